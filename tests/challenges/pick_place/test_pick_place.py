"""Pick and place: what is drawn, how it is shown, how it is judged."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from vico.agents.robot.increments import PERIOD
from vico.challenges.pick_place.episode import ROBOT, Demonstrator, Verdict, _judge, demonstrate, play, simulation_of
from vico.challenges.pick_place.tasks import NEXT_TO, TABLE, PickPlaceTask, draw_task, fitting_kinds
from vico.errors import EmptyInputError, InputError
from vico.world.walkable import BLOCKED
from vico.world.world import World

TASKS = [draw_task(seed) for seed in range(60)]


def test_a_seed_gives_the_same_task_and_others_give_others() -> None:
    assert draw_task(7) == TASKS[7]
    assert len({task.model_dump_json() for task in TASKS}) == len(TASKS)
    assert PickPlaceTask.model_validate_json(TASKS[7].model_dump_json()) == TASKS[7]


def test_all_that_is_to_vary_varies() -> None:
    assert {task.thing.kind for task in TASKS} == set(fitting_kinds())
    assert len({task.thing.colour for task in TASKS}) >= 7
    pairs = {(task.source, task.destination) for task in TASKS}
    assert pairs == {("ground", "ground"), ("table", "ground"), ("ground", "table")}
    assert len({task.weather for task in TASKS}) == 3
    assert len({task.thing.colour == task.landmark.colour for task in TASKS}) == 1  # never the same


def test_things_fit_between_the_fingers() -> None:
    for kind in fitting_kinds().values():
        assert min(kind.size[:2]) < 0.28
    assert "toolbox" in fitting_kinds()
    assert "parcel" not in fitting_kinds()


def test_the_robot_can_see_and_reach_what_it_is_told_of() -> None:
    for task in TASKS:
        x, y, yaw = task.robot
        dx, dy = task.thing.position[0] - x, task.thing.position[1] - y
        off = abs(math.remainder(math.atan2(dy, dx) - yaw, math.tau))
        assert 0.5 < math.hypot(dx, dy) < 2.0
        assert off < 0.61
        if task.destination == "ground":
            assert math.dist(task.spot[:2], task.landmark.position[:2]) < NEXT_TO
        else:
            assert task.table is not None
            assert abs(task.spot[0] - task.table[0]) < TABLE[0] / 2
            assert task.spot[2] == pytest.approx(task.table[2])


def test_instructions_name_thing_and_place() -> None:
    said = {(task.source, task.destination): task for task in TASKS}
    task = said["table", "ground"]
    where = f"put it down next to the {task.landmark.colour} {task.landmark.kind}."
    assert task.instruction == f"Pick up the {task.thing.colour} {task.thing.kind} from the table and {where}"
    assert said["ground", "table"].instruction.endswith(" and put it on the table.")


def test_bad_requests_are_refused() -> None:
    with pytest.raises(InputError, match="an episode of 0 s"):
        draw_task(0, seconds=0)
    with pytest.raises(ValidationError, match="colour2"):
        PickPlaceTask.model_validate(TASKS[0].model_dump() | {"colour2": "red"})


def test_an_episode_is_shown_and_what_was_done_does_it_again() -> None:
    pictures: list[np.ndarray[Any, Any]] = []
    shown = demonstrate(
        7, None, seconds=60, side=64, drop_below=0.01, seen=lambda k, seen: pictures.append(seen["rgb"])
    )
    played = shown.played
    assert (played.success, played.cause, played.why) == (True, Verdict.DONE, "")
    n = len(played.states)
    assert played.actions.shape == (n, 11)
    assert len(pictures) == n == round(played.seconds / PERIOD)
    assert pictures[0].shape == (224, 224, 3)
    assert not np.array_equal(pictures[0], pictures[n // 2])
    largest = np.abs(played.actions).max(axis=1)
    assert 0.5 < len(shown.kept) / n < 1.0
    assert (largest[shown.kept] >= 0.01).all()
    assert (np.delete(largest, shown.kept) < 0.01).all()

    class Again:
        """Does what was recorded, from the states as they are now."""

        def __init__(self) -> None:
            self.k = 0

        def act(self, observation: dict[str, Any], instruction: str) -> dict[str, Any] | None:
            from vico.agents.robot.increments import arm_state, control_of

            self.k += 1
            return None if self.k > n else control_of(played.actions[self.k - 1], arm_state(observation))

    again = play(shown.task, None, Again(), side=64, outputs=("rgb",), to_the_end=True)
    assert again.success
    # Actions are kept as float32: where things touch, that is seen.
    away = np.abs(again.states - played.states)
    assert np.mean(away < 1e-3) > 0.9
    assert away.max() < 0.1


def test_a_street_will_do(helsinki: World) -> None:
    task = draw_task(8, helsinki)
    assert task.table is None
    assert task.world == helsinki.manifest.name
    shown = demonstrate(8, helsinki, seconds=60, side=64)
    assert shown.played.cause == Verdict.DONE, shown.played.why
    assert shown.played.off <= NEXT_TO


def test_who_does_nothing_has_done_nothing() -> None:
    class Idle:
        def act(self, observation: dict[str, Any], instruction: str) -> None:
            return None

    played = play(TASKS[1], None, Idle(), side=32, outputs=("rgb",))
    assert (played.success, played.cause, len(played.actions)) == (False, Verdict.NOT_TAKEN, 0)


def test_being_near_is_not_enough() -> None:
    """A thing that fell two metres off, or was pushed to where it is to be, does not count."""
    task = next(task for task in TASKS if task.destination == "ground")
    sim = simulation_of(task, None, side=32, outputs=("rgb",))
    observations, _ = sim.observe([ROBOT])
    seen = observations[ROBOT]
    where = sim.state.objects.position
    where[0] = (*task.spot[:2], 0.0)
    assert _judge(sim, task, seen, lifted=True)[0] == Verdict.DONE
    assert _judge(sim, task, seen, lifted=False)[0] == Verdict.NOT_TAKEN
    where[0] = (*task.spot[:2], 0.3)
    assert _judge(sim, task, seen, lifted=True)[0] == Verdict.NOT_PLACED
    where[0] = (task.spot[0] + 2.0, task.spot[1], 0.0)
    assert _judge(sim, task, seen, lifted=True)[0] == Verdict.NOT_PLACED
    where[0] = (*task.spot[:2], 0.0)
    seen["sensors"]["contacts"] = np.array([5.0, 5.0])
    assert _judge(sim, task, seen, lifted=True)[0] == Verdict.HELD


def test_who_has_no_room_says_so(helsinki: World) -> None:
    narrow = World(
        helsinki.manifest,
        helsinki.path,
        walkable=type(helsinki.walkable)(np.full_like(helsinki.walkable.cls, BLOCKED), helsinki.half),
    )
    with pytest.raises(EmptyInputError, match="has no level street"):
        draw_task(0, narrow)


def test_a_demonstrator_that_gives_up_says_why() -> None:
    task = TASKS[1].model_copy(update={"spot": (30.0, 0.0, 0.0), "seconds": 20})
    played = play(task, None, Demonstrator(period=PERIOD), to_the_end=True)
    assert not played.success
    assert played.cause == Verdict.TIMEOUT
