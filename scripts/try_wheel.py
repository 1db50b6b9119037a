"""Build the wheel, install it into an empty environment, and use it there: away from the checkout, with nothing of it.

    python scripts/try_wheel.py

What is tried: the version, the command, the packaged map and data files (a small world is built and checked), a
community.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]
_TRIED = """
import sys
from pathlib import Path
import vico
assert Path(vico.__file__).is_relative_to(sys.prefix), vico.__file__
world = vico.build_world("world", radius=60.0)
assert vico.check_world(world) == []
people = vico.build_community(world, residents=3, out="people")
print(f"vico {vico.__version__}: {len(world.buildings)} buildings, {len(people.residents)} residents")
"""


def run(*command: object, at: Path, path: Path | None = None) -> None:
    """Run a command with nothing of the caller's Python environment; stop with its output if it fails."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON") and k != "VIRTUAL_ENV"}
    if path is not None:
        kept["PATH"] = f"{path}{os.pathsep}{kept.get('PATH', '')}"
    done = subprocess.run(
        [str(part) for part in command], cwd=at, env=kept, capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(f"{' '.join(str(part) for part in command)}: exit {done.returncode}\n{done.stdout}{done.stderr}")
    sys.stdout.write(done.stdout)


def main() -> int:
    """Run from the command line."""
    argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0]).parse_args()
    pip = ("-m", "pip", "--disable-pip-version-check", "--quiet")
    # setuptools builds on what it left there before: modules that are gone would be in the wheel.
    shutil.rmtree(ROOT / "build", ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix="vico-wheel-") as folder:
        here = Path(folder)
        run(sys.executable, *pip, "wheel", "--no-deps", "--wheel-dir", here, ROOT, at=here)
        wheel = next(here.glob("*.whl"))
        venv.create(here / "env", with_pip=True)
        scripts = here / "env" / ("Scripts" if os.name == "nt" else "bin")
        constraints = ROOT / "constraints.txt"
        run(scripts / "python", *pip, "install", "-c", constraints, f"{wheel}[worldgen]", at=here)
        empty = here / "elsewhere"
        empty.mkdir()
        run(scripts / "vico", "--version", at=empty, path=scripts)
        run(scripts / "python", "-I", "-c", _TRIED, at=empty, path=scripts)
        run(scripts / "vico", "check", "community", "people", "--world", "world", at=empty, path=scripts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
