"""Sign boards with the names of places, many on a page: letters, colours by trade, plain boards where letters lack.

Pillow's built-in font (Aileron, CC0) has the ASCII letters only. Accented letters are put together from a letter and
strokes; capitals of Greek and Cyrillic that no Latin letter looks like are polylines. Other scripts can't be drawn.
"""

from __future__ import annotations

import unicodedata
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from vico.world.mesh import Material
from vico.world.model import Place
from vico.worldgen.facades.facade_styles import styles
from vico.worldgen.facades.records import BoardColours, Rgb

_INSTEAD = {
    "’": "'", "‘": "'", "`": "'", "´": "'", "“": '"', "”": '"', "„": '"', "«": '"', "»": '"', "–": "-", "—": "-",
    "−": "-", "·": "-", "•": "-", "…": "...", "ß": "ss", "ẞ": "SS", "æ": "ae", "Æ": "AE", "œ": "oe", "Œ": "OE",
    "þ": "th", "Þ": "TH", "ð": "d", "ı": "i", "ĸ": "k", "ŋ": "n", "№": "No", "®": "", "™": "", "©": "", "°": "o",
    "ª": "a", "º": "o", "€": "EUR", "£": "GBP", "×": "x", "\u00a0": " ", "²": "2", "³": "3", "½": "1/2",
    "ʻ": "'", "ʼ": "'", "、": ",", "（": "(", "）": ")", "¡": "!", "¿": "?", "\u200b": "", "¹": "1", "⁄": "/",
}  # fmt: skip
_CROSSED = {"ø": "o", "Ø": "O", "đ": "d", "Đ": "D", "ł": "l", "Ł": "L", "ħ": "h", "Ħ": "H", "ŧ": "t", "Ŧ": "T"}
# Capitals that look like a Latin letter.
_ALIKE = dict(
    zip(
        "АВЕКМНОРСТХІЅЈУΑΒΕΖΗΙΚΜΝΟΡΤΥΧ",
        "ABEKMHOPCTXISJYABEZHIKMNOPTYX",
        strict=True,
    )
)
# Accents as polylines in widths of the letter (x about its middle) and heights of a capital above its top.
_ABOVE: dict[str, tuple[tuple[tuple[float, float], ...], ...]] = {
    "\u0300": (((-0.16, 0.26), (0.08, 0.08)),),
    "\u0301": (((0.16, 0.26), (-0.08, 0.08)),),
    "\u0302": (((-0.2, 0.08), (0.0, 0.24), (0.2, 0.08)),),
    "\u0303": (((-0.22, 0.1), (-0.1, 0.2), (0.1, 0.1), (0.22, 0.2)),),
    "\u0304": (((-0.2, 0.15), (0.2, 0.15)),),
    "\u0306": (((-0.2, 0.22), (-0.1, 0.1), (0.1, 0.1), (0.2, 0.22)),),
    "\u0307": (((-0.03, 0.15), (0.03, 0.15)),),
    "\u0308": (((-0.18, 0.15), (-0.12, 0.15)), ((0.12, 0.15), (0.18, 0.15))),
    "\u0309": (((-0.08, 0.24), (0.08, 0.24), (0.08, 0.16), (0.0, 0.12), (0.0, 0.06)),),
    "\u030a": (((-0.1, 0.16), (0.0, 0.26), (0.1, 0.16), (0.0, 0.06), (-0.1, 0.16)),),
    "\u030b": (((0.0, 0.26), (-0.16, 0.08)), ((0.24, 0.26), (0.08, 0.08))),
    "\u030c": (((-0.2, 0.24), (0.0, 0.08), (0.2, 0.24)),),
    "\u031b": (((0.3, 0.0), (0.36, 0.1)),),
}
_BELOW: dict[str, tuple[tuple[tuple[float, float], ...], ...]] = {
    "\u0323": (((-0.03, -0.14), (0.03, -0.14)),),
    "\u0326": (((0.04, -0.08), (-0.04, -0.24)),),
    "\u0327": (((0.0, 0.0), (0.02, -0.1), (0.1, -0.18), (-0.08, -0.24)),),
    "\u0328": (((0.1, 0.0), (0.0, -0.14), (0.12, -0.22)),),
    "\u0331": (((-0.2, -0.12), (0.2, -0.12)),),
}
# Capitals of our own: width, then polylines in capital heights, y up.
_DRAWN: dict[str, tuple[float, str]] = {
    "Б": (0.6, "56 06 00 40 53 51 44 04"), "Г": (0.52, "00 06 56"), "Ґ": (0.52, "00 06 46 47"),
    "Д": (0.75, "0- 00 60 6-|10 26 56 50"), "Ж": (0.9, "40 46|06 43 86|00 43 80"),
    "З": (0.58, "05 16 46 55 44 23 44 52 41 40 10 01"), "И": (0.66, "06 00 56 50"),
    "Й": (0.66, "06 00 56 50|18 27 37 48"), "Л": (0.66, "00 11 26 56 50"), "П": (0.66, "00 06 56 50"),
    "Ф": (0.8, "40 46|45 15 04 02 11 41 71 82 84 75 45"), "Ц": (0.7, "06 00 60 6-|50 56"),
    "Ч": (0.6, "06 04 13 53|56 50"),
    "Ш": (0.9, "06 00 80 86|46 40"), "Щ": (0.95, "06 00 90 9-|46 40|86 80"), "Ъ": (0.7, "06 26 20 50 61 52 43 23"),
    "Ы": (0.85, "06 00 30 41 42 33 03|76 70"), "Ь": (0.58, "06 00 40 51 52 43 03"),
    "Э": (0.62, "05 16 46 55 51 40 10 01|53 23"), "Ю": (0.95, "00 06|03 33|56 35 31 50 70 81 85 76 56"),
    "Я": (0.62, "50 56 16 05 04 13 53|23 00"), "Є": (0.62, "55 46 16 05 01 10 40 51|03 33"),
    "Ё": (0.56, "56 06 00 50|03 43|18 28|38 48"), "Ї": (0.34, "10 16|08 09|28 29"),
    "Γ": (0.52, "00 06 56"), "Δ": (0.7, "00 36 60 00"), "Θ": (0.75, "16 05 01 10 50 61 65 56 16|23 43"),
    "Λ": (0.66, "00 36 60"), "Ξ": (0.6, "06 56|13 43|00 50"), "Π": (0.66, "00 06 56 50"),
    "Σ": (0.58, "56 06 33 00 50"), "Φ": (0.8, "40 46|45 15 04 02 11 41 71 82 84 75 45"),
    "Ψ": (0.8, "40 46|06 04 13 43 73 84 86"), "Ω": (0.75, "00 20 02 04 16 56 64 62 40 60"),
}  # fmt: skip


