"""The opinion model: how members take a message, and what they think of the main agents over a day.

Its numbers are read from ``vico/data/challenges/influence/opinion.toml``; docs/influence.md explains each.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Annotated, Literal

from pydantic import Field

from vico.agents.influence.situation import Profile
from vico.challenges.influence.lexicon import GUIDE, Lexicon, Reading, Topic, lexicon_files
from vico.errors import InputError
from vico.io.data_files import PACKAGED, DataRecord, cached_data, read_record
from vico.seeds import rng

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
NotPositive = Annotated[float, Field(le=0.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]

_CONSTANTS_FILE = PACKAGED / "challenges" / "influence" / "opinion.toml"


class PriorConstants(DataRecord):
    """What is felt before any talk; `chance` is a standard deviation."""

    values: NotNegative
    hobbies: NotNegative
    group: NotNegative
    ties: NotNegative
    similarity: NotNegative
    chance: NotNegative


class MessageConstants(DataRecord):
    """How well a message is received."""

    value: Annotated[tuple[Positive, ...], Field(min_length=1)]
    hobby: Positive
    group: Positive
    other: NotPositive
    opposed: NotPositive
    common: Annotated[float, Field(ge=1.0)]
    unbacked: Share
    attention: Positive
    words_a_topic: Positive
    longest: Positive
    repeated: Share
    same_words: Share
    annoyance: NotPositive
    canned: Share
    appeals: Annotated[int, Field(ge=0)]
    flattery: NotNegative
    flattered_again: NotPositive
    pressure: NotPositive
    boasting: NotPositive


class ListenerConstants(DataRecord):
    """How a listener takes it."""

    base: Positive
    openness: NotNegative
    agreeableness: NotNegative
    hurt: NotNegative
    contact: NotNegative
    rounds: Annotated[int, Field(ge=1)]
    conversations: Annotated[int, Field(ge=1)]
    tired: Share


class ReplyConstants(DataRecord):
    """From which reception on a reply is warm, and below which it is cool."""

    warm: float
    cool: float


class SumForm(DataRecord):
    """Receptions add up, up to `most`, and fade with a half-life in hours."""

    name: str
    form: Literal["sum"]
    scale: Positive
    most: Positive
    half_life: Positive


class AverageForm(DataRecord):
    """Receptions are averaged with what was felt before; the older ones weigh less."""

    name: str
    form: Literal["average"]
    scale: Positive
    prior_weight: Positive
    message_weight: Positive
    forgetting: NotNegative


class SocialForm(DataRecord):
    """Receptions move an opinion the less the farther it has gone; at day's end friends' opinions are heard."""

    name: str
    form: Literal["social"]
    scale: Positive
    most: Positive
    half_life: Positive
    listens_to_friends: Share


Variant = SumForm | AverageForm | SocialForm


class OpinionConstants(DataRecord):
    """All numbers of the model."""

    prior: PriorConstants
    message: MessageConstants
    listener: ListenerConstants
    reply: ReplyConstants
    variant: tuple[Annotated[Variant, Field(discriminator="form")], ...]


@cached_data
def opinion_constants() -> OpinionConstants:
    """Return the numbers. They are the package's alone: results could not be compared otherwise.

    Raises
    ------
    SchemaError
        If the file is not as it should be.
    """
    return read_record(_CONSTANTS_FILE, OpinionConstants, guide=GUIDE)


@cached_data
def opinion_digest() -> str:
    """Return the first 12 hex digits of the file's SHA-256, to name in results."""
    return sha256(_CONSTANTS_FILE.read_bytes()).hexdigest()[:12]


@dataclass(frozen=True)
class HeardMessage:
    """A message that a member listened to.

    Attributes
    ----------
    time
        Seconds of the day.
    conversation, round
        Which of the speaker's conversations with the listener it belongs to, and which message of it, both from 0.
    """

    time: float
    speaker: str
    listener: str
    text: str
    conversation: int
    round: int


