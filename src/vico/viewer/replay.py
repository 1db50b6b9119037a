"""The replay of a recorded run: one HTML page with everything inside, and the demo film.

A `Recording` holds positions by second and body, events, and who is who. The page has the map, the moving agents,
schedules, log and first-person pictures. The demo film shows the map with everybody moving, beside what four of them
see.
"""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont

from vico.clock import seconds_of_day
from vico.english import split_name
from vico.io.files import write_bytes
from vico.render.film import write_film
from vico.sim.recording import Run, View
from vico.threads import in_order
from vico.world.walkable import CROSSING, OPEN, ROADWAY, SIDEWALK
from vico.world.world import World


@dataclass(frozen=True)
class RecordedBody:
    """Something that moves; `agent` is the agent's name, None for traffic."""

    entity: int
    kind: str
    name: str
    length: float
    width: float
    agent: str | None


@dataclass(frozen=True)
class RecordedEvent:
    """Something that happened: `step` seconds after the start."""

    step: int
    kind: str
    agent: str
    text: str
    position: tuple[float, float]


@dataclass(frozen=True)
class Recording:
    """A run, whole or as far as it came.

    Attributes
    ----------
    start
        Second of the day at which it began.
    tracks
        x, y, yaw by step and body, float32, shape ``(steps + 1, n, 3)``; NaN where a body was not there.
    people
        Name, role, a few lines, and the schedule of each agent, by agent name.
    views
        First-person films, by agent name.
    view_steps
        The step of the run that each second of `tracks` shows, int64, shape ``(steps + 1,)``.
    """

    path: Path
    start: int
    tracks: NDArray[np.float32]
    bodies: list[RecordedBody]
    events: list[RecordedEvent]
    people: dict[str, dict[str, Any]]
    views: dict[str, View]
    view_steps: NDArray[np.int64]
    metrics: dict[str, Any]
    state_hash: str

    @property
    def steps(self) -> int:
        """Seconds recorded."""
        return len(self.tracks) - 1

    def body_of(self, agent: str) -> int:
        """Index of an agent's body."""
        return next(i for i, body in enumerate(self.bodies) if body.agent == agent)

    def pictures(self, agent: str, seconds: Sequence[int]) -> Iterator[NDArray[np.uint8] | None]:
        """Yield what an agent saw at each of some ascending seconds, or last before; None before its first picture."""
        steps = self.view_steps[list(seconds)].tolist()
        frames = self.views[agent].frames(set(steps))
        picture: NDArray[np.uint8] | None = None
        coming = next(frames, None)
        for step in steps:
            if coming is not None and coming[0] <= step:
                picture, coming = coming[1], next(frames, None)
            yield picture

    def key_pictures(self, agent: str) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        """Yield second and picture of what an agent saw, wherever a whole frame is stored."""
        for step, picture in self.views[agent].key_frames():
            yield min(int(np.searchsorted(self.view_steps, step)), self.steps), picture

    def travelled_metres(self) -> NDArray[np.float64]:
        """Metres each body covered, leaving out jumps through doors; shape ``(n,)``."""
        moves = np.diff(self.tracks[:, :, :2].astype(np.float64), axis=0)
        metres = np.linalg.norm(moves, axis=2)
        metres[~(metres < 15.0)] = 0.0
        return np.asarray(metres.sum(axis=0))


# Told by the map and the schedule already, or only of use to developers.
_SILENT = {"refused", "collision"}


def recording_of(run: Run) -> Recording:
    """Read what the page and the film show out of a run: its state at every whole second."""
    # The last recorded step of each second since the start: every step, where all agents act once a second.
    times = run.times - run.times[0]
    seconds = np.arange(int(times[-1] + 1e-6) + 1)
    chosen = np.searchsorted(times, seconds + 1e-6) - 1
    tracks = run.tracks()
    cast = {int(entity): run.cast[int(entity)] for entity in tracks.entity}
    bodies = [RecordedBody(e, b.kind, b.name, b.size[0], b.size[1], b.agent) for e, b in cast.items()]
    events = [
        RecordedEvent(
            min(int(np.searchsorted(chosen, e["step"])), len(chosen) - 1),
            e["kind"],
            e["agent"],
            e["text"],
            (e["x"], e["y"]),
        )
        for e in run.events
        if e["kind"] not in _SILENT
    ]
    return Recording(
        path=run.path,
        start=int(run.manifest["start"]),
        tracks=np.concatenate([tracks.position[chosen, :, :2], tracks.yaw[chosen, :, None]], axis=-1, dtype=np.float32),
        bodies=bodies,
        events=events,
        people={agent["name"]: _agent_record(agent, cast[agent["entity"]].name) for agent in run.agents},
        views=run.views,
        view_steps=chosen,
        metrics=run.metrics,
        state_hash=run.hashes[-1],
    )


