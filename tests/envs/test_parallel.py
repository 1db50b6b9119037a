"""The PettingZoo environment: its contract, its spaces, repeatable episodes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pettingzoo.test import parallel_api_test

import toy_city
import vico
from vico.agents.base import RandomAgent
from vico.envs import CommunityEnv, EnvSpec, SingleAgentEnv
from vico.envs.spaces import short_form
from vico.errors import InputError, MissingFileError
from vico.sim.actions import PEOPLE_ACTIONS, Command, parse


def env(*, seed: int = 0, max_steps: int = 300, observe: str = "none", image: int = 32) -> CommunityEnv:
    """Three residents and an assistant in the toy city."""
    return vico.make(
        toy_city.world(),
        toy_city.community(),
        seed=seed,
        assistants=1,
        observe=observe,
        image=image,
        max_steps=max_steps,
    )


def episode(environment: CommunityEnv, *, seed: int = 0) -> list[str]:
    """Let random agents play an episode; return the state's hash after each step."""
    observations, infos = environment.reset(seed=seed)
    agents = {name: RandomAgent(name, seed=seed) for name in environment.agents}
    hashes = []
    while environment.agents:
        actions = {name: agents[name].act(observations[name], infos[name]) for name in environment.agents}
        observations, _, _, _, infos = environment.step(actions)
        hashes.append(infos["assistant_0"]["hash"])
    return hashes


def test_it_keeps_the_parallel_contract(capsys: pytest.CaptureFixture[str]) -> None:
    parallel_api_test(env(max_steps=60), num_cycles=80)
    assert "Passed" in capsys.readouterr().out


def test_random_agents_play_three_hundred_steps() -> None:
    assert len(episode(env(max_steps=300))) == 300


def test_observations_belong_to_their_spaces() -> None:
    environment = env(observe="all", max_steps=5)
    observations, _ = environment.reset(seed=3)
    observations, *_ = environment.step({"resident_0": {"type": "communicate", "text": "Huomenta, maailma!"}})
    misfits = [name for name, seen in observations.items() if not environment.observation_space(name).contains(seen)]
    assert misfits == []


def test_two_episodes_of_one_seed_have_the_same_hashes_at_every_step() -> None:
    environment = env(max_steps=80)
    assert episode(environment, seed=5) == episode(environment, seed=5)


def test_a_fresh_process_agrees_on_a_whole_episode() -> None:
    here = Path(__file__).parent
    program = (
        f"import sys; sys.path[:0] = [{str(here)!r}, {str(here.parent)!r}]\n"
        "from test_parallel import env, episode\n"
        "print('\\n'.join(episode(env(max_steps=120), seed=7)))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONHASHSEED": "1"},
    )
    there = done.stdout.split()
    assert len(there) == 120
    assert there == episode(env(max_steps=120), seed=7)


def test_a_reset_without_a_seed_goes_on_to_another_episode() -> None:
    environment = env(max_steps=3)
    environment.reset(seed=1)
    first = environment.state_hash()
    environment.reset()
    second = environment.state_hash()
    environment.reset(seed=1)
    assert (environment.state_hash() == first, second == first) == (True, False)


def test_every_sampled_action_is_well_formed() -> None:
    environment = env()
    space = environment.action_space("assistant_0")
    space.seed(0)
    world = environment.world
    places = [place.id for place in world.places] + [room.id for room in world.rooms]
    people = environment.sim.state.people.names
    bad = []
    for _ in range(300):
        action = space.sample()
        verdict = parse(short_form(action, places, people))
        if not isinstance(verdict, Command) and PEOPLE_ACTIONS[int(action["type"])] != "communicate":
            bad.append(verdict)
    assert bad == []


def test_stepping_before_a_reset_says_what_to_do() -> None:
    with pytest.raises(InputError, match=r"reset\(\)"):
        env().step({})


