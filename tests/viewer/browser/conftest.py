"""A recorded run, its server, and a browser without a window; skipped where there is none."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from command_line import vico
from shared_folders import Shared
from vico.errors import MissingExtraError, MissingFileError
from vico.viewer.headless import BrowserPage, browser_program, open_page
from vico.viewer.three import three_module

STEPS = 40


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark all tests of this folder."""
    here = Path(__file__).parent
    for item in items:
        if here in item.path.parents:
            item.add_marker(pytest.mark.browser)


@pytest.fixture(scope="session")
def browser() -> None:
    """Skip where there is no browser to drive, or no server to ask."""
    try:
        browser_program()
    except MissingExtraError as error:
        pytest.skip(str(error))
    for package in ("websockets", "starlette", "uvicorn"):
        pytest.importorskip(package, reason="the page's server needs: pip install 'virtual-community[viewer]'")


@pytest.fixture(scope="session")
def library() -> None:
    """Skip where the 3D library is not installed."""
    try:
        three_module()
    except MissingFileError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def page_run(helsinki_path: Path, helsinki_people: Path, shared: Shared) -> Path:
    """A run folder of four residents, two robots, cars and pedestrians."""

    def make(out: Path) -> None:
        code = vico(
            "run", helsinki_path, helsinki_people, "--start", "08:00", "--steps", STEPS, "--robots", "husky,go2",
            "--cars", 5, "--cyclists", 2, "--pedestrians", 8, "--observe", "resident_0", "--out", out / "run",
        )  # fmt: skip
        assert code == 0

    return shared("page_run", make) / "run"


@contextmanager
def served(run: Path, *, keep: Path | None = None) -> Iterator[str]:
    """Serve a run while the block lasts; give its address, the same again where `keep` is."""
    from vico.viewer.city import city_folder
    from vico.viewer.server.serve import ViewerServer
    from vico.viewer.server.state import ViewerState
    from vico.viewer.sources.source import Source
    from vico.viewer.sources.views import RecordedViews

    source = Source.of_run(run)
    assert source.tables.run is not None
    assert source.world is not None
    state = ViewerState(source, RecordedViews(source.tables.run).view, city=city_folder(source.world))
    with ViewerServer(state, keep=keep) as server:
        yield server.url


@pytest.fixture(scope="module")
def address(browser: None, library: None, page_run: Path) -> Iterator[str]:
    """Address of the run's page, with its token."""
    with served(page_run) as url:
        yield url


@pytest.fixture(scope="module")
def page(address: str) -> Iterator[BrowserPage]:
    """The page, opened and drawn, standing still at its first step."""
    with open_page() as opened:
        opened.resize(1000, 640)
        opened.go_to(address)
        opened.wait_for("window.vico && vico.view && vico.state.before && vico.view.city.textured", seconds=90)
        opened.evaluate("vico.view.adapts = false, vico.view.setCare(1), vico.clock.playing = false")
        yield opened
