"""Procedural textures: facades by bay and storey, roofs and grounds. Seeded, tileable, sides powers of two.

Everything is painted with plain rectangles and periodic noise on float arrays. Walls are near white, so that a vertex
colour gives each building its own; a facade sheet holds four bays (across) by four storeys (up), all different.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.world.mesh import Material
from vico.world.seeds import rng

BAYS = 4
"""Bays a facade or ground-floor sheet has side by side."""

STOREYS = 4
"""Storeys an upper-floor sheet has above each other."""

_PX = 256  # pixels a bay and a storey

Colour = Sequence[float] | NDArray[Any]


class Canvas:
    """A picture under construction, float32 0..255, y pointing up."""

    def __init__(self, height: int, width: int, colour: Colour, random: np.random.Generator) -> None:
        self.pixels = np.empty((height, width, 3), np.float32)
        self.pixels[:] = colour
        self.random = random

    def rect(self, x0: float, y0: float, x1: float, y1: float, colour: Colour, opacity: float = 1.0) -> None:
        """Fill a rectangle, pixels from the lower left corner."""
        a, b, c, d = (max(round(v), 0) for v in (x0, y0, x1, y1))
        view = self.pixels[b:d, a:c]
        view += (np.asarray(colour, np.float32) - view) * opacity

    def shade(self, x0: float, y0: float, x1: float, y1: float, factor: float) -> None:
        """Darken or lighten a rectangle."""
        a, b, c, d = (max(round(v), 0) for v in (x0, y0, x1, y1))
        self.pixels[b:d, a:c] *= factor

    def noise(self, strength: float, cells: int, ratio: int = 1) -> None:
        """Add periodic noise: `cells` knots across the picture (`ratio` times as many up), smoothly joined."""
        self.pixels += periodic_noise(self.pixels.shape[:2], cells, self.random, ratio)[..., None] * strength

    def grain(self, strength: float) -> None:
        """Add noise from pixel to pixel."""
        self.pixels += self.random.normal(0, strength, self.pixels.shape[:2]).astype(np.float32)[..., None]

    def texture(self) -> NDArray[np.uint8]:
        """The picture in the convention of `Material.texture`: row 0 at the bottom."""
        return np.clip(np.round(self.pixels), 0, 255).astype(np.uint8)


def periodic_noise(
    shape: tuple[int, ...], cells: int, random: np.random.Generator, ratio: int = 1
) -> NDArray[np.float32]:
    """Smooth noise about 0 that repeats at the picture's borders, standard deviation about 0.6."""
    height, width = shape[0], shape[1]
    rows = max(cells * ratio * height // width, 1)
    knots = random.normal(0, 1, (rows, cells)).astype(np.float32)

    def axis(n: int, k: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float32]]:
        place = (np.arange(n) + 0.5) * k / n
        low = np.floor(place).astype(np.int64)
        part = (place - low).astype(np.float32)
        return low % k, (low + 1) % k, part * part * (3 - 2 * part)

    y0, y1, fy = axis(height, rows)
    x0, x1, fx = axis(width, cells)
    rowwise = knots[:, x0] * (1 - fx) + knots[:, x1] * fx
    return np.asarray(rowwise[y0] * (1 - fy)[:, None] + rowwise[y1] * fy[:, None], np.float32)


# ---------------------------------------------------------------------------------------------------------- windows


@dataclass(frozen=True)
class Window:
    """How a window looks; lengths in pixels.

    Attributes
    ----------
    columns, rows
        Panes.
    transom
        Height of the upper row's share; 0 for equal rows.
    surround
        Width of the trim around; `trim` is its colour, `hood` adds a small cornice above.
    """

    columns: int = 2
    rows: int = 2
    transom: float = 0.3
    frame: Colour = (248, 247, 243)
    bar: float = 5
    surround: float = 0
    trim: Colour = (250, 248, 243)
    hood: bool = False
    sill: bool = True


