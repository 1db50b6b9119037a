"""Our traffic beside SUMO's: the same network, the same trips, flow, speed, queues and delay at junctions.

    python benchmarks/sumo.py WORLD [--cars 100 200] [--seconds 900] [--seed 1] [--table benchmarks/results/sumo.md]

For each junction rule our cars drive about for a while; every trip is noted: when and where it begins, over which
streets it leads. SUMO (of the package `eclipse-sumo`, the extra `worldgen`) then drives the same trips on the world's
`roads.net.xml`, with the same car-following model and parameters, in a process of its own with its own environment. Its
signals are on where ours are obeyed, else off: then its junctions go by right of way.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from defusedxml.ElementTree import parse
from reporting import machine, publish

from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.traffic.car_following import COMFORTABLE_BRAKING, TIME_GAP
from vico.sim.traffic.junctions import JunctionRule
from vico.sim.traffic.state import TOP_SPEED
from vico.world.folder import read_world
from vico.world.lanes import LaneGraph
from vico.world.world import World
from vico.worldgen.streets.netconvert import netconvert_binary

_STANDS = 0.1  # m/s, below which a vehicle counts as standing: SUMO's `halting`
_DT = 0.1  # s


@dataclass
class Trip:
    """What one car drove between coming in and going out."""

    car: int
    begin: float
    lane: str
    offset: float
    speed: float
    streets: list[int]
    end: float | None = None
    lost: float = 0.0


@dataclass
class Figures:
    """What is compared."""

    arrived: int
    speed: float
    standing: float
    lost: float
    passed: int
    running: float
    taken_out: int
    cpu: float
    trips: list[Trip] = field(default_factory=list)


class Notes:
    """Notes the trips of all cars while they drive."""

    def __init__(self, sim: Simulation) -> None:
        traffic = sim.state.traffic
        assert traffic is not None
        self._traffic, self._lanes = traffic, traffic.lanes
        self.time = 0.0
        self.trips: list[Trip] = []
        self._open = [self._begun(v) for v in range(traffic.cars)]
        self._last = traffic.fleet.lane[: traffic.cars].copy()
        self._rounds = self._rounds_now()
        self.speeds: list[float] = []
        self.standing: list[int] = []

    def look(self) -> None:
        """Note where everybody is now."""
        self.time += _DT
        traffic, fleet, lanes = self._traffic, self._traffic.fleet, self._lanes
        cars = traffic.cars
        rounds = self._rounds_now()
        speed = np.asarray(fleet.speed[:cars])
        self.speeds.append(float(speed.mean()))
        self.standing.append(int((speed < _STANDS).sum()))
        wished = np.minimum(lanes.speed[fleet.lane[:cars]], TOP_SPEED) * fleet.speed_factor[:cars]
        lost = np.clip(1.0 - speed / wished, 0.0, 1.0) * _DT
        for v in range(cars):
            trip = self._open[v]
            if rounds[v] != self._rounds[v]:
                trip.end = self.time
                self._open[v] = self._begun(v)
            else:
                trip.lost += float(lost[v])
                if fleet.lane[v] != self._last[v]:
                    self._note_streets(v, trip)
            self._last[v] = fleet.lane[v]
        self._rounds = rounds

    def _rounds_now(self) -> np.ndarray:
        fleet, cars = self._traffic.fleet, self._traffic.cars
        return np.asarray(fleet.laps[:cars] + fleet.teleports[:cars]).copy()

    def _begun(self, v: int) -> Trip:
        fleet, lanes = self._traffic.fleet, self._lanes
        lane = int(fleet.lane[v])
        start = float(fleet.offset[v]), float(fleet.speed[v])
        trip = Trip(v, self.time, lanes.ids[lane], *start, [int(lanes.edge[lane])])
        self.trips.append(trip)
        return trip

    def _note_streets(self, v: int, trip: Trip) -> None:
        """Add the streets a car has come to since it was looked at, short ones that it drove over in a step too."""
        lanes, fleet = self._lanes, self._traffic.fleet
        path = [int(fleet.lane[v])]
        for lane in fleet.previous_lanes[v].tolist():
            if lane < 0 or lane == self._last[v]:
                break
            path.append(int(lane))
        for lane in reversed(path):
            if lanes.inside[lane] < 0 and lanes.edge[lane] != trip.streets[-1]:
                trip.streets.append(int(lanes.edge[lane]))

    def finish(self) -> None:
        """Lead the trips under way on to the next way out, so that SUMO's cars do not vanish where ours were last."""
        ways = _ways_out(self._lanes)
        for v, trip in enumerate(self._open):
            lane = int(self._traffic.fleet.lane[v])
            while ways[lane] >= 0:
                lane = int(ways[lane])
                if self._lanes.inside[lane] < 0 and self._lanes.edge[lane] != trip.streets[-1]:
                    trip.streets.append(int(self._lanes.edge[lane]))


