"""A second process makes stages of a build ahead; the world is the same with it and without, and where it fails."""

from __future__ import annotations

import logging
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from vico.jobs import Helper
from vico.threads import WORKERS
from vico.world.folder import read_world
from vico.world.world import World, stage_seconds
from vico.worldgen import background_stages, construction
from vico.worldgen.pipeline import build_world
from vico.worldgen.request import BuildOptions

EXTRACT = Path(__file__).parents[2] / "src" / "vico" / "data" / "helsinki.osm.pbf"
CENTRE = {"lat": 60.1690, "lon": 24.9435}
# What all that stands there comes of: a second process is started where nothing of it is kept.
EARLIER = ("plans", "terrain", "streets", "grading", "bridges", "stairs", "buildings", "ways")
Begun = Callable[..., None]
AHEAD = {"clad": "cladding", "ground_from_osm": "ground"}


@pytest.fixture
def made_here(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the stages that this process makes though another may; there is a processor for that."""
    made: list[str] = []
    for function, name in AHEAD.items():
        real = getattr(construction, function)

        def counted(*inputs: object, name: str = name, real: object = real, **options: object) -> object:
            made.append(name)
            return real(*inputs, **options)  # type: ignore[operator]

        monkeypatch.setattr(construction, function, counted)
    monkeypatch.setenv(WORKERS, "2")
    monkeypatch.setattr(background_stages, "_FEWEST", 1)
    return made


def test_stages_made_ahead_are_those_that_would_be_made_here(
    corner: World, begun: Begun, tmp_path: Path, made_here: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # However long it takes to start, it is waited for.
    monkeypatch.setattr(Helper, "withdraw", lambda self, number: False)
    begun(tmp_path / "w", *EARLIER, *AHEAD.values())
    built = build_world(EXTRACT, **CENTRE, half=60, out=tmp_path / "w", options=BuildOptions(previews=False))
    assert made_here == []
    assert built == corner.manifest
    assert all(stage_seconds(read_world(tmp_path / "w"))[name] > 0.0 for name in AHEAD.values())


def test_what_has_not_been_begun_is_made_here(
    corner: World, begun: Begun, tmp_path: Path, made_here: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Helper, "withdraw", lambda self, number: True)
    begun(tmp_path / "w", *EARLIER, *AHEAD.values())
    built = build_world(EXTRACT, **CENTRE, half=60, out=tmp_path / "w", options=BuildOptions(previews=False))
    assert sorted(made_here) == sorted(AHEAD.values())
    assert built == corner.manifest


@pytest.mark.parametrize("maker", ["vico.worldgen.background_stages:nothing", "toy_service:doubler"])
def test_a_process_that_fails_is_told_and_costs_only_time(
    corner: World,
    begun: Begun,
    tmp_path: Path,
    made_here: list[str],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    maker: str,
) -> None:
    monkeypatch.setattr(background_stages, "_MAKER", maker)
    monkeypatch.setattr(Helper, "withdraw", lambda self, number: False)
    begun(tmp_path / "w", *EARLIER, *AHEAD.values())
    with caplog.at_level(logging.WARNING, logger="vico"):
        built = build_world(EXTRACT, **CENTRE, half=60, out=tmp_path / "w", options=BuildOptions(previews=False))
    assert sorted(made_here) == sorted(AHEAD.values())
    assert built == corner.manifest
    told = [record.getMessage() for record in caplog.records]
    assert [message.split(",")[0] for message in told if "second process" in message] == [
        f"stage {name} was not made by the second process" for name in ("ground", "cladding")
    ]


def test_where_no_process_can_be_started_all_is_made_here(
    corner: World, begun: Begun, tmp_path: Path, made_here: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "executable", str(tmp_path / "nothing"))
    begun(tmp_path / "w", *EARLIER, *AHEAD.values())
    built = build_world(EXTRACT, **CENTRE, half=60, out=tmp_path / "w", options=BuildOptions(previews=False))
    assert sorted(made_here) == sorted(AHEAD.values())
    assert built == corner.manifest


def test_a_build_that_goes_on_with_what_is_kept_starts_no_process(
    corner_path: Path, tmp_path: Path, made_here: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(corner_path, tmp_path / "w")

    def start(*_: object, **__: object) -> None:
        raise AssertionError("a process was started")

    monkeypatch.setattr(background_stages, "Helper", start)
    build_world(EXTRACT, **CENTRE, half=60, out=tmp_path / "w", force=True, options=BuildOptions(previews=False))