def glass(canvas: Canvas, x0: float, y0: float, x1: float, y1: float, *, lively: float = 1.0) -> None:
    """Paint a pane that mirrors a bright sky above and a street below, perhaps with curtains or a blind behind it."""
    random = canvas.random
    a, b, c, d = (round(v) for v in (x0, y0, x1, y1))
    if c - a < 2 or d - b < 2:
        return
    up = np.linspace(0, 1, d - b, dtype=np.float32)[:, None, None]
    across = np.linspace(0, 1, c - a, dtype=np.float32)[None, :, None]
    low, high = np.array([38, 44, 50], np.float32), np.array([112, 132, 150], np.float32)
    tone = float(random.uniform(0.7, 1.1))
    skyline = np.float32(random.uniform(0.25, 0.6))
    mirror = np.clip((up + 0.18 * across - skyline) * 3.0, 0, 1)
    view = (low + (high - low) * mirror) * tone
    canvas.pixels[b:d, a:c] = view
    width, height = c - a, d - b
    choice = random.random()
    cloth = np.array([214, 208, 196], np.float32) * float(random.uniform(0.75, 1.0))
    if choice < 0.4 * lively:
        side = width * float(random.uniform(0.12, 0.3))
        canvas.rect(a, b, a + side, d, cloth, 0.5)
        canvas.rect(c - side, b, c, d, cloth, 0.5)
    elif choice < 0.6 * lively:
        canvas.rect(a, d - height * float(random.uniform(0.2, 0.7)), c, d, cloth, 0.55)
    elif choice < 0.68 * lively:
        canvas.rect(a, b, c, d, (226, 190, 128), 0.35)


def window(canvas: Canvas, x0: float, y0: float, x1: float, y1: float, look: Window, *, lively: float = 1.0) -> None:
    """Paint a framed window into a wall."""
    s = look.surround
    if s:
        canvas.rect(x0 - s, y0 - 0.4 * s, x1 + s, y1 + s, look.trim)
        canvas.shade(x0 - s, y0 - 0.4 * s - 3, x1 + s, y0 - 0.4 * s, 0.8)
        canvas.shade(x1 + s, y0, x1 + s + 3, y1 + s, 0.86)
    if look.hood:
        canvas.rect(x0 - s - 8, y1 + s, x1 + s + 8, y1 + s + 12, look.trim)
        canvas.shade(x0 - s - 8, y1 + s - 5, x1 + s + 8, y1 + s, 0.68)
    if look.sill:
        canvas.rect(x0 - s - 6, y0 - 11, x1 + s + 6, y0 - 2, np.asarray(look.trim) * 0.97)
        canvas.shade(x0 - s - 6, y0 - 17, x1 + s + 6, y0 - 11, 0.68)
    canvas.rect(x0, y0, x1, y1, look.frame)
    bar = look.bar
    columns = np.linspace(x0 + bar, x1 + bar, look.columns + 1)
    heights = np.linspace(y0, y1 - bar, look.rows + 1)
    if look.transom and look.rows == 2:
        heights[1] = y1 - bar - (y1 - y0) * look.transom
    for i in range(look.columns):
        for j in range(look.rows):
            glass(canvas, columns[i], heights[j] + bar, columns[i + 1] - bar, heights[j + 1], lively=lively)
    # The reveal: walls are thick, so the head and one jamb throw a shadow on frame and glass.
    canvas.shade(x0, y1 - 9, x1, y1, 0.55)
    canvas.shade(x0, y0, x0 + 5, y1, 0.7)


def _plaster(height: int, width: int, random: np.random.Generator, base: Colour = (212, 210, 206)) -> Canvas:
    canvas = Canvas(height, width, base, random)
    canvas.noise(4.0, 6)
    canvas.noise(3.0, 40)
    canvas.grain(2.2)
    return canvas


