"""What a person sees who prints worlds, communities, runs, environments and their spaces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import toy_city
import vico
from vico.sim.recording.run import read_run


def test_objects_show_what_they_are(helsinki_path: Path, helsinki_people: Path, helsinki_run: tuple[Path, Any]) -> None:
    world, people = vico.read_world(helsinki_path), vico.read_community(helsinki_people)
    assert repr(world).startswith(f"World({world.manifest.name!r}, 300 m square at 60.")
    assert f"{len(world.buildings)} buildings" in repr(world)
    assert repr(people) == str(people)
    assert repr(people).startswith(f"Community({len(people.residents)} residents, ")
    assert f"{people.weekday} {people.date}" in repr(people)
    assert "8 steps" in repr(read_run(helsinki_run[0]))
    assert "in memory" in repr(toy_city.world())


def test_an_environment_and_its_spaces_fit_on_a_screen() -> None:
    env = vico.make(toy_city.world(), toy_city.community(), observe="none", transit=False, max_steps=5)
    try:
        assert repr(env).startswith("CommunityEnv(world ")
        agent = env.possible_agents[0]
        assert agent in repr(env)
        assert len(repr(env.observation_space(agent))) < 4_000
        assert len(repr(env.action_space(agent))) < 1_000
    finally:
        env.close()
