"""Strategies of main agents: whom to see next and what to say, offline or by a language model.

A strategy has a target choice and a dialogue; ``ours/nearest`` takes one from ours, the other from nearest. All offline
choices know the same: profiles, days, one's own conversations. All offline dialogues draw on the same lines, read from
``vico/data/agents/influence/lines*.toml``; they differ in which they choose for whom.

A language model that cannot be reached, refuses, or answers with garbage never ends a run: what it should have decided
is decided by the offline part that was named for it, and that is counted and told.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from vico.agents.influence.situation import Dialogue, PlannedStay, Profile, Situation, Talk, TargetChoice
from vico.clock import clock_of
from vico.errors import EmptyInputError, InputError, LlmBudgetError, SourceError, VicoError, sentence_of
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.llm import LanguageModel, Message, Reply, Usage
from vico.llm.prompts import read_prompt

# Those who have just been talked with are left in peace for so long, seconds, by all offline choices.
REVISIT_PAUSE = 1800.0


def _not_just_met(situation: Situation, members: dict[str, float]) -> dict[str, float]:
    """Return those with whom one has not just talked."""
    last = {talk.target: talk.began for talk in situation.talks}
    return {m: s for m, s in members.items() if situation.time - last.get(m, -math.inf) > REVISIT_PAUSE}


class RandomTarget:
    """Anybody who can be met."""

    def choose(self, situation: Situation, chance: np.random.Generator) -> str | None:
        """Return a member drawn at random."""
        options = sorted(_not_just_met(situation, situation.reachable()))
        return options[int(chance.integers(len(options)))] if options else None


class NearestTarget:
    """Who is nearest on foot."""

    def choose(self, situation: Situation, chance: np.random.Generator) -> str | None:
        """Return the member with the shortest way."""
        options = _not_just_met(situation, situation.reachable())
        return min(options, key=lambda m: (options[m], m)) if options else None


class PersuadableTarget:
    """Who is the easiest to win over by character, among those talked with least."""

    def choose(self, situation: Situation, chance: np.random.Generator) -> str | None:
        """Return the most open and agreeable member."""
        options = _not_just_met(situation, situation.reachable())

        def key(member: str) -> tuple[int, float, str]:
            profile = situation.members[member]
            ease = profile.trait("openness") + profile.trait("agreeableness")
            return len(situation.talks_with(member)), -ease, member

        return min(options, key=key) if options else None


class ExpectedGainTarget:
    """Ours: the largest expected gain for the time it takes, by where everybody will be.

    It guesses from profiles and from what members said who is undecided, how much there is to talk about, and how much
    a further conversation is still worth; it knows when members will be where, also those who will only come later.
    Everybody is seen once as soon as may be, and again towards the end of the day: what was said last is remembered.
    """

    # Guesses, not the model's numbers: what a tie or something shared is worth, how undecided reads as a distance, how
    # much less each further conversation brings, and the seconds a conversation takes.
    _VALUE, _HOBBY, _GROUP, _TIE, _LIKENESS = 0.5, 0.3, 0.3, 0.8, 0.5
    _UNDECIDED = 1.2
    _FURTHER = (1.0, 0.8)
    _TALK = 45.0
    # From how many hours before the end on a conversation after so many others is held.
    _FROM = (math.inf, 2.0)
    # A meeting so much before the end of a stay is sure enough, and one does not wait longer than this, seconds.
    _SURE, _PATIENCE = 90.0, 900.0

    def choose(self, situation: Situation, chance: np.random.Generator) -> str | None:
        """Return the member with the best rate of expected gain; None if waiting is better than all."""
        best: tuple[float, str] | None = None
        for member in sorted(situation.members):
            if situation.not_before.get(member, 0.0) > situation.time:
                continue
            wait = self.seconds_until_met(situation, member)
            if wait is None:
                continue
            rate = self.gain(situation, member) / (wait + self._TALK)
            if best is None or rate > best[0]:
                best = rate, member
        return None if best is None or best[0] <= 0.0 else best[1]

    def seconds_until_met(self, situation: Situation, member: str) -> float | None:
        """Return how soon a member can be talked with, seconds; None for not today, or not soon."""
        for stay in situation.days[member].chances(situation.time, situation.ends):
            ready = self._met_at(situation, stay)
            if ready is None:
                continue
            return ready - situation.time if ready - situation.time <= self._PATIENCE else None
        return None

    def _met_at(self, situation: Situation, stay: PlannedStay) -> float | None:
        assert stay.place is not None
        there = situation.time + situation.seconds_to(stay.place)
        ready = max(there, stay.start + self._SURE if stay.start > situation.time else there)
        return ready if ready + self._SURE < min(stay.end, situation.ends) else None

    def gain(self, situation: Situation, member: str) -> float:
        """Return what a conversation with a member is expected to be worth; 0 for one that has its time later."""
        talks = situation.talks_with(member)
        if talks and situation.time - talks[-1].began < REVISIT_PAUSE:
            return 0.0
        hours_left = (situation.ends - situation.time) / 3600.0
        if len(talks) >= len(self._FURTHER) or hours_left > self._FROM[len(talks)]:
            return 0.0
        further = self._FURTHER[len(talks)]
        margin = self.margin(situation, member)
        undecided = math.exp(-((margin / self._UNDECIDED) ** 2))
        listener = situation.members[member]
        ease = 0.6 + 0.4 * listener.trait("openness") + 0.4 * listener.trait("agreeableness")
        return further * undecided * ease * (0.5 + self.common_ground(situation.me, listener))

    def margin(self, situation: Situation, member: str) -> float:
        """Return a guess of how far a member prefers one to the rival; what they said last counts most."""
        listener = situation.members[member]
        guess = self.closeness(listener, situation.me) - self.closeness(listener, situation.rival)
        for talk in situation.talks_with(member):
            told = stated_preference(talk, situation.rival)
            guess = guess if told is None else told
        return guess

    def closeness(self, listener: Profile, other: Profile) -> float:
        """Return a guess of what a listener thinks of somebody they have not talked with."""
        likeness = 1.0 - sum(abs(a - b) for a, b in zip(listener.five, other.five, strict=True)) / len(listener.five)
        ground = self.common_ground(other, listener)
        return ground + self._TIE * listener.tie_to(other.id) + self._LIKENESS * likeness

    def common_ground(self, speaker: Profile, listener: Profile) -> float:
        """Return how much two have in common."""
        ranked = [self._VALUE / (k + 1) for k, value in enumerate(listener.values) if value in speaker.values]
        hobbies = self._HOBBY * len(set(listener.hobbies) & set(speaker.hobbies))
        return sum(ranked) + hobbies + self._GROUP * bool(set(listener.groups) & set(speaker.groups))


def stated_preference(talk: Talk, rival: Profile) -> float | None:
    """Return how far a member said that they prefer one to the rival, -0.5..0.5; None if they said nothing of it."""
    if not talk.answers:
        return None
    text = talk.answers[-1].lower()
    if rival.first_name.lower() in text:
        torn = any(word in text for word in ("could not say", "about the same", "not sure", "both"))
        return 0.0 if torn else -0.4
    return 0.5 if any(word in text for word in ("your side", "my friends", "be friends", "a friend")) else None


GUIDE = "docs/influence.md"


class ValueLines(DataRecord):
    """Lines about a value: of who shares it with the listener, and of who knows that they hold it."""

    name: str
    shared: tuple[str, ...]
    theirs: tuple[str, ...]


class TopicLines(DataRecord):
    """Lines about any hobby, or any group."""

    shared: tuple[str, ...] = ()
    theirs: tuple[str, ...] = ()
    own: tuple[str, ...] = ()


class EndingLines(DataRecord):
    """How a message ends, by what the listener is like."""

    outgoing: tuple[str, ...] = ()
    open: tuple[str, ...] = ()
    careful: tuple[str, ...] = ()
    anxious: tuple[str, ...] = ()
    reserved: tuple[str, ...] = ()
    plain: tuple[str, ...] = ()


class KindWords(DataRecord):
    """Friendly words that fit everybody."""

    general: tuple[str, ...] = ()


class Lines(DataRecord):
    """A file of lines; those of a user add to those of the package."""

    openings: tuple[str, ...] = ()
    value: tuple[ValueLines, ...] = ()
    hobby: TopicLines = TopicLines()
    group: TopicLines = TopicLines()
    endings: EndingLines = EndingLines()
    kind_words: KindWords = Field(default_factory=KindWords)

    @property
    def values(self) -> dict[str, ValueLines]:
        """Lines by value."""
        return {value.name: value for value in self.value}


@cached_data
def read_lines() -> Lines:
    """Return all lines there are.

    Raises
    ------
    SchemaError
        If a file is not as it should be.
    EmptyInputError
        If nothing is there to open a conversation with.
    """
    files = [read_record(path, Lines, guide=GUIDE) for path in data_files("agents/influence", "lines")]
    found = Lines(
        openings=tuple(line for file in files for line in file.openings),
        value=tuple(value for file in files for value in file.value),
        hobby=_join_topic_lines([file.hobby for file in files]),
        group=_join_topic_lines([file.group for file in files]),
        endings=EndingLines(
            **{
                name: tuple(line for f in files for line in getattr(f.endings, name))
                for name in EndingLines.model_fields
            }
        ),
        kind_words=KindWords(general=tuple(line for file in files for line in file.kind_words.general)),
    )
    if not (found.openings and found.kind_words.general and found.endings.plain):
        raise EmptyInputError(f"influence lines: openings, kind words or plain endings are missing; see {GUIDE}")
    return found


def _join_topic_lines(parts: list[TopicLines]) -> TopicLines:
    return TopicLines(**{name: tuple(s for p in parts for s in getattr(p, name)) for name in TopicLines.model_fields})


def _one_of(options: Sequence[str], chance: np.random.Generator) -> str:
    return options[int(chance.integers(len(options)))]


def _group_word(group: str) -> str:
    """Return a group's name without its place, as one says it."""
    name = group.split(" at ")[0]
    return name[0].lower() + name[1:]


