"""Writing a run down while it goes on: a folder that can be read at any moment, and gone on with after a kill."""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from vico.community.folder import write_community
from vico.errors import EmptyInputError, InputError, OutputError, OutputExistsError
from vico.io.files import FolderLock, folder_errors, write_errors, write_json
from vico.sim.bodies.arrays import Bodies
from vico.sim.loop.simulation import Simulation, StepResult
from vico.sim.recording.films import ViewFilms, drop_views_after
from vico.sim.recording.interventions import read_interventions, repeat_drops, write_setup
from vico.sim.recording.manifest import (
    CastLog,
    agents_record,
    append_cast,
    cut_cast,
    describer,
    read_manifest,
    run_record,
)
from vico.sim.recording.samples import StepSamples, everybody
from vico.sim.recording.schema import (
    AGENTS,
    COMMUNITY,
    MANIFEST,
    METRICS,
    SEGMENT_STEPS,
    Checkpoint,
    checkpoint_steps,
    drop_checkpoints_after,
    drop_segments_after,
    read_checkpoint,
    segments_of,
    write_checkpoint,
    write_segment,
)

__all__ = ["Checkpoint", "Recorder"]


class Recorder:
    """Records a simulation, step by step.

    Parameters
    ----------
    out
        Folder to write; must not exist, or be empty.
    sim
        Before its first step.
    sources
        Where world and community came from: ``{"world": path, "community": path}``; kept for the reader. A community
        that came from nowhere is written into the run's folder.
    wanted
        Steps the run is meant to have.
    states_every
        After how many steps a `checkpoint` is due; None for never.
    notes
        What else ``run.json`` is to hold, JSON values by name.
    keep
        Outputs that are recorded as arrays, beside the films.

    Attributes
    ----------
    notes
        The same, to be changed while the run goes on.

    Raises
    ------
    InputError
        If `states_every` is below 1.
    OutputExistsError
        If the folder holds something.
    """

    def __init__(
        self,
        out: Path,
        sim: Simulation,
        *,
        sources: Mapping[str, str],
        wanted: int,
        states_every: int | None = None,
        notes: Mapping[str, Any] | None = None,
        keep: Sequence[str] = (),
    ) -> None:
        self.notes = dict(notes or {})
        if out.exists() and any(out.iterdir()):
            raise OutputExistsError(f"{out}: the folder is not empty; give another, or --force")
        self._open(out, sim, sources=sources, wanted=wanted, states_every=states_every, keep=keep)
        with self._errors():
            if sim.community is not None and self._sources["community"] == COMMUNITY:
                write_community(sim.community, out / COMMUNITY, world=sim.world.path)
            self._write_manifest("running")
            write_json(out / AGENTS, {"agents": agents_record(sim)})

    def _open(
        self,
        out: Path,
        sim: Simulation,
        *,
        sources: Mapping[str, str],
        wanted: int,
        states_every: int | None,
        keep: Sequence[str],
    ) -> None:
        unknown = [name for name in keep if name not in sim.config.outputs]
        if unknown:
            raise InputError(f"{out}: {unknown[0]!r} is to be kept, but the run is not asked for it (outputs)")
        if states_every is not None and states_every < 1:
            raise InputError(f"{out}: a checkpoint every {states_every} steps; it has to be 1 or more, or None")
        with write_errors(out):
            out.mkdir(parents=True, exist_ok=True)
        # Held as long as this process lives, so that nobody takes the run for one that was killed.
        self._lock = FolderLock(out)
        self.out, self.sim, self.wanted, self.states_every = out, sim, wanted, states_every
        # Relative to the run's folder: it may be moved, as an evaluation's is when all episodes are over.
        self._sources = {"community": COMMUNITY} | dict(sources)
        self._closed = False
        self._samples = StepSamples(sim)
        self._films = ViewFilms(out)
        self._keep = tuple(keep)
        self._hash = sim.state_hash()
        self._began = time.perf_counter()
        self._earlier, self._resumed = 0.0, False
        self._cast = CastLog(describer(sim))
        # Of the run, whatever is dropped into it later.
        self._identity = sim.identity

    @classmethod
    def resume(
        cls,
        out: Path,
        sim: Simulation,
        *,
        sources: Mapping[str, str],
        wanted: int,
        states_every: int | None = None,
        notes: Mapping[str, Any] | None = None,
        keep: Sequence[str] = (),
    ) -> tuple[Self, Checkpoint]:
        """Go on with an interrupted run from its last checkpoint; what was recorded after it is dropped.

        Parameters
        ----------
        out
            Folder of the run.
        sim
            Made in the same way as the recorded one; it is set to the checkpoint's state.
        sources, wanted, states_every, notes, keep
            As for a new recorder.

        Returns
        -------
        recorder, checkpoint
            The recorder goes on with the step after the checkpoint.

        Raises
        ------
        MissingFileError, SchemaError
            If the folder holds no run, one of another version, or of another world, community or configuration.
        InputError
            If the run is complete.
        EmptyInputError
            If it has no checkpoint yet.
        OutputError
            If another process is writing it.
        """
        manifest = read_manifest(out)
        if manifest["status"] == "complete":
            raise InputError(f"{out}: the run is complete; there is nothing to go on with")
        steps = [step for step in checkpoint_steps(out) if any(s.last == step for s in segments_of(out))]
        if not steps:
            raise EmptyInputError(f"{out}: the run was stopped before its first checkpoint; run it anew")
        identity = sim.identity
        checkpoint = read_checkpoint(out, steps[-1], owner=identity)
        repeat_drops(sim, read_interventions(out)[: checkpoint.interventions])
        sim.restore(checkpoint.arrays)
        self = cls.__new__(cls)
        self.notes = dict(notes or {})
        self._open(out, sim, sources=sources, wanted=wanted, states_every=states_every, keep=keep)
        self._identity = identity
        with self._errors():
            drop_segments_after(out, checkpoint.step)
            drop_checkpoints_after(out, checkpoint.step)
            drop_views_after(out, checkpoint.step)
            cut_cast(out, checkpoint.step)
            self._cast.watch(checkpoint.step, everybody(sim))
            self._cast.lines.clear()
            self._earlier, self._resumed = float(checkpoint.clock["wall_seconds"]), True
            sim.metrics.seconds.update(checkpoint.clock["seconds_by_phase"])
            self._write_manifest("running")
        return self, checkpoint

    def begin(self, observations: Mapping[str, Mapping[str, Any]]) -> None:
        """Record the state before the first step, and what is seen then.

        Where the recording goes on from a checkpoint nothing is recorded: that state was.
        """
        if self._resumed:
            return
        self._identity = self.sim.identity
        with self._errors():
            write_setup(self.out, self.sim)
            self._take(None, {}, observations)

    def write(self, result: StepResult, actions: Mapping[str, Any] | None = None) -> None:
        """Record a step, and what agents asked for in it, by name."""
        self._hash = result.hash
        with self._errors():
            self._take(result, actions or {}, result.observations)
            if self.sim.metrics.steps % SEGMENT_STEPS == 0:
                self._flush()
                self._write_manifest("running")

    @property
    def checkpoint_due(self) -> bool:
        """Whether a `checkpoint` belongs after the step that was written last."""
        return self.states_every is not None and self.sim.metrics.steps % self.states_every == 0

    def checkpoint(self, agents: Mapping[str, Any], notes: Mapping[str, Any] | None = None) -> None:
        """Keep the exact state after the step that was written last, so that the run can go on from it.

        Parameters
        ----------
        agents
            State of each agent by name: nested mappings of JSON values and arrays.
        notes
            What else whoever runs the simulation wants back as `Checkpoint.notes`; of the same kind.

        Raises
        ------
        InputError
            If an agent's state holds anything else.
        """
        with self._errors():
            self._flush()
            # The films that are on the disk end here: going on begins new files.
            self._films.end_part()
            clock = {"wall_seconds": self._wall(), "seconds_by_phase": dict(self.sim.metrics.seconds)}
            checkpoint = Checkpoint(self.sim.metrics.steps, self.sim.arrays(), dict(agents), dict(notes or {}), clock)
            write_checkpoint(self.out, checkpoint, owner=self._identity)
            self._write_manifest("running")

    def close(self, status: str = "complete") -> dict[str, Any]:
        """Finish the run and return its metrics."""
        self._closed = True
        with self._errors(), ExitStack() as closed:
            closed.callback(self._lock.release)
            closed.callback(self._films.close)
            self._flush()
            self._films.end_part()
            metrics = self.metrics()
            write_json(self.out / METRICS, metrics)
            self._write_manifest(status)
        return metrics

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._closed:
            return
        # What cannot be written any more was said by the error that ended the block.
        with suppress(OutputError) if isinstance(error, OutputError) else nullcontext():
            self.close("complete" if kind is None else "stopped")

    @property
    def latest(self) -> Mapping[str, Mapping[str, Any]]:
        """Rows that were taken of the last step, by table; see `StepSamples.latest`."""
        return self._samples.latest

    @property
    def latest_cast(self) -> list[dict[str, Any]]:
        """Lines of the cast that the last step brought."""
        return self._cast.latest

    def metrics(self) -> dict[str, Any]:
        """Return counts and seconds so far; see `docs/formats.md`."""
        sim = self.sim
        wall = self._wall()
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
            "trips": sim.punctuality.by_mode(),
            "observations": counts.steps * len(sim.seeing),
            "seconds_by_phase": {name: round(value, 3) for name, value in counts.seconds.items()},
        } | sim.reports()

    def _wall(self) -> float:
        return self._earlier + time.perf_counter() - self._began

    @contextmanager
    def _errors(self) -> Iterator[None]:
        """Make one sentence of a full disk; of a folder that was taken away, too, instead of making it anew."""
        with folder_errors(self.out):
            self._lock.confirm()
            yield

    def _take(
        self, result: StepResult | None, actions: Mapping[str, Any], observations: Mapping[str, Mapping[str, Any]]
    ) -> None:
        sim, step = self.sim, self.sim.metrics.steps
        bodies: Bodies = everybody(sim)
        self._cast.watch(step, bodies)
        self._samples.take(bodies, self._hash, result, actions)
        watch = time.perf_counter()
        # Observations are made when they are asked for: those without pictures are not.
        looking = {name: observations[name] for i in sim.seeing if (name := sim.agents[i]) in observations}
        pictures = {name: seen["rgb"] for name, seen in looking.items() if "rgb" in seen}
        arrays = {
            name: {output: seen[output] for output in self._keep if output in seen}
            for name, seen in (looking.items() if self._keep else ())
        }
        self._films.add(step, pictures, sim.picture_waiter(), {name: kept for name, kept in arrays.items() if kept})
        seconds = sim.metrics.seconds
        seconds["films"] = seconds.get("films", 0.0) + time.perf_counter() - watch

    def _flush(self) -> None:
        """Write what was taken as a segment; the cast first, so that whoever is in a segment is in the cast."""
        if not len(self._samples):
            return
        first, last = self._samples.steps[0], self._samples.steps[-1]
        append_cast(self.out, self._cast.lines)
        self._cast.lines.clear()
        write_segment(self.out, first, last, self._samples.tables())

    def _write_manifest(self, status: str) -> None:
        record = run_record(self.sim, status, self._hash, self._sources, self.wanted, self._identity)
        write_json(self.out / MANIFEST, self.notes | record | {"states_every": self.states_every})
