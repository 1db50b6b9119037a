"""How long a world takes to build, stage by stage, and how much memory; how time grows with the radius; other cities.

    python benchmarks/world.py [--radius 400] [-n 3] [--before CHECKOUT] [--data FOLDER] [--keep FOLDER] [--table TABLE]

The packaged place, built anew each time in a process of its own. Stage seconds are wall time, as the world's own
``build.json`` tells them, and those of stages that a second process makes meanwhile are that one's; the last lines are
the whole command, imports and report included. With ``--before`` another version builds the same place in turn. With
``--data`` (a folder with ``places/NAME/NAME.osm.pbf``, and ``SOURCE.txt`` beside it that tells the centre) every place
there is built once, and one at several radii. No extract covers a radius of 800 m, so the largest are built from a map
that repeats it.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import tempfile
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import osmium
from reporting import machine, publish, row, vico

from vico.world.check import check_world
from vico.world.folder import read_world
from vico.worldgen.request import packaged_extract

GOAL = 90.0
# Averages of the paper's scenes (its tables "Average counts of object categories per scene", "Averaged number of
# annotated elements per scene" and, for faces, the one of visual fidelity), and which of our counts stands beside each.
PAPER_OBJECTS = (("amenity objects", 133, "amenity_objects"), ("natural objects", 357, "natural_objects"),
                 ("transit objects", 9, "transit"))  # fmt: skip
PAPER_ELEMENTS = (
    ("buildings", 53, "accessible_buildings"), ("places", 85, "places"), ("roads", 473, "roads"),
    ("junctions", 76, "junctions"), ("restaurants (food)", 25, "food"), ("stores", 21, "store"),
    ("accommodation", 16, "accommodation"), ("transit", 9, "transit"), ("offices", 8, "office"),
    ("entertainment", 5, "entertainment"), ("open places", 1, "open"),
    ("faces of the mesh (ours: for collision)", 376_000, "collision_faces"),
)  # fmt: skip
RADII = (200, 300, 400, 500, 600)
REPEATED = (600, 800)
APART = 1200.0  # metres between the copies of a map that is repeated


def places_in(data: Path) -> list[tuple[str, list[str]]]:
    """Every place that holds buildings: its name, and the options that tell where it is and what it is made from."""
    found = []
    for folder in sorted((data / "places").iterdir()):
        about = (folder / "SOURCE.txt").read_text()
        centre = re.search(r"centre lat,lon: (-?[\d.]+),(-?[\d.]+)", about)
        if centre is None or "no buildings" in about:
            continue
        words = ["--osm", str(folder / f"{folder.name}.osm.pbf"), "--center", f"{centre[1]},{centre[2]}"]
        words += ["--dem", str(folder / "dem_srtm.tif")] if (folder / "dem_srtm.tif").exists() else []
        feeds = sorted(folder.glob("gtfs*.zip"))
        words += ["--gtfs", *map(str, feeds)] if feeds else []
        found.append((folder.name, words))
    return found


def built(words: list[str], out: Path) -> tuple[dict[str, Any], float, float]:
    """Build a world: what it says of itself, seconds of the whole command, peak memory in MB."""
    child = vico("world", "build", *words, "--out", str(out), "--json")
    return json.loads(child.output), child.seconds, child.peak_mb


def beside_the_paper(facts: dict[str, Any], others: Sequence[dict[str, Any]]) -> list[str]:
    """Return the paper's two tables of scenes beside the packaged place and, where there are any, the other cities."""
    lines = []
    for title, rows in (("objects", PAPER_OBJECTS), ("annotated elements", PAPER_ELEMENTS)):
        head = f"| {title} | paper, mean of its scenes | {facts['name']} |"
        head += f" mean of {len(others)} other cities | least | greatest |" if others else ""
        lines += ["", f"## The paper's table of {title}, a scene", "", head, "|---" * (head.count("|") - 1) + "|"]
        for label, theirs, key in rows:
            line = f"| {label} | {theirs:,} | {_count(facts, key):,} |"
            if others:
                counts = [_count(other, key) for other in others]
                line += f" {np.mean(counts):,.0f} | {min(counts):,} | {max(counts):,} |"
            lines.append(line)
    return lines


