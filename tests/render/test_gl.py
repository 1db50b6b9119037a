"""OpenGL beside the processor: the same scene, pixel by pixel. Left out where moderngl or a driver is missing."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from vico.assets.shapes import ball, box, pose_matrix
from vico.assets.transit_vehicles import bus, bus_cabin
from vico.assets.vehicles import night_lamps
from vico.errors import InputError, MissingExtraError
from vico.render import Cameras, Lighting, Scene
from vico.render.cameras import Lens
from vico.render.frames import FINE_QUALITY, PictureRequest, take_pictures
from vico.render.gl.renderer import GlRenderer
from vico.render.limbs import LIMBS
from vico.render.records import GROUND_WINDOWS, OPENING, ROOM_FRONT, UPPER_WINDOWS
from vico.render.viewers import Viewers
from vico.render.world_scene import placed_lamps
from vico.sim.config import SimConfig
from vico.world.mesh import Material, merge_surfaces

DAY, NIGHT = Lighting.at(15 * 3600), Lighting.at(23 * 3600, clouds=0.8)
OUTSIDE = Cameras(np.array([[-14.0, -6.0, 2.0]]), np.array([[1.0, 0.4, -0.1]]), width=160, height=120, hidden_entity=8)
NEAR = replace(OUTSIDE, width=320, height=240)  # people are tall enough for arms and legs
INSIDE = Cameras(np.array([[100.0, 1.0, 1.6]]), np.array([[0.7, -1.0, -0.2]]), width=160, height=120)


def scene() -> Scene:
    """Textured blocks, cut-out leaves, many levels of detail, things and bodies that move, and a room far away."""
    generator = np.random.Generator(np.random.PCG64(4))
    brick = Material("brick", generator.integers(60, 200, (64, 64, 4)).astype(np.uint8), emission=1.0)
    ground = Material("ground", generator.integers(100, 160, (64, 64, 3)).astype(np.uint8))
    holes = np.full((32, 32, 4), 120, np.uint8)
    holes[..., 3] = np.where(generator.random((32, 32)) < 0.5, 255, 0)
    leaf = Material("leaf", holes, cutout=True, double_sided=True)
    floor = box((80, 80, 1), (0, 0, -0.5)).of_entity(2)
    static = [replace(floor, material=ground, uv=floor.positions[:, :2] / 2)]
    for k in range(12):
        x, y, z = generator.uniform((-10, -20, 1), (30, 20, 6))
        block = box((3, 2, 2 * z), (x, y, z)).of_entity(10 + k)
        static.append(replace(block, material=brick, uv=(block.positions[:, [0, 2]] + block.positions[:, 1:2]) / 3))
    slab = box((0.02, 3, 3), (-7.99, 1.5, 1.5)).of_entity(30)
    static.append(replace(slab, material=replace(brick, name="shop"), uv=slab.positions[:, 1:] / 8))
    room = [box((8, 0.2, 3), (100, -3, 1.5)), box((8, 8, 0.2), (100, 0, -0.1)), box((0.2, 8, 3), (104, 0, 1.5))]
    pane = box((0.05, 2, 1), (103.85, -1.5, 1.5))
    room.append(replace(pane, material=replace(ground, name="pane", emission=1.0), uv=pane.positions[:, 1:]))
    crown = ball((1.5, 1.5, 1.5), (0, 0, 2), colour=(80, 140, 60), sides=14, rings=10)
    models = {
        "tree": [replace(crown, material=leaf, uv=crown.positions[:, :2])],
        "cube": [box((1, 1, 1), (0, 0, 0.5), colour=(200, 40, 40))],
        "bus": [bus(), night_lamps("bus")],
        "crown": [replace(crown, material=Material("glow", emission=1.0))],
    }
    made = Scene(
        merge_surfaces(static),
        models,
        indoor=[s.of_entity(60) for s in room],
        rooms=[[100, 0, 0, 4, 4, 3, 0.0]],
        cabins={"bus": bus_cabin()},
        lighting=DAY,
    )
    brick = made.arrays.textures.materials[made.material_names.index("brick")]
    brick["windows"], brick["storeys"] = UPPER_WINDOWS, 4
    made.arrays.textures.materials["windows"][made.material_names.index("shop")] = GROUND_WINDOWS
    places = [pose_matrix(*generator.uniform((-8, -18), (30, 18)), 0, k) for k in range(40)]
    made.place(["tree"] * 40, np.array(places), np.arange(100, 140))
    made.place(["cube"], np.array([pose_matrix(102, -1, 0, 0.4)]), [70], indoor=True)
    index = [made.names[name] for name in ("cube", "cube", "bus")]
    places = [pose_matrix(-8, -3, 0, 0.3), pose_matrix(-9, 0, 0, 1), pose_matrix(4, 9, 0, 2.6)]
    made.set_rigid(index, np.array(places), [5, 8, 6])
    figure = ball((0.3, 0.3, 0.9), (-7, -5, 0.9), colour=(90, 120, 200)).of_entity(9)
    made.set_skinned(figure.positions, figure.normals, figure.triangles, figure.colour, figure.entity)
    places = np.array([pose_matrix(x, -4.0, 3.0) for x in (-9, -2, 6)])
    made.lamps = placed_lamps(models, ["crown"] * 3, places)
    made.lamps["entity"][1] = 12
    return made


def front() -> NDArray[np.void]:
    """The room lies behind the shop's pane."""
    record = np.zeros(1, ROOM_FRONT)
    for name, value in {
        "x": -8, "inward_x": 1, "room_x": 96, "room_inward_x": 1, "left": -9, "right": 9, "height": 3, "depth": 8,
        "half_width": 4,
    }.items():  # fmt: skip
        record[name] = value
    return record


