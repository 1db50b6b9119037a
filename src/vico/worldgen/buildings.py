"""Buildings as closed solids on the terrain, dressed, with their records and collision bodies."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field, replace

import mapbox_earcut
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo.osm import OsmData, polygons_of
from vico.world.heights import HeightField
from vico.world.mesh import Material, Surface
from vico.world.model import FIRST_BUILDING, Building, Dropped
from vico.world.seeds import rng
from vico.worldgen import facades
from vico.worldgen.facades import BACK, BLANK, FRONT, SHOPFRONT, Look
from vico.worldgen.outlines import BuildingPlan, PartPlan, building_plans
from vico.worldgen.roofs import building_solid, rings_of
from vico.worldgen.rooftops import rooftop_parts
from vico.worldgen.streets import on_the_ground
from vico.worldgen.textures import material

_SKIRT = 0.3  # metres the walls reach below the lowest ground, so that no gap shows
_FRONT_REACH = 17.0  # metres from a street's centre line within which a wall faces it
_SHOPS = ("ground_shops", "ground_cafes")
# Roof furniture: material and tint.
_FINISHES = {
    "cornice": ("blank_plaster", (255, 253, 248)),
    "penthouse": ("blank_plaster", (190, 192, 194)),
    "chimney": ("blank_brick", (226, 210, 200)),
}
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
    """

    records: list[Building]
    walls: list[Surface]
    roofs: list[Surface]
    collision: list[Surface]
    dropped: list[Dropped]
    watertight: int

    @property
    def collision_faces(self) -> int:
        """Triangles of all collision bodies."""
        return sum(len(surface.triangles) for surface in self.collision)


@dataclass(frozen=True)
class _Seat:
    """Where a building stands: `bottom` of its walls and `base` (ground floor), metres."""

    bottom: float
    base: float


def buildings_from_osm(osm: OsmData, terrain: HeightField, *, seed: int) -> BuildingsResult:
    """Build every building of an extract that touches the world's square.

    Parameters
    ----------
    osm
        The extract.
    terrain
        What the buildings stand on.
    seed
        Decides what the map leaves open: heights, roofs, colours.

    Returns
    -------
    BuildingsResult
        Records, meshes and collision bodies.
    """
    plans, dropped = building_plans(osm, seed=seed)
    region = facades.region_of(osm.frame.lat, osm.frame.lon)
    seats = [_seat(plan, terrain) for plan in plans]
    looks = [
        facades.look_of(
            plan.use,
            {**plan.tags, **plan.parts[0].tags},
            levels=plan.levels,
            area=plan.outline.area,
            region=region,
            random=rng(seed, "facade", plan.id),
        )
        for plan in plans
    ]
    plans = [
        replace(plan, rooftop=rooftop_parts(plan, look.wall, rng(seed, "rooftop", plan.id)))
        for plan, look in zip(plans, looks, strict=True)
    ]
    mesh = _meshes(plans, seats)
    edges = _edges(plans, seats, osm)
    walls, roofs = _dressed(mesh, edges, plans, seats, looks, seed)
    records = [
        _record(plan, FIRST_BUILDING + k, seat, look)
        for k, (plan, seat, look) in enumerate(zip(plans, seats, looks, strict=True))
    ]
    collision = [
        body
        for k, (plan, seat) in enumerate(zip(plans, seats, strict=True))
        for part in plan.parts
        for body in _collision(part, seat, FIRST_BUILDING + k)
    ]
    return BuildingsResult(records, walls, roofs, collision, dropped, len(plans) - len(_leaky(mesh)))


def _seat(plan: BuildingPlan, terrain: HeightField) -> _Seat:
    """Seat a building: walls down to the lowest ground under it, ground floor a little above that on a slope."""
    outline = np.asarray(shapely.segmentize(plan.outline.exterior, 3.0).coords)[:, :2]
    ground = terrain(outline)
    lowest, highest = float(ground.min()), float(ground.max())
    base = lowest + min(0.4 * (highest - lowest), 1.5)
    return _Seat(lowest - _SKIRT, base)


def _heights(part: PartPlan, seat: _Seat) -> tuple[float, float]:
    """Underside and eaves of a part above sea level."""
    return (seat.bottom if part.low <= 0 else seat.base + part.low), seat.base + part.eaves


