"""All data that building a world needs, read at once: a wrong entry is told before anything is built."""

from __future__ import annotations

from vico.assets.models.library import INDOOR, OUTDOOR, read_all
from vico.io.data_files import own_files
from vico.worldgen.facades import facade_styles as facades
from vico.worldgen.facts import named_places
from vico.worldgen.indoor import catalogue as rooms
from vico.worldgen.objects import catalogue as objects
from vico.worldgen.objects.detections import detected_classes


def read_tables() -> None:
    """Read every file of data, ours and the user's, and make the user's models.

    Raises
    ------
    InputError
        If `VICO_DATA` names no folder.
    SchemaError
        If a file can't be used; the message names file and entry.
    """
    for models in (read_all(own_files(OUTDOOR)), read_all(own_files(INDOOR))):
        for model in models.values():
            _ = model.surfaces
    for read in (
        facades.styles,
        named_places.categories,
        named_places.source_words,
        named_places.place_names,
        objects.kinds,
        objects.signs,
        objects.standing,
        objects.trees,
        objects.barriers,
        detected_classes,
        rooms.room_kinds,
        rooms.uses,
    ):
        read()
