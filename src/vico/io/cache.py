"""The cache folder: downloads, and products of them, kept between runs."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs

_NO_HOME = Path("/nonexistent")  # as the system's own users have it that have none


def cache_folder() -> Path:
    """Return the user's cache folder of this project: ``$VICO_CACHE``, else the platform's usual place.

    It may not exist yet, nor can it be made for a user without a home: then nothing is kept.
    """
    if chosen := os.environ.get("VICO_CACHE"):
        return Path(os.path.expanduser(chosen))
    try:
        return platformdirs.user_cache_path("vico", appauthor=False)
    except RuntimeError:  # neither HOME nor an entry among the users
        return _NO_HOME / ".cache" / "vico"
