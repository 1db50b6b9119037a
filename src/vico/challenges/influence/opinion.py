"""The opinion model: what members think of the main agents before, during and after a day of talk.

docs/influence.md has every formula. Nobody who courts members may look in here: agents cannot import this room.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from vico.agents.influence.profiles import Profile
from vico.challenges.influence.constants import (
    AverageForm,
    OpinionConstants,
    SocialForm,
    SumForm,
    Variant,
    opinion_constants,
)
from vico.challenges.influence.lexicon import Lexicon, lexicon_files
from vico.challenges.influence.reception import Heard, Receiver
from vico.errors import InputError
from vico.seeds import rng

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
        self._receiver = Receiver(lexicon, self.constants, self.profiles)
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

    def reception(self, message: Heard, before: Sequence[Heard]) -> float:
        """Return how well a message is received, before personality and patience; see `Receiver.reception`."""
        return self._receiver.reception(message, before)

    def tone(self, reception: float) -> str:
        """Return how one answers to a message so received: ``warm``, ``neutral`` or ``cool``."""
        reply = self.constants.reply
        return "warm" if reception >= reply.warm else "cool" if reception < reply.cool else "neutral"

    def opinions(
        self, heard: Sequence[Heard], *, now: float, variant: str, receptions: Sequence[float] | None = None
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
        self, heard: Sequence[Heard], receptions: Sequence[float] | None
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

    def _strength(self, message: Heard, reception: float) -> float:
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
        return _sum(form, prior, impressions, now)
    if isinstance(form, AverageForm):
        return _average(form, prior, impressions, now)
    return _social(form, prior, impressions, now)


def _sum(form: SumForm, prior: float, impressions: Sequence[Impression], now: float) -> float:
    """Add up what has not faded; the sum is bounded by a hyperbolic tangent."""
    total = sum(form.scale * one.strength * _left(now - one.time, form.half_life) for one in impressions)
    return prior + form.most * math.tanh(total / form.most)


def _average(form: AverageForm, prior: float, impressions: Sequence[Impression], now: float) -> float:
    """Average with the prior (Anderson's information integration), older impressions by a power of the hours gone."""
    weight, total = form.prior_weight, form.prior_weight * prior
    for one in impressions:
        share = form.message_weight * (1.0 + (now - one.time) / _HOUR) ** -form.forgetting
        weight += share
        total += share * (prior + form.scale * one.strength)
    return total / weight


def _social(form: SocialForm, prior: float, impressions: Sequence[Impression], now: float) -> float:
    """Move step by step towards a bound, and back towards the prior between the steps."""
    shift, last = 0.0, now
    for k, one in enumerate(impressions):
        if k:
            shift *= _left(one.time - last, form.half_life)
        last = one.time
        step = form.scale * one.strength
        room = 1.0 - shift / form.most if step > 0.0 else 1.0 + shift / form.most
        # No step may pass the bound, however large.
        shift += math.copysign(form.most * room * -math.expm1(-abs(step) / form.most), step)
    return prior + shift * (_left(now - last, form.half_life) if impressions else 1.0)


def _left(seconds: float, half_life: float) -> float:
    """Return what is left of an impression after so long; the half-life is in hours."""
    return float(0.5 ** (max(seconds, 0.0) / (half_life * _HOUR)))


def _shared_values(mine: Sequence[str], others: Sequence[str]) -> float:
    """Return how far two people's values agree, 0..1: the first ones count most."""
    weights = [1.0 / (rank + 1) for rank in range(max(len(mine), len(others), 1))]
    most = sum(w * w for w in weights)
    return sum(weights[mine.index(v)] * weights[others.index(v)] for v in mine if v in others) / most
