"""The `vico` command: one verb a capability, how its words become values, and what is said of those that cannot.

Exit codes: 0 done, 1 found wanting (a check failed), 2 bad input or a fault of the program (one sentence on stderr;
the traceback of a fault shows with `vico --verbose VERB`). Results go to stdout, progress and warnings to stderr;
`vico --verbose VERB` tells more there, `vico --quiet VERB` less. Each verb imports what it needs when it runs, so
`vico --help` is quick.
"""

from __future__ import annotations

import difflib
import errno
import gc
import io
import logging
import os
import sys
import types
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn, Union, get_args

import tyro
from tyro.conf import Positional
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo
from tyro.extras import SubcommandApp

from vico.cli import viewer
from vico.cli.assets import assets, motion
from vico.cli.check_agent import check_agent
from vico.cli.city import city
from vico.cli.console import ended_by_signals, exit_code
from vico.cli.dataset import dataset
from vico.cli.evaluation import evaluation
from vico.cli.leaderboard import leaderboard
from vico.cli.options import (
    CommaSeparated,
    CommunityBuildOptions,
    RayAddress,
    RunOptions,
    WorldBuildOptions,
    with_ray_address,
)
from vico.cli.viewer import FilmOptions, StillOptions
from vico.errors import InputError, VicoError, line_of, sentence_of
from vico.io.files import reason_of
from vico.version import __version__

#: Reads numbers with our own words for what is none, and options that may be left out without "None" in their help.
REGISTRY = ConstructorRegistry()
_LEFT_OUT = "unset"


@REGISTRY.primitive_rule
def _numbers(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    if info.type not in (int, float):
        return None
    kind, words, example = (int, "whole number", "300") if info.type is int else (float, "number", "0.5")

    def read(given: list[str]) -> int | float:
        try:
            return kind(given[0])
        except ValueError:
            raise ValueError(f"{given[0]!r} is no {words}; give one such as {example}") from None

    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=kind.__name__.upper(),
        instance_from_str=read,
        is_instance=lambda value: isinstance(value, kind) or (kind is float and isinstance(value, int)),
        str_from_instance=lambda value: [str(value)],
    )


@REGISTRY.primitive_rule
def _optional(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    kinds = get_args(info.type)
    if info.type_origin not in (Union, types.UnionType) or len(kinds) != 2 or type(None) not in kinds:
        return None
    inner = next(kind for kind in kinds if kind is not type(None))
    spec = ConstructorRegistry.get_primitive_spec(PrimitiveTypeInfo.make(inner, info.markers))
    if not isinstance(spec, PrimitiveConstructorSpec):
        return None
    return PrimitiveConstructorSpec(
        nargs=spec.nargs,
        metavar=spec.metavar,
        instance_from_str=spec.instance_from_str,
        is_instance=lambda value: True if value is None else spec.is_instance(value),
        str_from_instance=lambda value: [_LEFT_OUT] if value is None else spec.str_from_instance(value),
        choices=spec.choices,
    )


def check_verb(given: Sequence[str], verbs: Mapping[str, Sequence[str]]) -> None:
    """Make sure that the words before the options are a verb.

    Parameters
    ----------
    verbs
        By the first word, what may come after it; empty where that is up to the verb.

    Raises
    ------
    InputError
        If they are not; the verb that is nearest is named.
    """
    if not given or given[0].startswith("-"):
        return
    first, *rest = given
    if first not in verbs:
        _refuse(first, "", verbs)
    second = rest[0] if rest else ""
    if verbs[first] and second and not second.startswith("-") and second not in verbs[first]:
        _refuse(second, f"{first} ", verbs[first])


def _refuse(word: str, before: str, known: Sequence[str] | Mapping[str, Any]) -> None:
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.55)
    # "build" is a verb of several things, and none by itself.
    meant = f"did you mean vico {before}{near[0]}?" if near else f"there are {', '.join(known)}"
    raise InputError(f"no verb {before + word!r}; {meant}")


# The fields of a record are options of the verb itself, not of a part of it.
FLAT = tyro.conf.arg(name="")

_VERBOSITY = {"--verbose": logging.INFO, "--quiet": logging.ERROR}

app = SubcommandApp()
world = SubcommandApp()
community = SubcommandApp()
check = SubcommandApp()
language_model = SubcommandApp()


@world.command(name="build")
def world_build(options: Annotated[WorldBuildOptions, FLAT]) -> int:
    """Make a world from OpenStreetMap data. A build that was killed goes on where it stopped.

    Example: vico world build --lat 60.1690 --lon 24.9435 --out helsinki

    Example: vico world build --lat 48.8530 --lon 2.3499 --out paris

    Example: vico world build --osm monaco.osm.pbf --center 43.7338,7.4181 --dem srtm.tif --out monaco
    Example: vico world build --osm berlin.osm.pbf --buildings lod2.gml --buildings overture.parquet --out berlin
    """
    from vico.cli import world as verb

    return verb.build_as_asked(options)