class RandomDialogue:
    """Any line about anything, whoever listens."""

    def say(self, situation: Situation, talk: Talk, chance: np.random.Generator) -> str | None:
        """Return a line drawn at random."""
        known = read_lines()
        options = [line for value in known.value for line in (*value.shared, *value.theirs)]
        everybody = [situation.me, *situation.members.values()]
        hobbies = sorted({hobby for profile in everybody for hobby in profile.hobbies})
        options += [_one_of(known.hobby.own, chance).format(hobby=hobby) for hobby in hobbies]
        return f"{_one_of(known.openings, chance)} {_one_of(options, chance)}" if options else None


class OwnInterestsDialogue:
    """Talks about oneself: one's own values, hobbies and groups, whoever listens."""

    def say(self, situation: Situation, talk: Talk, chance: np.random.Generator) -> str | None:
        """Return the next thing about oneself; once all was told, some of it again."""
        known, me = read_lines(), situation.me
        told = [line for value in me.values if value in known.values for line in known.values[value].shared]
        told += [line.format(hobby=hobby) for hobby in me.hobbies for line in known.hobby.own]
        told += [line.format(group=_group_word(group)) for group in me.groups for line in known.group.own]
        before = [text for one in situation.talks_with(talk.target) for text in one.said]
        new = [line for line in told if not any(line in text for text in before)]
        return f"{_one_of(new or told, chance)} {_one_of(known.endings.plain, chance)}" if told else None


