"""Measure how often people are at the places of their day, by kind of place and hour.

    python scripts/measure_habits.py WORLD... > src/vico/data/agents/assistant/habits.toml

Takes communities as Carry has them. Give worlds that no reported task takes place in.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

from vico.agents.assistant.estimates import OUTDOORS
from vico.challenges.assistant.challenge import world_and_people
from vico.clock import seconds_of_day

_HOUR = 3600.0


def main() -> None:
    """Print the shares as TOML."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("worlds", nargs="+", type=Path)
    worlds = parser.parse_args().worlds
    known: Counter[str] = Counter()
    there: Counter[tuple[str, int]] = Counter()
    for folder in worlds:
        world, people = world_and_people(folder, "carry")
        for who in people.residents:
            stays = [(seconds_of_day(i.start), seconds_of_day(i.end), i.place) for i in who.schedule if i.place]
            for place in sorted({place for _, _, place in stays} - {who.home}):
                where = world.place_by_id[place]
                category = where.category.value if where.rooms else OUTDOORS
                known[category] += 1
                for hour in range(24):
                    middle = (hour + 0.5) * _HOUR
                    there[category, hour] += any(a <= middle < b and one == place for a, b, one in stays)
    lines = [f'about = "Measured by scripts/measure_habits.py on {", ".join(folder.name for folder in worlds)}."', ""]
    lines += ["[places]"]
    for category in sorted(known):
        shares = ", ".join(f"{there[category, hour] / known[category]:.2f}" for hour in range(24))
        lines += [f"{category} = [{shares}]"]
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
