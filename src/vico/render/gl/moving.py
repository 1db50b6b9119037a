"""What moves, packed for shaders: what throws shadows, and where things were when somebody looked last."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.render.arrays import SceneArrays
from vico.render.limbs import LIMBS
from vico.render.records import CASTER
from vico.render.sensors.past import PastPlaces
from vico.render.shading.light import Light
from vico.render.shadows.casters import TALLEST, list_casters
from vico.render.uniforms import Record

#: Open doors that a shader knows at a time.
OPENINGS = 16
#: Four numbers each that a shader reads of a caster: see `packed_casters`.
CASTER_ROWS = 11 + 2 * len(LIMBS)


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
    for at, frame in ((0, found["to_unit"]), (6, found["sun_frame"])):
        out[:, at : at + 3, :3] = frame[:, :, :3]
        out[:, at : at + 3, 3] = frame[:, :, 3] + frame[:, :, :3] @ eye
    out[:, 3, :3], out[:, 3, 3] = found["sun"], found["inverse_soft"]
    for k, name in enumerate(("first_column", "end_column", "first_row", "end_row")):
        out[:, 4, k] = found[name]
    out[:, 5, 0], out[:, 5, 1] = found["foot"] - eye[2], TALLEST * found["half_height"]
    out[:, 5, 2], out[:, 5, 3] = found["is_round"], found["limb_count"]
    out[:, 9] = found["area"]
    avatar = numbers - int(arrays.counts["instances"])
    owner = np.zeros((count, 3), np.int32)
    owner[:, 0] = np.where(avatar < 0, numbers, -1)
    if len(arrays.avatars.span):
        owner[:, 1] = arrays.mesh.entity[arrays.avatars.span["first_triangle"][np.maximum(avatar, 0)]]
    owner[:, 2] = found["cabin"]
    out[:, 10, :3] = owner.view(np.float32)
    out[:, 11:] = found["limbs"].reshape(count, 2 * len(LIMBS), 4)
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
    things[:, :12] = matrix.reshape(-1, 12)
    things[:, 12] = past.known[: len(things)]
    return bodies.astype(np.float32), things
