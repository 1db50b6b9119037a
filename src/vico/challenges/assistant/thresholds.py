"""Every number that the community assistant tasks are judged and drawn by (spec, section 4.1), in one place.

The advanced setting halves distances and names three times as many regions to look in.
"""

from __future__ import annotations

from dataclasses import dataclass

from vico.agents.requester import CALL_DISTANCE, HAND_OVER_DISTANCE, WAITS_FOR

#: Subtasks of an episode, and its longest duration, steps of one second.
SUBTASKS = 6
STEPS = 1500

#: People who live in the world: for Carry more, for six of them are to be out, near by and not far from home.
RESIDENTS = {"carry": 45, "delivery": 15, "search": 15}

#: Candidates that each object and place is chosen from.
CANDIDATES = 9

#: Regions lie no farther than this walk from the start, metres: so that six subtasks can be done in time by who plans
#: well. Who is to be helped with carrying moves about, and lives and is found within the second.
REACH = 160.0
CARRY_REACH = 350.0

#: How far outdoor things may lie from the middle of the region that is named, metres: with Delivery what one sees from
#: there at a glance, with Search an area to look through.
SOURCE_RADIUS = 8.0
SEARCH_RADIUS = 15.0

#: Middles of regions are told, positions of things are not: none lies nearer to a middle, metres.
OFF_MIDDLE = 0.4

#: A destination lies at least so far from the source, metres.
APART = 20.0

#: Places where somebody who is to be helped is often seen: so many are told, one of them right.
HAUNTS = 3

#: Nearer than this to the person one follows them, metres.
FOLLOW_DISTANCE = 5.0

#: A thing is seen, as causes of failure count it, with so many pixels within so many metres.
SEEN_PIXELS = 20
SEEN_DISTANCE = 10.0

#: Who moves less than the first, metres, over so many steps although it tries to is blocked.
BLOCKED_DISTANCE = 1.0
BLOCKED_STEPS = 45


@dataclass(frozen=True)
class Thresholds:
    """When a subtask is done.

    Attributes
    ----------
    destination_radius
        Delivery outdoors: things lie within this distance of the spot, metres.
    home_radius
        Carry: things lie within this distance of the home's entrance, metres, or inside.
    search_pixels, search_distance
        Search: at `task_complete` so many pixels of the thing are in view within this distance, metres.
    surface_distance
        Indoors: things lie within this distance of the surface that is named, metres, over the ground; None: anywhere
        in the place.
    regions
        Source regions that are told, times so many.
    """

    destination_radius: float = 3.0
    home_radius: float = 3.0
    search_pixels: int = 20
    search_distance: float = 10.0
    surface_distance: float | None = None
    regions: int = 1


STANDARD = Thresholds()
ADVANCED = Thresholds(destination_radius=1.5, home_radius=1.5, search_distance=5.0, surface_distance=1.5, regions=3)


# How far a message to those who are to be helped carries, how near they hand a thing over and how long they wait for
# who spoke to them is theirs to know; it is named here with the rest.
__all__ = [
    "ADVANCED",
    "APART",
    "BLOCKED_DISTANCE",
    "BLOCKED_STEPS",
    "CALL_DISTANCE",
    "CANDIDATES",
    "CARRY_REACH",
    "FOLLOW_DISTANCE",
    "HAND_OVER_DISTANCE",
    "HAUNTS",
    "OFF_MIDDLE",
    "REACH",
    "RESIDENTS",
    "SEARCH_RADIUS",
    "SEEN_DISTANCE",
    "SEEN_PIXELS",
    "SOURCE_RADIUS",
    "STANDARD",
    "STEPS",
    "SUBTASKS",
    "WAITS_FOR",
    "Thresholds",
    "thresholds",
]


def thresholds(*, advanced: bool) -> Thresholds:
    """Return the thresholds of a setting."""
    return ADVANCED if advanced else STANDARD
