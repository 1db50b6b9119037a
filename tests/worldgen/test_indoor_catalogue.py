"""Kinds of rooms and uses of places are data that anybody may add to, in their own language."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from vico.errors import SchemaError
from vico.world.check.indoors import walkable_inside
from vico.world.model import Category
from vico.worldgen.indoor import catalogue
from vico.worldgen.indoor.catalogue import use_of
from vico.worldgen.indoor.floorplans import sketch_of
from vico.worldgen.indoor.furnished_plans import plan_of, rooms_of_plan
from vico.worldgen.indoor.recipes import COMPOSITIONS

PAGE = Path(__file__).parents[2] / "docs" / "adding_a_room.md"
USE = "[use.x]\nsizes = [[6, 8]]\nplan = "


@pytest.fixture
def own_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's folder of data about rooms."""
    (tmp_path / "worldgen/indoor").mkdir(parents=True)
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    return tmp_path / "worldgen/indoor"


def test_a_use_of_ones_own_is_furnished_as_its_page_says(own_data: Path) -> None:
    use, room = re.findall(r"```toml\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    (own_data / "uses_werkstatt.toml").write_text(use)
    (own_data / "rooms_werkstatt.toml").write_text(room)
    assert use_of(Category.STORE, "selbsthilfewerkstatt") == "fahrradwerkstatt"
    for variant in range(4):
        plan = plan_of("fahrradwerkstatt", 1, 1, variant)
        assert [made.kind for made in plan.rooms] == ["werkstattraum", "storage", "washroom"]
        pieces = {item.prototype for item in plan.rooms[0].items}
        assert {"counter", "workbench", "tool_cabinet", "stool"} <= pieces
        rooms, objects = rooms_of_plan(plan)
        assert walkable_inside(rooms, objects) == []


def test_a_room_of_the_same_name_takes_the_place_of_ours(own_data: Path) -> None:
    (own_data / "rooms_mine.toml").write_text(
        '[room.cafe]\nfurniture = [{ stand = "sofa", times = 3, else = [{ stand = "chair" }] }]\n'
    )
    after = [item.prototype for item in plan_of("cafe").rooms[0].items]
    assert after.count("sofa") == 3
    assert "pastry_case" not in after


def test_a_home_of_ones_own_is_one_of_the_homes(own_data: Path) -> None:
    (own_data / "uses_mine.toml").write_text(
        '[use.loft]\nhome = 2.0\nplan = { entry = "hall", main = "studio", depth = 2.4, side = "bathroom" }\n'
        "sizes = [[8.0, 9.0]]\n"
    )
    assert catalogue.uses().homes == ("flat_small", "flat_medium", "flat_large", "maisonette", "loft")
    assert [room.kind for room in sketch_of("loft").rooms] == ["hall", "studio", "bathroom"]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("rooms", '[room.x]\nfurniture = [{ stand = "sofaa" }]', r"room\.x\.furniture\.0: no furniture 'sofaa'"),
        (
            "rooms", '[room.x]\nfurniture = [{ stand = "sofa", then = [{ put = "nook" }] }]',
            r"room\.x\.furniture\.0\.then\.0: no furniture 'nook'",
        ),
        ("rooms", '[room.x]\nfurniture = [{ hang = "@art" }]', r"room\.x\.furniture\.0: no choice '@art'"),
        ("rooms", '[room.x]\nfurniture = [{ sit = "sofa" }]', r"room\.x\.furniture\.0: a step has one of the fields"),
        ("rooms", '[room.x]\nfurniture = [{ stand = "sofa", fron = 1 }]', r"room\.x\.furniture\.0\.stand\.fron"),
        ("rooms", '[room.x]\ntone = "mauve"', r"room\.x\.tone: no colour 'mauve'"),
        ("rooms", '[room.x]\npalette = "dark"', r"room\.x\.palette: no palette 'dark'"),
        ("rooms", '[room.x]\ncomposed = "opera"', r"room\.x\.composed: no 'opera'"),
        ("rooms", '[room.x]\nsmall = ["dragon"]', r"room\.x\.small: no furniture 'dragon'"),
        ("uses", f'{USE}{{ front = "yard", depth = 2 }}', r"use\.x\.plan: no kind of room 'yard'"),
        ("uses", f'{USE}{{ drawn = "villa" }}', r"use\.x\.plan\.drawn: nobody draws 'villa'"),
        ("uses", f'{USE}{{ round = "cafe" }}', r"use\.x\.plan: a plan has one of the fields"),
        ("uses", '[categories]\nfood = "feast"', r"categories\.food: no use 'feast'"),
    ],
)  # fmt: skip
def test_a_wrong_entry_is_told(own_data: Path, name: str, text: str, message: str) -> None:
    path = own_data / f"{name}_mine.toml"
    path.write_text(text)
    with pytest.raises(SchemaError, match=rf"{re.escape(str(path))}: {message}"):
        (catalogue.room_kinds if name == "rooms" else catalogue.uses)()


def test_every_composition_furnishes_a_room_of_ours() -> None:
    composed = {kind.entry.composed for kind in catalogue.room_kinds().kinds.values()} - {None}
    assert composed == set(COMPOSITIONS)
