"""Compiled code is kept between runs, and is never that of sources that have changed."""

import dis
import importlib
import os
import pkgutil
import subprocess
import sys
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from types import FunctionType

import pytest

import vico
from vico.io.kernel_digest import kernel_digest, names_looked_up
from vico.io.sources import source_digest

_RECORDS = """
from typing import NamedTuple

class Car(NamedTuple):
    speed: float
"""
_RULES = """
from vico.io.compiled import compiled

LIMIT = 10.0

@compiled
def slower(speed):
    return speed - 1.0
"""
_DRIVE = """
from town.rules import LIMIT, slower
from vico.io.compiled import compiled

@compiled
def drive(car):
    return min(slower(car.speed), LIMIT)
"""
_RUN = """
import town.records
from town.drive import drive

car, = (kind for kind in vars(town.records).values() if isinstance(kind, type) and kind.__module__ == "town.records")
print(drive(car(8.0)), sum(drive.stats.cache_hits.values()))
"""


@pytest.fixture
def town(tmp_path: Path) -> Path:
    """A package of three modules: `drive` compiles in what `rules` holds, and is given records it never names."""
    package = tmp_path / "town"
    package.mkdir()
    for name, text in {"__init__": "", "records": _RECORDS, "rules": _RULES, "drive": _DRIVE}.items():
        (package / f"{name}.py").write_text(text)
    return package


def run(town: Path, cache: Path | None = None) -> tuple[float, int, str]:
    """Drive in a fresh process: the speed, how often compiled code was found, and what was said of trouble."""
    paths = [str(town.parent), *(path for path in sys.path if path)]
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"PYTHONPATH": os.pathsep.join(paths), "VICO_CACHE": str(cache or town.parent / "cache")}
    done = subprocess.run(
        [sys.executable, "-B", "-c", _RUN], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    speed, hits = done.stdout.split()
    return float(speed), int(hits), done.stderr


def test_processes_that_start_at_once_compile_each_function_once(town: Path) -> None:
    paths = os.pathsep.join([str(town.parent), *(path for path in sys.path if path)])
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"PYTHONPATH": paths, "VICO_CACHE": str(town.parent / "cache")}
    program = _RUN.replace("print(", "print('ready', flush=True)\ninput()\nprint(")
    with ExitStack() as ended:
        both = [
            ended.enter_context(
                subprocess.Popen(
                    [sys.executable, "-B", "-c", program],
                    env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                )
            )
            for _ in range(2)
        ]  # fmt: skip
        for process in both:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
        for process in both:
            assert process.stdin is not None
            process.stdin.write("\n")
            process.stdin.flush()
        printed = sorted(process.stdout.readline() for process in both if process.stdout)
    assert printed == ["7.0 0\n", "7.0 1\n"]


def _printed(town: Path, program: str) -> str:
    paths = os.pathsep.join([str(town.parent), *(path for path in sys.path if path)])
    environment = os.environ | {"NUMBA_CACHE_DIR": str(town.parent / "cache"), "PYTHONPATH": paths}
    return subprocess.run(
        [sys.executable, "-B", "-c", program], env=environment, check=True, capture_output=True, text=True
    ).stdout


