"""Build a small world from the packaged map and take a picture of one of its streets.

python examples/01_first_world.py --out out/first_world
"""

import argparse
from collections import Counter
from pathlib import Path

import vico


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--radius", type=float, default=150.0)
    arguments = parser.parse_args()

    world = vico.build_world(arguments.out, radius=arguments.radius)
    print(f"{len(world.buildings)} buildings, {len(world.places)} places, {len(vico.check_world(world))} findings")

    view = vico.view_world(world)
    view.save(arguments.out.with_suffix(".png"))
    in_view = Counter(entity["kind"] for entity in view.names.values())
    print(f"in view: {', '.join(f'{number} x {kind}' for kind, number in in_view.most_common())}")


if __name__ == "__main__":
    main()
