"""Upper floors: one sheet a family, eight bays by four storeys, every window with a life of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from vico.worldgen.facades.textures.windows import glass, railing, shutters, window, window_style
from vico.worldgen.texture_canvas import Canvas, Colour, blocks, bricks, plaster

BAYS = 8
"""Bays a facade or ground-floor sheet has side by side."""

STOREYS = 4
"""Storeys an upper-floor sheet has above each other."""

_PX = 128  # pixels a bay and a storey
_W, _H = BAYS * _PX, STOREYS * _PX

Picture = NDArray[np.uint8]


def cells() -> Iterator[tuple[int, int, float, float]]:
    """Column, row, middle of the bay and floor of the storey, pixels."""
    for j in range(STOREYS):
        for i in range(BAYS):
            yield i, j, i * _PX + _PX / 2, float(j * _PX)


def band(canvas: Canvas, y: float, height: float, colour: Colour, shadow: float = 0.7) -> None:
    """Paint a string course right across, with the shadow it throws; over the sheet's lower edge the shadow wraps."""
    canvas.rect(0, y, _W, y + height, colour)
    canvas.shade(0, y + height, _W, y + height + 1, 0.92)
    canvas.shade(0, y - 3, _W, y, shadow)
    if y < 3:
        canvas.shade(0, _H - 3 + y, _W, _H, shadow)


def _classic(random: np.random.Generator) -> Picture:
    """Paint a nineteenth-century town house: casements in mouldings, hoods and pediments by turns, courses between."""
    canvas = plaster(_H, _W, random)
    hoods = ("gable", "flat", "flat", "")
    for j in range(STOREYS):
        if j % 2 == 0:
            band(canvas, j * _PX, 6, (244, 242, 238))
    for _, j, x, y in cells():
        look = window_style("classic", hood=hoods[j])
        window(canvas, x - 23, y + 30, x + 23, y + 101, look, lit=0.34)
        if j == 1:  # an apron below the sill
            canvas.shade(x - 26, y + 9, x + 26, y + 21, 0.9)
            canvas.shade(x - 24, y + 11, x + 24, y + 19, 1.16)
    return canvas.texture()


def _plain(random: np.random.Generator) -> Picture:
    """Render with plain openings of the middle of the last century."""
    canvas = plaster(_H, _W, random)
    for i, _, x, y in cells():
        look = window_style("plain", columns=3 if i % 2 else 2)
        half = 29 if i % 2 else 22
        window(canvas, x - half, y + 37, x + half, y + 98, look, lit=0.36)
    return canvas.texture()


def _brick(random: np.random.Generator) -> Picture:
    """Brick with sash windows under stone lintels."""
    canvas = bricks(_H, _W, random, 4, 8)
    stone = (222, 216, 204)
    for j in range(STOREYS):
        if j == 2:
            band(canvas, j * _PX, 5, stone)
    for _, _, x, y in cells():
        look = window_style("brick", trim=stone)
        window(canvas, x - 21, y + 30, x + 21, y + 98, look, lit=0.34)
    return canvas.texture()


def _tenement(random: np.random.Generator, brick: Colour = (138, 84, 68), stone: Colour = (184, 160, 138)) -> Picture:
    """Dark brick, tall narrow sashes two to the bay, segmental heads and bands: walk-ups of the 1900s."""
    canvas = bricks(_H, _W, random, 4, 8, brick)
    for j in range(STOREYS):
        band(canvas, j * _PX, 4, stone, 0.76)
    for _, _, x, y in cells():
        for side in (-26, 26):
            canvas.rect(x + side - 17, y + 98, x + side + 17, y + 104, stone)
            canvas.rect(x + side - 4, y + 98, x + side + 4, y + 107, (200, 178, 156))
            look = window_style("tenement", trim=stone)
            window(canvas, x + side - 15, y + 28, x + side + 15, y + 98, look, lit=0.36)
            if random.random() < 0.12:
                canvas.rect(x + side - 10, y + 30, x + side + 10, y + 42, (196, 194, 190))
                for k in range(4):
                    canvas.shade(x + side - 8, y + 32 + k * 2.5, x + side + 8, y + 33 + k * 2.5, 0.7)
    return canvas.texture()