class KindWordsDialogue:
    """Friendly words and something about what the listener likes, by their profile's first entries."""

    def say(self, situation: Situation, talk: Talk, chance: np.random.Generator) -> str | None:
        """Return kind words in the first round, then a hobby, then the value that is dearest to them."""
        known, listener = read_lines(), situation.members[talk.target]
        number = len(talk.said)
        kind = _one_of(known.kind_words.general, chance)
        if number == 0 or not listener.hobbies:
            return f"{_one_of(known.openings, chance)} {kind}"
        if number == 1:
            hobby = listener.hobbies[len(situation.talks_with(talk.target)) % len(listener.hobbies)]
            return f"{_one_of(known.hobby.theirs, chance).format(hobby=hobby)} {_one_of(known.endings.plain, chance)}"
        value = known.values.get(listener.values[0]) if listener.values else None
        return f"{_one_of(value.theirs, chance)}" if value is not None and value.theirs else kind


class CommonGroundDialogue:
    """Ours: what speaker and listener share, dearest to the listener first, in a manner that suits them, never twice.

    Each message takes up what the member answered to, brings one or two things that were not said yet, and ends as
    the listener's character asks for. Who has nothing new to say ends the conversation.
    """

    _TOPICS = 2

    def say(self, situation: Situation, talk: Talk, chance: np.random.Generator) -> str | None:
        """Return the next message."""
        known, listener = read_lines(), situation.members[talk.target]
        before = [text for one in situation.talks_with(talk.target) for text in one.said]
        fresh = [
            options
            for options in self.topics(known, situation.me, listener)
            if not any(line in text for line in options for text in before)
        ]
        if not fresh:
            fresh = self._second_lines(known, situation.me, listener, before)
        if not fresh:
            return None
        # Lines that somebody else heard already would sound like a speech: others first.
        spoken = " ".join(text for one in situation.talks for text in one.said)
        chosen = []
        for options in fresh[: self._TOPICS]:
            new = [line for line in options if line not in spoken]
            chosen.append(_one_of(new or list(options), chance))
        return " ".join([*chosen, self._ending(known, listener, len(before))])

    def topics(self, known: Lines, me: Profile, listener: Profile) -> list[list[str]]:
        """Return lines by topic, the dearest to the listener first; what is shared before what is theirs alone."""
        ranked: list[tuple[float, list[str]]] = []
        for rank, name in enumerate(listener.values):
            if name in known.values:
                value, is_shared = known.values[name], name in me.values
                ranked.append((rank + (0.0 if is_shared else 1.5), list(value.shared if is_shared else value.theirs)))
        for hobby in listener.hobbies:
            is_shared = hobby in me.hobbies
            options = known.hobby.shared if is_shared else known.hobby.theirs
            ranked.append((1.0 if is_shared else 2.2, [line.format(hobby=hobby) for line in options]))
        for group in listener.groups:
            is_shared = group in me.groups
            options = known.group.shared if is_shared else known.group.theirs
            ranked.append((1.2 if is_shared else 2.4, [line.format(group=_group_word(group)) for line in options]))
        return [options for _, options in sorted(ranked, key=lambda one: one[0]) if options]

    def _second_lines(self, known: Lines, me: Profile, listener: Profile, before: Sequence[str]) -> list[list[str]]:
        """Return what is still unsaid about topics that came up already."""
        unsaid = [
            [line for line in options if not any(line in text for text in before)]
            for options in self.topics(known, me, listener)
        ]
        return [options for options in unsaid if options]

    def _ending(self, known: Lines, listener: Profile, number: int) -> str:
        """Return how to end: by the traits that stand out most in the listener, a different one each time."""
        endings = known.endings
        liked = [
            (listener.trait("extraversion") - 0.5, endings.outgoing),
            (listener.trait("openness") - 0.5, endings.open),
            (listener.trait("conscientiousness") - 0.55, endings.careful),
            (listener.trait("neuroticism") - 0.5, endings.anxious),
            (0.5 - listener.trait("extraversion"), endings.reserved),
        ]
        options = [one for _, some in sorted(liked, key=lambda pair: -pair[0])[:2] for one in some] or list(
            endings.plain
        )
        return options[number % len(options)]


