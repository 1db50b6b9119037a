"""People as they are drawn: their looks and bodies, how these change with clothes, and how everybody moves.

People whom nobody plays, and assistants without a community, have looks that the run's seed chooses. Who is small in
all pictures has a coarse body and roughly placed feet; only pictures know of that, never the state: what happens does
not depend on who looks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.assets.people import PASSERS_BY, Appearance, SkinnedBody, body_of, passer_by
from vico.assets.people.model import dress_for_weather
from vico.community.model import Resident
from vico.errors import InputError
from vico.render.skinning import BodyBatch, batch_bodies
from vico.seeds import rng
from vico.sim.animation import STYLE, Hands, Transition, clip_index, stride_length, style_of
from vico.sim.animation.gait import WALK_START
from vico.sim.animation.motions import pace_on
from vico.sim.bodies.arrays import Drawn
from vico.sim.bodies.state_arrays import Posture, Vehicle
from vico.sim.config import SimConfig
from vico.sim.environment.weather import Weather
from vico.sim.people.placement import habit_of
from vico.sim.pictures.hands import hands_of_agents
from vico.sim.state.simulation_state import SimulationState
from vico.sim.traffic.drawing import PedestrianGaits
from vico.sim.traffic.state import STOP, TALK
from vico.threads import in_order
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.world.world import World

# Who talks goes on for so long, then the other does, s.
_TURN_TO_TALK = 6.0
# Who waits at a stop looks at a phone for the first of these times out of every second one, s.
_AT_PHONE, _EVERY = 28.0, 47.0


def looks_of_strangers(seed: int, count: int) -> list[Appearance]:
    """Return how the people of a run look who have no looks of their own: its assistants first, then its pedestrians.

    Which of the shared looks come, and in which order, is the run's; no two are alike before all have come.
    """
    order = rng(seed, "looks").permutation(PASSERS_BY)
    return [passer_by(int(order[k % PASSERS_BY])) for k in range(count)]


def looks_of(residents: Sequence[Resident], strangers: int, seed: int, weather: Weather) -> list[Appearance]:
    """Return how people look who have dressed for the weather: residents, then strangers."""
    looks = [Appearance.from_dict(resident.appearance) for resident in residents]
    looks += looks_of_strangers(seed, strangers)
    return [dress_for_weather(look, weather.temperature, weather.rain, weather.snow) for look in looks]


def manner_of_pedestrian(pedestrian: int) -> str:
    """Return the name of the random stream that decides how a pedestrian carries itself."""
    return f"pedestrian_{pedestrian}"


class PedestrianMotion(NamedTuple):
    """Motions of pedestrians, as `vico.sim.animation.pose` takes them; arrays of one number each."""

    clip: NDArray[np.int64]
    phase: NDArray[np.float64]
    pace: NDArray[np.float64]
    after: Transition


def pedestrian_motion(gaits: PedestrianGaits, height: NDArray[np.float64], second: float) -> PedestrianMotion:
    """Return motion and place in its cycle of each pedestrian: they walk, stand and breathe, talk, sit, ride.

    Who waits at a stop looks at a phone now and then.

    Parameters
    ----------
    gaits
        How they walk.
    height
        Stature, metres, shape ``(n,)``.
    second
        Seconds since midnight of the first day.
    """
    idle = clip_index("idle")
    walk = np.where(gaits.cycling, clip_index("ride_bike"), clip_index("walk"))
    walking = gaits.time > 0.0
    n = np.arange(len(walking))
    start, stride = np.where(gaits.cycling, 0.0, WALK_START), stride_length(walk, gaits.pace, height)
    on_treads = gaits.treads
    in_stride = (start + gaits.walked / stride + (0.0 if on_treads is None else on_treads.cycles)) % 1.0
    # People at rest breathe by the clock, each at their own time.
    at_rest = (second * 0.5 + n * 0.37 + 0.1) % 1.0
    # Of two who talk one does and the other listens, by turns; one comes right after the other.
    talks = (gaits.standing == TALK) & ((second // _TURN_TO_TALK + n) % 2 == 0)
    still = np.where(gaits.seated, clip_index("ride_bus"), np.where(talks, clip_index("talk"), idle))
    at_rest = np.where(talks, (second / _TURN_TO_TALK * 2.0) % 1.0, at_rest)
    # The phone comes up and goes down within the motion.
    waited = (second + 13.0 * n) % _EVERY
    phones = (gaits.standing == STOP) & ~gaits.seated & ~walking & (waited < _AT_PHONE) & (n % 4 != 0)
    still = np.where(phones, clip_index("phone"), still)
    at_rest = np.where(phones, waited / _AT_PHONE, at_rest)
    after = Transition(
        np.where(walking & ~gaits.cycling, idle, walk),
        np.where(walking & ~gaits.cycling, at_rest, in_stride),
        gaits.pace,
        np.abs(gaits.time),
    )
    pace = gaits.pace
    if on_treads is not None:
        pace, pace_before = (pace_on(depth, gaits.pace, height) for depth in (on_treads.depth, on_treads.depth_before))
        then = (start + on_treads.walked_then / stride + on_treads.cycles_then) % 1.0
        steps = walking & ~gaits.cycling & (on_treads.time < gaits.time)
        after = Transition(
            np.where(steps, walk, after.clip),
            np.where(steps, then, after.phase),
            np.where(steps, pace_before, after.speed),
            np.where(steps, on_treads.time, after.since),
        )
    return PedestrianMotion(np.where(walking, walk, still), np.where(walking, in_stride, at_rest), pace, after)


#: From so many people on there are coarse bodies: making and loading them costs more than they save for fewer.
CROWD = 40
# Who is less tall than this in every picture is far, pixels.
_TALL = 12.0


class ViewingCameras(NamedTuple):
    """From where, and how large, people are seen.

    Attributes
    ----------
    eyes
        ENU metres, float64, shape ``(k, 3)``.
    focal
        Focal lengths, pixels, float64, shape ``(k,)``.
    """

    eyes: NDArray[np.float64]
    focal: NDArray[np.float64]


def far_from_all(
    sights: ViewingCameras, position: NDArray[np.float64], height: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return who is small in all pictures, whichever way these look.

    Parameters
    ----------
    sights
        Of all viewers; without any, nobody is far.
    position
        Where people stand, ENU metres, shape ``(n, 3)``.
    height
        Their statures, metres, shape ``(n,)``.
    """
    if not len(sights.eyes):
        return np.zeros(len(position), np.bool_)
    away = np.hypot(*(sights.eyes[:, None, :2] - position[None, :, :2]).transpose(2, 0, 1))
    tallest = (sights.focal[:, None] / np.maximum(away, 0.1)).max(axis=0) * height
    return np.asarray(tallest < _TALL)


