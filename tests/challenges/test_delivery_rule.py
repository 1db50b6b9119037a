"""The delivery rule at its edges, and the judge who applies it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

import toy_city
from vico.challenges.assistant.delivery import DESTINATION_RADIUS, delivered
from vico.challenges.assistant.model import Region, Start, Subtask, Task, TaskObject
from vico.challenges.assistant.runner import Judge
from vico.world.folder import World

SPOT = (4.0, -12.0, 0.5)


@dataclass
class Table:
    """Where things lie, as a test says: position, room, holder by name."""

    positions: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    rooms: dict[str, str] = field(default_factory=dict)
    holders: dict[str, str] = field(default_factory=dict)

    def object_position(self, name: str) -> NDArray[np.float64]:
        return np.array(self.positions[name])

    def object_room(self, name: str) -> str | None:
        return self.rooms.get(name)

    def object_holder(self, name: str) -> str | None:
        return self.holders.get(name)


@pytest.fixture(scope="module")
def city() -> World:
    return toy_city.world()


def errand(destination: Region, *, index: int = 0, objects: tuple[str, ...] = ("object_0",)) -> Subtask:
    source = Region(kind="place", name="Hat Shop", place=toy_city.SHOP, centre=(5.0, 4.0, 0.0), radius=0.0)
    return Subtask(
        index=index, text="", objects=list(objects), source=source, destination=destination,
        object_candidates=[], source_candidates=[], destination_candidates=[],
    )  # fmt: skip


OUTDOORS = Region(kind="outdoor", name="the green", place=None, centre=SPOT, radius=DESTINATION_RADIUS)
CAFE = Region(kind="place", name="Corner Café", place=toy_city.CAFE, centre=(-5.0, 4.0, -0.1), radius=0.0)


@pytest.mark.parametrize(("metres", "done"), [(0.0, True), (2.99, True), (3.01, False)])
def test_outdoors_three_metres_count(city: World, metres: float, done: bool) -> None:
    angle = 0.7
    there = (SPOT[0] + metres * np.cos(angle), SPOT[1] + metres * np.sin(angle), SPOT[2])
    assert delivered(errand(OUTDOORS), Table({"object_0": there}), city) is done


def test_height_does_not_count_outdoors(city: World) -> None:
    assert delivered(errand(OUTDOORS), Table({"object_0": (SPOT[0], SPOT[1], 9.0)}), city)


def test_a_thing_in_a_room_below_the_spot_is_not_outdoors(city: World) -> None:
    state = Table({"object_0": SPOT}, rooms={"object_0": "r_cafe"})
    assert not delivered(errand(OUTDOORS), state, city)


@pytest.mark.parametrize("room", ["r_cafe", "r_back"])
def test_every_room_of_the_place_counts(city: World, room: str) -> None:
    assert delivered(errand(CAFE), Table({"object_0": (0.0, 0.0, 0.0)}, rooms={"object_0": room}), city)


def test_another_place_and_the_doorstep_do_not_count(city: World) -> None:
    assert not delivered(errand(CAFE), Table({"object_0": CAFE.centre}, rooms={"object_0": "r_shop"}), city)
    assert not delivered(errand(CAFE), Table({"object_0": CAFE.centre}), city)


@pytest.mark.parametrize("region", [OUTDOORS, CAFE], ids=["outdoors", "place"])
def test_what_somebody_still_holds_is_not_delivered(city: World, region: Region) -> None:
    state = Table({"object_0": region.centre}, rooms={"object_0": "r_cafe"} if region is CAFE else {})
    assert delivered(errand(region), state, city)
    state.holders["object_0"] = "assistant_0"
    assert not delivered(errand(region), state, city)


def test_all_things_of_the_errand_have_to_be_there(city: World) -> None:
    both = errand(OUTDOORS, objects=("object_0", "object_1"))
    state = Table({"object_0": SPOT, "object_1": (SPOT[0] + 5, SPOT[1], SPOT[2])})
    assert not delivered(both, state, city)
    state.positions["object_1"] = SPOT
    assert delivered(both, state, city)


@pytest.fixture
def trial(city: World) -> tuple[Judge, Table]:
    """A judge over two errands to the green: a red and a blue helmet, both still in the shop."""
    things = [
        TaskObject(id=f"object_{k}", kind="helmet", colour=colour, name=f"{colour} helmet", position=(7.0, 13.0, -5.2),
                   yaw=0.0, room="r_shop")
        for k, colour in enumerate(("red", "blue"))
    ]  # fmt: skip
    task = Task(
        category="delivery", world="toy", world_digest=city.digest, seed=0, steps=9,
        assistants=[Start(position=(0.0, 0.0), yaw=0.0)], objects=things,
        subtasks=[errand(OUTDOORS, index=k, objects=(f"object_{k}",)) for k in range(2)],
    )  # fmt: skip
    names = [thing.name for thing in things]
    state = Table(dict.fromkeys(names, (7.0, 13.0, -5.2)), rooms=dict.fromkeys(names, "r_shop"))
    return Judge(task, city, state), state


def bring(state: Table, name: str) -> None:
    state.positions[name] = SPOT
    state.rooms.pop(name)


def test_what_nobody_reports_is_judged_as_it_stands_at_the_end(trial: tuple[Judge, Table]) -> None:
    judge, state = trial
    judge.watch(0)
    assert judge.final() == [False, False]
    bring(state, "blue helmet")
    judge.watch(1)
    assert judge.final() == [False, True]
    assert judge.since == [None, 1]
    assert not judge.over


def test_a_report_is_final_when_it_was_wrong(trial: tuple[Judge, Table]) -> None:
    judge, state = trial
    judge.watch(0)
    judge.report(0)
    bring(state, "red helmet")
    judge.watch(1)
    assert judge.final() == [False, False]


def test_a_report_is_final_when_it_was_right(trial: tuple[Judge, Table]) -> None:
    judge, state = trial
    bring(state, "red helmet")
    judge.watch(4)
    judge.report(0)
    state.holders["red helmet"] = "resident_0"  # somebody takes it away afterwards
    judge.watch(5)
    assert judge.final() == [True, False]
    assert judge.since[0] == 4


def test_a_success_that_is_lost_again_counts_from_when_it_came_back(trial: tuple[Judge, Table]) -> None:
    judge, state = trial
    bring(state, "red helmet")
    judge.watch(3)
    state.holders["red helmet"] = "assistant_0"
    judge.watch(4)
    assert judge.final() == [False, False]
    del state.holders["red helmet"]
    judge.watch(6)
    judge.watch(7)
    assert judge.final() == [True, False]
    assert judge.since[0] == 6


def test_it_is_over_when_everything_was_reported(trial: tuple[Judge, Table]) -> None:
    judge, _ = trial
    judge.watch(0)
    judge.report(0)
    assert not judge.over
    judge.report(7)  # no such errand
    judge.report(1)
    assert judge.over