@world.command(name="rebuild")
def world_rebuild(path: Positional[Path], stage: CommaSeparated, layout_llm: bool = False, json: bool = False) -> int:
    """Run stages of a world again, and whatever depends on what they change.

    Example: vico world rebuild helsinki --stage objects,indoor

    Args:
        path: World folder.
        stage: Names of stages, separated by commas; a wrong one names them all.
        layout_llm: With the language model that drew its floor plans.
        json: Print the result as JSON.
    """
    from vico.cli import world as verb

    names = [name.strip() for name in stage.split(",") if name.strip()]
    author = verb.layout_author(None, None, None) if layout_llm else None
    return verb.rebuild(path, names, author=author, json=json)


@world.command(name="build-many")
def world_build_many(
    table: Positional[Path],
    out: str,
    extracts: Path | None = None,
    only: str = "",
    workers: int = 0,
    ray: RayAddress = None,
    force: bool = False,
    json: bool = False,
) -> int:
    """Build a table of places side by side.

    The table is CSV: name,lat,lon and, where wanted, osm,radius,dem,tiles,gtfs,places,photos,layouts,things,
    buildings,precedence,seed. Semicolons, tabs, decimal commas and columns such as City or Longitude are read too; a
    row that can't be read is told with its line.
    Worlds that are there are kept, those that fail are told at the end (exit 1) and do not stop the others.

    Example: vico world build-many places.csv --out worlds --workers 4

    Example: vico world build-many paper35 --out worlds

    Example: vico world build-many places.csv --out s3://bucket/worlds --ray

    Args:
        table: The places; file names in it are relative to it. Or the name of a list, such as paper35.
        extracts: For a list: folder with maps of its places; the others are fetched.
        only: Names of the places to build, separated by commas; all without.
        out: Parent folder of the worlds, or a URL like s3://BUCKET/worlds (the extra "s3").
        workers: Processes side by side; 0 is one a processor.
        ray: Hand the places to a Ray cluster instead (the extra "ray"): its address; without one, that which runs here.
        force: Build anew worlds that are there.
        json: Print the outcomes as JSON.
    """
    from vico.cli import world as verb

    places = verb.rows_of_table(table, extracts=extracts, only=only)
    return verb.build_table(places, out=out, workers=workers or os.cpu_count() or 1, ray=ray, force=force, json=json)


@world.command(name="info")
def world_info(path: Positional[Path], json: bool = False) -> int:
    """Say what a world holds.

    Example: vico world info helsinki --json

    Args:
        path: World folder.
        json: Print JSON.
    """
    from vico.cli import world as verb

    return verb.info(path, json=json)


@community.command(name="build")
def community_build(options: Annotated[CommunityBuildOptions, FLAT]) -> int:
    """People a world: homes, jobs, groups and a full day, or several, for each resident.

    Example: vico community build helsinki --residents 15 --day friday --days 3 --out people

    Example: vico community build helsinki --llm --llm-budget-tokens 400000 --out people
    """
    from vico.cli import community as verb

    return verb.build(options)


@community.command(name="day")
def community_day(path: Positional[Path], day: str, out: Path, force: bool = False, json: bool = False) -> int:
    """Take one of several days of a community, as a community of its own that runs can live through.

    Example: vico community day people --day saturday --out people_saturday

    Args:
        path: Community folder, built with --days.
        day: A date like 2025-06-07, or a day of the week like saturday: the first one there is.
        out: Folder to make; refused if it exists, unless --force.
        force: Replace what this verb made there before; refused if the folder holds anything else.
        json: Print the result as JSON.
    """
    from vico.cli import community as verb

    return verb.day(path, day=day, out=out, force=force, json=json)


@app.command(name="export")
def export(
    path: Positional[Path],
    to: Literal["gltf", "usd", "mjcf", "geojson", "xodr"],
    out: Path,
    rooms: bool = False,
    force: bool = False,
    json: bool = False,
) -> int:
    """Write a world in another format: glTF, OpenUSD, MuJoCo, GeoJSON, OpenDRIVE.

    Example: vico export helsinki --to mjcf --out helsinki_mjcf

    Args:
        path: World folder.
        to: The format. "usd" needs the extra of that name.
        out: Folder to make; refused if it exists, unless --force.
        rooms: With what lies indoors.
        force: Replace what this verb made there before; refused if the folder holds anything else.
        json: Print the result as JSON.
    """
    from vico.cli import world as verb

    return verb.export(path, to, out=out, rooms=rooms, force=force, json=json)


