"""`vico check-agent`: whether an agent of one's own keeps the contract."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import tyro
from tyro.conf import Positional

from vico.errors import InputError, VicoError
from vico.version import __version__

_HALF = 150.0  # metres: houses, shops with rooms, people, and a street that cars can drive on


def check_agent(
    agent: Positional[Annotated[str, tyro.conf.arg(metavar="MODULE:NAME")]],
    world: Path | None = None,
    steps: int = 40,
    seed: int = 0,
    deadline: float = 1.0,
    in_process: bool = False,
    json: bool = False,
) -> int:
    """Check that an agent of yours keeps the contract, a line a finding. Exit 1 if anything is wrong.

    It is made in a process of its own, it answers with actions and in time, it repeats itself, one restored from its
    state goes on as it does, it leaves what it is given as it is, and it does not reach for what it is not given.

    Example: vico check-agent my_agents:Walker

    Args:
        agent: my_module:MyAgent, or path/to/file.py:MyAgent.
        world: World folder it plays an assistant in; a small one of the packaged place without.
        steps: How long, seconds.
        seed: Of the simulation and the agent.
        deadline: Seconds an action may take.
        in_process: Ask it in this process instead, for a debugger; nothing is watched then.
        json: Print JSON.
    """
    from dataclasses import asdict

    from vico.cli.console import print_json
    from vico.runner.check import check_agent as findings_of
    from vico.world.folder import read_world

    if steps < 2:
        raise InputError(f"check-agent: --steps {steps}; it has to be 2 or more")
    if not deadline > 0:
        raise InputError(f"check-agent: --deadline {deadline:g}; give seconds above 0")
    found = findings_of(
        agent,
        read_world(world or small_world()),
        steps=steps,
        seed=seed,
        deadline=deadline,
        isolate=not in_process,
    )
    if json:
        print_json(
            {
                "agent": agent,
                "ok": not found.findings,
                "findings": [asdict(finding) for finding in found.findings],
                "actions": found.types,
                "median_ms": round(found.median_ms, 3),
            }
        )
        return 1 if found.findings else 0
    for finding in found.findings:
        print(f"{finding.promise}{', ' + finding.where if finding.where else ''}: {' '.join(finding.what.split())}")
    if not found.findings:
        types = ", ".join(f"{kind} {count}" for kind, count in sorted(found.types.items()))
        print(f"{agent}: keeps the contract; {found.median_ms:.2f} ms an action ({types})")
    return 1 if found.findings else 0


def small_world() -> Path:
    """Return a small world of the packaged place; it is built into the user's cache, once, and a line says so."""
    from vico.io.cache import cache_folder
    from vico.world.folder import read_world
    from vico.world.model import VERSION
    from vico.worldgen.pipeline import build_world
    from vico.worldgen.request import BuildOptions, packaged_extract

    extract = packaged_extract()
    folder = cache_folder() / "worlds" / f"{extract.name}-{2 * _HALF:.0f}m-{__version__}-{VERSION}"
    try:
        read_world(folder)
    except VicoError:
        print(f"building a small world of {extract.name}, once, in {folder}", file=sys.stderr, flush=True)
        options = BuildOptions(previews=False)
        build_world(
            extract.path, lat=extract.lat, lon=extract.lon, half=_HALF, seed=0, out=folder, force=True, options=options
        )
    return folder
