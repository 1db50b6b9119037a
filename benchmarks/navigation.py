"""How an assistant finds its way: into places, to every room and surface, out again, and across the city.

    python benchmarks/navigation.py tour WORLD [--places 6] [--walks 6] [--rooms 8] [--surfaces 3] [--seed 0]
        [--out legs.json]
    python benchmarks/navigation.py table NAME=legs.json... [--table benchmarks/results/navigation.md]

The full simulation, with 15 residents who follow their day and traffic; one assistant that sees 256 x 256 pictures uses
`AssistantSkills` alone. A *leg* is one errand: from some 40 m off through the entrance into a place (*in*), through a
door to the next room (*door*; *stairs* where the room is one), to within 1.15 m of a thing on a surface (*surface*),
out into the street again (*out*), between two points outdoors (*walk*). Shortest walks come from the ground truth:
seconds at 1 m/s (0.5 on stairs) on a 0.1 m grid indoors, the router's outdoors, without turns. The time of a step is
processor time of all perception and navigation, done anew for the first 300 steps. To be compared, two
states of the sources run the same tours.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
import time
from collections.abc import Callable, Generator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from reporting import machine, publish

from vico.agents.assistant.skills import GRASP, AssistantSkills, ObservationView
from vico.agents.perception import _search_grid
from vico.agents.schedule import followers_of
from vico.community import build_community
from vico.envs import make
from vico.rules import STAIRS_SPEED
from vico.runner.gather import Gatherer
from vico.runner.loop import Runner
from vico.seeds import rng
from vico.sim.bodies.state_arrays import RADIUS
from vico.sim.loop.simulation import Simulation
from vico.world.folder import read_world
from vico.world.model import Container, Place
from vico.world.public import PublicMap
from vico.world.world import World

_CELL = 0.1
_KEPT = 300  # steps
_ME = "assistant_0"
Action = dict[str, Any]
Skill = Callable[[ObservationView], Action | None]
Script = Generator[Action, ObservationView, None]


@dataclass
class Leg:
    """One errand.

    Attributes
    ----------
    shortest
        Seconds the shortest walk takes; infinite where there is none.
    """

    kind: str
    what: str
    shortest: float
    reached: bool = False
    steps: int = 0
    collisions: int = 0
    refused: int = 0
    note: str = ""


@dataclass
class Tour:
    """An assistant that goes everywhere; an agent as the runner has them."""

    sim: Simulation
    world: World
    seed: int
    places: int
    walks: int
    rooms: int
    surfaces: int
    stateless: bool = True
    legs: list[Leg] = field(default_factory=list)
    done: bool = False

    def __post_init__(self) -> None:
        self.chance = rng(self.seed, "navigation benchmark")
        self.map = PublicMap.from_world(self.world)
        self.skills = AssistantSkills(self.map, rng(self.seed, "navigation benchmark, feet"))
        self.rooms_by_id = {room.id: room for room in self.world.rooms}
        self._script = self._whole()
        self._begun = False
        self._kept: list[tuple[dict[str, Any], dict[str, Any], Skill | None]] = []
        self._view: ObservationView | None = None

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> Action:
        """Return the next action."""
        view = ObservationView(observation, info)
        self._view = view
        if info.get("coming_out") or self.done:
            return {"type": "wait"}
        for name in ("depth", "segmentation"):
            np.asarray(view.observation[name])  # pictures may still be worked on: that is not the assistant's time
        dict(view.info["entities"])
        self.skills.notice(view)
        _ = view.things
        if len(self._kept) < _KEPT:
            self._kept.append((observation, info, None))
        try:
            if not self._begun:
                self._begun = True
                return next(self._script)
            return self._script.send(view)
        except StopIteration:
            self.done = True
            return {"type": "wait"}

    def processor_time(self) -> float:
        """Do the same perception and navigation anew, for the first steps; return milliseconds of processor a step.

        Whatever else a step takes (pictures, the simulation) is left out, and so is what other programs take.
        """
        for _ in range(2):  # compiled code is loaded the first time
            self.skills = AssistantSkills(self.map, rng(self.seed, "navigation benchmark, feet"))
            began = time.thread_time()
            for observation, info, act in self._kept:
                view = ObservationView(observation, info)
                self.skills.notice(view)
                _ = view.things
                if act is not None:
                    act(view)
            spent = time.thread_time() - began
        return 1000 * spent / len(self._kept)

    # The script: each yield is a step.

    def _whole(self) -> Script:
        assert self._view is not None
        for place in self._chosen_places():
            spot = self._spot_near(np.array(place.position[:2]), 30.0, 60.0)
            if spot is None:
                continue
            self.sim.scenario.place_agent(_ME, (*spot, 0.0))
            yield {"type": "wait"}
            yield from self._visit(place)
        for _ in range(self.walks):
            start = self.world.walkable.random_point(self.chance)
            goal = self._spot_near(start, 60.0, 200.0)
            if goal is None:
                continue
            self.sim.scenario.place_agent(_ME, (*start, 0.0))
            yield {"type": "wait"}
            yield from self._leg(
                "walk",
                f"{goal.round(1).tolist()}",
                self._outdoors(goal),
                lambda view, goal=goal: self.skills.walk_to(view, goal, near=1.0),
                lambda view, goal=goal: view.away(goal) <= 1.0,
            )

    def _chosen_places(self) -> list[Place]:
        choice = [p for p in self.world.places if p.rooms and p.entrance]
        order = self.chance.permutation(len(choice))
        # Half of them such as have stairs, where there are some: they are the hardest.
        climbing = [choice[k] for k in order if any(self.rooms_by_id[r].rise for r in choice[k].rooms)]
        rest = [choice[k] for k in order if choice[k] not in climbing[: self.places // 3]]
        return [*climbing[: self.places // 3], *rest][: self.places]

    def _spot_near(self, point: NDArray[np.float64], least: float, most: float) -> NDArray[np.float64] | None:
        for _ in range(30):
            spot = self.world.walkable.random_point(self.chance, near=point, radius=most)
            if math.dist(spot, point) >= least and self.map.router.path(spot, point) is not None:
                return spot
        return None

    def _visit(self, place: Place) -> Script:
        leg = yield from self._leg(
            "in",
            place.id,
            self._outdoors(np.asarray(place.position[:2])),
            lambda view: self.skills.go_inside(view, place.id),
            lambda view: view.place == place.id,
        )
        if not leg.reached:
            return
        assert self._view is not None
        room = self._view.room
        assert room is not None
        yield from self._rooms_from(room, {room})
        left = self._view.room
        if left is None:
            return
        yield from self._leg(
            "out", place.id, math.nan, lambda view: self.skills.leave(view), lambda view: view.room is None, limit=240
        )

    def _rooms_from(self, room: str, seen: set[str]) -> Script:
        """Look at a room and its surfaces, and go on behind each of its doors, and back."""
        assert self._view is not None
        for _ in range(4):
            yield {"type": "turn_left", "degrees": 85.0}
        yield from self._reach_surfaces(room)
        if self._view.room != room:
            return
        for door in list(self._view.state["doors"]):
            beyond = str(door["to"])
            if beyond == "outside" or beyond in seen or len(seen) >= self.rooms:
                continue
            seen.add(beyond)
            leg = yield from self._through(beyond)
            if leg.reached:
                yield from self._rooms_from(beyond, seen)
                if self._view.room == beyond:
                    yield from self._through(room)
            if self._view.room != room:
                return

    def _through(self, room: str) -> Generator[Action, ObservationView, Leg]:
        assert self._view is not None
        here = self.rooms_by_id[str(self._view.room)]
        door = next(d for d in self._view.state["doors"] if d["to"] == room)
        return (
            yield from self._leg(
                "stairs" if here.rise else "door",
                f"{here.kind} {here.id} -> {room}",
                self._indoors(np.asarray(door["position"]), 0.95),
                lambda view: self.skills.go_through(view, room) if view.room == here.id else None,
                lambda view: view.room == room,
                limit=70,
            )
        )

    def _reach_surfaces(self, room: str) -> Script:
        record = self.rooms_by_id[room]
        things = [c for c in record.containers if c.kind != "floor"]
        for k in self.chance.permutation(len(things))[: self.surfaces]:
            spot = self._spot_on(things[k])
            yield from self._leg(
                "surface",
                f"{record.kind} {things[k].kind} {things[k].id}",
                self._indoors(spot, GRASP),
                lambda view, spot=spot: self.skills.approach(view, spot, near=GRASP),
                lambda view, spot=spot: view.away(spot) <= GRASP,
                limit=60,
            )

    def _spot_on(self, surface: Container) -> NDArray[np.float64]:
        """Return the point of a surface that is nearest to where one reaches it from, a hand's breadth in."""
        x, y, _ = surface.centre
        c, s = math.cos(surface.yaw), math.sin(surface.yaw)
        dx, dy = surface.reach[0] - x, surface.reach[1] - y
        half = [max(size / 2 - 0.1, 0.0) for size in surface.size]
        u = min(max(c * dx + s * dy, -half[0]), half[0])
        v = min(max(c * dy - s * dx, -half[1]), half[1])
        return np.array([x + c * u - s * v, y + s * u + c * v])

    def _leg(
        self,
        kind: str,
        what: str,
        shortest: float,
        act: Callable[[ObservationView], Action | None],
        reached: Callable[[ObservationView], bool],
        *,
        limit: int = 0,
    ) -> Generator[Action, ObservationView, Leg]:
        leg = Leg(kind, what, shortest)
        self.legs.append(leg)
        limit = limit or int(60 + 3 * min(shortest, 400.0))
        view = self._view
        assert view is not None
        codes: dict[str, int] = {}
        while leg.steps < limit and not reached(view):
            action = act(view)
            if self._kept[-1][0] is view.observation:
                self._kept[-1] = (*self._kept[-1][:2], act)
            if action is None:
                codes["gave up"] = 1
                break
            view = yield action
            leg.steps += 1
            status, code = view.state["action_status"], str(view.state["action_code"])
            leg.collisions += status == "collision"
            leg.refused += status == "refused"
            if status != "ok":
                codes[code] = codes.get(code, 0) + 1
            if code == "closed":
                break
        leg.reached = reached(view)
        if not leg.reached:
            leg.note = f"at {view.pose[:3].round(1).tolist()} in {view.room}, {codes}"
            print(f"  {kind} {what}: {leg.note}", file=sys.stderr, flush=True)
        return leg

    # Ground truth: of the benchmark, not of the assistant.

    def _outdoors(self, goal: NDArray[np.float64]) -> float:
        assert self._view is not None
        here = self.sim.state.people.position[self.sim.state.people.names.index(_ME), :2]
        return self.map.router.length(here, goal)

    def _indoors(self, goal: NDArray[np.float64], near: float) -> float:
        """Return the seconds of the shortest walk in a room, without other people; infinite where there is none."""
        assert self._view is not None
        indoor = self.sim.state.indoor
        room = indoor.index[str(self._view.room)]
        here = self._view.pose[:2]
        corner = indoor.boxes[room, :2] - np.hypot(*indoor.boxes[room, 3:]) - 0.5
        n = round(2 * (np.hypot(*indoor.boxes[room, 3:]) + 0.5) / _CELL)
        axis = (np.arange(n) + 0.5) * _CELL
        points = np.stack(np.meshgrid(corner[0] + axis, corner[1] + axis), axis=-1).reshape(-1, 2)
        blocked = (indoor.gaps(room, points) <= RADIUS).reshape(n, n)
        start, aim = (here - corner) / _CELL, (goal[:2] - corner) / _CELL
        cells = _search_grid(blocked, int(start[0]), int(start[1]), float(aim[0]), float(aim[1]), near / _CELL)
        if not len(cells):
            return 0.0 if math.dist(here, goal[:2]) <= near else math.inf
        steps = np.diff(np.vstack([[np.floor(start)], cells]), axis=0)
        metres = float(np.hypot(*steps.T).sum()) * _CELL
        return metres / STAIRS_SPEED if self.rooms_by_id[str(self._view.room)].rise else metres


