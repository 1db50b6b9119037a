"""A folder of one's own adds an object, a kind of place and its rooms to a world, in German and without Python."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from shared_folders import Shared
from vico.errors import SchemaError
from vico.world.check import check_world
from vico.world.folder import read_world
from vico.world.world import World
from vico.worldgen.pipeline import build_world
from vico.worldgen.request import BuildOptions

LAT, LON = 48.1374, 11.5755
_DEGREES_EAST, _DEGREES_NORTH = 1 / 74_400, 1 / 111_200  # of a metre, near enough for a few houses

FILES = {
    "assets/models/outdoor/klaviere.toml": """
        group = "amenity"
        [model.strassenklavier]
        kind = "klavier"
        parts = [
          { shape = "box", size = [0.6, 1.5, 1.2], at = [0, 0, 0.6], colour = [60, 40, 30] },
          { shape = "box", size = [0.3, 1.3, 0.1], at = [0.45, 0, 0.75], colour = [240, 240, 232] },
        ]
        """,
    "assets/models/indoor/werkstatt.toml": """
        group = "indoor"
        [model.montagestaender]
        parts = [
          { shape = "cylinder", radius = 0.03, length = 1.2, colour = [60, 62, 66] },
          { shape = "box", size = [0.5, 0.5, 0.05], at = [0, 0, 0.03], colour = [60, 62, 66] },
        ]
        """,
    "worldgen/objects/kinds_klaviere.toml": '[tags.amenity]\npiano = "strassenklavier"\n',
    "worldgen/objects/standing_klaviere.toml": 'facing_path = ["strassenklavier"]\n',
    "worldgen/places/categories_werkstatt.toml": '[tags.amenity]\nstore = ["fahrradselbsthilfe"]\n',
    "worldgen/places/names_deutsch.toml": """
        home = "Wohnungen"
        on_street = "{what} in der {street}"
        building = "{what} {id}"
        [what]
        residential = "Wohnhaus"
        """,
    "worldgen/indoor/uses_werkstatt.toml": """
        [use.fahrradwerkstatt]
        kinds = ["fahrradselbsthilfe"]
        plan = { front = "schrauberraum", backs = [["storage", 1.0]], depth = 2.6 }
        sizes = [[7.0, 8.6]]
        """,
    "worldgen/indoor/rooms_werkstatt.toml": """
        [room.schrauberraum]
        floor = "concrete"
        shop_window = true
        small = ["tools", "mug"]
        furniture = [
          { stand = "workbench", times = 2, walls = ["far", "sides"], front = 0.8 },
          { put = "platz", at = [[0, 0], [1.2, 0], [-1.2, 0]], aisle = 0.4 },
        ]
        [sets]
        platz = [["montagestaender", 0, 0, 0], ["stool", 0.8, 0, 180]]
        """,
}


def write_map(path: Path) -> Path:
    """Write a street with two houses, a workshop in one of them, and a piano beside the street."""
    nodes: list[str] = []

    def node(x: float, y: float, **tags: str) -> int:
        said = "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())
        at = f'lat="{LAT + y * _DEGREES_NORTH:.7f}" lon="{LON + x * _DEGREES_EAST:.7f}"'
        nodes.append(f'<node id="{len(nodes) + 1}" {at}>{said}</node>')
        return len(nodes)

    def way(number: int, points: list[int], **tags: str) -> str:
        refs = "".join(f'<nd ref="{n}"/>' for n in points)
        said = "".join(f'<tag k="{key.replace("__", ":")}" v="{value}"/>' for key, value in tags.items())
        return f'<way id="{number}">{refs}{said}</way>'

    ways = [way(1, [node(x, 0) for x in (-110, -50, 0, 50, 110)], highway="residential", name="Lindenstraße")]
    for k, x in enumerate((-30.0, 10.0)):
        corners = [node(x, 14), node(x + 18, 14), node(x + 18, 30), node(x, 30)]
        ways.append(way(2 + k, [*corners, corners[0]], building="apartments", building__levels="4"))
    node(-20, 18, amenity="fahrradselbsthilfe", name="Die Speiche")
    node(0, -14, amenity="piano")
    path.write_text(f'<osm version="0.6">{"".join(nodes)}{"".join(ways)}</osm>', encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def world(shared: Shared) -> World:
    """A small world built with a folder of data of somebody's own."""
    return read_world(shared("own_data", _build, ["worldgen"]) / "world")


def _build(folder: Path) -> None:
    for name, text in FILES.items():
        path = folder / "vico" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("VICO_DATA", str(folder / "vico"))
        build_world(
            write_map(folder / "stadt.osm"), lat=LAT, lon=LON, half=60.0, out=folder / "world",
            options=BuildOptions(keep_stages=False, previews=False),
        )  # fmt: skip


def test_the_object_stands_where_it_is_mapped_with_its_model(world: World) -> None:
    (piano,) = world.objects.where(world.objects.kind == "klavier").position
    assert abs(piano[0]) < 1.0
    assert abs(piano[1] + 14.0) < 1.0
    assert "strassenklavier" in world.objects.prototype.tolist()


def test_the_place_has_the_rooms_and_furniture_of_its_kind(world: World) -> None:
    place = next(place for place in world.places if place.name == "Die Speiche")
    assert (place.category, place.kind) == ("store", "fahrradselbsthilfe")
    rooms = [room for room in world.rooms if room.place == place.id]
    assert [room.kind for room in rooms] == ["schrauberraum", "storage"]
    pieces = set(world.objects.where(world.objects.room == rooms[0].id).prototype.tolist())
    assert {"workbench", "montagestaender", "stool"} <= pieces


def test_homes_have_german_names(world: World) -> None:
    homes = {place.name for place in world.places if place.kind == "apartments"}
    assert "Wohnungen in der Lindenstraße" in homes
    assert all(name.startswith(("Wohnungen in der Lindenstraße", "Wohnhaus w")) for name in homes), homes


def test_the_world_is_sound_without_the_folder(world: World) -> None:
    assert check_world(world) == []


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        (
            "worldgen/objects/kinds_x.toml",
            '[tags.amenity]\npiano = "piano"',
            "kinds_x.toml: tags.amenity.piano: no model 'piano'",
        ),
        ("worldgen/indoor/rooms_x.toml", "[room.x]\nflor = 1", "rooms_x.toml: room.x.flor"),
        (
            "assets/models/outdoor/x.toml",
            'group = "amenity"\n[model.x]\nparts = [{ shape = "box", size = [1, 1, 1], colour = "oak" }]',
            "x.toml: model.x: no colour is called 'oak'",
        ),
    ],
)
def test_a_wrong_entry_ends_the_build_before_anything_is_built(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, text: str, message: str
) -> None:
    path = tmp_path / "vico" / name
    path.parent.mkdir(parents=True)
    path.write_text(text)
    monkeypatch.setenv("VICO_DATA", str(tmp_path / "vico"))
    with pytest.raises(SchemaError, match=re.escape(message)):
        build_world(write_map(tmp_path / "stadt.osm"), lat=LAT, lon=LON, half=60.0, out=tmp_path / "world")
    assert not (tmp_path / "world").exists()
