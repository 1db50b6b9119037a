"""Street furniture and furniture of the Debian package `sweethome3d-furniture` in the place of our own models.

The package is optional and only its models are used: read out of the archives, turned to our front, thinned, fitted
into our models' outlines, and kept as one GLB in the user's cache. A world that uses them carries them in its own
meshes, with credits. Our model keeps saying what an object is, what it is for, what can lie on it and what room it
takes; only its looks change. Worlds therefore place the same objects at the same spots whichever models they show.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vico.assets.furniture_archive import (
    COLLECTIONS,
    SYSTEM_FOLDER,
    Archive,
    ArchiveEntry,
    ObjMaterial,
    ObjMesh,
    archives,
    read_obj,
)
from vico.assets.models.library import furniture_models, street_models
from vico.assets.models.model import Model
from vico.assets.packages import FetchError, IntegrityError
from vico.assets.shapes import pose_matrix, surface_with_normals
from vico.assets.simplification import simplify_mesh
from vico.errors import MissingExtraError, SchemaError
from vico.io.cache import cache_folder
from vico.io.files import read_json, sha256_of, write_json
from vico.world.glb import read_glb, write_glb
from vico.world.mesh import Material, Surface, merge_surfaces

Array = NDArray[Any]

_SAMPLES = 6000


def transfer_uv(
    points: Array, faces: Array, paint: Array, old_points: Array, old_faces: Array, old_uv: Array, old_paint: Array
) -> Array:
    """Texture coordinates of thinned triangles: the map of the nearest old triangle of the same material goes on.

    Returns
    -------
    uv
        float64, shape ``(m, 3, 2)``.
    """
    uv = np.zeros((len(faces), 3, 2))
    corners = old_points[old_faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1) / 2
    centres = points[faces].mean(axis=1)
    ours = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    ours /= np.maximum(np.linalg.norm(ours, axis=1, keepdims=True), 1e-18)
    reach = 0.05 * float(np.ptp(old_points, axis=0).max())
    for number in np.unique(paint).tolist():
        there = np.flatnonzero((old_paint == number) & (area > 1e-14) & np.isfinite(old_uv).all(axis=(1, 2)))
        here = np.flatnonzero(paint == number)
        if not len(there):
            continue
        # Places spread evenly over the old surface, with the way it faces, so that neighbours round a corner differ.
        ends = np.cumsum(area[there])
        who = there[np.searchsorted(ends, (np.arange(_SAMPLES) + 0.5) / _SAMPLES * ends[-1])]
        u, v = np.modf(np.arange(1, _SAMPLES + 1)[:, None] * np.array([0.7548776662, 0.5698402910]))[0].T
        over = u + v > 1
        u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
        first, second, third = corners[who, 0], corners[who, 1], corners[who, 2]
        spots = first + u[:, None] * (second - first) + v[:, None] * (third - first)
        facing = cross[who] / (2 * area[who, None])
        tree = cKDTree(np.concatenate([spots, facing * reach], axis=1))
        _, nearest = tree.query(np.concatenate([centres[here], ours[here] * reach], axis=1))
        source = who[nearest]
        a, b, c = (corners[source, k][:, None, :] for k in range(3))
        p = points[faces[here]] - a
        e, f = b - a, c - a
        ee, ef, ff = (e * e).sum(-1), (e * f).sum(-1), (f * f).sum(-1)
        pe, pf = (p * e).sum(-1), (p * f).sum(-1)
        size = np.maximum(ee * ff - ef * ef, 1e-30)
        s, t = (ff * pe - ef * pf) / size, (ee * pf - ef * pe) / size
        old = old_uv[source]
        uv[here] = old[:, :1] + s[..., None] * (old[:, 1:2] - old[:, :1]) + t[..., None] * (old[:, 2:3] - old[:, :1])
    return uv


#: In place of a collection: one of our own models, as it is.
OURS = "="

_CREASE = 42.0
_GLOW = 0.9
_GLOW_COLOUR = (255, 236, 196)
# The list's axes are x right, y up, z to the viewer, who looks at the front; ours are x front, y left, z up.
_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True)
class StandIn:
    """One model of a pack, and where it goes in ours.

    Attributes
    ----------
    pack
        Letter of its collection, or `OURS`.
    name
        Its name in the archive.
    digest
        First digits of the SHA-256 of what it is made of; another is refused.
    triangles
        How many it may have.
    box
        Lowest and highest corner of where it goes, metres from our model's origin; None: our model's own box.
    turn
        Quarter turns, counter-clockwise seen from above, that bring its front to ours.
    whole
        Scaled alike in all directions, so that it touches the box; otherwise it fills the box.
    glow
        Its materials that shine at night.
    """

    pack: str
    name: str
    digest: str
    triangles: int = 1500
    box: tuple[float, float, float, float, float, float] | None = None
    turn: int = 0
    whole: bool = False
    glow: tuple[str, ...] = ()


def _place_stand_in(piece: StandIn, ours: Model, entry: ArchiveEntry, solid: ObjMesh) -> list[Surface]:
    upright = _turn_upright(solid.points, entry, piece.turn)
    points, faces, kept = simplify_mesh(upright, solid.faces, piece.triangles, kinds=solid.paint)
    paint = solid.paint[kept]
    if len(faces) == len(solid.faces):
        uv = solid.uv[kept]
    else:
        uv = transfer_uv(points, faces, paint, upright, solid.faces, solid.uv, solid.paint)
    points = _into_box(points, _box_of(piece, ours), whole=piece.whole)
    corners = surface_with_normals(points, faces, (255, 255, 255), crease=_CREASE)
    positions = corners.positions.reshape(-1, 3, 3)
    normals = corners.normals.reshape(-1, 3, 3)
    surfaces = []
    for number, worn in enumerate(solid.paints):
        chosen = paint == number
        if chosen.any():
            label = f"{piece.pack}/{piece.name}/{number}"
            surfaces.append(
                _surface(positions[chosen], normals[chosen], uv[chosen], worn, label, glows=worn.name in piece.glow)
            )
    return surfaces


def _turn_upright(points: NDArray[Any], entry: ArchiveEntry, turn: int) -> NDArray[np.float64]:
    """In our axes and at the size the list says, the front where the piece's turn brings it."""
    turned = points @ np.array(entry.rotation).reshape(3, 3).T
    wide = np.ptp(turned, axis=0)
    width, depth, height = entry.size
    turned = (turned - turned.min(axis=0)) / np.maximum(wide, 1e-9) * np.array([width, height, depth])
    c, s = ((1, 0), (0, 1), (-1, 0), (0, -1))[turn % 4]
    spin = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], np.float64)
    return np.asarray(turned @ _AXES.T @ spin.T, np.float64)


