"""A task as rollouts take it: ways, spots and chances from what a planner was told and saw."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from errands import LOOK, Crow, told, view_from
from vico.agents.assistant.errands import Book, Choice
from vico.agents.assistant.estimates import FIND_CHANCE, Estimates, read_habits
from vico.agents.assistant.rollouts import IN_HAND, OPEN, Beliefs, SituationBuilder, best_first_choice
from vico.agents.perception import RememberedSighting
from vico.seeds import rng
from vico.world.public import PublicMap

MAP = cast(PublicMap, SimpleNamespace(place_by_id={}))


def situations_of(*instructions: dict[str, object]) -> SituationBuilder:
    book = Book(list(instructions))
    return SituationBuilder(book, cast(Estimates, Crow()), Beliefs(book, MAP, read_habits()))


def test_people_are_looked_for_at_each_place_and_walked_home() -> None:
    made = situations_of(told(0, "carry", [(10.0, 0.0), (0.0, 30.0)], (10.0, 40.0)))
    situation, choices = made.now([0], view_from(0.0, 0.0), {}, 900.0)
    assert choices == [Choice("look", 0, 0), Choice("look", 0, 1), Choice("deliver", 0)]
    assert situation.spot_seconds.tolist() == [LOOK, LOOK]
    assert situation.spot_finds.tolist() == [FIND_CHANCE, FIND_CHANCE]
    assert 0.9 < situation.spot_chance.sum() <= 1.0
    assert situation.travel[0, situation.spot_point].tolist() == [5.0, 15.0]
    # The way home is walked at their pace: 40 m from the first place, sqrt(200) m from the second.
    first, second = situation.service[situation.spot_point, 0]
    assert first - second == pytest.approx((40.0 - np.hypot(10.0, 10.0)) / 1.4)
    assert not situation.brought.any()


def test_what_was_seen_is_likelier_than_where_it_was_not() -> None:
    made = situations_of(told(0, "carry", [(10.0, 0.0), (0.0, 30.0)], (10.0, 40.0)))
    now = float(view_from(0.0, 0.0).state["time"])
    seen = {0: RememberedSighting(7, "resident", "P0 Q", np.array([5.0, 5.0, 0.0]), "", now, 400)}
    situation, choices = made.now([0], view_from(0.0, 0.0), seen, 900.0)
    assert choices[0] == Choice("fetch", 0)
    assert situation.spot_chance[0] > 0.9
    assert situation.spot_chance.sum() <= 1.0
    assert choices[best_first_choice(situation, rng(0, "situations"), worlds=50)] == Choice("fetch", 0)


def test_what_is_in_hand_has_no_spots_and_closed_subtasks_are_left_out() -> None:
    made = situations_of(
        told(0, "delivery", [(10.0, 0.0)], (50.0, 0.0)), told(1, "delivery", [(20.0, 0.0)], (60.0, 0.0)),
        told(2, "delivery", [(20.0, 9.0)], (60.0, 9.0)),
    )  # fmt: skip
    made.book.picked["thing 0.0"] = 5
    made.book.closed.add(2)
    situation, choices = made.now([0, 1, 2], view_from(0.0, 0.0, (5, 0)), {}, 900.0)
    assert choices == [Choice("look", 1, 0), Choice("deliver", 0), Choice("deliver", 1)]
    assert situation.stage.tolist() == [IN_HAND, OPEN]
    assert (situation.hands, situation.load.tolist()) == (1, [1, 1])
    assert situation.brought.all()


def test_who_shares_reckons_from_what_was_told_alone() -> None:
    one = situations_of(told(0, "carry", [(10.0, 0.0), (0.0, 30.0)], (10.0, 40.0)))
    other = situations_of(told(0, "carry", [(10.0, 0.0), (0.0, 30.0)], (10.0, 40.0)))
    for a, b in zip(
        one.from_point([0], (3.0, 3.0), view_from(0.0, 0.0), 900.0)[0],
        other.from_point([0], (3.0, 3.0), view_from(50.0, 9.0), 900.0)[0],
        strict=True,
    ):
        assert np.array_equal(a, b)


def test_a_spot_that_is_told_twice_is_one_point() -> None:
    made = situations_of(told(0, "search", [(10.0, 0.0)], (0.0, 0.0)), told(1, "search", [(10.0, 0.0)], (0.0, 0.0)))
    situation, _ = made.now([0, 1], view_from(0.0, 0.0), {}, 900.0)
    assert len(situation.travel) == 2
    assert situation.end.tolist() == [-1, -1]
