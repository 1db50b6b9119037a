"""An arm at work, from what its robot sees and feels: picks things up, puts them down, hands them over."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from vico.agents.robot import arm_coming as coming
from vico.agents.robot import arm_grasping as grasping
from vico.agents.robot.arm_job import FELT, TAKES, Action, ArmJob, Array
from vico.agents.robot.body import ArmBody
from vico.agents.robot.held import Held
from vico.agents.robot.stages import Stage, Work
from vico.agents.state import AgentState

# Seconds for each stage, and without a grip after which what was held is lost.
_STALE, _LOST = 20.0, 0.6


class ArmWorker:
    """Does one piece of work after the other; asked as often as its robot acts.

    Ask `act` for actions while it is `busy`; then `outcome` is what came of the work, ``"failed"`` or the value of
    `Work`, and `why` the reason of a failure.

    Parameters
    ----------
    body
        The arm.
    period
        Seconds between two actions.

    Attributes
    ----------
    body, period
        As they were given.
    """

    def __init__(self, body: ArmBody, *, period: float) -> None:
        self.body, self.period = body, period
        self._job = ArmJob(body, period=period)

    # What came of it.

    @property
    def work(self) -> Work:
        """What it is at."""
        return self._job.work

    @property
    def stage(self) -> Stage:
        """How far it is with that."""
        return self._job.stage

    @property
    def held(self) -> Held | None:
        """What is in the jaw, as far as it knows; None for nothing."""
        return self._job.held

    @held.setter
    def held(self, held: Held | None) -> None:
        self._job.held = held

    @property
    def outcome(self) -> str:
        """What came of the last piece of work; "" while it is at one."""
        return self._job.outcome

    @property
    def why(self) -> str:
        """Why the last piece of work failed."""
        return self._job.why

    @property
    def forces(self) -> float:
        """Largest force on the weaker finger since the last grip, newtons."""
        return self._job.forces

    @property
    def tries(self) -> int:
        """How often the last piece of work was begun anew."""
        return self._job.tries

    # What it is told.

    @property
    def busy(self) -> bool:
        """Whether it is at work."""
        return self.work is not Work.NOTHING

    @property
    def wants_picture(self) -> bool:
        """Whether it looks at what is around it the next time."""
        stage = self._job.stage
        looks = stage in (Stage.ALIGN, Stage.LOOK, Stage.INSPECT) or (stage is Stage.CARRY and self._job.way is None)
        return self.busy and looks

    def pick(self, entity: int, position: Array, *, beside: Array | None = None) -> None:
        """Begin to pick a thing up that is about at a position, ENU metres.

        Parameters
        ----------
        beside
            Unit vector from the thing to the side it is to come from, shape ``(2,)``; None for wherever it is.
        """
        self._begin(Work.PICK, position, entity)
        self._job.beside = None if beside is None else np.array(beside, np.float64)

    def place(self, spot: Array, *, beside: Array | None = None) -> None:
        """Begin to put down what is held, with its underside at a spot, ENU metres.

        Parameters
        ----------
        beside
            Unit vector from the spot to the side it is to come from, shape ``(2,)``; None for wherever it is.
        """
        self._begin(Work.PLACE, spot, self._job.entity)
        self._job.beside = None if beside is None else np.array(beside, np.float64)

    def offer(self, person: Array) -> None:
        """Begin to hold out what is held to somebody who stands at a point, ENU metres."""
        self._begin(Work.OFFER, person, self._job.entity)

    def fold(self) -> None:
        """Bring the arm to where things are carried, or to its rest with nothing in it."""
        self._begin(Work.FOLD, self._job.target, self._job.entity)
        self._job.enter(Stage.CARRY)

    def moved(self, servos: Array) -> None:
        """Take in where somebody else has told the servos to be meanwhile, rad and metres, shape ``(9,)``."""
        self._job.servos, self._job.knows = np.array(servos, np.float64), True

    def lost(self, observation: Mapping[str, Any]) -> bool:
        """Return whether a jaw that held something feels it no more; then nothing is held.

        Asked once a period while there is no work for it.
        """
        job = self._job
        feels = job.by_oracle(observation) or float(np.min(observation["sensors"]["contacts"])) >= FELT / 2
        job.stuck = 0.0 if feels or self.busy or job.held is None else job.stuck + self.period
        if job.stuck < _LOST:
            return False
        job.held, job.stuck = None, 0.0
        return True

    def _begin(self, work: Work, target: Array, entity: int) -> None:
        job = self._job
        job.work, job.entity, job.target = work, entity, np.array(target, np.float64)
        job.outcome = job.why = ""
        job.tries, job.skip, job.beside = 0, set(), None
        job.enter(Stage.COME)

    # What it does.

    def act(self, observation: Mapping[str, Any]) -> Action:
        """Return the action for the coming period.

        Parameters
        ----------
        observation
            With ``sensors``; depth and segmentation are looked at where it plans.
        """
        job = self._job
        angles = np.asarray(observation["sensors"]["joint_position"], np.float64)
        if not job.knows:
            job.servos, job.knows = angles.copy(), True
        job.timer += self.period
        job.forces = max(job.forces, float(np.min(observation["sensors"]["contacts"])))
        if job.timer > _STALE + TAKES * (job.work is Work.OFFER) and job.stage is not Stage.COME:
            return job.fail(f"no end of {job.stage}")
        if self.wants_picture and "depth" not in observation:
            return job.hold()  # until there is one
        return _STAGES[job.stage](job, observation, angles)

    # Saved and restored.

    def state(self) -> AgentState:
        """Return all it remembers."""
        return self._job.state()

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._job.restore(state)


def _rest(job: ArmJob, observation: Mapping[str, Any], angles: Array) -> Action:
    return job.hold()


_STAGES: dict[Stage, Callable[[ArmJob, Mapping[str, Any], Array], Action]] = {
    Stage.IDLE: _rest,
    Stage.COME: coming.come,
    Stage.RAISE: coming.raise_held,
    Stage.ALIGN: coming.align,
    Stage.LOOK: grasping.plan,
    Stage.OVER: grasping.over,
    Stage.THERE: grasping.down,
    Stage.GRIP: grasping.grip,
    Stage.AWAY: grasping.away,
    Stage.BACK: coming.back,
    Stage.CARRY: grasping.carry,
    Stage.INSPECT: grasping.inspect,
}


__all__ = ["ArmWorker"]
