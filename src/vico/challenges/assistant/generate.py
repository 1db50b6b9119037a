"""Drawing tasks: when and where, who asks, which places, which things; each choice out of nine candidates.

The same seed gives the same task. Starts are drawn so that six subtasks can be asked at all.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from vico.agents.requester import PACE_HOME
from vico.agents.talk.acquaintance import first_name
from vico.assets.models.movable import kinds_for
from vico.assets.people.model import describe_appearance
from vico.challenges.assistant.candidates import ChoiceQuestion, Chooser, choose, seeded_chooser
from vico.challenges.assistant.placement import (
    Neighbourhood,
    ThingPlacer,
    place_region,
    region_text,
    regions_text,
    with_surface,
)
from vico.challenges.assistant.tasks import (
    APART,
    CANDIDATES,
    CARRY_REACH,
    FREQUENTED_PLACES,
    REACH,
    SEARCH_RADIUS,
    SOURCE_RADIUS,
    STEPS,
    SUBTASKS,
    Category,
    Person,
    Region,
    Start,
    Subtask,
    Task,
    thresholds,
)
from vico.clock import clock_of, seconds_of_day
from vico.community.folder import digest_of
from vico.community.model import Community, Resident
from vico.errors import EmptyInputError, InputError
from vico.seeds import rng
from vico.world.model import Place
from vico.world.routing import Router
from vico.world.world import World

# Hours at which errands are asked for, and half hours at which somebody may want help with carrying.
_HOURS = tuple(range(9, 18))
_HALF_HOURS = tuple(range(2 * 9, 2 * 19))
# Starts that are tried; with Carry until a subtask takes no longer walks than this on average, seconds, where one comes
# to somebody at the first pace, metres a second.
_TRIES, _CARRY_TRIES = 30, 12
_ENOUGH = 110.0
_COMES = 2.0
# Whoever asks for errands goes out alone, years; so many of them, where there are; each knows so many places near by.
_AGE = 10
_ASKERS, _KNOWN = 3, 3
# Who is to be helped with carrying is out for so long after the start, share of an episode.
_OUT_FOR = 0.5


@dataclass(frozen=True)
class Occasion:
    """A start, and who asks for something there.

    Attributes
    ----------
    time
        Of day, ``HH:MM``.
    people
        Who may ask.
    whereabouts
        Where each of those who are out is expected at the start, by id; empty where nobody is looked for.
    """

    hood: Neighbourhood
    time: str
    people: list[Resident]
    whereabouts: Mapping[str, Region] = field(default_factory=dict)

    def any_of(self, chance: np.random.Generator) -> Resident:
        """Return somebody."""
        return self.people[int(chance.integers(len(self.people)))]


def errand_occasion(world: World, community: Community, chance: np.random.Generator) -> Occasion:
    """Return a start around which people know places.

    Raises
    ------
    EmptyInputError
        If there is none.
    """
    people = [who for who in community.residents if who.age >= _AGE]
    best: Occasion | None = None
    hour = int(chance.choice(_HOURS))
    for start in _spots(world, people, chance):
        hood = Neighbourhood(world, _router(world), start, reach=REACH)
        askers = [who for who in people if len(hood.places_of(who)) >= _KNOWN]
        if best is None or len(askers) > len(best.people):
            best = Occasion(hood, f"{hour:02d}:00", askers)
        if len(best.people) >= _ASKERS:
            return best
    if best is None or not best.people:
        raise EmptyInputError(
            f"tasks: nobody knows {_KNOWN} places that can be entered within a walk of {REACH:.0f} m of any start; "
            "use a larger world or more residents"
        )
    return best


def carry_occasion(world: World, community: Community, chance: np.random.Generator) -> Occasion:
    """Return a start and a time of day at which six people are out, near by and not far from their homes.

    Six can be told apart when they are called, by their first names; there may be more people.

    Raises
    ------
    EmptyInputError
        If there never are.
    """
    people = [who for who in community.residents if who.age >= _AGE]
    starts = islice(_spots(world, people, chance), _CARRY_TRIES)
    hoods = [Neighbourhood(world, _router(world), start, reach=CARRY_REACH) for start in starts]
    ways = _WalksHome(world)
    best: tuple[float, Occasion] | None = None
    most = 0
    for half in chance.permutation(_HALF_HOURS):
        time = int(half) * 1800
        whereabouts = {who.id: place for who in people if (place := _out_at(who, time, world)) is not None}
        for hood in hoods:
            out = {
                who.id: whereabouts[who.id]
                for who in people
                if who.id in whereabouts and who.home in hood.places and hood.is_near(whereabouts[who.id].position)
            }
            apart = len({first_name(who.name) for who in people if who.id in out})
            most = max(most, apart)
            if apart < SUBTASKS:
                continue
            # Who is near and has not far to go home comes first: six of them can then be walked in time.
            seconds = {
                who.id: hood.distance(out[who.id].position) / _COMES + ways.metres(who, out[who.id]) / PACE_HOME
                for who in people
                if who.id in out
            }
            mine = sorted((who for who in people if who.id in out), key=lambda who: seconds[who.id])
            cost = sum(seconds[who.id] for who in mine[:SUBTASKS])
            if best is None or cost < best[0]:
                best = (
                    cost,
                    Occasion(
                        hood,
                        clock_of(time)[:5],
                        mine,
                        {who.id: hood.whereabouts(out[who.id], radius=SOURCE_RADIUS) for who in mine},
                    ),
                )
        if best is not None and best[0] <= _ENOUGH * SUBTASKS:
            break
    if best is not None:
        return best[1]
    raise EmptyInputError(
        f"carry: at no time of day are {SUBTASKS} people out within {CARRY_REACH:.0f} m who live there and have "
        f"different first names, {most} at most; use a larger world or more residents"
    )


class _WalksHome:
    """How far people have to go home."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._fields: dict[str, NDArray[np.float32]] = {}

    def metres(self, who: Resident, place: Place) -> float:
        """Walk from a place to somebody's home; infinite where there is none."""
        if who.home not in self._fields:
            self._fields[who.home] = _router(self._world).distance_field(_door(self._world.place_by_id[who.home]))
        walkable = self._world.walkable
        ix, iy = np.clip(walkable.cell_of(_door(place)), 0, walkable.n - 1)
        return float(self._fields[who.home][iy, ix])


