"""A table of what was used last: it drops what was not, and threads share it."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

from vico.io.memory import LruCache


def test_what_was_not_used_longest_is_dropped() -> None:
    table: LruCache[str, int] = LruCache(2)
    table.keep("a", 1)
    table.keep("b", 2)
    assert table.get("a") == 1
    table.keep("c", 3)
    assert [table.get(key) for key in "abc"] == [1, None, 3]
    table.keep("c", 4)
    assert [table.get(key) for key in "ac"] == [1, 4]


def test_threads_share_it() -> None:
    table: LruCache[int, int] = LruCache(8)

    def use(seed: int) -> None:
        for k in range(4_000):
            key = (k * 7 + seed) % 40
            found = table.get(key)
            assert found is None or found == key
            table.keep(key, key)

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(use, range(8)))
    assert sum(table.get(key) is not None for key in range(40)) == 8
