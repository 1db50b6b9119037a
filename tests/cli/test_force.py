"""`--force` replaces what the same verb made, and nothing else."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from command_line import vico
from vico.challenges.tables.results import EVALUATION_FOLDER
from vico.cli.demo import evening_folder
from vico.community.folder import COMMUNITY_FOLDER
from vico.datasets.folder import DATASET_FOLDER
from vico.errors import OutputExistsError
from vico.io.files import FolderKind
from vico.sim.recording import interventions
from vico.sim.recording.schema import RUN_FOLDER
from vico.world.exports import EXPORT_FOLDER
from vico.world.world import WORLD_FOLDER

Words = list[object]


@pytest.fixture
def verbs(corner_path: Path, helsinki_people: Path, helsinki_path: Path, tmp_path: Path) -> dict[str, Words]:
    """A command for every verb that makes a folder, without its output."""
    table = tmp_path / "places.csv"
    table.write_text("name,lat,lon\nhere,60.17,24.94\n")
    return {
        "world build": ["world", "build", "--radius", 60, "--lat", 60.169, "--lon", 24.9435],
        "community build": ["community", "build", helsinki_path, "--residents", 2],
        "community day": ["community", "day", helsinki_people, "--day", "monday"],
        "run": [
            "run",
            helsinki_path,
            helsinki_people,
            "--steps",
            1,
            "--observe",
            "none",
            "--cars",
            0,
            "--pedestrians",
            0,
            "--robots",
            "none",
        ],
        "export": ["export", corner_path, "--to", "geojson"],
        "dataset build": ["dataset", "build", "--runs", corner_path, "--to", "webdataset"],
        "eval": ["eval", "commute", "--worlds", corner_path, "--method", "rule"],
    }


@pytest.mark.parametrize(
    "name", ["world build", "community build", "community day", "run", "export", "dataset build", "eval"]
)
def test_a_folder_of_ones_own_survives_force(
    name: str, verbs: dict[str, Words], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    thesis = tmp_path / "thesis"
    thesis.mkdir()
    (thesis / "chapter.tex").write_text("years of work")
    assert vico(*verbs[name], "--out", thesis, "--force") == 2
    assert "chapter.tex" in capsys.readouterr().err
    assert (thesis / "chapter.tex").read_text() == "years of work"


def test_a_run_is_replaced_but_not_with_what_else_lies_in_it(
    verbs: dict[str, Words], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    assert vico(*verbs["run"], "--out", out) == 0
    assert vico(*verbs["run"], "--out", out, "--force") == 0
    (out / "notes.txt").write_text("look at step 3")
    capsys.readouterr()
    assert vico(*verbs["run"], "--out", out, "--force") == 2
    assert "holds 'notes.txt', which no run does" in capsys.readouterr().err
    assert (out / "notes.txt").exists()


@pytest.mark.parametrize("name", ["segments/mine.txt", "views/resident_0/mine.png", "community/.git/HEAD"])
def test_what_lies_deeper_in_a_run_survives_too(
    name: str,
    helsinki_run: tuple[Path, dict[str, object]],
    verbs: dict[str, Words],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = shutil.copytree(helsinki_run[0], tmp_path / "run")
    (out / name).parent.mkdir(parents=True, exist_ok=True)
    (out / name).write_text("years of work")
    assert vico(*verbs["run"], "--out", out, "--force") == 2
    assert f"holds {name!r}, which no run does" in capsys.readouterr().err
    assert (out / name).exists()


@pytest.mark.parametrize("name", ["previews/my_photo.png", "meshes/notes.txt", "mine/a.txt"])
def test_what_lies_deeper_in_a_world_survives_too(name: str, corner_path: Path, tmp_path: Path) -> None:
    world = shutil.copytree(corner_path, tmp_path / "world")
    (world / "meshes" / ".ground.glb.a1b2c3d4.glb").write_bytes(b"")  # of a build that was killed
    WORLD_FOLDER.require(world)
    (world / name).parent.mkdir(exist_ok=True)
    (world / name).write_text("years of work")
    with pytest.raises(OutputExistsError, match=f"holds '{name}', which no world does"):
        WORLD_FOLDER.require(world)


def test_a_link_to_a_run_is_said_to_be_one(helsinki_run: tuple[Path, dict[str, object]], tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(helsinki_run[0])
    with pytest.raises(OutputExistsError, match="is a link, and --force replaces no links"):
        RUN_FOLDER.require(tmp_path / "link")


def test_an_export_is_replaced_and_a_world_is_not_by_an_export(
    verbs: dict[str, Words], corner_path: Path, tmp_path: Path
) -> None:
    out = tmp_path / "export"
    assert vico(*verbs["export"], "--out", out) == 0
    assert vico(*verbs["export"], "--out", out, "--force") == 0
    world = shutil.copytree(corner_path, tmp_path / "world")
    assert vico(*verbs["export"], "--out", world, "--force") == 2
    assert (world / "world.json").exists()


@pytest.mark.parametrize(
    "kind",
    [WORLD_FOLDER, COMMUNITY_FOLDER, RUN_FOLDER, evening_folder(), DATASET_FOLDER, EXPORT_FOLDER, EVALUATION_FOLDER],
)
def test_every_kind_takes_an_empty_folder_and_no_file(kind: FolderKind, tmp_path: Path) -> None:
    kind.require(tmp_path)
    (tmp_path / "letter").write_text("dear")
    with pytest.raises(OutputExistsError, match="letter"):
        kind.require(tmp_path)
    with pytest.raises(OutputExistsError, match="is no folder"):
        kind.require(tmp_path / "letter")


def test_folders_as_they_are_made_are_of_their_kinds(
    corner_path: Path, helsinki_people: Path, helsinki_run: tuple[Path, dict[str, object]]
) -> None:
    WORLD_FOLDER.require(corner_path)
    COMMUNITY_FOLDER.require(helsinki_people)
    RUN_FOLDER.require(helsinki_run[0])


def test_a_run_that_was_shown_and_reached_into_is_still_a_run(
    helsinki_run: tuple[Path, dict[str, object]], tmp_path: Path
) -> None:
    pytest.importorskip("uvicorn")
    from vico.viewer.server.serve import ADDRESS, ViewerServer
    from vico.viewer.server.state import ViewerState
    from vico.viewer.sources.source import Source

    run = shutil.copytree(helsinki_run[0], tmp_path / "run")
    with ViewerServer(ViewerState(Source.of_run(run), lambda *_: ({}, "")), keep=run):
        pass
    (run / interventions.INTERVENTIONS_FILE).write_text("")
    assert (run / ADDRESS).is_file()
    RUN_FOLDER.require(run)
