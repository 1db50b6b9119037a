"""Buildings as closed solids on the terrain, dressed, with their records and collision bodies."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo.osm import OsmData, OsmWay, polygons_of
from vico.world.heights import HeightField
from vico.world.mesh import Material, Surface
from vico.world.model import FIRST_BUILDING, Building, Dropped
from vico.world.products import turned
from vico.world.seeds import rng
from vico.world.threads import in_order
from vico.worldgen.buildings.details import detailed
from vico.worldgen.buildings.finishes import FINISHES
from vico.worldgen.buildings.outlines import BuildingPlan, PartPlan, building_plans
from vico.worldgen.buildings.outlines_plans import RULES
from vico.worldgen.buildings.roof_shapes import rings_of
from vico.worldgen.buildings.solids import (
    Mesh,
    Seat,
    SolidMesh,
    collision_bodies,
    leaky,
    part_mesh,
    seat_of,
    solid_meshes,
)
from vico.worldgen.buildings.storeys import storeys_of
from vico.worldgen.facades import looks as facades
from vico.worldgen.facades.cuts import cut_at_heights, without_needless
from vico.worldgen.facades.looks import BACK, BLANK, FRONT, SHOPFRONT, Look
from vico.worldgen.facades.textures import material
from vico.worldgen.streets.streets import on_the_ground

_FRONT_REACH = 17.0  # metres from a street's centre line within which a wall faces it
_SHOPS = ("ground_shops", "ground_cafes")
_KEPT_TAGS = (
    "building",
    "building:levels",
    "height",
    "roof:shape",
    "addr:street",
    "addr:housenumber",
    "amenity",
    "shop",
    "office",
    "tourism",
    "start_date",
    "wikidata",
)


@dataclass(frozen=True)
class BuildingsResult:
    """What the stage made.

    Attributes
    ----------
    records
        One a building, in the order of their entities; none is accessible yet.
    walls, roofs
        Layers "buildings" and "roofs": together closed, part by part.
    collision
        Convex prisms of the walls, one surface each, vertices shared.
    dropped
        What the map had and the world has not, with reasons.
    watertight
        Buildings all of whose solids are closed and face outwards.
    rules
        How many heights each rule decided (`outlines_plans.RULES`).
    """

    records: list[Building]
    walls: list[Surface]
    roofs: list[Surface]
    collision: list[Surface]
    dropped: list[Dropped]
    watertight: int
    rules: dict[str, int] = field(default_factory=dict)

    @property
    def collision_faces(self) -> int:
        """Triangles of all collision bodies."""
        return sum(len(surface.triangles) for surface in self.collision)


def buildings_from_osm(
    osm: OsmData,
    terrain: HeightField,
    *,
    seed: int,
    fit: Callable[[list[BuildingPlan]], list[BuildingPlan]] | None = None,
) -> BuildingsResult:
    """Build every building of an extract whose middle lies within the world's square.

    Parameters
    ----------
    osm
        The extract.
    terrain
        What the buildings stand on.
    seed
        Decides what the map leaves open: heights, roofs, colours.
    fit
        Changes the plans before anything is built, for example to heights that were measured.

    Returns
    -------
    BuildingsResult
        Records, meshes and collision bodies.
    """
    plans, dropped = building_plans(osm, seed=seed)
    if fit is not None:
        plans = fit(plans)
    region = facades.region_of(osm.frame.lat, osm.frame.lon)
    seats = [seat_of(plan, terrain) for plan in plans]

    def look_of(plan: BuildingPlan, tags: Mapping[str, str]) -> Look:
        return facades.look_of(
            plan.use,
            {**plan.tags, **tags},
            levels=plan.levels,
            area=plan.outline.area,
            region=region,
            random=rng(seed, "facade", plan.id),
        )

    looks = _told_apart([look_of(plan, plan.parts[0].tags) for plan in plans], plans)
    streets = shapely.STRtree([shapely.LineString(way.line) for way in osm.ways if _is_street(way)])
    meshes: list[list[Mesh]] = [
        [part_mesh(part, seat) for part in plan.parts] for plan, seat in zip(plans, seats, strict=True)
    ]
    bases = [seat.base for seat in seats]
    plans = detailed(plans, meshes, looks, bases, _fronts(plans, seats, osm), streets, region=region, seed=seed)
    mesh = solid_meshes(plans, seats, meshes)
    edges = _edges(plans, seats, osm)
    # A part that is said to be of another colour or stuff is dressed by itself, with the building's own draws.
    dress = [
        look if part.finish or not _dressed_apart(part, plan) else look_of(plan, part.tags)
        for plan, look in zip(plans, looks, strict=True)
        for part in plan.solids
    ]
    walls, roofs = _dressed(mesh, edges, plans, seats, dress, seed)
    records = [
        _record(plan, FIRST_BUILDING + k, seat, look)
        for k, (plan, seat, look) in enumerate(zip(plans, seats, looks, strict=True))
    ]
    collision = [
        body
        for k, (plan, seat) in enumerate(zip(plans, seats, strict=True))
        for part in (*plan.parts, *(solid for solid in plan.rooftop if solid.finish == "post"))
        for body in collision_bodies(part, seat, FIRST_BUILDING + k)
    ]
    rules = {rule: count for rule in RULES if (count := sum(plan.rule == rule for plan in plans))}
    return BuildingsResult(records, walls, roofs, collision, dropped, len(plans) - len(leaky(mesh)), rules)


_DRESS_KEYS = (
    "building:colour",
    "building:color",
    "building:material",
    "building:facade:material",
    "roof:colour",
    "roof:color",
    "roof:material",
)


def _dressed_apart(part: PartPlan, plan: BuildingPlan) -> bool:
    first = plan.parts[0].tags
    return any(part.tags.get(key) != first.get(key) for key in _DRESS_KEYS)


def _told_apart(looks: list[Look], plans: list[BuildingPlan]) -> list[Look]:
    """No two houses side by side in the same clothes, unless the map says so."""
    outlines = [plan.outline for plan in plans]
    left, right = shapely.STRtree(outlines).query(outlines, predicate="dwithin", distance=1.0)
    pairs = sorted((i, j) for i, j in zip(left.tolist(), right.tolist(), strict=True) if i < j)
    free = [not any("colo" in key and key.startswith("building:") for key in plan.tags) for plan in plans]
    return facades.told_apart(looks, pairs, free)


def _fronts(plans: list[BuildingPlan], seats: list[Seat], osm: OsmData) -> list[list[NDArray[np.bool_]]]:
    """Of each plan's parts, which edges of the outline are fronts."""
    edges = _edges(plans, seats, osm)
    shown = (edges.style == FRONT) | (edges.style == SHOPFRONT)
    made, k = [], 0
    for plan in plans:
        row = []
        for _ in plan.solids:
            row.append(shown[edges.first[k] : edges.first[k + 1]])
            k += 1
        made.append(row)
    return made


