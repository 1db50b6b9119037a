"""Observations of agents after each step: their own state, what they heard, who is in view, and pictures.

`ObservationBuilder` makes all but the pictures from a state. Observations are made when somebody asks for them
(`Observations`), and wait for their pictures then.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from functools import partial
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.observation_arrays import CrowdObservations
from vico.rules import ActionStatus, code_name
from vico.sim.bodies.arrays import RESIDENT, Bodies
from vico.sim.bodies.seats import Rests, find_rest
from vico.sim.bodies.state_arrays import Posture, Vehicle
from vico.sim.cameras import Views
from vico.sim.people.hearing import ANNOUNCED, known_events
from vico.sim.people.placement import eye_height, has_room_to_sit, place_in_line
from vico.sim.perception import OUTDOORS, AllInView, Viewpoints, in_view, opaque_grid
from vico.sim.state.simulation_state import SimulationState

T = TypeVar("T")


class LazyByName(Mapping[str, T]):
    """Values by name, each made when it is first asked for, and then kept.

    Parameters
    ----------
    names
        In their order.
    make
        Makes the value of the name with a number.
    """

    def __init__(self, names: Sequence[str], make: Callable[[str], T]) -> None:
        self._made: dict[str, T | None] = dict.fromkeys(names)
        self._make = make

    def __getitem__(self, name: str) -> T:
        value = self._made[name]
        if value is None:
            value = self._made[name] = self._make(name)
        return value

    def __iter__(self) -> Iterator[str]:
        return iter(self._made)

    def __len__(self) -> int:
        return len(self._made)

    def __contains__(self, name: object) -> bool:
        return name in self._made

    def __repr__(self) -> str:
        return f"{type(self).__name__}({list(self._made)})"


class ByAgent(LazyByName[dict[str, Any]]):
    """Observations or infos by agent's name; those that nobody asks for are never made.

    Parameters
    ----------
    make_plain
        Makes what needs no pictures.
    make_seen
        Makes the rest, once they are there.

    Attributes
    ----------
    without_pictures
        The same for those who do not look at pictures, and need not wait for them.
    """

    def __init__(
        self,
        names: Sequence[str],
        make_plain: Callable[[str], dict[str, Any]],
        make_seen: Callable[[str], dict[str, Any]],
    ) -> None:
        self.without_pictures = LazyByName(names, make_plain)
        super().__init__(names, lambda name: make_plain(name) | make_seen(name))


class Observations(ByAgent):
    """Observations by agent's name.

    Attributes
    ----------
    crowd
        The same as arrays, without pictures.
    """

    def __init__(
        self,
        names: Sequence[str],
        make_plain: Callable[[str], dict[str, Any]],
        make_seen: Callable[[str], dict[str, Any]],
        crowd: CrowdObservations,
    ) -> None:
        super().__init__(names, make_plain, make_seen)
        self.crowd = crowd


#: How far off signals are told of, metres.
SIGNALS_REACH = 60.0
# Somebody as near as this to where one serves is who serves, metres.
_SERVING_REACH = 0.6

# By number. Looking an enumeration's members up costs more than all the rest.
_VEHICLES = {int(Vehicle.NONE): "", int(Vehicle.BUS): "bus", int(Vehicle.BIKE): "bike"}
_ON_FOOT, _LYING = int(Vehicle.NONE), int(Posture.LYING)
_POSTURES = {int(posture): posture.name.lower() for posture in Posture}
_STATUSES = {int(status): status.name.lower() for status in ActionStatus}


class _Tills:
    """Tills of a moment: who waits at each, and who serves there, is found when it is first asked for."""

    def __init__(self, state: SimulationState) -> None:
        self._state = state
        self._lines: dict[int, list[int]] = {}
        self._serving: dict[int, list[int]] = {}

    def place_of(self, i: int, room: int) -> dict[str, Any] | None:
        """Return where somebody stands in line at the till of its room, or would, and how many are before it there."""
        state = self._state
        if room not in self._lines:
            self._lines[room] = state.lines.waiting(room)
        place = place_in_line(i, state, self._lines[room])
        if place is None:
            return None
        x, y = place[1].tolist()
        waits = bool(state.lines.room[i] == room)
        return {"stand": (x, y, float(state.indoor.floor[room])), "before": place[0], "waits": waits}

    def counter_of(self, i: int, room: int) -> tuple[float, float, float, float] | None:
        """Return where somebody may serve in its room, ENU metres and yaw; None where nobody can, or somebody does."""
        state = self._state
        behind = state.tills[room].behind
        if behind is None:
            return None
        x, y, yaw = behind
        if room not in self._serving:
            p = state.people
            near = (p.room == room) & (np.hypot(p.position[:, 0] - x, p.position[:, 1] - y) < _SERVING_REACH)
            self._serving[room] = near.nonzero()[0].tolist()
        others = [j for j in self._serving[room] if j != i]
        return None if others else (x, y, float(state.indoor.floor[room]), yaw)


def _closed_to(state: SimulationState, i: int) -> list[str]:
    """Return the places that are closed to somebody now: the one they are in, or those at whose doors they stand."""
    p, places = state.people, state.world.places
    if (place := p.place.item(i)) >= 0:
        near = [place]
    else:
        near = [] if p.vehicle.item(i) else state.base.entrances_near(*p.position[i, :2].tolist())
    return [places[k].id for k in near if state.is_locked_out(i, places[k].id)]


class ObservationBuilder:
    """Builder of the observations of a moment, but for pictures.

    Parameters
    ----------
    state
        Of that moment; must stay as it is.
    stances
        As from `vico.sim.observations.agent_poses`.
    who
        Indices of the agents that are told.
    """

    def __init__(self, state: SimulationState, stances: NDArray[np.float64], who: Sequence[int]) -> None:
        self.poses = stances
        self._state = state
        self._index = {name: i for i, name in enumerate(state.names)}
        self._heard = {name: tuple(said) for name, said in state.events.heard.items() if said}
        people = len(state.people)
        # Robots are few, and what they are told lies elsewhere.
        self._robots = {i: agent_state(i, state) for i in who if i >= people}
        self._sensors = (
            {i: state.robots.observation(i - people) for i in self._robots} if state.robots is not None else {}
        )
        chosen = np.asarray(who, np.int64)
        chosen = chosen[chosen < people]
        self._residents = chosen[state.people.kind[chosen] == RESIDENT]
        self._eyes_of = {i: k for k, i in enumerate(self._residents.tolist())}
        self._in_view = bodies_in_view(state, stances, self._residents)
        self._seats_taken: NDArray[np.bool_] | None = None
        self._tills = _Tills(state)
        self._weather = state.environment.record()
        self._signals = state.traffic.signals_shown() if state.traffic is not None else None
        asks = range(people) if state.openings is not None else ()
        self._closed = {i: closed for i in asks if (closed := _closed_to(state, i))}
        self._events = {i: known_events(state, i, stances[i]) for i in who} if len(state.environment.agenda) else {}

    def observation(self, name: str) -> dict[str, Any]:
        """Return one agent's observation."""
        i = self._index[name]
        sensors = {"sensors": self._sensors[i]} if i in self._sensors else {}
        return sensors | {
            "pose": self.poses[i].copy(),
            "events": [message.record() for message in self._heard.get(name, ())],
            "state": self._robots[i] if i in self._robots else agent_state(i, self._state),
        }

    def info(self, name: str) -> dict[str, Any]:
        """Return one agent's info."""
        i = self._index[name]
        p = self._state.people
        code = code_name(p.reason_code.item(i)) if i < len(p) else self._robots[i]["action_code"]
        found: dict[str, Any] = {"action_code": code, "weather": self._weather}
        if i in self._events:
            found["events"] = self._events[i]
        if self._signals is not None and (i >= len(p) or p.room.item(i) < 0):
            x, y = self.poses[i, :2].tolist()
            found["signals"] = self._signals.near(x, y, SIGNALS_REACH)
        if i in self._closed:
            found["closed_now"] = self._closed[i]
        if i < len(p) and p.passing.item(i) < 0:
            found["coming_out"] = True
        if i < len(p) and (inside := p.room.item(i)) in self._state.tills:
            if (till := self._tills.place_of(i, inside)) is not None:
                found["till"] = till
            if (counter := self._tills.counter_of(i, inside)) is not None:
                found["counter"] = counter
        if i not in self._eyes_of:
            return found
        view = self._in_view.of(self._eyes_of[i])
        if (room := p.room.item(i)) >= 0:
            indoor = self._state.indoor
            view.room = indoor.boxes[room]
            view.furniture = indoor.furniture[indoor.furniture_start[room] : indoor.furniture_start[room + 1]]
        return found | {"in_view": view, "rest": self._rest(i)}

    def _rest(self, i: int) -> Rests:
        """Return the nearest free seat and bed, or the way there; none while one rides or lies."""
        p, state = self._state.people, self._state
        if p.vehicle.item(i) != _ON_FOOT or p.posture.item(i) == _LYING:
            return Rests(lambda lies: None)
        here = p.position[i], p.room.item(i)
        clear = partial(has_room_to_sit, i=i, state=state)
        return Rests(
            lambda lies: find_rest(state.seats, state.indoor, here, self._occupied_seats(), lies=lies, has_room=clear)
        )

    def _occupied_seats(self) -> NDArray[np.bool_]:
        if self._seats_taken is None:
            self._seats_taken = self._state.seats_taken()
        return self._seats_taken

    def crowd(self) -> CrowdObservations:
        """Return all agents' observations as arrays."""
        p, n = self._state.people, len(self.poses)
        heard = np.zeros(n, bool)
        heard[[self._index[name] for name in self._heard]] = True
        # What is going on in the city may concern them, too.
        agenda = self._state.environment.agenda
        if len(agenda) > 0 and agenda.has_news:
            heard[:] = True
        heard[list(self._closed)] = True
        heard[[i for i, known in self._events.items() if any(one["known"] != ANNOUNCED for one in known)]] = True
        view = self._in_view
        # The first bodies are the people's, in their order; who else is in view is no agent one would speak to.
        people = view.body < len(p)
        return CrowdObservations(
            index=self._index,
            time=self._state.second,
            pose=self.poses,
            posture=_pad(p.posture, n, Posture.STANDING),
            place=_pad(p.place, n, -1),
            room=_pad(p.room, n, -1),
            heard=heard,
            stopped=_pad(p.status == ActionStatus.COLLISION, n, False),
            viewer=self._residents[view.viewer[people]],
            seen=view.body[people],
            distance=view.distance[people],
        )


