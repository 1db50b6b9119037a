"""The demo film: the map with everybody moving, beside what four of them see."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from vico.clock import seconds_of_day
from vico.english import split_name
from vico.render.film import write_film
from vico.threads import in_order
from vico.viewer.map_picture import MapPicture
from vico.viewer.recording import Recording
from vico.world.world import World

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
    metres = recording.travelled()
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