def _box_of(piece: StandIn, ours: Model) -> NDArray[np.float64]:
    """Where a piece goes; what of ours is under the ground (foundations) is not counted."""
    if piece.box is not None:
        return np.array(piece.box, np.float64).reshape(2, 3)
    box = ours.bounds.copy()
    box[0, 2] = max(float(box[0, 2]), 0.0)
    return box


def _into_box(points: NDArray[Any], box: NDArray[np.float64], *, whole: bool) -> NDArray[np.float64]:
    """Scaled into a box, standing on its floor in its middle."""
    low, high = points.min(axis=0), points.max(axis=0)
    scale = (box[1] - box[0]) / np.maximum(high - low, 1e-9)
    if whole:
        scale = np.full(3, scale.min())
    middle = (box[0] + box[1]) / 2
    out = (points - (low + high) / 2) * scale + middle
    if whole:
        out[:, 2] += box[0, 2] - out[:, 2].min()
    return np.asarray(out, np.float64)


def _surface(
    positions: NDArray[Any], normals: NDArray[Any], uv: NDArray[Any], worn: ObjMaterial, label: str, *, glows: bool
) -> Surface:
    """Return the triangles of one material; those of plain colour share one material across all models."""
    uv = np.nan_to_num(uv.reshape(-1, 2).copy())
    uv[:, 1] = 1.0 - uv[:, 1]  # a picture's first row is at its top
    colour = _GLOW_COLOUR if glows else worn.colour
    if worn.picture is None or glows:
        uv[:] = 0.0
        material = Material("thing_glow", emission=_GLOW, double_sided=True) if glows else Material(
            "thing", double_sided=True
        )  # fmt: skip
    else:
        cutout = worn.picture.shape[2] == 4
        material = Material(label, worn.picture, cutout=cutout, double_sided=True, photo=not cutout)
    # Whole tiles less, so that coordinates stay small; then corners that are alike become one vertex.
    uv -= np.floor(uv.min(axis=0))
    rows = np.concatenate([positions.reshape(-1, 3), normals.reshape(-1, 3), uv], axis=1).astype(np.float32)
    _, first, index = np.unique(np.round(rows, 4), axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order))
    kept = rows[first[order]]
    return Surface(
        kept[:, :3].copy(),
        kept[:, 3:6].copy(),
        kept[:, 6:].copy(),
        np.tile(np.array(colour, np.uint8), (len(kept), 1)),
        np.zeros(len(kept), np.int32),
        place[np.asarray(index).reshape(-1)].reshape(-1, 3).astype(np.int32),
        material,
    )


