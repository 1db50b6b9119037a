"""Furniture for homes, shops, restaurants, offices and public places, and the small things that lie on it.

All of it is data: ``data/models/indoor/*.toml``.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from vico.assets.models.files import DATA, read_folder
from vico.assets.models.model import Model

FOLDER = DATA / "indoor"
_ORDER = ("furniture", "homes", "shops", "public", "small_things")


@cache
def furniture_models(*further: Path) -> dict[str, Model]:
    """Return the models of furniture by name, ours and those of further folders, which may replace ours."""
    models = read_folder(FOLDER, first=_ORDER)
    for folder in further:
        models |= read_folder(folder)
    return models