def _door(place: Place) -> NDArray[np.float64]:
    return np.asarray(place.position[:2], np.float64)


def _out_at(who: Resident, time: int, world: World) -> Place | None:
    """Return where somebody is expected at a time who is out then and for a while; None if they are not."""
    home = world.place_by_id[who.home]
    until = time + _OUT_FOR * STEPS
    during = [item for item in who.schedule if seconds_of_day(item.start) < until and seconds_of_day(item.end) > time]
    if any(item.place == who.home for item in during):
        return None
    place = next((world.place_by_id[item.place] for item in during if item.place is not None), None)
    if place is None or place.building == home.building is not None:
        return None
    if float(np.hypot(*np.subtract(place.position[:2], home.position[:2]))) < APART:
        return None
    return place


def _spots(world: World, people: list[Resident], chance: np.random.Generator) -> Iterator[NDArray[np.float64]]:
    """Yield free spots near places that people know, away from the map's edge where there are such."""
    known = sorted({place for who in people for place in (*who.known_places, who.home)})
    middles = [world.place_by_id[place].position[:2] for place in known]
    inner = [xy for xy in middles if max(abs(xy[0]), abs(xy[1])) <= 0.75 * world.half] or middles
    for _ in range(_TRIES if inner else 0):
        near = inner[int(chance.integers(len(inner)))]
        yield world.walkable.random_point(chance, near=near, radius=40.0, clearance=0.75)


def _router(world: World) -> Router:
    return world.router


