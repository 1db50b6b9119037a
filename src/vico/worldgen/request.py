"""What is asked of a build: which world, and how it is made."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict, dataclass, field
from typing import Any

from vico.geo.frame import LocalFrame
from vico.worldgen.indoor.layout_llm import LlmLayoutAuthor
from vico.worldgen.photos.texturing import Texturing
from vico.worldgen.seams.grid import HALO
from vico.worldgen.seams.join import TilePlace
from vico.worldgen.sources import Sources
from vico.worldgen.stages import Progress


@dataclass(frozen=True)
class BuildOptions:
    """How a world is built; the defaults are those of ``vico world build``.

    Attributes
    ----------
    texturing
        How photos come onto the walls.
    author
        Draws the floor plans of places that no layout of the sources covers; None leaves them to rules.
    previews
        Whether pictures are rendered into ``previews/``; the map is always drawn.
    keep_stages
        Keep what the stages made in ``<out>/.stages``, so that one can be run again.
    again
        Names of stages to run even where their product is kept.
    progress
        Called with a stage's name, how much of it is done, and how much there is.
    """

    texturing: Texturing = field(default_factory=Texturing)
    author: LlmLayoutAuthor | None = None
    previews: bool = True
    keep_stages: bool = True
    again: Collection[str] = ()
    progress: Progress | None = None


@dataclass(frozen=True)
class WorldRequest:
    """Everything that decides what is in a world: the same request gives the same folder, byte for byte.

    Attributes
    ----------
    sources
        What to build from.
    lat, lon
        The window's centre, degrees.
    half
        Half the window's side, metres.
    seed
        Decides what the map leaves open.
    texturing
        How photos come onto the walls.
    author
        Draws floor plans, if a language model is asked for them.
    previews
        Whether pictures are rendered.
    place
        Which tile of a city it is; None for a world by itself.
    """

    sources: Sources
    lat: float
    lon: float
    half: float
    seed: int
    texturing: Texturing
    author: LlmLayoutAuthor | None
    previews: bool
    place: TilePlace | None = None

    @property
    def frame(self) -> LocalFrame:
        """The world's frame."""
        east, north = (0.0, 0.0) if self.place is None else self.place.grid.centre(self.place.tile)
        return LocalFrame(self.lat, self.lon, east, north)

    @property
    def reach(self) -> float:
        """Half the side of the square of which streets and ground are planned, metres."""
        return self.half + (0.0 if self.place is None else HALO)

    def to_json(self) -> dict[str, Any]:
        """Return plain values, with absolute paths; of the author only whether there is one."""
        return {
            "lat": self.lat,
            "lon": self.lon,
            "half": self.half,
            "seed": self.seed,
            "sources": self.sources.to_json(),
            "texturing": asdict(self.texturing),
            "drawn_layouts": self.author is not None,
            "previews": self.previews,
        }

    @classmethod
    def from_json(cls, content: dict[str, Any], *, author: LlmLayoutAuthor | None) -> WorldRequest:
        """Return the request that `to_json` was asked for, with an author who may draw for it."""
        return cls(
            Sources.from_json(content["sources"]),
            content["lat"],
            content["lon"],
            content["half"],
            content["seed"],
            Texturing(**content["texturing"]),
            author,
            content.get("previews", True),
        )
