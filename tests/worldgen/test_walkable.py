"""Rasterising streets, walls and things."""

import numpy as np
import shapely

from vico.world.objects import Objects
from vico.world.walkable import BLOCKED, CROSSING, OPEN, ROADWAY, SIDEWALK, WalkableMap
from vico.worldgen.ground.walkable import walkable_map

NOTHING = shapely.Polygon()


def small_map(**given: object) -> WalkableMap:
    shapes = {"roadway": NOTHING, "sidewalk": NOTHING, "crossing": NOTHING, "water": NOTHING}
    return walkable_map(half=10.0, **({"solids": [], "objects": Objects.none()} | shapes | given))


def test_crossings_win_over_roadways_and_bridges_over_water() -> None:
    grid = small_map(
        water=shapely.box(-10, -4, 10, 4),
        roadway=shapely.box(-3, -10, 3, 10),
        crossing=shapely.box(-3, 6, 3, 8),
        sidewalk=shapely.box(4, -10, 6, 10),
    )
    assert [int(grid.class_at(p)) for p in ((0, 0), (0, 7), (5, 0), (-5, 0), (-5, 6))] == [
        ROADWAY,
        CROSSING,
        SIDEWALK,
        BLOCKED,
        OPEN,
    ]


def test_a_wall_a_hand_thick_closes_the_way() -> None:
    grid = small_map(solids=[shapely.box(-10, 0.26, 10, 0.3)])
    assert not (grid.cls != BLOCKED).all(axis=0).any()


def test_a_yard_in_a_building_stays_open_and_unconnected() -> None:
    block = shapely.box(-8, -8, 8, 8).difference(shapely.box(-4, -4, 4, 4))
    grid = small_map(solids=[block])
    assert int(grid.class_at((0, 0))) == OPEN
    assert not bool(grid.is_connected((0, 0)))


def test_free_cells_keep_a_body_off_the_wall() -> None:
    wall = shapely.Polygon([(-6, -5), (7, -2), (5, 6), (-3, 3)])
    grid = small_map(solids=[wall])
    rows, columns = np.nonzero(grid.cls)
    away = shapely.distance(shapely.points(grid.centre_of(np.column_stack([columns, rows]))), wall)
    assert away.min() >= 0.3
