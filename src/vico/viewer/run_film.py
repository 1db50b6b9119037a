"""Films and stills of a recorded run: everything as it was, between the steps too, from beside whoever is followed.

`RepeatedRun` simulates a recorded run once more with what its agents did, from a checkpoint, and compares the hash of
each step; it is looked at between its steps. A film of several shots is described by a file: who or what is looked
at, from where, when, and how fast time goes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydantic import Field, TypeAdapter, ValidationError

from vico.community import Community, read_community
from vico.errors import InputError, MissingFileError, SchemaError
from vico.io.files import read_json
from vico.render.film import FilmWriter
from vico.render.frames import FINE_QUALITY, PictureRequest, RenderQuality, take_pictures
from vico.render.motion import SceneMoment, moment_of, show_interpolated
from vico.rules import ActionStatus
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.pictures.city import renderer_of
from vico.sim.pictures.scene import SceneRenderer
from vico.sim.recording import Run
from vico.sim.recording.interventions import intervene, read_interventions, repeat_drops, repeat_setup
from vico.sim.state.simulation_state import SimulationState
from vico.sim.state.steps import TICKS_PER_SECOND
from vico.viewer.follow_camera import Angle, FollowCamera, Target, View, target_between, target_of
from vico.world.folder import is_world, read_world
from vico.world.model import Record
from vico.world.world import World

SCHEMA, VERSION = "vico.shots", 1


class Shot(Record):
    """One shot of a film.

    Attributes
    ----------
    start, stop
        HH:MM:SS, or seconds since the run began.
    follow
        Name of an agent, of a thing, or of something in traffic.
    view
        From where.
    angle
        Instead of the view's own place: metres away from what is followed, degrees round it (0 is behind, 90 to its
        right) and degrees up.
    speed
        Seconds of the run in a second of the film.
    """

    start: str
    stop: str
    follow: str
    view: View = "behind"
    angle: Angle | None = None
    speed: Annotated[float, Field(gt=0.0, le=100.0)] = 1.0


class ShotList(Record):
    """The shots of a film, one after the other."""

    schema_name: Literal["vico.shots"]
    version: Literal[1]
    shots: Annotated[list[Shot], Field(min_length=1)]


def read_shots(path: Path) -> Sequence[Shot]:
    """Read the shots of a film.

    Raises
    ------
    SchemaError
        If the file is damaged, or has a field that is unknown or makes no sense.
    """
    try:
        return ShotList.model_validate(read_json(path)).shots
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "shots"
        raise SchemaError(f"{path}: {where}: {first['msg']}; docs/pictures.md shows a list of shots") from None


T = TypeVar("T")


class RepeatedRun:
    """Simulates a recorded run again: from a checkpoint, with the recorded actions, each step's hash compared.

    Parameters
    ----------
    run
        The recording.
    world, community
        That it was made with.
    setup
        What was done to the simulation before its first step, such as adding objects; what the recording says of it
        if None.

    Attributes
    ----------
    sim
        The simulation, at the step that was repeated last; nobody's views are rendered.

    Raises
    ------
    SchemaError
        If this version of vico, or another world or community, would make another run.
    """

    def __init__(
        self,
        run: Run,
        world: World,
        community: Community | None,
        *,
        setup: Callable[[Simulation], None] | None = None,
    ) -> None:
        self.run = run
        self._world, self._community, self._setup = world, community, setup
        self._lines = read_interventions(run.path)
        self._begin()

    def _begin(self) -> None:
        """Set the scene as it was before the first step."""
        manifest = self.run.manifest
        config = TypeAdapter(SimConfig).validate_python(manifest["config"])
        self.sim = Simulation(self._world, self._community, config)
        if self._setup is None:
            repeat_setup(self.run.path, self.sim.scenario)
        else:
            self._setup(self.sim)
        if self.sim.identity != manifest["identity"]:
            raise SchemaError(
                f"{self.run.path}: was made by {manifest['producer']} with another configuration, world or community "
                "than this vico would take; record it anew"
            )
        self.sim.seeing = []
        self._at = self._done = 0
        if self.sim.state_hash() != self.run.hashes[0]:
            raise self._differs(0)

    @classmethod
    def of_folders(cls, run: Run, *, world: Path | None = None, community: Path | None = None) -> RepeatedRun:
        """Read world and community where the recording says they are, unless told.

        Raises
        ------
        MissingFileError
            If they are not there.
        """
        place = read_world(_folder(run, world, "world"))
        people = None
        if run.manifest["community"] is not None:
            people = read_community(_folder(run, community, "community"), place)
        return cls(run, place, people)

    @property
    def step(self) -> int:
        """The step that was repeated last."""
        return self._at

    def go_to(self, step: int) -> None:
        """Go to a step, from the checkpoint before it."""
        kept = [k for k in self.run.checkpoints if k <= step]
        if kept and (self._at > step or kept[-1] > self._at):
            checkpoint = self.run.checkpoint(kept[-1])
            if checkpoint.interventions < self._done:
                self._begin()  # what was dropped since can't be taken away
            repeat_drops(self.sim, self._lines[self._done : checkpoint.interventions])
            self.sim.restore(checkpoint.arrays)
            self._at, self._done = kept[-1], checkpoint.interventions
        if self._at > step:
            raise InputError(f"{self.run.path}: step {step} is behind; repeat the run from its beginning")
        while self._at < step:
            self._step()

    def moments(self, last: int, look: Callable[[SimulationState], T]) -> Iterator[list[T]]:
        """Yield what `look` makes of each tenth of a second, a list a step, up to the step `last`."""
        while self._at < last:
            seen: list[T] = []
            self.sim.state.on_substep = lambda seen=seen: seen.append(look(self.sim.state))
            try:
                self._step()
            finally:
                self.sim.state.on_substep = None
            yield seen

    def _step(self) -> None:
        step = self._at + 1
        while self._done < len(self._lines) and self._lines[self._done].after <= self._at:
            # What agents were made to do is among the recorded actions.
            intervene(self.sim, self._lines[self._done].intervention)
            self._done += 1
        self._pass_unrecorded(step)
        actions: dict[str, Any] = {}
        faults: dict[str, tuple[ActionStatus, str]] = {}
        for name, record in self.run.at(step).agents.items():
            if record.action is not None:
                actions[name] = record.action
            if record.status in ("late", "failed"):
                faults[name] = ActionStatus[record.status.upper()], record.reason
        result = self.sim.step(actions, faults)
        self._at = step
        if result.hash != self.run.hashes[step]:
            raise self._differs(step)

    def _pass_unrecorded(self, step: int) -> None:
        """Let the time pass in which nobody was asked for anything before a step, such as during an appointment."""
        now, times = self.sim.state.tick, self.run.times
        ticks = round(float(times[step] - times[step - 1]) * TICKS_PER_SECOND)
        ticks -= self.sim.periods.next_due(now) - now
        if ticks <= 0:
            return
        watcher, self.sim.state.on_substep = self.sim.state.on_substep, None
        self.sim.act({})
        self.sim.advance(ticks / TICKS_PER_SECOND)
        self.sim.state.on_substep = watcher

    def _differs(self, step: int) -> SchemaError:
        return SchemaError(
            f"{self.run.path}: simulated again, step {step} is another one than recorded: the run was changed while it "
            f"went on, or made by another vico ({self.run.manifest['producer']}); record it anew"
        )


def _folder(run: Run, given: Path | None, what: Literal["world", "community"]) -> Path:
    folder = given or run.source(what)
    if not (is_world(folder) if what == "world" else (folder / "community.json").exists()):
        raise MissingFileError(f"{run.path}: its {what} is no longer at {folder}; say where it is with --{what}")
    return folder


@dataclass(frozen=True, kw_only=True)
class FilmSettings:
    """What a film shows.

    Attributes
    ----------
    follow
        Name of an agent, of a thing, or of something in traffic.
    view
        One of `vico.viewer.follow_camera.VIEWS`.
    angle
        From where it is looked at, if not as the view has it.
    speed
        Seconds of the run in a second of the film.
    width, height
        Pixels, even.
    rate
        Frames a second.
    samples
        Rays a pixel, along each side.
    quality
        How carefully pictures are made.
    """

    follow: str
    view: str = "behind"
    angle: Angle | None = None
    speed: float = 1.0
    width: int = 1920
    height: int = 1080
    rate: int = 25
    samples: int = 2
    quality: RenderQuality = FINE_QUALITY

    def __post_init__(self) -> None:
        if self.width % 2 or self.height % 2 or not (64 <= self.width <= 7680 and 64 <= self.height <= 4320):
            raise InputError(f"film: {self.width}x{self.height}; sides have to be even, 64x64 to 7680x4320")
        if not 0.0 < self.speed <= 100.0:
            raise InputError(f"film: a speed of {self.speed:g}; above 0 to 100 make sense")
        if not 1 <= self.rate <= 120:
            raise InputError(f"film: {self.rate} frames a second; 1 to 120 make sense")


class Span(NamedTuple):
    """A shot, and the steps of the run that it shows."""

    settings: FilmSettings
    first: int
    last: int


class _FilmMoment(NamedTuple):
    moment: SceneMoment
    target: Target


def write_run_film(
    path: Path,
    repeated: RepeatedRun,
    settings: FilmSettings,
    *,
    first: int,
    last: int,
    report: Callable[[int, int], None] = lambda done, all_of: None,
) -> int:
    """Film a run from step `first` to step `last`; return the number of frames.

    Raises
    ------
    InputError
        If the steps were not recorded, or nobody has the name.
    """
    return write_film_of_shots(path, repeated, [Span(settings, first, last)], report=report)


def write_film_of_shots(
    path: Path,
    repeated: RepeatedRun,
    shots: Sequence[Span],
    *,
    report: Callable[[int, int], None] = lambda done, all_of: None,
) -> int:
    """Film shots of a run, one after the other, of one size and rate; return the number of frames.

    Raises
    ------
    InputError
        If steps were not recorded, nobody has a name, or a shot begins before the one before it has ended.
    """
    for before, after in itertools.pairwise(shots):
        if after.first < before.last:
            raise InputError(
                f"film: a shot of steps {after.first} to {after.last} after one to step {before.last}; a run is "
                "filmed forwards: sort the shots by time"
            )
    times = repeated.run.times
    count = sum(int(float(times[s.last] - times[s.first]) / s.settings.speed * s.settings.rate) for s in shots)
    with FilmWriter(path, rate=shots[0].settings.rate, crf=20, threads=2) as film:
        for settings, first, last in shots:
            for frame in film_frames(repeated, settings, first=first, last=last):
                film.add(frame)
                report(min(film.frames, count), count)
        return film.frames


def film_frames(repeated: RepeatedRun, settings: FilmSettings, *, first: int, last: int) -> Iterator[NDArray[np.uint8]]:
    """Return the frames of a film of a run from step `first` to step `last`, each uint8, shape ``(h, w, 3)``.

    Raises
    ------
    InputError
        If the steps were not recorded, or nobody has the name.
    """
    if not 0 <= first < last <= repeated.run.last:
        raise InputError(
            f"film: steps {first} to {last}; the run has steps 0 to {repeated.run.last}, and a film needs two of them"
        )
    return _frames(repeated, settings, first, last)


def still(repeated: RepeatedRun, settings: FilmSettings, step: int) -> NDArray[np.uint8]:
    """Return one picture of a step, uint8, shape ``(h, w, 3)``."""
    if not 0 <= step <= repeated.run.last:
        raise InputError(f"still: step {step}; the run has steps 0 to {repeated.run.last}")
    repeated.go_to(step)
    seen = _watcher(repeated, settings)(repeated.sim.state)
    camera = FollowCamera(settings.view, settings.width, settings.height, settings.angle)
    return _picture(seen, seen, 1.0, camera, settings, 1.0)


def write_still(path: Path, repeated: RepeatedRun, settings: FilmSettings, step: int) -> None:
    """Write one picture of a step as PNG or JPEG."""
    if path.suffix not in (".png", ".jpg"):
        raise InputError(f"{path}: stills are .png or .jpg files")
    Image.fromarray(still(repeated, settings, step)).save(path, quality=92)


def _watcher(repeated: RepeatedRun, settings: FilmSettings) -> Callable[[SimulationState], _FilmMoment]:
    renderer = renderer_of(repeated.sim, detail="full")

    def look(state: SimulationState) -> _FilmMoment:
        target = _target(state, settings)
        scene = renderer.show(state) if isinstance(renderer, SceneRenderer) else renderer.show(state, target.position)
        return _FilmMoment(moment_of(scene, state.second), target)

    return look


def _target(state: SimulationState, settings: FilmSettings) -> Target:
    target = target_of(state, settings.follow)
    if settings.angle is None or not settings.angle.ahead_of:
        return target
    dx, dy, _ = (target.position - target_of(state, settings.angle.ahead_of).position).tolist()
    return target._replace(yaw=math.atan2(dy, dx))


def _frames(repeated: RepeatedRun, settings: FilmSettings, first: int, last: int) -> Iterator[NDArray[np.uint8]]:
    repeated.go_to(first)
    look = _watcher(repeated, settings)
    camera = FollowCamera(settings.view, settings.width, settings.height, settings.angle)
    before = look(repeated.sim.state)
    start, number = before.moment.second, 0
    for tenths in repeated.moments(last, look):
        for after in tenths:
            # In whole numbers, so that no frame is lost to rounding.
            while (second := start + number * settings.speed / settings.rate) <= after.moment.second + 1e-9:
                length = max(after.moment.second - before.moment.second, 1e-9)
                share = min(max((second - before.moment.second) / length, 0.0), 1.0)
                yield _picture(before, after, share, camera, settings, 1.0 / settings.rate)
                number += 1
            before = after


def _picture(
    before: _FilmMoment, after: _FilmMoment, share: float, camera: FollowCamera, settings: FilmSettings, dt: float
) -> NDArray[np.uint8]:
    scene = show_interpolated(before.moment, after.moment, share)
    eye = camera.look(scene, target_between(before.target, after.target, share), dt)
    request = PictureRequest(depth=False, segmentation=False, samples=settings.samples, quality=settings.quality)
    return take_pictures(scene, eye, request, threads=1).rgb[0]
