"""The state as a whole: hashed, saved, restored, repeated."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import toy_city
from vico.agents.schedule import followers_of
from vico.errors import InputError, MissingFileError, SchemaError
from vico.runner.gather import Gatherer
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.physics.records import PhysicsError
from vico.sim.state.snapshot import state_hash
from vico.world.public import PublicMap

MORNING = SimConfig(start=8 * 3600 - 20, assistants=1, observe=())


def fresh(config: SimConfig = MORNING) -> Simulation:
    """The toy city before 08:00."""
    return Simulation(toy_city.world(), toy_city.community(), config)


def followed(sim: Simulation, steps: int) -> list[dict[str, Any]]:
    """Let residents follow their schedules; return the actions they took."""
    agents = Gatherer(followers_of(toy_city.community(), PublicMap.from_world(sim.world)))
    observations, infos = sim.observe()
    taken = []
    for _ in range(steps):
        gathered = agents.gather(observations, infos)
        result = sim.step(gathered.actions)
        observations, infos = result.observations, result.infos
        taken.append(gathered.actions)
    return taken


def hashes(sim: Simulation, actions: list[dict[str, Any]]) -> list[str]:
    """Take actions; return the state's hash after each step."""
    return [sim.step(action).hash for action in actions]


def test_equal_actions_give_equal_hashes_at_every_step() -> None:
    actions = followed(fresh(), 60)
    assert hashes(fresh(), actions) == hashes(fresh(), actions)


def test_another_seed_gives_another_hash() -> None:
    other = SimConfig(seed=1, start=MORNING.start, assistants=1, observe=())
    assert fresh().state_hash() != fresh(other).state_hash()


def test_a_step_tells_its_hash_until_the_next_one() -> None:
    sim = fresh()
    first = sim.step({})
    assert first.hash == sim.state_hash()
    second = sim.step({})
    assert first.hash != sim.state_hash()
    sim.advance(1.0)
    with pytest.raises(InputError, match="gone on since step 2"):
        assert second.hash


def test_every_letter_of_every_text_counts_in_the_hash() -> None:
    texts = [["", "", ""], ["a", "", ""], ["", "a", ""], ["", "ab", ""], ["", "\0b", ""], ["a", "a", ""]]
    assert len({state_hash({"texts": np.array(some, "<U8")}) for some in texts}) == len(texts)


def test_saved_loaded_and_continued_equals_uninterrupted(tmp_path: Path) -> None:
    actions = followed(fresh(), 60)
    through, first = fresh(), fresh()
    expected = hashes(through, actions)
    hashes(first, actions[:25])
    first.save(tmp_path / "half.npz")
    second = fresh()
    second.load(tmp_path / "half.npz")
    assert hashes(second, actions[25:]) == expected[25:]


def test_restoring_a_snapshot_forgets_what_came_after() -> None:
    sim = fresh()
    actions = followed(fresh(), 40)
    hashes(sim, actions[:20])
    kept, digest = sim.snapshot(), sim.state_hash()
    onwards = hashes(sim, actions[20:])
    sim.restore(kept)
    assert sim.state_hash() == digest
    assert hashes(sim, actions[20:]) == onwards


def test_a_snapshot_of_another_configuration_is_refused(tmp_path: Path) -> None:
    fresh().save(tmp_path / "a.npz")
    other = fresh(SimConfig(start=MORNING.start, assistants=2, observe=()))
    with pytest.raises(SchemaError, match="another"):
        other.load(tmp_path / "a.npz")


def test_a_broken_or_missing_snapshot_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "b.npz").write_bytes(b"not a zip")
    with pytest.raises(SchemaError, match="readable"):
        fresh().load(tmp_path / "b.npz")
    with pytest.raises(MissingFileError):
        fresh().load(tmp_path / "c.npz")


def test_a_fresh_process_agrees_on_every_hash() -> None:
    sim = fresh()
    followed(sim, 80)
    here = Path(__file__).parent
    program = (
        f"import sys; sys.path[:0] = [{str(here)!r}, {str(here.parent)!r}]\n"
        "from test_snapshot import fresh, followed\n"
        "sim = fresh(); followed(sim, 80); print(sim.state_hash())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONHASHSEED": "1"},
    )
    assert done.stdout.strip() == sim.state_hash()


def test_what_a_planner_tries_is_undone() -> None:
    sim = fresh()
    actions = followed(fresh(), 30)
    hashes(sim, actions[:10])
    digest, log = sim.state_hash(), list(sim.state.events.log)
    with sim.branch():
        tried = hashes(sim, actions[10:20])
    assert (sim.state_hash(), sim.state.events.log) == (digest, log)
    assert hashes(sim, actions[10:20]) == tried


def hurl(sim: Simulation) -> None:
    """Spoil the speed of a robot."""
    robots: Any = sim.state.robots
    robots.engine._data.qvel[0] = np.nan


def test_physics_that_diverges_leaves_a_snapshot_that_shows_it_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VICO_CACHE", str(tmp_path))
    config = replace(MORNING, robots=("husky",))
    sim = fresh(config)
    sim.step({})
    hurl(sim)
    before = sim.state_hash()
    with pytest.raises(PhysicsError, match=r"diverged at .*; the state before it is in .*npz: report it with"):
        sim.step({})
    (path,) = tmp_path.glob("diverged/*.npz")
    again = fresh(config)
    again.load(path)
    with pytest.raises(PhysicsError, match="diverged"):
        again.advance(1.0)
    # Both stand where they stood before the second that failed.
    assert again.state_hash() == sim.state_hash() == before


def test_a_snapshot_that_cannot_be_kept_is_told_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("VICO_CACHE", str(tmp_path / "file"))
    sim = fresh(replace(MORNING, robots=("husky",)))
    hurl(sim)
    with pytest.raises(PhysicsError, match="could not be kept"):
        sim.step({})
