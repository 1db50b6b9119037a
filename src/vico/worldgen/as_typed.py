"""Values of the map that are not plain: how a build read them, or that it could not.

A build's report lists each: what was read by a rule ("G+4" as five storeys), what can't be read ("two"), and what can't
be true ("9999"). Nothing else is decided here; stages read the same values by `vico.geo.quantities` and
`vico.world.opening_hours`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo.osm import OsmData, Tags
from vico.geo.quantities import QUANTITIES, Kind, Range, read
from vico.world.model import Dropped, Place
from vico.world.opening_hours import how_read, standard_spelling

_UNITS = {
    Kind.LENGTH: " m",
    Kind.STOREYS: " storeys",
    Kind.SPEED: " m/s",
    Kind.ANGLE: " degrees",
    Kind.NUMBER: "",
    Kind.LANES: "",
}
# Values of `maxspeed` that say no speed, and mean to.
_WORDS = frozenset({"none", "signals", "variable", "no", "unknown"})


def quantities_as_typed(osm: OsmData) -> tuple[dict[str, int], list[Dropped]]:
    """List the heights, storeys, widths and speeds of a window that were read by a rule or not at all.

    Returns
    -------
    tuple
        Counts of values ``by_rule`` and ``not_read`` (empty where all are plain), and id and sentence of each.
    """
    told: list[Dropped] = []
    counts = {"by_rule": 0, "not_read": 0}
    for name, shape, tags in _tagged(osm):
        for key, text in tags.items():
            of = QUANTITIES.get(key)
            if of is None or (sentence := _sentence(text, of)) is None or not np.any(osm.holds(shape)):
                continue
            counts["by_rule" if " read as " in sentence else "not_read"] += 1
            told.append(Dropped(id=name, reason=f"{key}={text!r} {sentence}"))
    return (counts if told else {}), told


def hours_as_typed(places: Sequence[Place]) -> tuple[dict[str, int], list[Dropped]]:
    """List the opening hours of places that were respelled or can't be read; the counts as of quantities."""
    told: list[Dropped] = []
    counts = {"by_rule": 0, "not_read": 0}
    for place in places:
        text = place.opening_hours
        if text is None or (how := how_read(text)) == "as typed":
            continue
        counts["not_read" if how == "not read" else "by_rule"] += 1
        read_as = (
            f"was read as {standard_spelling(text)!r}" if how == "respelled" else "can't be read: usual hours hold"
        )
        told.append(Dropped(id=place.id, reason=f"opening_hours={text!r} {read_as}"))
    return (counts if told else {}), told


def _tagged(osm: OsmData) -> Iterator[tuple[str, NDArray[np.float64], Tags]]:
    """Everything of a map that has tags: its id, points of its shape, and its tags. A closed way is told once."""
    yield from ((f"n{node.id}", node.xy[None], node.tags) for node in osm.nodes)
    yield from ((f"w{way.id}", way.line, way.tags) for way in osm.ways)
    relations: Iterable[tuple[str, NDArray[np.float64], Tags]] = (
        (area.id, shapely.get_coordinates(area.polygon), area.tags) for area in osm.areas if area.id.startswith("r")
    )
    yield from relations


def _sentence(text: str, of: Range) -> str | None:
    """Say how a value was read, or why not; None where it is plain."""
    if text in _WORDS and of.kind is Kind.SPEED:
        return None
    found = read(text, of.kind)
    if found.value is None:
        return "can't be read: decided by rule"
    if not of.least <= found.value <= of.most:
        return f"can't be ({of.least:g} to {of.most:g}{_UNITS[of.kind]}): decided by rule"
    if found.rule:
        return f"was read as {found.value:.4g}{_UNITS[of.kind]}: {found.rule}"
    return None
