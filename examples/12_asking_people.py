"""An assistant asks the way and for a person, understands the answers, and finds them.

Somebody is looked for by name. The assistant goes where people are, asks whoever is near, reads the answers back
(`vico.agents.talk.sentences`), goes where they point to, and asks again there.

python examples/12_asking_people.py --world out/demo/world --community out/demo/community --seed 1 --steps 900
"""

import argparse
import math
import sys
from pathlib import Path

from vico.agents.base import Action, Info, Observation
from vico.agents.schedule import followers_of
from vico.agents.talk.sentences import claims_in, place_named, whereabouts
from vico.agents.wayfinding import Walker
from vico.clock import seconds_of_day
from vico.community import read_community
from vico.seeds import rng
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.folder import read_world
from vico.world.public import PublicMap

# Seconds that an answer takes, and until the same people are asked again.
ANSWER, AGAIN = 2, 40
# Starts of the day that are tried, and seconds until two have come to where they can be asked.
TRIES, PATIENCE = 8, 240
# Who knows most of somebody's day; metres that others count as farther away.
CLOSE, FAR = ("family", "friend"), 1e4


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
    parser.add_argument("--start", type=float, default=12.0, help="hour of the day; as near to it as people meet")
    arguments = parser.parse_args()

    world = read_world(arguments.world)
    community = read_community(arguments.community, world)
    public_map = PublicMap.from_world(world)

    # Who asks stands before somebody who is out of doors and knows somebody who is indoors.
    for start in starts(community, arguments.start * 3600)[:TRIES]:
        config = SimConfig(seed=arguments.seed, start=start, assistants=1, observe=())
        sim = Simulation(world, community, config)
        residents = followers_of(community, public_map, seed=arguments.seed)
        observations, infos = sim.observe()
        pair = None
        for _ in range(PATIENCE):
            pair = pair_of(community, observations, infos)
            if pair is not None:
                break
            actions = {name: agent.act(observations[name], infos[name]) for name, agent in residents.items()}
            result = sim.step(actions)
            observations, infos = result.observations, result.infos
        if pair is not None:
            break
    else:
        print(
            "asking: nobody in this community walks by who knows somebody indoors: make a larger one", file=sys.stderr
        )
        sys.exit(2)

    friend, person = pair
    near = observations[friend.id]["pose"][:2]
    beside = public_map.walkable.random_point(rng(arguments.seed, "beside"), near=near, radius=3.0)
    sim.scenario.place_agent("assistant_0", (float(beside[0]), float(beside[1])))
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


def starts(community, wanted):
    """Return when people set out on foot while somebody they know is indoors and awake, the nearest to a time first.

    Seconds of the day; friends and family come before other acquaintances, who know less of each other's day.
    """
    people, found = community.resident_by_id, {}
    for relation in community.relations:
        for one, other in (relation.between, relation.between[::-1]):
            for item in people[one].schedule:
                time = seconds_of_day(item.start)
                theirs = people[other].item_at(time)
                if (
                    item.type == "commute"
                    and item.mode in (None, "walk")
                    and theirs.building
                    and theirs.type != "sleep"
                ):
                    found[time] = min(found.get(time, True), relation.kind not in CLOSE)
    return sorted(found, key=lambda time: (found[time], abs(time - wanted), time))


def pair_of(community, observations, infos):
    """Return two who know each other, the first out of doors on foot, the second indoors; None if there are none.

    Friends and family come first, then those nearest to each other.
    """
    people, best = community.resident_by_id, (math.inf, None)
    for relation in community.relations:
        for one, other in (relation.between, relation.between[::-1]):
            states = observations[one]["state"], observations[other]["state"]
            outdoors = not states[0]["room"] and not states[0]["vehicle"] and not infos[one].get("coming_out")
            # In the first room behind the street door, where one can be spoken to.
            if outdoors and any(door["to"] == "outside" for door in states[1].get("doors", ())):
                away = math.dist(observations[one]["pose"][:2], observations[other]["pose"][:2])
                away += 0.0 if relation.kind in CLOSE else FAR
                if away < best[0]:
                    best = away, (people[one], people[other])
    return best[1]


if __name__ == "__main__":
    main()