def test_an_unknown_agent_is_named_with_those_there_are() -> None:
    with pytest.raises(InputError, match="resident_0"):
        env().action_space("robot_9")


def test_a_missing_world_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError):
        vico.make(tmp_path / "nowhere")


def test_a_community_of_another_world_is_refused() -> None:
    people = toy_city.community()
    other = people.model_copy(update={"world": people.world.model_copy(update={"digest": "0" * 64})})
    with pytest.raises(InputError, match="made for world"):
        vico.make(toy_city.world(), other)


def test_setup_places_things_and_people_at_each_reset() -> None:
    environment = CommunityEnv(
        toy_city.world(),
        None,
        spec=env().spec,
        setup=lambda sim: sim.scenario.place_agent("assistant_0", (10.0, -20.0)),
    )
    for seed in (0, 1):
        observations, _ = environment.reset(seed=seed)
        assert observations["assistant_0"]["pose"][:2] == pytest.approx([10.0, -20.0], abs=0.3)


def quick() -> CommunityEnv:
    """The toy city with an assistant that acts twice a second."""
    return vico.make(
        toy_city.world(),
        toy_city.community(),
        assistants=1,
        observe="none",
        periods={"assistant_0": 0.5},
        max_steps=5,
    )


def test_with_periods_of_their_own_only_who_is_due_observes_until_the_end() -> None:
    environment = quick()
    environment.reset()
    steps = [environment.step({})[0] for _ in range(5)]
    assert [len(observations) for observations in steps] == [1, 4, 1, 4, 4]
    assert steps[-1]["resident_0"]["state"]["time"] == pytest.approx(8 * 3600 + 2.5)
    assert environment.agents == []


@pytest.mark.parametrize(("agent", "seconds"), [("resident_0", 1.0), ("assistant_0", 0.5)])
def test_a_single_agent_acts_at_its_own_period(agent: str, seconds: float) -> None:
    environment = SingleAgentEnv(quick(), agent, others=lambda env, seed: {n: Idle() for n in env.possible_agents})
    before, _ = environment.reset()
    after, *_ = environment.step({"type": "wait"})
    assert after["state"]["time"] - before["state"]["time"] == pytest.approx(seconds)


class Idle:
    """Waits."""

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
        """Return the action to wait."""
        return {"type": "wait"}


def test_periods_go_through_the_spec() -> None:
    spec = quick().spec
    assert EnvSpec.from_json(spec.to_json()).config.periods == {"assistant_0": 0.5}


def learners_action(kind: str, **slots: Any) -> dict[str, Any]:
    """An action in the learners' form, with what it does not use left at its first value."""
    space = env().action_space("assistant_0")
    action = space.sample()
    action |= {"type": PEOPLE_ACTIONS.index(kind), "hand": 0, "where": 0} | slots
    assert space.contains(action)
    return action


def test_learners_may_enter_rooms_and_choose_where_to_put() -> None:
    world = toy_city.world()
    names = [place.id for place in world.places] + [room.id for room in world.rooms]
    further = next(
        room.id for room in world.rooms if all(room.id != place.rooms[0] for place in world.places if place.rooms)
    )
    entering = short_form(learners_action("enter", place=names.index(further)), names, ["assistant_0"])
    assert entering == {"type": "enter", "place": further}
    point = np.array([1.0, 2.0, 0.5], np.float32)
    put = {
        where: short_form(learners_action("put", where=where, entity=77, target=point), names, []) for where in range(3)
    }
    assert "target" not in put[0]
    assert put[1]["target"] == 77
    assert put[2]["target"] == [1.0, 2.0, 0.5]
    assert all(isinstance(parse(action), Command) for action in put.values())


def test_an_action_for_nobody_is_refused() -> None:
    environment = env()
    environment.reset(seed=0)
    with pytest.raises(InputError, match=r"no agent is called 'asistant_0'; there are resident_0.*assistant_0"):
        environment.step({"asistant_0": {"type": "wait"}})
