"""Options of the verbs that have many, as records: parsed by the command line, taken by the verb's module."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal

import tyro
from tyro.conf import Positional

from vico.errors import InputError

CommaSeparated = Annotated[str, tyro.conf.arg(metavar="A,B,...")]
#: Of a Ray cluster; a bare ``--ray`` becomes ``--ray auto``.
RayAddress = Annotated[str | None, tyro.conf.arg(metavar="[ADDRESS]")]
# Several values after one option, or after the same one several times: nobody expects the last alone to count.
Hosts = Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="NAME")]
Words = Annotated[tuple[tuple[str, ...], ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="WORLD...")]
Files = Annotated[tuple[tuple[Path, ...], ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="FILE...")]
#: The fields of a record are options of the verb itself, not of a part of it.
FLAT = tyro.conf.arg(name="")
_RAY_ADDRESS = re.compile(r"auto|local|ray://.+|[^/\s]+:\d+")


@dataclass(frozen=True)
class WorldBuildOptions:
    """What `vico world build` is asked for.

    Attributes
    ----------
    out
        Folder to make; refused if it exists, unless --force.
    osm
        Map extract, .osm or .osm.pbf, plain or packed. Without it the packaged extract is used if it covers the
        window, else an Overpass server is asked.
    lat
        Latitude of the window's centre, degrees.
    lon
        Longitude of the window's centre, degrees.
    center
        Both in one. Without any, the middle of the extract.
    radius
        Half the window's side, metres.
    dem
        Elevation: GeoTIFF, .hgt, packed .hgt, or a .laz or .las point cloud; one or several. Flat ground without, and
        where they don't reach.
    buildings
        Buildings of other sources: CityJSON (.json, .jsonl), CityGML (.gml), Overture's GeoParquet; one or several. A
        model that does not say its reference system is followed by it: city.json@EPSG:7415.
    precedence
        Which source decides what, a .toml file like the packaged vico/data/sources/precedence.toml.
    tiles
        Photogrammetry: path or address of a tileset.json. Ground, heights and walls are taken from it.
    photos
        Street pictures: a folder with poses, or "mapillary" (MAPILLARY_TOKEN in the environment).
    places
        Further places: Overture GeoParquet files, or "google" (your key in the environment).
    gtfs
        Timetables: zipped GTFS feeds.
    layouts
        Folder of room layouts to choose from.
    detections
        Things that a detector found in posed street photos, or that somebody located: COCO's JSON, or GeoJSON.
    things
        Whose models street furniture and furniture wear: our own, or those of `vico assets install things`.
    overpass
        Address of the Overpass server, or "off"; else the environment's VICO_OVERPASS, else the public one.
    refresh
        Ask the server even if its answer is in the cache.
    texel
        Side of a texel of photographed walls, metres.
    inpaint
        What fills parts of walls that no photo shows.
    upscale
        What makes photographed walls finer.
    model
        For "diffusion": a folder with the model, or its name on a hub.
    matcher
        What finds the points that a street photo and a render of the world have in common.
    matcher_weights
        For "loftr": its checkpoint file.
    mask
        What finds people and vehicles in street photos: what the render does not show, or what the words for them
        mean to a detector.
    mask_detector
        For "grounded": a folder with a Grounding DINO model.
    mask_segmenter
        For "grounded": a folder with a Segment Anything model.
    layout_llm
        A language model draws floor plans (VICO_LLM_BASE_URL, VICO_LLM_MODEL, VICO_LLM_KEY).
    llm_calls
        Most calls to it.
    llm_tokens
        Most tokens.
    llm_cost
        Most dollars, at the prices of VICO_LLM_PRICE.
    seed
        Decides what the map leaves open.
    force
        Replace what is in the output folder; stages whose inputs did not change are kept.
    json
        Print the result as JSON.
    """

    out: Path
    osm: Path | None = None
    lat: float | None = None
    lon: float | None = None
    center: Annotated[str | None, tyro.conf.arg(metavar="LAT,LON")] = None
    radius: float = 400.0
    dem: Files = ()
    buildings: Files = ()
    precedence: Path | None = None
    tiles: str | None = None
    photos: str | None = None
    places: tuple[str, ...] = ()
    gtfs: Files = ()
    layouts: Path | None = None
    detections: Path | None = None
    things: Literal["procedural", "installed"] = "procedural"
    overpass: str | None = None
    refresh: bool = False
    texel: float = 0.10
    inpaint: Literal["exemplar", "patchmatch", "diffusion", "none"] = "exemplar"
    upscale: Literal["none", "sharpen", "realesrgan", "diffusion"] = "none"
    model: str = ""
    matcher: Literal["sift", "xfeat", "loftr"] = "sift"
    matcher_weights: str = ""
    mask: Literal["differences", "grounded"] = "differences"
    mask_detector: str = ""
    mask_segmenter: str = ""
    layout_llm: bool = False
    llm_calls: int | None = None
    llm_tokens: int | None = None
    llm_cost: float | None = None
    seed: int = 0
    force: bool = False
    json: bool = False

    def centre(self) -> tuple[float, float] | None:
        """Return latitude and longitude of the window's centre, degrees; None for the extract's middle.

        Raises
        ------
        InputError
            If the centre is given twice, by half, or not as two numbers.
        """
        if self.center is not None:
            if self.lat is not None or self.lon is not None:
                raise InputError("world build: give --center or --lat and --lon, not both")
            try:
                lat, lon = (float(part) for part in self.center.split(","))
            except ValueError:
                raise InputError(
                    f"--center: {self.center!r} is not LAT,LON; write for example 60.1690,24.9435"
                ) from None
            return lat, lon
        if self.lat is None and self.lon is None:
            return None
        if self.lat is None or self.lon is None:
            raise InputError("world build: --lat and --lon go together")
        return self.lat, self.lon


@dataclass(frozen=True)
class CommunityBuildOptions:
    """What `vico community build` is asked for.

    Attributes
    ----------
    path
        World folder.
    out
        Folder to make; refused if it exists, unless --force.
    residents
        How many people.
    seed
        Decides who they are.
    day
        First day, a date like 2025-06-07 or a day of the week like saturday; a working day by seed without it.
    days
        How many days everybody has a schedule for.
    llm
        A language model writes them (VICO_LLM_BASE_URL, VICO_LLM_MODEL, VICO_LLM_KEY); what it leaves is written by
        rule.
    llm_only
        Refuse to leave anything to the rules.
    llm_concurrency
        Questions to it under way at a time.
    llm_budget_tokens
        Most tokens.
    llm_budget_cost
        Most dollars, at the prices of VICO_LLM_PRICE.
    llm_timeout
        Seconds until an answer has to be there.
    llm_cache
        Folder of its answers, in which the same question is found again; without it, one in the user's cache.
    llm_record
        File to which all its answers are appended.
    llm_replay
        Such a file, from which they are taken instead; no server is needed.
    force
        Replace what this verb made there before; refused if the folder holds anything else.
    json
        Print the result as JSON.
    """

    path: Positional[Path]
    out: Path
    residents: int = 15
    seed: int = 0
    day: str | None = None
    days: int = 1
    llm: bool = False
    llm_only: bool = False
    llm_concurrency: int = 4
    llm_budget_tokens: int | None = None
    llm_budget_cost: float | None = None
    llm_timeout: float = 120.0
    llm_cache: Path | None = None
    llm_record: Path | None = None
    llm_replay: Path | None = None
    force: bool = False
    json: bool = False

    @property
    def asks_model(self) -> bool:
        """Whether a language model is asked: --llm, or a recording of one.

        Raises
        ------
        InputError
            If an option of the language model is given without it.
        """
        asks = self.llm or self.llm_only or self.llm_replay is not None
        given = {
            "--llm-budget-tokens": self.llm_budget_tokens,
            "--llm-budget-cost": self.llm_budget_cost,
            "--llm-cache": self.llm_cache,
            "--llm-record": self.llm_record,
        }
        unused = [name for name, value in given.items() if value is not None]
        if unused and not asks:
            raise InputError(f"community build: {unused[0]} is for a language model: add --llm")
        return asks


@dataclass(frozen=True)
class RunOptions:
    """What `vico run` is asked for.

    Attributes
    ----------
    world
        World folder.
    community
        Community folder, made for that world.
    out
        Folder to record into; refused if it exists, unless --force. A run that was cut short there goes on.
    resume
        Folder of a run that was cut short, instead of all others but --agent: it goes on from its last checkpoint.
    start
        Time of day, HH:MM or HH:MM:SS.
    date
        Of the first day, YYYY-MM-DD; the community's day unless given.
    utc_offset
        Hours that clocks are ahead of UTC there; without it, as the time zone of 15 degrees the world lies in.
    weather
        A kind of weather, "changing", or a weather file (.json).
    events
        Of the city: none, "changing", or a file of events (.json).
    opening_hours
        Places keep the hours that the map says.
    steps
        Seconds to simulate.
    robots
        Names, separated by commas; none for no robots.
    robot_places
        File (.json) of where robots start: {"robot_0": [x, y, yaw]}; metres and radians. Without it by the seed.
    assistant_places
        Likewise, where assistants start.
    physics
        Engine that moves robots: mujoco, or genesis (an extra).
    cars
        How many cars drive around; unset: 30, or as many as there is room for.
    cyclists
        How many people nobody plays ride bicycles in the streets.
    pedestrians
        How many people nobody plays walk around; unset: 30, or as many as there is room for.
    junctions
        Who may be in a junction: one vehicle at a time; those who are not in each other's way (shared); the same by
        signals, where the map has them; or one at a time by signals (both).
    traffic
        File of cars and pedestrians that are placed by hand (.json), beside the others; none for none.
    observe
        Whose views are rendered: all, none, or names separated by commas.
    outputs
        What they are given: rgb, depth, segmentation, normals, flow, semantic, separated by commas.
    keep
        Which of these are recorded as arrays (views/AGENT/STEP.npz), beside the film of what each agent saw.
    cameras
        A file (.json) of lenses by agent, model of robot, or residents, assistants, robots: docs/pictures.md.
    wear
        NAME=FILE.glb, separated by commas: heads and bodies of your own that people wear (docs/adding_people.md).
    quality
        Of these pictures: plain, or fine (soft shadows, darker corners, smooth edges, mirroring glass).
    renderer
        What makes them: cpu, or gl for OpenGL (the extra "gl").
    memory
        Gigabytes that what cameras see of a city may take; the rest is read again when somebody looks there.
    assistants
        How many avatars take part that are nobody's resident: assistant_0, ...
    agent
        Who plays them: my_module:MyAgent, or path/to/file.py:MyAgent. Without it they wait.
    talk
        How residents answer what they are asked: in the sentences of templates, or worded by a language model (llm:
        VICO_LLM_BASE_URL, VICO_LLM_MODEL, VICO_LLM_KEY), for which the run waits.
    deadline
        Seconds that agents given with --agent have for an action; who is late waits a step. 0 waits for them as long
        as it takes.
    isolate
        Ask each of them in a process of its own.
    states_every
        Checkpoint after so many steps, from which the run can go on if it is cut short; 0 for none but where Ctrl-C or
        SIGTERM stops it. Without it every 300 steps, if all agents have a state.
    workers
        Threads that render, and agents that are asked at a time where there is no deadline; 0 is one a processor.
        Decides nothing but how long it takes.
    seed
        Decides everything that is left to chance.
    check
        Look for overlaps of bodies after every sub-step; with any, the exit code is 1.
    interventions
        A file of what is done to the run from outside (interventions.jsonl of a run's folder): it is done again.
    live
        Show the run in a browser while it goes on, and let hands reach it from there (the extra "viewer").
    speed
        With --live: simulated seconds a second at most; 0 is as fast as it goes.
    paused
        With --live: wait before the first step until somebody lets it go on.
    port
        With --live: where the page is, on this machine alone; 0 takes a free one.
    allow_host
        With --live: a name, beside this machine's own, under which a proxy or a forwarded port shows the page; may be
        given several times.
    idle
        With --live: seconds without a page open after which the run waits for one; 0: it never waits.
    force
        Replace what this verb made there before; refused if the folder holds anything else.
    json
        Print the metrics as JSON.
    """

    world: Positional[Annotated[Path | None, tyro.conf.arg(metavar="WORLD")]] = None
    community: Positional[Annotated[Path | None, tyro.conf.arg(metavar="COMMUNITY")]] = None
    out: Path | None = None
    resume: Path | None = None
    start: str = "08:00"
    date: str | None = None
    utc_offset: float | None = None
    weather: str = "fair"
    events: str = "none"
    opening_hours: bool = False
    steps: int = 1800
    robots: CommaSeparated = "husky,go2"
    robot_places: Path | None = None
    assistant_places: Path | None = None
    physics: Literal["mujoco", "genesis"] = "mujoco"
    cars: int | None = None
    cyclists: int = 0
    pedestrians: int | None = None
    junctions: Literal["one", "shared", "signals", "both"] = "one"
    traffic: str = "none"
    observe: CommaSeparated = "all"
    outputs: CommaSeparated = "rgb,depth,segmentation"
    keep: CommaSeparated = "none"
    cameras: Path | None = None
    wear: CommaSeparated = ""
    quality: Literal["plain", "fine"] = "plain"
    renderer: Literal["cpu", "gl"] = "cpu"
    memory: float = 2.0
    assistants: int = 0
    agent: Annotated[str, tyro.conf.arg(metavar="MODULE:NAME")] = ""
    talk: Literal["templates", "llm"] = "templates"
    deadline: float = 60.0
    isolate: bool = False
    states_every: int | None = None
    workers: int = 0
    seed: int = 0
    check: Literal["none", "overlaps"] = "none"
    interventions: Path | None = None
    live: bool = False
    speed: float = 0.0
    paused: bool = False
    port: int = 0
    allow_host: Hosts = ()
    idle: float = 0.0
    force: bool = False
    json: bool = False


def split_names(text: str) -> list[str]:
    """Return the names of ``A,B,...``."""
    return [name.strip() for name in text.split(",") if name.strip()]


def with_ray_address(words: Sequence[str]) -> list[str]:
    """Return a command line in which ``--ray`` has an address: ``auto`` where none follows it."""
    found: list[str] = []
    for word, following in pairwise([*words, ""]):
        found.append(word)
        if word == "--ray" and not _RAY_ADDRESS.fullmatch(following):
            found.append("auto")
    return found
