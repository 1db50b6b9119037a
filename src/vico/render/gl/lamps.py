"""Lamps as the shader reads them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.render.lamps.grid import LampGrid

#: Numbers of each lamp.
LAMP_FLOATS = 12


def packed_lamps(grid: LampGrid) -> NDArray[np.float32]:
    """Return where each cell's part begins, lamps, and what cells name of them; whole numbers as their bits."""
    lamps = grid.lamps.copy()
    lamps["power"] = grid.power
    parts = grid.start.view(np.float32), lamps.view(np.float32), grid.named.view(np.float32)
    return np.concatenate(parts)
