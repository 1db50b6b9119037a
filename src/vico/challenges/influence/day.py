"""One day of talk, ready to be played: two courtships, a ledger, and the community they happen in.

The ledger holds what was said to whom, what of it counts, and what members answered. Without a language model members
answer by lines from ``vico/data/challenges/influence/replies.toml``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from vico.agents.influence.main_agent import Courtship
from vico.agents.influence.member import Answer
from vico.agents.influence.situation import (
    BIG_FIVE,
    ROUNDS,
    TALKING_DISTANCE,
    Profile,
    Tie,
    day_plan_of,
    forms_of_address,
)
from vico.agents.influence.strategies import Asker, LanguageMember, make_strategy
from vico.challenges.influence.lexicon import GUIDE, words_of
from vico.challenges.influence.opinion import HeardMessage, OpinionModel
from vico.challenges.influence.tasks import Assignment, InfluenceSettings, InfluenceTask, strategies_of
from vico.community.model import Community
from vico.io.data_files import PACKAGED, DataRecord, cached_data, read_record
from vico.llm import Budget, Endpoint, LanguageModel
from vico.rules import LONGEST_TEXT
from vico.seeds import rng


def profiles_of(community: Community) -> list[Profile]:
    """Return what may be known of each resident, in the community's order."""
    ties: dict[str, list[Tie]] = {resident.id: [] for resident in community.residents}
    for relation in community.relations:
        first, second = relation.between
        ties[first].append(Tie(second, str(relation.kind), relation.strength))
        ties[second].append(Tie(first, str(relation.kind), relation.strength))
    found = []
    for resident in community.residents:
        o, c, e, a, n = (float(getattr(resident.personality, name)) for name in BIG_FIVE)
        found.append(
            Profile(
                id=resident.id,
                name=resident.name,
                age=resident.age,
                occupation=resident.occupation,
                values=tuple(resident.values),
                five=(o, c, e, a, n),
                traits=tuple(resident.personality.traits),
                hobbies=tuple(resident.hobbies),
                groups=tuple(group.name for group in community.groups_of(resident.id)),
                ties=tuple(ties[resident.id]),
                lifestyle=resident.lifestyle,
                biography=resident.biography,
            )
        )
    return found


NonEmptyLines = Annotated[tuple[str, ...], Field(min_length=1)]


class ReplyLines(DataRecord):
    """Lines by what they say; in braces {you}, {rival} and {dear}."""

    warm: NonEmptyLines
    neutral: NonEmptyLines
    cool: NonEmptyLines
    stands_with_you: NonEmptyLines
    stands_with_rival: NonEmptyLines
    undecided: NonEmptyLines
    on_the_way: NonEmptyLines
    enough: NonEmptyLines


@cached_data
def reply_lines() -> ReplyLines:
    """Return the lines.

    Raises
    ------
    SchemaError
        If the file is not as it should be.
    """
    return read_record(PACKAGED / "challenges" / "influence" / "replies.toml", ReplyLines, guide=GUIDE)


def reply(kind: str, listener: Profile, speaker: Profile, rival: Profile, chance: np.random.Generator) -> str:
    """Return a line of a kind, as a listener says it to a speaker."""
    options: tuple[str, ...] = getattr(reply_lines(), kind)
    dear = [*listener.values, *listener.hobbies]
    line = options[int(chance.integers(len(options)))].format(
        you=speaker.first_name, rival=rival.first_name, dear=dear[int(chance.integers(len(dear)))] if dear else "people"
    )
    return line[0].upper() + line[1:]


#: Why what was said does not count; empty where it does.
Ignored = Literal["", "too far", "on the way", "enough", "day over"]

# After a pause of so many seconds another conversation begins.
PAUSE = 600.0
# Who thinks so nearly the same of two people calls it a draw.
_DRAW = 0.15


@dataclass(frozen=True)
class Utterance:
    """Something a main agent said to a member, and what came of it.

    Attributes
    ----------
    time
        Seconds of the day.
    ignored
        Why it does not count; empty where it does.
    """

    time: float
    speaker: str
    listener: str
    text: str
    answer: str
    conversation: int
    round: int
    ignored: Ignored