def _bricks(height: int, width: int, random: np.random.Generator, course: int = 16, length: int = 32) -> Canvas:
    """Running bond, in its own red: a vertex colour strong enough to redden grey bricks would redden panes as well."""
    canvas = Canvas(height, width, (158, 104, 86), random)
    rows, columns = height // course, width // length
    tone = random.normal(0, 1, (rows, columns)).astype(np.float32) * 11
    y, x = np.mgrid[0:height, 0:width]
    row = y // course
    shifted = (x + (row % 2) * (length // 2)) % width
    canvas.pixels += tone[row, shifted // length][..., None]
    joint = (y % course < 2) | (shifted % length < 2)
    canvas.pixels[joint] = (176, 150, 134)
    canvas.noise(4, 8)
    canvas.grain(4)
    return canvas


def _blocks(
    height: int, width: int, random: np.random.Generator, course: int, length: int, base: Colour = (214, 211, 206)
) -> Canvas:
    """Dressed stone with fine joints."""
    canvas = Canvas(height, width, base, random)
    rows, columns = height // course, width // length
    tone = random.normal(0, 1, (rows, columns)).astype(np.float32) * 5
    y, x = np.mgrid[0:height, 0:width]
    row = y // course
    shifted = (x + (row % 2) * (length // 2)) % width
    canvas.pixels += tone[row, shifted // length][..., None]
    canvas.pixels[(y % course < 3) | (shifted % length < 3)] *= 0.78
    canvas.pixels[(y % course == 3)] *= 1.05
    canvas.noise(5, 10)
    canvas.noise(3, 90)
    canvas.grain(3)
    return canvas


# ------------------------------------------------------------------------------------------------------ upper floors


def _classic(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = _plaster(STOREYS * _PX, BAYS * _PX, random)
    for j in range(STOREYS):
        y = j * _PX
        canvas.rect(0, y, BAYS * _PX, y + 13, (246, 244, 240))
        canvas.shade(0, y - 5, BAYS * _PX, y, 0.72)
        if j == 0:
            canvas.shade(0, STOREYS * _PX - 5, BAYS * _PX, STOREYS * _PX, 0.72)
        for i in range(BAYS):
            x = i * _PX + _PX / 2
            look = Window(2, 2, 0.32, surround=15, hood=j % 2 == 0, bar=5)
            window(canvas, x - 46, y + 62, x + 46, y + 206, look)
    return canvas.texture()


def _plain(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = _plaster(STOREYS * _PX, BAYS * _PX, random)
    for j in range(STOREYS):
        for i in range(BAYS):
            x, y = i * _PX + _PX / 2, j * _PX
            look = Window(3 if i % 2 else 2, 1, 0, frame=(228, 226, 220), bar=6)
            half = 58 if i % 2 else 44
            window(canvas, x - half, y + 74, x + half, y + 196, look)
    return canvas.texture()


def _brick(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = _bricks(STOREYS * _PX, BAYS * _PX, random)
    for j in range(STOREYS):
        for i in range(BAYS):
            x, y = i * _PX + _PX / 2, j * _PX
            canvas.rect(x - 56, y + 200, x + 56, y + 218, (226, 221, 210))
            canvas.shade(x - 56, y + 197, x + 56, y + 200, 0.7)
            look = Window(1, 2, 0.5, frame=(238, 236, 230), bar=7, trim=(226, 221, 210))
            window(canvas, x - 44, y + 66, x + 44, y + 200, look)
    return canvas.texture()


def _stone(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = _blocks(STOREYS * _PX, BAYS * _PX, random, 64, 128)
    for j in range(STOREYS):
        y = j * _PX
        canvas.rect(0, y, BAYS * _PX, y + 10, (232, 229, 223))
        canvas.shade(0, y + 10, BAYS * _PX, y + 13, 0.8)
        for i in range(BAYS):
            x = i * _PX + _PX / 2
            # Pilasters between the bays, a quarter of their width in each.
            canvas.shade(i * _PX, y + 13, i * _PX + 22, y + _PX, 1.06)
            canvas.shade(i * _PX + 22, y + 13, i * _PX + 27, y + _PX, 0.8)
            canvas.shade((i + 1) * _PX - 22, y + 13, (i + 1) * _PX, y + _PX, 1.06)
            look = Window(2, 3, 0, frame=(96, 88, 78), bar=5, surround=11, trim=(230, 227, 221))
            window(canvas, x - 48, y + 48, x + 48, y + 216, look, lively=0.5)
    return canvas.texture()


def _ribbon(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = _plaster(STOREYS * _PX, BAYS * _PX, random, (218, 218, 216))
    for j in range(STOREYS):
        y = j * _PX
        canvas.shade(0, y + 78, BAYS * _PX, y + 84, 0.62)
        canvas.rect(0, y + 84, BAYS * _PX, y + 218, (74, 78, 82))
        for i in range(BAYS):
            for k in range(3):
                x = i * _PX + k * _PX / 3
                glass(canvas, x + 4, y + 90, x + _PX / 3 - 4, y + 214, lively=0.6)
            canvas.shade(i * _PX, y, i * _PX + 3, y + 78, 0.82)
        canvas.shade(0, y + 206, BAYS * _PX, y + 218, 0.6)
    return canvas.texture()


def _curtain_wall(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = Canvas(STOREYS * _PX, BAYS * _PX, (92, 98, 104), random)
    for j in range(STOREYS):
        y = j * _PX
        for i in range(BAYS):
            for k in range(2):
                x = i * _PX + k * _PX / 2
                glass(canvas, x + 4, y + 64, x + _PX / 2 - 3, y + _PX - 4, lively=0.25)
                tone = float(random.uniform(0.85, 1.1))
                canvas.rect(x + 4, y + 4, x + _PX / 2 - 3, y + 60, np.array([92, 112, 124]) * tone)
                canvas.rect(x, y, x + 4, y + _PX, (168, 172, 176))
        canvas.rect(0, y + 60, BAYS * _PX, y + 64, (176, 180, 184))
    canvas.grain(1.5)
    return canvas.texture()


def _balconies(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = _plaster(STOREYS * _PX, BAYS * _PX, random)
    for j in range(STOREYS):
        for i in range(BAYS):
            x, y = i * _PX, j * _PX
            if i % 2:
                canvas.rect(x + 12, y + 14, x + _PX - 12, y + 226, (150, 148, 144))
                look = Window(3, 1, 0, frame=(206, 206, 204), bar=6, sill=False)
                window(canvas, x + 40, y + 20, x + _PX - 40, y + 214, look)
                canvas.shade(x + 12, y + 190, x + _PX - 12, y + 226, 0.62)
                canvas.rect(x + 4, y + 4, x + _PX - 4, y + 18, (214, 212, 208))
                for k in range(24):
                    left = x + 8 + k * (_PX - 16) / 24
                    canvas.rect(left, y + 18, left + 3, y + 92, (72, 76, 80))
                canvas.rect(x + 6, y + 92, x + _PX - 6, y + 99, (62, 66, 70))
            else:
                look = Window(2, 1, 0, frame=(120, 118, 114), bar=6)
                window(canvas, x + 62, y + 70, x + _PX - 62, y + 204, look)
    return canvas.texture()


def _panels(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = Canvas(STOREYS * _PX, BAYS * _PX, (214, 216, 218), random)
    x = np.arange(BAYS * _PX)
    canvas.pixels *= (1 + 0.07 * np.sin(x * 2 * np.pi / 16))[None, :, None].astype(np.float32)
    for j in range(STOREYS):
        canvas.shade(0, j * _PX, BAYS * _PX, j * _PX + 3, 0.7)
        for i in range(BAYS):
            window(
                canvas,
                i * _PX + 24,
                j * _PX + 150,
                (i + 1) * _PX - 24,
                j * _PX + 222,
                Window(4, 1, 0, frame=(110, 112, 114), bar=5, sill=False),
                lively=0.2,
            )
    canvas.noise(4, 8)
    return canvas.texture()


# ------------------------------------------------------------------------------------------------------ ground floors


def _shops(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = _blocks(_PX, BAYS * _PX, random, 32, 64, (150, 147, 143))
    boards = ((58, 62, 66), (92, 44, 40), (44, 66, 60), (62, 56, 78), (108, 92, 62), (40, 54, 80))
    order = random.permutation(len(boards))
    for i in range(BAYS):
        x = i * _PX
        canvas.rect(x + 14, 26, x + _PX - 14, 234, (48, 48, 50))
        door = i == 1
        edges = np.linspace(x + 20, x + _PX - 20, 4)
        for k in range(3):
            bottom = 34 if not (door and k == 1) else 26
            glass(canvas, edges[k] + 3, bottom, edges[k + 1] - 3, 180, lively=0.0)
            # A lit shop inside: shelves and goods as blurred blocks.
            for _ in range(9):
                gx = random.uniform(edges[k] + 5, edges[k + 1] - 24)
                gy = random.choice([38, 70, 102])
                canvas.rect(
                    gx, gy, gx + random.uniform(8, 18), gy + random.uniform(10, 26), random.uniform(60, 230, 3), 0.45
                )
            canvas.rect(edges[k] + 3, 150, edges[k + 1] - 3, 180, (236, 208, 160), 0.25)
        if door:
            canvas.rect(edges[1] + 1, 26, edges[1] + 7, 182, (190, 190, 188))
            canvas.rect(edges[2] - 7, 26, edges[2] - 1, 182, (190, 190, 188))
            canvas.rect(edges[2] - 16, 84, edges[2] - 11, 120, (210, 205, 196))
        board = np.asarray(boards[int(order[i])], np.float32)
        canvas.rect(x + 14, 188, x + _PX - 14, 232, board)
        canvas.shade(x + 14, 182, x + _PX - 14, 190, 0.55)
        # Lettering too small to read: strokes of a light colour.
        left = x + 50 + float(random.uniform(0, 20))
        while left < x + _PX - 60:
            stroke = float(random.uniform(4, 11))
            canvas.rect(left, 200, left + stroke, 220 + float(random.choice([0, 4])), board * 0.3 + 165)
            left += stroke + float(random.choice([3, 3, 4, 14]))
        if i == 2:
            stripes = np.linspace(x + 10, x + _PX - 10, 13)
            for k in range(12):
                canvas.rect(stripes[k], 160, stripes[k + 1], 196, (176, 60, 54) if k % 2 else (236, 232, 224))
            canvas.shade(x + 10, 150, x + _PX - 10, 160, 0.55)
    canvas.rect(0, 240, BAYS * _PX, _PX, (206, 202, 196))
    canvas.shade(0, 234, BAYS * _PX, 240, 0.6)
    canvas.rect(0, 0, BAYS * _PX, 18, (112, 108, 104))
    return canvas.texture()


def _cafes(random: np.random.Generator) -> NDArray[np.uint8]:
    """Older shop fronts in a stone ground floor: piers, smaller windows, signs on the fascia, doors with a step."""
    canvas = _blocks(_PX, BAYS * _PX, random, 32, 64, (206, 201, 193))
    awnings = ((46, 74, 60), (120, 46, 44), (52, 60, 84), (168, 132, 76))
    for i in range(BAYS):
        x = i * _PX
        frame = np.asarray(awnings[(i + 2) % 4], np.float32)
        canvas.rect(x + 30, 20, x + _PX - 30, 206, frame * 0.8)
        door = i in (0, 3)
        parts = [(x + 38, x + 152), (x + 160, x + _PX - 38)] if door else [(x + 38, x + 124), (x + 132, x + _PX - 38)]
        for k, (a, b) in enumerate(parts):
            bottom = 22 if door and k == 1 else 58
            glass(canvas, a, bottom, b, 160, lively=0.0)
            glass(canvas, a, 166, b, 200, lively=0.0)
            canvas.rect(a, 120, b, 160, (246, 206, 142), 0.28)
            if bottom == 58:
                canvas.rect(a, 26, b, 52, frame * 1.15)
                for _ in range(5):
                    gx = float(random.uniform(a, b - 20))
                    canvas.rect(gx, 58, gx + 16, 58 + float(random.uniform(12, 34)), random.uniform(60, 200, 3), 0.5)
        canvas.shade(x + 30, 196, x + _PX - 30, 206, 0.6)
        if i % 2:
            canvas.rect(x + 22, 150, x + _PX - 22, 200, awnings[i])
            canvas.shade(x + 22, 150, x + _PX - 22, 158, 0.72)
            canvas.shade(x + 22, 142, x + _PX - 22, 150, 0.6)
        left = x + 70.0
        while left < x + _PX - 74:
            stroke = float(random.uniform(4, 9))
            canvas.rect(left, 213, left + stroke, 228, (70, 62, 54))
            left += stroke + float(random.choice([3, 4, 12]))
    canvas.rect(0, 240, BAYS * _PX, _PX, (232, 228, 220))
    canvas.shade(0, 234, BAYS * _PX, 240, 0.66)
    canvas.rect(0, 0, BAYS * _PX, 16, (150, 146, 140))
    return canvas.texture()


def _rusticated(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = _blocks(_PX, BAYS * _PX, random, 32, 128, (226, 223, 217))
    canvas.rect(0, 0, BAYS * _PX, 34, (150, 146, 142))
    canvas.shade(0, 34, BAYS * _PX, 37, 0.8)
    for i in range(BAYS):
        x = i * _PX + _PX / 2
        look = Window(2, 2, 0.3, frame=(226, 224, 218), bar=6, surround=9)
        window(canvas, x - 48, 78, x + 48, 208, look)
    canvas.rect(0, 240, BAYS * _PX, _PX, (236, 233, 227))
    canvas.shade(0, 234, BAYS * _PX, 240, 0.66)
    return canvas.texture()


def _brick_ground(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = _bricks(_PX, BAYS * _PX, random)
    canvas.rect(0, 0, BAYS * _PX, 38, (176, 170, 164))
    for i in range(BAYS):
        x = i * _PX + _PX / 2
        canvas.rect(x - 58, 206, x + 58, 224, (226, 221, 210))
        window(canvas, x - 46, 76, x + 46, 206, Window(1, 2, 0.5, bar=7, trim=(226, 221, 210)))
    canvas.rect(0, 242, BAYS * _PX, _PX, (226, 221, 210))
    canvas.shade(0, 236, BAYS * _PX, 242, 0.7)
    return canvas.texture()


def _arcade(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = _blocks(_PX, BAYS * _PX, random, 32, 64, (206, 203, 198))
    y, x = np.mgrid[0:_PX, 0 : BAYS * _PX]
    local = x % _PX - _PX / 2
    canvas.rect(0, 0, BAYS * _PX, 30, (150, 147, 143))
    for size, colour in ((74, (226, 223, 217)), (62, (70, 66, 62))):
        inside = (np.abs(local) < size) & (y > 44 - (74 - size)) & ((y < 150) | (local**2 + (y - 150.0) ** 2 < size**2))
        canvas.pixels[inside] = colour
    for i in range(BAYS):
        middle = i * _PX + _PX / 2
        for side in (-1, 0):
            glass(canvas, middle + side * 56 + 3, 52, middle + (side + 1) * 56 - 3, 144, lively=0.4)
    arch = (local**2 + (y - 152.0) ** 2 < 54**2) & (y > 152) & (np.abs(local) > 3)
    canvas.pixels[arch] = (86, 98, 110)
    canvas.rect(0, 240, BAYS * _PX, _PX, (230, 227, 221))
    canvas.shade(0, 233, BAYS * _PX, 240, 0.64)
    return canvas.texture()


def _lobby(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = _blocks(_PX, BAYS * _PX, random, 64, 128, (176, 176, 176))
    for i in range(BAYS):
        x = i * _PX
        canvas.rect(x + 22, 16, x + _PX - 22, 222, (60, 64, 68))
        for k in range(2):
            left = x + 28 + k * 100
            glass(canvas, left, 22, left + 96, 166, lively=0.15)
            glass(canvas, left, 172, left + 96, 216, lively=0.15)
    canvas.rect(0, 230, BAYS * _PX, _PX, (150, 152, 154))
    canvas.shade(0, 224, BAYS * _PX, 230, 0.6)
    return canvas.texture()


def _gates(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = _plaster(_PX, BAYS * _PX, random, (214, 212, 208))
    for i in range(BAYS):
        x = i * _PX
        canvas.rect(x + 22, 0, x + _PX - 22, 196, (168, 170, 172))
        for k in range(9):
            canvas.shade(x + 22, k * 22, x + _PX - 22, k * 22 + 3, 0.72)
        canvas.shade(x + 22, 184, x + _PX - 22, 196, 0.6)
    return canvas.texture()


# ----------------------------------------------------------------------------------------- blank walls, roofs, doors


def _blank_plaster(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = _plaster(256, 256, random)
    canvas.noise(3, 12)
    return canvas.texture()


def _tiles(random: np.random.Generator) -> NDArray[np.uint8]:
    size, course, pan = 256, 16, 16
    y, x = np.mgrid[0:size, 0:size]
    canvas = Canvas(size, size, (214, 208, 202), random)
    tone = random.normal(0, 1, (size // course, size // pan)).astype(np.float32)
    canvas.pixels += tone[y // course, x // pan][..., None] * 11
    wave = 1 + 0.16 * np.sin(x % pan / pan * 2 * np.pi) - 0.3 * (y % course < 3)
    canvas.pixels *= wave[..., None].astype(np.float32)
    canvas.noise(6, 8)
    return canvas.texture()


def _seamed(random: np.random.Generator) -> NDArray[np.uint8]:
    size = 256
    canvas = Canvas(size, size, (214, 216, 216), random)
    canvas.noise(5, 5)
    canvas.noise(4, 24)
    for k in range(4):
        canvas.rect(k * 64, 0, k * 64 + 3, size, (236, 238, 238))
        canvas.shade(k * 64 + 3, 0, k * 64 + 7, size, 0.72)
        canvas.shade(k * 64, (k * 96) % size, k * 64 + 64, (k * 96) % size + 2, 0.82)
    return canvas.texture()


def _slates(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = _blocks(256, 256, random, 16, 32, (190, 192, 196))
    canvas.grain(5)
    return canvas.texture()


def _gravel(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = Canvas(256, 256, (206, 203, 198), random)
    canvas.grain(15)
    canvas.noise(5, 6)
    return canvas.texture()


def _door(random: np.random.Generator, *, glazed: bool) -> NDArray[np.uint8]:
    """A double door with its frame and a fanlight, 1.8 m by 2.7 m."""
    width, height = 128, 256
    canvas = Canvas(height, width, (232, 228, 220), random)
    canvas.rect(8, 0, width - 8, height - 8, (104, 100, 96) if glazed else (206, 200, 192))
    glass(canvas, 14, 206, width - 14, height - 14, lively=0.0)
    for k in range(2):
        left = 14 + k * 51
        if glazed:
            glass(canvas, left + 2, 16, left + 47, 198, lively=0.0)
            continue
        canvas.rect(left, 4, left + 49, 200, (196, 190, 182))
        for low, high in ((14, 62), (74, 128), (138, 190)):
            canvas.shade(left + 7, low, left + 42, high, 0.8)
            canvas.shade(left + 10, low + 3, left + 39, high - 3, 1.16)
    canvas.rect(62, 0, 66, 202, (60, 58, 56))
    canvas.rect(54, 92, 58, 112, (214, 196, 150))
    canvas.rect(70, 92, 74, 112, (214, 196, 150))
    return canvas.texture()


# ------------------------------------------------------------------------------------------------------------ ground


def _asphalt(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = Canvas(512, 512, (96, 97, 99), random)
    canvas.noise(3.5, 4)
    canvas.noise(3.0, 24)
    canvas.grain(7)
    return canvas.texture()


def _paving(random: np.random.Generator) -> NDArray[np.uint8]:
    """Slabs of half a metre on a 4 m tile."""
    canvas = _blocks(512, 512, random, 64, 64, (184, 180, 174))
    canvas.grain(3)
    return canvas.texture()


def _setts(random: np.random.Generator) -> NDArray[np.uint8]:
    """Granite setts on a 3.2 m tile."""
    canvas = _blocks(512, 512, random, 16, 32, (168, 162, 155))
    canvas.grain(6)
    return canvas.texture()


def _grass(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = Canvas(512, 512, (96, 114, 66), random)
    canvas.noise(7, 5)
    canvas.noise(7, 40)
    canvas.pixels += random.normal(0, 11, (512, 512, 1)).astype(np.float32) * np.array([1.0, 1.1, 0.6], np.float32)
    return canvas.texture()


def _grit(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = Canvas(256, 256, (182, 168, 142), random)
    canvas.noise(6, 6)
    canvas.grain(9)
    return canvas.texture()


def _water(random: np.random.Generator) -> NDArray[np.uint8]:
    canvas = Canvas(256, 256, (72, 104, 122), random)
    canvas.noise(7, 8, 2)
    canvas.noise(5, 32, 2)
    return canvas.texture()


_PAINTERS = {
    "wall_classic": _classic,
    "wall_plain": _plain,
    "wall_brick": _brick,
    "wall_stone": _stone,
    "wall_ribbon": _ribbon,
    "wall_glass": _curtain_wall,
    "wall_balconies": _balconies,
    "wall_panels": _panels,
    "ground_shops": _shops,
    "ground_cafes": _cafes,
    "ground_rusticated": _rusticated,
    "ground_brick": _brick_ground,
    "ground_arcade": _arcade,
    "ground_lobby": _lobby,
    "ground_gates": _gates,
    "blank_plaster": _blank_plaster,
    "blank_brick": lambda random: _bricks(256, 256, random).texture(),
    "blank_stone": lambda random: _blocks(256, 256, random, 64, 128).texture(),
    "roof_tiles": _tiles,
    "roof_metal": _seamed,
    "roof_slate": _slates,
    "roof_gravel": _gravel,
    "door_wood": lambda random: _door(random, glazed=False),
    "door_glass": lambda random: _door(random, glazed=True),
    "asphalt": _asphalt,
    "paving": _paving,
    "setts": _setts,
    "grass": _grass,
    "grit": _grit,
    "water": _water,
}


def material(name: str, seed: int = 0) -> Material:
    """The material of that name: same name and seed, same picture."""
    return Material(name, _PAINTERS[name](rng(seed, "texture", name)))
