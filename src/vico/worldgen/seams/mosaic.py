"""Data of a city's tiles, put together or cut to them: ground, streets, walkable map, road network.

There is one field of heights, one set of street polygons and one walkable map of the whole city: the surfaces of its
tiles, room to walls, and what is joined with what. The road network is cut to whole streets near a tile, in the
tile's own coordinates.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, tostring

import numpy as np
from defusedxml.ElementTree import fromstring
from numpy.typing import NDArray
from scipy import ndimage
from shapely import MultiPolygon, Polygon
from shapely.affinity import translate

from vico.geo import overlay
from vico.geo.overlay import polygons_of
from vico.io.arrays import new_array, npz_bytes
from vico.io.files import write_bytes
from vico.world.city import COST, EDGE, GATES, HIGH, LEVELS, LOW, REACHED, ROOM, SMOOTH, STEPS, SURFACES
from vico.world.city_gates import Gates
from vico.world.heights import Decks, HeightField, Stairs
from vico.world.lanes import DisjointSets
from vico.world.routing import walking_costs
from vico.world.walkable import BLOCKED, WalkableMap, read_walkable
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.seams.joins import KINDS, Tile, TileGrid, crop_heights


@dataclass(frozen=True)
class TileShape:
    """Parts of a tile that its city's streets depend on, in the tile's coordinates.

    Attributes
    ----------
    solids
        Footprints of what stands there, of buildings beyond the border only those of its own.
    open_ways
        Ids of the ways on decks and in tunnels that can be used.
    streets
        As its neighbours see them, too.
    """

    solids: list[Polygon]
    open_ways: frozenset[int]
    streets: StreetPolygons


def streets_of(shapes: Mapping[Tile, TileShape], grid: TileGrid) -> StreetPolygons:
    """Put the streets of tiles together: polygons alone, without the lines they were made of."""
    parts: dict[str, list[Polygon]] = {kind: [] for kind in KINDS}
    paved: dict[str, list[Polygon]] = {}
    for tile, shape in shapes.items():
        square, (x, y) = grid.box(tile, seen_from=tile), grid.centre(tile)
        for kind in KINDS:
            parts[kind] += _within(getattr(shape.streets, kind), square, x, y)
        for name, polygons in shape.streets.paved.items():
            paved.setdefault(name, []).extend(_within(polygons, square, x, y))
    whole = {kind: _unite(found) for kind, found in parts.items()}
    return StreetPolygons(
        **whole, streets=[], crossings=[], rails=[], paved={name: _unite(found) for name, found in paved.items()}
    )


def _within(shape: MultiPolygon, square: Polygon, x: float, y: float) -> list[Polygon]:
    return [translate(part, x, y) for part in polygons_of(overlay.intersection(shape, square))]


def _unite(parts: Sequence[Polygon]) -> MultiPolygon:
    return MultiPolygon(polygons_of(overlay.union_all(parts))) if parts else MultiPolygon()


def solids_of(shapes: Mapping[Tile, TileShape], grid: TileGrid) -> list[Polygon]:
    """Return the footprints of what stands in all tiles, in the city's coordinates."""
    return [translate(solid, *grid.centre(tile)) for tile, shape in shapes.items() for solid in shape.solids]


