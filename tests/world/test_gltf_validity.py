"""Meshes as other programs read them: no file of a world has an error by the Khronos glTF validator."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vico.world.glb import glb_bytes, read_glb
from vico.world.mesh import Material, Surface

_SCRIPT = Path(__file__).parents[2] / "scripts" / "validate_gltf.cjs"
_MODULES = Path(sys.prefix) / "gltf" / "node_modules"


def validated(paths: list[Path]) -> list[dict[str, Any]]:
    """What the validator says of each file."""
    node = shutil.which("node")
    if node is None or not (_MODULES / "gltf-validator").is_dir():
        pytest.skip(f"node or {_MODULES}/gltf-validator is not there: make check installs it where there is npm")
    done = subprocess.run(
        [node, str(_SCRIPT), *map(str, paths)],
        env={**os.environ, "NODE_PATH": str(_MODULES)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.stdout.count("\n") == len(paths), done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_every_mesh_of_a_world_is_valid_gltf(helsinki_path: Path) -> None:
    paths = sorted(helsinki_path.rglob("*.glb"))
    assert len(paths) >= 6
    faults = [said for said in validated(paths) if said["errors"] or said["warnings"] or said["degenerate"]]
    assert faults == []


def _fan(points: list[tuple[float, float, float]], triangles: list[tuple[int, int, int]]) -> Surface:
    count = len(points)
    normals = np.tile(np.array([0, 0, 1], np.float32), (count, 1))
    normals[-1] = 0.0
    return Surface(
        np.array(points, np.float32), normals, np.zeros((count, 2), np.float32), np.full((count, 3), 200, np.uint8),
        np.arange(count, dtype=np.int32), np.array(triangles, np.int32), Material("plain"),
    )  # fmt: skip


def test_triangles_without_three_corners_are_not_written_and_every_normal_has_length_1(tmp_path: Path) -> None:
    points = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.5, 0.5, 1.0)]
    surface = _fan(points, [(0, 1, 2), (0, 2, 3), (1, 1, 2), (1, 4, 2)])
    path = tmp_path / "fan.glb"
    path.write_bytes(glb_bytes({"layer": [surface]}))
    (back,) = read_glb(path)["layer"]
    assert back.positions[back.triangles].tolist() == [
        [list(points[k]) for k in triangle] for triangle in ((0, 1, 2), (1, 4, 2))
    ]
    assert back.entity[back.triangles].tolist() == [[0, 1, 2], [1, 4, 2]]
    assert np.linalg.norm(back.normals, axis=1) == pytest.approx(1.0, abs=1e-3)
    assert [(said["errors"], said["degenerate"]) for said in validated([path])] == [(0, 0)]
