"""While a run goes on, the garbage collector leaves alone what was there before it."""

import gc

from vico.runner.loop import freeze_heap


def test_what_is_there_is_left_alone_until_the_run_ends() -> None:
    kept = [[] for _ in range(1000)]
    with freeze_heap():
        assert gc.get_freeze_count() > len(kept)
    assert gc.get_freeze_count() == 0