class MessageReceiver:
    """Judges messages as their listeners do.

    Parameters
    ----------
    profiles
        Of all who take part, by id.
    """

    def __init__(self, lexicon: Lexicon, constants: OpinionConstants, profiles: dict[str, Profile]) -> None:
        self._lexicon, self._constants, self._profiles = lexicon, constants, profiles

    def reception(self, message: HeardMessage, before: Sequence[HeardMessage]) -> float:
        """Return how well a message is received: about -1..1, 0 leaves the listener indifferent.

        Parameters
        ----------
        before
            What was said earlier, to anybody, in the order of time.
        """
        numbers = self._constants.message
        reading = self._lexicon.read(message.text)
        listener = self._profiles[message.listener]
        mine = [one for one in before if (one.speaker, one.listener) == (message.speaker, message.listener)]
        told = [self._lexicon.read(one.text) for one in mine]
        if any(is_same(reading, other, numbers.same_words) for other in told):
            return numbers.annoyance
        fit = self._fit(reading, self._profiles[message.speaker], listener, told)
        liking = max(0.2, 1.0 + self._liking(reading, listener))
        if fit <= 0.0:
            return fit / liking + self._manners(reading, listener, told)
        fit *= liking * _length_factor(reading, numbers)
        if self._is_canned(message, reading, before):
            fit *= numbers.canned
        return fit + self._manners(reading, listener, told)

    def _fit(self, reading: Reading, speaker: Profile, listener: Profile, told: Sequence[Reading]) -> float:
        """Return how the topics fit the listener, -1..1: what is beyond the attention span thins out the rest."""
        numbers = self._constants.message
        if not reading.topics:
            return 0.0
        share = min(1.0, numbers.attention / len(reading.topics))
        total = 0.0
        for topic in reading.topics:
            worth = self._worth(topic, speaker, listener)
            raised = sum(topic in other.topics for other in told)
            total += share * (worth * numbers.repeated**raised if worth > 0.0 else worth)
        return total / (numbers.attention * numbers.common)

    def _worth(self, topic: Topic, speaker: Profile, listener: Profile) -> float:
        """Return what a topic is worth to a listener, from a speaker."""
        numbers = self._constants.message
        if topic.kind == "value":
            if topic.name not in listener.values:
                first = listener.values[0] if listener.values else ""
                is_opposed = first in self._lexicon.opposed.get(topic.name, ())
                return numbers.opposed if is_opposed else numbers.other
            rank = min(listener.values.index(topic.name), len(numbers.value) - 1)
            factor = numbers.common if topic.name in speaker.values else numbers.unbacked
            return numbers.value[rank] * factor
        theirs, own = (
            (listener.hobbies, speaker.hobbies) if topic.kind == "hobby" else (listener.groups, speaker.groups)
        )
        if topic.name not in theirs:
            return numbers.other
        worth = numbers.hobby if topic.kind == "hobby" else numbers.group
        return worth * (numbers.common if topic.name in own else 1.0)

    def _liking(self, reading: Reading, listener: Profile) -> float:
        """Return what the listener thinks of the appeals a message makes: the few they like best."""
        found = []
        for name in reading.appeals:
            appeal = self._lexicon.appeals[name]
            found.append(appeal.base + sum(w * (listener.trait(t) - 0.5) for t, w in appeal.appetite.items()))
        return sum(sorted(found, reverse=True)[: self._constants.message.appeals])

    def _manners(self, reading: Reading, listener: Profile, told: Sequence[Reading]) -> float:
        """Return what flattery, pressure and boasting do, whatever the topics."""
        numbers, total = self._constants.message, 0.0
        if reading.flattery:
            again = any(other.flattery for other in told)
            total += numbers.flattered_again if again else numbers.flattery * listener.trait("agreeableness")
        if reading.pressure:
            total += numbers.pressure * (1.3 - listener.trait("agreeableness"))
        return total + (numbers.boasting if reading.boasting else 0.0)

    def _is_canned(self, message: HeardMessage, reading: Reading, before: Sequence[HeardMessage]) -> bool:
        """Return whether somebody the listener knows was told the same by the same speaker."""
        known = {tie.other for tie in self._profiles[message.listener].ties}
        return any(
            is_same(reading, self._lexicon.read(one.text), self._constants.message.same_words)
            for one in before
            if one.speaker == message.speaker and one.listener in known
        )


def is_same(one: Reading, other: Reading, share: float) -> bool:
    """Return whether two messages have so large a share of their words in common that they are the same."""
    union = len(one.vocabulary | other.vocabulary)
    return union > 0 and len(one.vocabulary & other.vocabulary) / union >= share


