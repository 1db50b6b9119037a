"""A sheet of all motions: eight moments of each on somebody with clothes, and of one motion becoming another.

    python scripts/motion_sheet.py docs/images/motions.jpg [--clips walk,run] [--height 150]

A row is a motion, its moments evenly apart, seen from the side that the person's right hand is on, a little from
ahead. Rows with an arrow are transitions, from 0 to 0.9 s. The bicycle, and boxes as high as a seat and a kerb, are
drawn where the motion needs them.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from vico.assets.models.library import in_hand_models
from vico.assets.models.movable import movable_surfaces
from vico.assets.people import Appearance, body_of
from vico.assets.vehicles import bicycle
from vico.render import Cameras, Lighting, Scene, render
from vico.render.skinning import batch_bodies, skin
from vico.seeds import rng
from vico.sim.animation import CLIPS, Hands, Hold, Transition, clip_index, free_hands, ground_under_feet, pose, style_of
from vico.sim.animation.clips import is_seated
from vico.sim.pictures.hands import Holders, draw_phones, draw_umbrellas
from vico.world.mesh import Material, Surface

MOMENTS = 8
APART, TALL = 30.0, 2.1  # metres
SPEEDS = {"walk": 1.2, "carry": 1.0, "carry_left": 1.0, "carry_right": 1.0, "run": 2.5}
TRANSITIONS = (("idle", "walk"), ("walk", "idle"), ("walk", "run"), ("idle", "sit"), ("sit", "idle"), ("idle", "talk"))
HELD = ("walk + umbrella", "idle + umbrella", "walk + parcel", "idle + parcel")
LOOKS = (
    Appearance(age=31, height=1.74, top="jacket", top_colour=(150, 60, 50)),
    Appearance(gender=0.0, age=7, height=1.2, hair="ponytail", top_colour=(80, 140, 90)),
    Appearance(gender=1.0, age=79, height=1.68, hair="bald", build=0.7, top="coat", top_colour=(90, 90, 100)),
    Appearance(gender=0.1, age=45, height=1.66, build=0.8, hair="bob", top="shirt", top_colour=(190, 180, 90)),
)


def flat(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return level ground."""
    return np.zeros(len(points))


