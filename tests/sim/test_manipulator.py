"""The mobile manipulator: its arm reaches, and what it picks it holds by friction until it is put down."""

import numpy as np
import pytest

from robot_field import ENGINES, field, people
from vico.assets.shapes import box
from vico.kinematics.arm import hand_pose, reach_pose
from vico.sim.bodies.arrays import Bodies
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.robots import RobotPopulation, RobotScene, RobotStatus
from vico.sim.robots.manipulator import TaskStage

SIZE = (0.12, 0.18, 0.2)
TABLE = 0.55


def make(
    *kinds: str, table: bool = False, assistants: int = 0, engine: str = "mujoco", **others: tuple[float, float, float]
) -> Simulation:
    """Robots in a row along y, at x = 0, that look along x, but for those that are told where they are."""
    world = field()
    if table:
        world.surfaces("collision").append(box((0.3, 0.8, TABLE), (3.0, 0.0, TABLE / 2)))
    places = {f"robot_{robot}": (0.0, -3.0 * robot, 0.0) for robot in range(len(kinds))}
    places |= others
    config = SimConfig(robots=kinds, assistants=assistants, observe=(), seed=2, physics=engine, robot_places=places)
    sim = Simulation(world, None, config)
    sim.advance(1.0)
    return sim


def parcel(sim: Simulation, x: float, y: float, z: float = 0.0, *, yaw: float = 0.0) -> int:
    shape = [box(SIZE, (0, 0, SIZE[2] / 2))]
    return int(sim.scenario.add_object("parcel", "parcel", shape, (x, y, z), size=SIZE, yaw=yaw))


def until_done(sim: Simulation, seconds: int) -> bool:
    """Go on second by second until robot 0 has nothing to do; return whether that came so soon."""
    for _ in range(seconds):
        sim.advance(1.0)
        if not sim.state.robots.run.work[0].arrays.kind[0]:
            return True
    return False


def forces(sim: Simulation) -> np.ndarray:
    return np.asarray(sim.state.robots.observation(0)["contacts"])


def test_eleven_numbers_move_arm_fingers_and_base() -> None:
    robots = RobotPopulation(field(), ["manipulator"], [[0, 0, 0]], packs=False)
    model = robots.models[0]
    assert len(model.action_spaces["joints"]) == 11
    arm = np.array([0.3, 0.4, 0.2, 1.0, -0.3, 0.5, 0.1])
    robots.command(0, [*arm, 0.1, 0.1, 0.4, 0.0])
    east = []
    for _ in range(40):
        robots.advance(0.1, Bodies.none())
        east.append(robots.bodies().position[0, 0])
    assert robots.joint_positions()[0] == pytest.approx([*arm, 0.1, 0.1], abs=0.02)
    assert east[-1] - east[19] == pytest.approx(0.4 * 2.0, abs=0.05)
    robots.command(0, [*arm, 0.1, 0.1, 0.0, 0.5])
    yaw = []
    for _ in range(30):
        robots.advance(0.1, Bodies.none())
        yaw.append(robots.bodies().yaw[0])
    assert yaw[-1] - yaw[9] == pytest.approx(0.5 * 2.0, abs=0.1)


@pytest.mark.parametrize("then", ["stop", "go_to", "velocity"])
def test_an_arm_stays_where_motor_commands_brought_it(then: str) -> None:
    sim = make("manipulator")
    arm = np.array([0.3, 0.4, 0.2, 1.0, -0.3, 0.5, 0.1])
    for _ in range(4):
        sim.step({"robot_0": {"type": "control", "vector": [*arm, 0.1, 0.1, 0.0, 0.0]}})
    actions = {
        "stop": {"type": "stop"},
        "go_to": {"type": "go_to", "target": [3.0, 0.0, 0.0]},
        "velocity": {"type": "control", "space": "velocity", "vector": [0.3, 0.0, 0.0]},
    }
    for _ in range(3):
        sim.step({"robot_0": actions[then]})
        assert sim.state.robots.joint_positions()[0][:7] == pytest.approx(arm, abs=0.05)


