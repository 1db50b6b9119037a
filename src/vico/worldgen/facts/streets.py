"""Streets as several stages know them: their records, and what tags say of lanes and widths."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.quantities import quantity

LANE_WIDTH = 3.2
"""Metres; netconvert's default too, so that its lanes lie within the painted carriageway."""


_GUTTER = 0.35  # metres between the outermost lane and the kerb
_SERVICE_WIDTH = {"driveway": 3.0, "parking_aisle": 5.5, "alley": 3.2, "drive-through": 3.0}


class StreetClass(NamedTuple):
    """What is usual for a class of streets where OpenStreetMap says nothing.

    Attributes
    ----------
    lanes
        Lanes a direction.
    sidewalks
        Whether sidewalks are usual in a town.
    """

    lanes: int
    sidewalks: bool


DRIVABLE: dict[str, StreetClass] = {
    "motorway": StreetClass(2, False),
    "trunk": StreetClass(2, False),
    "primary": StreetClass(2, True),
    "secondary": StreetClass(1, True),
    "tertiary": StreetClass(1, True),
    "unclassified": StreetClass(1, True),
    "residential": StreetClass(1, True),
    "living_street": StreetClass(1, True),
    "road": StreetClass(1, True),
    "busway": StreetClass(1, False),
    "bus_guideway": StreetClass(1, False),
    "motorway_link": StreetClass(1, False),
    "trunk_link": StreetClass(1, False),
    "primary_link": StreetClass(1, True),
    "secondary_link": StreetClass(1, True),
    "tertiary_link": StreetClass(1, True),
    "service": StreetClass(1, False),
}
"""The values of `highway` that vehicles drive on."""

_UNKNOWN_CLASS = StreetClass(1, False)

PAVINGS: dict[str, str] = {
    **dict.fromkeys(("sett", "cobblestone", "unhewn_cobblestone", "cobblestone:flattened"), "setts"),
    **dict.fromkeys(("paving_stones", "paving_stones:lanes", "bricks", "brick"), "stones"),
    **dict.fromkeys(("concrete", "concrete:plates", "concrete:lanes"), "concrete"),
    **dict.fromkeys(("asphalt", "chipseal", "tartan", "rubber"), "asphalt"),
    **dict.fromkeys(("gravel", "fine_gravel", "compacted", "pebblestone", "unpaved"), "gravel"),
    **dict.fromkeys(("ground", "dirt", "earth", "mud", "woodchips"), "earth"),
    **dict.fromkeys(("grass", "grass_paver"), "grass"),
    **dict.fromkeys(("wood", "metal_grid"), "wood"),
    "sand": "sand",
}
"""What a way or area is paved with, by its `surface`; what is not here looks as its kind usually does."""


@dataclass(frozen=True)
class Street:
    """A drivable way and what is painted on it.

    Attributes
    ----------
    line
        Metres, shape ``(n, 2)``, in the direction of the way (and of traffic where `oneway`).
    width
        Of the carriageway, kerb to kerb, metres.
    kerbed
        Whether it lies below its surroundings, between kerbs.
    cycle_left, cycle_right
        Whether a lane for bicycles is painted on that side, seen along `line`.
    parking_left, parking_right
        Widths of the parking lanes at the kerbs, metres; `slanted` if cars stand across the street in them.
    tracks
        Whether trams run in it.
    setts
        Whether it is paved with natural stones, on which no lanes are painted.
    """

    way: int
    kind: str
    line: NDArray[np.float64]
    width: float
    lanes: int
    oneway: bool
    kerbed: bool = True
    cycle_left: bool = False
    cycle_right: bool = False
    parking_left: float = 0.0
    parking_right: float = 0.0
    slanted: bool = False
    tracks: bool = False
    setts: bool = False


