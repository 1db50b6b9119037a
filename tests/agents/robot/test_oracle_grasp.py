"""With oracle grasp a hand never loses what it closed on; without it nothing but friction holds a thing."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from robot_field import drawn_field
from vico.agents.robot.arm_interface import ArmStage
from vico.agents.robot.arm_skills import ArmWorker
from vico.assets.robots import robot_model
from vico.assets.shapes import box
from vico.challenges.robot_tasks import arm_body
from vico.errors import SchemaError
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.physics import surroundings
from vico.sim.physics.mujoco_engine import MujocoEngine

PERIOD, ROBOT, SIZE, AT = 0.05, "robot_0", (0.12, 0.2, 0.2), np.array([1.2, 0.3, 0.0])
BODY = arm_body(robot_model("manipulator"))


class Trial:
    """A manipulator and a thing before it."""

    def __init__(self, *, oracle: bool) -> None:
        config = SimConfig(
            robots=("manipulator",),
            robot_places={ROBOT: (0.0, 0.0, 0.0)},
            periods={ROBOT: PERIOD},
            observe=(ROBOT,),
            outputs=("depth", "segmentation"),
            image=192,
            oracle_grasp=oracle,
        )
        self.sim = Simulation(drawn_field(table=0.0), None, config)
        shape = [box(SIZE, (0, 0, SIZE[2] / 2))]
        self.thing = int(self.sim.scenario.add_object("parcel", "parcel", shape, tuple(AT), size=SIZE, yaw=0.7))
        self.worker = ArmWorker(BODY, period=PERIOD)
        self.worker.pick(self.thing, AT)
        self.seen: dict[str, Any] = dict(self.sim.step({ROBOT: {"type": "wait"}}).observations)[ROBOT]

    def work(self, stage: ArmStage | None = None) -> None:
        """Let the worker work, to its end or to a stage."""
        for _ in range(round(60.0 / PERIOD)):
            action = self.worker.act(self.seen)
            if not self.worker.busy or self.worker.stage is stage:
                return
            self.seen = dict(self.sim.step({ROBOT: action}).observations)[ROBOT]
        raise AssertionError(f"still at {self.worker.stage}")

    @property
    def position(self) -> np.ndarray:
        return np.array(self.sim.state.objects.position[0])


@pytest.fixture
def heavy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have things weigh more than friction holds."""
    monkeypatch.setattr(surroundings, "object_mass", lambda size: 25.0)


def test_by_oracle_what_is_too_heavy_for_friction_is_lifted_kept_and_put_down(heavy: None) -> None:
    trial = Trial(oracle=True)
    trial.work()
    assert (trial.worker.outcome, trial.worker.why) == ("picked", "")
    assert trial.seen["state"]["held"] == [0, trial.thing]
    up = trial.position
    assert up[2] > 0.3
    trial.sim.step({ROBOT: {"type": "control", "space": "velocity", "vector": [0.3, 0.0, 0.6]}})
    for _ in range(40):
        trial.sim.step({})
    assert trial.position[2] == pytest.approx(up[2], abs=0.02)
    assert np.hypot(*(trial.position - up)[:2]) > 0.2  # it came along
    trial.seen = dict(trial.sim.step({ROBOT: {"type": "stop"}}).observations)[ROBOT]
    trial.worker.place(np.array([0.5, -2.0, 0.0]))
    trial.work()
    assert (trial.worker.outcome, trial.worker.why) == ("placed", "")
    assert trial.position == pytest.approx([0.5, -2.0, 0.0], abs=0.04)
    assert trial.seen["state"]["held"] == [0, 0]


def test_what_is_held_by_oracle_is_saved(heavy: None) -> None:
    trial = Trial(oracle=True)
    trial.work(ArmStage.CARRY)
    saved = trial.sim.snapshot()
    vector = {"type": "control", "vector": [*trial.seen["sensors"]["joint_position"].tolist(), 0.2, 0.0]}
    for _ in range(10):
        trial.sim.step({ROBOT: vector})
    again = Trial(oracle=True)
    again.sim.restore(saved)
    for _ in range(10):
        again.sim.step({ROBOT: vector})
    assert again.sim.state_hash() == trial.sim.state_hash()
    robots, other = trial.sim.state.robots, Trial(oracle=True).sim.state.robots
    assert robots is not None
    assert other is not None
    without = {key: value for key, value in robots.arrays().items() if not key.startswith("oracle_")}
    with pytest.raises(SchemaError, match="without oracle grasp"):
        other.restore(without)


def test_without_it_no_weld_no_attachment_and_no_written_pose_holds_a_thing(monkeypatch: pytest.MonkeyPatch) -> None:
    trial = Trial(oracle=False)
    trial.work(ArmStage.GRIP)
    written: list[str] = []
    for name in ("place_object", "remove_object"):
        monkeypatch.setattr(MujocoEngine, name, lambda *rest, name=name: written.append(name))
    trial.work()
    assert trial.worker.outcome == "picked"
    for _ in range(40):
        trial.sim.step({ROBOT: {"type": "wait"}})
    assert trial.position[2] > 0.3
    assert not written
    assert trial.sim.state.objects.holder[0] == 0
    assert trial.seen["state"]["held"] == [0, 0]
    robots = trial.sim.state.robots
    assert robots is not None
    assert isinstance(robots.engine, MujocoEngine)
    couplings = robots.engine.compiled.full.model.eq_type
    assert set(couplings.tolist()) <= {int(mujoco.mjtEq.mjEQ_JOINT)}  # of the two fingers
    assert trial.worker.forces > 20.0


def test_without_it_what_is_too_heavy_stays_where_it_is(heavy: None) -> None:
    trial = Trial(oracle=False)
    trial.work()
    assert trial.worker.outcome == "failed"
    assert trial.position[2] < 0.1