def write_ground(folder: Path, grid: TileGrid, levels_of: Callable[[Tile], HeightField]) -> None:
    """Write the heights of a whole city, tile by tile: no more than one is held in memory.

    Parameters
    ----------
    folder
        Where to.
    grid
        The city's tiles.
    levels_of
        Reads the ground of a tile, over its square and more.
    """
    smooth, stepped = 2, 2
    for tile in grid:
        field = crop_heights(levels_of(tile), half=grid.size / 2)
        smooth = max(smooth, field.heights.shape[0])
        stepped = max(stepped, 2 if field.steps is None else len(field.steps.edge))
    sides = 2 * grid.reach + 1
    decks: list[Decks] = []
    stairs: list[Stairs] = []
    with ExitStack() as files:

        def array(name: str, samples: int, kind: Any, fill: float = 0) -> NDArray[Any]:
            side = sides * (samples - 1) + 1
            return files.enter_context(new_array(folder / name, (side, side), kind, fill))

        heights = array(SMOOTH, smooth, np.float32)
        steps = [
            array(EDGE, stepped, np.int8, 127),
            array(LOW, stepped, np.int16),
            array(HIGH, stepped, np.int16),
        ]
        for tile in grid:
            levels = levels_of(tile)
            field, (x, y) = crop_heights(levels, half=grid.size / 2), grid.centre(tile)
            _put(heights, _resample(field, smooth), tile, grid)
            if field.steps is not None:
                _put(steps[0], field.steps.edge, tile, grid)
                _put(steps[1], field.steps.low, tile, grid)
                _put(steps[2], field.steps.high, tile, grid)
            decks += [] if levels.decks is None else [levels.decks.moved(x, y)]
            stairs += [] if levels.stairs is None else [levels.stairs.moved(x, y)]
    arrays: dict[str, NDArray[Any]] = {}
    arrays |= Decks.joined(decks).arrays() if decks else {}
    arrays |= Stairs.joined(stairs).arrays() if stairs else {}
    write_bytes(folder / LEVELS, npz_bytes(arrays))


def _resample(field: HeightField, samples: int) -> NDArray[np.float32]:
    """Return smooth heights with so many samples a side."""
    if len(field.heights) == samples:
        return field.heights
    axis = np.linspace(-field.half, field.half, samples)
    points = np.stack(np.meshgrid(axis, axis), axis=-1)
    return field.smooth(points).astype(np.float32)


def _put(whole: NDArray[Any], part: NDArray[Any], tile: Tile, grid: TileGrid) -> None:
    side = len(part) - 1
    i, j = (side * k for k in grid.place(tile))
    whole[j : j + side + 1, i : i + side + 1] = part


#: Metres of room to walls that are distinguished: more counts as so much.
MOST_ROOM = 16.0


def write_walking(folder: Path, grid: TileGrid, tiles: Mapping[Tile, Path]) -> None:
    """Write the walkable map of a city.

    Parameters
    ----------
    folder
        Where to.
    grid, tiles
        Its tiles, and the files with the maps of those that are built; in others nobody walks.
    """
    first = read_walkable(next(iter(tiles.values())))
    side, cell = first.n, first.cell
    shape = (2 * grid.reach + 1) * side, (2 * grid.reach + 1) * side
    with ExitStack() as files:
        surfaces = files.enter_context(new_array(folder / SURFACES, shape, np.uint8))
        room = files.enter_context(new_array(folder / ROOM, shape, np.float32))
        reached = files.enter_context(new_array(folder / REACHED, shape, np.bool_))
        for tile, path in tiles.items():
            surfaces[cells_of_tile(tile, grid, side)] = read_walkable(path).cls
        for tile in tiles:
            room[cells_of_tile(tile, grid, side)] = _clearance(surfaces, cells_of_tile(tile, grid, side), cell)
        _write_reached(surfaces, [cells_of_tile(tile, grid, side) for tile in tiles], reached)
        cost = files.enter_context(new_array(folder / COST, shape, np.int16))
        for tile in tiles:
            square = cells_of_tile(tile, grid, side)
            wide, own = window_around(square, 1)
            cost[square] = walking_costs(surfaces[wide], room[wide], reached[wide])[own]


def write_gates(folder: Path, gates: Sequence[Gates]) -> None:
    """Write the gates of all tiles of a city as one table."""
    whole = Gates.joined(gates)
    with new_array(folder / STEPS, whole.steps.shape, np.uint8) as steps:
        steps[:] = whole.steps
    write_bytes(folder / GATES, npz_bytes(whole.arrays()))


