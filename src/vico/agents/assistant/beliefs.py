"""Where somebody or something may be: chances of each region that is told, by habit, and by what was seen and heard.

A region starts with what is known of such places at that hour. Having looked there in vain lowers its chance, for
people less and less as time goes on; having seen somebody there, or having been told so, raises it, for a while.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from vico.agents.assistant.errands import Book
from vico.agents.assistant.estimates import FINDS
from vico.agents.assistant.habits import OUTDOORS, Habits
from vico.agents.assistant.skills import AssistantSkills, ObservationView
from vico.agents.state import AgentState
from vico.world.public import PublicMap

# People stay where they were seen, or were not, for about so long, seconds.
_STAYS = 1200.0
# How much likelier a region is where somebody was seen, and where somebody says that they are, were or often are.
_SEEN = 4.0
_TOLD = {"see": 3.0, "myself": 3.0, "saw_in": 1.5, "saw_near": 1.0, "told": 1.0, "usual": 0.4}
_SAID = 0.3
# Chance that things are where nobody said; and people, who are at one of the places that are told at first and go on
# later: at first, and by how much more each second.
_ELSEWHERE_THINGS, _ELSEWHERE, _ELSEWHERE_LATER, _ELSEWHERE_MOST = 0.03, 0.03, 0.0002, 0.35
# How much of their time people are at each place that somebody says they are often seen at, at least.
_LEAST = 0.04

#: Regions of a subtask: ``(subtask, region)``.
Spot = tuple[int, int]


class Beliefs:
    """Chances of regions, and why.

    Parameters
    ----------
    book
        Regions, and how often each was looked through.
    habits
        Of people.
    """

    def __init__(self, book: Book, public_map: PublicMap, habits: Habits) -> None:
        self._book, self._map, self._habits = book, public_map, habits
        self._looks: dict[Spot, int] = {}
        self._looked_at: dict[Spot, float] = {}
        self._seen_at: dict[Spot, float] = {}
        self._told_at: dict[Spot, float] = {}
        self._told: dict[Spot, float] = {}
        self._began: float | None = None

    def state(self) -> AgentState:
        """Return all of it."""
        return {
            "looks": _rows(self._looks),
            "looked_at": _rows(self._looked_at),
            "seen_at": _rows(self._seen_at),
            "told_at": _rows(self._told_at),
            "told": _rows(self._told),
            "began": self._began,
        }

    def restore(self, state: AgentState) -> None:
        """Know what `state` returned."""
        self._looks = {(int(k), int(r)): int(n) for k, r, n in state["looks"]}
        self._began = state["began"]
        self._looked_at, self._seen_at, self._told_at, self._told = (
            {(int(k), int(r)): float(at) for k, r, at in state[name]}
            for name in ("looked_at", "seen_at", "told_at", "told")
        )

    def notice(self, view: ObservationView, skills: AssistantSkills) -> None:
        """Take in where people are in view, and which regions have been looked through since."""
        now = float(view.state["time"])
        self._began = now if self._began is None else self._began
        for k, looks in self._book.looked.items():
            for r, count in looks.items():
                if count > self._looks.get((k, r), 0):
                    self._looked_at[k, r] = now
                self._looks[k, r] = count
        for k, told in self._book.instructions.items():
            if self._book.category(k) != "carry" or not self._book.is_open(k):
                continue
            thing = skills.seen.last_seen(str(told["person"]["name"]))
            place = None if thing is None else skills.places.get(thing.room)
            at = None if place is None else self._region_at(k, place)
            if thing is not None and at is not None:
                self._seen_at[k, at] = thing.time

    def hear(self, k: int, place: str, now: float, how: str) -> None:
        """Take in that somebody is said to be at a place, which is one of the subtask's regions.

        Parameters
        ----------
        how
            What was said: a kind of `vico.agents.talk.understanding.Claim`.
        """
        r = self._region_at(k, place)
        if r is not None:
            self._told_at[k, r], self._told[k, r] = now, _TOLD.get(how, _SAID)

    def _region_at(self, k: int, place: str) -> int | None:
        sources = self._book.instructions[k]["sources"]
        return next((r for r, region in enumerate(sources) if region["place"] == place), None)

    def chances(self, k: int, now: float) -> list[float]:
        """Return how likely what a subtask is about is in each of its regions; together 1 at most."""
        person = self._book.category(k) == "carry"
        sources = self._book.instructions[k]["sources"]
        first = [self._habit(region, now) if person else 1.0 for region in sources]
        weights = [self._weight((k, r), weight, now, person=person) for r, weight in enumerate(first)]
        elsewhere = self._elsewhere(now) if person else _ELSEWHERE_THINGS
        total = sum(weights) + sum(first) * elsewhere / (1.0 - elsewhere)
        return [weight / total for weight in weights]

    def _elsewhere(self, now: float) -> float:
        """Return how likely somebody is at none of the places that were told."""
        since = now if self._began is None else self._began
        return min(_ELSEWHERE_MOST, _ELSEWHERE + _ELSEWHERE_LATER * (now - since))

    def _weight(self, spot: Spot, weight: float, now: float, *, person: bool) -> float:
        """Return what is left of a region's weight after all that was learnt of it."""
        if person:
            told, seen = self._told_at.get(spot), self._seen_at.get(spot)
            weight += 0.0 if told is None else self._told[spot] * math.exp(-(now - told) / _STAYS)
            weight += 0.0 if seen is None else _SEEN * math.exp(-(now - seen) / _STAYS)
        looked = self._looked_at.get(spot)
        if looked is None or (person and looked < self._seen_at.get(spot, -math.inf)):
            return weight
        missed = FINDS * (math.exp(-(now - looked) / _STAYS) if person else 1.0)
        return weight * (1.0 - missed) ** (1 if person else self._looks.get(spot, 1))

    def _habit(self, region: Mapping[str, Any], now: float) -> float:
        place = None if region["place"] is None else self._map.place_by_id.get(str(region["place"]))
        category = OUTDOORS if place is None else place.category.value
        return max(_LEAST, self._habits.share(category, now / 3600.0 % 24.0))


def _rows(known: Mapping[Spot, float]) -> list[list[float]]:
    return [[k, r, value] for (k, r), value in known.items()]