@dataclass
class Draw:
    """One episode as it is drawn."""

    world: World
    category: Category
    occasion: Occasion
    chance: np.random.Generator
    chooser: Chooser
    things: ThingPlacer
    advanced: bool

    @property
    def hood(self) -> Neighbourhood:
        """What lies within a walk of the start."""
        return self.occasion.hood

    def pick(self, question: str, names: list[str], into: dict[str, list[str]], who: Resident | None) -> int:
        """Have one of nine chosen, for whom who asks, and note what it was chosen from."""
        choice = choose(ChoiceQuestion(question, self.category, who), names, self.chooser)
        into[question] = choice.candidates
        return choice.chosen

    def kind(self, question: str, into: dict[str, list[str]], who: Resident) -> str:
        """Have the kind of a thing chosen."""
        kinds = [str(kind) for kind in self.chance.permutation(sorted(kinds_for("assistant")))[:CANDIDATES]]
        return kinds[self.pick(question, kinds, into, who)]

    def names_for(self, index: int) -> list[str]:
        """Return ids for the one thing or the two things of a subtask."""
        return [f"object_{index}_{k}" for k in range(1 + int(self.chance.random() < 0.3))]

    def regions(self, who: Resident, *, indoors: float, radius: float) -> list[Region]:
        """Nine regions that somebody knows, or as many as there are: of one kind, or of the other if there is none."""
        inside = bool(self.chance.random() < indoors)
        places = [place_region(place) for place in self.hood.places_of(who)]
        spots = self.hood.spots_of(who, self.chance, radius=radius)
        return places if (inside and places) or not spots else spots

    def among_others(
        self, source: Region, who: Resident, *, radius: float, count: int, target: Region | None = None
    ) -> tuple[list[Region], int]:
        """Return the source among the nearest others that somebody knows, `count` in all if there are so many.

        None of the others is where things are brought to.
        """
        if count <= 1:
            return [source], 0
        others = [place_region(place) for place in self.hood.places_of(who) if place.id != who.home]
        others += self.hood.spots_of(who, self.chance, radius=radius)
        near = self._others(source, others, target)[: 2 * (count - 1)]
        order = self.chance.permutation(len(near))[: count - 1]
        return self._shuffle(source, [near[int(k)] for k in order])

    def frequented_places(self, source: Region, who: Resident, home: Region, *, count: int) -> tuple[list[Region], int]:
        """Return the source among other places of somebody's day, `count` in all if there are so many.

        Where the day has fewer, the nearest others that they know fill up.
        """
        of_day = [region for region in self.hood.stays_of(who, radius=SOURCE_RADIUS) if region.place != who.home]
        known = [place_region(place) for place in self.hood.places_of(who) if place.id != who.home]
        known += self.hood.spots_of(who, self.chance, radius=SOURCE_RADIUS)
        days = self._others(source, of_day, home)
        more = self._others(source, known, home)
        chosen = [days[int(k)] for k in self.chance.permutation(len(days))]
        apart = {region.centre: region for region in (*chosen, *more) if region.centre != source.centre}
        return self._shuffle(source, list(apart.values())[: count - 1])

    def _others(self, source: Region, regions: list[Region], target: Region | None) -> list[Region]:
        """Return regions other than the source, where no thing is told to lie and none is brought to; nearest first."""
        others = [r for r in self.things.untold(regions) if r.place is None or r.place != source.place]
        others = [r for r in others if target is None or _are_apart(r, target)]
        return sorted(others, key=lambda r: float(np.hypot(*np.subtract(r.centre[:2], source.centre[:2]))))

    def _shuffle(self, source: Region, others: list[Region]) -> tuple[list[Region], int]:
        regions = [source, *others]
        shuffled = self.chance.permutation(len(regions))
        return [regions[int(k)] for k in shuffled], int(np.flatnonzero(shuffled == 0)[0])


