"""`--ray` and URLs on the command line, with a real S3 server and a Ray cluster of this machine."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from command_line import vico
from ray_nodes import needs_ray
from s3_server import S3Server, needs_s3
from toy_challenge import toy_world
from vico.challenges import records
from vico.cli.options import with_ray_address
from vico.io.stores import store_at
from vico.world.folder import read_world
from vico.worldgen.request import packaged_extract


@pytest.fixture
def bucket(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.setenv("VICO_CACHE", str(tmp_path / "cache"))
    with S3Server() as server:
        yield server.bucket("bucket")


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["eval", "--ray"], ["eval", "--ray", "auto"]),
        (["--ray", "--out", "x"], ["--ray", "auto", "--out", "x"]),
        (["build-many", "--ray", "places.csv"], ["build-many", "--ray", "auto", "places.csv"]),
        (["--ray", "10.0.0.1:6379", "x"], ["--ray", "10.0.0.1:6379", "x"]),
        (["--ray", "ray://head:10001"], ["--ray", "ray://head:10001"]),
        (["--ray", "local", "--ray=auto"], ["--ray", "local", "--ray=auto"]),
    ],
)
def test_ray_needs_no_address(words: list[str], found: list[str]) -> None:
    assert with_ray_address(words) == found


@needs_s3
def test_an_evaluation_lives_in_a_bucket_with_its_worlds(
    bucket: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("commute", "toy"):  # the leaderboard knows it by its own name
        monkeypatch.setitem(records.CHALLENGES, name, "toy_challenge:TOY")
    worlds, urls = [], []
    for name in ("east", "west"):
        worlds.append(toy_world(tmp_path / "worlds" / name))
        with store_at(bucket).new_folder(f"worlds/{name}") as folder:
            shutil.copytree(worlds[-1], folder)
        urls.append(f"{bucket}/worlds/{name}")

    def words(where: list[object], out: object, *more: object) -> list[object]:
        asked = ["--method", "bad", "--method", "good", "--seeds", 2, "--workers", 1]
        return ["eval", "commute", "--worlds", *where, *asked, "--out", out, *more]

    out = f"{bucket}/results"
    assert vico(*words(list(worlds), tmp_path / "here")) == 0
    board = tmp_path / "board.json"
    assert vico(*words(list(worlds), out, "--leaderboard", board)) == 0
    assert "s an episode" in capsys.readouterr().err
    store = store_at(out)
    for name in ("results.json", "results.md"):
        assert store.read(name) == (tmp_path / "here" / name).read_bytes()
    assert len(store.names("episodes")) == 16
    assert len(json.loads(board.read_text())["entries"]) == 4
    assert vico(*words(list(worlds), out)) == 2
    assert "exists already" in capsys.readouterr().err
    assert vico(*words(list(worlds), out, "--resume")) == 0
    assert capsys.readouterr().err.count("; kept") == 16
    assert vico(*words(list(worlds), out, "--force")) == 0
    assert capsys.readouterr().err.count("; kept") == 0
    # The toy's worlds are manifests that name no files; those in the bucket have the same digests.
    assert vico(*words(list(urls), f"{bucket}/more")) == 0
    assert store_at(f"{bucket}/more").read("results.json") == (tmp_path / "here" / "results.json").read_bytes()


@needs_ray
@needs_s3
def test_worlds_are_built_on_a_cluster_into_a_bucket(
    bucket: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(packaged_extract().path, tmp_path / "map.osm.pbf")
    table = tmp_path / "places.csv"
    table.write_text("name,lat,lon,radius,osm\nnorth,60.1692,24.9435,60,map.osm.pbf\nsea,10,10,60,map.osm.pbf\n")
    many = ["world", "build-many", table, "--out"]
    assert vico(*many, f"{bucket}/worlds", "--ray", "local", "--workers", 1, "--json") == 1
    north, sea = json.loads(capsys.readouterr().out)["places"]
    assert (north["state"], sea["state"]) == ("built", "failed")
    assert vico(*many, tmp_path / "here", "--workers", 1, "--json") == 1
    capsys.readouterr()
    there, here = store_at(f"{bucket}/worlds"), tmp_path / "here" / "north"
    assert there.read("north/world.json") == (here / "world.json").read_bytes()
    assert not there.has("sea")
    assert vico(*many, f"{bucket}/worlds", "--workers", 1, "--json") == 1
    assert json.loads(capsys.readouterr().out)["places"][0]["state"] == "kept"
    # A world in a bucket is played in like any other.
    evaluated = ["eval", "assistant", "--method", "random", "--seeds", 1, "--steps", 3, "--workers", 1]
    assert vico(*evaluated, "--worlds", f"{bucket}/worlds/north", "--out", tmp_path / "out") in (0, 1)
    content = json.loads((tmp_path / "out" / "results.json").read_text())
    assert set(content["worlds"].values()) <= {read_world(here).digest}
