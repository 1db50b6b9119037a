"""`vico doctor`: what is wrong with a machine is said, quickly, with what mends it."""

from __future__ import annotations

import importlib.metadata
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from command_line import vico


def findings(capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, dict[str, Any]]:
    code = vico("doctor", "--json", *options)
    return code, {finding["what"]: finding for finding in json.loads(capsys.readouterr().out)}


def elsewhere(**environment: str) -> tuple[int, dict[str, Any]]:
    done = subprocess.run(
        [sys.executable, "-m", "vico.cli.main", "doctor", "--json"], capture_output=True, text=True, timeout=120,
        check=False, env={**os.environ, **environment},
    )  # fmt: skip
    assert done.stderr == ""
    return done.returncode, {finding["what"]: finding for finding in json.loads(done.stdout)}


def installed(monkeypatch: pytest.MonkeyPatch, *requirements: str) -> None:
    """Let the default install need these packages alone."""
    monkeypatch.setattr(importlib.metadata, "requires", lambda name: [*requirements, "pdoc>=15; extra == 'docs'"])


def test_doctor_looks_at_every_package_of_the_default_install(capsys: pytest.CaptureFixture[str]) -> None:
    code, found = findings(capsys)
    assert code == 0
    assert found.keys() >= {"Python", "numpy", "mujoco", "mapbox-earcut", "memory", "free disk", "compiled code"}


def test_doctor_is_quick_where_nothing_is_compiled_and_compiles_nothing(tmp_path: Path) -> None:
    began = time.perf_counter()
    code, found = elsewhere(VICO_CACHE=str(tmp_path / "cache"))
    assert time.perf_counter() - began < 20.0  # 2 s on an idle machine
    assert code == 0
    assert "warm-up" in found["compiled code"]["mend"]
    assert list(tmp_path.iterdir()) == []


def test_thorough_tries_everything(capsys: pytest.CaptureFixture[str]) -> None:
    code, found = findings(capsys, "--thorough")
    assert code == 0
    assert all(found[what]["ok"] for what in ("renderer", "film encoder", "physics"))


def test_a_package_that_is_not_there_is_named_with_what_to_type(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    installed(monkeypatch, "numpy>=2.0", "no-such-package>=3,<4")
    code, found = findings(capsys)
    assert code == 1
    assert (found["no-such-package"]["found"], found["no-such-package"]["mend"]) == (
        "not installed", "pip install 'no-such-package>=3,<4'",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ("raise AttributeError('no such library')", "AttributeError: no such library"),
        ("import os; os.abort()", "exit status -6"),
    ],
)
def test_a_package_that_cannot_be_imported_is_named_with_why(
    content: str, why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "astral.py").write_text(content)
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    installed(monkeypatch, "astral>=3.2", "numpy>=2.0")
    code, found = findings(capsys)
    assert code == 1
    assert why in found["astral"]["found"]
    assert found["numpy"]["ok"]


def test_a_choice_of_opengl_does_not_trouble_mujoco() -> None:
    code, found = elsewhere(MUJOCO_GL="osmesa")
    assert code == 0
    assert found["mujoco"]["ok"]


@pytest.mark.skipif(os.geteuid() != 0, reason="needs root, to become a user whom nobody knows")
@pytest.mark.parametrize("home", [None, "", "/nonexistent"])
def test_the_cache_of_a_user_whom_the_machine_does_not_know_is_an_absolute_folder(home: str | None) -> None:
    environment = {name: value for name, value in os.environ.items() if name not in ("HOME", "VICO_CACHE")}
    environment |= {} if home is None else {"HOME": home}
    # The user changes after the imports: the interpreter may lie where others may not look.
    code = (
        "import os, vico.io.cache, platformdirs.unix; os.setgroups([]); os.setgid(54321); os.setuid(54321); "
        "print(vico.io.cache.cache_folder())"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stderr == ""
    assert Path(done.stdout.strip()).is_absolute()
