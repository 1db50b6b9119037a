"""Communities on many worlds: are they valid, how long do they take, and are their networks like real ones.

    python benchmarks/people.py WORLD [WORLD ...] [--residents 15 1000] [--seeds 10] [--days 1] [--table FILE]

A world that has no beds for so many is asked for as many as it says it has room for; the table says how many. Every
community is looked at by the validator and for words that people's days contradict. The networks of the largest
communities stand beside those of real people. ``--table`` writes all to a page (``benchmarks/results/people.md``).
"""

from __future__ import annotations

import argparse
import json
import re
import statistics
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path

from reporting import machine

from vico.community import Community, build_community, check_community
from vico.community.day import character_findings
from vico.community.model import RelationKind
from vico.community.place_index import PlaceIndex
from vico.community.relations import NetworkMeasures, network_measures
from vico.community.work import check_beds
from vico.errors import EmptyInputError
from vico.world.folder import read_world
from vico.world.world import World


@dataclass(frozen=True)
class RealNetwork:
    """A published network; None where the source does not say."""

    name: str
    source: str
    people: int
    degree: float
    clustering: float | None = None
    transitivity: float | None = None
    path: float | None = None
    assortativity: float | None = None


_SCHOOLS = "https://www.nature.com/articles/s41599-023-02124-9/tables/3"
_COLLEGE = "https://pmc.ncbi.nlm.nih.gov/articles/PMC10922236/table/T2"
REAL = (
    RealNetwork(
        "friends, boys of a high school, chosen and choosing", "[KONECT](http://konect.cc/networks/moreno_highschool)",
        70, 10.5, clustering=0.40, path=2.66, assortativity=0.08,
    ),
    RealNetwork("friends named, a school year, the first of six", f"[table 3]({_SCHOOLS})", 73, 7.4, transitivity=0.45),
    RealNetwork("friends named, a school year, the last of six", f"[table 3]({_SCHOOLS})", 157, 7.8, transitivity=0.38),
    RealNetwork("friends named, first-year students", f"[table 2]({_COLLEGE})", 1236, 5.4),
)  # fmt: skip


@dataclass(frozen=True)
class Trial:
    """One community: what was asked for and what came of it; `seconds` of one processor."""

    world: str
    asked: int
    residents: int
    seed: int
    seconds: float
    findings: int
    contradictions: int
    first: str = ""


def room_in(world: World, residents: int) -> int:
    """Return how many of some residents a world says it has room for."""
    try:
        check_beds(PlaceIndex(world, date(2025, 6, 2)), residents)
    except EmptyInputError as error:
        told = re.search(r"ask for at most (\d+) residents", str(error))
        if told is None:
            raise
        return int(told[1])
    return residents


def trial(world: World, asked: int, residents: int, seed: int, days: int) -> tuple[Trial, Community]:
    """Build one community and look at it."""
    began = time.process_time()
    community = build_community(world, residents=residents, seed=seed, days=days)
    seconds = time.process_time() - began
    found = check_community(community, world)
    words = character_findings(community)
    first = next((f"{one.where}: {one.what}" for one in (*found, *words)), "")
    name = Path(world.path).name if world.path is not None else world.manifest.name
    return Trial(name, asked, len(community.residents), seed, seconds, len(found), len(words), first), community


def till_coverage(community: Community, world: World) -> float:
    """Return which share of their opening hours shops and eateries with two or more staff are staffed, 6 to 23 h."""
    index = PlaceIndex(world, community.date)
    staff: dict[str, list[tuple[int, int]]] = {}
    heads: Counter[str] = Counter()
    for resident in community.residents:
        if resident.workplace is None or resident.age < 18:
            continue
        heads[resident.workplace] += 1
        stays = [i for i in resident.schedule if i.place == resident.workplace]
        staff.setdefault(resident.workplace, []).extend((_minute(i.start), _minute(i.end)) for i in stays)
    shares = []
    for place_id, stays in staff.items():
        place = index.place_by_id[place_id]
        if heads[place_id] < 2 or place.category.value not in ("store", "food"):
            continue
        minutes = [m for a, b in index.hours(place) for m in range(max(a, 360), min(b, 1380))]
        shares.append(statistics.fmean(any(a <= m <= b for a, b in stays) for m in minutes))
    return statistics.fmean(shares) if shares else float("nan")


