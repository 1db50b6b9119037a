"""Build the worlds of a list, one after the other or side by side; worlds that are there are kept.

    python benchmarks/worlds.py --list standard --places EXTRACTS --out WORLDS [--workers 1] [--only helsinki_b,...]
    python benchmarks/worlds.py --list reduced --out WORLDS          # of the packaged map alone

`--show` prints the list with the overlaps of its windows instead. Lists are data: docs/evaluation.md.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from vico.challenges.windows import PACKAGED_MAP, Window, WindowList, overlaps, window_list
from vico.errors import VicoError
from vico.worldgen.batch import Outcome, PlaceRow, build_many
from vico.worldgen.request import map_for


def locate(lat: float, lon: float, half: float) -> Path:
    """Return the packaged extract; no server is asked."""
    return map_for(lat, lon, half, source=None)


def row_of(window: Window, places: Path | None) -> PlaceRow:
    """Return what `build_many` is told of a window."""
    if window.osm != PACKAGED_MAP and places is None:
        sys.exit(f"{window.name}: needs the extract {window.osm}; say with --places in which folder it lies")
    osm = "" if places is None or window.osm == PACKAGED_MAP else str(places / window.osm)
    dem = "" if places is None else ";".join(str(places / name) for name in window.dem)
    return PlaceRow(window.name, window.lat, window.lon, osm=osm, radius=window.radius, dem=dem, seed=window.seed)


def show(windows: WindowList) -> None:
    """Print the windows, and which overlap."""
    print(windows.about)
    for window in windows.windows:
        print(f"{window.name:<18} {window.lat:9.5f} {window.lon:10.5f}  {2 * window.radius:.0f} m wide  {window.osm}")
    for first, second, share in overlaps(windows):
        print(f"{first} and {second} share {100 * share:.1f} %")


def tell(outcome: Outcome, *_: int) -> None:
    """Say what became of a world."""
    what = outcome.reason or f"{outcome.buildings} buildings, {outcome.places} places, {outcome.seconds:.1f} s"
    print(f"{outcome.name}: {outcome.state}: {what}", flush=True)


def main() -> int:
    """Build them; 1 if one failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", default="standard")
    parser.add_argument("--places", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--only", default="", help="names, separated by commas")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--show", action="store_true")
    arguments = parser.parse_args()
    try:
        windows = window_list(arguments.list)
        if arguments.show:
            show(windows)
            return 0
        if arguments.out is None:
            parser.error("--out is needed")
        names = [name for name in arguments.only.split(",") if name]
        if unknown := set(names) - {window.name for window in windows.windows}:
            parser.error(f"--only: no window called {', '.join(sorted(unknown))} in the list {arguments.list}")
        rows = [row_of(w, arguments.places) for w in windows.windows if not names or w.name in names]
        outcomes = build_many(rows, arguments.out, locate=locate, workers=arguments.workers, finished=tell)
    except VicoError as error:
        print(error, file=sys.stderr)
        return 2
    return 1 if any(outcome.state == "failed" for outcome in outcomes) else 0


if __name__ == "__main__":
    sys.exit(main())