def _stone(random: np.random.Generator) -> Picture:
    """Dressed stone with pilasters between the bays."""
    canvas = blocks(_H, _W, random, 16, 32)
    for j in range(STOREYS):
        band(canvas, j * _PX, 5, (232, 229, 223), 0.8)
    for i, j, x, y in cells():
        left = i * _PX
        canvas.shade(left, y + 5, left + 10, y + _PX, 1.06)
        canvas.shade(left + 10, y + 5, left + 12, y + _PX, 0.82)
        canvas.shade(left + _PX - 10, y + 5, left + _PX, y + _PX, 1.06)
        look = window_style("stone", hood="flat" if j % 2 else "")
        window(canvas, x - 24, y + 24, x + 24, y + 104, look, lively=0.5, lit=0.22)
    return canvas.texture()


def _arches(random: np.random.Generator) -> Picture:
    """Sandstone with round-headed windows in mouldings and balustrades below them."""
    canvas = blocks(_H, _W, random, 16, 64, (218, 206, 188))
    trim = (232, 221, 204)
    for j in range(STOREYS):
        band(canvas, j * _PX, 7, trim)
    for _, j, x, y in cells():
        if j % 2:
            window(canvas, x - 22, y + 32, x + 22, y + 98, window_style("pediment", trim=trim), lit=0.3)
            continue
        window(canvas, x - 24, y + 26, x + 24, y + 110, window_style("arched", trim=trim), lit=0.3)
        canvas.rect(x - 3, y + 109, x + 3, y + 120, trim)
        canvas.rect(x - 32, y + 8, x + 32, y + 22, trim)
        for k in range(7):
            canvas.shade(x - 28 + k * 8.6, y + 10, x - 25 + k * 8.6, y + 20, 0.72)
    return canvas.texture()


def _french(random: np.random.Generator) -> Picture:
    """Pale stone or plaster, windows down to the floor behind iron railings, shutters beside some."""
    canvas = blocks(_H, _W, random, 16, 64, (222, 216, 204), joint=0.9)
    for j in range(STOREYS):
        band(canvas, j * _PX, 5, (234, 229, 218), 0.76)
    for i, _, x, y in cells():
        look = window_style("french")
        window(canvas, x - 22, y + 10, x + 22, y + 106, look, lit=0.36)
        if i % 4 in (1, 2):
            shutters(canvas, x - 22, y + 10, x + 22, y + 106, (206, 208, 206), shut=0.08)
        railing(canvas, x - 26, y + 9, x + 25, y + 46, (44, 46, 50), gap=4.2)
    return canvas.texture()


def _shutters(random: np.random.Generator) -> Picture:
    """Southern or old-town plaster with louvred shutters and a little iron here and there."""
    canvas = plaster(_H, _W, random, (214, 211, 204))
    greens = ((96, 116, 96), (120, 108, 86), (104, 120, 132), (132, 96, 78))
    colour = greens[int(random.integers(len(greens)))]
    for _, j, x, y in cells():
        look = window_style("shuttered")
        low = 12 if j == 1 else 30
        window(canvas, x - 19, y + low, x + 19, y + 102, look, lit=0.34)
        shutters(canvas, x - 19, y + low, x + 19, y + 102, colour)
        if j == 1:
            canvas.rect(x - 26, y + 6, x + 26, y + 12, (206, 202, 194))
            canvas.shade(x - 26, y + 2, x + 26, y + 6, 0.7)
            railing(canvas, x - 24, y + 12, x + 23, y + 44, (48, 50, 52))
    return canvas.texture()