def _agent_record(agent: dict[str, Any], shown: str) -> dict[str, Any]:
    person = agent["person"]
    if person is None:
        return {"name": shown, "role": agent["kind"], "about": "", "schedule": []}
    return {
        "name": person["name"],
        "role": person["occupation"],
        "about": f"{person['age']}. {person['biography']}",
        "schedule": [
            {"start": s["start"], "end": s["end"], "activity": s["activity"], "where": s["place"], "type": s["type"]}
            for s in person["schedule"]
        ],
    }


UNIT = 0.02  # metres a track unit, at best: 16 bits reach 655 m; wider runs have larger units
_HIDDEN = -32768


def write_replay(path: Path, recording: Recording, world: World, *, picture: NDArray[np.uint8] | None = None) -> None:
    """Write the page; it opens from disk in any browser, without a network.

    Parameters
    ----------
    picture
        The world seen from above, north up, uint8, shape ``(n, n, 3)``: shown under the map on request.
    """
    page = files("vico.viewer").joinpath("replay_page.html").read_text(encoding="utf-8")
    data = json.dumps(page_data(recording, world, picture=picture), separators=(",", ":"), ensure_ascii=False)
    # Names come from the map: nothing in them may end the script element, or open a comment in it.
    write_bytes(path, page.replace("/*DATA*/", data.replace("<", "\\u003c")).encode())


def page_data(recording: Recording, world: World, *, picture: NDArray[np.uint8] | None = None) -> dict[str, Any]:
    """Everything the page shows, as JSON types."""
    names = list(recording.people)
    numbers = {name: i for i, name in enumerate(names)}
    manifest = world.manifest
    reach = np.abs(recording.tracks[..., :2])
    unit = max(UNIT, float(np.max(reach, initial=0.0, where=np.isfinite(reach))) / 32_000)
    credit = "; ".join(dict.fromkeys(source.attribution for source in manifest.sources if source.attribution))

    def pictures(name: str) -> list[tuple[int, str]]:
        """Return what an agent saw every 20 s or so: views are filmed with a whole frame that often."""
        if name not in recording.views:
            return []
        return [(second, _uri(frame, 60)) for second, frame in recording.key_pictures(name)]

    bodies = []
    for body in recording.bodies:
        entry = {"kind": body.kind, "name": body.agent or body.name, "length": body.length, "width": body.width}
        if body.agent is not None:
            entry["agent"] = numbers[body.agent]
        bodies.append(entry)
    return {
        "title": f"Virtual Community: {manifest.name}",
        "subtitle": f"{recording.steps // 60} minutes, {len(recording.bodies)} bodies, "
        f"state {recording.state_hash[:16]}",
        "credit": credit,
        "half": world.half,
        "start": recording.start,
        "steps": recording.steps,
        "unit": unit,
        "tracks": _tracks(recording.tracks, unit),
        "bodies": bodies,
        "events": [
            {
                "t": e.step,
                "kind": e.kind,
                "who": e.agent,
                "name": recording.people.get(e.agent, {}).get("name", e.agent),
                "text": e.text,
            }
            for e in recording.events
        ],
        "agents": [
            recording.people[name] | {"id": name, "pictures": seen}
            for name, seen in zip(names, in_order(pictures, names), strict=True)
        ],
        "metrics": {k: v for k, v in recording.metrics.items() if isinstance(v, (int, float, str))},
        "picture": _uri(picture, 80) if picture is not None else None,
        **_map_record(world),
    }