def _minute(clock: str) -> int:
    return int(clock[:2]) * 60 + int(clock[3:5])


def table_of(trials: Sequence[Trial]) -> list[str]:
    """Return the lines of the table of trials."""
    lines = [
        "| world | asked | residents | seeds | findings | contradicted words | processor seconds, median | most |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for world, asked in dict.fromkeys((t.world, t.asked) for t in trials):
        mine = [t for t in trials if (t.world, t.asked) == (world, asked)]
        seconds = [t.seconds for t in mine]
        lines.append(
            f"| {world} | {asked} | {mine[0].residents} | {len(mine)} | {sum(t.findings for t in mine)} | "
            f"{sum(t.contradictions for t in mine)} | {statistics.median(seconds):.1f} | {max(seconds):.1f} |"
        )
    return lines


def network_lines(measured: Sequence[tuple[str, NetworkMeasures]]) -> list[str]:
    """Return the lines of the table of networks, ours and those of real people."""
    lines = [
        "| network | people | mean degree | most | skew | clustering | transitivity | path | degree assortativity | "
        "age assortativity |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, m in measured:
        lines.append(
            f"| {name} | {m.people} | {m.mean_degree:.1f} | {m.most_degree} | {m.degree_skew:.1f} | {m.clustering:.2f} "
            f"| {m.transitivity:.2f} | {m.mean_path:.1f} | {m.degree_assortativity:+.2f} | {m.age_assortativity:+.2f} |"
        )
    for real in REAL:
        shown = [
            form.format(value) if value is not None else ""
            for form, value in (
                ("{:.2f}", real.clustering),
                ("{:.2f}", real.transitivity),
                ("{:.1f}", real.path),
                ("{:+.2f}", real.assortativity),
            )
        ]
        lines.append(
            f"| *{real.name}* ({real.source}) | {real.people} | {real.degree:.1f} | | | {' | '.join(shown)} | |"
        )
    return lines


def main() -> None:
    """Build, look and say."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="+", type=Path)
    parser.add_argument("--residents", nargs="+", type=int, default=[15, 1000])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--days", type=int, default=1)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--log", type=Path, help="lines of JSON, one a community, to go on from")
    options = parser.parse_args()
    trials: list[Trial] = []
    if options.log and options.log.exists():
        trials = [Trial(**json.loads(line)) for line in options.log.read_text().splitlines()]
    done = {(t.world, t.asked, t.seed) for t in trials}
    networks: list[tuple[str, NetworkMeasures]] = []
    for path in options.worlds:
        world = read_world(path)
        for asked in options.residents:
            if all((path.name, asked, seed) in done for seed in range(options.seeds)):
                continue
            residents = room_in(world, asked)
            for seed in range(options.seeds):
                if (path.name, asked, seed) in done:
                    continue
                one, community = trial(world, asked, residents, seed, options.days)
                trials.append(one)
                print(json.dumps(asdict(one)), flush=True)
                if options.log:
                    with options.log.open("a") as log:
                        log.write(json.dumps(asdict(one)) + "\n")
                if seed == 0 and residents > 100:
                    networks += _networks_of(path.name, community)
                    print(f"staffed while open: {till_coverage(community, world):.2f}", flush=True)
    lines = [*table_of(trials), "", *network_lines(networks)]
    print("\n".join(lines))
    if options.table:
        options.table.write_text("\n".join(["# Communities", "", machine(), "", *lines, ""]))


def _networks_of(name: str, community: Community) -> list[tuple[str, NetworkMeasures]]:
    n = len(community.residents)
    return [
        (f"{name}, {n}: friends", network_measures(community, [RelationKind.FRIEND])),
        (f"{name}, {n}: friends, adults only", network_measures(community, [RelationKind.FRIEND], adults_only=True)),
        (f"{name}, {n}: all ties", network_measures(community)),
    ]


if __name__ == "__main__":
    main()