def _alpine(random: np.random.Generator) -> Picture:
    """Whitewashed house of the Alps: small casements in painted frames, wooden shutters."""
    canvas = plaster(_H, _W, random, (226, 223, 216))
    canvas.noise(3, 12)
    ochre = (214, 186, 138)
    for i, j, x, y in cells():
        if (i + j) % 3 == 0:  # painted gable and scrolls around the frame
            for row in range(12):
                side = 30 * (1 - row / 12)
                canvas.rect(x - side, y + 104 + row, x + side, y + 105 + row, ochre)
            canvas.rect(x - 28, y + 24, x + 28, y + 30, ochre)
        look = window_style("alpine")
        window(canvas, x - 18, y + 36, x + 18, y + 98, look, lit=0.38)
        shutters(canvas, x - 18, y + 36, x + 18, y + 98, (92, 108, 72) if i // 4 else (122, 82, 56), shut=0.05)
        canvas.rect(x - 20, y + 29, x + 20, y + 37, (96, 66, 46))
        for k in range(9):
            bloom = ((190, 48, 54), (212, 74, 92), (78, 116, 56))[k % 3]
            canvas.rect(x - 19 + 4.2 * k, y + 35, x - 16 + 4.2 * k, y + 40 + k % 2, bloom)
    return canvas.texture()


def _timber_frame(random: np.random.Generator) -> Picture:
    """Half-timber: posts, rails and braces over white panels, small casements between."""
    canvas = plaster(_H, _W, random, (226, 220, 206))
    wood = np.array((88, 56, 40), np.float32)

    def beam(x0: float, y0: float, x1: float, y1: float, width: float = 7.0) -> None:
        canvas.stroke(x0, y0, x1, y1, width, wood * float(random.uniform(0.88, 1.1)))

    for floor in range(STOREYS):
        low = floor * _PX
        canvas.rect(0, low, _W, low + 9, wood)
        canvas.shade(0, low + 9, _W, low + 10.5, 0.75)
        canvas.shade(0, low, _W, low + 2, 0.7)
        canvas.rect(0, low + 118, _W, low + _PX, wood * 0.94)
        for k in range(BAYS * 4):
            canvas.rect(k * 32 + 10, low + 1, k * 32 + 18, low + 7, wood * 1.15)
    for i, j, x, y in cells():
        left = i * _PX
        canvas.rect(left - 4 if i else 0, y + 8, left + 4, y + 120, wood * float(random.uniform(0.9, 1.08)))
        if i == 0:
            canvas.rect(_W - 4, y + 8, _W, y + 120, wood)
        canvas.rect(left, y + 40, left + _PX, y + 46, wood)
        pattern = (i + j) % 4
        if pattern == 0:  # "the man": braces that lean against a post
            beam(left + 4, y + 10, left + 28, y + 64)
            beam(left + 124, y + 10, left + 100, y + 64)
            beam(left + 28, y + 118, left + 4, y + 76)
            beam(left + 100, y + 118, left + 124, y + 76)
        elif pattern == 2:  # a saint Andrew's cross in the parapet
            beam(x - 26, y + 9, x + 26, y + 41)
            beam(x - 26, y + 41, x + 26, y + 9)
        elif pattern == 3:
            beam(left + 4, y + 10, left + 30, y + 118)
        for side in (-27, 27):
            canvas.rect(x + side - 3, y + 9, x + side + 3, y + 120, wood)
        look = window_style("timbered")
        window(canvas, x - 23, y + 47, x + 23, y + 104, look, lit=0.36)
        canvas.rect(x - 26, y + 104, x + 26, y + 110, wood)
        canvas.rect(x - 27, y + 43, x + 27, y + 47, wood * 1.1)
    return canvas.texture()


def _boards(random: np.random.Generator) -> Picture:
    """Painted weatherboards, white corner and window trims."""
    canvas = plaster(_H, _W, random, (206, 204, 200))
    for row in range(0, _H, 8):
        canvas.pixels[row : row + 1] *= 0.74
        canvas.pixels[row + 1 : row + 3] *= 0.94
    for j in range(STOREYS):
        canvas.rect(0, j * _PX, _W, j * _PX + 6, (240, 239, 236))
        canvas.shade(0, j * _PX + 6, _W, j * _PX + 7, 0.8)
    for _, _, x, y in cells():
        look = window_style("boards")
        window(canvas, x - 20, y + 32, x + 20, y + 98, look, lit=0.36)
    return canvas.texture()


def _ribbon(random: np.random.Generator) -> Picture:
    """Concrete and strips of glass, right across."""
    canvas = plaster(_H, _W, random, (196, 192, 186))
    for j in range(STOREYS):
        y = j * _PX
        canvas.shade(0, y + 32, _W, y + 35, 1.12)
        canvas.rect(0, y + 36, _W, y + 104, (64, 66, 68))
        for i in range(BAYS):
            bright = bool(random.random() < 0.3)
            for k in range(4):
                x = i * _PX + k * 32
                glass(canvas, x + 1, y + 38, x + 31, y + 102, lively=0.35, lit=0.85 if bright else 0.04)
                canvas.rect(x - 1 if x else 0, y + 36, x + 1, y + 104, (84, 86, 88))
        canvas.shade(0, y + 98, _W, y + 104, 0.6)
        canvas.shade(0, y + 35, _W, y + 36, 0.6)
        canvas.shade(0, y + 104, _W, y + 105, 0.85)
        for i in range(BAYS):
            canvas.shade(i * _PX, y + 105, i * _PX + 1, y + _PX, 0.8)
            canvas.shade(i * _PX, y, i * _PX + 1, y + 35, 0.8)
    return canvas.texture()


def _curtain(random: np.random.Generator) -> Picture:
    """Paint a curtain wall: clear panes over dull spandrels between thin mullions; whole offices lit or dark."""
    canvas = Canvas(_H, _W, (70, 78, 86), random)
    for j in range(STOREYS):
        y = j * _PX
        for i in range(BAYS):
            bright = bool(random.random() < 0.32)
            for k in range(2):
                x = i * _PX + k * 64
                glass(canvas, x + 2, y + 32, x + 62, y + 126, lively=0.25, lit=0.9 if bright else 0.05)
                tone = float(random.uniform(0.85, 1.1))
                canvas.rect(x + 2, y + 2, x + 62, y + 30, np.array([88, 108, 120]) * tone)
                canvas.rect(x, y, x + 2, y + _PX, (168, 172, 176))
            if bright:  # strips of lamps under the ceiling
                for k in range(4):
                    canvas.rect(
                        i * _PX + 8 + k * 30, y + 112, i * _PX + 26 + k * 30, y + 114, (236, 236, 226), glow=255
                    )
        canvas.rect(0, y + 30, _W, y + 32, (176, 180, 184))
    canvas.grain(0.8)
    return canvas.texture()


def _fins(random: np.random.Generator) -> Picture:
    """Paint a recent tower: storey-high panes, closed panels between, slim vertical fins."""
    canvas = Canvas(_H, _W, (150, 152, 154), random)
    canvas.noise(3, 16)
    for j in range(STOREYS):
        y = j * _PX
        for i in range(BAYS):
            bright = bool(random.random() < 0.34)
            closed = bool(random.random() < 0.3)
            for k in range(3):
                x = i * _PX + k * _PX / 3
                if closed and k == 1:
                    canvas.rect(x + 2, y + 8, x + 41, y + 124, (176, 172, 164))
                else:
                    glass(canvas, x + 2, y + 8, x + 41, y + 124, lively=0.6, lit=0.8 if bright else 0.08)
                canvas.rect(x, y, x + 2.5, y + _PX, (196, 194, 190))
                canvas.shade(x + 2.5, y + 8, x + 5, y + _PX, 0.74)
        canvas.rect(0, y, _W, y + 8, (186, 184, 180))
        canvas.shade(0, y + 119, _W, y + 124, 0.66)
    canvas.grain(1)
    return canvas.texture()


def _grid(random: np.random.Generator) -> Picture:
    """Paint a recent office or hotel: a deep grid of stone or terracotta with storey-high windows set back in it."""
    canvas = blocks(_H, _W, random, 32, 64, (206, 200, 190), joint=0.9)
    for i, _, x, y in cells():
        canvas.rect(x - 46, y + 14, x + 46, y + 120, (96, 94, 90))
        look = window_style("grid")
        window(canvas, x - 42, y + 14, x + 42, y + 116, look, lively=0.4, lit=0.34)
        canvas.shade(x - 46, y + 104, x + 46, y + 120, 0.5)
        canvas.shade(x - 46, y + 14, x - 38, y + 120, 0.62)
        canvas.shade(x + 42, y + 14, x + 46, y + 120, 1.3)
        canvas.rect(x - 46, y + 12, x + 46, y + 15, (176, 172, 164))
        if i % 2:
            canvas.rect(x - 42, y + 16, x - 14, y + 114, (120, 114, 104))
            canvas.shade(x - 42, y + 104, x - 14, y + 114, 0.6)
    return canvas.texture()


def _slab(random: np.random.Generator) -> Picture:
    """Prefabricated concrete panels with sealed joints."""
    canvas = Canvas(_H, _W, (204, 202, 198), random)
    canvas.noise(5, 40)
    canvas.grain(3)
    for i, _, x, y in cells():
        tone = float(random.normal(1.0, 0.025))
        canvas.shade(i * _PX, y, (i + 1) * _PX, y + _PX, tone)
        half = (30, 30, 16, 30)[i % 4]
        look = window_style("slab", columns=1 if half < 20 else 2)
        window(canvas, x - half, y + 38, x + half, y + 98, look, lit=0.4)
    for j in range(STOREYS):
        canvas.rect(0, j * _PX, _W, j * _PX + 2, (134, 132, 128))
    for i in range(BAYS):
        canvas.rect(i * _PX, 0, i * _PX + 2, _H, (134, 132, 128))
    return canvas.texture()


def _balconies(random: np.random.Generator) -> Picture:
    """Homes with loggias in every other bay."""
    canvas = plaster(_H, _W, random)
    for i, _, x, y in cells():
        left, right = x - _PX / 2, x + _PX / 2
        if i % 2:
            canvas.rect(left + 6, y + 7, right - 6, y + 113, (150, 148, 144))
            look = window_style("balcony_door")
            window(canvas, left + 18, y + 10, right - 18, y + 107, look, lit=0.42)
            canvas.shade(left + 6, y + 95, right - 6, y + 113, 0.62)
            canvas.shade(left + 6, y + 7, left + 14, y + 113, 0.75)
            canvas.rect(left + 2, y + 2, right - 2, y + 9, (214, 212, 208))
            if i % 4 == 1:
                railing(canvas, left + 4, y + 9, right - 5, y + 47, (72, 76, 80), gap=4.6)
            else:
                canvas.rect(left + 3, y + 9, right - 3, y + 46, (168, 178, 182), 0.75)
                canvas.rect(left + 3, y + 45, right - 3, y + 48, (96, 100, 102))
                canvas.glow[round(y) + 9 : round(y) + 48, round(left) + 3 : round(right) - 3] *= 0.4
        else:
            look = window_style("balcony_window")
            window(canvas, left + 31, y + 35, right - 31, y + 102, look, lit=0.36)
    return canvas.texture()


def _panels(random: np.random.Generator) -> Picture:
    """Corrugated metal with a strip of lights high up."""
    canvas = Canvas(_H, _W, (214, 216, 218), random)
    canvas.pixels *= (1 + 0.07 * np.sin(np.arange(_W) * 2 * np.pi / 8))[None, :, None].astype(np.float32)
    for i, j, x, y in cells():
        canvas.shade(x - _PX / 2, y, x + _PX / 2, y + 1.5, 0.7)
        if (i + j) % 2 == 0:
            look = window_style("panels")
            window(canvas, x - 54, y + 75, x + 54, y + 111, look, lively=0.2, lit=0.12)
    canvas.noise(4, 8)
    return canvas.texture()


def _loft(random: np.random.Generator) -> Picture:
    """Paint factory brick: piers and wide steel windows of many panes."""
    canvas = bricks(_H, _W, random, 4, 8, (146, 92, 74))
    for i, _, x, y in cells():
        canvas.shade(i * _PX, y, i * _PX + 12, y + _PX, 1.08)
        canvas.shade(i * _PX + 12, y, i * _PX + 14, y + _PX, 0.76)
        canvas.shade((i + 1) * _PX - 12, y, (i + 1) * _PX, y + _PX, 1.08)
        canvas.rect(x - 46, y + 108, x + 46, y + 114, (132, 78, 62))
        look = window_style("loft")
        window(canvas, x - 44, y + 26, x + 44, y + 108, look, lively=0.3, lit=0.22)
    return canvas.texture()


def _back(random: np.random.Generator) -> Picture:
    """Paint the side nobody shows: bare render, small windows of stairs and kitchens, a down-pipe."""
    canvas = plaster(_H, _W, random, (198, 194, 188))
    canvas.noise(5, 5)
    for i, j, x, y in cells():
        kind = (i * 5 + j) % 8 if i % 4 == 3 else i % 4
        if kind == 1:
            window(canvas, x - 11, y + 52, x + 11, y + 96, window_style("back_stairs"), lit=0.3)
        elif kind < 6:
            window(canvas, x - 19, y + 36, x + 19, y + 96, window_style("back_kitchen"), lit=0.3)
        if i % 4 == 3:
            canvas.rect(x + 56, y, x + 60, y + _PX, (126, 126, 124))
            canvas.shade(x + 60, y, x + 62, y + _PX, 0.82)
            canvas.rect(x + 54, y + 60, x + 62, y + 62, (96, 96, 96))
    return canvas.texture()


def _back_brick(random: np.random.Generator) -> Picture:
    """Paint the same in stock brick."""
    canvas = bricks(_H, _W, random, 4, 8, (150, 116, 94))
    for i, _, x, y in cells():
        if i % 3 == 2:
            window(canvas, x - 12, y + 46, x + 12, y + 94, window_style("back_brick_stairs"), lit=0.3)
        else:
            look = window_style("back_brick")
            window(canvas, x - 19, y + 34, x + 19, y + 96, look, lit=0.3)
        if i % 4 == 1:
            canvas.rect(x + 50, y, x + 54, y + _PX, (58, 58, 58))
    return canvas.texture()


def _church(random: np.random.Generator) -> Picture:
    """One storey as high as the sheet: buttresses, tall pointed windows with tracery."""
    canvas = blocks(_H, _W, random, 16, 32, (204, 198, 186))
    panes = np.array([[70, 62, 96], [104, 58, 52], [60, 88, 84], [126, 104, 60], [62, 74, 108]], np.float32)
    for i in range(BAYS):
        left, x = i * _PX, i * _PX + _PX / 2
        canvas.shade(left, 0, left + 16, _H, 1.08)
        canvas.shade(left + 16, 0, left + 20, _H, 0.72)
        canvas.shade(left + _PX - 8, 0, left + _PX, _H, 1.05)
        for grow, colour in ((6.0, (222, 217, 206)), (0.0, (58, 54, 52))):
            inside, view, _ = canvas.inside_arch(
                x - 26 - grow, 84 - grow, x + 26 + grow, 430 + 1.6 * grow, pointed=True
            )
            view[inside] = colour
        for half in (-1, 0):
            inside, view, glow = canvas.inside_arch(x + half * 24 + 2, 90, x + half * 24 + 22, 384, pointed=True)
            rows, columns = inside.shape
            mosaic = panes[random.integers(len(panes), size=(rows // 6 + 1, columns // 5 + 1))]
            mosaic = mosaic.repeat(6, axis=0).repeat(5, axis=1)[:rows, :columns]
            mosaic *= random.uniform(0.6, 1.1, (rows // 3 + 1, 1, 1)).repeat(3, axis=0)[:rows].astype(np.float32)
            view[inside] = mosaic[inside]
            glow[inside] = 110 if i % 3 else 0
        y, column = np.mgrid[382:426, round(x) - 20 : round(x) + 20]
        rose = np.hypot(column - x + 0.5, (y - 402)) < 12
        canvas.pixels[382:426, round(x) - 20 : round(x) + 20][rose] = (84, 74, 108)
        canvas.shade(x - 26, 84, x - 22, 400, 0.7)
        canvas.rect(x - 34, 74, x + 34, 82, (218, 213, 202))
        canvas.shade(x - 34, 68, x + 34, 74, 0.74)
    canvas.rect(0, _H - 18, _W, _H, (220, 215, 204))
    canvas.shade(0, _H - 26, _W, _H - 18, 0.7)
    for k in range(_W // 16):
        canvas.rect(k * 16, _H - 26, k * 16 + 8, _H - 18, (214, 209, 198))
    return canvas.texture()


def _shed(random: np.random.Generator) -> Picture:
    """Upright boards without a window: sheds and barns."""
    canvas = Canvas(_H // 2, _W // 2, (168, 150, 130), random)
    canvas.noise(6, 10)
    for x in range(0, _W // 2, 4):
        canvas.pixels[:, x : x + 4] *= np.float32(random.normal(1.0, 0.07))
        canvas.pixels[:, x : x + 1] *= np.float32(0.7)
    canvas.grain(2)
    return canvas.texture()


WALLS: dict[str, Callable[[np.random.Generator], Picture]] = {
    "wall_classic": _classic,
    "wall_plain": _plain,
    "wall_brick": _brick,
    "wall_tenement": _tenement,
    "wall_tenement_buff": lambda random: _tenement(random, (172, 146, 112), (206, 194, 172)),
    "wall_stone": _stone,
    "wall_arched": _arches,
    "wall_french": _french,
    "wall_shuttered": _shutters,
    "wall_alpine": _alpine,
    "wall_timbered": _timber_frame,
    "wall_boards": _boards,
    "wall_ribbon": _ribbon,
    "wall_glass": _curtain,
    "wall_fins": _fins,
    "wall_grid": _grid,
    "wall_slab": _slab,
    "wall_balconies": _balconies,
    "wall_panels": _panels,
    "wall_loft": _loft,
    "wall_church": _church,
    "wall_shed": _shed,
    "wall_back": _back,
    "wall_back_brick": _back_brick,
}
"""Painters of upper floors by material name."""
