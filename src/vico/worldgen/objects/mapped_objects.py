"""Outdoor things of the map: which model a tag means, points, barriers with gates, areas of several things; and lamps.

`thing_of` leads from OpenStreetMap's tags to the name of a prototype. Points include trees mapped as rows. Barriers are
fences, walls, hedges, chains and rows of bollards. Areas are stalls of a market, tables outside, play equipment, flower
beds. Street lamps stand along the streets of a town where nobody mapped them, but where the map says that none are lit.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.assets.models.library import street_models
from vico.geo import overlay
from vico.geo.osm import OsmArea, OsmData, OsmNode, OsmWay, Tags
from vico.geo.quantities import metres, number, numbers, quantity
from vico.geometry import distance, distances
from vico.seeds import rng
from vico.world.heights import HeightField
from vico.worldgen.facts.fault_isolation import NamedShape, drop_on_failure, union_named
from vico.worldgen.facts.street_habits import street_habits
from vico.worldgen.facts.streets import carriageway_width
from vico.worldgen.objects import catalogue
from vico.worldgen.objects.catalogue import standing
from vico.worldgen.objects.placement import Placement, yaw_from_tag
from vico.worldgen.objects.trees import blue_noise_points, planting, row_placements, tree_placement


def region(osm: OsmData) -> str:
    """Where the look of street things differs: the family of the place's street habits, such as ``uk`` or ``us``."""
    return street_habits(osm).family


def sign_of(code: str) -> str | None:
    """Model of a sign by its `traffic_sign` code (``FI:361[30]``, ``US:R1-1``, ``stop``); None if it is none."""
    first = re.split(r"[;,]", code)[0].strip()
    signs = catalogue.signs()
    if first in signs.words:
        return signs.words[first] or None
    found = re.match(r"([A-Z]{2}):\s*([A-Z]*\d*(?:-\d+)?)", first)
    table = signs.codes.get(found.group(1)) if found else None
    if found is None or table is None:
        return None
    mark = found.group(2)
    for length in range(len(mark), 0, -1):
        if mark[:length] in table:
            return table[mark[:length]] or None
    return None


def on_the_ground(tags: Tags) -> bool:
    """Whether a thing stands outdoors at street level."""
    if tags.get("location") in ("underground", "indoor", "wall", "roof", "rooftop"):
        return False
    if tags.get("indoor", "no") not in ("no", "outdoor") or tags.get("tunnel", "no") not in ("no",):
        return False
    levels = numbers(tags.get("level"))
    return not levels or 0.0 in levels


def thing_of(tags: Tags, *, where: str = "", random: np.random.Generator | None = None) -> str | None:
    """Name of the model for a mapped thing.

    Parameters
    ----------
    tags
        Its tags.
    where
        As `region` says.
    random
        Picks among models that suit equally well; the first without.

    Returns
    -------
    str or None
        None if it is nothing that stands in streets.
    """
    if not on_the_ground(tags):
        return None
    found = _by_main_tag(tags)
    if found is None:
        return sign_of(tags["traffic_sign"]) if "traffic_sign" in tags else None
    if found == "recycling" and _takes_glass_alone(tags):
        return "recycling_glass"
    for finer in catalogue.kinds().finer.get(found, ()):
        models = finer.choice(tags, where)
        if models is not None:
            chosen = models[0] if random is None or len(models) == 1 else models[int(random.integers(len(models)))]
            return chosen or None
    return found


def _by_main_tag(tags: Tags) -> str | None:
    for key, models in catalogue.kinds().tables:
        value = tags.get(key)
        found = models.get(value, models.get(catalogue.ANY)) if value is not None else None
        if found:
            return found
    return None


def _takes_glass_alone(tags: Tags) -> bool:
    taken = [key for key, value in tags.items() if key.startswith("recycling:") and value == "yes"]
    return bool(taken) and all("glass" in key for key in taken)


