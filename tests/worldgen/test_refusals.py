"""The geometry engine refuses objects in every stage: the world is built without these alone, and says so."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest
import shapely
from shapely.errors import GEOSException

from command_line import vico
from damaged_maps import DrawnMap, DrawnWay, write_map
from random_windows import painted_once
from shared_folders import Shared
from vico.geo.frame import LocalFrame
from vico.world.check import check_world
from vico.world.check.world import check_dropped
from vico.world.folder import read_world
from vico.world.model import FAILED, TRIED, Dropped, StageReport
from vico.world.world import World
from vico.worldgen import construction, recipe
from vico.worldgen.facades import fronts
from vico.worldgen.indoor import stage as indoor
from vico.worldgen.pipeline import build_world
from vico.worldgen.request import BuildOptions
from vico.worldgen.stages import Stages
from vico.worldgen.transit import stage

HALF = 100.0
FRAME = LocalFrame(48.0, 11.0)
Points = list[tuple[float, float]]

# Everything that is refused in turn, each far enough from the rest that no shape of another has a corner near its own.
LINES: dict[str, tuple[Points, dict[str, str]]] = {
    "main street": ([(-140, 0), (-60, 0), (0, 0), (70, 0), (140, 0)], {"highway": "secondary", "name": "High Street"}),
    "side street": ([(0, 0), (0, 55), (0, 140)], {"highway": "residential", "name": "North Street"}),
    "yard": ([(-70, -83), (-40, -83), (-18, -80)], {"highway": "service"}),
    "passage": ([(42, 22), (42, 31), (42, 45)], {"highway": "service", "covered": "yes"}),
    "overpass": (
        [(85, -130), (85, -40), (85, 40), (85, 130)],
        {"highway": "residential", "bridge": "yes", "layer": "1"},
    ),
    "tunnel": ([(60, -61), (80, -61), (110, -61)], {"highway": "tertiary", "tunnel": "yes", "layer": "-1"}),
    "way to the tunnel": ([(20, -61), (40, -61), (60, -61)], {"highway": "tertiary"}),
    "stairs": ([(-61, 50), (-61, 57), (-61, 64)], {"highway": "steps"}),
    "rails": ([(-140, -93), (0, -92), (140, -93)], {"railway": "rail"}),
    "fence": ([(-90, 80), (-70, 82), (-55, 80)], {"barrier": "fence"}),
    "tree row": ([(-90, 90), (-60, 91), (-30, 90)], {"natural": "tree_row"}),
    "stream": ([(-95, 35), (-85, 40), (-78, 52)], {"waterway": "stream"}),
}
AREAS: dict[str, tuple[tuple[float, float, float, float], dict[str, str]]] = {
    "house": ((-50, 12, -30, 24), {"building": "apartments", "building:levels": "4"}),
    "next house": ((-28, 12, -10, 24), {"building": "apartments", "building:levels": "4"}),
    "shopping house": ((10, 12, 34, 26), {"building": "retail", "building:levels": "2"}),
    "shop": ((14, 14, 22, 24), {"shop": "bakery", "name": "The Good Bakery"}),
    "gate house": ((37, 28, 47, 38), {"building": "office", "building:levels": "3"}),
    "lawn": ((-50, -40, -30, -20), {"landuse": "grass"}),
    "pond": ((-20, -40, -5, -25), {"natural": "water"}),
    "pitch": ((10, -50, 40, -30), {"leisure": "pitch", "sport": "soccer"}),
    "wood": ((-48, 70, -20, 85), {"natural": "wood"}),
    "square": ((10, 50, 30, 66), {"highway": "pedestrian", "area": "yes", "name": "Market Square"}),
    "bicycles": ((-70, 9, -66, 11), {"amenity": "bicycle_rental", "name": "City Bikes"}),
}
CROSSING = (-60.0, 0.0)


@dataclass(frozen=True)
class Place:
    """The map, and how its things are called there: their ids, and the corners that each shares with nothing else."""

    path: Path
    ids: dict[str, str]
    corners: dict[str, Points]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Place:
    drawn = DrawnMap(FRAME, {}, {}, {}, {})
    known: dict[tuple[float, float], int] = {}
    ids: dict[str, str] = {}
    corners: dict[str, Points] = {}

    def node(point: tuple[float, float]) -> int:
        if point not in known:
            known[point] = drawn.node(*point)
        return known[point]

    def add(name: str, points: Points, tags: dict[str, str]) -> None:
        number = drawn.new_id()
        drawn.ways[number] = DrawnWay([node((float(x), float(y))) for x, y in points], tags)
        ids[name], corners[name] = f"w{number}", points

    for name, (points, tags) in LINES.items():
        add(name, points, tags)
    for name, ((x0, y0, x1, y1), tags) in AREAS.items():
        add(name, [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)], tags)
    crossing = node(CROSSING)
    drawn.node_tags[crossing] = {"highway": "crossing", "crossing": "zebra"}
    ids["crossing"] = f"n{crossing}"
    times = Counter(point for points in corners.values() for point in set(points))
    times[CROSSING] += 1
    own = {name: [point for point in points if times[point] == 1] for name, points in corners.items()}
    return Place(write_map(drawn, tmp_path_factory.mktemp("map") / "map.osm.pbf"), ids, own)


def built(place: Place, out: Path) -> World:
    with painted_once():
        build_world(
            place.path, lat=FRAME.lat, lon=FRAME.lon, half=HALF, out=out,
            options=BuildOptions(previews=False, keep_stages=False),
        )  # fmt: skip
    return read_world(out)


@pytest.fixture(scope="module")
def whole(place: Place, shared: Shared) -> World:
    world = read_world(shared("refusals_whole", lambda out: built(place, out), ["worldgen"]))
    assert check_world(world) == []
    assert lost(world) == {}
    return world


def lost(world: World) -> dict[str, set[str]]:
    """Ids of what could not be made, by stage."""
    found: dict[str, set[str]] = {}
    for step in world.manifest.stages:
        for dropped in step.dropped:
            if dropped.reason.startswith(FAILED):
                found.setdefault(step.name, set()).add(dropped.id)
    return found


def everything(world: World) -> set[str]:
    """Ids of all that a world holds, those of planned stops and stations apart: they go where there are streets."""
    return {
        *(b.id for b in world.buildings),
        *(p.id for p in world.places if not p.id.startswith(("stop", "bikes"))),
        *(r.id for r in world.roads.roads),
        *(name for name in world.objects.where(world.objects.outdoors).id.tolist() if name[0] in "wn"),
        *(s.name for s in world.transit.bike_stations),
    }


OPERATIONS = ("buffer", "intersection", "difference", "union", "union_all", "offset_curve", "set_precision", "simplify")


@contextmanager
def refusing(near: dict[str, Points]) -> Iterator[None]:
    """While a stage runs, the geometry engine refuses every shape that has a corner at one of its points."""
    spots = {stage: shapely.MultiPoint(points) for stage, points in near.items()}
    running: list[str] = []

    def refused(given: Any) -> bool:
        if not running or running[-1] not in spots:
            return False
        shapes = np.atleast_1d(np.asarray(given, object))
        points = shapely.points(shapely.get_coordinates(shapes))
        return bool(len(points)) and bool(shapely.dwithin(spots[running[-1]], points, 0.05).any())

    def refuser(operation: Callable[..., Any]) -> Callable[..., Any]:
        def refusing_operation(*given: Any, **options: Any) -> Any:
            shapes = [g for g in given if isinstance(g, shapely.Geometry | np.ndarray | list) and _holds_shapes(g)]
            if any(refused(g) for g in shapes):
                raise GEOSException("TopologyException: side location conflict")
            return operation(*given, **options)

        refusing_operation.__name__ = operation.__name__
        return refusing_operation

    def during(run: Callable[..., Any]) -> Callable[..., Any]:
        def told(self: Stages, name: str, *given: Any, **options: Any) -> Any:
            running.append(name)
            try:
                return run(self, name, *given, **options)
            finally:
                running.pop()

        return told

    @contextmanager
    def timing(self: Stages, name: str) -> Iterator[None]:
        running.append(name)
        with timer(self, name):
            yield
        running.pop()

    timer = Stages.timer
    with ExitStack() as stack:
        stack.enter_context(mock.patch.object(Stages, "timer", timing))
        for name in OPERATIONS:
            stack.enter_context(mock.patch.object(shapely, name, refuser(getattr(shapely, name))))
        stack.enter_context(mock.patch.object(Stages, "run", during(Stages.run)))
        yield


def _holds_shapes(given: Any) -> bool:
    if isinstance(given, shapely.Geometry):
        return True
    return len(given) > 0 and isinstance(np.asarray(given, object).flat[0], shapely.Geometry)


# Several at once, so that few worlds are built; not all: two of one stage are few, three of ground would be a finding,
# and what an early stage loses never comes to a later one.
@pytest.mark.parametrize(
    ("refused", "loses"),
    [
        (
            {
                "facts": ["overpass"],
                "streets": ["yard"],
                "buildings": ["next house"],
                "ways": ["passage"],
                "objects": ["fence"],
                "places": ["shop"],
            },
            ["overpass", "yard", "next house", "passage", "fence", "shop"],
        ),
        (
            {"plans": ["house"], "streets": ["square", "stairs"], "objects": ["wood"]},
            ["house", "square", "stairs", "wood"],
        ),
        ({"grading": ["stream"], "walkable": ["pond"], "ground": ["lawn", "side street"]}, []),
        ({"grading": ["pond"], "bridges": ["rails"], "ground": ["stairs"]}, []),
        ({"ground": ["pond", "rails"]}, []),
    ],
    ids=["lost one a stage", "lost together", "kept 1", "kept 2", "kept 3"],
)
def test_what_the_geometry_engine_refuses_costs_those_objects_alone(
    refused: dict[str, list[str]], loses: list[str], place: Place, whole: World, tmp_path: Path
) -> None:
    with refusing(
        {stage: [point for one in names for point in place.corners[one]] for stage, names in refused.items()}
    ):
        world = built(place, tmp_path / "world")
    assert lost(world) == {
        "buildings" if stage == "plans" else stage: {place.ids[one] for one in names}
        for stage, names in refused.items()
    }
    gone = everything(whole) - everything(world)
    mine = tuple(place.ids[one] for one in loses)
    others = {key for key in gone if not key.startswith(mine)} if mine else set(gone)
    # Streets are lit where houses stand beside them: without a house there may be one lamp less.
    assert {key for key in others if ".lamp" not in key} == set()
    assert len(others) <= 1
    assert check_world(world) == []


def test_what_fails_without_the_geometry_engine_costs_those_objects_alone(
    place: Place, whole: World, tmp_path: Path
) -> None:
    def fails_for(does: Callable[..., Any], name: str) -> Callable[..., Any]:
        def failing(first: Any, *rest: Any) -> Any:
            if getattr(first, "id", "") == place.ids[name] or name == "bicycles":
                raise np.linalg.LinAlgError("Singular matrix")
            return does(first, *rest)

        return failing

    with (
        mock.patch.object(stage, "_off_the_lanes", fails_for(stage._off_the_lanes, "bicycles")),
        mock.patch.object(indoor, "_plan", fails_for(indoor._plan, "shop")),
    ):
        world = built(place, tmp_path / "world")
    assert lost(world) == {"transit": {place.ids["bicycles"]}, "indoor": {place.ids["shop"]}}
    assert everything(whole) - everything(world) == {place.ids["shop"], "City Bikes"}
    assert check_world(world) == []


def test_an_entrance_whose_front_fails_stays_an_entrance(place: Place, whole: World, tmp_path: Path) -> None:
    door, build = whole.entrances[0].id, fronts._Front.build

    def failing(self: Any) -> None:
        if self.spot.entrance.id == door:
            raise ZeroDivisionError("float division by zero")
        build(self)

    with mock.patch.object(fronts._Front, "build", failing):
        world = built(place, tmp_path / "world")
    assert lost(world) == {"fronts": {door}}
    assert everything(world) == everything(whole)
    assert check_world(world) == []


def test_a_build_that_goes_on_tells_again_what_was_lost_before(place: Place, tmp_path: Path) -> None:
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with (
        refusing({"objects": place.corners["fence"]}),
        mock.patch.object(recipe, "walkable_from_site", stop),
        pytest.raises(KeyboardInterrupt),
    ):
        built(place, tmp_path / "world")
    world = built(place, tmp_path / "world")
    assert lost(world) == {"objects": {place.ids["fence"]}}


def test_a_stage_that_fails_as_a_whole_says_which_one_and_where(
    place: Place, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise GEOSException("TopologyException: side location conflict\nat 1 2")

    out = tmp_path / "world"
    with mock.patch.object(construction, "ground_from_osm", refuse):
        code = vico("world", "build", "--osm", place.path, "--center", "48,11", "--radius", 60, "--out", out)
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert code == 2
    assert said.startswith("vico: world build: stage ground failed (GEOSException: TopologyException: side location")
    assert "Traceback" not in said
    assert not out.exists()


def test_more_than_the_stated_share_of_any_stage_is_a_finding(whole: World) -> None:
    for failed, found in ((5, []), (6, ["much left out"])):
        dropped = [Dropped(id=f"w{k}", reason=f"{FAILED}: GEOSException") for k in range(failed)]
        report = StageReport(name="streets", counts={TRIED: 100}, dropped=dropped)
        world = World(whole.manifest.model_copy(update={"stages": [report]}), None)
        assert [f.id for f in check_dropped(world)] == found
