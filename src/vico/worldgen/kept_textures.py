"""Painted pictures kept in the user's cache, as the files that worlds hold: painted and packed once, then read.

All tiles of a city and all worlds that are built later use the same facades, roofs and pavings.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.io.cache import cache_folder
from vico.io.compiled import source_digest
from vico.io.files import write_bytes
from vico.world.glb import packed_png

Picture = NDArray[np.uint8]

# Folders that are kept: states of the sources and data between which one goes to and fro.
_KEPT = 4


@dataclass(frozen=True)
class Painters:
    """Pictures that one module paints.

    Parameters
    ----------
    file, module
        The module: what it and all that it imports say decides what its pictures look like.
    """

    file: str
    module: str

    def picture(self, name: str, paint: Callable[[], Picture], *, data: str = "") -> tuple[Picture, bytes]:
        """Return a picture and its PNG file, from the cache if it is there, else painted and kept.

        Parameters
        ----------
        name
            That no other picture of the module has.
        paint
            Paints it: the same picture whenever it is called.
        data
            A digest of the data files by which it is painted.
        """
        path = self._folder(data) / f"{hashlib.sha256(name.encode()).hexdigest()[:24]}.png"
        kept = _read(path)
        if kept is None:
            texture = paint()
            kept = texture, packed_png(texture)
            # A cache that can't be written costs time, nothing else.
            with contextlib.suppress(OSError):
                _make_room(path.parent)
                write_bytes(path, kept[1])
        return kept

    def _folder(self, data: str) -> Path:
        made_by = [source_digest(Path(self.file), self.module), data, np.__version__, _packer()]
        key = hashlib.sha256(json.dumps(made_by).encode()).hexdigest()[:24]
        return cache_folder() / "textures" / f"{self.module}-{key}"


@lru_cache(maxsize=1)
def _packer() -> str:
    """Return a digest of how pictures are packed here: libraries of other versions and builds make other bytes."""
    y, x = np.mgrid[0:128, 0:128]
    probe = np.stack([x * y, x ^ y, x + 3 * y], axis=2).astype(np.uint8)
    return hashlib.sha256(packed_png(probe)).hexdigest()


def _read(path: Path) -> tuple[Picture, bytes] | None:
    """Return a kept picture and its file; None if it is absent or damaged, so that it is painted anew."""
    try:
        packed = path.read_bytes()
        with Image.open(io.BytesIO(packed), formats=["PNG"]) as image:
            return np.asarray(image), packed
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None


def _make_room(folder: Path) -> None:
    """Make a folder if it is not there, and let go of those of the same module that were made long before it."""
    if folder.is_dir():
        return
    module = folder.name.rpartition("-")[0]
    others = sorted(folder.parent.glob(f"{module}-*"), key=lambda path: path.stat().st_mtime)
    for old in others[: 1 - _KEPT]:
        shutil.rmtree(old, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
