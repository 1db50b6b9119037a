"""Windows: panes that mirror sky and street, what hangs behind them, frames, surrounds, shutters and railings."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from vico.errors import SchemaError
from vico.io.data_files import cached_data, data_files, read_record
from vico.worldgen.facades.records import ROOM, WindowsFile, WindowStyle
from vico.worldgen.texture_canvas import Canvas, Colour


def window_style(name: str, **changes: Any) -> WindowStyle:
    """Return a window of ``vico/data/worldgen/facades/windows.toml``, with other values for some of its fields.

    Raises
    ------
    SchemaError
        If a file of windows can't be used, or none has the name.
    """
    styles = _styles()
    if name not in styles:
        raise SchemaError(f"windows: no window {name!r} in {ROOM}/windows.toml; there are {', '.join(styles)}")
    return styles[name].model_copy(update=changes)


@cached_data
def _styles() -> dict[str, WindowStyle]:
    files = [read_record(path, WindowsFile) for path in data_files(ROOM, "windows")]
    return {window.name: window for file in files for window in file.window}


@cached_data
def windows_digest() -> str:
    """Return a digest of the files of windows, the user's among them."""
    return hashlib.sha256(b"".join(path.read_bytes() for path in data_files(ROOM, "windows"))).hexdigest()


# Light of a pane with no lamp on behind it, of 255: too little to be seen; it tells glass from wall.
_PANE = 5.0
_LOW, _HIGH = np.array([34, 40, 46], np.float32), np.array([116, 136, 154], np.float32)


def glass(canvas: Canvas, x0: float, y0: float, x1: float, y1: float, *, lively: float = 1.0, lit: float = 0.3) -> None:
    """Paint an opening's glass: a mirrored skyline, curtains or a blind behind it, a lamp behind some.

    Parameters
    ----------
    lively
        How often something hangs behind the glass, 0..1.
    lit
        Share of openings with a lamp on at night.
    """
    random = canvas.random
    a, b, c, d = (round(v) for v in (x0, y0, x1, y1))
    if c - a < 2 or d - b < 2:
        return
    up = np.linspace(0, 1, d - b, dtype=np.float32)[:, None, None]
    across = np.linspace(0, 1, c - a, dtype=np.float32)[None, :, None]
    tone = float(random.uniform(0.72, 1.08))
    skyline = np.float32(random.uniform(0.25, 0.7))
    mirror = np.clip((up + 0.18 * across - skyline) * 3.0, 0, 1)
    canvas.pixels[b:d, a:c] = (_LOW + (_HIGH - _LOW) * mirror) * tone
    width, height = c - a, d - b
    on = bool(random.random() < lit)
    choice = float(random.random())
    kind = float(random.random())
    power = float(random.uniform(0.45, 1.0)) * 255
    canvas.glow[b:d, a:c] = _PANE
    if on:
        # A room seen through the pane: brightest below its lamp, with something standing before the far wall.
        hue = np.array([196, 162, 112] if kind < 0.66 else [202, 188, 158] if kind < 0.94 else [120, 140, 172])
        depth = 0.62 + 0.5 * np.clip(1 - np.abs(up - 0.72) * 1.6, 0, 1) - 0.2 * np.abs(across - 0.5)
        room = hue.astype(np.float32) * depth
        view = canvas.pixels[b:d, a:c]
        view += (room - view) * np.float32(0.62)
        canvas.glow[b:d, a:c] = power
        for _ in range(2):
            left = a + float(random.uniform(0, 0.8)) * width
            top = b + float(random.uniform(0.15, 0.5)) * height
            canvas.pixels[b : round(top), round(left) : round(left + 0.25 * width)] *= 0.62
    cloth = np.array([206, 200, 188], np.float32) * float(random.uniform(0.72, 1.0))
    cover = 0.75 if on else 0.5
    if choice < 0.42 * lively:
        side = width * float(random.uniform(0.12, 0.3))
        canvas.rect(a, b, a + side, d, cloth, cover)
        canvas.rect(c - side, b, c, d, cloth, cover)
    elif choice < 0.62 * lively:
        canvas.rect(a, d - height * float(random.uniform(0.2, 0.75)), c, d, cloth, cover)
    elif choice < 0.74 * lively:
        canvas.rect(a, b, c, d, cloth, cover * 0.8)
    elif choice < 0.8 * lively:
        canvas.rect(a + 0.3 * width, b, a + 0.62 * width, b + 0.3 * height, (58, 74, 50), 0.7)