def _tracks(tracks: NDArray[np.float32], unit: float) -> str:
    turns = tracks[..., 2:] - 2 * np.pi * np.rint(tracks[..., 2:] / (2 * np.pi))
    scaled = np.concatenate([tracks[..., :2] / unit, turns * 10_000], axis=-1)
    gone = ~np.isfinite(scaled).all(axis=-1)
    # Yaw of +-pi is +-31,416: it fits beside the mark for a body that is not there.
    whole = np.clip(np.nan_to_num(np.rint(scaled)), -32767, 32767).astype("<i2")
    whole[gone] = _HIDDEN
    return base64.b64encode(whole.tobytes()).decode()


def _uri(image: NDArray[np.uint8], quality: int) -> str:
    packed = io.BytesIO()
    Image.fromarray(image).save(packed, "WEBP", quality=quality, method=2)
    return "data:image/webp;base64," + base64.b64encode(packed.getvalue()).decode()


def _flat(points: Iterable[Iterable[float]]) -> list[int]:
    """Decimetres, x and y in turn."""
    return [round(10 * value) for point in points for value in list(point)[:2]]


def _map_record(world: World) -> dict[str, Any]:
    walked = {"footway", "path", "pedestrian", "steps", "cycleway", "track", "bridleway", "corridor"}
    objects = world.objects
    trees = (objects.kind == "tree") & (objects.room == "")
    return {
        "buildings": [
            {"rings": [_flat(ring) for ring in b.footprint], "open": int(b.accessible)} for b in world.buildings
        ],
        "roads": [
            {"w": road.width, "kind": "walk" if road.kind in walked else "drive", "line": _flat(road.line)}
            for road in world.roads.roads
            if road.layer >= 0
        ],
        "trees": _flat(zip(objects.x[trees].tolist(), objects.y[trees].tolist(), strict=True)),
        "places": [
            {"x": round(10 * p.position[0]), "y": round(10 * p.position[1]), "name": p.name, "kind": str(p.category)}
            for p in world.places
        ],
    }


_MAP_PAPER = (244, 242, 238)
_SURFACES = {OPEN: (232, 234, 226), SIDEWALK: (236, 228, 214), CROSSING: (250, 240, 214), ROADWAY: (255, 255, 255)}
_HOUSE, _OPEN_HOUSE, _EDGE = (205, 197, 186), (190, 178, 160), (160, 152, 142)
_TREE = (127, 181, 138)


