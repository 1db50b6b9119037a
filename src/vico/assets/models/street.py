"""Things that stand outdoors, at life size: plants, and data in ``data/models/outdoor/*.toml`` and of a user's own.

Plants grow by rule and chance: a list of their leaves would be longer than the rule and say less. They stay code.
"""

from __future__ import annotations

from vico.assets.models.files import read_all
from vico.assets.models.model import Model
from vico.assets.models.plants import plant_models
from vico.io.data_files import cached_data, data_files, own_files

ROOM = "models/outdoor"
_ORDER = ("street", "squares", "traffic", "playgrounds", "barriers")


@cached_data
def street_models() -> dict[str, Model]:
    """Return the models of all that stands outdoors by name: ours and the user's, which may replace ours."""
    own = own_files(ROOM)
    packaged = [path for path in data_files(ROOM, first=_ORDER) if path not in own]
    return read_all(packaged) | {plant.name: plant for plant in plant_models()} | read_all(own)
