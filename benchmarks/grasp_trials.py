"""Trials of an arm's skills alone: a manipulator, one thing, a table, a carrier; real physics, a real camera."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.arm_skills import ArmWorker
from vico.agents.robot.body import Stance
from vico.agents.robot.carrier import deck_spot
from vico.assets.models.movable import movable_colours, movable_prototype, movable_surfaces
from vico.assets.robots import robot_model
from vico.assets.shapes import box
from vico.challenges.pick_place.tasks import TABLE, fitting_kinds, level_field
from vico.challenges.robot_tasks import team_of
from vico.envs import Simulation, make
from vico.geometry import rotation_matrix
from vico.seeds import rng
from vico.world.model import Point3

#: Seconds between two actions, as in the challenge; that a piece of work may last; that things are given to rest.
PERIOD, LIMIT, RESTS = 0.05, 120.0, 1.0
#: A thing was picked once it was moved so far, is so high above what is below it, metres, and both fingers press, N.
MOVED, UP, PRESSED = 0.08, 0.02, 4.0
#: A thing was placed within so much of its spot, and of its height; it stands if it leans by less, radians; metres.
NEAR, LEVEL, UPRIGHT = 0.10, 0.03, 0.35
#: What things are taken from, and put down on.
SURFACES, TARGETS = ("ground", "table"), ("ground", "table", "deck")
#: Boxes of random sides beside the kinds of things: gripped side, the others, metres.
BOX, _GRIPPED, _OTHERS = "random box", (0.06, 0.17), (0.08, 0.30)
_SIDE = 192  # of pictures, pixels
_TABLE_AT, _TABLE_HEIGHTS = (3.0, 0.0), (0.35, 0.75)
_ARM, _CARRIER = "robot_0", "robot_1"

Array = NDArray[np.float64]


class Thing(NamedTuple):
    """What is picked: its kind, extents at rest, and colour."""

    kind: str
    size: Point3
    colour: str


@dataclass(frozen=True)
class Trial:
    """What came of one thing.

    Attributes
    ----------
    number, kind, surface, target
        Which trial; what was picked, what from, and where it was put down.
    picked, pick_cause, pick_seconds, tries
        Whether it was in the jaw and up; else why not; simulated seconds; attempts.
    placed, place_cause, place_seconds, off, leans
        The same of putting it down: metres off its spot, radians off upright. None where nothing was picked.
    said
        What the worker itself said of the pick; empty if that was right.
    processor_seconds
        Of it all.
    """

    number: int
    kind: str
    surface: str
    target: str
    picked: bool
    pick_cause: str
    pick_seconds: float
    tries: int
    said: str
    placed: bool | None = None
    place_cause: str = ""
    place_seconds: float = 0.0
    off: float = math.nan
    leans: float = math.nan
    processor_seconds: float = 0.0


def trial(number: int, *, seed: int = 0) -> Trial:
    """Pick one thing and put it down; the same number and seed give the same trial."""
    began = time.process_time()
    chance = rng(seed, "grasps", number)
    thing = _thing(chance, number)
    surface, target = SURFACES[number % 2], TARGETS[number // 2 % 3]
    scene = Scene(chance, thing, surface, target, seed=number)
    found = scene.pick()
    if found["picked"]:
        found |= scene.place()
    return Trial(number, thing.kind, surface, target, **found, processor_seconds=round(time.process_time() - began, 2))


def _thing(chance: np.random.Generator, number: int) -> Thing:
    """Return what a trial is about: kinds in turn, on either surface, random boxes among them."""
    kinds = [*sorted(fitting_kinds()), BOX]
    kind = kinds[number // 2 % len(kinds)]
    colours = list(movable_colours())
    colour = colours[int(chance.integers(len(colours)))]
    if kind != BOX:
        return Thing(kind, fitting_kinds()[kind].size, colour)
    sides = [float(chance.uniform(*_GRIPPED)), *(float(v) for v in chance.uniform(*_OTHERS, 2))]
    flat = sides[:2] if chance.random() < 0.5 else sides[1::-1]
    return Thing(kind, (flat[0], flat[1], sides[2]), colour)


def step(sim: Simulation, worker: ArmWorker, action: dict[str, Any]) -> dict[str, Any]:
    """Advance by a period; return what the arm observes then, with a picture where its worker looks next."""
    sim.look_away = () if worker.wants_picture else (_ARM,)
    sim.act({_ARM: action})
    sim.advance(PERIOD)
    observation: dict[str, Any] = sim.observe([_ARM])[0][_ARM]
    return observation


class Scene:
    """A field with what a trial needs, and the worker."""

    def __init__(self, chance: np.random.Generator, thing: Thing, surface: str, target: str, *, seed: int) -> None:
        self.thing, self.surface, self.target = thing, surface, target
        self.top = float(chance.uniform(*_TABLE_HEIGHTS))
        self.team = team_of(robot_model("manipulator"), robot_model("husky"))
        self.worker = ArmWorker(self.team.arm, period=PERIOD)
        x, y = _TABLE_AT
        table = "table" in (surface, target)
        # Within reach from the side of the table that the robot comes from.
        near = x - TABLE[0] / 2 + 0.04 + min(thing.size[:2]) / 2 + float(chance.uniform(0.04, 0.12))
        bearing, away = float(chance.uniform(-0.6, 0.6)), float(chance.uniform(1.0, 2.2))
        on_table = np.array([near, y + float(chance.uniform(-0.25, 0.25)), self.top])
        on_ground = np.array([away * math.cos(bearing), away * math.sin(bearing), 0.0])
        if table and surface == "ground":
            on_ground[0] = min(on_ground[0], 1.6)
        self.at = on_table if surface == "table" else on_ground
        self.spot = on_table if target == "table" else np.array([0.2, -float(chance.uniform(1.5, 2.5)), 0.0])
        places: dict[str, Point3] = {_ARM: (0.0, 0.0, float(chance.uniform(-math.pi, math.pi)))}
        robots = ("manipulator",)
        if target == "deck":
            robots = ("manipulator", "husky")
            places[_CARRIER] = (-1.0, float(chance.uniform(2.4, 3.2)), float(chance.uniform(-math.pi, math.pi)))
        yaw = float(chance.uniform(-math.pi, math.pi))
        env = make(
            level_field(seed, table=(x, y, self.top) if table else None),
            seed=seed,
            residents=0,
            robots=robots,
            robot_places=places,
            periods=dict.fromkeys(places, PERIOD),
            observe=(_ARM,),
            transit=False,
            outputs=("depth", "segmentation"),
            image=_SIDE,
            setup=lambda sim: self._add(sim, yaw),
        )
        self.sim: Simulation = env.sim
        self.told = self._step({"type": "wait"})
        self.entity = self.sim.ground_truth.object_entity("thing")

    def _add(self, sim: Simulation, yaw: float) -> None:
        kind, size, colour = self.thing
        shape = [box(size, (0.0, 0.0, size[2] / 2))] if kind == BOX else movable_surfaces(kind, colour)
        prototype = f"box {size}" if kind == BOX else movable_prototype(kind, colour)
        sim.scenario.add_object("thing", prototype, shape, self.at, size=size, yaw=yaw)

    # What is done.

    def pick(self) -> dict[str, Any]:
        """Pick the thing; return what came of it."""
        self.worker.pick(self.entity, self.at)
        seconds, ended, why = self._work()
        self._rest()
        moved = float(np.linalg.norm(self._where() - self.at))
        picked = moved > MOVED and self._clear() > UP and self._pressed() > PRESSED
        said = "" if picked == (ended == "picked") else ended
        cause = "" if picked else why or "dropped"
        return {
            "picked": picked, "pick_cause": cause, "pick_seconds": seconds, "tries": self.worker.tries, "said": said,
        }  # fmt: skip

    def place(self) -> dict[str, Any]:
        """Put down what is held; return what came of it."""
        beside, spot = None, self.spot
        if self.target == "deck":
            wide = 0.0 if self.worker.held is None else 2.0 * float(self.worker.held.half[0])
            spot, beside = deck_spot(self.team.deck, self._carrier(), self._where(), wide=wide)
        self.worker.place(spot, beside=beside)
        seconds, _, why = self._work()
        self._rest()
        before = self._where()
        self._rest(PERIOD)
        still = float(np.linalg.norm(self._where() - before)) < 0.02 * PERIOD
        off, leans = float(np.hypot(*(self._middle() - spot)[:2])), self._leans()
        low = before[2] - self._below(self.target)
        cause = ""
        if why or self._pressed() > PRESSED / 2:
            cause = why or "still held"
        elif abs(low) > LEVEL and leans < UPRIGHT:
            cause = "fell off"
        elif off > NEAR + (0.05 if leans >= UPRIGHT else 0.0):
            cause = "off its spot"
        elif not still:
            cause = "moves"
        return {
            "placed": not cause, "place_cause": cause, "place_seconds": seconds, "off": round(off, 4),
            "leans": round(leans, 3),
        }  # fmt: skip

    def _work(self) -> tuple[float, str, str]:
        """Have the worker act until it is done; return simulated seconds, what came of it, and why it failed."""
        for k in range(round(LIMIT / PERIOD)):
            action = self.worker.act(self.told)
            if not self.worker.busy:
                return round(k * PERIOD, 2), self.worker.outcome, self.worker.why
            self.told = self._step(action)
        return LIMIT, "failed", f"out of time at {self.worker.stage}"

    def _rest(self, seconds: float = RESTS) -> None:
        for _ in range(max(round(seconds / PERIOD), 1)):
            self.told = self._step({"type": "stop"})

    def _step(self, action: dict[str, Any]) -> dict[str, Any]:
        return step(self.sim, self.worker, action)

    # What is so.

    def _where(self) -> Array:
        return np.array(self.sim.ground_truth.object_position("thing"), np.float64)

    def _middle(self) -> Array:
        """Return the middle of the thing's box: where it lies on its side, that is not above its underside."""
        objects = self.sim.state.objects
        row = objects.index(self.entity)
        up = rotation_matrix(objects.orientation[row])[:, 2]
        return np.asarray(objects.position[row] + up * objects.size[row, 2] / 2)

    def _leans(self) -> float:
        row = self.sim.state.objects.index(self.entity)
        return float(math.acos(np.clip(rotation_matrix(self.sim.state.objects.orientation[row])[2, 2], -1.0, 1.0)))

    def _pressed(self) -> float:
        return float(np.min(self.told["sensors"]["contacts"]))

    def _clear(self) -> float:
        """Return how high the thing's underside is above the table, where that is below it, or the ground, metres."""
        off = np.abs(self._where()[:2] - _TABLE_AT) - np.array(TABLE) / 2
        over = "table" in (self.surface, self.target) and float(off.max()) < min(self.thing.size[:2]) / 2
        return float(self._where()[2]) - (self.top if over else 0.0)

    def _carrier(self) -> Stance:
        return Stance.of(self.sim.observe([_CARRIER])[0][_CARRIER])

    def _below(self, surface: str) -> float:
        """Return how high a surface is, metres."""
        if surface == "deck":
            return float(self._carrier().outside((self.team.deck.recess or self.team.deck).centre)[2])
        return self.top if surface == "table" else 0.0
