"""What every physics engine has to do: the same tests for each that is installed."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robot_field import ENGINES
from vico.assets.robots import ActionSpace, NoController, RobotModel, Sensors, robot_model
from vico.errors import InputError, SchemaError
from vico.sim.bodies.arrays import CAR, OBJECT, RESIDENT, Bodies
from vico.sim.physics import Capacity, PhysicsEngine, PhysicsScene, StaticScene, make_scene
from vico.sim.physics.records import COARSE, FINE, Party, RigidObject
from vico.world.heights import HeightField

FLAT = HeightField.flat(50.0)
PLAIN = StaticScene(FLAT)
PILLAR = StaticScene(FLAT, pillars=np.array([[3.0, 1.0, 1.0, 0.3, 1.0]]))
SMALL = Capacity(people=8, vehicles=4, objects=6)
HILL = HeightField(np.add.outer(np.sin(np.arange(101.0)), np.cos(np.arange(101.0) / 2)).astype(np.float32) * 0.2, 50.0)
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
pytestmark = pytest.mark.parametrize("name", ENGINES)

HUSKY, GO2 = (robot_model(kind, packs=False) for kind in ("husky", "go2"))
ROTORS = [("front", 0.2, 0.0), ("left", 0.0, 0.2), ("back", -0.2, 0.0), ("right", 0.0, -0.2)]
#: A plate of 1 kg with four rotors.
DRONE = replace(
    HUSKY,
    name="drone",
    mjcf="""<mujoco><worldbody><body name="base"><freejoint/>
    <geom type="box" size="0.2 0.2 0.03" mass="1"/>"""
    + "".join(f'<site name="{name}" pos="{x} {y} 0.03"/>' for name, x, y in ROTORS)
    + "</body></worldbody></mujoco>",
    motors=(),
    servos=(),
    joints=(),
    rest=np.zeros(0),
    controller=NoController(),
    action_spaces={"motors": ActionSpace("motors", (), (), np.zeros(0), np.zeros(0))},
    sensors=Sensors(),
    deck=None,
    stand=0.03,
    shapes={"base": HUSKY.shapes["base"]},
)


def body(kind: int, x: float, y: float, *, velocity: tuple[float, float] = (0.0, 0.0), entity: int = 7) -> Bodies:
    half = (2.0, 0.9) if kind == CAR else (0.25, 0.25)
    return Bodies(
        np.array([entity], np.int32),
        np.array([kind], np.int8),
        np.array([[x, y, 0.0]]),
        np.zeros(1),
        np.array([half[0]]),
        np.array([half[1]]),
        np.array([1.6]),
        np.array([velocity]),
    )


# Some engines build a scene in seconds, some in half a minute: tests of the same one share it.
_SCENES: dict[tuple[Any, ...], tuple[PhysicsScene, StaticScene, tuple[RobotModel, ...]]] = {}


def scene_of(name: str, static: StaticScene, models: tuple[RobotModel, ...]) -> PhysicsScene:
    key = name, id(static), tuple(id(model) for model in models)
    if key not in _SCENES:
        # What the key stands for is kept, too: nothing else is ever at the same place.
        _SCENES[key] = make_scene(name, static, models, SMALL), static, models
    return _SCENES[key][0]


def engine_of(
    name: str, scene: StaticScene = PLAIN, models: tuple[RobotModel, ...] = (HUSKY,), *places: tuple[float, ...]
) -> PhysicsEngine:
    return scene_of(name, scene, models).engine(np.array(places or [(0.0, 0.0, 0.0)]))


def skip_where_all_are_solved_at_once(name: str) -> None:
    if name == "genesis":
        pytest.skip("Genesis solves all contacts at once: what touches far away changes the last bits here")


def roll(engine: PhysicsEngine, seconds: float, speed: float = 4.0, bodies: Bodies | None = None) -> None:
    engine.command(0, np.full(4, speed))
    for _ in range(round(seconds / 0.1)):
        engine.set_dynamic_obstacles(bodies if bodies is not None else Bodies.none(), 0.1)
        engine.step(5)


def cube(x: float, y: float, z: float, *, size: float = 0.3, mass: float = 2.0) -> RigidObject:
    return RigidObject(np.full(3, size), mass, np.array([x, y, z]), UPRIGHT)


# Robots among solids, people and vehicles.


@pytest.mark.parametrize("solid", ["hull", "box", "pillar"])
def test_solids_of_every_kind_stop_a_robot_at_their_face(name: str, solid: str) -> None:
    corners = np.array([[x, y, z] for x in (5.0, 8.0) for y in (-3.0, 3.0) for z in (-1.0, 6.0)])
    scene = {
        "hull": StaticScene(FLAT, hulls=(corners,)),
        "box": StaticScene(FLAT, boxes=np.array([[6.5, 0.0, 1.0, 0.0, 1.5, 3.0, 1.0]])),
        "pillar": StaticScene(FLAT, pillars=np.array([[5.4, 0.0, 1.0, 0.4, 1.0]])),
    }[solid]
    engine = engine_of(name, scene)
    roll(engine, 12.0)
    # The front bumper is 0.495 m ahead of the base.
    assert engine.base(0).position[0] + 0.495 == pytest.approx(5.0, abs=0.02)


def test_a_robot_rests_on_the_ground_of_a_hill(name: str) -> None:
    axis = np.linspace(-50.0, 50.0, 51)
    hill = HeightField((0.08 * axis[None, :] + 0.05 * axis[:, None]).astype(np.float32), 50.0)
    engine = engine_of(name, StaticScene(hill), (HUSKY,), (10.0, 0.0, 0.0))
    roll(engine, 2.0, speed=0.0)
    base = engine.base(0)
    assert base.position[2] == pytest.approx(float(hill(base.position)) + 0.132, abs=0.02)
    slope = np.array([-0.08, -0.05, 1.0]) / np.linalg.norm([-0.08, -0.05, 1.0])
    assert base.rotation[:, 2] @ slope > 0.9995


def test_a_moving_body_pushes_a_robot_and_a_parked_one_does_not(name: str) -> None:
    engine = engine_of(name)
    roll(engine, 1.0, speed=0.0)
    assert abs(engine.base(0).position[0]) < 0.01
    for k in range(20):
        engine.set_dynamic_obstacles(body(CAR, -4.0 + 0.1 * (k + 1), 0.0, velocity=(1.0, 0.0)), 0.1)
        engine.step(5)
    # The car's nose has come to x = 0; the robot's tail was at -0.495.
    assert engine.base(0).position[0] == pytest.approx(0.495 + 0.03, abs=0.03)


def test_a_person_in_the_way_of_raw_wheels_is_not_run_into(name: str) -> None:
    engine = engine_of(name)
    roll(engine, 10.0, speed=6.0, bodies=body(RESIDENT, 4.0, 0.0))
    gap = 4.0 - 0.25 - (engine.base(0).position[0] + 0.495)
    assert 0.0 <= gap < 0.06


def test_a_body_goes_evenly_from_where_it_was_to_where_it_will_be(name: str) -> None:
    engine = engine_of(name)
    engine.set_dynamic_obstacles(body(CAR, -3.0, 0.0), 0.1)
    engine.step(5)
    # Its velocity says nothing of where it comes from: it was told before.
    engine.set_dynamic_obstacles(body(CAR, -2.7, 0.0, velocity=(9.0, 0.0)), 0.1)
    points = np.array([[-1.4, 0.0, 3.0], [-1.1, 0.0, 3.0], [-0.76, 0.0, 3.0]])
    seen = []
    for _ in range(5):
        engine.step()
        seen.append(engine.clearance_below(points) < 2.0)
    # Its nose goes from -1.0 to -0.7, with the skin 3 cm more: the furthest point is reached in the fourth frame.
    assert np.array(seen)[:, 2].tolist() == [False, False, False, True, True]


def test_a_body_that_was_elsewhere_a_moment_ago_is_where_it_is_now(name: str) -> None:
    engine = engine_of(name)
    engine.set_dynamic_obstacles(body(CAR, -9.0, 5.0), 0.1)
    engine.step(5)
    engine.set_dynamic_obstacles(body(CAR, 8.0, -5.0), 0.1)
    engine.step(1)
    assert engine.clearance_below(np.array([[8.0, -5.0, 3.0]]))[0] == pytest.approx(1.4)


def test_of_more_bodies_than_there_is_room_for_the_nearest_count_and_the_rest_are_reported(name: str) -> None:
    engine = engine_of(name)
    crowd = Bodies.joined([body(RESIDENT, 1.5 + 0.6 * k, 0.0, entity=20 - k) for k in range(10)])
    engine.set_dynamic_obstacles(crowd, 0.1)
    engine.step(5)
    above = np.column_stack([1.5 + 0.6 * np.arange(10), np.zeros(10), np.full(10, 3.0)])
    assert (engine.clearance_below(above) < 2.0).tolist() == [True] * 8 + [False] * 2
    assert engine.left_out == 2


def test_movable_objects_among_the_bodies_are_no_kinematic_ones(name: str) -> None:
    engine = engine_of(name)
    engine.set_dynamic_obstacles(body(OBJECT, 2.0, 0.0), 0.1)
    engine.step(5)
    assert engine.clearance_below(np.array([[2.0, 0.0, 3.0]]))[0] == pytest.approx(3.0)


@pytest.mark.parametrize(("top", "least", "most"), [(0.05, 3.0, 9.0), (0.13, 1.5, 2.6), (0.2, 1.4, 1.65)])
def test_wheels_climb_a_kerb_and_are_stopped_by_what_is_higher(
    name: str, top: float, least: float, most: float
) -> None:
    engine = engine_of(
        name, StaticScene(FLAT, boxes=np.array([[7.0, 0.0, top / 2 - 0.5, 0.0, 5.0, 3.0, top / 2 + 0.5]]))
    )
    roll(engine, 6.0)
    assert least < engine.base(0).position[0] < most


def test_links_meet_what_lies_beyond_the_outline_of_a_robot(name: str) -> None:
    boom = '<geom type="capsule" size="0.02" fromto="0.4 0 0.25 0.98 0 0.25" mass="0" contype="1" conaffinity="1"/>'
    model = replace(HUSKY, name="boom", mjcf=HUSKY.mjcf.replace("<freejoint/>", "<freejoint/>" + boom))
    engine = engine_of(name, StaticScene(FLAT, boxes=np.array([[6.0, 0.0, 1.0, 0.0, 1.0, 3.0, 1.0]])), (model,))
    roll(engine, 12.0)
    assert engine.base(0).position[0] + 1.0 == pytest.approx(5.0, abs=0.02)
    points = [np.zeros((0, 3))]
    for _ in range(20):
        engine.step()
        touched = engine.contacts()
        points.append(touched.position[touched.position[:, 2] > 0.2])
    assert len(np.concatenate(points))
    assert np.concatenate(points)[:, 0] == pytest.approx(5.0, abs=0.02)


# Sensors, contacts, thrust.


def test_wheels_carry_the_weight_of_a_standing_robot(name: str) -> None:
    engine = engine_of(name)
    roll(engine, 2.0, speed=0.0)
    forces = engine.contacts().link_forces(0, len(engine.link_names(0)))
    assert engine.link_names(0)[0] == "base"
    assert forces[0] == 0.0
    assert forces[1:] == pytest.approx(np.full(4, 50.0 * 9.81 / 4), rel=0.02)


def test_an_imu_feels_gravity_at_rest_and_nothing_in_free_fall(name: str) -> None:
    engine = engine_of(name)
    roll(engine, 1.0, speed=0.0)
    assert engine.imu(0).specific_force == pytest.approx([0.0, 0.0, 9.81], abs=0.05)
    falling = engine_of(name, PLAIN, (DRONE,))
    falling.thrust(0, ["front", "back"], np.array([[0.0, 0.0, 20.0]] * 2))
    falling.step(25)
    falling.thrust(0, ["front", "back"], np.zeros((2, 3)))
    falling.step(2)
    assert np.abs(falling.imu(0).specific_force).max() < 0.01


def test_rotors_lift_hold_and_turn_a_robot(name: str) -> None:
    engine = engine_of(name, PLAIN, (DRONE,))
    sites = [site for site, _, _ in ROTORS]
    weight = 9.81 / 4
    engine.thrust(0, sites, np.array([[0.0, 0.0, 2 * weight]] * 4))
    engine.step(25)
    # Half a second at 1 g upwards.
    assert engine.base(0).velocity[2] == pytest.approx(4.905, rel=0.03)
    engine.thrust(0, sites, np.array([[0.0, 0.0, weight]] * 4), np.array([[0.0, 0.0, 0.001]] * 4))
    high = engine.base(0).position[2]
    engine.step(25)
    assert engine.base(0).position[2] - high == pytest.approx(4.905 / 2, rel=0.03)
    # 0.004 Nm on 1 kg of 0.4 x 0.4 m for half a second.
    assert engine.base(0).angular_velocity_body[2] == pytest.approx(0.004 * 0.5 / (0.4**2 / 6), rel=0.03)


@pytest.mark.parametrize("frame", [FINE, COARSE])
def test_whoever_acts_within_a_frame_does_so_before_each_step_and_sees_motion_as_it_is(name: str, frame: float) -> None:
    engine = engine_of(name, PLAIN, (DRONE,))
    found: list[tuple[float, float, float]] = []

    def actuate(since: float, step: float) -> None:
        found.append((since, step, float(engine.motion(np.array([0])).velocity[0, 2])))
        engine.thrust_all(np.array([0]), "front", np.array([[0.0, 0.0, 20.0 * (1 + len(found)), 0.0, 0.0, 0.0]]))

    engine.step(3, frame=frame, actuate=actuate)
    since, steps, climbing = np.array(found).T
    assert steps.sum() == pytest.approx(3 * frame)
    each = len(found) // 3
    assert each >= 2
    assert since == pytest.approx(np.tile(np.arange(each) * frame / each, 3))
    assert np.all(np.diff(climbing) > 0.0)


def test_robots_of_a_kind_are_pushed_in_one_call_as_each_alone(name: str) -> None:
    wrench = np.array([[0.0, 0.0, 12.0, 0.0, 0.0, 0.001], [0.1, 0.0, 11.0, 0.0, 0.0, 0.0]])
    engines = [engine_of(name, PLAIN, (DRONE, DRONE), (0, 0, 0), (5, 0, 0)) for _ in range(2)]
    engines[0].thrust_all(np.array([0, 1]), "front", wrench)
    for robot in (0, 1):
        engines[1].thrust(robot, ["front"], wrench[robot : robot + 1, :3], wrench[robot : robot + 1, 3:])
    for engine in engines:
        engine.step(5)
    for robot in (0, 1):
        assert np.array_equal(engines[0].base(robot).position, engines[1].base(robot).position)
    assert engines[0].base(0).position[2] > 0.0


def test_a_site_nobody_has_is_refused(name: str) -> None:
    engine = engine_of(name, PLAIN, (DRONE,))
    with pytest.raises(InputError, match="no site 'up'; it has front, left, back, right"):
        engine.thrust(0, ["up"], np.zeros((1, 3)))
    with pytest.raises(InputError, match="finite"):
        engine.thrust(0, ["front"], np.full((1, 3), np.nan))


# Free rigid objects.


def test_a_thing_in_the_air_falls_and_rests_on_the_ground(name: str) -> None:
    engine = engine_of(name)
    engine.place_object(2, cube(4.0, 0.0, 1.0))
    engine.step(10)
    # A fifth of a second of falling: g t^2 / 2.
    assert engine.objects().position[2, 2] == pytest.approx(1.0 - 0.5 * 9.81 * 0.2**2, abs=0.02)
    assert not engine.objects().resting[2]
    engine.step(100)
    found = engine.objects()
    assert found.present.tolist() == [False, False, True, False, False, False]
    assert found.position[2] == pytest.approx([4.0, 0.0, 0.15], abs=0.005)
    assert found.resting[2]


def test_a_thing_rests_on_a_kerb_a_deck_and_another_thing(name: str) -> None:
    kerb = StaticScene(FLAT, boxes=np.array([[6.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.12]]))
    engine = engine_of(name, kerb)
    engine.place_object(0, cube(6.0, 0.0, 0.5))
    engine.place_object(1, cube(6.0, 0.0, 1.0, size=0.2))
    engine.place_object(2, cube(-0.02, 0.0, 0.7))
    engine.step(150)
    heights = engine.objects().position[:, 2]
    assert heights[0] == pytest.approx(0.12 + 0.15, abs=0.005)
    assert heights[1] == pytest.approx(0.12 + 0.3 + 0.1, abs=0.01)
    # Husky's top plate, between the rails, is 0.23 m above its base, which stands at 0.132 m.
    assert heights[2] == pytest.approx(0.132 + 0.23 + 0.15, abs=0.01)


def test_a_husky_that_drives_into_a_box_pushes_it_and_feels_it(name: str) -> None:
    engine = engine_of(name)
    engine.place_object(0, cube(1.2, 0.0, 0.15, mass=4.0))
    roll(engine, 4.0)
    thing, front = engine.objects().position[0], engine.base(0).position[0] + 0.495
    assert front > 1.5
    assert thing[0] - 0.15 == pytest.approx(front, abs=0.03)
    felt = []
    for _ in range(50):
        engine.step()
        touched = engine.contacts()
        if touched.touching(0, 0, 0):
            felt.append(touched.link_forces(0, 5)[0])
    # Friction of 0.6 on 4 kg.
    assert max(felt) > 0.6 * 4.0 * 9.81


def test_a_walking_person_pushes_a_thing_that_had_come_to_rest(name: str) -> None:
    engine = engine_of(name)
    engine.place_object(0, cube(3.0, 0.0, 0.15))
    engine.step(100)
    assert engine.objects().resting[0]
    for k in range(20):
        engine.set_dynamic_obstacles(body(RESIDENT, 2.4 + 0.1 * (k + 1), 0.0, velocity=(1.0, 0.0)), 0.1)
        engine.step(10, frame=FINE)
    # The person has come to 4.4.
    assert engine.objects().position[0, 0] > 4.6


def test_a_thing_taken_away_is_no_longer_there_and_what_leant_on_it_moves(name: str) -> None:
    engine = engine_of(name)
    engine.place_object(0, cube(3.0, 0.0, 0.15))
    engine.place_object(1, cube(3.0, 0.0, 0.45))
    engine.step(150)
    engine.remove_object(0)
    engine.step(100)
    assert engine.objects().present.tolist()[:2] == [False, True]
    assert engine.objects().position[1, 2] == pytest.approx(0.15, abs=0.005)


def test_size_and_mass_of_a_thing_are_its_own(name: str) -> None:
    engine = engine_of(name)
    engine.place_object(0, RigidObject(np.array([1.0, 0.4, 0.2]), 30.0, np.array([3.0, 0.0, 0.4]), UPRIGHT))
    engine.place_object(1, cube(5.0, 0.0, 0.4, size=0.1, mass=0.2))
    engine.step(150)
    assert engine.objects().position[:2, 2] == pytest.approx([0.1, 0.05], abs=0.005)
    touched = engine.contacts()
    for slot, mass in ((0, 30.0), (1, 0.2)):
        mine = (touched.party == Party.OBJECT) & (touched.owner == slot)
        # A thing that sleeps is not solved: no contacts, no forces.
        weight = float(touched.force[mine.any(axis=1)].sum())
        assert weight == pytest.approx(mass * 9.81, rel=0.05) or weight == 0.0


def test_things_without_extents_and_slots_that_are_not_there_are_refused(name: str) -> None:
    engine = engine_of(name)
    with pytest.raises(InputError, match="three positive extents and a mass"):
        engine.place_object(0, RigidObject(np.array([0.0, 1.0, 1.0]), 1.0, np.zeros(3), UPRIGHT))
    with pytest.raises(InputError, match="no slot 6"):
        engine.remove_object(6)


# State.


def busy(name: str) -> tuple[PhysicsEngine, PhysicsEngine]:
    """Two engines of one scene; the first has a car, people, things lying, sleeping and falling."""
    scene = scene_of(name, PILLAR, (HUSKY, GO2))
    places = np.array([[0.0, 0.0, 0.3], [0.0, 3.0, 1.0]])
    first, second = scene.engine(places), scene.engine(places + 0.5)
    first.place_object(0, cube(2.0, 0.7, 0.2, mass=3.0))
    first.place_object(3, cube(-5.0, 0.7, 0.15))
    first.command(1, GO2.rest, (80.0, 2.0))
    roll(first, 1.5, bodies=body(RESIDENT, 2.5, 0.4, velocity=(0.1, 0.0)))
    first.place_object(1, cube(1.0, 2.0, 2.0))
    roll(first, 0.1, bodies=body(RESIDENT, 2.51, 0.4, velocity=(0.1, 0.0)))
    roll(second, 1.0, speed=1.0)
    second.place_object(4, cube(1.0, 1.0, 0.5, size=0.5))
    return first, second


def same(first: PhysicsEngine, second: PhysicsEngine) -> bool:
    mine, other = first.arrays(), second.arrays()
    return list(mine) == list(other) and all(np.array_equal(mine[key], other[key]) for key in mine)


def test_a_restored_engine_answers_alike_and_goes_on_bit_for_bit(name: str) -> None:
    first, second = busy(name)
    second.restore({key: array.copy() for key, array in first.arrays().items()})
    assert same(first, second)
    assert np.array_equal(first.contacts().force, second.contacts().force)
    assert np.array_equal(first.imu(0).specific_force, second.imu(0).specific_force)
    assert np.array_equal(first.motor_forces(1), second.motor_forces(1))
    assert np.array_equal(first.links(1), second.links(1))
    for engine in (first, second):  # in turns: they share a compiled scene
        roll(engine, 1.0, bodies=body(CAR, 6.0, 2.0, velocity=(-0.2, 0.0)))
    for engine in (first, second):
        roll(engine, 2.0, bodies=body(CAR, 6.0, 2.0, velocity=(-0.2, 0.0)))
    assert same(first, second)


def test_a_restored_engine_undoes_what_happened_since(name: str) -> None:
    first, _ = busy(name)
    saved = {key: array.copy() for key, array in first.arrays().items()}
    ends = []
    for _ in range(2):
        first.restore(saved)
        first.place_object(5, cube(2.0, -1.0, 1.0))
        roll(first, 1.0)
        first.remove_object(3)
        roll(first, 1.0)
        ends.append(first.arrays())
    assert all(np.array_equal(ends[0][key], ends[1][key]) for key in ends[0])


def test_a_state_of_other_robots_is_refused(name: str) -> None:
    one = engine_of(name)
    other = engine_of(name, PLAIN, (GO2,))
    with pytest.raises(SchemaError, match="belongs to other robots"):
        other.restore(one.arrays())


def test_many_frames_at_once_are_those_frames_one_by_one(name: str) -> None:
    engines = [engine_of(name) for _ in "ab"]
    for engine in engines:
        engine.command(0, np.full(4, 3.0))
        engine.set_dynamic_obstacles(body(RESIDENT, 3.0, 0.2, velocity=(-0.4, 0.0)), 0.6)
    engines[0].step(30)
    for _ in range(30):
        engines[1].step()
    assert same(engines[0], engines[1])


def test_what_happens_far_away_changes_nothing_here(name: str) -> None:
    """Another robot that meets people and pushes things, beyond reach, leaves no bit of this one's motion changed."""
    skip_where_all_are_solved_at_once(name)
    scene = scene_of(name, PLAIN, (HUSKY, GO2))
    places = np.array([[0.0, 0.0, 0.3], [0.0, 40.0, 0.0]])
    quiet, lively = scene.engine(places), scene.engine(places)
    lively.place_object(3, cube(0.6, 40.0, 0.6))
    for engine in (quiet, lively):
        engine.place_object(0, cube(1.5, 0.5, 0.15))
    for k in range(40):
        here = body(RESIDENT, 3.0, 1.0, velocity=(0.0, 0.1))
        there = body(CAR, -4.0 + 0.1 * k, 40.0, velocity=(1.0, 0.0), entity=3)
        for engine, bodies in ((quiet, here), (lively, Bodies.joined([there, here]))):
            engine.command(0, np.full(4, 4.0))
            engine.set_dynamic_obstacles(bodies, 0.1)
            engine.step(5)
    assert np.array_equal(quiet.base(0).position, lively.base(0).position)
    assert np.array_equal(quiet.objects().position[0], lively.objects().position[0])
    assert not np.array_equal(quiet.base(1).position, lively.base(1).position)


