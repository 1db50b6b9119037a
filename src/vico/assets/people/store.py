"""Bodies kept in the user's cache: made once, then read in a millisecond or two."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import zipfile
from dataclasses import fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from vico.assets.people.model import JOINTS, Appearance, SkinnedBody
from vico.io.cache import cache_folder
from vico.io.compiled import source_digest
from vico.io.files import sha256_of, write_bytes
from vico.io.npz import read_npz

_ARRAYS = tuple(field.name for field in fields(SkinnedBody) if field.name != "height")


def stored_body(look: Appearance, source: str, data: Path | None) -> Path:
    """Return where a light body is kept, or would be.

    Parameters
    ----------
    look
        Whose body.
    source
        Which maker: "procedural" or "anny", and what for if not the usual light body.
    data
        File that the maker reads, if it does.
    """
    made_of = _hash_of(data, data.stat().st_mtime_ns) if data else ""
    key = json.dumps([_makers(), source, made_of, look.to_dict()], sort_keys=True)
    return cache_folder() / "bodies" / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.npz"


@lru_cache(maxsize=1)
def _makers() -> str:
    """Return a digest of the code that makes bodies: when it changes, kept bodies are of no use."""
    return source_digest(Path(__file__).with_name("choice.py"), "vico.assets.people.choice")


@lru_cache(maxsize=2)
def _hash_of(data: Path, changed: int) -> str:
    return sha256_of(data)


def read_body(path: Path) -> SkinnedBody | None:
    """Read a kept body; None if it is absent or damaged, so that it is made anew."""
    try:
        arrays = read_npz(path.read_bytes(), (*_ARRAYS, "height"))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    if len(arrays) < len(_ARRAYS) + 1:
        return None
    count = len(arrays["vertices"])
    sound = arrays["weights"].shape == (count, 4) and arrays["joints"].shape == (len(JOINTS), 3)
    if not sound or not 0 <= int(arrays["triangles"].min()) <= int(arrays["triangles"].max()) < count:
        return None
    for name in ("triangles", "weight_joints"):
        arrays[name] = arrays[name].astype(np.int32)
    return SkinnedBody(**{name: arrays[name] for name in _ARRAYS}, height=float(arrays["height"]))


def keep_body(path: Path, body: SkinnedBody) -> None:
    """Write a body, whole or not at all."""
    arrays: dict[str, Any] = {name: getattr(body, name) for name in _ARRAYS}
    arrays["triangles"] = body.triangles.astype(np.uint16)
    arrays["weight_joints"] = body.weight_joints.astype(np.uint8)
    arrays["height"] = np.float64(body.height)
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    # A cache that can't be written costs time, nothing else.
    with contextlib.suppress(OSError):
        write_bytes(path, buffer.getvalue())
