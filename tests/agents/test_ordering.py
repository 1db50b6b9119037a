"""The best order against all orders, in small models drawn by chance and in one that is worked out by hand."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from errands import LOOK, Crow, told, view_from
from vico.agents.assistant.errands import Book, Choice
from vico.agents.assistant.estimates import DOOR, FIND_CHANCE, PICK, PUT, Estimates
from vico.agents.assistant.rollouts import DONE
from vico.agents.assistant.skills import ObservationView
from vico.agents.assistant.task_planning import TaskModel, TaskPlan, TaskState, best_plan
from vico.agents.perception import RememberedSighting
from vico.seeds import rng


def model_of(
    instructions: list[dict[str, Any]],
    *,
    seen: dict[int, RememberedSighting] | None = None,
    view: ObservationView | None = None,
) -> TaskModel:
    book = Book(instructions)
    crow = cast(Estimates, Crow())
    return TaskModel(book, crow, list(book.instructions), view or view_from(0.0, 0.0), seen or {})


def drawn(seed: int, category: str, count: int) -> TaskModel:
    """A model over places in a square of 200 m."""
    chance = rng(seed, "ordering", category)

    def somewhere() -> tuple[float, float]:
        x, y = chance.uniform(-100.0, 100.0, 2)
        return (float(x), float(y))

    return model_of(
        [
            told(k, category, [somewhere() for _ in range(1 + int(category == "carry"))], somewhere(),
                 things=1 + int(chance.integers(2)) if category == "delivery" else 1)
            for k in range(count)
        ]
    )  # fmt: skip


def best_by_trying_all(model: TaskModel, left: float) -> float:
    """The worth of the best of all sequences of choices."""

    def from_here(outlook: TaskState, worth: float) -> float:
        best = worth
        for _, reached, likely in model.steps(outlook):
            if reached.time <= left:
                gained = sum(s == DONE for s in reached.stages) - sum(s == DONE for s in outlook.stages)
                best = max(best, from_here(reached, worth + gained * likely * (1.0 - 0.25 * reached.time / left)))
        return best

    return from_here(model.start, 0.0)


def followed(model: TaskModel, plan: TaskPlan, left: float) -> tuple[float, float, int]:
    """What the choices of a plan come to in the model: worth, time of the last success, subtasks done."""
    outlook, worth, last, done = model.start, 0.0, 0.0, 0
    for choice in plan.choices:
        reached, likely = next((o, p) for c, o, p in model.steps(outlook) if c == choice)
        gained = sum(s == DONE for s in reached.stages) - sum(s == DONE for s in outlook.stages)
        worth += gained * likely * (1.0 - 0.25 * reached.time / left)
        last, done = (reached.time, done + 1) if gained else (last, done)
        outlook = reached
    return worth, last, done


@pytest.mark.parametrize("left", [150.0, 400.0, 1500.0])
@pytest.mark.parametrize(("category", "count"), [("delivery", 3), ("search", 5), ("carry", 3)])
def test_no_order_is_better_than_the_best(category: str, count: int, left: float) -> None:
    for seed in range(8):
        model = drawn(seed, category, count)
        plan = best_plan(model, left)
        assert plan.worth == pytest.approx(best_by_trying_all(model, left), abs=1e-9), seed
        worth, last, done = followed(model, plan, left)
        assert (plan.worth, plan.time, plan.done) == (pytest.approx(worth), pytest.approx(last), done)
        assert last <= left


@pytest.mark.parametrize("category", ["delivery", "search", "carry"])
def test_the_best_order_is_never_worse_than_the_one_given(category: str) -> None:
    for seed in range(6):
        model = drawn(seed, category, 6)
        outlook, worth, left = model.start, 0.0, 1500.0
        for k in model.subtasks:
            for kind in ("look", "deliver") if category == "delivery" else ("look",):
                step = next(
                    ((o, p) for c, o, p in model.steps(outlook) if (c.kind, c.subtask) == (kind, k)), None
                )  # fmt: skip
                if step is None or step[0].time > left:
                    continue
                gained = sum(s == DONE for s in step[0].stages) - sum(s == DONE for s in outlook.stages)
                outlook, worth = step[0], worth + gained * step[1] * (1.0 - 0.25 * step[0].time / left)
        assert best_plan(model, left).worth >= worth - 1e-9


def test_two_things_are_fetched_on_one_way() -> None:
    # Both lie 40 m east, 2 m apart, and both go back to where one is; one way there and back does, with two hands.
    model = model_of(
        [
            told(0, "delivery", [(40.0, 0.0)], (0.0, 0.0)),
            told(1, "delivery", [(42.0, 0.0)], (0.0, 0.0)),
        ]
    )
    plan = best_plan(model, 1500.0)
    assert [choice.kind for choice in plan.choices] == ["look", "look", "deliver", "deliver"]
    # 20 s there, a look, a pick, 1 s on, a look, a pick, 21 s back, two times put down.
    assert plan.time == pytest.approx(20 + LOOK + PICK + 1 + LOOK + PICK + 21 + PUT + PUT)
    assert plan.done == 2
    assert model.start.hands == 2


def test_a_pair_of_things_takes_both_hands() -> None:
    model = model_of(
        [
            told(0, "delivery", [(40.0, 0.0)], (0.0, 0.0), things=2),
            told(1, "delivery", [(42.0, 0.0)], (0.0, 0.0)),
        ]
    )
    kinds = [(choice.kind, choice.subtask) for choice in best_plan(model, 1500.0).choices]
    assert kinds.index(("deliver", kinds[0][1])) == 1


def test_what_was_seen_is_fetched_without_a_look() -> None:
    lies = RememberedSighting(7, "object", "thing 0.0", np.array([10.0, 0.0, 0.0]), "", 0.0, 50)
    model = model_of([told(0, "search", [(40.0, 0.0)], (0.0, 0.0))], seen={0: lies})
    assert best_plan(model, 1500.0).choices == (Choice("fetch", 0),)
    assert best_plan(model, 1500.0).time == pytest.approx(5.0 + PUT)


def test_what_takes_too_long_is_not_planned() -> None:
    model = model_of([told(0, "search", [(40.0, 0.0)], (0.0, 0.0))])
    assert best_plan(model, 20.0 + LOOK + PUT).done == 1
    assert best_plan(model, 19.9 + LOOK + PUT) == TaskPlan()


def test_who_is_indoors_has_a_door_to_pass() -> None:
    asked = [told(0, "search", [(40.0, 0.0)], (0.0, 0.0))]
    inside, outside = (
        best_plan(model_of(asked, view=view_from(0.0, 0.0, room=room)), 1500.0) for room in ("r_cafe", "")
    )
    assert inside.time - outside.time == pytest.approx(DOOR)
    assert 0.0 < FIND_CHANCE < 1.0
    assert outside.worth == pytest.approx(FIND_CHANCE * (1.0 - 0.25 * outside.time / 1500.0))
