"""How residents get about, and what else they could take: modes of a community, and trips from door to door.

``python benchmarks/modes.py WORLD COMMUNITY [--trips 20] [--seed 0]``: Markdown tables on standard output.
"""

from __future__ import annotations

import argparse
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np

from vico.clock import seconds_of_day
from vico.community import Community, read_community
from vico.community.model import ItemType, Resident, ScheduleItem
from vico.rules import walk_speed
from vico.seeds import rng
from vico.world.folder import read_world
from vico.world.world import World

MODES = ("walk", "bus", "tram", "bike")


def ways_of(community: Community) -> list[tuple[Resident, str, ScheduleItem, str]]:
    """Return the ways of all residents: who, from which place, the way, and to which."""
    found = []
    for resident in community.residents:
        place = resident.home
        for item, then in pairwise(resident.schedule):
            place = item.place or place
            if item.type is ItemType.COMMUTE and then.place and place != then.place:
                found.append((resident, place, item, then.place))
    return found


def main() -> None:
    """Print how residents get about, and what chosen trips take by each mode."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("world", type=Path)
    parser.add_argument("community", type=Path)
    parser.add_argument("--trips", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    world = read_world(options.world)
    community = read_community(options.community, world)
    ways = ways_of(community)
    table_of_modes(ways)
    random = rng(options.seed, "benchmark", "trips")
    chosen = [ways[k] for k in sorted(random.choice(len(ways), min(options.trips, len(ways)), replace=False).tolist())]
    table_of_trips(world, chosen)


def table_of_modes(ways: list[tuple[Resident, str, ScheduleItem, str]]) -> None:
    """Print the share of each mode, by the walker's age and by how long the way is."""
    print("| who | ways | on foot | bus | tram | bicycle |")
    print("|---|---|---|---|---|---|")
    groups = (("all", 0, 200), ("below 18", 0, 18), ("18 to 59", 18, 60), ("60 on", 60, 200))
    for name, low, high in groups:
        modes = Counter(item.mode.value if item.mode else "walk" for one, _, item, _ in ways if low <= one.age < high)
        total = sum(modes.values())
        shares = " | ".join(f"{100 * modes[mode] / max(total, 1):.1f} %" for mode in MODES)
        print(f"| {name} | {total} | {shares} |")


def table_of_trips(world: World, ways: list[tuple[Resident, str, ScheduleItem, str]]) -> None:
    """Print what trips take from door to door, by each mode, at the second at which somebody sets out."""
    places = {place.id: place for place in world.places}
    print("\n| age | m as the crow flies | on foot, s | bus | tram | bicycle | fastest | taken |")
    print("|---|---|---|---|---|---|---|---|")
    fastest: Counter[str] = Counter()
    for one, origin, item, goal in ways:
        a, b = places[origin].position[:2], places[goal].position[:2]
        depart = float(seconds_of_day(item.start))
        walk = world.trips.seconds(a, b, depart, modes=("walk",)) / walk_speed(one.age)
        rides = [world.trips.seconds(a, b, depart, modes=(mode,)) for mode in MODES[1:]]
        seconds = [walk, *rides]
        best = MODES[int(np.argmin(seconds))]
        fastest[best] += 1
        cells = " | ".join("none" if not np.isfinite(s) else f"{s:.0f}" for s in seconds)
        crow = float(np.hypot(a[0] - b[0], a[1] - b[1]))
        print(f"| {one.age} | {crow:.0f} | {cells} | {best} | {item.mode.value if item.mode else 'walk'} |")
    print("\n" + ", ".join(f"{mode} fastest in {count}" for mode, count in fastest.most_common()))


if __name__ == "__main__":
    main()