def test_a_thing_that_comes_and_goes_out_of_reach_changes_nothing_here(name: str) -> None:
    skip_where_all_are_solved_at_once(name)
    scene = make_scene(name, StaticScene(HILL), (HUSKY, GO2), SMALL)
    places = np.array([[0.0, 0.0, 0.3], [0.0, 20.0, 0.0]])
    alone, visited = scene.engine(places), scene.engine(places)
    for k in range(60):
        if k == 20:
            visited.place_object(2, cube(20.0, -20.0, 5.0))
        elif k == 40:
            visited.remove_object(2)
        for engine in (alone, visited):
            engine.command(0, np.array([4.0, 2.0, 4.0, 2.0]))
            engine.set_dynamic_obstacles(body(RESIDENT, 3.0, 1.0, velocity=(0.0, 0.1)), 0.1)
            engine.step(5)
    for robot in (0, 1):
        assert np.array_equal(alone.base(robot).position, visited.base(robot).position)
        assert np.array_equal(alone.joints(robot)[1], visited.joints(robot)[1])
    assert not visited.objects().present.any()


def test_a_batch_computes_what_single_engines_compute(name: str) -> None:
    scene = scene_of(name, PLAIN, (HUSKY, GO2))
    places = np.array([[0.0, 0.0, 0.3], [0.0, 3.0, 1.0]])
    batch = scene.batch(5, places, threads=2)
    singles = [scene.engine(places) for _ in range(5)]
    for k, engine in enumerate(singles):
        engine.place_object(0, cube(1.2, 0.4, 0.3, size=0.2 + 0.05 * k, mass=1.0 + k))
        batch.restore(np.array([k]), engine.arrays())
    speeds = np.linspace(1.0, 5.0, 5)
    for _ in range(20):
        batch.command(0, np.tile(speeds[:, None], 4))
        batch.step(3, frame=FINE)
        batch.step(2, frame=COARSE)
    for k, engine in enumerate(singles):
        engine.command(0, np.full(4, speeds[k]))
        for _ in range(20):
            engine.step(3, frame=FINE)
            engine.step(2, frame=COARSE)
        mine, other = engine.arrays(), batch.arrays(k)
        assert all(np.array_equal(mine[key], other[key]) for key in mine), k
        assert np.array_equal(batch.joints(1)[0][k], engine.joints(1)[0])
        assert np.array_equal(batch.bases(0)[0][k, :3], engine.base(0).position)
        assert np.array_equal(batch.objects()[0][k, 0, :3], engine.objects().position[0])
    assert len(batch) == 5


def test_robots_need_places(name: str) -> None:
    with pytest.raises(InputError, match="2 robots need as many places"):
        scene_of(name, PLAIN, (HUSKY, GO2)).engine(np.zeros((1, 3)))
