"""The `vico` command: one verb a capability.

Exit codes: 0 done, 1 found wanting (a check failed), 2 bad input (one sentence on stderr, no traceback).
Results go to stdout, progress to stderr. Each verb imports what it needs when it runs, so `vico --help` is quick.
"""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path
from typing import Annotated, Literal

import tyro
from tyro.conf import Positional
from tyro.extras import SubcommandApp

from vico import __version__
from vico.errors import InputError, VicoError

Comma = Annotated[str, tyro.conf.arg(metavar="A,B,...")]

app = SubcommandApp()
world = SubcommandApp()
community = SubcommandApp()
check = SubcommandApp()
evaluation = SubcommandApp()
assets = SubcommandApp()


def _pair(text: str, what: str) -> tuple[float, float]:
    try:
        first, second = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"{what}: {text!r} is not LAT,LON; write for example 60.1690,24.9435") from None
    return first, second


@world.command(name="build")
def world_build(
    out: Path,
    osm: Path | None = None,
    lat: float | None = None,
    lon: float | None = None,
    center: Annotated[str | None, tyro.conf.arg(metavar="LAT,LON")] = None,
    radius: float = 400.0,
    dem: tuple[Path, ...] = (),
    tiles: str | None = None,
    photos: str | None = None,
    places: tuple[str, ...] = (),
    gtfs: tuple[Path, ...] = (),
    layouts: Path | None = None,
    things: Literal["procedural", "installed"] = "procedural",
    overpass: str | None = None,
    refresh: bool = False,
    texel: float = 0.10,
    inpaint: Literal["exemplar", "patchmatch", "diffusion", "none"] = "exemplar",
    upscale: Literal["none", "sharpen", "realesrgan", "diffusion"] = "none",
    model: str = "",
    layout_llm: bool = False,
    llm_calls: int | None = None,
    llm_tokens: int | None = None,
    llm_cost: float | None = None,
    seed: int = 0,
    force: bool = False,
    json: bool = False,
) -> int:
    """Make a world from OpenStreetMap data. A build that was killed goes on where it stopped.

    Example: vico world build --lat 60.1690 --lon 24.9435 --out helsinki

    Example: vico world build --lat 48.8530 --lon 2.3499 --out paris

    Example: vico world build --osm monaco.osm.pbf --center 43.7338,7.4181 --dem srtm.tif --out monaco

    Args:
        out: Folder to make; refused if it exists, unless --force.
        osm: Map extract, .osm or .osm.pbf, plain or packed. Without it the packaged extract is used if it covers the
            window, else an Overpass server is asked.
        lat: Latitude of the window's centre, degrees.
        lon: Longitude of the window's centre, degrees.
        center: Both in one. Without any, the middle of the extract.
        radius: Half the window's side, metres.
        dem: Elevation: GeoTIFF, .hgt or packed .hgt; one or several that cover the window. Flat ground without.
        tiles: Photogrammetry: path or address of a tileset.json. Ground, heights and walls are taken from it.
        photos: Street pictures: a folder with poses, or "mapillary" (MAPILLARY_TOKEN in the environment).
        places: Further places: Overture GeoParquet files, or "google" (your key in the environment).
        gtfs: Timetables: zipped GTFS feeds.
        layouts: Folder of room layouts to choose from.
        things: Whose models street furniture and furniture wear: our own, or those of `vico assets install things`.
        overpass: Address of the Overpass server, or "off"; else the environment's VICO_OVERPASS, else the public one.
        refresh: Ask the server even if its answer is in the cache.
        texel: Side of a texel of photographed walls, metres.
        inpaint: What fills parts of walls that no photo shows.
        upscale: What makes photographed walls finer.
        model: For "diffusion": a folder with the model, or its name on a hub.
        layout_llm: A language model draws floor plans (VICO_LLM_BASE_URL, VICO_LLM_MODEL, VICO_LLM_KEY).
        llm_calls: Most calls to it.
        llm_tokens: Most tokens.
        llm_cost: Most dollars, at the prices of VICO_LLM_PRICE.
        seed: Decides what the map leaves open.
        force: Replace what is in the output folder; stages whose inputs did not change are kept.
        json: Print the result as JSON.
    """
    from vico.cli import world as verb
    from vico.worldgen.photos.texturing import Texturing
    from vico.worldgen.sources import Sources

    if center is not None:
        if lat is not None or lon is not None:
            raise InputError("world build: give --center or --lat and --lon, not both")
        lat, lon = _pair(center, "--center")
    if (lat is None) != (lon is None):
        raise InputError("world build: --lat and --lon go together")
    if osm is None:
        osm = verb.locate(lat, lon, radius, overpass=overpass, refresh=refresh)
    sources = Sources(
        osm,
        dem=dem,
        tiles=tiles,
        photos=photos,
        places=places,
        gtfs=gtfs,
        layouts=layouts,
        installed_things=things == "installed",
    )
    how = Texturing(texel=texel, inpaint=inpaint, upscale=upscale, model=model)
    return verb.build(sources, out=out, lat=lat, lon=lon, half=radius, seed=seed, texturing=how, force=force, json=json)


