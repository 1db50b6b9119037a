"""Writing a run down while it goes on: a folder that can be read at any moment, even after a power cut.

::

    run.json                 what was run, who takes part, how far it came
    metrics.json             counts and seconds; written at the end
    states/part-00000.parquet   step, entity, x, y, z, yaw, clip, status: a minute each
    steps/part-00000.parquet    step, time, hash
    events.jsonl             one event a line
    views/<agent>.mp4        what each agent saw, a frame a step (fragmented: whole minutes survive a kill)
"""

from __future__ import annotations

import json
import resource
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from vico.errors import OutputError, OutputExistsError
from vico.io.files import write_bytes, write_errors, write_json
from vico.io.folders import FolderLock, folder_errors
from vico.sim.bodies import KINDS, Bodies
from vico.sim.events import Event
from vico.sim.recording import SCHEMA, VERSION, Run, read_run
from vico.sim.simulation import Simulation, StepResult
from vico.version import __version__

PART = 60
RATE = 10
KEY = 20
_COLUMNS = ("step", "entity", "x", "y", "z", "yaw", "clip", "status")


class ViewFilm:
    """One agent's film: H.264 in fragments of 20 frames, so that what is written can be played at any time."""

    def __init__(self, path: Path, side: int) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        flags = {"movflags": "frag_keyframe+empty_moov+default_base_moof", "flush_packets": "1"}
        self._container: Any = av.open(str(path), "w", options=flags)
        self._stream = self._container.add_stream("libx264", rate=RATE)
        self._stream.width = self._stream.height = side
        self._stream.pix_fmt = "yuv420p"
        self._stream.time_base = Fraction(1, RATE)
        # One thread and no look-ahead: the films must not fight the simulation for cores.
        self._stream.codec_context.thread_count = 1
        self._stream.options = {"crf": "27", "preset": "ultrafast", "tune": "zerolatency"}
        # A whole frame every 20 steps, and nowhere else: viewers take those as stills without decoding the rest.
        self._stream.options |= {"g": str(KEY), "sc_threshold": "0"}

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Append a picture, uint8, shape ``(side, side, 3)``."""
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
        self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Write what is left."""
        self._container.mux(self._stream.encode(None))
        self._container.close()