def window_around(square: tuple[slice, slice], cells: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return the rows and columns so many cells around a square, and where it lies in them."""
    wide = tuple(slice(max(0, part.start - cells), part.stop + cells) for part in square)
    own = tuple(slice(part.start - w.start, part.stop - w.start) for part, w in zip(square, wide, strict=True))
    return (wide[0], wide[1]), (own[0], own[1])


def cells_of_tile(tile: Tile, grid: TileGrid, side: int) -> tuple[slice, slice]:
    """Return the rows and columns of a tile's cells."""
    column, row = grid.place(tile)
    return slice(row * side, (row + 1) * side), slice(column * side, (column + 1) * side)


def _clearance(surfaces: NDArray[np.uint8], square: tuple[slice, slice], cell: float) -> NDArray[np.float32]:
    """Return the clearance of a tile's cells; walls of its neighbours count."""
    wide, own = window_around(square, int(np.ceil(MOST_ROOM / cell)) + 1)
    clearance = WalkableMap(np.ascontiguousarray(surfaces[wide]), 1.0, cell).clearance
    return np.minimum(clearance[own], np.float32(MOST_ROOM))


def _write_reached(surfaces: NDArray[np.uint8], squares: list[tuple[slice, slice]], reached: NDArray[np.bool_]) -> None:
    """Find what is joined with the city's edge, tile by tile; the largest such part where there are several."""
    height, width = surfaces.shape
    regions: list[tuple[NDArray[np.int32], int]] = []
    sizes = [0]
    for square in squares:
        labels, count = ndimage.label(surfaces[square] != BLOCKED)
        regions.append((labels.astype(np.int32), len(sizes) - 1))
        sizes += np.bincount(labels.ravel(), minlength=count + 1)[1:].tolist()
    sets = DisjointSets(len(sizes))
    by_corner = {(square[0].start, square[1].start): k for k, square in enumerate(squares)}
    at_edge: set[int] = set()
    for k, (rows, columns) in enumerate(squares):
        own = _city_labels(regions[k])
        for there, mine, theirs in (
            ((rows.start, columns.stop), own[:, -1], lambda other: other[:, 0]),
            ((rows.stop, columns.start), own[-1], lambda other: other[0]),
        ):
            if there in by_corner:
                across = theirs(_city_labels(regions[by_corner[there]]))
                for a, b in set(zip(mine.tolist(), across.tolist(), strict=True)):
                    if a and b:
                        sets.join(a, b)
        edges = [own[0]] * (rows.start == 0) + [own[-1]] * (rows.stop == height)
        edges += [own[:, 0]] * (columns.start == 0) + [own[:, -1]] * (columns.stop == width)
        at_edge |= {int(label) for edge in edges for label in np.unique(edge) if label}
    total: dict[int, int] = {}
    for label, size in enumerate(sizes):
        total[sets.root(label)] = total.get(sets.root(label), 0) + size
    roots = sorted({sets.root(label) for label in at_edge})
    if not roots:
        return
    best = max(roots, key=lambda root: (total[root], -root))
    joined = np.array([label > 0 and sets.root(label) == best for label in range(len(sizes))])
    for k, square in enumerate(squares):
        reached[square] = joined[_city_labels(regions[k])]


def _city_labels(region: tuple[NDArray[np.int32], int]) -> NDArray[Any]:
    """Return a tile's labels as they are counted through the city; 0 where nobody walks."""
    labels, before = region
    return np.where(labels > 0, labels + before, 0)


_POINT = re.compile(r"(-?\d+\.?\d*),(-?\d+\.?\d*)")


class NetworkCutter:
    """Cuts SUMO networks out of a larger one.

    Parameters
    ----------
    net
        The bytes of its ``roads.net.xml``, local metres.
    """

    def __init__(self, net: bytes) -> None:
        root = fromstring(net)
        self._attributes = dict(root.attrib)
        self._by_tag: dict[str, list[Element]] = {}
        for element in root:
            self._by_tag.setdefault(element.tag, []).append(element)
        self._streets = [edge for edge in self._of("edge") if not edge.get("function")]
        self._boxes = np.array([_box(edge) for edge in self._streets]).reshape(-1, 4)
        # Where things of a tag stand in the file: a tile looks at those that are near alone.
        self._edge_at = {edge.get("id"): k for k, edge in enumerate(self._of("edge"))}
        self._junction_at = {junction.get("id"): k for k, junction in enumerate(self._of("junction"))}
        self._links_from: dict[Any, list[int]] = {}
        for k, link in enumerate(self._of("connection")):
            self._links_from.setdefault(link.get("from"), []).append(k)
        self._walked: dict[str, list[Any]] = {}
        for edge in self._of("edge"):
            if edge.get("function") in ("walkingarea", "crossing"):
                self._walked.setdefault(str(edge.get("id"))[1:].rpartition("_")[0], []).append(edge.get("id"))

    def _of(self, tag: str) -> list[Element]:
        return self._by_tag.get(tag, [])

    def within(self, *, half: float, east: float, north: float) -> bytes:
        """Return the streets that reach into a square, and what of their junctions joins them.

        Parameters
        ----------
        half
            Half its side, metres.
        east, north
            Its middle; what is found is told from there.
        """
        west, south, right, top = self._boxes.T if len(self._boxes) else np.zeros((4, 0))
        near = (west <= east + half) & (right >= east - half) & (south <= north + half) & (top >= north - half)
        edges = {self._streets[k].get("id") for k in np.flatnonzero(near)}
        junctions = {self._streets[k].get(end) for k in np.flatnonzero(near) for end in ("from", "to")}
        edges |= self._through(edges, junctions)
        kept = [self._of("edge")[k] for k in sorted(self._edge_at[name] for name in edges if name in self._edge_at)]
        lanes = {lane.get("id") for edge in kept for lane in edge}
        links = [link for link in self._leaving(edges) if link.get("to") in edges]
        programs = {link.get("tl") for link in links}
        root = Element("net", self._attributes)
        root.extend(self._of("location"))
        root.extend(self._of("type"))
        root.extend(_shift_element(edge, east, north) for edge in kept)
        root.extend(program for program in self._of("tlLogic") if program.get("id") in programs)
        at = sorted(self._junction_at[name] for name in junctions | lanes if name in self._junction_at)
        root.extend(_joining(_shift_element(self._of("junction")[k], east, north), lanes) for k in at)
        root.extend(links)
        return b'<?xml version="1.0" encoding="UTF-8"?>\n' + bytes(tostring(root)) + b"\n"

    def _through(self, streets: Iterable[Any], junctions: Iterable[Any]) -> set[Any]:
        """Return the parts of junctions that lead from one of some streets to another, and where people cross them."""
        kept, known = set(streets), set(junctions)
        inside: set[Any] = set()
        found = kept
        while found:
            links = (link for link in self._leaving(found) if link.get("to") in kept and link.get("via"))
            found = {str(link.get("via")).rpartition("_")[0] for link in links} - inside
            inside |= found
        return inside | {edge for junction in known for edge in self._walked.get(str(junction), ())}

    def _leaving(self, edges: Iterable[Any]) -> list[Element]:
        """Return the connections that leave some edges, in the order of the file."""
        return [self._of("connection")[k] for k in sorted(k for name in edges for k in self._links_from.get(name, ()))]


def _box(edge: Element) -> tuple[float, float, float, float]:
    points = [found for lane in edge for found in _POINT.findall(lane.get("shape", ""))]
    xy = np.array(points, np.float64).reshape(-1, 2)
    (west, south), (east, north) = xy.min(axis=0), xy.max(axis=0)
    return float(west), float(south), float(east), float(north)


def _shift_element(element: Element, east: float, north: float) -> Element:
    """Return a copy of an element and its children with coordinates from another origin."""
    moved = Element(element.tag, dict(element.attrib))
    if "shape" in moved.attrib:
        moved.set(
            "shape", _POINT.sub(lambda p: f"{float(p[1]) - east:.3f},{float(p[2]) - north:.3f}", moved.attrib["shape"])
        )
    for axis, shift in (("x", east), ("y", north)):
        if axis in moved.attrib:
            moved.set(axis, f"{float(moved.attrib[axis]) - shift:.3f}")
    moved.extend(_shift_element(child, east, north) for child in element)
    return moved


def _joining(junction: Element, lanes: set[Any]) -> Element:
    """Return a junction that knows of some lanes alone."""
    for key in ("incLanes", "intLanes"):
        junction.set(key, " ".join(lane for lane in junction.get(key, "").split() if lane in lanes))
    return junction
