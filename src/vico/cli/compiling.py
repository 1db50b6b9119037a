"""Compile what a command is going to need in processes of their own, while it reads, fetches and builds.

Compiling holds the interpreter, so threads would wait for each other. Processes share what they compile through the
cache folder: whoever needs what another is compiling waits for that function alone (`vico.io.compiled`).
"""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.process import BaseProcess

import numpy as np

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
    """Compile parts, one after another, by doing a little of each; who needs what fails is told."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started this process ends it
    for part in parts:
        with suppress(Exception):
            _pictures() if part == "pictures" else _people()


def _pictures() -> None:
    from vico.render.frames import warm_up

    warm_up()


def _people() -> None:
    from vico.assets.people import body_of, passer_by
    from vico.render.skinning import batch_bodies, skin
    from vico.sim.animation import clip_index, pose, style_of

    bodies = [body_of(passer_by(look)) for look in range(2)]
    level = np.zeros(2)
    rotations, offsets = pose(
        np.full(2, clip_index("walk")), level, level + 1.0, np.stack([style_of(b) for b in bodies])
    )
    skin(batch_bodies(bodies, range(1, 3)), rotations, offsets, np.zeros((2, 3)), level)
