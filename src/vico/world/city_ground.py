"""The ground of a whole city, in files that are read where they are looked at: heights, and where people walk."""

from __future__ import annotations

import zipfile
from pathlib import Path

from vico.errors import MissingFileError, SchemaError
from vico.io.arrays import drop_pages, mapped_array
from vico.io.npz import read_npz
from vico.world.city_files import EDGE, HIGH, LEVELS, LOW, REACHED, ROOM, SMOOTH, SURFACES
from vico.world.decks import Decks
from vico.world.heights import HeightField, Steps
from vico.world.stairs import Stairs
from vico.world.walkable import WalkableMap


def whole_ground(folder: Path, half: float) -> HeightField:
    """Open the heights of a city.

    Parameters
    ----------
    folder
        What the city has as a whole.
    half
        Half the side of the square they cover, metres.

    Raises
    ------
    MissingFileError, SchemaError
        If a file is not there, or damaged.
    """
    path = folder / LEVELS
    try:
        arrays = read_npz(path.read_bytes())
        decks, stairs = Decks.from_arrays(arrays), Stairs.from_arrays(arrays)
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; build the city anew") from None
    except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise SchemaError(f"{path}: not readable ({error}); build the city anew") from None
    steps = Steps(*(mapped_array(folder / name) for name in (EDGE, LOW, HIGH)))
    return HeightField(mapped_array(folder / SMOOTH), half, steps, decks, stairs)


def give_back(ground: HeightField) -> None:
    """Give back the memory that the heights of a city were read into: they are read again where they are looked at."""
    drop_pages(ground.heights)
    if ground.steps is not None:
        for array in (ground.steps.edge, ground.steps.low, ground.steps.high):
            drop_pages(array)


def whole_walkable(folder: Path, half: float) -> WalkableMap:
    """Open where people walk in a city; raises as `whole_ground`."""
    surfaces, room, reached = (mapped_array(folder / name) for name in (SURFACES, ROOM, REACHED))
    walkable = WalkableMap(surfaces, half)
    walkable.__dict__.update(clearance=room, connected=reached)
    return walkable