_LONG = 2.0  # metres of line a model covers at scale 1
_GATES = ("gate", "lift_gate", "swing_gate", "entrance", "kissing_gate", "turnstile", "full-height_turnstile",
          "cycle_barrier", "hampshire_gate", "bump_gate", "motorcycle_barrier", "sally_port")  # fmt: skip
_GAP = 1.2  # metres between the middles of two obstacles in a row that people get through
_IN_ROWS = {"bollard": ("bollard", 1.7), "block": ("block", 2.4), "planter": ("planter", 2.2)}


def _model(tags: Tags) -> str | None:
    """Name the model of a line by kind, material and height."""
    name = catalogue.barriers().lines.get(tags.get("barrier", ""))
    tall = metres(tags.get("height"))
    if name == "fence":
        name = catalogue.barriers().fences.get(tags.get("fence_type", tags.get("material", "")), "fence")
        if name == "fence" and tall is not None and tall > 1.5:
            name = "fence_high"
    elif name == "wall":
        if tags.get("material", tags.get("wall", "")) == "brick":
            name = "wall_brick"
        elif tall is not None:
            name = "wall_low" if tall < 0.9 else "wall" if tall < 1.6 else "wall_high"
    elif name == "hedge" and tall is not None:
        name = "hedge_low" if tall < 0.9 else "hedge" if tall < 1.6 else "hedge_high"
    return name


def barrier_placements(osm: OsmData, carriageway: BaseGeometry, openings: BaseGeometry, half: float) -> list[Placement]:
    """Pieces of some two metres, open where ways and gates lead through; their length decides their scale."""
    gates = [(n.id, n.xy) for n in osm.nodes if n.tags.get("barrier") in _GATES or "entrance" in n.tags]
    lines = [(f"w{way.id}", way.line, way.tags) for way in osm.ways if "area" not in way.tags]
    hedges = [area for area in osm.areas if area.tags.get("barrier") == "hedge" and area.tags.get("area") == "yes"]
    drawn = {area.id for area in hedges}
    gaps = [NamedShape("footways", overlay.buffer(openings, 0.3))]
    gaps.append(NamedShape("carriageways", overlay.buffer(carriageway, 0.3)))
    gaps += [NamedShape(f"n{number}", overlay.buffer(shapely.Point(xy), 1.3)) for number, xy in gates]
    through = union_named(gaps, grid=None)
    shapely.prepare(through)
    found: list[Placement] = []
    for key, line, tags in lines:
        kind = tags.get("barrier", "")
        if key in drawn or (quantity(tags, "layer") or 0) != 0 or np.abs(line).min(axis=0).max() > half:
            continue
        if tags.get("location") in ("underground", "indoor") or (number(tags.get("level")) or 0) != 0:
            continue
        if kind in _IN_ROWS:
            mapped = [n.xy for n in osm.nodes if n.tags.get("barrier") == kind]
            with drop_on_failure(key):
                found += _row(key, line, *_IN_ROWS[kind], through if kind == "planter" else None, mapped)
            continue
        name = _model(tags)
        if name is not None:
            with drop_on_failure(key):
                found += _line(key, line, name, metres(tags.get("height")), through, half)
    for area in hedges:
        with drop_on_failure(area.id):
            found += _blocks(area.id, area.polygon, metres(area.tags.get("height")))
    return found


def _line(
    key: str, line: NDArray[np.float64], name: str, tall: float | None, through: BaseGeometry, half: float
) -> list[Placement]:
    """Pieces of one barrier, as tall as it is said to be, open where something leads `through`."""
    height = 1.0 if tall is None else float(np.clip(tall / street_models()[name].size[2], 0.55, 1.5))
    found: list[Placement] = []
    for piece in shapely.get_parts(overlay.difference(shapely.LineString(line).simplify(0.15), through)):
        for a, b in zip(piece.coords[:-1], piece.coords[1:], strict=True):
            for wish in _pieces(key, name, np.array(a), np.array(b), height):
                if np.abs(wish.xy).max() < half - _LONG:
                    wish.id = f"{key}.{len(found)}"
                    found.append(wish)
    return found


