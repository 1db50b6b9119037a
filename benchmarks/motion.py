"""How well people's feet keep to the ground, and how smoothly one motion becomes another.

    PYTHONPATH=tests python benchmarks/motion.py [--table benchmarks/results/motion.md]

People of 6, 30 and 80 years, slim and heavy, walk and run as the simulation moves them: their phase goes on with the
metres they cover. Fifty frames a second are skinned; a foot bears weight while a point of its sole is within 4 mm of
the ground. *Skate* is the way that the lowest point of such a foot goes over the ground, centimetres a step;
*float* how far the lower foot is above the ground at worst (walking only: who runs flies), *sunk* how far
the sole's lowest point is below it. Transitions: an avatar of the simulation, advanced in fiftieths of a second; the
largest turn of a joint between two frames, beside the largest within the two motions themselves.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from reporting import machine, publish

import toy_city
from vico.assets.motions.clip import rotation_matrices
from vico.assets.people import Appearance, J, SkinnedBody, body_of
from vico.render.skinning import batch_bodies, skin
from vico.seeds import rng
from vico.sim.animation import Transition, clip_index, ground_under_feet, pose, stride_length, style_of
from vico.sim.bodies.footprints import BODY
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation

RATE = 50.0
BEARS = 0.004
SPEEDS = (0.4, 0.8, 1.0, 1.3, 1.6)
SLOPES = (-0.10, -0.05, 0.0, 0.05, 0.10)
PEOPLE = {
    "6 years": Appearance(age=6, height=1.16),
    "30 years": Appearance(age=30, height=1.75),
    "30, slim": Appearance(age=30, height=1.83, build=0.05),
    "30, heavy": Appearance(age=30, height=1.66, build=0.95),
    "80 years": Appearance(age=80, height=1.62),
}
Ground = Callable[[NDArray[np.float64]], NDArray[np.float64]]


class Footwork(NamedTuple):
    """Skate in centimetres a step, float and penetration in centimetres at worst."""

    skate: float
    above: float
    sunk: float


def plane(slope: float) -> Ground:
    """Return ground that rises along x."""
    return lambda points: slope * points[..., 0]


def footwork(look: Appearance, clip: str, speed: float, ground: Ground) -> Footwork:
    """Measure two cycles of somebody's gait."""
    body = body_of(look)
    style = style_of(body, rng(3, "manner"), age=look.age)
    stride = float(stride_length(clip_index(clip), speed, body.height))
    frames = round(2 * stride / speed * RATE)
    x = np.arange(frames) * speed / RATE
    number = np.full(frames, clip_index(clip))
    spots = np.column_stack([x, np.zeros(frames), ground(np.column_stack([x, np.zeros(frames)]))])
    moves = number, x / stride % 1.0, np.full(frames, speed), np.repeat(style[None], frames)
    under = ground_under_feet(*moves, (spots, np.zeros(frames)), ground)
    rotations, offsets = pose(*moves, ground=under)
    return of_feet(body, rotations, offsets, spots, ground, steps=4)


def of_feet(
    body: SkinnedBody,
    rotations: Any,
    offsets: Any,
    spots: NDArray[Any],
    ground: Ground,
    *,
    steps: float,
    yaw: Any = None,
) -> Footwork:
    """Return the figures of a motion of one body, a row a frame."""
    frames = len(spots)
    batch = batch_bodies([body] * frames, range(frames))
    vertices = (
        skin(batch, rotations, offsets, spots, np.zeros(frames) if yaw is None else yaw)[0]
        .reshape(frames, -1, 3)
        .astype(np.float64)
    )
    lowest, skate = np.empty((2, frames)), 0.0
    for side, name in enumerate(("left", "right")):
        own = np.isin(body.weight_joints[:, 0], [J[f"{name}_ankle"], J[f"{name}_foot"]])
        sole = vertices[:, own & (body.vertices[:, 2] < 0.05 * body.height)]
        above = sole[:, :, 2] - ground(sole[:, :, :2])
        lowest[side] = above.min(axis=1)
        for k in range(frames - 1):
            bears = (above[k] < BEARS) & (above[k + 1] < BEARS)
            if bears.any():
                # The point that a foot rolls over rests: all others that touch are about to come or to go.
                at = np.flatnonzero(bears)
                at = at[(above[k] + above[k + 1])[at].argmin()]
                skate += float(np.linalg.norm(sole[k + 1, at, :2] - sole[k, at, :2]))
    return Footwork(100 * skate / steps, 100 * lowest.min(axis=0).max(), -100 * lowest.min())


