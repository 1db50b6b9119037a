"""Counts the motions that differ measurably: clips by age, build, load, pace, slope and manner.

    python benchmarks/motion_variants.py [--table benchmarks/results/motion_variants.md]

A variant is a motion of one kind of person under one set of circumstances. Each is posed at eight moments; it counts
if its joints differ by more than 2 degrees (root mean square over body joints and moments) from those of every
variant counted before it that has the same clip.
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from reporting import machine, publish

from vico.assets.people import Appearance, body_of
from vico.seeds import rng
from vico.sim.animation import CLIPS, clip_index, ground_under_feet, pose, style_of
from vico.sim.animation.clips import is_gait
from vico.sim.animation.motions import RUN

MOMENTS, APART = 8, 2.0  # degrees
BODY_JOINTS = 22
AGES = {"6": 1.16, "14": 1.6, "30": 1.75, "60": 1.7, "85": 1.6}
BUILDS, MANNERS = (0.1, 0.9), 20
WALKS, RUNS, SLOPES = (0.3, 0.6, 0.9, 1.2, 1.5), (1.8, 2.5), (-0.1, 0.0, 0.1)


def people() -> list[Any]:
    """Return styles of people of all ages and builds, several manners each."""
    styles = []
    for (age, height), build in product(AGES.items(), BUILDS):
        body = body_of(Appearance(age=float(age), height=height, build=build), source="procedural")
        styles += [style_of(body, rng(7, "manner", k), age=float(age)) for k in range(MANNERS)]
    return styles


def angles(clip: int, speed: float, slope: float, style: Any) -> NDArray[np.float32]:
    """Return the joint angles of a variant, degrees, shape ``(moments * joints * 3,)``."""
    moves = (
        np.full(MOMENTS, clip),
        np.arange(MOMENTS) / MOMENTS,
        np.full(MOMENTS, speed),
        np.repeat(style[None], MOMENTS),
    )
    place = np.zeros((MOMENTS, 3)), np.zeros(MOMENTS)
    ground = ground_under_feet(*moves, place, lambda points: slope * points[:, 0])
    rotations, _ = pose(*moves, ground=ground)
    return np.degrees(rotations[:, :BODY_JOINTS]).ravel()


def differing(variants: list[NDArray[np.float32]]) -> int:
    """Return how many variants differ from all that were counted before them."""
    kept = np.empty((len(variants), variants[0].size), np.float32)
    count = 0
    for variant in variants:
        if not count or np.sqrt(((kept[:count] - variant) ** 2).mean(axis=1) * 3).min() > APART:
            kept[count], count = variant, count + 1
    return count


def main() -> None:
    """Count, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--table", type=Path)
    arguments = parser.parse_args()
    styles, total, made = people(), 0, 0
    lines = ["# Variants of motions", "", machine(), "", (__doc__ or "").split("\n\n")[2].replace("\n", " "), ""]
    lines += ["| clip | variants made | that differ |", "|---|---|---|"]
    for name in CLIPS:
        clip = clip_index(name)
        speeds = RUNS if clip == RUN else WALKS if is_gait(clip) else (0.0,)
        slopes = SLOPES if is_gait(clip) or name in ("idle", "talk", "wave", "drink", "eat", "stand") else (0.0,)
        variants = [angles(clip, *how) for how in product(speeds, slopes, styles)]
        count = differing(variants)
        total, made = total + count, made + len(variants)
        lines.append(f"| {name} | {len(variants)} | {count} |")
    publish([*lines, f"| all | {made} | {total} |"], arguments.table)


if __name__ == "__main__":
    main()
