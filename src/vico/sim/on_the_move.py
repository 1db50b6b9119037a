"""How all that moves does at a moment: found once, whatever number of scenes shows it."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.sim.animation import Hands, Transition
from vico.sim.bodies import Drawn
from vico.sim.hands_scene import hands_of_agents
from vico.sim.simulation_state import SimulationState
from vico.sim.state import Posture, Vehicle
from vico.world.heights import HeightField


class Motion(NamedTuple):
    """How people move, one row a person.

    Attributes
    ----------
    clip
        Motion numbers (`clip_index`), int64.
    phase
        Place in the cycle, 0..1 and on, float64.
    speed
        That its strides are those of, metres a second, float64.
    after
        What they did before.
    position
        Feet, ENU metres, float64, shape ``(n, 3)``.
    yaw
        Radians, counter-clockwise from east, float64.
    on_ground
        Whether they stand in the street, not on a floor or a vehicle, bool.
    room
        Where they are, int32; -1 for outdoors and vehicles.
    rise, rise_before
        How far whoever sits is, or was before, above the height at which their feet would rest on the floor, metres,
        float64; 0 for others.
    hands
        What they hold.
    """

    clip: NDArray[np.int64]
    phase: NDArray[np.float64]
    speed: NDArray[np.float64]
    after: Transition
    position: NDArray[np.float64]
    yaw: NDArray[np.float64]
    on_ground: NDArray[np.bool_]
    room: NDArray[np.int32]
    rise: NDArray[np.float64]
    rise_before: NDArray[np.float64]
    hands: Hands

    def of(self, rows: NDArray[np.int64]) -> Motion:
        """Return how some of them move."""
        after = Transition._make(None if part is None else part[rows] for part in self.after)
        hands = Hands._make(part[rows] for part in self.hands)
        plain = {name: getattr(self, name)[rows] for name in self._fields if name not in ("after", "hands")}
        return Motion(after=after, hands=hands, **plain)


def _motion_of_agents(state: SimulationState, height: HeightField) -> Motion:
    """Return how residents and assistants move; who sits in a bus sits as the seat stands, wherever they look."""
    p = state.people
    in_seat = (p.vehicle == Vehicle.BUS) & (p.posture == Posture.SITTING)
    yaw = np.where(in_seat, p.vehicle_yaw, p.yaw)
    before = p.clip_before.astype(np.int64), p.phase_before.copy(), p.pace_before.copy(), p.clip_time.copy()
    on_stairs = (state.indoor.treads_under(p.room) > 0) | ((p.room < 0) & (height.going_at(p.position) > 0))
    over_ground = np.where(on_stairs, np.hypot(*p.velocity.T), p.pace)
    after = Transition(*before, moved=p.moved.copy(), over_ground=over_ground)
    on_ground = (p.room < 0) & (p.vehicle == Vehicle.NONE) & (p.seat < 0) & (p.passing == 0)
    rise = np.zeros(len(p))
    sitting = np.flatnonzero(p.seat >= 0)
    if len(sitting):
        seat = p.seat[sitting]
        yaw[sitting] = state.seats.yaw[seat]
        rise[sitting] = p.position[sitting, 2] - state.seats.floor[seat]
    # Who gets up comes down from the seat to the floor.
    rise_before = np.where(p.seat < 0, p.moved[:, 2], 0.0)
    place = p.position.copy(), yaw, on_ground, p.room.copy(), rise, rise_before, hands_of_agents(state)
    return Motion(p.clip.astype(np.int64), p.phase.copy(), p.pace.copy(), after, *place)


def joined_motion(a: Motion, b: Motion) -> Motion:
    """Return how some people move, and after them others."""
    pairs = {name: (getattr(a.after, name), getattr(b.after, name)) for name in Transition._fields if name != "ground"}
    after = Transition(**{name: np.concatenate(pair) for name, pair in pairs.items()})
    hands = Hands(*(np.concatenate(pair) for pair in zip(a.hands, b.hands, strict=True)))
    plain = [name for name in Motion._fields if name not in ("after", "hands")]
    joined = {name: np.concatenate([getattr(a, name), getattr(b, name)]) for name in plain}
    return Motion(after=after, hands=hands, **joined)


class Moving:
    """What moves in a state as it is now; of no use any more when the state has gone on.

    Parameters
    ----------
    state
        The state.
    height
        Of the ground of its world.
    """

    def __init__(self, state: SimulationState, height: HeightField) -> None:
        self.state, self._height = state, height

    @cached_property
    def agents(self) -> Motion:
        """How residents and assistants move."""
        return _motion_of_agents(self.state, self._height)

    @cached_property
    def shapes(self) -> list[Drawn]:
        """Vehicles, signals, robots and things."""
        state = self.state
        found = [system.draw() for system in (state.traffic, state.transit, state.robots) if system is not None]
        return [*found, state.things.draw()] if len(state.things) else found
