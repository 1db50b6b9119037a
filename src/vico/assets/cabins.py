"""The insides of vehicles that can be looked into: where light comes in, and what keeps it out."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from vico.assets.bus import bus_cabin
from vico.assets.tram import tram_cabin
from vico.assets.vehicle_parts import Cabin

#: Ends of the names of sections of trams and trains, which are alike inside.
_SECTIONS = ("_front", "_middle", "_rear")
_COUPLED = ("tram", "light_rail", "train")


@cache
def cabin_of(name: str, *, mirrored: bool = False) -> Cabin | None:
    """Return the inside of a vehicle's prototype, None of what has none that is seen.

    Parameters
    ----------
    name
        As in `vico.assets.vehicles.vehicle_prototypes`, `tram_prototypes` and `train_prototypes`.
    mirrored
        Whether a bus has its doors on the left.
    """
    if name == "bus":
        cabin = bus_cabin()
        return replace(cabin, left=cabin.right, right=cabin.left) if mirrored else cabin
    if name.endswith(_SECTIONS) and name.rpartition("_")[0] in _COUPLED:
        return tram_cabin()
    return None