def _is_street(way: OsmWay) -> bool:
    return (
        way.tags.get("highway") not in (None, "steps", "corridor", "elevator", "platform", "service", "path")
        and "building" not in way.tags
        and on_the_ground(way.tags)
    )


@dataclass
class _Edges:
    """Wall lines of all parts; `first[part]` is where a part's begin."""

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    style: NDArray[np.int64]
    first: NDArray[np.int64]


def _edges(plans: list[BuildingPlan], seats: list[Seat], osm: OsmData) -> _Edges:
    """Every wall's line, and what it shows: nothing towards a neighbour, a front towards a street."""
    starts: list[NDArray[np.float64]] = []
    ends: list[NDArray[np.float64]] = []
    part_of: list[int] = []
    plan_of: list[int] = []
    parts: list[PartPlan] = []
    first = [0]
    for p, plan in enumerate(plans):
        for part in plan.solids:
            for ring in rings_of(part.polygon):
                starts.append(ring)
                ends.append(np.roll(ring, -1, axis=0))
            n = sum(len(s) for s in starts[-(1 + len(part.polygon.interiors)) :])
            part_of += [len(parts)] * n
            plan_of += [p] * n
            first.append(first[-1] + n)
            parts.append(part)
    if not parts:
        return _Edges(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, np.int64), np.zeros(1, np.int64))
    start, end = np.concatenate(starts), np.concatenate(ends)
    along = end - start
    length = np.hypot(*along.T)
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.maximum(length, 1e-9)[:, None]
    middle = (start + end) / 2
    style = np.full(len(start), BACK, np.int64)
    streets = [shapely.LineString(way.line) for way in osm.ways if _is_street(way)]
    if streets:
        near = shapely.STRtree(streets).query(
            shapely.points(middle + outward * 1.0), predicate="dwithin", distance=_FRONT_REACH
        )
        style[np.unique(near[0])] = FRONT
    trading = np.array([plan.shops > 0 or plan.use in ("retail", "commercial") for plan in plans])[plan_of]
    style[(style == FRONT) & trading & (length > 2.2)] = SHOPFRONT
    # A wall against a neighbour's is a fire wall where it rises above it, and unseen where it does not.
    probes = shapely.points(middle + outward * 0.4)
    left, right = shapely.STRtree([part.polygon for part in parts]).query(probes, predicate="intersects")
    owner = np.array(plan_of)
    owner_of_part = np.array([p for p, plan in enumerate(plans) for _ in plan.solids])
    low = np.array([part.low for part in parts])
    top = np.array([seats[p].base for p in owner_of_part]) + np.array([part.eaves for part in parts])
    ground = np.array([seats[p].base for p in owner_of_part])
    mine = np.array(part_of)[left]
    # High above a low neighbour a wall has windows again; the few that are drawn below its roof are unseen.
    tall = top[right] - ground[mine] > 0.6 * (top[mine] - ground[mine])
    other = (owner[left] != owner_of_part[right]) & (low[right] <= 0.0) & tall
    style[left[other]] = BLANK
    style[length < 1.3] = BLANK
    for k, part in enumerate(parts):
        if part.finish:
            mine = style[first[k] : first[k + 1]]
            mine[:] = BLANK
            if FINISHES[part.finish].picture:
                mine[list(FINISHES[part.finish].shown) or slice(None)] = FRONT
    return _Edges(start, end, style, np.array(first))


