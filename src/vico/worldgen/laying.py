"""From what stands there to what is drawn of it: cladding, and the ground around; each stage one call."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.world.mesh import Surface, merge_surfaces
from vico.worldgen.buildings.stage import Cladding, clad
from vico.worldgen.ground.backdrop import backdrop_of
from vico.worldgen.ground.stage import APRON, ground_from_osm
from vico.worldgen.ground.wires import contact_wires
from vico.worldgen.ground.yards import Yards, yards_of
from vico.worldgen.request import WorldRequest
from vico.worldgen.shaping import Shape
from vico.worldgen.stages import Stages


def cladding_in(shape: Shape, request: WorldRequest, stages: Stages) -> Cladding:
    """Cover the buildings."""
    # Known by what it is a part of: that has been digested.
    bare = stages.given(shape.built.bare, f"{stages.digest(shape.built)} bare")
    return stages.run("cladding", clad, bare, shape.plan.site.osm, seed=request.seed)


def yards_in(shape: Shape, request: WorldRequest, stages: Stages) -> Yards:
    """Decide which of the open ground is not paved."""
    plan = shape.plan
    reach = plan.site.osm.half + _apron(request)
    return stages.run("yards", yards_of, plan.site, plan.streets.carriageway, reach=reach)


def ground_in(
    shape: Shape, yards: Yards, trees: NDArray[np.float64], request: WorldRequest, stages: Stages
) -> list[Surface]:
    """Make the ground, wires over tracks, and what lies beyond the window.

    Parameters
    ----------
    trees
        Where trees stand, metres, shape ``(n, 2)``.
    """
    run, plan = stages.run, shape.plan
    site, height, streets = plan.site, plan.height, plan.streets
    ground = run(
        "ground",
        ground_from_osm,
        site,
        height,
        streets,
        shape.bridges,
        shape.flights,
        standing=shape.solids,
        trees=trees,
        yards=yards,
    )
    wires = run("wires", contact_wires, site, height, shape.solids, reach=request.half)
    if not _apron(request):
        return merge_surfaces([*ground, *wires])
    around = run("backdrop", backdrop_of, site, height, streets, shape.built.records, seed=request.seed)
    return merge_surfaces([*ground, *around, *wires])


def _apron(request: WorldRequest) -> float:
    # A tile ends where the next one begins: nothing is drawn beyond it.
    return APRON if request.place is None else 0.0
