"""Which challenges there are: by name, loaded when they are asked for."""

from __future__ import annotations

import importlib
from typing import cast

from vico.agents.model_access import model_from_environment
from vico.challenges.records import Challenge
from vico.errors import InputError, line_of, sentence_of

#: Name -> where its object is: ``module:OBJECT``.
CHALLENGES = {
    "assistant": "vico.challenges.assistant.challenge:ASSISTANT",
    "commute": "vico.challenges.commute.challenge:COMMUTE",
    "influence": "vico.challenges.influence:INFLUENCE",
    "robot": "vico.challenges.robot.challenge:ROBOT",
    "teaming": "vico.challenges.teaming.challenge:TEAMING",
}
#: The method, of any challenge, that asks a language model.
ASKS_A_MODEL = "llm"
_NEEDED = ("name", "categories", "methods", "metrics", "causes", "task", "play")


def load_challenge(name: str) -> Challenge:
    """Return a challenge by its name, or as ``my_module:MY_CHALLENGE``.

    Raises
    ------
    InputError
        If there is none of that name, it can't be imported, or it is no challenge.
    """
    module, _, attribute = CHALLENGES.get(name, name).partition(":")
    if not attribute:
        raise InputError(f"no challenge called {name!r}; there are {', '.join(CHALLENGES)}, or my_module:MY_CHALLENGE")
    try:
        found = getattr(importlib.import_module(module), attribute, None)
    except ModuleNotFoundError as error:
        if error.name is None or not (module == error.name or module.startswith(f"{error.name}.")):
            raise
        raise InputError(f"challenge {name}: there is no module {error.name}; this version does not have it") from None
    except Exception as error:
        raise InputError(f"challenge {name}: cannot be imported: {sentence_of(error)} at {line_of(error)}") from None
    if found is None:
        raise InputError(f"challenge {name}: {module} has no {attribute}; this version does not have it")
    lacking = [part for part in _NEEDED if not hasattr(found, part)]
    if lacking:
        raise InputError(f"challenge {name}: {module}:{attribute} has no {lacking[0]}; see vico.challenges.records")
    return cast(Challenge, found)


def check_methods(challenge: Challenge, methods: list[str]) -> None:
    """Make sure that every method is one of a challenge's, agents from elsewhere, or two of these joined by ``+``.

    Raises
    ------
    InputError
        If one is not; the message names those there are. And if one asks a language model, and none is named.
    """
    for method in methods:
        for part in parts_of(method):
            if part == ASKS_A_MODEL and part in challenge.methods:
                model_from_environment(method=part)  # before anything is drawn or played
            if part not in challenge.methods and ":" not in part:
                raise InputError(
                    f"{challenge.name}: no method called {part!r}; there are {', '.join(sorted(challenge.methods))}, "
                    "my_module:MyAgent, or two of these joined by +"
                )
    if len(set(methods)) < len(methods):
        raise InputError(f"{challenge.name}: a method is given twice; name each once")


def parts_of(method: str) -> list[str]:
    """Return the one or two methods that a method's name stands for."""
    return method.split("+")


def foreign_parts(challenge: Challenge, method: str) -> list[str]:
    """Return those of them that are agents from elsewhere."""
    return [part for part in parts_of(method) if part not in challenge.methods]