class Recorder:
    """Records a simulation, step by step.

    Parameters
    ----------
    out
        Folder to write; must not exist, or be empty.
    sim
        Before its first step.
    sources
        Where world and community came from: ``{"world": path, "community": path}``; kept for the reader.
    wanted
        Steps the run is meant to have.

    Raises
    ------
    OutputExistsError
        If the folder holds something.
    """

    def __init__(self, out: Path, sim: Simulation, *, sources: Mapping[str, str], wanted: int) -> None:
        if out.exists() and any(out.iterdir()):
            raise OutputExistsError(f"{out}: the folder is not empty; give another, or --force")
        with write_errors(out):
            out.mkdir(parents=True, exist_ok=True)
        # Held as long as this process lives, so that nobody takes the run for one that was killed.
        self._lock = FolderLock(out)
        self.out, self.sim, self.wanted = out, sim, wanted
        self._sources = dict(sources)
        self._rows: list[list[NDArray[Any]]] = []
        self._steps: list[tuple[int, float, str]] = []
        self._parts = 0
        self._hash = sim.state_hash()
        self._began = time.perf_counter()
        self._films: dict[str, ViewFilm] = {}
        # One step's pictures are encoded while the next step is simulated (the encoder lets go of the interpreter).
        self._film_crew = ThreadPoolExecutor(1, "films")
        self._filming: Future[None] | None = None
        self._events = (out / "events.jsonl").open("a", encoding="utf-8")
        self._bodies = _Cast(sim)
        self._write_manifest("running")

    def begin(self, observations: Mapping[str, Mapping[str, Any]]) -> None:
        """Record the state before the first step, and what is seen then."""
        with self._errors():
            self._take(0, observations)

    def write(self, result: StepResult) -> None:
        """Record a step."""
        self._hash = result.hash
        with self._errors():
            self._take(self.sim.metrics.steps, result.observations)
            self._write_events(result.events)
            if self.sim.metrics.steps % PART == 0:
                self._flush()
                self._write_manifest("running")

    def close(self, status: str = "complete") -> dict[str, Any]:
        """Finish the run and return its metrics."""
        with self._errors(), ExitStack() as closed:
            closed.callback(self._lock.release)
            closed.callback(self._events.close)
            if self._steps:
                self._flush()
            self._finish_filming()
            self._film_crew.shutdown()
            for film in self._films.values():
                film.close()
            self._films = {}
            metrics = self.metrics()
            write_json(self.out / "metrics.json", metrics)
            self._write_manifest(status)
        return metrics

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._events.closed:
            return
        # What cannot be written any more was said by the error that ended the block.
        with suppress(OutputError) if isinstance(error, OutputError) else nullcontext():
            self.close("complete" if kind is None else "stopped")

    def metrics(self) -> dict[str, Any]:
        """Return counts and seconds so far; see `docs/formats.md`."""
        sim = self.sim
        wall = time.perf_counter() - self._began
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        counts = sim.metrics
        return {
            "steps": counts.steps,
            "wall_seconds": round(wall, 3),
            "real_time_factor": round(counts.steps / wall, 3) if wall > 0 else 0.0,
            "peak_rss_mb": round(peak / (1024 if sys.platform != "darwin" else 1024 * 1024), 1),
            "state_hash": self._hash,
            "collisions": counts.collisions,
            "refused": counts.refused,
            "arrivals": int(sim.punctuality.arrivals.sum()),
            "late": int(sim.punctuality.late.sum()),
            "observations": counts.steps * len(sim.seeing),
            "seconds_by_phase": {name: round(value, 3) for name, value in counts.seconds.items()},
        }

    @contextmanager
    def _errors(self) -> Iterator[None]:
        """Make one sentence of a full disk; of a folder that was taken away, too, instead of making it anew."""
        with folder_errors(self.out):
            self._lock.confirm()
            yield

    def _take(self, step: int, observations: Mapping[str, Mapping[str, Any]]) -> None:
        rows = self._bodies.rows(step)
        self._rows.append(rows)
        self._steps.append((step, self.sim.state.second, self._hash))
        watch = time.perf_counter()
        self._finish_filming()
        pictures = {name: seen["rgb"] for name, seen in observations.items() if "rgb" in seen}
        if pictures:
            self._filming = self._film_crew.submit(self._film, pictures, self.sim.rgb_waiter())
        seconds = self.sim.metrics.seconds
        seconds["films"] = seconds.get("films", 0.0) + time.perf_counter() - watch

    def _film(self, pictures: Mapping[str, NDArray[np.uint8]], wait: Callable[[], None]) -> None:
        wait()
        for name, picture in pictures.items():
            if name not in self._films:
                self._films[name] = ViewFilm(self.out / "views" / f"{name}.mp4", picture.shape[0])
            self._films[name].add(picture)

    def _finish_filming(self) -> None:
        """Wait for the pictures of the step before; whatever went wrong with them is raised here."""
        if self._filming is not None:
            filming, self._filming = self._filming, None
            filming.result()

    def _write_events(self, events: list[Event]) -> None:
        for event in events:
            self._events.write(json.dumps(event.record(), ensure_ascii=False, sort_keys=True) + "\n")
        if events:
            self._events.flush()

    def _flush(self) -> None:
        columns = [np.concatenate(parts) for parts in zip(*self._rows, strict=True)]
        states = pa.table(dict(zip(_COLUMNS, columns, strict=True)))
        _write_table(self.out / "states" / f"part-{self._parts:05d}.parquet", states)
        steps, times, hashes = zip(*self._steps, strict=True)
        table = pa.table(
            {"step": pa.array(steps, pa.int32()), "time": pa.array(times, pa.float64()), "hash": pa.array(hashes)}
        )
        _write_table(self.out / "steps" / f"part-{self._parts:05d}.parquet", table)
        self._rows, self._steps = [], []
        self._parts += 1

    def _write_manifest(self, status: str) -> None:
        sim = self.sim
        community = sim.community
        write_json(
            self.out / "run.json",
            {
                "schema_name": SCHEMA,
                "version": VERSION,
                "producer": f"vico {__version__}",
                "status": status,
                "seed": sim.config.seed,
                "config": sim.config.record(),
                "world": {"path": self._sources.get("world", ""), "digest": sim.world.digest},
                "community": None
                if community is None
                else {"path": self._sources.get("community", ""), "residents": len(sim.residents)},
                "start": sim.config.start,
                "steps": sim.metrics.steps,
                "wanted_steps": self.wanted,
                "agents": self._bodies.agents,
                "bodies": self._bodies.entries,
                "state_hash": self._hash,
            },
        )


