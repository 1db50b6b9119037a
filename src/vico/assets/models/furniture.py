"""Furniture for homes, shops, restaurants, offices and public places, and the small things that lie on it.

All of it is data: ``data/models/indoor/*.toml``, and the files of a user's own (docs/adding_a_model.md).
"""

from __future__ import annotations

from vico.assets.models.files import read_all
from vico.assets.models.model import Model
from vico.io.data_files import cached_data, data_files

ROOM = "models/indoor"
_ORDER = ("furniture", "homes", "shops", "public", "small_things")


@cached_data
def furniture_models() -> dict[str, Model]:
    """Return the models of furniture by name: ours and the user's, which may replace ours."""
    return read_all(data_files(ROOM, first=_ORDER))
