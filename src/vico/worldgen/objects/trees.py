"""Trees and shrubs: which model by species, climate and size; rows; and what grows where only an area is mapped."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.assets.models.library import street_models
from vico.geo import overlay
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData, Tags
from vico.geo.quantities import metres
from vico.seeds import rng
from vico.world.heights import HeightField
from vico.worldgen.facts.fault_isolation import NamedShape, drop_on_failure, union_named
from vico.worldgen.facts.street_habits import street_habits
from vico.worldgen.objects.catalogue import trees
from vico.worldgen.objects.placement import Placement

_SHRUB_ROOM = 7.0
_BARE = {
    "leisure": ("pitch", "playground", "swimming_pool", "track", "stadium", "sports_centre", "marina"),
    "natural": ("water", "beach", "sand", "bare_rock", "wetland"),
    "amenity": ("parking", "fountain", "marketplace", "outdoor_seating", "bicycle_parking", "grave_yard"),
    "landuse": ("construction", "railway", "basin", "reservoir", "flowerbed"),
    "man_made": ("pier", "bridge", "pontoon"),
    "public_transport": ("platform",), "railway": ("platform",), "waterway": ("riverbank", "dock"),
}  # fmt: skip
_RAILS = ("rail", "light_rail", "narrow_gauge", "subway", "tram")
_BESIDE_RAILS = 4.0  # metres from the middle of a track
_MOST = 700  # plants that no map has, in a world
# Green that is kept short.
_MOWN = {
    "landuse": ("grass", "meadow", "farmland", "vineyard", "allotments", "cemetery", "recreation_ground"),
    "leisure": ("park", "garden", "golf_course", "pitch"),
    "natural": ("grassland", "heath", "scree", "bare_rock", "cliff"),
}
_STEEP = 0.25  # rise per metre from which nothing is mown
_STEEP_CELL = 10.0  # metres, side of the cells that it is measured in
_WILD_ROOM = 55.0  # square metres that a plant has there
_SHRUBS = 0.6  # share of shrubs there

_LAWN_CELL = 11.0  # metres, side of the cells of lawns
_LAWN_GROWN = 0.5  # share of them in which something grows
_LAWN_SHRUBS = 0.25  # share of shrubs in what grows


def climate(frame: LocalFrame, height: HeightField) -> str:
    """Say what kind of plants grow here: by latitude, the Mediterranean and California by their boxes, and altitude."""
    lat = abs(frame.lat)
    if lat < 25.0:
        return "tropical"
    if float(np.median(height.heights)) > 600.0:
        return "alpine"
    if lat > 57.0:
        return "boreal"
    warm = (35.0 < frame.lat < 44.2 and -10.0 < frame.lon < 37.0) or (32 < frame.lat < 38.5 and -125 < frame.lon < -114)
    return "mediterranean" if warm or lat < 32.0 else "temperate"


def planting(osm: OsmData, height: HeightField) -> str:
    """Name the mix of plants of a place: that of its climate in its country where there is one, else its climate's."""
    zone = climate(osm.frame, height)
    own = f"{zone}_{street_habits(osm).family}"
    return own if own in trees().mixes else zone


def tree_placement(
    key: str, tags: Tags, xy: NDArray[np.float64], seed: int, zone: str, *, wild: bool = False
) -> Placement:
    """Wish for a tree with the model and the size its tags and place suggest; `wild` ones grow as in woods."""
    random = rng(seed, "tree", key)
    name = _model(tags, xy, seed, random, zone, wild)
    wide, _, tall = street_models()[name].size
    scale = float(random.uniform(0.82, 1.15))
    height, crown = metres(tags.get("height")), metres(tags.get("diameter_crown"))
    girth = metres(tags.get("circumference"))
    if girth and girth > 20:  # centimetres, whatever the wiki says
        girth /= 100
    if height:
        if crown and "genus" not in tags and "species" not in tags and name not in trees().palms:
            name = _by_shape(name, crown / height)
            tall = street_models()[name].size[2]
        scale = height / tall
    elif crown:
        scale = crown / wide
    elif girth:
        scale = 25.0 * (1.0 - math.exp(-2.5 * girth / math.pi)) / tall
    return Placement(key, name, xy, None, float(np.clip(scale, 0.35, 2.0)))


def _by_shape(name: str, ratio: float) -> str:
    """Name the model of the same leaves whose crown is as wide for its height as measured."""
    needles = trees().needles
    leaves = needles if name in needles else ("tree_lime", "tree_lime_tall", "tree_maple", "tree_poplar", "tree_oak")
    models = street_models()
    return min(leaves, key=lambda n: abs(math.log(max(models[n].size[0] / models[n].size[2], 0.05) / max(ratio, 0.05))))


