"""An hour of dense traffic under each junction rule: who was taken out of jams, how many got through, how fast.

    python benchmarks/traffic_hour.py WORLD ... [--rules shared signals] [--cars 200] [--pedestrians 100]
        [--seconds 3600] [--start 08:00] [--seed 1] [--jams] [--table benchmarks/results/traffic_hour.md]

Nobody but the traffic is in the world, and no buses. `--jams` tells who was taken out where, and behind whom, and who
is stuck at the end. Pedestrians are stuck who have not got on by 1 m for 60 s, and do not wait for anything.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from reporting import machine, publish

from vico.clock import seconds_of_day
from vico.sim.bodies.arrays import Bodies
from vico.sim.loop.checks import overlapping
from vico.sim.state.base import SimulationBase
from vico.sim.traffic import JunctionRule, Traffic, TrafficSetup
from vico.sim.traffic.state import RED
from vico.world.folder import read_world

_STANDS = 60.0  # s of standing from which on a car counts as one that gets nowhere
_OVERLAPS_EVERY = 10  # s


@dataclass
class Hour:
    """What is noted every second; entries are moves into a junction."""

    speed: list[float] = field(default_factory=list)
    stood: list[int] = field(default_factory=list)
    stuck: list[int] = field(default_factory=list)  # pedestrians
    overlaps: int = 0
    entries: int = 0
    at_red: int = 0


def drive(traffic: Traffic, start: int, seconds: int) -> Hour:
    """Drive for so many seconds, from a second of the day on."""
    found, inside = Hour(), traffic.lanes.inside
    for k in range(seconds):
        traffic.set_signals(start + k, ())
        shown = traffic.signals_shown()
        signals = traffic.signals.lane if traffic.signals is not None else np.zeros(0, np.int32)
        red = signals[shown.light[: len(signals)] == RED] if shown is not None else signals
        for _ in range(10):
            before = traffic.fleet.lane.copy()
            traffic.advance(0.1, Bodies.none())
            now = traffic.fleet.lane
            entered = now[(before != now) & (inside[before] < 0) & (inside[now] >= 0)]
            found.entries += len(entered)
            found.at_red += int(np.isin(entered, red).sum())
        found.speed.append(float(traffic.fleet.speed.mean()))
        found.stood.append(int((traffic.fleet.stopped_time > _STANDS).sum()))
        found.stuck.append(int((traffic.pedestrian_state.jammed_time > _STANDS).sum()))
        if k % _OVERLAPS_EVERY == 0:
            found.overlaps += len(overlapping(traffic.bodies(), 0.0))
    return found


def _row(world: Path, rule: str, given: argparse.Namespace) -> str:
    base = SimulationBase.of(read_world(world))
    start = seconds_of_day(given.start)
    traffic = Traffic(
        base.streets,
        base.world.height,
        cars=given.cars,
        pedestrians=given.pedestrians,
        seed=given.seed,
        first_entity=1_000,
        setup=TrafficSetup(JunctionRule(rule)),
    )
    hour = drive(traffic, start, given.seconds)
    for jam in traffic.jams.rescued() if given.jams else ():
        print(
            f"  {jam.at:5.0f} s  {jam.position[0]:5.0f} {jam.position[1]:5.0f}  entity {jam.entity} behind {jam.before}"
        )
    for jam in traffic.stuck() if given.jams else ():
        print(f"  at the end {jam.position[0]:5.0f} {jam.position[1]:5.0f}  entity {jam.entity} for {jam.stood:.0f} s")
    red = f"{hour.at_red} of {hour.entries:,}" if JunctionRule(rule).has_signals else ""
    figures = [
        f"{world.name} ({len(traffic.lanes.lights.programs)})",
        f"`{rule}`",
        str(traffic.jams.count),
        f"{traffic.reentered:,}",
        f"{np.mean(hour.speed):.1f}",
        f"{np.mean(hour.stood):.1f}",
        f"{np.mean(hour.stuck):.1f}, {hour.stuck[-1]}",
        red,
        str(hour.overlaps),
    ]
    return f"| {' | '.join(figures)} |"


def main() -> None:
    """Drive each world under each rule."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="+", type=Path)
    parser.add_argument("--rules", nargs="+", default=[rule.value for rule in JunctionRule])
    parser.add_argument("--cars", type=int, default=200)
    parser.add_argument("--pedestrians", type=int, default=100)
    parser.add_argument("--seconds", type=int, default=3600)
    parser.add_argument("--start", default="08:00")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jams", action="store_true")
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    rows = [
        "# An hour of dense traffic",
        "",
        f"{given.cars} cars, {given.pedestrians} pedestrians, no buses, seed {given.seed}, {given.seconds:,} s from "
        f"{given.start}. {machine()}",
        "",
        "| world (programs) | rule | rescued | through | mean speed, m/s | stood > 60 s, mean | pedestrians stuck, "
        "mean, at the end | at red | overlaps |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for world in given.worlds:
        for rule in given.rules:
            rows.append(_row(world, rule, given))
            print(rows[-1], flush=True)
    publish(rows, given.table)


if __name__ == "__main__":
    main()
