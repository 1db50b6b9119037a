"""Things of a task lie where there is room for them beside the others."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from vico.assets.models.movable import movable_kinds
from vico.challenges.assistant.placement import PlacedThing, ThingPlacer, free_spot
from vico.challenges.assistant.tasks import Region
from vico.errors import EmptyInputError
from vico.seeds import rng
from vico.world.model import Container

CHAIR = Container(id="c", entity=1, kind="chair", centre=(0, 0, -5.5), size=(0.44, 0.44), yaw=0.0489, reach=(1, 0))
DESK = Container(id="d", entity=2, kind="desk", centre=(0, 0, -5.3), size=(0.3, 0.98), yaw=0.0, reach=(1, 0))
FLOOR = Container(id="f", entity=3, kind="floor", centre=(0, 0, -6.0), size=(6, 6), yaw=0.0, reach=(2, 0))


def lying(kind: str, x: float, y: float, z: float, yaw: float = 0.0) -> PlacedThing:
    width, depth, height = movable_kinds()[kind].size
    return PlacedThing((x, y, z), (width, depth, height), yaw)


def test_a_chair_holds_one_toolbox_and_no_basketball_beside_it() -> None:
    toolbox, ball = lying("toolbox", 0, 0, -5.5, 0.37), lying("basketball", 0.008, -0.043, -5.5, 3.13)
    assert free_spot(toolbox, [], [FLOOR, CHAIR]) == toolbox
    assert free_spot(ball, [toolbox], [FLOOR, CHAIR]) is None


def test_a_desk_holds_both_side_by_side() -> None:
    toolbox, ball = lying("toolbox", 0, 0.2, -5.3), lying("basketball", 0, 0.1, -5.3)
    beside = free_spot(ball, [toolbox], [FLOOR, DESK])
    assert beside is not None
    assert abs(beside.spot[0]) <= 0.15
    # Their boxes, 0.21 m and 0.28 m deep, touch no more.
    assert 0.2 - beside.spot[1] >= (0.21 + 0.28) / 2 - 1e-3


def test_what_is_higher_or_on_the_floor_is_in_nobodys_way() -> None:
    toolbox = lying("toolbox", 0, 0, -5.5)
    above = lying("basketball", 0, 0, -5.5 + toolbox.size[2])
    assert free_spot(above, [toolbox], [FLOOR, CHAIR]) == above
    low = [lying("toolbox", 0, 0, -6.0)]
    assert free_spot(lying("basketball", 0, 0, -6.0), low, [FLOOR]) == lying("basketball", 0, 0, -6.0)


def things(chairs: int, seed: int) -> ThingPlacer:
    """Return the things of a world with one place, one room and so many chairs."""
    seats = [CHAIR.model_copy(update={"centre": (5.0 * k, 0.0, -5.5)}) for k in range(chairs)]
    room = SimpleNamespace(id="room", containers=seats, centre=(0, 0, -6.0))
    place = SimpleNamespace(rooms=["room"])
    world: Any = SimpleNamespace(room_by_id={"room": room}, place_by_id={"place": place})
    return ThingPlacer(cast(Any, world), rng(seed, "test"))


def test_no_two_things_share_a_chair() -> None:
    region = Region(kind="place", name="office", place="place", centre=(0, 0, 0), radius=0.0)
    for seed in range(20):
        drawn = things(2, seed)
        first, second = (drawn.make(f"o{k}", "toolbox", in_region=region, middles=[]) for k in range(2))
        assert abs(first.position[0] - second.position[0]) > 4.0
        assert [thing.id for thing in drawn.made] == ["o0", "o1"]
    alone = things(1, 0)
    alone.make("o0", "toolbox", in_region=region, middles=[])
    with pytest.raises(EmptyInputError, match="no surface of office has room for another toolbox"):
        alone.make("o1", "toolbox", in_region=region, middles=[])