def _pad(values: NDArray[Any], length: int, value: int | bool) -> NDArray[Any]:
    """Return values of people with one for each robot behind them."""
    return np.concatenate([values, np.full(length - len(values), value, values.dtype)])


def bodies_in_view(state: SimulationState, stances: NDArray[np.float64], residents: NDArray[np.int64]) -> AllInView:
    """Return what residents, given by their indices, have in view; `stances` as from `poses`."""
    p = state.people
    # The space of each avatar: outdoors, its room, or its bus.
    mine = np.where(p.room >= 0, p.room, OUTDOORS).astype(np.int64)
    in_bus = p.vehicle == Vehicle.BUS
    mine[in_bus] = len(state.indoor.rooms) + p.vehicle_entity[in_bus]
    feet = stances[residents]
    eyes = Viewpoints(
        feet[:, :3] + np.column_stack([np.zeros((len(residents), 2)), eye_height(state)[residents]]),
        p.yaw[residents],
        p.entity[residents],
        mine[residents],
    )
    others = [owner.bodies() for owner in (state.traffic, state.transit, state.robots) if owner is not None]
    bodies = Bodies.joined([p.bodies_of(np.arange(len(p))), *others])
    spaces = np.concatenate([mine, np.full(len(bodies) - len(p), OUTDOORS)])
    sight = state.environment.sight_of(bodies.position, spaces >= 0)
    return in_view(eyes, bodies, spaces, opaque_grid(state.world), state.entities, sight=sight)