@check.command(name="world")
def check_world(path: Positional[Path], json: bool = False) -> int:
    """Check a world: schema, hashes, buildings, entrances, rooms, lanes, transit. Exit 1 if anything is wrong.

    Args:
        path: World folder.
        json: Print JSON.
    """
    from vico.cli import world as verb

    return verb.check(path, json=json)


@check.command(name="community")
def check_community(path: Positional[Path], world: Path | None = None, json: bool = False) -> int:
    """Check that a community is grounded in its world. Exit 1 if anything is wrong.

    Args:
        path: Community folder.
        world: World folder; without it, the one the community was made for, if it is still where it was.
        json: Print JSON.
    """
    from vico.cli import community as verb

    return verb.check(path, world=world, json=json)


@app.command(name="run")
def run(options: Annotated[RunOptions, FLAT]) -> int:
    """Simulate a community: residents follow their schedules among robots, traffic and transit.

    Example: vico run helsinki people --start 08:00 --steps 1800 --out morning

    Example: vico run helsinki people --observe none --robots none --out fast
    """
    from vico.cli import run as verb

    return verb.run(options)


@app.command(name="replay")
def replay(path: Positional[Path], no_film: bool = False, world: Path | None = None) -> int:
    """Make the replay page (and the film) of a recorded run.

    Example: vico replay morning

    Args:
        path: Run folder; a run that was cut short shows what it had.
        no_film: Leave demo.mp4 out.
        world: The world it ran in, if it is no longer where it was.
    """
    from vico.cli import film as verb

    return verb.replay(path, film=not no_film, world=world)


@app.command(name="film")
def film(options: Annotated[FilmOptions, FLAT]) -> int:
    """Film somebody in a recorded run: it is simulated again with what was done in it, and looked at from beside.

    Example: vico film morning --follow resident_3 --start 08:05 --stop 08:06 --out walk.mp4
    """
    from vico.cli import film as verb

    return verb.film(options)


@app.command(name="still")
def still(options: Annotated[StillOptions, FLAT]) -> int:
    """Take a picture of somebody in a recorded run.

    Example: vico still morning --follow resident_3 --at 08:05 --view side --out walk.png

    Example: vico still morning --follow resident_3 --at 08:05 --headless --out walk.png
    """
    from vico.cli import film as verb

    return verb.still(options)


@app.command(name="score-pictures")
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
    from vico.cli import film as verb

    return verb.score_pictures(pictures, photos=photos, weights=weights, scale=scale, json=json)


@app.command(name="demo")
def demo(out: Path = Path("out/demo"), seed: int = 0, force: bool = False) -> int:
    """Do the main job once: build central Helsinki, people it, simulate half an hour, show it.

    Args:
        out: Folder to make; refused if it exists, unless --force.
        seed: Decides everything that is left to chance.
        force: Replace the folders world, community, run and evening there; what else lies beside them stays.
    """
    from vico.cli import demo as verb

    return verb.demo(out, seed=seed, force=force)


@language_model.command(name="serve")
def llm_serve(model: Path | None = None, context: int = 8192, threads: int = 1, port: int = 0) -> int:
    """Serve a language model on this machine, and print the variables that name it. Needs the extra "llm".

    Example: vico llm serve

    Example: vico llm serve --model qwen2.5-7b-instruct-q4_k_m.gguf --threads 8

    Args:
        model: Weights in GGUF. Without it the small ones of `vico assets install llm`, which only show that all works.
        context: Longest question and answer together, tokens.
        threads: Processor threads; beside other work, one is the fastest.
        port: Of 127.0.0.1; 0 takes a free one.
    """
    from vico.cli import assets as verb

    return verb.serve_language_model(model, context=context, threads=threads, port=port)


@app.command(name="doctor")
def doctor(thorough: bool = False, json: bool = False) -> int:
    """Say whether this machine has what vico needs, and what is missing. Exit 1 if something needed is missing.

    Args:
        thorough: Try it all, too: draw, write a film, simulate. Where nothing is compiled yet that takes minutes.
        json: Print JSON.
    """
    from vico.cli import doctor as verb

    return verb.doctor(thorough=thorough, json=json)


@app.command(name="bench")
def bench(
    what: Positional[Literal["render", "sim", "world", "memory"]], table: Path | None = None, json: bool = False
) -> int:
    """Measure speed and memory on this machine, on the packaged place with 15 residents.

    Example: vico bench render

    Example: vico bench world --table benchmarks/results/world.md

    Args:
        what: What to measure.
        table: Write the table to this file, too.
        json: Print the tables as JSON.
    """
    from vico.cli import demo as verb

    return verb.bench(what, table=table, json=json)


@app.command(name="warm-up")
def warm_up() -> int:
    """Compile the hot loops once, so that the first run starts quickly."""
    from vico.cli import demo as verb

    return verb.warm_up()


