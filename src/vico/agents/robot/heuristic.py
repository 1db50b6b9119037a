"""The robot with the arm, by an automaton: goes, looks, picks, loads the carrier, goes along, unloads, puts down.

`ObjectSearch` says what was seen of the thing of a task, and from where to look next. A thing that the jaw cannot hold
is pushed (`PushTrip`): to the destination where that is near, else to where it may be held.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, AgentState, FieldState, Info, Observation
from vico.agents.requester import TAKEN_TEXT
from vico.agents.robot.arm_interface import ArmSkill
from vico.agents.robot.arm_interface import ErrandStage as Stage
from vico.agents.robot.arm_skills import ArmWorker
from vico.agents.robot.body import ArmBody, Drive, Stance, ground_distance, object_in_view
from vico.agents.robot.carrier import AT_GOAL, DeckStep, DeckTrip, Team, messages_from, parse_sighting
from vico.agents.robot.pushing import FARTHEST, Pusher
from vico.english import split_name

Array = NDArray[np.float64]

#: Places round a middle that are tried one after the other.
PUT_PLACES = 6
#: Things are put down within so much of the middle of the destination, metres.
GOAL_RADIUS = 2.2
# So far ahead things are put down, and come to from about the middle, metres.
_PUT_AHEAD, _GOAL_RING = 0.75, 1.6


def placement_ahead(centre: Sequence[float], here: Stance, *, stand: float, tries: int) -> Array:
    """Return where to put a thing down: ahead, and near the middle of the destination, ENU metres, shape ``(3,)``.

    Parameters
    ----------
    stand
        Height of the base's frame above the ground, metres.
    tries
        How often it was tried: each time it is another spot.
    """
    middle = np.array(centre[:2])
    towards = middle - here.position[:2]
    away = float(np.hypot(*towards))
    ahead = towards / away if away > 0.3 else here.rotation[:2, 0]
    c, s = math.cos(0.6 * tries), math.sin(0.6 * tries)
    ahead = np.array([c * ahead[0] - s * ahead[1], s * ahead[0] + c * ahead[1]])
    reach = min(max(away - GOAL_RADIUS, _PUT_AHEAD), max(away, _PUT_AHEAD))
    spot = here.position[:2] + ahead * reach
    return np.array([*spot, here.position[2] - stand])


# Seconds between two looks.
_LOOKS_EVERY = 0.5
#: Farther away a thing is gone nearer to first, metres.
RELIABLE_DISTANCE = 8.0
_TURN_TIME = 9.5  # seconds of a full turn to look about
_VIEWPOINT_RING = 4.0  # metres from the middle to the places to look from
_VIEWPOINTS = 6  # number of them
# So high above the ground something is in a hand, metres.
_LOW = 0.2
# Sides that are tried one after the other are turned by so much, rad: none comes twice.
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))


def approach_side(number: int, first: float = 0.0) -> Array:
    """Return the side of a thing from which it is tried, a unit vector on the map, shape ``(2,)``.

    Parameters
    ----------
    first
        Heading of the side that is tried first, rad.
    """
    turn = first + _GOLDEN * number
    return np.array([math.cos(turn), math.sin(turn)])


class ObjectSearch:
    """What a robot knows of where its thing is.

    Parameters
    ----------
    told
        What the task tells; see `vico.agents.robot.heuristic.Manipulator`.

    Attributes
    ----------
    entity, seen
        Of the thing, as it was in view last; where it stood, ENU metres; 0 and None before.
    middle
        About which it is looked for, ENU metres, shape ``(2,)``.
    """

    def __init__(self, told: Mapping[str, Any]) -> None:
        self._name, self._period = str(told["object"]), float(told["period"])
        self.entity = 0
        self.seen: Array | None = None
        self.middle = np.array(told["source"]["centre"][:2], np.float64)
        self._clock = self._looked = self._turned = 0.0
        self._place = 0

    @property
    def is_due(self) -> bool:
        """Whether it looks the next time."""
        return self._clock + self._period - self._looked >= _LOOKS_EVERY

    def pass_time(self) -> None:
        """Let a period pass."""
        self._clock += self._period

    def look(self, observation: Observation, info: Info, *, near: float = RELIABLE_DISTANCE) -> bool:
        """Look for the thing twice a second; return whether it is in view and near."""
        if self._clock - self._looked < _LOOKS_EVERY or "depth" not in observation:
            return False
        self._looked = self._clock
        found, here = object_in_view(observation, info, self._name), Stance.of(observation)
        if found is None:
            return False
        self.entity, self.seen = found.entity, here.outside(found.low)
        return ground_distance(self.seen, here.position) <= near

    def lies_low(self, ground: float) -> bool:
        """Return whether the thing was seen low above a height of the ground, metres: nobody has it in hand."""
        return self.seen is not None and float(self.seen[2]) - ground < _LOW

    def move_to(self, middle: Array) -> None:
        """Look about another point from now on, ENU metres."""
        self.middle, self._place = middle[:2].copy(), 0

    def begin(self) -> None:
        """Begin a turn."""
        self._turned = 0.0

    def turns(self) -> bool:
        """Return whether the robot turns on; else it goes to the `next_place`."""
        self._turned += self._period
        if self._turned < _TURN_TIME:
            return True
        self._turned = 0.0
        return False

    def next_place(self) -> Array:
        """Return where to look from next: one place after the other round the middle, ENU metres, shape ``(2,)``."""
        turn = 2.0 * math.pi * self._place / _VIEWPOINTS
        self._place += 1
        ring = _VIEWPOINT_RING * (1 + self._place // _VIEWPOINTS % 2)
        return np.asarray(self.middle + ring * np.array([math.cos(turn), math.sin(turn)]))

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "entity": self.entity,
            "seen": None if self.seen is None else self.seen.copy(),
            "middle": self.middle.copy(),
            "seconds": [self._clock, self._looked, self._turned],
            "place": self._place,
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self.entity, self._place = int(state["entity"]), int(state["place"])
        self.seen = None if state["seen"] is None else np.array(state["seen"])
        self.middle = np.array(state["middle"])
        self._clock, self._looked, self._turned = (float(value) for value in state["seconds"])


# Why a thing that cannot be picked is pushed; how often at most, and how far where the destination is not near, metres.
_NO_HOLD = ("too wide for the jaw", "out of reach", "the jaw closed on nothing", "it slipped")
_MAX_PUSHES, _PUSH_ON = 4, 0.6
# So often the destination itself is what it is pushed to.
_HOME_TRIES = 2


class PushTrip(FieldState):
    """Pushes the thing of a task, another way each time.

    Parameters
    ----------
    told
        What the task tells; see `vico.agents.robot.heuristic.Manipulator`.
    body, worker
        The arm, and what picks and places with it.
    period
        Seconds between two actions.

    Attributes
    ----------
    is_there
        Whether the last push brought the thing to the destination.
    """

    _pusher: Pusher
    _pushed: int = 0
    is_there: bool = False

    def __init__(self, told: Mapping[str, Any], body: ArmBody, worker: ArmSkill, *, period: float) -> None:
        self._goal = np.array(told["destination"]["centre"][:2], np.float64)
        self._brings = told["category"] == "deliver"
        self._worker, self._pusher = worker, Pusher(body, period=period)

    @property
    def busy(self) -> bool:
        """Whether it is at work."""
        return self._pusher.busy

    @property
    def wants_picture(self) -> bool:
        """Whether it looks at the thing the next time."""
        return self._pusher.wants_picture

    @property
    def helps(self) -> bool:
        """Whether pushing may help where the last pick failed."""
        return self._pushed < _MAX_PUSHES and self._worker.why in _NO_HOLD

    def begin(self, entity: int, thing: Array, here: Array) -> None:
        """Begin to push a thing that stands at a point, both ENU metres."""
        self._pusher.push(entity, thing, self._to(thing[:2], here[:2]))
        self._pushed += 1
        self.is_there = False

    def act(self, observation: Observation) -> Action:
        """Return the action for the coming period; once it is not busy the arm's servos are the worker's again."""
        action = self._pusher.act(observation)
        if not self._pusher.busy:
            if isinstance(self._worker, ArmWorker):
                self._worker.set_servos(self._pusher.servos)
            came = self._pusher.outcome == "pushed"
            self.is_there = came and self._brings and ground_distance(self._pusher.thing, self._goal) < GOAL_RADIUS
        return action

    def _to(self, thing: Array, here: Array) -> Array:
        """Return where a thing is pushed to: the destination, or half a metre on, another way each time."""
        if self._brings and ground_distance(thing, self._goal) < FARTHEST and self._pushed < _HOME_TRIES:
            return self._goal
        away = thing - here
        first = math.atan2(float(away[1]), float(away[0]))
        return np.asarray(thing + _PUSH_ON * approach_side(self._pushed, first))


_CALLS_EVERY = 4.0  # seconds between two calls of the person
_TURN = 0.7  # to look about, rad/s
_AT_SOURCE = 2.5  # metres to which one comes near to a source
_AT_PERSON = 3.0  # metres to which one comes near to people
_TRIES = 5  # how often something is tried
_FAR = 15.0  # metres: nearer to the destination than this nothing is put on a deck
# Seconds of standing that end going along.
_STANDS, _SPEED = 4.0, 0.03


class Manipulator:
    """Does a task with its arm, and tells the carrier where to come.

    Parameters
    ----------
    told
        What the task tells (`vico.challenges.robot.tasks.RobotTask.instruction`), and ``period``, seconds.
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
        self.search = ObjectSearch(told)
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
        for text in messages_from(observation, self.carrier):
            self.deck.hear(text)
            self._hear_of_it(parse_sighting(text))
        if self.worker.has_lost(observation):
            self._search_about(Stance.of(observation).position)
        if self._waits_to_say:
            return {"type": "communicate", "text": self._waits_to_say.pop(0)}
        return _ERRAND_STAGES[self.stage](self, observation, info)

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
            self._waits_to_say.append(TAKEN_TEXT)
            far = ground_distance(Stance.of(observation).position, self.told["destination"]["centre"]) > _FAR
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
        at_home = ground_distance(Stance.of(observation).position, self.told["destination"]["centre"]) < AT_GOAL + 3.0
        if self._stood > (_STANDS if at_home else 5.0 * _STANDS):
            self._next(Stage.BRING)
        return {"type": "wait"}

    def _bring(self, observation: Observation, info: Info) -> Action:
        if not self._began:
            self._began = True
            # To the middle of the destination; after failed tries, to places around it.
            middle = np.array(self.told["destination"]["centre"][:2], np.float64)
            turn = 2.0 * math.pi * self._around / PUT_PLACES
            offset = (self._around > 0) * _GOAL_RING * np.array([math.cos(turn), math.sin(turn)])
            self.drive.begin(middle + offset, near=AT_GOAL)
        action = self.drive.act(observation)
        if self.drive.busy:
            return action
        if not self.drive.arrived and self._around < PUT_PLACES:
            self._around += 1  # the middle itself may be no ground for a robot
            self._began = False
        else:
            self._next(Stage.PLACE)
        return action

    def _places(self, observation: Observation, info: Info) -> Action:
        if not self._began:
            self._began = True
            here, goal = Stance.of(observation), self.told["destination"]["centre"]
            self.worker.place(placement_ahead(goal, here, stand=self.team.arm.stand, tries=self._tries))
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
        if seen is None or not looks or ground_distance(seen, self.search.middle) < _AT_SOURCE / 2:
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
        beside = approach_side(self._tries // 2) if self._tries >= 2 else None
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


_ERRAND_STAGES = {
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
