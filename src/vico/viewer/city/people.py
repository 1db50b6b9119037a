"""Bodies of people and how they move, as a browser poses them: a file a person, made when it is first asked for.

Motions are tables of joint rotations, from which a browser poses them at any phase and pace. A gait's table has a row
for each phase at each of some paces; other motions have one for each phase. Who stands and waits has no cycle to
speak of: their joints are a resting pose and what shifting the weight, turning the head and nodding add to it
(`vico.sim.animation.standing.restlessness`).
"""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.people import PARENTS, Appearance, SkinnedBody, body_of
from vico.assets.people.level_of_detail import simplify_body
from vico.io.cache import cache_folder
from vico.io.files import write_bytes
from vico.seeds import rng
from vico.sim.animation import CLIPS, clip_index, pose, style_of
from vico.sim.animation.postures import restlessness

__all__ = ["PERSON_FORMAT", "PeopleFiles", "motion_tables", "person_bytes"]
# Metres a second at which gaits are tabulated.
_WALKS, _RUNS = (0.3, 0.6, 1.0, 1.5, 2.2), (1.5, 2.5, 4.0)
_GAITS = {"run": _RUNS} | dict.fromkeys(("walk", "carry", "carry_left", "carry_right"), _WALKS)
# Motions of those who stand and wait, and at which place in their cycle they are looked at.
_RESTING = {"idle": 0.0, "stand": 0.0, "phone": 0.5}
_GAIT_PHASES, _PHASES = 32, 24
# Waves beat thrice a cycle, talk twice.
_FINE = {"wave": 48, "sit_wave": 48, "turn": 32, "open_door": 40}
_MOMENTS = 96  # at which a resting pose is looked at
_SHORT = 32767


def motion_tables(style: Any) -> tuple[list[dict[str, Any]], list[NDArray[Any]]]:
    """Tabulate all motions of a person.

    Parameters
    ----------
    style
        A `vico.sim.animation.STYLE` record.

    Returns
    -------
    list of dict
        Of each motion, in the order of `CLIPS`: ``name``, ``paces`` (empty for those without) and ``phases``, ``row``
        (its first row in the tables), or ``resting`` (its place among the resting poses).
    list of ndarray
        Joint rotations as quaternions x, y, z, w times 32767, int16, shape ``(rows, 55, 4)``; pelvis shifts, metres,
        float32, shape ``(rows, 3)``; and of resting poses the coefficients of 1, weight, turn of the head and nod for
        each joint's axis-angle and for the shift, float32, shape ``(resting, 4, 56, 3)``.
    """
    entries: list[dict[str, Any]] = []
    courses: list[tuple[int, float, float]] = []
    resting: list[NDArray[np.float64]] = []
    for name in CLIPS:
        clip = clip_index(name)
        if name in _RESTING:
            entries.append({"name": name, "resting": len(resting)})
            resting.append(_resting_pose(style, clip, _RESTING[name]))
            continue
        paces = _GAITS.get(name, ())
        phases = _FINE.get(name, _GAIT_PHASES if paces else _PHASES)
        entries.append({"name": name, "paces": list(paces), "phases": phases, "row": len(courses)})
        courses += [(clip, k / phases, pace) for pace in paces or (0.0,) for k in range(phases)]
    clips, places, speeds = (np.array(column) for column in zip(*courses, strict=True))
    rotations, offsets = pose(clips, places, speeds, np.repeat(style, len(courses)))
    return entries, [_quaternions(rotations), offsets, np.stack(resting).astype(np.float32)]


def _resting_pose(style: Any, clip: int, phase: float) -> NDArray[np.float64]:
    """Fit what shifting one's weight, turning one's head and nodding do to a pose; shape ``(4, 56, 3)``."""
    seconds = np.arange(_MOMENTS) * 3.7
    causes, poses = np.ones((_MOMENTS, 4)), np.empty((_MOMENTS, 56, 3))
    one = np.repeat(style, 1)
    for k, second in enumerate(seconds.tolist()):
        causes[k, 1:] = restlessness(second, float(style["asymmetry"]), float(style["rhythm"]))
        rotations, offsets = pose(np.array([clip]), np.array([phase]), np.zeros(1), one, second=second)
        poses[k, :-1], poses[k, -1] = rotations[0], offsets[0]
    fitted, *_ = np.linalg.lstsq(causes, poses.reshape(_MOMENTS, -1), rcond=None)
    return np.asarray(fitted.reshape(4, 56, 3))


def _quaternions(rotations: NDArray[np.float32]) -> NDArray[np.int16]:
    angle = np.linalg.norm(rotations.astype(np.float64), axis=-1, keepdims=True)
    half = 0.5 * angle
    scale = np.where(angle > 1e-9, np.sin(half) / np.maximum(angle, 1e-9), 0.5)
    found = np.concatenate([rotations * scale, np.cos(half)], axis=-1)
    return np.round(found * _SHORT).astype(np.int16)


