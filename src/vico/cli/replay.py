"""`vico replay`: the page and the film of a recorded run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.cli.output import progress_bars
from vico.errors import MissingFileError, SchemaError
from vico.render import render_top_down
from vico.render.world_scene import scene_of
from vico.sim.recording import read_run
from vico.sim.recording.schema import DEMO_FILM, REPLAY
from vico.viewer.demo_film import write_demo_film
from vico.viewer.from_run import recording_of
from vico.viewer.replay import write_replay
from vico.world.folder import is_world, read_world
from vico.world.world import World
from vico.worldgen.previews.viewpoints import Overhead


def replay(path: Path, *, film: bool = True, world: Path | None = None) -> int:
    """Write ``replay.html`` (and ``demo.mp4``) into the run's folder.

    Parameters
    ----------
    world
        The world it ran in, if it is no longer where it was.
    """
    run = read_run(path)
    folder = world or run.source("world")
    if not is_world(folder):
        raise MissingFileError(f"{path}: its world is no longer at {folder}; say where it is with --world")
    place = read_world(folder)
    recording = recording_of(run)
    with progress_bars() as report:
        report("ground picture", 0, 1)
        picture = _from_above(place, folder)
        report("ground picture", 1, 1)
        report("replay page", 0, 1)
        write_replay(path / REPLAY, recording, place, picture=picture)
        report("replay page", 1, 1)
        if film and recording.views:
            report("film", 0, 1)
            write_demo_film(path / DEMO_FILM, recording, place)
            report("film", 1, 1)
    print(path / "replay.html")
    return 0


def _from_above(world: World, folder: Path) -> NDArray[np.uint8]:
    """Return the picture the world was built with; taken now where it was built without pictures."""
    kept = folder / "previews" / "above.png"
    if kept.is_file():
        try:
            with Image.open(kept, formats=("PNG",)) as image:
                return np.asarray(image.convert("RGB"))
        except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
            raise SchemaError(f"{kept}: not a readable picture ({error}); build the world anew") from None
    return render_top_down(scene_of(world, rooms=False), world.half, Overhead().side)