#: So many characters of a message are said; the rest is cut off at a word.
MAX_MESSAGE = 600
#: After so many failures in a row that lie with the server or the budget a model is not asked again.
MAX_FAILURES = 3

T = TypeVar("T", bound=BaseModel)


class TargetReply(BaseModel):
    """Whom to see next."""

    model_config = ConfigDict(extra="forbid")
    member: str = Field(description="Id of one of those listed.")


class MessageReply(BaseModel):
    """What to say."""

    model_config = ConfigDict(extra="forbid")
    message: str = Field(min_length=1, max_length=2000)


class RankingReply(BaseModel):
    """Who is liked better, and why."""

    model_config = ConfigDict(extra="forbid")
    friend: str = Field(description="Id of one of the two.")
    reason: str = ""


class ChatModel(Protocol):
    """What is needed of `vico.llm.LanguageModel`."""

    def ask(
        self, messages: list[Message], reply: type[T], *, check: Callable[[T], list[str]] | None = None
    ) -> Reply[T]:
        """Ask for a record."""


class Asker:
    """Asks a model, counts what that takes and how often nothing came of it.

    Attributes
    ----------
    usage
        What was used.
    fallbacks
        How often an offline part had to decide.
    reasons
        Why, the first time for each kind of error.
    """

    def __init__(self, model: ChatModel | LanguageModel) -> None:
        self._model = model
        self._failed = 0
        self.usage = Usage()
        self.fallbacks = 0
        self.reasons: list[str] = []

    def ask(self, name: str, reply: type[T], check: Callable[[T], list[str]] | None = None, **inputs: Any) -> T | None:
        """Return a record for a prompt; None where an offline part has to decide."""
        if self._failed >= MAX_FAILURES:
            self.fallbacks += 1
            return None
        try:
            answer = self._model.ask(read_prompt("influence", name, reply).messages(**inputs), reply, check=check)
        except VicoError as error:
            self._failed = self._failed + 1 if isinstance(error, (SourceError, LlmBudgetError)) else 0
            self.fallbacks += 1
            kind = type(error).__name__
            if not any(reason.startswith(kind) for reason in self.reasons):
                self.reasons.append(f"{sentence_of(error)} ({name})")
            return None
        self._failed = 0
        self.usage += answer.usage
        return answer.value