def tour(args: argparse.Namespace) -> None:
    """Send an assistant about a world, and keep its legs."""
    world = read_world(args.world)
    community = build_community(world, residents=15, seed=0)
    number = round(30 * min(1.0, world.half / 400.0) ** 2)
    env = make(
        world, community, seed=args.seed, start=args.start, assistants=1, cars=number, pedestrians=number,
        observe=(_ME,), max_steps=100_000,
    )  # fmt: skip
    agent = Tour(env.sim, world, args.seed, args.places, args.walks, args.rooms, args.surfaces)
    followers = followers_of(community, env.public_map, seed=args.seed)
    agents = Gatherer(followers | {_ME: agent}, trusted=[*followers, _ME], deadline=0.0, workers=1)
    began = time.perf_counter()
    try:
        Runner(env.sim, agents).run(args.steps, until=lambda: agent.done)
    finally:
        agents.close()
    whole = time.perf_counter() - began
    record = {
        "world": Path(args.world).name,
        "legs": [asdict(leg) for leg in agent.legs],
        "milliseconds": agent.processor_time(),
        "steps": env.sim.metrics.steps,
        "wall": whole,
    }
    if args.out is not None:
        args.out.write_text(json.dumps(record))
    print("\n".join(_rows(str(args.world), record)), f"\n{env.sim.metrics.steps} steps in {whole:.0f} s")