def _where_robot_is(robot: int, state: SimulationState) -> dict[str, Any]:
    """Return building, room, place and doors around a robot; empty outdoors."""
    assert state.robots is not None
    inside = int(state.robots.rooms[robot])
    if inside < 0:
        return {"building": "", "room": "", "place": "", "doors": []}
    room, at = state.indoor.rooms[inside], int(state.indoor.place[inside])
    place = state.world.places[at].id if at >= 0 else ""
    return {"building": room.building, "room": room.id, "place": place, "doors": state.doors_in(inside)}


def _vehicle_of(state: SimulationState, i: int) -> str:
    """Return what somebody rides: bus, tram, train or bike; empty for nothing."""
    vehicle = state.people.vehicle.item(i)
    if vehicle == Vehicle.BUS and state.transit is not None:
        return state.transit.service_of(state.transit.with_entity(state.people.vehicle_entity.item(i)))[0]
    return _VEHICLES[vehicle]


def agent_state(i: int, state: SimulationState) -> dict[str, Any]:
    """Return the state part of an agent's observation; empty strings and 0 stand for "none".

    ``doors`` lists the ways out of the room one is in (empty outdoors); ``posture`` is standing, sitting or lying.
    """
    common: Mapping[str, Any] = {"time": float(state.second)}
    p = state.people
    if i >= len(p):
        assert state.robots is not None
        robots, k = state.robots, i - len(p)
        return {
            **common,
            "cash": 0.0,
            "held": [0, robots.held_by_oracle(k)],
            "vehicle": "",
            **_where_robot_is(k, state),
            "accessible_places": [],
            "posture": "standing",
            "action_status": _STATUSES[int(robots.action_status[k])],
            "action_code": code_name(int(robots.reason_code[k])),
            "action_reason": str(robots.reason[k]),
        }
    inside, at, held = p.room.item(i), p.place.item(i), p.held[i].tolist()
    room = state.indoor.rooms[inside] if inside >= 0 else None
    place = state.world.places[at] if at >= 0 else None
    return {
        **common,
        "cash": round(p.cash.item(i), 2),
        "held": held,
        "vehicle": _vehicle_of(state, i),
        "building": room.building if room else "",
        "room": room.id if room else "",
        "place": place.id if place else "",
        "accessible_places": state.accessible_places(i),
        "doors": state.doors_in(p.room.item(i)),
        "posture": _POSTURES[p.posture.item(i)],
        "action_status": _STATUSES[p.status.item(i)],
        "action_code": code_name(p.reason_code.item(i)),
        "action_reason": str(p.reason[i]),
    }


