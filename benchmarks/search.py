"""Search for maps that the world generator can't cope with: random windows, plain and damaged, built and checked.

    python benchmarks/search.py --count 300                    # windows of the extracts as they are
    python benchmarks/search.py --count 300 --damaged          # with broken outlines, streets and tags
    python benchmarks/search.py --window 'FILE:LAT,LON,...'    # one again, as a failure was printed
    python benchmarks/search.py --again failures.json          # all that failed

Prints each failure as it is found, with the words that reproduce it, then how many there are of each kind and the
seconds a window takes. Exits 1 if any build ended in a traceback or a refusal, or any world has a finding.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from damaged_maps import DAMAGES
from random_windows import Trial, Window, extracts, failures, kinds_of, middle_of, random_window, try_window
from vico.threads import WORKERS


def _gently() -> None:
    """Let whoever else works on this machine go first."""
    os.environ[WORKERS] = "1"
    os.nice(int(os.environ.get("SEARCH_NICE", "10")))


def _chosen(given: argparse.Namespace) -> list[Window]:
    if given.window:
        return [Window.parse(text) for text in given.window]
    if given.again:
        return [Window.parse(text) for text in json.loads(given.again.read_text())]
    places = [path for path in extracts() if not given.places or path.parent.name in given.places.split(",")]
    low, high = given.radius
    windows = [
        random_window(k, seed=given.seed, damaged=given.damaged, places=places, radius=(low, high))
        for k in range(given.first, given.first + given.count)
    ]
    if given.damage:
        names = tuple(given.damage.split("+"))
        windows = [Window(w.extract, w.lat, w.lon, w.half, names, w.seed) for w in windows]
    return windows


def _told(trial: Trial) -> None:
    print(f"{trial.state}: --window '{trial.window}'")
    for line in trial.what[:6]:
        print(f"    {line}")
    if len(trial.what) > 6:
        print(f"    and {len(trial.what) - 6} more")
    sys.stdout.flush()


def main() -> int:
    """Search."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60, help="how many windows")
    parser.add_argument("--first", type=int, default=0, help="number of the first, to go on with a search")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--radius", type=int, nargs=2, default=(60, 150), metavar=("LEAST", "MOST"), help="metres")
    parser.add_argument("--damaged", action="store_true", help="damage each map in one to three ways")
    parser.add_argument("--damage", help=f"in these ways, joined by +: {', '.join(DAMAGES)}")
    parser.add_argument("--places", help="only extracts in folders of these names, separated by commas")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--window", action="append", help="a window as a failure was printed; any number")
    parser.add_argument("--again", type=Path, help="a file that --failures wrote")
    parser.add_argument("--failures", type=Path, help="write the failing windows here")
    parser.add_argument("--keep", type=Path, help="with one window: leave map and world in this folder")
    parser.add_argument("--traceback", action="store_true", help="print tracebacks whole")
    given = parser.parse_args()
    windows = _chosen(given)
    start, trials = time.perf_counter(), []
    if given.processes <= 1:
        _gently()
        for window in windows:
            trials.append(try_window(window, given.keep))
            if failures(trials[-1:]):
                _told(trials[-1])
                print(trials[-1].detail if given.traceback else "", end="", flush=True)
    else:
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(given.processes, mp_context=context, initializer=_gently) as pool:
            for done in as_completed([pool.submit(try_window, window) for window in windows]):
                trials.append(done.result())
                if failures(trials[-1:]):
                    _told(trials[-1])
    for kind, count in kinds_of(trials).items():
        print(f"{count:5d} x {kind}")
    bad = failures(trials)
    empty = sum(trial.state == "empty" for trial in trials)
    seconds = [trial.seconds for trial in trials if trial.state != "empty"]
    built = len(seconds)
    print(
        f"{built} windows built ({empty} more are empty), {len(bad)} failed; median {middle_of(seconds):.1f} s, most "
        f"{max(seconds, default=0.0):.1f} s a window; {time.perf_counter() - start:.0f} s in all"
    )
    if given.failures:
        given.failures.write_text(json.dumps([str(trial.window) for trial in bad], indent=1))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
