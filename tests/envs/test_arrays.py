"""The array form: fixed shapes, actions that can be told from numbers and back, masks that tell the truth."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces
from pettingzoo.test import parallel_api_test

import toy_city
import vico
from vico.envs import CommunityEnv, EnvSpec, SingleAgentEnv
from vico.envs.array_actions import PHRASES, ActionTable, Entry
from vico.envs.array_observations import TEXT_BYTES, NearbyEntity, Surroundings, arrays_markdown
from vico.envs.forms import ArrayForm
from vico.errors import InputError
from vico.sim.actions import PEOPLE_ACTIONS, Command, parse

SOME = Surroundings(
    things=tuple(NearbyEntity(f"t{k}", "object", np.array([k, 1.0, 0.5]), entity=70 + k) for k in range(3)),
    people=tuple(NearbyEntity(f"resident_{k}", "resident", np.zeros(3), entity=90 + k) for k in range(2)),
    places=tuple(NearbyEntity(f"p{k}", "place", np.zeros(3)) for k in range(2)),
)


def env(form: Any = "arrays", **options: Any) -> CommunityEnv:
    """Three residents, an assistant and a robot in the toy city."""
    given = {"assistants": 1, "robots": ("husky",), "observe": "none", "max_steps": 30, **options}
    return vico.make(toy_city.world(), toy_city.community(), form=form, **given)


def form_of(environment: CommunityEnv, agent: str) -> ArrayForm:
    form = environment.forms[agent]
    assert isinstance(form, ArrayForm)
    return form


def test_it_keeps_the_parallel_contract(capsys: pytest.CaptureFixture[str]) -> None:
    parallel_api_test(env(), num_cycles=40)
    assert "Passed" in capsys.readouterr().out


@pytest.mark.parametrize("form", ["arrays", {"name": "arrays", "observation": "box", "actions": "discrete"}])
def test_observations_are_in_their_space_whatever_is_done(form: Any) -> None:
    environment = env(form)
    observations, _ = environment.reset(seed=3)
    for _ in range(25):
        actions = {name: environment.action_space(name).sample() for name in environment.agents}
        observations, *_ = environment.step(actions)
        for name, seen in observations.items():
            assert environment.observation_space(name).contains(seen), name


def test_pictures_come_with_the_arrays_and_give_what_is_in_view() -> None:
    environment = env(observe=("assistant_0",), image=64, max_steps=4)
    environment.reset(seed=1)
    scenario = environment.sim.scenario
    scenario.place_agent("assistant_0", (0.0, -15.0, 0.0), yaw=0.0)
    scenario.place_agent("resident_0", (4.0, -15.0, 0.0), yaw=0.0)
    seen = environment.step({})[0]["assistant_0"]
    assert environment.observation_space("assistant_0").contains(seen)
    assert seen["rgb"].shape == (64, 64, 3)
    there, ahead, left = seen["people"][0, :3]
    assert (there, ahead) == pytest.approx((1.0, 1.0), abs=0.05)
    assert left == pytest.approx(0.0, abs=0.1)


def test_one_box_and_pictures_are_refused() -> None:
    with pytest.raises(InputError, match="no pictures"):
        env({"name": "arrays", "observation": "box"}, observe="all")


def test_one_box_holds_the_numbers_of_the_dict_in_its_order() -> None:
    whole, one = env(), env({"name": "arrays", "observation": "box"})
    told, flat = whole.reset(seed=2)[0]["resident_0"], one.reset(seed=2)[0]["resident_0"]
    form = form_of(one, "resident_0")
    assert np.array_equal(flat, np.concatenate([told[name].ravel() for name in form.numeric]))


def test_messages_are_told_as_bytes_cut_off_at_a_whole_character() -> None:
    environment = env({"name": "arrays", "texts": True})
    environment.reset(seed=0)
    for name, x in (("resident_0", 0.0), ("resident_1", 2.0)):
        environment.sim.scenario.place_agent(name, (x, -15.0, 0.0))
    said = "ä" * TEXT_BYTES
    seen = environment.step({"resident_0": {"type": "communicate", "text": said}})[0]["resident_1"]
    assert seen["heard"][0, 0] == 1.0
    assert bytes(seen["heard_text"][0]).rstrip(b"\0").decode() == "ä" * (TEXT_BYTES // 2)


@pytest.mark.parametrize("entry", ActionTable().menu[::3])
def test_an_action_goes_to_numbers_and_back(entry: Entry) -> None:
    table = ActionTable()
    action = table.action_of(entry, SOME)
    if not isinstance(parse(action), Command):
        assert entry.choice >= 2  # names what is not there
        return
    assert table.action_of(table.entry_of(action, SOME), SOME) == action
    assert table.menu[table.number_of(entry)] == entry


def test_choices_name_what_is_around() -> None:
    table = ActionTable()

    def action(kind: str, **parts: int) -> dict[str, Any]:
        return table.action_of(Entry(PEOPLE_ACTIONS.index(kind), **parts), SOME)

    assert action("pick", choice=1, hand=1) == {"type": "pick", "hand": 1, "object": 71}
    assert action("put") == {"type": "put", "hand": 0}
    assert action("put", choice=3) == {"type": "put", "hand": 0, "target": 72}
    assert action("enter", choice=1) == {"type": "enter", "place": "p1"}
    assert action("enter", choice=2) == {"type": "enter"}
    assert action("hand_over", choice=1) == {"type": "hand_over", "hand": 0, "agent": "resident_1"}
    assert action("communicate", choice=7) == {"type": "communicate", "text": PHRASES[7]}
    assert action("turn_left", level=3) == {"type": "turn_left", "degrees": 30.0}
    assert action("move_forward", level=7) == {"type": "move_forward", "distance": 2.5}


def test_demonstrations_become_the_nearest_numbers() -> None:
    table = ActionTable()
    entry = table.entry_of({"type": "move_forward", "distance": 0.93}, SOME)
    assert table.action_of(entry, SOME)["distance"] == 1.0
    with pytest.raises(InputError, match="none of what is told of"):
        table.entry_of({"type": "pick", "hand": 0, "object": 12345}, SOME)


def test_what_a_mask_allows_is_not_refused_and_what_it_forbids_is() -> None:
    environment = env({"name": "arrays", "actions": "discrete"})
    environment.reset(seed=1)
    _, infos = environment.reset(seed=1)
    mask = infos["assistant_0"]["action_mask"]
    assert mask.shape == (environment.action_space("assistant_0").n,)  # type: ignore[attr-defined]
    assert 0 < mask.sum() < len(mask)
    kept = environment.snapshot()
    told = {}
    for number in range(0, len(mask), 2):
        environment.restore(kept)
        environment.step({"assistant_0": np.int64(number)})
        told[number] = environment.sim.observe()[0]["assistant_0"]["state"]["action_status"] != "refused"
        environment.reset(seed=1)
    assert told == {number: bool(mask[number]) for number in told}


def test_the_mask_of_numbers_with_parts_lists_each_part() -> None:
    environment = env()
    _, infos = environment.reset(seed=1)
    space = environment.action_space("assistant_0")
    assert isinstance(space, spaces.MultiDiscrete)
    mask = infos["assistant_0"]["action_mask"]
    assert len(mask) == space.nvec.sum()
    assert mask[PEOPLE_ACTIONS.index("move_forward")] == 1
    assert mask[PEOPLE_ACTIONS.index("exit_bike")] == 0
    space.sample(mask=tuple(np.split(mask, np.cumsum(space.nvec)[:-1])))


def test_the_page_lists_the_arrays_that_there_are() -> None:
    page = (Path(__file__).parents[2] / "docs" / "environments.md").read_text(encoding="utf-8")
    assert arrays_markdown() in page


def test_kinds_of_actions_can_be_fewer() -> None:
    environment = env({"name": "arrays", "actions": "discrete", "kinds": ["wait", "turn_left"]})
    assert environment.action_space("assistant_0").n == 9  # type: ignore[attr-defined]
    with pytest.raises(InputError, match="no action 'fly'"):
        env({"name": "arrays", "kinds": ["fly"]})


def test_a_robot_is_told_its_sensors_and_driven_by_a_vector() -> None:
    environment = env()
    observations, infos = environment.reset(seed=0)
    space = environment.action_space("robot_0")
    assert isinstance(space, spaces.Box)
    assert observations["robot_0"]["sensors.joint_velocity"].dtype == np.float32
    assert infos["robot_0"] == {}
    environment.step({"robot_0": np.full(space.shape, 2.0, np.float32)})
    assert environment.sim.observe()[0]["robot_0"]["state"]["action_status"] == "ok"


def test_the_short_form_is_taken_too() -> None:
    environment = SingleAgentEnv(env(), "assistant_0")
    environment.reset(seed=0)
    before = environment.community.sim.ground_truth.agent_position("assistant_0").copy()
    environment.step({"type": "move_forward", "distance": 1.0})
    after = environment.community.sim.ground_truth.agent_position("assistant_0")
    assert np.linalg.norm(after - before) == pytest.approx(1.0, abs=0.1)
    assert environment.action_masks().any()


@pytest.mark.parametrize(
    ("form", "told"),
    [
        ("pixels", "rich or arrays"),
        ({"name": "arrays", "shape": 3}, "no 'shape'"),
        ({"observation": "x"}, "dict or box"),
    ],
)
def test_an_unknown_form_is_told_with_those_there_are(form: Any, told: str) -> None:
    with pytest.raises(InputError, match=told):
        env(form)


def test_the_form_goes_through_the_spec() -> None:
    spec = env({"name": "arrays", "kinds": ["wait"]}).spec
    assert EnvSpec.from_json(spec.to_json()).form == {"name": "arrays", "kinds": ["wait"]}


def test_no_warning_comes_from_gymnasium_when_spaces_are_looked_at() -> None:
    environment = env("rich")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        observations, _ = environment.reset(seed=0)
        assert all(environment.observation_space(name).contains(seen) for name, seen in observations.items())
