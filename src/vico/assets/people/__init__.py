"""Bodies of people: how somebody looks, and the skinned mesh that comes of it."""

from vico.assets.people.choice import PASSERS_BY, body_of, passer_by, random_appearance
from vico.assets.people.model import (
    BOTTOMS,
    FINGERS,
    HAIR,
    JOINTS,
    PARENTS,
    SHOES,
    TOPS,
    Appearance,
    Bottom,
    Colour,
    Hair,
    J,
    Shoes,
    SkinnedBody,
    Top,
    t_pose,
)

__all__ = [
    "BOTTOMS",
    "FINGERS",
    "HAIR",
    "JOINTS",
    "PARENTS",
    "PASSERS_BY",
    "SHOES",
    "TOPS",
    "Appearance",
    "Bottom",
    "Colour",
    "Hair",
    "J",
    "Shoes",
    "SkinnedBody",
    "Top",
    "body_of",
    "passer_by",
    "random_appearance",
    "t_pose",
]