def _ways_out(lanes: LaneGraph) -> np.ndarray:
    """Return the lane after each on a shortest way to a lane that leads nowhere; -1 at its end, or without one."""
    after = np.full(len(lanes), -1, np.int64)
    known = {i for i in range(len(lanes)) if not len(lanes.following(i))}
    edge = sorted(known)
    while edge:
        found = []
        for lane in edge:
            for before in lanes.preceding(lane).tolist():
                if before not in known:
                    known.add(before)
                    after[before] = lane
                    found.append(before)
        edge = found
    return after


def ours(world: World, rule: JunctionRule, *, cars: int, seconds: int, seed: int) -> Figures:
    """Let our cars drive about, and note their trips."""
    sim = Simulation(world, None, SimConfig(cars=cars, transit=False, observe=(), seed=seed, junctions=rule.value))
    notes = Notes(sim)
    sim.state.on_substep = notes.look
    sim.step({})  # what is compiled, is by now
    began = time.process_time()
    for _ in range(seconds - 1):
        sim.step({})
    cpu = (time.process_time() - began) / (seconds - 1)
    notes.finish()
    traffic = sim.state.traffic
    assert traffic is not None
    return Figures(
        arrived=sum(trip.end is not None for trip in notes.trips),
        speed=float(np.mean(notes.speeds)),
        standing=float(np.mean(notes.standing)),
        lost=sum(trip.lost for trip in notes.trips if trip.end is not None),
        passed=_passed(notes.trips),
        running=float(cars),
        taken_out=int(traffic.fleet.teleports.sum()),
        cpu=1000.0 * cpu,
        trips=notes.trips,
    )


def _passed(trips: list[Trip]) -> int:
    return sum(len(trip.streets) - 1 for trip in trips if trip.end is not None)


