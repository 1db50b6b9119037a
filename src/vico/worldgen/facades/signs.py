"""Sign boards with the names of places, many on a page: letters, colours by trade, plain boards where letters lack."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.world.mesh import Material
from vico.world.model import Place
from vico.worldgen.facades.catalogue import styles
from vico.worldgen.facades.lettering import lettered, letters_width, spelled
from vico.worldgen.facades.records import BoardColours, Rgb, SignTrade

_ROW, _FONT, _PAGE, _MOST_PAGES = 48, 30, 2048, 2
_MOST_BOARDS = 6000
_RIM = 2  # pixels


@dataclass(frozen=True)
class Lettering:
    """What is painted on a board.

    Attributes
    ----------
    text
        As `spelled` gives it.
    ground, letters, rim
        Colours; None: no rim.
    shines
        Whether it does at night.
    """

    text: str
    ground: Rgb
    letters: Rgb
    rim: Rgb | None = None
    shines: bool = True

    @property
    def order(self) -> tuple[str, Rgb, Rgb, tuple[int, ...], bool]:
        """What boards are sorted by."""
        return self.text, self.ground, self.letters, self.rim or (), self.shines


@dataclass(frozen=True)
class Board:
    """A painted board on a page.

    Attributes
    ----------
    page
        Index into `Boards.materials`.
    uv
        Left, bottom, right and top, texture coordinates.
    aspect
        Its width by its height.
    ground, letters
        Colours.
    """

    page: int
    uv: tuple[float, float, float, float]
    aspect: float
    ground: Rgb
    letters: Rgb


@dataclass(frozen=True)
class Boards:
    """Boards by the id of their place, or the lettering that was asked for.

    `mute` lists places whose name has letters that can't be drawn.
    """

    by_place: dict[str, Board]
    materials: tuple[Material, ...]
    mute: tuple[str, ...]
    by_lettering: dict[Lettering, Board] = field(default_factory=dict)


def trade_of(place: Place) -> SignTrade:
    """Return what kind of sign suits a place: by its kind, else by its category, else the last."""
    trades = list(styles().trades.values())
    of_kind = [trade for trade in trades if place.kind in trade.kinds]
    of_category = [trade for trade in trades if trade.category == place.category]
    return (of_kind or of_category or trades)[-1]


def colours_of(place: Place) -> BoardColours:
    """Return the colours of a place's board: of a chain the same everywhere, since they hang on the name alone."""
    boards = trade_of(place).boards
    return boards[zlib.crc32(place.name.encode()) % len(boards)]


_LONGEST = 30  # characters of a name that a board has room for


def board_text(place: Place) -> str | None:
    """Return what a place's board says, shortened to fit; None where its letters can't be drawn."""
    text = spelled(place.name)
    if text is None:
        return None
    for cut in (" - ", " | ", " (", ", ", " / "):
        if len(text) > 22 and cut in text[3:]:
            text = text[: text.index(cut, 3)]
    if len(text) > _LONGEST:
        text = _cut_at_a_word(text)
    return text.upper() if zlib.crc32(b"case" + place.name.encode()) % 3 == 0 else text


def _cut_at_a_word(text: str) -> str:
    """Return a name's first words, as many as a board has room for: it doesn't end in "of", "und" or "&"."""
    words = text.split()
    while len(words) > 1 and (len(" ".join(words)) > _LONGEST or len(words[-1]) <= 3):
        words.pop()
    return " ".join(words)