def generate_task(
    world: World,
    community: Community,
    category: Category,
    *,
    seed: int,
    assistants: int = 1,
    advanced: bool = False,
    steps: int = STEPS,
    chooser: Chooser | None = None,
) -> Task:
    """Make one episode's task; the same world, community, seed and chooser give the same task.

    Parameters
    ----------
    assistants
        1 or 2; a second one changes nothing else.
    advanced
        Three times as many source regions, and surfaces that are named.
    chooser
        Who picks out of nine candidates; a seeded draw if None.

    Raises
    ------
    EmptyInputError
        If the world and its people have too little around any starting point.
    """
    chance = rng(seed, "assistant task", category, world.digest, str(advanced))
    occasion = (carry_occasion if category == "carry" else errand_occasion)(world, community, chance)
    draw = Draw(
        world, category, occasion, chance, chooser or seeded_chooser(chance), ThingPlacer(world, chance), advanced
    )
    subtask = {"carry": _carry, "delivery": _delivery, "search": _search}[category]
    subtasks: list[Subtask] = []
    for index in range(SUBTASKS):
        subtasks.append(subtask(draw, index, subtasks))
    return Task(
        category=category,
        advanced=advanced,
        world=world.manifest.name,
        world_digest=world.digest,
        community_digest=digest_of(community),
        seed=seed,
        start=occasion.time,
        steps=steps,
        assistants=_starts(world, occasion.hood.start, chance, assistants),
        objects=draw.things.made,
        subtasks=subtasks,
    )


def first_subtasks(task: Task, *, subtasks: int) -> Task:
    """Return a task that asks for its first subtasks alone; the things of the others lie where they lay.

    Raises
    ------
    InputError
        If it has fewer, or none are asked for.
    """
    if not 1 <= subtasks <= len(task.subtasks):
        raise InputError(f"assistant: {subtasks} subtasks; a task has 1 to {len(task.subtasks)}")
    return task.model_copy(update={"subtasks": task.subtasks[:subtasks]})


def _delivery(draw: Draw, index: int, before: list[Subtask]) -> Subtask:
    """Bring things from one region to another."""
    who = draw.occasion.any_of(draw.chance)
    candidates: dict[str, list[str]] = {}
    limits = thresholds(advanced=draw.advanced)
    sources = draw.things.untold(draw.regions(who, indoors=0.5, radius=SOURCE_RADIUS))
    if not sources:
        raise EmptyInputError("delivery: a thing lies in the middle of every region there is; use a larger world")
    source = sources[draw.pick("Where do the things lie?", [r.name for r in sources], candidates, who)]
    targets = draw.things.untold(draw.regions(who, indoors=0.6, radius=limits.destination_radius))
    targets = [r for r in targets if _are_apart(r, source)] or [
        r
        for r in draw.things.untold(draw.hood.spots_of(who, draw.chance, radius=limits.destination_radius))
        if _are_apart(r, source)
    ]
    if not targets:
        raise EmptyInputError(f"delivery: nothing lies {APART:.0f} m or more from {source.name}; use a larger world")
    target = targets[draw.pick("Where are the things brought to?", [r.name for r in targets], candidates, who)]
    if draw.advanced:
        target = with_surface(target, draw.world, draw.chance)
    kind = draw.kind(f"What is carried from {source.name} to {target.name}?", candidates, who)
    told_before = [region for one in before for region in _named_regions(one)]
    names = draw.names_for(index)
    for name in names:
        draw.things.make(name, kind, in_region=source, middles=[*told_before, source, target])
    regions, right = draw.among_others(source, who, radius=SOURCE_RADIUS, count=limits.regions, target=target)
    text = (
        f"{who.name} asks: bring {draw.things.describe(names)} from {regions_text(regions)} to {region_text(target)}."
    )
    return _subtask(index, text, who, names, regions, right, target, candidates)


