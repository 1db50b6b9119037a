"""Layouts of one's own: read strictly, found by use and size, drawn by an author who is told what is wrong."""

from __future__ import annotations

import copy
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vico.errors import InputError, MissingFileError, SchemaError, VicoError
from vico.world.check.indoors import walkable_inside
from vico.world.model import Category
from vico.world.world import World
from vico.worldgen.indoor.furnished_plans import rooms_of_plan
from vico.worldgen.indoor.layout_library import (
    Layout,
    LayoutRequest,
    findings_of,
    layout_from_author,
    layout_guide,
    layout_schema,
    parse_layout,
    read_library,
    write_layout,
)
from vico.worldgen.indoor.stage import furnish

BAR: dict[str, Any] = {
    "schema": "vico.layout",
    "version": 1,
    "name": "Corner bar",
    "use": "bar",
    "size": [8.0, 6.0],
    "rooms": [
        {"id": "bar", "kind": "bar", "rect": [0, 0, 8, 4], "walls": "brick", "colour": "#a08060"},
        {
            "id": "store",
            "kind": "storage",
            "rect": [0, 4, 8, 6],
            "furniture": [{"model": "store_rack", "at": [1.0, 5.68], "yaw": -90}],
        },
    ],
    "doors": [{"between": ["bar", "outside"], "at": [4.0, 0.0]}, {"between": ["bar", "store"], "at": [6.0, 4.0]}],
}


def changed(**changes: Any) -> dict[str, Any]:
    """The bar with something else at a path such as ``rooms.0.rect``."""
    made = copy.deepcopy(BAR)
    for path, value in changes.items():
        at: Any = made
        *steps, last = path.split("__")
        for step in steps:
            at = at[int(step)] if step.isdigit() else at[step]
        at[int(last) if last.isdigit() else last] = value
    return made


def test_a_layout_is_built_as_drawn_and_can_be_walked() -> None:
    layout = parse_layout(json.dumps(BAR), "bar.json")
    plan = layout.plan(0)
    rooms, objects = rooms_of_plan(plan)
    assert walkable_inside(rooms, objects) == []
    assert [room.kind for room in rooms] == ["bar", "storage"]
    rack = int(np.flatnonzero((objects.room == rooms[1].id) & (objects.prototype == "store_rack"))[0])
    assert (objects.x[rack], objects.y[rack]) == pytest.approx((1.0 - 4.0, 5.68 - 3.0), abs=0.01)
    assert "wall_brick" in {surface.material.name for surface in plan.shell}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rooms__0__rect": [0, 0, 8]}, "rooms.0.rect"),
        ({"rooms__0__rect": [0, 0, 9, 4]}, "leaves the plan"),
        ({"rooms__1__rect": [0, 3, 8, 6]}, "overlaps"),
        ({"rooms__1__furniture__0__model": "throne"}, "rooms.1.furniture.0"),
        ({"rooms__1__furniture__0__at": [1.0, 3.0]}, "within its room"),
        ({"rooms__1__furniture__0__at": [6.0, 4.5]}, "rooms"),
        ({"rooms__0__kind": "throne_room"}, "rooms.0 (bar).kind"),
        ({"rooms__1__id": "bar"}, "ids have to differ"),
        ({"doors__1__at": [6.0, 3.0]}, "doors.1.at"),
        ({"doors__0__width": 0.4}, "doors.0.width"),
        ({"doors__1__between": ["bar", "cellar"]}, "no room 'cellar'"),
        ({"doors__1": {"between": ["bar", "outside"], "at": [2.0, 0.0]}}, "2 of them lead outside"),
        ({"use": "palace"}, "use"),
        ({"size": [8.0, float("nan")]}, "size.1"),
        ({"colour": "red"}, "colour"),
        ({"version": 2}, "version"),
        ({"category": "food"}, "either use or category"),
    ],
)
def test_what_is_wrong_is_said_with_the_path_of_the_field(changes: dict[str, Any], words: str) -> None:
    with pytest.raises((SchemaError, InputError), match=r"bar\.json: ") as caught:
        parse_layout(json.dumps(changed(**changes)), "bar.json")
    assert words in str(caught.value)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=8),
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from([*BAR, "x"]), inner, max_size=6),
        max_leaves=12,
    )
)
def test_json_that_is_no_layout_is_refused_in_a_sentence(content: object) -> None:
    with pytest.raises(VicoError, match=r"^any\.json: "):
        parse_layout(json.dumps(content), "any.json")