def public_profile(profile: Profile) -> dict[str, Any]:
    """Return a profile as prompts show it."""
    return {
        "id": profile.id,
        "name": profile.name,
        "age": profile.age,
        "occupation": profile.occupation,
        "values": list(profile.values),
        "traits": list(profile.traits),
        "hobbies": list(profile.hobbies),
        "groups": list(profile.groups),
        "lifestyle": profile.lifestyle,
        "biography": profile.biography[:1200],
    }


class LanguageTarget:
    """Asks a model whom to see next."""

    def __init__(self, asker: Asker, fallback: TargetChoice) -> None:
        self.asker, self.fallback = asker, fallback

    def choose(self, situation: Situation, chance: np.random.Generator) -> str | None:
        """Return the model's choice among those who can be met; the fallback's where there is none."""
        options = situation.reachable()
        if not options:
            return None

        def check(reply: TargetReply) -> list[str]:
            known = ", ".join(options)
            return [] if reply.member in options else [f"{reply.member[:40]!r} can't be met now; take one of {known}"]

        listed = []
        for member, seconds in options.items():
            stay = situation.days[member].at(situation.time)
            talks = [talk.record() for talk in situation.talks_with(member)]
            about = {"walk_seconds": round(seconds), "stays_seconds": round(stay.end - situation.time), "talks": talks}
            listed.append(public_profile(situation.members[member]) | about | {"does": stay.activity})
        reply = self.asker.ask(
            "choose_target",
            TargetReply,
            check,
            time=clock_of(int(situation.time))[:5],
            ends=clock_of(int(situation.ends))[:5],
            me=public_profile(situation.me),
            rival=public_profile(situation.rival),
            members=listed,
        )
        return self.fallback.choose(situation, chance) if reply is None else reply.member


