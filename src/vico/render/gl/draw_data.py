"""Data of the shaders for a picture: uniforms of camera and light, lamps, shadow casters, and visible ranges."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.render.arrays import ANYWHERE, INDOORS, OUTDOORS, SceneArrays
from vico.render.compiled import inlined, kernel
from vico.render.lamps import MOST_BEAMS, LampGrid, nearest_beams
from vico.render.lighting import TONE_RANGE, TONE_STEPS
from vico.render.limbs import LIMBS
from vico.render.motion import PastPlaces
from vico.render.records import CASTER
from vico.render.shadows.casters import TALLEST, list_casters
from vico.render.uniforms import Light, Record

#: Numbers of each lamp.
LAMP_FLOATS = 12


def packed_beams(beams: NDArray[np.void], camera: Record, light: Record) -> NDArray[np.float32]:
    """Return the headlights that light a camera's picture, in a light's uniforms."""
    chosen = np.zeros(MOST_BEAMS, np.int64)
    return beams[chosen[: nearest_beams(beams, camera, light["lamp_exposure"], chosen)]].view(np.float32)


def packed_lamps(grid: LampGrid) -> NDArray[np.float32]:
    """Return where each cell's part begins, lamps, and what cells name of them; whole numbers as their bits."""
    lamps = grid.lamps.copy()
    lamps["power"] = grid.power
    parts = grid.start.view(np.float32), lamps.view(np.float32), grid.named.view(np.float32)
    return np.concatenate(parts)


def vector(record: Record, name: str, parts: str = "xyz") -> tuple[float, ...]:
    """Return the parts of a record's field as numbers."""
    return tuple(float(record[f"{name}_{part}"]) for part in parts)


def _colour(record: Record, name: str) -> tuple[float, ...]:
    return tuple(float(record[f"{name}_{part}"]) for part in ("red", "green", "blue"))


def view_uniforms(camera: Record) -> dict[str, Any]:
    """Return the uniforms about a camera."""
    focal = float(camera["focal"])
    return {
        "eye": (float(camera["x"]), float(camera["y"]), float(camera["z"])),
        "right": vector(camera, "right"),
        "down": vector(camera, "down"),
        "forward": vector(camera, "forward"),
        "scale": (2.0 * focal / float(camera["width"]), 2.0 * focal / float(camera["height"])),
        "centre": (
            2.0 * float(camera["centre_x"]) / float(camera["width"]) - 1.0,
            2.0 * float(camera["centre_y"]) / float(camera["height"]) - 1.0,
        ),
        "near": float(camera["near"]),
        "far": float(camera["far"]),
        "indoors": int(camera["indoors"]),
        "hidden": int(camera["hidden_entity"]),
        "most_taps": int(camera["most_taps"]),
        "room_place": (*vector(camera, "room"), float(camera["room_cos"])),
        "room_size": (
            float(camera["room_half_length"]),
            float(camera["room_half_width"]),
            float(camera["room_height"]),
            float(camera["room_sin"]),
        ),
        "room_light": tuple(float(camera[f"room_{name}"]) for name in ("lamp", "around", "window")),
    }


def light_uniforms(light: Light) -> dict[str, Any]:
    """Return the uniforms about the light."""
    u = light.uniforms
    relief, grid = light.relief, light.lamps
    return {
        "lamp_grid": (float(grid.x), float(grid.y), float(grid.columns), float(grid.rows)),
        "lamp_parts": (len(grid.start), len(grid.start) + LAMP_FLOATS * len(grid.lamps)),
        "sun": vector(u, "sun"),
        "sun_colour": _colour(u, "sun"),
        "ambient": _colour(u, "ambient"),
        "tilt": _colour(u, "tilt"),
        "haze": _colour(u, "haze"),
        "side": vector(u, "side", "xy"),
        "unlit": (float(u["unlit_x"]), float(u["unlit_y"]), float(u["unlit_radius"])),
        "haze_per_metre": float(u["haze_per_metre"]),
        "lamp_exposure": float(u["lamp_exposure"]),
        "wet": float(u["wet"]),
        "snow_cover": float(u["snow_cover"]),
        "softness": float(u["shadow_softness"]),
        "glass": float(u["glass"]),
        "interiors": float(u["interiors"]),
        "tone_scale": (TONE_STEPS - 1) / TONE_RANGE,
        "shadow_frame": tuple(float(v) for v in light.shadow.matrix.T.reshape(-1)),
        "relief_frame": (float(relief.x), float(relief.y), float(relief.texels_per_metre)),
    }


