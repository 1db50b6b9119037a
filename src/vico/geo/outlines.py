"""Outlines as people draw them, made into valid polygons in bounded time; and files that unpack to too much."""

from __future__ import annotations

import bz2
import gzip
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from vico.errors import SchemaError
from vico.geo import overlay
from vico.geo.overlay import OverlayError, polygons_of

#: A building with more corners than this is simplified: OpenStreetMap allows 2,000 nodes a way.
MOST_CORNERS = 1000
# Mending takes time that grows with the third power of the crossings: 200 random corners take seconds, 2,000 days.
_MOST_CROSSINGS = 200
_FREE, _MOST_RATIO = 64 << 20, 60  # real extracts unpack to 3 (pbf) to 20 times (XML) their size


def is_scribble(lines: list[NDArray[np.float64]]) -> bool:
    """Whether lines cross each other so often that they outline nothing, and would take for ever to mend.

    Parameters
    ----------
    lines
        Metres, shape ``(n, 2)`` each.
    """
    pieces = [np.concatenate([line[:-1], line[1:]], axis=1) for line in lines if len(line) > 1]
    if not pieces:
        return False
    segments = np.concatenate(pieces)
    boxes = shapely.box(
        *np.minimum(segments[:, :2], segments[:, 2:]).T, *np.maximum(segments[:, :2], segments[:, 2:]).T
    )
    tree = shapely.STRtree(boxes)
    crossings = 0
    for start in range(0, len(segments), 500):
        one, two = tree.query(boxes[start : start + 500])
        later = two > one + start + 1  # each pair once, neighbours not
        a, b = segments[one[later] + start], segments[two[later]]
        crossings += int((_apart(a, b) & _apart(b, a)).sum())
        if crossings > _MOST_CROSSINGS + len(segments) // 20:
            return True
    return False


def _apart(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether the ends of segments `b` lie on different sides of the lines through `a`, or on them."""
    along = a[:, 2:] - a[:, :2]

    def side(point: NDArray[np.float64]) -> NDArray[np.float64]:
        off = point - a[:, :2]
        return along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0]

    return np.asarray(side(b[:, :2]) * side(b[:, 2:]) <= 0.0)


def mended(polygon: Polygon) -> tuple[Polygon | MultiPolygon, str | None]:
    """Return the polygonal part of a possibly self-crossing outline, and what was wrong with it."""
    if not np.isfinite(shapely.get_coordinates(polygon)).all():
        return Polygon(), "outline with points too far away"
    if polygon.is_valid:
        return _rounded(polygon), None
    if is_scribble([np.asarray(polygon.exterior.coords)]):
        return Polygon(), "outline crosses itself too often to mean an area; left out"
    parts = polygons_of(_rounded(overlay.mended(polygon)))
    if not parts:
        return Polygon(), "area without extent"
    what = f"outline crosses or touches itself; kept as {len(parts)} part{'s' * (len(parts) > 1)}"
    return (parts[0] if len(parts) == 1 else MultiPolygon(parts)), what


def _rounded(shape: Polygon | MultiPolygon) -> Polygon | MultiPolygon:
    """Round a shape to the grid of all overlays, so that whatever is cut from it meets it exactly; else empty it."""
    try:
        return overlay.on_grid(shape)
    except OverlayError:
        return Polygon()


def joined(shapes: Sequence[BaseGeometry], *, gap: float, least: float) -> Polygon | MultiPolygon:
    """Return what outlines cover together, gaps between them closed.

    Parameters
    ----------
    shapes
        Areas, metres.
    gap
        Half the width of gaps that are closed, metres.
    least
        Square metres below which a piece is left out.
    """
    whole = overlay.union_all(shapes)
    closed = overlay.buffer(overlay.buffer(whole, gap, join_style="mitre"), -gap, join_style="mitre")
    # The engine may lose a turned box when it is shrunk by centimetres (GEOS 3.14).
    kept = closed if closed.area > 0.98 * whole.area else whole
    parts = polygons_of(overlay.on_grid(kept), least)
    return parts[0] if len(parts) == 1 else MultiPolygon(parts)


def simplified(shape: Polygon | MultiPolygon) -> tuple[Polygon | MultiPolygon, str | None]:
    """Return a shape of at most `MOST_CORNERS` corners, as near to the given one as that allows, and what was done."""
    corners = shapely.get_num_coordinates(shape)
    tolerance = 0.05
    while shapely.get_num_coordinates(shape) > MOST_CORNERS and tolerance < 100.0:
        shape, tolerance = overlay.simplify(shape, tolerance), tolerance * 2
    left = shapely.get_num_coordinates(shape)
    return shape, f"outline of {corners:,} corners; simplified to {left:,}" if left < corners else None


def check_size(path: Path) -> None:
    """Refuse a compressed extract that unpacks to far more than any real one does.

    Raises
    ------
    SchemaError
        If it does, or can't be unpacked.
    """
    name = path.name.lower()
    most = _FREE + _MOST_RATIO * path.stat().st_size
    try:
        if name.endswith(".pbf"):
            with path.open("rb") as file:
                size = _pbf_size(file, most)
        elif name.endswith((".gz", ".bz2")):
            size = 0
            with gzip.open(path) if name.endswith(".gz") else bz2.open(path) as packed:
                while size <= most and (block := packed.read(1 << 20)):
                    size += len(block)
        else:
            return
    except (OSError, EOFError, zlib.error) as error:
        raise SchemaError(f"{path}: truncated or broken ({error}); download it again, or clip it anew") from None
    if size > most:
        raise SchemaError(
            f"{path}: unpacks to more than {most >> 20:,} MiB, {_MOST_RATIO} times its size, as no map does; download "
            "it again"
        )


def _pbf_size(file: BinaryIO, most: int) -> int:
    """Return what the blocks of a PBF file say they unpack to, bytes; what is broken is left for the reader to say."""
    size = 0
    while size <= most and len(length := file.read(4)) == 4:
        header = file.read(min(int.from_bytes(length, "big"), 1 << 16))
        block = dict(_fields(header)).get(3)
        if not isinstance(block, int):
            break
        start = file.tell()
        size += next((value for key, value in _fields(file.read(min(block, 64))) if key == 2), block)
        file.seek(start + block)
    return size


def _fields(content: bytes) -> list[tuple[int, int]]:
    """Numbers of the protocol buffer's fields, and their values (of blobs, their lengths), as far as they go."""
    found: list[tuple[int, int]] = []
    place = 0
    while place < len(content):
        numbers: list[int] = []
        kind = 0
        for _ in range(2):
            value = shift = 0
            while place < len(content) and shift < 64:
                byte = content[place]
                place, value, shift = place + 1, value | (byte & 127) << shift, shift + 7
                if byte < 128:
                    break
            numbers.append(value)
        kind = numbers[0] & 7
        if kind not in (0, 2):
            break
        found.append((numbers[0] >> 3, numbers[1]))
        place += numbers[1] if kind == 2 else 0
    return found