# Metres: of who has no body yet, whom nobody sees.
_USUAL_HEIGHT = 1.7
_Detail = Literal["far", "light", "full"]


class RenderedSimulation(Protocol):
    """What renderers ask of a simulation."""

    @property
    def config(self) -> SimConfig:
        """What the run is asked to be."""

    @property
    def state(self) -> SimulationState:
        """Everybody and everything, as it is now."""

    @property
    def residents(self) -> Sequence[Resident]:
        """Who takes part, the first of its people."""

    @property
    def looks(self) -> Sequence[Appearance]:
        """How people look at the start, in the order of their avatars, and after them the pedestrians."""

    @property
    def world(self) -> World:
        """Where it happens."""

    @property
    def shapes(self) -> Mapping[str, Sequence[Surface]]:
        """Shapes of loose things, by name."""

    def entity(self, entity: int) -> dict[str, str]:
        """Kind and name of an entity."""


class DrawnPeople:
    """Bodies of agents and pedestrians, and what tells their movements apart.

    Parameters
    ----------
    sim
        Whose people they are.
    detail
        Of the bodies.
    far
        Whether a crowd has a second, coarser body each.
    everybody
        Whether all have a body; else those that `choose` is told, and at first nobody.

    Attributes
    ----------
    rows
        Who has a body: numbers of agents, and after them of pedestrians, ascending.
    batch
        Their bodies, and after them those for far away, as `vico.render.skinning.skin` takes them.
    looks
        How everybody looks now.
    style
        A `STYLE` record each, shape ``(n,)``.
    height
        Metres, float64, shape ``(n,)``; a usual one of those who never had a body.
    entities
        int32, shape ``(n,)``.
    habit
        How little each pedestrian minds rain, 0..1, float64.
    """

    def __init__(
        self, sim: RenderedSimulation, *, detail: Literal["light", "full"], far: bool, everybody: bool = True
    ) -> None:
        people, looks = sim.state.people, list(sim.looks)
        walkers = sim.state.traffic.walkers.entity.tolist() if sim.state.traffic is not None else []
        self._detail, self._seed = detail, sim.config.seed
        self._own = [Appearance.from_dict(resident.appearance) for resident in sim.residents]
        # What the looks at the start are for.
        self._clothes = np.tile(sim.state.clothes_at_start, (len(self._own), 1))
        self.looks = looks
        for name in sim.config.worn:
            if name not in people.names:
                there = ", ".join(people.names) or "none"
                raise InputError(f"worn: nobody is called {name!r}; there are {there}")
        self._worn = {name: Path(path) for name, path in sim.config.worn.items()}
        self._names = [*people.names, *(manner_of_pedestrian(k) for k in range(len(walkers)))]
        self._bodies: dict[int, SkinnedBody] = {}
        self._far: dict[int, SkinnedBody] = {}
        self._has_far = far and len(looks) >= CROWD
        self._being_made: dict[Appearance, Future[Any]] = {}
        self._maker: ThreadPoolExecutor | None = None
        self.entities = np.array([*people.entity.tolist(), *walkers], np.int32)
        self.habit = np.array([habit_of(self._seed, name) for name in self._names[len(people) :]], np.float64)
        self.style = np.zeros(len(looks), STYLE)
        self.height = np.full(len(looks), _USUAL_HEIGHT)
        self.rows = np.zeros(0, np.int64)
        self._batch()
        if everybody:
            self.choose(np.arange(len(looks)))

    @property
    def nbytes(self) -> int:
        """Bytes of the bodies."""
        rest = sum(body.triangles.nbytes for bodies in (self._bodies, self._far) for body in bodies.values())
        return self.batch.nbytes + rest

    def choose(self, rows: NDArray[np.int64]) -> None:
        """Have bodies for some, by their numbers, ascending, and for nobody else."""
        if np.array_equal(rows, self.rows):
            return
        wanted = set(rows.tolist())
        for bodies in (self._bodies, self._far):
            for i in bodies.keys() - wanted:
                del bodies[i]
        new = [i for i in rows.tolist() if i not in self._bodies]
        self._bodies |= self._make_bodies(new, self._detail)
        if self._has_far:
            self._far |= self._make_bodies(new, "far")
        for i in new:
            self._describe(i)
        self.rows = rows.copy()
        self._batch()

    def follow(self, state: SimulationState) -> None:
        """Have people look as they are dressed now; bodies are made once a look."""
        wanted = state.people.clothes[: len(self._own)]
        for i in np.flatnonzero(state.people.at_door()[: len(self._own)]).tolist():
            # Who is about to leave home: the body is made before it is needed.
            if i in self._bodies and state.people.door[i] == state.homes[i] and state.people.room[i] >= 0:
                self._prepare(self._look(i, state.weather_to_dress_for()))
        if np.array_equal(wanted, self._clothes):
            return
        changed = []
        for i in np.flatnonzero((wanted != self._clothes).any(axis=1)).tolist():
            look = self._look(i, wanted[i])
            if look != self.looks[i] and self._names[i] not in self._worn:
                self.looks[i] = look
                changed.append(i)
        self._clothes[:] = wanted
        drawn = [i for i in changed if i in self._bodies]
        for i in drawn:
            near, far = self._body(self.looks[i])
            self._bodies[i] = near
            if self._has_far:
                self._far[i] = far
            self._describe(i)
        if drawn:
            self._batch()

    def _look(self, i: int, weather: NDArray[np.float64]) -> Appearance:
        temperature, rain, snow = weather.tolist()
        return dress_for_weather(self._own[i], temperature, rain, snow)

    def _prepare(self, look: Appearance) -> None:
        """Begin to make a body."""
        if look in self._being_made or look in self.looks:
            return
        if self._maker is None:
            self._maker = ThreadPoolExecutor(1, "bodies")
        self._being_made[look] = self._maker.submit(self._make, look)

    def _make(self, look: Appearance) -> tuple[SkinnedBody, SkinnedBody]:
        near = body_of(look, detail=self._detail)
        return near, body_of(look, detail="far") if self._has_far else near

    def _body(self, look: Appearance) -> tuple[SkinnedBody, SkinnedBody]:
        """Return somebody's body from near and far, waiting for it if it is being made."""
        begun = self._being_made.pop(look, None)
        return self._make(look) if begun is None else begun.result()

    def _make_bodies(self, rows: Sequence[int], detail: _Detail) -> dict[int, SkinnedBody]:
        """Make bodies, those of a look once; who wears one of their own has it in any detail."""
        kinds = list(dict.fromkeys(self.looks[i] for i in rows))
        made = dict(zip(kinds, in_order(partial(body_of, detail=detail), kinds), strict=True))
        bodies = {i: made[self.looks[i]] for i in rows}
        for name, path in self._worn.items():
            from vico.assets.people.custom_body import fit_custom_body  # few wear anything of their own

            k = self._names.index(name)
            if k in bodies:
                bodies[k] = fit_custom_body(bodies[k], path) if detail != "far" else self._bodies[k]
        return bodies

    def _describe(self, i: int) -> None:
        """Note what tells somebody's movements apart."""
        body, look = self._bodies[i], self.looks[i]
        self.style[i] = style_of(body, rng(self._seed, "manner", self._names[i]), age=look.age)
        self.height[i] = body.height

    def _batch(self) -> None:
        rows = self.rows.tolist()
        bodies = [self._bodies[i] for i in rows] + [self._far[i] for i in rows if self._has_far]
        entities = self.entities[self.rows].tolist()
        self.batch: BodyBatch = batch_bodies(bodies, entities * (2 if self._has_far else 1))
        # Their vertices are kept once.
        self._bodies = {i: self.batch.body(k, self._bodies[i]) for k, i in enumerate(rows)}
        if self._has_far:
            self._far = {i: self.batch.body(k, self._far[i]) for k, i in enumerate(rows, len(rows))}


