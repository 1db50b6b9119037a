"""`vico doctor`: what this machine has, what is missing, and the command that mends it.

It answers in seconds: nothing is compiled, unless everything is to be tried (`--thorough`).
"""

from __future__ import annotations

import json as json_files
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from vico.cli.console import print_json

# Package -> what of it is imported, where that is called otherwise. MuJoCo is imported as we do it.
_MODULES = {
    "mujoco": "vico.io.mujoco",
    "mapbox-earcut": "mapbox_earcut",
    "opening-hours-py": "opening_hours",
    "Pillow": "PIL.Image",
    "pyarrow": "pyarrow.parquet",
    "scipy": "scipy.spatial",
    "eclipse-sumo": "sumo",
}
# What a process of its own is told to do: import modules and say after each how it went. One that crashes says nothing.
_IMPORT = """
import importlib, json, sys
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
        wrong = ""
    except BaseException as error:
        wrong = f"{type(error).__name__}: {error}"
    print(json.dumps([name, wrong]), flush=True)
"""


@dataclass(frozen=True)
class Diagnosis:
    """One thing looked at. `needed` tells whether the default install works without it."""

    what: str
    ok: bool
    needed: bool
    found: str
    mend: str = ""


def _packages() -> list[Diagnosis]:
    """Look for the packages of the default install, and import each: what is installed may not load."""
    import importlib.metadata

    try:
        told = importlib.metadata.requires("virtual-community") or []
    except importlib.metadata.PackageNotFoundError:
        return [Diagnosis("virtual-community", False, True, "not installed", "pip install -e . in the checkout")]
    base = [one.partition(";")[0].strip() for one in told if "extra ==" not in one]
    requirements = {re.split(r"[\[<>=!~ ]", one)[0]: one for one in base}
    versions: dict[str, str] = {}
    for name in requirements:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    wrong = _not_importable([_module(name) for name in versions])
    found = []
    for name, requirement in requirements.items():
        if name not in versions:
            found.append(Diagnosis(name, False, True, "not installed", f"pip install '{requirement}'"))
        elif why := wrong.get(_module(name)):
            mend = f"pip install --force-reinstall --no-deps {name}=={versions[name]}"
            found.append(Diagnosis(name, False, True, f"{versions[name]} cannot be imported: {why}", mend))
        else:
            found.append(Diagnosis(name, True, True, versions[name]))
    return found


def _module(package: str) -> str:
    return _MODULES.get(package, package.lower())


def _not_importable(modules: list[str]) -> dict[str, str]:
    """Import modules in another process; return those that fail, with why."""
    wrong: dict[str, str] = {}
    waiting = modules
    while waiting:
        done = subprocess.run(
            [sys.executable, "-c", _IMPORT, *waiting], capture_output=True, text=True, errors="replace", check=False
        )
        told = [json_files.loads(line) for line in done.stdout.splitlines() if line.startswith("[")]
        wrong |= {name: " ".join(why.split())[:200] for name, why in told if why}
        waiting = waiting[len(told) :]
        if waiting:  # the process ended with this one
            wrong[waiting[0]] = f"importing it ends Python (exit status {done.returncode})"
            waiting = waiting[1:]
    return wrong


def _netconvert() -> Diagnosis:
    import importlib.metadata

    mend = "pip install 'virtual-community[worldgen]' to build worlds"
    try:
        return Diagnosis("eclipse-sumo", True, False, importlib.metadata.version("eclipse-sumo"))
    except importlib.metadata.PackageNotFoundError:
        return Diagnosis("eclipse-sumo", False, False, "not installed", mend)


def _memory() -> Diagnosis:
    gigabytes = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    return Diagnosis("memory", gigabytes >= 4, True, f"{gigabytes:.1f} GB", "4 GB are needed for an 800 m world")


def _disk() -> Diagnosis:
    try:
        free = shutil.disk_usage(Path.cwd()).free / 1e9
    except OSError as error:
        return Diagnosis("free disk", False, True, f"this folder: {error.strerror}", "go to a folder that is there")
    return Diagnosis("free disk", free >= 1, True, f"{free:.1f} GB", "free 1 GB")


def _compiled_code() -> Diagnosis:
    """Say whether compiled code is kept, and can be."""
    from vico.io.compiled import compiled_folder

    folder = compiled_folder()
    try:
        kept = sum(1 for file in folder.glob("*/*.nbc"))
        there = next(place for place in (folder, *folder.parents) if place.exists())
    except OSError as error:
        mend = "name another folder with VICO_CACHE"
        return Diagnosis("compiled code", False, False, f"{folder}: {error.strerror}", mend)
    if not os.access(there, os.W_OK):
        mend = (
            f"make {there} writable, or name another folder with VICO_CACHE; every start compiles anew what is missing"
        )
        return Diagnosis("compiled code", False, False, f"{kept} functions in {folder}, none can be added", mend)
    mend = "vico warm-up; else the first run compiles for minutes"
    return Diagnosis("compiled code", kept > 0, False, f"{kept} functions in {folder}", mend)


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


def _physics() -> Diagnosis:
    """Let a ball fall in MuJoCo."""
    from vico.io.mujoco import mujoco

    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    for _ in range(100):
        mujoco.mj_step(model, data)
    fallen = -float(data.qpos[2])
    return Diagnosis("physics", 0.1 < fallen < 10.0, True, f"a ball fell {fallen:.2f} m", "report this as a bug")


def findings(*, thorough: bool = False) -> list[Diagnosis]:
    """Look at everything; nothing is changed.

    Parameters
    ----------
    thorough
        Also draw, write a film and simulate. The first time that compiles for a minute or more.
    """
    import platform

    is_supported = (3, 11) <= sys.version_info[:2] < (3, 15)
    found = [
        Diagnosis("Python", is_supported, True, platform.python_version(), "install Python 3.11, 3.12, 3.13 or 3.14"),
        *_packages(),
        _netconvert(),
    ]
    checks: list[Callable[[], Diagnosis]] = [_memory, _disk]
    if all(one.ok or not one.needed for one in found):  # what follows needs the packages
        checks += [_compiled_code, *((_frame, _film, _physics) if thorough else ())]
    return found + [check() for check in checks]


def doctor(thorough: bool = False, json: bool = False) -> int:
    """Say whether this machine has what vico needs, and what is missing. Exit 1 if something needed is missing.

    Args:
        thorough: Try it all, too: draw, write a film, simulate. Where nothing is compiled yet that takes minutes.
        json: Print JSON.
    """
    from rich.console import Console
    from rich.table import Table

    found = findings(thorough=thorough)
    if json:
        print_json([asdict(finding) for finding in found])
    else:
        table = Table("what", "", "found", "to mend")
        for f in found:
            mark = "ok" if f.ok else ("MISSING" if f.needed else "optional")
            table.add_row(f.what, mark, f.found, "" if f.ok else f.mend)
        Console().print(table)
    return 0 if all(f.ok or not f.needed for f in found) else 1
