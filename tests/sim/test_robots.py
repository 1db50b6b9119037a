"""Robots in a small world: they drive and walk as told, stop for people and walls, and can be saved exactly."""

import hashlib
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from robot_field import HALF, PACKS, field, people
from vico.errors import InputError
from vico.sim.bodies.arrays import OBJECT, Bodies
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.robots import RobotPopulation, RobotStatus
from vico.sim.robots.quadruped import LegGeometry, leg_angles
from vico.world.heights import HeightField

#: Of Go2: lengths of thigh and shin 0.213 m, 0.0955 m from the hip to the leg (Unitree's description).
LEGS = LegGeometry(0.1934, 0.0465, 0.0955, 0.213, 0.213)


def run(robots: RobotPopulation, seconds: float, bodies: Bodies | None = None) -> None:
    for _ in range(round(seconds * 10)):
        robots.advance(0.1, bodies if bodies is not None else Bodies.none())


def gap(robots: RobotPopulation, persons: Bodies) -> float:
    """Smallest distance between the rectangle of any robot and the disc of any person."""
    mine = robots.bodies()
    least = np.inf
    for i in range(len(mine)):
        away = persons.position[:, :2] - mine.position[i, :2]
        c, s = np.cos(mine.yaw[i]), np.sin(mine.yaw[i])
        u = np.abs(away @ [c, s]) - mine.half_length[i]
        v = np.abs(away @ [-s, c]) - mine.half_width[i]
        outside = np.hypot(np.maximum(u, 0), np.maximum(v, 0)) + np.minimum(np.maximum(u, v), 0)
        least = min(least, float(outside.min()) - 0.25)
    return least


def test_an_unknown_robot_is_refused() -> None:
    with pytest.raises(InputError, match="'rover' is not known; choose among drone, go2, h1, husky, manipulator"):
        RobotPopulation(field(), ["rover"])


def test_robots_start_where_a_run_places_them_and_the_others_by_the_seed() -> None:
    config = SimConfig(robots=("husky", "husky"), robot_places={"robot_1": (3.0, -2.0, 0.5)}, observe=(), seed=1)
    robots = Simulation(field(), None, config).state.robots
    assert robots is not None
    bodies = robots.bodies()
    assert bodies.position[1, :2] == pytest.approx([3.0, -2.0])
    assert bodies.yaw[1] == pytest.approx(0.5)
    assert np.hypot(*(bodies.position[0] - bodies.position[1])[:2]) > 3.0


@pytest.mark.parametrize(
    ("places", "says"),
    [
        ({"robot_7": (0, 0, 0)}, "nobody is called 'robot_7'; there are robot_0, robot_1"),
        ({"robot_0": (0, 0)}, r"robot_0: \(0, 0\); give x, y"),
        ({"robot_0": (0, float("nan"), 0)}, "give x, y"),
        ({"robot_0": "here"}, "robot_0: 'here'; give x, y"),
        ({"robot_0": (1e6, 0, 0)}, "there is no free ground"),
        ({"robot_0": (0, 0, 0), "robot_1": (0.5, 0, 0)}, "robot_1 would stand in robot_0"),
        ([1], "give a table of places by name"),
    ],
)
def test_places_of_robots_that_make_no_sense_are_refused(places: Any, says: str) -> None:
    with pytest.raises(InputError, match=f"robot_places: .*{says}"):
        Simulation(field(), None, SimConfig(robots=("husky", "husky"), robot_places=places, observe=()))


def test_husky_drives_ten_metres_straight() -> None:
    robots = RobotPopulation(field(), ["husky"], [[0, 0, 0]], packs=False)
    robots.drive(0, (0.8, 0, 0))
    run(robots, 13.0)
    x, y, _ = robots.bodies().position[0]
    # 0.8 m/s, less the time it takes to get going at 1 m/s2.
    assert 9.8 < x < 10.5
    assert abs(y) < 0.05
    assert abs(robots.bodies().yaw[0]) < 0.01


def test_husky_turns_as_fast_as_it_is_told_though_its_wheels_skid() -> None:
    robots = RobotPopulation(field(), ["husky"], [[0, 0, 0]], packs=False)
    robots.drive(0, (0, 0, 0.5))
    run(robots, 2.0)
    before = robots.bodies().yaw[0]
    run(robots, 2.0)
    assert robots.bodies().yaw[0] - before == pytest.approx(1.0, abs=0.1)


def test_wheel_speeds_drive_husky_as_far_as_its_wheels_roll() -> None:
    robots = RobotPopulation(field(), ["husky"], [[0, 0, 0]], packs=False)
    robots.command(0, [4.0, 4.0, 4.0, 4.0])
    run(robots, 1.0)
    before = robots.bodies().position[0, 0]
    run(robots, 10.0)
    # 4 rad/s on wheels of 0.165 m.
    assert robots.bodies().position[0, 0] - before == pytest.approx(6.6, rel=0.03)


