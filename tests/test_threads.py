import threading
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vico.errors import InputError
from vico.threads import WORKERS, for_each, in_order, meanwhile, workers


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 6), st.lists(st.integers(0, 50), max_size=40))
def test_results_come_in_the_order_of_the_items(many: int, items: list[int]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(WORKERS, str(many))
        assert list(in_order(lambda k: k * k, items)) == [k * k for k in items]


def test_items_are_taken_as_they_are_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(WORKERS, "2")
    taken = 0

    def items() -> Iterator[int]:
        nonlocal taken
        for k in range(1000):
            taken += 1
            yield k

    results = in_order(lambda k: -k, items())
    assert [next(results) for _ in range(3)] == [0, -1, -2]
    assert taken <= 6
    results.close()  # type: ignore[attr-defined]
    assert taken <= 6


def test_tasks_run_side_by_side_and_their_errors_come_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(WORKERS, "2")
    both = threading.Barrier(2, timeout=20)
    for_each(lambda _: both.wait(), range(2))  # neither goes on before the other has begun

    def fail(k: int) -> int:
        if k == 3:
            raise InputError("the third")
        return k

    with pytest.raises(InputError, match="the third"):
        for_each(fail, range(100))


def test_the_number_of_threads_is_the_environments_or_the_machines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(WORKERS, raising=False)
    assert workers() >= 1
    monkeypatch.setenv(WORKERS, " 3 ")
    assert workers() == 3
    for wrong in ("0", "-1", "two", "1e3", "999", "²"):
        monkeypatch.setenv(WORKERS, wrong)
        with pytest.raises(InputError, match=WORKERS):
            workers()


@pytest.mark.parametrize("number", [1, 3])
def test_a_task_meanwhile_is_waited_for_and_fails_where_it_is_waited_for(
    number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(WORKERS, str(number))
    ran: list[str] = []

    def fails() -> None:
        raise KeyError("late")

    def counts() -> int:
        ran.append(threading.current_thread().name)
        return len(ran)

    result = meanwhile(counts)
    assert result() == 1
    assert (ran == [threading.current_thread().name]) == (number == 1)
    wait = meanwhile(fails)
    with pytest.raises(KeyError, match="late"):
        wait()
