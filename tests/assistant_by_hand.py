"""Assistant tasks in the toy city, and their truth, as a test says it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

import toy_city
from vico.challenges.assistant.evaluate import CauseTracker, Judge
from vico.challenges.assistant.tasks import Category, Person, Region, Start, Subtask, Surface, Task, TaskObject
from vico.runner.loop import Step
from vico.world.model import Point3
from vico.world.world import World

#: In the shop and in the café, on the green, and far from all of it.
IN_SHOP: Point3 = (7.0, 12.5, toy_city.FLOOR)
IN_CAFE: Point3 = (-6.0, 11.0, toy_city.FLOOR)
GREEN: Point3 = (4.0, -12.0, 0.5)
FAR: Point3 = (-30.0, -30.0, 0.0)

SHOP = Region(kind="place", name="Hat Shop", place=toy_city.SHOP, centre=(5.0, 4.0, 0.1), radius=0.0)
CAFE = Region(kind="place", name="Corner Café", place=toy_city.CAFE, centre=(-5.0, 4.0, -0.1), radius=0.0)
OUTDOORS = Region(kind="outdoor", name="the green", place=None, centre=GREEN, radius=3.0)
#: The table of the café's first room: 1.6 m x 0.8 m around (-6, 13).
CAFE_TABLE = CAFE.model_copy(update={"surface": Surface(room="r_cafe", kind="table", entity=200_001)})

WHO = "assistant_0"
CLEO = Person(agent="resident_2", name="Cleo Ek", looks="a woman in a blue shirt")


@dataclass
class Truth:
    """Where things and people are: positions by name, rooms by name where they are indoors, holders by thing."""

    world: World
    positions: dict[str, Point3] = field(default_factory=dict)
    rooms: dict[str, str] = field(default_factory=dict)
    holders: dict[str, str] = field(default_factory=dict)

    def put(self, name: str, position: Point3, room: str | None = None) -> None:
        """Have something or somebody somewhere, in nobody's hands."""
        self.positions[name] = position
        self.rooms.pop(name, None)
        self.holders.pop(name, None)
        if room is not None:
            self.rooms[name] = room

    def object_position(self, name: str) -> NDArray[np.float64]:
        return np.array(self.positions[name])

    def object_room(self, name: str) -> str | None:
        return self.rooms.get(name)

    def object_holder(self, name: str) -> str | None:
        return self.holders.get(name)

    def object_entity(self, name: str) -> int:
        return entity_of(name)

    def agent_entity(self, name: str) -> int:
        return entity_of(name)

    def agent_position(self, name: str) -> NDArray[np.float64]:
        return np.array(self.positions[name])

    def agent_room(self, name: str) -> str | None:
        return self.rooms.get(name)

    def agent_place(self, name: str) -> str | None:
        room = self.rooms.get(name)
        return None if room is None else self.world.room_by_id[room].place


def entity_of(name: str) -> int:
    """Return the entity of a thing or person of these tasks."""
    names = ["red helmet", "blue helmet", "green helmet", "resident_0", "resident_1", "resident_2", WHO, "assistant_1"]
    return 501 + names.index(name)


def subtask(
    sources: Sequence[Region],
    destination: Region | None,
    *,
    index: int = 0,
    objects: Sequence[str] = ("object_0",),
    source: int = 0,
) -> Subtask:
    """Return a subtask of Cleo's."""
    return Subtask(
        index=index, text="Cleo Ek asks.", person=CLEO, objects=list(objects), sources=list(sources), source=source,
        destination=destination, candidates={},
    )  # fmt: skip


def task(
    category: Category, subtasks: Sequence[Subtask], world: World, *, advanced: bool = False, assistants: int = 1,
    steps: int = 200,
) -> Task:  # fmt: skip
    """Return a task over a red, a blue and a green helmet in the shop; with Carry Cleo has the red one."""
    things = [
        TaskObject(
            id=f"object_{k}", kind="helmet", colour=colour, name=f"{colour} helmet", position=IN_SHOP, yaw=0.0,
            room="r_shop", holder=CLEO.agent if category == "carry" and k == 0 else None,
        )
        for k, colour in enumerate(("red", "blue", "green"))
    ]  # fmt: skip
    return Task(
        category=category, advanced=advanced, world="toy", world_digest=world.digest, community_digest="c" * 64, seed=0,
        start="08:00", steps=steps, assistants=[Start(position=(0.0, 0.0), yaw=0.0)] * assistants, objects=things,
        subtasks=list(subtasks),
    )  # fmt: skip


def picture(shown: Mapping[str, int]) -> dict[str, Any]:
    """Return an observation's picture that shows so many pixels of each of these, and nothing else."""
    flat = np.zeros(64 * 64, np.int32)
    begin = 0
    for name, pixels in shown.items():
        flat[begin : begin + pixels] = entity_of(name)
        begin += pixels
    return {"segmentation": flat.reshape(64, 64)}


class Story:
    """An episode as a test tells it, step by step."""

    def __init__(self, of: Task, world: World) -> None:
        self.truth = Truth(world)
        self.names = [f"assistant_{i}" for i in range(len(of.assistants))]
        for name in (*self.names, "resident_0", "resident_1", "resident_2"):
            self.truth.put(name, FAR)
        for thing in of.objects:
            self.truth.put(thing.name, thing.position, thing.room)
            if thing.holder is not None:
                self.truth.holders[thing.name] = thing.holder
        self.judge = Judge(of, world, self.truth, list(self.names))
        self.chronicle = CauseTracker(self.judge)
        self.number = 0
        self.judge.watch(0)

    def step(
        self, action: Mapping[str, Any] | None = None, *, sees: Mapping[str, int] | None = None, status: str = "ok",
        who: str = WHO, times: int = 1,
    ) -> None:  # fmt: skip
        """Have one assistant act, with this outcome, while the others wait."""
        for _ in range(times):
            self.number += 1
            observations, actions = {}, {}
            for name in self.names:
                mine = name == who
                observations[name] = picture(sees if mine and sees else {}) | {
                    "pose": [*self.truth.positions[name], 1.0, 0.0, 0.0],
                    "state": {"action_status": status if mine else "ok"},
                }
                actions[name] = dict(action) if mine and action is not None else {"type": "wait"}
            result = SimpleNamespace(observations=observations)
            step = Step(self.number, actions, {}, cast(Any, result))
            self.judge.on_step(step)
            self.chronicle.on_step(step)

    def report(self, index: int = 0, **options: Any) -> None:
        """Have a subtask reported."""
        self.step({"type": "task_complete", "index": index}, **options)

    def cause(self, index: int = 0) -> str:
        """Return why a subtask failed."""
        assert not self.judge.final()[index]
        return self.chronicle.cause_of(index)