@pytest.fixture(scope="module")
def both() -> tuple[Scene, GlRenderer]:
    made = scene()
    try:
        return made, GlRenderer(made)
    except MissingExtraError as error:
        pytest.skip(str(error))


WET = replace(DAY, wet=0.8, rain=2.0)


@pytest.mark.parametrize(
    ("cameras", "light", "request_"),
    [
        (OUTSIDE, DAY, PictureRequest(normals=True)),
        (OUTSIDE, NIGHT, PictureRequest(normals=True)),
        (OUTSIDE, WET, PictureRequest(normals=True, quality=FINE_QUALITY)),
        (OUTSIDE, DAY, PictureRequest(normals=True, samples=2)),
        (INSIDE, DAY, PictureRequest(normals=True)),
    ],
    ids=["day", "night", "rain, fine", "smooth", "room"],
)
def test_both_renderers_take_the_same_pictures(
    both: tuple[Scene, GlRenderer], cameras: Cameras, light: Lighting, request_: PictureRequest
) -> None:
    made, gl = both
    made.lighting = light
    wanted, got = take_pictures(made, cameras, request_), gl.take(cameras, request_)
    same = wanted.segmentation == got.segmentation
    assert same.mean() > 0.995
    assert len(np.unique(wanted.segmentation)) > (2 if cameras is INSIDE else 15)
    assert 8 not in got.segmentation
    # A card lays corners on a grid of 1/256 pixel: slanted ground far away is off by as much.
    slope = np.maximum(*(np.abs(np.gradient(wanted.depth[0], axis=axis)) for axis in (0, 1)))
    assert np.percentile((np.abs(wanted.depth - got.depth)[0] - slope / 128)[same[0]], 99) < 1e-3
    assert np.percentile(np.abs(wanted.normals - got.normals)[same], 99) < 1e-2
    assert np.abs(wanted.rgb.astype(int) - got.rgb).mean() < 0.5


