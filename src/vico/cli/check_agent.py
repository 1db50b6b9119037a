"""`vico check-agent`: whether an agent of one's own keeps the contract."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from vico.cli.output import print_json
from vico.cli.small_world import small_world
from vico.errors import InputError
from vico.runner.check import check_agent
from vico.world.folder import read_world


def check(agent: str, *, world: Path | None, steps: int, seed: int, deadline: float, isolate: bool, json: bool) -> int:
    """Let an agent play an assistant in a world; say what is wrong, a line a finding; 1 if anything is.

    Parameters
    ----------
    world
        None for a small one of the packaged place.
    """
    if steps < 2:
        raise InputError(f"check-agent: --steps {steps}; it has to be 2 or more")
    if not deadline > 0:
        raise InputError(f"check-agent: --deadline {deadline:g}; give seconds above 0")
    found = check_agent(
        agent, read_world(world or small_world()), steps=steps, seed=seed, deadline=deadline, isolate=isolate
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
