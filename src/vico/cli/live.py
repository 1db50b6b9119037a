"""The viewer's server for verbs that show a run: its address, and waiting for Ctrl+C."""

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
LIVE = ("live", "speed", "paused", "port", "allow_host", "idle")

#: The longest that a run may be asked to go on without a page before it waits, seconds.
MOST_IDLE = 1_000_000


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
    if not 0 <= options.idle <= MOST_IDLE:
        raise InputError(f"run: --idle {options.idle:g}; it has to be 0 to {MOST_IDLE}")
    assert control is not None
    from vico.viewer.live import LiveViewer

    with LiveViewer(
        control,
        world,
        city=city_of(world),
        player=player,
        port=options.port,
        hosts=options.allow_host,
        idle=options.idle,
    ) as viewer:
        viewer.announce = print_address
        viewer.announce_idle = _print_idle
        yield viewer


def city_of(world: World) -> Path:
    """Return the folder of a world's files for the page; made the first time, which takes some seconds."""
    from vico.viewer.city import city_folder

    return city_folder(world, making=lambda: print("making the city's files for the page ...", file=sys.stderr))


def print_address(url: str) -> None:
    """Say where the page is; on stdout, for programs that start this one."""
    print(f"open in a browser on this machine:  {url}", flush=True)


def _print_idle(second: float) -> None:
    """Say that the run waits because no page is there."""
    hours, minutes = int(second // 3600) % 24, int(second // 60) % 60
    print(
        f"nobody has the page open: the run waits at {hours:02d}:{minutes:02d} until somebody has "
        "(--idle 0: it never waits)",
        file=sys.stderr,
        flush=True,
    )


def wait_for_interrupt(sentence: str) -> None:
    """Wait until Ctrl+C; say for what."""
    print(sentence, file=sys.stderr, flush=True)
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        print("", file=sys.stderr)