class Ledger:
    """Hears all that main agents say to members.

    A message is meant for the member whose name comes first in it, so that nobody can speak to all at once. It counts
    if it is said from within 2 m to a member who is not on the way somewhere, and is one of the first three of its
    conversation.

    Parameters
    ----------
    model
        What members think; tells how warmly they answer.
    address
        By id, the name by which a member is spoken to.
    seed
        Decides which words they answer with.
    ends
        When the day of talk is over, seconds of the day.
    language
        A language model that answers in members' stead; None: lines by the opinion model.
    """

    def __init__(
        self,
        model: OpinionModel,
        address: Mapping[str, str],
        *,
        seed: int,
        ends: float,
        language: LanguageMember | None = None,
    ) -> None:
        self.model, self.language = model, language
        self._seed, self._ends = seed, ends
        self._names = {member: words_of(address[member]) for member in model.members}
        self.utterances: list[Utterance] = []
        self.heard: list[HeardMessage] = []
        #: How each message in `heard` was received.
        self.receptions: list[float] = []

    def answers(self) -> dict[str, Answer]:
        """Return what each member says when spoken to, by id."""
        return {member: partial(self._answer, member) for member in self.model.members}

    def is_meant(self, member: str, text: str) -> bool:
        """Return whether a message is meant for a member: theirs is the first name in it."""
        words = words_of(text[:LONGEST_TEXT])
        places = {
            name: next((k for k in range(len(words) - len(spoken) + 1) if words[k : k + len(spoken)] == spoken), None)
            for name, spoken in self._names.items()
        }
        named = {name: at for name, at in places.items() if at is not None}
        # "Ada" and "Ada Berg" may begin at the same word: the longer name is meant.
        return bool(named) and member == min(named, key=lambda name: (named[name], -len(self._names[name])))

    def say(
        self, time: float, speaker: str, member: str, text: str, *, distance: float, on_the_way: bool
    ) -> str | None:
        """Take in what a main agent says to a member; return the answer, None for none.

        Parameters
        ----------
        time
            Seconds of the day.
        distance
            Between the two, metres.
        """
        text = text[:LONGEST_TEXT]
        conversation, number = self._place_of(time, speaker, member)
        ignored = self._reason_to_ignore(time, distance, on_the_way, number)
        message = HeardMessage(time, speaker, member, text, conversation, number)
        reception = self.model.reception(message, self.heard)
        answer = self._reply(message, ignored, reception)
        if ignored in ("", "enough"):
            self.heard.append(message)
            self.receptions.append(reception)
        self.utterances.append(Utterance(time, speaker, member, text, answer or "", conversation, number, ignored))
        return answer

    def record(self) -> list[dict[str, Any]]:
        """Return everything that was said, as plain data."""
        return [asdict(one) for one in self.utterances]

    def talks_of(self, member: str, speaker: str | None = None) -> list[dict[str, Any]]:
        """Return what was said to a member, and answered, as prompts show it."""
        return [
            {"speaker": one.speaker, "said": one.text, "answer": one.answer}
            for one in self.utterances
            if one.listener == member and not one.ignored and speaker in (None, one.speaker)
        ]

    def _answer(self, member: str, message: Mapping[str, Any], distance: float, on_the_way: bool) -> str | None:
        text = str(message["text"])
        if not self.is_meant(member, text):
            return None
        speaker, time = str(message["speaker"]), float(message["time"])
        return self.say(time, speaker, member, text, distance=distance, on_the_way=on_the_way)

    def _place_of(self, time: float, speaker: str, member: str) -> tuple[int, int]:
        """Return which conversation of the two this is, and which message of it, from 0."""
        last = next((one for one in reversed(self.heard) if (one.speaker, one.listener) == (speaker, member)), None)
        if last is None:
            return 0, 0
        if time - last.time > PAUSE:
            return last.conversation + 1, 0
        return last.conversation, last.round + 1

    def _reason_to_ignore(self, time: float, distance: float, on_the_way: bool, number: int) -> Ignored:
        if time > self._ends:
            return "day over"
        if distance > TALKING_DISTANCE:
            return "too far"
        if on_the_way:
            return "on the way"
        return "enough" if number >= ROUNDS else ""

    def _reply(self, message: HeardMessage, ignored: Ignored, reception: float) -> str | None:
        if ignored in ("too far", "day over"):
            return None
        listener, speaker = self.model.profiles[message.listener], self.model.profiles[message.speaker]
        rival = self.model.profiles[next(main for main in self.model.mains if main != speaker.id)]
        chance = rng(self._seed, "reply", listener.id, speaker.id, len(self.utterances))
        line = partial(reply, listener=listener, speaker=speaker, rival=rival, chance=chance)
        if ignored:
            return line("on_the_way" if ignored == "on the way" else "enough")
        if self.language is not None:
            told = self._ask_model(message, listener, speaker)
            if told is not None:
                return told
        words = line(self.model.tone(reception))
        return f"{words} {line(self._stance(message, rival, reception))}" if message.round == ROUNDS - 1 else words

    def _ask_model(self, message: HeardMessage, listener: Profile, speaker: Profile) -> str | None:
        assert self.language is not None
        said = [*self.talks_of(listener.id, speaker.id), {"speaker": speaker.id, "said": message.text, "answer": ""}]
        told = self.language.answer(listener, speaker, list(said))
        return None if told is None else told[:LONGEST_TEXT]

    def opinions(self, now: float, variant: str) -> dict[tuple[str, str], float]:
        """Return what members think after all that was said so far; see `OpinionModel.opinions`."""
        return self.model.opinions(self.heard, now=now, variant=variant, receptions=self.receptions)

    def _stance(self, message: HeardMessage, rival: Profile, reception: float) -> str:
        """Return which of the two a member stands with after a message, by the first variant."""
        heard, receptions = [*self.heard, message], [*self.receptions, reception]
        variant = self.model.variants[0]
        opinions = self.model.opinions(heard, now=message.time, variant=variant, receptions=receptions)
        ahead = opinions[message.listener, message.speaker] - opinions[message.listener, rival.id]
        return "undecided" if abs(ahead) < _DRAW else "stands_with_you" if ahead > 0 else "stands_with_rival"


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
    days = {resident.id: day_plan_of(resident.schedule) for resident in community.residents}
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