@pytest.mark.parametrize("packs", PACKS)
def test_go2_walks_twenty_seconds_without_falling(packs: bool) -> None:
    robots = RobotPopulation(field(), ["go2"], [[-20, 0, 0]], packs=packs)
    robots.drive(0, (0.6, 0, 0))
    upright = 1.0
    for _ in range(200):
        robots.advance(0.1, Bodies.none())
        upright = min(upright, float(robots.engine.base(0).rotation[2, 2]))
    assert np.linalg.norm(robots.bodies().position[0, :2] - [-20, 0]) / 20.0 >= 0.4
    assert upright > 0.95
    assert robots.events() == []


@pytest.mark.parametrize("packs", PACKS)
@pytest.mark.parametrize("slope", [-0.1, 0.1])
def test_go2_and_husky_follow_a_way_up_and_down_a_street(packs: bool, slope: float) -> None:
    axis = np.linspace(-HALF, HALF, 41)
    hill = HeightField(np.broadcast_to(slope * axis, (41, 41)).astype(np.float32), HALF)
    robots = RobotPopulation(field(height=hill), ["go2", "husky"], [[0, 0, 0], [0, 5, 0]], packs=packs)
    robots.follow(0, [(0, 0), (8, 0), (8, -6)])
    robots.follow(1, [(0, 5), (8, 5), (8, 11)])
    kinds: list[tuple[int, str]] = []
    for _ in range(600):
        robots.advance(0.1, Bodies.none())
        kinds += [(event.robot, event.kind) for event in robots.events()]
    assert sorted(kinds) == [(0, "arrived"), (1, "arrived")]
    assert robots.bodies().position[:, :2] == pytest.approx(np.array([[8, -6], [8, 11]]), abs=0.45)


@pytest.mark.parametrize("packs", PACKS)
def test_go2_stands_still_when_nothing_is_asked_of_it(packs: bool) -> None:
    robots = RobotPopulation(field(), ["go2"], [[0, 0, 0]], packs=packs)
    run(robots, 3.0)
    before = robots.bodies().position[0].copy()
    run(robots, 5.0)
    assert np.abs(robots.bodies().position[0] - before).max() < 0.01
    assert robots.engine.base(0).rotation[2, 2] > 0.995


@pytest.mark.parametrize(("kind", "packs"), [("husky", False), ("go2", False)])
def test_a_wall_stops_a_robot(kind: str, packs: bool) -> None:
    robots = RobotPopulation(field((6, 0, 2, 30)), [kind], [[0, 0, 0]], packs=packs)
    robots.drive(0, (0.8, 0, 0))
    run(robots, 15.0)
    nose = robots.bodies().position[0, 0] + robots.models[0].half_length
    assert 4.9 < nose < 5.02


@pytest.mark.parametrize("kind", ["husky", "go2"])
def test_a_robot_stops_for_a_person_in_front_and_goes_on_when_they_leave(kind: str) -> None:
    robots = RobotPopulation(field(), [kind], [[0, 0, 0]], packs=False)
    robots.drive(0, (0.8, 0, 0))
    run(robots, 10.0, people((6, 0)))
    assert robots.status[0] == RobotStatus.WAITING
    assert 0.3 < gap(robots, people((6, 0))) < 1.0
    assert abs(robots.bodies().velocity[0, 0]) < 0.1
    run(robots, 5.0)
    assert robots.bodies().position[0, 0] > 6.5


@pytest.mark.parametrize("kind", ["husky", "go2"])
def test_a_robot_goes_round_a_person_who_stays_and_never_touches_them(kind: str) -> None:
    robots = RobotPopulation(field(), [kind], [[0, 0, 0]], packs=False)
    assert robots.go_to(0, (14, 0))
    person = people((7, 0))
    least = np.inf
    for _ in range(450):
        robots.advance(0.1, person)
        least = min(least, gap(robots, person))
    assert least > 0.1
    assert robots.bodies().position[0, 0] == pytest.approx(14, abs=0.5)


@pytest.mark.parametrize("kind", ["husky", "go2", "h1"])
def test_who_waits_makes_room_for_somebody_who_stands_close_ahead_if_there_is_room_behind(kind: str) -> None:
    robots = RobotPopulation(field(), [kind] * 2, [[0, 0, 0], [0, 12, 0]], packs=False)
    half = robots.models[0].half_length
    near = half + 0.25 + 0.08
    standing = people((near, 0), (near, 12), (-near - 0.3, 12))
    for robot, y in enumerate((0, 12)):
        robots.follow(robot, [(0, y), (12, y)])
    run(robots, 3.5, standing)
    assert (robots.status == RobotStatus.WAITING).all()
    back = -robots.bodies().position[:, 0]
    assert 0.12 < back[0] < 0.45
    assert abs(back[1]) < 0.05