class _Cast:
    """Everybody and everything that moves, in the order it is recorded in."""

    def __init__(self, sim: Simulation) -> None:
        self._sim = sim
        self.agents: list[dict[str, Any]] = []
        self.entries: list[dict[str, Any]] = []
        state = sim.state
        for i, name in enumerate(state.people.names):
            entity = int(state.people.entity[i])
            person = sim.residents[i] if i < len(sim.residents) else None
            self.agents.append(
                {
                    "name": name,
                    "kind": "assistant" if person is None else "resident",
                    "entity": entity,
                    "resident": None if person is None else person.id,
                    "person": None if person is None else _person(person, sim),
                }
            )
        if state.robots is not None:
            bodies = state.robots.bodies()
            self.agents += [
                {"name": name, "kind": "robot", "entity": int(entity), "resident": None, "person": None}
                for name, entity in zip(state.robots.names, bodies.entity, strict=True)
            ]
        for bodies in self._bodies():
            for k in range(len(bodies)):
                entity = int(bodies.entity[k])
                self.entries.append(
                    {
                        "entity": entity,
                        "kind": KINDS[int(bodies.kind[k])],
                        "name": sim.entity(entity)["name"],
                        "size": [
                            round(float(value), 3)
                            for value in (2 * bodies.half_length[k], 2 * bodies.half_width[k], bodies.height[k])
                        ],
                    }
                )
        for k, entity in enumerate(state.objects.entity):
            size = [round(float(value), 3) for value in state.objects.size[k]]
            self.entries.append({"entity": int(entity), "kind": "object", "name": state.objects.names[k], "size": size})

    def _bodies(self) -> list[Bodies]:
        state = self._sim.state
        everyone = state.people.bodies_of(np.arange(len(state.people)))
        return [everyone] + [s.bodies() for s in (state.robots, state.traffic, state.transit) if s is not None]

    def rows(self, step: int) -> list[NDArray[Any]]:
        """Return the columns of one step, in the order of `_COLUMNS`."""
        state = self._sim.state
        bodies, objects = Bodies.joined(self._bodies()), state.objects
        entity = np.concatenate([bodies.entity, objects.entity])
        position = np.vstack([bodies.position, objects.position]).astype(np.float32)
        clip = np.full(len(entity), -1, np.int16)
        status = np.full(len(entity), -1, np.int8)
        clip[: len(state.people)] = state.people.clip
        status[: len(state.people)] = state.people.status
        yaw = np.concatenate([bodies.yaw, objects.yaw]).astype(np.float32)
        steps = np.full(len(entity), step, np.int32)
        return [steps, entity, position[:, 0], position[:, 1], position[:, 2], yaw, clip, status]


def _person(resident: Any, sim: Simulation) -> dict[str, Any]:
    places = {place.id: place.name for place in sim.world.places}
    return {
        "name": resident.name,
        "age": resident.age,
        "gender": resident.gender,
        "occupation": resident.occupation,
        "biography": resident.biography,
        "schedule": [
            {
                "type": str(item.type),
                "start": item.start,
                "end": item.end,
                "activity": item.activity,
                "place": places.get(item.place or "", ""),
            }
            for item in resident.schedule
        ],
    }


def _write_table(path: Path, table: pa.Table) -> None:
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd")
    write_bytes(path, sink.getvalue().to_pybytes())


__all__ = ["Recorder", "Run", "ViewFilm", "read_run"]