def test_what_motor_commands_took_hold_of_is_known_to_be_in_the_hand() -> None:
    sim = make("manipulator")
    thing = parcel(sim, 2.5, 0.8)
    sim.step({"robot_0": {"type": "pick", "object": thing}})
    assert until_done(sim, 30)
    robots = sim.state.robots
    held = [*robots.joint_positions()[0][:7], 0.0, 0.0, 0.0, 0.0]
    sim.step({"robot_0": {"type": "control", "vector": held}})
    robots.run.work[0].arrays.held[:] = 0.0  # nobody remembers it
    sim.step({"robot_0": {"type": "control", "vector": held}})
    assert robots.in_hand(0) == thing
    # It is not in the robot's own way, and is put down like any other.
    sim.step({"robot_0": {"type": "place", "target": [0.0, 2.0, 0.0]}})
    assert until_done(sim, 40)
    sim.advance(1.0)
    assert sim.state.objects.position[0] == pytest.approx([0.0, 2.0, 0.0], abs=0.03)
    empty = [*robots.joint_positions()[0][:7], 0.1, 0.1, 0.0, 0.0]
    sim.step({"robot_0": {"type": "control", "vector": empty}})
    assert robots.in_hand(0) == 0


def test_the_arms_kinematics_are_those_of_physics_and_are_inverted() -> None:
    robots = RobotPopulation(field(), ["manipulator"], [[0, 0, 0]], packs=False)
    robots.advance(0.1, Bodies.none())
    chain, model = robots.scene.groups[0].controller.chain, robots.models[0]
    places, pose = (np.empty((7, 3)), np.empty((7, 3))), np.empty((3, 4))
    hand_pose(chain, robots.joint_positions()[0][:7].copy(), *places, pose)
    link = robots.engine.links(0)[list(model.shapes).index("gripper")]
    base = robots.engine.base(0)
    seen = base.rotation.T @ (link[:3, 3] + chain.grip * link[:3, 2] - base.position)
    assert pose[:, 3] == pytest.approx(seen, abs=1e-6)
    stream = np.random.default_rng(1)
    for _ in range(20):
        goal = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0]])
        goal[:, 3] = stream.uniform([0.5, -0.3, 0.0], [0.65, 0.3, 0.7])
        angles = reach_pose(chain, goal, model.rest[:7])
        assert angles is not None
        assert np.all((angles >= chain.low) & (angles <= chain.high))
        hand_pose(chain, angles, *places, pose)
        assert np.abs(pose - goal).max() < 3e-3


@pytest.mark.parametrize("engine", ENGINES)
def test_a_thing_is_picked_from_the_ground_carried_by_friction_and_placed(engine: str) -> None:
    sim = make("manipulator", engine=engine)
    thing = parcel(sim, 2.5, 0.8, yaw=0.7)
    told = sim.step({"robot_0": {"type": "pick", "object": thing}}).observations["robot_0"]["state"]
    assert told["action_status"] == "ok"
    assert until_done(sim, 30)
    robots, objects = sim.state.robots, sim.state.objects
    assert robots.in_hand(0) == thing
    assert objects.position[0, 2] > 0.4
    assert objects.holder[0] == 0  # nothing but friction holds it
    assert forces(sim).min() > 30.0
    height = objects.position[0, 2]
    sim.advance(2.0)
    assert objects.position[0, 2] == pytest.approx(height, abs=0.01)
    sim.step({"robot_0": {"type": "place", "target": [0.0, 2.0, 0.0]}})
    assert until_done(sim, 40)
    sim.advance(1.0)
    assert objects.position[0] == pytest.approx([0.0, 2.0, 0.0], abs=0.03)
    assert robots.in_hand(0) == 0


@pytest.mark.parametrize("engine", ENGINES)
def test_a_thing_from_a_table_is_put_on_a_deck_and_stays_there_while_that_drives(engine: str) -> None:
    sim = make("manipulator", "husky", table=True, engine=engine)
    robots, objects = sim.state.robots, sim.state.objects
    thing = parcel(sim, 3.0, 0.0, TABLE)
    robots.pick(0, thing)
    assert until_done(sim, 30)
    assert robots.in_hand(0) == thing
    carrier = int(robots.entities[1])
    sim.step({"robot_0": {"type": "place", "target": carrier}})
    assert until_done(sim, 60)
    sim.advance(1.0)
    deck = robots.deck(carrier)
    on_deck = deck.rotation.T @ (objects.position[0] - deck.position) - deck.centre
    assert abs(on_deck[0]) < deck.length / 2
    assert abs(on_deck[1]) < deck.width / 2
    assert on_deck[2] == pytest.approx(0.0, abs=0.02)
    robots.drive(1, (-0.5, 0, 0))
    sim.advance(3.0)
    deck = robots.deck(carrier)
    after = deck.rotation.T @ (objects.position[0] - deck.position) - deck.centre
    assert np.abs(after - on_deck).max() < 0.1