def paint_boards(places: Sequence[Place], plates: Iterable[Lettering] = ()) -> Boards:
    """Paint a board for every place and the plates that are asked for, equal ones once, on at most two pages.

    Letters are made smaller where a city has more names than the pages hold; the last names of very many have none.
    """
    wanted: dict[Lettering, list[str]] = {plate: [] for plate in plates}
    mute = []
    for place in places:
        text = board_text(place)
        if text is None:
            mute.append(place.id)
            continue
        colours = colours_of(place)
        wanted.setdefault(Lettering(text, colours.ground, colours.letters), []).append(place.id)
    if not wanted:
        return Boards({}, (), tuple(mute))
    order = sorted(wanted, key=lambda one: one.order)
    for share in (1.0, 0.75, 0.5, 0.375, 0.25):
        row, font = round(_ROW * share / 4) * 4, max(round(_FONT * share), 7)
        pages = _packed([_board_width(one.text, font) for one in order], row)
        if pages is not None:
            break
    else:  # more names than even the smallest letters leave room for: the last ones stay without
        for one in order[_MOST_BOARDS:]:
            mute += wanted.pop(one)
        order = order[:_MOST_BOARDS]
        pages = _packed([_board_width(one.text, font) for one in order], row)
        assert pages is not None
    count = max(page for page, _, _ in pages) + 1
    highest = max(y for page, _, y in pages if page == count - 1) + row
    canvases = [np.zeros((_PAGE, _PAGE, 4), np.uint8) for _ in range(count)]
    if count == 1:  # a small place needs a small page
        canvases = [np.zeros((1 << max(highest - 1, 1).bit_length(), _PAGE, 4), np.uint8)]
    by_place: dict[str, Board] = {}
    by_lettering: dict[Lettering, Board] = {}
    for one, (page, x, y) in zip(order, pages, strict=True):
        picture = _painted(one, font, row)
        height, width = picture.shape[:2]
        canvas = canvases[page]
        canvas[y : y + height, x : x + width] = picture
        e = 0.6
        uv = (
            (x + e) / _PAGE,
            (y + e) / canvas.shape[0],
            (x + width - e) / _PAGE,
            (y + height - e) / canvas.shape[0],
        )
        by_lettering[one] = Board(page, uv, width / height, one.ground, one.letters)
        by_place.update(dict.fromkeys(wanted[one], by_lettering[one]))
    materials = tuple(Material(f"signs_{k}", canvas, emission=1.0) for k, canvas in enumerate(canvases))
    return Boards(by_place, materials, tuple(mute), by_lettering)


def _painted(board: Lettering, font: int, row: int) -> NDArray[np.uint8]:
    """One board: coverage of the letters mixes the colours; letters shine, the board a little. Row 0 is the bottom."""
    text, ground, letters = board.text, board.ground, board.letters
    mask = lettered(text, font)
    margin = round(0.45 * font)
    wide = _board_width(text, font)
    if mask.shape[1] > wide - 2 * margin:
        mask = np.asarray(Image.fromarray(mask).resize((wide - 2 * margin, mask.shape[0]), Image.Resampling.BOX))
    cover = np.zeros((row, wide), np.float32)
    # The middle of a capital, 0.77 of the font's size below the mask's top, goes to the middle of the board.
    top = round(row / 2 - 0.79 * font)
    a, b = max(top, 0), min(top + mask.shape[0], row)
    cover[a:b, margin : margin + mask.shape[1]] = mask[a - top : b - top] / np.float32(255)
    cover = (np.round(cover * 5) / 5).astype(np.float32)  # a handful of shades: files are smaller by a third
    colour = (
        np.asarray(ground, np.float32) * (1 - cover[..., None]) + np.asarray(letters, np.float32) * cover[..., None]
    )
    bright = sum(letters) > sum(ground)
    glow = 40 + 215 * cover if bright else 190 - 120 * cover
    if not board.shines:
        glow = np.zeros_like(cover)
    if board.rim is not None:
        edge = np.ones((row, wide), bool)
        edge[_RIM:-_RIM, _RIM:-_RIM] = False
        colour[edge] = board.rim
    return np.concatenate([colour, glow[..., None]], axis=2).round().astype(np.uint8)[::-1]


def _board_width(text: str, font: int) -> int:
    """Pixels a board is wide; names longer than half a page are squeezed."""
    margin = round(0.45 * font)
    return min(letters_width(text, font) + 2 * margin, _PAGE // 2)


def _packed(widths: Sequence[int], row: int) -> list[tuple[int, int, int]] | None:
    """Lay boards in rows: page, x and y of each; None if they need more pages than there may be."""
    order = sorted(range(len(widths)), key=lambda k: (-widths[k], k))
    rows: list[list[int]] = []  # page, y, used width
    places: list[tuple[int, int, int]] = [(0, 0, 0)] * len(widths)
    rows_a_page = _PAGE // row
    for k in order:
        for entry in rows:
            if entry[2] + widths[k] + 2 <= _PAGE:
                break
        else:
            page, line = divmod(len(rows), rows_a_page)
            if page >= _MOST_PAGES:
                return None
            entry = [page, line * row, 0]
            rows.append(entry)
        places[k] = (entry[0], entry[2], entry[1])
        entry[2] += widths[k] + 2
    return places
