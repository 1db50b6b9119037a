"""Rectangles on square pages, packed along a skyline."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled


def pack(cells: NDArray[np.int64], page: int) -> NDArray[np.int64]:
    """Place rectangles (width, height) on pages: page, x, y of each; the highest first, each as low as it goes."""
    order = np.lexsort((np.arange(len(cells)), -cells[:, 0], -cells[:, 1]))
    return _skyline(cells, order, page) if len(cells) else np.zeros((0, 3), np.int64)


@compiled(nogil=True)
def _skyline(cells, order, page):  # type: ignore[no-untyped-def]
    places = np.zeros((len(cells), 3), np.int64)
    tops = np.zeros((len(cells), page), np.int32)
    pages = 1
    queue = np.zeros(page, np.int64)
    for index in order:
        w, h = cells[index]
        k = 0
        while True:
            top = tops[k]
            best, best_x = page + 1, -1
            head, tail = 0, 0
            for x in range(page):
                while tail > head and top[queue[tail - 1]] <= top[x]:
                    tail -= 1
                queue[tail] = x
                tail += 1
                left = x - w + 1
                if left >= 0:
                    if queue[head] < left:
                        head += 1
                    if top[queue[head]] < best:
                        best, best_x = top[queue[head]], left
            if best + h <= page:
                places[index] = k, best_x, best
                top[best_x : best_x + w] = best + h
                break
            k += 1
            pages = max(pages, k + 1)
    return places
