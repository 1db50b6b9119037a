"""Runs that datasets are made of."""

from __future__ import annotations

from pathlib import Path

import pytest

from command_line import vico
from shared_folders import Shared


@pytest.fixture(scope="session")
def kept_runs(helsinki_path: Path, helsinki_people: Path, shared: Shared) -> list[Path]:
    """Three runs of a few steps in which two residents' pictures are kept exactly."""

    def make(out: Path) -> None:
        for seed in range(3):
            code = vico(
                "run", helsinki_path, helsinki_people, "--steps", 6 + seed, "--seed", seed, "--robots", "none",
                "--cars", 2, "--pedestrians", 2, "--observe", "resident_0,resident_1",
                "--keep", "rgb,depth,segmentation", "--out", out / f"run{seed}",
            )  # fmt: skip
            assert code == 0

    folder = shared("kept_runs", make)
    return [folder / f"run{seed}" for seed in range(3)]
