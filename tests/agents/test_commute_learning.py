"""The abstract city commuters are trained in: its second by hand, and the paper's reward."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from vico.agents.commute.abstract_city import (  # fmt: skip
    ACTIONS,
    BIKE,
    BUS,
    CASH,
    DUE,
    ENTER_BIKE,
    ENTER_BUS,
    EXIT_BIKE,
    EXIT_BUS,
    FOOT,
    FORWARD,
    GOAL_X,
    LAST,
    OBSERVATION_NAMES,
    OBSERVATION_SIZE,
    SINCE,
    STATE_SIZE,
    TIME,
    TURN_LEFT,
    VEHICLE,
    CityArrays,
    X,
    cast_ray,
    is_sound,
    observe_all,
    step_all,
)
from vico.agents.commute.learning import CommuteVectorEnv, EpisodeDraws, Network, TrainingCity
from vico.errors import MissingFileError, SchemaError


def toy() -> CityArrays:
    """200 m x 200 m of open ground with a wall at x = 50; stops at x = 0 and 40, a station at x = -20.

    One line leaves x = 0 at 1000 s and is at x = 40 at 1060 s.
    """
    n = 400
    clearance = np.full((n, n), 0.5, np.float32)
    clearance[:, 300:302] = 0.0
    return CityArrays(
        half=100.0, cell=0.5, clearance=clearance,
        stop_xy=np.array([[0.0, 0.0], [40.0, 0.0]]), station_xy=np.array([[-20.0, 0.0]]),
        gives=np.array([True]), takes=np.array([True]),
        call_stop=np.array([0, 1]), call_line=np.array([0, 0]), call_after=np.array([-30.0, 60.0]),
        first_call=np.array([0, 1, 2]), next_call=np.array([1, -1]),
        begins=np.array([1000.0]), first_begin=np.array([0, 1]), dwell=30.0,
    )  # fmt: skip


def agent(
    x: float, *, goal: float, vehicle: int = FOOT, time: float = 900.0, cash: float = 30.0
) -> NDArray[np.float64]:
    """One agent that looks east."""
    state = np.zeros((1, STATE_SIZE))
    state[0, [X, GOAL_X, VEHICLE, TIME, DUE, CASH]] = x, goal, vehicle, time, time + 60.0, cash
    return state


def step(state: NDArray[np.float64], action: int) -> tuple[float, bool]:
    rewards, reached = np.zeros(1), np.zeros(1, np.bool_)
    step_all(toy(), state, np.array([action]), 3.0, rewards, reached)
    return float(rewards[0]), bool(reached[0])


def test_a_step_on_foot_towards_the_goal() -> None:
    # 1 m nearer, -1 for a step on foot, -0.1 for the action.
    assert step(agent(0.0, goal=30.0), FORWARD) == (pytest.approx(1.0 - 1.0 - 0.1), False)


def test_a_turn_costs_the_action_alone() -> None:
    assert step(agent(0.0, goal=30.0), TURN_LEFT) == (pytest.approx(-0.1), False)


def test_a_second_on_a_bicycle_brings_three_metres() -> None:
    assert step(agent(0.0, goal=30.0, vehicle=BIKE), FORWARD) == (pytest.approx(3.0 - 0.1), False)


def test_the_goal_is_worth_a_thousand() -> None:
    assert step(agent(0.0, goal=4.0), FORWARD) == (pytest.approx(1000.0 + 1.0 - 1.0 - 0.1), True)


def test_on_the_last_commute_one_has_to_get_off_first() -> None:
    state = agent(0.0, goal=4.0, vehicle=BIKE)
    state[0, LAST], state[0, SINCE] = 1.0, 850.0
    assert step(state, FORWARD) == (pytest.approx(3.0 - 0.1), False)
    # 51 s cost a started minute, and 20 more as no station is near.
    assert step(state, EXIT_BIKE) == (pytest.approx(1000.0 - 20.2 - 0.1), True)


def test_a_wall_stops_one() -> None:
    state = agent(49.0, goal=90.0)
    for _ in range(3):
        step(state, FORWARD)
    assert 49.0 < state[0, X] < 50.0
    assert step(state, FORWARD)[0] == pytest.approx(-1.1)
    assert cast_ray(toy(), 20.0, 0.0, 0.0) == 20.0
    assert cast_ray(toy(), 40.0, 0.0, 0.0) == pytest.approx(10.0, abs=0.5)


def test_the_bus_goes_by_its_timetable() -> None:
    state = agent(1.0, goal=41.0, time=960.0)
    step(state, ENTER_BUS)
    assert (state[0, VEHICLE], state[0, CASH]) == (FOOT, 30.0)  # it comes at 970
    state[0, TIME] = 975.0
    # The fare is 2, and the seat is where one waits, a metre farther from the goal.
    assert step(state, ENTER_BUS)[0] == pytest.approx(-1.0 - 2.0 - 0.1)
    assert state[0, VEHICLE] == BUS
    state[0, TIME] = 1029.0
    assert step(state, EXIT_BUS)[1] is False  # under way: half of 60 s on the road are over
    assert (state[0, VEHICLE], state[0, X]) == (BUS, pytest.approx(20.0))
    state[0, TIME] = 1059.0
    assert step(state, TURN_LEFT)[1] is True  # its last stop, where all get off, is a metre from the goal
    assert (state[0, VEHICLE], state[0, X]) == (FOOT, 40.0)


def test_a_bicycle_is_taken_at_a_station_and_brought_back() -> None:
    state = agent(-10.0, goal=80.0)
    step(state, ENTER_BIKE)
    assert state[0, VEHICLE] == FOOT
    state[0, X] = -19.0
    step(state, ENTER_BIKE)
    assert state[0, VEHICLE] == BIKE
    state[0, TIME] += 70.0
    # 71 s: two started minutes, and the station is near.
    assert step(state, EXIT_BIKE)[0] == pytest.approx(-0.4 - 0.1)


def test_what_is_seen_has_a_name_each() -> None:
    state, out = agent(0.0, goal=30.0), np.zeros((1, OBSERVATION_SIZE), np.float32)
    observe_all(toy(), state, out)
    seen = dict(zip(OBSERVATION_NAMES, out[0].tolist(), strict=True))
    assert seen["goal_ahead"] == 1.0
    assert seen["goal_distance"] == pytest.approx(math.log(31.0) / 6.0, abs=1e-6)
    assert seen["station_ahead"] == -1.0
    assert (seen["on_foot"], seen["on_bicycle"], seen["in_bus"]) == (1.0, 0.0, 0.0)
    assert seen["bus_soon"] == pytest.approx(1.0 / (1.0 + 70.0 / 60.0))
    assert seen["free_0"] == pytest.approx(math.log(21.0) / 3.0, abs=1e-6)


def environment() -> CommuteVectorEnv:
    points = np.array([[-60.0, 0.0], [0.0, 60.0], [30.0, -60.0]])
    city = TrainingCity(toy(), points, points)
    return CommuteVectorEnv([city], num_envs=6, seed=5, draws=EpisodeDraws(least=30.0, most=200.0))


def test_the_same_seed_gives_the_same_episodes() -> None:
    assert is_sound(toy())
    chance = np.random.default_rng(0)
    actions = chance.integers(len(ACTIONS), size=(400, 6))
    runs = []
    for _ in range(2):
        env = environment()
        seen = [env.reset()[0]]
        ended = 0
        for row in actions:
            out, _, reached, given_up, infos = env.step(row)
            seen.append(out)
            ended += len(infos.get("ended", ()))
            assert not (reached & given_up).any()
        runs.append(np.array(seen))
        assert ended > 0
        assert env.single_observation_space.contains(seen[-1][0])
    np.testing.assert_array_equal(runs[0], runs[1])


@pytest.mark.parametrize("name", ["ppo", "a2c"])
def test_the_packaged_policies_fit(name: str) -> None:
    from vico.io.data_files import PACKAGED

    network = Network.read(PACKAGED / "agents" / "commute" / f"{name}.npz")
    logits = network.logits(np.zeros(OBSERVATION_SIZE, np.float32))
    assert logits.shape == (len(ACTIONS),)
    assert np.isfinite(logits).all()


def test_a_damaged_policy_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="train_commute"):
        Network.read(tmp_path / "none.npz")
    (tmp_path / "bad.npz").write_bytes(b"not an archive")
    with pytest.raises(SchemaError, match="not a policy"):
        Network.read(tmp_path / "bad.npz")
    np.savez(tmp_path / "odd.npz", w0=np.zeros((3, 7), np.float32), b0=np.zeros(7, np.float32))
    with pytest.raises(SchemaError, match="layer 0 does not fit"):
        Network.read(tmp_path / "odd.npz")
