"""The resident: goes where the day's schedule says, on time, and lives a little on the way."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Protocol

from vico.agents.base import Action, Info, Observation
from vico.agents.conversation import Acquaintance, Conversation, Speaker
from vico.agents.indoor_walk import IndoorWalker
from vico.agents.state import AgentState, generator_state, restore_generator
from vico.agents.wayfinding import Walker
from vico.clock import DAY, seconds_of_day
from vico.seeds import rng
from vico.world.public import PublicMap, PublicPlace

WALK, BRISK, RUN = 1.0, 1.5, 2.4
# Time kept in hand for corners, crossings and doors: a share of the way, and seconds.
_SLACK_SHARE, _SLACK = 0.15, 20.0
# Open places are reached this close to their position, metres.
_OPEN_REACH = 3.0
_EAT_EVERY = 6
# Those who came out for a walk or a run stay within this distance of the place, metres.
_STROLL = 30.0
_STROLLING = ("leisure", "visit")
_RUNNING = ("exercise",)
_EATING = ("meal_home", "meal_out")
# How often who is stopped indoors steps aside instead of trying again.
_GIVE_WAY = 0.5
_STROLL_SPEED, _RUN_SPEED = 0.9, 1.9


class Item(Protocol):
    """A stretch of the day, as the community's schedules have it."""

    @property
    def type(self) -> str:
        """sleep, meal, main or commute."""

    @property
    def tag(self) -> str | None:
        """What it is about, as `vico.community.model.ActivityTag` has it; None if nobody said."""

    @property
    def start(self) -> str:
        """``HH:MM:SS``."""

    @property
    def end(self) -> str:
        """``HH:MM:SS``."""

    @property
    def activity(self) -> str:
        """What for, in words."""

    @property
    def place(self) -> str | None:
        """Id of the place; None on the way."""


class Scheduled(Speaker, Protocol):
    """A resident, as the community has them."""

    @property
    def schedule(self) -> Sequence[Item]:
        """The day without gaps."""


@dataclass(frozen=True)
class Stay:
    """To be at a place by `due`, and to set out at `leave`, seconds of the day; `tag` says what for."""

    leave: float
    due: float
    type: str
    tag: str
    activity: str
    place: str


def stays_of(schedule: Iterable[Item], known: Mapping[str, object]) -> list[Stay]:
    """Return the stays of a day, each with the time to set out; items without a place on the map are left out."""
    stays: list[Stay] = []
    leave: float | None = None
    for item in schedule:
        if str(item.type) == "commute":
            leave = seconds_of_day(item.start) if leave is None else leave
            continue
        if item.place is None or item.place not in known:
            continue
        due = seconds_of_day(item.start)
        when = due if leave is None else leave
        stays.append(Stay(when, due, str(item.type), str(item.tag or ""), item.activity, item.place))
        leave = None
    return stays


def with_ways(stays: Sequence[Stay], public_map: PublicMap) -> list[Stay]:
    """Give those stays time for the way whose schedule has none: two doors of one building may lie streets apart."""
    found = list(stays[:1])
    for before, stay in pairwise(stays):
        if stay.leave == stay.due and before.place != stay.place:
            places = public_map.place_by_id
            way = public_map.router.seconds(places[before.place].position, places[stay.place].position, WALK)
            if math.isfinite(way):
                stay = replace(stay, leave=max(before.due, stay.due - way * (1.0 + _SLACK_SHARE) - _SLACK))
        found.append(stay)
    return found