def change(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def test_a_second_run_finds_what_the_first_compiled(town: Path) -> None:
    assert run(town)[:2] == (7.0, 0)
    assert run(town)[:2] == (7.0, 1)
    assert list(town.glob("**/*.nbi")) == []  # nothing beside the sources


def test_a_function_or_constant_of_another_file_that_changes_is_compiled_anew(town: Path) -> None:
    run(town)
    change(town / "rules.py", "speed - 1.0", "speed - 2.0")
    assert run(town)[:2] == (6.0, 0)
    change(town / "rules.py", "LIMIT = 10.0", "LIMIT = 5.0")
    assert run(town)[:2] == (5.0, 0)


def test_a_function_is_compiled_once_for_all_constants_of_a_type(town: Path) -> None:
    change(town / "drive.py", "slower(car.speed)", "slower(times(times(car.speed, 1), 2))")
    change(town / "drive.py", "import LIMIT, slower", "import LIMIT, slower, times")
    change(
        town / "rules.py", "@compiled", "@compiled\ndef times(speed, factor):\n    return speed * factor\n\n@compiled"
    )
    program = _RUN + "from town.rules import times\nprint(len(times.get_call_template.__self__.overloads))\n"
    assert _printed(town, program) == "10.0 0\n1\n"


_GROUND = """
from typing import NamedTuple
import numpy as np
from vico.io.compiled import compiled

class Ground(NamedTuple):
    heights: object
    marks: object

@compiled
def highest(ground, first):
    best, part = 0.0, ground.heights[first:]
    for height in part:
        best = max(best, height)
    ground.marks[:] = best
    return best

@compiled
def part(ground, first):
    return ground.heights[first:]

@compiled
def copied(ground):
    return Ground(ground.heights + 1.0, ground.marks.copy())

@compiled
def survey(ground):
    mine = np.arange(3.0)
    total = highest(Ground(mine, mine), 0)
    for first in range(len(ground.heights)):
        total += highest(ground, first) + part(ground, first)[0] + highest(copied(ground), first)
    return total
"""
_SURVEY = """
import os
import sys
os.environ["NUMBA_NRT_STATS"] = "1"
import numpy as np
from numba.core.runtime import rtsys
from town.ground import Ground, highest, part, survey

ground = Ground(np.array([1.0, 3.0, 2.0]), np.zeros(3))
print(survey(ground), highest(ground, 2), part(ground, 1))
before = [sys.getrefcount(array) for array in ground], rtsys.get_allocation_stats()
for _ in range(100):
    survey(ground), highest(ground, 0), part(ground, 0)
made = rtsys.get_allocation_stats()
print(before[0] == [sys.getrefcount(array) for array in ground])
print(made.alloc - before[1].alloc >= 300, made.alloc - before[1].alloc == made.free - before[1].free)
print(["call void @NRT_incref" in code for rule in (highest, part) for code in rule.inspect_llvm().values()])
"""


def test_a_function_that_only_borrows_arrays_counts_no_references_and_loses_none(town: Path) -> None:
    (town / "ground.py").write_text(_GROUND)
    assert _printed(town, _SURVEY) == "27.0 2.0 [3. 2.]\nTrue\nTrue True\n[False, True]\n"


def test_what_does_not_fit_a_slice_is_refused(town: Path) -> None:
    change(town / "rules.py", "return speed - 1.0", "speed[:2] = speed[2:]\n    return speed[0]")
    program = (
        "import numpy as np\nfrom town.drive import slower\nprint(slower(np.arange(4.0)))\n"
        "try:\n    slower(np.zeros(5))\nexcept ValueError as error:\n    print(error)\n"
    )
    assert _printed(town, program) == "2.0\ncannot assign slice from input of different size\n"


def test_sources_that_are_back_find_their_code(town: Path) -> None:
    run(town)
    change(town / "rules.py", "speed - 1.0", "speed - 2.0")
    run(town)
    change(town / "rules.py", "speed - 2.0", "speed - 1.0")
    assert run(town)[:2] == (7.0, 1)


def test_a_record_renamed_where_no_import_shows_it_breaks_nothing(town: Path) -> None:
    run(town)
    change(town / "records.py", "class Car", "class Vehicle")
    assert run(town)[:2] == (7.0, 0)
    assert run(town)[:2] == (7.0, 1)


def test_code_cut_off_in_the_writing_is_compiled_anew(town: Path) -> None:
    run(town)
    for file in (town.parent / "cache").rglob("*.nb?"):
        file.write_bytes(file.read_bytes()[:20])
    assert run(town)[:2] == (7.0, 0)


def test_a_cache_folder_that_cannot_be_written_is_said_and_breaks_nothing(town: Path) -> None:
    taken = town.parent / "taken"
    taken.write_text("a file where the folder would be")
    speed, hits, said = run(town, cache=taken)
    assert (speed, hits) == (7.0, 0)
    assert said.count("compiled code cannot be kept") == 1
    assert str(taken) in said
    assert "VICO_CACHE" in said


def test_a_chosen_folder_of_numba_wins(town: Path) -> None:
    chosen = town.parent / "chosen"
    paths = os.pathsep.join([str(town.parent), *(path for path in sys.path if path)])
    environment = os.environ | {"NUMBA_CACHE_DIR": str(chosen), "PYTHONPATH": paths}
    subprocess.run([sys.executable, "-B", "-c", _RUN], env=environment, check=True, capture_output=True)
    assert list(chosen.rglob("drive.drive-*.nbi"))


def test_what_was_not_used_for_long_is_swept(town: Path) -> None:
    folder = town.parent / "cache" / "compiled" / "town.drive"
    folder.mkdir(parents=True)
    for name, when in (("old.nbc", 1.6e9), ("fresh.nbc", time.time() - 86_400.0)):
        (folder / name).touch()
        os.utime(folder / name, (when, when))
    run(town)
    assert (folder / "fresh.nbc").is_file()
    assert not (folder / "old.nbc").exists()


def test_what_changes_beside_a_function_compiles_nothing(town: Path) -> None:
    run(town)
    change(town / "rules.py", "LIMIT = 10.0", '"""Rules."""\n\nUNUSED = 3.0\nLIMIT = 10.0\n\ndef other():\n    pass\n')
    change(town / "rules.py", "def slower(speed):", 'def slower(speed):\n    """Brake."""\n    # gently')
    change(town / "drive.py", "from town.rules", "import json\n\nfrom town.rules")
    assert run(town)[:2] == (7.0, 1)


def test_fields_of_a_record_that_change_places_are_compiled_anew(town: Path) -> None:
    change(town / "records.py", "speed: float", "speed: float\n    mass: float = 1.0")
    assert run(town)[:2] == (7.0, 0)
    change(town / "records.py", "speed: float\n    mass: float = 1.0", "mass: float\n    speed: float = 1.0")
    assert run(town)[:2] == (0.0, 0)  # what is given first is the mass now


_PAIR = """
from typing import NamedTuple

import numpy as np

class Pair(NamedTuple):
    first: float
    second: float

"""


@pytest.mark.parametrize(
    ("constant", "changed", "expression"),
    [
        ("np.array([1.0, 2.0])", "np.array([1.0, 3.0])", "TABLE[1]"),
        ("(1, (2, 3))", "(1, (2, 4))", "TABLE[1][1]"),
        ("Pair(1.0, 2.0)", "Pair(2.0, 1.0)", "TABLE.first"),
        ("np.float32(0.5)", "np.float64(0.5)", "TABLE"),
    ],
)
def test_constants_of_every_kind_are_part_of_the_code(town: Path, constant: str, changed: str, expression: str) -> None:
    change(town / "rules.py", "LIMIT = 10.0", f"{_PAIR}LIMIT = 10.0\nTABLE = {constant}")
    change(town / "rules.py", "speed - 1.0", f"speed - {expression}")
    assert run(town)[1] == 0
    assert run(town)[1] == 1
    change(town / "rules.py", f"TABLE = {constant}", f"TABLE = {changed}")
    assert run(town)[1] == 0


def test_what_every_kernel_is_made_from_is_known() -> None:
    for module in pkgutil.walk_packages(vico.__path__, "vico."):
        with suppress(ImportError):  # of an extra that is not installed
            importlib.import_module(module.name)
    kernels = [
        value
        for name, module in sys.modules.items()
        if name.startswith("vico.")
        for value in list(vars(module).values())
        if isinstance(getattr(value, "py_func", None), FunctionType)
    ]
    assert len(kernels) > 500
    for kernel in kernels:
        kernel_digest(kernel, ())
        code = kernel.py_func.__code__
        looked_up = [step.argval for step in dis.get_instructions(code) if step.opname == "LOAD_GLOBAL"]
        assert names_looked_up(code) == looked_up


def test_the_digest_follows_imports_of_packages_and_in_brackets(town: Path) -> None:
    before = source_digest(town / "drive.py", "town.drive")
    change(town / "rules.py", "LIMIT = 10.0", "LIMIT = 11.0")
    assert (after := _fresh_digest(town)) != before
    change(
        town / "drive.py", "from town.rules import LIMIT, slower", "from town import (\n    rules,  # of the road\n)"
    )
    brackets = _fresh_digest(town)
    change(town / "rules.py", "LIMIT = 11.0", "LIMIT = 12.0")
    assert len({before, after, brackets, _fresh_digest(town)}) == 4


def _fresh_digest(town: Path) -> str:
    """As another process would see it: in one process a file is read once."""
    program = (
        "import sys; from pathlib import Path; from vico.io.sources import source_digest as d;"
        "print(d(Path(sys.argv[1]), 'town.drive'))"
    )
    return subprocess.run(
        [sys.executable, "-c", program, str(town / "drive.py")], check=True, capture_output=True, text=True
    ).stdout
