"""The delivery task: its rule in one place.

Task: bring things from where they are (inside a place, or a region outdoors) to a destination (a place, or a spot
outdoors). The assistant is told the things' names, the source and the destination; it must find the things itself.

Randomisation: the start; for each of six errands the source, the destination and the kind of thing, each chosen out
of nine candidates; one or two things an errand; their colours; the container surface indoors, or a free, reachable
point outdoors, on which each lies.

Success: every thing of the errand lies, in nobody's hands, inside the destination: in one of the place's rooms, or
outdoors within 3 m of the spot (spec, section 4.1).
"""

from __future__ import annotations

import numpy as np

from vico.assets.models.movable import movable_colours, movable_kinds
from vico.challenges.assistant.choose import CANDIDATES, Chooser, NearbyRegions, seeded_chooser
from vico.challenges.assistant.model import Region, Start, StateView, Subtask, Task, TaskObject
from vico.errors import EmptyInputError
from vico.seeds import rng
from vico.world.folder import World
from vico.world.model import Container, Point3, Room
from vico.world.routing import Router
from vico.world.walkable import OPEN, SIDEWALK

SUBTASKS = 6
STEPS = 1500
DESTINATION_RADIUS = 3.0
# How far outdoor things may lie from the middle of the region that is named: what one sees from there at a glance.
SOURCE_RADIUS = 8.0
# Errands stay in the neighbourhood, so that six of them can be done on foot in 1500 s by somebody who plans well.
REACH = 160.0
# Middles of regions are told, positions of things are not: none lies in a middle, metres.
_OFF_MIDDLE = 0.4
_TRIES = 100


def generate_delivery(
    world: World, *, seed: int, assistants: int = 1, steps: int = STEPS, chooser: Chooser | None = None
) -> Task:
    """Make one episode's task; the same world, seed and chooser give the same task.

    Raises
    ------
    EmptyInputError
        If the world has too few places around any starting point.
    """
    chance = rng(seed, "delivery", world.digest)
    choose = chooser or seeded_chooser(chance)
    router = world.router
    start, surroundings = _start(world, router, chance)
    objects: list[TaskObject] = []
    subtasks: list[Subtask] = []
    taken: set[str] = set()
    for index in range(SUBTASKS):
        indoors = bool(chance.random() < 0.5)
        count = 1 + int(chance.random() < 0.3)
        sources = _untold(_candidates(surroundings, chance, indoors=indoors, radius=SOURCE_RADIUS), objects)
        if not sources:
            raise EmptyInputError("delivery: a thing lies in the middle of every region there is; use a larger world")
        source = sources[choose("Where do the things lie?", [r.name for r in sources])]
        targets = _candidates(surroundings, chance, indoors=bool(chance.random() < 0.6), radius=DESTINATION_RADIUS)
        targets = [
            r for r in _untold(targets, objects) if np.hypot(*np.subtract(r.centre[:2], source.centre[:2])) > 20.0
        ]
        if not targets:
            raise EmptyInputError(f"delivery: nothing lies 20 m or more from {source.name}; use a larger world")
        destination = targets[choose("Where are the things brought to?", [r.name for r in targets])]
        kinds = [str(k) for k in chance.permutation(sorted(movable_kinds()))[:CANDIDATES]]
        kind = kinds[choose(f"What is carried from {source.name} to {destination.name}?", kinds)]
        told = [region for errand in subtasks for region in (errand.source, errand.destination)]
        middles = np.array([region.centre[:2] for region in (*told, source, destination)])
        names = [f"object_{index}_{k}" for k in range(count)]
        things = [_thing(surroundings, chance, kind, source, middles, taken, name) for name in names]
        objects += things
        what = " and ".join(movable_kinds()[t.kind].described(t.colour) for t in things)
        subtasks.append(
            Subtask(
                index=index,
                text=f"Bring {what} from {_at(source)} to {_at(destination)}.",
                objects=[t.id for t in things],
                source=source,
                destination=destination,
                object_candidates=kinds,
                source_candidates=[r.name for r in sources],
                destination_candidates=[r.name for r in targets],
            )
        )
    starts = [Start(position=(float(start[0]), float(start[1])), yaw=float(chance.uniform(-np.pi, np.pi)))]
    for _ in range(1, assistants):
        beside = world.walkable.random_point(chance, near=start, radius=6.0, clearance=0.5)
        starts.append(Start(position=(float(beside[0]), float(beside[1])), yaw=float(chance.uniform(-np.pi, np.pi))))
    return Task(
        category="delivery",
        world=world.manifest.name,
        world_digest=world.digest,
        seed=seed,
        steps=steps,
        assistants=starts,
        objects=objects,
        subtasks=subtasks,
    )


