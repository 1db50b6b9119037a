"""What robots are asked to do on each physics engine: how it went, how exactly, and how fast. Part of physics.py."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.assets.shapes import box
from vico.sim.bodies.arrays import Bodies
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.robots import RobotPopulation
from vico.world.world import World

KINDS = ("husky", "manipulator", "go2", "drone", "h1")
HUSKY, MANIPULATOR, GO2, DRONE, H1 = range(5)
#: Where they stand on the square: metres east and north of its middle, heading.
_SPOTS = ((-4.0, -3.0, 0.0), (0.0, 0.0, 0.0), (3.0, 4.5, 0.0), (5.0, -6.0, 0.0), (-5.0, 5.0, 0.0))
_PARCEL = (0.12, 0.18, 0.2)
_PUSH = 15.0  # newton seconds


@dataclass
class Result:
    """How a task went: what happened, how far off that was, and simulated seconds for each of processor time."""

    outcome: str
    error: str
    speed: float

    def cells(self) -> list[str]:
        """For a table."""
        return [self.outcome, self.error, f"{self.speed:.1f}"]


class Tasks:
    """A robot of every kind on a square, on one engine."""

    def __init__(self, world: World, middle: NDArray[np.float64], engine: str) -> None:
        x, y = middle.tolist()
        places = {f"robot_{k}": (x + dx, y + dy, yaw) for k, (dx, dy, yaw) in enumerate(_SPOTS)}
        config = SimConfig(robots=KINDS, robot_places=places, physics=engine, cars=0, pedestrians=0, observe=(), seed=2)
        self.sim, self.middle, self.world = Simulation(world, None, config), middle, world
        robots = self.sim.state.robots
        assert isinstance(robots, RobotPopulation)
        self.robots = robots
        self.events: list[tuple[int, str]] = []
        self.cpu = self.seconds = 0.0
        self.let(2.0)

    def let(self, seconds: float, done: Callable[[], bool] | None = None) -> bool:
        """Let time pass, until something is so if that is sooner; return whether it was."""
        for _ in range(round(seconds * 10)):
            began = time.process_time()
            self.robots.advance(0.1, Bodies.none())
            self.cpu += time.process_time() - began
            self.seconds += 0.1
            self.events += [(event.robot, event.kind) for event in self.robots.events()]
            if done is not None and done():
                return True
        return False

    def all(self) -> dict[str, list[str]]:
        """Return the results of all tasks, by what they are."""
        tasks: dict[str, Callable[[], tuple[str, str]]] = {
            "husky goes to a point 5 m ahead": lambda: self.goes_to(HUSKY, 5.0),
            "go2 goes to a point 4 m ahead": lambda: self.goes_to(GO2, 4.0),
            "go2 is told 0.8 rad/s": lambda: self.turns(GO2, 0.8),
            "go2 stops": lambda: self.stops(GO2),
            "h1 is told 0.5 m/s": lambda: self.walks(H1, 0.5),
            "h1 is told 0.5 rad/s": lambda: self.turns(H1, 0.5),
            "h1 stops": lambda: self.stops(H1),
            f"h1 is pushed with {_PUSH:g} Ns": self.is_pushed,
            "drone hovers in wind of 8 m/s with gusts": self.hovers,
            "manipulator reaches a point": self.reaches,
            "manipulator picks a parcel from the ground": self.picks,
            "manipulator puts it down": self.places,
            "manipulator picks it again and puts it on Husky's deck": self.loads,
            "husky carries it 3 m and stops": self.carries,
        }
        found = {}
        for name, task in tasks.items():
            self.cpu = self.seconds = 0.0
            self.events.clear()
            outcome, error = task()
            found[name] = Result(outcome, error, self.seconds / max(self.cpu, 1e-9)).cells()
        return found

    def goes_to(self, robot: int, ahead: float) -> tuple[str, str]:
        """Go straight ahead."""
        goal = self.robots.run.position(robot)[:2] + np.array([ahead, 0.0])
        self.robots.go_to(robot, goal)
        self.let(30.0, lambda: any(who == robot for who, _ in self.events))
        off = float(np.hypot(*(self.robots.run.position(robot)[:2] - goal)))
        return next((kind for who, kind in self.events if who == robot), "not there in 30 s"), f"{off:.2f} m off"

    def turns(self, robot: int, rate: float) -> tuple[str, str]:
        """Turn on the spot."""
        self.robots.drive(robot, (0.0, 0.0, rate))
        self.let(1.0)
        before = self.robots.engine.base(robot).yaw
        self.let(3.0)
        turned = (self.robots.engine.base(robot).yaw - before + np.pi) % (2 * np.pi) - np.pi
        self.robots.stop(robot)
        self.let(1.0)
        return self.standing(robot), f"{turned / 3.0 - rate:+.3f} rad/s"

    def walks(self, robot: int, speed: float) -> tuple[str, str]:
        """Go straight ahead, by a velocity."""
        self.robots.drive(robot, (speed, 0.0, 0.0))
        self.let(2.0)
        before = self.robots.run.position(robot).copy()
        self.let(4.0)
        gone = float(np.hypot(*(self.robots.run.position(robot) - before)[:2])) / 4.0
        return self.standing(robot), f"{gone - speed:+.3f} m/s"

    def stops(self, robot: int) -> tuple[str, str]:
        """Stand still after going ahead."""
        self.robots.drive(robot, (0.5, 0.0, 0.0))
        self.let(3.0)
        self.robots.stop(robot)
        self.let(2.0)
        before = self.robots.run.position(robot).copy()
        self.let(2.0)
        drift = float(np.linalg.norm(self.robots.run.position(robot) - before))
        return self.standing(robot), f"moves {1e3 * drift:.1f} mm in 2 s"

    def standing(self, robot: int) -> str:
        """Say whether a robot has kept its feet."""
        return "falls" if (robot, "fallen") in self.events else "stands"

    def is_pushed(self) -> tuple[str, str]:
        """Push it on the chest, aside, for a tenth of a second."""
        engine = self.robots.engine
        force = engine.base(H1).rotation.T @ np.array([0.0, 10.0 * _PUSH, 0.0])
        before = self.robots.run.position(H1).copy()
        engine.thrust(H1, ["chest"], force[None])
        self.let(0.1)
        engine.thrust(H1, ["chest"], np.zeros((1, 3)))
        self.let(4.0)
        return self.standing(H1), f"{np.linalg.norm(self.robots.run.position(H1) - before):.2f} m aside"

    def hovers(self) -> tuple[str, str]:
        """Hover 10 m up."""
        target = self.robots.run.position(DRONE) + np.array([0.0, 0.0, 10.0])
        self.robots.set_wind(8.0, 0.0)
        self.robots.fly_to(DRONE, target)
        self.let(10.0)
        off = []
        for _ in range(100):
            self.let(0.1)
            off.append(float(np.linalg.norm(self.robots.run.position(DRONE) - target)))
        self.robots.set_wind(0.0, 0.0)
        self.robots.land(DRONE)
        self.let(20.0, lambda: (DRONE, "landed") in self.events)
        came = "hovers, lands" if (DRONE, "landed") in self.events else "does not land"
        return came, f"{np.mean(off):.2f} m off, at most {max(off):.2f}"

    def finished(self) -> bool:
        """Return whether the arm has nothing to do."""
        return not self.robots.run.work[1].arrays.kind[0]  # type: ignore[union-attr]

    def said(self) -> str:
        """Return what the manipulator said last."""
        return next((kind for who, kind in reversed(self.events) if who == MANIPULATOR), "nothing said")

    def reaches(self) -> tuple[str, str]:
        """Reach a point in the air."""
        target = self.robots.run.position(MANIPULATOR) + np.array([1.2, 0.3, 0.5])
        self.robots.reach(MANIPULATOR, target)
        self.let(40.0, self.finished)
        robots, model = self.robots, self.robots.models[MANIPULATOR]
        chain = robots.run.work[1].chain  # type: ignore[union-attr]
        link = robots.engine.links(MANIPULATOR)[list(model.shapes).index("gripper")]
        off = np.linalg.norm(link[:3, 3] + chain.grip * link[:3, 2] - target)
        return self.said(), f"{1e3 * off:.0f} mm off"

    def parcel(self) -> NDArray[np.float64]:
        """Return where the parcel is."""
        return self.sim.state.objects.position[0].copy()

    def picks(self) -> tuple[str, str]:
        """Have it pick a parcel from the ground, and hold that for five seconds."""
        base = self.robots.engine.base(MANIPULATOR)
        at = base.position + base.rotation @ (1.4, 0.2, 0.0)
        at[2] = float(self.world.height(at))
        shape = [box(_PARCEL, (0, 0, _PARCEL[2] / 2))]
        self.entity = int(self.sim.scenario.add_object("parcel", "parcel", shape, at, size=_PARCEL, yaw=0.5))
        self.robots.pick(MANIPULATOR, self.entity)
        self.let(60.0, self.finished)
        before = self.parcel()[2]
        self.let(5.0)
        return self.said(), f"slips {1e3 * (before - self.parcel()[2]):.1f} mm in 5 s"

    def places(self) -> tuple[str, str]:
        """Put it on the ground."""
        base = self.robots.engine.base(MANIPULATOR)
        target = base.position + base.rotation @ (0.3, 1.5, 0.0)
        target[2] = float(self.world.height(target))
        self.robots.place(MANIPULATOR, target)
        self.let(60.0, self.finished)
        self.let(1.0)
        return self.said(), f"{1e3 * np.hypot(*(self.parcel() - target)[:2]):.0f} mm off"

    def on_deck(self) -> NDArray[np.float64]:
        """Return where the parcel is in the frame of Husky's deck."""
        deck = self.robots.deck(int(self.robots.entities[HUSKY]))
        assert deck is not None
        return np.asarray(deck.rotation.T @ (self.parcel() - deck.position) - deck.centre)

    def loads(self) -> tuple[str, str]:
        """Take it from the ground onto a deck."""
        self.robots.pick(MANIPULATOR, self.entity)
        self.let(60.0, self.finished)
        self.robots.place(MANIPULATOR, int(self.robots.entities[HUSKY]))
        self.let(80.0, self.finished)
        self.let(1.0)
        return self.said(), f"{1e3 * abs(self.on_deck()[2]):.0f} mm above it"

    def carries(self) -> tuple[str, str]:
        """Drive with it."""
        before = self.on_deck()
        self.robots.drive(HUSKY, (-0.6, 0.0, 0.0))
        self.let(5.0)
        self.robots.stop(HUSKY)
        self.let(2.0)
        after = self.on_deck()
        lies = bool(np.all(np.abs(after[:2]) < 0.32) and abs(after[2]) < 0.03)
        return "still on it" if lies else "lost", f"slides {1e3 * np.hypot(*(after - before)[:2]):.0f} mm"


def tables(found: dict[str, dict[str, list[str]]]) -> list[str]:
    """Return the lines of a table of tasks by engine."""
    engines = list(found)
    heads = [f"{engine}: {what}" for engine in engines for what in ("outcome", "error", "times real time")]
    lines = [f"| task | {' | '.join(heads)} |", "|---|" + "---|" * len(heads)]
    for name in found[engines[0]]:
        lines.append(f"| {name} | {' | '.join(cell for engine in engines for cell in found[engine][name])} |")
    return lines