@dataclass
class _Mesh:
    """All solids together; `part` and `plan` say whose a face is, `parts` whose part is of which plan."""

    points: NDArray[np.float64]
    faces: NDArray[np.int64]
    part: NDArray[np.int64]
    plan_of_part: NDArray[np.int64]
    broken: list[int] = field(default_factory=list)


def _meshes(plans: list[BuildingPlan], seats: list[_Seat]) -> _Mesh:
    points: list[NDArray[np.float64]] = []
    faces: list[NDArray[np.int64]] = []
    owner: list[NDArray[np.int64]] = []
    plan_of_part: list[int] = []
    broken: list[int] = []
    count = 0
    for p, (plan, seat) in enumerate(zip(plans, seats, strict=True)):
        for part in plan.solids:
            low, eaves = _heights(part, seat)
            # Solids are made near the origin and near height 0: the kernel's tolerance grows with coordinates.
            x, y = (round(v) for v in part.polygon.centroid.coords[0])
            local = shapely.transform(part.polygon, lambda xy, x=x, y=y: xy - (x, y))
            solid = building_solid(local, low - eaves, 0.0, part.roof).simplify(0.002)
            solid_mesh = solid.to_mesh64()
            vertices = np.asarray(solid_mesh.vert_properties, np.float64)[:, :3]
            triangles = np.asarray(solid_mesh.tri_verts, np.int64)
            if not len(triangles) or solid.volume() <= 0:
                broken.append(p)
            points.append(vertices + np.array([x, y, eaves]))
            faces.append(triangles + count)
            owner.append(np.full(len(triangles), len(plan_of_part), np.int64))
            count += len(vertices)
            plan_of_part.append(p)
    if not points:
        return _Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64))
    return _Mesh(np.concatenate(points), np.concatenate(faces), np.concatenate(owner), np.array(plan_of_part), broken)


def _leaky(mesh: _Mesh) -> set[int]:
    """Plans with a solid that is empty, inside out, or has an edge without its exact counterpart."""
    start, end = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    size = np.int64(len(mesh.points))
    forward, backward = np.sort(start * size + end), np.sort(end * size + start)
    if len(forward) == len(backward) and np.array_equal(forward, backward) and (np.diff(forward) > 0).all():
        return set(mesh.broken)
    there = np.isin(start * size + end, backward)
    _, index, counts = np.unique(start * size + end, return_inverse=True, return_counts=True)
    bad = ~there | (counts[index] > 1)
    return set(mesh.broken) | set(mesh.plan_of_part[np.repeat(mesh.part, 3)[bad]].tolist())


@dataclass
class _Edges:
    """Wall lines of all parts; `first[part]` is where a part's begin."""

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    style: NDArray[np.int64]
    first: NDArray[np.int64]


