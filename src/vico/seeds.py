"""Randomness by name: every use has a stream of its own, so that adding one changes no other."""

from __future__ import annotations

import zlib

import numpy as np

from vico.errors import InputError


def rng(seed: int, *names: str | int) -> np.random.Generator:
    """Return the random stream that belongs to `names` under `seed`.

    The same seed and names give the same stream in every process; different names give independent streams.

    Raises
    ------
    InputError
        If the seed is negative.
    """
    if seed < 0:
        raise InputError(f"seed: {seed}; it must not be negative")
    key = [zlib.crc32(name.encode()) if isinstance(name, str) else int(name) for name in names]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=tuple(key))))
