"""What to say: the offline dialogues. All draw on the same lines; they differ in which they choose for whom."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vico.agents.influence.lines import Lines, lines
from vico.agents.influence.profiles import Profile
from vico.agents.influence.situation import Situation, Talk


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
        known = lines()
        options = [line for value in known.value for line in (*value.shared, *value.theirs)]
        everybody = [situation.me, *situation.members.values()]
        hobbies = sorted({hobby for profile in everybody for hobby in profile.hobbies})
        options += [_one_of(known.hobby.own, chance).format(hobby=hobby) for hobby in hobbies]
        return f"{_one_of(known.openings, chance)} {_one_of(options, chance)}" if options else None


class OwnInterestsDialogue:
    """Talks about oneself: one's own values, hobbies and groups, whoever listens."""

    def say(self, situation: Situation, talk: Talk, chance: np.random.Generator) -> str | None:
        """Return the next thing about oneself; once all was told, some of it again."""
        known, me = lines(), situation.me
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
        known, listener = lines(), situation.members[talk.target]
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
        known, listener = lines(), situation.members[talk.target]
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
