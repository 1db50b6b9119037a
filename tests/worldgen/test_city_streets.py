"""The streets of a city as a whole, and what its tiles get of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely
from shapely import MultiPolygon

from vico.world.city import whole_ground
from vico.world.heights import Decks, HeightField, Steps
from vico.world.lanes import LaneGraph, read_lanes
from vico.world.world import World
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.seams.joins import Tile, TileGrid
from vico.worldgen.seams.mosaic import NetworkCutter, TileShape, solids_of, streets_of, write_ground


def _lines(lanes: LaneGraph) -> dict[str, shapely.LineString]:
    return {lane: shapely.LineString(lanes.line(k)) for k, lane in enumerate(lanes.ids)}


def test_a_tile_gets_the_lanes_around_it_whole(helsinki: World, tmp_path: Path) -> None:
    east, north, half = 20.0, -30.0, 50.0
    cut = tmp_path / "roads.net.xml"
    cut.write_bytes(
        NetworkCutter(helsinki.file("roads.net.xml").read_bytes()).within(half=half, east=east, north=north)
    )
    whole, part = helsinki.lanes, read_lanes(cut)
    assert 0 < len(part) < len(whole)
    square = shapely.box(east - half, north - half, east + half, north + half)
    for lane, line in _lines(part).items():
        k = whole.index[lane]
        there = whole.line(k) - [east, north]
        assert np.allclose(shapely.get_coordinates(line), there, atol=2e-3)
        number = part.index[lane]
        assert np.array_equal(
            part.z[part.first[number] : part.first[number + 1]], whole.z[whole.first[k] : whole.first[k + 1]]
        )
        following = {whole.ids[n] for n in whole.following(k)}
        assert {part.ids[n] for n in part.following(number)} == following & set(part.ids)
    missing = [lane for lane, line in _lines(whole).items() if lane not in part.index and line.intersects(square)]
    # Of junctions only what joins two streets that are near is kept.
    assert [lane for lane in missing if not lane.startswith(":")] == []


def test_cutting_everything_leaves_everything(helsinki: World, tmp_path: Path) -> None:
    cut = tmp_path / "roads.net.xml"
    cut.write_bytes(NetworkCutter(helsinki.file("roads.net.xml").read_bytes()).within(half=5000.0, east=0.0, north=0.0))
    whole, part = helsinki.lanes, read_lanes(cut)
    assert part.ids == whole.ids
    assert np.array_equal(part.points, whole.points)
    assert np.array_equal(part.next, whole.next)
    assert np.array_equal(part.zone, whole.zone)
    assert part.junctions == whole.junctions
    assert part.lights.programs == whole.lights.programs
    assert len(part.walks) == len(whole.walks)


PAIR = TileGrid(160.0, (0, 0), (1, 0))


def _field(tile: Tile) -> HeightField:
    """A slope and a kerb that go on from tile to tile."""
    half, shift = 100.0, PAIR.centre(tile)
    axis = np.linspace(-half, half, 51)
    heights = (0.01 * (axis[None] + shift[0]) + np.zeros((51, 1))).astype(np.float32)
    fine = np.linspace(-half, half, 401)
    edge = np.clip(127 * (fine[:, None] + np.zeros((1, 401))), -127, 127).astype(np.int8)
    low, high = np.full((401, 401), -120, np.int16), np.zeros((401, 401), np.int16)
    deck = np.array([[60.0 - shift[0], 5.0, 6.0], [100.0 - shift[0], 5.0, 6.0]])
    decks = Decks.of([(deck, 3.0, 3.0, 0.0)]) if tile == (0, 0) else None
    return HeightField(heights, half, Steps(edge, low, high), decks)


def test_the_ground_of_a_city_is_that_of_its_tiles(tmp_path: Path) -> None:
    write_ground(tmp_path, PAIR, _field)
    ground = whole_ground(tmp_path, PAIR.half)
    spots = np.random.default_rng(0).uniform((-80.0, -80.0), (240.0, 80.0), (2000, 2))
    for tile in PAIR:
        here = spots[np.abs(spots - PAIR.centre(tile)).max(axis=1) <= 80.0]
        own = _field(tile)
        for name in ("smooth", "lower", "upper", "edge_distance"):
            found, told = getattr(ground, name)(here), getattr(own, name)(here - PAIR.centre(tile))
            assert np.allclose(found, told, atol=1e-5), name
    # On the deck, of which one tile alone knows: in both.
    assert ground.near([[75.0, 5.0, 6.0], [95.0, 5.0, 6.0]]).tolist() == [6.0, 6.0]
    assert ground.near([[95.0, 5.0, 0.0]])[0] == ground([[95.0, 5.0]])[0]


def test_streets_and_houses_of_tiles_are_put_together() -> None:
    def street(tile: Tile) -> TileShape:
        x, _ = PAIR.centre(tile)
        road = MultiPolygon([shapely.box(-300.0 - x, -4.0, 300.0 - x, 4.0)])
        none = MultiPolygon()
        streets = StreetPolygons(road, none, none, none, none, none, none, none, [], [], [], road, {"setts": road})
        return TileShape([shapely.box(-5.0, 10.0, 5.0, 20.0)], frozenset({tile[0]}), streets)

    shapes = {tile: street(tile) for tile in PAIR}
    streets = streets_of(shapes, PAIR)
    assert len(streets.carriageway.geoms) == 1
    assert streets.carriageway.bounds == (-80.0, -4.0, 240.0, 4.0)
    assert streets.paved["setts"].equals(streets.carriageway)
    assert [solid.bounds for solid in solids_of(shapes, PAIR)] == [(-5.0, 10.0, 5.0, 20.0), (155.0, 10.0, 165.0, 20.0)]
