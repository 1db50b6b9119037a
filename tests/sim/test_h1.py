"""H1 in a small world: it walks, turns, stops, keeps its feet when pushed and on kerbs, and is set upright again."""

import hashlib
import subprocess
import sys

import mujoco
import numpy as np
import pytest

from robot_field import ENGINES, HALF, field, people
from vico.assets.robots import robot_model
from vico.errors import InputError
from vico.sim.bodies.arrays import Bodies
from vico.sim.robots import RobotPopulation, RobotScene, RobotStatus
from vico.sim.robots.biped import STEPPING, sole_slope
from vico.world.heights import HeightField, Steps


def team(
    *commands: tuple[float, float, float], height: HeightField | None = None, engine: str = "mujoco"
) -> RobotPopulation:
    """Robots 3 m apart that follow a velocity each."""
    places = [[-5.0, 3.0 * k, 0.0] for k in range(len(commands))]
    world, kinds = field(height=height), ["h1"] * len(commands)
    scene = RobotScene(world, kinds, packs=False, physics=engine)
    robots = RobotPopulation(world, kinds, places, packs=False, scene=scene)
    for robot, command in enumerate(commands):
        robots.drive(robot, command)
    return robots


def run(robots: RobotPopulation, seconds: float, bodies: Bodies | None = None) -> list[tuple[int, str]]:
    """Let time pass; return what happened."""
    seen = []
    for _ in range(round(seconds * 10)):
        robots.advance(0.1, Bodies.none() if bodies is None else bodies)
        seen += [(event.robot, event.kind) for event in robots.events()]
    return seen


def push(robots: RobotPopulation, robot: int, newton_seconds: float, angle: float) -> None:
    """Push a chest for the next tenth of a second."""
    rotation = robots.engine.base(robot).rotation
    force = rotation.T @ (10.0 * newton_seconds * np.array([np.cos(angle), np.sin(angle), 0.0]))
    robots.engine.thrust(robot, ["chest"], force[None])


def yaws(robots: RobotPopulation) -> np.ndarray:
    return np.array([robots.engine.base(robot).yaw for robot in range(len(robots))])


@pytest.mark.parametrize("engine", ENGINES)
def test_it_walks_turns_and_stands_as_it_is_told(engine: str) -> None:
    robots = team((0.3, 0, 0), (0.6, 0, 0), (0, 0, 0.5), (0, 0, 0), engine=engine)
    assert run(robots, 3.0) == []
    before, heading = robots.bodies().position.copy(), yaws(robots)
    assert run(robots, 5.0) == []
    way = robots.bodies().position - before
    turned = (yaws(robots) - heading + np.pi) % (2 * np.pi) - np.pi
    assert np.linalg.norm(way[:2, :2], axis=1) / 5.0 == pytest.approx([0.3, 0.6], abs=0.08)
    assert turned[2] / 5.0 == pytest.approx(0.5, abs=0.12)
    assert np.linalg.norm(way[2, :2]) < 0.35
    assert np.linalg.norm(way[3, :2]) < 0.01
    robots.stop(1)
    assert run(robots, 3.0) == []
    before = robots.bodies().position.copy()
    assert run(robots, 1.0) == []
    assert np.linalg.norm(robots.bodies().position[1] - before[1]) < 0.01


@pytest.mark.parametrize("engine", ENGINES)
def test_it_stays_on_its_feet_when_it_is_pushed(engine: str) -> None:
    robots = team((0, 0, 0), (0, 0, 0), (0.5, 0, 0), (0.5, 0, 0), engine=engine)
    run(robots, 2.0)
    for robot, angle in enumerate((0.0, np.pi, np.pi / 2, -np.pi / 2)):
        push(robots, robot, 15.0, angle)
    robots.advance(0.1, Bodies.none())
    for robot in range(4):
        push(robots, robot, 0.0, 0.0)
    assert run(robots, 4.0) == []


def kerbs() -> HeightField:
    """Level ground that is 12 cm higher between x = -3 and 1 m, with kerbs as worlds have them."""
    n = round(2 * HALF / 0.5) + 1
    x = np.broadcast_to(np.linspace(-HALF, HALF, n), (n, n))
    edge = np.clip(np.rint(np.minimum(x + 3.0, 1.0 - x) * 127), -127, 127).astype(np.int8)
    steps = Steps(edge, np.zeros((n, n), np.int16), np.full((n, n), 120, np.int16))
    return HeightField(np.zeros((2, 2), np.float32), HALF, steps)


def test_it_walks_up_a_kerb_and_down_again() -> None:
    robots = team((0.6, 0, 0), (0.8, 0, 0), height=kerbs())
    assert run(robots, 14.0) == []
    assert robots.bodies().position[:, 0].min() > 2.0


def on_kerbs() -> tuple[RobotPopulation, np.ndarray]:
    """Robots that walk towards the kerb at x = 1 m from either side, and the x at which each stops."""
    heading = np.repeat([0.0, 0.4, 0.8, np.pi], 3)
    stop = 1.0 + np.tile([-0.2, 0.0, 0.2], 4) - 0.3 * np.cos(heading)
    y = 2.5 * (np.arange(12) - 5.5)
    places = np.column_stack([stop - 1.4 * np.cos(heading), y - 1.4 * np.sin(heading), heading])
    world, kinds = field(height=kerbs()), ["h1"] * 12
    robots = RobotPopulation(
        world, kinds, places, packs=False, scene=RobotScene(world, kinds, packs=False, physics="mujoco")
    )
    return robots, stop


