"""The cache folder: the user's own choice, else the platform's."""

from __future__ import annotations

from pathlib import Path

import pytest

from vico.io.cache import cache_folder


def test_the_users_choice_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VICO_CACHE", "~/elsewhere")
    assert cache_folder() == Path.home() / "elsewhere"


def test_else_it_is_the_platforms_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("VICO_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr("sys.platform", "linux")
    assert cache_folder() == tmp_path / "vico"
