"""Plan a trip between two places, print its legs and what else one could do, and let an assistant make it.

python examples/07_getting_around.py --world out/demo/world --seed 0 --steps 900
"""

import argparse
from pathlib import Path

import vico
from vico.agents.travel import Traveller
from vico.seeds import rng

EIGHT = 8 * 3600


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=900)
    arguments = parser.parse_args()

    chance = rng(arguments.seed, "example")
    env = vico.make(arguments.world, assistants=1, observe=(), seed=arguments.seed)
    places = [place for place in env.public_map.places if place.entrance is not None]
    goal = places[int(chance.integers(len(places)))]
    observations, infos = env.reset()
    me = "assistant_0"
    start, x, y = observations[me]["pose"][:2], *goal.position[:2]

    for trip in env.public_map.trips.alternatives(start, (x, y), EIGHT):
        legs = ", ".join(f"{leg.mode} {leg.seconds:.0f} s" for leg in trip.legs)
        print(f"{trip.seconds:.0f} s for {trip.price:.2f}, {trip.walked:.0f} m on foot: {legs}")

    traveller = Traveller(env.public_map, chance)
    for step in range(arguments.steps):
        action = traveller.towards((x, y), observations[me], infos[me])
        if action is None:
            print(f"at {goal.name} after {step} s")
            break
        observations, _, _, _, infos = env.step({me: action})


if __name__ == "__main__":
    main()