def _pieces(key: str, name: str, a: NDArray[np.float64], b: NDArray[np.float64], height: float) -> list[Placement]:
    """One segment of a line from corner to corner, in equal pieces whose ends meet."""
    length = math.hypot(b[0] - a[0], b[1] - a[1])
    if length < 0.7:
        return []
    count = max(1, round(length / (_LONG * height)))
    scale = float(np.clip(length / count / _LONG, 0.4, 1.6))
    yaw = math.atan2(b[1] - a[1], b[0] - a[0])
    return [
        Placement(key, name, a + (b - a) * ((i + 0.5) / count), yaw, scale, reach=0.0, piece=True) for i in range(count)
    ]


def _row(
    key: str,
    line: NDArray[np.float64],
    name: str,
    apart: float,
    through: BaseGeometry | None,
    mapped: Sequence[NDArray[np.float64]],
) -> list[Placement]:
    """Things that stand along a line one by one, but for those that are mapped one by one too."""
    whole = shapely.LineString(line)
    count = max(1, round(whole.length / apart))
    own = np.array(mapped).reshape(-1, 2)
    found = []
    for k, d in enumerate(np.linspace(0, whole.length, count + 1)):
        point = whole.interpolate(d)
        if (through is None or not through.contains(point)) and not (
            np.hypot(*(own - (point.x, point.y)).T) < _GAP
        ).any():
            found.append(Placement(f"{key}.{k}", name, np.array(point.coords[0]), reach=0.6))
    return found


def _blocks(key: str, shape: BaseGeometry, tall: float | None) -> list[Placement]:
    """Fill a hedge mapped as an area with blocks of a metre along its longer side."""
    box = shapely.oriented_envelope(shape)
    corners = np.array(box.exterior.coords[:3]) if box.geom_type == "Polygon" else np.zeros((3, 2))
    first, second = corners[1] - corners[0], corners[2] - corners[1]
    along = first if np.hypot(*first) >= np.hypot(*second) else second
    if np.hypot(*along) < 0.5:
        return []
    scale = 1.0 if tall is None else float(np.clip(tall / 1.2, 0.5, 1.6))
    yaw = math.atan2(along[1], along[0])
    u, v = np.array([math.cos(yaw), math.sin(yaw)]), np.array([-math.sin(yaw), math.cos(yaw)])
    middle = corners[0] + (corners[2] - corners[0]) / 2
    nu, nv = (max(1, round(float(np.hypot(*side)) / scale)) for side in sorted(
        (first, second), key=lambda s: -float(np.hypot(*s))))  # fmt: skip
    shapely.prepare(shape)
    found: list[Placement] = []
    for i in range(nu):
        for j in range(nv):
            xy = middle + u * (i + 0.5 - nu / 2) * scale + v * (j + 0.5 - nv / 2) * scale
            if len(found) < 200 and shape.dwithin(shapely.Point(xy), 0.15 * scale):
                found.append(Placement(f"{key}.{len(found)}", "hedge_block", xy, yaw, scale, reach=0.0, piece=True))
    return found


def _gate_yaws(osm: OsmData) -> dict[int, float]:
    """Which way each gate leads through, by node id: across the barrier it hangs in, else along its way."""
    barriers: dict[int, float] = {}
    ways: dict[int, float] = {}
    wanted = {n.id for n in osm.nodes if n.tags.get("barrier") in _GATES}
    for way in osm.ways:
        fence = way.tags.get("barrier") in catalogue.barriers().lines or way.tags.get("barrier") == "retaining_wall"
        if not fence and "highway" not in way.tags:
            continue
        for k, node in enumerate(way.nodes):
            if node in wanted and len(way.line) == len(way.nodes):
                d = way.line[min(k + 1, len(way.line) - 1)] - way.line[max(k - 1, 0)]
                yaw = math.atan2(d[1], d[0])
                if fence:
                    barriers[node] = yaw + math.pi / 2
                else:
                    ways[node] = yaw
    return {**barriers, **ways}


