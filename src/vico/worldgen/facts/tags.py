"""What tags of OpenStreetMap say: levels, bridges."""

from __future__ import annotations

from collections.abc import Mapping

from vico.geo.quantities import number, quantity


def is_underground(tags: Mapping[str, str]) -> bool:
    """Whether a building lies below the ground, all of it.

    `location`, `tunnel` and `level` say so. `layer` alone does not: it says what is drawn over what, as of a house
    under a viaduct; beside ``parking=underground`` it does.
    """
    if tags.get("location") == "underground" or tags.get("tunnel") == "yes":
        return True
    if tags.get("parking") == "underground" and tags.get("layer", "").startswith("-"):
        return True
    # All of its levels are below the ground: -1;-2 is, -1;0;1 is not, nor is the range -1-2.
    highest = number(tags.get("level"))
    return highest is not None and highest < 0.0


def on_the_ground(tags: Mapping[str, str]) -> bool:
    """Whether a way or area lies at ground level outdoors: not in a tunnel, indoors or on a level below the ground.

    A layer below 0 alone does not say so: a stream or a street under a bridge has one. A level below the ground does,
    unless the layer says that it is not below.
    """
    if tags.get("tunnel", "no") not in ("no", "building_passage") or tags.get("indoor", "no") != "no":
        return False
    if tags.get("location") == "underground" or tags.get("highway") == "corridor":
        return False
    layer, level = quantity(tags, "layer"), number(tags.get("level"))
    return level is None or level >= 0 or (layer is not None and layer >= 0)


def level_of(tags: Mapping[str, str]) -> int:
    """Return the layer a way lies on: as mapped, else 1 for bridges, -1 for tunnels, 0 for the rest."""
    if (layer := quantity(tags, "layer")) is not None:
        return round(layer)
    return 1 if is_bridge(tags) else -1 if tags.get("tunnel", "no") not in ("no", "building_passage") else 0


def is_bridge(tags: Mapping[str, str]) -> bool:
    """Whether a way leads over a bridge."""
    return tags.get("bridge", "no") != "no"
