"""Drawing tasks: who asks, which places, which things; deterministic, each choice out of nine candidates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.agents.talk.address import first_name
from vico.assets.models.movable import kinds_for
from vico.assets.people.words import looks_in_words
from vico.challenges.assistant.choose import Chooser, Question, choose, seeded_chooser
from vico.challenges.assistant.model import Category, Person, Region, Start, Subtask, Task
from vico.challenges.assistant.regions import Neighbourhood, either, place_region, told, with_surface
from vico.challenges.assistant.starts import Occasion, carry_occasion, errand_occasion
from vico.challenges.assistant.things import Things
from vico.challenges.assistant.thresholds import (
    APART,
    CANDIDATES,
    HAUNTS,
    SEARCH_RADIUS,
    SOURCE_RADIUS,
    STEPS,
    SUBTASKS,
    thresholds,
)
from vico.community.folder import digest_of
from vico.community.model import Community, Resident
from vico.errors import EmptyInputError, InputError
from vico.seeds import rng
from vico.world.world import World


@dataclass
class Draw:
    """One episode as it is drawn."""

    world: World
    category: Category
    occasion: Occasion
    chance: np.random.Generator
    chooser: Chooser
    things: Things
    advanced: bool

    @property
    def hood(self) -> Neighbourhood:
        """What lies within a walk of the start."""
        return self.occasion.hood

    def pick(self, question: str, names: list[str], into: dict[str, list[str]], who: Resident | None) -> int:
        """Have one of nine chosen, for whom who asks, and note what it was chosen from."""
        choice = choose(Question(question, self.category, who), names, self.chooser)
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
        return self._mixed(source, [near[int(k)] for k in order])

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
        return self._mixed(source, list(apart.values())[: count - 1])

    def _others(self, source: Region, regions: list[Region], target: Region | None) -> list[Region]:
        """Return regions other than the source, where no thing is told to lie and none is brought to; nearest first."""
        others = [r for r in self.things.untold(regions) if r.place is None or r.place != source.place]
        others = [r for r in others if target is None or _apart(r, target)]
        return sorted(others, key=lambda r: float(np.hypot(*np.subtract(r.centre[:2], source.centre[:2]))))

    def _mixed(self, source: Region, others: list[Region]) -> tuple[list[Region], int]:
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
    draw = Draw(world, category, occasion, chance, chooser or seeded_chooser(chance), Things(world, chance), advanced)
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


def shortened(task: Task, *, subtasks: int) -> Task:
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
    targets = [r for r in targets if _apart(r, source)] or [
        r
        for r in draw.things.untold(draw.hood.spots_of(who, draw.chance, radius=limits.destination_radius))
        if _apart(r, source)
    ]
    if not targets:
        raise EmptyInputError(f"delivery: nothing lies {APART:.0f} m or more from {source.name}; use a larger world")
    target = targets[draw.pick("Where are the things brought to?", [r.name for r in targets], candidates, who)]
    if draw.advanced:
        target = with_surface(target, draw.world, draw.chance)
    kind = draw.kind(f"What is carried from {source.name} to {target.name}?", candidates, who)
    told_before = [region for one in before for region in _told_of(one)]
    names = draw.names_for(index)
    for name in names:
        draw.things.make(name, kind, in_region=source, middles=[*told_before, source, target])
    regions, right = draw.among_others(source, who, radius=SOURCE_RADIUS, count=limits.regions, target=target)
    text = f"{who.name} asks: bring {draw.things.described(names)} from {either(regions)} to {told(target)}."
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
    told_before = [region for one in before for region in _told_of(one)]
    names = [f"object_{index}_0"]
    draw.things.make(names[0], kind, in_region=source, middles=[*told_before, source])
    count = thresholds(advanced=draw.advanced).regions
    regions, right = draw.among_others(source, who, radius=SEARCH_RADIUS, count=count)
    text = f"{who.name} asks: find {draw.things.described(names)}, lost at {either(regions)}."
    return _subtask(index, text, who, names, regions, right, None, candidates)


def _carry(draw: Draw, index: int, before: list[Subtask]) -> Subtask:
    """Find somebody, take what they hand over, follow them home, put it down there."""
    candidates: dict[str, list[str]] = {}
    who = _who_needs_a_hand(draw, before, candidates)
    home = place_region(draw.world.place_by_id[who.home])
    if draw.advanced:
        home = with_surface(home, draw.world, draw.chance)
    count = HAUNTS * thresholds(advanced=draw.advanced).regions
    source = draw.occasion.whereabouts[who.id]
    regions, right = draw.frequented_places(source, who, home, count=count)
    kind = draw.kind(f"What does {who.name} carry home?", candidates, who)
    names = draw.names_for(index)
    for name in names:
        draw.things.hand(name, kind, holder=who.id, near=source.centre)
    text = (
        f"Find {who.name}, {looks_in_words(who.appearance)}, often seen at {either(regions)}; take "
        f"{draw.things.described(names)} from them, follow them home to {told(home)} and put it down there."
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
    person = Person(agent=who.id, name=who.name, looks=looks_in_words(who.appearance))
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


def _told_of(subtask: Subtask) -> list[Region]:
    return [*subtask.sources, *([subtask.destination] if subtask.destination is not None else [])]


def _apart(region: Region, other: Region) -> bool:
    return float(np.hypot(*np.subtract(region.centre[:2], other.centre[:2]))) > APART


def _starts(world: World, start: NDArray[np.float64], chance: np.random.Generator, count: int) -> list[Start]:
    """Return where the assistants begin: the first at the start, a second beside it."""
    starts = [Start(position=(float(start[0]), float(start[1])), yaw=float(chance.uniform(-np.pi, np.pi)))]
    for _ in range(1, count):
        beside = world.walkable.random_point(chance, near=start, radius=6.0, clearance=0.5)
        starts.append(Start(position=(float(beside[0]), float(beside[1])), yaw=float(chance.uniform(-np.pi, np.pi))))
    return starts
