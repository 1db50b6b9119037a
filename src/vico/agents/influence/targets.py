"""Whom to see next: the offline choices. All know the same: profiles, days, one's own conversations."""

from __future__ import annotations

import math

import numpy as np

from vico.agents.influence.days import Stay
from vico.agents.influence.profiles import Profile
from vico.agents.influence.situation import Situation, Talk

# Those who have just been talked with are left in peace for so long, seconds, by all offline choices.
REST = 1800.0


def _rested(situation: Situation, members: dict[str, float]) -> dict[str, float]:
    """Return those with whom one has not just talked."""
    last = {talk.target: talk.began for talk in situation.talks}
    return {m: s for m, s in members.items() if situation.time - last.get(m, -math.inf) > REST}


class RandomTarget:
    """Anybody who can be met."""

    def choose(self, situation: Situation, chance: np.random.Generator) -> str | None:
        """Return a member drawn at random."""
        options = sorted(_rested(situation, situation.reachable()))
        return options[int(chance.integers(len(options)))] if options else None


class NearestTarget:
    """Who is nearest on foot."""

    def choose(self, situation: Situation, chance: np.random.Generator) -> str | None:
        """Return the member with the shortest way."""
        options = _rested(situation, situation.reachable())
        return min(options, key=lambda m: (options[m], m)) if options else None


class PersuadableTarget:
    """Who is the easiest to win over by character, among those talked with least."""

    def choose(self, situation: Situation, chance: np.random.Generator) -> str | None:
        """Return the most open and agreeable member."""
        options = _rested(situation, situation.reachable())

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

    def _met_at(self, situation: Situation, stay: Stay) -> float | None:
        assert stay.place is not None
        there = situation.time + situation.seconds_to(stay.place)
        ready = max(there, stay.start + self._SURE if stay.start > situation.time else there)
        return ready if ready + self._SURE < min(stay.end, situation.ends) else None

    def gain(self, situation: Situation, member: str) -> float:
        """Return what a conversation with a member is expected to be worth; 0 for one that has its time later."""
        talks = situation.talks_with(member)
        if talks and situation.time - talks[-1].began < REST:
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
