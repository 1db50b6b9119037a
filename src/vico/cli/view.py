"""`vico view`: a recorded run in the browser, also while it is still being written."""

from __future__ import annotations

import webbrowser
from collections.abc import Sequence
from pathlib import Path

from vico.cli.live import city_of, told, wait_for_interrupt
from vico.cli.output import print_json
from vico.viewer.server import require_server


def view(path: Path, *, world: Path | None, port: int, hosts: Sequence[str] = (), browser: bool, json: bool) -> int:
    """Show a run until Ctrl+C.

    Parameters
    ----------
    path
        Run folder.
    world
        The world it ran in, if it is no longer where it was.
    port
        To listen on; 0 takes the one it was shown on before, or a free one.
    hosts
        Names of hosts, beside this machine's own, under which the page is shown.
    browser
        Open it there.
    json
        Print the address as JSON.
    """
    require_server()
    from vico.viewer.server.serve import ViewerServer
    from vico.viewer.server.state import ViewerState
    from vico.viewer.sources.source import Source
    from vico.viewer.sources.views import RecordedViews

    source = Source.recorded(path, world=world)
    run = source.tables.run
    assert run is not None
    city = None if source.world is None else city_of(source.world)
    with ViewerServer(
        ViewerState(source, RecordedViews(run).view, city=city), port=port, keep=path, hosts=hosts
    ) as server:
        if json:
            print_json({"url": server.url})
        else:
            told(server.url)
        if browser:
            webbrowser.open(server.url)
        wait_for_interrupt(f"{path}: steps 0 to {source.last}; Ctrl+C ends")
    return 0