def mapped_placements(osm: OsmData, height: HeightField, seed: int) -> list[Placement]:
    """Wish for everything that is mapped as a point or as a row of trees."""
    zone = planting(osm, height)
    where = region(osm)
    points: list[Placement] = []
    gates = _gate_yaws(osm)
    for node in osm.nodes:
        with drop_on_failure(f"n{node.id}"):
            wish = _point_placement(node, seed, zone, where, gates.get(node.id))
            if wish is not None:
                points.append(wish)
    return [*points, *row_placements(osm, seed, zone)]


def _point_placement(node: OsmNode, seed: int, zone: str, where: str, gate: float | None) -> Placement | None:
    """Wish for what a point maps; None for nothing. `gate` is the yaw of a gate there."""
    key = f"n{node.id}"
    if node.tags.get("natural") == "tree":
        return tree_placement(key, node.tags, node.xy, seed, zone)
    if node.tags.get("shelter") == "yes" and (
        node.tags.get("highway") == "bus_stop" or node.tags.get("public_transport") == "platform"
    ):
        return Placement(f"{key}.shelter", "shelter", node.xy, reach=4.5)
    random = rng(seed, "thing", key)
    name = thing_of(node.tags, where=where, random=random)
    if name is None:
        return None
    wish = Placement(key, name, node.xy, yaw_from_tag(node.tags))
    if name.startswith(standing().of_any_size):
        wish.scale = float(random.uniform(0.8, 1.25))
    if gate is not None and wish.yaw is None:
        wish.yaw, wish.reach = gate, 0.0 if name == "gate" else 3.0
    return wish


_PLAY = ("swing", "springy", "seesaw", "climbing_frame", "sandpit", "roundabout", "swing_nest")
_BEDS = ("flowers", "flowers_violet", "flowers_yellow")
_LARGE = 2500.0  # square metres: what is larger is no single thing


def area_placements(
    osm: OsmData, openings: BaseGeometry, half: float, seed: int, *, where: str = ""
) -> list[Placement]:
    """Wish for what stands in mapped areas."""
    found: list[Placement] = []
    played = [n.xy for n in osm.nodes if "playground" in n.tags]
    for area in osm.areas:
        tags = area.tags
        if "building" in tags or "building:part" in tags or not on_the_ground(tags):
            continue
        if not area.polygon.intersects(shapely.box(-half, -half, half, half)):
            continue
        with drop_on_failure(area.id):
            found += _of_area(area, openings, played, seed, where)
    return found


def _of_area(
    area: OsmArea, openings: BaseGeometry, played: list[NDArray[np.float64]], seed: int, where: str
) -> list[Placement]:
    """Wish for what stands in one area; `played` is where play equipment is mapped piece by piece."""
    tags, random = area.tags, rng(seed, "group", area.id)
    if tags.get("amenity") in ("marketplace", "market"):
        names = ("market_stall", "market_stall_green")
        return _grid(area, names, (3.2, 4.4), 30, random, keep=openings if _narrow(area) else None)
    if tags.get("leisure") == "outdoor_seating" or tags.get("amenity") == "biergarten":
        names = ("cafe_parasol", "cafe_table") if tags.get("leisure") else ("picnic_table", "picnic_table")
        return _grid(area, names, (3.1, 3.1), 24, random)
    if tags.get("landuse") == "flowerbed" or tags.get("garden:type") == "flower_bed":
        inner = overlay.buffer(area.polygon, -0.35)
        name = _BEDS[int(random.integers(3))]
        return [
            Placement(f"{area.id}.{k}", name, xy, float(random.uniform(-np.pi, np.pi)), 0.8, reach=0.0)
            for k, xy in enumerate(blue_noise_points(inner, 1.7, 60, random, least=0.98))
        ]
    if tags.get("leisure") == "playground":
        return _playground(area, played, random)
    if tags.get("leisure") == "pitch":
        return _pitch(area)
    if tags.get("leisure") == "fitness_station":
        return [Placement(area.id, "fitness_station", _middle(area))]
    return _single(area, seed, where)


