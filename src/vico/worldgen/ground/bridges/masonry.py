"""Quadrilaterals of stone, steel and asphalt that are gathered by look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vico.world.mesh import Surface, surface_of_quads
from vico.worldgen.ground.pavings import LOOKS, GroundStyle, coloured, ground_material

Floats = NDArray[np.float64]

PARAPET = 1.0
"""Height of a parapet, metres."""


@dataclass
class Masonry:
    """Quads that pile up by look; each knows its own flat normal."""

    quads: dict[str, list[Floats]] = field(default_factory=dict)
    tints: dict[str, tuple[GroundStyle, tuple[int, int, int] | None]] = field(default_factory=dict)

    def add(self, quad: Sequence[Floats], look: str, tint: tuple[int, int, int] | None = None) -> None:
        """Add a quadrilateral, counter-clockwise seen from its face."""
        key = look if tint is None else f"{look}/{tint}"
        self.quads.setdefault(key, []).append(np.asarray(quad, np.float64))
        self.tints[key] = (LOOKS[look], tint)

    def take(self, other: Masonry) -> None:
        """Add the quadrilaterals of another."""
        for key, quads in other.quads.items():
            self.quads.setdefault(key, []).extend(quads)
            self.tints[key] = other.tints[key]

    def box(
        self, foot: Sequence[Floats], low: float, high: float, look: str, tint: tuple[int, int, int] | None = None
    ) -> None:
        """Add an upright prism over a quadrilateral given counter-clockwise."""
        lower = [np.r_[p[:2], low] for p in foot]
        upper = [np.r_[p[:2], high] for p in foot]
        self.add(upper, look, tint)
        for k in range(4):
            m = (k + 1) % 4
            self.add([lower[k], lower[m], upper[m], upper[k]], look, tint)

    def surfaces(self) -> list[Surface]:
        """One surface a look."""
        found = []
        for key, quads in self.quads.items():
            look, tint = self.tints[key]
            corners = np.stack(quads)
            normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
            normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
            x, y, z = corners[..., 0], corners[..., 1], corners[..., 2]
            level = np.abs(normal[:, None, 2:]) > 0.5
            upright = np.stack([x * -normal[:, None, 1] + y * normal[:, None, 0], z], axis=2)
            uv = np.where(level, corners[..., :2], upright)
            plan = corners.reshape(-1, 3)[:, :2]
            found.append(
                surface_of_quads(
                    corners,
                    normal,
                    uv / look.tile,
                    colour=coloured(look, plan) if tint is None else tint,
                    entity=look.entity,
                    material=ground_material(look.material),
                    by_halves=True,
                )
            )
        return found
