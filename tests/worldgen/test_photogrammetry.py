"""Synthetic photogrammetry, and what is read from it: the skin, the ground under it, buildings nudged to it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from photogrammetry.aerial import Photogrammetry, photogrammetry
from photogrammetry.surface_net import surface_net
from photogrammetry.tile_view import tile_surfaces
from photogrammetry.tileset import write_tileset
from vico.errors import EmptyInputError, InputError
from vico.geo.osm import OsmData, read_osm
from vico.geo.overlay import OverlayError
from vico.geo.tiles3d import TileMesh, read_tileset
from vico.seeds import rng
from vico.world.folder import read_world
from vico.world.heights import HeightField
from vico.world.world import World
from vico.worldgen.buildings import fitting
from vico.worldgen.buildings.fitting import fit_to_tiles, lower_onto_terrain, plans_on_tiles
from vico.worldgen.buildings.solids import leaky_plans, seat_of, solid_meshes
from vico.worldgen.buildings.stage import buildings_from_plans
from vico.worldgen.facts.building_outlines import building_plans
from vico.worldgen.facts.building_plans import BuildingPlan, BuildingPlans
from vico.worldgen.facts.ray_casting import RayCaster
from vico.worldgen.ground.terrain import on_ground, terrain_from_tiles
from vico.worldgen.pipeline import build_world
from vico.worldgen.request import BuildOptions, Sources

EXTRACT = Path(__file__).parents[2] / "src" / "vico" / "data" / "helsinki.osm.pbf"
HALF = 80.0
ROUGH = Photogrammetry(texel=0.8, levels=2, shift=0.0, height_error=0.0)


@pytest.fixture(scope="session")
def helsinki_tiles(helsinki: World) -> TileMesh:
    """160 m x 160 m of Helsinki as photographed, coarsely."""
    pytest.importorskip("embreex", reason="ray casting is an extra")
    return photogrammetry(helsinki, ROUGH, half=HALF)


@pytest.fixture(scope="session")
def map_of_helsinki(helsinki: World) -> OsmData:
    """The map around it."""
    return read_osm(EXTRACT, helsinki.frame, HALF)


# --- the skin


def test_a_ball_has_the_surface_of_a_ball() -> None:
    x, y, z = np.mgrid[0:40, 0:40, 0:40].astype(np.float32)
    distance = np.sqrt((x - 19.5) ** 2 + (y - 20) ** 2 + (z - 20.2) ** 2)
    points, faces = surface_net(np.clip(0.5 + 12.0 - distance, 0, 1).astype(np.float32))
    radius = np.linalg.norm(points - (19.5, 20, 20.2), axis=1)
    assert np.abs(radius - 12.0).max() < 0.2
    corner = points[faces]
    assert np.einsum("nk,nk->n", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])).sum() / 6 == pytest.approx(
        4 / 3 * np.pi * 12**3, rel=0.01
    )  # closed, and its faces look outward
    assert len(np.unique(faces)) == len(points)


def test_the_skin_is_near_the_world_it_was_made_of(helsinki: World, helsinki_tiles: TileMesh) -> None:
    layers = [s for name in ("ground", "buildings", "roofs") for s in helsinki.surfaces(name) if len(s.triangles)]
    first = np.cumsum([0, *(len(s.positions) for s in layers)])
    world = RayCaster(
        np.concatenate([s.positions for s in layers]),
        np.concatenate([s.triangles + n for s, n in zip(layers, first, strict=False)]),
    )
    spots = rng(0, "spots").uniform(-HALF + 5, HALF - 5, (4000, 2))
    start = np.c_[spots, np.full(4000, 300.0)]
    down = np.array([0.0, 0.0, -1.0])
    off = (
        world.first(start, down).distance
        - RayCaster(helsinki_tiles.positions, helsinki_tiles.triangles).first(start, down).distance
    )
    off = off[np.isfinite(off)]
    assert len(off) > 3500
    assert abs(np.median(off)) < 0.15
    assert 0.05 < np.median(np.abs(off)) < 0.3  # bumpy, yet on it
    assert 0.02 < (np.abs(off) > 1.0).mean() < 0.35  # trees, cars, melted edges


def test_it_is_one_skin_with_a_picture_a_leaf(helsinki_tiles: TileMesh) -> None:
    mesh = helsinki_tiles
    assert len(mesh.textures) == 4
    assert mesh.texture_of.min() == 0
    assert mesh.uv.min() >= 0.0
    assert mesh.uv.max() <= 1.0
    assert all(p.std() > 20 for p in mesh.textures)
    corner = mesh.positions[mesh.triangles]
    up = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2]
    assert (up > 0).mean() > 0.6
    assert "OpenStreetMap" in " ".join(mesh.attributions)


def test_the_same_seed_gives_the_same_mesh_and_another_another(helsinki: World, helsinki_tiles: TileMesh) -> None:
    small = replace(ROUGH, texel=2.0, cell=2.0, levels=1)
    one, two = (photogrammetry(helsinki, small, half=25.0) for _ in range(2))
    assert np.array_equal(one.positions, two.positions)
    assert all(np.array_equal(a, b) for a, b in zip(one.textures, two.textures, strict=True))
    other = photogrammetry(helsinki, replace(small, seed=1), half=25.0)
    assert other.positions.shape != one.positions.shape or not np.array_equal(other.positions, one.positions)


def test_it_can_be_looked_at(helsinki_tiles: TileMesh) -> None:
    surfaces = tile_surfaces(helsinki_tiles)
    assert sum(len(s.triangles) for s in surfaces) == len(helsinki_tiles.triangles)
    for surface in surfaces:
        assert surface.material.texture is not None
        assert all(side & (side - 1) == 0 for side in surface.material.texture.shape[:2])


def test_it_survives_being_written_and_read(helsinki: World, helsinki_tiles: TileMesh, tmp_path: Path) -> None:
    pytest.importorskip("DracoPy", reason="Draco is an extra")
    write_tileset(helsinki_tiles, helsinki.frame, tmp_path / "t", levels=ROUGH.levels)
    back, report = read_tileset(tmp_path / "t", helsinki.frame, HALF + 10, error=0.0)
    assert (report.read, report.left_out) == (4, ())
    assert len(back.triangles) == len(helsinki_tiles.triangles)
    assert np.abs(back.positions.min(axis=0) - helsinki_tiles.positions.min(axis=0)).max() < 0.01
    sizes = [np.array([p.shape for p in mesh.textures]) for mesh in (back, helsinki_tiles)]
    assert (sizes[1] - sizes[0] >= 0).all()  # but for what no triangle uses
    assert (sizes[1] - sizes[0] <= 4).all()


def test_a_nonsensical_camera_is_refused(helsinki: World) -> None:
    with pytest.raises(InputError, match="texel"):
        photogrammetry(helsinki, Photogrammetry(texel=0.0))


# --- the ground


def test_cars_and_trees_are_told_from_a_slope() -> None:
    random = rng(3, "ground")
    along = np.arange(0, 240, 1.0)
    rows = [np.stack([along, np.full(240, y), 0.12 * along + 3 * np.sin(along / 40)], 1) for y in (-1.8, 0.0, 1.8)]
    points = np.concatenate(rows)
    points[:, 2] += random.normal(0, 0.08, len(points))
    out = np.zeros(len(points), bool)
    for start in random.uniform(0, 230, 22):  # cars on the right, some of them in a row
        out |= (np.abs(points[:, 0] - start) < 2.1) & (points[:, 1] > 1)
    tree = (np.abs(points[:, 0] - 120) < 9) & (points[:, 1] < 1)
    points[out, 2] += 1.4
    points[tree & ~out, 2] += random.uniform(3, 8, (tree & ~out).sum())
    wrong = out | tree
    good = on_ground(points)
    assert (~good[wrong]).mean() > 0.9
    assert good[~wrong].mean() > 0.95


def test_the_ground_of_a_tilted_city_is_found(helsinki_tiles: TileMesh, map_of_helsinki: OsmData) -> None:
    points = helsinki_tiles.positions
    tilted = replace(helsinki_tiles, positions=points + np.outer(0.1 * points[:, 0] - 0.04 * points[:, 1], (0, 0, 1)))
    field, report = terrain_from_tiles(tilted, map_of_helsinki, half=HALF)
    spots = np.stack(np.meshgrid(*[np.linspace(-HALF + 2, HALF - 2, 60)] * 2), axis=-1).reshape(-1, 2)
    off = field(spots) - (0.1 * spots[:, 0] - 0.04 * spots[:, 1])
    assert report.samples > 500
    assert 0 < report.outliers < 0.4 * report.samples
    # Packaged Helsinki is flat, so the tilt is the whole truth; kerbs lie up to 0.15 m above it.
    assert np.sqrt((off**2).mean()) < 0.35
    assert np.abs(off).max() < 1.5


def test_a_mesh_without_ground_says_so(map_of_helsinki: OsmData) -> None:
    far = np.array([[900.0, 900, 0], [910, 900, 0], [900, 910, 0]])
    lone = TileMesh(
        far, np.array([[0, 1, 2]], np.int32), np.zeros((3, 2), np.float32), np.array([-1], np.int32), (),
        np.full((3, 3), 255, np.uint8),
    )  # fmt: skip
    pytest.importorskip("embreex", reason="ray casting is an extra")
    with pytest.raises(EmptyInputError, match="0 of 0 rays"):
        terrain_from_tiles(lone, map_of_helsinki, half=HALF)


# --- the buildings


def measurable(plans: list[BuildingPlan]) -> list[int]:
    """Plans whose middle was photographed."""
    middle = [np.abs(np.asarray(p.outline.centroid.coords[0])).max() for p in plans]
    return [k for k, p in enumerate(plans) if middle[k] < HALF - 15 and p.outline.area > 80]


def tops(plans: list[BuildingPlan], ground: HeightField) -> np.ndarray:
    return np.array([seat_of(p, ground).base + max(part.top for part in p.parts) for p in plans])


def test_wrong_heights_are_mended(helsinki_tiles: TileMesh, map_of_helsinki: OsmData) -> None:
    ground = HeightField.flat(200.0)
    plans = building_plans(map_of_helsinki, seed=0).plans
    plans = [plans[k] for k in measurable(plans)]
    by = rng(0, "wrong").choice([-3.2, 3.2, 6.4], len(plans))
    wrong = [
        replace(p, parts=[replace(q, eaves=max(q.eaves + d, 2.5) if q.low == 0 else q.eaves) for q in p.parts])
        for p, d in zip(plans, by, strict=True)
    ]
    fitted, report = fit_to_tiles(wrong, helsinki_tiles, ground)
    assert len(plans) >= 5
    off = np.abs(tops(fitted, ground) - tops(plans, ground))
    was = np.abs(tops(wrong, ground) - tops(plans, ground))
    assert np.median(was) > 2.5
    assert np.median(off) < 0.4
    assert report.after < 0.5 * report.before
    assert report.counts()["heights"] > 0.7 * len(plans)
    assert [p.id for p in fitted] == [p.id for p in plans]


def test_shifted_footprints_are_moved_back(helsinki_tiles: TileMesh, map_of_helsinki: OsmData) -> None:
    ground = HeightField.flat(200.0)
    plans = building_plans(map_of_helsinki, seed=0).plans
    by = np.array([1.1, -0.7, 0.0])
    moved = replace(helsinki_tiles, positions=helsinki_tiles.positions + by)
    fitted, report = fit_to_tiles(plans, moved, ground)
    shifts = np.array([fit.shift for fit in report.fits if fit.shift != (0.0, 0.0)])
    assert len(shifts) > 5
    assert np.abs(np.median(shifts, axis=0) - by[:2]).max() < 0.25
    assert np.hypot(*shifts.T).max() < 2.01
    assert report.after < report.before
    mesh = solid_meshes(fitted, [seat_of(p, ground) for p in fitted])
    assert leaky_plans(mesh) == set()


def test_a_building_that_cant_be_fitted_stays_as_planned_and_is_told(
    helsinki_tiles: TileMesh, map_of_helsinki: OsmData, monkeypatch: pytest.MonkeyPatch
) -> None:
    plans = building_plans(map_of_helsinki, seed=0).plans

    def failing(plan: BuildingPlan, *given: Any) -> tuple[BuildingPlan, str]:
        if plan.id == plans[1].id:
            raise OverlayError("side location conflict")
        return plan, "already fits"

    def unmoved(*_: Any) -> None:
        raise OverlayError("side location conflict")

    monkeypatch.setattr(fitting, "raised_to_mesh", failing)
    monkeypatch.setattr(fitting, "_move_building", unmoved)
    by = replace(helsinki_tiles, positions=helsinki_tiles.positions + np.array([1.1, -0.7, 0.0]))
    decided, report = plans_on_tiles(BuildingPlans(plans, []), by, HeightField.flat(200.0))
    assert decided.plans == plans
    assert report.fits[1].reason == "can't be raised"
    told = [entry.id for entry in decided.dropped]
    assert told[0] == f"{plans[1].id} fit"
    assert len(told) > 2
    assert all(entry.reason == "can't be made: OverlayError: side location conflict" for entry in decided.dropped)


def test_where_the_tiles_show_no_building_none_is_changed(map_of_helsinki: OsmData) -> None:
    pytest.importorskip("embreex", reason="ray casting is an extra")
    corner = np.array([[-300.0, -300, 0], [300, -300, 0], [300, 300, 0], [-300, 300, 0]])
    bare = TileMesh(
        corner, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros((4, 2), np.float32), np.full(2, -1, np.int32), (),
        np.full((4, 3), 255, np.uint8),
    )  # fmt: skip
    plans = building_plans(map_of_helsinki, seed=0).plans
    fitted, report = fit_to_tiles(plans, bare, HeightField.flat(200.0))
    assert all(new is old for new, old in zip(fitted, plans, strict=True))
    assert report.counts()["the tiles show no building"] > 0.9 * len(plans)


def test_a_city_model_without_ground_is_lowered_onto_the_terrain(map_of_helsinki: OsmData) -> None:
    plans = building_plans(map_of_helsinki, seed=0).plans
    ground = HeightField(np.array([[5.0, 9.0], [5.0, 9.0]], np.float32), 200.0)
    solid = solid_meshes(plans, [seat_of(plan, ground) for plan in plans])
    count = len(solid.points)
    model = TileMesh(
        solid.points + np.array([0.0, 0.0, 36.7]), solid.faces.astype(np.int32), np.zeros((count, 2), np.float32),
        np.full(len(solid.faces), -1, np.int32), (), np.full((count, 3), 255, np.uint8),
    )  # fmt: skip
    lowered, by = lower_onto_terrain(model, plans, ground)
    # The feet of what was built are 0.3 m under the lowest ground, up to 0.4 of its fall under the ground floor.
    assert by == pytest.approx(-36.7, abs=1.0)
    assert np.allclose(lowered.positions[:, 2] - model.positions[:, 2], by)
    with pytest.raises(EmptyInputError, match="place and crs"):
        lower_onto_terrain(replace(model, positions=model.positions + 5000.0), plans, ground)


def test_buildings_on_tiles_are_closed(helsinki_tiles: TileMesh, map_of_helsinki: OsmData) -> None:
    flat = HeightField.flat(200.0)
    fitted, report = plans_on_tiles(building_plans(map_of_helsinki, seed=0), helsinki_tiles, flat)
    built = buildings_from_plans(fitted, map_of_helsinki, flat, seed=0)
    assert len(report.fits) == len(built.records)
    assert built.watertight == len(built.records)


# --- a hilly place, whole


@pytest.mark.slow
def test_monaco_is_found_again_in_its_own_photogrammetry(shared_data: Path, tmp_path: Path) -> None:
    pytest.importorskip("DracoPy", reason="Draco is an extra")
    place = shared_data / "places" / "monaco"
    extract = place / "monaco.osm.pbf"
    build_world(
        Sources(extract, dem=(place / "dem_srtm.tif",)),
        lat=43.73384,
        lon=7.41813,
        half=150.0,
        out=tmp_path / "w",
        options=BuildOptions(previews=False),
    )
    world = read_world(tmp_path / "w")
    config = Photogrammetry(texel=0.6)
    write_tileset(photogrammetry(world, config), world.frame, tmp_path / "t", levels=config.levels)
    mesh, _ = read_tileset(tmp_path / "t", world.frame, 150.0, error=0.0)
    osm = read_osm(extract, world.frame, 150.0)
    field, _ = terrain_from_tiles(mesh, osm, half=150.0)
    spots = np.stack(np.meshgrid(*[np.linspace(-148, 148, 150)] * 2), axis=-1).reshape(-1, 2)
    off = field(spots) - world.height(spots)
    assert np.sqrt((off**2).mean()) < 0.4
    assert np.quantile(np.abs(off), 0.99) < 1.5
    plans = building_plans(osm, seed=0).plans
    _, report = fit_to_tiles(plans, mesh, field)
    assert report.after < 0.45
    assert report.after < report.before
