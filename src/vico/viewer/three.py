"""The 3D library that the page draws with: `three`, from a package that ships it as one module."""

from __future__ import annotations

from pathlib import Path

from vico.assets.packages import Package, installed_folder
from vico.errors import MissingFileError

_MODULE = "nicegui/elements/scene/dist/index.js"

#: The module alone, and its licences; the wheel's other files are a framework that is not used here.
THREE = Package(
    "nicegui",
    "3.18.0",
    ("a2bd51642312d98aab6d8b641245d796ff1b89da5829777170bcc488140c3dcd",),
    "MIT",
    "three.js r180 by its authors (2010-2025, MIT), as bundled in NiceGUI by Zauberzeug GmbH (MIT).",
    (_MODULE, "*/licenses/LICENSE"),
    size_limit=8_000_000,
)


def three_module() -> Path:
    """Return the module's file.

    Raises
    ------
    MissingFileError
        If it is not installed.
    """
    folder = installed_folder(THREE)
    if folder is None:
        raise MissingFileError("the page's 3D library is not installed; type: vico assets install viewer")
    return folder / _MODULE
