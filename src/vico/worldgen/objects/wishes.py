"""What should stand where, before room is found for it; and how tags say numbers and directions."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.geo.osm import Tags
from vico.geo.quantities import Kind, read

_POINTS = ("N", "NNE", "NE", "ENE", "E", "ESE", "SE", "SSE", "S", "SSW", "SW", "WSW", "W", "WNW", "NW", "NNW")


@dataclass
class Wish:
    """A thing that should stand somewhere.

    Attributes
    ----------
    id
        OSM id, with a running number where one mapped thing becomes many.
    prototype
        Name of its model.
    xy
        Where, metres east and north.
    yaw
        Radians from east; None: as its surroundings suggest.
    scale
        Factor on the model.
    entity, group
        As the record of a stop or station says, or None.
    reach
        How far it may be moved to find room, metres; 0: it stands there or nowhere.
    piece
        A piece of a line: its ends may touch walls and other pieces.
    """

    id: str
    prototype: str
    xy: NDArray[np.float64]
    yaw: float | None = None
    scale: float = 1.0
    entity: int | None = None
    group: str | None = None
    reach: float = 3.0
    piece: bool = False


def direction(tags: Tags) -> float | None:
    """Yaw from a `direction` tag: degrees clockwise from north, or a compass point."""
    said = tags.get("direction", tags.get("camera:direction", ""))
    degrees = 22.5 * _POINTS.index(said) if said in _POINTS else read(said, Kind.ANGLE).value
    return None if degrees is None else math.remainder(math.pi / 2 - math.radians(degrees), 2 * math.pi)
