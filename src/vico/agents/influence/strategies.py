"""Strategies by name: a target choice and a dialogue; ``ours/nearest`` takes one from ours, the other from nearest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from vico.agents.influence.dialogues import (
    CommonGroundDialogue,
    KindWordsDialogue,
    OwnInterestsDialogue,
    RandomDialogue,
)
from vico.agents.influence.language import Asker, LanguageDialogue, LanguageTarget
from vico.agents.influence.situation import Dialogue, TargetChoice
from vico.agents.influence.targets import ExpectedGainTarget, NearestTarget, PersuadableTarget, RandomTarget
from vico.errors import InputError

TARGETS: dict[str, Callable[[], TargetChoice]] = {
    "random": RandomTarget,
    "nearest": NearestTarget,
    "persuadable": PersuadableTarget,
    "ours": ExpectedGainTarget,
}
DIALOGUES: dict[str, Callable[[], Dialogue]] = {
    "random": RandomDialogue,
    "nearest": OwnInterestsDialogue,
    "persuadable": KindWordsDialogue,
    "ours": CommonGroundDialogue,
}
#: The language model's strategy, and the offline one that decides where the model does not.
LLM = "llm"
FALLBACK = "nearest"
NAMES = (*TARGETS, LLM)


@dataclass(frozen=True)
class Strategy:
    """Whom to see, and what to say to them; `askers` are the language models behind it."""

    name: str
    target: TargetChoice
    dialogue: Dialogue
    askers: tuple[Asker, ...] = ()


def parts_of(name: str) -> tuple[str, str]:
    """Return the names of target choice and dialogue that a strategy's name stands for.

    Raises
    ------
    InputError
        If there are no such strategies.
    """
    parts = name.split("/")
    target, dialogue = (parts * 2)[:2]
    if len(parts) > 2 or target not in NAMES or dialogue not in NAMES:
        raise InputError(
            f"influence: no strategy {name!r}; there are {', '.join(NAMES)}, and two of them as TARGET/DIALOGUE"
        )
    return target, dialogue


def make_strategy(name: str, model: Callable[[str], Asker] | None = None) -> Strategy:
    """Return a strategy.

    Parameters
    ----------
    model
        Makes what asks a language model, for ``"target"`` or ``"dialogue"``; needed by ``llm`` alone.

    Raises
    ------
    InputError
        If there is no such strategy, or a model is needed and there is none.
    """
    target, dialogue = parts_of(name)
    if LLM in (target, dialogue) and model is None:
        raise InputError(f"influence: {name!r} needs a language model; set VICO_LLM_BASE_URL and VICO_LLM_MODEL")
    askers: list[Asker] = []

    def asker(purpose: str) -> Asker:
        assert model is not None
        askers.append(model(purpose))
        return askers[-1]

    chooses: TargetChoice = LanguageTarget(asker("target"), TARGETS[FALLBACK]()) if target == LLM else TARGETS[target]()
    speaks: Dialogue = (
        LanguageDialogue(asker("dialogue"), DIALOGUES[FALLBACK]()) if dialogue == LLM else DIALOGUES[dialogue]()
    )
    return Strategy(name, chooses, speaks, tuple(askers))