@pytest.mark.parametrize("engine", ENGINES)
def test_from_before_a_carrier_it_goes_beside_it_to_reach_the_deck(engine: str) -> None:
    sim = make("manipulator", "husky", engine=engine, robot_1=(3.0, 0.0, np.pi))
    robots, objects = sim.state.robots, sim.state.objects
    robots.pick(0, parcel(sim, 0.0, 1.2))
    # Told to put it down before it is raised, it raises it all the same, and brings it over the deck from above.
    while not robots.run.work[0].arrays.held[0, 0]:
        sim.advance(1.0)
    work, beside = robots.run.work[0].arrays, []
    sim.state.on_substep = lambda: beside.append(objects.position[0, 2]) if work.stage[0] == TaskStage.ALIGN else None
    robots.place(0, int(robots.entities[1]))
    assert until_done(sim, 60)
    assert min(beside) > 0.6
    assert [event.text for event in sim.state.events.log if event.kind == "robot"] == ["placed"]
    deck = robots.deck(int(robots.entities[1]))
    on_deck = deck.rotation.T @ (objects.position[0] - deck.position) - deck.centre
    assert abs(on_deck[2]) < 0.02


@pytest.mark.parametrize("engine", ENGINES)
def test_it_holds_a_thing_out_until_somebody_takes_it(engine: str) -> None:
    sim = make("manipulator", assistants=1, engine=engine)
    robots, objects = sim.state.robots, sim.state.objects
    thing = parcel(sim, 1.5, 0.0)
    sim.scenario.place_agent("assistant_0", (1.0, 3.0, 0.0))
    robots.pick(0, thing)
    assert until_done(sim, 30)
    told = sim.step({"robot_0": {"type": "hand_over", "agent": "assistant_0"}}).observations["robot_0"]["state"]
    assert told["action_status"] == "ok"
    assert not until_done(sim, 16)
    assert forces(sim).min() > 30.0
    told = sim.step({"assistant_0": {"type": "pick", "hand": 0, "object": thing}}).observations["assistant_0"]["state"]
    assert told["action_status"] == "ok"
    assert until_done(sim, 12)
    assert objects.holder[0] == sim.state.people.entity[0]
    assert robots.in_hand(0) == 0


def test_what_cannot_be_done_is_refused_with_a_reason() -> None:
    sim = make("manipulator", "husky")
    wide = int(sim.scenario.add_object("crate", "crate", [box((0.5, 0.5, 0.3))], (4, 0, 0), size=(0.5, 0.5, 0.3)))
    asked = [
        ({"type": "place", "target": [1.0, 1.0, 0.0]}, "hand_empty"),
        ({"type": "pick", "object": wide}, "not_portable"),
        ({"type": "pick", "object": 77}, "not_portable"),
        ({"type": "pick", "hand": 0, "object": wide}, "unknown_field"),
        ({"type": "hand_over", "agent": "robot_1"}, "hand_empty"),
    ]
    for action, code in asked:
        assert sim.step({"robot_0": action}).observations["robot_0"]["state"]["action_code"] == code
    told = sim.step({"robot_1": {"type": "reach", "target": [1.0, 0.0, 0.5]}}).observations["robot_1"]["state"]
    assert told["action_code"] == "not_able"


@pytest.mark.parametrize("engine", ENGINES)
def test_the_hand_reaches_a_point_and_the_base_waits_for_people_in_between(engine: str) -> None:
    world = field()
    scene = RobotScene(world, ["manipulator"], packs=False, physics=engine)
    robots = RobotPopulation(world, ["manipulator"], [[0, 0, 0]], packs=False, scene=scene)
    robots.reach(0, [1.4, 0.0, 0.5])
    somebody = people((1.0, 0.0))
    for _ in range(60):
        robots.advance(0.1, somebody)
    assert robots.bodies().position[0, 0] < 0.5
    assert robots.status[0] == RobotStatus.WAITING
    said: list[str] = []
    for _ in range(120):
        robots.advance(0.1, Bodies.none())
        said += [event.kind for event in robots.events()]
    assert said == ["reached"]
    chain, model = robots.scene.groups[0].controller.chain, robots.models[0]
    link = robots.engine.links(0)[list(model.shapes).index("gripper")]
    assert link[:3, 3] + chain.grip * link[:3, 2] == pytest.approx([1.4, 0.0, 0.5], abs=0.02)


def test_a_task_is_restored_bit_for_bit() -> None:
    sim = make("manipulator")
    robots = sim.state.robots
    robots.reach(0, [1.0, 0.2, 0.4])
    sim.advance(3.0)
    saved = robots.arrays()
    sim.advance(1.0)
    expected = robots.arrays()
    robots.restore(saved)
    sim.advance(1.0)
    found = robots.arrays()
    assert {name for name in expected if not np.array_equal(found[name], expected[name])} <= {"engine_entity"}
