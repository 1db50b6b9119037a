"""Changes of a simulation by a task's author before its first step, and answers to its evaluator after."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.errors import InputError
from vico.rules import ride_price
from vico.sim.actions.interaction import hold
from vico.sim.bodies.avatars import free_ground
from vico.sim.bodies.state_arrays import Vehicle
from vico.sim.people import placement
from vico.sim.people.placement import ObjectBox, free_hand, free_spot_on_surface, overlapping_entity
from vico.sim.state.simulation_state import SimulationState
from vico.world.mesh import Surface
from vico.world.model import Point3, Record

# An object that cannot lie where it is asked for lies no farther away than this, metres.
_NEARBY = 2.0


class AddedObject(Record):
    """A call of `Scenario.add_object`, without the shape."""

    call: Literal["add_object"] = "add_object"
    name: str
    prototype: str
    position: Point3
    room: str
    size: Point3
    yaw: float


class HandedObject(Record):
    """A call of `Scenario.hand_object`, without the shape."""

    call: Literal["hand_object"] = "hand_object"
    name: str
    prototype: str
    agent: str
    size: Point3


class PlacedAgent(Record):
    """A call of `Scenario.place_agent`."""

    call: Literal["place_agent"] = "place_agent"
    name: str
    position: tuple[float, ...]
    yaw: float


class GivenCash(Record):
    """A call of `Scenario.give_cash`."""

    call: Literal["give_cash"] = "give_cash"
    name: str
    amount: float


Call = AddedObject | HandedObject | PlacedAgent | GivenCash


class Scenario:
    """Adds objects and places agents, before the first step.

    Parameters
    ----------
    state
        Of the simulation; changed in place.

    Attributes
    ----------
    calls
        What was done, in order: `repeat` does it to another simulation that is made in the same way.
    """

    def __init__(self, state: SimulationState) -> None:
        self._state = state
        self.calls: list[Call] = []

    def repeat(self, call: Call, shapes: Mapping[str, Sequence[Surface]]) -> None:
        """Do what was done to another simulation.

        Parameters
        ----------
        shapes
            Of objects, by prototype.

        Raises
        ------
        InputError
            If it can't be done to this one.
        """
        match call:
            case AddedObject(name=name, prototype=prototype, position=position, room=room, size=size, yaw=yaw):
                self.add_object(name, prototype, shapes[prototype], position, room=room, size=size, yaw=yaw)
            case HandedObject(name=name, prototype=prototype, agent=agent, size=size):
                self.hand_object(name, prototype, shapes[prototype], agent, size=size)
            case PlacedAgent(name=name, position=position, yaw=yaw):
                self.place_agent(name, position, yaw=yaw)
            case GivenCash(name=name, amount=amount):
                self.give_cash(name, amount)

    def add_object(
        self,
        name: str,
        prototype: str,
        shape: Sequence[Surface],
        position: ArrayLike,
        *,
        room: str = "",
        size: ArrayLike = (0.3, 0.3, 0.3),
        yaw: float = 0.0,
    ) -> int:
        """Add a movable object: where it is asked for, or, if something or somebody is there, beside that.

        Parameters
        ----------
        prototype
            Name of its shape; objects of one shape share it.
        shape
            The shape, origin at the middle of its underside, z up.
        position
            Where that origin is to lie, ENU metres; `GroundTruth.object_position` tells where it does.
        room
            Id of the room it lies in; "" outdoors.
        size
            Extents of its box, metres.
        yaw
            Counter-clockwise from east, radians.

        Returns
        -------
        int
            Its entity.

        Raises
        ------
        InputError
            If there is no such room, or no free spot within 2 m on the same surface.
        """
        state = self._state
        if room and room not in state.indoor.index:
            raise InputError(f"add_object: {name}: no room has the id {room!r}")
        index = state.indoor.index[room] if room else -1
        point, extents = np.asarray(position, np.float64), np.asarray(size, np.float64)
        spot = free_spot_on_surface(ObjectBox(extents, yaw), point, index, state, within=_NEARBY)
        if spot is None:
            other = state.entity(overlapping_entity(ObjectBox(extents, yaw), point, index, state))["name"]
            raise InputError(f"add_object: {name}: {other} is there, and no spot within {_NEARBY:g} m is free")
        entity = state.objects.add(name, prototype, spot, index, extents, yaw)
        state.shapes[prototype] = list(shape)
        state.entities[entity] = {"kind": "object", "name": name}
        self.calls.append(
            AddedObject(
                name=name,
                prototype=prototype,
                position=_triple(point),
                room=room,
                size=_triple(extents),
                yaw=float(yaw),
            )
        )
        return entity

    def hand_object(
        self, name: str, prototype: str, shape: Sequence[Surface], agent: str, *, size: ArrayLike = (0.3, 0.3, 0.3)
    ) -> int:
        """Add a movable object that a person holds.

        Parameters
        ----------
        name, prototype, shape, size
            As with `add_object`.
        agent
            Who holds it, in a free hand.

        Returns
        -------
        int
            Its entity.

        Raises
        ------
        InputError
            If nobody has that name, or both hands are full.
        """
        state = self._state
        if agent not in state.people.names:
            raise InputError(f"hand_object: {name}: nobody is called {agent!r}")
        i = state.people.names.index(agent)
        hand = free_hand(i, state)
        if hand is None:
            raise InputError(f"hand_object: {name}: {agent} has no free hand")
        entity = state.objects.add(
            name, prototype, state.people.position[i], int(state.people.room[i]), np.asarray(size, np.float64), 0.0
        )
        state.shapes[prototype] = list(shape)
        state.entities[entity] = {"kind": "object", "name": name}
        hold(state.objects.index(entity), i, hand, state)
        self.calls.append(HandedObject(name=name, prototype=prototype, agent=agent, size=_triple(size)))
        return entity

    def place_agent(self, name: str, position: ArrayLike, *, yaw: float = 0.0) -> None:
        """Stand a person on free ground outdoors near a point.

        Raises
        ------
        InputError
            If nobody has the name, or there is no free ground within 8 m.
        """
        state = self._state
        if name not in state.people.names:
            raise InputError(f"place_agent: nobody is called {name!r}; there are {', '.join(state.people.names)}")
        i = state.people.names.index(name)
        near = np.asarray(position, np.float64)
        spot = free_ground(state.world.walkable, near, state.obstacles_to(i), within=8.0)
        if spot is None:
            raise InputError(f"place_agent: {name}: no free ground within 8 m of {np.asarray(position)[:2].tolist()}")
        placement.put_outdoors(i, spot, yaw, state)
        self.calls.append(PlacedAgent(name=name, position=tuple(near.tolist()), yaw=float(yaw)))

    def give_cash(self, name: str, amount: float) -> None:
        """Let a person carry so much money, instead of what they had.

        Raises
        ------
        InputError
            If nobody has the name, or the amount is negative or no number.
        """
        people = self._state.people
        if name not in people.names:
            raise InputError(f"give_cash: nobody is called {name!r}; there are {', '.join(people.names)}")
        if not 0.0 <= amount < math.inf:
            raise InputError(f"give_cash: {name}: {amount}; give an amount of 0 or more")
        people.cash[people.names.index(name)] = amount
        self.calls.append(GivenCash(name=name, amount=float(amount)))


def _triple(values: ArrayLike) -> Point3:
    x, y, z = np.asarray(values, np.float64).tolist()
    return x, y, z


class GroundTruth:
    """Answers an evaluator's questions from the state itself; agents never get it.

    Parameters
    ----------
    state
        Of the simulation.
    """

    def __init__(self, state: SimulationState) -> None:
        self._state = state

    def object_position(self, name: str) -> NDArray[np.float64]:
        """Return where an object is, ENU metres, shape ``(3,)``."""
        return self._state.objects.position[self._index(name)].copy()

    def object_room(self, name: str) -> str | None:
        """Return the id of the room an object is in; None outdoors."""
        room = int(self._state.objects.room[self._index(name)])
        return self._state.indoor.rooms[room].id if room >= 0 else None

    def object_holder(self, name: str) -> str | None:
        """Return the name of the agent that carries an object; None if nobody does."""
        holder = int(self._state.objects.holder[self._index(name)])
        return self._state.entities[holder]["agent"] if holder else None

    def money(self, name: str) -> float:
        """Return what a person has, less what they owe for rides."""
        i = self._person(name)
        return float(self._state.people.cash[i] - self._state.people.owed[i])

    def bicycle_price(self, name: str) -> float:
        """Return what a person would have to pay who left their bicycle here and now; 0 for who rides none."""
        state = self._state
        i = self._person(name)
        if state.transit is None or state.people.vehicle[i] != Vehicle.BIKE:
            return 0.0
        bicycles = state.transit.bicycles
        bike = int(state.people.vehicle_entity[i]) - bicycles.first_entity
        seconds = float(state.transit.clock[0] - bicycles.since[bike])
        return ride_price(seconds, returned=bicycles.is_at_station(bike))

    def object_entity(self, name: str) -> int:
        """Return the entity of an object, as pictures show it."""
        return int(self._state.objects.entity[self._index(name)])

    def agent_entity(self, name: str) -> int:
        """Return a person's entity, as pictures show it."""
        return int(self._state.people.entity[self._person(name)])

    def agent_position(self, name: str) -> NDArray[np.float64]:
        """Return where a person stands, ENU metres, shape ``(3,)``."""
        return self._state.people.position[self._person(name)].copy()

    def agent_place(self, name: str) -> str | None:
        """Return the id of the place a person is in; None outdoors."""
        place = int(self._state.people.place[self._person(name)])
        return self._state.world.places[place].id if place >= 0 else None

    def agent_room(self, name: str) -> str | None:
        """Return the id of the room a person is in; None outdoors."""
        room = int(self._state.people.room[self._person(name)])
        return self._state.indoor.rooms[room].id if room >= 0 else None

    def _person(self, name: str) -> int:
        names = self._state.people.names
        if name not in names:
            raise InputError(f"nobody is called {name!r}; there are {', '.join(names) or 'none'}")
        return names.index(name)

    def _index(self, name: str) -> int:
        names = self._state.objects.names
        if name not in names:
            raise InputError(f"no object is called {name!r}; there are {', '.join(names) or 'none'}")
        return names.index(name)
