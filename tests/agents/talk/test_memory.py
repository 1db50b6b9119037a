"""Memories are bounded, and come back from their state."""

from __future__ import annotations

from vico.agents.talk.memory import MOST_MESSAGES, MOST_PEOPLE, MOST_VISITS, ResidentMemory
from vico.io.plain_data import decode, encode


def full() -> ResidentMemory:
    memory = ResidentMemory(["a", "b"])
    for k in range(200):
        memory.see(f"resident_{k}", float(k), 1.0 * k, 2.0, "a" if k % 2 else "")
        memory.listen({"events": [{"time": float(k), "speaker": "x", "text": "long " * 200}]})
        memory.arrive(float(k), k, "b")
    return memory


def test_what_is_oldest_is_forgotten() -> None:
    memory = full()
    assert (len(list(memory.people)), len(memory.messages), len(memory.visits)) == (
        MOST_PEOPLE,
        MOST_MESSAGES,
        MOST_VISITS,
    )
    assert memory.last_seen("resident_0") is None
    last = memory.last_seen("resident_199")
    assert last is not None
    assert (last.time, last.x, last.place) == (199.0, 199.0, "a")
    assert max(len(one.text) for one in memory.messages) == 300


def test_who_is_seen_again_is_kept() -> None:
    memory = ResidentMemory()
    for k in range(MOST_PEOPLE):
        memory.see(f"resident_{k}", float(k), 0.0, 0.0, "")
    memory.see("resident_0", 100.0, 0.0, 0.0, "")
    memory.see("new", 101.0, 0.0, 0.0, "")
    assert memory.last_seen("resident_0") is not None
    assert memory.last_seen("resident_1") is None


def test_a_visit_that_is_interrupted_goes_on() -> None:
    memory = ResidentMemory()
    memory.arrive(10.0, 0, "a")
    memory.leave(20.0)
    memory.leave(25.0)
    assert memory.visits[0].until == 20.0
    memory.arrive(30.0, 0, "a")
    memory.arrive(40.0, 1, "a")
    assert [(one.stay, one.since, one.until) for one in memory.visits] == [(0, 10.0, 40.0), (1, 40.0, None)]


def test_restored_memories_are_the_same() -> None:
    memory, fresh = full(), ResidentMemory(["a", "b"])
    fresh.restore(decode(encode(memory.state())))
    assert encode(fresh.state()) == encode(memory.state())
    assert fresh.last_seen("resident_150") == memory.last_seen("resident_150")
