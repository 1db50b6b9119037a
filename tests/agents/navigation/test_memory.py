"""What was seen is remembered where it was, until it is seen to be gone."""

import numpy as np
import pytest

from vico.agents.perception import SightingMemory, points_from_depth, sightings
from vico.assets.shapes import box
from vico.io.plain_data import decode, encode
from vico.render import Cameras, Scene, render
from vico.seeds import rng

KINDS = {
    7: {"kind": "object", "name": "red parcel"},
    8: {"kind": "resident", "name": "Ann"},
    1: {"kind": "ground", "name": ""},
}


def view(*things, yaw: float = 0.0, time: float = 0.0, room: str = "hall", held=(0, 0)) -> dict:
    floor = box((30, 30, 0.1), (0, 0, -0.05)).of_entity(1)
    ahead = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    cameras = Cameras(np.array([[0.0, 0.0, 1.6]]), ahead[None])
    frames = render(Scene([floor, *things], {}), cameras)
    return {
        "depth": frames.depth[0],
        "segmentation": frames.segmentation[0],
        "intrinsics": cameras.intrinsics,
        "extrinsics": cameras.extrinsics[0],
        "pose": np.array([0.0, 0.0, 0.0, *ahead]),
        "state": {"time": time, "room": room, "held": list(held)},
    }


def parcel(x: float = 4.0, y: float = 0.5):
    return box((0.4, 0.4, 0.4), (x, y, 0.2)).of_entity(7)


def take_in(memory: SightingMemory, picture: dict) -> list[str]:
    return [thing.name for thing in memory.notice(picture, sightings(picture, KINDS))]


def test_a_thing_is_known_where_it_was_seen_even_behind_something_or_ones_back() -> None:
    memory = SightingMemory()
    take_in(memory, view(parcel()))
    screen = box((0.1, 3.0, 2.5), (2.0, 0.0, 1.25)).of_entity(3)
    for picture in (view(parcel(), yaw=np.pi, time=1.0), view(parcel(), screen, time=2.0)):
        assert take_in(memory, picture) == []
    seen = memory.last_seen("red parcel")
    assert seen is not None
    assert seen.position == pytest.approx([3.9, 0.5, 0.3], abs=0.25)
    assert (seen.time, seen.room) == (0.0, "hall")
    assert memory.things(kind="object", room="hall") == [seen]
    assert memory.things(room="kitchen") == []


def test_a_thing_that_is_not_there_when_one_looks_again_is_forgotten() -> None:
    memory = SightingMemory()
    take_in(memory, view(parcel()))
    assert take_in(memory, view(time=5.0)) == ["red parcel"]
    assert memory.last_seen("red parcel") is None


def test_another_rooms_things_are_not_missed_from_here_and_what_is_held_is_not_lying_about() -> None:
    memory = SightingMemory()
    take_in(memory, view(parcel()))
    assert take_in(memory, view(room="kitchen", time=1.0)) == []
    assert memory.last_seen("red parcel") is not None
    assert take_in(memory, view(room="kitchen", time=2.0, held=(7, 0))) == ["red parcel"]


def test_confidence_grows_with_pixels_and_fades_for_people() -> None:
    memory = SightingMemory()
    take_in(memory, view(parcel(), box((0.4, 0.4, 1.7), (4.0, -1.0, 0.85)).of_entity(8)))
    thing, person = memory.last_seen("red parcel"), memory.last_seen("Ann")
    assert thing is not None
    assert person is not None
    assert thing.confidence(1000.0) == thing.confidence(0.0) > 0.6
    assert person.confidence(0.0) > 0.9
    assert person.confidence(300.0) < 0.05


def test_rooms_are_looked_at_direction_by_direction_and_state_keeps_all() -> None:
    memory = SightingMemory()
    shares = []
    for turn in range(4):
        take_in(memory, view(parcel(), yaw=turn * np.pi / 2, time=float(turn)))
        shares.append(memory.looked_at("hall"))
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    assert memory.looked_at("loft") == 0.0
    other = SightingMemory()
    other.restore(decode(encode(memory.state())))
    assert other.looked_at("hall") == 1.0
    mine, its = memory.last_seen("red parcel"), other.last_seen("red parcel")
    assert mine is not None
    assert its is not None
    np.testing.assert_array_equal(its.position, mine.position)
    assert take_in(other, view(time=9.0)) == take_in(memory, view(time=9.0)) == ["red parcel"]


def test_sightings_are_what_counting_pixel_by_pixel_comes_to() -> None:
    chance = rng(0, "navigation test, pixels")
    picture = view(
        parcel(), *(box((0.3, 0.3, 0.5), (*chance.uniform(1, 6, 2), 0.3)).of_entity(k) for k in range(20, 60))
    )
    picture["segmentation"][chance.random((256, 256)) < 0.1] = 0
    picture["depth"][chance.random((256, 256)) < 0.1] = 0.0
    entities = {k: {"kind": "object", "name": f"thing {k}"} for k in (7, *range(20, 60))}
    found = sightings(picture, entities)
    points, pixels = points_from_depth(picture["depth"], picture["intrinsics"], picture["extrinsics"])
    owner = picture["segmentation"].ravel()[pixels]
    assert len(found) > 10
    for thing in found:
        mask = picture["segmentation"] == thing.entity
        assert thing.pixels == mask.sum()
        assert thing.position == pytest.approx(points[owner == thing.entity].mean(axis=0), abs=1e-9)
        rows, columns = np.nonzero(mask)
        assert thing.box == (columns.min(), rows.min(), columns.max(), rows.max())
    away = [np.linalg.norm(thing.position - picture["pose"][:3]) for thing in found]
    assert away == sorted(away)
