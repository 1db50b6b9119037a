"""The front door: `import vico` is enough for the first steps."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import toy_city
import vico
from vico.cli.options import CommunityBuildOptions, WorldBuildOptions
from vico.errors import InputError
from vico.world.world import World


def test_importing_vico_loads_no_room() -> None:
    code = "import sys, vico; print([name for name in sys.modules if name.startswith('vico.')])"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == "['vico.version']"


@pytest.mark.parametrize("name", vico.__all__)
def test_every_public_name_is_there_and_documented(name: str) -> None:
    value = getattr(vico, name)
    assert name == "__version__" or value.__doc__


def test_a_name_that_is_not_there_is_told() -> None:
    with pytest.raises(AttributeError, match="module 'vico' has no attribute 'bild_world'"):
        vico.bild_world  # noqa: B018


@pytest.mark.parametrize(
    ("function", "options"),
    [(vico.build_world, WorldBuildOptions), (vico.build_community, CommunityBuildOptions)],
)
def test_the_command_line_has_the_same_defaults(function: Callable[..., Any], options: type) -> None:
    usual = {field.name: field.default for field in fields(options)}
    here = {name: one.default for name, one in signature(function).parameters.items() if name in usual}
    # There `out` may be left out, or a file given for several.
    both = here.keys() - {"out", "dem"}
    assert {"seed"} < both
    assert {name: here[name] for name in both} == {name: usual[name] for name in both}


def test_a_community_is_built_written_and_checked(helsinki_path: Path, tmp_path: Path) -> None:
    community = vico.build_community(helsinki_path, residents=3, seed=4, out=tmp_path / "people")
    assert vico.check_community(tmp_path / "people", helsinki_path) == []
    assert [r.id for r in vico.read_community(tmp_path / "people").residents] == [r.id for r in community.residents]


def test_a_view_shows_the_street_from_where_it_is_asked(helsinki: World) -> None:
    spot = helsinki.walkable.random_point(np.random.default_rng(0))
    view = vico.view_world(helsinki, at=spot[:2], toward=(0.0, 0.0), width=96, height=64)
    assert view.rgb.shape == (64, 96, 3)
    assert view.depth[-1].max() > 0.5  # the ground before one's feet
    assert {"ground", "road", "building"} & {entity["kind"] for entity in view.names.values()}


@pytest.mark.parametrize("at", [(0.0,), (0.0, float("nan")), (1.0, 2.0, 3.0, 4.0)])
def test_a_view_from_no_point_is_refused(helsinki: World, at: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="is no point"):
        vico.view_world(helsinki, at=at)


def test_a_view_of_a_world_without_streets_asks_from_where() -> None:
    with pytest.raises(InputError, match="say from where with `at`"):
        vico.view_world(toy_city.world())


def test_half_a_centre_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="lat and lon go together"):
        vico.build_world(tmp_path / "w", lat=60.0)