Observation = dict[str, Any]


class ObservationRenderer(Protocol):
    """Renders what agents see; a simulation makes the usual one itself."""

    def render(self, state: SimulationState, poses: NDArray[np.float64], own: NDArray[np.int32]) -> Views:
        """Render one view for each pose in one call.

        Parameters
        ----------
        state
            The state to render.
        poses
            Optical centres (ENU metres) and unit vectors along the optical axes, float64, shape ``(k, 6)``.
        own
            Entity of the body that each view leaves out (the viewer's own), int32, shape ``(k,)``.
        """

    def names(self, entities: Sequence[int]) -> dict[int, dict[str, str]]:
        """Return kind and name of entities that can be seen."""

    def picture_waiter(self) -> Callable[[], None]:
        """Return what to call, from any thread, to wait for the pictures of the last `render`."""

    def rebind(self, sim: Any) -> ObservationRenderer:
        """Return a renderer of another simulation that keeps as much of the scene as it can."""


def agent_poses(state: SimulationState) -> NDArray[np.float64]:
    """Return every agent's x, y, z (ENU metres) and the unit vector it looks along, float64, shape ``(n, 6)``.

    x, y, z is where the agent stands (feet); the camera is `camera_height` above.
    """
    p = state.people
    facing = np.column_stack([np.cos(p.yaw) * np.cos(p.pitch), np.sin(p.yaw) * np.cos(p.pitch), np.sin(p.pitch)])
    mine = np.column_stack([p.position, facing])
    if state.robots is None:
        return mine
    robots = state.robots.bodies()
    ahead = np.column_stack([np.cos(robots.yaw), np.sin(robots.yaw), np.zeros(len(robots))])
    return np.vstack([mine, np.column_stack([robots.position, ahead])])


