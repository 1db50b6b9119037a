"""MuJoCo comes in without OpenGL, whatever the shell says, and leaves the shell's choice to others."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "vico"
FALL = (
    "model = mujoco.MjModel.from_xml_string('<mujoco><worldbody><geom size=\"1\"/></worldbody></mujoco>'); "
    "mujoco.mj_step(model, mujoco.MjData(model)); "
)


def said(code: str, **environment: str) -> str:
    bare = {name: value for name, value in os.environ.items() if name not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False,
        env={**bare, **environment},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("library", ["osmesa", "egl", "glfw", "no-such-library", " OSMESA", ""])
def test_a_choice_of_opengl_changes_nothing(library: str) -> None:
    code = f"from vico.io.mujoco import mujoco; {FALL} import os; print(os.environ['MUJOCO_GL'] == {library!r})"
    assert said(code, MUJOCO_GL=library, PYOPENGL_PLATFORM="wrong") == "True"


def test_no_choice_stays_no_choice() -> None:
    assert said("import os, vico.io.mujoco; print('MUJOCO_GL' in os.environ)") == "False"


def test_no_opengl_is_loaded_by_us() -> None:
    code = "import sys, vico.io.mujoco; print([name for name in sys.modules if name in ('OpenGL', 'glfw')])"
    assert said(code, MUJOCO_GL="glfw") == "[]"


def test_who_draws_with_mujoco_beside_us_gets_the_library_they_chose() -> None:
    code = "import vico.io.mujoco, mujoco; from mujoco import Renderer; print(mujoco.GLContext.__module__, Renderer)"
    assert said(code, MUJOCO_GL="glfw") == said(code.replace("vico.io.mujoco, ", ""), MUJOCO_GL="glfw")


def test_a_wrong_choice_of_theirs_is_told_when_they_draw() -> None:
    code = "import vico.io.mujoco, mujoco\ntry: mujoco.Renderer\nexcept RuntimeError as error: print(error)"
    assert "no-such-library" in said(code, MUJOCO_GL="no-such-library")


def test_mujoco_that_was_imported_before_stays_as_it_is() -> None:
    code = "import mujoco; had = mujoco.GLContext; import vico.io.mujoco; print(mujoco.GLContext is had)"
    assert said(code, MUJOCO_GL="glfw") == "True"


def test_a_name_that_mujoco_lacks_is_an_error_of_attributes() -> None:
    assert said("import vico.io.mujoco, mujoco; print(hasattr(mujoco, 'nothing'))") == "False"


def test_all_that_need_mujoco_take_it_from_one_place() -> None:
    found = []
    for path in sorted(SOURCE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            if any(name.split(".")[0] == "mujoco" for name in names):
                found.append(path.relative_to(SOURCE).as_posix())
    assert set(found) == {"io/mujoco.py"}
