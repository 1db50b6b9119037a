"""Which model a mapped thing has: OpenStreetMap's tags to the names of prototypes."""

from __future__ import annotations

import re

import numpy as np

from vico.geo.osm import OsmData, Tags
from vico.geo.quantities import numbers
from vico.worldgen.facts.street_habits import street_habits
from vico.worldgen.objects import catalogue


def region(osm: OsmData) -> str:
    """Where the look of street things differs: the family of the place's street habits, such as ``uk`` or ``us``."""
    return street_habits(osm).family


def sign_of(code: str) -> str | None:
    """Model of a sign by its `traffic_sign` code (``FI:361[30]``, ``US:R1-1``, ``stop``); None if it is none."""
    first = re.split(r"[;,]", code)[0].strip()
    signs = catalogue.signs()
    if first in signs.words:
        return signs.words[first] or None
    found = re.match(r"([A-Z]{2}):\s*([A-Z]*\d*(?:-\d+)?)", first)
    table = signs.codes.get(found.group(1)) if found else None
    if found is None or table is None:
        return None
    mark = found.group(2)
    for length in range(len(mark), 0, -1):
        if mark[:length] in table:
            return table[mark[:length]] or None
    return None


def on_the_ground(tags: Tags) -> bool:
    """Whether a thing stands outdoors at street level."""
    if tags.get("location") in ("underground", "indoor", "wall", "roof", "rooftop"):
        return False
    if tags.get("indoor", "no") not in ("no", "outdoor") or tags.get("tunnel", "no") not in ("no",):
        return False
    levels = numbers(tags.get("level"))
    return not levels or 0.0 in levels


def thing_of(tags: Tags, *, where: str = "", random: np.random.Generator | None = None) -> str | None:
    """Name of the model for a mapped thing.

    Parameters
    ----------
    tags
        Its tags.
    where
        As `region` says.
    random
        Picks among models that suit equally well; the first without.

    Returns
    -------
    str or None
        None if it is nothing that stands in streets.
    """
    if not on_the_ground(tags):
        return None
    found = _by_main_tag(tags)
    if found is None:
        return sign_of(tags["traffic_sign"]) if "traffic_sign" in tags else None
    if found == "recycling" and _takes_glass_alone(tags):
        return "recycling_glass"
    for finer in catalogue.kinds().finer.get(found, ()):
        models = finer.choice(tags, where)
        if models is not None:
            chosen = models[0] if random is None or len(models) == 1 else models[int(random.integers(len(models)))]
            return chosen or None
    return found


def _by_main_tag(tags: Tags) -> str | None:
    for key, models in catalogue.kinds().tables:
        value = tags.get(key)
        found = models.get(value, models.get(catalogue.ANY)) if value is not None else None
        if found:
            return found
    return None


def _takes_glass_alone(tags: Tags) -> bool:
    taken = [key for key, value in tags.items() if key.startswith("recycling:") and value == "yes"]
    return bool(taken) and all("glass" in key for key in taken)
