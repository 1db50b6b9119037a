"""Run the tests of the rooms that changed and of those above: ``scripts/test_changed.py [--since REF] [--list]``.

What changed is what differs from where this branch left `origin/main` (or `main`), untracked files too. A room's change
asks for the tests of all rooms that may import it (`tests/test_rooms.py`); a test's, for itself; a helper's, for the
tests that name it; a page's, an example's or a script's, for the tests beside the rooms' folders.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from house import above  # noqa: E402
from test_rooms import ALLOWED, GROUND, OPEN  # noqa: E402

_TESTS = ROOT / "tests"
_ROOMS = {*ALLOWED, *OPEN}


def changed_files(since: str | None = None) -> list[str]:
    """Return the paths, from the checkout's root, that differ from a commit, and those that git does not know."""
    git = ["git", "-C", str(ROOT)]

    def said(*words: str) -> list[str]:
        done = subprocess.run([*git, *words], capture_output=True, text=True, check=False)
        return done.stdout.splitlines() if done.returncode == 0 else []

    references = [since] if since else ["origin/main", "main"]
    base = next((found[0] for one in references if (found := said("merge-base", one, "HEAD"))), since or "HEAD")
    return sorted({*said("diff", "--name-only", base), *said("ls-files", "--others", "--exclude-standard")})


def tests_of(changed: Iterable[str]) -> list[str]:
    """Return the folders and files of tests that changed files ask for; ``tests`` where it is all of them."""
    rooms: set[str] = set()
    asked: set[str] = set()
    beside = False
    for name in changed:
        path = PurePosixPath(name)
        match path.parts:
            case ("src", "vico", room, *_) if room in _ROOMS:
                rooms |= above([room])
            case ("src", "vico", first, *_) if first == "data" or first.removesuffix(".py") in GROUND:
                return ["tests"]
            case ("tests", "conftest.py") | ("pyproject.toml",) | ("constraints.txt",):
                return ["tests"]
            case ("tests", *_, file) if file.startswith("test_"):
                asked |= {name} if (ROOT / name).exists() else set()
            case ("tests", folder, *_, "conftest.py"):
                asked.add(f"tests/{folder}")
            case ("tests", *folders, file) if file.endswith(".py"):
                asked |= _naming(folders[0] if folders else path.stem)
            case _:
                beside = True
    asked |= {f"tests/{room}" for room in rooms if (_TESTS / room).is_dir()}
    if beside or rooms:
        asked |= {f"tests/{path.name}" for path in _TESTS.glob("test_*.py")}
    return sorted(one for one in asked if not any(f"{one}/".startswith(f"{other}/") for other in asked - {one}))


def _naming(helper: str) -> set[str]:
    """Return the tests that import a helper, or a helper that does."""
    found: set[str] = set()
    waiting, known = [helper], {helper}
    while waiting:
        names = re.compile(rf"^\s*(?:from|import) {re.escape(waiting.pop())}\b", re.MULTILINE)
        for path in _TESTS.rglob("*.py"):
            if names.search(path.read_text(encoding="utf-8")):
                if path.name == "conftest.py":
                    found.add(path.parent.relative_to(ROOT).as_posix())
                elif path.name.startswith("test_"):
                    found.add(path.relative_to(ROOT).as_posix())
                elif path.stem not in known:
                    known.add(path.stem)
                    waiting.append(path.stem)
    return found


def main() -> int:
    """Say which tests the changes ask for, and run them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--since", help="a commit to compare with, instead of where this branch left main")
    parser.add_argument("--list", action="store_true", help="say which tests, and run none")
    options, words = parser.parse_known_args()
    tests = tests_of(changed_files(options.since))
    sys.stdout.write("\n".join(tests or ["nothing that a test looks at has changed"]) + "\n")
    sys.stdout.flush()
    if options.list or not tests:
        return 0
    processes = ["-n", "auto", "--maxprocesses", "4", "--dist", "worksteal"]
    return subprocess.run(
        [sys.executable, "-m", "pytest", *processes, *tests, *words], cwd=ROOT, check=False
    ).returncode


if __name__ == "__main__":
    sys.exit(main())
