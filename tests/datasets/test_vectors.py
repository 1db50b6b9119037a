"""Vectors say the same of a live observation and of its recording, and actions come back from theirs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vico.challenges.assistant.challenge import play_task
from vico.challenges.assistant.generate import first_subtasks, generate_task
from vico.community import build_community
from vico.datasets.demonstrations import EpisodeFacts, current_part, demonstrations_of
from vico.datasets.vectors import (
    GOAL,
    IDLE,
    PERSON_STATE,
    ActionForm,
    action_caption,
    goal_vector,
    in_own_frame,
    in_world_frame,
    person_state,
)
from vico.errors import InputError
from vico.runner.loop import Hook, Step
from vico.sim.actions import ACTIONS, PEOPLE_ACTIONS
from vico.sim.actions.table import parse
from vico.sim.recording import read_run
from vico.world.world import World

POSE = (12.5, -40.25, 3.0, 2.1)
FORM = ActionForm()
EXAMPLES: list[dict[str, Any]] = [
    {"type": "move_forward", "distance": 1.75},
    {"type": "move_forward", "distance": 3.0},
    {"type": "move_forward", "distance": 1.0, "turn": -22.5},
    {"type": "turn_left", "degrees": 37.0},
    {"type": "turn_right", "degrees": 270.0},
    {"type": "look_at", "target": [20.0, -35.5, 4.25]},
    {"type": "pick", "hand": 1, "object": 1_000_123},
    {"type": "put", "hand": 0},
    {"type": "put", "hand": 1, "target": 4711},
    {"type": "put", "hand": 1, "target": [13.0, -40.0, 3.75]},
    {"type": "hand_over", "hand": 0, "agent": "resident_3"},
    {"type": "enter", "place": "n1613725221"},
    {"type": "exit"},
    {"type": "communicate", "text": "Missä on kirjasto?", "range": 4.0},
    {"type": "sit", "target": 2000},
    {"type": "sit"},
    {"type": "task_complete", "index": 5},
    {"type": "wait"},
]
ROBOT = ActionForm(robot=True, width=2, space="velocity")
ROBOT_EXAMPLES: list[dict[str, Any]] = [
    {"type": "control", "vector": [0.5, -1.25]},
    {"type": "go_to", "target": [1.0, 2.0, 0.5]},
    {"type": "follow", "agent": "resident_0"},
    {"type": "place", "target": 1_000_001},
    {"type": "pick", "object": 1_000_002},
    {"type": "stop"},
]


def nearly(one: Any, other: Any) -> bool:
    """Whether two actions are the same, but for the rounding of float32."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(nearly(one[key], other[key]) for key in one)
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(nearly, one, other))
    return math.isclose(one, other, abs_tol=1e-4) if isinstance(one, float) else one == other


@pytest.mark.parametrize("action", EXAMPLES, ids=action_caption)
def test_an_action_comes_back_from_its_vector(action: dict[str, Any]) -> None:
    vector, text = FORM.encode(action, POSE)
    assert vector.shape == (len(FORM.names),)
    assert vector.dtype == np.float32
    assert nearly(FORM.decode(vector, POSE, text), action)


@pytest.mark.parametrize("action", ROBOT_EXAMPLES, ids=action_caption)
def test_a_robots_action_comes_back_from_its_vector(action: dict[str, Any]) -> None:
    vector, text = ROBOT.encode(action, POSE)
    assert nearly(ROBOT.decode(vector, POSE, text), action)


def test_every_action_of_people_has_an_example() -> None:
    told = {action["type"] for action in EXAMPLES}
    without_fields = {name for name in PEOPLE_ACTIONS if not ACTIONS[name].fields}
    assert set(PEOPLE_ACTIONS) - told - without_fields == {"sleep"}  # whose field is that of `sit`


@pytest.mark.parametrize(
    "action", [None, 3, {"type": "fly"}, {"type": "move_forward"}, {"type": "control", "vector": [1]}]
)
def test_what_is_no_action_is_encoded_as_waiting(action: object) -> None:
    vector, text = FORM.encode(action, POSE)
    assert FORM.decode(vector, POSE, text) == {"type": IDLE}