@lru_cache(maxsize=8)
def _font(size: int) -> Any:
    return ImageFont.load_default(size=size)


def _ascii(character: str) -> bool:
    return " " <= character <= "~"


def _parts(character: str) -> tuple[str, str] | None:
    """Return a letter as an ASCII one and its accents."""
    if _ascii(character):
        return character, ""
    if character in _CROSSED:
        return _CROSSED[character], "/"
    whole = unicodedata.normalize("NFD", character)
    letter, marks = whole[0], whole[1:]
    letter = _ALIKE.get(letter, letter)
    if _ascii(letter) and all(mark in _ABOVE or mark in _BELOW for mark in marks):
        return letter, marks
    return None


def drawable_text(text: str) -> str | None:
    """Return the text in characters that can be drawn, or None if some can't.

    Names in Greek or Cyrillic come back in capitals; typographic signs as their plain cousins.
    """
    text = "".join(_INSTEAD.get(c, c) for c in unicodedata.normalize("NFC", text))
    if any("Ͱ" <= c <= "ӿ" for c in text):
        text = unicodedata.normalize("NFC", "".join(_without_tonos(c) for c in text.upper()))
    text = " ".join(text.split())
    if not text or any(_parts(c) is None and c not in _DRAWN for c in text):
        return None
    return text


def _without_tonos(character: str) -> str:
    """Greek capitals go without accents."""
    if "Ͱ" <= character <= "Ͽ":
        return unicodedata.normalize("NFD", character)[0]
    return character


def text_width(text: str, size: int, *, bold: bool = True) -> int:
    """Width of what `lettered` draws, pixels."""
    return (int(_places(text, 2 * size, bold)[1]) + 2) // 2 + 1


def _places(text: str, size: int, bold: bool) -> tuple[list[tuple[str, float, float]], float]:
    """Where each character begins and how wide it is, and where the text ends."""
    weight = size / 44.0 if bold else 0.0
    places: list[tuple[str, float, float]] = []
    x = weight + 1.0
    for character in text:
        parts = _parts(character)
        if character in _DRAWN or parts is None:
            wide = (_DRAWN[character][0] + 0.28) * 0.7 * size
        else:
            wide = float(_font(size).getlength(parts[0]))
        places.append((character, x, wide))
        x += wide + weight
    return places, x + weight


