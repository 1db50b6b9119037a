"""What the second process of a build does; `Ahead` starts it and tells it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from vico.jobs.contract import Json, Tell, Work
from vico.worldgen.evidence import gather
from vico.worldgen.laying import cladding_in, ground_in, yards_in
from vico.worldgen.request import WorldRequest
from vico.worldgen.shaping import planned, shaped
from vico.worldgen.stages import Stages


def maker(options: Json, tell: Tell) -> Work:
    """Return what makes stages of a build from those that it has kept: a service of `vico.jobs`."""
    request = WorldRequest.from_json(options["request"], author=None)
    # What stands and lies there depends on no other source.
    sources = replace(request.sources, places=(), gtfs=(), layouts=None, detections=None)
    stages = Stages(Path(options["folder"]))
    evidence = gather(sources, request.frame, request.reach, stages)
    shape = shaped(planned(evidence, request, stages), request, stages)

    def work(content: Json) -> Json:
        name = content["stage"]
        if name == "cladding":
            cladding_in(shape, request, stages)
        else:
            trees = np.array(content["trees"], np.float64).reshape(-1, 2)
            ground_in(shape, yards_in(shape, request, stages), trees, request, stages)
        return {"seconds": stages.seconds[name]}

    return work
