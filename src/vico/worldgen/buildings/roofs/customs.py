"""Roofs that nobody mapped take the shape that houses of their family and region have."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo.quantities import quantity
from vico.worldgen.buildings.roofs.eaves import edges_of
from vico.worldgen.facades.catalogue import styles
from vico.worldgen.facades.families import picked
from vico.worldgen.facts.outlines.plans import BuildingPlan, PartPlan
from vico.worldgen.facts.outlines.roof_shapes import Roof, inradius, shape_named

_SUPPOSED = ("gabled", "hipped", "half-hipped", "mansard")
_STREETS = 3  # storeys from which on a house belongs to a street, and its region's roofs
_WIDEST = 1.3  # of its depth, the width of a house up to which it turns its gable to the street
_DEEPEST = 18.0  # metres of a house whose ridge is turned along the street
_REACH = 25.0  # metres within which a street counts
_SHORTEST = 2.5  # metres of a side that may be a house's front
_PITCHED = range(2, 8)  # storeys of houses that have pitched roofs in a town of them
_SLOPE = 0.62  # metres a metre: of roofs that nobody gave a height
_PARAPET = 0.6  # metres
_GARRET = 3.4  # metres: a mansard is a storey high, where nobody says its height


def with_customary_roofs(
    plan: BuildingPlan,
    wall: str,
    streets: shapely.STRtree,
    *,
    region: str,
    flat_town: bool = False,
    random: np.random.Generator,
) -> BuildingPlan:
    """Return a building whose supposed roofs have the shape of its family's, else of its region's.

    Parameters
    ----------
    plan
        The building. Roofs that are mapped or measured stay as they are.
    wall
        Its family of facades.
    streets
        Centre lines of streets: a ridge goes by the side of the house that lies nearest to one.
    region
        As `facades.catalogue.region_of` says.
    flat_town
        Whether houses have flat roofs here (`is_flat_town`): then those that were supposed stay flat.
    random
        The building's own stream.

    Notes
    -----
    A stated height stays; else walls keep their height, and the roof is as high as its shape is.
    """
    draw = float(random.random())
    family = styles().families[wall]
    shapes = family.roofs or (styles().region(region).pitched if plan.levels >= _STREETS else {})
    if not shapes or (plan.origin is not None and plan.origin.roof):
        return plan
    shape = picked(list(shapes.items()), draw)
    told = plan.rule == "height tag"
    # What is flat among several parts may carry another.
    flat_too = not flat_town and len(plan.parts) == 1 and shape != "flat"
    parts = [
        _with_roof(part, shape, _street_side(part, streets) if family.ridge else None, family.ridge, told=told)
        if _supposed(part, flat_too=flat_too)
        else part
        for part in plan.parts
    ]
    return replace(plan, parts=parts)


def is_flat_town(plans: Sequence[BuildingPlan]) -> bool:
    """Return whether most houses of several storeys have flat roofs, as mapped or supposed."""
    shapes = [part.roof.shape for plan in plans for part in plan.parts[:1] if plan.levels >= _STREETS]
    return 2 * shapes.count("flat") > len(shapes)


def _supposed(part: PartPlan, *, flat_too: bool) -> bool:
    """Return whether nobody said what roof a part has; a flat one among pitched ones only where it has the room."""
    tags = part.tags
    said = shape_named(tags.get("roof:shape")) or quantity(tags, "roof:height")
    if said or quantity(tags, "roof:levels") is not None or part.roof.facets or part.levels < 1:
        return False
    if part.roof.shape != "flat":
        return part.roof.shape in _SUPPOSED
    return flat_too and part.levels in _PITCHED and part.low <= 0.0 and 1.5 < inradius(part.polygon) < _DEEPEST / 2


def _with_roof(part: PartPlan, shape: str, street: NDArray[np.float64] | None, ridge: str, *, told: bool) -> PartPlan:
    if shape == "flat":
        # A stated height is that of the walls; else only the roof goes.
        return replace(part, eaves=part.top if told else part.eaves, roof=Roof("flat", _PARAPET))
    direction, height = part.roof.direction, part.roof.height
    if part.roof.shape == "flat":
        deep = inradius(part.polygon)
        height = min(_SLOPE * deep, 5.5)
        if told:  # the stated height is that of the ridge
            height = min(height, 0.4 * part.eaves)
            part = replace(part, eaves=part.eaves - height)
    if street is not None and shape == "gabled":
        yaw, wide = math.atan2(float(street[1]), float(street[0])), float(np.hypot(*street))
        deep = part.polygon.area / wide
        if ridge == "across" and wide < _WIDEST * deep:
            direction = yaw + math.pi / 2
            height = height if told else min(max(height, 0.57 * wide), 7.0)
        elif ridge == "along" and deep < _DEEPEST:
            direction = yaw
            height = height if told else min(max(0.32 * deep, 1.2), 5.5)
    if not told and shape == "mansard":
        height = min(_GARRET, 1.2 * inradius(part.polygon))
    return replace(part, roof=Roof(shape, height, direction))


def _street_side(part: PartPlan, streets: shapely.STRtree) -> NDArray[np.float64] | None:
    """Return the edge that lies nearest to a street as a vector, metres; None where none is near."""
    edges = edges_of(part.polygon)
    middle = edges.start + (edges.length / 2)[:, None] * edges.along + edges.out
    found, distance = streets.query_nearest(
        shapely.points(middle), max_distance=_REACH, return_distance=True, all_matches=False
    )
    near = np.full(len(middle), np.inf)
    near[found[0]] = distance
    near[edges.length < _SHORTEST] = np.inf
    k = int(near.argmin())
    return edges.along[k] * edges.length[k] if np.isfinite(near[k]) else None
