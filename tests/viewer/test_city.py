"""What a browser draws of a world: every triangle in its tile, every texture in an array, every robot's joints."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from shutil import which

import numpy as np
import pytest

from shared_folders import Shared
from vico.assets.robots import robot_model, robot_names
from vico.io.files import read_json
from vico.viewer.city import write_city
from vico.viewer.city.export import MANIFEST, PICTURE, Grid, far_tiles, ground_picture
from vico.viewer.city.models import PLAIN, SHAPES, Blob, TextureLayers, pack_surfaces, write_robots
from vico.world.mesh import Material, Surface
from vico.world.world import World

_PAGE = Path(__file__).parents[2] / "src" / "vico" / "viewer" / "page"


@pytest.fixture(scope="module")
def city(helsinki: World, shared: Shared) -> Path:
    def make(out: Path) -> None:
        out.mkdir()
        write_city(helsinki, out)

    return shared("city_of_the_page", make, ["viewer"])


def test_near_tiles_hold_every_triangle_of_the_world(helsinki: World, city: Path) -> None:
    tiles = read_json(city / MANIFEST)["tiles"]
    drawn = sum(mesh["indices"] // 3 for tile in tiles for mesh in tile["near"])
    whole = sum(len(s.triangles) for layer in ("ground", "buildings", "roofs") for s in helsinki.surfaces(layer))
    assert drawn == whole


def test_meshes_lie_whole_in_their_files(city: Path) -> None:
    manifest = read_json(city / MANIFEST)
    for tile in manifest["tiles"]:
        data = (city / tile["file"]).read_bytes()
        for mesh in tile["near"]:
            width = 2 if mesh["vertices"] < 65536 else 4
            index = mesh["offset"] + 32 * mesh["vertices"]
            assert index + width * mesh["indices"] <= len(data)
            kind = np.uint16 if width == 2 else np.uint32
            assert np.frombuffer(data, kind, mesh["indices"], index).max() < mesh["vertices"]
            position = np.frombuffer(data, np.float32, 3 * mesh["vertices"], mesh["offset"]).reshape(-1, 3)
            assert position.min(axis=0) == pytest.approx(mesh["low"], abs=0.006)


def test_from_afar_buildings_have_a_fraction_of_their_triangles_and_all_their_height(helsinki: World) -> None:
    far = far_tiles(helsinki, Grid.over(helsinki.half), TextureLayers())
    whole = sum(len(s.triangles) for layer in ("buildings", "roofs") for s in helsinki.surfaces(layer))
    assert sum(len(mesh.triangles) for mesh in far.values()) < 0.35 * whole
    tallest = max(float(s.positions[:, 2].max()) for s in helsinki.surfaces("roofs"))
    assert max(float(mesh.position[:, 2].max()) for mesh in far.values()) == pytest.approx(tallest, abs=3.0)


def test_every_object_outdoors_and_indoors_stands_somewhere(helsinki: World, city: Path) -> None:
    outdoors = sum(entry["count"] for entry in read_json(city / MANIFEST)["instances"])
    rooms = read_json(city / "rooms.json")
    indoors = sum(entry["count"] for file in rooms["files"] for entry in file["instances"])
    assert outdoors + indoors == len(helsinki.objects.entity)
    assert len(rooms["rooms"]) == len(helsinki.rooms)


def test_the_same_world_gives_the_same_bytes(helsinki: World, city: Path, tmp_path: Path) -> None:
    write_city(helsinki, tmp_path)
    names = sorted(path.name for path in city.iterdir())
    assert names == sorted(path.name for path in tmp_path.iterdir())
    assert [name for name in names if (city / name).read_bytes() != (tmp_path / name).read_bytes()] == []


def test_one_picture_is_one_layer_and_plain_surfaces_are_white() -> None:
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 255, (256, 256, 3)).astype(np.uint8)
    layers = TextureLayers()
    first, second = (layers.layer_of(Material(name, picture.copy())) for name in ("a", "b"))
    assert (first.array, first.layer) == (second.array, second.layer) == (0, 1)
    assert layers.layer_of(Material("paint")).layer == PLAIN
    assert layers.layer_of(Material("wall", np.zeros((512, 1024, 4), np.uint8))).array == SHAPES.index((512, 1024))


def test_surfaces_of_one_array_become_one_mesh_and_leaves_are_seen_from_behind() -> None:
    triangle = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    faces = np.array([(0, 1, 2)])
    leaf = Material("leaf", np.full((64, 64, 4), 200, np.uint8), cutout=True)
    surfaces = [Surface.from_triangles(triangle, faces, material=m) for m in (Material("a"), Material("b"), leaf)]
    meshes = pack_surfaces(surfaces, TextureLayers())
    assert [(mesh.array, mesh.both_sides, len(mesh.triangles)) for mesh in meshes] == [(0, False, 2), (0, True, 1)]


def test_robots_have_every_measured_joint_that_moves_a_link() -> None:
    entries = write_robots(TextureLayers(), Blob())
    assert set(entries) == set(robot_names())
    for name, entry in entries.items():
        found = sorted(j["index"] for link in entry["links"] for j in link["joints"] if j["index"] is not None)
        expected = [] if robot_model(name).rotors is not None else list(range(len(robot_model(name).joints)))
        assert found == expected, name
        assert all(link["parent"] < k for k, link in enumerate(entry["links"]))


def test_the_page_is_sound_to_a_type_checker() -> None:
    checker = which("tsc") or next((str(p) for p in Path(".venv/tsc").glob("node_modules/.bin/tsc")), None)
    if checker is None:
        pytest.skip("no TypeScript: npm install --prefix .venv/tsc typescript checks the page's modules")
    done = subprocess.run([checker, "-p", str(_PAGE / "tsconfig.json")], capture_output=True, text=True, check=False)
    assert done.stdout == ""
    assert json.loads((_PAGE / "tsconfig.json").read_text())["compilerOptions"]["strict"] is True


def test_the_ground_from_above_shows_streets_over_the_bed_below_them(helsinki: World) -> None:
    textures = TextureLayers()
    picture = np.asarray(ground_picture(helsinki, textures), np.float64)
    asphalt = next(s for s in helsinki.surfaces("ground") if s.material.name == "ground_asphalt")
    middle = asphalt.positions[asphalt.triangles].mean(axis=1)
    corners = asphalt.positions[asphalt.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    inside = (np.abs(middle[:, :2]).max(axis=1) < helsinki.half - 1) & (area > 4.0)
    column, row = ((middle[inside, :2] * [1, -1] + helsinki.half) * PICTURE / (2 * helsinki.half)).astype(int).T
    own = asphalt.colour[asphalt.triangles[inside, 0], :3] / 255.0  # cycle tracks are red
    wanted = own * textures.layer_of(asphalt.material).colour
    away = np.abs(picture[row, column] - wanted).max(axis=1)
    assert (away < 30).mean() > 0.8


def test_every_door_of_a_facade_can_be_drawn_open(helsinki: World, city: Path) -> None:
    manifest = read_json(city / MANIFEST)
    doors = manifest["doors"]
    assert len(doors) > 0.5 * len(helsinki.entrances)
    for door in doors:
        assert np.hypot(*door["inward"]) == pytest.approx(1.0, abs=1e-3)
        away = np.subtract(door["at"][:2], helsinki.entrances[door["entrance"]].position[:2])
        assert np.hypot(*away) < 3.5
        assert all(manifest["models"][name]["near"] for name in (*door["leaves"], door["hall"]))
    assert all(name in manifest["models"] for name in (*manifest["umbrellas"], *manifest["placards"]))
