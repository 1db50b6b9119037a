"""How building a city, and running in it, grow with its area: squares of one region, the largest 5 km wide.

    python benchmarks/city_scale.py EXTRACT --center LAT,LON --half 600 --out OUT [--sizes 400 1200 2000 5000]
        [--table benchmarks/results/city_scale.md]

The region is EXTRACT laid side by side as often as the largest size asks for (`repeated_region.py`): no real map of
that size is at hand everywhere. Each size is built by two processes and run for some minutes with 200 residents, 80
vehicles and 100 pedestrians a square kilometre, nobody's views rendered. What is built is kept in OUT: the same command
goes on after a kill, and then counts only what was left to do; delete OUT for figures of whole builds.
"""

from __future__ import annotations

import argparse
import json
import math
import resource
import shutil
from pathlib import Path

from repeated_region import repeated
from reporting import machine, publish, vico

TILE, WORKERS, STEPS = 400, 2, 300
_RESIDENTS, _CARS, _PEDESTRIANS = 200, 80, 100


def measured(region: Path, center: str, size: int, out: Path) -> list[str]:
    """Build and run one size; return its row of the table."""
    city, people, run = (out / f"{name}_{size}" for name in ("city", "people", "run"))
    before = _processor_seconds()
    built = vico(
        "city", "build", "--osm", str(region), "--center", center, "--size", str(size), "--tile", str(TILE),
        "--out", str(city), "--workers", str(WORKERS), "--json",
    )  # fmt: skip
    seconds = _processor_seconds() - before
    tiles = json.loads(built.output)["tiles"]
    area = len(tiles) * (TILE / 1000) ** 2
    disk = sum(path.stat().st_size for path in city.rglob("*") if path.is_file()) / 1e6
    residents, cars, walkers = (max(1, round(area * each)) for each in (_RESIDENTS, _CARS, _PEDESTRIANS))
    shutil.rmtree(people, ignore_errors=True)
    vico("community", "build", str(city), "--residents", str(residents), "--out", str(people))
    ran = vico(
        "run", str(city), str(people), "--out", str(run), "--steps", str(STEPS), "--cars", str(cars),
        "--pedestrians", str(walkers), "--robots", "none", "--observe", "none", "--force", "--json",
    )  # fmt: skip
    told = json.loads(ran.output)
    return [
        f"{area:.2f}",
        str(len(tiles)),
        f"{built.seconds / 60:.1f}",
        f"{seconds / area:.0f}",
        f"{built.peak_mb:.0f}",
        f"{disk / area:.0f}",
        f"{residents}, {cars}, {walkers}",
        f"{told['real_time_factor']:.2f}",
        f"{told['peak_rss_mb']:.0f}",
        str(told["state_hash"])[:8],
    ]


def _processor_seconds() -> float:
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def main() -> None:
    """Measure and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("extract", type=Path)
    parser.add_argument("--center", required=True, help="of what is copied, LAT,LON")
    parser.add_argument("--half", type=float, default=600.0, help="half the side of what is copied, metres")
    parser.add_argument("--sizes", type=int, nargs="+", default=[400, 1200, 2000])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--table", type=Path)
    arguments = parser.parse_args()
    about = machine()
    arguments.out.mkdir(parents=True, exist_ok=True)
    lat, lon = map(float, arguments.center.split(","))
    copies = 2 * math.ceil((max(arguments.sizes) / (2 * arguments.half) - 1) / 2) + 1
    region = arguments.out / "region.osm.pbf"
    repeated(arguments.extract, region, lat=lat, lon=lon, half=arguments.half, copies=copies)
    rows = [measured(region, arguments.center, size, arguments.out) for size in sorted(arguments.sizes)]
    head = (
        "km2", "tiles", "minutes to build", "processor s a km2", "peak MB of a process", "MB on disk a km2",
        "residents, vehicles, walkers", "times real time", "peak MB", "state hash",
    )  # fmt: skip
    publish(
        [
            "# Cities by their area",
            "",
            about,
            "",
            f"{arguments.extract.name}, laid side by side {copies} x {copies} times; tiles of {TILE} m; {WORKERS} "
            f"processes; runs of {STEPS} steps from eight in the morning, nobody's views rendered.",
            "",
            f"| {' | '.join(head)} |",
            f"|{'---:|' * len(head)}",
            *(f"| {' | '.join(row)} |" for row in rows),
        ],
        arguments.table,
    )


if __name__ == "__main__":
    main()
