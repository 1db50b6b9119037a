"""One sheet of door leaves, show windows and plain paint, from which doorways and shop fronts are put together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.house_doors import DOOR_CELLS, SHEET, Cell
from vico.worldgen.facades.textures.ground_floors import show_window
from vico.worldgen.facades.textures.windows import glass
from vico.worldgen.texture_canvas import Canvas

_WIDTH, _HEIGHT = SHEET

# Leaves stand in the upper row, 256 pixels high; show windows and the rest in the lower one.
CELLS = DOOR_CELLS | {
    "vitrine_4": Cell(1536, 256, 256, 256),
    "vitrine_5": Cell(1792, 256, 256, 256),
    "vitrine_0": Cell(0, 0, 256, 256),
    "vitrine_1": Cell(256, 0, 256, 256),
    "vitrine_2": Cell(512, 0, 256, 256),
    "vitrine_3": Cell(768, 0, 256, 256),
    "paint": Cell(1024, 0, 128, 256),
    "stripes": Cell(1152, 0, 128, 256),
    "cross": Cell(1280, 0, 128, 128),
    "lamp": Cell(1280, 128, 128, 128),
    "stone": Cell(1408, 0, 128, 256),
    "vitrine_6": Cell(1536, 0, 256, 256),
    "vitrine_7": Cell(1792, 0, 256, 256),
}
"""Where everything lies; `vitrine_<k>` shows the wares of kind k % 4."""


def _leaf(canvas: Canvas, x: float, y: float, width: float, height: float) -> None:
    """Paint a wooden leaf with three panels, near white: the vertex colour paints it."""
    canvas.rect(x, y, x + width, y + height, (198, 194, 188))
    for low, high in ((0.05, 0.3), (0.36, 0.64), (0.7, 0.95)):
        a, b = y + low * height, y + high * height
        canvas.shade(x + 7, a, x + width - 7, b, 0.78)
        canvas.shade(x + 10, a + 3, x + width - 10, b - 3, 1.18)


def _handle(canvas: Canvas, x: float, y: float, length: float = 20.0) -> None:
    canvas.rect(x, y, x + 4, y + length, (214, 196, 150))


def _corner(name: str) -> tuple[float, float]:
    """Return the lower left corner of a cell of the sheet, pixels."""
    return float(CELLS[name].x), float(CELLS[name].y)


def paint_doors(random: np.random.Generator) -> NDArray[np.uint8]:
    """Paint the sheet that `CELLS` describes."""
    canvas = Canvas(_HEIGHT, _WIDTH, (226, 224, 220), random)
    for name in ("double", "panelled", "single"):
        _wooden_door(canvas, name)
    _glass_door(canvas)
    for name in ("office", "hotel"):
        _hall_door(canvas, name)
    _portal(canvas)
    _gate(canvas)
    for k in range(8):
        _vitrine(canvas, k)
    _plain_cells(canvas)
    return canvas.texture()


def _wooden_door(canvas: Canvas, name: str) -> None:
    x, y = _corner(name)
    canvas.rect(x, y, x + 128, y + 256, (224, 220, 212))
    canvas.shade(x, y + 249, x + 128, y + 256, 0.6)
    glass(canvas, x + 10, y + 208, x + 118, y + 246, lively=0.0, lit=0.7)
    if name == "single":
        _leaf(canvas, x + 10, y + 2, 108, 198)
        glass(canvas, x + 30, y + 120, x + 98, y + 188, lively=0.3, lit=0.6)
        canvas.rect(x + 63, y + 120, x + 66, y + 188, (198, 194, 188))
        _handle(canvas, x + 104, y + 92)
        canvas.rect(x + 46, y + 86, x + 82, y + 92, (176, 160, 120))
        return
    for left in (x + 10, x + 65):
        _leaf(canvas, left, y + 2, 53, 198)
        if name == "panelled":
            glass(canvas, left + 9, y + 96, left + 44, y + 190, lively=0.2, lit=0.6)
            for k in range(4):
                canvas.rect(left + 12 + k * 9, y + 96, left + 14 + k * 9, y + 190, (50, 48, 46))
    canvas.rect(x + 62, y + 2, x + 66, y + 202, (70, 66, 62))
    _handle(canvas, x + 55, y + 92)
    _handle(canvas, x + 69, y + 92)


def _glass_door(canvas: Canvas) -> None:
    x, y = _corner("glass")
    canvas.rect(x, y, x + 128, y + 256, (208, 206, 202))
    glass(canvas, x + 8, y + 214, x + 120, y + 248, lively=0.0, lit=1.0)
    for left in (x + 8, x + 66):
        glass(canvas, left, y + 12, left + 54, y + 206, lively=0.0, lit=1.0)
        canvas.rect(left + 14, y + 130, left + 40, y + 142, (226, 224, 218), 0.55)
    _handle(canvas, x + 54, y + 84, 44)
    _handle(canvas, x + 70, y + 84, 44)


def _hall_door(canvas: Canvas, name: str) -> None:
    """Paint the glazed entrance of an office or of a hotel, in steel or in brass."""
    x, y = _corner(name)
    canvas.rect(x, y, x + 256, y + 256, (92, 96, 100) if name == "office" else (150, 122, 74))
    for k in range(4):
        left = x + 6 + k * 62
        glass(canvas, left, y + 8, left + 58, y + 200, lively=0.0, lit=1.0)
        glass(canvas, left, y + 206, left + 58, y + 250, lively=0.0, lit=1.0)
    _handle(canvas, x + 120, y + 84, 44)
    _handle(canvas, x + 134, y + 84, 44)


def _portal(canvas: Canvas) -> None:
    """Paint a church's portal: a pointed arch in steps, with iron bands on the leaves."""
    x, y = _corner("portal")
    canvas.rect(x, y, x + 256, y + 256, (206, 200, 190))
    for inset, tone in ((6, 0.86), (18, 1.12), (30, 0.82), (40, 0.4)):
        inside, view, _ = canvas.inside_arch(x + inset, y, x + 256 - inset, y + 252 - inset, pointed=True)
        view[inside] = np.array((206, 200, 190), np.float32) * tone
    for left in (x + 48, x + 130):
        canvas.rect(left, y, left + 78, y + 128, (112, 78, 54))
        for k in range(1, 6):
            canvas.shade(left + k * 13, y, left + k * 13 + 2, y + 128, 0.7)
        for height in (26, 96):
            canvas.rect(left, y + height, left + 64, y + height + 6, (48, 44, 42))
    canvas.rect(x + 40, y + 128, x + 216, y + 136, (176, 168, 156))
    canvas.rect(x + 124, y, x + 132, y + 128, (150, 142, 130))


