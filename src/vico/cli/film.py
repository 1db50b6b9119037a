"""`vico film` and `vico still`: what happened in a recorded run, looked at from beside somebody."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vico.cli.options import FilmOptions, StillOptions
from vico.cli.output import progress_bars
from vico.clock import seconds_of_day
from vico.errors import InputError, OutputExistsError
from vico.render.quality import RenderQuality
from vico.sim.recording import Run, read_run
from vico.viewer.repeat import RepeatedRun
from vico.viewer.run_film import FilmSettings, write_run_film, write_still


def film(options: FilmOptions) -> int:
    """Write a film of a run."""
    out = options.out
    _check(out, force=options.force)
    width, height = size_of(options.size)
    settings = FilmSettings(
        follow=options.follow,
        view=options.view,
        width=width,
        height=height,
        rate=options.fps,
        samples=options.samples,
        quality=RenderQuality.of(options.quality),
    )
    recorded = read_run(options.run)
    first = step_of(recorded, options.start, default=0)
    last = step_of(recorded, options.stop, default=recorded.last)
    with progress_bars() as report:
        report("reading the run", 0, 1)
        repeated = RepeatedRun.of_folders(recorded, world=options.world, community=options.community)
        report("reading the run", 1, 1)
        frames = write_run_film(
            out, repeated, settings, first=first, last=last, report=lambda done, count: report("film", done, count)
        )
    print(f"{out}: {frames} frames, {frames / settings.rate:.1f} s")
    return 0


def still(options: StillOptions) -> int:
    """Write a picture of a moment of a run."""
    _check(options.out, force=options.force)
    width, height = size_of(options.size)
    settings = FilmSettings(
        follow=options.follow,
        view=options.view,
        width=width,
        height=height,
        samples=options.samples,
        quality=RenderQuality.of(options.quality),
    )
    recorded = read_run(options.run)
    step = step_of(recorded, options.at, default=recorded.last)
    write_still(
        options.out, RepeatedRun.of_folders(recorded, world=options.world, community=options.community), settings, step
    )
    print(options.out)
    return 0


def size_of(text: str) -> tuple[int, int]:
    """Return width and height of ``1920x1080``.

    Raises
    ------
    InputError
        If it is no such text.
    """
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise InputError(f"--size {text}: give it as WIDTHxHEIGHT, for example 1920x1080")
    return int(width), int(height)


def step_of(run: Run, text: str, *, default: int) -> int:
    """Return the step of a time of day (``HH:MM``, ``HH:MM:SS``) or of a number of seconds since the start.

    Raises
    ------
    InputError
        If the run was not there then.
    """
    if not text:
        return default
    times = run.times
    if ":" in text:
        second = float(seconds_of_day(text))
    else:
        try:
            second = float(times[0]) + float(text)
        except ValueError:
            raise InputError(f"{text!r} is no time: give HH:MM:SS, or seconds since the start of the run") from None
    if not times[0] - 1e-6 <= second <= times[-1] + 1e-6:
        raise InputError(f"{text}: the run lasts from {_clock(times[0])} to {_clock(times[-1])}")
    return int(np.searchsorted(times, second - 1e-6))


def _clock(second: float) -> str:
    whole = int(second)
    return f"{whole // 3600 % 24:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}"


def _check(out: Path, *, force: bool) -> None:
    if out.exists() and not force:
        raise OutputExistsError(f"{out}: exists; give another name, or --force")
