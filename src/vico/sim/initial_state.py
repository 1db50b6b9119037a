"""The state at the start of a run: everybody and everything, from the world, the community and the configuration."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from vico.rules import TRAM_SECTIONS
from vico.sim import spawn, systems
from vico.sim.appointments import Appointment
from vico.sim.avatars import Avatars
from vico.sim.base import SimulationBase
from vico.sim.bodies import ASSISTANT, KINDS, RESIDENT
from vico.sim.config import NO_DAY, SimConfig
from vico.sim.environment import Agenda, Environment, Sky
from vico.sim.events import Events
from vico.sim.holding import habit_of, take_umbrella
from vico.sim.openings import OpeningHours
from vico.sim.periods import TICKS_PER_SECOND
from vico.sim.simulation_state import SimulationState
from vico.sim.state import FIRST_ASSISTANT, FIRST_RESIDENT, FIRST_ROBOT, MovableObjects, People
from vico.sim.tills import Lines

if TYPE_CHECKING:
    from vico.community.model import Resident

_NOWHERE = 2**30


def initial_state(
    base: SimulationBase,
    residents: Sequence[Resident],
    days: Sequence[Sequence[Appointment]],
    config: SimConfig,
    day: date | None = None,
) -> SimulationState:
    """Make the state before the first step.

    Parameters
    ----------
    residents, days
        Who takes part, and their appointments: residents start where these put them.
    day
        The date that their days are of; None: the run's own.

    Raises
    ------
    InputError
        If a robot's model is not known, or there is no free ground for everybody.
    """
    people = _people(residents, config)
    avatars = Avatars(people, base.indoor, base.world.walkable, base.world.height)
    events = Events(people.names)
    tick = config.start * TICKS_PER_SECOND
    environment = _environment(base, config)
    state = SimulationState(base, people, MovableObjects.none(), avatars, events, environment, tick=tick)
    state.lines = Lines.of(len(people))
    if config.opening_hours:
        origin = base.world.manifest.origin
        opened = day or state.environment.sky.first_day
        state.openings = OpeningHours(base.world.places, opened, (origin.lat, origin.lon), residents, days)
    # Nobody has a place yet: until then avatars are nowhere that could be in anybody's way.
    people.room[:] = _NOWHERE
    state.traffic, state.transit = systems.traffic_and_transit_of(base, config)
    base.world.drop_pages()  # streets look at the ground of all the city, and so do those who find their places below
    state.show_signals()
    robots = systems.robots_of(base, config, state.obstacles(), errands=config.errands)
    if robots is not None:
        robots.attach_objects(state.objects)
        robots.attach_people(people)
    state.robots = robots
    state.entities = _entities(state, residents, config)
    events.names = state.names
    events.begin(0, state.second, events.names)
    spawn.place_residents(state, days, config.start)
    spawn.place_assistants(len(residents), config.assistant_places, state, config.seed)
    take_umbrella(slice(None), state)
    state.homes = np.full(len(people), -1, np.int32)
    state.homes[: len(residents)] = [base.place_index.get(resident.home, -1) for resident in residents]
    state.clothes_at_start = state.weather_to_dress_for()
    people.clothes[:] = state.clothes_at_start
    return state


def _environment(base: SimulationBase, config: SimConfig) -> Environment:
    origin = base.world.manifest.origin
    sky = Sky.over(origin.lat, origin.lon, config.date or NO_DAY.isoformat(), config.utc_offset)
    second = float(config.start)
    agenda = Agenda(base.event_sites, config.events, seed=config.seed, second=second)
    return Environment(sky, config.weather, seed=config.seed, second=second, agenda=agenda)


def _people(residents: Sequence[Resident], config: SimConfig) -> People:
    names = [r.id for r in residents] + [f"assistant_{i}" for i in range(config.assistants)]
    kinds = [RESIDENT] * len(residents) + [ASSISTANT] * config.assistants
    entities = [FIRST_RESIDENT + i for i in range(len(residents))]
    entities += [FIRST_ASSISTANT + i for i in range(config.assistants)]
    people = People.standing(names, kinds, entities)
    for i, resident in enumerate(residents):
        people.cash[i] = float(resident.cash)
        people.height[i] = resident.appearance["height"]
    people.umbrella_habit[:] = [habit_of(config.seed, name) for name in names]
    return people


def _entities(state: SimulationState, residents: Sequence[Resident], config: SimConfig) -> dict[int, dict[str, str]]:
    """Kind and name of every body of the run by entity, and the agent's name of those that have one."""
    found: dict[int, dict[str, str]] = {}
    for i, (entity, name) in enumerate(zip(state.people.entity.tolist(), state.people.names, strict=True)):
        kind = "resident" if i < len(residents) else "assistant"
        shown = residents[i].name if i < len(residents) else name
        found[entity] = {"kind": kind, "name": shown, "agent": name}
    for k, entity in enumerate(state.robots.bodies().entity.tolist() if state.robots is not None else []):
        found[entity] = {"kind": "robot", "name": f"robot {k}"}
    if state.traffic is not None:
        entities, kinds = state.traffic.entities()
        for k, (entity, kind) in enumerate(zip(entities.tolist(), kinds.tolist(), strict=True)):
            found[entity] = {"kind": KINDS[kind], "name": f"{KINDS[kind]} {k}"}
    # Bicycles in their stations are nobody's obstacle, but are seen.
    for k, entity in enumerate(state.transit.bicycles.entities().tolist() if state.transit is not None else []):
        found[entity] = {"kind": "bicycle", "name": f"bicycle {k}"}
    for k, entity in enumerate(state.transit.trams.entities().tolist() if state.transit is not None else []):
        tram = k // TRAM_SECTIONS
        kind = state.transit.trams.kind(tram) if state.transit is not None else "tram"
        found[entity] = {"kind": kind, "name": f"{kind} {tram}"}
    for k, name in enumerate(state.robots.names if state.robots is not None else []):
        found[FIRST_ROBOT + k] |= {"name": f"{config.robots[k].partition(':')[0]} {k}", "agent": name}
    return found