class ScheduleFollower:
    """Follows a resident's day from observations and the public map alone.

    Sets out when the schedule says, walks the routed way (faster when late), goes through doors, sits, eats, drinks
    and sleeps where that belongs, steps aside for others, lets cars pass, and greets those it knows.

    Parameters
    ----------
    resident
        Whose day it is.
    public_map
        Streets and places.
    known
        Whom the resident knows.
    seed
        Of the run.
    """

    def __init__(
        self, resident: Scheduled, public_map: PublicMap, *, known: Sequence[Acquaintance] = (), seed: int = 0
    ) -> None:
        generator = rng(seed, "schedule follower", resident.id)
        self._map = public_map
        self._stays = with_ways(stays_of(resident.schedule, public_map.place_by_id), public_map)
        self._rng = generator
        self._walker = Walker(public_map, generator)
        self._indoors = IndoorWalker()
        self._aside: list[Action] = []
        self._conversation = Conversation(resident, known, generator)
        self._posture = "standing"
        self._tick = 0
        self._tried: set[str] = set()
        self._arrived: Stay | None = None
        self._stroll: tuple[float, float] | None = None
        self._pause = 0
        # The type of the last action that was asked for.
        self._asked = ""

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming second."""
        action = self._decide(observation, info)
        self._asked = str(action["type"])
        return action

    def state(self) -> AgentState:
        """Return all that decides what is done next, beside the day and the map."""
        arrived = self._arrived
        return {
            "generator": generator_state(self._rng),
            "walker": self._walker.state(),
            "indoors": self._indoors.state(),
            "conversation": self._conversation.state(),
            "aside": [dict(action) for action in self._aside],
            "posture": self._posture,
            "tick": self._tick,
            "tried": sorted(self._tried),
            "arrived": None if arrived is None else self._stays.index(arrived),
            "stroll": None if self._stroll is None else list(self._stroll),
            "pause": self._pause,
            "asked": self._asked,
        }

    def restore(self, state: AgentState) -> None:
        """Go on with the day where a follower of the same resident was."""
        restore_generator(self._rng, state["generator"])
        self._walker.restore(state["walker"])
        self._indoors.restore(state["indoors"])
        self._conversation.restore(state["conversation"])
        arrived, stroll = state["arrived"], state["stroll"]
        self._aside = [dict(action) for action in state["aside"]]
        self._posture, self._tick, self._tried = state["posture"], state["tick"], set(state["tried"])
        self._arrived = None if arrived is None else self._stays[arrived]
        self._stroll = None if stroll is None else (float(stroll[0]), float(stroll[1]))
        self._pause, self._asked = state["pause"], state["asked"]

    def _decide(self, observation: Observation, info: Info) -> Action:
        self._tick += 1
        state = observation["state"]
        self._posture = state["posture"]
        stay = self._stay_at(state["time"] % DAY)
        if stay is None:
            return {"type": "wait"}
        place = self._map.place_by_id[stay.place]
        if self._posture != "lying":
            line = self._conversation.line(observation, info, _errand(stay, place, self._is_there(observation, place)))
            if line is not None:
                return line
        if self._is_there(observation, place):
            return self._stay(observation, info, stay, place)
        up = self._get_up()
        if up is not None:
            return up
        return self._leave(observation, info) if state["room"] else self._walk(observation, info, stay, place)

    def _stay_at(self, second: float) -> Stay | None:
        current = None
        for stay in self._stays:
            if second >= stay.leave:
                current = stay
        return current or (self._stays[0] if self._stays else None)

    def _is_there(self, observation: Observation, place: PublicPlace) -> bool:
        state = observation["state"]
        if place.building is not None:
            return bool(state["place"] == place.id)
        x, y = observation["pose"][:2]
        away = math.hypot(x - place.position[0], y - place.position[1])
        # Who came for a walk may go about once there.
        mine = self._arrived is not None and self._arrived.place == place.id
        return not state["room"] and away <= (2 * _STROLL if mine else _OPEN_REACH)

    def _stay(self, observation: Observation, info: Info, stay: Stay, place: PublicPlace) -> Action:
        """Live at the place; out in the open, those who came to move about do."""
        if self._arrived != stay:
            self._arrived, self._stroll, self._pause = stay, None, 0
            self._walker.stop()
        if place.building is not None or stay.tag not in (*_STROLLING, *_RUNNING):
            return self._live(stay)
        up = self._get_up()
        if up is not None:
            return up
        if self._pause > 0:
            self._pause -= 1
            return {"type": "wait"}
        if self._stroll is None:
            spot = self._map.walkable.random_point(self._rng, near=place.position[:2], radius=_STROLL)
            self._stroll = (float(spot[0]), float(spot[1]))
        pace = _RUN_SPEED if stay.tag in _RUNNING else _STROLL_SPEED
        action = self._walker.towards(self._stroll, pace, observation, info)
        if action is None:
            self._stroll, self._pause = None, int(self._rng.integers(3, 15))
            return {"type": "wait"}
        return action

    def _live(self, stay: Stay) -> Action:
        """Do what one came for."""
        if stay.type == "sleep":
            return self._become("lying")
        if stay.type == "meal" or stay.tag in _EATING:
            if self._posture != "sitting":
                return self._become("sitting")
            if self._tick % _EAT_EVERY == 0:
                return {"type": "drink" if self._rng.random() < 0.3 else "eat"}
            return {"type": "wait"}
        if self._posture == "lying":
            return self._become("standing")
        if self._tick % 40 == 0 and self._rng.random() < 0.5:
            return self._become("sitting" if self._posture == "standing" else "standing")
        if self._tick % 90 == 45:
            return {"type": "drink"}
        return {"type": "wait"}

    def _become(self, posture: str) -> Action:
        if posture == self._posture:
            return {"type": "wait"}
        if self._posture == "lying":
            return {"type": "wake"}
        if posture == "standing":
            return {"type": "stand"}
        return {"type": "sit" if posture == "sitting" else "sleep"}

    def _get_up(self) -> Action | None:
        return None if self._posture == "standing" else self._become("standing")

    def _leave(self, observation: Observation, info: Info) -> Action:
        """Walk to the door that leads out, and through it."""
        self._walker.stop()
        state = observation["state"]
        doors = state["doors"]
        out = next((door for door in doors if door["to"] == "outside"), None)
        if out is None:
            # A room further in: doors are listed with the way to the street first.
            self._tried.add(state["room"])
            out = next((door for door in doors if door["to"] not in self._tried), doors[0] if doors else None)
        if out is None:
            return {"type": "wait"}
        outside = out["to"] == "outside"
        if self._aside:
            return self._aside.pop()
        if state["action_status"] == "collision" and self._rng.random() < _GIVE_WAY:
            # Two who want past each other would push for ever: a step aside, somewhere.
            self._aside = [{"type": "move_forward", "distance": float(self._rng.uniform(0.3, 0.8))}]
            side = "turn_left" if self._rng.random() < 0.5 else "turn_right"
            return {"type": side, "degrees": float(self._rng.uniform(60.0, 170.0))}
        self._indoors.notice(observation, info)
        step = self._indoors.towards(observation, out["position"], near=1.9 if outside else 0.9)
        if step is not None:
            return step
        if outside:
            self._tried = set()
            return {"type": "exit"}
        return {"type": "enter", "place": out["to"]}

    def _walk(self, observation: Observation, info: Info, stay: Stay, place: PublicPlace) -> Action:
        self._arrived = None
        state = observation["state"]
        turned_away = self._asked == "enter" and state["action_status"] == "refused"
        if place.id in state["accessible_places"] and not turned_away:
            return {"type": "enter", "place": place.id}
        goal = (float(place.position[0]), float(place.position[1]))
        left = self._walker.remaining(observation["pose"])
        time_left = stay.due - state["time"] % DAY
        action = self._walker.towards(goal, self._speed(left, time_left), observation, info)
        if action is not None:
            return action
        return {"type": "enter", "place": place.id} if place.id in state["accessible_places"] else {"type": "wait"}

    def _speed(self, metres: float, seconds: float) -> float:
        """Walk at ease while there is time, briskly when it gets short, and run when late."""
        needed = metres * (1.0 + _SLACK_SHARE) / max(1.0, seconds - _SLACK)
        if needed <= WALK:
            return WALK
        return needed if needed <= BRISK else min(RUN, max(BRISK, needed))


def followers_of(community: Any, public_map: PublicMap, *, seed: int = 0) -> dict[str, ScheduleFollower]:
    """Make a follower for every resident of a community, by agent's name.

    Parameters
    ----------
    community
        Anything with ``residents`` and ``relations`` as `vico.community.model.Community` has them.
    """
    residents = {resident.id: resident for resident in community.residents}
    known: dict[str, list[Acquaintance]] = {name: [] for name in residents}
    for relation in community.relations:
        first, second = relation.between
        for me, other in ((first, second), (second, first)):
            if me in residents and other in residents:
                known[me].append(Acquaintance(other, residents[other].name, str(relation.kind), relation.note))
    return {
        name: ScheduleFollower(resident, public_map, known=known[name], seed=seed)
        for name, resident in residents.items()
    }


def _errand(stay: Stay, place: PublicPlace, there: bool) -> str:
    """Return what one is about, to follow "I'm "."""
    doing = stay.activity.split(": ")[-1]
    doing = doing[:1].lower() + doing[1:]
    home = place.kind == "apartments"
    if there:
        return f"at home, about to {doing}" if home else f"here to {doing}"
    return "on my way home" if home else f"on my way to {place.name}, to {doing}"


__all__ = ["ScheduleFollower", "Stay", "followers_of", "stays_of"]