#: Open doors that a shader knows at a time.
OPENINGS = 16
# Rows of a caster, of four numbers each, as a shader reads them: see `packed_casters`.
_TO_UNIT_ROW = 0  # and two more
_SUN_ROW = 3
_BOUNDS_ROW = 4
_FOOT_ROW = 5
_SUN_FRAME_ROW = 6  # and two more
_AREA_ROW = 9
_OWNER_ROW = 10
_LIMBS_ROW = 11  # and all after it
#: How many they are.
CASTER_ROWS = _LIMBS_ROW + 2 * len(LIMBS)
# Where it is said of an instance whether its last matrix is known: after three rows of the matrix.
_IS_KNOWN = 12


def packed_casters(arrays: SceneArrays, camera: Record, light: Light) -> NDArray[np.float32]:
    """Return all that may darken a camera's picture, float32, shape ``(n, 4 * CASTER_ROWS)``.

    Of each caster, places being from the eye: three rows to its unit frame; the sun there and the inverse soft length;
    first and end column and row; foot, greatest height above it, whether it is round, and how many limbs it has; three
    rows to the frame across the light; the area there; number of the instance or -1, entity of the avatar, and row of
    the cabin or -1, all as bits of whole numbers; then two rows a limb.
    """
    most = int(arrays.counts["instances"]) - int(arrays.counts["static_instances"]) + int(arrays.counts["avatars"])
    found, numbers = np.zeros(most, CASTER), np.zeros(most, np.int64)
    count = list_casters(arrays, camera, light.uniforms, found, numbers)
    found, numbers = found[:count], numbers[:count]
    eye = np.array([camera["x"], camera["y"], camera["z"]], np.float64)
    out = np.zeros((count, CASTER_ROWS, 4), np.float32)
    for at, frame in ((_TO_UNIT_ROW, found["to_unit"]), (_SUN_FRAME_ROW, found["sun_frame"])):
        out[:, at : at + 3, :3] = frame[:, :, :3]
        out[:, at : at + 3, 3] = frame[:, :, 3] + frame[:, :, :3] @ eye
    out[:, _SUN_ROW, :3], out[:, _SUN_ROW, 3] = found["sun"], found["inverse_soft"]
    for k, name in enumerate(("first_column", "end_column", "first_row", "end_row")):
        out[:, _BOUNDS_ROW, k] = found[name]
    foot = out[:, _FOOT_ROW]
    foot[:, 0], foot[:, 1] = found["foot"] - eye[2], TALLEST * found["half_height"]
    foot[:, 2], foot[:, 3] = found["is_round"], found["limb_count"]
    out[:, _AREA_ROW] = found["area"]
    avatar = numbers - int(arrays.counts["instances"])
    owner = np.zeros((count, 3), np.int32)
    owner[:, 0] = np.where(avatar < 0, numbers, -1)
    if len(arrays.avatars.span):
        owner[:, 1] = arrays.mesh.entity[arrays.avatars.span["first_triangle"][np.maximum(avatar, 0)]]
    owner[:, 2] = found["cabin"]
    out[:, _OWNER_ROW, :3] = owner.view(np.float32)
    out[:, _LIMBS_ROW:] = found["limbs"].reshape(count, 2 * len(LIMBS), 4)
    return out.reshape(count, 4 * CASTER_ROWS)


