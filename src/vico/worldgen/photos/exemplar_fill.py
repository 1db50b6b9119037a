"""Missing texels from the picture's own: an exemplar fill for facades, and plain colour where nothing is known.

The fill looks, for every missing texel, for a known one whose surroundings match, coarse to fine, and takes what lies
there; neighbours prefer to copy from neighbours, so whole windows come over in one piece. Facades repeat along their
storeys, so a match at the same height is preferred.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled

_REACH = 3  # texels from a patch's centre to its border
_LEVELS = 5
_SMALLEST = 20  # texels of a side below which no coarser level is made
_UNKNOWN = 3 * 70.0**2  # what a source texel costs that is not known itself
_GUESSED = 0.25  # weight of a texel that is filled already, against a known one
_DRIFT = 4.0  # what a texel of height between copy and source costs, squared differences, at full resolution
_MOST_DRIFT = 9000.0


def pull_push(image: NDArray[np.uint8], known: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Spread known colours smoothly over all others; an image without a known texel stays as it is.

    Parameters
    ----------
    image
        uint8, shape ``(h, w, 3)``.
    known
        Which texels to keep, shape ``(h, w)``.

    Returns
    -------
    ndarray
        uint8, shape ``(h, w, 3)``.
    """
    if not known.any():
        return image.copy()
    levels = [(np.ascontiguousarray(image), np.ascontiguousarray(known))]
    while not levels[-1][1].all() and max(levels[-1][0].shape[:2]) > 1:
        levels.append(_halve(*levels[-1]))
    filled = levels[-1][0]
    for finer, mask in reversed(levels[:-1]):
        filled = _push(finer, mask, filled)
    return filled