def _middle(area: OsmArea) -> NDArray[np.float64]:
    return np.array(area.polygon.representative_point().coords[0])


def _narrow(area: OsmArea) -> bool:
    """Whether a market is but a widening of streets, which must stay open."""
    return bool(overlay.buffer(area.polygon, -6.0).is_empty)


def _single(area: OsmArea, seed: int, where: str) -> list[Placement]:
    """Wish for an area that is one thing."""
    size = float(area.polygon.area)
    name = thing_of(area.tags, where=where, random=rng(seed, "thing", area.id))
    if name is None or size > _LARGE or name in ("toilets", "fuel_pump") or name.startswith("sign"):
        return []
    xy = _middle(area)
    if name.startswith("fountain"):
        if size < 5.0:
            return [Placement(area.id, "fountain", xy, None, float(np.clip(math.sqrt(size / math.pi) / 2.0, 0.4, 1.0)))]
        side = math.sqrt(size)
        name = "fountain" if shapely.minimum_bounding_radius(area.polygon) < 0.62 * side else "fountain_jets"
        wide = 2.0 * math.sqrt(size / math.pi) if name == "fountain" else side
        return [Placement(area.id, name, xy, _along(area), float(np.clip(wide / 4.2, 0.5, 2.6)))]
    if name.startswith("bicycle_"):
        return _stands(area)
    if name == "motorcycles":
        return _grid(area, ("motorcycles",), (2.4, 2.2), 12, rng(seed, "group", area.id))
    return [Placement(area.id, name, xy)]


def _along(area: OsmArea) -> float:
    """Direction of an area's longer side."""
    box = shapely.oriented_envelope(area.polygon)
    if box.geom_type != "Polygon":
        return 0.0
    corners = np.array(box.exterior.coords[:3])
    first, second = corners[1] - corners[0], corners[2] - corners[1]
    side = first if np.hypot(*first) >= np.hypot(*second) else second
    return math.atan2(side[1], side[0])


