"""How building a city, and running in it, grow with its area: squares of one region, the largest 5 km wide.

    python benchmarks/city_scale.py EXTRACT --center LAT,LON --half 600 --out OUT [--sizes 400 1200 2000 5000]
        [--table benchmarks/results/city_scale.md]

The region is EXTRACT laid side by side as often as the largest size asks for (`repeated_region.py`): no real map of
that size is at hand everywhere. Each size is built by two processes and run for some minutes with 185 residents, 74
vehicles and 20 pedestrians a square kilometre, or as many as a run can have, nobody's views rendered. What is built,
and how long it took, is kept in OUT, so the same command goes on after a kill: a build that was cut short counts only
what was left to do. Delete OUT to measure anew.
"""

from __future__ import annotations

import argparse
import json
import math
import resource
from pathlib import Path

from repeated_region import repeated
from reporting import machine, publish, vico

from vico.sim.config import LIMITS

TILE, WORKERS, STEPS = 400, 2, 300
# A square kilometre: 5,000 residents and 2,000 vehicles in 27 of them.
_RESIDENTS, _CARS, _PEDESTRIANS = 185, 74, 20


def measured(region: Path, center: str, size: int, out: Path) -> list[str]:
    """Build and run one size; return its row of the table."""
    city, people, run = (out / f"{name}_{size}" for name in ("city", "people", "run"))
    known = out / f"built_{size}.json"
    if not known.exists():
        known.write_text(json.dumps(_built(region, center, size, city)))
    built = json.loads(known.read_text())
    area = built["tiles"] * (TILE / 1000) ** 2
    disk = sum(path.stat().st_size for path in city.rglob("*") if path.is_file()) / 1e6
    residents = max(1, round(area * _RESIDENTS))
    cars = min(max(1, round(area * _CARS)), LIMITS["cars"])
    walkers = min(max(1, round(area * _PEDESTRIANS)), LIMITS["pedestrians"])
    if not people.exists():
        vico("community", "build", str(city), "--residents", str(residents), "--out", str(people))
    ran = vico(
        "run", str(city), str(people), "--out", str(run), "--steps", str(STEPS), "--cars", str(cars),
        "--pedestrians", str(walkers), "--robots", "none", "--observe", "none", "--force", "--json",
    )  # fmt: skip
    told = json.loads(ran.output)
    return [
        f"{area:.2f}",
        str(built["tiles"]),
        f"{built['seconds'] / 60:.1f}",
        f"{built['processor_seconds'] / area:.0f}",
        f"{built['peak_mb']:.0f}",
        f"{disk / area:.0f}",
        f"{residents}, {cars}, {walkers}",
        f"{told['real_time_factor']:.2f}",
        f"{told['peak_rss_mb']:.0f}",
        str(told["state_hash"])[:8],
    ]


def _built(region: Path, center: str, size: int, city: Path) -> dict[str, float]:
    before = _processor_seconds()
    built = vico(
        "city", "build", "--osm", str(region), "--center", center, "--size", str(size), "--tile", str(TILE),
        "--out", str(city), "--workers", str(WORKERS), "--json",
    )  # fmt: skip
    return {
        "tiles": len(json.loads(built.output)["tiles"]),
        "seconds": built.seconds,
        "processor_seconds": _processor_seconds() - before,
        "peak_mb": built.peak_mb,
    }


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
    head = (
        "km2", "tiles", "minutes to build", "processor s a km2", "peak MB of a process", "MB on disk a km2",
        "residents, vehicles, walkers", "times real time", "peak MB", "state hash",
    )  # fmt: skip
    lines = [
        "# Cities by their area",
        "",
        about,
        "",
        f"{arguments.extract.name}, laid side by side {copies} x {copies} times; tiles of {TILE} m; {WORKERS} "
        f"processes; runs of {STEPS} steps from eight in the morning, nobody's views rendered.",
        "",
        f"| {' | '.join(head)} |",
        f"|{'---:|' * len(head)}",
    ]
    for size in sorted(arguments.sizes):
        lines.append(f"| {' | '.join(measured(region, arguments.center, size, arguments.out))} |")
        publish(lines, arguments.table)  # what is measured is kept though a larger size fails


if __name__ == "__main__":
    main()
