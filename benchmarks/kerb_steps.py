"""Feet over the kerbs and on the stairs of a world: how far soles are off the ground, and slide.

    python benchmarks/kerb_steps.py WORLD [--crossings 24] [--table benchmarks/results/kerb_steps.md]

Straight walks of 5 m across one kerb of at least 7 cm each, at places drawn with a seed, at fifty frames a second, by
people of 6, 30 and 80 years. *Float* is how far the lower foot is above the ground at worst, *sunk* how far a sole is
below it; both on the world's own ground, kerb edges included. A *drop* is how far hips come down within 0.2 s. Stairs:
up and down one flight of the world's first stairs room, from half a metre before it to half a metre behind; half a
metre a second, as the simulation has it.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from motion import PEOPLE, of_feet
from numpy.typing import NDArray
from reporting import machine, publish

from vico.api import read_world
from vico.assets.people import body_of
from vico.rules import STAIRS_SPEED
from vico.seeds import rng
from vico.sim.animation import clip_index, ground_under_feet, pose, stride_length, style_of
from vico.sim.animation.stride import pace_of_step
from vico.world.folder import World
from vico.world.model import FLIGHT_STEPS, LANDING

_LENGTH, _SPEED, _RATE, _KERB = 5.0, 1.2, 50.0, 0.07
_SOON = round(0.2 * _RATE)  # frames
_WHO = ("6 years", "30 years", "80 years")
_TRIES = 200_000


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
    return lines + on_stairs(world)


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


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("world", type=Path)
    parser.add_argument("--crossings", type=int, default=24)
    parser.add_argument("--table", type=Path)
    options = parser.parse_args()
    publish(report(read_world(options.world), options.crossings), options.table)
