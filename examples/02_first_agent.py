"""Let an agent of your own walk to a cafe through a peopled city, acting from observations alone.

python examples/02_first_agent.py --world out/demo/world --steps 120
"""

import argparse
import math
from pathlib import Path

import numpy as np

import vico
from vico.community import build_community
from vico.world.folder import read_world


class CafeGoer:
    """Follows a route of the public map to the nearest place to eat that is worth a walk."""

    def __init__(self, public_map) -> None:
        self.map = public_map
        self.route = None

    def act(self, observation: dict) -> dict:
        """Turn towards the next corner of the route, or walk on."""
        x, y, _, east, north, _ = observation["pose"]
        if self.route is None:
            food = [place for place in self.map.places if place.category == "food"]
            food.sort(key=lambda place: math.dist(place.position[:2], (x, y)))
            cafe = next(place for place in food if math.dist(place.position[:2], (x, y)) > 30.0)
            print(f"going to {cafe.name}")
            self.route = list(self.map.router.path((x, y), cafe.position[:2]))
        while self.route and math.dist(self.route[0], (x, y)) < 0.5:
            self.route.pop(0)
        if not self.route:
            return {"type": "communicate", "text": "Hello, everybody!"}
        ahead = math.atan2(self.route[0][1] - y, self.route[0][0] - x) - math.atan2(north, east)
        turn = math.degrees(math.remainder(ahead, math.tau))
        if abs(turn) > 5:
            return {"type": "turn_left" if turn > 0 else "turn_right", "degrees": abs(turn)}
        return {"type": "move_forward", "distance": min(1.0, math.dist(self.route[0], (x, y)))}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=120)
    arguments = parser.parse_args()

    world = read_world(arguments.world)
    community = build_community(world, residents=5, seed=0)
    env = vico.make(world, community, assistants=1, cars=10, pedestrians=10, observe=("assistant_0",), seed=0)
    observations, _ = env.reset(seed=0)
    agent = CafeGoer(env.public_map)
    start = np.array(observations["assistant_0"]["pose"][:2])
    for _ in range(arguments.steps):
        action = agent.act(observations["assistant_0"])
        observations, _, _, _, infos = env.step({"assistant_0": action})  # whoever has no action waits
    end = np.array(observations["assistant_0"]["pose"][:2])
    in_view = [entity["name"] for entity in infos["assistant_0"]["entities"].values() if entity["name"]]
    print(f"walked {np.linalg.norm(end - start):.0f} m as the crow flies; in view: {', '.join(in_view[:5])}")
    print(f"state {env.state_hash()}")


if __name__ == "__main__":
    main()
