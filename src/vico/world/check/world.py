"""Is a world what it says it is? Everything a consumer relies on, checked one by one."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from vico.errors import VicoError
from vico.io.files import sha256_of
from vico.world.check.buildings import check_buildings_apart, check_buildings_closed, check_buildings_seated, outline_of
from vico.world.check.indoors import check_containers, check_indoors, check_rooms
from vico.world.check.outdoors import (
    check_clearances,
    check_entrances,
    check_objects,
    check_places,
    check_rails,
    check_roads,
    check_transit,
)
from vico.world.model import FAILED, FAULT, TRIED, WorldFinding
from vico.world.opendrive import check_opendrive
from vico.world.world import World, world_files

MOST_FAILED = 0.05
"""Share of the objects of any stage that may fail to be made."""

FEW_FAILED = 2
"""How many a stage may fail to make whatever their share: a small window has few objects."""

_Rule = Callable[[World], Iterable[WorldFinding]]

_MADE = {"buildings": "buildings"}  # what counts the objects of a stage that does not say how many it tried


def check_world(world: World, *, part: bool = False) -> list[WorldFinding]:
    """Check a world.

    Parameters
    ----------
    world
        As read from its folder.
    part
        Whether it is a tile of a city, whose streets are the city's (`check_whole`).

    Returns
    -------
    list of Finding
        Empty if all is well. A file that can't be read is a finding too, and ends the checks that need it.
    """
    return _run_rules(world, _RULES if part else (*_RULES, *_STREET_RULES))


def check_whole(world: World) -> list[WorldFinding]:
    """Check what a city has as a whole, and that its tiles' entities differ; as `check_world`."""
    return _run_rules(world, (check_whole_files, *_STREET_RULES, check_entities, check_dropped))


def _run_rules(world: World, rules: Iterable[_Rule]) -> list[WorldFinding]:
    findings: list[WorldFinding] = []
    for rule in rules:
        try:
            findings += rule(world)
        except VicoError as error:
            findings.append(WorldFinding("readable", rule.__name__.removeprefix("check_"), str(error)))
    return _with_locations(world, findings) if findings else findings


def _with_locations(world: World, findings: list[WorldFinding]) -> list[WorldFinding]:
    """Return the findings with the places of the things they name, as far as the world can be read."""
    at: dict[str, tuple[float, float]] = {}
    with contextlib.suppress(VicoError):
        for building in world.buildings:
            middle = outline_of(building).representative_point()
            at[building.id] = (middle.x, middle.y)
        at |= {door.id: door.position[:2] for door in world.entrances}
        at |= {place.id: place.position[:2] for place in world.places}
        for room in world.rooms:
            at[room.id] = room.centre[:2]
            at |= {container.id: container.centre[:2] for container in room.containers}
        at |= dict(zip(world.objects.id.tolist(), world.objects.position[:, :2].tolist(), strict=True))
        at |= {stop.id: stop.wait[:2] for stop in world.transit.stops}
        at |= {stop.id: stop.wait[:2] for stop in world.transit.tram_stops}
        lanes = world.lanes
        for k, name in enumerate(lanes.ids):
            at[name] = tuple(lanes.line(k)[0, :2].tolist())
    found = ((f, at.get(f.where)) for f in findings)
    return [f._replace(at=(round(float(p[0]), 2), round(float(p[1]), 2))) if p is not None else f for f, p in found]


def check_files(world: World) -> Iterator[WorldFinding]:
    """Check that every file is there, and is what was written."""
    if world.path is None:
        return
    listed = world.manifest.files
    there = world_files(world.path)
    for name in sorted(set(listed) - set(there)):
        yield WorldFinding("file missing", name, "listed in world.json, but not there")
    for name in sorted(set(there) - set(listed)):
        yield WorldFinding("file unknown", name, "there, but not listed in world.json")
    for name in there:
        if name in listed and sha256_of(world.path / name) != listed[name]:
            yield WorldFinding("file changed", name, "its SHA-256 is not the one in world.json")


def check_whole_files(world: World) -> Iterator[WorldFinding]:
    """Check that what a city has as a whole is what its manifest names."""
    for name, digest in world.manifest.files.items():
        path = world.file(name)
        if not path.exists():
            yield WorldFinding("file missing", name, "listed in city.json, but not there")
        elif sha256_of(path) != digest:
            yield WorldFinding("file changed", name, "its SHA-256 is not the one in city.json")


def check_entities(world: World) -> Iterator[WorldFinding]:
    """Check that no two things share a number. Stops' and stations' objects carry their records' own."""
    numbers: list[NDArray[np.int64]] = [
        np.array([b.entity for b in world.buildings], np.int64),
        np.array([r.entity for r in world.rooms], np.int64),
        world.objects.entity.astype(np.int64),
    ]
    every = np.concatenate(numbers)
    values, counts = np.unique(every, return_counts=True)
    for number in values[counts > 1].tolist():
        yield WorldFinding("entity twice", str(number), f"{int(counts[values == number][0])} things have this number")


def check_dropped(world: World) -> Iterator[WorldFinding]:
    """Check that no stage failed to make more than `MOST_FAILED` of its objects, nor any for a fault of ours."""
    for stage in world.manifest.stages:
        for dropped in stage.dropped:
            if dropped.reason.startswith(FAULT):
                yield WorldFinding("program fault", dropped.id, f"{stage.name}: {dropped.reason}")
        failed = len({dropped.id for dropped in stage.dropped if dropped.reason.startswith(FAILED)})
        tried = stage.counts.get(TRIED, failed + stage.counts.get(_MADE.get(stage.name, ""), 0))
        if failed > max(FEW_FAILED, MOST_FAILED * tried):
            what = f"{failed} of {tried} can't be made; see the reasons in report.html"
            yield WorldFinding("much left out", stage.name, what)


_RULES: tuple[_Rule, ...] = (
    check_files,
    check_buildings_closed,
    check_buildings_seated,
    check_buildings_apart,
    check_entrances,
    check_places,
    check_rooms,
    check_containers,
    check_indoors,
    check_objects,
    check_clearances,
    check_entities,
    check_dropped,
)
_STREET_RULES: tuple[_Rule, ...] = (check_roads, check_transit, check_rails, check_opendrive)
