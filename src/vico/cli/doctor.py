"""`vico doctor`: what this machine has, what is missing, and the command that mends it."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from vico.cli.output import print_json

_BASE = (
    "numpy",
    "numba",
    "scipy",
    "shapely",
    "osmium",
    "pyproj",
    "manifold3d",
    "mujoco",
    "pyarrow",
    "av",
    "pettingzoo",
)


@dataclass(frozen=True)
class Diagnosis:
    """One thing looked at. `needed` tells whether the default install works without it."""

    what: str
    ok: bool
    needed: bool
    found: str
    mend: str = ""


def _python() -> Diagnosis:
    ok = (3, 11) <= sys.version_info[:2] < (3, 14)
    return Diagnosis("Python", ok, True, platform.python_version(), "install Python 3.11, 3.12 or 3.13")


def _package(name: str, *, needed: bool, mend: str) -> Diagnosis:
    try:
        return Diagnosis(name, True, needed, importlib.metadata.version(name))
    except importlib.metadata.PackageNotFoundError:
        return Diagnosis(name, False, needed, "not installed", mend)


def _memory() -> Diagnosis:
    gigabytes = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    return Diagnosis("memory", gigabytes >= 4, True, f"{gigabytes:.1f} GB", "4 GB are needed for an 800 m world")


def _disk() -> Diagnosis:
    free = shutil.disk_usage(Path.cwd()).free / 1e9
    return Diagnosis("free disk", free >= 1, True, f"{free:.1f} GB", "free 1 GB")


def _film() -> Diagnosis:
    """Write a film of four frames for real: a codec that is listed may still fail to open."""
    import numpy as np

    from vico.render.film import write_film

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "test.mp4"
        try:
            write_film(path, (np.full((64, 64, 3), i * 60, np.uint8) for i in range(4)), rate=4)
        except (OSError, ValueError) as error:
            return Diagnosis("film encoder", False, True, str(error), "pip install --force-reinstall av")
        return Diagnosis("film encoder", True, True, f"{path.stat().st_size} bytes written")


def _frame() -> Diagnosis:
    """Render one frame on the CPU, as every observation is."""
    import numpy as np

    from vico.assets.shapes import box
    from vico.render import Cameras, Scene, render

    scene = Scene([box((1, 1, 1), (5, 0, 0)).of_entity(7)], {})
    frames = render(scene, Cameras(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]])))
    seen = int((frames.segmentation == 7).sum())
    return Diagnosis("renderer", seen > 0, True, f"a box covers {seen} pixels", "report this as a bug, with this table")


def findings() -> list[Diagnosis]:
    """Look at everything; nothing is changed."""
    pip = "pip install virtual-community"
    found = [_python(), *(_package(name, needed=True, mend=pip) for name in _BASE)]
    found.append(
        _package("eclipse-sumo", needed=False, mend="pip install 'virtual-community[worldgen]' to build worlds")
    )
    checks: list[Callable[[], Diagnosis]] = [_memory, _disk, _frame, _film]
    return found + [check() for check in checks]


def doctor(*, json: bool = False) -> int:
    """Print the findings; 1 if something needed is missing."""
    found = findings()
    if json:
        print_json([asdict(finding) for finding in found])
    else:
        table = Table("what", "", "found", "to mend")
        for f in found:
            mark = "ok" if f.ok else ("MISSING" if f.needed else "optional")
            table.add_row(f.what, mark, f.found, "" if f.ok else f.mend)
        Console().print(table)
    return 0 if all(f.ok or not f.needed for f in found) else 1
