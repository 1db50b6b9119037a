"""The verbs that open a page: `vico view`, `vico live` and `vico play`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro
from tyro.conf import Positional

from vico.cli.options import Hosts
from vico.cli.viewer_options import LiveOptions, PlayOptions

_FLAT = tyro.conf.arg(name="")


def view(
    path: Positional[Path],
    world: Path | None = None,
    port: int = 0,
    allow_host: Hosts = (),
    browser: bool = False,
    json: bool = False,
) -> int:
    """Show a recorded run in a browser on this machine; also one that is still being written.

    Example: vico view morning

    Example: vico view morning --port 8123 --browser

    Args:
        path: Run folder.
        world: The world it ran in, if it is no longer where it was.
        port: Where the page is; 0 takes the one it was shown on before, or a free one.
        allow_host: A name, beside this machine's own, under which a proxy or a forwarded port shows the page; may be
            given several times.
        browser: Open it in the browser.
        json: Print the address as JSON.
    """
    from vico.cli import view as verb

    return verb.view(path, world=world, port=port, hosts=allow_host, browser=browser, json=json)


def live(options: Annotated[LiveOptions, _FLAT]) -> int:
    """Start a simulation with a page beside it, from which it can be paused, looked into and changed.

    Example: vico live helsinki people

    Example: vico live helsinki people --robots husky,drone --agent my_module:MyAgent --speed 10
    """
    from vico.cli import run as verb

    return verb.run(options.run_options())


def play(options: Annotated[PlayOptions, _FLAT]) -> int:
    """Walk through a world among its people, from a page in the browser; or do a task there, and be judged.

    Example: vico play helsinki people

    Example: vico play helsinki people --as resident_3

    Example: vico play helsinki people --robots drone --as robot_0

    Example: vico play helsinki --task delivery --seed 0
    """
    from vico.cli import play as verb

    return verb.play(options)