def beside_before(
    now: Sequence[tuple[dict[str, Any], float]], before: Sequence[tuple[dict[str, Any], float]]
) -> list[str]:
    """Return a table of medians of this version and of the one before, stage by stage, built in turn."""
    lines = ["", f"## Beside the version before, built in turn, medians of {len(now)}", ""]
    lines += ["| stage | before s | now s | ratio |", "|---|---|---|---|"]
    names = [*before[0][0]["seconds"], *(name for name in now[0][0]["seconds"] if name not in before[0][0]["seconds"])]
    for name in (name for name in names if name != "total"):
        was, is_now = (
            [facts["seconds"][name] for facts, _ in runs if name in facts["seconds"]] for runs in (before, now)
        )
        lines.append(_ratio(name, was, is_now))
    return [*lines, _ratio("whole command", [s for _, s in before], [s for _, s in now])]


def _ratio(name: str, before: Sequence[float], now: Sequence[float]) -> str:
    if not before or not now:
        old, new = (f"{np.median(values):.2f}" if values else "" for values in (before, now))
        return f"| {name} | {old} | {new} | |"
    old, new = float(np.median(before)), float(np.median(now))
    return (
        f"| {name} | {old:.2f} | {new:.2f} | {new / old:.2f} |"
        if old >= 0.1
        else f"| {name} | {old:.2f} | {new:.2f} | |"
    )


def _count(facts: dict[str, Any], key: str) -> int:
    return int(facts[key]) if key in facts else int(facts["places_by_type"].get(key, 0))