def _stands(area: OsmArea) -> list[Placement]:
    """Stands along the longer side of a bicycle park."""
    box = shapely.oriented_envelope(area.polygon)
    corners = np.array(box.exterior.coords[:3])
    sides = sorted(distance(corners[k + 1], corners[k]) for k in range(2))
    yaw = _along(area)
    along = np.array([math.cos(yaw), math.sin(yaw)])
    count = max(1, min(8, int(sides[1] // 3.6)))
    middle = np.array(box.centroid.coords[0])
    names = ("bicycle_parking", "bicycle_parking_empty")
    return [
        Placement(f"{area.id}.{k}", names[k % 2], middle + along * (k + 0.5 - count / 2) * 3.5, yaw - math.pi / 2)
        for k in range(count)
    ]


def _grid(
    area: OsmArea,
    names: tuple[str, ...],
    step: tuple[float, float],
    most: int,
    random: np.random.Generator,
    keep: BaseGeometry | None = None,
) -> list[Placement]:
    """Things in rows along the longer side of an area."""
    yaw = _along(area)
    u, v = np.array([math.cos(yaw), math.sin(yaw)]), np.array([-math.sin(yaw), math.cos(yaw)])
    middle = np.array(area.polygon.centroid.coords[0])
    reach = float(shapely.minimum_bounding_radius(area.polygon))
    n = int(reach // min(step)) + 1
    inner = overlay.buffer(area.polygon, -0.5 * min(step) * 0.8)
    if inner.is_empty:
        inner = area.polygon
    if keep is not None:
        inner = overlay.difference(inner, keep)
    shapely.prepare(inner)
    found: list[Placement] = []
    for j in range(-n, n + 1):
        for i in range(-n, n + 1):
            xy = middle + u * i * step[0] + v * j * step[1]
            if len(found) < most and inner.contains(shapely.Point(xy)):
                facing = yaw + math.pi / 2 + (math.pi if j % 2 else 0.0)
                name = names[int(random.integers(len(names)))]
                found.append(Placement(f"{area.id}.{len(found)}", name, xy, facing, reach=0.5))
    return found


def _playground(area: OsmArea, played: list[NDArray[np.float64]], random: np.random.Generator) -> list[Placement]:
    """Return equipment by the ground's size, unless it is mapped piece by piece."""
    shape = area.polygon
    if any(shape.contains(shapely.Point(xy)) for xy in played):
        return []
    spots = blue_noise_points(overlay.buffer(shape, -1.6), 30.0, 9, random, least=0.85)
    if not len(spots):
        return [Placement(area.id, "springy", _middle(area))]
    names = ["play_tower" if shape.area > 60 else "slide", *np.array(_PLAY)[random.permutation(len(_PLAY))].tolist()]
    names.append("bench")
    yaws = random.uniform(-np.pi, np.pi, len(spots))
    return [
        Placement(area.id if k == 0 else f"{area.id}.{k}", str(name), xy, float(yaw))
        for k, (name, xy, yaw) in enumerate(zip(names, spots, yaws, strict=False))
    ]


def _pitch(area: OsmArea) -> list[Placement]:
    """Goals and hoops at the ends of a pitch."""
    sport = area.tags.get("sport", "")
    name = "basketball_hoop" if "basketball" in sport else "goal"
    if not any(s in sport for s in ("basketball", "soccer", "multi", "football", "futsal", "handball")):
        if "table_tennis" in sport:
            return [Placement(area.id, "table_tennis", _middle(area))]
        return [Placement(area.id, "chess_table", _middle(area))] if "chess" in sport else []
    yaw = _along(area)
    along = np.array([math.cos(yaw), math.sin(yaw)])
    ring = shapely.oriented_envelope(area.polygon)
    if ring.geom_type != "Polygon":
        return []
    corners = np.array(ring.exterior.coords[:3])
    long = max(distance(corners[k + 1], corners[k]) for k in range(2))
    middle = np.array(ring.centroid.coords[0])
    scale = float(np.clip(long / 60.0, 1.0, 2.0)) if name == "goal" else 1.0
    out = long / 2 - 1.0 * scale
    return [
        Placement(f"{area.id}.0", name, middle + along * out, yaw + math.pi, scale),
        Placement(f"{area.id}.1", name, middle - along * out, yaw, scale),
    ]


#: Metres from one lamp to the next along a street, and to the nearest lamp that is mapped.
SPACING = 28.0
_APART = 20.0
# Metres between the kerb and a lamp, and how far from a street's middle a kerb is looked for.
_BESIDE_KERB = 0.6  # metres from the kerb to a lamp
_WIDEST = 16.0  # metres from the middle of a way within which its kerb is looked for
# Where nothing says whether a street is lit, it is where houses stand this near, metres.
_TOWN = 45.0
_REACH = 2.4
_ROADS = ("primary", "secondary", "tertiary", "unclassified", "residential", "living_street", "road")
_ON_FOOT = ("pedestrian",)
# Those for people on foot are lit only where the map says so.
_PATHS = ("footway", "path", "cycleway", "steps", "service")
_LIT = ("yes", "24/7", "automatic", "limited", "sunset-sunrise", "dusk-dawn", "interval")
_DARK = ("no", "disused")


def lamp_placements(
    osm: OsmData,
    carriageway: BaseGeometry,
    solids: Sequence[BaseGeometry],
    known: NDArray[np.float64],
    *,
    lamp: str | None = None,
) -> list[Placement]:
    """Wish for lamps along lit streets, on alternate sides, where none stand yet.

    Parameters
    ----------
    carriageway
        Where vehicles drive.
    solids
        Footprints of buildings: where the map is silent, streets beside them are lit.
    known
        Where lamps are mapped, metres, shape ``(n, 2)``.
    lamp
        Model of those along streets; ``street_lamp`` without.
    """
    shapely.prepare(carriageway)
    houses, taken = shapely.STRtree(list(solids)), [known.reshape(-1, 2)]
    found: list[Placement] = []
    for way in osm.ways:
        if not _may_be_lit(way):
            continue
        with drop_on_failure(f"w{way.id}"):
            for k, (xy, out) in enumerate(_steps(way)):
                near = _distance(np.concatenate(taken), xy)
                if near < _APART or not (_is_lit(way) or _in_town(xy, houses)):
                    continue
                spot = _spot(xy, out if k % 2 else -out, way, carriageway)
                if spot is None or _distance(np.concatenate(taken), spot) < _APART:
                    continue
                taken.append(spot[None])
                name = lamp or "street_lamp" if way.tags["highway"] in _ROADS else "park_lamp"
                found.append(Placement(f"w{way.id}.lamp{k}", name, spot, reach=_REACH))
    return found


def _may_be_lit(way: OsmWay) -> bool:
    tags = way.tags
    kind = tags.get("highway", "").removesuffix("_link")
    if tags.get("lit") in _DARK or tags.get("tunnel", "no") != "no" or tags.get("bridge", "no") != "no":
        return False
    if tags.get("layer", "0") != "0" or tags.get("indoor", "no") != "no":
        return False
    return kind in _ROADS + _ON_FOOT or (kind in _PATHS and _is_lit(way) and tags.get("footway") is None)


def _is_lit(way: OsmWay) -> bool:
    return way.tags.get("lit") in _LIT


def _in_town(xy: NDArray[np.float64], houses: shapely.STRtree) -> bool:
    return bool(len(houses.query(shapely.Point(xy), predicate="dwithin", distance=_TOWN)))


def _distance(points: NDArray[np.float64], xy: NDArray[np.float64]) -> float:
    return float(distances(points, xy).min(initial=math.inf))


def _steps(way: OsmWay) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return points along the middle of a way, evenly, and unit vectors to the left there; the ends are junctions."""
    line = shapely.LineString(way.line)
    count = round(line.length / SPACING)
    if count < 1:
        return []
    found = []
    for share in (np.arange(count) + 0.5) / count:
        a, b = (np.array(line.interpolate(share * line.length + d).coords[0]) for d in (-0.5, 0.5))
        along = (b - a) / max(distance(b, a), 1e-9)
        found.append(((a + b) / 2.0, np.array([-along[1], along[0]])))
    return found


def _spot(
    xy: NDArray[np.float64], out: NDArray[np.float64], way: OsmWay, carriageway: BaseGeometry
) -> NDArray[np.float64] | None:
    """Return where a lamp stands on one side of a way: beside the kerb, or beside the way where there is none."""
    if not shapely.intersects_xy(carriageway, *xy):
        width = carriageway_width(way.tags) if way.tags["highway"] in _ROADS else 3.0
        return xy + out * (width / 2 + _BESIDE_KERB)
    across = shapely.LineString([xy, xy + _WIDEST * out])
    drivable = overlay.intersection(across, carriageway)
    first = next(
        (part for part in shapely.get_parts(drivable) if shapely.distance(part, shapely.Point(xy)) < 0.1), None
    )
    if first is None or first.length > _WIDEST - 1.0:
        return None
    return xy + out * (first.length + _BESIDE_KERB)