@world.command(name="rebuild")
def world_rebuild(path: Positional[Path], stage: Comma, layout_llm: bool = False, json: bool = False) -> int:
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
    out: Path,
    workers: int = 0,
    ray: bool = False,
    force: bool = False,
    json: bool = False,
) -> int:
    """Build a table of places side by side.

    The table is CSV: name,lat,lon and, where wanted, osm,radius,dem,tiles,gtfs,places,photos,layouts,things,seed.
    Worlds that are there are kept, those that fail are told at the end (exit 1) and do not stop the others.

    Example: vico world build-many places.csv --out worlds --workers 4

    Args:
        table: The places; file names in it are relative to it.
        out: Parent folder of the worlds.
        workers: Processes side by side; 0 is one a processor.
        ray: Hand the places to a Ray cluster instead (the extra "scale").
        force: Build anew worlds that are there.
        json: Print the outcomes as JSON.
    """
    from vico.cli import world as verb

    return verb.build_table(table, out=out, workers=workers or os.cpu_count() or 1, ray=ray, force=force, json=json)


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
def community_build(
    path: Positional[Path],
    out: Path,
    residents: int = 15,
    seed: int = 0,
    force: bool = False,
    json: bool = False,
) -> int:
    """People a world: homes, jobs, groups and a full day for each resident.

    Example: vico community build helsinki --residents 15 --out people

    Args:
        path: World folder.
        out: Folder to make; refused if it exists, unless --force.
        residents: How many people.
        seed: Decides who they are.
        force: Replace what is in the output folder.
        json: Print the result as JSON.
    """
    from vico.cli import community as verb

    return verb.build(path, out=out, residents=residents, seed=seed, force=force, json=json)


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
        force: Replace what is in the output folder.
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
def run(
    world: Positional[Path],
    community: Positional[Path],
    out: Path,
    start: str = "08:00",
    steps: int = 1800,
    robots: Comma = "husky,go2",
    cars: int = 30,
    pedestrians: int = 30,
    observe: Comma = "all",
    seed: int = 0,
    force: bool = False,
    json: bool = False,
) -> int:
    """Simulate a community: residents follow their schedules among robots, traffic and transit.

    Example: vico run helsinki people --start 08:00 --steps 1800 --out morning

    Example: vico run helsinki people --observe none --robots none --out fast

    Args:
        world: World folder.
        community: Community folder, made for that world.
        out: Folder to record into; refused if it exists, unless --force.
        start: Time of day, HH:MM or HH:MM:SS.
        steps: Seconds to simulate.
        robots: Names, separated by commas; none for no robots.
        cars: How many cars drive around.
        pedestrians: How many people nobody plays walk around.
        observe: Whose views are rendered: all, none, or names separated by commas.
        seed: Decides everything that is left to chance.
        force: Replace what is in the output folder.
        json: Print the metrics as JSON.
    """
    from vico.cli import run as verb

    return verb.run(
        world,
        community,
        out=out,
        start=start,
        steps=steps,
        robots=robots,
        cars=cars,
        pedestrians=pedestrians,
        observe=observe,
        seed=seed,
        force=force,
        json=json,
    )


@app.command(name="replay")
def replay(path: Positional[Path], no_film: bool = False, world: Path | None = None) -> int:
    """Make the replay page (and the film) of a recorded run.

    Example: vico replay morning

    Args:
        path: Run folder; a run that was cut short shows what it had.
        no_film: Leave demo.mp4 out.
        world: The world it ran in, if it is no longer where it was.
    """
    from vico.cli import replay as verb

    return verb.replay(path, film=not no_film, world=world)


