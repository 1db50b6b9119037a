"""Films and stills of a recorded run: everything as it was, between the steps too, from beside whoever is followed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.errors import InputError
from vico.render.film import FilmWriter
from vico.render.frames import FINE_QUALITY, PictureRequest, RenderQuality, take_pictures
from vico.render.motion import SceneMoment, moment_of, show_interpolated
from vico.sim.pictures.city import renderer_of
from vico.sim.pictures.scene import SceneRenderer
from vico.sim.state.simulation_state import SimulationState
from vico.viewer.follow import Angle, FollowCamera
from vico.viewer.repeat import RepeatedRun
from vico.viewer.targets import Target, target_between, target_of


@dataclass(frozen=True, kw_only=True)
class FilmSettings:
    """What a film shows.

    Attributes
    ----------
    follow
        Name of an agent, of a thing, or of something in traffic.
    view
        One of `vico.viewer.follow.VIEWS`.
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


class _Seen(NamedTuple):
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


def _watcher(repeated: RepeatedRun, settings: FilmSettings) -> Callable[[SimulationState], _Seen]:
    renderer = renderer_of(repeated.sim, detail="full")

    def look(state: SimulationState) -> _Seen:
        target = _target(state, settings)
        scene = renderer.show(state) if isinstance(renderer, SceneRenderer) else renderer.show(state, target.position)
        return _Seen(moment_of(scene, state.second), target)

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
    before: _Seen, after: _Seen, share: float, camera: FollowCamera, settings: FilmSettings, dt: float
) -> NDArray[np.uint8]:
    scene = show_interpolated(before.moment, after.moment, share)
    eye = camera.look(scene, target_between(before.target, after.target, share), dt)
    request = PictureRequest(depth=False, segmentation=False, samples=settings.samples, quality=settings.quality)
    return take_pictures(scene, eye, request, threads=1).rgb[0]
