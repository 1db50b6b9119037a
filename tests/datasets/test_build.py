"""Datasets are made whole, whatever happens on the way, and hold what was recorded."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from command_line import vico
from ray_nodes import needs_ray
from shared_folders import Shared
from vico.datasets.build import BuildRequest, Contents, SplitRule, build_dataset, tasks_of
from vico.datasets.folder import Dataset, card_of
from vico.datasets.formats import webdataset
from vico.datasets.inspection import findings_of, write_contact_sheet
from vico.errors import InputError, SchemaError
from vico.io.files import read_json, write_json
from vico.jobs import Service
from vico.jobs.executors import ThisProcess
from vico.sim.recording import read_run

OUTPUTS = ("rgb", "depth", "segmentation")
FORMATS = ("lerobot", "webdataset", "parquet")


def request(runs: list[Path], to: str = "lerobot", outputs: tuple[str, ...] = OUTPUTS, **more: Any) -> BuildRequest:
    agents = more.pop("agents", ())
    contents = Contents(to, outputs, 64, agents)
    return BuildRequest(contents, runs=tuple(runs), rule=more.pop("rule", SplitRule("episode", 0.0)), **more)


def bytes_of(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def built(kept_runs: list[Path], shared: Shared) -> dict[str, Dataset]:
    """A dataset of each format, of the same runs."""

    def make(out: Path) -> None:
        out.mkdir()
        for to in FORMATS:
            build_dataset(request(kept_runs, to, rule=SplitRule("episode", 0.2)), out / to)

    folder = shared("datasets_built", make)
    return {to: Dataset(folder / to) for to in FORMATS}


@pytest.mark.parametrize("to", FORMATS)
def test_a_dataset_holds_what_was_recorded(built: dict[str, Dataset], kept_runs: list[Path], to: str) -> None:
    dataset = built[to]
    assert findings_of(dataset) == []
    rows = dataset.episodes()
    assert len(rows) == 6  # two residents in each of three runs
    assert dataset.about.frames == sum(row["frames"] for row in rows) == 2 * (6 + 7 + 8)
    runs = {run.manifest["state_hash"]: run for run in map(read_run, kept_runs)}
    for row in rows:
        run, name = runs[row["run"]], row["agent"]
        frames = list(dataset.frames(row["episode_index"]))
        assert len(frames) == run.last
        for frame in frames:
            step = frame["step"]
            with np.load(run.path / "views" / name / f"{step:08d}.npz") as seen:
                middles = ((np.arange(64) + 0.5) * 4).astype(int)
                for output in ("depth", "segmentation"):  # exactly, at the pixels that were picked
                    assert np.array_equal(frame["pictures"][output], seen[output][np.ix_(middles, middles)])
                small = seen["rgb"].reshape(64, 4, 64, 4, 3).mean(axis=(1, 3))
                difference = np.abs(frame["pictures"]["rgb"].astype(float) - small).mean()
                assert difference < (6.0 if to == "lerobot" else 0.6)  # film; PNG, rounded
            action = run.at(step + 1).agents[name].action
            assert dataset.form.decode(frame["action"], (0, 0, 0, 0))["type"] == action["type"]
            body = run.tracks(step, step)
            place = body.position[0, body.entity.tolist().index(entity_of(run, name))]
            assert np.allclose(frame["observation.state"][:3], place, atol=1e-3)


def entity_of(run: Any, name: str) -> int:
    return int(next(agent["entity"] for agent in run.agents if agent["name"] == name))


def test_a_dataset_says_how_much_it_holds(built: dict[str, Dataset]) -> None:
    about = built["lerobot"].about
    assert repr(built["lerobot"]).startswith(f"Dataset(lerobot: 6 episodes, {about.frames} frames; ")


def test_residents_are_told_what_their_day_says(built: dict[str, Dataset]) -> None:
    activities = {text for row in built["lerobot"].episodes() for text in row["instructions"]}
    assert activities
    assert all(len(text) > 3 for text in activities)
    assert {row["success"] for row in built["lerobot"].episodes()} == {None}  # nobody judged


def test_segmentation_has_names(built: dict[str, Dataset]) -> None:
    dataset = built["parquet"]
    shown = {int(e) for frame in dataset.frames(0) for e in np.unique(frame["pictures"]["segmentation"]) if e}
    names = dataset.entities(0)
    assert shown
    assert shown == set(names)
    assert "unknown" not in {kind for kind, _ in names.values()}


def test_lerobots_files_say_what_its_reader_asks_for(built: dict[str, Dataset]) -> None:
    folder = built["lerobot"].path
    info = read_json(folder / "meta" / "info.json")
    assert (info["codebase_version"], info["fps"], info["total_frames"]) == ("v3.0", 1, 42)
    assert info["splits"] == {"train": "0:4", "test": "4:6"}
    data = pq.read_table(folder / info["data_path"].format(chunk_index=0, file_index=0))
    stored = {name for name, feature in info["features"].items() if feature["dtype"] != "video"}
    assert set(data.column_names) == stored
    assert data["index"].to_pylist() == list(range(42))
    episodes = pq.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [row["dataset_from_index"] for row in episodes[1:]] == [row["dataset_to_index"] for row in episodes[:-1]]
    key = "videos/observation.images.ego"
    assert [row[f"{key}/from_timestamp"] for row in episodes[1:]] == [r[f"{key}/to_timestamp"] for r in episodes[:-1]]
    stats = read_json(folder / "meta" / "stats.json")
    state = np.array(data["observation.state"].to_pylist())
    assert np.allclose(stats["observation.state"]["q50"], np.median(state, axis=0))
    assert np.array(stats["observation.images.ego"]["mean"]).shape == (3, 1, 1)
    pictures = np.stack([f["pictures"]["rgb"] for k in range(6) for f in built["parquet"].frames(k)]) / 255
    assert np.allclose(np.ravel(stats["observation.images.ego"]["mean"]), pictures.mean(axis=(0, 1, 2)), atol=1e-6)
    assert np.allclose(np.ravel(stats["observation.images.ego"]["std"]), pictures.std(axis=(0, 1, 2)), atol=1e-6)


def test_a_shards_sample_is_whole(built: dict[str, Dataset]) -> None:
    folder = built["webdataset"].path
    found = list(webdataset.samples(folder / "train-000000.tar"))
    endings = {"__key__", "json", "state.npy", "action.npy", "rgb.png", "depth.npy", "segmentation.npy"}
    assert all(set(sample) == endings for sample in found)
    assert len({sample["__key__"] for sample in found}) == len(found)
    assert (folder / "test-000000.tar").is_file()


def test_workers_and_interruptions_change_no_byte(
    kept_runs: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build_dataset(request(kept_runs), tmp_path / "whole")
    whole = bytes_of(tmp_path / "whole")
    build_dataset(request(kept_runs, workers=2), tmp_path / "two")
    assert bytes_of(tmp_path / "two") == whole

    class Stopped(BaseException):
        pass

    class Stopping(ThisProcess):
        def run(self, service: Service, tasks: Any, **how: Any) -> None:
            super().run(service, tasks[:2], **how)
            raise Stopped

    monkeypatch.setattr("vico.datasets.build.open_executor", lambda **how: Stopping())
    with pytest.raises(Stopped):
        build_dataset(request(kept_runs), tmp_path / "cut")
    parts = tmp_path / "cut.partial" / "parts"
    made = {path.name: path.stat().st_mtime_ns for path in parts.glob("0*")}
    assert len(made) == 2
    assert not (tmp_path / "cut").exists()
    shutil.rmtree(next(iter(parts.glob("000001.*"))))  # as if it had been under way
    (parts / ".scratch" / "left.over").mkdir(parents=True)
    kept: list[str] = []

    class Noting(ThisProcess):
        def run(self, service: Service, tasks: Any, **how: Any) -> None:
            kept.extend(path.name for path in parts.glob("0*") if path.stat().st_mtime_ns == made[path.name])
            super().run(service, tasks, **how)

    monkeypatch.setattr("vico.datasets.build.open_executor", lambda **how: Noting())
    build_dataset(request(kept_runs), tmp_path / "cut")
    assert len(kept) == 1
    assert bytes_of(tmp_path / "cut") == whole
    assert not (tmp_path / "cut.partial").exists()


def test_a_killed_process_is_started_again(
    kept_runs: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flag = tmp_path / "flag"
    monkeypatch.setenv("VICO_TEST_FLAG", str(flag))
    monkeypatch.setattr("vico.datasets.build.MAKER", "dataset_player:dying")
    built = build_dataset(request(kept_runs, outputs=(), workers=2), tmp_path / "out")
    assert flag.exists()
    assert built.missing == []
    assert built.record["episodes"] == 12  # all residents: nobody's pictures are asked for


@needs_ray
def test_a_cluster_makes_the_same_bytes(kept_runs: list[Path], tmp_path: Path) -> None:
    build_dataset(request(kept_runs, outputs=()), tmp_path / "here")
    build_dataset(request(kept_runs, outputs=(), ray="local", workers=2), tmp_path / "ray")
    assert bytes_of(tmp_path / "ray") == bytes_of(tmp_path / "here")


def test_whole_worlds_or_persons_are_kept_apart(kept_runs: list[Path], tmp_path: Path) -> None:
    build_dataset(request(kept_runs, outputs=(), rule=SplitRule("person", 0.3)), tmp_path / "out")
    persons: dict[str, set[str]] = {}
    for row in Dataset(tmp_path / "out").episodes():
        persons.setdefault(row["split"], set()).update(row["persons"])
    assert set(persons) == {"train", "test"}
    assert not persons["train"] & persons["test"]
    with pytest.raises(InputError, match="by world there is one group"):
        build_dataset(request(kept_runs, outputs=(), rule=SplitRule("world", 0.3)), tmp_path / "other")
    assert not (tmp_path / "other").exists()


def test_a_robots_joints_and_commands(helsinki_run: tuple[Path, Any], tmp_path: Path) -> None:
    build_dataset(request([helsinki_run[0]], "parquet", (), agents=("robots",)), tmp_path / "out")
    dataset = Dataset(tmp_path / "out")
    assert (dataset.about.body, dataset.about.episodes, dataset.about.frames) == ("husky", 1, 8)
    assert findings_of(dataset) == []
    assert dataset.form.robot
    assert "joint.0" in dataset.about.features["observation.state"]
    frame = next(dataset.frames(0))
    quaternion = frame["observation.state"][3:7]
    assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-3)


def test_a_film_is_enough_for_colours(helsinki_run: tuple[Path, Any], tmp_path: Path) -> None:
    build_dataset(request([helsinki_run[0]], "webdataset", ("rgb",)), tmp_path / "out")
    dataset = Dataset(tmp_path / "out")
    assert [row["agent"] for row in dataset.episodes()] == ["resident_0"]
    views = dict(read_run(helsinki_run[0]).views["resident_0"].frames())
    for frame in dataset.frames(0):
        small = views[frame["step"]].reshape(64, 4, 64, 4, 3).mean(axis=(1, 3))
        assert np.abs(frame["pictures"]["rgb"] - small).mean() < 0.6


def test_the_card_names_licences_and_counts(built: dict[str, Dataset]) -> None:
    card = (built["lerobot"].path / "README.md").read_text()
    assert "ODbL-1.0" in card
    assert "© OpenStreetMap contributors" in card
    assert "6 episodes, 42 frames" in card
    assert "| test | 2 |" in card
    assert card_of.__doc__


def test_damage_is_found(built: dict[str, Dataset], tmp_path: Path) -> None:
    shutil.copytree(built["lerobot"].path, tmp_path / "out")
    data = tmp_path / "out" / "data/chunk-000/file-000.parquet"
    content = bytearray(data.read_bytes())
    content[len(content) // 2] ^= 0xFF
    data.write_bytes(content)
    (tmp_path / "out" / "meta" / "tasks.parquet").unlink()
    found = findings_of(Dataset(tmp_path / "out"))
    assert found == ["data/chunk-000/file-000.parquet: is not what was written", "meta/tasks.parquet: is gone"]


def test_an_unknown_field_is_named(built: dict[str, Dataset], tmp_path: Path) -> None:
    about = read_json(built["lerobot"].path / "dataset.json")
    write_json(tmp_path / "dataset.json", about | {"colour": 1})
    with pytest.raises(SchemaError, match=r"dataset\.json: colour"):
        Dataset(tmp_path)


def test_a_contact_sheet_is_drawn(built: dict[str, Dataset], tmp_path: Path) -> None:
    shown = write_contact_sheet(tmp_path / "sheet.png", built["parquet"], 1, frames=4)
    assert len(shown) == 4
    assert all(isinstance(frame["does"], str) for frame in shown)
    assert (tmp_path / "sheet.png").stat().st_size > 20_000


def test_parts_of_other_wishes_are_not_taken(kept_runs: list[Path]) -> None:
    small, large = tasks_of(request(kept_runs)), tasks_of(request(kept_runs, outputs=("rgb",)))
    assert not {task["key"] for task in small} & {task["key"] for task in large}
    json.dumps(small)  # whoever hands them out may send them anywhere


BAD = [
    ([], "give --runs, or --world and --episodes"),
    (["--runs", "{run}", "--episodes", "3"], "not both"),
    (["--runs", "{run}", "{run}"], "given twice"),
    (["--runs", "{nothing}"], "is no finished run"),
    (["--runs", "{run}", "--outputs", "smell"], "no output 'smell'"),
    (["--runs", "{run}", "--size", "63"], "even number"),
    (["--runs", "{run}", "--size", "512", "--test", "0"], "256 pixels were recorded"),
    (["--runs", "{run}", "--agents", "nobody"], "nobody is called 'nobody'"),
    (["--runs", "{run}", "--agents", "resident_2", "--test", "0"], "record it with --keep rgb,depth"),
    (["--runs", "{run}", "--agents", "resident_2", "--outputs", "rgb", "--test", "0"], "--observe resident_2"),
    (["--runs", "{run}", "--test", "1.5"], "below 1"),
    (["--runs", "{run}", "--workers", "-1"], "--workers -1"),
    (["--world", "{nothing}", "--episodes", "1"], "world"),
    (["--world", "{world}", "--episodes", "1", "--method", "clever"], "no method 'clever'"),
]


@pytest.mark.parametrize(("words", "said"), BAD, ids=[said for _, said in BAD])
def test_bad_input_is_one_sentence_and_leaves_nothing(
    words: list[str],
    said: str,
    kept_runs: list[Path],
    helsinki_path: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    names = {"run": kept_runs[0], "nothing": tmp_path, "world": helsinki_path}
    given = [word.format(**names) for word in words]
    outputs = [] if "--outputs" in words else ["--outputs", "rgb,depth"]
    code = vico("dataset", "build", "--to", "lerobot", *given, *outputs, "--out", tmp_path / "out")
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("vico: ")]
    assert code == 2
    assert len(lines) == 1
    assert said in lines[0]
    assert not (tmp_path / "out").exists()


def test_other_peoples_folders_are_left_alone(
    kept_runs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["dataset", "build", "--to", "parquet", "--runs", *kept_runs[:1], "--outputs", "none", "--test", 0, "--out"]
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("all of it")
    assert vico(*words, tmp_path / "mine") == 2
    assert "exists already" in capsys.readouterr().err
    (tmp_path / "out.partial").mkdir()
    (tmp_path / "out.partial" / "thesis.txt").write_text("all of it")
    assert vico(*words, tmp_path / "out") == 2
    assert "holds something else than parts of a dataset" in capsys.readouterr().err
    assert (tmp_path / "mine" / "thesis.txt").read_text() == (tmp_path / "out.partial" / "thesis.txt").read_text()


def test_one_bad_run_does_not_take_the_others_with_it(
    kept_runs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = tmp_path / "broken"
    shutil.copytree(kept_runs[1], broken)
    next(broken.glob("views/resident_0/*.npz")).write_bytes(b"PK")
    code = vico(
        "dataset", "build", "--to", "parquet", "--outputs", "rgb", "--size", 64, "--test", 0, "--runs", kept_runs[0],
        broken, "--out", tmp_path / "out",
    )  # fmt: skip
    assert code == 1
    assert "broken: " in capsys.readouterr().err
    assert Dataset(tmp_path / "out").about.episodes == 2
    assert len(Dataset(tmp_path / "out").about.missing) == 1


def test_the_verbs_answer_in_json(
    built: dict[str, Dataset], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = built["parquet"].path
    assert vico("dataset", "info", path, "--json") == 0
    assert json.loads(capsys.readouterr().out)["episodes"] == 6
    assert vico("dataset", "check", path, "--json") == 0
    assert json.loads(capsys.readouterr().out)["findings"] == []
    assert vico("dataset", "show", path, "--episode", 2, "--frames", 3, "--out", tmp_path / "s.png", "--json") == 0
    assert len(json.loads(capsys.readouterr().out)) == 3
    assert vico("dataset", "show", path, "--episode", 99, "--out", tmp_path / "t.png") == 2
    assert "no episode 99" in capsys.readouterr().err
    assert vico("dataset", "check", tmp_path) == 2
    assert "holds no dataset.json" in capsys.readouterr().err
