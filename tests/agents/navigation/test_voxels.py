"""Voxels stand where things do, go when what stood there is gone, and fade where it moves."""

import numpy as np
import pytest

from vico.agents.navigation.voxels import FADES, SIDE, VoxelMap
from vico.assets.shapes import box
from vico.render import Cameras, Scene, render

KINDS = {7: {"kind": "furniture", "name": "box"}, 8: {"kind": "resident", "name": "Ann"}, 9: {"kind": "object"}}


def view(*things, eye=(0.0, 0.0), yaw: float = 0.0, time: int = 0, feet: float = 0.0) -> dict:
    """What one sees who stands at a point, on a floor with some boxes."""
    floor = box((30, 30, 0.1), (0, 0, -0.05)).of_entity(1)
    ahead = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    cameras = Cameras(np.array([[*eye, feet + 1.6]]), ahead[None])
    frames = render(Scene([floor, *things], {}), cameras)
    return {
        "depth": frames.depth[0],
        "segmentation": frames.segmentation[0],
        "intrinsics": cameras.intrinsics,
        "extrinsics": cameras.extrinsics[0],
        "pose": np.array([*eye, feet, *ahead]),
        "state": {"time": float(time)},
    }


def thing(entity: int = 7, x: float = 4.0, y: float = 1.0):
    return box((0.4, 0.6, 1.0), (x, y, 0.5)).of_entity(entity)


def solid_at(voxels: VoxelMap, x: float, y: float, within: float = 0.3) -> bool:
    rows, columns = np.nonzero(voxels.voxels.solid)
    xy = np.column_stack([columns, rows])
    xy = ((xy + SIDE // 2) % SIDE - SIDE // 2 + 0.5) / 10
    return bool((np.abs(xy - [x, y]) <= within).all(axis=1).any())


def test_what_stands_on_a_floor_is_in_the_way_and_the_floor_is_not() -> None:
    voxels = VoxelMap(0.0)
    voxels.see(view(thing()), KINDS, ())
    rows, columns = np.nonzero(voxels.voxels.solid)
    xy = ((np.column_stack([columns, rows]) + SIDE // 2) % SIDE - SIDE // 2 + 0.5) / 10
    assert len(xy) >= 8
    # Within a voxel of the box, which reaches from 3.8 to 4.2 m ahead and from 0.7 to 1.3 m to the left.
    assert (np.abs(xy - [4.0, 1.0]) <= [0.3, 0.4]).all()
    assert voxels.cost[10, 38] == 0
    assert voxels.cost[0, 30] == 10  # floor that was seen
    assert voxels.cost[0, SIDE - 30] == 11  # behind one's back


def test_what_is_carried_or_may_be_picked_up_is_in_nobodys_way() -> None:
    voxels = VoxelMap(0.0)
    voxels.see(view(thing(7), thing(9, y=-1.0)), KINDS, [7])
    assert not voxels.voxels.solid.any()


def test_what_was_moved_away_is_free_again_once_seen_through() -> None:
    voxels = VoxelMap(0.0)
    voxels.see(view(thing()), KINDS, ())
    assert solid_at(voxels, 4.0, 1.0)
    voxels.see(view(yaw=np.pi, time=1), KINDS, ())  # looking away tells nothing
    assert solid_at(voxels, 4.0, 1.0)
    voxels.see(view(thing(x=2.5), time=2), KINDS, ())
    assert solid_at(voxels, 2.5, 1.0)
    voxels.see(view(time=3), KINDS, ())
    assert not voxels.voxels.solid.any()
    assert not voxels.voxels.counts.any()


def test_people_fade_and_furniture_stays() -> None:
    voxels = VoxelMap(0.0)
    voxels.see(view(thing(8), thing(7, y=-1.0)), KINDS, ())
    assert solid_at(voxels, 4.0, 1.0)
    voxels.refresh(FADES - 1)
    assert solid_at(voxels, 4.0, 1.0)
    voxels.refresh(FADES)
    assert not solid_at(voxels, 4.0, 1.0)
    assert solid_at(voxels, 4.0, -1.0)


def test_a_person_who_walked_on_is_not_where_they_were() -> None:
    voxels = VoxelMap(0.0)
    voxels.see(view(thing(8)), KINDS, ())
    voxels.see(view(thing(8, y=-1.0), time=1), KINDS, ())
    assert not solid_at(voxels, 4.0, 1.0)
    assert solid_at(voxels, 4.0, -1.0)


def test_what_stops_one_is_remembered_and_wider_each_time() -> None:
    voxels, pose = VoxelMap(0.0), np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    counts = []
    for times in (1, 2, 3):
        voxels.stumble(pose, 10, times=times)
        counts.append(int(voxels.voxels.solid.sum()))
    assert counts == sorted(set(counts))
    assert voxels.passing
    assert voxels.forget_stumbles(10)
    assert not voxels.forget_moving()
    assert not voxels.voxels.counts.any()


def test_memory_is_bounded_and_what_lies_far_off_gives_way() -> None:
    voxels = VoxelMap(lambda points: np.zeros(len(points)), least=2)
    voxels.see(view(thing()), KINDS, ())
    assert voxels.voxels.solid.any()
    size = sum(array.nbytes for array in voxels.voxels)
    # 51.2 m further on the same places are taken by other ground.
    far = view(eye=(51.2, 0.0), time=1)
    far["depth"][:] = 0.0
    voxels.see(far, KINDS, ())
    assert not voxels.voxels.solid.any()
    assert sum(array.nbytes for array in voxels.voxels) == size <= 8e6


@pytest.mark.parametrize("ground", [0.0, None])
def test_a_map_goes_on_from_its_state(ground: float | None) -> None:
    voxels = VoxelMap(ground)
    voxels.see(view(thing(8), thing(7, y=-1.0)), KINDS, ())
    voxels.stumble(view()["pose"], 0, times=2)
    other = VoxelMap(ground)
    other.restore(voxels.state())
    for step, picture in enumerate([view(thing(7, y=-1.0), time=1), view(yaw=1.0, time=6)]):
        for one in (voxels, other):
            one.see(picture, KINDS, ())
        for name, mine, its in zip(voxels.voxels._fields, voxels.voxels, other.voxels, strict=True):
            if name != "flags":
                np.testing.assert_array_equal(mine, its, err_msg=f"{name}, step {step}")