def test_bytes_that_are_no_json_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_bytes(b"\xff\xfe{")
    with pytest.raises(SchemaError, match=r"a\.json"):
        read_library(tmp_path)
    with pytest.raises(MissingFileError, match="no such folder"):
        read_library(tmp_path / "none")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three layouts: two bars, and one for any shop."""
    write_layout(Layout.model_validate_json(json.dumps(BAR)), tmp_path / "bar.json")
    large = changed(
        name="Large bar", size=[12.0, 9.0], rooms__0__rect=[0, 0, 12, 7], rooms__1__rect=[0, 7, 12, 9],
        rooms__1__furniture=None, doors__1__at=[6.0, 7.0],
    )  # fmt: skip
    (tmp_path / "large.json").write_text(json.dumps(large))
    shop = changed(name="Shop", category="store", rooms__0__kind="shop")
    del shop["use"]
    (tmp_path / "shop.json").write_text(json.dumps(shop))
    return tmp_path


def test_the_nearest_fit_by_use_then_category_and_area_is_taken(folder: Path) -> None:
    library = read_library(folder)
    chance = np.random.default_rng(0)
    names = [
        getattr(library.nearest(use, category, area, chance), "name", None)
        for use, category, area in (
            ("bar", Category.FOOD, 300.0), ("bar", Category.FOOD, 60.0), ("bar", Category.FOOD, 20.0),
            ("florist", Category.STORE, 90.0), ("church", Category.ENTERTAINMENT, 90.0),
        )
    ]  # fmt: skip
    assert names == ["Large bar", "Corner bar", "Corner bar", "Shop", None]


def test_places_are_furnished_from_the_library(helsinki: World, folder: Path) -> None:
    pub = next(p for p in helsinki.places if p.kind in ("pub", "bar"))
    made = furnish([pub], buildings=helsinki.buildings, height=helsinki.height, library=folder)
    assert [room.kind for room in made.rooms] == ["bar", "storage"]
    assert walkable_inside(made.rooms, made.furniture) == []


class Scripted:
    """An author with its answers ready."""

    def __init__(self, *answers: str) -> None:
        self.answers = list(answers)
        self.heard: list[tuple[str, ...]] = []
        self.asked: list[LayoutRequest] = []

    def draw(self, request: LayoutRequest, feedback: Sequence[str]) -> str:
        """The next answer."""
        self.asked.append(request)
        self.heard.append(tuple(feedback))
        return self.answers.pop(0)


def test_an_author_is_told_what_is_wrong_until_the_layout_is_good(helsinki: World) -> None:
    pub = next(p for p in helsinki.places if p.kind in ("pub", "bar"))
    author = Scripted("not json", json.dumps(changed(rooms__1__rect=[0, 3, 8, 6])), json.dumps(BAR))
    layout = layout_from_author(author, pub, use="bar", area=100.0)
    assert layout is not None
    assert layout.name == "Corner bar"
    assert author.heard[0] == ()
    assert "JSON" in author.heard[1][0]
    assert "overlaps" in author.heard[2][0]
    assert author.asked[0].size == (10.0, 10.0)


def test_an_author_who_never_gets_it_right_is_replaced_by_the_rules(helsinki: World) -> None:
    pub = next(p for p in helsinki.places if p.kind in ("pub", "bar"))
    author = Scripted("{}", "{}", "{}")
    made = furnish([pub], buildings=helsinki.buildings, height=helsinki.height, author=author)
    assert author.answers == []
    assert made.rooms[0].kind == "bar"


def test_the_schema_and_the_guide_tell_an_author_all_there_is() -> None:
    schema = layout_schema()
    text = json.dumps(schema)
    assert len(schema["x-furniture"]) >= 40
    assert "restaurant_kitchen" in schema["x-room-kinds"]
    assert "additionalProperties" in text
    assert '"schema"' in text
    assert "0.9 m" in layout_guide()
    assert findings_of(Layout.model_validate_json(json.dumps(BAR))) == []