class _Pile:
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
        packed = np.zeros((len(corners), 9), np.float32)
        packed[:, :3], packed[:, 3:6], packed[:, 6:8] = corners, normals, uv
        packed[:, 8] = entity
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


def _dressed(
    mesh: SolidMesh, edges: _Edges, plans: list[BuildingPlan], seats: list[Seat], looks: list[Look], seed: int
) -> tuple[list[Surface], list[Surface]]:
    """Give every triangle its material and texture coordinates; cut walls where the material changes."""
    if not len(mesh.faces):
        return [], []
    parts = [part for plan in plans for part in plan.solids]
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
    points, faces, owner = mesh.points, mesh.faces, mesh.part
    whole = small & ~np.array([part.finish == "dormer" for part in parts])
    for cut in (plinth, np.where(ground_top < eaves - 0.2, ground_top, np.nan), np.where(whole, np.nan, eaves)):
        points, faces, owner = cut_at_heights(points, faces, owner, cut)
    faces, owner = without_needless(points, faces, owner, len(mesh.points))
    mesh.points, mesh.faces, mesh.part = points, faces, owner
    corner = points[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    middle = corner.mean(axis=1)
    edge = _edge_of(middle, normal, owner, edges)
    upright = np.abs(normal[:, 2]) < 0.15
    shift = _phases(edges, plans, seed)
    entity = (FIRST_BUILDING + of[owner]).astype(np.int32)
    z = corner[..., 2]
    # Zones: 0 roof and undersides, 1 blank, 2 plinth, 3 shopfront, 4 ground floor, 5 upper floors, 6 those of a back,
    # 7 a gable above the eaves.
    style = np.where(edge >= 0, edges.style[edge], BLANK)
    height = middle[:, 2]
    zone = np.where(style == BLANK, 1, 5)
    zone[(zone == 5) & (height > eaves[owner])] = 7
    zone[(zone == 7) & small[owner]] = 1
    zone[(zone == 5) & (height < ground_top[owner])] = 4
    zone[(zone == 4) & (style == SHOPFRONT)] = 3
    zone[(zone == 5) & (style == BACK)] = 6
    zone[(height < plinth[owner])] = 2
    zone[~upright] = 0
    start = edges.start[edge]
    line = edges.end[edge] - start
    length = np.maximum(np.hypot(*line.T), 1e-6)
    direction = line / length[:, None]
    along = np.einsum("nki,ni->nk", corner[..., :2] - start[:, None, :], direction)
    walls: dict[str, _Pile] = {}
    roofs: dict[str, _Pile] = {}
    worn = [FINISHES[part.finish] if part.finish else None for part in parts]
    rows = list(zip(worn, looks, strict=True))
    names = {
        0: [worn.cover if worn and worn.cover else look.roof for worn, look in rows],
        1: [worn.side if worn else look.blank for worn, look in rows],
        2: ["blank_stone"] * len(parts),
        3: [_SHOPS[zlib.crc32(plans[p].id.encode()) % len(_SHOPS)] for p in of],
        4: [worn.picture or worn.side if worn else look.ground for worn, look in rows],
        5: [look.wall for look in looks],
        6: [look.back for look in looks],
        7: [look.gable or look.blank for look in looks],
    }
    white, stone = (255, 255, 255), (206, 202, 196)
    tints = {
        0: [worn.cover_tint if worn and worn.cover else look.roof_tint for worn, look in rows],
        1: [worn.tint if worn else look.tint for worn, look in rows],
        2: [stone] * len(parts),
        3: [white] * len(parts),
        4: [worn.tint if worn else look.ground_tint for worn, look in rows],
        5: [look.tint for look in looks],
        6: [look.back_tint for look in looks],
        7: [look.gable_tint if look.gable else look.tint for look in looks],
    }
    wished = np.array([worn.bay if worn else look.bay for worn, look in rows])[owner]
    storeys = np.array([storeys.count for storeys in divided])
    own_cover = np.array([bool(worn and worn.cover) for worn in worn])
    unders = np.array([worn.under if worn else "blank_plaster" for worn in worn], "U24")
    under_tints = np.array([worn.under_tint if worn else tints[0][k] for k, worn in enumerate(worn)], np.uint8)
    flat_tints = np.array([look.flat_tint for look in looks], np.uint8)
    for k in range(8):
        chosen = np.flatnonzero(zone == k)
        if not len(chosen):
            continue
        mine = owner[chosen]
        label = np.array(names[k], "U24")
        colours = np.array(tints[k], np.uint8)
        if k == 0:
            level_roof = (normal[chosen, 2] > 0.97) & ~own_cover[mine]
            label_of = np.where(level_roof, "roof_gravel", label[mine]).astype("U24")
            colour = colours[mine].copy()
            felt = level_roof & (label[mine] != "roof_gravel")
            colour[felt] = flat_tints[mine][felt]
            under = normal[chosen, 2] < 0
            label_of[under], colour[under] = unders[mine][under], under_tints[mine][under]
            uv = _slope_uv(corner[chosen], normal[chosen], label_of)
            _pile(roofs, label_of[~under], chosen[~under], corner, uv[~under], colour[~under], entity)
            _pile(walls, label_of[under], chosen[under], corner, uv[under], colour[under], entity)
            continue
        label_of = label[mine]
        if k <= 2 or k == 7:
            size = np.array([facades.BLANK_TILE.get(name, 1.0) for name in label_of])
            flat_along = np.einsum(
                "nki,ni->nk", corner[chosen][..., :2], np.stack([-normal[chosen, 1], normal[chosen, 0]], 1)
            )
            uv = np.stack([flat_along, z[chosen]], axis=-1) / size[:, None, None]
        else:
            bay = np.where(k == 3, 4.2, wished[chosen])
            count = facades.bays(length[chosen], bay)
            u = facades.bay_coordinates(along[chosen], length[chosen, None], count[:, None]) + shift[edge[chosen], :1]
            if k >= 5:
                v = facades.storey_coordinates(
                    z[chosen], ground_top[mine][:, None], eaves[mine][:, None], storeys[mine][:, None]
                ) + np.where(hall[mine][:, None], 0.0, shift[edge[chosen], 1:])
            else:
                v = (z[chosen] - base[mine][:, None]) / (ground_top[mine] - base[mine])[:, None]
                v = np.clip(v, 0.004, 0.996)
            uv = np.stack([u, v], axis=-1)
        _pile(walls, label_of, chosen, corner, uv, colours[mine], entity)

    def surfaces(piles: dict[str, _Pile]) -> list[Surface]:
        return list(in_order(lambda name: piles[name].surface(material(name)), sorted(piles)))

    return surfaces(walls), surfaces(roofs)


def _phases(edges: _Edges, plans: list[BuildingPlan], seed: int) -> NDArray[np.float64]:
    """Where on its sheet each wall begins, in quarters of a sheet along and up: a building's own draws."""
    made, k = [np.zeros((0, 2), np.int64)], 0
    for plan in plans:
        count = int(edges.first[k + len(plan.solids)] - edges.first[k])
        made.append(rng(seed, "bays", plan.id).integers(0, 4, (count, 2)))
        k += len(plan.solids)
    return np.concatenate([*made, np.zeros((1, 2), np.int64)]).astype(np.float64) / 4


def _pile(
    piles: dict[str, _Pile],
    labels: NDArray[np.str_],
    faces: NDArray[np.int64],
    corner: NDArray[np.float64],
    uv: NDArray[np.float64],
    colour: NDArray[np.uint8],
    entity: NDArray[np.int32],
) -> None:
    for name in np.unique(labels).tolist():
        here = labels == name
        pile = piles.setdefault(str(name), _Pile())
        pile.positions.append(corner[faces[here]])
        # Whole sheets off the coordinates: small numbers keep their digits in float32.
        pile.uv.append(uv[here] - np.floor(uv[here].min(axis=1, keepdims=True)))
        pile.colour.append(colour[here])
        pile.entity.append(entity[faces[here]])


def _edge_of(
    middle: NDArray[np.float64], normal: NDArray[np.float64], owner: NDArray[np.int64], edges: _Edges
) -> NDArray[np.int64]:
    """The wall line each upright triangle stands on; -1 for parapets' insides and all that is not upright."""
    result = np.full(len(middle), -1, np.int64)
    upright = np.flatnonzero(np.abs(normal[:, 2]) < 0.15)
    order = upright[np.argsort(owner[upright], kind="stable")]
    bounds = np.searchsorted(owner[order], np.arange(len(edges.first)))
    for part in range(len(edges.first) - 1):
        faces = order[bounds[part] : bounds[part + 1]]
        if not len(faces):
            continue
        a, b = (
            edges.start[edges.first[part] : edges.first[part + 1]],
            edges.end[edges.first[part] : edges.first[part + 1]],
        )
        along = b - a
        length = np.maximum(np.hypot(*along.T), 1e-9)
        along = along / length[:, None]
        outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
        away = middle[faces][:, None, :2] - a[None]
        t = (away * along).sum(-1)
        off = np.abs((away * outward).sum(-1)) + np.maximum(np.maximum(-t, t - length), 0.0)
        off = np.where(turned(normal[faces][:, :2], outward) > 0.9, off, np.inf)
        best = off.argmin(axis=1)
        good = off[np.arange(len(faces)), best] < 0.06
        result[faces[good]] = edges.first[part] + best[good]
    return result


def _slope_uv(corner: NDArray[np.float64], normal: NDArray[np.float64], label: NDArray[np.str_]) -> NDArray[np.float64]:
    """Texture coordinates on slopes: u level, v up the slope."""
    level = np.stack([-normal[:, 1], normal[:, 0], np.zeros(len(normal))], axis=1)
    size = np.linalg.norm(level, axis=1, keepdims=True)
    level = np.where(size > 0.05, level / np.maximum(size, 1e-9), (1.0, 0.0, 0.0))
    up = np.cross(normal, level)
    tile = np.array([facades.ROOF_TILE.get(str(name), 3.0) for name in label])[:, None]
    return np.stack(
        [np.einsum("nki,ni->nk", corner, level) / tile, np.einsum("nki,ni->nk", corner, up) / tile], axis=-1
    )


def _record(plan: BuildingPlan, entity: int, seat: Seat, look: Look) -> Building:
    standing = [part.polygon for part in plan.parts if part.low < 2.5] or [part.polygon for part in plan.parts]
    # A millimetre grid, so that the written outline is the valid one and not its rounding.
    merged = polygons_of(shapely.set_precision(shapely.union_all(standing), 0.001))
    footprint = max(merged, key=lambda shape: shape.area)
    rings = [[(round(float(x), 3), round(float(y), 3)) for x, y in ring] for ring in rings_of(footprint)]
    highest = max(plan.parts, key=lambda part: part.top)
    return Building(
        id=plan.id,
        entity=entity,
        name=plan.name,
        use=plan.use,
        footprint=rings,
        base=round(seat.base, 3),
        height=round(highest.top, 3),
        levels=max(plan.levels, 1),
        roof_shape=highest.roof.shape,
        colour="#{:02x}{:02x}{:02x}".format(*look.tint),
        accessible=False,
        tags={key: plan.tags[key] for key in _KEPT_TAGS if key in plan.tags},
    )
