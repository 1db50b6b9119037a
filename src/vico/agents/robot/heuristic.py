"""The robot with the arm, by an automaton: goes, looks, picks, loads the carrier, goes along, unloads, puts down."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, Info, Observation
from vico.agents.robot.body import Stance
from vico.agents.robot.depositor import TAKEN
from vico.agents.robot.driving import Drive
from vico.agents.robot.pushing import FARTHEST, Pusher
from vico.agents.robot.sight import seen_at
from vico.agents.robot.skill import ArmSkill
from vico.agents.robot.team import Team, deck_spot, heard_from, says_come, told_seen, told_where
from vico.agents.robot.worker import ArmWorker
from vico.agents.state import AgentState

Array = NDArray[np.float64]

# Seconds between two looks for the thing, two calls of the person, and until a carrier is waited for no longer.
_LOOKS_EVERY, _CALLS_EVERY, _WAITS = 0.5, 4.0, 90.0
# Farther away a thing is gone nearer to first, metres.
_SURE = 8.0
# A full turn to look about, rad/s and seconds; places to look from lie on a ring about the middle, metres.
_TURN, _ROUND, _RING, _PLACES = 0.7, 9.5, 4.0, 6
# How near one comes to regions, to people and to where things are put down, metres; how often something is tried.
_AT_SOURCE, _AT_PERSON, _AT_GOAL, _TRIES = 2.5, 3.0, 2.0, 5
# Where the carrier is called to, from the robot with the arm, and how far off it may be, metres.
_ASIDE, _BY = 2.2, 6.0
# Nearer to the destination than this nothing is put on a deck, metres.
_FAR = 15.0
# Things are put down so far ahead, within so much of the middle of the destination, and come to from about it, metres.
_AHEAD, _WITHIN, _ABOUT = 0.75, 2.2, 1.6
# Sides that are tried one after the other are turned by so much, rad: none comes twice.
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))
# Why a thing that cannot be picked is pushed; how often at most, and how far where the destination is not near, metres.
_NO_HOLD = ("too wide for the jaw", "out of reach", "the jaw closed on nothing", "it slipped")
_PUSHES, _ON = 4, 0.6
# Seconds of standing that end going along.
_STANDS, _SPEED = 4.0, 0.03


class Stage(StrEnum):
    """What the robot is at."""

    GO = "go to the source"
    CALL = "call the person"
    SEARCH = "look for the thing"
    PICK = "pick it"
    PUSH = "push it"
    LOAD = "put it on the carrier"
    ALONG = "go along with the carrier"
    UNLOAD = "take it off the carrier"
    FOLLOW = "follow the person"
    BRING = "bring it"
    PLACE = "put it down"
    END = "end"


class Manipulator:
    """Does a task with its arm, and tells the carrier where to come.

    Parameters
    ----------
    told
        What the task tells (`vico.challenges.robot.model.RobotTask.instruction`), and ``period``, seconds.
    team
        The robots' bodies.
    carrier
        Name of the carrier.
    uses_deck
        Whether things travel on the carrier's deck; else in the jaw.
    pushes
        Whether it pushes what its jaw cannot hold: to the destination where that is near, else to where it may.
    worker
        Picks and places; the arm's own skills if None.
    """

    def __init__(
        self,
        told: Mapping[str, Any],
        team: Team,
        *,
        carrier: str,
        uses_deck: bool = True,
        pushes: bool = False,
        worker: ArmSkill | None = None,
    ) -> None:
        self.told, self.team, self.carrier = dict(told), team, carrier
        self.uses_deck = uses_deck and told["category"] == "deliver"
        self.period = float(told["period"])
        self.worker: ArmSkill = ArmWorker(team.arm, period=self.period) if worker is None else worker
        self.drive = Drive(period=self.period)
        self.pushes, self.pusher = pushes, Pusher(team.arm, period=self.period)
        self._pushed = 0
        self.stage = Stage.GO
        self.entity = 0
        self.seen: Array | None = None
        self._middle = np.array(told["source"]["centre"][:2], np.float64)  # about which the thing is looked for
        self._clock = self._looked = self._said = 0.0
        self._tries = self._place = self._around = 0
        self._turned = self._stood = 0.0
        self._began = False
        self._carrier_at: Stance | None = None
        self._waits_to_say: list[str] = []

    # What it does.

    @property
    def wants_picture(self) -> bool:
        """Whether it looks for the thing, or at what its arm is at, the next time."""
        if self.worker.busy or self.pusher.busy:
            return self.worker.wants_picture or self.pusher.wants_picture
        looks = self.stage in (Stage.CALL, Stage.SEARCH) or (self.stage is Stage.GO and self._lies_about)
        return looks and self._clock + self.period - self._looked >= _LOOKS_EVERY

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        self._clock += self.period
        for text in heard_from(observation, self.carrier):
            self._carrier_at = told_where(text) or self._carrier_at
            self._hear_of_it(told_seen(text))
        if self.worker.lost(observation):
            self._search_about(Stance.of(observation).position)
        if self._waits_to_say:
            return {"type": "communicate", "text": self._waits_to_say.pop(0)}
        return _STAGES[self.stage](self, observation, info)

    def _go(self, observation: Observation, info: Info) -> Action:
        """Go to where the thing, or the person, is said to be."""
        if not self._began:
            self._began = True
            near = _AT_SOURCE if self._lies_about else _AT_PERSON
            self.drive.begin(np.array(self.told["source"]["centre"]), near=near, stops=not self._lies_about)
        if self._lies_about and self._look(observation, info):
            return self._pick()
        action = self.drive.act(observation)
        if not self.drive.busy:
            self._next(Stage.SEARCH if self._lies_about else Stage.CALL)
        return action

    def _call(self, observation: Observation, info: Info) -> Action:
        """Call the person until they have put the thing down."""
        if self._look(observation, info, near=_SURE) and self._on_the_ground(observation):
            return self._pick()
        self._said += self.period
        if self._said >= _CALLS_EVERY:
            self._said = 0.0
            name = str(self.told["person"]["name"]).split()[0]
            return {"type": "communicate", "text": f"{name}, we are here to carry it for you."}
        return self._turn()

    def _search(self, observation: Observation, info: Info) -> Action:
        """Look all about, from one place after the other round the middle."""
        if self.worker.busy:
            return self.worker.act(observation)
        if self._look(observation, info):
            return self._pick()
        if self.drive.busy:
            return self.drive.act(observation)
        self._turned += self.period
        if self._turned < _ROUND:
            return self._turn()
        self._turned = 0.0
        turn = 2.0 * math.pi * self._place / _PLACES
        self._place += 1
        ring = _RING * (1 + self._place // _PLACES % 2)
        self.drive.begin(self._middle + ring * np.array([math.cos(turn), math.sin(turn)]), near=1.0)
        return self.drive.act(observation)

    def _picks(self, observation: Observation, info: Info) -> Action:
        action = self.worker.act(observation)
        if self.worker.busy:
            return action
        if self.worker.outcome == "picked":
            self._tries = 0
            self._waits_to_say.append(TAKEN)
            far = _away(Stance.of(observation).position, self.told["destination"]["centre"]) > _FAR
            along = Stage.BRING if self._lies_about else Stage.FOLLOW
            self._next(Stage.LOAD if self.uses_deck and far and not self._tips_over() else along)
            return action
        self._tries += 1
        if self.pushes and self._pushed < _PUSHES and self.worker.why in _NO_HOLD and self._on_the_ground(observation):
            self._next(Stage.PUSH)
            return action
        return self._search_anew(action)

    def _search_anew(self, action: Action) -> Action:
        self.seen = None
        self.worker.fold()  # a hand left where it failed is in the way of the next try
        self._next(Stage.SEARCH)
        return action

    def _push(self, observation: Observation, info: Info) -> Action:
        """Push what could not be taken up, and look for it again; at the destination leave it."""
        assert self.seen is not None
        if not self._began:
            self._began = True
            self.pusher.push(self.entity, self.seen, self._pushed_to(Stance.of(observation).position))
            self._pushed += 1
        action = self.pusher.act(observation)
        if self.pusher.busy:
            return action
        if isinstance(self.worker, ArmWorker):
            self.worker.moved(self.pusher.servos)
        there = self._lies_about and _away(self.pusher.thing, self.told["destination"]["centre"]) < _WITHIN
        if self.pusher.outcome == "pushed" and there:
            self._next(Stage.END)
            return action
        return self._search_anew(action)

    def _pushed_to(self, here: Array) -> Array:
        """Return where a thing is pushed to: the destination, or half a metre on, another way each time, ENU metres."""
        assert self.seen is not None
        thing, goal = self.seen[:2], np.array(self.told["destination"]["centre"][:2], np.float64)
        if self._lies_about and _away(thing, goal) < FARTHEST and self._pushed < 2:
            return goal
        away = thing - here[:2]
        turn = math.atan2(float(away[1]), float(away[0])) + _GOLDEN * self._pushed
        return np.asarray(thing + _ON * np.array([math.cos(turn), math.sin(turn)]))

    def _load(self, observation: Observation, info: Info) -> Action:
        """Call the carrier, wait until it stands, and put the thing on its deck."""
        here = Stance.of(observation)
        if self.worker.busy:
            action = self.worker.act(observation)
            if not self.worker.busy:
                self._next(Stage.ALONG if self.worker.held is None else Stage.BRING)
            return action
        if not self._began:
            self._began, self._carrier_at = True, None
            aside = here.position[:2] - here.rotation[:2, 0] * _ASIDE
            return {"type": "communicate", "text": says_come(*aside.tolist())}
        self._said += self.period
        if self._carrier_at is not None and _away(self._carrier_at.position, here.position) < _BY:
            wide = 0.0 if self.worker.held is None else 2.0 * float(self.worker.held.half[0])
            spot, beside = deck_spot(self.team.deck, self._carrier_at, here.position, wide=wide)
            self.worker.place(spot, beside=beside)
            return self.worker.act(observation)
        if self._said > _WAITS:
            self._next(Stage.BRING)
        return {"type": "stop"}

    def _along(self, observation: Observation, info: Info) -> Action:
        """Send the carrier to the destination, and go there."""
        if not self._began:
            self._began, self._carrier_at = True, None
            x, y = self.told["destination"]["centre"][:2]
            self.drive.begin(np.array([x, y]), near=_AT_GOAL)
            return {"type": "communicate", "text": says_come(x, y)}
        if self.drive.busy:
            return self.drive.act(observation)
        self._said += self.period
        if self._carrier_at is not None:
            spot, beside = deck_spot(self.team.deck, self._carrier_at, Stance.of(observation).position)
            self.worker.pick(self.entity, spot, beside=beside)
            self._next(Stage.UNLOAD)
        elif self._said > 2.0 * _WAITS:
            self._next(Stage.END)
        return {"type": "stop"}

    def _unload(self, observation: Observation, info: Info) -> Action:
        action = self.worker.act(observation)
        if self.worker.busy:
            return action
        if self.worker.outcome == "picked":
            self._tries = 0
            self._next(Stage.BRING)
            return action
        self._tries += 1
        self._next(Stage.ALONG if self._tries < _TRIES else Stage.END)
        return action

    def _follow(self, observation: Observation, info: Info) -> Action:
        """Keep near the person until they stand at home, or have gone in."""
        if not self._began:
            self._began = True
            return {"type": "follow", "agent": str(self.told["person"]["agent"])}
        self._said += self.period
        stands = float(np.abs(observation["sensors"]["base_velocity"][:2]).max()) < _SPEED
        self._stood = self._stood + self.period if stands and self._said > 2.0 * _STANDS else 0.0
        at_home = _away(Stance.of(observation).position, self.told["destination"]["centre"]) < _AT_GOAL + 3.0
        if self._stood > (_STANDS if at_home else 5.0 * _STANDS):
            self._next(Stage.BRING)
        return {"type": "wait"}

    def _bring(self, observation: Observation, info: Info) -> Action:
        if not self._began:
            self._began = True
            self.drive.begin(self._goal(), near=_AT_GOAL)
        action = self.drive.act(observation)
        if self.drive.busy:
            return action
        if not self.drive.arrived and self._around < _PLACES:
            self._around += 1  # the middle itself may be no ground for a robot
            self._began = False
        else:
            self._next(Stage.PLACE)
        return action

    def _places(self, observation: Observation, info: Info) -> Action:
        if not self._began:
            self._began = True
            self.worker.place(self._spot(Stance.of(observation)))
        action = self.worker.act(observation)
        if self.worker.busy:
            return action
        self._tries += 1
        if self.worker.outcome != "placed" and self.worker.held is not None and self._tries < 2 * _TRIES:
            self._began = False
        else:
            self._next(Stage.END)
        return action

    def _rests(self, observation: Observation, info: Info) -> Action:
        return {"type": "stop"}

    # How it does it.

    def _tips_over(self) -> bool:
        """Return whether what is held would not stay upright on a deck that drives over kerbs."""
        return self.worker.held is not None and self.worker.held.slender

    def _hear_of_it(self, seen: Array | None) -> None:
        """Go where the other robot sees the thing, unless it is in view already."""
        looks = self.stage is Stage.SEARCH or (self.stage is Stage.GO and self._lies_about)
        if seen is None or not looks or _away(seen, self._middle) < _AT_SOURCE / 2:
            return
        self._search_about(seen)
        self.drive.begin(self._middle, near=_AT_SOURCE / 2, stops=True)

    def _search_about(self, middle: Array) -> None:
        """Look for the thing about another point from now on, ENU metres."""
        self._middle, self._place = middle[:2].copy(), 0
        self._next(Stage.SEARCH)

    @property
    def _lies_about(self) -> bool:
        """Whether the thing lies about; else a person has it."""
        return bool(self.told["category"] == "deliver")

    def _look(self, observation: Observation, info: Info, *, near: float = _SURE) -> bool:
        """Look for the thing twice a second; return whether it is in view and near."""
        if self._clock - self._looked < _LOOKS_EVERY or "depth" not in observation:
            return False
        self._looked = self._clock
        found, here = seen_at(observation, info, str(self.told["object"])), Stance.of(observation)
        if found is None:
            return False
        self.entity, self.seen = found.entity, here.outside(found.low)
        return _away(self.seen, here.position) <= near

    def _on_the_ground(self, observation: Observation) -> bool:
        """Return whether the thing lies low: nobody has it in hand."""
        ground = float(observation["sensors"]["base_pose"][2]) - self.team.arm.stand
        return self.seen is not None and float(self.seen[2]) - ground < 0.2

    def _pick(self) -> Action:
        """Pick the thing; where that has failed twice, from one side after the other, until time is out."""
        assert self.seen is not None
        turn = _GOLDEN * (self._tries // 2)
        beside = np.array([math.cos(turn), math.sin(turn)]) if self._tries >= 2 else None
        self.worker.pick(self.entity, self.seen, beside=beside)
        self._next(Stage.PICK)
        return {"type": "stop"}

    def _turn(self) -> Action:
        return {"type": "control", "space": "velocity", "vector": [0.0, 0.0, _TURN]}

    def _goal(self) -> Array:
        """Return the middle of the destination, or one place after the other about it, ENU metres."""
        middle = np.array(self.told["destination"]["centre"][:2], np.float64)
        turn = 2.0 * math.pi * self._around / _PLACES
        return middle + (self._around > 0) * _ABOUT * np.array([math.cos(turn), math.sin(turn)])

    def _spot(self, here: Stance) -> Array:
        """Return where to put the thing down: ahead, and near the middle of the destination."""
        middle = np.array(self.told["destination"]["centre"][:2])
        towards = middle - here.position[:2]
        away = float(np.hypot(*towards))
        ahead = towards / away if away > 0.3 else here.rotation[:2, 0]
        c, s = math.cos(0.6 * self._tries), math.sin(0.6 * self._tries)
        ahead = np.array([c * ahead[0] - s * ahead[1], s * ahead[0] + c * ahead[1]])
        reach = min(max(away - _WITHIN, _AHEAD), max(away, _AHEAD))
        spot = here.position[:2] + ahead * reach
        return np.array([*spot, here.position[2] - self.team.arm.stand])

    def _next(self, stage: Stage) -> None:
        self.stage, self._began, self._said, self._stood, self._turned = stage, False, 0.0, 0.0, 0.0

    # Saved and restored.

    def state(self) -> AgentState:
        """Return all it remembers."""
        at = self._carrier_at
        return {
            "worker": self.worker.state(),
            "drive": self.drive.state(),
            "pusher": self.pusher.state(),
            "stage": str(self.stage),
            "entity": self.entity,
            "seen": None if self.seen is None else self.seen.copy(),
            "middle": self._middle.copy(),
            "seconds": [self._clock, self._looked, self._said, self._turned, self._stood],
            "counts": [self._tries, self._place, self._around, self._pushed],
            "began": self._began,
            "carrier": None if at is None else [at.position.copy(), at.rotation.copy()],
            "to_say": list(self._waits_to_say),
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self.worker.restore(state["worker"])
        self.drive.restore(state["drive"])
        self.stage, self.entity, self._began = Stage(state["stage"]), int(state["entity"]), bool(state["began"])
        self.seen = None if state["seen"] is None else np.array(state["seen"])
        self._middle = np.array(state["middle"])
        self._clock, self._looked, self._said, self._turned, self._stood = (float(v) for v in state["seconds"])
        self._tries, self._place, self._around, self._pushed = (int(value) for value in state["counts"])
        self.pusher.restore(state["pusher"])
        at = state["carrier"]
        self._carrier_at = None if at is None else Stance(np.array(at[0]), np.array(at[1]))
        self._waits_to_say = [str(text) for text in state["to_say"]]


def _away(a: Any, b: Any) -> float:
    return float(np.hypot(*(np.asarray(a)[:2] - np.asarray(b)[:2])))


_STAGES = {
    Stage.GO: Manipulator._go,
    Stage.CALL: Manipulator._call,
    Stage.SEARCH: Manipulator._search,
    Stage.PICK: Manipulator._picks,
    Stage.PUSH: Manipulator._push,
    Stage.LOAD: Manipulator._load,
    Stage.ALONG: Manipulator._along,
    Stage.UNLOAD: Manipulator._unload,
    Stage.FOLLOW: Manipulator._follow,
    Stage.BRING: Manipulator._bring,
    Stage.PLACE: Manipulator._places,
    Stage.END: Manipulator._rests,
}