def test_rooms_behind_glass_are_the_same_ones(both: tuple[Scene, GlRenderer]) -> None:
    made, gl = both
    made.lighting, made.fronts = DAY, front()
    look = Cameras(np.array([[-14.0, 0.0, 1.6]]), np.array([[1.0, 0.0, 0.0]]), width=320, height=240)
    request = PictureRequest(quality=FINE_QUALITY)
    wanted, got = take_pictures(made, look, request).rgb.astype(int), gl.take(look, request).rgb.astype(int)
    made.fronts = made.fronts[:0]
    without = gl.take(look, request).rgb.astype(int)
    assert np.abs(wanted - got).mean() < 1.0
    assert (np.abs(without - got).max(axis=-1) > 10).mean() > 0.004


def test_open_doors_are_cut_out_of_the_same_pixels(both: tuple[Scene, GlRenderer]) -> None:
    made, gl = both
    opening = np.zeros(1, OPENING)
    sizes = {"x": -8.0, "y": 0.3, "inward_x": 1.0, "half_width": 0.25, "height": 2.0, "before": 0.1, "behind": 0.3}
    for name, value in sizes.items():
        opening[name] = value
    made.lighting = DAY
    look = replace(OUTSIDE, position=np.array([[-11.0, 0.3, 1.6]]), forward=np.array([[1.0, 0.0, 0.0]]))
    closed = take_pictures(made, look, PictureRequest()).segmentation
    made.set_openings(opening)
    wanted, got = take_pictures(made, look, PictureRequest()), gl.take(look, PictureRequest())
    made.set_openings(opening[:0])
    assert ((closed == 30) & (wanted.segmentation != 30)).sum() > 200
    assert ((closed != 30) & (wanted.segmentation != closed)).sum() == 0
    # What stands behind is seen by one of them only: nothing ever stands there but a hall.
    assert ((got.segmentation == 30) == (wanted.segmentation == 30)).mean() > 0.995


@pytest.mark.parametrize(("lamp", "daylight"), [(0.0, 1.0), (1.0, 0.0), (0.0, 0.0)])
def test_rooms_are_lit_alike(both: tuple[Scene, GlRenderer], lamp: float, daylight: float) -> None:
    made, gl = both
    made.light_rooms(lamp, daylight)
    wanted, got = take_pictures(made, INSIDE, PictureRequest()), gl.take(INSIDE, PictureRequest())
    made.light_rooms(1.0, 1.0)
    assert np.abs(wanted.rgb.astype(int) - got.rgb).mean() < 1.0


def test_windows_are_lit_alike(both: tuple[Scene, GlRenderer]) -> None:
    made, gl = both
    made.lighting = NIGHT
    bright = take_pictures(made, OUTSIDE, PictureRequest()).rgb.astype(int)
    # One of the twelve is not among them, another is on; the lamp that is a shop's, too, goes out.
    dark = [k for k in range(21, 9, -1) if k != 16]
    made.light_windows([*dark, 7, 900_000], [[float(k == 14), float(k != 12)] for k in dark] + [[1.0, 1.0]] * 2)
    wanted, got = take_pictures(made, OUTSIDE, PictureRequest()).rgb.astype(int), gl.take(OUTSIDE, PictureRequest())
    made.light_windows(None)
    assert (np.abs(wanted - bright).max(axis=-1) > 20).mean() > 0.05
    assert (np.abs(wanted - got.rgb).max(axis=-1) > 20).mean() < 0.003


def test_what_moves_is_moved_there_too(both: tuple[Scene, GlRenderer]) -> None:
    made, gl = both
    index = made.names["cube"]
    made.set_rigid([index], np.array([pose_matrix(-9, -4, 0, 0.3)]), [5])
    figure = ball((0.3, 0.3, 0.9), (-8, -2, 0.9), colour=(90, 120, 200)).of_entity(9)
    made.set_skinned(figure.positions, figure.normals, figure.triangles, figure.colour, figure.entity)
    wanted, got = take_pictures(made, OUTSIDE, PictureRequest()), gl.take(OUTSIDE, PictureRequest())
    assert (wanted.segmentation == got.segmentation).mean() > 0.995
    assert ((wanted.segmentation == 9) | (wanted.segmentation == 5)).sum() > 100