def test_a_robot_lets_a_person_cross() -> None:
    robots = RobotPopulation(field(), ["husky"], [[0, 0, 0]], packs=False)
    assert robots.go_to(0, (14, 0))
    least = np.inf
    for k in range(200):
        person = people((5, -6 + 0.1 * k), velocity=(0, 1.0))
        robots.advance(0.1, person)
        least = min(least, gap(robots, person))
    assert least > 0.15


def test_husky_goes_round_a_house() -> None:
    robots = RobotPopulation(field((10, 0, 6, 12)), ["husky"], [[0, 0, 0]], packs=False)
    assert robots.go_to(0, (20, 0))
    run(robots, 60.0)
    assert [event.kind for event in robots.events()] == ["arrived"]


def test_a_goal_nobody_can_reach_is_refused() -> None:
    walls = [(20, 10, 20, 1), (20, -10, 20, 1), (10, 0, 1, 20), (30, 0, 1, 20)]
    robots = RobotPopulation(field(*walls), ["husky"], [[0, 0, 0]], packs=False)
    assert not robots.go_to(0, (20, 0)) or np.abs(robots.run.followers[0].path[-1] - [20, 0]).max() > 5


@pytest.mark.parametrize("packs", PACKS)
@pytest.mark.parametrize("tilt", [(0.7071, 0.7071, 0, 0), (0.7071, -0.7071, 0, 0), (0, 1, 0, 0)])
def test_a_go2_that_lies_on_its_side_or_back_says_so_and_gets_up(packs: bool, tilt: tuple[float, ...]) -> None:
    robots = RobotPopulation(field(), ["go2"], [[0, 0, 0]], packs=packs)
    saved = {name: array.copy() for name, array in robots.arrays().items()}
    state = saved["engine_state"]
    # The solver's state begins with the time, then the position and the quaternion of the first base.
    state[3], state[4:8] = 0.3, tilt
    robots.restore(saved)
    seen = []
    for _ in range(300):
        robots.advance(0.1, Bodies.none())
        seen += [event.kind for event in robots.events()]
    assert seen == ["fallen", "recovered"]
    assert robots.engine.base(0).rotation[2, 2] > 0.98


def digest(robots: RobotPopulation) -> str:
    total = hashlib.sha256()
    for name, array in robots.arrays().items():
        total.update(name.encode() + np.ascontiguousarray(array).tobytes())
    return total.hexdigest()


def on_the_way(packs: bool) -> RobotPopulation:
    robots = RobotPopulation(field((10, 3, 2, 2)), ["husky", "go2"], [[0, 0, 0], [0, 6, 0]], packs=packs)
    robots.go_to(0, (20, 0))
    robots.go_to(1, (20, 6))
    return robots


@pytest.mark.parametrize("packs", PACKS)
def test_a_population_restored_on_its_way_goes_on_bit_for_bit(packs: bool) -> None:
    first, second = on_the_way(packs), on_the_way(packs)
    person = people((6.5, 0.2), velocity=(0.0, 0.05))
    run(first, 7.3, person)
    second.restore({name: array.copy() for name, array in first.arrays().items()})
    assert digest(first) == digest(second)
    for _ in range(150):
        first.advance(0.1, person)
        second.advance(0.1, person)
        assert digest(first) == digest(second)


def test_a_fresh_process_computes_the_same_bits() -> None:
    robots = on_the_way(False)
    run(robots, 8.0, people((6.5, 0.2)))
    code = (
        "import sys; sys.path.insert(0, '..'); import test_robots as t; r = t.on_the_way(False); "
        "t.run(r, 8.0, t.people((6.5, 0.2))); print(t.digest(r))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=__file__.rsplit("/", 1)[0]
    )
    assert done.stdout.strip() == digest(robots)


def test_drawn_links_are_where_the_bodies_are() -> None:
    robots = on_the_way(False)
    run(robots, 3.0)
    drawn = robots.draw()
    shapes = robots.prototypes()
    assert set(drawn.prototypes) == set(shapes)
    for i in range(2):
        mine = drawn.entity == robots.entities[i]
        points = np.concatenate(
            [
                surface.moved(pose).positions
                for k, pose in zip(drawn.index[mine], drawn.transforms[mine], strict=True)
                for surface in shapes[drawn.prototypes[k]]
            ]
        )
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        assert middle[:2] == pytest.approx(robots.bodies().position[i, :2], abs=0.08)
        assert abs(points[:, 2].min()) < 0.04


