"""Rooms behind glass: the shop's own behind its front, painted boxes behind other windows."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import toy_city
from vico.assets.shapes import box
from vico.render import Cameras, Lighting, Scene
from vico.render.frames import PictureRequest, RenderQuality, take_pictures
from vico.render.records import GROUND_WINDOWS, ROOM_FRONT, UPPER_WINDOWS
from vico.render.world_scene import room_fronts
from vico.world.mesh import Material, Surface, merge_surfaces
from vico.world.model import Doorway

INTERIORS = RenderQuality(interiors=True)


def street(windows: int, *, storeys: int = 0) -> Scene:
    """A glass wall along y at x = 0, seen from the west, and a red cube in a grey room at (200, 50, -6)."""
    glass = Material("pane", np.full((8, 8, 4), 128, np.uint8), emission=1.0)
    corners = np.array([[0.0, 4, 0], [0.0, -4, 0], [0.0, -4, 2.8], [0.0, 4, 2.8]])
    pane = Surface.from_triangles(
        corners, np.array([[0, 1, 2], [0, 2, 3]]), uv=np.array([[0.0, 0], [0.3, 0], [0.3, 0.25], [0, 0.25]]),
        entity=1000, material=glass,
    )  # fmt: skip
    ground = box((60, 60, 1), (0, 0, -0.5), colour=(150, 150, 150)).of_entity(2)
    walls = [
        box((8, 0.2, 3), (200, 53.1, -4.5)).of_entity(60),
        box((8, 8, 0.2), (200, 49, -6.1)).of_entity(60),
        box((0.6, 0.6, 0.6), (201, 51, -5.0), colour=(230, 10, 10)).of_entity(61),
    ]
    scene = Scene(
        [*merge_surfaces([ground]), pane],
        indoor=walls,
        rooms=[[200, 49, -6, 4, 4, 3, 0.0]],
        lighting=Lighting.at(13 * 3600),
    )
    record = scene.arrays.textures.materials[scene.material_names.index("pane")]
    record["windows"], record["storeys"] = windows, storeys
    return scene


def with_front(scene: Scene) -> Scene:
    """The room's south wall, in which one looks north, lies behind the glass, in which one looks east."""
    front = np.zeros(1, ROOM_FRONT)
    for name, value in {
        "inward_x": 1, "room_x": 200, "room_y": 45, "room_z": -6, "room_inward_y": 1, "left": -4, "right": 4,
        "height": 2.8, "depth": 8, "half_width": 4,
    }.items():  # fmt: skip
        front[name] = value
    scene.fronts = front
    return scene


def picture(scene: Scene, place: tuple[float, float, float], quality: RenderQuality = INTERIORS) -> NDArray[Any]:
    look = Cameras(np.array([place]), np.array([[1.0, 0.0, 0.0]]), width=200, height=160)
    return take_pictures(scene, look, PictureRequest(quality=quality)).rgb[0].astype(int)


def middle_of_red(rgb: NDArray[Any]) -> tuple[float, float]:
    row, column = np.nonzero((rgb[..., 0] > 2 * rgb[..., 1]) & (rgb[..., 0] > 60))
    return float(row.mean()), float(column.mean())


def test_what_stands_in_a_room_is_seen_where_it_would_be_behind_the_pane() -> None:
    scene = with_front(street(GROUND_WINDOWS))
    # One metre to the right of the door and six in: a metre south of it, and six to the east, on the street's side.
    for x, y, z in ((-5.0, 0.0, 1.6), (-3.0, 2.0, 1.2), (-4.0, -3.0, 1.6)):
        row, column = middle_of_red(picture(scene, (x, y, z)))
        depth = 6.0 - x - 0.3  # mostly its front is seen
        assert abs(column + 0.5 - (100 + 80 * (y + 1.0) / depth)) < 3
        assert abs(row + 0.5 - (80 + 80 * (z - 1.0) / depth)) < 3


def test_without_the_switch_or_a_room_the_pane_is_as_it_was() -> None:
    scene = with_front(street(GROUND_WINDOWS))
    plain = picture(scene, (-5.0, 0.0, 1.6), RenderQuality())
    scene.fronts = scene.fronts[:0]
    assert np.array_equal(picture(scene, (-5.0, 0.0, 1.6), RenderQuality()), plain)
    assert np.array_equal(picture(scene, (-5.0, 0.0, 1.6)), plain)


def test_other_windows_show_a_box_that_shifts_as_the_eye_does() -> None:
    scene = street(UPPER_WINDOWS, storeys=4)
    flat = [picture(scene, (-5.0, y, 1.6), RenderQuality()) for y in (0.0, 0.5)]
    deep = [picture(scene, (-5.0, y, 1.6)) for y in (0.0, 0.5)]
    glass = np.s_[70:100, 80:120]
    assert np.ptp(flat[0][glass]) < 12  # a pane of one colour
    assert np.ptp(deep[0][glass]) > 25
    # 0.5 m at 5 m are 8 columns: what is painted on the pane moves so far, what is behind it less.
    moved = np.roll(deep[1], -8, axis=1)[glass]
    assert np.abs(moved - deep[0][glass]).mean() > 1.0
    assert np.array_equal(np.roll(flat[1], -8, axis=1)[glass], flat[0][glass])


def test_shops_of_a_world_have_their_rooms_behind_their_doors() -> None:
    toy = toy_city.world()
    rooms = [r.model_copy(update={"doors": [Doorway(to="", position=r.door, inside=r.inside)]}) for r in toy.rooms]
    world: Any = SimpleNamespace(places=toy.places, entrances=toy.entrances, rooms=rooms)
    fronts = room_fronts(world)
    shops = {p.id: p.entrance for p in toy.places if p.category in ("store", "food", "entertainment") and p.entrance}
    assert len(fronts) == len({shops[room.place] for room in rooms if room.place in shops}) > 0
    for front in fronts:
        room = rooms[int(front["room"])]
        inside = np.array([front["room_x"], front["room_y"]]) + 0.5 * np.array(
            [front["room_inward_x"], front["room_inward_y"]]
        )
        away = inside - np.array(room.centre[:2])
        c, s = np.cos(room.yaw), np.sin(room.yaw)
        assert abs(away @ (c, s)) < room.size[0] / 2
        assert abs(away @ (-s, c)) < room.size[1] / 2
        assert front["left"] < 0 < front["right"]