class LanguageDialogue:
    """Asks a model what to say."""

    def __init__(self, asker: Asker, fallback: Dialogue) -> None:
        self.asker, self.fallback = asker, fallback

    def say(self, situation: Situation, talk: Talk, chance: np.random.Generator) -> str | None:
        """Return the model's words; the fallback's where there are none."""
        me, listener = public_profile(situation.me), public_profile(situation.members[talk.target])
        talks = [one.record() for one in situation.talks_with(talk.target)]
        if talk.said:
            reply = self.asker.ask("next_message", MessageReply, me=me, listener=listener, said=talks)
        else:
            reply = self.asker.ask("first_message", MessageReply, me=me, listener=listener, earlier=talks)
        return self.fallback.say(situation, talk, chance) if reply is None else shorten(reply.message)


class LanguageMember:
    """Asks a model what a member answers, and how they rank the two."""

    def __init__(self, asker: Asker) -> None:
        self.asker = asker

    def answer(self, me: Profile, speaker: Profile, said: list[Mapping[str, Any]]) -> str | None:
        """Return what a member answers; None where an offline part has to."""
        reply = self.asker.ask(
            "member_reply", MessageReply, me=public_profile(me), speaker=public_profile(speaker), said=said
        )
        return None if reply is None else shorten(reply.message)

    def friend(self, me: Profile, mains: list[Profile], said: list[Mapping[str, Any]]) -> str | None:
        """Return the id of the main agent whom a member likes better; None where an offline part has to say."""
        ids = [main.id for main in mains]

        def check(reply: RankingReply) -> list[str]:
            return [] if reply.friend in ids else [f"{reply.friend[:40]!r} is none of the two: {', '.join(ids)}"]

        shown = [public_profile(main) for main in mains]
        reply = self.asker.ask("member_ranking", RankingReply, check, me=public_profile(me), mains=shown, said=said)
        return None if reply is None else reply.friend


def shorten(text: str, longest: int = MAX_MESSAGE) -> str:
    """Return a text in one line, cut off at a word where it is too long."""
    line = " ".join(text.split())
    return line if len(line) <= longest else line[: longest + 1].rsplit(" ", 1)[0][:longest]


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
LLM_NAME = "llm"
FALLBACK_NAME = "nearest"
PART_NAMES = (*TARGETS, LLM_NAME)


@dataclass(frozen=True)
class Strategy:
    """Whom to see, and what to say to them; `askers` are the language models behind it."""

    name: str
    target: TargetChoice
    dialogue: Dialogue
    askers: tuple[Asker, ...] = ()


def split_strategy_name(name: str) -> tuple[str, str]:
    """Return the names of target choice and dialogue that a strategy's name stands for.

    Raises
    ------
    InputError
        If there are no such strategies.
    """
    parts = name.split("/")
    target, dialogue = (parts * 2)[:2]
    if len(parts) > 2 or target not in PART_NAMES or dialogue not in PART_NAMES:
        raise InputError(
            f"influence: no strategy {name!r}; there are {', '.join(PART_NAMES)}, and two of them as TARGET/DIALOGUE"
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
    target, dialogue = split_strategy_name(name)
    if LLM_NAME in (target, dialogue) and model is None:
        raise InputError(f"influence: {name!r} needs a language model; set VICO_LLM_BASE_URL and VICO_LLM_MODEL")
    askers: list[Asker] = []

    def asker(purpose: str) -> Asker:
        assert model is not None
        askers.append(model(purpose))
        return askers[-1]

    chooses: TargetChoice = (
        LanguageTarget(asker("target"), TARGETS[FALLBACK_NAME]()) if target == LLM_NAME else TARGETS[target]()
    )
    speaks: Dialogue = (
        LanguageDialogue(asker("dialogue"), DIALOGUES[FALLBACK_NAME]())
        if dialogue == LLM_NAME
        else DIALOGUES[dialogue]()
    )
    return Strategy(name, chooses, speaks, tuple(askers))
