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
# Options of all verbs that simulate.
Robots = Annotated[str, tyro.conf.arg(help="Names, separated by commas; none for no robots.", metavar="A,B,...")]
StartTime = Annotated[str, tyro.conf.arg(help="Time of day, HH:MM or HH:MM:SS.")]
FirstDate = Annotated[str | None, tyro.conf.arg(help="Of the first day, YYYY-MM-DD; the community's day unless given.")]
WeatherChoice = Annotated[str, tyro.conf.arg(help='A kind of weather, "changing", or a weather file (.json).')]
EventChoice = Annotated[str, tyro.conf.arg(help='Of the city: none, "changing", or a file of events (.json).')]
Cars = Annotated[
    int | None, tyro.conf.arg(help="How many cars drive around; unset: 30, or as many as there is room for.")
]
Cyclists = Annotated[int, tyro.conf.arg(help="How many people nobody plays ride bicycles in the streets.")]
Pedestrians = Annotated[
    int | None,
    tyro.conf.arg(help="How many people nobody plays walk around; unset: 30, or as many as there is room for."),
]
_RAY_ADDRESS = re.compile(r"auto|local|ray://.+|[^/\s]+:\d+")


@dataclass(frozen=True)
class WorldBuildOptions:
    """What `vico world build` is asked for."""

    out: Path  # Folder to make; refused if it exists, unless --force.
    #: Map extract, .osm or .osm.pbf, plain or packed. Without it the packaged extract is used if it covers the window,
    #: else an Overpass server is asked.
    osm: Path | None = None
    lat: float | None = None  # Latitude of the window's centre, degrees.
    lon: float | None = None  # Longitude of the window's centre, degrees.
    #: Both in one. Without any, the middle of the extract.
    center: Annotated[str | None, tyro.conf.arg(metavar="LAT,LON")] = None
    radius: float = 400.0  # Half the window's side, metres.
    #: Elevation: GeoTIFF, .hgt, packed .hgt, or a .laz or .las point cloud; one or several. Flat ground without, and
    #: where they don't reach.
    dem: Files = ()
    #: Buildings of other sources: CityJSON (.json, .jsonl), CityGML (.gml), Overture's GeoParquet; one or several. A
    #: model that does not say its reference system is followed by it: city.json@EPSG:7415.
    buildings: Files = ()
    #: Which source decides what, a .toml file like the packaged vico/data/worldgen/sources/precedence.toml.
    precedence: Path | None = None
    #: Photogrammetry: path or address of a tileset.json. Ground, heights and walls are taken from it.
    tiles: str | None = None
    #: Street pictures: a folder with poses, or "mapillary" (MAPILLARY_TOKEN in the environment).
    photos: str | None = None
    #: Further places: Overture GeoParquet files, or "google" (your key in the environment).
    places: tuple[str, ...] = ()
    gtfs: Files = ()  # Timetables: zipped GTFS feeds.
    layouts: Path | None = None  # Folder of room layouts to choose from.
    #: Things that a detector found in posed street photos, or that somebody located: COCO's JSON, or GeoJSON.
    detections: Path | None = None
    #: Whose models street furniture and furniture wear: our own, or those of `vico assets install things`.
    things: Literal["procedural", "installed"] = "procedural"
    #: Address of the Overpass server, or "off"; else the environment's VICO_OVERPASS, else the public one.
    overpass: str | None = None
    refresh: bool = False  # Ask the server even if its answer is in the cache.
    texel: float = 0.10  # Side of a texel of photographed walls, metres.
    #: What fills parts of walls that no photo shows.
    inpaint: Literal["exemplar", "patchmatch", "diffusion", "none"] = "exemplar"
    upscale: Literal["none", "sharpen", "realesrgan", "diffusion"] = "none"  # What makes photographed walls finer.
    model: str = ""  # For "diffusion": a folder with the model, or its name on a hub.
    #: What finds the points that a street photo and a render of the world have in common.
    matcher: Literal["sift", "xfeat", "loftr"] = "sift"
    matcher_weights: str = ""  # For "loftr": its checkpoint file.
    #: What finds people and vehicles in street photos: what the render does not show, or what the words for them mean
    #: to a detector.
    mask: Literal["differences", "grounded"] = "differences"
    mask_detector: str = ""  # For "grounded": a folder with a Grounding DINO model.
    mask_segmenter: str = ""  # For "grounded": a folder with a Segment Anything model.
    layout_llm: bool = False  # A language model draws floor plans (VICO_LLM_BASE_URL, VICO_LLM_MODEL, VICO_LLM_KEY).
    llm_calls: int | None = None  # Most calls to it.
    llm_tokens: int | None = None  # Most tokens.
    llm_cost: float | None = None  # Most dollars, at the prices of VICO_LLM_PRICE.
    seed: int = 0  # Decides what the map leaves open.
    force: bool = False  # Replace what is in the output folder; stages whose inputs did not change are kept.
    json: bool = False  # Print the result as JSON.

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
    """What `vico community build` is asked for."""

    path: Positional[Path]  # World folder.
    out: Path  # Folder to make; refused if it exists, unless --force.
    residents: int = 15  # How many people.
    seed: int = 0  # Decides who they are.
    #: First day, a date like 2025-06-07 or a day of the week like saturday; a working day by seed without it.
    day: str | None = None
    days: int = 1  # How many days everybody has a schedule for.
    #: A language model writes them (VICO_LLM_BASE_URL, VICO_LLM_MODEL, VICO_LLM_KEY); what it leaves is written by
    #: rule.
    llm: bool = False
    llm_only: bool = False  # Refuse to leave anything to the rules.
    llm_concurrency: int = 4  # Questions to it under way at a time.
    llm_budget_tokens: int | None = None  # Most tokens.
    llm_budget_cost: float | None = None  # Most dollars, at the prices of VICO_LLM_PRICE.
    llm_timeout: float = 120.0  # Seconds until an answer has to be there.
    #: Folder of its answers, in which the same question is found again; without it, one in the user's cache.
    llm_cache: Path | None = None
    llm_record: Path | None = None  # File to which all its answers are appended.
    llm_replay: Path | None = None  # Such a file, from which they are taken instead; no server is needed.
    force: bool = False  # Replace what this verb made there before; refused if the folder holds anything else.
    json: bool = False  # Print the result as JSON.

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
    """What `vico run` is asked for."""

    world: Positional[Annotated[Path | None, tyro.conf.arg(metavar="WORLD")]] = None  # World folder.
    #: Community folder, made for that world.
    community: Positional[Annotated[Path | None, tyro.conf.arg(metavar="COMMUNITY")]] = None
    #: Folder to record into; refused if it exists, unless --force. A run that was cut short there goes on.
    out: Path | None = None
    #: Folder of a run that was cut short, instead of all others but --agent: it goes on from its last checkpoint.
    resume: Path | None = None
    start: StartTime = "08:00"
    date: FirstDate = None
    #: Hours that clocks are ahead of UTC there; without it, as the time zone of 15 degrees the world lies in.
    utc_offset: float | None = None
    weather: WeatherChoice = "fair"
    events: EventChoice = "none"
    opening_hours: bool = False  # Places keep the hours that the map says.
    steps: int = 1800  # Seconds to simulate.
    robots: Robots = "husky,go2"
    #: File (.json) of where robots start: {"robot_0": [x, y, yaw]}; metres and radians. Without it by the seed.
    robot_places: Path | None = None
    assistant_places: Path | None = None  # Likewise, where assistants start.
    physics: Literal["mujoco", "genesis"] = "mujoco"  # Engine that moves robots: mujoco, or genesis (an extra).
    cars: Cars = None
    cyclists: Cyclists = 0
    pedestrians: Pedestrians = None
    #: Who may be in a junction: one vehicle at a time; those who are not in each other's way (shared); the same by
    #: signals, where the map has them; or one at a time by signals (both).
    junctions: Literal["one", "shared", "signals", "both"] = "one"
    #: File of cars and pedestrians that are placed by hand (.json), beside the others; none for none.
    traffic: str = "none"
    observe: CommaSeparated = "all"  # Whose views are rendered: all, none, or names separated by commas.
    #: What they are given: rgb, depth, segmentation, normals, flow, semantic, separated by commas.
    outputs: CommaSeparated = "rgb,depth,segmentation"
    #: Which of these are recorded as arrays (views/AGENT/STEP.npz), beside the film of what each agent saw.
    keep: CommaSeparated = "none"
    #: A file (.json) of lenses by agent, model of robot, or residents, assistants, robots: docs/pictures.md.
    cameras: Path | None = None
    #: NAME=FILE.glb, separated by commas: heads and bodies of your own that people wear (docs/adding_people.md).
    wear: CommaSeparated = ""
    #: Of these pictures: plain, or fine (soft shadows, darker corners, smooth edges, mirroring glass).
    quality: Literal["plain", "fine"] = "plain"
    renderer: Literal["cpu", "gl"] = "cpu"  # What makes them: cpu, or gl for OpenGL (the extra "gl").
    #: Gigabytes that what cameras see of a city may take; the rest is read again when somebody looks there.
    memory: float = 2.0
    assistants: int = 0  # How many avatars take part that are nobody's resident: assistant_0, ...
    #: Who plays them: my_module:MyAgent, or path/to/file.py:MyAgent. Without it they wait.
    agent: Annotated[str, tyro.conf.arg(metavar="MODULE:NAME")] = ""
    #: How residents answer what they are asked: in the sentences of templates, or worded by a language model (llm:
    #: VICO_LLM_BASE_URL, VICO_LLM_MODEL, VICO_LLM_KEY), for which the run waits.
    talk: Literal["templates", "llm"] = "templates"
    #: Seconds that agents given with --agent have for an action; who is late waits a step. 0 waits for them as long as
    #: it takes.
    deadline: float = 60.0
    isolate: bool = False  # Ask each of them in a process of its own.
    #: Checkpoint after so many steps, from which the run can go on if it is cut short; 0 for none but where Ctrl-C or
    #: SIGTERM stops it. Without it every 300 steps, if all agents have a state.
    states_every: int | None = None
    #: Threads that render, and agents that are asked at a time where there is no deadline; 0 is one a processor.
    #: Decides nothing but how long it takes.
    workers: int = 0
    seed: int = 0  # Decides everything that is left to chance.
    #: Look for overlaps of bodies after every sub-step; with any, the exit code is 1.
    check: Literal["none", "overlaps"] = "none"
    #: A file of what is done to the run from outside (interventions.jsonl of a run's folder): it is done again.
    interventions: Path | None = None
    #: Show the run in a browser while it goes on, and let hands reach it from there (the extra "viewer").
    live: bool = False
    speed: float = 0.0  # With --live: simulated seconds a second at most; 0 is as fast as it goes.
    paused: bool = False  # With --live: wait before the first step until somebody lets it go on.
    port: int = 0  # With --live: where the page is, on this machine alone; 0 takes a free one.
    #: With --live: a name, beside this machine's own, under which a proxy or a forwarded port shows the page; may be
    #: given several times.
    allow_host: Hosts = ()
    idle: float = 0.0  # With --live: seconds without a page open after which the run waits for one; 0: it never waits.
    force: bool = False  # Replace what this verb made there before; refused if the folder holds anything else.
    json: bool = False  # Print the metrics as JSON.


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
