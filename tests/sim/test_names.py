"""Agents, things and vehicles are found by what people call them."""

from __future__ import annotations

import pytest

from vico.errors import InputError
from vico.sim.config import find_by_name

NAMES = {
    "resident_0": "Ann Lee",
    "resident_1": "Anna Järvinen",
    "resident_2": "Abel de la Cruz",
    "resident_3": "Matti Järvinen",
    "assistant_0": "assistant 0",
    "robot_0": "husky 0",
    "robot_1": "go2 1",
    "car 3": "car 3",
}


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("resident_3", "resident_3"),
        ("Resident 3", "resident_3"),
        ("Ann Lee", "resident_0"),
        ("ann  lee", "resident_0"),
        ("Ann", "resident_0"),
        ("anna", "resident_1"),
        ("Matti Jarvinen", "resident_3"),
        ("Järvinen Matti", "resident_3"),
        ("Cruz", "resident_2"),
        ("husky", "robot_0"),
        ("go2", "robot_1"),
        ("car 3", "car 3"),
        ("Car_3", "car 3"),
    ],
)
def test_a_name_is_known_as_people_write_it(text: str, key: str) -> None:
    assert find_by_name(text, NAMES, option="film: --follow") == key


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("Ann Leigh", r"^film: --follow: nobody is called 'Ann Leigh'; did you mean Ann Lee \(resident_0\)\?$"),
        ("Abel Cruise", r"did you mean Abel de la Cruz \(resident_2\)\?"),
        ("resident_33", r"did you mean Matti Järvinen \(resident_3\)\?"),
        ("huskey", r"did you mean husky 0 \(robot_0\)\?"),
        ("car 33", r"did you mean car 3\?"),
        (
            "Järvinen",
            r"2 are called 'Järvinen': Anna Järvinen \(resident_1\), Matti Järvinen \(resident_3\); say which",
        ),
        ("Bob", r"nobody is called 'Bob'; there are Ann Lee \(resident_0\), Anna"),
        (" ", r"nobody is called ' '; there are"),
    ],
)
def test_another_name_is_refused_with_the_one_that_was_meant(text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        find_by_name(text, NAMES, option="film: --follow")
