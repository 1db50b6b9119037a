"""`vico world build --lat --lon` where no extract is packaged: the map comes from a server."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from command_line import vico
from http_server import Answer, Request, serve
from vico.io.cache import cache_folder
from vico.world.check import check_world
from vico.world.folder import read_world
from vico.world.world import STAGES

STATUS = b"Connected as: 1\nRate limit: 2\n2 slots available now.\nCurrently running queries (pid, space limit):\n"


def test_a_place_on_earth_is_fetched_built_and_sound(
    shared_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    content = (shared_data / "samples" / "overpass_monaco_800m_derived.json").read_bytes()
    asked: list[str] = []

    def overpass(request: Request) -> Answer:
        asked.append(request.path)
        return Answer(body=STATUS if request.path == "/api/status" else content)

    # No map is kept; textures, which are the same of every place, are.
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "textures").symlink_to(cache_folder() / "textures")
    monkeypatch.setenv("VICO_CACHE", str(tmp_path / "cache"))
    dem = shared_data / "places" / "monaco" / "dem_srtm.tif"
    where = ("--lat", 43.73384, "--lon", 7.41813, "--radius", 70, "--dem", dem)
    with serve(overpass) as base:
        assert vico("world", "build", *where, "--overpass", f"{base}/api", "--out", tmp_path / "w") == 0
        assert asked.count("/api/interpreter") == 1
        # A second world of the place asks nobody. What its stages make of the map is there; the map is read.
        shutil.copytree(tmp_path / "w" / STAGES, tmp_path / "again.partial" / STAGES)
        monkeypatch.setenv("VICO_OVERPASS", f"{base}/api")
        assert vico("world", "build", *where, "--out", tmp_path / "again") == 0
        assert asked.count("/api/interpreter") == 1
    world = read_world(tmp_path / "w")
    assert len(world.buildings) > 20
    assert check_world(world) == []
    assert [s.kind for s in world.manifest.sources] == ["map", "elevation"]
    capsys.readouterr()


def test_a_server_that_is_not_there_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with serve(lambda request: Answer(404, b"gone")) as base:
        where = ("--lat", 10, "--lon", 10, "--radius", 70)
        assert vico("world", "build", *where, "--overpass", base, "--out", tmp_path / "w") == 2
    error = capsys.readouterr().err
    assert "404" in error
    assert "Traceback" not in error
    assert list(tmp_path.iterdir()) == []
