"""Close a street and cut the power while a run goes on; see who learns of it, and what the cars do.

python examples/08_events.py --world out/demo/world --seed 1 --steps 90
"""

import argparse
from pathlib import Path

from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.folder import read_world


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", type=Path, required=True)
    parser.add_argument("--street", default="", help="name of a street; one of the world's if not given")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=90)
    arguments = parser.parse_args()

    world = read_world(arguments.world)
    sim = Simulation(world, None, SimConfig(seed=arguments.seed, cars=15, assistants=1, transit=False, observe=()))
    environment = sim.state.environment
    street = arguments.street or sim.base.event_sites.streets[0]
    works = environment.start_event("road_works", street=street, walkways=True, name="new pipes")
    environment.start_event("power_cut", region=(0.0, 0.0, world.half))
    for _ in range(arguments.steps):
        result = sim.step({})
    for event in result.infos["assistant_0"]["events"]:
        print(f"known ({event['known']}): {event['name']}, {len(event['closed_ground'])} circles of ground closed")

    effects = environment.agenda.effects
    print(f"{len(effects.shut)} places closed, {len(sim.state.things)} barriers stand")
    fleet = sim.state.traffic.fleet
    there = int(effects.lanes[fleet.lane].sum())
    print(f"{there} of {len(fleet)} cars on {street}, {int(fleet.teleports.sum())} vanished")
    environment.end_event(works)
    sim.step({})
    print(f"after it {len(sim.state.things)} barriers stand")


if __name__ == "__main__":
    main()
