"""Cities of tiles: neighbours agree along their borders, whatever was built first."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
import tifffile
from hypothesis import given
from hypothesis import strategies as st
from shapely.affinity import translate

from damaged_maps import DrawnMap, DrawnWay, write_map
from random_windows import painted_once
from vico.errors import InputError, MissingFileError, SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData
from vico.io.files import write_json
from vico.world.check import check_whole
from vico.world.city import CityManifest, CityTile, Side, border_findings, profile_of, read_city
from vico.world.city_world import CityWorld
from vico.world.folder import read_world
from vico.world.heights import HeightField
from vico.world.mesh import Material, Surface
from vico.world.model import Origin
from vico.world.world import World
from vico.worldgen import city_region
from vico.worldgen.city_build import build_city, city_request, divide_map, divide_sources, plan_tile
from vico.worldgen.city_region import CityRequest
from vico.worldgen.facts.site import site_facts
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.request import Sources
from vico.worldgen.seams.joins import (
    BORES,
    HALO,
    TileGrid,
    blend_heights,
    crop_heights,
    fit_border,
    grid_of,
    grid_over,
    join_neighbours,
    tile_name,
)
from vico.worldgen.stages import load_product
from vico.worldgen.streets.roads import streets_from_osm

EXTRACT = Path(__file__).parents[2] / "src" / "vico" / "data" / "helsinki.osm.pbf"
CENTRE = (60.1690, 24.9435)
PAIR = TileGrid(160.0, (0, 0), (1, 0))


@given(st.floats(1.0, 20_000.0), st.sampled_from([160.0, 400.0, 800.0]))
def test_a_grid_covers_what_is_asked_for_with_as_few_tiles_as_can_be(extent: float, size: float) -> None:
    grid = grid_of(extent, size)
    side = grid.last[0] - grid.first[0] + 1
    assert side % 2 == 1
    assert len(list(grid)) == len(grid) == side * side
    assert side * size >= extent
    assert side == 1 or (side - 2) * size < extent


@given(*[st.integers(-9, 0)] * 2, *[st.integers(0, 9)] * 2, st.sampled_from([160.0, 408.0]))
def test_the_edges_of_a_grid_are_those_of_its_tiles(west: int, south: int, east: int, north: int, size: float) -> None:
    grid = TileGrid(size, (west, south), (east, north))
    assert grid.edges == shapely.union_all([grid.box(tile) for tile in grid]).bounds
    assert max(map(abs, grid.edges)) == grid.half
    reach = grid.reach
    square = TileGrid(size, (-reach, -reach), (reach, reach))
    assert square.edges == (-grid.half, -grid.half, grid.half, grid.half)


def _covers(grid: TileGrid, west: float, south: float, east: float, north: float) -> bool:
    low, high = grid.box(grid.first).bounds[:2], grid.box(grid.last).bounds[2:]
    return low[0] <= west and low[1] <= south and high[0] >= east and high[1] >= north


@given(
    *[st.floats(-4_000.0, 0.0)] * 2, *[st.floats(0.0, 4_000.0)] * 2, st.sampled_from([160.0, 400.0]),
)  # fmt: skip
def test_a_rectangle_is_covered_with_as_few_tiles_as_can_be(
    west: float, south: float, east: float, north: float, size: float
) -> None:
    grid = grid_over((west, south), (east, north), size)
    assert (0, 0) in grid
    assert _covers(grid, west, south, east, north)
    (left, low), (right, high) = grid.first, grid.last
    smaller = [
        ((left + 1, low), (right, high)), ((left, low + 1), (right, high)),
        ((left, low), (right - 1, high)), ((left, low), (right, high - 1)),
    ]  # fmt: skip
    for first, last in smaller:
        if (0, 0) in TileGrid(size, first, last):
            assert not _covers(TileGrid(size, first, last), west, south, east, north)


def test_a_box_is_covered_around_its_middle_or_a_centre_in_it(tmp_path: Path) -> None:
    sources, lat, lon = Sources(tmp_path / "no.pbf"), *CENTRE
    box = lon - 0.004, lat - 0.001, lon + 0.004, lat + 0.001
    request = city_request(sources, lat=lat, lon=lon, extent=box, out=tmp_path / "city", tile=160.0)
    # 445 m from west to east, 223 m from south to north.
    assert (request.grid.first, request.grid.last) == ((-1, -1), (1, 1))
    wide = city_request(
        sources, lat=lat, lon=lon, extent=(box[0], lat - 0.0005, box[2], lat + 0.0005), out=tmp_path / "c", tile=160.0
    )
    assert (wide.grid.first, wide.grid.last) == ((-1, 0), (1, 0))
    for bad, words in (
        ((25.0, 60.0, 24.0, 61.0), "the smaller of each first"),
        ((0.0, 0.0, 1.0, 1.0), "outside"),
        ((20.0, 55.0, 30.0, 65.0), "smaller box"),
    ):
        with pytest.raises(InputError, match=words):
            city_request(sources, lat=lat, lon=lon, extent=bad, out=tmp_path / "city", tile=160.0)


def test_the_frame_of_a_tile_is_that_of_the_city_shifted() -> None:
    city, tile = LocalFrame(*CENTRE), LocalFrame(*CENTRE, east=400.0, north=-800.0)
    lat, lon = np.array([60.1701, 60.1612]), np.array([24.95, 24.9501])
    shift = np.array([400.0, -800.0])
    assert np.allclose(tile.to_enu(lat, lon) + shift, city.to_enu(lat, lon), atol=1e-9)
    assert np.allclose(tile.to_geodetic(np.zeros(2)), city.to_geodetic(shift), atol=1e-12)


def _field(rng: np.random.Generator, half: float) -> HeightField:
    n = round(2 * half / 4.0) + 1
    return HeightField(rng.normal(0.0, 3.0, (n, n)).astype(np.float32), half)


@given(st.integers(0, 1000))
def test_neighbours_compute_the_same_heights_and_keep_their_own_further_in(seed: int) -> None:
    grid = TileGrid(160.0, (0, 0), (1, 1))
    rng = np.random.default_rng(seed)
    half = 80.0 + HALO + 60.0
    fields = {tile: _field(rng, half) for tile in grid}
    made = {tile: crop_heights(blend_heights(fields, tile, grid), half=80.0 + 60.0) for tile in grid}
    spots = rng.uniform(-60.0, 220.0, (500, 2)).round(3)
    seen = []
    for tile, field in made.items():
        here = spots - grid.centre(tile)
        inside = np.abs(here).max(axis=1) <= 140.0
        z = np.full(len(spots), np.nan)
        z[inside] = field.smooth(here[inside])
        seen.append(z)
    assert np.nanmax(np.nanmax(seen, axis=0) - np.nanmin(seen, axis=0)) < 1e-9
    middle = rng.uniform(-40.0, 40.0, (50, 2))
    assert np.allclose(made[0, 0].smooth(middle), fields[0, 0].smooth(middle), atol=1e-5)


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> CityRequest:
    """Two tiles of Helsinki side by side, planned but not built."""
    out = tmp_path_factory.mktemp("pair")
    request = CityRequest(Sources(EXTRACT), *CENTRE, PAIR, 0, out)
    divide_sources(request)
    for tile in PAIR:
        plan_tile(request, tile)
    return request


def _no_reading(*_: object, **__: object) -> OsmData:
    raise AssertionError("the map is read")


def test_a_map_is_read_again_where_it_or_a_part_of_it_is_not_what_it_was(
    planned: CityRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(city_region, "read_osm", _no_reading)
    key = divide_map(planned).key
    changed = tmp_path / "changed.osm.pbf"
    changed.write_bytes(EXTRACT.read_bytes() + b"\0")
    with pytest.raises(AssertionError, match="is read"):
        divide_map(replace(planned, sources=Sources(changed)))
    assert not (planned.plans / "map.json").exists()  # until it is divided
    monkeypatch.undo()
    assert divide_map(planned).key == key
    monkeypatch.setattr(city_region, "read_osm", _no_reading)
    part = planned.plans / tile_name(next(iter(PAIR))) / "map.stage"
    assert part.exists()
    lost = part.rename(tmp_path / "map.stage")
    with pytest.raises(AssertionError, match="is read"):
        divide_map(planned)
    lost.rename(part)
    monkeypatch.undo()
    divide_map(planned)


def test_a_map_is_divided_anew_for_tiles_of_another_size(tmp_path: Path) -> None:
    keys = {
        city_region.RegionMap(CityRequest(Sources(EXTRACT), *CENTRE, grid, 0, tmp_path)).key
        for grid in (TileGrid(480.0, (0, 0), (0, 0)), TileGrid(160.0, (-1, -1), (1, 1)))
    }
    assert len(keys) == 2  # of the same square


def test_streets_of_a_city_end_where_its_tiles_do(planned: CityRequest) -> None:
    data = divide_map(planned).of_city
    assert (data.half, data.box) == (PAIR.half, (-80.0, -80.0, 240.0, 80.0))
    lines = [street.line for street in streets_from_osm(site_facts(data))]
    low, high = np.concatenate(lines).min(axis=0), np.concatenate(lines).max(axis=0)
    assert [*low, *high] == pytest.approx(data.box, abs=1e-6)


def test_streets_and_kerbs_of_two_tiles_are_the_same_at_their_border(planned: CityRequest) -> None:
    around = list(PAIR)
    streets, heights = (
        [load_product(planned.plans / tile_name(tile), name)[0] for tile in around] for name in ("streets", "grading")
    )
    west, east = (join_neighbours(PAIR, tile, streets, heights, apron=60.0) for tile in around)
    border = shapely.box(78.0, -80.0, 82.0, 80.0)

    def near(polygons: StreetPolygons, kind: str, shift: float) -> shapely.Geometry:
        return shapely.intersection(translate(getattr(polygons, kind), shift, 0.0), border)

    kinds = ("carriageway", "sidewalk", "pedestrian", "sunken")
    for kind in kinds:
        here, there = near(west.streets, kind, 0.0), near(east.streets, kind, 160.0)
        assert shapely.area(shapely.symmetric_difference(here, there)) < 1e-3, kind  # of a border 160 m long
    assert sum(near(west.streets, kind, 0.0).area for kind in kinds) > 50.0  # the border does cross streets
    along = np.arange(-80.0, 80.0, 0.1)
    points = np.stack([np.full_like(along, 80.0), along], axis=1)
    for side in ("lower", "upper", "smooth"):
        here, there = (getattr(one.height, side)(points - [shift, 0.0]) for one, shift in ((west, 0.0), (east, 160.0)))
        assert np.array_equal(here, there), side


def test_heights_that_cover_one_tile_alone_go_on_in_the_next(tmp_path: Path) -> None:
    frame = LocalFrame(*CENTRE)
    lat, lon = frame.to_geodetic(np.array([[-260.0, 260.0], [-40.0, -260.0]]))
    step = 0.0002
    rows, columns = int((lat[0] - lat[1]) / step), int((lon[1] - lon[0]) / step)
    dem = tmp_path / "west.tif"
    keys = (1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 2, 2048, 0, 1, 4326)
    tags = [
        (33550, "d", 3, (step, step, 0.0), False),
        (33922, "d", 6, (0.0, 0.0, 0.0, float(lon[0]), float(lat[0]), 0.0), False),
        (34735, "H", len(keys), keys, False),
    ]
    tifffile.imwrite(dem, np.full((rows, columns), 7.0, np.float32), extratags=tags)
    request = CityRequest(Sources(EXTRACT, dem=(dem,)), *CENTRE, PAIR, 0, tmp_path / "city")
    divide_sources(request)
    assert [plan_tile(request, tile) for tile in PAIR] == [{}, {}]
    west, east = (load_product(request.plans / tile_name(tile), "grading")[0] for tile in PAIR)
    assert west.smooth([[0.0, 0.0]])[0] == pytest.approx(7.0, abs=0.3)
    assert np.isfinite(east.smooth([[0.0, 0.0]])[0])
    assert west.smooth([[80.0, 0.0]])[0] == pytest.approx(east.smooth([[-80.0, 0.0]])[0], abs=0.3)


def _strip(ys: list[float], zs: list[float], *, east: bool, stuff: str = "ground") -> Surface:
    """Ground along a border at x = 80 or -80 with corners at some heights there."""
    x, inner = (80.0, 70.0) if east else (-80.0, -70.0)
    n = len(ys)
    points = np.array([*((x, y, z) for y, z in zip(ys, zs, strict=True)), *((inner, y, 0.0) for y in ys)])
    faces = [face for k in range(n - 1) for face in ([k, k + 1, n + k], [k + 1, n + k + 1, n + k])]
    up = np.broadcast_to((0.0, 0.0, 1.0), points.shape)
    return Surface.from_triangles(points, np.array(faces), normals=up, uv=points[:, :2], material=Material(stuff))


def test_ground_meets_what_the_tile_before_it_drew() -> None:
    first = profile_of([_strip([-80.0, -10.0, 4.0, 80.0], [0.0, 0.3, 0.1, 0.0], east=True)], Side(0, 80.0))
    own = _strip([-80.0, -30.0, 4.05, 80.0], [0.0, 0.25, 0.2, 0.0], east=False)
    fitted = fit_border([own], Side(0, -80.0), first)[0]
    met = profile_of([fitted], Side(0, -80.0))
    for one, other in ((first, met), (met, first)):
        t, z = np.r_[one.start, (one.start + one.end) / 2], np.r_[one.low, (one.low + one.high) / 2]
        assert np.abs(other.heights(t, z, "ground") - z).max() < 1e-4
    area = _area(own)
    assert _area(fitted) == pytest.approx(area, rel=0.02)
    assert np.allclose(np.linalg.norm(fitted.normals, axis=1), 1.0, atol=1e-5)


def _area(surface: Surface) -> float:
    corners = surface.positions[surface.triangles][:, :, :2].astype(np.float64)
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return float(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() / 2)


def test_a_kerb_stays_a_kerb() -> None:
    """Ground of two heights on one spot meets the like of it."""
    first = profile_of(
        [
            _strip([-80.0, 80.0], [0.0, 0.0], east=True, stuff="street"),
            _strip([-80.0, 80.0], [0.12, 0.12], east=True, stuff="pavement"),
        ],
        Side(0, 80.0),
    )
    low = _strip([-80.0, 0.0, 80.0], [0.0, 0.01, 0.0], east=False, stuff="street")
    high = _strip([-80.0, 0.0, 80.0], [0.12, 0.13, 0.12], east=False, stuff="pavement")
    fitted = fit_border([low, high], Side(0, -80.0), first)
    assert [round(float(one.positions[1, 2]), 4) for one in fitted] == [0.0, 0.12]


def test_a_drive_and_the_stone_beside_it_end_at_their_own_heights() -> None:
    """Both are of concrete, and the drive comes up where the stone is lowered: ends at one spot, 5 cm apart."""
    first = profile_of(
        [_strip([-80.0, 4.0], [-0.06, -0.03], east=True), _strip([4.0, 80.0], [-0.08, 0.0], east=True)], Side(0, 80.0)
    )
    drive = fit_border([_strip([-80.0, 4.05], [-0.06, -0.03], east=False)], Side(0, -80.0), first)[0]
    stone = fit_border([_strip([4.05, 80.0], [-0.08, 0.0], east=False)], Side(0, -80.0), first)[0]
    assert drive.positions[1, 1:].tolist() == pytest.approx([4.0, -0.03])
    assert stone.positions[0, 1:].tolist() == pytest.approx([4.0, -0.08])


def test_bad_sizes_are_refused_in_a_sentence(tmp_path: Path) -> None:
    for options, said in (
        ({"extent": 500.0, "tile": 100.0}, "multiple of 8 within 160"),
        ({"extent": 500.0, "tile": 161.0}, "multiple of 8"),
        ({"extent": float("nan")}, "size"),
        ({"extent": -3.0}, "size"),
        ({"extent": 500.0, "seed": -1}, "seed"),
    ):
        with pytest.raises(InputError, match=said):
            city_request(Sources(EXTRACT), lat=60.0, lon=25.0, out=tmp_path / "city", **options)
    with pytest.raises(MissingFileError, match=r"no\.pbf"):
        build_city(city_request(Sources(tmp_path / "no.pbf"), lat=60.0, lon=25.0, extent=100.0, out=tmp_path / "city"))
    with pytest.raises(MissingFileError, match="make one with vico city build"):
        read_city(tmp_path)
    (tmp_path / "city.json").write_text('{"schema_name": "vico.city", "version": 1}')
    with pytest.raises(SchemaError, match="build the city anew"):
        read_city(tmp_path)


def _check_whole(path: Path) -> None:
    """Check that a city opens as one world: everything once, streets and ways across borders."""
    world = read_world(path)
    assert isinstance(world, CityWorld)
    assert check_whole(world) == []
    for name in ("buildings", "places", "entrances", "rooms", "parking"):
        ids = [one.id for one in getattr(world, name)]
        assert len(set(ids)) == len(ids), name
    assert len(set(world.objects.id.tolist())) == len(world.objects)
    doors = {entrance.id for entrance in world.entrances}
    assert all(place.entrance in doors for place in world.places if place.entrance)
    # Streets end at the city's edge and nowhere else.
    lanes, half = world.lanes, world.half
    ends = [k for k in range(len(lanes)) if not len(lanes.following(k)) and not lanes.buses_only[k]]
    at_border = [k for k in ends if (np.abs(np.abs(lanes.line(k)[-1]) - 80.0) < 3.0).any()]
    assert len(at_border) <= 2
    assert np.abs(lanes.points).max() > half - 5.0
    spots = np.random.default_rng(0).uniform(-half, half, (500, 2))
    for column, row in ((-1, 0), (0, 0), (1, 1)):
        centre = np.array([column, row]) * 160.0
        here = spots[np.abs(spots - centre).max(axis=1) < 79.0]
        tile = world.city.world((column, row))
        assert np.allclose(world.height(here), tile.height(here - centre), atol=1e-4)
        assert np.array_equal(world.walkable.class_at(here), tile.walkable.class_at(here - centre))
    rng = np.random.default_rng(1)
    a, b = (world.walkable.random_point(rng, near=(k, k), radius=60.0) for k in (-170.0, 170.0))
    way = world.router.path(a, b)
    assert way is not None
    assert np.linalg.norm(np.diff(way, axis=0), axis=1).sum() < 2.0 * np.linalg.norm(b - a)


def _city_of(folder: Path, tile: Path, digest: str) -> None:
    (folder / "tiles").mkdir(parents=True)
    (folder / "tiles" / "0_0").symlink_to(tile)
    content = CityManifest(
        producer="vico",
        origin=Origin(lat=60.0, lon=25.0),
        size=160.0,
        first=(0, 0),
        last=(0, 0),
        seed=0,
        tiles=[CityTile(column=0, row=0, name="0_0", digest=digest, buildings=1, places=1)],
    )
    write_json(folder / "city.json", content.model_dump(mode="json"))


def test_a_tile_that_is_gone_or_another_one_is_named(corner: World, corner_path: Path, tmp_path: Path) -> None:
    _city_of(tmp_path / "good", corner_path, corner.digest)
    assert read_city(tmp_path / "good").world((0, 0)).digest == corner.digest
    _city_of(tmp_path / "other", corner_path, "0" * 64)
    with pytest.raises(SchemaError, match=r"tile 0_0: .* of another build"):
        read_city(tmp_path / "other").world((0, 0))
    (tmp_path / "good" / "tiles" / "0_0").unlink()
    with pytest.raises(MissingFileError, match=r"tile 0_0: .* is gone"):
        read_city(tmp_path / "good").world((0, 0))
    with pytest.raises(MissingFileError, match="has no tile 3_4"):
        read_city(tmp_path / "good").world((3, 4))


def _river_and_tunnel(path: Path) -> Path:
    """A map with a river that is a pond to who knows half of it, and a tunnel with a mouth 8 m west of x = 80."""
    drawn = DrawnMap(LocalFrame(*CENTRE), {}, {}, {}, {})
    known: dict[tuple[float, float], int] = {}

    def way(points: list[tuple[float, float]], **tags: str) -> None:
        for point in points:
            if point not in known:
                known[point] = drawn.node(*point)
        drawn.ways[drawn.new_id()] = DrawnWay([known[point] for point in points], tags)

    way([(-200.0, 0.0), (-40.0, 0.0), (72.0, 0.0)], highway="secondary")
    way([(72.0, 0.0), (210.0, 0.0)], highway="secondary", tunnel="yes", layer="-1")
    way([(210.0, 0.0), (300.0, 0.0)], highway="secondary")
    way([(-40.0, 0.0), (-40.0, 70.0)], highway="residential")
    way([(60.0, -50.0), (232.0, -50.0), (232.0, -34.0), (60.0, -34.0), (60.0, -50.0)], natural="water")
    for x in (-20.0, 30.0, 140.0, 180.0):
        way([(x, 20.0), (x + 15.0, 20.0), (x + 15.0, 32.0), (x, 32.0), (x, 20.0)], building="yes")
    return write_map(drawn, path)


def test_a_river_and_a_tunnel_go_on_in_the_next_tile(tmp_path: Path) -> None:
    request = CityRequest(Sources(_river_and_tunnel(tmp_path / "map.osm.pbf")), *CENTRE, PAIR, 0, tmp_path / "city")
    with painted_once():
        city = build_city(request)
    assert border_findings(city, (0, 0), (1, 0), 0) == []
    west, east = (load_product(request.plans / tile_name(tile), BORES)[0] for tile in PAIR)
    along = np.stack([np.linspace(70.0, 90.0, 21), np.zeros(21)], axis=1)
    floors = [np.interp(along[:, 0] - shift, one.line[:, 0], one.z) for (one,), shift in ((west, 0.0), (east, 160.0))]
    assert np.allclose(*floors, atol=1e-9)
    assert floors[0][-1] < -1.0
    levels = [city.world(tile).height.lower([[x, -42.0]])[0] for tile, x in (((0, 0), 70.0), ((1, 0), -60.0))]
    assert levels == pytest.approx([-1.3, -1.3], abs=0.01)


@pytest.mark.slow
def test_a_city_is_the_same_bytes_whatever_was_built_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    request = city_request(
        Sources(EXTRACT), lat=CENTRE[0], lon=CENTRE[1], extent=480.0, tile=160.0, out=tmp_path / "city"
    )
    city = build_city(request, workers=2)
    assert not city.manifest.failed
    assert len(city.manifest.tiles) == 9
    findings = [found for border in city.borders() for found in border_findings(city, *border)]
    assert findings == []
    _check_whole(request.out)
    digests = {tile.name: tile.digest for tile in city.manifest.tiles}
    built = {name: (request.out / "tiles" / name / "build.json").stat().st_mtime_ns for name in digests}
    shutil.rmtree(request.out / "tiles" / "0_0")
    with monkeypatch.context() as patch:
        patch.setattr(city_region, "read_osm", _no_reading)
        again = build_city(request)
    assert {tile.name: tile.digest for tile in again.manifest.tiles} == digests
    kept = {name: (request.out / "tiles" / name / "build.json").stat().st_mtime_ns for name in digests}
    assert [name for name in digests if kept[name] != built[name]] == ["0_0"]
    (request.out / "whole" / "roads.net.xml").unlink()
    mended = build_city(request)
    assert mended.manifest == again.manifest
    elsewhere = replace(request, out=tmp_path / "other")
    assert {tile.name: tile.digest for tile in build_city(elsewhere).manifest.tiles} == digests
