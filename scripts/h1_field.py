"""Where H1 learns to walk: many robots on a field, what their steps are worth, pushes and commands.

See `train_h1.py`.
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from vico.assets.robots.h1 import JOINTS, REST, STAND, STRIDE, h1_mjcf, limit_of
from vico.io.compiled import compiled
from vico.sim.physics.mujoco_model import FRICTION, _set_options
from vico.sim.robots.biped import (
    ACTION,
    COMMAND,
    LEG,
    LEGS,
    MEMORY,
    OBSERVED,
    PHASE,
    STEPPING,
    StepSettings,
    advance_clock,
    leg_targets,
    observe,
)
from vico.sim.robots.controller import planar_motion

PERIOD = 0.02
FIELD, CELL = 64.0, 0.5


def terrain(rng: np.random.Generator, level: float) -> NDArray[np.float64]:
    """Heights of a field, metres, on a grid of `CELL`: kerbs everywhere, slopes and bumps in its eastern half."""
    n = round(2 * FIELD / CELL) + 1
    h = np.zeros((n, n))
    # Plateaus of 2 to 6 m: kerbs of half a metre between them.
    for axis in (0, 1):
        at, z = 0, 0.0
        line = np.zeros(n)
        while at < n:
            width = int(rng.integers(4, 13))
            z = 0.0 if z > 0 or rng.random() < 0.3 else float(rng.uniform(0.03, 0.15))
            line[at : at + width] = z
            at += width
        h += (line[:, None] if axis == 0 else line[None, :]) * (0.5 if axis else 1.0)
    y, x = np.meshgrid(np.arange(n) * CELL, np.arange(n) * CELL)
    rough = 0.25 * np.sin(2 * np.pi * x / 16) * np.sin(2 * np.pi * y / 21) + rng.uniform(-0.012, 0.012, h.shape)
    return level * (h + np.where(x > FIELD, rough, 0.0))


def training_model(heights: NDArray[np.float64] | None, grip: float, fine: bool, extra: float) -> Any:
    """Compile H1 on a field (None: level) with the options of a run."""
    spec = mujoco.MjSpec.from_string(h1_mjcf())
    _set_options(spec)
    spec.option.enableflags = 0
    spec.option.timestep, spec.option.impratio = (0.005, FRICTION[0.01]) if fine else (1 / 150, FRICTION[0.02])
    bits = {"contype": 1, "conaffinity": 5}
    if heights is None:
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[FIELD, FIELD, 1], **bits)
    else:
        low, high = float(heights.min()), float(heights.max())
        spec.add_hfield(
            name="ground",
            size=[FIELD, FIELD, high - low, 5.0],
            nrow=len(heights),
            ncol=len(heights),
            userdata=((heights - low) / (high - low)).astype(np.float32).ravel().tolist(),
        )
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="ground", pos=[0, 0, low], **bits)
    model = spec.compile()
    feet = model.geom_priority > 0
    model.geom_friction[feet, 0] *= grip
    base = model.body("base").id
    model.body_mass[base] += extra
    return model


@compiled
def ground_at(heights, x, y):  # type: ignore[no-untyped-def]
    """Height of the field; rows go along y."""
    n = len(heights)
    fx, fy = (x + FIELD) / CELL, (y + FIELD) / CELL
    i, j = min(max(int(fx), 0), n - 2), min(max(int(fy), 0), n - 2)
    a, b = fx - i, fy - j
    return (1 - b) * ((1 - a) * heights[j, i] + a * heights[j, i + 1]) + b * (
        (1 - a) * heights[j + 1, i] + a * heights[j + 1, i + 1]
    )


@compiled
def sole(angles, side):  # type: ignore[no-untyped-def]
    """Return heel and toe of a sole in the frame of the base, shape ``(2, 3)``; `side` is 1 on the left."""
    out = np.empty((2, 3))
    cy, sy = math.cos(angles[0]), math.sin(angles[0])
    cr, sr = math.cos(angles[1]), math.sin(angles[1])
    a, b, c = angles[2], angles[2] + angles[3], angles[2] + angles[3] + angles[4]
    for k in range(2):
        fx = -0.045 if k == 0 else 0.155
        fz = -0.07
        px = -0.4 * math.sin(a) - 0.4 * math.sin(b) + fx * math.cos(c) + fz * math.sin(c)
        pz = -0.4 * math.cos(a) - 0.4 * math.cos(b) - fx * math.sin(c) + fz * math.cos(c)
        py = side * 0.11536
        y, z = cr * py - sr * pz, sr * py + cr * pz
        x = 0.039468 + px
        out[k, 0], out[k, 1], out[k, 2] = cy * x - sy * y, sy * x + cy * y + side * 0.0875, z - 0.1742
    return out


@compiled
def rotation_of(q, out):  # type: ignore[no-untyped-def]
    """Write the matrix of a unit quaternion."""
    w, x, y, z = q
    out[0, 0], out[0, 1], out[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    out[1, 0], out[1, 1], out[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    out[2, 0], out[2, 1], out[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


TERMS = ("velocity", "turn", "upright", "contact", "swing", "height", "smooth", "pose", "slip", "width")


@compiled
def judge(heights, state, memory, soles, targets, change, rewards, done):  # type: ignore[no-untyped-def]
    """Write what each robot's last period was worth, by term, and whether it fell (1) or left the field (2).

    Parameters
    ----------
    state
        Poses and motions of the robots as MuJoCo has them.
    soles
        Where the soles' middles were, shape ``(robots, 2, 3)``; updated.
    targets
        Of the joints, now and in the period before, rad.
    change
        Of the network's answer since the period before, squared.
    """
    pose, motion = state
    rotation = np.empty((3, 3))
    for k in range(len(pose)):
        q, v, m, r = pose[k], motion[k], memory[k], rewards[k]
        rotation_of(q[3:7], rotation)
        planar = planar_motion(rotation, v[:3], v[3:6])
        up = rotation[2, 2]
        # Velocity along the heading, whatever the base's pitch.
        norm = math.sqrt(rotation[0, 0] ** 2 + rotation[1, 0] ** 2) + 1e-9
        cx, sx = rotation[0, 0] / norm, rotation[1, 0] / norm
        ex = cx * v[0] + sx * v[1] - m[COMMAND]
        ey = -sx * v[0] + cx * v[1] - m[COMMAND + 1]
        ew = planar[2] - m[COMMAND + 2]
        # Steps sway: what counts is the motion as it is, and smoothed over half a stride.
        smooth = m[MEMORY : MEMORY + 3]
        share = PERIOD / 0.4
        smooth[0] += (ex - smooth[0]) * share
        smooth[1] += (ey - smooth[1]) * share
        smooth[2] += (ew - smooth[2]) * share
        r[0] = 0.6 * math.exp(-(ex * ex + ey * ey) / 0.15) + 0.6 * math.exp(-(smooth[0] ** 2 + smooth[1] ** 2) / 0.02)
        r[0] -= 1.2 * min(math.hypot(smooth[0], smooth[1]), 0.5)
        r[1] = 0.3 * math.exp(-ew * ew / 0.30) + 0.3 * math.exp(-(smooth[2] ** 2) / 0.04) + 0.3
        r[2] = 0.4 * math.exp(-(1.0 - up * up) / 0.03) - 0.05 * (v[3] ** 2 + v[4] ** 2) - 0.4 * v[2] ** 2
        phase = m[PHASE]
        r[3] = r[4] = r[8] = 0.0
        lowest = 1e9
        for side in range(2):
            points = sole(q[7 + LEG * side : 12 + LEG * side], 1.0 - 2.0 * side)
            gap, z = 1e9, 0.0
            world = np.zeros(3)
            for p in range(2):
                x = q[0] + rotation[0, 0] * points[p, 0] + rotation[0, 1] * points[p, 1] + rotation[0, 2] * points[p, 2]
                y = q[1] + rotation[1, 0] * points[p, 0] + rotation[1, 1] * points[p, 1] + rotation[1, 2] * points[p, 2]
                z = q[2] + rotation[2, 0] * points[p, 0] + rotation[2, 1] * points[p, 1] + rotation[2, 2] * points[p, 2]
                gap = min(gap, z - ground_at(heights, x, y))
                lowest = min(lowest, z)
                world[0] += 0.5 * x
                world[1] += 0.5 * y
                world[2] += 0.5 * z
            on_ground = gap < 0.008
            s = 2.0 * (phase - 0.5 * side)
            swings = m[STEPPING] > 0.0 and 0.08 < s < 0.92
            r[3] += 0.15 if on_ground != swings else -0.15
            if swings:
                wanted = 0.09 * math.sin(math.pi * s)
                r[4] -= 20.0 * min(0.0, gap - wanted) ** 2 + 5.0 * max(0.0, gap - wanted - 0.05) ** 2
            way = math.sqrt((world[0] - soles[k, side, 0]) ** 2 + (world[1] - soles[k, side, 1]) ** 2) / PERIOD
            if on_ground:
                r[8] -= 0.15 * min(way, 2.0)
            soles[k, side] = world
        across = -sx * (soles[k, 0, 0] - soles[k, 1, 0]) + cx * (soles[k, 0, 1] - soles[k, 1, 1])
        r[9] = -15.0 * min(0.0, across - 0.22) ** 2 - 4.0 * max(0.0, across - 0.50) ** 2
        r[5] = -6.0 * (q[2] - lowest - 0.99) ** 2
        rate = swing = 0.0
        for j in range(LEGS):
            rate += (targets[k, j] - targets[k, LEGS + j]) ** 2
            swing += v[6 + j] ** 2
        r[6] = -0.9 * rate - 0.0006 * swing - 0.010 * change[k]
        r[7] = -0.5 * (q[7] ** 2 + q[8] ** 2 + q[12] ** 2 + q[13] ** 2)
        if m[STEPPING] == 0.0:
            for j in range(LEGS):
                r[7] -= 0.02 * v[6 + j] ** 2 + 0.6 * (q[7 + j] - REST[j % LEG]) ** 2
            r[7] -= 0.6 * min(math.hypot(v[0], v[1]), 1.0)
        done[k] = 0
        if up < 0.6 or q[2] - lowest < 0.6:
            done[k] = 1
        elif abs(q[0]) > FIELD - 3.0 or abs(q[1]) > FIELD - 3.0:
            done[k] = 2


@compiled
def observe_all(settings, pose, motion, memory, seen):  # type: ignore[no-untyped-def]
    """Let the clocks of all robots go on, and write what they see."""
    rotation = np.empty((3, 3))
    for k in range(len(pose)):
        rotation_of(pose[k, 3:7], rotation)
        planar = planar_motion(rotation, motion[k, :3], motion[k, 3:6])
        tilt = math.acos(min(max(rotation[2, 2], -1.0), 1.0))
        advance_clock(settings, planar, tilt, memory[k])
        joints = (pose[k, 7:], motion[k, 6:])
        moving = (rotation, motion[k, :3], motion[k, 3:6])
        observe(settings, moving, joints, memory[k], seen[k])


@compiled
def act_all(settings, actions, memory, targets):  # type: ignore[no-untyped-def]
    """Write the targets of all robots' joints."""
    for k in range(len(actions)):
        leg_targets(settings, actions[k], memory[k], targets[k])


