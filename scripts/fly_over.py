"""Fly a drone across a city, past points that are given, and film it from behind.

    python scripts/fly_over.py CITY PEOPLE --way=-2400,-2400 --way 2400,2400 --out flight [--height 60] [--speed 8]

Points are metres east and north of the city's middle. The flight is a run with the people's day, traffic and walkers;
it is recorded in OUT, so `vico film OUT` shows it in other ways, and ends when the last point is reached.
"""

from __future__ import annotations

import argparse
import math
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from vico.agents.schedule import followers_of
from vico.community.folder import read_community
from vico.render.film import write_film
from vico.runner.gather import FaultLog, Gatherer
from vico.runner.loop import Hook, Runner, Step
from vico.runner.recording import RecordedRun
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.recording import read_run
from vico.sim.recording.recorder import Recorder
from vico.viewer.run_film import FilmSettings, RepeatedRun, film_frames
from vico.world.folder import read_world
from vico.world.public import PublicMap
from vico.world.world import World

_REACHED, _ROOM, _FARTHEST = 4.0, 1.2, 300  # metres
_DRONE = "robot_0"


class Reached(Exception):
    """The last point is reached."""


def begin(world: World, near: tuple[float, float]) -> tuple[float, float] | None:
    """Return the nearest free ground to a point, on which a drone can stand, and from which one gets away."""
    for away in range(0, _FARTHEST, 2):
        for turn in range(0, 360, 20):
            x = near[0] + away * math.cos(math.radians(turn))
            y = near[1] + away * math.sin(math.radians(turn))
            if world.walkable.is_connected((x, y)) and float(world.walkable.clearance_at((x, y))) > _ROOM:
                return x, y
    return None


class Pilot:
    """Flies from point to point."""

    def __init__(self, points: list[tuple[float, float, float]]) -> None:
        self.points, self.told = points, False

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
        """Go on to the next point."""
        x, y = observation["pose"][:2]
        while self.points and math.dist(self.points[0][:2], (x, y)) < _REACHED:
            self.points.pop(0)
            self.told = False
        if self.told or not self.points:
            return {"type": "wait"}
        self.told = True
        return {"type": "fly_to", "target": list(self.points[0])}


class UntilThere(Hook):
    """Ends the run when there are no more points."""

    def __init__(self, pilot: Pilot) -> None:
        self.pilot = pilot

    def stepped(self, step: Step) -> None:
        """Look whether it is there."""
        if not self.pilot.points:
            raise Reached


def main() -> None:
    """Fly, and film it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("city", type=Path)
    parser.add_argument("people", type=Path)
    parser.add_argument(
        "--way", action="append", required=True, help="a point EAST,NORTH, metres; the drone begins there"
    )
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--height", type=float, default=60.0, help="metres above the ground")
    parser.add_argument("--start", type=float, default=9.0, help="hour of the day")
    parser.add_argument("--speed", type=float, default=8.0, help="seconds of the flight in one of the film")
    parser.add_argument("--rate", type=int, default=12, help="frames a second")
    parser.add_argument("--size", default="960x540")
    parser.add_argument("--cars", type=int, default=400)
    parser.add_argument("--pedestrians", type=int, default=400)
    arguments = parser.parse_args()

    world = read_world(arguments.city)
    community = read_community(arguments.people, world)
    way = [(float(east), float(north)) for east, north in (point.split(",") for point in arguments.way)]
    public = PublicMap.from_world(world)
    ground = begin(world, way[0])
    if ground is None:
        parser.error(f"--way {way[0]}: no free ground within {_FARTHEST} m to begin on; give another first point")
    config = SimConfig(
        seed=community.seed,
        start=int(arguments.start * 3600),
        robots=("drone",),
        robot_places={_DRONE: (*ground, 0.0)},
        observe=(),
        cars=arguments.cars,
        pedestrians=arguments.pedestrians,
    )
    sim = Simulation(world, community, config)
    pilot = Pilot([(x, y, float(world.height((x, y))) + arguments.height) for x, y in way])
    followers = followers_of(community, public, seed=config.seed)
    agents = Gatherer({**followers, _DRONE: pilot}, trusted=[*followers, _DRONE])
    faults = FaultLog()
    sources = {"world": str(arguments.city.resolve()), "community": str(arguments.people.resolve())}
    with closing(agents), Recorder(arguments.out, sim, sources=sources, wanted=3600) as recorder:
        with suppress(Reached):
            Runner(sim, agents, hooks=[RecordedRun(recorder, faults), UntilThere(pilot)], faults=faults).run(3600)
        recorder.close()
    repeated = RepeatedRun(read_run(arguments.out), world, community)
    width, height = (int(side) for side in arguments.size.split("x"))
    settings = FilmSettings(
        follow=_DRONE, view="behind", width=width, height=height, rate=arguments.rate, speed=arguments.speed
    )
    frames = film_frames(repeated, settings, first=0, last=repeated.run.last)
    write_film(arguments.out / "flight.mp4", frames, rate=arguments.rate)


if __name__ == "__main__":
    main()
