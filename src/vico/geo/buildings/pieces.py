"""Buildings put together of the pieces that a city model has them in: a building, and parts of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vico.geo.buildings.model import FoundBuilding
from vico.geo.buildings.surfaces import Surface3, building_of_surfaces
from vico.geo.overlay import OverlayError

_MARGIN = 20.0  # metres beyond the window within which buildings are kept: their middle may still lie in it
_MOST = 200_000


@dataclass
class Piece:
    """A building or a part of one.

    Attributes
    ----------
    id, parent
        Its own, and of what it is a part; empty for a whole building.
    tags
        What its attributes say, in OpenStreetMap's words.
    by_detail
        Its surfaces, by level of detail.
    """

    id: str
    parent: str
    tags: dict[str, str]
    by_detail: dict[float, list[Surface3]] = field(default_factory=dict)


class BuildingPieces:
    """Gathers the pieces in a window.

    Parameters
    ----------
    kind, file
        Of the source.
    half
        Half side of the window, metres.
    """

    def __init__(self, kind: str, file: str, half: float) -> None:
        self._kind, self._file = kind, file
        self._reach = half + _MARGIN
        self._pieces: dict[str, Piece] = {}
        self._tags: dict[str, dict[str, str]] = {}  # of buildings whose geometry is with their parts

    def add(self, piece: Piece) -> None:
        """Take a piece in, if anything of it lies in the window; of one without geometry only what it says."""
        if not any(piece.by_detail.values()):
            if piece.tags:
                self._tags[piece.id] = piece.tags
            return
        points = np.concatenate([s.rings[0] for row in piece.by_detail.values() for s in row])[:, :2]
        if not np.isfinite(points).all():
            return
        low, high = points.min(axis=0), points.max(axis=0)
        if (low < self._reach).all() and (high > -self._reach).all():
            self._pieces[piece.id] = piece
        if len(self._pieces) > _MOST:
            raise ValueError(f"more than {_MOST:,} buildings in the window, as in no real place")

    def buildings(self) -> tuple[tuple[FoundBuilding, ...], tuple[tuple[str, str], ...]]:
        """Return the buildings, sorted by id, and the id and reason of each that can't be used."""
        groups: dict[str, list[Piece]] = {}
        for piece in self._pieces.values():
            groups.setdefault(self._root(piece), []).append(piece)
        made: list[FoundBuilding] = []
        refused: list[tuple[str, str]] = []
        for root in sorted(groups):
            key = f"{self._kind}:{root}"
            try:
                found = self._building(root, groups[root])
            except OverlayError as error:
                found = f"its surfaces can't be put together ({error})"
            if isinstance(found, str):
                refused.append((key, found))
                continue
            if found.fault:
                refused.append((key, f"its roof is fitted instead of built: {found.fault}"))
            made.append(found)
        return tuple(made), tuple(refused)

    def _root(self, piece: Piece) -> str:
        seen = {piece.id}
        while piece.parent and piece.parent in self._pieces and piece.parent not in seen:
            piece = self._pieces[piece.parent]
            seen.add(piece.id)
        return piece.parent or piece.id

    def _building(self, root: str, pieces: list[Piece]) -> FoundBuilding | str:
        pieces = sorted(pieces, key=lambda piece: piece.id)
        tags: dict[str, str] = {}
        for piece in pieces:
            tags = {**piece.tags, **tags}
        tags = {**tags, **self._tags.get(root, {})}
        if root in self._pieces:
            tags |= self._pieces[root].tags
        details = {detail for piece in pieces for detail, row in piece.by_detail.items() if row}
        best = max(details, key=_worth)
        surfaces = [surface for piece in pieces for surface in piece.by_detail.get(best, ())]
        if best < 2.0:
            # Blocks and outlines say how high and how wide, not which roof.
            surfaces = [Surface3("wall" if best >= 1.0 else "ground", s.rings) for s in surfaces]
            if best >= 1.0:
                surfaces = _with_floor(surfaces)
        return building_of_surfaces(surfaces, key=root, kind=self._kind, file=self._file, facts=tags)


def _worth(detail: float) -> float:
    """How good a level of detail is: 2 with its refinements, then 3, then blocks, then outlines."""
    return {2: 30.0, 3: 20.0, 1: 10.0}.get(int(detail), 0.0) + detail


def _with_floor(surfaces: list[Surface3]) -> list[Surface3]:
    """Name the lowest level surfaces of a block its ground."""
    lowest = min(float(s.rings[0][:, 2].min()) for s in surfaces)
    return [Surface3("ground" if float(s.rings[0][:, 2].max()) < lowest + 0.05 else s.kind, s.rings) for s in surfaces]
