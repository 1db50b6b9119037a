"""The page when its server goes and comes again, and where the 3D library is missing."""

from __future__ import annotations

from pathlib import Path

import pytest

import vico.viewer.three
from vico.viewer.headless import open_page

from .conftest import served


def test_the_page_finds_a_server_that_was_started_again(
    browser: None, library: None, page_run: Path, tmp_path: Path
) -> None:
    with open_page() as page:
        with served(page_run, keep=tmp_path) as first:
            page.resize(800, 560)
            page.go_to(first)
            page.wait_for("window.vico && vico.source.connected && vico.state.before", seconds=90)
        page.wait_for("vico.source.connected === false")
        assert "lost" in page.evaluate("document.getElementById('connection').textContent")
        with served(page_run, keep=tmp_path) as second:
            assert second == first
            page.wait_for("vico.source.connected", seconds=40)
            assert page.evaluate("document.getElementById('connection').textContent") == ""


def test_without_the_library_there_is_the_map_and_what_to_type(
    browser: None, page_run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(vico.viewer.three, "installed_folder", lambda package: None)
    with served(page_run) as address, open_page() as page:
        page.resize(800, 560)
        page.go_to(address)
        page.wait_for("window.vico && vico.state.before && document.body.classList.contains('flat')", seconds=60)
        assert "vico assets install viewer" in page.evaluate("document.getElementById('notice').textContent")
        page.wait_for("vico.page.map.scale > 0")
        page.press("n", "KeyN")
        page.wait_for("vico.page.selected > 0")
