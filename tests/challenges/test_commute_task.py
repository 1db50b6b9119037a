"""Commute tasks: generated the same each time, strict about their files, and judged by their own rules."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from commute_day import toy_task
from vico.challenges.commute import tasks
from vico.challenges.commute.generate import generate_commute
from vico.challenges.commute.tasks import read_task, write_task
from vico.clock import clock_of
from vico.errors import EmptyInputError, InputError, SchemaError
from vico.world.world import World


def test_the_same_world_and_seed_give_the_same_bytes(helsinki_city: World, tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_task(tmp_path / name, generate_commute(helsinki_city, seed=3))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert read_task(tmp_path / "a", world=helsinki_city) == generate_commute(helsinki_city, seed=3)
    assert generate_commute(helsinki_city, seed=2) != generate_commute(helsinki_city, seed=3)


def test_days_keep_the_rules(helsinki_city: World) -> None:
    places = {place.id: place for place in helsinki_city.places}
    for seed in range(6):
        task = generate_commute(helsinki_city, seed=seed, hours=3.0)
        day = task.appointments
        assert tasks.LEAST_PLACES <= len({a.place for a in day}) <= tasks.MOST_PLACES
        assert day[0].place == task.appointments[0].candidates[0]
        for before, after in pairwise(day):
            away = math.dist(before.position, after.position)
            share = (after.start - before.end) / away - 1.0
            # Rounded to whole seconds: half a second either way.
            assert tasks.SLACK[0] - 0.5 / away <= share <= tasks.SLACK[1] + 0.5 / away
            assert len(after.candidates) <= tasks.CANDIDATES
        assert all(places[a.place].position[:2] == a.position for a in day)
        least = sum(b.start - a.end for a, b in pairwise(day))
        least += tasks.LEAST_STAY * (len(day) - 2) + tasks.LAST_STAY
        # Each stay is rounded to a second.
        assert task.seconds == pytest.approx(max(3.0 * 3600, least), abs=len(day))


def test_a_world_too_small_is_refused_in_a_sentence(corner: World) -> None:
    with pytest.raises(EmptyInputError, match="use a larger world"):
        generate_commute(corner, seed=0)


def test_hours_out_of_range_are_refused(corner: World) -> None:
    with pytest.raises(InputError, match="give 1 to 14"):
        generate_commute(corner, seed=0, hours=0.5)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t["appointments"][1].update(start=32_400), r"appointments.1.start: 09:00:00 is not after 09:00:00"),
        (lambda t: t["appointments"][1].update(end=32_900), "appointments.1: end: 20 s after the start"),
        (lambda t: t["appointments"][1].update(position=[1.0, 0.0]), "appointments.1.position: 1 m from the one"),
        (lambda t: t["appointments"][1].update(position=["here", 0.0]), "appointments.1.position.0"),
        (lambda t: t["resident"].update(cash=-1), "resident.cash"),
        (lambda t: t["resident"].update(wings=2), "resident.wings"),
        (lambda t: t.update(appointments=t["appointments"][:1]), "appointments"),
        (lambda t: t.update(version=2), "not a commute task of version 1"),
    ],
)
def test_nonsense_by_hand_is_refused_with_file_and_field(tmp_path: Path, change: Any, said: str) -> None:
    path = tmp_path / "task.json"
    content = toy_task().model_dump(mode="json")
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(SchemaError, match=said) as refused:
        read_task(path)
    assert str(path) in str(refused.value)


def test_a_task_of_another_world_or_a_vanished_place_is_refused(tmp_path: Path, helsinki_city: World) -> None:
    path = tmp_path / "task.json"
    task = generate_commute(helsinki_city, seed=0)
    write_task(path, toy_task())
    with pytest.raises(SchemaError, match="world_digest: made for another world"):
        read_task(path, world=helsinki_city)
    content = task.model_dump(mode="json")
    content["appointments"][1].update(place="gone", candidates=["gone"])
    path.write_text(json.dumps(content))
    with pytest.raises(SchemaError, match=r"appointments.1.place: the world has no place 'gone'"):
        read_task(path, world=helsinki_city)


def test_agents_are_told_the_day_without_candidates() -> None:
    (told,) = toy_task().instructions()
    assert [clock_of(a["start"]) for a in told["appointments"]][1:] == ["09:08:00", "09:26:40"]
    assert all("candidates" not in a for a in told["appointments"])