def _genus(tags: Tags) -> str | None:
    for key in ("genus", "species", "taxon"):
        genus = tags.get(key, "").split(" ")[0].lower()
        if genus in trees().genera:
            return genus
    for key, value in tags.items():
        if key.split(":")[0] in ("species", "taxon", "genus") or key == "name":
            for word in value.lower().replace("-", " ").split():
                for known, genus in trees().names.items():
                    if word == known or (len(known) > 4 and word.endswith(known)):
                        return genus
    return None


def _model(tags: Tags, xy: NDArray[np.float64], seed: int, random: np.random.Generator, zone: str, wild: bool) -> str:
    genus = _genus(tags)
    if genus == "pinus" and zone == "mediterranean":
        return "tree_stone_pine"
    if genus == "populus" and "tremula" in tags.get("species", ""):
        return "tree_birch"
    if genus is not None:
        return trees().genera[genus]
    known = trees()
    leaves = tags.get("leaf_type", tags.get("wood", ""))
    if leaves == "palm":
        return known.palms[int(random.integers(len(known.palms)))]
    planted = known.mixes[zone]
    mix = planted.woods if wild else planted.streets
    if leaves in ("needleleaved", "coniferous"):
        mix = tuple(n for n in planted.woods if n in known.needles) or ("tree_spruce",)
    elif leaves in ("broadleaved", "deciduous"):
        evergreen = tags.get("leaf_cycle") == "evergreen" and zone in ("mediterranean", "tropical")
        mix = tuple(n for n in mix if n not in (*known.needles, *known.palms))
        mix = ("tree_oak", "tree_olive") if evergreen else mix or ("tree_oak",)
    if not wild and random.random() < 0.78:
        # Neighbours in a street are of one kind, mostly.
        local = rng(seed, "species", int(xy[0] // 60) + 10_000, int(xy[1] // 60) + 10_000)
        return mix[int(local.integers(len(mix)))]
    return mix[int(random.integers(len(mix)))]


def row_placements(osm: OsmData, seed: int, zone: str) -> list[Placement]:
    """Trees of tree rows: as many as mapped, else one every eight metres; the row has one species."""
    found: list[Placement] = []
    mapped = [node.xy for node in osm.nodes if node.tags.get("natural") == "tree"]
    near = shapely.STRtree(shapely.points(mapped)) if mapped else None
    for way in osm.ways:
        if way.tags.get("natural") != "tree_row":
            continue
        with drop_on_failure(f"w{way.id}"):
            line = shapely.LineString(way.line)
            count = max(2, round(line.length / 8.0) + 1)
            name = tree_placement(f"w{way.id}", way.tags, way.line[0], seed, zone).prototype
            for k, d in enumerate(np.linspace(0, line.length, count)):
                point = line.interpolate(d)
                if near is not None and len(near.query(point, predicate="dwithin", distance=3.0)):
                    continue
                wish = tree_placement(f"w{way.id}.{k}", way.tags, np.array(point.coords[0]), seed, zone)
                wish.prototype = name
                found.append(wish)
    return found


def blue_noise_points(
    ground: BaseGeometry, room: float, most: int, random: np.random.Generator, *, least: float = 0.72
) -> NDArray[np.float64]:
    """Points of blue noise in an area, shape ``(n, 2)``: none nearer to another than `least` times its room's side."""
    count = min(int(ground.area / room + random.random()), most)
    if count <= 0:
        return np.zeros((0, 2))
    apart = least * math.sqrt(room)
    x0, y0, x1, y1 = ground.bounds
    share = max(ground.area / max((x1 - x0) * (y1 - y0), 1e-9), 0.02)
    tries = random.uniform((x0, y0), (x1, y1), (min(int(9 * count / share) + 8, 60_000), 2))
    shapely.prepare(ground)
    tries = tries[shapely.contains_xy(ground, tries[:, 0], tries[:, 1])]
    taken: dict[tuple[int, int], list[tuple[float, float]]] = {}
    out: list[tuple[float, float]] = []
    for x, y in tries.tolist():
        i, j = math.floor(x / apart), math.floor(y / apart)
        around = (p for a in (i - 1, i, i + 1) for b in (j - 1, j, j + 1) for p in taken.get((a, b), ()))
        if any((x - px) ** 2 + (y - py) ** 2 < apart * apart for px, py in around):
            continue
        taken.setdefault((i, j), []).append((x, y))
        out.append((x, y))
        if len(out) == count:
            break
    return np.array(out).reshape(-1, 2)


def _use(area: OsmArea) -> str | None:
    """Say what is planted in an area, a key of `Trees.room` or ``scrub``."""
    tags = area.tags
    if tags.get("natural") in ("wood", "scrub", "shrubbery"):
        return "wood" if tags["natural"] == "wood" else "scrub"
    for key in ("landuse", "leisure"):
        if tags.get(key) in trees().room and "building" not in tags:
            return tags[key]
    return None


def planted_area_placements(
    osm: OsmData,
    height: HeightField,
    carriageway: BaseGeometry,
    openings: BaseGeometry,
    half: float,
    seed: int,
    zone: str,
) -> list[Placement]:
    """Trees of woods, parks, gardens and cemeteries, shrubs of scrub, where only the area is mapped, off the ways.

    Where nothing is mapped and the ground is too steep to be a lawn, it grows wild.
    """
    window = shapely.box(-half, -half, half, half)
    keep_off = _kept_free(osm, carriageway, openings, window)
    mapped = [node.xy for node in osm.nodes if node.tags.get("natural") == "tree"]
    trunks = shapely.points(np.array(mapped).reshape(-1, 2))
    done: BaseGeometry = shapely.Polygon()
    found: list[tuple[float, Placement]] = []
    order = {"wood": 0, "forest": 0, "scrub": 1, "orchard": 1}
    for area in sorted(osm.areas, key=lambda a: order.get(_use(a) or "", 2)):
        use = _use(area)
        if use is None or area.polygon.area < 12.0:
            continue
        with drop_on_failure(area.id):
            ground = overlay.difference(overlay.difference(overlay.intersection(area.polygon, window), keep_off), done)
            if not ground.is_empty:
                done = overlay.union(done, ground)
                found += _plant_area(area, use, ground, trunks, seed, zone)
    mown = [NamedShape(area.id, area.polygon) for area in osm.areas if _is_mown(area)]
    elsewhere = union_named([NamedShape("kept", keep_off), NamedShape("planted", done), *mown])
    found += _grown_wild(height, elsewhere, half, seed, zone)
    if len(found) <= _MOST:
        return [wish for _, wish in found]
    # Every area is thinned alike.
    limit = sorted(rank for rank, _ in found)[_MOST]
    return [wish for rank, wish in found if rank < limit]


def _is_mown(area: OsmArea) -> bool:
    return any(area.tags.get(key) in values for key, values in _MOWN.items())


def _grown_wild(
    height: HeightField, elsewhere: BaseGeometry, half: float, seed: int, zone: str
) -> list[tuple[float, Placement]]:
    """Return what grows where the ground is too steep to be mown: trees as in woods, and more shrubs.

    Each cell of ground decides for itself, so what is mapped elsewhere changes nothing.
    """
    count = max(int(2 * half // _STEEP_CELL), 1)
    side = 2 * half / count
    edges = np.linspace(-half, half, count + 1)
    level = height.smooth(np.stack(np.meshgrid(edges, edges), axis=-1))
    east, north = np.diff(level, axis=1) / side, np.diff(level, axis=0) / side
    steep = np.hypot((east[1:] + east[:-1]) / 2, (north[:, 1:] + north[:, :-1]) / 2) > _STEEP
    shapely.prepare(elsewhere)
    found: list[tuple[float, Placement]] = []
    for row, column in np.argwhere(steep).tolist():
        random = rng(seed, "slope", row, column)
        for k in range(int(side * side / _WILD_ROOM + random.random())):
            xy = np.array([edges[column], edges[row]]) + random.uniform(0.0, side, 2)
            if shapely.contains_xy(elsewhere, *xy):
                continue
            key = f"slope.{row}.{column}.{k}"
            if random.random() < _SHRUBS:
                name = ("shrub", "shrub_tall", "shrub_tall")[int(random.integers(3))]
                wish = Placement(key, name, xy, None, float(random.uniform(0.8, 1.5)))
            else:
                wish = tree_placement(key, {}, xy, seed, zone, wild=True)
            wish.reach = 0.0
            found.append((float(random.random()), wish))
    return found


def lawn_placements(
    osm: OsmData,
    lawns: BaseGeometry,
    openings: BaseGeometry,
    mapped: Sequence[BaseGeometry],
    seed: int,
    zone: str,
) -> list[Placement]:
    """Return what grows on lawns that no map has: a tree or a shrub at most in each cell of them.

    Nothing grows on ways for walkers, beside rails, nor within areas that are `mapped` or bare.
    """
    if lawns.is_empty:
        return []
    shapely.prepare(lawns)
    shapely.prepare(openings)
    bare = [area.polygon for area in osm.areas if _is_bare(area)]
    rails = [shapely.LineString(way.line) for way in osm.ways if way.tags.get("railway") in _RAILS]
    taken, tracks = shapely.STRtree([*mapped, *bare]), shapely.STRtree(rails)
    count = max(int(2 * osm.half // _LAWN_CELL), 1)
    side = 2 * osm.half / count
    found: list[tuple[float, Placement]] = []
    # Tiles of a city do not all draw alike.
    aside, up = (round(way / (2 * osm.half)) for way in (osm.frame.east, osm.frame.north))
    tile = f".{aside}.{up}" if aside or up else ""
    for row, column in np.ndindex(count, count):
        cell = f"lawn{tile}.{row}.{column}"
        random = rng(seed, f"lawn{tile}", row, column)
        grows, kind, rank = random.random(3).tolist()
        xy = np.array([column, row]) * side - osm.half + random.uniform(0.15, 0.85, 2) * side
        if grows > _LAWN_GROWN or not shapely.contains_xy(lawns, *xy):
            continue
        point = shapely.Point(xy)
        near = tracks.query(point, predicate="dwithin", distance=_BESIDE_RAILS)
        if len(near) or len(taken.query(point, predicate="intersects")) or shapely.dwithin(openings, point, 0.8):
            continue
        if kind < _LAWN_SHRUBS:
            name = ("shrub", "shrub_tall", "shrub_flowering")[int(random.integers(3))]
            wish = Placement(cell, name, xy, None, float(random.uniform(0.8, 1.2)))
        else:
            wish = tree_placement(cell, {}, xy, seed, zone)
        wish.reach = 0.0
        found.append((rank, wish))
    limit = sorted(rank for rank, _ in found)[_MOST] if len(found) > _MOST else 1.0
    return [wish for rank, wish in found if rank < limit]


def _kept_free(
    osm: OsmData, carriageway: BaseGeometry, openings: BaseGeometry, window: shapely.Polygon
) -> BaseGeometry:
    """Return where nothing is planted: on and beside ways, houses, and areas that are bare."""
    kept = [NamedShape("footways", overlay.buffer(openings, 0.8))]
    kept.append(NamedShape("carriageways", overlay.buffer(carriageway, 1.6)))
    for area in osm.areas:
        bare = _is_bare(area)
        built = ("building" in area.tags or "building:part" in area.tags) and area.polygon.intersects(window)
        if bare or built:
            with drop_on_failure(area.id):
                within = overlay.intersection(area.polygon, window)
                kept.append(NamedShape(area.id, overlay.buffer(within, 2.2 if built else 1.0)))
    return union_named(kept)


def _is_bare(area: OsmArea) -> bool:
    return any(area.tags.get(key) in values for key, values in _BARE.items()) and area.tags.get("layer", "0") == "0"


def _plant_area(
    area: OsmArea, use: str, ground: BaseGeometry, trunks: NDArray[np.object_], seed: int, zone: str
) -> list[tuple[float, Placement]]:
    """Plant what is free of an area (`ground`): wishes, each with a rank by which areas are thinned."""
    room, random = trees().room, rng(seed, "scatter", area.id)
    found: list[tuple[float, Placement]] = []
    if use == "scrub":
        for k, xy in enumerate(blue_noise_points(ground, _SHRUB_ROOM, 160, random, least=0.6)):
            name = ("shrub", "shrub_tall", "shrub_tall")[int(random.integers(3))]
            wish = Placement(f"{area.id}.{k}", name, xy, None, float(random.uniform(0.75, 1.3)), reach=0.0)
            found.append((float(random.random()), wish))
        return found
    wild = use in ("wood", "forest", "nature_reserve")
    there = int(shapely.contains(area.polygon, trunks).sum()) if len(trunks) else 0
    if not wild and there > 0.3 * ground.area / room[use]:
        return found  # they are mapped one by one
    for k, xy in enumerate(blue_noise_points(ground, room[use], 260, random)):
        wish = tree_placement(f"{area.id}.{k}", area.tags, xy, seed, zone, wild=wild)
        if use == "orchard":
            wish.prototype, wish.scale = "tree_fruit", 1.0
        wish.reach = 0.0
        found.append((float(random.random()), wish))
    if use in ("park", "garden", "cemetery"):
        for k, xy in enumerate(blue_noise_points(ground, 2.2 * room[use] if use == "park" else 70.0, 40, random)):
            name = ("shrub", "shrub_tall", "shrub_flowering")[int(random.integers(3))]
            wish = Placement(f"{area.id}.s{k}", name, xy, None, float(random.uniform(0.8, 1.2)), reach=0.0)
            found.append((float(random.random()), wish))
    return found