def transition(first: dict[str, Any], then: dict[str, Any], look: Appearance) -> tuple[float, float, Footwork]:
    """Return the largest turns of a joint a frame, degrees, around a change and apart from it, and the feet's figures.

    Two seconds of one motion, then one and a half of another; the change is the 0.9 s after it.
    """
    sim = Simulation(toy_city.world(), None, SimConfig(assistants=1, observe=()))
    people, avatars = sim.state.people, sim.state.avatars
    everybody = np.ones(1, np.bool_)
    people.height[0] = body_of(look).height
    sim.scenario.place_agent("assistant_0", (-20.0, -15.0))
    rows: list[tuple[Any, ...]] = []
    for seconds, does in ((2, first), (2, then)):
        for _ in range(seconds):
            avatars.begin(everybody)
            people.posture[0] = does.get("posture", 0)
            people.move_left[0] = people.move_speed[0] = does.get("speed", 0.0)
            people.turn_left[0] = does.get("turn", 0.0)
            people.action_clip[0] = does.get("clip", -1)
            for frame in range(int(RATE)):
                avatars.advance(1 / RATE, np.zeros(0, BODY), share=np.array([1 / (RATE - frame)]))
                before = people.clip_before, people.phase_before, people.pace_before, people.clip_time
                now = people.clip, people.phase, people.pace, *before, people.position, people.yaw
                rows.append(tuple(np.array(values[0]) for values in now))
    *course, position, yaw = (np.array(column) for column in zip(*rows, strict=True))
    body = body_of(look)
    style = np.repeat(style_of(body, rng(3, "manner"), age=look.age)[None], len(yaw))
    height = sim.world.height
    under = [ground_under_feet(*course[k : k + 3], style, (position, yaw), height) for k in (0, 3)]
    frames = [
        pose(
            *(c[k : k + 1] for c in course[:3]),
            style[:1],
            second=k / RATE,
            after=Transition(*(c[k : k + 1] for c in course[3:]), ground=under[1][k : k + 1]),
            ground=under[0][k : k + 1],
        )
        for k in range(len(yaw))
    ]
    rotations, offsets = (np.concatenate(parts) for parts in zip(*frames, strict=True))
    turned = rotation_matrices(rotations)
    between = np.einsum("tjkr,tjkc->tjrc", turned[:-1], turned[1:])
    angle = np.degrees(np.arccos(np.clip((np.trace(between, axis1=2, axis2=3) - 1) / 2, -1, 1))).max(axis=1)
    change = slice(int(2 * RATE) - 1, int(2.9 * RATE))
    rest = np.delete(angle, np.r_[0:50, change])
    some = slice(int(1.9 * RATE), int(3.0 * RATE))
    feet = of_feet(body, rotations[some], offsets[some], position[some], height, steps=1, yaw=yaw[some])
    return float(angle[change].max()), float(rest.max()), feet


CHANGES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "standing, walking": ({}, {"speed": 1.0}),
    "walking, standing": ({"speed": 1.0}, {}),
    "walking, running": ({"speed": 1.0}, {"speed": 2.5}),
    "running, walking": ({"speed": 2.5}, {"speed": 1.0}),
    "running, standing": ({"speed": 2.5}, {}),
    "walking, slower": ({"speed": 1.0}, {"speed": 0.5}),
    "walking, turning round on the spot": ({"speed": 1.0}, {"turn": np.pi / 2}),
    "turning on the spot, walking": ({"turn": np.pi / 2}, {"speed": 1.0}),
    "standing, turning on the spot": ({}, {"turn": -np.pi / 3}),
    "standing, sitting": ({}, {"posture": 1}),
    "sitting, standing": ({"posture": 1}, {}),
    "standing, picking": ({}, {"clip": clip_index("pick")}),
    "picking, walking": ({"clip": clip_index("pick")}, {"speed": 1.0}),
    "talking, walking": ({"clip": clip_index("talk")}, {"speed": 1.0}),
}


def report() -> list[str]:
    """Return the tables."""
    lines = ["# Feet and changes of motion", "", machine(), "", __doc__.split("\n\n")[2].replace("\n", " "), ""]
    lines += ["| who | gait | m/s | slope | skate cm a step | float cm | sunk cm |", "|---|---|---|---|---|---|---|"]
    worst = 0.0
    for who, look in PEOPLE.items():
        for clip, speeds in (("walk", SPEEDS), ("run", (2.5,))):
            for speed in speeds:
                for slope in SLOPES:
                    feet = footwork(look, clip, speed, plane(slope))
                    above = "flies" if clip == "run" else f"{feet.above:.2f}"
                    lines.append(
                        f"| {who} | {clip} | {speed} | {100 * slope:+.0f} % | {feet.skate:.2f} | {above} | "
                        f"{max(feet.sunk, 0.0):.2f} |"
                    )
                    worst = max(worst, feet.skate)
    lines += ["", f"At worst {worst:.2f} cm a step.", ""]
    lines += [
        "| change | who | turn a frame, degrees | else | skate cm | float cm | sunk cm |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, (first, then) in CHANGES.items():
        for who in ("30 years", "6 years"):
            here, rest, feet = transition(first, then, PEOPLE[who])
            lines.append(
                f"| {name} | {who} | {here:.1f} | {rest:.1f} | {feet.skate:.2f} | {feet.above:.2f} | {feet.sunk:.2f} |"
            )
    return lines


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--table", type=Path)
    publish(report(), parser.parse_args().table)
