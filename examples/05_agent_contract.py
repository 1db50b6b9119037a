"""An agent that keeps the contract: checked, run in a process of its own, saved, and gone on with.

python examples/05_agent_contract.py --world out/demo/world --steps 40
"""

import argparse
import math
from pathlib import Path

import numpy as np

from vico.community import build_community
from vico.runner.check import check_agent
from vico.runner.foreign import Terms, foreign_agents
from vico.runner.gather import Gatherer
from vico.runner.loading import AgentSeat
from vico.runner.loop import Runner
from vico.seeds import rng
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.folder import read_world


class Wanderer:
    """Walks from one random spot to the next. Its constructor names what it wants to be told."""

    def __init__(self, public_map, name: str, seed: int) -> None:
        self.map = public_map
        self.random = rng(seed, "wanderer", name)  # a stream of its own: the same run draws the same numbers
        self.route = np.zeros((0, 2))

    def act(self, observation: dict, info: dict) -> dict:
        """Turn towards the next corner of the route, or walk on."""
        x, y, _, east, north, _ = observation["pose"]
        while len(self.route) and math.dist(self.route[0], (x, y)) < 0.5:
            self.route = self.route[1:]
        if not len(self.route):
            spot = self.map.walkable.random_point(self.random, near=(x, y), radius=40.0)
            route = self.map.router.path((x, y), spot)
            self.route = np.zeros((0, 2)) if route is None else route
            return {"type": "wait"}
        ahead = math.atan2(self.route[0][1] - y, self.route[0][0] - x) - math.atan2(north, east)
        turn = math.degrees(math.remainder(ahead, math.tau))
        if abs(turn) > 5:
            return {"type": "turn_left" if turn > 0 else "turn_right", "degrees": abs(turn)}
        if observation["state"]["action_status"] == "collision":
            return {"type": "turn_right", "degrees": 60.0}
        return {"type": "move_forward", "distance": min(1.0, math.dist(self.route[0], (x, y)))}

    def state(self) -> dict:
        """Return all it remembers: JSON values and arrays."""
        return {"route": self.route, "random": self.random.bit_generator.state}

    def restore(self, state: dict) -> None:
        """Remember what `state` returned."""
        self.route = state["route"]
        self.random.bit_generator.state = state["random"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--world", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=40)
    arguments = parser.parse_args()

    world, spec = read_world(arguments.world), f"{__file__}:Wanderer"
    found = check_agent(spec, world, steps=20)
    print(f"findings: {[finding.what for finding in found.findings]}, {found.median_ms:.1f} ms an action")

    people = build_community(world, residents=3, seed=0)
    sim = Simulation(world, people, SimConfig(assistants=2, cars=5, pedestrians=5, observe=()))
    seats = [AgentSeat(f"assistant_{i}", seed=0, number=i, of=2) for i in range(2)]
    agents = Gatherer(foreign_agents(spec, seats, world, Terms(isolate=True)), deadline=60.0)
    try:
        Runner(sim, agents).run(arguments.steps // 2)
        middle, remembered = sim.snapshot(), agents.states()[0]  # what a checkpoint holds
        Runner(sim, agents).run(arguments.steps)
        first = sim.state_hash()
        sim.restore(middle)
        agents.restore(remembered)
        runner = Runner(sim, agents)
        runner.run(arguments.steps)
    finally:
        agents.close()
    print(f"went on from the middle to the same end: {sim.state_hash() == first}; faults: {runner.faults.by_agent()}")


if __name__ == "__main__":
    main()
