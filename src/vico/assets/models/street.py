"""Things that stand outdoors, at life size: data in ``data/models/outdoor/*.toml``, and plants.

Plants grow by rule and chance: a list of their leaves would be longer than the rule and say less. They stay code.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from vico.assets.models.files import DATA, read_folder
from vico.assets.models.model import Model
from vico.assets.models.plants import plant_models

FOLDER = DATA / "outdoor"
_ORDER = ("street", "squares", "traffic", "playgrounds", "barriers")


@cache
def street_models(*further: Path) -> dict[str, Model]:
    """Return the models of all that stands outdoors by name, with those of further folders, which may replace ours."""
    models = read_folder(FOLDER, first=_ORDER) | {plant.name: plant for plant in plant_models()}
    for folder in further:
        models |= read_folder(folder)
    return models