def draw_text(text: str, size: int, *, bold: bool = True) -> NDArray[np.uint8]:
    """Draw spelled text.

    Parameters
    ----------
    text
        What `spelled` returned.
    size
        Height of the font, pixels; a capital is about 0.7 of that.
    bold
        Thicker strokes.

    Returns
    -------
    ndarray
        Coverage 0..255, shape ``(1.5 size, width)``, the base line at 1.12 `size` from the top; row 0 is the top.
    """
    target, size = size, 2 * size  # lines have hard edges: they are drawn larger and reduced
    font = _font(size)
    cap = 0.7 * size
    line = 1.12 * size
    weight = size / 44.0 if bold else 0.0
    stroke = max(round(0.085 * size + weight), 1)
    places, _ = _places(text, size, bold)
    image = Image.new("L", (2 * text_width(text, target, bold=bold), round(1.5 * size)), 0)
    draw = ImageDraw.Draw(image)
    for character, left, wide in places:
        if character in _DRAWN:
            across, strokes = _DRAWN[character]
            most = max(int(p[0]) for p in strokes.replace("|", " ").split(" "))
            up, along = cap / 6.0, across * cap / most
            for polyline in strokes.split("|"):
                points = [
                    (left + 0.14 * cap + int(p[0]) * along, line - (-1 if p[1] == "-" else int(p[1])) * up)
                    for p in polyline.split(" ")
                ]
                draw.line(points, fill=255, width=stroke, joint="curve")
            continue
        parts = _parts(character)
        assert parts is not None
        letter, marks = parts
        draw.text((left, line), letter, font=font, fill=255, anchor="ls", stroke_width=round(weight))
        top = cap if letter.isupper() else 0.52 * size
        if letter in "bdfhklt":
            top = 0.74 * size
        if letter in "ij" and any(mark in _ABOVE for mark in marks):
            draw.rectangle((left, 0, left + wide, line - 0.55 * size), fill=0)  # the dot gives way
        middle = left + wide / 2
        for mark in marks:
            if mark == "/":
                draw.line(
                    [(left + 0.12 * wide, line + 0.04 * size), (left + 0.88 * wide, line - top - 0.04 * size)]
                    if letter in "oO"
                    else [(left, line - 0.42 * top), (left + 0.8 * wide, line - 0.58 * top)],
                    fill=255,
                    width=max(stroke - 1, 1),
                )
                continue
            base = line - top if mark in _ABOVE else line
            for polyline_of in _ABOVE.get(mark, ()) + _BELOW.get(mark, ()):
                points = [(middle + px * cap, base - py * cap) for px, py in polyline_of]
                draw.line(points, fill=255, width=stroke, joint="curve")
    height = round(1.5 * target)
    return np.asarray(image.resize((image.width // 2, height), Image.Resampling.BOX))


_ROW = 48  # pixels, height of a board
_FONT = 30  # pixels, size of its letters
_PAGE = 2048  # pixels, side of a page of boards
_MOST_PAGES = 2
_MOST_BOARDS = 6000
_RIM = 2  # pixels


@dataclass(frozen=True)
class Lettering:
    """Text and colours of a board.

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
        """Key that boards are sorted by."""
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


def colours_of(place: Place) -> BoardColours:
    """Return the colours of a place's board: of a chain the same everywhere, since they hang on the name alone."""
    # The sign that suits a place goes by its kind, else by its category, else it is the last.
    trades = list(styles().trades.values())
    of_kind = [trade for trade in trades if place.kind in trade.kinds]
    of_category = [trade for trade in trades if trade.category == place.category]
    boards = (of_kind or of_category or trades)[-1].boards
    return boards[zlib.crc32(place.name.encode()) % len(boards)]


_LONGEST_TEXT = 30  # characters of a name that a board has room for


def board_text(place: Place) -> str | None:
    """Return what a place's board says, shortened to fit; None where its letters can't be drawn."""
    text = drawable_text(place.name)
    if text is None:
        return None
    for cut in (" - ", " | ", " (", ", ", " / "):
        if len(text) > 22 and cut in text[3:]:
            text = text[: text.index(cut, 3)]
    if len(text) > _LONGEST_TEXT:
        # Keep as many first words as a board has room for; none ends in "of", "und" or "&".
        words = text.split()
        while len(words) > 1 and (len(" ".join(words)) > _LONGEST_TEXT or len(words[-1]) <= 3):
            words.pop()
        text = " ".join(words)
    return text.upper() if zlib.crc32(b"case" + place.name.encode()) % 3 == 0 else text


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
        pages = _pack_rows([_board_width(one.text, font) for one in order], row)
        if pages is not None:
            break
    else:  # more names than even the smallest letters leave room for: the last ones stay without
        for one in order[_MOST_BOARDS:]:
            mute += wanted.pop(one)
        order = order[:_MOST_BOARDS]
        pages = _pack_rows([_board_width(one.text, font) for one in order], row)
        assert pages is not None
    count = max(page for page, _, _ in pages) + 1
    highest = max(y for page, _, y in pages if page == count - 1) + row
    canvases = [np.zeros((_PAGE, _PAGE, 4), np.uint8) for _ in range(count)]
    if count == 1:  # a small place needs a small page
        canvases = [np.zeros((1 << max(highest - 1, 1).bit_length(), _PAGE, 4), np.uint8)]
    by_place: dict[str, Board] = {}
    by_lettering: dict[Lettering, Board] = {}
    for one, (page, x, y) in zip(order, pages, strict=True):
        picture = _paint_board(one, font, row)
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


def _paint_board(board: Lettering, font: int, row: int) -> NDArray[np.uint8]:
    """One board: coverage of the letters mixes the colours; letters shine, the board a little. Row 0 is the bottom."""
    text, ground, letters = board.text, board.ground, board.letters
    mask = draw_text(text, font)
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
    return min(text_width(text, font) + 2 * margin, _PAGE // 2)


def _pack_rows(widths: Sequence[int], row: int) -> list[tuple[int, int, int]] | None:
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
