"""Planners that reckon with orders: the same decisions each time, and two assistants who share the work."""

from __future__ import annotations

from typing import Any

import pytest

import toy_city
from vico.agents.assistant import METHODS, make_planner
from vico.agents.assistant.errands import Book, Choice, ChoicePlanner
from vico.agents.assistant.ours import OurPlanner
from vico.agents.assistant.skills import ObservationView
from vico.errors import InputError
from vico.seeds import rng
from vico.world.public import PublicMap


@pytest.fixture(scope="module")
def city() -> PublicMap:
    return PublicMap.from_world(toy_city.world())


def errands(seed: int, count: int = 6) -> list[dict[str, Any]]:
    """Deliveries from spot to spot on the square before the house."""
    chance = rng(seed, "errands")

    def spot() -> dict[str, Any]:
        x, y = (float(v) for v in chance.uniform([-35.0, -35.0], [35.0, -2.0]))
        return {"kind": "outdoor", "name": "", "place": None, "centre": (x, y, 0.0), "radius": 8.0, "surface": None}

    person = {"agent": "resident_0", "name": "Ada Berg", "looks": ""}
    return [
        {"index": k, "category": "delivery", "text": "", "person": person, "objects": [f"thing {k}"],
         "sources": [spot()], "destination": spot()}
        for k in range(count)
    ]  # fmt: skip


def view(x: float, y: float, *, time: float = 8 * 3600.0, held: tuple[int, int] = (0, 0)) -> ObservationView:
    state = {"room": "", "held": list(held), "time": time}
    return ObservationView({"pose": [x, y, 0.0, 1.0, 0.0, 0.0], "state": state}, {})


def planner(city: PublicMap, method: str, told: list[dict[str, Any]], **more: Any) -> ChoicePlanner:
    made = make_planner(method, told, city, seed=3, **more)
    assert isinstance(made, ChoicePlanner)
    made.began = 8 * 3600.0
    return made


@pytest.mark.parametrize("method", ["mcts", "ours"])
def test_the_same_is_decided_each_time(city: PublicMap, method: str) -> None:
    for seed in range(3):
        told = errands(seed)
        views = [view(0.0, -10.0), view(20.0, -20.0, time=8 * 3600 + 300.0)]
        first, again = ([planner(city, method, told).decide(one) for one in views] for _ in range(2))
        assert first == again
        assert all(choice is not None and choice.kind == "look" for choice in first)


def test_what_is_in_hand_and_nothing_else_is_delivered(city: PublicMap) -> None:
    for method in ("mcts", "ours"):
        one = planner(city, method, errands(0, count=2))
        one.book.picked = {"thing 0": 71, "thing 1": 72}
        choice = one.decide(view(0.0, -10.0, held=(71, 72)))
        assert choice is not None
        assert choice.kind == "deliver"


def test_every_second_subtask_is_each_ones_with_mcts(city: PublicMap) -> None:
    told = errands(1)
    assert [planner(city, "mcts", told, number=i, of=2).mine for i in range(2)] == [[0, 2, 4], [1, 3, 5]]


def test_two_who_start_at_the_same_spot_share_all_of_it(city: PublicMap) -> None:
    for seed in range(3):
        shares = []
        for number in range(2):
            one = planner(city, "ours", errands(seed), number=number, of=2)
            assert isinstance(one, OurPlanner)
            one.decide(view(0.0, -10.0))
            shares.append(set(one.state()["share"]))
        assert shares[0] | shares[1] == set(range(6))
        assert not shares[0] & shares[1]


def test_the_book_offers_what_makes_sense(city: PublicMap) -> None:
    told = errands(0, count=2)
    book = Book(told)
    here = view(0.0, -10.0)
    assert book.choices(here, {}) == [Choice("look", 0, 0), Choice("look", 1, 0)]
    book.picked["thing 0"] = 71
    assert book.choices(view(0.0, -10.0, held=(71, 0)), {}) == [Choice("deliver", 0), Choice("look", 1, 0)]
    book.looked[1] = {0: 3}  # looked for often enough
    assert book.choices(view(0.0, -10.0, held=(71, 0)), {}) == [Choice("deliver", 0)]
    book.closed.add(0)
    assert book.choices(view(0.0, -10.0, held=(71, 0)), {}) == []
    again = Book(told)
    again.restore(book.state())
    assert again.state() == book.state()


def test_a_method_that_is_none_is_refused(city: PublicMap) -> None:
    with pytest.raises(InputError, match=f"no method called 'best'; there are {', '.join(sorted(METHODS))}"):
        make_planner("best", errands(0), city, seed=0)