class Field:
    """Many robots on a field."""

    def __init__(self, count: int, rng: np.random.Generator, level: float, threads: int) -> None:
        self.count, self.rng = count, rng
        self.heights = terrain(rng, level) if level > 0 else np.zeros((3, 3))
        n = round(2 * FIELD / CELL) + 1
        self.sampled = self.heights if level > 0 else np.zeros((n, n))
        given = self.heights if level > 0 else None
        variants = [(1.0, False, 0.0), (0.7, False, 3.0), (0.35, False, 0.0), (1.0, False, -2.0), (0.9, True, 0.0)]
        self.fine = [fine for _, fine, _ in variants]
        models = [training_model(given, grip, fine, extra) for grip, fine, extra in variants]
        self.share = np.arange(count) * len(models) // count
        self.models = [models[k] for k in self.share]
        self.data = [mujoco.MjData(models[0]) for _ in range(max(threads, 1))]
        self.rollout = rollout.Rollout(nthread=threads if threads > 1 else 0)
        m = models[0]
        self.nq, self.nv = m.nq, m.nv
        self.pose, self.motion = np.zeros((count, m.nq)), np.zeros((count, m.nv))
        self.memory = np.zeros((count, MEMORY + 3))  # and the smoothed errors of the velocity
        self.targets, self.before = np.zeros((count, LEGS)), np.zeros((count, LEGS))
        self.soles = np.zeros((count, 2, 3))
        self.age = np.zeros(count, np.int64)
        low, high = (np.array([limit_of(j)[end] for j in JOINTS]) for end in (0, 1))
        self.settings = StepSettings(PERIOD, STRIDE, REST.copy(), low, high)
        self.reset(np.arange(count))
        self.wanted = self.memory[:, COMMAND : COMMAND + 3].copy()
        self.command(np.arange(count))
        self.terms = np.zeros((count, len(TERMS)))
        self.done = np.zeros(count, np.int64)
        self.strength = 0.3

    def reset(self, who: NDArray[np.int64]) -> None:
        """Have some begin anew, somewhere."""
        rng, n = self.rng, len(who)
        self.pose[who] = 0.0
        self.pose[who, :2] = rng.uniform(-FIELD + 15, FIELD - 15, (n, 2))
        self.pose[who, 7:] = np.tile(REST, 2) + rng.uniform(-0.06, 0.06, (n, LEGS))
        # Walking along a kerb is hardest: kerbs run along both axes.
        along = 0.5 * np.pi * rng.integers(0, 4, n) + rng.normal(0.0, 0.12, n)
        yaw = np.where(rng.random(n) < 0.6, along, rng.uniform(-np.pi, np.pi, n))
        self.pose[who, 3], self.pose[who, 6] = np.cos(yaw / 2), np.sin(yaw / 2)
        for k in who:
            near = [
                ground_at(self.sampled, self.pose[k, 0] + dx, self.pose[k, 1] + dy)
                for dx in (-0.25, 0, 0.25)
                for dy in (-0.25, 0, 0.25)
            ]
            self.pose[k, 2] = max(near) + STAND + 0.005
        self.motion[who] = 0.0
        self.motion[who, :6] = rng.normal(0, 0.1, (n, 6))
        self.memory[who] = 0.0
        self.memory[who, PHASE] = rng.integers(0, 2, n) * 0.5
        self.targets[who] = self.pose[who, 7:]
        self.soles[who] = self.pose[who, None, :3]
        self.age[who] = 0

    def command(self, who: NDArray[np.int64]) -> None:
        """Tell some what to do."""
        rng, n = self.rng, len(who)
        kind = rng.random(n)
        vx = rng.uniform(0.2, 1.05, n)
        vy, wz = np.zeros(n), rng.normal(0.0, 0.25, n)
        stand, turn, other = kind < 0.15, (kind > 0.15) & (kind < 0.25), kind > 0.8
        vx[other], vy[other] = rng.uniform(-0.35, 0.8, other.sum()), rng.uniform(-0.25, 0.25, other.sum())
        wz[turn | other] = rng.uniform(-0.9, 0.9, (turn | other).sum())
        vx[stand | turn], wz[stand] = 0.0, 0.0
        np.clip(wz, -0.9, 0.9, out=wz)
        self.wanted[who] = np.stack([vx, vy, wz], axis=1)

    def look(self) -> NDArray[np.float32]:
        """Let clocks and commands go on, and return what everybody sees."""
        change = np.array([2.0, 1.5, 4.0]) * PERIOD
        now = self.memory[:, COMMAND : COMMAND + 3]
        now += np.clip(self.wanted - now, -change, change)
        seen = np.empty((self.count, OBSERVED))
        observe_all(self.settings, self.pose, self.motion, self.memory, seen)
        return seen.astype(np.float32)

    def step(self, actions: NDArray[np.float32]) -> NDArray[np.float64]:
        """Let a period pass, and return what it was worth."""
        self.before[:] = self.targets
        last = self.memory[:, ACTION : ACTION + LEGS].copy()
        act_all(self.settings, actions.astype(np.float64), self.memory, self.targets)
        change = ((self.memory[:, ACTION : ACTION + LEGS] - last) ** 2).sum(axis=1)
        state = np.concatenate([np.zeros((self.count, 1)), self.pose, self.motion], axis=1)
        for fine, steps in ((False, 3), (True, 4)):
            rows = np.flatnonzero([self.fine[k] == fine for k in self.share])
            control = np.repeat(self.targets[rows, None], steps, axis=1)
            found, _ = self.rollout.rollout(
                [self.models[k] for k in rows], self.data, state[rows], control, nstep=steps
            )
            self.pose[rows], self.motion[rows] = found[:, -1, 1 : 1 + self.nq], found[:, -1, 1 + self.nq :]
        bad = ~np.isfinite(self.pose).all(axis=1) | (np.abs(self.motion).max(axis=1) > 200)
        if bad.any():
            self.reset(np.flatnonzero(bad))
        state, targets = (self.pose, self.motion), np.concatenate([self.targets, self.before], axis=1)
        judge(self.sampled, state, self.memory, self.soles, targets, change, self.terms, self.done)
        self.terms[self.age == 0, 8] = 0.0
        self.age += 1
        self.done[bad] = 1
        return self.terms.sum(axis=1)

    def go_on(self) -> None:
        """Begin anew with who fell, tell some something else, push some."""
        gone = np.flatnonzero(self.done)
        if len(gone):
            self.reset(gone)
            self.command(gone)
        other = np.flatnonzero(self.rng.random(self.count) < PERIOD / 4.0)
        if len(other):
            self.command(other)
        pushed = np.flatnonzero(self.rng.random(self.count) < PERIOD / 5.0)
        angle = self.rng.uniform(-np.pi, np.pi, len(pushed))
        size = self.strength * self.rng.uniform(0.2, 1.0, len(pushed))
        self.motion[pushed, 0] += size * np.cos(angle)
        self.motion[pushed, 1] += size * np.sin(angle)
