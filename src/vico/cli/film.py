"""`vico film`, `vico still`, `vico replay` and `vico score-pictures`: pictures of recorded runs.

Films and stills show what happened in a recorded run, from beside somebody. A replay is the page and the film of a
whole run. Scores are FID and KID of a folder of pictures against one of photos. What a verb needs is imported when it
runs, so that `vico --help` is quick.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional

from vico.cli.console import CommandInterrupted, Report, print_json, print_table, progress_bars, signal_of
from vico.cli.options import FLAT
from vico.errors import InputError, MissingFileError, OutputExistsError, SchemaError, some_of
from vico.viewer.server import require_server

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from vico.sim.recording import Run
    from vico.viewer.run_film import FilmSettings, Span
    from vico.world.world import World


@dataclass(frozen=True)
class FilmOptions:
    """What `vico film` is asked for."""

    run: Positional[Path]  # Run folder.
    #: Whom the camera follows: a person by name ("Ann Lee", or Ann), resident_3, a robot, a thing, or "car 3".
    follow: str = ""
    #: Instead of it: a file that lists shots, each with times, whom it follows and from where (docs/pictures.md).
    shots: Path | None = None
    out: Path = Path("film.mp4")  # File to write (.mp4).
    size: str = "1920x1080"  # WIDTHxHEIGHT, pixels.
    start: str = ""  # HH:MM:SS, or seconds since the run began; without it, its beginning.
    stop: str = ""  # Likewise; without it, its end.
    fps: int = 25  # Frames a second.
    view: Literal["behind", "front", "eyes", "above", "side", "orbit", "close"] = "behind"  # From where.
    samples: int = 2  # Rays a pixel, along each side: 1 is quick, 2 smooth.
    quality: Literal["plain", "fine"] = "fine"  # plain, or fine: soft shadows, darker corners, mirroring glass.
    world: Path | None = None  # The world it ran in, if it is no longer where it was.
    community: Path | None = None  # Its community, if it is no longer where it was.
    force: bool = False  # Replace the file if it is there.
    #: Have the page of `vico view` draw it, in Chromium without a window: nothing is simulated again.
    headless: bool = False


@dataclass(frozen=True)
class StillOptions:
    """What `vico still` is asked for."""

    run: Positional[Path]  # Run folder.
    follow: str  # Who is in its middle, as for `vico film`: "Ann Lee", resident_3, "car 3".
    at: str = ""  # HH:MM:SS, or seconds since the run began; without it, its end.
    out: Path = Path("still.png")  # File to write (.png or .jpg).
    size: str = "1920x1080"  # WIDTHxHEIGHT, pixels.
    view: Literal["behind", "front", "eyes", "above", "side", "orbit", "close"] = "behind"  # From where.
    samples: int = 3  # Rays a pixel, along each side.
    quality: Literal["plain", "fine"] = "fine"  # plain, or fine: soft shadows, darker corners, mirroring glass.
    world: Path | None = None  # The world it ran in, if it is no longer where it was.
    community: Path | None = None  # Its community, if it is no longer where it was.
    force: bool = False  # Replace the file if it is there.
    #: Have the page of `vico view` draw it, in Chromium without a window: nothing is simulated again.
    headless: bool = False


def film(options: Annotated[FilmOptions, FLAT]) -> int:
    """Film somebody in a recorded run: it is simulated again with what was done in it, and looked at from beside.

    Example: vico film morning --follow resident_3 --start 08:05 --stop 08:06 --out walk.mp4
    """
    from vico.render.frames import RenderQuality
    from vico.sim.recording import read_run
    from vico.viewer.run_film import FilmSettings, RepeatedRun, write_film_of_shots

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
        with _report_if_interrupted(out, report, settings.rate) as film:
            frames = write_film_of_shots(out, repeated, spans, report=film)
    print(f"{out}: {frames} frames, {frames / settings.rate:.1f} s")
    return 0


def _spans(options: FilmOptions, settings: FilmSettings, run: Run) -> list[Span]:
    """Return the shots that are asked for, and their steps; whoever is followed is looked up."""
    from vico.viewer.run_film import Span, read_shots

    if options.shots is None:
        first, last = step_of(run, options.start, default=0), step_of(run, options.stop, default=run.last)
        follow = followed_name(run, options.follow, first, last, option="film: --follow")
        return [Span(replace(settings, follow=follow), first, last)]
    spans = []
    for number, shot in enumerate(read_shots(options.shots), 1):
        option = f"{options.shots}: shot {number}"
        first, last = step_of(run, shot.start, default=0), step_of(run, shot.stop, default=run.last)
        follow, angle = followed_name(run, shot.follow, first, last, option=f"{option}: follow"), shot.angle
        if angle is not None and angle.ahead_of:
            ahead_of = followed_name(run, angle.ahead_of, first, last, option=f"{option}: ahead_of")
            angle = angle.model_copy(update={"ahead_of": ahead_of})
        of_shot = replace(settings, follow=follow, view=shot.view, angle=angle, speed=shot.speed)
        spans.append(Span(of_shot, first, last))
    return spans


def still(options: Annotated[StillOptions, FLAT]) -> int:
    """Take a picture of somebody in a recorded run.

    Example: vico still morning --follow resident_3 --at 08:05 --view side --out walk.png

    Example: vico still morning --follow resident_3 --at 08:05 --headless --out walk.png
    """
    from vico.render.frames import RenderQuality
    from vico.sim.recording import read_run
    from vico.viewer.run_film import FilmSettings, RepeatedRun, write_still

    _check(options.out, force=options.force)
    width, height = size_of(options.size)
    recorded = read_run(options.run)
    step = step_of(recorded, options.at, default=recorded.last)
    follow = followed_name(recorded, options.follow, step, step, option="still: --follow")
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
    from vico.viewer.headless import page_shot_of, write_film

    width, height = size_of(options.size)
    first, last = step_of(run, options.start, default=0), step_of(run, options.stop, default=run.last)
    follow = followed_name(run, options.follow, first, last, option="film: --follow")
    shot = page_shot_of(follow, options.view, width=width, height=height)
    with (
        _page_of(options.run, options.world) as address,
        progress_bars() as report,
        _report_if_interrupted(options.out, report, options.fps) as film_report,
    ):
        frames = write_film(address, options.out, shot, first=first, last=last, rate=options.fps, report=film_report)
    print(f"{options.out}: {frames} frames, {frames / options.fps:.1f} s")
    return 0


def _still_of_page(options: StillOptions, follow: str, step: int) -> int:
    """Take a picture of what the page draws of a run."""
    from vico.viewer.headless import page_shot_of, write_still

    width, height = size_of(options.size)
    shot = page_shot_of(follow, options.view, width=width, height=height)
    with _page_of(options.run, options.world) as address:
        write_still(address, options.out, shot, step)
    print(options.out)
    return 0


@contextmanager
def _report_if_interrupted(out: Path, report: Report, rate: int) -> Iterator[Callable[[int, int], None]]:
    """Give what is told of a film's frames; where the block is interrupted, say how much of the film is there."""
    from vico.render.film import partial_film

    made, wanted = 0, 0

    def report_frames(done: int, count: int) -> None:
        nonlocal made, wanted
        made, wanted = done, count
        report("film", done, count)

    try:
        yield report_frames
    except KeyboardInterrupt as stop:
        if not made:
            raise
        sentence = (
            f"{partial_film(out)}: stopped after {made} of {wanted} frames, {made / rate:.1f} s that can be played"
        )
        raise CommandInterrupted(signal_of(stop), sentence) from None


