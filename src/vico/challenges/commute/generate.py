"""The day of a commuter: which places, and when.

Task: be at every appointment of the day by its start, by foot, bus, tram or rented bicycle.

Randomisation: the resident, out of the adults of a community; the number of different places, 4 to 8; each place after
home out of nine candidates of those that the resident knows, 250 m or more from the one before as the crow flies;
whether the day ends at home (every second one does); how long each stay takes; the slack between stays.

Slack: metres as the crow flies at 1 m/s, and a share of that time more, drawn from 0.3 to 1.1 with equal chances. No
router has a part in it, so no method is on time by construction: a way that winds more than the draw allows is too long
for who walks.

Success: within 3 m of the place's point, on foot or on a bicycle, when the appointment starts; at the last one on foot.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise

import numpy as np

from vico.challenges.commute import tasks
from vico.challenges.commute.tasks import Appointment, Commuter, CommuteTask
from vico.community import build_community
from vico.community.model import Community, Resident
from vico.errors import EmptyInputError, InputError
from vico.rules import WALK_SPEED
from vico.seeds import rng
from vico.world.model import Category, Place
from vico.world.world import World

#: People a community has, and how many days in a row are of one community.
RESIDENTS, DAYS_A_COMMUNITY = 15, 2
_ADULT = (18, 75)
# Where people may go who know no place that is far enough: not to other people's homes.
_PUBLIC = (Category.STORE, Category.FOOD, Category.ENTERTAINMENT, Category.OFFICE, Category.OPEN)
_TRIES = 50


def generate_commute(world: World, *, seed: int, hours: float = tasks.HOURS) -> CommuteTask:
    """Make one episode's task; the same world, seed and hours give the same task.

    Parameters
    ----------
    seed
        Number of the schedule; two in a row are of one community.
    hours
        From the end of the first stay to the end of the last.

    Raises
    ------
    InputError
        If the hours are out of range.
    EmptyInputError
        If the world has too few places far enough apart.
    """
    if not tasks.LEAST_HOURS <= hours <= tasks.MOST_HOURS:
        raise InputError(f"commute: {hours:g} hours; give {tasks.LEAST_HOURS:g} to {tasks.MOST_HOURS:g}")
    chance = rng(seed, "commute", world.digest)
    number = seed // DAYS_A_COMMUNITY
    community = _people(world, number)
    adults = [r for r in community.residents if _ADULT[0] <= r.age <= _ADULT[1]]
    for _ in range(_TRIES):
        resident = adults[int(chance.integers(len(adults)))]
        chosen = _places(world, resident, chance)
        if chosen is not None:
            return _task(world, resident, chosen, chance, seed=seed, community=number, hours=hours)
    raise EmptyInputError(
        f"commute: {world.manifest.name}: no resident has {tasks.LEAST_PLACES} places to go to, each "
        f"{tasks.LEAST_LEG:g} m or more from the next; use a larger world"
    )


@lru_cache(maxsize=2)
def _people(world: World, number: int) -> Community:
    """Return a community; methods that play the same day one after the other share it."""
    return build_community(world, residents=RESIDENTS, seed=number)


def _places(world: World, resident: Resident, chance: np.random.Generator) -> list[tuple[Place, list[str]]] | None:
    """Draw the places of a day, each with its candidates; None if there are too few."""
    reachable = {p.id: p for p in world.places if bool(world.walkable.is_connected(p.position[:2]))}
    if resident.home not in reachable:
        return None
    home = reachable[resident.home]
    places = dict.fromkeys(resident.known_places)
    known = [reachable[i] for i in places if i in reachable and i != home.id]
    known = [p for p in known if p.category is not Category.TRANSIT]
    public = [p for p in reachable.values() if p.category in _PUBLIC]
    wanted = int(chance.integers(tasks.LEAST_PLACES, tasks.MOST_PLACES + 1))
    returns = bool(chance.random() < 0.5)
    day = [(home, [home.id])]
    while len(day) < wanted:
        used, last = {place.id for place, _ in day}, len(day) == wanted - 1
        here = [day[-1][0], home] if last and returns else [day[-1][0]]
        options = _far_from(here, known, used) or _far_from(here, public, used)
        if not options:
            return None
        order = chance.permutation(len(options))[: tasks.CANDIDATES]
        candidates = [options[int(k)] for k in order]
        day.append((candidates[int(chance.integers(len(candidates)))], [p.id for p in candidates]))
    return [*day, (home, [home.id])] if returns else day


def _far_from(here: list[Place], places: list[Place], used: set[str]) -> list[Place]:
    far = [p for p in places if p.id not in used]
    return [p for p in far if all(_metres(p, place) >= tasks.LEAST_LEG for place in here)]


def _metres(a: Place, b: Place) -> float:
    return math.dist(a.position[:2], b.position[:2])


def _task(
    world: World,
    resident: Resident,
    chosen: list[tuple[Place, list[str]]],
    chance: np.random.Generator,
    *,
    seed: int,
    community: int,
    hours: float,
) -> CommuteTask:
    """Give the places their times."""
    legs = [_metres(a, b) for (a, _), (b, _) in pairwise(chosen)]
    slack = [round(leg / WALK_SPEED * (1.0 + float(chance.uniform(*tasks.SLACK)))) for leg in legs]
    between = len(chosen) - 2
    rest = hours * 3600.0 - sum(slack) - tasks.LAST_STAY - between * tasks.LEAST_STAY
    weights = chance.uniform(0.5, 1.5, between)
    stays = [tasks.LEAST_STAY + round(max(0.0, rest) * float(w) / float(weights.sum())) for w in weights]
    end = tasks.MORNING + 60 * int(chance.integers(60))
    times = [(end - tasks.LEAST_STAY, end)]
    for gap, stay in zip(slack, [*stays, tasks.LAST_STAY], strict=True):
        start = times[-1][1] + gap
        times.append((start, start + stay))
    return CommuteTask(
        world=world.manifest.name,
        world_digest=world.digest,
        seed=seed,
        community=community,
        resident=Commuter(
            id=resident.id,
            name=resident.name,
            age=resident.age,
            occupation=resident.occupation,
            lifestyle=resident.lifestyle,
            cash=float(resident.cash),
        ),
        appointments=[
            Appointment(
                place=place.id,
                name=place.name,
                kind=place.kind,
                position=(place.position[0], place.position[1]),
                start=start,
                end=stop,
                candidates=candidates,
            )
            for (place, candidates), (start, stop) in zip(chosen, times, strict=True)
        ],
    )