def observe(
    state: SimulationState,
    seeing: Sequence[int],
    renderer: ObservationRenderer | None,
    *,
    who: Sequence[int] | None = None,
    waits: bool = True,
) -> tuple[Observations, ByAgent]:
    """Return observations and infos of all agents; those in `seeing` get pictures, rendered in one call.

    Parameters
    ----------
    who
        Indices of the agents that observe; None for all. Those in `seeing` are among them.
    waits
        Whether an observation that is asked for waits for its pictures; else see `ObservationRenderer.picture_waiter`.

    Returns
    -------
    tuple
        Observation by name (the outputs asked for, ``extrinsics`` and ``intrinsics`` only for those who see;
        ``sensors`` for robots; ``pose``, ``events``, ``state`` for everybody), and info by name: ``entities``, kind
        and name of what segmentation shows, by entity; ``action_code``; ``weather`` outdoors
        (`vico.sim.environment`); ``signals`` within 60 m outdoors, where a run obeys them
        (`vico.sim.traffic.signals.SignalsShown`); ``events`` of the city that it knows of, where a run has any
        (`vico.sim.people.hearing`); for residents ``in_view``, what is in view by sight lines
        (`vico.sim.perception.InView`), the same with and without pictures, and ``rest``, the nearest free seat
        (``sit``) and bed (``lie``) of the place, or None: its ``entity``, where to ``stand`` before it, and the
        ``door`` (a room's id) to go through where it is in another room. Each is made when it is first asked for, of
        the state as it is now, and waits for its pictures; those of ``without_pictures`` have and await none.
    """
    names = state.names
    chosen = range(len(names)) if who is None else who
    told = ObservationBuilder(_frozen_copy(state), agent_poses(state), chosen)
    seen = None
    if renderer is not None and len(seeing):
        seen = _Pictures(_render_views(state, seeing, told.poses, renderer), renderer, [names[i] for i in seeing])
    asked = [names[i] for i in chosen]

    def pictures(name: str) -> Observation:
        return seen.of(name, waits=waits) if seen is not None else {}

    def entities(name: str) -> dict[str, Any]:
        return {"entities": seen.entities(name) if seen is not None else {}}

    return Observations(asked, told.observation, pictures, told.crowd()), ByAgent(asked, told.info, entities)


class _Pictures:
    """Pictures of some agents, by their names in the order of the views."""

    def __init__(self, views: Views, renderer: ObservationRenderer, names: Sequence[str]) -> None:
        self._views, self._renderer = views, renderer
        self._place = {name: k for k, name in enumerate(names)}

    def of(self, name: str, *, waits: bool) -> Observation:
        """Return an agent's pictures; nothing where it has none."""
        if (k := self._place.get(name)) is None:
            return {}
        views = self._views
        if waits:
            views.wait_for(k)
        pictures = {name: arrays[k] for name, arrays in views.pictures.items()}
        return pictures | {"extrinsics": views.extrinsics[k], "intrinsics": views.intrinsics[k]}

    def entities(self, name: str) -> dict[int, dict[str, str]]:
        """Return kind and name of what an agent's pictures show, by entity; nothing without segmentation."""
        images = self._views.pictures.get("segmentation")
        if (k := self._place.get(name)) is None or images is None:
            return {}
        self._views.wait_for(k)
        return self._renderer.names(distinct_entities(images[k]))


def _render_views(
    state: SimulationState, seeing: Sequence[int], stances: NDArray[np.float64], renderer: ObservationRenderer
) -> Views:
    """Return views of some agents."""
    order = list(seeing)
    cameras = stances.copy()
    people = len(state.people)
    cameras[:people, 2] += eye_height(state)
    if state.robots is not None:
        cameras[people:] = state.robots.cameras()
    cameras = cameras[order]
    own = state.people.entity
    if state.robots is not None:
        own = np.concatenate([own, state.robots.bodies().entity])
    return renderer.render(state, cameras, np.asarray(own[order], np.int32))


def _frozen_copy(state: SimulationState) -> SimulationState:
    """Return a state whose people, robots' outcomes and time stay what they are now."""
    kept = copy(state)
    kept.people = copy(state.people)
    for name, array in state.people.arrays().items():
        setattr(kept.people, name, array.copy())
    return kept


def distinct_entities(image: NDArray[np.int32]) -> list[int]:
    """Return the entities that a picture shows, ascending."""
    flat, width = np.ravel(image), image.shape[1]
    # Beneath the first row, an entity's first pixel is unlike the one before it and the one above; few others are.
    first, below = flat[:width], flat[width:]
    marks = np.empty(len(below), np.bool_)
    _mark_corners(below, flat[width - 1 : -1], flat[: len(below)], marks)
    found = np.concatenate([first, below[np.flatnonzero(marks)]])
    return [int(value) for value in np.unique(found) if value > 0]


@compiled(nogil=True)
def _mark_corners(here, left, above, marks):
    for i in range(len(marks)):
        marks[i] = (here[i] != left[i]) & (here[i] != above[i])