def own_model(name: str, y: float = 0.0) -> StandIn:
    """One of our own models beside what a pack gives."""
    return StandIn(OURS, name, "", box=(0.0, y, 0.0, 0.0, y, 0.0))


#: By the name of our model.
STAND_INS: dict[str, tuple[StandIn, ...]] = {
    "bench": (StandIn("K", "concrete-bench", "889d6605788009f7f9ae", triangles=900),),
    "bench_flat": (StandIn("Z", "bench", "77bce24a2d2b0e4318ce", triangles=700),),
    "lounger": (StandIn("Z", "deckChair", "4c7d5b7b26784ce44585", triangles=700),),
    "waste_basket": (StandIn("K", "park-trashcan", "8dbb28149c9ff390a512", triangles=900),),
    "fountain": (StandIn("B", "fountain", "33ef70512af55f9f0eb5"),),
    "cafe_table": (StandIn("K", "cafe-table", "040324ca1550c657f37a", triangles=700),),
    "cafe_parasol": (
        StandIn("Z", "umbrella", "7725ca377ca7c250ea86", triangles=900),
        StandIn("K", "cafe-table", "040324ca1550c657f37a", triangles=700, box=(-0.4, -0.4, 0, 0.4, 0.4, 0.75)),
        StandIn("S", "chair4", "1a2d9ebd3f8045c4efb7", box=(0.5, -0.22, 0, 0.93, 0.22, 0.9), turn=2),
        StandIn("S", "chair4", "1a2d9ebd3f8045c4efb7", box=(-0.93, -0.22, 0, -0.5, 0.22, 0.9)),
        StandIn("S", "chair4", "1a2d9ebd3f8045c4efb7", box=(-0.22, 0.5, 0, 0.22, 0.93, 0.9), turn=3),
    ),
    "swing": (StandIn("Z", "childSwing", "62792c1e9efe29c30d96"),),
    "springy": (StandIn("Z", "motorbike", "3f6d20b03e6c5aec9bfc", turn=1),),
    "seesaw": (StandIn("Z", "seesaw", "725ce2980ac63acc3a93", turn=1),),
    "sandpit": (StandIn("S", "sandpit", "b0d3d71f2dd2a85de0f8"),),
    "goal": (StandIn("S", "big-football-goal", "07ad4b34f220119948d4"),),
    "tent": (StandIn("S", "barnum", "2a1c72d9383e0b37226d"),),
    "tent_small": (StandIn("S", "campingTent", "02a681c1e0e7b134be4f", whole=True),),
    "stone": (StandIn("Z", "rock3", "d0335a04e8561cf9591a"),),
    "rock": (StandIn("Z", "rock2", "6b8dfc15501fbd0a8ed8"),),
    "planter": (StandIn("S", "maceta", "fe4fca18f97418c808e0", triangles=1000),),
    "lantern": (StandIn("K", "classic-lamppost", "813fcbfc39aaf3fd1853", glow=("Glass",)),),
    "fire_hydrant": (StandIn("K", "fire-hydrant", "7276578466a0030a1254", triangles=700),),
    "bicycle_parking_small": (
        own_model("bicycle_stand", -0.425),
        own_model("bicycle_stand", 0.425),
        StandIn("S", "bicycle", "915c20d1ad098dd7c06c", box=(-0.81, -0.515, 0, 0.91, -0.055, 0.99)),
    ),
    "bicycle_parking": (
        own_model("bicycle_parking_empty"),
        StandIn("S", "bicycle", "915c20d1ad098dd7c06c", box=(-0.81, -0.515, 0, 0.91, -0.055, 0.99)),
    ),
    "bicycle_parking_large": (
        own_model("bicycle_stand", -2.125),
        own_model("bicycle_parking_empty"),
        own_model("bicycle_stand", 2.125),
        StandIn("S", "bicycle", "915c20d1ad098dd7c06c", box=(-0.81, -0.515, 0, 0.91, -0.055, 0.99)),
    ),
    "motorcycles": (
        StandIn("S", "yamaha-yzr-r6", "293fed98f4bf2d8c4e71", box=(-0.96, -0.83, 0, 0.98, -0.1, 1.07)),
        StandIn("S", "scooter2", "5e896b81ba793453d1cf", box=(-0.8, 0.1, 0, 0.8, 0.75, 1.07)),
    ),
    "bed_double": (StandIn("S", "bed1", "eb7d5fb8050b70071292", triangles=1000),),
    "bed_single": (
        StandIn("B", "juniorBed", "e114efd1de1fc4411ba6", triangles=900, box=(-1.05, -0.47, 0, 1.02, 0.47, 0.72)),
    ),
    "bed_bunk": (StandIn("B", "bunkBed", "17417c0b1dbae07fb751", triangles=1200),),
    "hospital_bed": (StandIn("S", "hospital-bed", "80cd76dcfed95d6e1970", box=(-1.02, -0.47, 0, 1.02, 0.47, 0.83)),),
    "sofa": (StandIn("S", "clear_sofa", "7e9570f88644167a96a6", triangles=1000),),
    "sofa_teal": (StandIn("B", "sofa3", "82dab2fdcbdcb9959ad5", triangles=900),),
    "armchair": (StandIn("Z", "armchair2", "3277ccef85587d9fa9df", triangles=900),),
    "dining_table": (StandIn("S", "table4", "690e09bdb2ab806fde6c"),),
    "kitchen_table": (StandIn("B", "table", "8b46ea0e5943dae52a10"),),
    "large_table": (StandIn("Z", "table", "b7cffce030cc204a6987"),),
    "work_table": (StandIn("S", "wooden_office_alder_table", "61c50d11feec55636d3d", triangles=500),),
    "restaurant_table": (StandIn("S", "round-table", "dadf7aec85ebdb2fc553"),),
    "coffee_table": (StandIn("S", "saloon_table", "e672096a1af83fe5fc94", triangles=700),),
    "side_table": (StandIn("S", "bar_table", "1de6fcb4d836c3f7501b", triangles=500),),
    "bedside_table": (StandIn("Z", "bedsideTable2", "b0e901dc394e9910700b"),),
    "chair": (StandIn("S", "chair4", "1a2d9ebd3f8045c4efb7"),),
    "restaurant_chair": (StandIn("S", "chair", "b0d514e66d8e5598a934", triangles=500),),
    "office_chair": (StandIn("S", "office_chair", "65bc22b6ab39ca3a27d1", triangles=900),),
    "bar_stool": (StandIn("Z", "stool2", "0d38b08a5016ed9076c2", triangles=450),),
    "stool": (StandIn("Z", "stool2", "0d38b08a5016ed9076c2", triangles=450),),
    "school_desk": (StandIn("S", "table-with-leaning-feet", "1c6c9430e101881c690a"),),
    "desk": (
        StandIn("B", "simpleDesk", "ca7009b9672ac27dc1ce", box=(-0.375, -0.75, 0, 0.375, 0.75, 0.74)),
        StandIn("S", "apple_pc", "6c7e0542fdfb106203c4", triangles=900, box=(-0.3, -0.25, 0.74, 0.1, 0.25, 1.16)),
    ),
    "television": (
        StandIn("B", "tvStand", "2b73a37b661c809ceb27", box=(-0.21, -0.75, 0, 0.21, 0.75, 0.5)),
        StandIn("S", "wall-flat-tv", "ebb8d0068abc061b9ec8", box=(-0.05, -0.55, 0.5, 0.05, 0.55, 1.22)),
    ),
    "bookcase": (StandIn("K", "full-bookcase", "dbcffaffd7731b4e681e", triangles=900),),
    "wardrobe": (StandIn("B", "wardrobe2", "07611d2f4d30244b31f7", triangles=700),),
    "chest_of_drawers": (StandIn("B", "dresserWithDrawers", "ad180c56eceb62e74cc3", triangles=700),),
    "kitchen": (
        StandIn("Z", "drawersCabinet", "f8f95398755479558ab7", box=(-0.31, -1.22, 0, 0.31, -0.61, 0.92)),
        StandIn("Z", "lowerCabinet", "151f83c4a4681d6dad8c", box=(-0.31, -0.61, 0, 0.31, 0, 0.92)),
        StandIn("Z", "lowerCabinet", "151f83c4a4681d6dad8c", box=(-0.31, 0, 0, 0.31, 0.61, 0.92)),
        StandIn("Z", "lowerCabinet", "151f83c4a4681d6dad8c", box=(-0.31, 0.61, 0, 0.31, 1.22, 0.92)),
        StandIn("Z", "upperCabinet", "041781fc38cf6986e781", box=(-0.31, -1.22, 1.35, 0.09, -0.61, 2.07)),
        StandIn("Z", "upperCabinet", "041781fc38cf6986e781", box=(-0.31, -0.61, 1.35, 0.09, 0, 2.07)),
        StandIn("Z", "upperCabinet", "041781fc38cf6986e781", box=(-0.31, 0, 1.35, 0.09, 0.61, 2.07)),
        StandIn("Z", "upperCabinet", "041781fc38cf6986e781", box=(-0.31, 0.61, 1.35, 0.09, 1.22, 2.07)),
        StandIn("S", "induction-cooker-4-zones", "dc402ce02ba3838d44f8", box=(-0.25, -0.6, 0.92, 0.25, -0.02, 0.93)),
    ),
    "fridge": (StandIn("K", "fridge", "d8983b17c68690ae469f"),),
    "washing_machine": (StandIn("S", "clothes_washing_machine", "02a3b9faaed268bf6283", triangles=700),),
    "toilet": (StandIn("Z", "toiletsUnit", "326715c500beb89d8243", triangles=700),),
    "bathtub": (StandIn("B", "bath_jay_hardy", "d35e822532729833d7fa"),),
    "shower": (StandIn("Z", "showerStall", "cb641dbc1c3f276193da"),),
    "floor_lamp": (StandIn("S", "living_lamp", "feb1ab1ea448951e9f43", triangles=700),),
    "pot_plant": (
        StandIn("S", "maceta", "fe4fca18f97418c808e0", triangles=900, box=(-0.28, -0.26, 0, 0.28, 0.26, 0.72)),
    ),
    "table_lamp": (StandIn("S", "little_lamp2", "cb19f67c0bb9c1b4466e", triangles=400),),
    "exercise_bike": (StandIn("S", "indoor-bike", "441f00e24e4c507eba14"),),
    "water_cooler": (StandIn("S", "water_cooler", "c9e2fbe7d87dcd94330e", triangles=600),),
    "printer": (StandIn("S", "inkjet_and_scanner_printer", "614342c20bc14b65927a"),),
    "pool_table": (StandIn("Z", "poolTable", "d68e5eeb9e7ac61e35e5"),),
    "fireplace": (StandIn("S", "fireplace1", "f4389442c1ef9d04f925"),),
    "rug": (StandIn("K", "oriental-rug", "526ab407b117d9cb704f"),),
    "mat": (StandIn("S", "doormat", "54f124d1dbd4daa22409"),),
    "newspaper": (StandIn("K", "newspaper", "34e36f91e9214743aa60"),),
    "phone": (StandIn("Z", "iphone", "1ab6ae0b082345a56698"),),
    "tablet": (StandIn("S", "tablet", "71996fb28d132955e032"),),
    "coffee_machine": (StandIn("S", "coffee_machine", "75ba2febd80a06cb86d2", triangles=900),),
    "toaster": (StandIn("S", "toaster", "c3ecdd33a709be456bb8", triangles=450),),
    "cardboard_box": (StandIn("S", "cardboard-box", "98b256ab2494289bc04d"),),
    "towels": (StandIn("S", "com_bath3_toalla", "94c635be7196de54fe80", triangles=300),),
    "folded_clothes": (StandIn("S", "folded_clothes", "4cf9d52daefab522ad23", triangles=450, turn=1),),
    "wine_bottle": (StandIn("S", "wine_bottle", "41a510dde327736f11b1", triangles=250),),
    "mug": (StandIn("K", "coffee-mug", "b3622143bae04b37f8a3", triangles=220),),
    "cup": (StandIn("Z", "caffe_final", "f2760ad0b92282c57578", triangles=280),),
    "remote": (StandIn("S", "tv-remote-control", "8ecf03718d641167cd38"),),
    "fruit_bowl": (StandIn("S", "bowlWithFruits", "e897fde8c0f887066d2f", triangles=600),),
    "car_red": (StandIn("S", "chevrolet", "fc578f8a13bb31d0e3a5", triangles=2500),),
    "car_grey": (StandIn("S", "suv", "8cb8e158e50609022995", triangles=2500),),
}


