"""Feet over the kerbs and on the stairs of a world: how far soles are off the ground, and slide.

    python benchmarks/kerb_steps.py WORLD [--crossings 24] [--table benchmarks/results/kerb_steps.md]

Straight walks of 5 m across one kerb of at least 7 cm each, at places drawn with a seed, at fifty frames a second, by
people of 6, 30 and 80 years. *Float* is how far the lower foot is above the ground at worst, *sunk* how far a sole is
below it; both on the world's own ground, kerb edges included. A *drop* is how far hips come down within 0.2 s. Stairs:
up and down one flight of the world's first stairs room, from half a metre before it to half a metre behind; half a
metre a second, as the simulation has it. Flights outdoors are taken likewise, where their treads are not so deep that
one walks on them as on the ground.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from motion import PEOPLE, Footwork, of_feet
from numpy.typing import NDArray
from reporting import machine, publish

from vico.api import read_world
from vico.assets.people import SkinnedBody, body_of
from vico.rules import STAIRS_SPEED
from vico.seeds import rng
from vico.sim.animation import clip_index, ground_under_feet, pose, stride_length, style_of
from vico.sim.animation.motions import pace_of_step
from vico.world.heights import DEEPEST
from vico.world.model import FLIGHT_STEPS, LANDING
from vico.world.world import World

_LENGTH, _SPEED, _RATE, _KERB = 5.0, 1.2, 50.0, 0.07
_SOON = round(0.2 * _RATE)  # frames
_WHO = ("6 years", "30 years", "80 years")
_TRIES = 200_000
_LEAST_TREADS = 8


def crossings(world: World, count: int) -> list[tuple[NDArray[np.float64], float, float]]:
    """Return walks over one kerb: where each begins, its heading, and how far it steps up, metres."""
    draw, found = rng(1, "kerbs"), []
    along = np.linspace(0.0, _LENGTH, 51)
    for _ in range(_TRIES):
        if len(found) == count:
            break
        start = np.asarray(world.walkable.random_point(draw), np.float64)[:2]
        yaw = float(draw.uniform(-np.pi, np.pi))
        line = start + along[:, None] * np.array([np.cos(yaw), np.sin(yaw)])
        if np.abs(line).max() > world.half - 2.0 or float(world.walkable.clearance_at(line).min()) < 0.3:
            continue
        rises = np.diff(world.height(line))
        k = int(np.argmax(np.abs(rises)))
        rise = float(rises[max(k - 2, 0) : k + 3].sum())
        elsewhere = np.delete(rises, slice(max(k - 2, 0), k + 3))
        if abs(rise) > _KERB and np.abs(elsewhere).max() < 0.02 and 1.5 < along[k] < 3.5:
            found.append((start, yaw, rise))
    return found


def report(world: World, count: int) -> list[str]:
    """Return the table."""
    walks = crossings(world, count)
    lines = ["# Feet over kerbs", "", machine(), "", f"World: {world.manifest.name}, {len(walks)} kerbs.", ""]
    lines += [
        "| who | step | kerbs | skate cm a step, worst | float cm, worst | sunk cm, worst | drop cm, worst |",
        "|---|---|---|---|---|---|---|",
    ]
    for who in _WHO:
        look = PEOPLE[who]
        body = body_of(look)
        one = style_of(body, rng(3, "manner"), age=look.age)
        for name, sign in (("up", 1.0), ("down", -1.0)):
            figures, drops = [], []
            for start, yaw, rise in walks:
                if rise * sign < 0:  # the other way round
                    start, yaw = start + _LENGTH * np.array([np.cos(yaw), np.sin(yaw)]), yaw + np.pi
                frames = int(_LENGTH / _SPEED * _RATE)
                gone = np.arange(frames) / _RATE * _SPEED
                spots = start + gone[:, None] * np.array([np.cos(yaw), np.sin(yaw)])
                position = np.column_stack([spots, world.height(spots)])
                style, clip = np.repeat(one[None], frames), np.full(frames, clip_index("walk"))
                stride = float(stride_length(clip[:1], np.full(1, _SPEED), style["height"][:1])[0])
                course = clip, 0.3 + gone / stride, np.full(frames, _SPEED), style
                under = ground_under_feet(*course, (position, np.full(frames, yaw)), world.height)
                moved = pose(*course, ground=under)
                hips = position[:, 2] + moved[1][:, 2]
                drops.append(100.0 * float((hips[:-_SOON] - hips[_SOON:]).max()))
                steps = 2 * gone[-1] / stride
                figures.append(of_feet(body, *moved, position, world.height, steps=steps, yaw=np.full(frames, yaw)))
            worst = [max(getattr(f, name) for f in figures) for name in ("skate", "above", "sunk")]
            worst.append(max(drops))
            lines.append(f"| {who} | {name} | {len(figures)} | " + " | ".join(f"{value:.2f}" for value in worst) + " |")
    return lines + on_stairs(world) + on_flights(world, count)


def on_stairs(world: World) -> list[str]:
    """Return the table of a flight of stairs."""
    room = next((room for room in world.rooms if room.rise), None)
    if room is None:
        return []
    lines = ["", "| who | stairs | skate cm a step | float cm, worst | sunk cm, worst |", "|---|---|---|---|---|"]
    run = room.size[0] - 2 * LANDING
    for who in _WHO:
        look = PEOPLE[who]
        body = body_of(look)
        one = style_of(body, rng(3, "manner"), age=look.age)
        pace = pace_of_step(run / FLIGHT_STEPS, look.height)
        stride = float(stride_length(clip_index("walk"), pace, look.height))
        for name, sign in (("up", 1.0), ("down", -1.0)):
            frames = int((run + 1.0) / STAIRS_SPEED * _RATE)
            gone = np.arange(frames) / _RATE * STAIRS_SPEED
            along, across = sign * (gone - 0.5 * gone[-1]), -0.25 * room.size[1]
            c, s = np.cos(room.yaw), np.sin(room.yaw)
            spots = np.array(room.centre[:2]) + np.column_stack([c * along - s * across, s * along + c * across])
            yaw = np.full(frames, room.yaw if sign > 0 else room.yaw + np.pi)
            position = np.column_stack([spots, [room.floor_at(x, y) for x, y in spots.tolist()]])
            course = np.full(frames, clip_index("walk")), 0.3 + gone / stride, np.full(frames, pace)
            style = np.repeat(one[None], frames)
            under = ground_under_feet(*course, style, (position, yaw), room.treads_at)
            moved = pose(*course, style, ground=under)
            found = of_feet(body, *moved, position, room.treads_at, steps=2 * gone[-1] / stride, yaw=yaw)
            lines.append(f"| {who} | {name} | {found.skate:.2f} | {found.above:.2f} | {max(found.sunk, 0.0):.2f} |")
    return lines


def flights(world: World) -> list[tuple[NDArray[np.float64], float]]:
    """Return the middles of the treads' edges of each flight outdoors, upwards, and the depth of its treads, metres."""
    stairs = world.height.stairs
    if stairs is None:
        return []
    front = 0.5 * (stairs.corners[:, 0] + stairs.corners[:, 3])
    back = 0.5 * (stairs.corners[:, 1] + stairs.corners[:, 2])
    cuts = np.flatnonzero(np.hypot(*(back[:-1] - front[1:]).T) > 0.01) + 1
    parts = np.split(np.arange(len(front)), cuts)
    return [(np.vstack([front[part], back[part[-1:]]]), float(stairs.going[part[0]])) for part in parts]