def test_motor_commands_of_the_wrong_size_are_refused() -> None:
    robots = RobotPopulation(field(), ["go2"], [[0, 0, 0]], packs=False)
    with pytest.raises(InputError, match="takes 12 finite numbers"):
        robots.command(0, [0.0, 1.0])


def test_joint_targets_move_the_joints() -> None:
    robots = RobotPopulation(field(), ["go2"], [[0, 0, 0]], packs=False)
    targets = np.array([0.0, 1.0, -1.9] * 4)
    robots.command(0, targets)
    run(robots, 2.0)
    assert robots.observation(0)["joint_position"] == pytest.approx(targets, abs=0.12)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("foot", [(0.0, 0.0, -0.27), (0.1, 0.05, -0.25), (-0.12, -0.06, -0.3)])
def test_leg_angles_bring_the_foot_where_it_is_wanted(side: float, foot: tuple[float, float, float]) -> None:
    x, y, z = foot[0], foot[1] + side * 0.0955, foot[2]
    hip, thigh, calf = leg_angles(x, y, z, side, LEGS)
    down = -0.213 * np.cos(thigh) - 0.213 * np.cos(thigh + calf)
    found = (
        -0.213 * np.sin(thigh) - 0.213 * np.sin(thigh + calf),
        side * 0.0955 * np.cos(hip) - down * np.sin(hip),
        side * 0.0955 * np.sin(hip) + down * np.cos(hip),
    )
    assert found == pytest.approx((x, y, z), abs=1e-6)


def test_spawns_are_reachable_and_apart() -> None:
    robots = RobotPopulation(field((0, 0, 10, 10)), ["husky", "go2", "go2"], seed=3, packs=False)
    positions = robots.bodies().position[:, :2]
    assert robots.world.walkable.is_connected(positions).all()
    away = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    assert away[np.triu_indices(3, 1)].min() > 2.9


def test_a_robot_stops_for_a_thing_on_the_ground() -> None:
    robots = RobotPopulation(field(), ["husky"], [[0, 0, 0]], packs=False)
    crate = replace(people((5, 0)), kind=np.full(1, OBJECT, np.int8), height=np.array([0.4]))
    robots.drive(0, (0.8, 0, 0))
    run(robots, 10.0, crate)
    nose = robots.bodies().position[0, 0] + robots.models[0].half_length
    assert robots.status[0] == RobotStatus.WAITING
    assert 0.2 < 4.75 - nose < 1.0


def test_what_flies_high_above_stops_nobody() -> None:
    robots = RobotPopulation(field(), ["husky"], [[0, 0, 0]], packs=False)
    above = people((5, 0))
    above.position[0, 2] = 30.0
    robots.drive(0, (0.8, 0, 0))
    run(robots, 10.0, above)
    assert robots.bodies().position[0, 0] > 6.0


def test_a_robot_keeps_near_whom_it_follows() -> None:
    robots = RobotPopulation(field((6, 0, 2, 10)), ["go2"], [[0, 0, 0]], packs=False)
    start = np.array([2.5, 0.0])
    leader = people(tuple(start))
    robots.follow_body(0, int(leader.entity[0]))
    corners = [(2.5, 0), (3, 7.5), (9.5, 7.5), (10, 0)]
    for a, b in pairwise(corners):
        away = np.subtract(b, a)
        steps = int(np.hypot(*away) / 0.05)
        for k in range(steps):
            robots.advance(0.1, people(tuple(np.add(a, away * k / steps)), velocity=tuple(away / np.hypot(*away) / 2)))
    run(robots, 8.0, people(corners[-1]))
    left = np.hypot(*(robots.bodies().position[0, :2] - corners[-1]))
    assert 0.6 < left < 2.2
    assert robots.status[0] == RobotStatus.WAITING
    run(robots, 0.1)  # the leader has gone indoors
    assert robots.status[0] == RobotStatus.WAITING


@pytest.mark.parametrize("packs", PACKS)
def test_a_standing_go2_feels_its_weight(packs: bool) -> None:
    robots = RobotPopulation(field(), ["go2"], [[0, 0, 0]], packs=packs)
    run(robots, 3.0)
    felt = robots.observation(0)
    assert felt["contacts"].shape == (4,)
    assert felt["contacts"].sum() == pytest.approx(15.0 * 9.81, rel=0.06)  # 15 kg, as Unitree publishes
    assert felt["contacts"].min() > 10.0
    assert felt["specific_force"] == pytest.approx([0, 0, 9.81], abs=0.4)
    assert felt["gravity"] == pytest.approx([0, 0, -1], abs=0.06)
    assert felt["fallen"] == [0]
