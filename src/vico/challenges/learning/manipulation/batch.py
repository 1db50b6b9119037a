"""Copies of a manipulation environment that step together, by MuJoCo's batched stepping."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.challenges.learning.manipulation.observation import PRESSING, Bools, Readings, poses_in
from vico.challenges.learning.manipulation.scene import (
    ACTIONS,
    JAW,
    PHYSICS_STEP,
    SUBSTEPS,
    Array,
    BoxParameters,
    EpisodeDraw,
    ManipulationOptions,
    Scene,
    compile_scene,
    motors_of,
    silence_warnings,
    write_thing,
)
from vico.challenges.learning.manipulation.tasks import NEAR, ManipulationTask
from vico.errors import InputError, SchemaError
from vico.exact import apply_matrix, product
from vico.io.mujoco import mujoco, rollout
from vico.seeds import rng

# Targets this much wider than the jaw when it was fastened to a box let go of it, metres.
_RELEASE_MARGIN = 0.005
_CTRL, _ACTIVE = mujoco.mjtState.mjSTATE_CTRL, mujoco.mjtState.mjSTATE_EQ_ACTIVE
# Numbers of a weld; MuJoCo has room for more.
_WELD = 11
_LIFT = 0.05  # metres that count as having been lifted


class BatchStep(NamedTuple):
    """What came of a step of all copies.

    Attributes
    ----------
    readings
        After it.
    broken
        Copies whose action was no number, or whose motion has broken down, shape ``(n,)``: they stay as they were.
    causes
        Why, by number of the copy.
    """

    readings: Readings
    broken: Bools
    causes: dict[int, str]


class BatchedScene:
    """States of ``n`` copies and what moves them on.

    Every copy has a model of its own, as boxes differ. What a copy does depends on its own state and action alone:
    neither on how many others there are nor on the number of threads.

    Parameters
    ----------
    count, threads
        How many copies, and threads that step them.

    Raises
    ------
    InputError
        If there are no copies or threads.
    """

    def __init__(self, task: ManipulationTask, options: ManipulationOptions, count: int, *, threads: int = 1) -> None:
        if count < 1 or threads < 1:
            raise InputError(f"env: {count} environments on {threads} threads; both have to be 1 or more")
        silence_warnings()
        self.task, self.options = task, options
        self.scene: Scene = compile_scene(options.base)
        model = self.scene.model
        self.models = [model, *(copy.copy(model) for _ in range(count - 1))]
        self._data = [mujoco.MjData(model) for _ in range(min(threads, count))]
        self._rollout = rollout.Rollout(nthread=len(self._data) if len(self._data) > 1 else 0)
        self._spec = int(_CTRL | _ACTIVE)
        size, n = self.scene.state_size, count
        self.state = np.zeros((n, size))
        self._states, self._sensors = np.zeros((n, SUBSTEPS, size)), np.zeros((n, SUBSTEPS, model.nsensordata))
        self._control = np.zeros((n, SUBSTEPS, model.nu + model.neq))
        self._warm = np.zeros((n, model.nv))
        # Jaw's own coupling is on; the weld of an oracle's grasp is not.
        self._control[:, :, model.nu :] = np.array(model.eq_active0, np.float64)
        self._weld = int(model.equality("grasp").id)
        self.targets = np.zeros((n, ACTIONS))
        self.pressure = np.zeros((n, 2))
        self.half, self.start, self.goal = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
        self.mass, self.friction, self.surface = np.zeros(n), np.zeros(n), np.zeros(n)
        self.fastened = np.full(n, np.nan)
        self.steps, self.at_goal = np.zeros(n, np.int64), np.zeros(n, np.int64)
        self.was_lifted = np.zeros(n, bool)
        self.seeds, self.episodes = np.zeros(n, np.int64), np.zeros(n, np.int64)
        self._motors = motors_of(self.scene.controller, options)

    def __len__(self) -> int:
        return len(self.state)

    def close(self) -> None:
        """End the threads."""
        self._rollout.close()

    def begin(self, copies: Iterable[int]) -> None:
        """Start the episode of each copy's seed and number."""
        for k in copies:
            chance = rng(int(self.seeds[k]), "manipulation", self.task.name, int(self.episodes[k]))
            self._put(k, self.task.begin(chance, self.options))

    def _put(self, k: int, episode: EpisodeDraw) -> None:
        """Put a copy to the start of an episode."""
        scene = self.scene
        self._write(k, episode.thing)
        self.start[k], self.goal[k] = episode.position, episode.goal
        positions = np.array(scene.model.qpos0)
        positions[scene.thing : scene.thing + 3] = episode.position
        positions[scene.thing + 3 : scene.thing + 7] = episode.rotation
        positions[scene.joints] = [*episode.arm, episode.opening, episode.opening]
        self.state[k] = 0.0
        self.state[k, 1 : 1 + scene.model.nq] = positions
        self.targets[k] = [*episode.arm, episode.target]
        self.pressure[k] = 0.0
        self.fastened[k] = np.nan
        self.steps[k] = self.at_goal[k] = 0
        self.was_lifted[k] = False

    def _write(self, k: int, thing: BoxParameters) -> None:
        self.half[k], self.mass[k], self.friction[k], self.surface[k] = (
            thing.half, thing.mass, thing.friction, thing.surface,
        )  # fmt: skip
        write_thing(self.models[k], thing)

    def advance(self, actions: Array) -> BatchStep:
        """Move all copies on by a step of control.

        Parameters
        ----------
        actions
            Shares of `ManipulationOptions.joint_step` and `finger_step` that targets are moved by, -1 to 1 (cut off
            beyond), shape ``(n, 8)``: the arm's joints, then the jaw (positive opens it).

        Raises
        ------
        InputError
            If the actions are of another shape.
        """
        actions = np.asarray(actions, np.float64)
        if actions.shape != (len(self), ACTIONS):
            raise InputError(f"env: actions have shape {actions.shape}; it has to be {(len(self), ACTIONS)}")
        refused: Bools = ~np.asarray(np.isfinite(actions).all(axis=1))
        before, state = self.targets.copy(), self.state.copy()
        self.targets = self._motors.move_targets(
            self.targets, self._joints()[0], np.where(refused[:, None], 0.0, actions)
        )
        if self.options.oracle_grasp:
            self._fasten()
        self._step(before)
        broken: Bools = np.logical_or(refused, ~self._is_sound(state))
        causes = {
            int(k): "the action holds NaN or infinity" if refused[k] else "the motion broke down"
            for k in np.nonzero(broken)[0]
        }
        self.state[broken], self.targets[broken] = state[broken], before[broken]
        self.steps += 1
        return BatchStep(self._count_steps(), broken, causes)

    def _step(self, before: Array) -> None:
        """Have MuJoCo move everything on, while the servos' targets go from where they were to where they are."""
        shares = (np.arange(SUBSTEPS) + 1.0) / SUBSTEPS
        path = before[:, None] + shares[None, :, None] * (self.targets - before)[:, None]
        self._control[:, :, :ACTIONS] = path
        self._control[:, :, ACTIONS] = path[:, :, JAW]  # the other finger
        # Nothing is kept of what the solver found last: what a copy does depends on its state alone.
        self._rollout.rollout(
            self.models, self._data, self.state, self._control, control_spec=self._spec, skip_checks=True,
            nstep=SUBSTEPS, initial_warmstart=self._warm, state=self._states, sensordata=self._sensors,
        )  # fmt: skip
        self.state = self._states[:, -1].copy()
        forces = self._sensors[:, -1].reshape(len(self), 2, 3)
        self.pressure = np.linalg.norm(forces, axis=2)

    def _is_sound(self, before: Array) -> Bools:
        """Return which copies moved on: MuJoCo starts one whose motion breaks down anew, or stops it."""
        passed = np.abs(self.state[:, 0] - before[:, 0] - SUBSTEPS * PHYSICS_STEP) < 1e-6
        return np.asarray(passed & np.isfinite(self.state).all(axis=1) & np.isfinite(self.pressure).all(axis=1))

    def _fasten(self) -> None:
        """Fasten boxes that both pads press on to closing hands, and let go of those whose jaw is opened."""
        jaw, closing = self._joints()[0][:, JAW], self.targets[:, JAW]
        holds = ~np.isnan(self.fastened)
        lets_go = holds & (closing > np.where(holds, self.fastened, 0.0) + _RELEASE_MARGIN)
        self.fastened[lets_go] = np.nan
        takes = ~holds & (self.pressure > PRESSING).all(axis=1) & (closing < jaw)
        for k in np.nonzero(takes)[0].tolist():
            self.fastened[k] = jaw[k]
            self.models[k].eq_data[self._weld, :_WELD] = self._weld_data(k)
        self._activate()

    def _activate(self) -> None:
        self._control[:, :, self.scene.model.nu + self._weld] = ~np.isnan(self.fastened)[:, None]

    def _weld_data(self, k: int) -> Array:
        """Return MuJoCo's numbers of a weld that keeps a box where it is in the hand."""
        _, hand, thing = poses_in(self.scene, self.state[k : k + 1])
        rotation = hand.rotation[0]
        joint = hand.position[0] - rotation[:, 2] * self.scene.chain.grip
        turn = np.zeros(4)
        mujoco.mju_mat2Quat(turn, product(rotation.T, thing.rotation[0]).ravel())
        # Anchor in the box's frame, place in the hand's, rotation, how much torque counts beside force.
        return np.concatenate([np.zeros(3), apply_matrix(thing.position[0] - joint, rotation.T), turn, [1.0]])

    def _joints(self) -> tuple[Array, Array]:
        """Return positions and speeds of the arm's joints and the jaw, shape ``(n, 8)`` each."""
        scene = self.scene
        positions = self.state[:, 1 : 1 + scene.model.nq][:, scene.joints]
        rates = self.state[:, 1 + scene.model.nq :][:, scene.joint_rates]
        both = [np.column_stack([part[:, :7], part[:, 7:9].mean(axis=1)]) for part in (positions, rates)]
        return both[0], both[1]

    def _count_steps(self) -> Readings:
        """Return readings after a step, with what is counted over steps moved on."""
        r = self.readings()
        self.at_goal = np.where(r.goal_distance < NEAR, self.at_goal + 1, 0)
        self.was_lifted = self.was_lifted | (r.is_gripped & (r.clearance > _LIFT))
        return r._replace(at_goal=self.at_goal.copy(), was_lifted=self.was_lifted.copy())

    def readings(self) -> Readings:
        """Return what all copies look like now."""
        scene = self.scene
        base, hand, thing = poses_in(scene, self.state)
        joints, rates = self._joints()
        first = 1 + scene.model.nq + scene.thing_rate
        speeds = [np.linalg.norm(self.state[:, first + a : first + a + 3], axis=1) for a in (0, 3)]
        return Readings(
            joints=joints,
            joint_rates=rates,
            base=base.position,
            base_rotation=base.rotation,
            hand=hand.position,
            hand_rotation=hand.rotation,
            thing=thing.position.copy(),
            thing_rotation=thing.rotation,
            thing_speed=np.column_stack(speeds),
            pressure=self.pressure.copy(),
            targets=self.targets.copy(),
            half=self.half.copy(),
            surface=self.surface.copy(),
            start=self.start.copy(),
            goal=self.goal.copy(),
            at_goal=self.at_goal.copy(),
            was_lifted=self.was_lifted.copy(),
        )

    def snapshot(self) -> dict[str, NDArray[Any]]:
        """Return everything that changes, as arrays whose first axis is the copies."""
        found = {name: getattr(self, name).copy() for name in _SAVED}
        return {**found, "weld": np.array([model.eq_data[self._weld, :_WELD] for model in self.models])}

    def restore(self, saved: Mapping[str, NDArray[Any]]) -> None:
        """Go back to a snapshot of as many copies of the same kind.

        Raises
        ------
        SchemaError
            If it is of another kind.
        """
        mine = {**{name: getattr(self, name) for name in _SAVED}, "weld": np.zeros((len(self), _WELD))}
        for name, value in mine.items():
            if name not in saved or np.shape(saved[name]) != value.shape:
                has = f"has shape {np.shape(saved[name])}" if name in saved else "is missing"
                raise SchemaError(f"env: {name} of the saved state {has}, not {value.shape}; save one of this kind")
        for name in _SAVED:
            setattr(self, name, np.array(saved[name], dtype=mine[name].dtype))
        for k, model in enumerate(self.models):
            mass, friction, surface = float(self.mass[k]), float(self.friction[k]), float(self.surface[k])
            write_thing(model, BoxParameters(self.half[k], mass, friction, surface))
            model.eq_data[self._weld, :_WELD] = saved["weld"][k]
        self._activate()


_SAVED = (
    "state", "targets", "pressure", "half", "mass", "friction", "surface", "start", "goal", "fastened", "steps",
    "at_goal", "was_lifted", "seeds", "episodes",
)  # fmt: skip