@given(st.lists(st.floats(-1e3, 1e3, width=32), min_size=len(FORM.names), max_size=len(FORM.names)))
def test_whatever_is_predicted_is_an_action_in_form_and_range(numbers: list[float]) -> None:
    action = FORM.decode(numbers, POSE, "somebody")
    kind = ACTIONS[action["type"]]
    command = parse(action)
    assert not hasattr(command, "code"), command
    for name, value in command.values.items():  # type: ignore[union-attr]
        assert kind.fields[name].in_range(value)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(InputError, match="16777216"):
        FORM.encode({"type": "pick", "hand": 0, "object": 2**24}, POSE)
    with pytest.raises(InputError, match="2"):
        ROBOT.encode({"type": "control", "vector": [1.0, 2.0, 3.0]}, POSE)
    with pytest.raises(InputError, match="own action space"):
        ROBOT.encode({"type": "control", "vector": [1.0, 2.0], "space": "torque"}, POSE)
    with pytest.raises(InputError, match="finite"):
        FORM.decode([float("nan")] * len(FORM.names), POSE)


@given(st.tuples(*[st.floats(-500, 500)] * 3), st.floats(-4, 4))
def test_frames_undo_each_other(point: tuple[float, float, float], yaw: float) -> None:
    pose = (10.0, -20.0, 1.5, yaw)
    assert np.allclose(in_world_frame(pose, in_own_frame(pose, point)), point, atol=1e-9)


def test_ahead_is_forward_and_north_of_an_eastward_gaze_is_left() -> None:
    assert np.allclose(in_own_frame((0.0, 0.0, 0.0, 0.0), (3.0, 2.0, 1.0)), (3.0, 2.0, 1.0))
    assert np.allclose(in_own_frame((0.0, 0.0, 0.0, math.pi / 2), (0.0, 5.0, 0.0)), (5.0, 0.0, 0.0))


def test_a_goal_says_which_regions_there_are() -> None:
    spot = {"kind": "outdoor", "centre": [10.0, 0.0, 0.0], "radius": 8.0}
    inside = {"kind": "place", "centre": [0.0, 10.0, 0.0], "radius": 0.0}
    both = dict(zip(GOAL, goal_vector((0, 0, 0, 0), {"sources": [spot], "destination": inside}), strict=True))
    assert (both["source.forward"], both["source.radius"], both["source.indoors"]) == (10.0, 8.0, 0.0)
    assert (both["destination.there"], both["destination.left"], both["destination.indoors"]) == (1.0, 10.0, 1.0)
    assert not goal_vector((0, 0, 0, 0), {"sources": [spot], "destination": None})[len(GOAL) // 2 :].any()
    assert not goal_vector((0, 0, 0, 0), None).any()


def test_a_frame_is_about_the_part_that_is_reported_next() -> None:
    report = [{"type": "task_complete", "index": k} for k in range(3)]
    walk = {"type": "wait"}
    assert current_part([walk, report[1], walk, report[0], walk, walk], 3) == [1, 1, 0, 0, 2, 2]
    assert current_part([walk, walk], 1) == [0, 0]
    assert current_part([walk], 0) == [0]


class Watch(Hook):
    """Keeps the state vectors of an assistant's live observations."""

    def __init__(self) -> None:
        self.states: list[Any] = []

    def begin(self, observations: Any) -> None:
        self.states.append(person_state(observations["assistant_0"]))

    def on_step(self, step: Step) -> None:
        self.states.append(person_state(step.result.observations["assistant_0"]))


def test_states_of_a_recording_are_those_of_the_live_observations(helsinki: World, tmp_path: Path) -> None:
    people = build_community(helsinki, residents=15, seed=0)
    task = first_subtasks(generate_task(helsinki, people, "delivery", seed=1, steps=25), subtasks=1)
    assert len(task.subtasks) == 1
    watch = Watch()
    play_task(helsinki, people, task, method="heuristic", recording=tmp_path / "run", hooks=[watch])
    run = read_run(tmp_path / "run")
    found = demonstrations_of(run, EpisodeFacts(instructions=task.instructions()), ["assistant_0"])[0]
    assert len(found) == run.last
    live = np.array(watch.states[:-1])
    assert np.abs(found.state - live).max(axis=0).max() < 2e-3, dict(
        zip(PERSON_STATE, np.abs(found.state - live).max(axis=0), strict=True)
    )
    assert found.instructions == [task.subtasks[0].text] * run.last
    asked = [run.at(step).agents["assistant_0"].action["type"] for step in range(1, run.last + 1)]
    assert [FORM.decode(vector, POSE)["type"] for vector in found.action] == asked