PACK = "sweethome3d-furniture"
_SCHEMA = "vico.things"
_MINUTES = 20
# Raise when what is baked changes beside the table, so that older caches are left alone.
_BAKE = 2


@dataclass(frozen=True)
class Credit:
    """Whom a world owes thanks for models of one collection.

    Attributes
    ----------
    collection
        Name of the collection, with the pack's.
    licence
        SPDX identifier.
    words
        The models, who made them, and that they were changed.
    """

    collection: str
    licence: str
    words: str


def our_models() -> dict[str, Model]:
    """All models of ours that stand in worlds, by name."""
    return {**street_models(), **furniture_models()}


def fetch_things(pack: Path | None = None, *, force: bool = False, say: Callable[[str], None] = lambda _: None) -> Path:
    """Find or fetch the pack, and bake its models into the cache.

    Parameters
    ----------
    pack
        A ``.deb`` of the pack or a folder with its archives; None: where the system has it installed, else what
        ``apt-get download`` gives (nothing is installed on the system, and the download is not kept).
    force
        Bake again even if that was done.
    say
        Told what happens, with licences and credits, a sentence a call.

    Returns
    -------
    Path
        The baked file.

    Raises
    ------
    FetchError
        If it is not there and can't be fetched.
    MissingFileError, IntegrityError
        If `pack` is not it, or is damaged.
    """
    baked = baked_things()
    if available_things() and not force and pack is None:
        say(f"things: {PACK} is in {baked}")
        return baked
    if pack is None and any((SYSTEM_FOLDER / f"{c.file}.sh3f").is_file() for c in COLLECTIONS.values()):
        pack = SYSTEM_FOLDER
    if pack is not None:
        _bake(archives(pack), baked, say)
    else:
        baked.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=baked.parent, prefix=f".{PACK}-") as folder:
            _bake(archives(_download_package(Path(folder), say)), baked, say)
    return baked


