"""Cladding: what every triangle of a building is covered with: its material, its colour, its texture coordinates."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from vico.seeds import rng
from vico.threads import in_order
from vico.world.mesh import Material, Surface
from vico.world.model import FIRST_BUILDING
from vico.worldgen.buildings.solids import Footing, SolidMesh
from vico.worldgen.buildings.walls import (
    WallLines,
    WallSide,
    cut_at_heights,
    lines_of_faces,
    storeys_of,
    without_needless,
)
from vico.worldgen.facades import walls
from vico.worldgen.facades.facade_styles import FacadeStyle, styles
from vico.worldgen.facades.records import LONGEST_NAME, Finish, Rgb
from vico.worldgen.facades.textures.materials import material
from vico.worldgen.facts.building_plans import BuildingPlan, PartPlan

_SHOPS = ("ground_shops", "ground_cafes")
_LABEL = f"U{LONGEST_NAME}"  # of materials in arrays


class _SurfaceBatch:
    """Triangles of one material while they are gathered."""

    def __init__(self) -> None:
        self.positions: list[NDArray[np.float64]] = []
        self.uv: list[NDArray[np.float64]] = []
        self.colour: list[NDArray[np.uint8]] = []
        self.entity: list[NDArray[np.int32]] = []

    def surface(self, stuff: Material) -> Surface:
        """One surface, flat-shaded, equal corners shared."""
        positions = np.concatenate(self.positions)
        corners = positions.astype(np.float32).reshape(-1, 3)
        flat = np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0])
        flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-12)
        normals = np.repeat(np.round(flat, 4), 3, axis=0).astype(np.float32) + np.float32(0)
        uv = np.round(np.concatenate(self.uv).reshape(-1, 2), 5).astype(np.float32) + np.float32(0)
        colour = np.repeat(np.concatenate(self.colour), 3, axis=0)
        entity = np.repeat(np.concatenate(self.entity), 3)
        packed = np.column_stack([corners, normals, uv, entity.astype(np.float32)])
        rows = np.ascontiguousarray(packed).view(np.dtype((np.void, packed.dtype.itemsize * 9))).ravel()
        _, index, inverse = np.unique(rows, return_index=True, return_inverse=True)
        normals = normals[index]
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        return Surface(
            np.ascontiguousarray(corners[index]),
            normals,
            np.ascontiguousarray(uv[index]),
            np.ascontiguousarray(colour[index]),
            np.ascontiguousarray(entity[index]),
            inverse.reshape(-1, 3).astype(np.int32),
            stuff,
        )


class Zone(IntEnum):
    """Parts of a building that wear something of their own."""

    ROOF = 0  # and undersides
    BLANK = 1
    PLINTH = 2
    SHOPFRONT = 3
    GROUND_FLOOR = 4
    UPPER_FLOORS = 5
    BACK = 6  # upper floors away from streets
    GABLE = 7  # of a front, above the eaves


_WITHOUT_BAYS = (Zone.BLANK, Zone.PLINTH, Zone.GABLE)
_SHOP_BAY = 4.2  # metres
_WHITE: Rgb = (255, 255, 255)
_PLINTH_STONE: Rgb = (206, 202, 196)


@dataclass(frozen=True)
class _Levels:
    """Heights of all parts, metres above the origin's, and how their storeys are divided; shape ``(parts,)`` each.

    Attributes
    ----------
    base, ground_top, eaves
        Where the ground floor begins and ends, and where the walls end.
    plinth
        Below this a wall is stone; NaN: it has no plinth.
    small
        Whether it is a small solid with a finish.
    by_storey
        Whether its picture begins at the first floor: that of halls, and of families whose storeys are unlike.
    whole
        Small solids that are not cut at their eaves.
    storeys
        Rows of windows.
    """

    base: NDArray[np.float64]
    ground_top: NDArray[np.float64]
    eaves: NDArray[np.float64]
    plinth: NDArray[np.float64]
    small: NDArray[np.bool_]
    by_storey: NDArray[np.bool_]
    whole: NDArray[np.bool_]
    storeys: NDArray[np.float64]


@dataclass(frozen=True)
class _Faces:
    """The triangles of all walls and roofs: corners, normals, whose part, entity, and the wall line of each or -1."""

    corner: NDArray[np.float64]
    normal: NDArray[np.float64]
    owner: NDArray[np.int64]
    entity: NDArray[np.int32]
    line: NDArray[np.int64]


def textured_surfaces(
    mesh: SolidMesh,
    edges: WallLines,
    plans: list[BuildingPlan],
    seats: list[Footing],
    looks: list[FacadeStyle],
    seed: int,
) -> tuple[list[Surface], list[Surface]]:
    """Give every triangle its material and texture coordinates; cut walls where the material changes.

    Parameters
    ----------
    mesh
        The solids.
    edges
        The lines of their walls.
    plans, seats
        The buildings.
    looks
        What each part of each wears.
    seed
        Decides where on its sheet each wall begins.

    Returns
    -------
    tuple
        Walls and roofs.
    """
    if not len(mesh.faces):
        return [], []
    parts = [part for plan in plans for part in plan.solids]
    levels = _levels(mesh, parts, plans, seats, looks)
    mesh = _cut(mesh, levels)
    corner = mesh.points[mesh.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    line = lines_of_faces(corner.mean(axis=1), normal, mesh.part, edges)
    entity = (FIRST_BUILDING + mesh.plan_of_part[mesh.part]).astype(np.int32)
    faces = _Faces(corner, normal, mesh.part, entity, line)
    zone = _zones(faces, edges, levels)
    of = mesh.plan_of_part
    shops = [_SHOPS[zlib.crc32(plans[p].id.encode()) % len(_SHOPS)] for p in of]
    wardrobe = _PartMaterials.of(parts, looks, shops)
    shift = _phases(edges, plans, seed)
    walls: dict[str, _SurfaceBatch] = {}
    roofs: dict[str, _SurfaceBatch] = {}
    for k in Zone:
        chosen = np.flatnonzero(zone == k)
        if not len(chosen):
            continue
        mine = faces.owner[chosen]
        if k == Zone.ROOF:
            label, colour, under = wardrobe.roof(mine, faces.normal[chosen])
            uv = _slope_uv(faces.corner[chosen], faces.normal[chosen], label)
            _add_faces(roofs, faces, label[~under], chosen[~under], uv[~under], colour[~under])
            _add_faces(walls, faces, label[under], chosen[under], uv[under], colour[under])
            continue
        label = wardrobe.names[k][mine]
        if k in _WITHOUT_BAYS:
            uv = _blank_uv(faces.corner[chosen], faces.normal[chosen], label)
        else:
            bay = np.full(len(mine), _SHOP_BAY) if k == Zone.SHOPFRONT else wardrobe.bay[mine]
            uv = _bay_uv(faces, chosen, k, bay, edges, levels, shift)
        _add_faces(walls, faces, label, chosen, uv, wardrobe.tints[k][mine])

    def surfaces(piles: dict[str, _SurfaceBatch]) -> list[Surface]:
        return list(in_order(lambda name: piles[name].surface(material(name)), sorted(piles)))

    return surfaces(walls), surfaces(roofs)


def _levels(
    mesh: SolidMesh, parts: list[PartPlan], plans: list[BuildingPlan], seats: list[Footing], looks: list[FacadeStyle]
) -> _Levels:
    of = mesh.plan_of_part
    base = np.array([seats[p].base for p in of])
    bottom = np.array([seats[p].bottom for p in of])
    small = np.array([bool(part.finish) for part in parts])
    low = np.array([part.low for part in parts])
    eaves = base + np.array([part.eaves for part in parts])
    # Halls and churches have one row of windows from a low base to the eaves.
    hall = np.array([look.hall for look in looks]) & ~small
    divided = [storeys_of(plans[p], part, hall=bool(h)) for p, part, h in zip(of, parts, hall, strict=True)]
    ground_top = base + np.array([storeys.bottom for storeys in divided])
    base = np.where(small, base + low, base)  # a picture on a small solid runs from its underside to its eaves
    plinth = np.where((base - bottom > 0.75) & (low <= 0) & ~small, base, np.nan)
    whole = small & ~np.array([part.finish == "dormer" for part in parts])
    storeys = np.array([storeys.count for storeys in divided])
    families = styles().families
    by_storey = hall | np.array([families[look.wall].by_storey for look in looks])
    return _Levels(base, ground_top, eaves, plinth, small, by_storey, whole, storeys)


def _cut(mesh: SolidMesh, levels: _Levels) -> SolidMesh:
    """Return the solids with walls cut at their plinths, at the tops of their ground floors and at their eaves."""
    points, faces, owner = mesh.points, mesh.faces, mesh.part
    floors = np.where(levels.ground_top < levels.eaves - 0.2, levels.ground_top, np.nan)
    for heights in (levels.plinth, floors, np.where(levels.whole, np.nan, levels.eaves)):
        points, faces, owner = cut_at_heights(points, faces, owner, heights)
    faces, owner = without_needless(points, faces, owner, len(mesh.points))
    return replace(mesh, points=points, faces=faces, part=owner)


def _zones(faces: _Faces, edges: WallLines, levels: _Levels) -> NDArray[np.int64]:
    """Return which zone each triangle lies in, by height and by what its wall shows."""
    owner, height = faces.owner, faces.corner.mean(axis=1)[:, 2]
    style = np.where(faces.line >= 0, edges.style[faces.line], WallSide.BLANK)
    zone = np.where(style == WallSide.BLANK, Zone.BLANK, Zone.UPPER_FLOORS)
    zone[(zone == Zone.UPPER_FLOORS) & (height > levels.eaves[owner])] = Zone.GABLE
    zone[(zone == Zone.GABLE) & levels.small[owner]] = Zone.BLANK
    zone[(zone == Zone.UPPER_FLOORS) & (height < levels.ground_top[owner])] = Zone.GROUND_FLOOR
    zone[(zone == Zone.GROUND_FLOOR) & (style == WallSide.SHOPFRONT)] = Zone.SHOPFRONT
    zone[(zone == Zone.UPPER_FLOORS) & (style == WallSide.BACK)] = Zone.BACK
    zone[(height < levels.plinth[owner])] = Zone.PLINTH
    zone[~(np.abs(faces.normal[:, 2]) < 0.15)] = Zone.ROOF
    return zone


_Covering = tuple[str, Rgb]  # a material's name and its tint


def _zone_coverings(look: FacadeStyle, shop: str) -> dict[Zone, _Covering]:
    """Return what each zone of a part wears that has no finish of its own."""
    return {
        Zone.ROOF: (look.roof, look.roof_tint),
        Zone.BLANK: (look.blank, look.tint),
        Zone.PLINTH: ("blank_stone", _PLINTH_STONE),
        Zone.SHOPFRONT: (shop, _WHITE),
        Zone.GROUND_FLOOR: (look.ground, look.ground_tint),
        Zone.UPPER_FLOORS: (look.wall, look.tint),
        Zone.BACK: (look.back, look.back_tint),
        Zone.GABLE: (look.gable, look.gable_tint) if look.gable else (look.blank, look.tint),
    }


def _finish_coverings(finish: Finish, look: FacadeStyle) -> dict[Zone, _Covering]:
    """Return what a finish has zones wear instead."""
    tint = look.tint if finish.as_wall else finish.tint
    worn = {Zone.BLANK: (finish.side, tint), Zone.GROUND_FLOOR: (finish.picture or finish.side, tint)}
    if finish.cover:
        worn[Zone.ROOF] = (finish.cover, finish.cover_tint)
    return worn


@dataclass(frozen=True)
class _PartMaterials:
    """Materials and colours of every part: by zone, and of undersides and flat roofs; shape ``(parts, ...)`` each."""

    names: dict[Zone, NDArray[np.str_]]
    tints: dict[Zone, NDArray[np.uint8]]
    bay: NDArray[np.float64]
    own_cover: NDArray[np.bool_]
    under: NDArray[np.str_]
    under_tint: NDArray[np.uint8]
    flat_tint: NDArray[np.uint8]

    @classmethod
    def of(cls, parts: list[PartPlan], looks: list[FacadeStyle], shops: list[str]) -> _PartMaterials:
        """Open it: small solids wear their finish, all others their building's look."""
        finishes = styles().finishes
        worn = [finishes[part.finish] if part.finish else None for part in parts]
        clothes = [_zone_coverings(look, shop) for look, shop in zip(looks, shops, strict=True)]
        under: list[_Covering] = []
        for outfit, finish, look in zip(clothes, worn, looks, strict=True):
            if finish is not None:
                outfit |= _finish_coverings(finish, look)
            under.append(
                ("blank_plaster", outfit[Zone.ROOF][1]) if finish is None else (finish.under, finish.under_tint)
            )
        return cls(
            {zone: np.array([outfit[zone][0] for outfit in clothes], _LABEL) for zone in Zone},
            {zone: np.array([outfit[zone][1] for outfit in clothes], np.uint8) for zone in Zone},
            np.array([look.bay if finish is None else finish.bay for finish, look in zip(worn, looks, strict=True)]),
            np.array([finish is not None and bool(finish.cover) for finish in worn]),
            np.array([name for name, _ in under], _LABEL),
            np.array([tint for _, tint in under], np.uint8),
            np.array([look.flat_tint for look in looks], np.uint8),
        )

    def roof(
        self, part: NDArray[np.int64], normal: NDArray[np.float64]
    ) -> tuple[NDArray[np.str_], NDArray[np.uint8], NDArray[np.bool_]]:
        """Return what faces of roofs wear, in which colour, and which of them face down: level ones are gravel."""
        label = self.names[Zone.ROOF][part]
        level = (normal[:, 2] > 0.97) & ~self.own_cover[part]
        colour = self.tints[Zone.ROOF][part].copy()
        felt = level & (label != "roof_gravel")
        colour[felt] = self.flat_tint[part][felt]
        label = np.where(level, "roof_gravel", label).astype(_LABEL)
        under = normal[:, 2] < 0
        label[under], colour[under] = self.under[part][under], self.under_tint[part][under]
        return label, colour, under


