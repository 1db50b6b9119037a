"""Close-ups of eight people of different age, sex and skin: face from the front and three-quarter, a hand.

python scripts/faces_sheet.py docs/images/faces.jpg [--size 230] [--light] [--procedural]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from vico.assets.people import Appearance, J, body_of
from vico.render import Cameras, Lighting, Scene
from vico.render.frames import FINE_QUALITY, PictureRequest, take_pictures
from vico.render.skinning import batch_bodies, skin
from vico.seeds import rng
from vico.sim.animation import clip_index, pose, style_of
from vico.world.mesh import Material, Surface

APART, LABEL = 30.0, 16  # metres, pixels
# Metres that a picture's side shows, of a head and of a hand; how far away the camera is.
HEAD, HAND, DISTANCE = 0.36, 0.30, 1.6
EUROPEAN, AFRICAN, ASIAN = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
PEOPLE = {
    "girl, 6": Appearance(
        0.0, 6, 1.16, 0.4, 0.4, EUROPEAN, (240, 200, 178), "ponytail", (120, 84, 52), top="t-shirt", eyes=(86, 110, 130)
    ),
    "boy, 11": Appearance(1.0, 11, 1.45, 0.4, 0.5, AFRICAN, (112, 70, 48), "crop", (28, 24, 22), top="hoodie"),
    "woman, 24": Appearance(0.0, 24, 1.66, 0.3, 0.5, ASIAN, (236, 196, 160), "long", (28, 24, 22), top="shirt"),
    "man, 33": Appearance(
        1.0, 33, 1.82, 0.4, 0.6, EUROPEAN, (222, 172, 142), "short", (84, 58, 40), beard=True, top="jacket"
    ),
    "woman, 41": Appearance(
        0.0, 41, 1.70, 0.6, 0.5, AFRICAN, (141, 92, 66), "curly", (28, 24, 22), glasses=True, top="dress"
    ),
    "man, 52": Appearance(
        1.0,
        52,
        1.71,
        0.6,
        0.5,
        ASIAN,
        (205, 160, 122),
        "crop",
        (60, 56, 54),
        glasses=True,
        top="suit",
        bottom="trousers",
    ),
    "woman, 68": Appearance(
        0.0, 68, 1.60, 0.6, 0.4, EUROPEAN, (232, 186, 160), "bob", (176, 172, 168), glasses=True, eyes=(90, 104, 76)
    ),
    "man, 84": Appearance(1.0, 84, 1.70, 0.4, 0.3, EUROPEAN, (236, 190, 168), "bald", (200, 198, 194), top="shirt"),
}


def floor() -> Surface:
    """Return a floor to stand on."""
    corners = np.array([[-40, -40, 0], [40, -40, 0], [40, 2000, 0], [-40, 2000, 0]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Surface.from_triangles(corners, faces, colour=(150, 152, 150), entity=2, material=Material("floor"))


def close_ups(looks: list[Appearance], size: int, **body: str) -> list[list[NDArray[np.uint8]]]:
    """Draw each person's face from the front, three-quarter, and a hand."""
    count = len(looks)
    bodies = [body_of(look, **body) for look in looks]  # type: ignore[arg-type]
    style = [style_of(one, rng(1, "manner", k), age=looks[k].age) for k, one in enumerate(bodies)]
    moving, speed = np.full(count, clip_index("idle")), np.zeros(count)
    rotations, offsets = pose(moving, np.zeros(count), speed, np.stack(style), second=7.0)
    spots = np.column_stack([np.zeros(count), APART * np.arange(count), np.zeros(count)])
    batch = batch_bodies(bodies, [10 + k for k in range(count)])
    vertices, normals = skin(batch, rotations, offsets, spots, np.full(count, 0.25))
    scene = Scene([floor()], lighting=Lighting(sun_direction=(0.8, -0.45, 0.6)))
    scene.set_skinned(vertices, normals, batch.triangles, batch.colour, batch.entity)
    ends = np.cumsum([len(one.vertices) for one in bodies])
    drawn = []
    for one, end in zip(bodies, ends, strict=True):
        own, carried = vertices[end - len(one.vertices) : end], one.weight_joints[:, 0]
        eyes = own[np.isin(carried, [J["left_eye"], J["right_eye"]])].mean(0)
        hand = own[np.isin(carried, [J["left_wrist"], *range(J["left_index1"], J["right_index1"])])].mean(0)
        ahead = np.array([np.cos(0.25), np.sin(0.25), 0.0])
        left = np.array([-ahead[1], ahead[0], 0.0])
        views = (
            (eyes - [0, 0, 0.025], 1.0 * ahead, HEAD),
            (eyes - 0.05 * ahead - [0, 0, 0.025], 0.7 * ahead + 0.71 * left, HEAD),
            (hand, 0.55 * ahead + 0.8 * left + [0, 0, 0.2], HAND),
        )
        pictures = []
        for middle, way, wide in views:
            away = DISTANCE * way / np.linalg.norm(way)
            cameras = Cameras(
                (middle + away)[None], -away[None], width=size, height=size, fov_y=2 * np.arctan(wide / 2 / DISTANCE)
            )
            request = PictureRequest(samples=2, quality=FINE_QUALITY)
            pictures.append(take_pictures(scene, cameras, request, threads=1).rgb[0])
        drawn.append(pictures)
    return drawn


def sheet(drawn: list[list[NDArray[np.uint8]]], names: list[str]) -> Image.Image:
    """Return the pictures, a column for each person."""
    size = drawn[0][0].shape[0]
    found = Image.new("RGB", (len(drawn) * size, LABEL + 3 * size), "white")
    pen, font = ImageDraw.Draw(found), ImageFont.load_default(size=11)
    for k, (pictures, name) in enumerate(zip(drawn, names, strict=True)):
        pen.text((k * size + 4, 2), name, "black", font)
        for row, picture in enumerate(pictures):
            found.paste(Image.fromarray(picture), (k * size, LABEL + row * size))
    return found


def main() -> None:
    """Draw a sheet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--size", type=int, default=230, help="of a picture, pixels")
    parser.add_argument("--light", action="store_true", help="the bodies of simulations instead of those of films")
    parser.add_argument("--procedural", action="store_true", help="bodies without the installed data")
    arguments = parser.parse_args()
    detail, source = "light" if arguments.light else "full", "procedural" if arguments.procedural else "best"
    drawn = close_ups(list(PEOPLE.values()), arguments.size, detail=detail, source=source)
    sheet(drawn, list(PEOPLE)).save(arguments.out, quality=86)


if __name__ == "__main__":
    main()