@dataclass(frozen=True)
class Crossing:
    """Where walkers cross a carriageway.

    Attributes
    ----------
    id
        Of the way or point that maps it.
    start, end
        On the two kerbs, metres.
    width
        Across the walking direction, metres.
    painted
        Whether it is marked.
    marking
        How: zebra, lines, dashes, ladder, dots, broken_lines or studs.
    signals
        Whether lights stop the traffic there.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    width: float
    painted: bool
    marking: str = "zebra"
    signals: bool = False
    id: str = ""

    @property
    def polygon(self) -> Polygon:
        """The strip between the kerbs."""
        return overlay.buffer(LineString([self.start, self.end]), self.width / 2, cap_style="flat")


@dataclass(frozen=True)
class StreetPolygons:
    """Street surfaces, metres; pieces of one kind do not overlap, nor do kinds except as said.

    Attributes
    ----------
    carriageway
        Where vehicles drive, kerb to kerb, tunnels left out.
    sidewalk
        Paved ways for walkers beside carriageways or by themselves.
    crossing
        Parts of `carriageway` where walkers cross.
    pedestrian
        Squares and pedestrian streets.
    path
        Unpaved footways, in parks mostly.
    cycleway
        Tracks of their own for bicycles.
    steps
        Stairs outdoors.
    parking
        Open car parks.
    streets, crossings
        The lines and stripes the polygons came from.
    rails
        Centre lines of tram tracks in the street, metres.
    sunken
        Part of `carriageway` between kerbs: streets, without drives and yards.
    paved
        What the map says ways and squares are paved with: polygons by the names in `PAVINGS`, across kinds.
    """

    carriageway: MultiPolygon
    sidewalk: MultiPolygon
    crossing: MultiPolygon
    pedestrian: MultiPolygon
    path: MultiPolygon
    cycleway: MultiPolygon
    steps: MultiPolygon
    parking: MultiPolygon
    streets: list[Street]
    crossings: list[Crossing]
    rails: list[NDArray[np.float64]]
    sunken: MultiPolygon = field(default_factory=MultiPolygon)
    paved: dict[str, MultiPolygon] = field(default_factory=dict)

    def footways(self) -> BaseGeometry:
        """Return where walkers walk."""
        return overlay.union_all(
            [self.sidewalk, self.pedestrian, self.path, self.steps, self.cycleway, self.crossing], grid=None
        )


def lane_count(tags: Mapping[str, str]) -> int:
    """Lanes of a drivable way, both directions together."""
    said = quantity(tags, "lanes")
    if said is not None and 1 <= said <= 12:
        return int(said)
    per_direction = DRIVABLE.get(tags.get("highway", ""), _UNKNOWN_CLASS).lanes
    return per_direction if is_oneway(tags) else 2 * per_direction


def is_oneway(tags: Mapping[str, str]) -> bool:
    """Whether vehicles use a way in one direction only."""
    said = tags.get("oneway")
    if said in ("yes", "true", "1", "-1"):
        return True
    return said is None and (tags.get("junction") in ("roundabout", "circular") or tags.get("highway") == "motorway")


def carriageway_width(tags: Mapping[str, str]) -> float:
    """Kerb-to-kerb width of a drivable way, metres: `width` where believable, else lanes, class and parking lanes."""
    said = quantity(tags, "width")
    if said is not None and 2.0 <= said <= 40.0:
        return said
    kind = tags.get("highway", "")
    if kind == "service" and "lanes" not in tags:
        return _SERVICE_WIDTH.get(tags.get("service", ""), 4.0)
    if kind == "living_street" and "lanes" not in tags:
        return 5.0
    width = lane_count(tags) * LANE_WIDTH + 2 * _GUTTER
    for side in ("left", "right", "both"):
        lane = tags.get(f"parking:lane:{side}", tags.get(f"parking:{side}", ""))
        metres = {"parallel": 2.0, "lane": 2.0, "street_side": 2.2, "diagonal": 4.2, "perpendicular": 4.8}.get(
            lane, 0.0
        )
        width += metres * (2 if side == "both" else 1)
    return width
