"""What a viewer beside a run costs: the same run with nobody at its page, with one stream, and with ten.

    python benchmarks/live.py WORLD COMMUNITY [--turns 12] [--steps 40] [--table benchmarks/results/live.md]

With the community's residents, 30 cars, 30 pedestrians and a Husky, recorded, nobody's views rendered, as fast as it
goes. Streams come and go while one run goes on, some steps each, in turns: a machine that is now faster and now slower
is so for all of them, and what counts is the ratio within a turn. They are read by another process, ten frames a second
each. Measured are the seconds by the clock, by which the run gets slower, and processor seconds of the whole process,
simulation and server together. What a frame weighs and what encoding it takes are measured on the last state.
"""

from __future__ import annotations

import argparse
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
from vico.runner.gather import FaultLog, Gatherer
from vico.runner.loop import Hook, Runner, Step
from vico.runner.recording import RecordedRun
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.recording.recorder import Recorder
from vico.viewer.live import LiveViewer
from vico.world.folder import read_world
from vico.world.public import PublicMap

#: How many streams read the run, in turns.
STREAMS = (0, 1, 10)
_WARM, _SETTLED = 40, 5  # steps before the first turn, and in each before it counts

READER = """
import asyncio, json, sys, websockets
place, token = sys.argv[1], sys.argv[2]
async def read():
    async with websockets.connect(place, additional_headers={"Authorization": "Bearer " + token}, max_size=None) as one:
        await one.send(json.dumps({"type": "follow", "rate": 10}))
        async for message in one:
            pass
async def main():
    loop, held = asyncio.get_running_loop(), []
    if len(sys.argv) > 3:
        held = [asyncio.create_task(read()) for _ in range(int(sys.argv[3]))]
        await asyncio.gather(*held, return_exceptions=True)
    while line := await loop.run_in_executor(None, sys.stdin.readline):
        for one in held:
            one.cancel()
        held = [asyncio.create_task(read()) for _ in range(int(line))]
asyncio.run(main())
"""


class Turns(Hook):
    """Asks for more and fewer streams in turns, and notes what steps take then.

    Parameters
    ----------
    steps
        In each part of a turn.
    reader
        What reads the streams; told how many by a line.
    """

    def __init__(self, steps: int, reader: subprocess.Popen[str]) -> None:
        self._steps, self._reader = steps, reader
        self._began = (0.0, 0.0)
        #: Milliseconds a step by the clock and of the processor, by number of streams.
        self.took: dict[int, list[tuple[float, float]]] = {count: [] for count in STREAMS}

    def on_step(self, step: Step) -> None:
        """Note where a part of a turn begins and ends."""
        part, at = divmod(step.number - _WARM, self._steps)
        if part < 0:
            return
        if at == _SETTLED:
            self._began = time.perf_counter(), time.process_time()
        elif at == self._steps - 1:
            now = time.perf_counter(), time.process_time()
            a, b = (1000.0 * (end - start) / (at - _SETTLED) for start, end in zip(self._began, now, strict=True))
            self.took[STREAMS[part % len(STREAMS)]].append((a, b))
            assert self._reader.stdin is not None
            self._reader.stdin.write(f"{STREAMS[(part + 1) % len(STREAMS)]}\n")
            self._reader.stdin.flush()


def measured(world: Path, community: Path, turns: int, steps: int) -> tuple[Turns, float, int]:
    """Run it; return what steps took, what encoding a frame takes (milliseconds), and its bytes."""
    place = read_world(world)
    people = read_community(community, place)
    config = SimConfig(cars=30, pedestrians=30, robots=("husky",), errands=True, observe=())
    sim = Simulation(place, people, config, defer_pictures=True)
    followers = followers_of(people, PublicMap.from_world(place), seed=0)
    agents, faults = Gatherer(followers, trusted=followers), FaultLog()
    wanted = _WARM + turns * len(STREAMS) * steps
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        out = Path(folder) / "run"
        recorder = stack.enter_context(Recorder(out, sim, sources={"world": str(world)}, wanted=wanted))
        control = Control(out)
        viewer = stack.enter_context(LiveViewer(control, place))
        viewer.show(recorder, agents)
        base, _, token = viewer.url.partition("/?token=")
        stream = base.replace("http:", "ws:") + "/stream"
        reader = subprocess.Popen([sys.executable, "-c", READER, stream, token], stdin=subprocess.PIPE, text=True)
        stack.callback(reader.kill)
        watch = Turns(steps, reader)
        hooks: list[Hook] = [RecordedRun(recorder, faults), viewer, watch]
        Runner(sim, agents, hooks=hooks, faults=faults, director=control).run(wanted)
        source, began = viewer.source, time.process_time()
        for _ in range(20):
            content = next(source.frames(source.last, source.last)).to_bytes()
        return watch, (time.process_time() - began) * 50.0, len(content)


def main() -> int:
    """Measure and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("community", type=Path)
    parser.add_argument("--turns", type=int, default=12)
    parser.add_argument("--steps", type=int, default=40)
    parser.add_argument("--table", type=Path)
    arguments = parser.parse_args()
    about = machine()
    watch, encode, size = measured(arguments.world, arguments.community, arguments.turns, arguments.steps)
    names = {0: "nobody there", 1: "one viewer", 10: "ten viewers"}
    lines = ["# A viewer beside a run", "", about, ""]
    lines += [
        f"{arguments.turns} turns of {arguments.steps} steps each; see `benchmarks/live.py` for what is measured."
    ]
    for k, what in enumerate(("seconds by the clock", "processor seconds")):
        lines += ["", f"| {what}, ms a step | median | least | greatest | n |", "|---|---|---|---|---|"]
        lines += [row(names[count], [took[k] for took in found], 1) for count, found in watch.took.items()]
        for count in STREAMS[1:]:
            more = [100.0 * (a[k] / b[k] - 1.0) for a, b in zip(watch.took[count], watch.took[0], strict=True)]
            low, middle, high = statistics.quantiles(more, n=4)
            lines += [
                "",
                f"{names[count]}: {middle:+.1f} % (median of turns; the middle half {low:+.1f} to {high:+.1f}).",
            ]
    lines += ["", f"A frame has {size / 1000:.1f} kB and takes {encode:.2f} ms to make."]
    publish(lines, arguments.table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