def kerb(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ground that is 12 cm higher from x = 0 on."""
    return np.where(points[:, 0] > 0.0, 0.12, 0.0)


def box(x: tuple[float, float], y: tuple[float, float], top: float) -> Surface:
    """Return a box on the floor."""
    corners = np.array([[a, b, c] for a in x for b in y for c in (0.0, top)], np.float32)
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (1, 5, 7, 3), (0, 2, 6, 4))
    faces = [f for q in quads for f in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))]
    return Surface.from_triangles(
        corners, np.array(faces, np.int32), colour=(120, 130, 140), entity=2, material=Material("box")
    )


def row(name: str, look: Appearance, height: int) -> NDArray[np.uint8]:
    """Draw one motion, `name`, or the transition `before > after`."""
    body = body_of(look)
    style = np.repeat(style_of(body, rng(1, "manner", name), age=look.age)[None], MOMENTS)
    spots = np.zeros((MOMENTS, 3))
    before, _, clip = name.rpartition(" > ")
    clip, _, held = clip.partition(" + ")
    uphill = clip == "kerb"
    clip = "walk" if uphill else clip
    number = np.full(MOMENTS, clip_index(clip))
    speed = np.full(MOMENTS, SPEEDS.get(clip, 0.0))
    share = np.linspace(0, 1, MOMENTS, endpoint=False)
    after = None
    if before:
        since = np.linspace(0, 0.9, MOMENTS)
        moving = SPEEDS.get(clip, 0.0)
        share = 0.29 + since * moving / 1.5 if moving else 0.0 * since
        old = np.full(MOMENTS, clip_index(before)), np.full(MOMENTS, 0.1), np.full(MOMENTS, SPEEDS.get(before, 0.0))
        after = Transition(*old, since)
    ground = kerb if uphill else flat
    x = np.linspace(-0.9, 0.7, MOMENTS) if uphill else np.zeros(MOMENTS)
    places = np.column_stack([x, np.zeros(MOMENTS), ground(np.column_stack([x, x]))])
    if uphill:
        share = x / 1.32 % 1.0
    moves = number, share, speed, style
    under = ground_under_feet(*moves, (places, np.zeros(MOMENTS)), ground)
    hands = free_hands(MOMENTS)
    if held:
        hold = {"umbrella": Hold.UMBRELLA_RIGHT, "parcel": Hold.BEFORE_CHEST}[held]
        hands = Hands(hands.gesture, np.full(MOMENTS, int(hold)), np.ones(MOMENTS), np.full(MOMENTS, 0.3))
    rotations, offsets = pose(*moves, second=100.0 + 3.0 * share[0], after=after, ground=under, hands=hands)
    spots[:, 1] = APART * np.arange(MOMENTS)
    batch = batch_bodies([body] * MOMENTS, [10 + k for k in range(MOMENTS)])
    turn = np.full(MOMENTS, 0.0)
    vertices, normals = skin(batch, rotations, offsets, spots + places, turn)
    solid = [box((-40, 40), (-40, 300), 0.0)]
    solid += [box((0.0, 1.2), (y - 0.4, y + 0.4), 0.12) for y in spots[:, 1] if uphill]
    seated = is_seated(clip_index(clip)) or clip == "ride_bus"
    solid += [box((-0.32, 0.12), (y - 0.25, y + 0.25), 0.45) for y in spots[:, 1] if seated]
    scene = Scene(solid, lighting=Lighting(), prototypes=_prototypes())
    if clip == "ride_bike":
        frames = np.tile(np.eye(4), (MOMENTS, 1, 1))
        frames[:, :3, 3] = spots
        scene.set_rigid(np.full(MOMENTS, scene.names["bicycle"], np.int32), frames, np.full(MOMENTS, 5))
    who = Holders(
        batch.joints, rotations, offsets, spots + places, turn, number, share, hands,
        np.full(MOMENTS, body.height), np.arange(MOMENTS, dtype=np.int32),
    )  # fmt: skip
    in_hand(scene, who, held or _MEALS.get(clip, ""))
    scene.set_skinned(vertices, normals, batch.triangles, batch.colour, batch.entity)
    return pictures(scene, spots, height)


_MEALS = {"drink": "paper_cup", "eat": "sandwich", "sit_drink": "mug", "sit_eat": "sandwich", "phone": "phone"}


def _prototypes() -> dict[str, list[Surface]]:
    known = {name: model.surfaces for name, model in in_hand_models().items()}
    return known | {"bicycle": [bicycle()], "parcel": movable_surfaces("parcel", "red")}


def in_hand(scene: Scene, who: Holders, what: str) -> None:
    """Put what people of a row hold into the scene."""
    if not what:
        return
    rows = np.arange(MOMENTS)
    if what in ("umbrella", "phone"):
        drawn = draw_umbrellas(who, MOMENTS) if what == "umbrella" else draw_phones(who)
        assert drawn is not None
        rows = rows[: len(drawn.index)]
        frames, names = drawn.transforms, [drawn.prototypes[k] for k in drawn.index]
    else:
        palms = who.palms(rows)
        points = palms.mean(axis=1) - np.array([0.0, 0.0, 0.12]) if what == "parcel" else palms[:, 1]
        frames, names = np.tile(np.eye(4), (MOMENTS, 1, 1)), [what] * MOMENTS
        if what == "sandwich":  # it points at the face
            frames[:, :2, :2] *= -1.0
        frames[:, :3, 3] = who.world(rows, points)
    index = np.array([scene.names[name] for name in names], np.int32)
    scene.set_rigid(index, np.asarray(frames, np.float64), np.full(len(rows), 7))


def pictures(scene: Scene, spots: NDArray[np.float64], height: int) -> NDArray[np.uint8]:
    """Draw everybody of a row from ahead of their right side, each by a camera of their own."""
    away, target = np.array([4.5, -7.2, 1.5]), spots + np.array([0.05, 0.0, 0.9])
    fov = 2 * np.arctan2(TALL / 2, np.linalg.norm(away))
    look = np.repeat(-away[None], len(spots), axis=0)
    cameras = Cameras(target + away, look, fov_y=float(fov), width=round(0.8 * height), height=height)
    drawn = render(scene, cameras, depth=False, segmentation=False, samples=2).rgb
    return np.concatenate(list(drawn), axis=1)


def main() -> None:
    """Draw the rows and put them into two columns."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--clips", default="", help="motions, with commas between; all if not given")
    parser.add_argument("--height", type=int, default=150, help="of a person's picture, pixels")
    parser.add_argument("--columns", type=int, default=2, help="of rows beside each other")
    arguments = parser.parse_args()
    names = (
        arguments.clips.split(",")
        if arguments.clips
        else [*CLIPS, *HELD, "kerb", *(f"{a} > {b}" for a, b in TRANSITIONS)]
    )
    drawn = [Image.fromarray(row(name, LOOKS[k % len(LOOKS)], arguments.height)) for k, name in enumerate(names)]
    wide, high = drawn[0].width + 6, drawn[0].height + 4
    rows = -(-len(names) // arguments.columns)
    sheet = Image.new("RGB", (arguments.columns * wide - 6, rows * high - 4), "white")
    for k, (name, picture) in enumerate(zip(names, drawn, strict=True)):
        ImageDraw.Draw(picture).text((4, 2), name, "black", ImageFont.load_default(13))
        sheet.paste(picture, (k // rows * wide, k % rows * high))
    sheet.save(arguments.out, quality=34, optimize=True)


if __name__ == "__main__":
    main()
