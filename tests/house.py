"""Which rooms of the house lie below which, and a digest of all that some rooms make things from."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Collection, Iterator
from hashlib import sha256
from pathlib import Path

from test_rooms import ALLOWED, GROUND, OPEN
from vico.io.cache import cache_folder

SOURCE = Path(__file__).parents[1] / "src" / "vico"


def below(rooms: Collection[str]) -> set[str]:
    """Return rooms with all that they may import, directly or not. The front doors may import everything."""
    found: set[str] = set()
    waiting = list(rooms)
    while waiting:
        room = waiting.pop().partition(".")[0]
        if room not in found:
            found.add(room)
            waiting += ALLOWED if room in OPEN else ALLOWED.get(room, set())
    return found


def above(rooms: Collection[str]) -> set[str]:
    """Return rooms with all that may import them, directly or not."""
    return {room for room in (*ALLOWED, *OPEN) if below([room]) & set(rooms)}


def digest(rooms: Collection[str] | None, *more: Path) -> str:
    """Return 16 hexadecimal digits that change with what a run of some rooms can depend on.

    Parameters
    ----------
    rooms
        Of the house; those below count too. None stands for all, with the front doors.
    more
        Files of tests that count, with the helpers that they import.

    Returns
    -------
    str
        Of source text, packaged data, files of tests, installed packages and assets, Python, and our variables.
    """
    whole = sha256()
    for path in (*_files(rooms), *_with_helpers(more)):
        whole.update(f"\n{os.path.relpath(path, SOURCE)} ".encode() + path.read_bytes())
    whole.update(_SURROUNDINGS)
    return whole.hexdigest()[:16]


def _surroundings() -> bytes:
    packages = {path.name for folder in map(Path, sys.path) for path in folder.glob("*.dist-info")}
    assets = {path.name for path in cache_folder().glob("assets/*")}
    ours = {name: value for name, value in os.environ.items() if name.startswith("VICO_") and name not in _SET_BY_TESTS}
    return repr((sys.version, sorted(packages), sorted(assets), sorted(ours.items()))).encode()


_SET_BY_TESTS = {"VICO_CACHE", "VICO_OVERPASS"}
_SURROUNDINGS = _surroundings()  # as a run begins: single tests set variables and cache folders of their own


def _with_helpers(makers: Collection[Path]) -> list[Path]:
    """Return files of tests with the fixtures that they share and the helpers that they import, directly or not."""
    tests = Path(__file__).parent
    # What a maker is given comes from the fixtures of its folder and of those above.
    folders = {folder for maker in makers for folder in maker.parents if folder.is_relative_to(tests)}
    found = {*makers, *(path for folder in folders for path in folder.glob("conftest.py"))}
    waiting = list(found)
    while waiting:
        for name in re.findall(r"^\s*(?:from|import) (\w+)", waiting.pop().read_text(encoding="utf-8"), re.MULTILINE):
            helper = tests / name
            if name.startswith("test_"):
                continue
            package = helper.glob("*.py") if (helper / "__init__.py").is_file() else ()
            files = {*package, *(path for path in [helper.with_suffix(".py")] if path.is_file())}
            waiting += files - found
            found |= files
    return sorted(found)


def _files(rooms: Collection[str] | None) -> Iterator[Path]:
    kept = None if rooms is None else below(rooms) | {"data", *(f"{name}.py" for name in GROUND)}
    for path in sorted(SOURCE.rglob("*")):
        first = path.relative_to(SOURCE).parts[0]
        if path.is_file() and path.suffix != ".pyc" and (kept is None or first in kept):
            yield path