def _search(draw: Draw, index: int, before: list[Subtask]) -> Subtask:
    """Find a thing in a region."""
    who = draw.occasion.any_of(draw.chance)
    candidates: dict[str, list[str]] = {}
    sources = draw.things.untold(draw.regions(who, indoors=0.6, radius=SEARCH_RADIUS))
    if not sources:
        raise EmptyInputError("search: a thing lies in the middle of every region there is; use a larger world")
    source = sources[draw.pick("Where is it lost?", [r.name for r in sources], candidates, who)]
    kind = draw.kind(f"What is lost at {source.name}?", candidates, who)
    told_before = [region for one in before for region in _named_regions(one)]
    names = [f"object_{index}_0"]
    draw.things.make(names[0], kind, in_region=source, middles=[*told_before, source])
    count = thresholds(advanced=draw.advanced).regions
    regions, right = draw.among_others(source, who, radius=SEARCH_RADIUS, count=count)
    text = f"{who.name} asks: find {draw.things.describe(names)}, lost at {regions_text(regions)}."
    return _subtask(index, text, who, names, regions, right, None, candidates)


def _carry(draw: Draw, index: int, before: list[Subtask]) -> Subtask:
    """Find somebody, take what they hand over, follow them home, put it down there."""
    candidates: dict[str, list[str]] = {}
    who = _who_needs_a_hand(draw, before, candidates)
    home = place_region(draw.world.place_by_id[who.home])
    if draw.advanced:
        home = with_surface(home, draw.world, draw.chance)
    count = FREQUENTED_PLACES * thresholds(advanced=draw.advanced).regions
    source = draw.occasion.whereabouts[who.id]
    regions, right = draw.frequented_places(source, who, home, count=count)
    kind = draw.kind(f"What does {who.name} carry home?", candidates, who)
    names = draw.names_for(index)
    for name in names:
        draw.things.hand(name, kind, holder=who.id, near=source.centre)
    text = (
        f"Find {who.name}, {describe_appearance(who.appearance)}, often seen at {regions_text(regions)}; take "
        f"{draw.things.describe(names)} from them, follow them home to {region_text(home)} and put it down there."
    )
    return _subtask(index, text, who, names, regions, right, home, candidates)


def _who_needs_a_hand(draw: Draw, before: list[Subtask], into: dict[str, list[str]]) -> Resident:
    """Have somebody chosen who has not been, and is called by another first name than those who have.

    Who is called like one of them is struck off and another one chosen; where nobody is, one choice is made.
    """
    taken = {one.person.agent for one in before}
    called = {first_name(one.person.name) for one in before}
    people = [who for who in draw.occasion.people if who.id not in taken]
    while True:  # ends: on the occasion there are as many first names as subtasks
        who = people.pop(draw.pick("Who needs a hand?", [one.name for one in people], into, None))
        if first_name(who.name) not in called:
            return who


def _subtask(
    index: int,
    text: str,
    who: Resident,
    objects: list[str],
    sources: list[Region],
    source: int,
    destination: Region | None,
    candidates: dict[str, list[str]],
) -> Subtask:
    """Put a subtask together."""
    person = Person(agent=who.id, name=who.name, looks=describe_appearance(who.appearance))
    return Subtask(
        index=index,
        text=text,
        person=person,
        objects=objects,
        sources=sources,
        source=source,
        destination=destination,
        candidates=candidates,
    )


def _named_regions(subtask: Subtask) -> list[Region]:
    return [*subtask.sources, *([subtask.destination] if subtask.destination is not None else [])]


def _are_apart(region: Region, other: Region) -> bool:
    return float(np.hypot(*np.subtract(region.centre[:2], other.centre[:2]))) > APART


def _starts(world: World, start: NDArray[np.float64], chance: np.random.Generator, count: int) -> list[Start]:
    """Return where the assistants begin: the first at the start, a second beside it."""
    starts = [Start(position=(float(start[0]), float(start[1])), yaw=float(chance.uniform(-np.pi, np.pi)))]
    for _ in range(1, count):
        beside = world.walkable.random_point(chance, near=start, radius=6.0, clearance=0.5)
        starts.append(Start(position=(float(beside[0]), float(beside[1])), yaw=float(chance.uniform(-np.pi, np.pi))))
    return starts