def _length_factor(reading: Reading, numbers: MessageConstants) -> float:
    """Return what is left of a message that says too little about its topics, or goes on for too long."""
    needed = numbers.words_a_topic * len(reading.topics)
    return min(1.0, reading.words / needed) * min(1.0, numbers.longest / max(reading.words, 1))


_HOUR = 3600.0


@dataclass(frozen=True)
class Impression:
    """What a message did to a listener: when, and by how much, with patience and personality reckoned in."""

    time: float
    strength: float


class OpinionModel:
    """What the members of a community think of those who court them.

    Parameters
    ----------
    profiles
        Of all residents.
    mains
        Ids of those who court the others.
    seed
        Decides what nothing else explains.
    constants
        Numbers; those of the package unless given.
    """

    def __init__(
        self,
        profiles: Sequence[Profile],
        mains: Sequence[str],
        *,
        seed: int,
        constants: OpinionConstants | None = None,
    ) -> None:
        self.constants = constants or opinion_constants()
        self.profiles = {profile.id: profile for profile in profiles}
        self.mains = tuple(mains)
        self.members = tuple(profile.id for profile in profiles if profile.id not in self.mains)
        hobbies = [hobby for profile in profiles for hobby in profile.hobbies]
        groups = [group for profile in profiles for group in profile.groups]
        lexicon = Lexicon(lexicon_files(), hobbies=hobbies, groups=groups)
        self._receiver = MessageReceiver(lexicon, self.constants, self.profiles)
        self._seed = seed

    @property
    def variants(self) -> tuple[str, ...]:
        """Names of the variants, the first one first."""
        return tuple(variant.name for variant in self.constants.variant)

    def prior(self, member: str, main: str) -> float:
        """Return what a member thinks of a main agent before any talk."""
        numbers = self.constants.prior
        listener, other = self.profiles[member], self.profiles[main]
        shared_hobbies = len(set(listener.hobbies) & set(other.hobbies)) / max(len(listener.hobbies), 1)
        likeness = 1.0 - sum(abs(a - b) for a, b in zip(listener.five, other.five, strict=True)) / len(listener.five)
        chance = float(rng(self._seed, "first opinion", member, main).normal(0.0, 1.0))
        return (
            numbers.values * _shared_values(listener.values, other.values)
            + numbers.hobbies * shared_hobbies
            + numbers.group * bool(set(listener.groups) & set(other.groups))
            + numbers.ties * listener.tie_to(main)
            + numbers.similarity * likeness
            + numbers.chance * chance
        )

    def reception(self, message: HeardMessage, before: Sequence[HeardMessage]) -> float:
        """Return how well a message is received, before personality and patience; see `Receiver.reception`."""
        return self._receiver.reception(message, before)

    def tone(self, reception: float) -> str:
        """Return how one answers to a message so received: ``warm``, ``neutral`` or ``cool``."""
        reply = self.constants.reply
        return "warm" if reception >= reply.warm else "cool" if reception < reply.cool else "neutral"

    def opinions(
        self, heard: Sequence[HeardMessage], *, now: float, variant: str, receptions: Sequence[float] | None = None
    ) -> dict[tuple[str, str], float]:
        """Return what every member thinks of every main agent.

        Parameters
        ----------
        heard
            All that members listened to, in the order of time.
        now
            Seconds of the day.
        variant
            Name of a variant.
        receptions
            How each message was received, where that is known already.

        Raises
        ------
        InputError
            If there is no such variant.
        """
        form = next((one for one in self.constants.variant if one.name == variant), None)
        if form is None:
            raise InputError(f"influence: no variant {variant!r}; there are {', '.join(self.variants)}")
        found = {
            (member, main): opinion_after(form, self.prior(member, main), impressions, now)
            for (member, main), impressions in self._impressions(heard, receptions).items()
        }
        return self._after_talk_with_friends(form, found) if isinstance(form, SocialForm) else found

    def ranking(self, opinions: Mapping[tuple[str, str], float], member: str) -> list[str]:
        """Return the main agents in a member's order, the dearest first; a tie is broken by the seed."""
        chance = {main: float(rng(self._seed, "tie", member, main).random()) for main in self.mains}
        return sorted(self.mains, key=lambda main: (-opinions[member, main], chance[main], main))

    def _impressions(
        self, heard: Sequence[HeardMessage], receptions: Sequence[float] | None
    ) -> dict[tuple[str, str], list[Impression]]:
        found: dict[tuple[str, str], list[Impression]] = {
            (member, main): [] for member in self.members for main in self.mains
        }
        for k, message in enumerate(heard):
            if (message.listener, message.speaker) in found:
                reception = self.reception(message, heard[:k]) if receptions is None else receptions[k]
                strength = self._strength(message, reception)
                found[message.listener, message.speaker].append(Impression(message.time, strength))
        return found

    def _strength(self, message: HeardMessage, reception: float) -> float:
        """Return what a message does: by its reception, who listens, and how often they were spoken to already."""
        numbers, listener = self.constants.listener, self.profiles[message.listener]
        if message.round >= numbers.rounds:
            return 0.0
        patience = numbers.tired ** max(0, message.conversation + 1 - numbers.conversations)
        first = message.conversation == 0 and message.round == 0
        contact = numbers.contact * (0.5 + listener.trait("extraversion")) if first else 0.0
        if reception < 0.0:
            return contact + reception * (1.0 + numbers.hurt * listener.trait("neuroticism"))
        open_minded = (
            numbers.base
            + numbers.openness * listener.trait("openness")
            + numbers.agreeableness * listener.trait("agreeableness")
        )
        return contact + reception * open_minded * patience

    def _after_talk_with_friends(
        self, form: SocialForm, opinions: Mapping[tuple[str, str], float]
    ) -> dict[tuple[str, str], float]:
        """Return opinions once every member has heard what the members they know think."""
        found = {}
        for (member, main), own in opinions.items():
            ties = [tie for tie in self.profiles[member].ties if (tie.other, main) in opinions and tie.strength > 0.0]
            weight = sum(tie.strength for tie in ties)
            others = sum(tie.strength * opinions[tie.other, main] for tie in ties) / weight if ties else own
            found[member, main] = (1.0 - form.listens_to_friends) * own + form.listens_to_friends * others
        return found