def of_places(data: Path, scratch: Path, seen: list[dict[str, Any]]) -> list[str]:
    """Return a table of every place, once each; what each says of itself is added to `seen`."""
    lines = [
        "",
        "## Other cities, once each",
        "",
        "Findings are those of `vico check world`.",
        "",
        "| place | s | peak MB | world MB | buildings (accessible) | places | amenity | natural | transit | faces "
        "| findings |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, words in places_in(data):
        facts, seconds, peak = built(words, scratch / name)
        seen.append(facts)
        findings = check_world(read_world(scratch / name))
        for finding in findings:
            print(name, finding, file=sys.stderr)
        lines.append(
            f"| {name} | {seconds:.1f} | {peak:.0f} | {facts['megabytes']:.0f} | {facts['buildings']} "
            f"({facts['accessible_buildings']}) | {facts['places']} | {facts['amenity_objects']} | "
            f"{facts['natural_objects']} | {facts['transit']} | {facts['collision_faces']} | {len(findings)} |"
        )
    return lines


def of_radii(data: Path, scratch: Path) -> list[str]:
    """How time grows with the window: in an extract, and in a map that repeats it."""
    words = dict(places_in(data))["helsinki"]
    lines = [
        "",
        "## Time against size: Helsinki",
        "",
        "Repeated: the extract four times, two by two, 1.2 km apart, fields between: none covers 1.6 km.",
        "",
        "| radius m | map | s | s per ha | peak MB | world MB | buildings | places | faces |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [_of_size(words, "extract", radius, scratch) for radius in RADII]
    extract = Path(words[words.index("--osm") + 1])
    lat, lon = map(float, words[words.index("--center") + 1].split(","))
    north, east = APART / 111_320.0, APART / (111_320.0 * float(np.cos(np.radians(lat))))
    repeated(extract, scratch / "repeated.osm.pbf", north=north, east=east)
    words = ["--osm", str(scratch / "repeated.osm.pbf"), "--center", f"{lat + north / 2},{lon + east / 2}"]
    return lines + [_of_size(words, "repeated", radius, scratch) for radius in REPEATED]


def _of_size(words: Sequence[str], label: str, radius: float, scratch: Path) -> str:
    facts, seconds, peak = built([*words, "--radius", str(radius)], scratch / f"{label}{radius}")
    return (
        f"| {radius} | {label} | {seconds:.1f} | {seconds / (4 * radius**2 / 1e4):.2f} | {peak:.0f} | "
        f"{facts['megabytes']:.0f} | {facts['buildings']} | {facts['places']} | {facts['collision_faces']} |"
    )


def repeated(path: Path, out: Path, *, north: float, east: float) -> None:
    """Write a map four times, two by two, `north` and `east` degrees apart."""
    step = 10**12  # between the ids of two copies, far above any of OpenStreetMap's
    copies = [(k * step, k // 2 * north, k % 2 * east) for k in range(4)]
    out.unlink(missing_ok=True)
    with osmium.SimpleWriter(str(out)) as writer:
        for kind in (osmium.osm.NODE, osmium.osm.WAY, osmium.osm.RELATION):
            for first, up, right in copies:
                for thing in osmium.FileProcessor(str(path), kind):
                    new: dict[str, Any] = {"id": thing.id + first}
                    if thing.is_node():
                        new["location"] = (thing.location.lon + right, thing.location.lat + up)
                    elif thing.is_way():
                        new["nodes"] = [node.ref + first for node in thing.nodes]
                    else:
                        new["members"] = [(m.type, m.ref + first, m.role) for m in thing.members]
                    writer.add(thing.replace(**new))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--radius", type=float, default=400.0)
    parser.add_argument("-n", type=int, default=3, help="builds")
    parser.add_argument("--before", type=Path, help="another checkout, to compare with")
    parser.add_argument("--data", type=Path, help="folder with more places")
    parser.add_argument("--keep", type=Path, help="empty folder to keep the worlds in")
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    place, about = packaged_extract(), machine()
    facts, whole, peaks = [], [], []
    before: list[tuple[dict[str, Any], float]] = []
    with nullcontext(given.keep) if given.keep else tempfile.TemporaryDirectory(prefix="vico-") as folder:
        for k in range(given.n):
            where = ["--lat", str(place.lat), "--lon", str(place.lon), "--radius", str(given.radius)]
            child = vico("world", "build", *where, "--out", f"{folder}/{k}", "--json")
            facts.append(json.loads(child.output))
            whole.append(child.seconds)
            peaks.append(child.peak_mb)
            if given.before:
                # A folder of its own each time: what is kept in one would be read again.
                child = vico("world", "build", *where, "--out", f"{folder}/before{k}", "--json", checkout=given.before)
                before.append((json.loads(child.output), child.seconds))
        others: list[dict[str, Any]] = []
        more = of_radii(given.data, Path(folder)) + of_places(given.data, Path(folder), others) if given.data else []
    last = facts[-1]
    more = beside_the_paper(last, others) + more
    if before:
        more = beside_before(list(zip(facts, whole, strict=True)), before) + more
    how = "vico bench world --table benchmarks/results/world.md"
    if given.data or given.before:
        words = f"-n {given.n}{' --before CHECKOUT' if given.before else ''}{' --data DATA' if given.data else ''}"
        how = f"python benchmarks/world.py {words} --table benchmarks/results/world.md"
    lines = [
        "# World: seconds a stage",
        "",
        about,
        f"Made by `{how}`.",
        "",
        f"{place.name}, {2 * given.radius:.0f} m x {2 * given.radius:.0f} m: {last['buildings']} buildings, "
        f"{last['places']} places, {last['roads']} roads, {last['indoor_objects']} things indoors; "
        f"{last['megabytes']:.0f} MB on disk. Goal: {GOAL:.0f} s for 800 m x 800 m.",
        "",
        "Stages that a second process makes run beside the others: the total may be more than the whole command.",
        "",
        "| stage | median s | least | greatest | n |",
        "|---|---|---|---|---|",
    ]
    stages = [name for name in last["seconds"] if name != "total"]
    lines += [row(name, [f["seconds"][name] for f in facts], 2) for name in (*stages, "total")]
    lines.append(row("whole command", whole, 2))
    lines += ["", "| memory | median MB | least | greatest | n |", "|---|---|---|---|---|"]
    lines.append(row("peak resident set", peaks, 0))
    publish(lines + more, given.table)


if __name__ == "__main__":
    main()
