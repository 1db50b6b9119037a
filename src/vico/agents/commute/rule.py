"""The rule agent: walks, whatever there is."""

from __future__ import annotations

from vico.agents.commute.legs import LegMaker
from vico.agents.commute.question import Question
from vico.world.public import PublicMap
from vico.world.trips import Trip


class WalkPlanner:
    """Plans the walk (paper, appendix: the rule-based agent)."""

    def __init__(self, public_map: PublicMap) -> None:
        self._legs = LegMaker(public_map)

    def __call__(self, question: Question) -> Trip | None:
        """Return the walk from here to the goal."""
        leg = self._legs.walk(question.here, question.goal, question.now)
        return None if leg is None else Trip(question.now, (leg,))
