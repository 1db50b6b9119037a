"""The nearest of some named points."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

from vico.world.model import Point2


def nearest(here: Point2, points: Mapping[str, Point2], without: Collection[object] = ()) -> str | None:
    """Return the name of the nearest point as the crow flies; None if there is none."""
    names = [name for name in points if name not in without]
    return min(names, key=lambda name: (math.dist(here, points[name]), name), default=None)