@app.command(name="demo")
def demo(out: Path = Path("out/demo"), seed: int = 0, force: bool = False) -> int:
    """Do the main job once: build central Helsinki, people it, simulate half an hour, show it.

    Args:
        out: Folder to make; refused if it exists, unless --force.
        seed: Decides everything that is left to chance.
        force: Replace what is in the output folder.
    """
    from vico.cli import demo as verb

    return verb.demo(out, seed=seed, force=force)


@evaluation.command(name="assistant")
def evaluate_assistant(
    worlds: list[Path],
    out: Path,
    category: Literal["delivery"] = "delivery",
    method: str = "heuristic",
    assistants: int = 1,
    seeds: int = 3,
    steps: int = 1500,
    force: bool = False,
    json: bool = False,
) -> int:
    """Judge a planner on the community assistant tasks.

    Example: vico eval assistant --category delivery --method heuristic --worlds helsinki monaco --seeds 3 --out results

    Args:
        worlds: World folders; one episode for each world and seed.
        out: Folder for tasks and results; refused if it exists, unless --force.
        category: What is asked for.
        method: Planner: random or heuristic.
        assistants: How many assistants work together.
        seeds: Episodes a world, seeded 0, 1, ...
        steps: Seconds an episode may last.
        force: Replace what is in the output folder.
        json: Print the results as JSON.
    """
    from vico.cli import evaluate as verb

    return verb.assistant(
        worlds=worlds,
        out=out,
        category=category,
        method=method,
        assistants=assistants,
        seeds=seeds,
        steps=steps,
        force=force,
        json=json,
    )


@assets.command(name="install")
def assets_install(
    what: Positional[Literal["people", "robots", "things", "all"]] = "all",
    pack: Path | None = None,
    force: bool = False,
) -> int:
    """Fetch richer bodies, robots and furniture from the packages that ship them, and print their licences.

    Example: vico assets install people

    Args:
        what: Which pack.
        pack: For "things": a .deb of sweethome3d-furniture or a folder with its archives. Without it the one the
            system has, else what apt-get downloads.
        force: Fetch and prepare again.
    """
    from vico.cli import assets as verb

    return verb.install(what, pack=pack, force=force)


@assets.command(name="status")
def assets_status() -> int:
    """Say which packs are installed, with their licences."""
    from vico.cli import assets as verb

    return verb.status()


@app.command(name="doctor")
def doctor(json: bool = False) -> int:
    """Say whether this machine has what vico needs, and what is missing. Exit 1 if something needed is missing.

    Args:
        json: Print JSON.
    """
    from vico.cli import doctor as verb

    return verb.doctor(json=json)


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
    from vico.cli import bench as verb

    return verb.bench(what, table=table, json=json)


@app.command(name="warm-up")
def warm_up() -> int:
    """Compile the hot loops once, so that the first run starts quickly."""
    from vico.cli import warm_up as verb

    return verb.warm_up()


app.command(world, name="world", help="Make worlds and look into them.")
app.command(community, name="community", help="People a world.")
app.command(check, name="check", help="Check a world or a community.")
app.command(assets, name="assets", help="Richer bodies and robots.")
app.command(evaluation, name="eval", help="Judge agents on a challenge.")


def _sentence(error: OSError) -> str:
    """What the operating system refused, where, and what to do about it."""
    where = f"{error.filename}: " if error.filename is not None else ""
    if error.errno == errno.ENOSPC:
        return f"{where}no space left on the disk; free some, or choose another --out"
    return f"{where}{(error.strerror or str(error)).lower()}; give a path that can be read and written"


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; never a traceback for bad input."""
    given = sys.argv[1:] if arguments is None else arguments
    if given == ["--version"]:
        print(__version__)
        return
    try:
        code = app.cli(
            prog="vico",
            description="An open world for humans, robots and society.",
            args=given,
            config=(tyro.conf.FlagCreatePairsOff, tyro.conf.OmitArgPrefixes),
        )
    except VicoError as error:
        print(f"vico: {error}", file=sys.stderr)
        sys.exit(2)
    except BrokenPipeError:
        # Whoever read the output, `head` for one, has had enough; nothing may be flushed into the closed pipe.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(141)
    except OSError as error:
        if error.filename is None and error.errno != errno.ENOSPC:
            raise
        print(f"vico: {_sentence(error)}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("vico: stopped; what was finished is on disk", file=sys.stderr)
        sys.exit(130)
    sys.exit(code)


if __name__ == "__main__":
    main()
