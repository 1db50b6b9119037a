"""Compile what a command is going to need in processes of their own, while it reads, fetches and builds.

Compiling holds the interpreter, so threads would wait for each other. Processes share compiled code through the cache
folder: a process waits for a function that another one is compiling (`vico.io.compiled`).
"""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.process import BaseProcess
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled_folder
from vico.threads import workers

#: What can be compiled ahead, the biggest first, and a module whose code is there once it was.
PARTS = {"pictures": "vico.render.view", "people": "vico.sim.animation.clips"}


@contextmanager
def compiling_ahead(parts: Sequence[str] = tuple(PARTS), *, to_the_end: bool = False) -> Iterator[None]:
    """Compile parts that are not in the cache beside what the block does, with the processors that are left.

    Parameters
    ----------
    parts
        Of `PARTS`.
    to_the_end
        Wait for them at the end of the block; else what is not done by then is given up.
    """
    folder = compiled_folder()
    wanted = [part for part in parts if not (folder / PARTS[part]).is_dir()]
    at_once = min(len(wanted), workers() - 1)
    context = multiprocessing.get_context("spawn")  # a fork would have this process's threads' locks, and no threads
    beside: list[BaseProcess] = [
        context.Process(target=compile_parts, args=(wanted[first::at_once],), daemon=True) for first in range(at_once)
    ]
    for process in beside:
        process.start()
    try:
        yield
        for process in beside if to_the_end else ():
            process.join()
    finally:
        for process in beside:
            process.terminate()  # it writes whole files or none, and lets go of its locks


def compile_parts(parts: Sequence[str]) -> None:
    """Compile parts, one after another, by doing a little of each; a failure shows where the part is really needed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started this process ends it
    for part in parts:
        with suppress(Exception):
            _pictures() if part == "pictures" else _people()


def _pictures() -> None:
    from vico.render.frames import warm_up
    from vico.render.skinning import batch_bodies, skin

    warm_up()
    bodies, rotations, offsets = _two_who_walk()
    skin(batch_bodies(bodies, range(1, 3)), rotations, offsets, np.zeros((2, 3)), np.zeros(2))


def _people() -> None:
    _two_who_walk()


def _two_who_walk() -> tuple[list[Any], NDArray[Any], NDArray[Any]]:
    """Return two bodies, the rotations of their joints and their offsets."""
    from vico.assets.people import body_of, passer_by
    from vico.sim.animation import clip_index, pose, style_of

    bodies = [body_of(passer_by(look)) for look in range(2)]
    start = np.zeros(2)
    styles = np.stack([style_of(body) for body in bodies])
    rotations, offsets = pose(np.full(2, clip_index("walk")), start, start + 1.0, styles)
    return bodies, rotations, offsets