def _gate(canvas: Canvas) -> None:
    """Paint a sectional gate."""
    x, y = _corner("gate")
    canvas.rect(x, y, x + 256, y + 256, (196, 196, 194))
    for k in range(10):
        canvas.shade(x, y + k * 25.6, x + 256, y + k * 25.6 + 3, 0.7)
    canvas.shade(x, y + 246, x + 256, y + 256, 0.5)
    _handle(canvas, x + 126, y + 36, 6)


def _vitrine(canvas: Canvas, k: int) -> None:
    x, y = _corner(f"vitrine_{k}")
    canvas.rect(x, y, x + 256, y + 256, (52, 50, 48))
    show_window(canvas, x + 6, y + 6, x + 250, y + 250, kind=k % 4, lamp=0.95)
    canvas.rect(x + 126, y + 6, x + 130, y + 250, (52, 50, 48))


def _plain_cells(canvas: Canvas) -> None:
    """Paint what boards, awnings, crosses, lamps and steps are cut from."""
    cell = CELLS["paint"]
    canvas.rect(cell.x, cell.y, cell.x + 128, cell.y + 256, (232, 231, 228))
    cell = CELLS["stripes"]
    for k in range(8):
        stripe = (238, 236, 230) if k % 2 else (150, 148, 146)
        canvas.rect(cell.x + k * 16, cell.y, cell.x + k * 16 + 16, cell.y + 256, stripe)
    cell = CELLS["cross"]
    canvas.rect(cell.x, cell.y, cell.x + 128, cell.y + 128, (20, 60, 36), glow=60)
    for a, b, c, d in ((46, 14, 82, 114), (14, 46, 114, 82)):
        canvas.rect(cell.x + a, cell.y + b, cell.x + c, cell.y + d, (70, 226, 120), glow=255)
    cell = CELLS["lamp"]
    canvas.rect(cell.x, cell.y, cell.x + 128, cell.y + 128, (252, 240, 214), glow=255)
    cell = CELLS["stone"]
    canvas.rect(cell.x, cell.y, cell.x + 128, cell.y + 256, (214, 210, 203))
    for k in range(8):
        canvas.shade(cell.x, cell.y + k * 32, cell.x + 128, cell.y + k * 32 + 2, 0.82)
