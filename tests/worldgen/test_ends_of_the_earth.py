"""Worlds where longitude misbehaves: beside a pole, on one, and across the date line."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import shapely

from vico.world.check import check_world
from vico.world.folder import read_world
from vico.worldgen.pipeline import build_world
from vico.worldgen.request import BuildOptions

_A, _F = 6378137.0, 1 / 298.257223563  # WGS 84
_E2 = _F * (2 - _F)
_NEAR = 0.02  # metres: the map's own grid of 1e-7 degrees is a centimetre wide

# Metres east and north of the window's centre. No two are alike, so that a world turned or mirrored is found out.
_HOUSES = {
    "hall": [(-40.0, 12.0), (-18.0, 12.0), (-18.0, 30.0), (-40.0, 30.0)],
    "tower": [(10.0, 14.0), (24.0, 14.0), (24.0, 40.0), (10.0, 40.0)],
    "shed": [(12.0, -30.0), (40.0, -30.0), (40.0, -14.0), (12.0, -14.0)],
    "house": [(-34.0, -26.0), (-16.0, -26.0), (-16.0, -14.0), (-34.0, -14.0)],
}
_TREE, _CAFE = (30.0, 20.0), (-29.0, 20.0)
_STREETS = {"Long Street": [(-110.0, -1.0), (110.0, 3.0)], "Cross Street": [(-3.0, -110.0), (0.0, 1.0), (2.0, 110.0)]}


def _geodetic(lat: float, lon: float, east: float, north: float) -> tuple[float, float]:
    """Latitude and longitude of a point of the plane that touches the ellipsoid at an origin; no projection involved.

    By geocentric coordinates and Bowring's formula, which is true to 1e-9 degrees this near the ground.
    """
    phi, lam = math.radians(lat), math.radians(lon)
    n = _A / math.sqrt(1 - _E2 * math.sin(phi) ** 2)
    to_east = np.array([-math.sin(lam), math.cos(lam), 0.0])
    to_north = np.array([-math.sin(phi) * math.cos(lam), -math.sin(phi) * math.sin(lam), math.cos(phi)])
    origin = n * np.array([math.cos(phi) * math.cos(lam), math.cos(phi) * math.sin(lam), (1 - _E2) * math.sin(phi)])
    x, y, z = origin + east * to_east + north * to_north
    b, p = _A * (1 - _F), math.hypot(x, y)
    theta = math.atan2(z * _A, p * b)
    e2 = (_A**2 - b**2) / b**2
    found = math.atan2(z + e2 * b * math.sin(theta) ** 3, p - _E2 * _A * math.cos(theta) ** 3)
    return math.degrees(found), math.degrees(math.atan2(y, x))


def _map(path: Path, lat: float, lon: float) -> Path:
    nodes: list[str] = []
    ways: list[str] = []

    def node(xy: tuple[float, float], tags: str = "") -> int:
        at = _geodetic(lat, lon, *xy)
        nodes.append(f'<node id="{len(nodes) + 1}" lat="{at[0]:.7f}" lon="{at[1]:.7f}">{tags}</node>')
        return len(nodes)

    def way(numbers: list[int], **tags: str) -> None:
        refs = "".join(f'<nd ref="{n}"/>' for n in numbers)
        said = "".join(f'<tag k="{k.replace("__", ":")}" v="{v}"/>' for k, v in tags.items())
        ways.append(f'<way id="{len(ways) + 1}">{refs}{said}</way>')

    for name, corners in _HOUSES.items():
        numbers = [node(xy) for xy in corners]
        way([*numbers, numbers[0]], building="apartments", building__levels="3", name=name)
    middle = node((0.0, 1.0))
    west, east, south, north = (node(xy) for xy in ((-110.0, -1.0), (110.0, 3.0), (-3.0, -110.0), (2.0, 110.0)))
    way([west, middle, east], highway="residential", name="Long Street")
    way([south, middle, north], highway="residential", name="Cross Street")
    node(_CAFE, '<tag k="amenity" v="cafe"/><tag k="name" v="Last Café"/>')
    node(_TREE, '<tag k="natural" v="tree"/>')
    path.write_text(f'<osm version="0.6">{"".join(nodes)}{"".join(ways)}</osm>', encoding="utf-8")
    return path


_SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    ("lat", "lon"),
    [
        pytest.param(89.9995, 24.9, id="56 m from the pole"),
        pytest.param(-16.8, 179.99995, id="date line"),
        pytest.param(90.0, 0.0, id="pole", marks=_SLOW),
        pytest.param(-89.9998, -120.0, id="south pole", marks=_SLOW),
        pytest.param(66.0, -180.0, id="on the line", marks=_SLOW),
    ],
)
def test_a_world_is_right_where_longitude_is_not(lat: float, lon: float, tmp_path: Path) -> None:
    out = tmp_path / "world"
    build_world(
        _map(tmp_path / "end.osm", lat, lon),
        lat=lat,
        lon=lon,
        half=60.0,
        out=out,
        options=BuildOptions(keep_stages=False, previews=False),
    )
    world = read_world(out)
    built = {building.name: shapely.Polygon(building.footprint[0]) for building in world.buildings}
    assert set(built) == set(_HOUSES)
    for name, corners in _HOUSES.items():
        assert built[name].hausdorff_distance(shapely.Polygon(corners)) < _NEAR, name
    for name, line in _STREETS.items():
        roads = [shapely.LineString(np.array(road.line)[:, :2]) for road in world.roads.roads if road.name == name]
        inside = shapely.LineString(line).intersection(shapely.box(-60, -60, 60, 60))
        assert shapely.union_all(roads).hausdorff_distance(inside) < _NEAR, name
    window = shapely.box(-60, -60, 60, 60)
    middles = shapely.union_all([shapely.LineString(line) for line in _STREETS.values()]).intersection(window)
    driven = [shapely.LineString(world.lanes.line(int(k))[:, :2]) for k in np.flatnonzero(world.lanes.inside < 0)]
    assert len(driven) >= 8
    assert shapely.union_all(driven).hausdorff_distance(middles) < 8.0  # two lanes a street, and a junction without
    mapped = [str(one).startswith("n") for one in world.objects.id]  # others grow on lawns
    (tree,) = world.objects.position[(world.objects.kind == "tree") & mapped]
    assert np.abs(tree[:2] - _TREE).max() < _NEAR
    cafe = next(place for place in world.places if place.name == "Last Café")
    assert world.building_by_id[cafe.building or ""].name == "hall"
    west, south, east, north = world.manifest.bbox
    assert -180.0 <= west <= 180.0
    assert -180.0 <= east <= 180.0
    assert south < north <= 90.0
    assert check_world(world) == []