def sumos(world: World, trips: list[Trip], *, seconds: int, signals: bool, seed: int) -> Figures:
    """Let SUMO drive the same trips."""
    lanes = world.lanes
    with tempfile.TemporaryDirectory(prefix="vico-sumo-") as folder:
        work = Path(folder)
        (work / "trips.rou.xml").write_text(_routes(lanes, trips), encoding="utf-8")
        binary = netconvert_binary().with_name("sumo")
        command = [
            str(binary), "--net-file", str(world.file("roads.net.xml").resolve()), "--route-files", "trips.rou.xml",
            "--begin", "0", "--end", str(seconds), "--step-length", str(_DT), "--seed", str(seed),
            "--time-to-teleport", "150", "--tls.all-off", str(not signals).lower(), "--xml-validation", "never",
            "--xml-validation.net", "never", "--no-step-log", "true", "--no-warnings", "true",
            "--ignore-route-errors", "true", "--summary-output", "summary.xml", "--tripinfo-output", "tripinfo.xml",
            "--tripinfo-output.write-unfinished", "true", "--statistic-output", "statistics.xml",
        ]  # fmt: skip
        environment = {"PATH": os.environ.get("PATH", ""), "LC_ALL": "C", "SUMO_HOME": str(binary.parent.parent)}
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(command, cwd=work, env=environment, capture_output=True, text=True, check=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode:
            raise SystemExit(f"sumo: exit status {done.returncode}: {done.stderr.strip()[-500:]}")
        return _figures(work, trips, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, seconds)


def _figures(work: Path, trips: list[Trip], cpu: float, seconds: int) -> Figures:
    steps = [{k: float(v) for k, v in step.attrib.items()} for step in parse(work / "summary.xml").iter("step")]
    infos = [info.attrib for info in parse(work / "tripinfo.xml").iter("tripinfo")]
    arrived = {info["id"] for info in infos if float(info["arrival"]) >= 0.0}
    statistics = parse(work / "statistics.xml").getroot()
    teleports = statistics.find("teleports")
    running = np.array([step["running"] for step in steps])
    speeds = np.array([max(step["meanSpeed"], 0.0) for step in steps])
    return Figures(
        arrived=len(arrived),
        speed=float((speeds * running).sum() / max(running.sum(), 1.0)),
        standing=float(np.mean([step["halting"] for step in steps])),
        lost=sum(float(info["timeLoss"]) + float(info["departDelay"]) for info in infos if info["id"] in arrived),
        passed=sum(len(trip.streets) - 1 for k, trip in enumerate(trips) if f"t{k}" in arrived),
        running=float(running.mean()),
        taken_out=int(teleports.get("total", 0)) if teleports is not None else 0,
        cpu=1000.0 * cpu / seconds,
    )


def _routes(lanes: LaneGraph, trips: list[Trip]) -> str:
    rows = [
        "<routes>",
        f'<vType id="car" carFollowModel="IDM" accel="1.6" decel="{COMFORTABLE_BRAKING}" emergencyDecel="8" '
        f'tau="{TIME_GAP}" minGap="1.8" length="4.6" maxSpeed="{TOP_SPEED}" speedFactor="0.95" speedDev="0"/>',
    ]
    for k, trip in sorted(enumerate(trips), key=lambda pair: pair[1].begin):
        edges = " ".join(lanes.edges[street] for street in trip.streets)
        lane, position = trip.lane, trip.offset
        inside = lane.startswith(":")
        where = "" if inside else f' departLane="{lane.rsplit("_", 1)[1]}" departPos="{position:.1f}"'
        rows.append(
            f'<vehicle id="t{k}" type="car" depart="{trip.begin:.1f}"{where} departSpeed="{"0" if inside else "max"}">'
            f'<route edges="{edges}"/></vehicle>'
        )
    return "\n".join([*rows, "</routes>", ""])


def _row(what: str, one: Figures, seconds: int) -> str:
    lost = one.lost / max(one.passed, 1)
    return (
        f"| {what} | {one.arrived * 3600 / seconds:,.0f} | {one.speed:.2f} | {one.standing:.1f} of {one.running:.0f} "
        f"| {lost:.1f} | {one.taken_out} | {one.cpu:.1f} |"
    )


def main() -> None:
    """Run all cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("--cars", type=int, nargs="+", default=[100, 200])
    parser.add_argument("--seconds", type=int, default=900)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--table", type=Path)
    options: Any = parser.parse_args()
    head = machine()
    world = read_world(options.world)
    lines = [
        "# Our traffic beside SUMO's",
        "",
        f"`python benchmarks/sumo.py {options.world.name} --cars {' '.join(map(str, options.cars))} --seconds "
        f"{options.seconds} --seed {options.seed}`; what the rows mean and why they differ: "
        "[docs/sumo.md](../../docs/sumo.md).",
        "",
        head,
    ]
    for cars in options.cars:
        lines += [
            "",
            f"## {cars} cars",
            "",
            "| | arrived, an hour | mean speed, m/s | standing, of those under way | lost, s a junction passed "
            "| taken out of jams | ms of processor time a second |",
            "|---|---|---|---|---|---|---|",
        ]
        for rule in JunctionRule:
            mine = ours(world, rule, cars=cars, seconds=options.seconds, seed=options.seed)
            lines.append(_row(f"ours, `{rule.value}`", mine, options.seconds))
            run = {"seconds": options.seconds, "seed": options.seed, "signals": rule.has_signals}
            how = "signals" if rule.has_signals else "right of way"
            lines.append(_row(f"SUMO, {how}, the same trips", sumos(world, mine.trips, **run), options.seconds))
            print(lines[-2], lines[-1], sep="\n", flush=True)
    publish(lines, options.table)


if __name__ == "__main__":
    main()
