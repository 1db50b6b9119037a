"""Lamps as the shader reads them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.render.lamps.beams import MOST_BEAMS, nearest_beams
from vico.render.lamps.grid import LampGrid
from vico.render.uniforms import Record

#: Numbers of each lamp.
LAMP_FLOATS = 12


def packed_beams(beams: NDArray[np.void], camera: Record, light: Record) -> NDArray[np.float32]:
    """Return the headlights that light a camera's picture, in a light's uniforms."""
    chosen = np.zeros(MOST_BEAMS, np.int64)
    return beams[chosen[: nearest_beams(beams, camera, light["lamp_exposure"], chosen)]].view(np.float32)


def packed_lamps(grid: LampGrid) -> NDArray[np.float32]:
    """Return where each cell's part begins, lamps, and what cells name of them; whole numbers as their bits."""
    lamps = grid.lamps.copy()
    lamps["power"] = grid.power
    parts = grid.start.view(np.float32), lamps.view(np.float32), grid.named.view(np.float32)
    return np.concatenate(parts)
