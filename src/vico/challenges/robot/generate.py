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

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.movable import MovableKind, kinds_for
from vico.assets.robots import robot_model
from vico.challenges.assistant.candidates import Chooser, seeded_chooser
from vico.challenges.assistant.evaluate import entrance_of
from vico.challenges.assistant.placement import Neighbourhood, place_region, region_text
from vico.challenges.assistant.tasks import Region, Start
from vico.challenges.robot.tasks import (
    APART,
    ARM_COMES,
    CARRIER_COMES,
    CARRY_REACH,
    DESTINATION_RADIUS,
    GOAL_COMES,
    HIGHEST,
    JAW_ROOM,
    LEVEL,
    LOWEST,
    REACH,
    SOURCE_RADIUS,
    STEPS,
    Category,
    RobotTask,
)
from vico.challenges.robot_tasks import Draw, arm_body, frame_of, object_description, person_of
from vico.community.model import Community, Resident
from vico.errors import EmptyInputError
from vico.seeds import rng
from vico.world.world import World

Array = NDArray[np.float64]

# Tasks that are tried; who asks is of this age at least, years.
_DRAWS, _AGE = 200, 10
# Robots' ways, in metres of pavement, are longer than people's walks by this factor at most.
_ROUNDABOUT = 2.0
# The robots begin, and the person waits, so far apart, metres.
_BESIDE, _WAITS_WITHIN = (2.0, 6.0), (6.0, 14.0)


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
    draw = Draw(world, community, category, chance, chooser or seeded_chooser(chance))
    frame = frame_of(world, community, category, seed=seed, steps=steps)
    for _ in range(_DRAWS):
        task = (_carry if category == "carry" else _deliver)(draw, frame)
        if task is not None:
            return task
        draw.candidates.clear()
    raise EmptyInputError(
        f"robot: nobody knows two spots on level ground that both robots have ways to, {APART:.0f} m apart and within "
        f"a walk of {REACH:.0f} m; use a larger world or more residents"
    )


def _deliver(draw: Draw, frame: dict[str, Any]) -> RobotTask | None:
    asker, hood = _asker(draw, REACH)
    spots = hood.spots_of(asker, draw.chance, radius=SOURCE_RADIUS)
    if not spots:
        return None
    source = spots[draw.pick("Where does the thing lie?", [r.name for r in spots], asker)]
    targets = [place_region(place) for place in hood.places_of(asker)]
    targets += hood.spots_of(asker, draw.chance, radius=DESTINATION_RADIUS)
    targets = [region for region in targets if _are_apart(region, source)]
    if not targets:
        return None
    target = targets[draw.pick("Where is it brought to?", [r.name for r in targets], asker)]
    lies = _spot(draw, np.array(source.centre[:2]), 0.5, SOURCE_RADIUS)
    robots = _starts(draw, hood.start)
    if lies is None or robots is None or not _can_go(draw, robots, lies, np.array(target.centre), REACH):
        return None
    thing = draw.thing("What is brought?", portable_kinds(), asker, lies)
    text = (
        f"{asker.name} asks: bring {object_description(thing)} from the ground {region_text(source)} to "
        f"{region_text(target)} and put it down there."
    )
    asked = {"text": text, "person": person_of(asker), "waits_at": None, "thing": thing}
    return _task(draw, frame, robots, source, target, asked)


def _carry(draw: Draw, frame: dict[str, Any]) -> RobotTask | None:
    asker, hood = _asker(draw, CARRY_REACH)
    home = hood.places.get(asker.home)
    if home is None or not APART <= hood.distance(home.position) <= CARRY_REACH:
        return None
    region = place_region(home)
    robots = _starts(draw, hood.start)
    waits = _spot(draw, hood.start, *_WAITS_WITHIN)
    door = entrance_of(region, draw.world)
    if robots is None or waits is None or not _can_go(draw, robots, waits, door, CARRY_REACH):
        return None
    thing = draw.thing("What is brought?", portable_kinds(), asker, waits, holder=asker.id)
    person = person_of(asker)
    text = (
        f"{asker.name}, {person.looks}, waits near by with {object_description(thing)}: go there and call them, take "
        f"up what they put down, go home with them to {region_text(region)}, and put it down there."
    )
    waits_at = draw.stands(waits, towards=np.array(robots[0].position))
    asked = {"text": text, "person": person, "waits_at": waits_at, "thing": thing}
    return _task(draw, frame, robots, hood.spot(waits, radius=SOURCE_RADIUS), region, asked)


def _task(
    draw: Draw,
    frame: dict[str, Any],
    robots: tuple[Start, Start],
    source: Region,
    destination: Region,
    asked: dict[str, Any],
) -> RobotTask:
    return RobotTask(
        **frame,
        **asked,
        start=draw.hour(),
        manipulator=robots[0],
        carrier=robots[1],
        source=source,
        destination=destination,
        candidates=dict(draw.candidates),
    )


def _asker(draw: Draw, reach: float) -> tuple[Resident, Neighbourhood]:
    """Return somebody, and what lies about a start that they know."""
    return draw.asker(draw.people(_AGE), reach=reach)


def _is_level(draw: Draw, at: Array) -> bool:
    """Return whether things lie still, and are put down upright, at a point, ENU metres."""
    return draw.ways.rise(at) <= LEVEL


def _spot(draw: Draw, near: Array, low: float, high: float) -> Array | None:
    """Return free level ground so far from a point; None if there is none."""
    return draw.spot(near, low, high, suits=lambda found: _is_level(draw, found))


def _can_go(draw: Draw, robots: tuple[Start, Start], thing: Array, goal: Array, reach: float) -> bool:
    """Return whether both robots can begin, and come near enough to the thing and to where it is to be."""
    if not _is_level(draw, goal):
        return False
    near = (("manipulator", ARM_COMES, GOAL_COMES), ("husky", CARRIER_COMES, CARRIER_COMES))
    for start, (name, at_thing, at_goal) in zip(robots, near, strict=True):
        model, points = robot_model(name), [(thing, at_thing), (goal, at_goal)]
        if not draw.ways.stands(model, start.position):
            return False
        if not draw.ways.lead(model, start.position, points, within=_ROUNDABOUT * reach):
            return False
    return True


def _starts(draw: Draw, start: Array) -> tuple[Start, Start] | None:
    beside = _spot(draw, start, *_BESIDE)
    return None if beside is None else (draw.stands(start), draw.stands(beside))


def _are_apart(region: Region, other: Region) -> bool:
    return float(np.hypot(*np.subtract(region.centre[:2], other.centre[:2]))) >= APART