def window(
    canvas: Canvas,
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    look: WindowStyle,
    *,
    lively: float = 1.0,
    lit: float = 0.3,
) -> None:
    """Paint a framed window into a wall."""
    s, k = look.surround, look.scale
    trim = np.asarray(look.trim, np.float32)
    if s:
        if look.arch:
            canvas.arch(x0 - s, y0 - 0.4 * s, x1 + s, y1 + s, trim)
        else:
            canvas.rect(x0 - s, y0 - 0.4 * s, x1 + s, y1 + s, trim)
            canvas.shade(x1 + s, y0, x1 + s + 1.5 * k, y1 + s, 0.86)
        canvas.shade(x0 - s, y0 - 0.4 * s - 1.5 * k, x1 + s, y0 - 0.4 * s, 0.8)
    middle = (x0 + x1) / 2
    if look.hood == "flat":
        canvas.rect(x0 - s - 4 * k, y1 + s, x1 + s + 4 * k, y1 + s + 6 * k, trim)
        canvas.shade(x0 - s - 4 * k, y1 + s - 2.5 * k, x1 + s + 4 * k, y1 + s, 0.68)
    elif look.hood == "gable":
        reach = (x1 - x0) / 2 + s + 4 * k
        for row in range(round(11 * k)):
            side = reach * (1 - row / (11 * k))
            canvas.rect(middle - side, y1 + s + 3 * k + row, middle + side, y1 + s + 3 * k + row + 1, trim * 0.97)
        canvas.rect(middle - reach, y1 + s, middle + reach, y1 + s + 3 * k, trim)
        canvas.shade(middle - reach, y1 + s - 2.5 * k, middle + reach, y1 + s, 0.68)
        canvas.shade(middle - reach * 0.6, y1 + s + 3.5 * k, middle + reach * 0.6, y1 + s + 6 * k, 0.86)
    elif look.hood == "lintel":
        canvas.rect(x0 - 5 * k, y1, x1 + 5 * k, y1 + 9 * k, trim)
        canvas.shade(x0 - 5 * k, y1 + 9 * k, x1 + 5 * k, y1 + 10 * k, 0.84)
        canvas.rect(middle - 3 * k, y1, middle + 3 * k, y1 + 11 * k, trim * 1.03)
    if look.sill:
        canvas.rect(x0 - s - 3 * k, y0 - 5 * k, x1 + s + 3 * k, y0 - k, trim * 0.97)
        canvas.shade(x0 - s - 3 * k, y0 - 8.5 * k, x1 + s + 3 * k, y0 - 5 * k, 0.68)
    bar = look.bar
    before = canvas.pixels[round(y0) : round(y1), round(x0) : round(x1)].copy() if look.arch else None
    canvas.rect(x0, y0, x1, y1, look.frame)
    glass(canvas, x0 + bar, y0 + bar, x1 - bar, y1 - bar, lively=lively, lit=lit)
    frame = np.asarray(look.frame, np.float32)
    heights = np.linspace(y0, y1 - bar, look.rows + 1)
    if look.transom and look.rows == 2:
        heights[1] = y1 - bar - (y1 - y0) * look.transom
    for row in range(1, look.rows):
        canvas.rect(x0, heights[row], x1, heights[row] + bar, frame)
    columns = np.linspace(x0, x1 - bar, look.columns + 1)
    for column in range(1, look.columns):
        canvas.rect(columns[column], y0, columns[column] + bar, y1, frame)
    if look.sash:
        half = (y0 + y1) / 2
        canvas.shade(x0 + bar, half - 2.5 * k, x1 - bar, half, 0.7)
    # The reveal: walls are thick, so the head and one jamb throw a shadow on frame and glass.
    canvas.shade(x0, y1 - 4.5 * k, x1, y1, 0.55)
    canvas.shade(x0, y0, x0 + 2.5 * k, y1, 0.7)
    if before is not None:
        inside, view, glow = canvas.inside_arch(x0, y0, x1, y1)
        inside, outside = inside[: len(view)], ~inside[: len(view)]
        view[outside] = before[outside]
        glow[outside] = 0.0


def shutters(canvas: Canvas, x0: float, y0: float, x1: float, y1: float, colour: Colour, *, shut: float = 0.12) -> None:
    """Hang louvred shutters beside a painted window, or close them over it."""
    tone = np.asarray(colour, np.float32) * float(canvas.random.uniform(0.92, 1.05))
    wide = (x1 - x0) / 2
    leaves = [(x0 - wide - 1, x0 - 1), (x1 + 1, x1 + wide + 1)]
    if canvas.random.random() < shut:
        leaves = [(x0, x0 + wide - 0.5), (x1 - wide + 0.5, x1)]
    for a, b in leaves:
        canvas.rect(a, y0 - 1, b, y1, tone)
        for y in np.arange(y0 + 3, y1 - 3, 3.0):
            canvas.shade(a + 2, y, b - 2, y + 1, 0.74)
        middle = (y0 + y1) / 2
        canvas.rect(a + 1, middle - 1.5, b - 1, middle + 1.5, tone * 1.04)
        canvas.shade(a, y0 - 3, b, y0 - 1, 0.8)
        canvas.shade(b, y0, b + 1, y1, 0.82)


def railing(canvas: Canvas, x0: float, y0: float, x1: float, y1: float, colour: Colour, *, gap: float = 4.0) -> None:
    """Paint a balustrade of thin bars before what is painted behind."""
    for x in np.arange(x0, x1 + 0.1, gap):
        canvas.rect(x, y0, x + 1.2, y1, colour)
    canvas.rect(x0 - 1, y1, x1 + 2, y1 + 2, colour)
    canvas.rect(x0 - 1, y0, x1 + 2, y0 + 1.4, colour)
