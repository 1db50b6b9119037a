"""A plain map of a world as an image, for films: buildings, streets, green, trees; north is up."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw

from vico.world.walkable import CROSSING, OPEN, ROADWAY, SIDEWALK
from vico.world.world import World

_PAPER = (244, 242, 238)
_SURFACES = {OPEN: (232, 234, 226), SIDEWALK: (236, 228, 214), CROSSING: (250, 240, 214), ROADWAY: (255, 255, 255)}
_HOUSE, _OPEN_HOUSE, _EDGE = (205, 197, 186), (190, 178, 160), (160, 152, 142)
_TREE = (127, 181, 138)


class MapPicture:
    """The base map at one scale, and where a point lies on it.

    Parameters
    ----------
    pixels
        Side of the square image.
    """

    def __init__(self, world: World, pixels: int) -> None:
        self.half = world.half
        self.pixels = pixels
        self.image = self._draw(world)

    def to_pixels(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Image coordinates (x right, y down) of ENU points, shape ``(..., 2)``."""
        points = np.asarray(xy, np.float64)
        scale = self.pixels / (2 * self.half)
        return np.stack([(points[..., 0] + self.half) * scale, (self.half - points[..., 1]) * scale], axis=-1)

    def _draw(self, world: World) -> Image.Image:
        # The ground comes from the walkable grid: it already tells roadway, pavement and open ground apart.
        table = np.full((256, 3), _PAPER, np.uint8)
        for surface, colour in _SURFACES.items():
            table[surface] = colour
        ground = Image.fromarray(table[world.walkable.cls[::-1]])
        large = self.pixels * 2  # drawn at twice the size and reduced: smooth edges
        picture = ground.resize((large, large), Image.Resampling.BILINEAR)
        draw = ImageDraw.Draw(picture)
        for building in world.buildings:
            for k, ring in enumerate(building.footprint):
                points = [tuple(p) for p in self.to_pixels(np.asarray(ring)) * 2]
                fill = _PAPER if k else (_OPEN_HOUSE if building.accessible else _HOUSE)
                draw.polygon(points, fill=fill, outline=_EDGE)
        objects = world.objects
        trees = np.column_stack([objects.x, objects.y])[(objects.kind == "tree") & (objects.room == "")]
        radius = max(2.0 * large / (2 * self.half), 1.5)
        for x, y in self.to_pixels(trees) * 2:
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=_TREE)
        return picture.resize((self.pixels, self.pixels), Image.Resampling.LANCZOS)
