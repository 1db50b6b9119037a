"""Environments by id, and their specs as JSON."""

from __future__ import annotations

import json

import gymnasium
import pettingzoo
import pytest

import toy_city
import vico
from vico.envs import CommunityEnv, EnvSpec
from vico.envs.parallel import make_from_spec
from vico.errors import InputError, SchemaError

ID = "vico/Community-v0"


def test_a_spec_goes_to_json_and_back() -> None:
    spec = EnvSpec(world="w", community="c", seed=7, start="07:30:15", robots=("go2",), observe=("resident_0",))
    assert EnvSpec.from_json(spec.to_json()) == spec


def test_an_environment_has_the_spec_it_was_made_from() -> None:
    env = vico.make(toy_city.world(), assistants=1, image=48, observe="none", max_steps=5)
    assert (env.spec.assistants, env.spec.image, env.spec.max_steps, env.spec.world) == (1, 48, 5, None)


@pytest.mark.parametrize(
    ("change", "told"), [({"speed": 3}, "speed"), ({"image": "large"}, "image"), ({"version": 9}, "version 1")]
)
def test_a_damaged_spec_is_refused_with_its_field(change: dict[str, object], told: str) -> None:
    text = json.dumps(json.loads(EnvSpec().to_json()) | change)
    with pytest.raises(SchemaError, match=told):
        EnvSpec.from_json(text)


def test_an_unknown_option_is_told_with_those_there_are() -> None:
    with pytest.raises(InputError, match="max_steps"):
        vico.make(toy_city.world(), fog=3)  # type: ignore[call-arg]


def test_a_spec_without_a_folder_makes_no_environment() -> None:
    with pytest.raises(InputError, match="names no folder"):
        make_from_spec(EnvSpec())


def test_gymnasium_makes_one_agent_among_residents() -> None:
    options = {"world": toy_city.world(), "community": toy_city.community(), "start": "07:59:50", "image": 16}
    env = gymnasium.make(ID, **options)
    seen, _ = env.reset(seed=1)
    assert env.observation_space.contains(seen)
    everybody = env.unwrapped.community  # type: ignore[attr-defined]
    rooms = everybody.sim.state.people.room.copy()
    for _ in range(40):
        seen, reward, ended, cut, info = env.step({"type": "wait"})
    assert (reward, ended, cut) == (0.0, False, False)
    assert env.observation_space.contains(seen)
    assert "hash" in info
    # The residents set out for work meanwhile.
    assert (everybody.sim.state.people.room != rooms).any()


def test_pettingzoo_makes_everybody_at_once() -> None:
    env = pettingzoo.make("parallel", ID, world=toy_city.world(), observe="none", assistants=2)
    assert isinstance(env, CommunityEnv)
    assert env.possible_agents == ["assistant_0", "assistant_1"]
