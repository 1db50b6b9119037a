"""Rings as mappers draw them: gaps, roles, members that are missing or listed twice."""

from pathlib import Path

import numpy as np
import pytest

from vico.geo.frame import LocalFrame
from vico.geo.osm import read_osm
from vico.geo.outlines import MemberWay, area_of_members, role_meant

FRAME = LocalFrame(52.1, 11.6)
CORNERS = np.array([(0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0), (0.0, 0.0)])
HOLE = CORNERS * 0.2 + 5.0  # 4 m x 4 m


def way(number: int, role: str, line: object, *, cut: bool = False) -> MemberWay:
    return MemberWay(number, role, np.array(line, float), cut)


def halves(gap: float = 0.0) -> list[MemberWay]:
    """The square in two ways, `gap` metres apart at the corner where it begins."""
    return [way(1, "outer", CORNERS[:3]), way(2, "outer", [*CORNERS[2:4], (0.0, gap)])]


def read(members: list[MemberWay], missing: int = 0) -> tuple[float, list[str]]:
    """Square metres, 0 where there is no area, and what is told."""
    shape, told = area_of_members(members, missing, FRAME)
    return (0.0 if shape is None else round(shape.area, 1)), told


def test_whole_rings_are_an_area_and_nothing_is_told() -> None:
    assert read([*halves(), way(3, "inner", HOLE)]) == (384.0, [])


def test_a_gap_of_a_metre_is_closed_and_told_with_its_place() -> None:
    assert read(halves(1.0)) == (400.0, ["a gap of 1.0 m at 52.100004, 11.600000 in its outer ring is closed"])


def test_a_wider_gap_is_named_with_its_width_and_place() -> None:
    assert read(halves(8.0)) == (
        0.0,
        ["its outer ring is not closed in the map: a gap of 8.0 m at 52.100036, 11.600000; left out"],
    )


def test_a_wider_gap_beside_a_whole_ring_leaves_that() -> None:
    area, (told,) = read([*halves(8.0), way(3, "outer", CORNERS + 100.0)])
    assert area == 400.0
    assert told.startswith("a part of its outer ring stays open: a gap of 8.0 m at 52.1")


def test_a_hole_that_is_not_closed_is_filled_and_told() -> None:
    area, (told,) = read([*halves(), way(3, "inner", HOLE[:4] - np.array([0.0, 2.0]))])
    assert area == 400.0
    assert told.startswith("a hole stays open: a gap of 4.0 m at ")


def test_two_narrow_gaps_are_both_closed() -> None:
    area, told = read([way(1, "outer", CORNERS[:3]), way(2, "outer", [(20.0, 20.7), (0.0, 20.0), (0.0, 0.5)])])
    assert area == pytest.approx(407.0)
    assert [sentence[:15] for sentence in told] == ["a gap of 0.5 m ", "a gap of 0.7 m "]


def test_an_island_in_a_hole_is_there() -> None:
    island = way(4, "outer", CORNERS * 0.1 + 6.0)
    assert read([*halves(), way(3, "inner", HOLE), island]) == (388.0, [])


def test_missing_members_are_told_as_such() -> None:
    assert read(halves()[:1], missing=1) == (
        0.0,
        ["1 of its 2 member ways are not in the file, so that no ring closes; left out"],
    )
    assert read([], missing=3) == (0.0, ["all of its member ways (3) are not in the file; left out"])
    assert read(halves(), missing=1) == (400.0, ["1 of its member ways are not in the file; kept what closes"])


def test_missing_nodes_are_told_as_such() -> None:
    cut = [way(1, "outer", CORNERS[:3]), way(2, "outer", CORNERS[2:4], cut=True)]
    assert read(cut)[1] == ["nodes of its member ways are not in the file, so that no ring closes; left out"]


def test_a_member_that_is_listed_twice_counts_once() -> None:
    one, two = halves()
    assert read([one, two, one]) == (400.0, ["lists w1 twice; taken once"])


@pytest.mark.parametrize(
    ("role", "meant"),
    [("outer", "outer"), ("Outer", "outer"), ("outer ", "outer"), ("ouer", "outer"), ("outter", "outer"),
     ("innner", "inner"), ("INNER", "inner"), ("inner_ring", "inner"), ("iner", "inner"), ("enclave", "inner"),
     ("", None), ("part", None), ("label", None), ("5", None)],
)  # fmt: skip
def test_what_roles_mean(role: str, meant: str | None) -> None:
    assert role_meant(role) == meant


def test_a_misspelt_role_is_read_and_told() -> None:
    assert read([*halves(), way(3, "innner", HOLE)]) == (384.0, ["role 'innner' of w3 is read as inner"])


@pytest.mark.parametrize("role", ["", "part"])
def test_rings_without_a_role_are_holes_where_they_lie_within_others(role: str) -> None:
    area, (told,) = read([*halves(), way(3, role, HOLE), way(4, role, CORNERS + 100.0)])
    assert area == 784.0
    assert told.endswith("rings within others are holes (1 of 2)")


def test_an_island_in_a_hole_without_roles_is_filled() -> None:
    nested = [way(1, "", CORNERS), way(2, "", CORNERS * 0.8 + 2.0), way(3, "", CORNERS * 0.4 + 6.0)]
    assert read(nested)[0] == 400.0 - 256.0 + 64.0


def test_a_way_without_a_role_closes_an_outer_ring() -> None:
    one, two = halves()
    assert read([one, way(2, "", two.line)]) == (400.0, [])


def test_a_hole_that_covers_all_is_named() -> None:
    assert read([way(1, "outer", HOLE), way(2, "inner", CORNERS)]) == (
        0.0,
        ["its holes cover all of it; left out (are the roles outer and inner exchanged?)"],
    )


def test_holes_alone_are_named() -> None:
    assert read([way(1, "inner", HOLE)]) == (0.0, ["none of its members is outer; left out"])


@pytest.mark.parametrize(
    ("refs", "area", "told"),
    [
        ("1 2 3 4", 0, "its outline is not closed in the map: a gap of 22.1 m at 0.000100, 0.000000; no building"),
        ("1 2 3 4 5", 492, "its outline is not closed in the map; a gap of 1.1 m is closed"),
        ("1 2", 0, "area without extent"),
    ],
)
def test_a_building_s_open_outline_is_closed_or_told(tmp_path: Path, refs: str, area: int, told: str) -> None:
    places = [(0, 0), (0, 2e-4), (2e-4, 2e-4), (2e-4, 0), (1e-5, 0)]
    nodes = "".join(f'<node id="{k}" version="1" lat="{y}" lon="{x}"/>' for k, (y, x) in enumerate(places, 1))
    ways = f'<way id="7" version="1">{"".join(f"<nd ref={chr(34)}{r}{chr(34)}/>" for r in refs.split())}'
    path = tmp_path / "a.osm"
    path.write_text(f'<osm version="0.6">{nodes}{ways}<tag k="building" v="yes"/></way></osm>')
    data = read_osm(path, LocalFrame(0.0, 0.0), 100.0, need_buildings=False)
    assert data.broken == [("w7", told)]
    assert [round(one.polygon.area) for one in data.areas] == [area] * (area > 0)
