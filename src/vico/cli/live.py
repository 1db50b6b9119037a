"""What the verbs that show a run have in common: the viewer's server, its address, and waiting for Ctrl+C."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from vico.cli.options import RunOptions
from vico.errors import InputError
from vico.runner.control import FASTEST, Control
from vico.viewer.server import require_server
from vico.world.world import World

if TYPE_CHECKING:
    from vico.viewer.live import LiveViewer
    from vico.viewer.play import PlayedAgent

#: Options of a run that decide how it is shown, and nothing in it.
LIVE = ("live", "speed", "paused", "port", "allow_host")


@contextmanager
def live_viewer(
    options: RunOptions, world: World, control: Control | None, player: PlayedAgent | None = None
) -> Iterator[LiveViewer]:
    """Show a run while the block lasts.

    Raises
    ------
    MissingExtraError
        If the server is not installed.
    InputError
        If the speed is out of range.
    """
    require_server()
    if not 0 <= options.speed <= FASTEST:
        raise InputError(f"run: --speed {options.speed:g}; it has to be 0 to {FASTEST:g}")
    assert control is not None
    from vico.viewer.live import LiveViewer

    with LiveViewer(
        control, world, city=city_of(world), player=player, port=options.port, hosts=options.allow_host
    ) as viewer:
        viewer.announce = told
        yield viewer


def city_of(world: World) -> Path:
    """Return the folder of a world's files for the page; made the first time, which takes some seconds."""
    from vico.viewer.city import city_folder

    print("making the city's files for the page ...", file=sys.stderr, flush=True)
    return city_folder(world)


def told(url: str) -> None:
    """Say where the page is; on stdout, for programs that start this one."""
    print(f"open in a browser on this machine:  {url}", flush=True)


def wait_for_interrupt(sentence: str) -> None:
    """Wait until Ctrl+C; say for what."""
    print(sentence, file=sys.stderr, flush=True)
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        print("", file=sys.stderr)