def packed_cabins(arrays: SceneArrays) -> NDArray[np.float32]:
    """Return the fields of all `CABIN`, 18 numbers and two sides each, float32."""
    cabins = arrays.prototypes.cabins
    parts = [cabins[name].reshape(len(cabins), -1) for name in ("low", "high", "windows", "front", "rear")]
    parts += [cabins["end_half"][:, None], cabins["sharp"], np.zeros((len(cabins), 2), np.float32)]
    return np.concatenate([*parts, cabins["open"].reshape(len(cabins), -1)], axis=1)


def packed_openings(arrays: SceneArrays, camera: Record) -> NDArray[np.float32]:
    """Return the nearest doors that are not closed, float32, shape ``(OPENINGS, 3, 4)``; of those beyond, zeros.

    Middle of the sill from the eye, half width; direction inwards, height, nothing; before, behind, nothing.
    """
    openings = arrays.openings
    away = np.hypot(openings["x"] - float(camera["x"]), openings["y"] - float(camera["y"]))
    openings = openings[np.argsort(away, kind="stable")[:OPENINGS]]
    out = np.zeros((OPENINGS, 12), np.float32)
    for k, name in enumerate("xyz"):
        out[: len(openings), k] = openings[name] - float(camera[name])
    for k, name in ((3, "half_width"), (4, "inward_x"), (5, "inward_y"), (6, "height"), (8, "before"), (9, "behind")):
        out[: len(openings), k] = openings[name]
    return out.reshape(OPENINGS, 3, 4)


