"""What agents that come with vico tell of their plans: made of what they remember, when somebody asks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from vico.agents.base import Goal, Plan
from vico.agents.stays import Stay
from vico.clock import DAY, clock_of
from vico.world.public import PublicMap

# Of a day, so many stays are told.
_AHEAD = 3

_DOES = {
    "look": "goes where it may be, and looks for it",
    "fetch": "goes where it saw it",
    "deliver": "brings what it holds",
}


def plan_of_day(
    stays: Sequence[Stay], departures: Sequence[float], second: float, public_map: PublicMap, way: Iterable[Any]
) -> Plan | None:
    """Return where a day leads next; None for a day without places.

    Parameters
    ----------
    departures
        When one sets out for each stay, seconds of the day.
    second
        Now, seconds since the first midnight.
    way
        Points that one walks along now, ENU metres.
    """
    if not stays:
        return None
    now = second % DAY
    at = max((k for k, leaves in enumerate(departures) if now >= leaves), default=0)
    goals = []
    for stay in stays[at : at + _AHEAD]:
        place = public_map.place_by_id[stay.place]
        x, y, z = place.position
        goals.append(Goal(f"{stay.activity} from {clock_of(int(stay.due))[:5]}", (x, y, z), place.name or place.kind))
    stay = stays[at]
    by = "" if stay.mode == "walk" else f", by {stay.mode}"
    why = f"the day says {stay.activity} from {clock_of(int(stay.due))[:5]}{by}"
    return Plan(tuple(goals), _on_ground(way, public_map), why)


def plan_of_errand(
    told: Mapping[str, Any] | None, doing: str, public_map: PublicMap, way: Iterable[Any], *, source: int = -1
) -> Plan:
    """Return what an assistant is about.

    Parameters
    ----------
    told
        The subtask's instruction; None where there is none left.
    doing
        What it does for it, in words.
    source
        Which of the subtask's sources it goes to; -1 for none.
    """
    if told is None:
        return Plan(why="everything is reported")
    goals = [Goal(str(told["text"]))]
    regions = [*([told["sources"][source]] if source >= 0 else []), told["destination"]]
    for region in regions:
        if region is not None:
            x, y, z = region["centre"]
            goals.append(Goal(str(region["name"]), (x, y, z), str(region["name"])))
    return Plan(tuple(goals), _on_ground(way, public_map), _DOES.get(doing, doing))


def _on_ground(way: Iterable[Any], public_map: PublicMap) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(x), float(y), float(public_map.height((float(x), float(y))))) for x, y in way)
