"""Make a release: check the version and the changelog, build the archive and the wheel, check both.

    python scripts/release.py --check 0.2.0 --notes notes.md
    python scripts/release.py --cut 0.2.0

`--cut` gives the changelog's unreleased section that version and today's date, and sets the version of the package.
`--check` refuses what does not fit together, builds into dist/ with `build`, and reads that with `twine check` (the
extra "release").
"""

from __future__ import annotations

import argparse
import importlib.util
import re
import shutil
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).parents[1]
CHANGELOG, VERSION = ROOT / "CHANGELOG.md", ROOT / "src" / "vico" / "version.py"
_NUMBER = re.compile(r"\d+\.\d+\.\d+")
_UNRELEASED = re.compile(r"^## \S+ \(unreleased\)$", re.MULTILINE)
_ASSIGNED = re.compile(r'__version__ = "([^"]*)"')


def section_of(changelog: str, version: str) -> str:
    """Return what the changelog says of a version, without its heading; empty if nothing."""
    found = re.search(rf"^## {re.escape(version)}\b[^\n]*\n(.*?)(?=^## |\Z)", changelog, re.MULTILINE | re.DOTALL)
    return found[1].strip() if found else ""


def cut(version: str, day: str) -> None:
    """Name the changelog's newest section, and set the version."""
    text = CHANGELOG.read_text(encoding="utf-8")
    if len(_UNRELEASED.findall(text)) != 1:
        sys.exit(f"{CHANGELOG}: needs one heading such as '## {version} (unreleased)'")
    CHANGELOG.write_text(_UNRELEASED.sub(f"## {version} ({day})", text), encoding="utf-8")
    source = VERSION.read_text(encoding="utf-8")
    VERSION.write_text(_ASSIGNED.sub(f'__version__ = "{version}"', source), encoding="utf-8")
    print(f"{version} ({day}): look at the changelog, commit, tag v{version}, push the tag")


def check(version: str, notes: Path | None) -> None:
    """Refuse a version that package and changelog do not name; build, and check what was built."""
    found = _ASSIGNED.search(VERSION.read_text(encoding="utf-8"))
    if found is None or found[1] != version:
        sys.exit(f"{VERSION}: says {found[1] if found else 'no version'}, not {version}")
    told = section_of(CHANGELOG.read_text(encoding="utf-8"), version)
    if not told or f"## {version} (unreleased)" in CHANGELOG.read_text(encoding="utf-8"):
        sys.exit(
            f"{CHANGELOG}: has no released section '## {version}'; cut it first: scripts/release.py --cut {version}"
        )
    if notes is not None:
        notes.write_text(told + "\n", encoding="utf-8")
    if missing := [name for name in ("build", "twine") if importlib.util.find_spec(name) is None]:
        sys.exit(f"release: {missing[0]} is missing; install it with: pip install -e '.[release]'")
    dist = ROOT / "dist"
    shutil.rmtree(dist, ignore_errors=True)
    subprocess.run([sys.executable, "-m", "build", "--outdir", dist, ROOT], check=True)
    subprocess.run([sys.executable, "-m", "twine", "check", "--strict", *map(str, sorted(dist.iterdir()))], check=True)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--cut", metavar="VERSION", help="begin a release")
    what.add_argument("--check", metavar="VERSION", help="build and check one")
    parser.add_argument("--notes", type=Path, help="file for what the changelog says of it")
    given = parser.parse_args()
    version = given.cut or given.check
    if not _NUMBER.fullmatch(version):
        parser.error(f"{version!r} is no version: give three numbers, such as 0.2.0")
    if given.cut:
        cut(version, datetime.now(UTC).date().isoformat())
    else:
        check(version, given.notes)


if __name__ == "__main__":
    main()
