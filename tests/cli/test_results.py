"""What the verbs print for machines."""

from __future__ import annotations

import base64
import io
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from command_line import script, vico
from vico.cli import demo
from vico.sim.recording import read_run
from vico.world.folder import read_world
from vico.worldgen.report import report_page

# The least that the two verbs promise to tell.
WORLD_KEYS = {
    "buildings", "accessible_buildings", "places", "places_by_type", "roads", "junctions", "amenity_objects",
    "natural_objects", "transit", "collision_faces", "watertight_buildings", "seconds", "sources",
}  # fmt: skip
RUN_KEYS = {
    "steps", "wall_seconds", "real_time_factor", "peak_rss_mb", "state_hash", "collisions", "arrivals", "late",
}  # fmt: skip
EVAL_KEYS = {"rows", "differences", "averages", "episodes", "not_played", "setting", "worlds", "challenge", "vico"}


def printed(capsys: pytest.CaptureFixture[str]) -> Any:
    return json.loads(capsys.readouterr().out)


def test_world_info_tells_every_count(helsinki_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert vico("world", "info", helsinki_path, "--json") == 0
    facts = printed(capsys)
    assert facts.keys() >= WORLD_KEYS
    assert facts["watertight_buildings"] == facts["buildings"] > 20
    assert sum(facts["places_by_type"].values()) == facts["places"]
    assert facts["sources"][0]["licence"] == "ODbL-1.0"
    assert min(facts["seconds"].values()) >= 0


def test_a_sound_world_is_found_sound(helsinki_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert vico("check", "world", helsinki_path, "--json") == 0
    assert printed(capsys) == {"ok": True, "findings": []}


def test_a_damaged_world_exits_1(helsinki_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path in helsinki_path.iterdir():
        if path.name != "transit.json":
            (tmp_path / path.name).symlink_to(path)
    (tmp_path / "transit.json").write_text((helsinki_path / "transit.json").read_text() + " ")
    assert vico("check", "world", tmp_path, "--json") == 1
    assert not printed(capsys)["ok"]


def test_run_tells_its_metrics(helsinki_run: tuple[Path, dict[str, Any]]) -> None:
    path, metrics = helsinki_run
    assert metrics.keys() >= RUN_KEYS
    assert metrics["steps"] == 8
    assert metrics["state_hash"] == read_run(path).hashes[-1]
    assert metrics == json.loads((path / "metrics.json").read_text())


def test_the_same_run_has_the_same_hash_and_another_seed_another(
    helsinki_run: tuple[Path, dict[str, Any]],
    helsinki_path: Path,
    helsinki_people: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    hashes = []
    for seed in (0, 1):
        # Who looks does not change what happens.
        code = vico(
            "run", helsinki_path, helsinki_people, "--steps", 8, "--robots", "husky", "--cars", 3, "--pedestrians", 3,
            "--observe", "none", "--seed", seed, "--out", tmp_path / f"{seed}", "--json",
        )  # fmt: skip
        assert code == 0
        hashes.append(printed(capsys)["state_hash"])
    assert hashes[0] == helsinki_run[1]["state_hash"]
    assert hashes[1] != hashes[0]


def test_eval_tells_rates_and_leaves_tasks_and_results(
    helsinki_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "results"
    words = ("--category", "delivery", "--method", "random", "--seeds", 1, "--steps", 3)
    assert vico("eval", "assistant", "--worlds", helsinki_path, *words, "--out", out, "--json") == 0
    told = printed(capsys)
    assert told.keys() >= EVAL_KEYS
    (row,) = told["rows"]
    assert (row["category"], row["method"], row["episodes"], row["parts"]) == ("delivery", "random", 1, 6)
    assert (row["metrics"]["SR"]["mean"], row["metrics"]["Ts"]["mean"]) == (0.0, 3.0)
    assert len(list((out / "tasks").glob("*.json"))) == 1
    assert json.loads((out / "results.json").read_text()) == told
    assert "| random | 0.0 (one episode) | 3" in (out / "results.md").read_text()


def test_a_run_leaves_nothing_beside_its_folder(helsinki_path: Path, helsinki_people: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [
            sys.executable, "-m", "vico.cli.main", "run", str(helsinki_path), str(helsinki_people), "--steps", "2",
            "--robots", "husky,go2", "--cars", "2", "--pedestrians", "2", "--observe", "none", "--out", "run",
        ],
        cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_progress_without_a_terminal_is_a_line_a_stage(
    helsinki_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert vico("community", "build", helsinki_path, "--residents", 3, "--out", tmp_path / "p") == 0
    assert capsys.readouterr().err.split()[:4] == ["people", "and", "schedules", "1/1"]


def test_output_that_nobody_reads_on_is_no_error(helsinki_path: Path) -> None:
    done = subprocess.run(
        f"{sys.executable} -m vico.cli.main world info {helsinki_path} --json | head -c 1",
        shell=True, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert (done.stdout, done.stderr) == ("{", "")


def test_bench_says_where_benchmarks_are_to_be_had(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(demo, "SCRIPTS", tmp_path)
    assert vico("bench", "world") == 2
    assert "come with the repository" in capsys.readouterr().err


@pytest.mark.slow
def test_bench_world_measures_every_stage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    table, run = tmp_path / "results" / "world.md", subprocess.run
    small = ("--radius", "60", "-n", "1")
    monkeypatch.setattr(subprocess, "run", lambda command, **how: run([*command, *small], **how))
    assert demo.bench("world", table=table, json=True) == 0
    seconds, memory, objects, elements = printed(capsys)["tables"]
    stages = {row["stage"]: float(row["median s"]) for row in seconds["rows"]}
    assert stages.keys() >= {"map", "buildings", "roads", "previews", "total"}
    assert stages["whole command"] > stages["total"] > stages["buildings"] > 0
    assert float(memory["rows"][0]["median MB"]) > 100
    # The averages that the paper gives for its scenes stand beside the counts of this one.
    theirs = "paper, mean of its scenes"
    assert {row["objects"]: row[theirs] for row in objects["rows"]} == {
        "amenity objects": "133",
        "natural objects": "357",
        "transit objects": "9",
    }
    roads = next(row for row in elements["rows"] if row["annotated elements"] == "roads")
    assert roads[theirs] == "473"
    assert int(roads["helsinki"]) > 0
    assert "/" not in table.read_text().split("Made by")[0].replace("x86/64", "")


def test_every_benchmark_is_a_script_that_explains_itself() -> None:
    for name in ("render", "sim", "world", "memory"):
        done = script(demo.SCRIPTS / f"{name}.py", "--help")
        assert done.returncode == 0, done.stderr
        assert f"benchmarks/{name}.py" in done.stdout
        assert "--table" in done.stdout


def test_the_page_takes_the_picture_the_world_was_built_with(
    helsinki_run: tuple[Path, dict[str, Any]],
    helsinki_path: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    run, world = tmp_path / "run", tmp_path / "world"
    shutil.copytree(helsinki_run[0], run)
    shutil.copytree(helsinki_path, world)
    (world / "previews").mkdir()
    kept = world / "previews" / "above.png"
    Image.new("RGB", (40, 40), (250, 10, 200)).save(kept)
    assert vico("replay", run, "--world", world, "--no-film") == 0
    page = (run / "replay.html").read_text()
    assert any(_is_flat(picture, (250, 10, 200)) for picture in re.findall(r"data:image/webp;base64,([^\"']+)", page))
    kept.write_bytes(kept.read_bytes()[:50])
    assert vico("replay", run, "--world", world, "--no-film") == 2
    assert "not a readable picture" in capsys.readouterr().err


def _is_flat(encoded: str, colour: tuple[int, int, int]) -> bool:
    """Whether a picture is of one colour, save for the losses of its encoding."""
    with Image.open(io.BytesIO(base64.b64decode(encoded))) as picture:
        return bool(np.abs(np.asarray(picture.convert("RGB")).astype(int) - colour).max() < 40)


def test_the_report_shows_the_square_once_and_its_streets_apart(tmp_path: Path, helsinki_path: Path) -> None:
    world = tmp_path / "world"
    shutil.copytree(helsinki_path, world)
    (world / "previews").mkdir()
    for name in ("above", "view_0"):
        Image.new("RGB", (4, 4)).save(world / "previews" / f"{name}.png")
    page = report_page(read_world(world))
    assert page.count("previews/above.png") == 1
    assert re.findall(r"<a href='(previews/[^']*)'", page) == ["previews/view_0.png"]
