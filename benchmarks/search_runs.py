"""Search for runs that must not be: random people, traffic, robots and weather in worlds that are given.

    python benchmarks/search_runs.py helsinki london --count 60     # worlds take turns
    python benchmarks/search_runs.py --run 'helsinki:7:300'         # one again, as a failure was printed

A run fails if it ends in a traceback or a refusal, if anything overlaps in any sub-step, if an agent that comes with
the package is at fault, or if its last steps, gone through again from a snapshot, give another hash. What is only worth
a look is printed below it: who got nowhere, who was taken out of a jam, who stood in one at the end, robots that lie on
the ground. Exits 1 if any failed.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from random_runs import Drawn, try_run


def main() -> int:
    """Search."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", type=Path, nargs="*", help="world folders")
    parser.add_argument("--count", type=int, default=20, help="how many runs")
    parser.add_argument("--first", type=int, default=0, help="number of the first, to go on with a search")
    parser.add_argument("--steps", type=int, default=300, help="seconds a run simulates")
    parser.add_argument("--run", action="append", default=[], help="a run as a failure was printed; any number")
    parser.add_argument("--traceback", action="store_true", help="print tracebacks whole")
    given = parser.parse_args()
    os.nice(int(os.environ.get("SEARCH_NICE", "10")))
    runs = [Drawn.parse(text) for text in given.run]
    if given.worlds:
        numbers = range(given.first, given.first + given.count)
        runs += [Drawn(given.worlds[k % len(given.worlds)], k, given.steps) for k in numbers]
    failed = 0
    for run in runs:
        outcome = try_run(run)
        failed += outcome.state not in ("fine", "empty")
        print(f"{outcome.state}: --run '{run}'  {outcome.seconds:.0f} s")
        for line in [f"    ! {what}" for what in outcome.what] + [f"    . {note}" for note in outcome.notes[:12]]:
            print(line)
        print(outcome.detail if given.traceback else "", end="", flush=True)
    print(f"{len(runs)} runs, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