def opinion_after(form: Variant, prior: float, impressions: Sequence[Impression], now: float) -> float:
    """Return an opinion after impressions, as a variant's form has it; more of a better impression is never less."""
    if isinstance(form, SumForm):
        return _sum_opinion(form, prior, impressions, now)
    if isinstance(form, AverageForm):
        return _average_opinion(form, prior, impressions, now)
    return _social_opinion(form, prior, impressions, now)


def _sum_opinion(form: SumForm, prior: float, impressions: Sequence[Impression], now: float) -> float:
    """Add up what has not faded; the sum is bounded by a hyperbolic tangent."""
    total = sum(form.scale * one.strength * _remaining_share(now - one.time, form.half_life) for one in impressions)
    return prior + form.most * math.tanh(total / form.most)


def _average_opinion(form: AverageForm, prior: float, impressions: Sequence[Impression], now: float) -> float:
    """Average with the prior (Anderson's information integration), older impressions by a power of the hours gone."""
    weight, total = form.prior_weight, form.prior_weight * prior
    for one in impressions:
        share = form.message_weight * (1.0 + (now - one.time) / _HOUR) ** -form.forgetting
        weight += share
        total += share * (prior + form.scale * one.strength)
    return total / weight


def _social_opinion(form: SocialForm, prior: float, impressions: Sequence[Impression], now: float) -> float:
    """Move step by step towards a bound, and back towards the prior between the steps."""
    shift, last = 0.0, now
    for k, one in enumerate(impressions):
        if k:
            shift *= _remaining_share(one.time - last, form.half_life)
        last = one.time
        step = form.scale * one.strength
        room = 1.0 - shift / form.most if step > 0.0 else 1.0 + shift / form.most
        # No step may pass the bound, however large.
        shift += math.copysign(form.most * room * -math.expm1(-abs(step) / form.most), step)
    return prior + shift * (_remaining_share(now - last, form.half_life) if impressions else 1.0)


def _remaining_share(seconds: float, half_life: float) -> float:
    """Return what is left of an impression after so long; the half-life is in hours."""
    return float(0.5 ** (max(seconds, 0.0) / (half_life * _HOUR)))


def _shared_values(mine: Sequence[str], others: Sequence[str]) -> float:
    """Return how far two people's values agree, 0..1: the first ones count most."""
    weights = [1.0 / (rank + 1) for rank in range(max(len(mine), len(others), 1))]
    most = sum(w * w for w in weights)
    return sum(weights[mine.index(v)] * weights[others.index(v)] for v in mine if v in others) / most
