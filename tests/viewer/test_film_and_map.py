"""The demo film and the map it is drawn on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from vico.render.film import read_film
from vico.sim.recording import read_run
from vico.viewer import replay
from vico.viewer.replay import HEIGHT, RATE, SECONDS, WIDTH, MapPicture, Recording, recording_of, write_demo_film
from vico.world.world import World


@pytest.fixture(scope="module")
def recording(helsinki_run: tuple[Path, dict[str, Any]]) -> Recording:
    return recording_of(read_run(helsinki_run[0]))


def test_a_film_lasts_twenty_seconds_at_least() -> None:
    assert SECONDS >= 20
    assert WIDTH % 2 == HEIGHT % 2 == 0


def test_the_film_has_its_frames_and_its_size(
    recording: Recording, helsinki: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replay, "SECONDS", 1.0)
    assert write_demo_film(tmp_path / "f.mp4", recording, helsinki) == RATE
    frames = list(read_film(tmp_path / "f.mp4"))
    assert len(frames) == RATE
    assert frames[0].shape == (HEIGHT, WIDTH, 3)
    # The left is a map, the right shows what somebody sees; the clock goes on.
    assert frames[0][:, :HEIGHT].std() > 10
    assert frames[0][8:272, HEIGHT + 8 : HEIGHT + 272].std() > 10
    assert np.abs(frames[0][8:42, 8:112].astype(int) - frames[-1][8:42, 8:112]).max() > 60


def test_metres_travelled_leave_jumps_out(recording: Recording) -> None:
    tracks = np.zeros_like(recording.tracks)
    tracks[:, 0, 0] = np.arange(len(tracks))  # a metre a second
    tracks[4:, 1, 0] = 80.0  # one jump through a door
    metres = Recording(**(vars(recording) | {"tracks": tracks})).travelled_metres()
    assert metres[:2].tolist() == [len(tracks) - 1, 0.0]


@pytest.fixture(scope="module")
def picture(helsinki: World) -> tuple[MapPicture, NDArray[np.uint8]]:
    base = MapPicture(helsinki, 600)
    return base, np.asarray(base.image)


def test_buildings_are_where_they_are(helsinki: World, picture: tuple[MapPicture, NDArray[np.uint8]]) -> None:
    base, image = picture
    # Ateneum, the art museum, stands 130 m east and 140 m north of the window's middle.
    house = next(b for b in helsinki.buildings if b.name is not None and "Ateneum" in b.name)
    rings = [np.asarray(ring) for ring in house.footprint]
    inside = shapely.Polygon(rings[0], rings[1:]).buffer(-3.0).intersection(shapely.box(-148, -148, 148, 148))
    x, y = base.to_pixels(np.asarray(inside.representative_point().coords[0])).astype(int)
    assert np.abs(image[y, x].astype(int) - (190, 178, 160)).max() < 25


def test_a_street_is_lighter_than_its_houses(helsinki: World, picture: tuple[MapPicture, NDArray[np.uint8]]) -> None:
    base, image = picture
    walkable = helsinki.walkable
    spots = np.argwhere((walkable.cls == 4) & (np.abs(np.indices(walkable.cls.shape) - walkable.n / 2).max(0) < 250))
    x, y = base.to_pixels(walkable.centre_of(spots[:: len(spots) // 50, ::-1])).astype(int).T
    assert np.median(image[y, x]) > 245


def test_corners_of_the_window_are_corners_of_the_picture(picture: tuple[MapPicture, NDArray[np.uint8]]) -> None:
    base, _ = picture
    corners = base.to_pixels([[-150.0, 150.0], [150.0, -150.0], [0.0, 0.0]])
    assert corners.tolist() == [[0.0, 0.0], [600.0, 600.0], [300.0, 300.0]]
