"""The robot with the arm, by an automaton: goes, looks, picks, loads the carrier, goes along, unloads, puts down."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, Info, Observation
from vico.agents.robot.body import Stance, metres_apart
from vico.agents.robot.deck_trip import AT_GOAL, DeckStep, DeckTrip
from vico.agents.robot.depositor import TAKEN
from vico.agents.robot.driving import Drive
from vico.agents.robot.push_trip import PushTrip
from vico.agents.robot.put_spots import PLACES, goal_about, spot_ahead
from vico.agents.robot.skill import ArmSkill
from vico.agents.robot.stages import ErrandStage as Stage
from vico.agents.robot.team import Team, heard_from, told_seen
from vico.agents.robot.thing_search import ThingSearch, side_of_try
from vico.agents.robot.worker import ArmWorker
from vico.agents.state import AgentState
from vico.english import split_name

Array = NDArray[np.float64]

_CALLS_EVERY = 4.0  # seconds between two calls of the person
_TURN = 0.7  # to look about, rad/s
# How near one comes to regions and to people, metres; how often something is tried.
_AT_SOURCE, _AT_PERSON, _TRIES = 2.5, 3.0, 5
_FAR = 15.0  # metres: nearer to the destination than this nothing is put on a deck
# Seconds of standing that end going along.
_STANDS, _SPEED = 4.0, 0.03


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
        Whether it pushes what its jaw cannot hold.
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
        self.stage = Stage.GO
        self.search = ThingSearch(told)
        self.deck = DeckTrip(team, self.worker, self.drive, period=self.period)
        self.pushes, self.push = pushes, PushTrip(told, team.arm, self.worker, period=self.period)
        self._said = self._stood = 0.0
        self._tries = self._around = 0
        self._began = False
        self._waits_to_say: list[str] = []

    # What it does.

    @property
    def wants_picture(self) -> bool:
        """Whether it looks for the thing, or at what its arm is at, the next time."""
        if self.worker.busy or self.push.busy:
            return self.worker.wants_picture or self.push.wants_picture
        looks = self.stage in (Stage.CALL, Stage.SEARCH) or (self.stage is Stage.GO and self._lies_about)
        return looks and self.search.is_due

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        self.search.pass_time()
        for text in heard_from(observation, self.carrier):
            self.deck.hear(text)
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
        if self._lies_about and self.search.look(observation, info):
            return self._pick()
        action = self.drive.act(observation)
        if not self.drive.busy:
            self._next(Stage.SEARCH if self._lies_about else Stage.CALL)
        return action

    def _call(self, observation: Observation, info: Info) -> Action:
        """Call the person until they have put the thing down."""
        if self.search.look(observation, info) and self.search.lies_low(self._ground(observation)):
            return self._pick()
        self._said += self.period
        if self._said >= _CALLS_EVERY:
            self._said = 0.0
            name = split_name(str(self.told["person"]["name"]))[1]
            return {"type": "communicate", "text": f"{name}, we are here to carry it for you."}
        return self._turn()

    def _search(self, observation: Observation, info: Info) -> Action:
        """Look all about, from one place after the other round the middle."""
        if self.worker.busy:
            return self.worker.act(observation)
        if self.search.look(observation, info):
            return self._pick()
        if self.drive.busy:
            return self.drive.act(observation)
        if self.search.turns():
            return self._turn()
        self.drive.begin(self.search.next_place(), near=1.0)
        return self.drive.act(observation)

    def _picks(self, observation: Observation, info: Info) -> Action:
        action = self.worker.act(observation)
        if self.worker.busy:
            return action
        if self.worker.outcome == "picked":
            self._tries = 0
            self._waits_to_say.append(TAKEN)
            far = metres_apart(Stance.of(observation).position, self.told["destination"]["centre"]) > _FAR
            along = Stage.BRING if self._lies_about else Stage.FOLLOW
            tips_over = self.worker.held is not None and self.worker.held.slender
            self._next(Stage.LOAD if self.uses_deck and far and not tips_over else along)
            return action
        self._tries += 1
        if self.pushes and self.push.helps and self.search.lies_low(self._ground(observation)):
            self._next(Stage.PUSH)
            return action
        return self._search_anew(action)

    def _pushes(self, observation: Observation, info: Info) -> Action:
        """Push what could not be taken up, and look for it again; at the destination leave it."""
        if not self._began:
            self._began = True
            assert self.search.seen is not None
            self.push.begin(self.search.entity, self.search.seen, Stance.of(observation).position)
        action = self.push.act(observation)
        if self.push.busy:
            return action
        if not self.push.is_there:
            return self._search_anew(action)
        self._next(Stage.END)
        return action

    def _search_anew(self, action: Action) -> Action:
        self.search.seen = None
        self.worker.fold()  # a hand left where it failed is in the way of the next try
        self._next(Stage.SEARCH)
        return action

    def _load(self, observation: Observation, info: Info) -> Action:
        """Call the carrier, wait until it stands, and put the thing on its deck."""
        return self._step(self.deck.load(observation))

    def _along(self, observation: Observation, info: Info) -> Action:
        """Send the carrier to the destination, and go there."""
        goal = np.array(self.told["destination"]["centre"][:2], np.float64)
        return self._step(self.deck.go_along(observation, goal, self.search.entity))

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
        at_home = metres_apart(Stance.of(observation).position, self.told["destination"]["centre"]) < AT_GOAL + 3.0
        if self._stood > (_STANDS if at_home else 5.0 * _STANDS):
            self._next(Stage.BRING)
        return {"type": "wait"}

    def _bring(self, observation: Observation, info: Info) -> Action:
        if not self._began:
            self._began = True
            self.drive.begin(goal_about(self.told["destination"]["centre"], self._around), near=AT_GOAL)
        action = self.drive.act(observation)
        if self.drive.busy:
            return action
        if not self.drive.arrived and self._around < PLACES:
            self._around += 1  # the middle itself may be no ground for a robot
            self._began = False
        else:
            self._next(Stage.PLACE)
        return action

    def _places(self, observation: Observation, info: Info) -> Action:
        if not self._began:
            self._began = True
            here, goal = Stance.of(observation), self.told["destination"]["centre"]
            self.worker.place(spot_ahead(goal, here, stand=self.team.arm.stand, tries=self._tries))
        action = self.worker.act(observation)
        if self.worker.busy:
            return action
        self._tries += 1
        if self.worker.outcome != "placed" and self.worker.held is not None and self._tries < 2 * _TRIES:
            self._began = False
        else:
            self._next(Stage.END)
        return action

    # How it does it.

    def _hear_of_it(self, seen: Array | None) -> None:
        """Go where the other robot sees the thing, unless it is in view already."""
        looks = self.stage is Stage.SEARCH or (self.stage is Stage.GO and self._lies_about)
        if seen is None or not looks or metres_apart(seen, self.search.middle) < _AT_SOURCE / 2:
            return
        self._search_about(seen)
        self.drive.begin(self.search.middle, near=_AT_SOURCE / 2, stops=True)

    def _search_about(self, middle: Array) -> None:
        """Look for the thing about another point from now on, ENU metres."""
        self.search.move_to(middle)
        self._next(Stage.SEARCH)

    @property
    def _lies_about(self) -> bool:
        """Whether the thing lies about; else a person has it."""
        return bool(self.told["category"] == "deliver")

    def _ground(self, observation: Observation) -> float:
        """Return how high the ground is beneath it, metres."""
        return float(observation["sensors"]["base_pose"][2]) - self.team.arm.stand

    def _pick(self) -> Action:
        """Pick the thing; where that has failed twice, from one side after the other, until time is out."""
        search = self.search
        assert search.seen is not None
        beside = side_of_try(self._tries // 2) if self._tries >= 2 else None
        self.worker.pick(search.entity, search.seen, beside=beside)
        self._next(Stage.PICK)
        return {"type": "stop"}

    def _turn(self) -> Action:
        return {"type": "control", "space": "velocity", "vector": [0.0, 0.0, _TURN]}

    def _step(self, step: DeckStep) -> Action:
        if step.then is not None:
            self._next(step.then)
        return step.action

    def _next(self, stage: Stage) -> None:
        self.stage, self._began, self._said, self._stood = stage, False, 0.0, 0.0
        self.search.begin()
        self.deck.begin()

    # Saved and restored.

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "worker": self.worker.state(),
            "drive": self.drive.state(),
            "stage": str(self.stage),
            "search": self.search.state(),
            "seconds": [self._said, self._stood],
            "counts": [self._tries, self._around],
            "began": self._began,
            "deck": self.deck.state(),
            "push": self.push.state(),
            "to_say": list(self._waits_to_say),
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self.worker.restore(state["worker"])
        self.drive.restore(state["drive"])
        self.search.restore(state["search"])
        self.stage, self._began = Stage(state["stage"]), bool(state["began"])
        self._said, self._stood = (float(value) for value in state["seconds"])
        self._tries, self._around = (int(value) for value in state["counts"])
        self.deck.restore(state["deck"])
        self.push.restore(state["push"])
        self._waits_to_say = [str(text) for text in state["to_say"]]


_STAGES = {
    Stage.GO: Manipulator._go,
    Stage.CALL: Manipulator._call,
    Stage.SEARCH: Manipulator._search,
    Stage.PICK: Manipulator._picks,
    Stage.PUSH: Manipulator._pushes,
    Stage.LOAD: Manipulator._load,
    Stage.ALONG: Manipulator._along,
    Stage.UNLOAD: Manipulator._unload,
    Stage.FOLLOW: Manipulator._follow,
    Stage.BRING: Manipulator._bring,
    Stage.PLACE: Manipulator._places,
    Stage.END: lambda robot, observation, info: {"type": "stop"},
}
