"""One day of talk, ready to be played: two courtships, a ledger, and the community they happen in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from vico.agents.influence.courtship import Courtship
from vico.agents.influence.days import day_plan
from vico.agents.influence.language import Asker, LanguageMember
from vico.agents.influence.profiles import forms_of_address
from vico.agents.influence.strategies import make_strategy
from vico.challenges.influence.ledger import Ledger
from vico.challenges.influence.model import Assignment, InfluenceSettings, InfluenceTask, strategies_of
from vico.challenges.influence.opinion import OpinionModel
from vico.challenges.influence.profiles import profiles_of
from vico.community.model import Community
from vico.llm import Budget, Endpoint, LanguageModel

#: Makes what asks a language model, by what for: ``target``, ``dialogue`` or ``member``.
Models = Callable[[str], Asker]


@dataclass(frozen=True)
class Day:
    """What a day is played with.

    Attributes
    ----------
    courtships
        By the id of the character; the character of the method's first strategy is `ours`.
    """

    task: InfluenceTask
    community: Community
    courtships: dict[str, Courtship]
    ledger: Ledger
    ours: str

    @property
    def askers(self) -> list[Asker]:
        """Language models that take part."""
        found = [asker for one in self.courtships.values() for asker in one.strategy.askers]
        return found if self.ledger.language is None else [*found, self.ledger.language.asker]


def make_day(
    task: InfluenceTask,
    community: Community,
    method: str,
    settings: InfluenceSettings,
    assignment: Assignment,
    models: Models | None = None,
) -> Day:
    """Make a day of talk.

    Parameters
    ----------
    models
        Makes what asks a language model; those of the environment unless given, and only where one is needed.

    Raises
    ------
    InputError
        If a strategy is unknown, or a language model is needed and none is set.
    """
    models = models or models_of(settings)
    profiles = profiles_of(community)
    by_id = {profile.id: profile for profile in profiles}
    members = [by_id[member] for member in task.members]
    days = {resident.id: day_plan(resident.schedule) for resident in community.residents}
    first, second = task.mains
    names = strategies_of(method)
    played = dict(zip((first, second) if assignment == "first" else (second, first), names, strict=True))
    # A name that is shared with a main agent would be no trouble: only members are spoken to.
    address = forms_of_address(members)
    courtships = {
        main: Courtship(
            by_id[main],
            by_id[other],
            members,
            {member: days[member] for member in task.members},
            address,
            strategy=make_strategy(played[main], models),
            ends=task.ends,
            seed=task.seed,
        )
        for main, other in ((first, second), (second, first))
    }
    model = OpinionModel(profiles, task.mains, seed=task.seed)
    language = LanguageMember(models("member")) if settings.members == "llm" else None
    ledger = Ledger(model, address, seed=task.seed, ends=task.ends, language=language)
    return Day(task, community, courtships, ledger, first if assignment == "first" else second)


def models_of(settings: InfluenceSettings) -> Models:
    """Return what makes language models of the environment's endpoint; all share the episode's budget."""
    budget = Budget(tokens=settings.llm_tokens or None)
    wanted = {
        "target": settings.target_model,
        "dialogue": settings.dialogue_model,
        "member": settings.member_model,
    }

    def asker(purpose: str) -> Asker:
        endpoint = Endpoint.from_environment()
        name = wanted[purpose]
        return Asker(LanguageModel(replace(endpoint, model=name) if name else endpoint, budget=budget))

    return asker