def _download_package(folder: Path, say: Callable[[str], None]) -> Path:
    """Have apt download the package; it checks the archive's signature."""
    mend = (
        f"get {PACK}'s .deb from a Debian or Ubuntu mirror and type `vico assets install things --pack FILE`; "
        "until then our own models serve"
    )
    if shutil.which("apt-get") is None:
        raise FetchError(f"things: this machine has no apt-get: {mend}")
    say(f"fetching {PACK} (120 MB) with apt-get download")
    command = ["apt-get", "-q", "download", PACK]
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=60 * _MINUTES, check=False,
            env={**os.environ, "LC_ALL": "C"},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise FetchError(f"things: apt-get did not finish in {_MINUTES} minutes: {mend}") from None
    found = sorted(folder.glob(f"{PACK}_*.deb"))
    if done.returncode or len(found) != 1:
        words = [line for line in done.stderr.splitlines() if line.startswith("E:")] or ["it gave no file"]
        raise FetchError(f"things: apt-get can't download {PACK} ({words[-1]}): run apt-get update, or {mend}")
    return found[0]


def _bake(opened: Mapping[str, Archive], path: Path, say: Callable[[str], None]) -> None:
    """Make every stand-in, and keep them with who made them; one that can't be made is left out and told."""
    solids: dict[tuple[str, str], tuple[ArchiveEntry, ObjMesh]] = {}

    def look(piece: StandIn) -> tuple[ArchiveEntry, ObjMesh]:
        key = piece.pack, piece.name
        if key not in solids:
            archive = opened.get(piece.pack)
            if archive is None:
                raise IntegrityError(f"the pack lacks {COLLECTIONS[piece.pack].file}.sh3f")
            entry = archive.entries.get(piece.name)
            if entry is None:
                raise IntegrityError(f"{archive.name} lacks {piece.name}")
            solid = read_obj(entry.model, archive.read)
            if not solid.digest.startswith(piece.digest):
                raise IntegrityError(f"{archive.name}: {piece.name} is not the one this version of vico was tried with")
            solids[key] = entry, solid
        return solids[key]

    models = our_models()
    layers: dict[str, Sequence[Surface]] = {}
    made_of: dict[str, list[dict[str, str]]] = {}
    with ExitStack() as stack:
        for archive in opened.values():
            stack.enter_context(archive)
        say(f"things: thinning and fitting {len(STAND_INS)} models")
        for name, pieces in STAND_INS.items():
            try:
                parts: list[Surface] = []
                for stand_in in pieces:
                    if stand_in.pack == OURS:
                        x, y = stand_in.box[:2] if stand_in.box else (0.0, 0.0)
                        parts += [surface.moved(pose_matrix(x, y)) for surface in models[stand_in.name].surfaces]
                    else:
                        parts += _place_stand_in(stand_in, models[name], *look(stand_in))
                layers[name] = merge_surfaces(parts)
            except IntegrityError as error:
                say(f"things: {name} stays our own model: {error}")
                continue
            foreign = {(p.pack, p.name): look(p)[0].creator for p in pieces if p.pack != OURS}
            made_of[name] = [{"pack": k[0], "name": k[1], "creator": who} for k, who in sorted(foreign.items())]
    if not layers:
        raise IntegrityError(f"things: none of the models could be made of this pack; is it {PACK} 1.8?")
    write_glb(path, layers)
    write_json(_record(path), {"schema": _SCHEMA, "sha256": sha256_of(path), "models": made_of})
    read_things.cache_clear()
    for credit in credits_of(layers):
        say(f"{credit.collection}: {credit.licence}. {credit.words}")