def _edges(plans: list[BuildingPlan], seats: list[_Seat], osm: OsmData) -> _Edges:
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
    streets = [
        shapely.LineString(way.line)
        for way in osm.ways
        if way.tags.get("highway") not in (None, "steps", "corridor", "elevator", "platform", "service", "path")
        and "building" not in way.tags
        and on_the_ground(way.tags)
    ]
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
    style[np.array([bool(part.finish) for part in parts])[part_of]] = BLANK
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
    mesh: _Mesh, edges: _Edges, plans: list[BuildingPlan], seats: list[_Seat], looks: list[Look], seed: int
) -> tuple[list[Surface], list[Surface]]:
    """Give every triangle its material and texture coordinates; cut walls where the material changes."""
    if not len(mesh.faces):
        return [], []
    parts = [part for plan in plans for part in plan.solids]
    of = mesh.plan_of_part
    base = np.array([seats[p].base for p in of])
    bottom = np.array([seats[p].bottom for p in of])
    low = np.array([part.low for part in parts])
    eaves = base + np.array([part.eaves for part in parts])
    levels = np.array([max(part.levels, 1) for part in parts])
    tall = np.array(
        [plans[p].use in ("retail", "commercial", "office", "civic", "hotel") or plans[p].shops > 0 for p in of]
    )
    ground = np.where(tall, 4.0, 3.5)
    single = (levels <= 1) | (eaves - base < 5.6)
    ground_top = np.where(low > 0, base + low, np.where(single, eaves, base + ground))
    plinth = np.where((base - bottom > 0.75) & (low <= 0), base, np.nan)
    points, faces, owner = mesh.points, mesh.faces, mesh.part
    for cut in (plinth, np.where(ground_top < eaves - 0.2, ground_top, np.nan), eaves):
        points, faces, owner = facades.cut_at_heights(points, faces, owner, cut)
    mesh.points, mesh.faces, mesh.part = points, faces, owner
    corner = points[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    middle = corner.mean(axis=1)
    edge = _edge_of(middle, normal, owner, edges)
    upright = np.abs(normal[:, 2]) < 0.15
    random = rng(seed, "bays")
    shift = random.integers(0, 4, (len(edges.start) + 1, 2)).astype(np.float64) / 4
    entity = (FIRST_BUILDING + of[owner]).astype(np.int32)
    z = corner[..., 2]
    # Zones: 0 roof and undersides, 1 blank, 2 plinth, 3 shopfront, 4 ground floor, 5 upper floors.
    style = np.where(edge >= 0, edges.style[edge], BLANK)
    height = middle[:, 2]
    zone = np.where(style == BLANK, 1, 5)
    zone[(zone == 5) & (height > eaves[owner])] = 1
    zone[(zone == 5) & (height < ground_top[owner])] = 4
    zone[(zone == 4) & (style == SHOPFRONT)] = 3
    zone[(height < plinth[owner])] = 2
    zone[~upright] = 0
    start = edges.start[edge]
    line = edges.end[edge] - start
    length = np.maximum(np.hypot(*line.T), 1e-6)
    direction = line / length[:, None]
    along = np.einsum("nki,ni->nk", corner[..., :2] - start[:, None, :], direction)
    walls: dict[str, _Pile] = {}
    roofs: dict[str, _Pile] = {}
    look_of = [looks[p] for p in of]
    names = {
        0: [look.roof for look in look_of],
        1: [
            _FINISHES[part.finish][0] if part.finish else look.blank for part, look in zip(parts, look_of, strict=True)
        ],
        2: ["blank_stone"] * len(parts),
        3: [_SHOPS[zlib.crc32(plans[p].id.encode()) % len(_SHOPS)] for p in of],
        4: [look.ground for look in look_of],
        5: [look.wall for look in look_of],
    }
    white, stone = (255, 255, 255), (206, 202, 196)
    tints = {
        0: [look.roof_tint for look in look_of],
        1: [_FINISHES[part.finish][1] if part.finish else look.tint for part, look in zip(parts, look_of, strict=True)],
        2: [stone] * len(parts),
        3: [white] * len(parts),
        4: [look.ground_tint for look in look_of],
        5: [look.tint for look in look_of],
    }
    wished = np.array([look.bay for look in look_of])[owner]
    storeys = np.maximum(np.round((eaves - ground_top) / 3.25), 1.0)
    for k in range(6):
        chosen = np.flatnonzero(zone == k)
        if not len(chosen):
            continue
        mine = owner[chosen]
        label = np.array(names[k], "U24")
        colours = np.array(tints[k], np.uint8)
        if k == 0:
            level_roof = (normal[chosen, 2] > 0.97) | (normal[chosen, 2] < 0)
            label_of = np.where(level_roof, "roof_gravel", label[mine]).astype("U24")
            colour = colours[mine].copy()
            colour[level_roof & (label[mine] != "roof_gravel")] = (150, 148, 146)
            under = normal[chosen, 2] < 0
            label_of[under] = "blank_plaster"
            uv = _slope_uv(corner[chosen], normal[chosen], label_of)
            _pile(roofs, label_of[~under], chosen[~under], corner, uv[~under], colour[~under], entity)
            _pile(walls, label_of[under], chosen[under], corner, uv[under], colour[under], entity)
            continue
        label_of = label[mine]
        if k <= 2:
            size = np.array([facades.BLANK_TILE[name] for name in label_of])
            flat_along = np.einsum(
                "nki,ni->nk", corner[chosen][..., :2], np.stack([-normal[chosen, 1], normal[chosen, 0]], 1)
            )
            uv = np.stack([flat_along, z[chosen]], axis=-1) / size[:, None, None]
        else:
            bay = np.where(k == 3, 4.2, wished[chosen])
            count = facades.bays(length[chosen], bay)
            u = facades.bay_coordinates(along[chosen], length[chosen, None], count[:, None]) + shift[edge[chosen], :1]
            if k == 5:
                v = (
                    facades.storey_coordinates(
                        z[chosen], ground_top[mine][:, None], eaves[mine][:, None], storeys[mine][:, None]
                    )
                    + shift[edge[chosen], 1:]
                )
            else:
                v = (z[chosen] - base[mine][:, None]) / (ground_top[mine] - base[mine])[:, None]
                v = np.clip(v, 0.004, 0.996)
            uv = np.stack([u, v], axis=-1)
        _pile(walls, label_of, chosen, corner, uv, colours[mine], entity)
    return (
        [walls[name].surface(material(name)) for name in sorted(walls)],
        [roofs[name].surface(material(name)) for name in sorted(roofs)],
    )


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
        off = np.where(normal[faces][:, :2] @ outward.T > 0.9, off, np.inf)
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


def _record(plan: BuildingPlan, entity: int, seat: _Seat, look: Look) -> Building:
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


def _collision(part: PartPlan, seat: _Seat, entity: int) -> list[Surface]:
    """Convex prisms that fill a part's walls, up to half the height of a pitched roof."""
    low, eaves = _heights(part, seat)
    top = eaves + (part.roof.height if part.roof.shape == "flat" else 0.5 * part.roof.height)
    bodies: list[Surface] = []
    for shape in polygons_of(shapely.simplify(part.polygon, 0.25), 0.5):
        for ring in convex_pieces(shape):
            n = len(ring)
            points = np.concatenate([np.c_[ring, np.full(n, low)], np.c_[ring, np.full(n, top)]])
            i = np.arange(n)
            j = (i + 1) % n
            fan = np.arange(1, n - 1)
            triangles = np.concatenate(
                [
                    np.stack([i, j, n + j], axis=1),
                    np.stack([i, n + j, n + i], axis=1),
                    np.stack([np.zeros_like(fan), fan + 1, fan], axis=1),
                    np.stack([np.full_like(fan, n), n + fan, n + fan + 1], axis=1),
                ]
            )
            out = points - points.mean(axis=0)
            normals = out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)
            bodies.append(
                Surface.from_triangles(
                    points, triangles, normals=normals, entity=entity, material=Material("collision")
                )
            )
    return bodies


