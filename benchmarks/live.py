"""What a viewer beside a run costs: the same steps without the server, with it, and with browsers' streams.

    python benchmarks/live.py WORLD COMMUNITY [-n 3] [--steps 120] [--table benchmarks/results/live.md]

With the community's residents, 30 cars, 30 pedestrians and a Husky, recorded, nobody's views rendered, as fast as it
goes. Each way is run n times in turn, each in a process of its own. Measured are processor seconds of the whole
process, simulation and server together, for a step: more than the time by which the run gets slower, for what the
server does while the simulation's own threads wait costs the run nothing. The streams are read by another process, ten
frames a second each. What a frame weighs and what encoding it takes are measured on the last state.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from reporting import machine, publish, row

from vico.agents.schedule import followers_of
from vico.community import read_community
from vico.runner.control import Control
from vico.runner.faults import FaultLog
from vico.runner.gather import Gatherer
from vico.runner.loop import Hook, Runner, Step
from vico.runner.recording import RecordedRun
from vico.sim.config import SimConfig
from vico.sim.recorder import Recorder
from vico.sim.simulation import Simulation
from vico.viewer.live import LiveViewer
from vico.world.folder import read_world
from vico.world.public import PublicMap

#: Ways to run it: whether the server is there, and how many streams read it.
WAYS = {"no viewer": (False, 0), "server, nobody there": (True, 0), "one viewer": (True, 1), "ten viewers": (True, 10)}
_WARM = 20

READER = """
import asyncio, json, sys, websockets
place, token, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
async def read():
    async with websockets.connect(place, additional_headers={"Authorization": "Bearer " + token}, max_size=None) as one:
        await one.send(json.dumps({"type": "follow", "rate": 10}))
        async for message in one:
            pass
async def main():
    await asyncio.gather(*(read() for _ in range(count)), return_exceptions=True)
asyncio.run(main())
"""


class Watch(Hook):
    """Notes the processor time from a step on."""

    def __init__(self) -> None:
        self.began = self.wall = 0.0

    def stepped(self, step: Step) -> None:
        """Begin when everything is warm."""
        if step.number == _WARM:
            self.began, self.wall = time.process_time(), time.perf_counter()


def measured(world: Path, community: Path, way: str, steps: int) -> dict[str, float]:
    """Run it one way; return processor and wall-clock milliseconds a step, and what frames weigh."""
    served, streams = WAYS[way]
    place, watch = read_world(world), Watch()
    people = read_community(community, place)
    config = SimConfig(cars=30, pedestrians=30, robots=("husky",), errands=True, observe=())
    sim = Simulation(place, people, config, defer_pictures=True)
    followers = followers_of(people, PublicMap.from_world(place), seed=0)
    agents, faults = Gatherer(followers, trusted=followers), FaultLog()
    found: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        out = Path(folder) / "run"
        recorder = stack.enter_context(Recorder(out, sim, sources={"world": str(world)}, wanted=steps))
        hooks: list[Hook] = [RecordedRun(recorder, faults), watch]
        control = Control(out)
        if served:
            viewer = stack.enter_context(LiveViewer(control, place))
            viewer.show(recorder, agents)
            hooks.insert(1, viewer)
        if streams:
            base, _, token = viewer.url.partition("/?token=")
            place_of = base.replace("http:", "ws:") + "/stream"
            reader = subprocess.Popen([sys.executable, "-c", READER, place_of, token, str(streams)])
            stack.callback(reader.kill)
        director = control if served else None
        Runner(sim, agents, hooks=hooks, faults=faults, director=director).run(steps + _WARM)
        found["cpu_ms"] = (time.process_time() - watch.began) * 1000.0 / steps
        found["wall_ms"] = (time.perf_counter() - watch.wall) * 1000.0 / steps
        if served:
            source, began = viewer.source, time.process_time()
            for _ in range(20):
                content = next(source.frames(source.last, source.last)).encoded()
            found["encode_ms"], found["bytes"] = (time.process_time() - began) * 50.0, float(len(content))
    return found


def main() -> int:
    """Measure and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("community", type=Path)
    parser.add_argument("-n", type=int, default=3)
    parser.add_argument("--steps", type=int, default=120)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--one", choices=list(WAYS), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        print(json.dumps(measured(arguments.world, arguments.community, arguments.one, arguments.steps)))
        return 0
    about, runs = machine(), {way: list[dict[str, float]]() for way in WAYS}
    for _ in range(arguments.n):
        for way in WAYS:
            words = [sys.executable, __file__, str(arguments.world), str(arguments.community), "--one", way]
            done = subprocess.run([*words, "--steps", str(arguments.steps)], capture_output=True, text=True, check=True)
            runs[way].append(json.loads(done.stdout.splitlines()[-1]))
    middle = {way: statistics.median(run["cpu_ms"] for run in found) for way, found in runs.items()}
    more = {way: 100.0 * (value / middle["no viewer"] - 1.0) for way, value in middle.items()}
    last = runs["one viewer"][-1]
    publish(
        [
            "# A viewer beside a run",
            "",
            about,
            "",
            f"{arguments.steps} steps after {_WARM} to warm up; see `benchmarks/live.py` for what is measured.",
            "",
            "| processor time, ms a step | median | least | greatest | n |",
            "|---|---|---|---|---|",
            *(row(way, [run["cpu_ms"] for run in found], 1) for way, found in runs.items()),
            "",
            f"More than without a viewer: {', '.join(f'{way} {more[way]:+.1f} %' for way in WAYS if more[way])}. "
            f"A frame has {last['bytes'] / 1000:.1f} kB and takes {last['encode_ms']:.2f} ms to make.",
        ],
        arguments.table,
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
