"""Drives over kerbs with a thing in the jaw, or on a carrier's deck: does it stay there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from grasp_trials import LIMIT, PERIOD, step
from numpy.typing import NDArray

from vico.agents.robot.arm_skills import ArmWorker
from vico.agents.robot.body import Stance
from vico.agents.robot.carrier import deck_spot
from vico.agents.robot.grasps import is_slender
from vico.assets.models.movable import movable_colours, movable_prototype, movable_surfaces
from vico.assets.robots import robot_model
from vico.challenges.pick_place.tasks import fitting_kinds
from vico.challenges.robot_tasks import team_of
from vico.envs import Simulation, make
from vico.seeds import rng
from vico.world.world import World

#: What carries: the manipulator's jaw, or the carrier's deck.
SORTS = ("in the jaw", "on the deck")
#: Who carries it.
CARRIERS = ("manipulator", "husky")
#: A drive over a kerb is so long; a kerb is so high at least, metres; so much ground is free on either side.
LENGTH, KERB, FREE = 5.0, 0.02, 0.9
#: How fast one drives and turns, m/s and rad/s; what shifts by more on a deck, or sinks so far in a jaw, was lost.
SPEED, TURN, LOST = 0.6, 0.7, 0.3
# A thing is let go of so high above a deck, and lies there if it is no farther off its spot then, metres.
_ABOVE, _LIES = 0.03, 0.1
_TRIES = 100_000
_ROBOT = "robot_0"

Array = NDArray[np.float64]


class Kerb(NamedTuple):
    """Where a drive over a kerb begins, its heading, and how far it steps up, metres."""

    start: Array
    yaw: float
    rise: float


@dataclass(frozen=True)
class Driven:
    """What came of a drive.

    Attributes
    ----------
    number, sort, kind
        Which; what carried; what was carried.
    began
        Whether the thing was in the jaw, or on the deck, at first.
    lost
        Whether it was not at the end.
    shift
        Metres that it moved against what carried it.
    metres, kerbs
        Driven, and crossed.
    """

    number: int
    sort: str
    kind: str
    began: bool
    lost: bool = False
    shift: float = math.nan
    metres: float = 0.0
    kerbs: int = 0


def kerbs(world: World, sort: int, count: int, *, seed: int) -> list[Kerb]:
    """Return straight drives over one kerb, up or down, with free ground all along: kerbs that ways lead over."""
    highest = robot_model(CARRIERS[sort]).kerb or math.inf
    chance, found = rng(seed, "grasps", "kerbs", sort), []
    along = np.linspace(0.0, LENGTH, 51)
    for _ in range(_TRIES):
        if len(found) == count:
            break
        start = np.asarray(world.walkable.random_point(chance), np.float64)[:2]
        yaw = float(chance.uniform(-math.pi, math.pi))
        line = start + along[:, None] * np.array([math.cos(yaw), math.sin(yaw)])
        if np.abs(line).max() > world.half - 3.0 or float(world.walkable.clearance_at(line).min()) < FREE:
            continue
        rises = np.diff(world.height(line))
        k = int(np.argmax(np.abs(rises)))
        # Beyond what the ground rises anyway.
        rise = float((rises[max(k - 2, 0) : k + 3] - np.median(rises)).sum())
        elsewhere = np.delete(rises, slice(max(k - 2, 0), k + 3))
        if KERB < abs(rise) < highest and np.abs(elsewhere).max() < 0.02 and 1.8 < along[k] < 3.8:
            found.append(Kerb(start, yaw, rise))
    return found


def drive(world: World, kerb: Kerb, number: int, *, seed: int) -> Driven:
    """Drive over a kerb, turn about, and back again."""
    chance = rng(seed, "grasps", "drive", number)
    sort, colours = SORTS[number % 2], list(movable_colours())
    kinds = _kinds(sort)
    kind = kinds[number // 2 % len(kinds)]
    run = _Run(world, kerb, sort, kind, colours[int(chance.integers(len(colours)))], seed=number)
    if not run.load():
        return Driven(number, sort, kind, began=False)
    before, start = run.carried(), run.driven
    for turn in (1.0, -1.0):
        run.go(LENGTH / SPEED, forward=SPEED)
        run.go(math.pi / TURN, turn=turn * TURN)
    shift = float(np.linalg.norm(run.carried() - before))
    lost = shift > LOST or (sort == SORTS[0] and not run.pressed())
    return Driven(number, sort, kind, True, lost, round(shift, 4), round(run.driven - start, 1), run.crossed)


def _kinds(sort: str) -> list[str]:
    """Return what is carried: what would tip over on a deck, robots keep in the jaw."""
    kinds = sorted(fitting_kinds().items())
    return [name for name, kind in kinds if sort == SORTS[0] or not is_slender(min(kind.size[:2]) / 2, kind.size[2])]


class _Run:
    """A robot at a kerb, and a thing."""

    def __init__(self, world: World, kerb: Kerb, sort: str, kind: str, colour: str, *, seed: int) -> None:
        self._team = team_of(robot_model("manipulator"), robot_model("husky"))
        self._worker = ArmWorker(self._team.arm, period=PERIOD)
        self._sort, self._kerb, self._world = sort, kerb, world
        self.driven, self.crossed = 0.0, 0
        held = sort == SORTS[0]
        reach = 0.75 if held else 1.5
        ahead = np.array([math.cos(kerb.yaw), math.sin(kerb.yaw)])
        spot = kerb.start + reach * ahead
        self._at = np.array([*spot, float(world.height(spot))])
        size = fitting_kinds()[kind].size

        def laid(sim: Simulation) -> None:
            shape, prototype = movable_surfaces(kind, colour), movable_prototype(kind, colour)
            sim.scenario.add_object("thing", prototype, shape, self._at, size=size, yaw=kerb.yaw)

        env = make(
            world,
            seed=seed,
            residents=0,
            cars=0,
            pedestrians=0,
            cyclists=0,
            robots=(CARRIERS[SORTS.index(sort)],),
            robot_places={_ROBOT: (float(kerb.start[0]), float(kerb.start[1]), kerb.yaw)},
            periods={_ROBOT: PERIOD},
            observe=(_ROBOT,) if held else (),
            transit=False,
            outputs=("depth", "segmentation"),
            image=192,
            setup=laid,
        )
        self._sim: Simulation = env.sim
        self._told: Any = None
        self._step({"type": "wait"})

    def load(self) -> bool:
        """Pick the thing, or have it lie on the deck; return whether that is so."""
        entity = self._sim.ground_truth.object_entity("thing")
        if self._sort == SORTS[1]:
            objects = self._sim.state.objects
            row = objects.index(entity)
            size = objects.size[row]
            spot = deck_spot(self._team.deck, self._stance(), self._at, wide=float(size[:2].min())).spot
            # Along the deck, as an arm lays it down, and let go of a little above.
            objects.position[row] = spot + np.array([0.0, 0.0, _ABOVE])
            objects.set_yaw(row, self._kerb.yaw + (math.pi / 2 if size[1] > size[0] else 0.0))
            self.go(1.5)
            return bool(np.linalg.norm(self._where() - spot) < _LIES)
        worker = self._worker
        worker.pick(entity, self._where())
        for _ in range(round(LIMIT / PERIOD)):
            action = worker.act(self._told)
            if not worker.busy:
                break
            self._step(action)
        return worker.outcome == "picked" and self.pressed()

    def go(self, seconds: float, *, forward: float = 0.0, turn: float = 0.0) -> None:
        """Drive for so long, m/s and rad/s."""
        for _ in range(round(seconds / PERIOD)):
            before = self._stance().position.copy()
            self._step({"type": "control", "space": "velocity", "vector": [forward, 0.0, turn]})
            after = self._stance().position
            self.driven += float(np.hypot(*(after - before)[:2]))
            self.crossed += self._far(before) != self._far(after)

    def carried(self) -> Array:
        """Return where the thing is in the frame of what carries it: of the base, metres."""
        return self._stance().inside(self._where())

    def pressed(self) -> bool:
        """Return whether both fingers press on something."""
        return float(np.min(self._told["sensors"]["contacts"])) > 4.0

    def _far(self, point: Array) -> bool:
        """Return on which side of the kerb a point is, by the ground's height there."""
        middle = float(self._world.height(self._kerb.start)) + self._kerb.rise / 2
        return float(self._world.height(point[:2])) > middle

    def _stance(self) -> Stance:
        return Stance.of(self._told)

    def _where(self) -> Array:
        return np.array(self._sim.ground_truth.object_position("thing"), np.float64)

    def _step(self, action: dict[str, Any]) -> None:
        self._told = step(self._sim, self._worker, action)