@compiled(nogil=True)
def _halve(image, known):
    height, width = image.shape[:2]
    h, w = (height + 1) // 2, (width + 1) // 2
    small, mask = np.zeros((h, w, 3), np.uint8), np.zeros((h, w), np.bool_)
    for y in range(h):
        for x in range(w):
            count = 0
            r = g = b = 0
            for j in range(2 * y, min(2 * y + 2, height)):
                for i in range(2 * x, min(2 * x + 2, width)):
                    if known[j, i]:
                        count += 1
                        r += image[j, i, 0]
                        g += image[j, i, 1]
                        b += image[j, i, 2]
            if count:
                mask[y, x] = True
                small[y, x, 0] = (r + count // 2) // count
                small[y, x, 1] = (g + count // 2) // count
                small[y, x, 2] = (b + count // 2) // count
    return small, mask


@compiled(nogil=True)
def _push(image, known, coarse):
    out = image.copy()
    height, width = known.shape
    h, w = coarse.shape[:2]
    for y in range(height):
        for x in range(width):
            if not known[y, x]:
                # Bilinear between the four nearest coarse texels.
                y0, x0 = y // 2, x // 2
                y1 = min(max(y0 + (1 if y % 2 else -1), 0), h - 1)
                x1 = min(max(x0 + (1 if x % 2 else -1), 0), w - 1)
                for k in range(3):
                    value = 9.0 * coarse[y0, x0, k] + 3.0 * coarse[y1, x0, k]
                    value += 3.0 * coarse[y0, x1, k] + 1.0 * coarse[y1, x1, k]
                    out[y, x, k] = np.uint8(value / 16.0 + 0.5)
    return out


def exemplar_fill(
    image: NDArray[np.uint8],
    missing: NDArray[np.bool_],
    *,
    usable: NDArray[np.bool_] | None = None,
    upright: bool = True,
    seed: int = 0,
) -> NDArray[np.uint8]:
    """Fill missing texels with copies of known ones whose surroundings match.

    Parameters
    ----------
    image
        uint8, shape ``(h, w, 3)``.
    missing
        What to fill, shape ``(h, w)``.
    usable
        What may be copied; all that is not missing where not given. Others are neither copied nor compared.
    upright
        Rows are level: prefer sources at the same height.
    seed
        Of the random search.

    Returns
    -------
    ndarray
        uint8, shape ``(h, w, 3)``; texels that are not missing are as they were.
    """
    good = ~missing if usable is None else usable & ~missing
    if not missing.any() or not good.any():
        return image.copy()
    pictures = [np.ascontiguousarray(image)]
    goods, holes = [np.ascontiguousarray(good)], [np.ascontiguousarray(missing)]
    while len(pictures) < _LEVELS and min(pictures[-1].shape[:2]) > _SMALLEST:
        small, _ = _halve(pictures[-1], goods[-1])
        half = _reduce_mask(goods[-1]) >= 2  # half of it is known
        if not half.any():
            break
        pictures.append(small)
        goods.append(half)
        holes.append((_reduce_mask(holes[-1]) > 0) & ~half)
    field = np.zeros((0, 0, 2), np.int32)
    for k in range(len(pictures) - 1, -1, -1):
        start = pull_push(pictures[k], goods[k])
        sources = np.flatnonzero(goods[k]).astype(np.int32)
        row = np.concatenate([[0], np.cumsum(goods[k].sum(axis=1))])
        drift = _DRIFT * 4.0**k if upright else 0.0
        rounds = 6 if k == len(pictures) - 1 else 2
        level = _Picture(start, holes[k], goods[k])
        field = _find_matches(level, _Sources(sources, row), field, drift, rounds, np.uint64(seed * 977 + k))
        if k == 0:
            return _copy_matches(pictures[0], holes[0], field, start)
    raise AssertionError("a picture has at least one level")


def _reduce_mask(mask: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """How many of each two by two texels are set."""
    height, width = mask.shape
    even = np.zeros((height + height % 2, width + width % 2), np.uint8)
    even[:height, :width] = mask
    return even.reshape(even.shape[0] // 2, 2, even.shape[1] // 2, 2).sum(axis=(1, 3), dtype=np.uint8)


class _Picture(NamedTuple):
    """A level of the picture while it is filled: texels, which of them are missing, and which may be copied."""

    image: NDArray[np.uint8]
    hole: NDArray[np.bool_]
    good: NDArray[np.bool_]


class _Sources(NamedTuple):
    """The texels that may be copied, by flat index, and where each row's begin among them."""

    texels: NDArray[np.int32]
    row: NDArray[np.int64]


@compiled(nogil=True)
def _cost(picture, y, x, sy, sx, drift, best):
    """Mean squared difference of the patches about (y, x) and (sy, sx); gives up above `best`."""
    image, hole, good = picture.image, picture.hole, picture.good
    height, width = hole.shape
    reach = _REACH
    total, weight = 0.0, 0.0
    rise = float(sy - y)
    prior = min(drift * rise * rise, _MOST_DRIFT)
    if prior >= best:
        return prior
    full = float((2 * reach + 1) ** 2)
    for j in range(-reach, reach + 1):
        ty, qy = y + j, sy + j
        if ty < 0 or ty >= height:
            continue
        for i in range(-reach, reach + 1):
            tx, qx = x + i, sx + i
            if tx < 0 or tx >= width:
                continue
            if hole[ty, tx]:
                w = _GUESSED
            elif good[ty, tx]:
                w = 1.0
            else:
                continue
            weight += w
            if qy < 0 or qy >= height or qx < 0 or qx >= width or not good[qy, qx]:
                total += w * _UNKNOWN
            else:
                r = float(image[ty, tx, 0]) - float(image[qy, qx, 0])
                g = float(image[ty, tx, 1]) - float(image[qy, qx, 1])
                b = float(image[ty, tx, 2]) - float(image[qy, qx, 2])
                total += w * (r * r + g * g + b * b)
        if total / full + prior >= best:
            return total / full + prior
    return total / max(weight, 1e-9) + prior


@compiled(nogil=True, inline="always")
def _next_random(state):
    """SplitMix64: the next state and its random bits."""
    state = state + np.uint64(0x9E3779B97F4A7C15)
    z = state
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return state, z ^ (z >> np.uint64(31))


@compiled(nogil=True, inline="always")
def _may_be_copied(good, y, x):
    return 0 <= y < good.shape[0] and 0 <= x < good.shape[1] and good[y, x]


@compiled(nogil=True)
def _as_coarser(coarse, y, x):
    """Return the source that the coarser level found for a texel; (-1, -1) for none."""
    if coarse.shape[0]:
        cy, cx = min(y // 2, coarse.shape[0] - 1), min(x // 2, coarse.shape[1] - 1)
        if coarse[cy, cx, 0] >= 0:
            return coarse[cy, cx, 0] * 2 + y % 2, coarse[cy, cx, 1] * 2 + x % 2
    return -1, -1


@compiled(nogil=True)
def _first_sources(picture, sources, coarse, drift, state):
    """Return a source for every missing texel to begin with: the coarser level's, else one at random."""
    height, width = picture.hole.shape
    field = np.full((height, width, 2), -1, np.int32)
    for y in range(height):
        for x in range(width):
            if not picture.hole[y, x]:
                continue
            sy, sx = _as_coarser(coarse, y, x)
            if not _may_be_copied(picture.good, sy, sx):
                # From the same row where it has a known texel and rows are level, else from anywhere.
                low, high = sources.row[y], sources.row[y + 1]
                if drift == 0.0 or low == high:
                    low, high = 0, len(sources.texels)
                state, bits = _next_random(state)
                pick = sources.texels[low + int(bits % np.uint64(high - low))]
                sy, sx = pick // width, pick % width
            field[y, x, 0], field[y, x, 1] = sy, sx
    return field, state


@compiled(nogil=True)
def _paint(picture, field):
    for y in range(picture.hole.shape[0]):
        for x in range(picture.hole.shape[1]):
            if picture.hole[y, x]:
                picture.image[y, x] = picture.image[field[y, x, 0], field[y, x, 1]]


@compiled(nogil=True, inline="always")
def _match_beside_neighbour(picture, field, y, x, step, drift, found):
    """Return what `found` says, or a better source beside that of the neighbour above (below) or left (right)."""
    sy, sx, best = found
    height, width = picture.hole.shape
    for k in range(2):
        ny, nx = (y + step, x) if k == 0 else (y, x + step)
        if ny < 0 or ny >= height or nx < 0 or nx >= width or not picture.hole[ny, nx]:
            continue
        ty, tx = field[ny, nx, 0] + y - ny, field[ny, nx, 1] + x - nx
        if _may_be_copied(picture.good, ty, tx) and (ty != sy or tx != sx):
            c = _cost(picture, y, x, ty, tx, drift, best)
            if c < best:
                best, sy, sx = c, ty, tx
    return sy, sx, best


@compiled(nogil=True, inline="always")
def _random_match(picture, y, x, drift, state, found):
    """Return the next state, and `found` or a better source: along the row, where facades repeat; then about it."""
    sy, sx, best = found
    height, width = picture.hole.shape
    span = width
    while span >= 1:
        state, bits = _next_random(state)
        tx = sx + int(bits % np.uint64(2 * span + 1)) - span
        ty = sy if span > 2 or drift > 0 else y
        if drift == 0.0:
            state, bits = _next_random(state)
            reach = min(span, height)
            ty = sy + int(bits % np.uint64(2 * reach + 1)) - reach
        elif span >= width // 2:
            ty = y
        if _may_be_copied(picture.good, ty, tx):
            c = _cost(picture, y, x, ty, tx, drift, best)
            if c < best:
                best, sy, sx = c, ty, tx
        span //= 3
    return state, (sy, sx, best)


@compiled(nogil=True)
def _find_matches(picture, sources, coarse, drift, rounds, seed):
    """Find a source for every missing texel: from the coarser level, from neighbours, and at random, nearer and nearer.

    The picture is painted along the way: what is found first is what the next is compared with.
    """
    height, width = picture.hole.shape
    field, state = _first_sources(picture, sources, coarse, drift, seed)
    if coarse.shape[0]:
        _paint(picture, field)
    for turn in range(rounds):
        forward = turn % 2 == 0
        step = -1 if forward else 1
        for line in range(height):
            y = line if forward else height - 1 - line
            for column in range(width):
                x = column if forward else width - 1 - column
                if not picture.hole[y, x]:
                    continue
                sy, sx = np.int64(field[y, x, 0]), np.int64(field[y, x, 1])
                found = (sy, sx, _cost(picture, y, x, sy, sx, drift, 1e30))
                found = _match_beside_neighbour(picture, field, y, x, step, drift, found)
                state, found = _random_match(picture, y, x, drift, state, found)
                field[y, x, 0], field[y, x, 1] = found[0], found[1]
                picture.image[y, x] = picture.image[found[0], found[1]]
    return field


@compiled(nogil=True)
def _copy_matches(image, hole, field, start):
    out = image.copy()
    for y in range(hole.shape[0]):
        for x in range(hole.shape[1]):
            if hole[y, x]:
                sy, sx = field[y, x, 0], field[y, x, 1]
                if sy >= 0:
                    out[y, x] = image[sy, sx]
                else:
                    out[y, x] = start[y, x]
    return out
