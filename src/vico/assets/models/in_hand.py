"""What people have in their hands while they eat, drink, march or keep dry: data in ``data/models/in_hand/*.toml``.

The origin of such a model is where the fist holds it, and not the middle of its foot.
"""

from __future__ import annotations

from vico.assets.models.files import read_all
from vico.assets.models.model import Model
from vico.io.data_files import cached_data, data_files

ROOM = "models/in_hand"


@cached_data
def in_hand_models() -> dict[str, Model]:
    """Return the models by name: ours and the user's, which may replace ours."""
    return read_all(data_files(ROOM))


@cached_data
def placards() -> list[str]:
    """Return the names of the placards there are."""
    return [name for name, model in in_hand_models().items() if model.kind == "placard"]


@cached_data
def umbrellas() -> list[str]:
    """Return the names of the umbrellas there are."""
    return [name for name, model in in_hand_models().items() if model.kind == "umbrella"]
