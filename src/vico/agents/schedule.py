"""The resident: goes where the day's schedule says, on time, and lives a little on the way."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any, Protocol

from vico.agents.activities import Buyer, Clerk, SeatSeeker
from vico.agents.base import Action, AgentState, Info, Observation, Plan, generator_state, restore_generator
from vico.agents.day_plan import DayPlanChanges, ScheduleItem, Stay, plan_of_day, stays_of, with_travel_times
from vico.agents.indoor_walk import IndoorWalker
from vico.agents.residents import Residents
from vico.agents.talk.acquaintance import Acquaintance, acquaintances_of
from vico.agents.talk.answers import HEARING_RANGE, Knowledge, Talk, Talker, moment_of, person_of
from vico.agents.talk.conversation import Conversation, Errand, Speaker
from vico.agents.talk.grammar import activity_of
from vico.agents.talk.memory import ResidentMemory
from vico.agents.travel import Traveller
from vico.agents.wayfinding import Stride, Walker, speed_to_arrive, walking_speeds_of
from vico.clock import DAY
from vico.rules import DOOR_REACH
from vico.seeds import rng
from vico.world.model import Point3
from vico.world.public import PublicMap, PublicPlace

# So many residents are sure to ask for many ways.
_MANY = 40
# Open places are reached this close to their position, metres.
_OPEN_REACH = 3.0
# All of it comes round again after `_ROUND`.
_EAT_EVERY = 6  # seconds between two bites of somebody at rest
_MOVE_EVERY = 180  # seconds between two movements
_DRINK_EVERY = 90  # seconds between two sips
_ROUND = math.lcm(_EAT_EVERY, _MOVE_EVERY, _DRINK_EVERY)
# Those who came out for a walk or a run stay within this distance of the place, metres.
_STROLL = 30.0
_STROLLING = ("leisure", "visit")
_RUNNING = ("exercise",)
_EATING = ("meal_home", "meal_out")
_BUYING = ("shop", "meal_out")
_SERVING = ("work",)
# One looks out of the window again after so many seconds, if nothing happens before: in snow one sets out earlier.
_LOOK_OUT = 900.0
# How often who is stopped indoors steps aside instead of trying again.
_GIVE_WAY = 0.5
# What one comes for on one's feet; for all else one sits where there is a free seat. How often one moves all the same,
# each time it comes round, and how long who got up stays on their feet, seconds.
_STANDING = ("shop", "exercise")
_STIRS, _ON_FEET_FOR = 0.2, (10, 40)
# Others are too near who stands without need, metres, middle to middle.
_TOO_NEAR = 0.8
_STROLL_SPEED, _RUN_SPEED = 0.9, 1.9
# One is not at home there, though one sleeps there.
_LODGINGS = ("hotel", "hostel", "motel", "guest_house")


class Scheduled(Speaker, Protocol):
    """A resident, as the community has them."""

    @property
    def schedule(self) -> Sequence[ScheduleItem]:
        """The day without gaps."""


class ScheduleFollower:
    """Follows a resident's day from observations and the public map alone.

    Sets out when the schedule says, walks the routed way (faster when late), goes through doors, sits, eats, drinks and
    sleeps where that belongs, steps aside, lets cars pass, greets those it knows, remembers, and answers questions.

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
    talk
        How it answers questions; None: in the sentences of templates.
    names
        What people are called whom it sees or hears, by agent.
    """

    def __init__(
        self,
        resident: Scheduled,
        public_map: PublicMap,
        *,
        known: Sequence[Acquaintance] = (),
        seed: int = 0,
        talk: Talk | None = None,
        names: Mapping[str, str] = MappingProxyType({}),
        paces: tuple[float, float] | None = None,
    ) -> None:
        generator = rng(seed, "schedule follower", resident.id)
        self.group: Residents | None = None
        #: Time before which it only waits, unless spoken to, met or moved.
        self.rests_until = -math.inf
        #: What it goes on with until `walks_until` unless it is spoken to, met, moved or stopped.
        self.stride: Stride | None = None
        self.walks_until = -math.inf
        self._name = resident.id
        self._ease, self._haste = paces or walking_speeds_of(resident.age)
        self._map = public_map
        self._stays = with_travel_times(stays_of(resident.schedule, public_map.place_by_id), public_map, self._ease)
        nights = (stay.place for stay in self._stays if stay.type == "sleep")
        self._home = str(getattr(resident, "home", None) or next(nights, ""))
        self._rng = generator
        self._walker = Walker(public_map, generator)
        self._traveller = Traveller(public_map, generator)
        self._indoors = IndoorWalker(resident.id)
        self._seeker = SeatSeeker(self._step_towards)
        self._buyer = Buyer(self._step_towards)
        self._clerk = Clerk(self._step_towards)
        # Whether it is about to sit down.
        self._seeks = False
        self._aside: list[Action] = []
        self._conversation = Conversation(resident, known, generator)
        memory = ResidentMemory(public_map.place_ids)
        people = {person.agent: person for person in known}
        self._talker = Talker(Knowledge(person_of(resident), public_map, people, names, memory, self._stays), talk)
        self._posture = "standing"
        self._changes = DayPlanChanges(public_map, self._stays, seed=seed, name=resident.id, age=resident.age)
        # So that not everybody takes a sip at once.
        self._offset = int(generator.integers(_ROUND))
        self._tried: set[str] = set()
        # The stay it has come for, and the id of where it spends it.
        self._arrived: Stay | None = None
        self._arrived_at = ""
        self._stroll: tuple[float, float] | None = None
        # When a stroll goes on, or one who got up sits down again, seconds.
        self._paused_until = -math.inf
        # Where and until when it stands well, metres and seconds.
        self._settled = (math.inf, math.inf, -math.inf)
        # Whether the last action was to go in somewhere.
        self._went_in = False

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming second."""
        if self.group is not None:
            self.group.forget(self._name)
        self.rests_until, self.stride = -math.inf, None
        self._talker.notice(observation, info)
        if info.get("coming_out"):  # of a door: nobody does anything else meanwhile
            return {"type": "wait"}
        action = self._decide(observation, info)
        self._went_in = action["type"] == "enter"
        return action

    @property
    def acquaintances(self) -> Collection[str]:
        """Agents whom the resident knows."""
        return self._conversation.acquaintances

    @property
    def memory(self) -> ResidentMemory:
        """Whom it saw, where it was and what it heard."""
        return self._talker.knows.memory

    @property
    def encounters(self) -> int:
        """Changes whenever `greeting_times` does."""
        return self._conversation.encounters

    @property
    def greeting_times(self) -> Mapping[str, float]:
        """When the resident last spoke with agents, seconds."""
        return self._conversation.greeting_times

    def has_arrived(self, time: float) -> bool:
        """Return whether it is where it means to be at a time, seconds: not on the way, and not about to leave."""
        stay = self._stay_at(time % DAY)
        return stay is not None and self._arrived == stay

    def plan(self, second: float) -> Plan | None:
        """Return where the day leads next."""
        return plan_of_day(
            self._stays, self._changes.departures, second, self._map, self._walker.way or self._traveller.way
        )

    def state(self) -> AgentState:
        """Return all that decides what is done next, beside the day and the map."""
        arrived = self._arrived
        return {
            "generator": generator_state(self._rng),
            "walker": self._walker.state(),
            "traveller": self._traveller.state() if self._traveller.plans else None,
            "indoors": self._indoors.state(),
            "seeker": self._seeker.state(),
            "buyer": self._buyer.state(),
            "clerk": self._clerk.state(),
            "seeks": self._seeks,
            "conversation": self._conversation.state(),
            "talker": self._talker.state(),
            "aside": [dict(action) for action in self._aside],
            "posture": self._posture,
            "tried": sorted(self._tried),
            "arrived": None if arrived is None else self._stays.index(arrived),
            "arrived_at": self._arrived_at,
            "stroll": None if self._stroll is None else list(self._stroll),
            "paused_until": None if math.isinf(self._paused_until) else self._paused_until,
            "settled": None if math.isinf(self._settled[2]) else list(self._settled),
            "went_in": self._went_in,
            "changes": self._changes.state(),
        }

    def restore(self, state: AgentState) -> None:
        """Go on with the day where a follower of the same resident was."""
        if self.group is not None:
            self.group.forget(self._name)
        restore_generator(self._rng, state["generator"])
        self._walker.restore(state["walker"])
        self._traveller = Traveller(self._map, self._rng)
        if state["traveller"] is not None:
            self._traveller.restore(state["traveller"])
        self._indoors.restore(state["indoors"])
        self._seeker.restore(state["seeker"])
        self._buyer.restore(state["buyer"])
        self._clerk.restore(state["clerk"])
        self._seeks = bool(state["seeks"])
        self._conversation.restore(state["conversation"])
        self._talker.restore(state["talker"])
        arrived, stroll = state["arrived"], state["stroll"]
        self._aside = [dict(action) for action in state["aside"]]
        self._posture, self._tried = state["posture"], set(state["tried"])
        self._arrived, self._arrived_at = None if arrived is None else self._stays[arrived], str(state["arrived_at"])
        self._stroll = None if stroll is None else (float(stroll[0]), float(stroll[1]))
        paused, settled = state["paused_until"], state["settled"]
        self._settled = (math.inf, math.inf, -math.inf) if settled is None else (settled[0], settled[1], settled[2])
        self._paused_until, self._went_in = -math.inf if paused is None else paused, state["went_in"]
        self._changes.restore(state["changes"])

    def _decide(self, observation: Observation, info: Info) -> Action:
        state = observation["state"]
        self._posture = state["posture"]
        self._changes.notice(info)
        stay = self._stay_at(state["time"] % DAY)
        if stay is None:
            return {"type": "wait"}
        place = self._changes.place_of(stay, info, state["place"])
        if state["vehicle"]:
            return self._travel(observation, info, stay, place)
        if self._posture != "lying":
            errand = partial(self._errand, observation, stay, place)
            answer = self._answer(observation, info, lambda: errand().words)
            line = answer or self._conversation.line(observation, info, errand)
            if line is not None:
                return line
        if self._is_there(observation, place):
            return self._stay(observation, info, stay, place)
        self.memory.leave(state["time"])
        up = self._get_up()
        if up is not None:
            return up
        return self._leave(observation, info) if state["room"] else self._walk(observation, info, stay, place)

    def _answer(self, observation: Observation, info: Info, errand: Callable[[], str]) -> Action | None:
        """Answer what is asked, if anything is."""
        if not observation["events"]:
            return None
        answered = self._talker.reply(observation, moment_of(observation, info, self._map, errand))
        if answered is None:
            return None
        self._conversation.meet(answered[0], observation["state"]["time"])
        return {"type": "communicate", "text": answered[1], "range": HEARING_RANGE}

    def _stay_at(self, second: float) -> Stay | None:
        departures = self._changes.departures
        for k in range(len(departures) - 1, -1, -1):
            if second >= departures[k]:
                return self._stays[k]
        return self._stays[0] if self._stays else None

    def _is_there(self, observation: Observation, place: PublicPlace) -> bool:
        state = observation["state"]
        if place.building is not None:
            return bool(state["place"] == place.id)
        x, y = observation["pose"][:2]
        away = math.hypot(x - place.position[0], y - place.position[1])
        # Who came for a walk may go about once there.
        mine = self._arrived is not None and self._arrived_at == place.id
        return not state["room"] and away <= (2 * _STROLL if mine else _OPEN_REACH)

    def _stay(self, observation: Observation, info: Info, stay: Stay, place: PublicPlace) -> Action:
        """Live at the place; out in the open, those who came to move about do."""
        if (self._arrived, self._arrived_at) != (stay, place.id):
            self._arrived, self._arrived_at = stay, place.id
            self._stroll, self._paused_until = None, -math.inf
            self._seeks = False
            self._walker.stop()
            self._traveller.stop()
            self.memory.arrive(observation["state"]["time"], self._stays.index(stay), place.id)
        time = observation["state"]["time"]
        if place.building is not None or stay.tag not in (*_STROLLING, *_RUNNING):
            return self._live(stay, observation, info)
        up = self._get_up()
        if up is not None:
            return up
        if time < self._paused_until:
            return self._rest(time, self._paused_until)
        watched = self._changes.point_to_watch(place)
        if watched is not None:
            self._paused_until = time + int(self._rng.integers(20, 90))
            return {"type": "look_at", "target": list(watched)}
        if self._stroll is None:
            spot = self._map.walkable.random_point(self._rng, near=place.position[:2], radius=_STROLL)
            self._stroll = (float(spot[0]), float(spot[1]))
        pace = min(_RUN_SPEED, self._haste) if stay.tag in _RUNNING else min(_STROLL_SPEED, self._ease)
        action = self._walker.towards(self._stroll, pace, observation, info)
        if action is None:
            self._stroll, self._paused_until = None, time + int(self._rng.integers(4, 16))
            return {"type": "wait"}
        self._go_on(time, pace, stay, (place.position, 0.0, 2 * _STROLL))
        return action

    def _live(self, stay: Stay, observation: Observation, info: Info) -> Action:
        """Do what one came for."""
        time: float = observation["state"]["time"]
        second = math.floor(time)
        tick = second + self._offset
        if stay.type == "sleep":
            return self._sleep(observation, info)
        if self._posture == "lying":
            return self._become("standing")
        step = self._business(stay, observation, info)
        if step is not None:
            return step if self._posture != "sitting" else self._become("standing")
        eats = stay.type == "meal" or stay.tag in _EATING
        if self._posture == "sitting":
            self._seeks = False
        else:
            step = self._settle(stay, eats, observation, info)
            if step is not None:
                return step
        # When a seat may be free again, or it is time to sit down again.
        again = math.inf if self._posture == "sitting" else self._seeker.again("sit")
        again = min((later for later in (again, self._paused_until) if later > time), default=math.inf)
        if eats:
            bite = "" if tick % _EAT_EVERY else "drink" if self._rng.random() < 0.3 else "eat"
            return self._rest(time, min(again, second + _EAT_EVERY - tick % _EAT_EVERY), bite or "wait")
        if tick % _MOVE_EVERY == 0 and self._rng.random() < _STIRS:
            if self._posture == "sitting":
                self._paused_until = time + int(self._rng.integers(*_ON_FEET_FOR))
                return self._become("standing")
            self._seeks = True
            return {"type": "wait"}
        return self._rest(time, min(again, self._next_tick(time)), "wait" if tick % _DRINK_EVERY else "drink")

    def _settle(self, stay: Stay, eats: bool, observation: Observation, info: Info) -> Action | None:
        """Return the next action of sitting down, or else of standing in nobody's way; None where one stands well."""
        time: float = observation["state"]["time"]
        sits = stay.tag not in _STANDING and time >= self._paused_until
        if eats or sits or self._seeks:
            step = self._seeker.towards("sit", observation, info)
            self._seeks = step is not None
            if step is not None:
                return step
        x, y = (float(value) for value in observation["pose"][:2])
        # Who stands well goes on doing so until the next thing to do, whoever comes by: nobody asks who rests.
        if not observation["state"]["room"] or (time < self._settled[2] and self._settled[:2] == (x, y)):
            return None
        self._indoors.notice(observation, info)
        step = self._indoors.aside(observation, _TOO_NEAR)
        if step is None:
            self._settled = x, y, self._next_tick(time)
        return step

    def _next_tick(self, time: float) -> float:
        """Return when it is time for the next sip or move, seconds."""
        second = math.floor(time)
        tick = second + self._offset
        return second + min(_MOVE_EVERY - tick % _MOVE_EVERY, _DRINK_EVERY - tick % _DRINK_EVERY)

    def _business(self, stay: Stay, observation: Observation, info: Info) -> Action | None:
        """Return the next action of buying or serving at a till; None where there is nothing to do at one."""
        errand = f"{stay.due:.0f} {stay.place}"
        if stay.tag in _BUYING:
            return self._buyer.towards(errand, observation, info)
        if stay.tag not in _SERVING:
            return None
        step = self._clerk.towards(errand, observation, info)
        if step == {"type": "wait"}:
            time: float = observation["state"]["time"]
            return self._rest(time, time + _MOVE_EVERY)
        return step

    def _sleep(self, observation: Observation, info: Info) -> Action:
        """Go to bed; who finds none sits down, and looks for one again later."""
        time: float = observation["state"]["time"]
        if self._posture == "lying":
            return self._rest(time, math.inf)
        step = self._seeker.towards("lie", observation, info)
        if step is None and self._posture == "standing":
            step = self._seeker.towards("sit", observation, info)
        if step is not None:
            return step
        later = self._seeker.again("lie")
        return self._rest(time, later if self._posture == "sitting" else min(later, self._seeker.again("sit")))

    def _rest(self, time: float, until: float, now: str = "wait") -> Action:
        """Wait, maybe after a sip or a bite, and say until when nothing else will come of being asked."""
        self.rests_until = min(until, self._next_stay(time))
        return {"type": now}

    def _go_on(self, time: float, pace: float, stay: Stay, around: tuple[Point3, float, float]) -> None:
        """Say what comes of being asked while it walks straight on; `around`: as `Stride.place_x` and on."""
        ahead, ((x, y, _), least, most) = self._walker.straight_on, around
        if ahead is not None:
            paces = pace, stay.due, self._ease, self._haste
            self.stride, self.walks_until = Stride(*ahead, *paces, x, y, least, most), self._next_stay(time)

    def _next_stay(self, time: float) -> float:
        """Return when the next stay begins, or the next day, or it is time to look out of the window again."""
        of_day = time % DAY
        change = next((second for second in self._changes.changes() if second > of_day), DAY)
        # A little early, for the rounding: being asked for nothing costs little.
        return time + min(change - of_day, _LOOK_OUT) - 1e-3

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
        self._traveller.stop()
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
        step = self._step_towards(out["position"], 1.9 if outside else 0.9, observation, info)
        if step is not None:
            return step
        if outside:
            self._tried = set()
            return {"type": "exit"}
        return {"type": "enter", "place": out["to"]}

    def _step_towards(self, point: Sequence[float], near: float, observation: Observation, info: Info) -> Action | None:
        """Return the next action on the way to a point of the room, or near by outdoors; None once within `near` m."""
        state = observation["state"]
        if not state["room"]:
            return self._walker.towards((float(point[0]), float(point[1])), _STROLL_SPEED, observation, info)
        if self._aside:
            return self._aside.pop()
        is_told = "in_view" in info  # who is goes around others
        if not is_told and state["action_status"] == "collision" and self._rng.random() < _GIVE_WAY:
            # Two who want past each other would push for ever: a step aside, somewhere.
            self._aside = [{"type": "move_forward", "distance": float(self._rng.uniform(0.3, 0.8))}]
            side = "turn_left" if self._rng.random() < 0.5 else "turn_right"
            return {"type": side, "degrees": float(self._rng.uniform(60.0, 170.0))}
        self._indoors.notice(observation, info)
        return self._indoors.towards(observation, point, near=near)

    def _walk(self, observation: Observation, info: Info, stay: Stay, place: PublicPlace) -> Action:
        self._arrived = None
        state = observation["state"]
        turned_away = self._went_in and state["action_status"] == "refused"
        if place.id in state["accessible_places"] and not turned_away:
            return {"type": "enter", "place": place.id}
        if stay.mode != "walk":
            return self._travel(observation, info, stay, place)
        goal = (float(place.position[0]), float(place.position[1]))
        left = self._walker.remaining(observation["pose"])
        time_left = stay.due - state["time"] % DAY
        action = self._walker.towards(goal, self._pace(left, time_left), observation, info)
        if action is not None:
            door = place.position if place.building is None else place.entrance or place.position
            near = _OPEN_REACH if place.building is None else DOOR_REACH
            self._go_on(state["time"], math.nan, stay, (door, near, math.inf))
            return action
        return {"type": "enter", "place": place.id} if place.id in state["accessible_places"] else {"type": "wait"}

    def _pace(self, metres: float, seconds: float) -> float:
        return speed_to_arrive(metres, seconds, self._ease, self._haste)

    def _travel(self, observation: Observation, info: Info, stay: Stay, place: PublicPlace) -> Action:
        """Go by bus, tram or bicycle, as the schedule says; where that fails, as one gets there first."""
        state = observation["state"]
        goal = (float(place.position[0]), float(place.position[1]))
        left, time_left = self._traveller.remaining(observation["pose"]), stay.due - state["time"] % DAY
        ride = None if stay.mode == "walk" else (stay.mode, float(state["time"]) + time_left)
        pace = self._pace(left, time_left)
        without = self._changes.avoided_modes
        action = self._traveller.towards(goal, observation, info, speed=pace, ride=ride, without=without)
        if action is not None:
            return action
        return {"type": "enter", "place": place.id} if place.id in state["accessible_places"] else {"type": "wait"}

    def _errand(self, observation: Observation, stay: Stay, place: PublicPlace) -> Errand:
        """Return what one is about."""
        leaves = not self._is_there(observation, place)
        if leaves and place.id == self._home:
            back = f"back to {place.name}" if place.kind in _LODGINGS else "home"
            return Errand(f"on my way {back}", leaves)
        if place.id != stay.place and place.kind != self._map.place_by_id[stay.place].kind:
            # Elsewhere than planned: in a shelter from the rain, at what is on.
            return Errand(f"on my way to {place.name}" if leaves else "here for a while", leaves)
        activity = activity_of(stay.activity if stay.type != "sleep" else self._awake_in(stay, observation))
        if not leaves:
            return Errand(activity.doing, leaves)
        if place.kind == "apartments" or not place.name:
            return Errand(f"on my way {activity.going}", leaves)
        return Errand(f"on my way to {place.name}, {activity.going}", leaves)

    def _awake_in(self, stay: Stay, observation: Observation) -> str:
        """Return what one who speaks in the hours of sleep is about: getting up if most of them is over."""
        k = self._stays.index(stay)
        end = self._stays[k + 1].leave if k + 1 < len(self._stays) else 2 * DAY - stay.due
        return "Get up" if observation["state"]["time"] % DAY > (stay.due + end) / 2 else "Go to bed"


def followers_of(
    community: Any, public_map: PublicMap, *, seed: int = 0, talk: Talk | None = None
) -> dict[str, ScheduleFollower]:
    """Make a follower for every resident of a community, by agent's name; they may be asked as a group.

    Parameters
    ----------
    community
        Anything with ``residents`` and ``relations`` as `vico.community.model.Community` has them.
    talk
        How they answer questions; None: in the sentences of templates (docs/talk.md).
    """
    residents = {resident.id: resident for resident in community.residents}
    if len(residents) >= _MANY:
        public_map.router.learn_landmarks()
    known = acquaintances_of(residents, community.relations)
    names = {name: resident.name for name, resident in residents.items()}
    followers = {
        name: ScheduleFollower(resident, public_map, known=known[name], seed=seed, talk=talk, names=names)
        for name, resident in residents.items()
    }
    group = Residents(followers, public_map.walkable)
    for follower in followers.values():
        follower.group = group
    return followers


__all__ = ["ScheduleFollower", "Stay", "followers_of", "stays_of"]
