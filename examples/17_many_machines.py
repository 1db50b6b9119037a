"""Share out work of your own to processes or to a Ray cluster: a survey of worlds.

    python examples/17_many_machines.py helsinki monaco --workers 2
    python examples/17_many_machines.py helsinki monaco --ray            # the extra "ray"

What is done to each world is a function of a module, named by a string, so that every process and every machine can
find it. docs/many_machines.md tells the rest.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from vico.jobs import Answer, Service, Task, open_executor
from vico.world.folder import read_world


def surveyor(options: Mapping[str, Any], tell: object) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    """Return what surveys a world; each process calls this once."""
    unit = options["square_metres"]

    def survey(task: Mapping[str, Any]) -> dict[str, Any]:
        world = read_world(Path(task["world"]))
        walkable = float(world.walkable.connected.sum()) * world.walkable.cell**2
        return {"name": world.manifest.name, "buildings": len(world.buildings), "walkable": walkable / unit}

    return survey


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", type=Path, nargs="+")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--ray", nargs="?", const="auto")
    arguments = parser.parse_args()

    def done(index: int, answer: Answer) -> None:
        found = answer.content
        if found is None:
            print(f"{arguments.worlds[index]}: {answer.reason}")
        else:
            print(f"{found['name']}: {found['buildings']} buildings, {found['walkable']:.2f} ha to walk on")

    service = Service("17_many_machines:surveyor", {"square_metres": 10_000})
    tasks = [Task({"world": str(path)}) for path in arguments.worlds]
    with open_executor(workers=arguments.workers, ray=arguments.ray) as executor:
        executor.run(service, tasks, done=done)


if __name__ == "__main__":
    main()
