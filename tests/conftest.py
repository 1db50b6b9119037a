"""Worlds that many tests look at, built once from real data by whichever process needs them first, and kept."""

from __future__ import annotations

import gc
import io
import json
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numba
import pytest
from hypothesis import settings

from command_line import vico
from shared_folders import FOLDERS, Shared
from vico.community import build_community, write_community
from vico.io.compiled import compiled_folder
from vico.world.folder import read_world
from vico.world.world import STAGES, World
from vico.worldgen.pipeline import build_world
from vico.worldgen.request import BuildOptions
from vico.worldgen.stages import SUFFIX

# The same examples in every run; HYPOTHESIS_PROFILE=search draws others.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("search", deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

# What tests import and share is never garbage: it need not be looked through over and over.
gc.set_threshold(20_000, 20, 20)
os.environ["VICO_OVERPASS"] = "off"  # tests ask no server but their own
# A test with a cache folder of its own need not compile everything anew, nor a process that it starts.
numba.config.CACHE_DIR = os.environ.setdefault("NUMBA_CACHE_DIR", str(compiled_folder()))

EXTRACT = Path(__file__).parents[1] / "src" / "vico" / "data" / "helsinki.osm.pbf"
SHARED = Path(__file__).parents[2] / "shared" / "data"


# Files whose tests take longest: they start processes, build worlds of their own, run to the end and again.
_LONG = ("test_examples.py", "test_readme.py", "test_resume.py", "test_episodes.py", "test_stages.py")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Order the tests so that two processes wait as little as may be, for each other and at the end.

    Each begins at its part of the list. The first one makes the city; meanwhile the second one makes what the rest
    needs, and then does what takes long, so that what is left at the end is short and can be shared out.
    """

    def needs(item: pytest.Item, fixture: str) -> bool:
        return fixture in getattr(item, "fixturenames", ())

    city = [item for item in items if needs(item, "helsinki_city")]
    people = [item for item in items if needs(item, "helsinki_people") and item not in city][:1]
    long = [item for item in items if item.path.name in _LONG and item not in city + people]
    taken = set(map(id, city + people + long))
    rest = [item for item in items if id(item) not in taken]
    before_half = max(len(items) // 2 - len(city), 0)
    items[:] = city + rest[:before_half] + people + long + rest[before_half:]


@pytest.fixture(scope="session")
def shared() -> Iterator[Shared]:
    """Make a folder once for all processes and runs: ``shared(name, make, rooms)``. No test may change what lies there.

    It is made anew when the sources of the rooms have changed that make it; without rooms, when anything has.
    """
    yield FOLDERS.folder
    FOLDERS.confirm()


def _world(out: Path, half: float) -> None:
    build_world(EXTRACT, lat=60.1690, lon=24.9435, half=half, seed=0, out=out, options=BuildOptions(previews=False))


@pytest.fixture(scope="session")
def helsinki_path(shared: Shared) -> Path:
    """A folder with 300 m x 300 m of central Helsinki, built from the packaged extract."""
    return shared("helsinki", lambda out: _world(out, 150.0), ["worldgen"])


@pytest.fixture(scope="session")
def helsinki(helsinki_path: Path) -> World:
    """The world in `helsinki_path`."""
    return read_world(helsinki_path)


@pytest.fixture(scope="session")
def corner_path(shared: Shared) -> Path:
    """A folder with 120 m x 120 m of central Helsinki: as small as a world can be and have everything."""
    return shared("corner", lambda out: _world(out, 60.0), ["worldgen"])


@pytest.fixture
def begun(corner_path: Path) -> Callable[..., None]:
    """Lay what the stages of `corner` made where a build of the same place goes on with it: ``begun(out, *without)``.

    As if it had been killed at its end; or, without some stages, before they had been made.
    """

    def lay(out: Path, *without: str) -> None:
        stages = out.with_name(f"{out.name}.partial") / STAGES
        shutil.copytree(corner_path / STAGES, stages)
        for name in without:
            (stages / f"{name}{SUFFIX}").unlink()

    return lay


@pytest.fixture(scope="session")
def corner(corner_path: Path) -> World:
    """The world in `corner_path`."""
    return read_world(corner_path)


@pytest.fixture(scope="session")
def helsinki_city(shared: Shared) -> World:
    """700 m x 700 m of central Helsinki: large enough for bus lines and bicycle stations."""
    return read_world(shared("city", lambda out: _world(out, 350.0), ["worldgen"]))


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real data beside the checkout; tests that need it are skipped where it is absent."""
    if not SHARED.is_dir():
        pytest.skip(f"{SHARED} is not there: real extracts beside the checkout are needed")
    return SHARED


@pytest.fixture(scope="session")
def helsinki_people(helsinki: World, helsinki_path: Path, shared: Shared) -> Path:
    """A community folder with four residents of `helsinki_path`."""
    return shared(
        "people",
        lambda out: write_community(build_community(helsinki, residents=4), out, world=helsinki_path),
        ["worldgen", "community"],
    )


@pytest.fixture(scope="session")
def helsinki_run(helsinki_path: Path, helsinki_people: Path, shared: Shared) -> tuple[Path, dict[str, Any]]:
    """A run folder of eight steps with one observer and the Husky, and what ``vico run --json`` printed."""

    def make(out: Path) -> None:
        printed = io.StringIO()
        with redirect_stdout(printed):
            code = vico(
                "run", helsinki_path, helsinki_people, "--steps", 8, "--robots", "husky", "--cars", 3,
                "--pedestrians", 3, "--observe", "resident_0", "--out", out / "run", "--json",
            )  # fmt: skip
        assert code == 0
        (out / "printed.json").write_text(printed.getvalue())

    out = shared("run", make)
    return out / "run", json.loads((out / "printed.json").read_text())