def packed_past(past: PastPlaces) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return where avatars' vertices were, shape ``(v, 3)``, and how moving instances stood, shape ``(n, 16)``.

    Both are from where the eye was, float32; the latter are three rows of a matrix, then whether it is known.
    """
    bodies = np.stack([past.x - past.eye[0], past.y - past.eye[1], past.z - past.eye[2]], axis=1)
    things = np.zeros((len(past.matrix), 16), np.float32)
    matrix: NDArray[Any] = past.matrix.astype(np.float64)
    matrix[:, :, 3] -= past.eye
    things[:, :_IS_KNOWN] = matrix.reshape(-1, 12)
    things[:, _IS_KNOWN] = past.known[: len(things)]
    return bodies.astype(np.float32), things


# Smaller than this across is not drawn, pixels; as the other renderer has it.
_LEAST_PIXELS = 0.8
_LEVELS = 3


def cluster_ranges(arrays: SceneArrays, camera: Record) -> list[tuple[int, int]]:
    """Return ranges of triangles of the clusters in view, neighbours joined."""
    clusters = arrays.clusters
    if not len(clusters.low):
        return []
    seen = np.empty(len(clusters.low), np.bool_)
    where = INDOORS if camera["indoors"] else OUTDOORS
    _find_clusters(clusters.low, clusters.high, arrays.cluster_where, where, camera, seen)
    first, end = clusters.span["first_triangle"][seen], clusters.span["end_triangle"][seen]
    if not len(first):
        return []
    return joined_ranges(first, end)


def joined_ranges(first: NDArray[np.int32], end: NDArray[np.int32]) -> list[tuple[int, int]]:
    """Return ranges with those joined that follow each other."""
    breaks = np.flatnonzero(first[1:] != end[:-1]) + 1
    starts, ends = np.concatenate([[0], breaks]), np.append(breaks, len(first)) - 1
    return list(zip(first[starts].tolist(), end[ends].tolist(), strict=True))


def instances_in_view(
    arrays: SceneArrays, camera: Record, *, moving: bool
) -> tuple[NDArray[np.int32], list[tuple[int, int]]]:
    """Return the instances in view, those of one mesh beside each other, and how many there are of each mesh.

    Returns
    -------
    numbers
        Of the instances.
    groups
        For each mesh that is seen three times its prototype plus the level of detail, and how many follow.
    """
    count = int(arrays.counts["instances" if moving else "static_instances"])
    if not count:
        return np.zeros(0, np.int32), []
    prototypes, instances = arrays.prototypes, arrays.instances
    code, numbers = np.empty(count, np.int32), np.empty(count, np.int32)
    each = np.zeros(_LEVELS * len(prototypes.low), np.int64)
    found = _find_instances(instances, prototypes, camera, code, each)
    _group(code, each, numbers)
    seen = np.flatnonzero(each)
    return numbers[:found], list(zip(seen.tolist(), each[seen].tolist(), strict=True))


@kernel
def _find_clusters(low: Any, high: Any, where: Any, wanted: int, camera: Any, seen: Any) -> None:
    for k in range(len(seen)):
        radius, middle = 0.0, np.empty(3, np.float64)
        for axis in range(3):
            middle[axis] = (np.float64(low[k, axis]) + np.float64(high[k, axis])) / 2.0
            half = (np.float64(high[k, axis]) - np.float64(low[k, axis])) / 2.0
            radius += half * half
        seen[k] = where[k] == wanted and _is_in_view(middle[0], middle[1], middle[2], np.sqrt(radius), camera)


@kernel
def _find_instances(instances: Any, prototypes: Any, camera: Any, code: Any, each: Any) -> int:
    """Write three times the prototype plus the level of detail of what is in view, -1 of the rest; count them."""
    found = 0
    for k in range(len(code)):
        code[k] = -1
        where, sphere = instances.where[k], instances.sphere[k]
        if where != ANYWHERE and (where == INDOORS) != (camera.indoors != 0):
            continue
        x, y, z, radius = np.float64(sphere.x), np.float64(sphere.y), np.float64(sphere.z), np.float64(sphere.radius)
        ahead = _ahead(x, y, z, camera)
        if 2.0 * radius * camera.focal < _LEAST_PIXELS * ahead or not _is_in_view(x, y, z, radius, camera):
            continue
        model = instances.prototype[k]
        extent, scale = 0.0, 0.0
        for axis in range(3):
            side = np.float64(prototypes.high[model, axis]) - np.float64(prototypes.low[model, axis])
            along = np.float64(instances.matrix[k, axis, 0])
            extent, scale = extent + side * side, scale + along * along
        pixels = np.sqrt(extent * scale) * camera.focal / max(ahead, camera.near)
        level = 0
        if pixels < prototypes.pixels[model, 1]:
            level = 2 if pixels < prototypes.pixels[model, 2] else 1
        code[k] = _LEVELS * model + level
        each[code[k]] += 1
        found += 1
    return found


@kernel
def _group(code: Any, each: Any, numbers: Any) -> None:
    """Write the numbers of what has a code, one code after the other."""
    place = np.zeros(len(each), np.int64)
    for k in range(1, len(each)):
        place[k] = place[k - 1] + each[k - 1]
    for k in range(len(code)):
        if code[k] >= 0:
            numbers[place[code[k]]] = k
            place[code[k]] += 1


@inlined
def _ahead(x: float, y: float, z: float, camera: Any) -> float:
    dx, dy, dz = x - camera.x, y - camera.y, z - camera.z
    return dx * camera.forward_x + dy * camera.forward_y + dz * camera.forward_z


@inlined
def _is_in_view(x: float, y: float, z: float, radius: float, camera: Any) -> bool:
    """Return whether a camera may see a sphere."""
    dx, dy, dz = x - camera.x, y - camera.y, z - camera.z
    ahead = dx * camera.forward_x + dy * camera.forward_y + dz * camera.forward_z
    if ahead + radius <= camera.near or ahead - radius >= camera.far:
        return False
    across = abs(dx * camera.right_x + dy * camera.right_y + dz * camera.right_z)
    down = abs(dx * camera.down_x + dy * camera.down_y + dz * camera.down_z)
    wide = max(camera.centre_x, camera.width - camera.centre_x) / camera.focal
    tall = max(camera.centre_y, camera.height - camera.centre_y) / camera.focal
    return across - ahead * wide <= radius * np.sqrt(1.0 + wide * wide) and down - ahead * tall <= radius * np.sqrt(
        1.0 + tall * tall
    )