def people(made: Scene, spots: list[tuple[float, float]], *, with_limbs: bool) -> None:
    """Put slim bodies at some spots, whose limbs are a row of leaning capsules."""
    made.set_rigid([made.names["cube"]], np.array([pose_matrix(-9.5, -3, 0.4, 0.3)]), [5])
    parts = merge_surfaces([ball((0.25, 0.25, 0.9), (x, y, 0.9)).of_entity(20 + k) for k, (x, y) in enumerate(spots)])[
        0
    ]
    rows = [[[x, y, 0.1, x, y + 0.1 * k - 0.6, 1.6, 0.06] for k in range(len(LIMBS))] for x, y in spots]
    limbs = np.array(rows, np.float32) if with_limbs else None
    made.set_skinned(parts.positions, parts.normals, parts.triangles, parts.colour, parts.entity, limbs=limbs)


@pytest.mark.parametrize(("cameras", "with_limbs"), [(NEAR, True), (OUTSIDE, False), (INSIDE, False)])
def test_what_moves_throws_the_same_shadows(both: tuple[Scene, GlRenderer], cameras: Cameras, with_limbs: bool) -> None:
    made, gl = both
    made.lighting = replace(DAY, sun_direction=(0.3, -0.8, 0.5), shadow_direction=None)
    people(made, [(-9.0, -5.5), (-10.5, -4.0), (101.5, 0.0)], with_limbs=with_limbs)
    request = PictureRequest()
    wanted, got = take_pictures(made, cameras, request), gl.take(cameras, request)
    bare = take_pictures(made, cameras, replace(request, moving=False))
    darker = (bare.rgb.astype(int) - wanted.rgb).max(axis=-1) > 12
    darker &= (bare.segmentation == wanted.segmentation) & (got.segmentation == wanted.segmentation)
    assert darker.sum() > 200
    difference = np.abs(wanted.rgb.astype(int) - got.rgb)
    assert difference.mean() < 0.5
    assert np.percentile(difference[darker], 95) <= 3


@pytest.mark.parametrize("record", [{"width": 160, "height": 120}, {"projection": "panorama", "height": 64}])
def test_flow_is_the_same(both: tuple[Scene, GlRenderer], record: dict[str, Any]) -> None:
    """The eye, a cube and people move; another cube comes."""
    made, gl = both
    lens, flows, seen = Lens.of(record), [], []
    pose = np.concatenate([OUTSIDE.position, OUTSIDE.forward], axis=1)
    for renderer in ("cpu", "gl"):
        viewers = Viewers(made, ("segmentation", "flow"), renderer=renderer)
        viewers._gl = gl
        for second in range(2):
            people(made, [(-9.0, -5.5 + 0.2 * second), (-10.5, -4.0)], with_limbs=True)
            poses = np.array([pose_matrix(-9, -3 + 0.3 * second, 0, 0.3), pose_matrix(-7, -1, 0, 1)])[: 1 + second]
            made.set_rigid([made.names["cube"]] * len(poses), poses, [5, 6][: len(poses)])
            views = viewers.take(pose + 0.1 * second, np.array([1], np.int32), [lens], second=float(second))
            views.wait()
        flows.append(views.pictures["flow"][0])
        seen.append(views.pictures["segmentation"][0])
    same = seen[0] == seen[1]
    assert same.mean() > 0.995
    assert np.percentile(np.abs(flows[0] - flows[1])[same], 99) < 0.02
    for entity in (5, 20):
        assert np.abs(flows[1][seen[1] == entity]).max() > 1.0
    assert not flows[1][seen[1] == 6].any()


def test_without_moderngl_a_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "moderngl", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'virtual-community\[gl\]'"):
        GlRenderer(Scene([]))


@pytest.mark.parametrize("wanted", ["vulkan", "", 3])
def test_other_renderers_are_refused(wanted: Any) -> None:
    with pytest.raises(InputError, match="renderer"):
        SimConfig(renderer=wanted)
