"""`vico assets`: bodies, robots and things read from the packages that ship them. Everything works without."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Literal

from rich.console import Console
from rich.table import Table

from vico.assets.furniture_pack import PACK, available_things, credits_of, fetch_things, read_things
from vico.assets.packages import (
    SMALL_LANGUAGE_MODEL,
    FetchError,
    Package,
    fetch,
    installed_folder,
    small_language_model,
)
from vico.assets.people.anny import available, baked_file
from vico.assets.people.bake import PEOPLE, bake
from vico.assets.robots import robot_model, robot_names, robot_packages
from vico.cli.output import print_json
from vico.io.cache import cache_folder
from vico.viewer.three import THREE, three_module

Pack = Literal["people", "robots", "viewer", "things", "llm", "all"]


def _say(sentence: str) -> None:
    print(sentence, file=sys.stderr)


def install(what: Pack = "all", *, pack: Path | None = None, force: bool = False) -> int:
    """Fetch packs, prepare them once, and print licences and credits.

    Parameters
    ----------
    what
        Which pack.
    pack
        Where the things are, as a ``.deb`` or a folder of archives; fetched otherwise.
    force
        Fetch and prepare again.

    Raises
    ------
    FetchError, IntegrityError, MissingFileError
        If a package cannot be had, or is not the one expected; packs finished before stay.
    """
    began = time.perf_counter()
    if what in ("people", "all"):
        folder = fetch(PEOPLE, force=force, say=_say)
        if force or not available():
            _say("cutting and thinning the bodies")
            bake(folder, baked_file())
        _say(f"people: {baked_file()} ({baked_file().stat().st_size / 1e6:.1f} MB)")
    if what in ("robots", "all"):
        for package in robot_packages():
            fetch(package, force=force, say=_say)
        for name in robot_names():
            robot_model(name)
            _say(f"robots: {name} is ready")
    if what in ("viewer", "all"):
        fetch(THREE, force=force, say=_say)
        _say(f"viewer: {three_module()}, for `vico view` and `vico live`")
    if what == "llm":
        fetch(SMALL_LANGUAGE_MODEL, force=force, say=_say)
        _say(f"llm: {small_language_model()}, for `vico llm serve`")
    if what in ("things", "all"):
        try:
            baked = fetch_things(pack, force=force, say=_say)
            _say(f"things: {baked} ({baked.stat().st_size / 1e6:.1f} MB), for `vico world build --things installed`")
        except FetchError as error:
            if what == "things":
                raise
            _say(f"{error}")  # a system's package: never a need
    _say(f"done in {time.perf_counter() - began:.0f} s; all of it is in {cache_folder()}")
    return 0


def status(*, json: bool = False) -> int:
    """Say which packs are installed, with their licences."""
    rows = [("people", PEOPLE, available())]
    rows.append(("llm", SMALL_LANGUAGE_MODEL, installed_folder(SMALL_LANGUAGE_MODEL) is not None))
    rows += [("robots", package, installed_folder(package) is not None) for package in robot_packages()]
    rows.append(("viewer", THREE, installed_folder(THREE) is not None))
    if json:
        print_json([*(_entry(pack, package, ready) for pack, package, ready in rows), *_things()])
        return 0
    table = Table("pack", "package", "", "licence", "credits")
    for pack, package, ready in rows:
        state = "installed" if ready else "not installed"
        table.add_row(pack, f"{package.name} {package.version}", state, package.licence, package.credits)
    for row in _things():
        state = "installed" if row["installed"] else "not installed"
        table.add_row("things", str(row["package"]), state, str(row["licence"]), str(row["credits"]))
    Console().print(table)
    return 0


def _things() -> list[dict[str, object]]:
    """Return a row for each collection of things, or one that says there is none."""
    if not available_things():
        rest = "Things are our own models."
        return [
            {"pack": "things", "package": PACK, "version": "1.8", "installed": False, "licence": "", "credits": rest}
        ]
    return [
        {"pack": "things", "package": c.collection, "version": "1.8", "installed": True, "licence": c.licence,
         "credits": c.words}
        for c in credits_of(read_things()[0])
    ]  # fmt: skip


def _entry(pack: str, package: Package, ready: bool) -> dict[str, object]:
    return {
        "pack": pack,
        "package": package.name,
        "version": package.version,
        "installed": ready,
        "licence": package.licence,
        "credits": package.credits,
    }
