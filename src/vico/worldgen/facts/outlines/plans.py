"""A building decided but not yet built: plain records between the deciding and the building."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo.osm import Tags
from vico.world.model import Dropped
from vico.worldgen.facts.expendable import NamedShape
from vico.worldgen.facts.outlines.roof_shapes import Roof

_TALL = 2.2  # metres: what begins higher up is walked under

RULES = ("height tag", "levels tag", "parts", "kind", "neighbours", "area", "town")
"""How a height was decided, strongest first: tagged, by its parts, by the kind of building, by neighbours of its use
within 100 m, by the nearest of any use, by how dense the town stands."""


@dataclass(frozen=True)
class PartPlan:
    """A solid to build, heights in metres above the building's base.

    Attributes
    ----------
    low
        Underside; 0 where it stands on the ground.
    eaves
        Where the roof begins.
    levels
        Storeys between ground (or underside) and eaves.
    finish
        Empty for what has rooms; else what it is beside (`finishes.FINISHES`): cornice, eaves, dormer, chimney, ...
    mesh
        The closed solid itself where outline and roof don't say it: points (metres, height above the building's
        base), shape ``(n, 3)``, and faces, shape ``(m, 3)``.
    """

    polygon: Polygon
    low: float
    eaves: float
    levels: int
    roof: Roof
    tags: Tags
    finish: str = ""
    mesh: tuple[NDArray[np.float64], NDArray[np.int64]] | None = field(default=None, compare=False)

    @property
    def top(self) -> float:
        """The highest point."""
        return self.eaves + self.roof.height


@dataclass(frozen=True)
class BuildingOrigin:
    """Where a building's facts are from: ``osm``, kind and file of another source, a rule; empty: by `rule` and tags.

    Attributes
    ----------
    footprint, height, roof
        Of its outline, its height and its roof; a roof built of a model's surfaces is ``KIND:FILE surfaces``.
    """

    footprint: str
    height: str = ""
    roof: str = ""


@dataclass(frozen=True)
class BuildingPlan:
    """A building decided but not yet built.

    Attributes
    ----------
    shops
        Named shops, restaurants and the like inside it or at its walls.
    rooftop
        What sits on `parts` or holds them up.
    rule
        How its height was decided, one of `RULES`.
    origin
        Where its facts are from; None where only the map was asked.
    """

    id: str
    name: str | None
    use: str
    tags: Tags
    outline: Polygon
    levels: int
    shops: int
    parts: list[PartPlan]
    rooftop: list[PartPlan] = field(default_factory=list)
    rule: str = "town"
    origin: BuildingOrigin | None = None

    @property
    def solids(self) -> list[PartPlan]:
        """Everything to build."""
        return [*self.parts, *self.rooftop]


@dataclass(frozen=True)
class BuildingPlans:
    """The buildings of a place, decided but not yet built.

    Attributes
    ----------
    plans
        In the order of their ids, without overlaps among their solids.
    dropped
        What the map has and the place has not, with reasons.
    """

    plans: list[BuildingPlan]
    dropped: list[Dropped]

    def standing(self) -> list[NamedShape]:
        """Return the footprints of what stands on the ground: parts that begin lower than a person is tall, metres."""
        return [NamedShape(plan.id, part.polygon) for plan in self.plans for part in plan.parts if part.low < _TALL]