#: Of the layout of a person's file; another number, and files are made anew.
PERSON_FORMAT = 5
# Triangles of a body that is some ten pixels tall.
_FAR_TRIANGLES = 220


class PeopleFiles:
    """Gives the file of each person of a run.

    Parameters
    ----------
    looks
        How people look, by entity.
    manners
        Name of the random stream that decides how each moves, by entity.
    seed
        Of the run.
    """

    def __init__(self, looks: Mapping[int, Appearance], manners: Mapping[int, str], seed: int) -> None:
        self._looks, self._manners, self._seed = dict(looks), dict(manners), seed
        self._lock = Lock()
        self._read = lru_cache(maxsize=256)(Path.read_bytes)

    def __contains__(self, entity: int) -> bool:
        """Whether somebody is known."""
        return entity in self._looks

    def file(self, entity: int) -> bytes:
        """Return body and motions of somebody, as `person_bytes` lays them out; kept in the user's cache.

        Raises
        ------
        KeyError
            If nobody has this number.
        """
        look, manner = self._looks[entity], self._manners[entity]
        key = json.dumps([PERSON_FORMAT, look.to_dict(), manner, self._seed], sort_keys=True)
        name = hashlib.sha256(key.encode()).hexdigest()[:24]
        path = cache_folder() / "viewer" / "people" / f"{name}.bin"
        with self._lock:
            if not path.exists():
                write_bytes(path, person_bytes(look, manner, self._seed))
        return self._read(path)


def person_bytes(look: Appearance, manner: str, seed: int) -> bytes:
    """Return somebody's body, near and far, and motions.

    The layout: uint32 length of a JSON head, the head, padding to a multiple of four, and columns one after another at
    the offsets that the head tells: for each mesh position and normal (float32), colour (uint8, four), joints (uint8,
    four), weights (uint8, four), triangles (uint16); then rest joints, T-pose joints, the frames from rest to T-pose,
    and the tables of `vico.viewer.city.people`. The head also tells of the left and the right sole how far it is below
    the ankle (``depth``) and how far it rolls on (``roll``) at the pitches `vico.sim.animation.motions.SOLE_PITCHES`.
    """
    body = body_of(look)
    columns: list[NDArray[Any]] = []
    head: dict[str, Any] = {"height": float(body.height), "parents": PARENTS.tolist(), "meshes": []}
    for mesh in (body, simplify_body(body, _FAR_TRIANGLES)):
        head["meshes"].append(
            {
                "vertices": len(mesh.vertices),
                "indices": int(mesh.triangles.size),
                "columns": _append_arrays(columns, *_mesh_columns(mesh)),
            }
        )
    head["skeleton"] = _append_arrays(columns, body.rest_joints, body.joints, body.frames)
    style = style_of(body, rng(seed, "manner", manner), age=look.age)
    tables, data = motion_tables(style)
    head["motions"], head["motion_data"] = tables, _append_arrays(columns, *data)
    head["soles"] = {"depth": _rows_of(style["sole_depth"]), "roll": _rows_of(style["sole_roll"])}
    head["manner"] = {name: float(style[name]) for name in ("height", "asymmetry", "rhythm")}
    text = json.dumps(head, separators=(",", ":")).encode()
    text += b" " * (-(len(text) + 4) % 4)
    return b"".join([struct.pack("<I", len(text)), text, *(_pad(column) for column in columns)])


def _rows_of(table: NDArray[Any]) -> list[list[float]]:
    """Return the rows of a table, to a tenth of a millimetre."""
    rows: list[list[float]] = np.round(table.astype(np.float64), 4).tolist()
    return rows


def _mesh_columns(mesh: SkinnedBody) -> list[NDArray[Any]]:
    colour = np.full((len(mesh.vertices), 4), 255, np.uint8)
    colour[:, :3] = mesh.colour
    # Shares that add up to 255 exactly: what rounding leaves goes to the strongest.
    weights = np.round(mesh.weights * 255).astype(np.int64)
    weights[:, 0] += 255 - weights.sum(axis=1)
    return [
        mesh.vertices.astype(np.float32),
        mesh.normals.astype(np.float32),
        colour,
        mesh.weight_joints.astype(np.uint8),
        weights.astype(np.uint8),
        mesh.triangles.astype(np.uint16),
    ]


def _append_arrays(columns: list[NDArray[Any]], *arrays: NDArray[Any]) -> list[int]:
    """Append arrays; return where each begins, counted from the first column of all."""
    starts = []
    at = sum(len(_pad(column)) for column in columns)
    for array in arrays:
        starts.append(at)
        columns.append(np.ascontiguousarray(array))
        at += len(_pad(columns[-1]))
    return starts


def _pad(array: NDArray[Any]) -> bytes:
    data = np.ascontiguousarray(array).tobytes()
    return data + b"\0" * (-len(data) % 4)
