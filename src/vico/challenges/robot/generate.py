"""Drawing robot tasks: who asks, what is brought, from where to where; deterministic, each choice out of nine.

Deliver
    Task: find a thing on the ground about a spot, bring it to a destination, put it down there.
    Randomizations: person, thing, colour, place and heading of the thing, both spots, time of day, the robots' places.
    Success: it lies at rest within 3 m of the spot, or inside the place, in nobody's grip.
Carry
    Task: take up what a person puts down, keep within 5 m of them on their way home, put it down there.
    Randomizations: person, home, thing, colour, where the person waits, time of day, the robots' places.
    Success: after the person has arrived it lies at rest within 3 m of the home's entrance, or inside.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.movable import MovableKind, kinds_for, movable_colours, movable_kinds
from vico.assets.people.words import looks_in_words
from vico.assets.robots import robot_model
from vico.challenges.assistant.choose import Chooser, Question, choose, seeded_chooser
from vico.challenges.assistant.model import Person, Region, Start, TaskObject
from vico.challenges.assistant.regions import Neighbourhood, place_region, told
from vico.challenges.assistant.rules import entrance_of
from vico.challenges.robot.bodies import arm_body
from vico.challenges.robot.model import Category, RobotTask
from vico.challenges.robot.thresholds import (
    APART,
    ARM_COMES,
    CANDIDATES,
    CARRIER_COMES,
    CARRY_REACH,
    DESTINATION_RADIUS,
    GOAL_COMES,
    HIGHEST,
    JAW_ROOM,
    LOWEST,
    REACH,
    SOURCE_RADIUS,
    STEPS,
)
from vico.challenges.robot.ways import Ways
from vico.community.folder import digest_of
from vico.community.model import Community, Resident
from vico.errors import EmptyInputError
from vico.seeds import rng
from vico.world.folder import World
from vico.world.model import Place
from vico.world.walkable import OPEN, SIDEWALK

# Points, and tasks, that are tried; hours at which tasks begin; who asks is of this age at least, years.
_TRIES, _DRAWS, _HOURS, _AGE = 40, 200, tuple(range(9, 18)), 10
# Robots' ways, in metres of pavement, are longer than people's walks by this factor at most.
_ROUNDABOUT = 2.0
# Free ground that robots and things need around them, metres; the robots begin, and the person waits, so far apart.
_ROOM, _BESIDE, _WAITS_WITHIN = 1.0, (2.0, 6.0), (6.0, 14.0)


@dataclass
class _Draw:
    """One episode as it is drawn."""

    world: World
    category: Category
    chance: np.random.Generator
    chooser: Chooser
    ways: Ways
    candidates: dict[str, list[str]] = field(default_factory=dict)

    def pick(self, question: str, names: list[str], who: Resident | None) -> int:
        """Have one of nine chosen, and note what it was chosen from."""
        choice = choose(Question(question, self.category, who), names, self.chooser)
        self.candidates[question] = choice.candidates
        return choice.chosen

    def spot(self, near: NDArray[np.float64], low: float, high: float) -> NDArray[np.float64] | None:
        """Return free level ground so far from a point; None if there is none."""
        for _ in range(_TRIES):
            found = self.world.walkable.random_point(
                self.chance, classes=(OPEN, SIDEWALK), near=near, radius=high, clearance=_ROOM
            )
            if low <= float(np.hypot(*(found - near))) and self.ways.is_level(found):
                return found
        return None


def portable_kinds() -> list[MovableKind]:
    """Return the kinds of things that the jaw is wide enough for."""
    opening = arm_body(robot_model("manipulator")).opening
    return [
        kind
        for kind in kinds_for("robot").values()
        if min(kind.size[:2]) / 2 + JAW_ROOM <= opening and LOWEST <= kind.size[2] <= HIGHEST
    ]


def generate_robot_task(
    world: World,
    community: Community,
    category: Category,
    *,
    seed: int,
    steps: int = STEPS,
    chooser: Chooser | None = None,
) -> RobotTask:
    """Make one episode's task; the same world, community, seed and chooser give the same task.

    Parameters
    ----------
    steps
        Seconds at most.
    chooser
        Who picks out of nine candidates; a seeded draw if None.

    Raises
    ------
    EmptyInputError
        If the world and its people have too little around any starting point.
    """
    chance = rng(seed, "robot task", category, world.digest)
    ways = Ways(world, robot_model("manipulator"), robot_model("husky"))
    draw = _Draw(world, category, chance, chooser or seeded_chooser(chance), ways)
    frame: dict[str, Any] = {
        "category": category,
        "world": world.manifest.name,
        "world_digest": world.digest,
        "community_digest": digest_of(community),
        "seed": seed,
        "steps": steps,
    }
    for _ in range(_DRAWS):
        task = (_carry if category == "carry" else _deliver)(draw, community, frame)
        if task is not None:
            return task
        draw.candidates = {}
    raise EmptyInputError(
        f"robot: nobody knows two spots on level ground that both robots have ways to, {APART:.0f} m apart and within "
        f"a walk of {REACH:.0f} m; use a larger world or more residents"
    )


def _deliver(draw: _Draw, community: Community, frame: dict[str, Any]) -> RobotTask | None:
    asker, hood = _asker(draw, community, REACH)
    spots = hood.spots_of(asker, draw.chance, radius=SOURCE_RADIUS)
    if not spots:
        return None
    source = spots[draw.pick("Where does the thing lie?", [r.name for r in spots], asker)]
    targets = [place_region(place) for place in hood.places_of(asker)]
    targets += hood.spots_of(asker, draw.chance, radius=DESTINATION_RADIUS)
    targets = [region for region in targets if _apart(region, source)]
    if not targets:
        return None
    target = targets[draw.pick("Where is it brought to?", [r.name for r in targets], asker)]
    lies = draw.spot(np.array(source.centre[:2]), 0.5, SOURCE_RADIUS)
    robots = _starts(draw, hood.start)
    if lies is None or robots is None or not _can_go(draw, robots, lies, np.array(target.centre), REACH):
        return None
    thing = _thing(draw, asker, lies, None)
    text = (
        f"{asker.name} asks: bring {_described(thing)} from the ground {told(source)} to {told(target)} and put it "
        "down there."
    )
    return RobotTask(
        **frame,
        start=_hour(draw),
        manipulator=robots[0],
        carrier=robots[1],
        text=text,
        person=_person(asker),
        waits_at=None,
        thing=thing,
        source=source,
        destination=target,
        candidates=dict(draw.candidates),
    )


def _carry(draw: _Draw, community: Community, frame: dict[str, Any]) -> RobotTask | None:
    asker, hood = _asker(draw, community, CARRY_REACH)
    home = hood.places.get(asker.home)
    if home is None or not APART <= hood.distance(home.position) <= CARRY_REACH:
        return None
    region = place_region(home)
    robots = _starts(draw, hood.start)
    waits = draw.spot(hood.start, *_WAITS_WITHIN)
    door = entrance_of(region, draw.world)
    if robots is None or waits is None or not _can_go(draw, robots, waits, door, CARRY_REACH):
        return None
    thing = _thing(draw, asker, waits, asker.id)
    looks = looks_in_words(asker.appearance)
    text = (
        f"{asker.name}, {looks}, waits near by with {_described(thing)}: go there and call them, take up what they put "
        f"down, go home with them to {told(region)}, and put it down there."
    )
    source = hood.spot(waits, radius=SOURCE_RADIUS)
    back = np.array(robots[0].position) - waits
    stands = Start(position=(float(waits[0]), float(waits[1])), yaw=float(np.arctan2(back[1], back[0])))
    return RobotTask(
        **frame,
        start=_hour(draw),
        manipulator=robots[0],
        carrier=robots[1],
        text=text,
        person=_person(asker),
        waits_at=stands,
        thing=thing,
        source=source,
        destination=region,
        candidates=dict(draw.candidates),
    )


def _asker(draw: _Draw, community: Community, reach: float) -> tuple[Resident, Neighbourhood]:
    """Return somebody, and what lies about a start that they know."""
    people = [who for who in community.residents if who.age >= _AGE]
    who = people[draw.pick("Who asks?", [one.name for one in people], None)]
    inner = [xy for place in _known(draw.world, who) if max(map(abs, xy := place.position[:2])) < 0.8 * draw.world.half]
    near = inner[int(draw.chance.integers(len(inner)))] if inner else (0.0, 0.0)
    start = draw.world.walkable.random_point(draw.chance, near=near, radius=40.0, clearance=_ROOM)
    return who, Neighbourhood(draw.world, draw.world.router, start, reach=reach)


def _known(world: World, who: Resident) -> list[Place]:
    return [world.place_by_id[place] for place in dict.fromkeys((who.home, *who.known_places))]


def _can_go(
    draw: _Draw, robots: tuple[Start, Start], thing: NDArray[np.float64], goal: NDArray[np.float64], reach: float
) -> bool:
    """Return whether both robots can begin, and come near enough to the thing and to where it is to be."""
    ways, within = draw.ways, _ROUNDABOUT * reach
    if not ways.is_level(goal):
        return False
    near = ((ways.manipulator, ARM_COMES, GOAL_COMES), (ways.carrier, CARRIER_COMES, CARRIER_COMES))
    for start, (model, at_thing, at_goal) in zip(robots, near, strict=True):
        points = [(thing, at_thing), (goal, at_goal)]
        if not ways.stands(model, start.position) or not ways.lead(model, start.position, points, within=within):
            return False
    return True


def _starts(draw: _Draw, start: NDArray[np.float64]) -> tuple[Start, Start] | None:
    beside = draw.spot(start, *_BESIDE)
    if beside is None:
        return None
    yaws = draw.chance.uniform(-np.pi, np.pi, 2).tolist()
    at = [(float(xy[0]), float(xy[1])) for xy in (start, beside)]
    return Start(position=at[0], yaw=yaws[0]), Start(position=at[1], yaw=yaws[1])


def _thing(draw: _Draw, who: Resident, at: NDArray[np.float64], holder: str | None) -> TaskObject:
    kinds = portable_kinds()
    order = [kinds[int(k)] for k in draw.chance.permutation(len(kinds))[:CANDIDATES]]
    kind = order[draw.pick("What is brought?", [one.kind for one in order], who)]
    colours = list(movable_colours())
    colour = colours[int(draw.chance.integers(len(colours)))]
    return TaskObject(
        id="object",
        kind=kind.kind,
        colour=colour,
        name=f"{colour} {kind.kind}",
        position=(float(at[0]), float(at[1]), float(draw.world.height(at))),
        yaw=float(draw.chance.uniform(-np.pi, np.pi)),
        room=None,
        holder=holder,
    )


def _described(thing: TaskObject) -> str:
    return movable_kinds()[thing.kind].described(thing.colour)


def _apart(region: Region, other: Region) -> bool:
    return float(np.hypot(*np.subtract(region.centre[:2], other.centre[:2]))) >= APART


def _hour(draw: _Draw) -> str:
    return f"{int(draw.chance.choice(_HOURS)):02d}:00"


def _person(who: Resident) -> Person:
    return Person(agent=who.id, name=who.name, looks=looks_in_words(who.appearance))
