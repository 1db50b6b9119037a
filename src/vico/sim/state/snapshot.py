"""The whole state as named arrays: hashed at every step, saved to one file, and read back."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import MissingFileError, SchemaError
from vico.io.arrays import read_npz
from vico.io.files import write_bytes
from vico.version import __version__

SCHEMA = "vico.snapshot"
VERSION = 1


def state_hash(arrays: Mapping[str, NDArray[Any]]) -> str:
    """Return BLAKE2b-128 over names, types, shapes and bytes of all arrays, in the order given; hex.

    Texts are mostly empty: of an array of them those that are not count, and which they are.
    """
    digest = hashlib.blake2b(digest_size=16)
    for name, array in arrays.items():
        digest.update(f"{name}|{array.dtype.str}|{array.shape}|".encode())
        if array.dtype.kind == "U" and array.size and array.dtype.itemsize:
            letters = np.ascontiguousarray(array).reshape(-1).view(np.uint32).reshape(array.size, -1)
            written = np.flatnonzero(letters.any(axis=1))
            digest.update(written.tobytes())
            array = letters[written]
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def arrays_of(arrays: Mapping[str, NDArray[Any]], prefix: str) -> dict[str, NDArray[Any]]:
    """Return the arrays whose names start with ``prefix.``, without it."""
    head = prefix + "."
    return {name[len(head) :]: array for name, array in arrays.items() if name.startswith(head)}


def identity(config: Mapping[str, Any], world: str, residents: Sequence[str], objects: Sequence[str]) -> str:
    """Hash what decides how a simulation runs on from a state: version, configuration, world, people and objects.

    Parameters
    ----------
    config
        Record of the configuration.
    world
        Digest of the world.
    residents, objects
        Names, in their order.
    """
    what = {
        "version": __version__,
        "config": config,
        "world": world,
        "community": list(residents),
        "objects": list(objects),
    }
    return hashlib.sha256(json.dumps(what, sort_keys=True, default=str).encode()).hexdigest()


def write_snapshot(path: Path, arrays: Mapping[str, NDArray[Any]], *, owner: str) -> None:
    """Write a snapshot as ``.npz``, whole or not at all.

    Parameters
    ----------
    owner
        Identity of the simulation it belongs to: version, configuration, world and community.
    """
    sink = io.BytesIO()
    head = {"__schema__": np.array(SCHEMA), "__version__": np.array(VERSION), "__owner__": np.array(owner)}
    for name, array in arrays.items():
        if array.dtype.hasobject:
            raise TypeError(f"snapshot: {name} holds objects; arrays of numbers and text can be saved")
    np.savez_compressed(sink, allow_pickle=False, **head, **arrays)
    write_bytes(path, sink.getvalue())


def read_snapshot(path: Path, *, owner: str) -> dict[str, NDArray[Any]]:
    """Read what `write_snapshot` wrote.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is damaged, no snapshot, or belongs to another simulation.
    """
    try:
        arrays = read_npz(path.read_bytes())
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such snapshot") from None
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise SchemaError(f"{path}: not a readable snapshot ({error})") from None
    schema = str(arrays.pop("__schema__", ""))
    version = int(arrays.pop("__version__", -1))
    found = str(arrays.pop("__owner__", ""))
    if schema != SCHEMA or version != VERSION:
        raise SchemaError(f"{path}: schema {schema!r} version {version} is not {SCHEMA} version {VERSION}")
    if found != owner:
        raise SchemaError(
            f"{path}: was saved by a simulation of another version, world, community or configuration; "
            "load it into one that is made in the same way"
        )
    return arrays
