"""An assistant asks the way and for a person, understands the answers, and finds them.

Somebody is looked for by name. The assistant goes where people are, asks whoever is near, reads the answers back
(`vico.agents.talk.understanding`), goes where they point to, and asks again there.

python examples/12_asking_people.py --world out/demo/world --community out/demo/community --seed 1 --steps 900
"""

import argparse
import math
from pathlib import Path

import numpy as np

from vico.agents.base import Action, Info, Observation
from vico.agents.schedule import followers_of
from vico.agents.talk.understanding import claims_in, place_named, whereabouts
from vico.agents.wayfinding import Walker
from vico.community import read_community
from vico.seeds import rng
from vico.sim.config import SimConfig
from vico.sim.simulation import Simulation
from vico.world.folder import read_world
from vico.world.public import PublicMap

# Seconds that an answer takes, and until the same people are asked again.
ANSWER, AGAIN = 2, 40


class Asker:
    """Looks for a person by asking; knows the public map and what it hears, and nothing else."""

    def __init__(self, person: str, public_map: PublicMap, *, seed: int) -> None:
        self.person = person
        self.found = False
        self.goal = None
        self._map = public_map
        self._walker = Walker(public_map, rng(seed, "asker"))
        self._asked_at = -AGAIN
        self._asks_the_way = False

    def act(self, observation: Observation, info: Info) -> Action:
        """Listen; ask now and then; go where the answers point to."""
        time = observation["state"]["time"]
        for message in observation["events"]:
            self._hear(message)
        if self.found or time - self._asked_at < ANSWER:
            return {"type": "wait"}
        if self._asks_the_way and self.goal is not None:
            self._asks_the_way, self._asked_at = False, time
            return {"type": "communicate", "text": f"Thank you! How do I get to {self.goal.name}?"}
        if time - self._asked_at >= AGAIN:
            self._asked_at = time
            return {"type": "communicate", "text": f"Excuse me, have you seen {self.person}?"}
        return self._go(observation, info)

    def _hear(self, message: dict) -> None:
        if message["speaker"].startswith("assistant"):
            return
        print(f"{message['speaker']}: {message['text']}")
        for claim in claims_in(message["text"]):
            if claim.kind == "way":
                print(f"   understood: the way to {claim.place} is {claim.metres} m long")
        for claim in whereabouts(message["text"], self.person)[:1]:
            print(f"   understood: {claim.kind}, {claim.place or 'in view'}")
            self.found = claim.kind in ("see", "myself")
            place = place_named(self._map, claim.place)
            if place is not None and place is not self.goal:
                self.goal, self._asks_the_way = place, True

    def _go(self, observation: Observation, info: Info) -> Action:
        state = observation["state"]
        if self.goal is None or state["place"] == self.goal.id:
            return {"type": "wait"}
        if self.goal.id in state["accessible_places"]:
            return {"type": "enter", "place": self.goal.id}
        step = self._walker.towards(self.goal.position[:2], 1.8, observation, info)
        return step or {"type": "wait"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--world", type=Path, required=True)
    parser.add_argument("--community", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=900)
    parser.add_argument("--start", type=float, default=12.0, help="hour of the day")
    arguments = parser.parse_args()

    world = read_world(arguments.world)
    community = read_community(arguments.community, world)
    public_map = PublicMap.from_world(world)
    config = SimConfig(seed=arguments.seed, start=int(arguments.start * 3600), assistants=1, observe=())
    sim = Simulation(world, community, config)
    residents = followers_of(community, public_map, seed=arguments.seed)

    # Who asks stands before somebody who is out of doors and has a friend who is indoors.
    observations, infos = sim.observe()
    friend, person = pair_of(community, observations)
    x, y = observations[friend.id]["pose"][:2]
    sim.scenario.place_agent("assistant_0", (float(x), float(y) - 2.0))
    print(f"{person.name} is looked for; {friend.name} comes by")
    asker = Asker(person.name, public_map, seed=arguments.seed)
    observations, infos = sim.observe()
    began = observations["assistant_0"]["state"]["time"]
    for _ in range(arguments.steps):
        actions = {name: agent.act(observations[name], infos[name]) for name, agent in residents.items()}
        actions["assistant_0"] = asker.act(observations["assistant_0"], infos["assistant_0"])
        if actions["assistant_0"]["type"] == "communicate":
            print(f"assistant: {actions['assistant_0']['text']}")
        result = sim.step(actions)
        observations, infos = result.observations, result.infos
        if asker.found:
            break
    away = math.dist(observations["assistant_0"]["pose"][:2], observations[person.id]["pose"][:2])
    lasted = observations["assistant_0"]["state"]["time"] - began
    print(f"found: {asker.found} after {lasted:.0f} s, {away:.0f} m away")


def pair_of(community, observations):
    """Return two friends, the first out of doors on foot, the second indoors; those nearest to each other."""
    people, best = community.resident_by_id, (np.inf, None, None)
    for relation in community.relations:
        for one, other in (relation.between, relation.between[::-1]):
            states = observations[one]["state"], observations[other]["state"]
            outdoors = not states[0]["room"] and not states[0]["vehicle"]
            # In the first room behind the street door, where one can be spoken to.
            outdoors = outdoors and any(door["to"] == "outside" for door in states[1].get("doors", ()))
            if relation.kind in ("friend", "family") and outdoors:
                away = math.dist(observations[one]["pose"][:2], observations[other]["pose"][:2])
                if away < best[0]:
                    best = away, people[one], people[other]
    if best[1] is None:
        raise SystemExit("nobody is out of doors who has a friend indoors at that hour: try another --start")
    return best[1:]


if __name__ == "__main__":
    main()
