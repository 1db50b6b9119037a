"""Bodies of people and how they move, as a browser poses them: a file a person, made when it is first asked for."""

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
from vico.sim.animation import style_of
from vico.viewer.city.motions import motion_tables

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
    and the tables of `vico.viewer.city.motions`. The head also tells of the left and the right sole how far it is below
    the ankle (``depth``) and how far it rolls on (``roll``) at the pitches `vico.sim.animation.motions.SOLE_PITCHES`.
    """
    body = body_of(look)
    columns: list[NDArray[Any]] = []
    head: dict[str, Any] = {"height": float(body.height), "parents": PARENTS.tolist(), "meshes": []}
    for mesh in (body, _far_body(body)):
        head["meshes"].append(
            {
                "vertices": len(mesh.vertices),
                "indices": int(mesh.triangles.size),
                "columns": _put(columns, *_mesh_columns(mesh)),
            }
        )
    head["skeleton"] = _put(columns, body.rest_joints, body.joints, body.frames)
    style = style_of(body, rng(seed, "manner", manner), age=look.age)
    tables, data = motion_tables(style)
    head["motions"], head["motion_data"] = tables, _put(columns, *data)
    head["soles"] = {"depth": _rounded(style["sole_depth"]), "roll": _rounded(style["sole_roll"])}
    head["manner"] = {name: float(style[name]) for name in ("height", "asymmetry", "rhythm")}
    text = json.dumps(head, separators=(",", ":")).encode()
    text += b" " * (-(len(text) + 4) % 4)
    return b"".join([struct.pack("<I", len(text)), text, *(_padded(column) for column in columns)])


def _rounded(table: NDArray[Any]) -> list[list[float]]:
    """Return the rows of a table, to a tenth of a millimetre."""
    rows: list[list[float]] = np.round(table.astype(np.float64), 4).tolist()
    return rows


def _far_body(body: SkinnedBody) -> SkinnedBody:
    return simplify_body(body, _FAR_TRIANGLES)


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


def _put(columns: list[NDArray[Any]], *arrays: NDArray[Any]) -> list[int]:
    """Append arrays; return where each begins, counted from the first column of all."""
    starts = []
    at = sum(len(_padded(column)) for column in columns)
    for array in arrays:
        starts.append(at)
        columns.append(np.ascontiguousarray(array))
        at += len(_padded(columns[-1]))
    return starts


def _padded(array: NDArray[Any]) -> bytes:
    data = np.ascontiguousarray(array).tobytes()
    return data + b"\0" * (-len(data) % 4)


__all__ = ["PERSON_FORMAT", "PeopleFiles", "person_bytes"]