def convex_pieces(polygon: Polygon) -> list[NDArray[np.float64]]:
    """Divide a polygon into convex ones: ears, then merged across every diagonal that is not needed.

    Returns
    -------
    list of ndarray
        Counter-clockwise rings, not closed, shape ``(n, 2)``.

    Notes
    -----
    Hertel and Mehlhorn (1983): at most four times the least number of pieces.
    """
    rings = rings_of(polygon)
    points = np.concatenate(rings)
    ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
    triangles = mapbox_earcut.triangulate_float64(points, ends).reshape(-1, 3).astype(int)
    pieces: dict[int, list[int]] = {}
    side: dict[tuple[int, int], int] = {}
    for k, (a, b, c) in enumerate(triangles.tolist()):
        (ux, uy), (vx, vy) = points[b] - points[a], points[c] - points[a]
        area = float(ux * vy - uy * vx)
        if abs(area) < 1e-9:
            continue
        pieces[k] = [a, b, c] if area > 0 else [a, c, b]
        for i in range(3):
            side[pieces[k][i], pieces[k][(i + 1) % 3]] = k
    for a, b in sorted(side):
        first, second = side.get((a, b)), side.get((b, a))
        if first is None or second is None or first == second:
            continue
        one, two = pieces[first], pieces[second]
        i, j = one.index(a), two.index(b)
        ring = one[i + 1 :] + one[: i + 1]
        # Walk the first from b round to a, then the second's corners between a and b.
        rest = two[j:] + two[:j]
        merged = ring + [v for v in rest if v not in (a, b)]
        if not _is_convex(points[merged]):
            continue
        pieces[first] = merged
        del pieces[second]
        for u, v in [key for key, of in side.items() if of == second]:
            side[u, v] = first
    return [points[ring] for ring in pieces.values()]


def _is_convex(ring: NDArray[np.float64]) -> bool:
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return bool((before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0] > -1e-9).all())