class PersonMotion(NamedTuple):
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

    def of(self, rows: NDArray[np.int64]) -> PersonMotion:
        """Return how some of them move."""
        after = Transition._make(None if part is None else part[rows] for part in self.after)
        hands = Hands._make(part[rows] for part in self.hands)
        plain = {name: getattr(self, name)[rows] for name in self._fields if name not in ("after", "hands")}
        return PersonMotion(after=after, hands=hands, **plain)


def concatenate_motion(a: PersonMotion, b: PersonMotion) -> PersonMotion:
    """Return how some people move, and after them others."""
    pairs = {name: (getattr(a.after, name), getattr(b.after, name)) for name in Transition._fields if name != "ground"}
    after = Transition(**{name: np.concatenate(pair) for name, pair in pairs.items()})
    hands = Hands(*(np.concatenate(pair) for pair in zip(a.hands, b.hands, strict=True)))
    plain = [name for name in PersonMotion._fields if name not in ("after", "hands")]
    joined = {name: np.concatenate([getattr(a, name), getattr(b, name)]) for name in plain}
    return PersonMotion(after=after, hands=hands, **joined)


class MovingBodies:
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
    def agents(self) -> PersonMotion:
        """How residents and assistants move."""
        state = self.state
        p = state.people
        # Who sits in a bus sits as the seat stands, wherever they look.
        in_seat = (p.vehicle == Vehicle.BUS) & (p.posture == Posture.SITTING)
        yaw = np.where(in_seat, p.vehicle_yaw, p.yaw)
        before = p.clip_before.astype(np.int64), p.phase_before.copy(), p.pace_before.copy(), p.clip_time.copy()
        on_stairs = (state.indoor.treads_under(p.room) > 0) | ((p.room < 0) & (self._height.going_at(p.position) > 0))
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
        return PersonMotion(p.clip.astype(np.int64), p.phase.copy(), p.pace.copy(), after, *place)

    @cached_property
    def shapes(self) -> list[Drawn]:
        """Vehicles, signals, robots and things."""
        state = self.state
        found = [system.draw() for system in (state.traffic, state.transit, state.robots) if system is not None]
        return [*found, state.things.draw()] if len(state.things) else found
