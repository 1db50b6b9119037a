"""How a member takes one message: its topics in the listener's eyes, its manner, and whether all that was heard before.

The formulas stand in docs/influence.md under the same names.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vico.agents.influence.profiles import Profile
from vico.challenges.influence.constants import MessageConstants, OpinionConstants
from vico.challenges.influence.lexicon import Lexicon, Reading, Topic


@dataclass(frozen=True)
class Heard:
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


class Receiver:
    """Judges messages as their listeners do.

    Parameters
    ----------
    profiles
        Of all who take part, by id.
    """

    def __init__(self, lexicon: Lexicon, constants: OpinionConstants, profiles: dict[str, Profile]) -> None:
        self._lexicon, self._constants, self._profiles = lexicon, constants, profiles

    def reception(self, message: Heard, before: Sequence[Heard]) -> float:
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

    def _is_canned(self, message: Heard, reading: Reading, before: Sequence[Heard]) -> bool:
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
