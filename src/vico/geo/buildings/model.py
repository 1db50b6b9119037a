"""What a source tells of a building, whatever its format."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon

#: Kinds of sources, and what each is called where the two of city models are meant.
KINDS = ("cityjson", "citygml", "overture")
CITY_MODELS = ("cityjson", "citygml")


@dataclass(frozen=True)
class RoofFacet:
    """A plane piece of a roof.

    Attributes
    ----------
    polygon
        Its outline seen from above, ENU metres.
    plane
        Height ``c + gx * x + gy * y`` at a point of it: metres above a level that the holder tells.
    """

    polygon: Polygon
    plane: tuple[float, float, float]

    def height(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height of the plane at points, shape ``(n, 2)``."""
        c, gx, gy = self.plane
        return np.asarray(c + xy[:, 0] * gx + xy[:, 1] * gy, np.float64)

    @property
    def steepness(self) -> float:
        """Rise per metre along the fall."""
        return float(np.hypot(*self.plane[1:]))

    def moved(self, *, east: float = 0.0, north: float = 0.0, up: float = 0.0) -> RoofFacet:
        """Return it somewhere else, metres."""
        c, gx, gy = self.plane
        shifted = shapely.transform(self.polygon, lambda xy: xy + np.array([east, north]))
        return RoofFacet(shifted, (c + up - gx * east - gy * north, gx, gy))


@dataclass(frozen=True)
class FoundBuilding:
    """A building of a source.

    Attributes
    ----------
    id
        Kind and the source's own id, such as ``citygml:DEBE_1``.
    kind
        One of `KINDS`.
    file
        Name of the file it was read from.
    footprint
        ENU metres.
    tags
        What is said of it, in OpenStreetMap's words: ``height`` (ground to the highest point, metres),
        ``building:levels``, ``roof:shape``, ``roof:height``, ``building``, ``name``, ...
    facets
        The surfaces of its roof, heights above its own ground; empty where the source has none that can be built.
    fault
        Why its roof can't be built as the source has it, if it has one at all.
    parts
        Parts of it, each with an outline and tags of its own.
    """

    id: str
    kind: str
    file: str
    footprint: Polygon | MultiPolygon
    tags: dict[str, str]
    facets: tuple[RoofFacet, ...] = ()
    fault: str = ""
    parts: tuple[tuple[Polygon | MultiPolygon, dict[str, str]], ...] = ()

    @property
    def source(self) -> str:
        """Kind and file, as the records of buildings name it."""
        return f"{self.kind}:{self.file}"


@dataclass(frozen=True)
class FoundBuildings:
    """What a file has in a window.

    Attributes
    ----------
    kind, file, sha256
        Of the file.
    buildings
        Sorted by id.
    refused
        Id and reason of each that can't be used.
    attributions
        Whom to credit, as far as the file says.
    licence
        As far as the file or its kind says.
    """

    kind: str
    file: str
    sha256: str
    buildings: tuple[FoundBuilding, ...]
    refused: tuple[tuple[str, str], ...] = ()
    attributions: tuple[str, ...] = ()
    licence: str = "as its provider states"
