"""`vico film` and `vico still`: what happened in a recorded run, looked at from beside somebody."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from vico.cli.interrupts import Stopped, signal_of
from vico.cli.live import city_of
from vico.cli.output import Report, progress_bars
from vico.cli.viewer_options import FilmOptions, StillOptions
from vico.clock import seconds_of_day
from vico.errors import InputError, MissingFileError, OutputExistsError, some_of
from vico.render.film import partial_film
from vico.render.frames import RenderQuality
from vico.sim.config import find_by_name
from vico.sim.recording import Run, read_run
from vico.viewer.repeat import RepeatedRun
from vico.viewer.run_film import FilmSettings, Span, write_film_of_shots, write_still
from vico.viewer.server import require_server
from vico.viewer.shots import read_shots


def film(options: FilmOptions) -> int:
    """Write a film of a run."""
    out = options.out
    if bool(options.follow) == (options.shots is not None):
        raise InputError("film: give either --follow with a name, or --shots with a list of shots")
    if options.shots is not None and options.headless:
        raise InputError("film: the page films one shot; leave out --headless, or --shots")
    _check(out, force=options.force)
    width, height = size_of(options.size)
    recorded = read_run(options.run)
    if options.headless:
        return _film_of_page(options, recorded)
    settings = FilmSettings(
        follow=options.follow,
        view=options.view,
        width=width,
        height=height,
        rate=options.fps,
        samples=options.samples,
        quality=RenderQuality.of(options.quality),
    )
    spans = _spans(options, settings, recorded)
    with progress_bars() as report:
        report("reading the run", 0, 1)
        repeated = RepeatedRun.of_folders(recorded, world=options.world, community=options.community)
        report("reading the run", 1, 1)
        with _told_where_interrupted(out, report, settings.rate) as film:
            frames = write_film_of_shots(out, repeated, spans, report=film)
    print(f"{out}: {frames} frames, {frames / settings.rate:.1f} s")
    return 0


def _spans(options: FilmOptions, settings: FilmSettings, run: Run) -> list[Span]:
    """Return the shots that are asked for, and their steps; whoever is followed is looked up."""
    if options.shots is None:
        first, last = step_of(run, options.start, default=0), step_of(run, options.stop, default=run.last)
        follow = followed(run, options.follow, first, last, option="film: --follow")
        return [Span(replace(settings, follow=follow), first, last)]
    spans = []
    for number, shot in enumerate(read_shots(options.shots), 1):
        option = f"{options.shots}: shot {number}"
        first, last = step_of(run, shot.start, default=0), step_of(run, shot.stop, default=run.last)
        follow, angle = followed(run, shot.follow, first, last, option=f"{option}: follow"), shot.angle
        if angle is not None and angle.ahead_of:
            ahead_of = followed(run, angle.ahead_of, first, last, option=f"{option}: ahead_of")
            angle = angle.model_copy(update={"ahead_of": ahead_of})
        of_shot = replace(settings, follow=follow, view=shot.view, angle=angle, speed=shot.speed)
        spans.append(Span(of_shot, first, last))
    return spans


def still(options: StillOptions) -> int:
    """Write a picture of a moment of a run."""
    _check(options.out, force=options.force)
    width, height = size_of(options.size)
    recorded = read_run(options.run)
    step = step_of(recorded, options.at, default=recorded.last)
    follow = followed(recorded, options.follow, step, step, option="still: --follow")
    if options.headless:
        return _still_of_page(options, follow, step)
    settings = FilmSettings(
        follow=follow,
        view=options.view,
        width=width,
        height=height,
        samples=options.samples,
        quality=RenderQuality.of(options.quality),
    )
    write_still(
        options.out, RepeatedRun.of_folders(recorded, world=options.world, community=options.community), settings, step
    )
    print(options.out)
    return 0


def _film_of_page(options: FilmOptions, run: Run) -> int:
    """Film what the page draws of a run."""
    from vico.viewer.headless import shot_of, write_film

    width, height = size_of(options.size)
    first, last = step_of(run, options.start, default=0), step_of(run, options.stop, default=run.last)
    follow = followed(run, options.follow, first, last, option="film: --follow")
    shot = shot_of(follow, options.view, width=width, height=height)
    with (
        _page_of(options.run, options.world) as address,
        progress_bars() as report,
        _told_where_interrupted(options.out, report, options.fps) as film_report,
    ):
        frames = write_film(address, options.out, shot, first=first, last=last, rate=options.fps, report=film_report)
    print(f"{options.out}: {frames} frames, {frames / options.fps:.1f} s")
    return 0


def _still_of_page(options: StillOptions, follow: str, step: int) -> int:
    """Take a picture of what the page draws of a run."""
    from vico.viewer.headless import shot_of, write_still

    width, height = size_of(options.size)
    shot = shot_of(follow, options.view, width=width, height=height)
    with _page_of(options.run, options.world) as address:
        write_still(address, options.out, shot, step)
    print(options.out)
    return 0


@contextmanager
def _told_where_interrupted(out: Path, report: Report, rate: int) -> Iterator[Callable[[int, int], None]]:
    """Give what is told of a film's frames; where the block is interrupted, say how much of the film is there."""
    made, wanted = 0, 0

    def told(done: int, count: int) -> None:
        nonlocal made, wanted
        made, wanted = done, count
        report("film", done, count)

    try:
        yield told
    except KeyboardInterrupt as stop:
        if not made:
            raise
        sentence = (
            f"{partial_film(out)}: stopped after {made} of {wanted} frames, {made / rate:.1f} s that can be played"
        )
        raise Stopped(signal_of(stop), sentence) from None


@contextmanager
def _page_of(path: Path, world: Path | None) -> Iterator[str]:
    """Serve a run's page while the block lasts; give its address."""
    from vico.viewer.browser import browser_program
    from vico.viewer.three import three_module

    require_server()
    # What is missing is said before anything is begun.
    browser_program()
    three_module()
    from vico.viewer.server.serve import ViewerServer
    from vico.viewer.server.state import ViewerState
    from vico.viewer.sources.source import Source
    from vico.viewer.sources.views import RecordedViews

    source = Source.recorded(path, world=world)
    run = source.tables.run
    assert run is not None
    if source.world is None:
        raise MissingFileError(f"{path}: its world is no longer there; give its folder with --world")
    with ViewerServer(ViewerState(source, RecordedViews(run).view, city=city_of(source.world))) as server:
        yield server.url


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


def followed(run: Run, text: str, first: int, last: int, *, option: str) -> str:
    """Return the simulation's name of somebody or something that is there from a step to another.

    Parameters
    ----------
    text
        A name as `vico.sim.config.find_by_name` takes it.

    Raises
    ------
    InputError
        If nobody is called so, or is not there all the time.
    """
    name = find_by_name(text, run.names, option=option)
    stays = [stay for one in run.cast.values() if name in (one.agent, one.name) for stay in one.intervals]
    if not any(begin <= first and (until is None or last < until) for begin, until in stays):
        there = [f"{_clock(run.times[a])} to {_clock(run.times[run.last if b is None else b - 1])}" for a, b in stays]
        raise InputError(f"{option}: {name} is there from {some_of(there)} alone; give times in between")
    return name


def _clock(second: float) -> str:
    whole = int(second)
    return f"{whole // 3600 % 24:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}"


def _check(out: Path, *, force: bool) -> None:
    if out.exists() and not force:
        raise OutputExistsError(f"{out}: exists; give another name, or --force")