def _record(path: Path) -> Path:
    return path.with_suffix(".json")


@cache
def baked_things() -> Path:
    """Where the baked models are, or would be, for this version's choice of them."""
    choice = hashlib.sha256(repr((_BAKE, sorted(STAND_INS.items()))).encode()).hexdigest()[:16]
    return cache_folder() / "baked" / f"things-{choice}.glb"


def available_things() -> bool:
    """Whether the pack's models are baked and whole."""
    try:
        read_things()
    except (MissingExtraError, SchemaError):
        return False
    return True


@cache
def read_things() -> tuple[dict[str, list[Surface]], dict[str, list[dict[str, str]]], str]:
    """Return surfaces by the name of our model, what each is made of, and the SHA-256 of all.

    Raises
    ------
    MissingExtraError
        If nothing was baked.
    SchemaError
        If the cache is damaged.
    """
    path = baked_things()
    mend = "type `vico assets install things --force`"
    try:
        record = read_json(_record(path))
        if record["schema"] != _SCHEMA or record["sha256"] != sha256_of(path):
            raise ValueError
        made_of = {
            str(name): [{key: str(row[key]) for key in ("pack", "name", "creator")} for row in rows]
            for name, rows in record["models"].items()
        }
        if any(row["pack"] not in COLLECTIONS for rows in made_of.values() for row in rows):
            raise ValueError
    except FileNotFoundError:
        raise MissingExtraError("things: no pack of models is installed; type `vico assets install things`") from None
    except (KeyError, TypeError, AttributeError, ValueError):
        raise SchemaError(f"{path}: not what was baked there; {mend}") from None
    return read_glb(path), made_of, str(record["sha256"])


def credits_of(names: Iterable[str]) -> list[Credit]:
    """Whom to thank for these of the stand-ins, a row for each collection they are from."""
    _, made_of, _ = read_things()
    rows = {(row["pack"], row["creator"], row["name"]) for name in names for row in made_of.get(name, ())}
    found: list[Credit] = []
    for letter, collection in COLLECTIONS.items():
        by: dict[str, list[str]] = {}
        for pack, creator, name in sorted(rows):
            if pack == letter:
                by.setdefault(creator or collection.owner, []).append(name)
        if by:
            words = "; ".join(f"{', '.join(models)} by {who}" for who, models in by.items())
            credit = f"{words} ({collection.owner}); thinned and fitted"
            found.append(Credit(f"{PACK}, {collection.file}", collection.licence, credit))
    return found
