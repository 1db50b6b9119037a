"""What tags of OpenStreetMap say: numbers with units, levels, bridges."""

from __future__ import annotations

import math
from collections.abc import Mapping


def number(text: str | None) -> float | None:
    """Read a tag value's first number in metres (``12 m``, ``12,5``, ``40'``, ``40 ft``); None if there is none."""
    if not text:
        return None
    cleaned = text.strip().split(";")[0].replace(",", ".").lower()
    scale = 1.0
    for unit, factor in (("ft", 0.3048), ("'", 0.3048), ("m", 1.0)):
        if cleaned.endswith(unit):
            cleaned, scale = cleaned[: -len(unit)].strip(), factor
            break
    try:
        value = float(cleaned) * scale
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def on_the_ground(tags: Mapping[str, str]) -> bool:
    """Whether a way or area lies at ground level outdoors: not in a tunnel, indoors or on a lower layer."""
    if tags.get("tunnel", "no") not in ("no", "building_passage") or tags.get("indoor", "no") != "no":
        return False
    if tags.get("location") == "underground" or tags.get("highway") == "corridor":
        return False
    layer = number(tags.get("layer"))
    level = number(tags.get("level"))
    return (layer is None or layer >= 0) and (level is None or level >= 0 or layer is not None)


def level_of(tags: Mapping[str, str]) -> int:
    """Return the layer a way lies on: as mapped, else 1 for bridges, -1 for tunnels, 0 for the rest."""
    try:
        return round(float(tags["layer"].split(";")[0]))
    except (KeyError, ValueError, OverflowError):
        return 1 if is_bridge(tags) else -1 if tags.get("tunnel", "no") not in ("no", "building_passage") else 0


def is_bridge(tags: Mapping[str, str]) -> bool:
    """Whether a way leads over a bridge."""
    return tags.get("bridge", "no") != "no"