def on_flights(world: World, count: int) -> list[str]:
    """Return the table of flights outdoors."""
    chosen = [flight for flight in flights(world) if len(flight[0]) > _LEAST_TREADS and flight[1] < DEEPEST][:count]
    if not chosen:
        return []
    lines = ["", f"Flights outdoors: {len(chosen)} of {_LEAST_TREADS} treads or more.", ""]
    lines += ["| who | goes | skate cm a step, worst | float cm, worst | sunk cm, worst |", "|---|---|---|---|---|"]
    for who in _WHO:
        look = PEOPLE[who]
        body = body_of(look)
        one = style_of(body, rng(3, "manner"), age=look.age)
        for name, sign in (("up", 1), ("down", -1)):
            figures = [_climbed(world, body, one, look.height, line[::sign], going) for line, going in chosen]
            worst = [max(0.0, *(getattr(f, kind) for f in figures)) for kind in ("skate", "above", "sunk")]
            lines.append(f"| {who} | {name} | " + " | ".join(f"{value:.2f}" for value in worst) + " |")
    return lines


def _climbed(
    world: World, body: SkinnedBody, one: Any, height: float, line: NDArray[np.float64], going: float
) -> Footwork:
    """Return what somebody's feet do along a flight, a tread a step."""
    pace = pace_of_step(going, height)
    stride = float(stride_length(clip_index("walk"), pace, height))
    gone = np.arange(0.0, _along(line)[-1], STAIRS_SPEED / _RATE)
    spots = np.column_stack([np.interp(gone, _along(line), line[:, k]) for k in (0, 1)])
    yaw = np.arctan2(*np.gradient(spots, axis=0).T[::-1])
    position = np.column_stack([spots, world.height(spots)])
    course = np.full(len(gone), clip_index("walk")), 0.3 + gone / stride, np.full(len(gone), pace)
    style = np.repeat(one[None], len(gone))

    def footing(points: NDArray[np.float64]) -> NDArray[np.float64]:
        level = world.height(points[..., :2])
        return world.height.footing(np.concatenate([points[..., :2], level[..., None]], axis=-1))

    moved = pose(*course, style, ground=ground_under_feet(*course, style, (position, yaw), world.height.footing))
    return of_feet(body, *moved, position, footing, steps=2 * gone[-1] / stride, yaw=yaw)


def _along(line: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("world", type=Path)
    parser.add_argument("--crossings", type=int, default=24)
    parser.add_argument("--table", type=Path)
    options = parser.parse_args()
    publish(report(read_world(options.world), options.crossings), options.table)
