"""Rules of objects outdoors: they stand on the ground, and in nothing else."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo import overlay
from vico.world.check.finding import WorldFinding
from vico.world.lanes import LaneGraph
from vico.world.world import World

_TOUCH = 0.01  # square metres of outlines that may overlap
_KERB = 0.4  # metres at each side of a lane that no vehicle's body sweeps
_JOINED = ("fence", "wall", "guard_rail", "hedge", "retaining_wall")  # pieces of a barrier meet, and meet their posts


def check_objects(world: World) -> Iterator[WorldFinding]:
    """Check that nothing outdoors stands in a building, beyond the edge, or off the ground; everything has a model."""
    objects = world.objects
    models = world.prototypes()
    for name in sorted(set(objects.prototype.tolist()) - set(models)):
        yield WorldFinding("object without model", name, "prototypes.glb has no such node")
    outside = np.flatnonzero(objects.outdoors)
    # Roofs on posts and storeys over passages don't count: what stands below them stands outdoors.
    standing = [
        body.positions[: len(body.positions) // 2]
        for body in world.surfaces("collision")
        if float(body.positions[:, 2].min()) < float(world.height(body.positions[:, :2]).max()) + 2.2
    ]
    tree = shapely.STRtree([shapely.Polygon(ring[:, :2].astype(np.float64)) for ring in standing])
    points = shapely.points(objects.position[outside, :2])
    for k in np.unique(tree.query(points, predicate="within")[0]).tolist():
        yield WorldFinding("object in a building", str(objects.id[outside[k]]), "it stands inside a wall")
    for k in outside[np.abs(objects.position[outside, :2]).max(axis=1) > world.half].tolist():
        yield WorldFinding("object beyond the edge", str(objects.id[k]), "it stands outside the world's square")
    off = np.abs(world.height(objects.position[outside]) - objects.z[outside]) > 0.05
    for k in outside[off].tolist():
        yield WorldFinding("object not seated", str(objects.id[k]), "its foot is not at ground level")


def _lane_bands(lanes: LaneGraph, chosen: NDArray[np.int64]) -> NDArray[np.object_]:
    """Return what vehicles sweep on each lane, a little narrower than the lane."""
    lines = np.array([shapely.LineString(lanes.line(int(k))[:, :2]) for k in chosen], object)
    return np.asarray(overlay.buffer(lines, lanes.width[chosen] / 2 - _KERB, cap_style="flat"), object)


def check_clearances(world: World) -> Iterator[WorldFinding]:
    """Check that nothing solid stands on a lane that is driven, nor in another solid thing."""
    objects = world.objects
    solid = np.flatnonzero(objects.outdoors & objects.solid)
    if not len(solid):
        return
    feet = shapely.polygons(objects.feet()[solid])
    lanes = world.lanes
    driven = np.flatnonzero(lanes.inside < 0) if len(lanes) else np.zeros(0, np.int64)
    if len(driven):
        bands = _lane_bands(lanes, driven)
        for k, lane in np.column_stack(shapely.STRtree(bands).query(feet, predicate="intersects")).tolist():
            inside = float(overlay.common_area(feet[k], bands[lane]))
            if inside > _TOUCH:
                what = f"{inside:.2f} m2 of its foot stand on lane {lanes.ids[int(driven[lane])]}"
                yield WorldFinding("object on a lane", str(objects.id[solid[k]]), what)
    left, right = shapely.STRtree(feet).query(feet, predicate="intersects")
    chosen = left < right
    for a, b in zip(left[chosen].tolist(), right[chosen].tolist(), strict=True):
        if str(objects.kind[solid[a]]) in _JOINED and str(objects.kind[solid[b]]) in _JOINED:
            continue
        common = float(overlay.common_area(feet[a], feet[b]))
        if common > _TOUCH:
            what = f"{common:.2f} m2 of its foot stand in {objects.id[solid[b]]}"
            yield WorldFinding("objects overlap", str(objects.id[solid[a]]), what)
