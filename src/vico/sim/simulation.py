"""The loop: one outer second after the other, ten sub-steps each, seeded and repeatable."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico import __version__
from vico.errors import InputError
from vico.sim import moves, rides, spawn, systems
from vico.sim.actions import Command, Refusal, check
from vico.sim.avatars import Avatars, free_ground
from vico.sim.bodies import ASSISTANT, KINDS, RESIDENT, Bodies, HasBodies
from vico.sim.config import DAY, SUBSTEP, SUBSTEPS, SimConfig
from vico.sim.effects import perform
from vico.sim.events import Event, Events
from vico.sim.indoor import Indoor
from vico.sim.observations import Eyes, Observation, observe
from vico.sim.snapshot import copied, part, read_snapshot, state_hash, write_snapshot
from vico.sim.stage import Stage
from vico.sim.state import FIRST_ASSISTANT, FIRST_RESIDENT, FIRST_ROBOT, REASON_LENGTH, Goods, People, Status
from vico.sim.timetable import Punctuality, appointments
from vico.world.folder import World
from vico.world.mesh import Surface
from vico.world.seeds import rng

if TYPE_CHECKING:
    from vico.community.model import Community

Trouble = tuple[Status, str]
_NOWHERE = 2**30


@dataclass(frozen=True)
class StepResult:
    """What a step brought.

    Attributes
    ----------
    observations, infos
        By agent; see `vico.sim.observations.observe`.
    events
        What happened in the step.
    hash
        Of the state after it.
    """

    observations: dict[str, Observation]
    infos: dict[str, dict[str, Any]]
    events: list[Event]
    hash: str


@dataclass
class Metrics:
    """Counts and seconds of a run so far."""

    steps: int = 0
    collisions: int = 0
    refused: int = 0
    seconds: dict[str, float] = field(default_factory=dict)


class Simulation:
    """A world, its people, and time.

    Parameters
    ----------
    world
        Where it happens.
    community
        Whose residents take part; None for nobody.
    config
        What the run is asked to be.
    eyes
        Renders what agents see; None makes the usual one the first time it is needed.
    colours_later
        RGB of observations is worked on while the next step goes on: faster where nobody but a recorder looks at it.
        It must not be read before `Simulation.colours` was called.

    Raises
    ------
    InputError
        If the community belongs to another world, or a name is unknown.
    """

    def __init__(
        self,
        world: World,
        community: Community | None = None,
        config: SimConfig | None = None,
        *,
        eyes: Eyes | None = None,
        colours_later: bool = False,
    ) -> None:
        if community is not None and community.world.digest != world.digest:
            raise InputError(
                f"simulation: the community was made for world {community.world.name!r}, not for this one "
                f"({world.manifest.name!r}); give that world, or build a community for this one"
            )
        self.world = world
        self.colours_later = colours_later
        self.community = community
        self.config = config or SimConfig()
        self.metrics = Metrics()
        residents = list(community.residents) if community is not None else []
        if self.config.residents is not None:
            residents = residents[: self.config.residents]
        self.residents = residents
        self.stage = self._staged()
        stage = self.stage
        days = [appointments(r.schedule, stage.place_index) for r in residents]
        spawn.place_residents(stage, days, self.config.start)
        for i in range(len(residents), len(stage.people)):
            spawn.place_anywhere(i, stage, rng(self.config.seed, "spawn", stage.people.names[i]))
        self.punctuality = Punctuality.of(days, self.config.start)
        self.seeing = self._seeing()
        self._eyes, self._attached = eyes, False

    # The loop.

    def step(self, actions: Mapping[str, Any], troubles: Mapping[str, Trouble] | None = None) -> StepResult:
        """Let one second pass.

        Parameters
        ----------
        actions
            One dict by agent's name; who has none waits. Bad ones are refused with a reason; names nobody has are
            ignored.
        troubles
            Agents that were late or failed, and why: they wait, and it is noted.
        """
        stage = self.stage
        watch = _StopWatch(self.metrics.seconds)
        stage.events.begin(self.metrics.steps, stage.second)
        stage.avatars.begin()
        self._act(actions, troubles or {})
        watch.lap("actions")
        crowd = _Crowd(stage)
        for k in range(SUBSTEPS):
            if stage.traffic is not None:
                stage.traffic.advance(SUBSTEP, crowd.others(stage.traffic))
                crowd.moved(stage.traffic)
                watch.lap("traffic")
            if stage.transit is not None:
                stage.transit.advance(SUBSTEP, crowd.others(stage.transit))
                crowd.moved(stage.transit)
                watch.lap("transit")
            stage.avatars.advance(SUBSTEP, crowd.others(stage.avatars), share=1.0 / (SUBSTEPS - k))
            rides.follow(stage)
            crowd.moved(stage.avatars)
            watch.lap("avatars")
            if stage.robots is not None:
                stage.robots.advance(SUBSTEP, crowd.others(stage.robots))
                crowd.moved(stage.robots)
                watch.lap("robots")
        moves.follow_hands(stage)
        self._note_collisions()
        self._note_robots()
        stage.second += 1.0
        self.punctuality.watch(stage)
        self.metrics.steps += 1
        watch.lap("bookkeeping")
        observations, infos = self.observe(watch)
        digest = self.state_hash()
        watch.lap("hash")
        return StepResult(observations, infos, list(stage.events.log), digest)

    def _act(self, actions: Mapping[str, Any], troubles: Mapping[str, Trouble]) -> None:
        stage = self.stage
        for i, name in enumerate(stage.names):
            if name in troubles:
                status, reason = troubles[name]
                kind = "agent_late" if status is Status.LATE else "agent_failed"
                self._set_status(i, status, reason)
                stage.events.add(kind, name, reason[:REASON_LENGTH], self._position(i))
                continue
            if name not in actions or actions[name] is None:
                continue
            verdict = check(actions[name], i, stage)
            if isinstance(verdict, Command):
                perform(verdict, i, stage)
            else:
                self._refuse(i, verdict)

    def _refuse(self, i: int, refusal: Refusal) -> None:
        self._set_status(i, Status.REFUSED, refusal.reason)
        self.metrics.refused += 1
        self.stage.events.add("refused", self.stage.names[i], refusal.reason, self._position(i))

    def _set_status(self, i: int, status: Status, reason: str) -> None:
        stage = self.stage
        if i < len(stage.people):
            stage.people.status[i] = status
            stage.people.reason[i] = reason[:REASON_LENGTH]
        elif stage.robots is not None:
            stage.robots.reasons[i - len(stage.people)] = reason[:REASON_LENGTH]

    def _position(self, i: int) -> NDArray[np.float64]:
        stage = self.stage
        if i < len(stage.people):
            return stage.people.position[i]
        assert stage.robots is not None
        return stage.robots.bodies().position[i - len(stage.people)]

    def _note_collisions(self) -> None:
        stage, p = self.stage, self.stage.people
        for i in np.flatnonzero(p.status == Status.COLLISION):
            entity = int(p.contact[i])
            what = "something solid" if entity < 0 else self.entity(entity)["kind"]
            p.reason[i] = f"stopped by {what}"[:REASON_LENGTH]
            self.metrics.collisions += 1
            stage.events.add("collision", p.names[i], f"is stopped by {what}", p.position[i], entity=entity)

    def _note_robots(self) -> None:
        robots = self.stage.robots
        for note in robots.events() if robots is not None else ():
            name = robots.names[note.robot] if robots is not None else ""
            self.stage.events.add("robot", name, note.kind, note.position)

    # What agents see.

    def observe(self, watch: _StopWatch | None = None) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Observations and infos of all agents as things stand."""
        watch = watch or _StopWatch(self.metrics.seconds)
        eyes = self.eyes if self.seeing else None
        result = observe(self.stage, self.seeing, eyes)
        watch.lap("observations")
        return result

    @property
    def eyes(self) -> Eyes:
        """The renderer; made when it is first needed, for it takes seconds and much memory."""
        if self._eyes is None:
            from vico.sim.scene import SceneEyes

            self._eyes = SceneEyes(self)
        elif not self._attached:
            self._eyes = self._eyes.moved_to(self)
        self._attached = True
        return self._eyes

    def colours(self) -> Callable[[], None]:
        """What to call, from any thread, to wait for the RGB of the last observations."""
        return self._eyes.under_way() if self._eyes is not None else lambda: None

    @property
    def made_eyes(self) -> Eyes | None:
        """The renderer, if it was made: another simulation of the same world may use it."""
        return self._eyes

    def entity(self, entity: int) -> dict[str, str]:
        """Kind and name of an entity of the world or of this run."""
        return self.entities.get(entity) or self.world.entities.get(entity) or {"kind": "unknown", "name": str(entity)}

    # State as a whole.

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every array that decides the future, in a fixed order; not copied."""
        steps = {"steps": np.array([self.metrics.steps, self.metrics.collisions, self.metrics.refused])}
        watch = {f"punctuality.{name}": array for name, array in self.punctuality.arrays().items()}
        return steps | dict(self.stage.all_arrays()) | watch

    def state_hash(self) -> str:
        """Hash of the whole state, hex."""
        return state_hash(self.arrays())

    def snapshot(self) -> dict[str, NDArray[Any]]:
        """A copy of the whole state; `restore` goes back to it."""
        return copied(self.arrays())

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to a snapshot of a simulation made in the same way."""
        stage = self.stage
        steps, collisions, refused = (int(value) for value in arrays["steps"])
        self.metrics.steps, self.metrics.collisions, self.metrics.refused = steps, collisions, refused
        stage.second = float(arrays["second"][0])
        stage.people.restore(part(arrays, "people"))
        stage.goods.restore(part(arrays, "goods"))
        stage.events.restore(part(arrays, "events"))
        for name in ("traffic", "transit", "robots"):
            system = getattr(stage, name)
            if system is not None:
                system.restore(part(arrays, name))
        self.punctuality.restore(part(arrays, "punctuality"))

    def save(self, path: Path) -> None:
        """Write a snapshot file (``.npz``, no pickle)."""
        write_snapshot(path, self.arrays(), owner=self.identity)

    def load(self, path: Path) -> None:
        """Go back to a snapshot file of a simulation made in the same way."""
        self.restore(read_snapshot(path, owner=self.identity))

    @property
    def identity(self) -> str:
        """Version, configuration, world and community in one hash: equal ones run equally."""
        what = {
            "version": __version__,
            "config": self.config.record(),
            "world": self.world.digest,
            "community": [r.id for r in self.residents],
            "goods": self.stage.goods.names,
        }
        return hashlib.sha256(json.dumps(what, sort_keys=True, default=str).encode()).hexdigest()

    # Setting the stage.

    @property
    def agents(self) -> list[str]:
        """Names of all agents: residents, assistants, robots."""
        return self.stage.names

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
        """Put a loose thing into the world; to be done before the first step.

        Parameters
        ----------
        prototype
            Name of its shape; things of one shape share it.
        shape
            The shape, origin at the middle of its underside, z up.
        position
            Where that origin comes to lie, ENU metres.
        room
            Id of the room it lies in; "" outdoors.
        size
            Extents of its box, metres.

        Returns
        -------
        int
            Its entity.
        """
        stage = self.stage
        if room and room not in stage.indoor.index:
            raise InputError(f"add_object: {name}: no room has the id {room!r}")
        index = stage.indoor.index[room] if room else -1
        spot = np.asarray(position, np.float64)
        entity = stage.goods.add(name, prototype, spot, index, np.asarray(size, np.float64), yaw)
        self.shapes[prototype] = list(shape)
        self.entities[entity] = {"kind": "object", "name": name}
        return entity

    def place_agent(self, name: str, position: ArrayLike, *, yaw: float = 0.0) -> None:
        """Stand a person on free ground outdoors near a point; to be done before the first step.

        Raises
        ------
        InputError
            If nobody has the name, or there is no free ground within 8 m.
        """
        stage = self.stage
        if name not in stage.people.names:
            raise InputError(f"place_agent: nobody is called {name!r}; there are {', '.join(stage.people.names)}")
        i = stage.people.names.index(name)
        near = np.asarray(position, np.float64)
        spot = free_ground(self.world.walkable, near, stage.obstacles_to(i), within=8.0)
        if spot is None:
            raise InputError(f"place_agent: {name}: no free ground within 8 m of {np.asarray(position)[:2].tolist()}")
        moves.put_outdoors(i, spot, yaw, stage)

    def object_position(self, name: str) -> NDArray[np.float64]:
        """Where a loose thing is, ENU metres, shape ``(3,)``."""
        return self.stage.goods.position[self._good(name)].copy()

    def object_room(self, name: str) -> str | None:
        """Id of the room a loose thing is in; None outdoors."""
        room = int(self.stage.goods.room[self._good(name)])
        return self.stage.indoor.rooms[room].id if room >= 0 else None

    def object_holder(self, name: str) -> str | None:
        """Agent that carries a loose thing; None if nobody does."""
        holder = int(self.stage.goods.holder[self._good(name)])
        return self.entities[holder]["agent"] if holder else None

    def _good(self, name: str) -> int:
        goods = self.stage.goods
        if name not in goods.names:
            raise InputError(f"no loose thing is called {name!r}; there are {', '.join(goods.names) or 'none'}")
        return goods.names.index(name)

    def _staged(self) -> Stage:
        config, world = self.config, self.world
        names = [r.id for r in self.residents] + [f"assistant_{i}" for i in range(config.assistants)]
        kinds = [RESIDENT] * len(self.residents) + [ASSISTANT] * config.assistants
        entities = [FIRST_RESIDENT + i for i in range(len(self.residents))]
        entities += [FIRST_ASSISTANT + i for i in range(config.assistants)]
        people = People.standing(names, kinds, entities)
        for i, resident in enumerate(self.residents):
            people.cash[i] = float(resident.cash)
            people.height[i] = resident.appearance["height"]
        indoor = Indoor.from_world(world.rooms, world.places, world.objects)
        avatars = Avatars(people, indoor, world.walkable, world.height)
        self.shapes: dict[str, list[Surface]] = {}
        self.entities: dict[int, dict[str, str]] = {}
        for i, name in enumerate(names):
            kind = "resident" if i < len(self.residents) else "assistant"
            shown = self.residents[i].name if i < len(self.residents) else name
            self.entities[entities[i]] = {"kind": kind, "name": shown, "agent": name}
        stage = Stage(world, indoor, people, Goods.none(), avatars, Events(names), second=float(config.start))
        # Nobody has a place yet: until then avatars are nowhere that could be in anybody's way.
        people.room[:] = _NOWHERE
        stage.traffic, stage.transit = systems.traffic_and_transit_of(world, config)
        stage.robots = systems.robots_of(world, config, stage.obstacles(), errands=config.errands)
        for system, kind in ((stage.robots, "robot"), (stage.traffic, ""), (stage.transit, "")):
            if system is None:
                continue
            bodies = system.bodies()
            for k, entity in enumerate(bodies.entity.tolist()):
                named = kind or KINDS[int(bodies.kind[k])]
                self.entities[entity] = {"kind": named, "name": f"{named} {k}"}
        for k, name in enumerate(stage.robots.names if stage.robots is not None else []):
            entity = FIRST_ROBOT + k
            self.entities[entity] |= {"name": f"{config.robots[k]} {k}", "agent": name}
        stage.events.names = stage.names
        stage.events.begin(0, stage.second)
        return stage

    def _seeing(self) -> list[int]:
        names = self.stage.names
        if self.config.observe is None:
            return list(range(len(names)))
        unknown = [name for name in self.config.observe if name not in names]
        if unknown:
            raise InputError(f"observe: nobody is called {unknown[0]!r}; there are {', '.join(names)}")
        return [names.index(name) for name in self.config.observe]


class _Crowd:
    """Everybody's bodies during a step; an owner's are asked for again only when they have moved."""

    def __init__(self, stage: Stage) -> None:
        self._bodies = {id(owner): owner.bodies() for owner in stage.owners()}

    def moved(self, owner: HasBodies) -> None:
        self._bodies[id(owner)] = owner.bodies()

    def others(self, owner: HasBodies) -> Bodies:
        return Bodies.joined([bodies for key, bodies in self._bodies.items() if key != id(owner)])


class _StopWatch:
    """Adds up wall seconds by phase; measures only, decides nothing."""

    def __init__(self, into: dict[str, float]) -> None:
        self._into = into
        self._last = time.perf_counter()

    def lap(self, phase: str) -> None:
        now = time.perf_counter()
        self._into[phase] = self._into.get(phase, 0.0) + now - self._last
        self._last = now


__all__ = ["DAY", "Metrics", "Simulation", "StepResult"]