def delivered(subtask: Subtask, state: StateView, world: World) -> bool:
    """Tell whether an errand is done: the rule of this module's heading."""
    return all(_inside(subtask.destination, name, state, world) for name in subtask.objects)


def _inside(region: Region, name: str, state: StateView, world: World) -> bool:
    if state.object_holder(name) is not None:
        return False
    room = state.object_room(name)
    if region.kind == "place":
        return room is not None and world.room_by_id[room].place == region.place
    position = state.object_position(name)
    return room is None and float(np.hypot(*(position[:2] - np.asarray(region.centre[:2])))) <= region.radius


def _start(world: World, router: Router, chance: np.random.Generator) -> tuple[np.ndarray, NearbyRegions]:
    """Return a free spot with enough places around it, away from the map's edge."""
    for _ in range(20):
        start = world.walkable.random_point(chance, near=(0.0, 0.0), radius=0.75 * world.half, clearance=0.75)
        try:
            return start, NearbyRegions(world, router, start, reach=REACH)
        except EmptyInputError:
            continue
    raise EmptyInputError("delivery: no start has two places that can be entered within a walk; use a larger world")


def _candidates(
    surroundings: NearbyRegions, chance: np.random.Generator, *, indoors: bool, radius: float
) -> list[Region]:
    """Nine regions, or as many as there are, of the wanted kind; of the other kind if there is none."""
    outdoors = surroundings.outdoor_candidates(chance, CANDIDATES, radius=radius)
    places = surroundings.indoor_candidates(chance, CANDIDATES)
    return places if (indoors and places) or not outdoors else outdoors


def _untold(regions: list[Region], objects: list[TaskObject]) -> list[Region]:
    """Regions in whose middle, which is told, no thing lies."""
    lying = np.array([thing.position[:2] for thing in objects]).reshape(-1, 2)
    return [r for r in regions if (np.hypot(*(lying - r.centre[:2]).T) >= _OFF_MIDDLE).all()]


def _at(region: Region) -> str:
    return region.name if region.kind == "place" else f"outdoors at {region.name}"


def _thing(
    surroundings: NearbyRegions,
    chance: np.random.Generator,
    kind: str,
    source: Region,
    middles: np.ndarray,
    taken: set[str],
    name: str,
) -> TaskObject:
    """Return a thing with a name no other thing of the episode has, laid down in the source, in none of the middles."""
    free = [c for c in movable_colours() if f"{c} {kind}" not in taken]
    colour = free[int(chance.integers(len(free)))]
    taken.add(f"{colour} {kind}")
    room: str | None = None
    if source.kind == "place":
        position, room = _spot_indoors(surroundings, chance, kind, source)
    else:
        position = _spot_outdoors(surroundings.world, chance, source, middles)
    return TaskObject(
        id=name,
        kind=kind,
        colour=colour,
        name=f"{colour} {kind}",
        position=position,
        yaw=float(chance.uniform(-np.pi, np.pi)),
        room=room,
    )


def _spot_indoors(
    surroundings: NearbyRegions, chance: np.random.Generator, kind: str, source: Region
) -> tuple[Point3, str]:
    """Return a spot on one of a place's surfaces, and the id of its room."""
    rooms = [surroundings.rooms[i] for i in surroundings.world.place_by_id[str(source.place)].rooms]
    surfaces = [(r, c) for r in rooms for c in r.containers]
    room, container = surfaces[int(chance.integers(len(surfaces)))]
    return _on(container, room, kind, chance), room.id


def _spot_outdoors(world: World, chance: np.random.Generator, source: Region, middles: np.ndarray) -> Point3:
    """Return a free, reachable spot of a region that lies in none of the middles that are told."""
    for _ in range(_TRIES):
        spot = world.walkable.random_point(
            chance, classes=(OPEN, SIDEWALK), near=source.centre, radius=SOURCE_RADIUS, clearance=0.5
        )
        if np.hypot(*(middles - spot).T).min() >= _OFF_MIDDLE:
            x, y = spot
            return (float(x), float(y), float(world.height(spot)))
    raise EmptyInputError(f"delivery: at {source.name} things can lie in its middle only; use a larger world")


def _on(container: Container, room: Room, kind: str, chance: np.random.Generator) -> Point3:
    """Return a spot on a surface; on the floor, where somebody can stand, so that furniture never buries the thing."""
    if container.kind == "floor":
        return (container.reach[0], container.reach[1], room.centre[2])
    margin = max(movable_kinds()[kind].size[:2]) / 2
    half = np.maximum(np.asarray(container.size) / 2 - margin, 0.0)
    u, v = chance.uniform(-half, half)
    c, s = np.cos(container.yaw), np.sin(container.yaw)
    x, y, z = container.centre
    return (float(x + c * u - s * v), float(y + s * u + c * v), z)