@contextmanager
def _page_of(path: Path, world: Path | None) -> Iterator[str]:
    """Serve a run's page while the block lasts; give its address."""
    from vico.cli.live import city_of
    from vico.viewer.headless import browser_program
    from vico.viewer.three import three_module

    require_server()
    # What is missing is said before anything is begun.
    browser_program()
    three_module()
    from vico.viewer.server.serve import ViewerServer
    from vico.viewer.server.state import ViewerState
    from vico.viewer.sources.source import Source
    from vico.viewer.sources.views import RecordedViews

    source = Source.of_run(path, world=world)
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
    import numpy as np

    from vico.clock import seconds_of_day

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


def followed_name(run: Run, text: str, first: int, last: int, *, option: str) -> str:
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
    from vico.sim.config import find_by_name

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


def replay(path: Positional[Path], no_film: bool = False, world: Path | None = None) -> int:
    """Make the replay page (and the film) of a recorded run.

    Example: vico replay morning

    Args:
        path: Run folder; a run that was cut short shows what it had.
        no_film: Leave demo.mp4 out.
        world: The world it ran in, if it is no longer where it was.
    """
    from vico.sim.recording import read_run
    from vico.sim.recording.schema import DEMO_FILM, REPLAY
    from vico.viewer.replay import recording_of, write_demo_film, write_replay
    from vico.world.folder import is_world, read_world

    run = read_run(path)
    folder = world or run.source("world")
    if not is_world(folder):
        raise MissingFileError(f"{path}: its world is no longer at {folder}; say where it is with --world")
    place = read_world(folder)
    recording = recording_of(run)
    with progress_bars() as report:
        report("ground picture", 0, 1)
        picture = _from_above(place, folder)
        report("ground picture", 1, 1)
        report("replay page", 0, 1)
        write_replay(path / REPLAY, recording, place, picture=picture)
        report("replay page", 1, 1)
        if not no_film and recording.views:
            report("film", 0, 1)
            write_demo_film(path / DEMO_FILM, recording, place)
            report("film", 1, 1)
    print(path / "replay.html")
    return 0


def _from_above(world: World, folder: Path) -> NDArray[np.uint8]:
    """Return the picture the world was built with; taken now where it was built without pictures."""
    import numpy as np
    from PIL import Image

    from vico.render import render_top_down
    from vico.render.world_scene import scene_of
    from vico.worldgen.previews import Overhead

    kept = folder / "previews" / "above.png"
    if kept.is_file():
        try:
            with Image.open(kept, formats=("PNG",)) as image:
                return np.asarray(image.convert("RGB"))
        except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
            raise SchemaError(f"{kept}: not a readable picture ({error}); build the world anew") from None
    return render_top_down(scene_of(world, rooms=False), world.half, Overhead().side)


def score_pictures(
    pictures: Positional[Path],
    photos: Path,
    weights: Path,
    scale: Literal["-1..1", "0..1", "0..255", "imagenet"] = "-1..1",
    json: bool = False,
) -> int:
    """Say how much pictures look like photos: FID and KID by a feature network of your own.

    Example: vico score-pictures stills --photos street_photos --weights inception_v3.onnx

    Args:
        pictures: Folder of pictures (.jpg, .png), folders in it too.
        photos: Folder of photos.
        weights: The network, an ONNX file: pictures in, features out. Needs the extra "scores".
        scale: What it wants bytes to be turned into.
        json: Print JSON.
    """
    from vico.viewer.picture_scores import FeatureNetwork, pictures_in, scores

    network = FeatureNetwork(weights, scale=scale)
    found = asdict(scores(network.features(pictures_in(pictures)), network.features(pictures_in(photos))))
    found |= {"weights": weights.name, "scale": scale}
    if json:
        print_json(found)
    else:
        print_table(f"{pictures} beside {photos}", found)
    return 0