class MapPicture:
    """The base map at one scale, and where a point lies on it.

    Parameters
    ----------
    pixels
        Side of the square image.
    """

    def __init__(self, world: World, pixels: int) -> None:
        self.half = world.half
        self.pixels = pixels
        self.image = self._draw(world)

    def to_pixels(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Image coordinates (x right, y down) of ENU points, shape ``(..., 2)``."""
        points = np.asarray(xy, np.float64)
        scale = self.pixels / (2 * self.half)
        return np.stack([(points[..., 0] + self.half) * scale, (self.half - points[..., 1]) * scale], axis=-1)

    def _draw(self, world: World) -> Image.Image:
        # The ground comes from the walkable grid: it already tells roadway, pavement and open ground apart.
        table = np.full((256, 3), _MAP_PAPER, np.uint8)
        for surface, colour in _SURFACES.items():
            table[surface] = colour
        ground = Image.fromarray(table[world.walkable.cls[::-1]])
        large = self.pixels * 2  # drawn at twice the size and reduced: smooth edges
        picture = ground.resize((large, large), Image.Resampling.BILINEAR)
        draw = ImageDraw.Draw(picture)
        for building in world.buildings:
            for k, ring in enumerate(building.footprint):
                points = [tuple(p) for p in self.to_pixels(np.asarray(ring)) * 2]
                fill = _MAP_PAPER if k else (_OPEN_HOUSE if building.accessible else _HOUSE)
                draw.polygon(points, fill=fill, outline=_EDGE)
        objects = world.objects
        trees = np.column_stack([objects.x, objects.y])[(objects.kind == "tree") & (objects.room == "")]
        radius = max(2.0 * large / (2 * self.half), 1.5)
        for x, y in self.to_pixels(trees) * 2:
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=_TREE)
        return picture.resize((self.pixels, self.pixels), Image.Resampling.LANCZOS)


WIDTH, HEIGHT = 1280, 720
RATE = 16
SECONDS = 21.0
_INK, _SOFT, _PAPER = (29, 35, 41), (93, 104, 115), (255, 255, 255)
_COLOURS = {
    "resident": (213, 94, 0),
    "assistant": (0, 0, 0),
    "robot": (204, 121, 167),
    "car": (0, 114, 178),
    "bus": (230, 159, 0),
    "bicycle": (0, 158, 115),
    "pedestrian": (122, 133, 144),
}
_LABELS = {"resident": "residents", "robot": "robots", "car": "cars", "bus": "buses", "pedestrian": "passers-by"}
_TILE = 264
_LEFT = HEIGHT + 8


def write_demo_film(path: Path, recording: Recording, world: World) -> int:
    """Write the film, about `SECONDS` long (never under 20 s); return the number of frames."""
    return write_film(path, _frames(recording, world), rate=RATE, threads=2)


def _frames(recording: Recording, world: World) -> Iterator[NDArray[np.uint8]]:
    base = MapPicture(world, HEIGHT)
    stage = Image.new("RGB", (WIDTH, HEIGHT), _PAPER)
    stage.paste(base.image, (0, 0))
    _furnish(stage, recording, world, base)
    count = max(round(SECONDS * RATE), 1)
    times = np.linspace(0, recording.steps, count)
    chosen = _most_alive(recording, 4)
    steps = [int(time) for time in times]
    films = {name: recording.pictures(name, sorted(set(steps))) for name in chosen}

    def moments() -> Iterator[tuple[float, list[NDArray[np.uint8] | None]]]:
        views: list[NDArray[np.uint8] | None] = [None] * len(chosen)
        for k, (time, step) in enumerate(zip(times, steps, strict=True)):
            if k == 0 or step != steps[k - 1]:
                views = [next(films[name]) for name in chosen]
            yield float(time), views

    def draw(moment: tuple[float, list[NDArray[np.uint8] | None]]) -> NDArray[np.uint8]:
        time, views = moment
        frame = stage.copy()
        _draw_bodies(frame, recording, base, time, chosen)
        for number, (name, view) in enumerate(zip(chosen, views, strict=True)):
            _draw_view(frame, recording, name, number, view, int(time))
        _draw_talk(frame, recording, int(time))
        return np.asarray(frame)

    # Decoding and encoding go on here while frames are drawn beside.
    yield from in_order(draw, moments())


@cache
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)


def _most_alive(recording: Recording, count: int) -> list[str]:
    """Agents with a film of their own who moved most: they have something to show."""
    metres = recording.travelled_metres()
    names = [name for name in recording.people if name in recording.views]
    names.sort(key=lambda name: (-metres[recording.body_of(name)], name))
    robots = [name for name in names if recording.bodies[recording.body_of(name)].kind == "robot"]
    people = [name for name in names if name not in robots]
    # One robot among the people, if there is any.
    chosen = people[: count - len(robots[:1])] + robots[:1]
    return chosen + [name for name in names if name not in chosen][: count - len(chosen)]


def _furnish(stage: Image.Image, recording: Recording, world: World, base: MapPicture) -> None:
    """Draw what never moves: legend, scale bar, north, attribution."""
    draw = ImageDraw.Draw(stage)
    present = [kind for kind in _LABELS if any(body.kind == kind for body in recording.bodies)]
    draw.rounded_rectangle((8, HEIGHT - 34, 40 + 108 * len(present), HEIGHT - 8), 5, fill=_PAPER)
    for k, kind in enumerate(present):
        x = 18 + 108 * k
        draw.ellipse((x, HEIGHT - 26, x + 10, HEIGHT - 16), fill=_COLOURS[kind])
        number = sum(body.kind == kind for body in recording.bodies)
        draw.text((x + 15, HEIGHT - 29), f"{number} {_LABELS[kind]}", _INK, _font(14))
    length = 100 * HEIGHT / (2 * world.half)
    right, bottom = HEIGHT - 14, HEIGHT - 34
    draw.rectangle((right - length - 6, bottom - 22, right + 6, bottom + 6), fill=_PAPER)
    draw.line((right - length, bottom, right, bottom), _INK, 2)
    draw.text((right - length / 2, bottom - 18), "100 m", _INK, _font(13), anchor="ma")
    draw.polygon([(HEIGHT - 20, 12), (HEIGHT - 26, 30), (HEIGHT - 14, 30)], fill=_INK)
    draw.text((HEIGHT - 20, 32), "N", _INK, _font(13), anchor="ma")
    credit = next((s.attribution for s in world.manifest.sources if s.attribution), "")
    draw.text((HEIGHT - 8, HEIGHT - 16), credit, _SOFT, _font(11), anchor="ra")


def _draw_bodies(frame: Image.Image, recording: Recording, base: MapPicture, time: float, chosen: list[str]) -> None:
    draw = ImageDraw.Draw(frame)
    step = min(int(time), recording.steps)
    after = min(step + 1, recording.steps)
    here, there = recording.tracks[step], recording.tracks[after]
    jump = np.linalg.norm(there[:, :2] - here[:, :2], axis=1) > 30
    share = np.where(jump, 0.0, time - step)[:, None]
    points = base.to_pixels(here[:, :2] * (1 - share) + there[:, :2] * share)
    # Traffic first: people are drawn over it.
    order = sorted(range(len(points)), key=lambda i: recording.bodies[i].agent is not None)
    for i in order:
        x, y = points[i]
        if not np.isfinite(x):
            continue
        body = recording.bodies[i]
        radius = {"resident": 5, "assistant": 5, "robot": 5, "bus": 5, "car": 3}.get(body.kind, 2)
        box = (x - radius, y - radius, x + radius, y + radius)
        colour = _COLOURS.get(body.kind, _INK)
        if body.kind in ("car", "bus", "robot"):
            draw.rectangle(box, fill=colour, outline=_PAPER)
        else:
            draw.ellipse(box, fill=colour, outline=_PAPER if radius > 2 else None)
        if body.agent in chosen:
            draw.text((x, y - 20), str(chosen.index(body.agent) + 1), _INK, _font(15), anchor="ma", stroke_width=3,
                      stroke_fill=_PAPER)  # fmt: skip
    clock = recording.start + step
    draw.rounded_rectangle((8, 8, 112, 42), 6, fill=_PAPER)
    draw.text((18, 12), f"{clock // 3600 % 24:02d}:{clock // 60 % 60:02d}:{clock % 60:02d}", _INK, _font(21))


def _draw_view(
    frame: Image.Image, recording: Recording, name: str, number: int, image: NDArray[np.uint8] | None, step: int
) -> None:
    x = _LEFT + (number % 2) * (_TILE + 12)
    y = 8 + (number // 2) * (_TILE + 46)
    if image is not None:
        frame.paste(Image.fromarray(image).resize((_TILE, _TILE), Image.Resampling.BILINEAR), (x, y))
    person = recording.people[name]
    now = recording.start + step
    doing = next(
        (s["activity"] for s in person["schedule"] if seconds_of_day(s["start"]) <= now <= seconds_of_day(s["end"])), ""
    )
    draw = ImageDraw.Draw(frame)
    draw.text((x, y + _TILE + 3), f"{number + 1}  {person['name']}, {person['role']}"[:40], _INK, _font(14))
    draw.text((x, y + _TILE + 21), doing[:44], _SOFT, _font(13))


def _draw_talk(frame: Image.Image, recording: Recording, step: int) -> None:
    """Draw the last things said."""
    said = [e for e in recording.events if e.kind == "message" and step - 180 <= e.step <= step][-3:]
    draw = ImageDraw.Draw(frame)
    for k, event in enumerate(said):
        name = recording.people.get(event.agent, {}).get("name", event.agent)
        y = HEIGHT - 86 + 28 * k
        line = f"{split_name(name)[1]}: {event.text}"
        draw.text((_LEFT, y), line if len(line) < 78 else line[:77] + "…", _INK, _font(14))
