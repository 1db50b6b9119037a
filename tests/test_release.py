"""The release script names the changelog's newest section, and refuses what does not fit together."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A project with a changelog and a version, and the script."""
    for name in ("scripts", "src/vico"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "scripts" / "release.py").write_text((ROOT / "scripts" / "release.py").read_text(encoding="utf-8"))
    (tmp_path / "CHANGELOG.md").write_text(
        "# Changelog\n\n## 0.2.0 (unreleased)\n\n- New.\n\n## 0.1.0 (2026-01-02)\n\n- Old.\n"
    )
    (tmp_path / "src/vico/version.py").write_text('__version__ = "0.1.0"\n')
    return tmp_path


def release(checkout: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(checkout / "scripts" / "release.py"), *words]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_cut_dates_the_newest_section_and_sets_the_version(checkout: Path) -> None:
    assert release(checkout, "--cut", "0.2.0").returncode == 0
    changelog = (checkout / "CHANGELOG.md").read_text()
    assert changelog.startswith("# Changelog\n\n## 0.2.0 (20")
    assert changelog.endswith("## 0.1.0 (2026-01-02)\n\n- Old.\n")
    assert (checkout / "src/vico/version.py").read_text() == '__version__ = "0.2.0"\n'
    again = release(checkout, "--cut", "0.2.1")
    assert again.returncode == 1
    assert "needs one heading such as '## 0.2.1 (unreleased)'" in again.stderr


@pytest.mark.parametrize(("version", "says"), [("0.2.0", "says 0.1.0, not 0.2.0"), ("v0.1.0", "is no version")])
def test_a_version_that_does_not_fit_is_refused(checkout: Path, version: str, says: str) -> None:
    done = release(checkout, "--check", version)
    assert done.returncode != 0
    assert says in done.stderr


def test_a_section_that_is_not_released_is_refused(checkout: Path) -> None:
    (checkout / "src/vico/version.py").write_text('__version__ = "0.2.0"\n')
    done = release(checkout, "--check", "0.2.0")
    assert done.returncode == 1
    assert "cut it first" in done.stderr