def test_it_stops_on_a_kerb_and_stays_there() -> None:
    robots, stop = on_kerbs()
    side = np.sign(robots.bodies().position[:, 0] - stop)
    for robot in range(12):
        robots.drive(robot, (0.6, 0, 0))
    walking = set(range(12))
    for _ in range(60):
        assert run(robots, 0.1) == []
        x = robots.bodies().position[:, 0]
        for robot in [robot for robot in walking if side[robot] * (x[robot] - stop[robot]) <= 0.0]:
            robots.drive(robot, (0, 0, 0))
            walking.remove(robot)
    assert not walking
    before = robots.bodies().position[:, :2].copy()
    assert np.ptp(robots.bodies().position[:, 2]) > 0.08  # feet are at different heights
    furthest = np.zeros(12)
    for _ in range(80):
        assert run(robots, 0.1) == []
        furthest = np.maximum(furthest, np.linalg.norm(robots.bodies().position[:, :2] - before, axis=1))
    assert furthest.max() < 0.2
    assert np.mean(furthest) < 0.08
    assert not robots.run.memory[0][:, STEPPING].any()


def test_pushes_do_not_move_it_away_bit_by_bit() -> None:
    robots = team(*[(0, 0, 0)] * 8)
    run(robots, 2.0)
    before = robots.bodies().position[:, :2].copy()
    for _ in range(5):
        for robot in range(8):
            push(robots, robot, 15.0, robot * np.pi / 4)
        assert run(robots, 0.1) == []
        for robot in range(8):
            push(robots, robot, 0.0, 0.0)
        assert run(robots, 3.9) == []
    # Where nothing steers it back, 0.7 m on average.
    assert np.linalg.norm(robots.bodies().position[:, :2] - before, axis=1).mean() < 0.35


def test_it_feels_its_soles_where_they_are() -> None:
    model = robot_model("h1", packs=False)
    physics = mujoco.MjModel.from_xml_string(model.mjcf)
    data, rng = mujoco.MjData(physics), np.random.default_rng(3)
    for _ in range(5):
        data.qpos[:3] = 0.0
        data.qpos[3:7] = rng.normal(size=4)
        data.qpos[3:7] /= np.linalg.norm(data.qpos[3:7])
        data.qpos[7:] = rng.uniform(-0.4, 0.4, 10)
        mujoco.mj_kinematics(physics, data)
        rotation = data.body("base").xmat.reshape(3, 3)
        for leg, side in enumerate(("left", "right")):
            foot = data.body(f"{side}_ankle")
            height = float(foot.xpos[2] + foot.xmat.reshape(3, 3)[2] @ model.controller.places[-1])
            slope = -float(np.arcsin(foot.xmat[6]))
            found = sole_slope(
                model.controller.places, rotation, data.qpos[7 + 5 * leg : 12 + 5 * leg], 1.0 - 2.0 * leg
            )
            assert found == pytest.approx((slope, height), abs=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
def test_one_that_fell_is_lifted_and_goes_on(engine: str) -> None:
    robots = team((0, 0, 0), engine=engine)
    push(robots, 0, 120.0, 0.7)
    robots.advance(0.1, Bodies.none())
    push(robots, 0, 0.0, 0.0)
    assert run(robots, 12.0) == [(0, "fallen"), (0, "recovered")]
    robots.drive(0, (0.5, 0, 0))
    before = robots.bodies().position[0].copy()
    assert run(robots, 4.0) == []
    assert np.linalg.norm(robots.bodies().position[0] - before) > 1.2


@pytest.mark.parametrize("engine", ENGINES)
def test_it_waits_for_a_person_and_goes_round_who_stays(engine: str) -> None:
    robots = team((0, 0, 0), engine=engine)
    assert robots.go_to(0, (7, 0))
    person = people((1, 0))
    least, waited = np.inf, False
    for _ in range(450):
        robots.advance(0.1, person)
        least = min(least, float(np.linalg.norm(robots.bodies().position[0, :2] - [1, 0])))
        waited |= robots.status[0] == RobotStatus.WAITING
    assert waited
    assert least > 0.25 + robots.models[0].half_length
    assert [event.kind for event in robots.events()] == ["arrived"]


def test_its_motors_take_angles_within_their_bounds() -> None:
    robots = team((0, 0, 0))
    with pytest.raises(InputError, match="takes 10 finite numbers"):
        robots.command(0, [0.0] * 12)
    robots.command(0, robots.models[0].rest)
    run(robots, 0.3)
    assert robots.observation(0)["joint_position"] == pytest.approx(robots.models[0].rest, abs=0.2)
    assert robots.observation(0)["contacts"].sum() == pytest.approx(51.4 * 9.81, rel=0.15)


def digest(robots: RobotPopulation) -> str:
    total = hashlib.sha256()
    for name, array in robots.arrays().items():
        total.update(name.encode() + np.ascontiguousarray(array).tobytes())
    return total.hexdigest()


def test_a_restored_one_and_a_fresh_process_go_on_bit_for_bit() -> None:
    first, second = team((0.6, 0, 0.3), (0, 0, 0)), team((0, 0, 0), (0, 0, 0))
    run(first, 2.0)
    first.stop(0)  # it holds its place then
    run(first, 2.0)
    second.restore({name: array.copy() for name, array in first.arrays().items()})
    run(first, 2.0)
    run(second, 2.0)
    assert digest(first) == digest(second)
    code = (
        "import sys; sys.path.insert(0, '..'); import test_h1 as t; r = t.team((0.6, 0, 0.3), (0, 0, 0)); "
        "t.run(r, 2.0); r.stop(0); t.run(r, 4.0); print(t.digest(r))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=__file__.rsplit("/", 1)[0]
    )
    assert done.stdout.strip() == digest(first)


def test_physics_is_the_same_with_meshes_and_without() -> None:
    assert robot_model("h1", packs=False).mjcf == robot_model("h1").mjcf