_KINDS = ("in", "door", "stairs", "surface", "out", "walk")


def _rows(name: str, record: dict[str, Any]) -> list[str]:
    rows = []
    for kind in _KINDS:
        legs = [Leg(**leg) for leg in record["legs"] if leg["kind"] == kind]
        # What is closed, or cannot be got to by anybody, tells nothing of the way there.
        legs = [leg for leg in legs if not math.isinf(leg.shortest) and "'closed'" not in leg.note]
        if not legs:
            continue
        steps = sum(leg.steps for leg in legs)
        good = [leg for leg in legs if leg.reached and leg.shortest >= 1.0]
        over = f"{statistics.median(leg.steps / leg.shortest for leg in good):.2f}" if good else "-"
        rows.append(
            f"| {name} | {kind} | {sum(leg.reached for leg in legs)} of {len(legs)} | "
            f"{statistics.mean(leg.steps for leg in legs):.1f} | {over} | "
            f"{60 * sum(leg.collisions for leg in legs) / max(steps, 1):.2f} | {sum(leg.refused for leg in legs)} |"
        )
    rows.append(f"| {name} | *a step's perception and navigation* | {record['milliseconds']:.2f} ms | | | | |")
    return rows


def table(args: argparse.Namespace) -> None:
    """Put the legs of some tours side by side."""
    lines = [
        "# Finding the way",
        "",
        machine(),
        "",
        "What the columns mean: `benchmarks/navigation.py`. *Over* is the median of steps to seconds of the shortest",
        "walk, where that takes a second at least; turns take a step each and are not in the shortest walk.",
        "",
        "| sources, world | leg | reached | mean steps | over | collisions a minute | refused |",
        "|---|---|---|---|---|---|---|",
    ]
    for pair in args.tours:
        name, _, path = pair.partition("=")
        lines += _rows(name, json.loads(Path(path).read_text()))
    publish(lines, args.table)


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(required=True)
    go = verbs.add_parser("tour")
    go.add_argument("world", type=Path)
    for name, value in (("places", 6), ("walks", 6), ("rooms", 8), ("surfaces", 3), ("seed", 0), ("steps", 20_000)):
        go.add_argument(f"--{name}", type=int, default=value)
    go.add_argument("--start", default="11:00")
    go.add_argument("--out", type=Path)
    go.set_defaults(run=tour)
    show = verbs.add_parser("table")
    show.add_argument("tours", nargs="+")
    show.add_argument("--table", type=Path)
    show.set_defaults(run=table)
    args = parser.parse_args()
    args.run(args)


if __name__ == "__main__":
    main()
