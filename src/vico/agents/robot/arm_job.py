"""One piece of work of an arm: what it remembers from one action to the next, and what each of its stages may do."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.body import ArmBody, Stance
from vico.agents.robot.driving import Drive
from vico.agents.robot.following import go_along
from vico.agents.robot.grasps import ThingBox
from vico.agents.robot.held import Held, held_out_at
from vico.agents.robot.reaching import Reach
from vico.agents.robot.stages import Stage, Work
from vico.agents.state import AgentState

Array = NDArray[np.float64]
Action = dict[str, Any]

#: Metres from the base's middle to what its arm reaches for, tried one after the other.
STANDOFFS = (0.60, 0.54, 0.68, 0.62)
#: Seconds without getting nearer, and that people have to take what is held out to them.
STUCK, TAKES = 1.0, 60.0
#: Newtons on both fingers that are a grip.
FELT = 4.0
# Metres that fingers stay apart if there is something in between.
_APART = 0.004
# Angles, rad, that count as there.
_THERE = 0.03
# Of its speed an arm goes with, and with something in the jaw.
_SPEED, _LADEN = 0.8, 0.5


class ArmJob:
    """What an arm at work remembers; stages are functions of it, the observation and the angles it felt.

    Attributes
    ----------
    held
        What is in the jaw, as far as it knows; None for nothing.
    outcome, why
        Of the last piece of work, and the reason of a failure.
    forces
        Largest force on the weaker finger since the last grip, newtons.
    tries
        How often the work was begun anew.
    entity, target
        What is picked, or held; where, ENU metres, shape ``(3,)``.
    beside
        Unit vector to the side the base is to come from, shape ``(2,)``; None for wherever it is.
    servos, knows
        Where servos are told to be, rad and metres, shape ``(9,)``, and whether that is known yet.
    angles
        Of the arm as they were felt last, rad.
    timer, stuck
        Seconds of this stage, and of getting no nearer.
    reach, skip
        Ways to a grasp or a spot, and the grasps that are not tried again.
    way, point
        That the arm goes, angles of shape ``(m, 7)``, and which of its points is next.
    start
        Where going back began, ENU metres, shape ``(2,)``.
    box
        Round the thing, as it stood when the hand went there.
    """

    def __init__(self, body: ArmBody, *, period: float) -> None:
        self.body, self.period = body, period
        self.work, self.stage = Work.NOTHING, Stage.IDLE
        self.held: Held | None = None
        self.outcome = self.why = ""
        self.forces = 0.0
        self.drive = Drive(period=period)
        self.entity = 0
        self.target = np.zeros(3)
        self.beside: Array | None = None
        self.servos = np.concatenate([body.rest, [0.0, 0.0]])
        self.angles = body.rest.copy()
        self.knows = False
        self.timer = self.stuck = 0.0
        self.tries = 0
        self.skip: set[int] = set()
        self.reach: Reach | None = None
        self.way: Array | None = None
        self.point = 0
        self.start = np.zeros(2)
        self.box: ThingBox | None = None

    # What it feels, and is after.

    def by_oracle(self, observation: Mapping[str, Any]) -> bool:
        """Return whether it is told that it holds the thing, as it is with oracle grasp."""
        return self.entity != 0 and self.entity in observation.get("state", {}).get("held", ())

    def grips(self, observation: Mapping[str, Any], angles: Array) -> bool:
        """Return whether both fingers feel something between them, or an oracle says that they hold the thing."""
        if self.by_oracle(observation):
            return True
        return float(angles[7:].min()) >= _APART and float(np.min(observation["sensors"]["contacts"])) >= FELT

    def aim(self, stance: Stance) -> Array:
        """Return what the base turns to and the arm reaches for, ENU metres."""
        if self.work is not Work.OFFER:
            return self.target
        return held_out_at(self.target, stance)

    def follow(self, angles: Array) -> bool:
        """Bring the servos on along the way; return whether the arm is at its end."""
        way = self.way
        assert way is not None
        most = self.body.fastest[:7] * self.period * (_SPEED if self.held is None else _LADEN)
        self.point = go_along(way, self.point, self.servos[:7], most)
        return self.point >= len(way) and float(np.abs(way[-1] - angles[:7]).max()) < _THERE

    def fingers(self, goal: float) -> bool:
        """Bring the fingers' servos towards a way off the middle; return whether they are told to be there."""
        most = self.body.fastest[7:] * self.period
        self.servos[7:] += np.clip(goal - self.servos[7:], -most, most)
        return bool(np.abs(self.servos[7:] - goal).max() < 1e-9)

    def hold(self, forward: float = 0.0, turn: float = 0.0) -> Action:
        """Return the action that leaves the servos as they are told, with speeds of the base, m/s and rad/s."""
        return {"type": "control", "vector": [*self.servos.tolist(), forward, turn]}

    def begin_way(self, way: Array, stage: Stage) -> None:
        """Enter a stage in which the arm goes a way."""
        self.enter(stage)
        self.way, self.point = way, 0

    def enter(self, stage: Stage) -> None:
        """Enter a stage, with no way yet."""
        self.stage, self.timer, self.way, self.stuck = stage, 0.0, None, 0.0

    def retry(self, why: str) -> Action:
        """Try once more from another standoff, or give up."""
        self.tries += 1
        self.why = why
        if self.tries >= len(STANDOFFS):
            return self.fail(why)
        self.enter(Stage.ALIGN)
        return self.hold()

    def fail(self, why: str) -> Action:
        """End the work: it failed."""
        self.outcome, self.why = "failed", why
        self.work = Work.NOTHING
        self.enter(Stage.IDLE)
        return self.hold()

    def finish(self) -> Action:
        """End the work: it is done."""
        self.outcome, self.why = str(self.work), ""
        self.work = Work.NOTHING
        self.enter(Stage.IDLE)
        return self.hold()

    # Saved and restored.

    def state(self) -> AgentState:
        """Return all it remembers."""
        held, reach = self.held, self.reach
        return {
            "work": str(self.work),
            "stage": str(self.stage),
            "held": None if held is None else {**held._asdict()},
            "outcome": [self.outcome, self.why],
            "entity": self.entity,
            "target": self.target.copy(),
            "beside": None if self.beside is None else self.beside.copy(),
            "set": self.servos.copy(),
            "angles": self.angles.copy(),
            "knows": self.knows,
            "numbers": [self.timer, self.stuck, self.forces],
            "tries": self.tries,
            "skip": sorted(self.skip),
            "reach": None if reach is None else {**reach._asdict()},
            "way": None if self.way is None else self.way.copy(),
            "point": self.point,
            "from": self.start.copy(),
            "drive": self.drive.state(),
            "box": None if self.box is None else {**self.box._asdict()},
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self.work, self.stage = Work(state["work"]), Stage(state["stage"])
        self.held = None if state["held"] is None else Held(**state["held"])
        self.outcome, self.why = state["outcome"]
        self.entity, self.tries, self.point = int(state["entity"]), int(state["tries"]), int(state["point"])
        self.target, self.servos = np.array(state["target"]), np.array(state["set"])
        self.beside = None if state["beside"] is None else np.array(state["beside"])
        self.angles = np.array(state["angles"])
        self.knows = bool(state["knows"])
        self.timer, self.stuck, self.forces = (float(value) for value in state["numbers"])
        self.skip = set(state["skip"])
        self.drive.restore(state["drive"])
        self.reach = None if state["reach"] is None else Reach(**state["reach"])
        self.way = None if state["way"] is None else np.array(state["way"])
        self.start = np.array(state["from"])
        self.box = None if state["box"] is None else ThingBox(**state["box"])
