"""What may be in view, nearest first."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.render.arrays import INSTANCE_GROUP
from vico.render.compiled import inlined, kernel
from vico.render.geometry import CLUSTER_GROUP
from vico.render.visibility.culling import (
    distance_to_box,
    faces_away,
    in_view,
    is_elsewhere,
    is_instance_in_view,
    is_tiny,
    nearest_depth,
    set_box,
    set_world_view,
)

_BUCKETS = 640
_BUCKETS_PER_ROOT_METRE = 20.0


@kernel
def list_static(scene: Any, camera: Any, buffers: Any) -> int:
    """Write what may be in view of what never moves to `buffers.ordered`, nearest first; return how many entries.

    Entries count clusters, groups of static instances, instances that move, avatars, in this order. What is in a group
    is looked at when its turn comes: most groups are hidden by then.
    """
    set_world_view(camera, buffers.model_view)
    found = _list_clusters(scene, camera, buffers)
    found = _list_groups(scene, camera, buffers, len(scene.cluster_where), found)
    _sort_by_bucket(buffers.candidate, buffers.bucket, buffers.ordered, found)
    return found


@kernel
def list_moving(scene: Any, camera: Any, buffers: Any) -> int:
    """Do as `list_static` for what moves."""
    set_world_view(camera, buffers.model_view)
    first = len(scene.cluster_where) + len(scene.instances.groups.where)
    found = _list_instances(scene, camera, buffers, first, 0)
    first += scene.counts.instances - scene.counts.static_instances
    found = _list_avatars(scene, camera, buffers, first, found)
    _sort_by_bucket(buffers.candidate, buffers.bucket, buffers.ordered, found)
    return found


@inlined
def members(entry: int, clusters: int, groups: int, static_instances: int) -> Any:
    """Return the first and the end item code that an entry of the list stands for."""
    if entry < clusters:
        return entry, entry + 1
    if entry < clusters + groups:
        first = clusters + (entry - clusters) * INSTANCE_GROUP
        return first, min(first + INSTANCE_GROUP, clusters + static_instances)
    first = entry - groups + static_instances
    return first, first + 1


@inlined
def _bucket(distance: float) -> int:
    """Return a number that grows with the distance, finest nearby."""
    return min(int(_BUCKETS_PER_ROOT_METRE * np.sqrt(distance)), _BUCKETS - 1)


@inlined
def _list_clusters(scene: Any, camera: Any, buffers: Any) -> int:
    where, indoors = scene.cluster_where, camera.indoors != 0
    lows, highs, cones = scene.clusters.low, scene.clusters.high, scene.clusters.cone
    group_lows, group_highs = scene.clusters.group_low, scene.clusters.group_high
    model_view, box, candidate, bucket = buffers.model_view, buffers.box, buffers.candidate, buffers.bucket
    found = 0
    skip = False
    for k in range(len(where)):
        if k % CLUSTER_GROUP == 0:
            group = k // CLUSTER_GROUP
            set_box(model_view, group_lows[group], group_highs[group], box)
            skip = not in_view(box, camera)
        if skip or is_elsewhere(where[k], indoors):
            continue
        low, high = lows[k], highs[k]
        if faces_away(low, high, cones[k], camera):
            continue
        set_box(model_view, low, high, box)
        if in_view(box, camera):
            candidate[found] = k
            bucket[found] = _bucket(distance_to_box(low, high, camera))
            found += 1
    return found


@inlined
def _list_groups(scene: Any, camera: Any, buffers: Any, first: int, found: int) -> int:
    groups, indoors = scene.instances.groups, camera.indoors != 0
    where, lows, highs, widest = groups.where, groups.low, groups.high, groups.radius
    model_view, box, candidate, bucket = buffers.model_view, buffers.box, buffers.candidate, buffers.bucket
    for k in range(len(where)):
        if is_elsewhere(where[k], indoors):
            continue
        low, high = lows[k], highs[k]
        set_box(model_view, low, high, box)
        if is_tiny(widest[k], nearest_depth(box), camera) or not in_view(box, camera):
            continue
        candidate[found] = first + k
        bucket[found] = _bucket(distance_to_box(low, high, camera))
        found += 1
    return found


@inlined
def _list_instances(scene: Any, camera: Any, buffers: Any, first: int, found: int) -> int:
    start, end = scene.counts.static_instances, scene.counts.instances
    spheres, owners, where = scene.instances.sphere, scene.instances.entity, scene.instances.where
    candidate, bucket = buffers.candidate, buffers.bucket
    for k in range(start, end):
        sphere = spheres[k]
        if is_instance_in_view(sphere, owners[k], where[k], camera):
            dx, dy, dz = sphere.x - camera.x, sphere.y - camera.y, sphere.z - camera.z
            candidate[found] = first + k - start
            bucket[found] = _bucket(max(np.sqrt(dx * dx + dy * dy + dz * dz) - sphere.radius, 0.0))
            found += 1
    return found


@inlined
def _list_avatars(scene: Any, camera: Any, buffers: Any, first: int, found: int) -> int:
    entities, spans = scene.mesh.entity, scene.avatars.span
    lows, highs = scene.avatars.low, scene.avatars.high
    model_view, box, candidate, bucket = buffers.model_view, buffers.box, buffers.candidate, buffers.bucket
    for k in range(scene.counts.avatars):
        if camera.hidden_entity != 0 and entities[spans[k].first_triangle] == camera.hidden_entity:
            continue
        low, high = lows[k], highs[k]
        set_box(model_view, low, high, box)
        if in_view(box, camera):
            candidate[found] = first + k
            bucket[found] = _bucket(distance_to_box(low, high, camera))
            found += 1
    return found


@inlined
def _sort_by_bucket(candidate: Any, bucket: Any, ordered: Any, found: int) -> None:
    counts = np.zeros(_BUCKETS + 1, np.int32)
    for k in range(found):
        counts[bucket[k] + 1] += 1
    for k in range(_BUCKETS):
        counts[k + 1] += counts[k]
    for k in range(found):
        slot = bucket[k]
        ordered[counts[slot]] = candidate[k]
        counts[slot] += 1
