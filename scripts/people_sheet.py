"""A contact sheet of people: residents of a community side by side, to one scale, each with name, age and occupation.

    python scripts/people_sheet.py docs/images/people.jpg --world helsinki --residents 50 [--temperature 22 --rain 0]
    python scripts/people_sheet.py out/trades.jpg --trades

`--trades` draws somebody of every trade that has clothes of its own instead.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from vico.assets.people import Appearance, body_of
from vico.assets.people.model import dress_for_weather
from vico.community import build_community
from vico.community.people import ResidentDraft
from vico.community.profiles import Wardrobe, trade_clothes
from vico.render import Cameras, Lighting, Scene, render
from vico.render.skinning import batch_bodies, skin
from vico.seeds import rng
from vico.sim.animation import clip_index, pose, style_of
from vico.world.folder import read_world
from vico.world.mesh import Material, Surface

APART, TALL, LABEL = 30.0, 2.08, 24  # metres, metres, pixels


def floor() -> Surface:
    """Return a floor to stand on."""
    corners = np.array([[-40, -40, 0], [40, -40, 0], [40, 2000, 0], [-40, 2000, 0]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Surface.from_triangles(corners, faces, colour=(150, 152, 150), entity=2, material=Material("floor"))


def portraits(looks: list[Appearance], height: int) -> list[NDArray[np.uint8]]:
    """Draw people who stand, each by a camera of their own, all to one scale."""
    count = len(looks)
    bodies = [body_of(look, detail="full") for look in looks]
    style = [style_of(body, rng(1, "manner", k), age=looks[k].age) for k, body in enumerate(bodies)]
    number, speed = np.full(count, clip_index("idle")), np.zeros(count)
    share = np.linspace(0, 1, count, endpoint=False)
    rotations, offsets = pose(number, share, speed, np.stack(style), second=7.0)
    spots = np.column_stack([np.zeros(count), APART * np.arange(count), np.zeros(count)])
    batch = batch_bodies(bodies, [10 + k for k in range(count)])
    vertices, normals = skin(batch, rotations, offsets, spots, np.full(count, 0.25))
    scene = Scene([floor()], lighting=Lighting())
    scene.set_skinned(vertices, normals, batch.triangles, batch.colour, batch.entity)
    away = np.array([7.0, -1.2, 0.35])
    fov = 2 * np.arctan2(TALL / 2, np.linalg.norm(away))
    towards = np.repeat(-away[None], count, axis=0)
    middle = spots + np.array([0.0, 0.0, TALL / 2 - 0.08])
    cameras = Cameras(middle + away, towards, fov_y=float(fov), width=round(0.5 * height), height=height)
    return list(render(scene, cameras, depth=False, segmentation=False, samples=2).rgb)


def sheet(looks: list[Appearance], names: list[tuple[str, str]], *, height: int, columns: int) -> Image.Image:
    """Return the portraits in rows, each with two lines below."""
    drawn = [Image.fromarray(picture) for picture in portraits(looks, height)]
    wide, high = drawn[0].width, height + LABEL
    rows = -(-len(drawn) // columns)
    found = Image.new("RGB", (columns * wide, rows * high), "white")
    pen, font = ImageDraw.Draw(found), ImageFont.load_default(size=9.5)
    for k, (picture, lines) in enumerate(zip(drawn, names, strict=True)):
        x, y = k % columns * wide, k // columns * high
        found.paste(picture, (x, y))
        for line, text in enumerate(lines):
            pen.text((x + 2, y + height + 11 * line), text[:22], "black", font)
    return found


def of_trades() -> tuple[list[Appearance], list[tuple[str, str]]]:
    """Return somebody of every trade that has clothes of its own."""
    wardrobe = Wardrobe(rng(3, "trades"))
    looks, names = [], []
    for k, trade in enumerate(trade for clothes in trade_clothes() for trade in clothes.trades):
        draft = ResidentDraft(f"resident_{k}", ("female", "male")[k % 2], 24 + 7 * k % 38, "worker", k)
        draft.occupation = trade
        looks.append(Appearance.from_dict(wardrobe.look_of(draft)))
        names.append((trade, str(draft.age)))
    return looks, names


def main() -> None:
    """Draw a sheet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--world", type=Path, help="world whose people are drawn")
    parser.add_argument("--residents", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--temperature", type=float, help="degrees Celsius; without: as they like best")
    parser.add_argument("--rain", type=float, default=0.0, help="mm/h")
    parser.add_argument("--trades", action="store_true")
    parser.add_argument("--height", type=int, default=250, help="of a picture, pixels")
    arguments = parser.parse_args()
    if arguments.trades:
        looks, names = of_trades()
    else:
        people = build_community(read_world(arguments.world), arguments.residents, arguments.seed).residents
        looks = [Appearance.from_dict(r.appearance) for r in people]
        names = [(f"{r.name}, {r.age}", r.occupation) for r in people]
    if arguments.temperature is not None:
        looks = [dress_for_weather(look, arguments.temperature, arguments.rain) for look in looks]
    sheet(looks, names, height=arguments.height, columns=10).save(arguments.out, quality=80)


if __name__ == "__main__":
    main()