# Verbs of several words, by the first.
_GROUPS = {
    "world": world,
    "city": city,
    "community": community,
    "check": check,
    "assets": assets,
    "motion": motion,
    "llm": language_model,
    "eval": evaluation,
    "dataset": dataset,
    "leaderboard": leaderboard,
}
app.command(world, name="world", help="Make worlds and look into them.")
app.command(city, name="city", help="Make cities of tiles.")
app.command(community, name="community", help="People a world.")
app.command(check, name="check", help="Check a world or a community.")
app.command(assets, name="assets", help="Richer bodies, robots and things; things out of words.")
app.command(motion, name="motion", help="Motions of other programs, and of recorded people.")
app.command(language_model, name="llm", help="A language model on this machine.")
app.command(evaluation, name="eval", help="Judge agents on a challenge.")
app.command(dataset, name="dataset", help="Datasets of demonstrations, for trainers.")
app.command(leaderboard, name="leaderboard", help="A public file of what methods came to.")
app.command(name="check-agent")(check_agent)
app.command(name="view")(viewer.view)
app.command(name="live")(viewer.live)
app.command(name="play")(viewer.play)


_log = logging.getLogger("vico")


def _fault(error: Exception) -> str:
    """Say what went wrong that is not the caller's doing; the traceback goes to the log."""
    _log.info("where it failed", exc_info=error)
    return (
        f"{sentence_of(error)} at {line_of(error)}: a fault of vico; please report it, with what the same command says "
        "after vico --verbose"
    )


def _sentence(error: OSError) -> str:
    """Say what the operating system refused, where, and what to do about it."""
    if error.filename is None and error.errno != errno.ENOSPC:
        return _fault(error)
    where = f"{error.filename}: " if error.filename is not None else ""
    return f"{where}{reason_of(error, writing=False)}"


def _configure_logging(given: list[str]) -> list[str]:
    """Let warnings of the library go to stderr, more or less with `_VERBOSITY` before the verb; return the rest."""
    level = _VERBOSITY.get(given[0]) if given else None
    logging.basicConfig(format="vico: %(message)s")
    logging.getLogger("vico").setLevel(logging.WARNING if level is None else level)
    return given if level is None else given[1:]


def _replace_what_cannot_be_shown() -> None:
    """Let a terminal of seven bits show what it can of a name, where Python would end the program."""
    for stream, errors in ((sys.stdout, "replace"), (sys.stderr, "backslashreplace")):
        if isinstance(stream, io.TextIOWrapper) and stream.errors in ("strict", "surrogateescape"):
            # In the C locale Python lets through what it could not read, and no more.
            stream.reconfigure(errors=errors)


def _leave(code: int, sentence: str = "") -> NoReturn:
    """Say why, and end with this exit code when all that was printed is out."""
    try:
        if sentence:
            print(f"vico: {sentence}", file=sys.stderr)
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        # Whoever read the output, `head` for one, has had enough; nothing may be flushed into the closed pipe.
        # Both may be the pipe (2>&1), and what is left for either would be flushed into it when the program ends.
        for stream in (sys.stdout, sys.stderr):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        code = code or 141
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        print(f"vico: stdout: {reason_of(error)}", file=sys.stderr)
        code = 2
    sys.exit(code)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; a sentence for whatever goes wrong, never a traceback."""
    gc.set_threshold(20_000, 20, 20)  # what is imported is never garbage: imports alone take a seventh less
    _replace_what_cannot_be_shown()
    given = _configure_logging(sys.argv[1:] if arguments is None else arguments)
    try:
        if given == ["--version"]:
            print(__version__)
            _leave(0)
        verbs = {name: list(_GROUPS[name]._subcommands) if name in _GROUPS else [] for name in app._subcommands}
        check_verb(given, verbs)
        with ended_by_signals():
            code = app.cli(
                prog="vico",
                description="An open world for humans, robots and society.",
                args=with_ray_address(given),
                registry=REGISTRY,
                config=(tyro.conf.FlagCreatePairsOff, tyro.conf.OmitArgPrefixes),
            )
    except SystemExit as end:  # help was asked for, options were refused, or rich found the pipe closed
        _leave(141 if isinstance(end.__context__, BrokenPipeError) else end.code if isinstance(end.code, int) else 0)
    except VicoError as error:
        _leave(2, str(error))
    except BrokenPipeError:
        _leave(141)
    except OSError as error:
        _leave(2, _sentence(error))
    except KeyboardInterrupt as stop:
        _leave(exit_code(stop), str(stop) or "stopped; what was finished is on disk")
    except Exception as error:  # whatever: who runs a command is not who mends the program
        _leave(2, _fault(error))
    _leave(code)


if __name__ == "__main__":
    main()
