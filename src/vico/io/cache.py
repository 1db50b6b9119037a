"""Where downloads and what is made of them are kept between runs."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs


def cache_folder() -> Path:
    """Return the user's cache folder of this project: ``$VICO_CACHE``, else the platform's usual place.

    It may not exist yet.
    """
    if chosen := os.environ.get("VICO_CACHE"):
        return Path(chosen).expanduser()
    return platformdirs.user_cache_path("vico", appauthor=False)
