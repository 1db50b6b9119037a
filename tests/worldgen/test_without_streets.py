"""A campus of footways, without one street: a world all the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from command_line import vico
from shared_folders import Shared
from vico.community import build_community, write_community
from vico.world.check import check_world
from vico.world.folder import read_world
from vico.world.model import Category
from vico.world.world import World
from vico.worldgen.pipeline import build_world
from vico.worldgen.request import BuildOptions

_DEGREE = 111_200.0  # metres of a degree at the equator, where the campus lies


class _Map:
    """Writes a small OSM file, metres in."""

    def __init__(self) -> None:
        self._nodes: list[str] = []
        self._ways: list[str] = []

    def node(self, x: float, y: float, **tags: str) -> int:
        number = len(self._nodes) + 1
        self._nodes.append(f'<node id="{number}" lat="{y / _DEGREE:.8f}" lon="{x / _DEGREE:.8f}">{_tags(tags)}</node>')
        return number

    def way(self, points: list[tuple[float, float]], *, closed: bool = False, **tags: str) -> None:
        numbers = [self.node(x, y) for x, y in points]
        refs = "".join(f'<nd ref="{n}"/>' for n in (*numbers, *numbers[: int(closed)]))
        self._ways.append(f'<way id="{len(self._ways) + 1}">{refs}{_tags(tags)}</way>')

    def write(self, path: Path) -> Path:
        path.write_text(f'<osm version="0.6">{"".join(self._nodes)}{"".join(self._ways)}</osm>')
        return path


def _tags(tags: dict[str, str]) -> str:
    return "".join(f'<tag k="{key.replace("__", ":")}" v="{value}"/>' for key, value in tags.items())


def _campus(path: Path) -> Path:
    made = _Map()
    for k, (i, j) in enumerate((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)):
        x, y = 28.0 * i, 28.0 * j
        use = "apartments" if k % 2 else "university"
        corners = [(x - 9, y - 8), (x + 9, y - 8), (x + 9, y + 8), (x - 9, y + 8)]
        made.way(corners, closed=True, building=use, building__levels="3")
        made.node(x, y - 4, **({"shop": "books"} if k % 2 else {"amenity": "cafe"}), name=f"Number {k}")
    for a in (-42.0, -14.0, 14.0, 42.0):
        made.way([(a, -49.0), (a, 49.0)], highway="footway")
        made.way([(-49.0, a), (49.0, a)], highway="footway")
    return made.write(path / "campus.osm")


@pytest.fixture(scope="module")
def campus(shared: Shared) -> tuple[Path, World]:
    def make(out: Path) -> None:
        out.mkdir()
        place = {"lat": 0.0, "lon": 0.0, "half": 50.0}
        build_world(_campus(out), **place, seed=0, out=out / "world", options=BuildOptions(previews=False))

    out = shared("campus", make, ["worldgen"]) / "world"
    return out, read_world(out)


def test_it_has_everything_but_streets(campus: tuple[Path, World]) -> None:
    world = campus[1]
    assert len(world.lanes) == 0
    assert world.transit.lines == []
    assert "no streets for traffic" in world.transit.left_out[-1].reason
    assert len(world.buildings) == 8
    assert {Category.FOOD, Category.STORE, Category.ACCOMMODATION} <= {place.category for place in world.places}
    assert all(bool(world.walkable.is_connected(door.approach)) for door in world.entrances)
    assert list(check_world(world)) == []


def test_people_live_there_and_cars_are_refused_in_one_sentence(
    campus: tuple[Path, World], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, world = campus
    write_community(build_community(world, residents=2), tmp_path / "people", world=folder)
    common = ("run", folder, tmp_path / "people", "--steps", 2, "--observe", "none", "--pedestrians", 0)
    assert vico(*common, "--cars", 5, "--out", tmp_path / "cars") == 2
    assert (
        "the world has no street for cars; take a larger world, or ask for 0 cars: --cars 0" in capsys.readouterr().err
    )
    assert vico(*common, "--cars", 0, "--out", tmp_path / "none") == 0
    capsys.readouterr()
    # Nobody asked for cars: there are as many as there is room for.
    assert vico(*common, "--out", tmp_path / "unsaid") == 0
    assert "there is room for 0 cars" in capsys.readouterr().err
