"""Stages that a second process makes while the build is at others: it keeps them, and the build reads what it kept.

The second process is told where the build keeps its products, and the name of a stage. It reads the same sources and
the products that are there already, and so comes to the same inputs, the same key and the same product as the build
would. So nothing depends on whether there is a second process: a stage that it did not make, for whatever reason, is
made by the build when it comes up.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from vico import threads
from vico.jobs import Helper, Service
from vico.jobs.contract import Json, Tell, Work
from vico.worldgen.construction import build_shape, find_yards, make_cladding, make_ground, plan_site
from vico.worldgen.evidence import read_evidence
from vico.worldgen.request import WorldRequest
from vico.worldgen.stages import Stages

_log = logging.getLogger(__name__)
_MAKER = "vico.worldgen.background_stages:maker"
_FEWEST = 40  # buildings


class BackgroundStages:
    """A second process of a build, started once the first stages are kept; ended with its block.

    Parameters
    ----------
    request
        What is built.
    folder
        Where the build keeps what its stages make.
    """

    def __init__(self, request: WorldRequest, folder: Path) -> None:
        self._request = request
        self._folder = folder
        self._helper: Helper | None = None

    def __enter__(self) -> BackgroundStages:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._helper is not None:
            self._helper.close()

    def start(self, buildings: int) -> None:
        """Let it read what there is, if it may help: all that stands and lies there is made and kept.

        It helps where there is a second processor, and more to make than a process takes to start. It does not where
        tiles of a city are built side by side, nor with photos and photographed meshes: they fill the memory, and it
        would have to read them too.

        Parameters
        ----------
        buildings
            How many stand there.
        """
        request, sources = self._request, self._request.sources
        alone = request.place is None and not (sources.tiles or sources.photos)
        if alone and buildings >= _FEWEST and threads.workers() > 1:
            options = {"request": request.to_json(), "folder": str(self._folder.absolute())}
            try:
                self._helper = Helper(Service(_MAKER, options), share=max(1, threads.workers() // 2))
            except OSError as error:
                _log.info("no second process could be started: %s", error)

    def make(self, name: str, stages: Stages, **known: Any) -> None:
        """Have a stage made, if it was started; all stages that it depends on are made and kept.

        Parameters
        ----------
        name
            Which.
        stages
            Of the build: they wait for it when it comes up.
        known
            Inputs that no stage makes, as plain data.
        """
        if self._helper is not None:
            number = self._helper.ask({"stage": name, **known})
            stages.await_first(name, partial(_wait_for_stage, self._helper, number, name))


def _wait_for_stage(helper: Helper, number: int, name: str) -> float | None:
    """Wait for a stage; return the seconds that it took, None if it was not yet begun or could not be made."""
    if helper.withdraw(number):
        return None
    answer = helper.answer(number)
    if answer.content is None:
        _log.warning("stage %s was not made by the second process, and is made here: %s", name, answer.reason)
        return None
    return float(answer.content["seconds"])


def maker(options: Json, tell: Tell) -> Work:
    """Return what makes stages of a build from those that it has kept: a service of `vico.jobs`."""
    request = WorldRequest.from_json(options["request"], author=None)
    # What stands and lies there depends on no other source.
    sources = replace(request.sources, places=(), gtfs=(), layouts=None, detections=None)
    stages = Stages(Path(options["folder"]))
    evidence = read_evidence(sources, request.frame, request.reach, stages)
    shape = build_shape(plan_site(evidence, request, stages), request, stages)

    def work(content: Json) -> Json:
        name = content["stage"]
        if name == "cladding":
            make_cladding(shape, request, stages)
        else:
            trees = np.array(content["trees"], np.float64).reshape(-1, 2)
            make_ground(shape, find_yards(shape, request, stages), trees, request, stages)
        return {"seconds": stages.seconds[name]}

    return work