def _blank_uv(corner: NDArray[np.float64], normal: NDArray[np.float64], label: NDArray[np.str_]) -> NDArray[np.float64]:
    """Return texture coordinates on walls without bays: metres along and up, by the texture's size."""
    blank = styles().blank_walls
    size = np.array([blank[name].tile if name in blank else 1.0 for name in label])
    along = np.einsum("nki,ni->nk", corner[..., :2], np.stack([-normal[:, 1], normal[:, 0]], 1))
    return np.stack([along, corner[..., 2]], axis=-1) / size[:, None, None]


def _bay_uv(
    faces: _Faces,
    chosen: NDArray[np.int64],
    zone: Zone,
    bay: NDArray[np.float64],
    edges: WallLines,
    levels: _Levels,
    shift: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return texture coordinates on walls in whole bays, and on upper floors in whole storeys."""
    mine, line, corner = faces.owner[chosen], faces.line[chosen], faces.corner[chosen]
    start = edges.start[line]
    direction = edges.end[line] - start
    length = np.maximum(np.hypot(*direction.T), 1e-6)
    direction = direction / length[:, None]
    along = np.einsum("nki,ni->nk", corner[..., :2] - start[:, None, :], direction)
    count = walls.bays(length, bay)
    u = walls.bay_coordinates(along, length[:, None], count[:, None]) + shift[line, :1]
    z, base, top = corner[..., 2], levels.base[mine], levels.ground_top[mine]
    if zone in (Zone.UPPER_FLOORS, Zone.BACK):
        v = walls.storey_coordinates(z, top[:, None], levels.eaves[mine][:, None], levels.storeys[mine][:, None])
        v = v + np.where(levels.by_storey[mine][:, None], 0.0, shift[line, 1:])
    else:
        v = np.clip((z - base[:, None]) / (top - base)[:, None], 0.004, 0.996)
        v = v * np.where(levels.small[mine], levels.storeys[mine], 1.0)[:, None]  # an oriel's storeys are alike
    return np.stack([u, v], axis=-1)


def _phases(edges: WallLines, plans: list[BuildingPlan], seed: int) -> NDArray[np.float64]:
    """Where on its sheet each wall begins, in quarters of a sheet along and up: a building's own draws."""
    made, k = [np.zeros((0, 2), np.int64)], 0
    for plan in plans:
        count = int(edges.first[k + len(plan.solids)] - edges.first[k])
        made.append(rng(seed, "bays", plan.id).integers(0, 4, (count, 2)))
        k += len(plan.solids)
    return np.concatenate([*made, np.zeros((1, 2), np.int64)]).astype(np.float64) / 4


def _add_faces(
    piles: dict[str, _SurfaceBatch],
    faces: _Faces,
    labels: NDArray[np.str_],
    chosen: NDArray[np.int64],
    uv: NDArray[np.float64],
    colour: NDArray[np.uint8],
) -> None:
    """Put chosen faces on the piles of their materials."""
    for name in np.unique(labels).tolist():
        here = labels == name
        pile = piles.setdefault(str(name), _SurfaceBatch())
        pile.positions.append(faces.corner[chosen[here]])
        # Whole sheets off the coordinates: small numbers keep their digits in float32.
        pile.uv.append(uv[here] - np.floor(uv[here].min(axis=1, keepdims=True)))
        pile.colour.append(colour[here])
        pile.entity.append(faces.entity[chosen[here]])


def _slope_uv(corner: NDArray[np.float64], normal: NDArray[np.float64], label: NDArray[np.str_]) -> NDArray[np.float64]:
    """Texture coordinates on slopes: u level, v up the slope."""
    level = np.stack([-normal[:, 1], normal[:, 0], np.zeros(len(normal))], axis=1)
    size = np.linalg.norm(level, axis=1, keepdims=True)
    level = np.where(size > 0.05, level / np.maximum(size, 1e-9), (1.0, 0.0, 0.0))
    up = np.cross(normal, level)
    roofs = styles().roofs
    tile = np.array([roofs[str(name)].tile if str(name) in roofs else 3.0 for name in label])[:, None]
    return np.stack(
        [np.einsum("nki,ni->nk", corner, level) / tile, np.einsum("nki,ni->nk", corner, up) / tile], axis=-1
    )
