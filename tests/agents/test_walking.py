"""The walker reaches its goal by actions alone, and gets around what is in the way."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from vico.agents.base import Action, Info
from vico.agents.indoor_walk import IndoorWalker
from vico.agents.wayfinding import Walker
from vico.seeds import rng
from vico.sim.bodies.arrays import Bodies
from vico.sim.perception import InView
from vico.world.heights import HeightField
from vico.world.public import PublicMap
from vico.world.walkable import BLOCKED, OPEN, WalkableMap

HALF = 40.0


def map_with_wall() -> PublicMap:
    """Open ground with a wall across the middle, open at its northern end only."""
    cells = np.full((160, 160), OPEN, np.uint8)
    cells[:140, 78:82] = BLOCKED
    return PublicMap(HALF, WalkableMap(cells, HALF), HeightField.flat(HALF), [], [], [], [])


class Point:
    """A body that does what it is told, except inside closed discs."""

    def __init__(self, x: float, y: float) -> None:
        self.pose = np.array([x, y, 0.0, 1.0, 0.0, 0.0])
        self.discs: list[tuple[float, float, float]] = []
        self.collided = False

    def do(self, action: dict) -> None:
        self.collided = False
        if action["type"] in ("turn_left", "turn_right"):
            angle = math.radians(action["degrees"]) * (1 if action["type"] == "turn_left" else -1)
            c, s = math.cos(angle), math.sin(angle)
            self.pose[3:5] = c * self.pose[3] - s * self.pose[4], s * self.pose[3] + c * self.pose[4]
        elif action["type"] == "move_forward":
            there = self.pose[:2] + self.pose[3:5] * action["distance"]
            if any(math.hypot(there[0] - x, there[1] - y) < r for x, y, r in self.discs):
                self.collided = True
            else:
                self.pose[:2] = there


def walk(walker: Walker, body: Point, goal: tuple[float, float], limit: int) -> int:
    for step in range(limit):
        status = {"action_status": "collision" if body.collided else "ok", "action_code": "hit_body"}
        action = walker.towards(goal, 1.0, {"pose": body.pose, "state": status}, {"entities": {}})
        if action is None:
            return step
        body.do(action)
    raise AssertionError(f"still {walker.remaining(body.pose[:2]):.1f} m to go after {limit} steps")


def test_who_goes_after_somebody_gets_around_what_is_in_the_way() -> None:
    walker, body = Walker(map_with_wall(), rng(0, "walk")), Point(-30.0, 0.0)
    body.discs = [(-28.0, 0.0, 0.9)]
    for step in range(30):  # they go on, a little further each second
        status = {"action_status": "collision" if body.collided else "ok", "action_code": "hit_body"}
        goal = (-20.0, 0.5 * step)
        action = walker.towards(goal, 1.0, {"pose": body.pose, "state": status}, {"entities": {}})
        if action is None:
            break
        body.do(action)
    assert math.dist(body.pose[:2], goal) < 6.0


def test_who_may_drift_turns_less() -> None:
    turns = {}
    for drift in (0.12, 0.3):
        walker, body = Walker(map_with_wall(), rng(0, "walk")), Point(-30.0, 0.0)
        walker.wide_drift, turned = drift, 0
        for step in range(20):
            observation = {"pose": body.pose, "state": {"action_status": "ok", "action_code": ""}}
            action = walker.towards((-10.0, 0.3 * step), 2.0, observation, {"entities": {}})
            if action is None:
                break
            turned += action["type"] != "move_forward"
            body.do(action)
        turns[drift] = turned
    assert turns[0.3] < turns[0.12]


def test_walker_goes_around_a_wall_it_knows_of() -> None:
    body = Point(-20.0, -20.0)
    steps = walk(Walker(map_with_wall(), rng(0, "walk")), body, (20.0, -20.0), 200)
    shortest = 2 * math.hypot(20.0, 50.0)  # over the wall's northern end at y = 30
    assert math.hypot(body.pose[0] - 20.0, body.pose[1] + 20.0) <= 0.5
    assert shortest * 0.95 <= steps <= shortest * 1.25


@pytest.mark.parametrize("seed", range(5))
def test_walker_gets_past_what_the_map_does_not_show(seed: int) -> None:
    body = Point(-30.0, 0.0)
    body.discs = [(-20.0, 0.0, 1.2)]
    walk(Walker(map_with_wall(), rng(seed, "walk")), body, (-10.0, 0.0), 120)
    assert math.hypot(body.pose[0] + 10.0, body.pose[1]) <= 0.5


@pytest.mark.parametrize(
    ("x", "y", "type_", "degrees"), [(0, 2, "turn_left", 90), (0, -2, "turn_right", 90), (-2, 1e-9, "turn_left", 180)]
)
def test_indoors_one_turns_the_shorter_way_to_face_the_route(x: float, y: float, type_: str, degrees: float) -> None:
    observation = {"pose": np.array([0.0, 0, 0, 1, 0, 0]), "state": {"room": "hall", "action_status": "ok"}}
    action = IndoorWalker().towards(observation, (x, y), near=0.3)
    assert action is not None
    assert action["type"] == type_
    assert action["degrees"] == pytest.approx(degrees, abs=10.0)  # a route runs along the cells of a grid


def test_indoors_one_walks_around_what_one_bumped_into() -> None:
    walker, body, status = IndoorWalker(), Point(-1.5, 0.05), "ok"
    body.discs = [(0.0, 0.0, 0.3)]
    for _ in range(60):
        observation = {"pose": body.pose, "state": {"room": "hall", "action_status": status}}
        walker.notice(observation, {"entities": {}})
        action = walker.towards(observation, (1.5, 0.0), near=0.3)
        if action is None:
            break
        body.do(action)
        status = "collision" if body.collided else "ok"
    assert math.hypot(body.pose[0] - 1.5, body.pose[1]) <= 0.3


def told_room(*others: tuple[float, float], furniture: Sequence[Sequence[float]] = (), agent: str = "") -> Info:
    """What one is told of a room of 6 x 4 m around the origin: what stands in it, and others, nearest first."""
    names = {1: {"agent": agent}}
    view = InView(bodies_at(others), np.arange(len(others)), np.zeros(len(others)), names)
    view.room = np.array([0.0, 0, 0, 3, 2])
    view.furniture = np.array(furniture, np.float64).reshape(-1, 5)
    return {"in_view": view}


def bodies_at(spots: Sequence[tuple[float, float]]) -> Bodies:
    """People at some spots."""
    n = len(spots)
    position = np.column_stack([np.array(spots, np.float64).reshape(-1, 2), np.zeros(n)])
    half = np.full(n, 0.25)
    return Bodies(
        np.arange(1, n + 1), np.zeros(n, np.int8), position, np.zeros(n), half, half, half * 7, np.zeros((n, 2))
    )


def indoor_walk(body: Point, goal: tuple[float, float], info: Info, steps: int = 60) -> int:
    """Walk to a point of a room; return how many steps that took."""
    walker, status = IndoorWalker("resident_1"), "ok"
    for step in range(steps):
        state = {"room": "hall", "action_status": status, "action_code": "hit_body", "time": float(step), "doors": []}
        observation = {"pose": body.pose, "state": state}
        walker.notice(observation, info)
        action = walker.towards(observation, goal, near=0.3)
        if action is None:
            return step
        body.do(action)
        status = "collision" if body.collided else "ok"
    return steps


def test_indoors_one_walks_around_furniture_in_view_without_touching_it() -> None:
    body = Point(-1.5, 0.05)
    body.discs = [(0.0, 0.0, 0.3)]
    assert indoor_walk(body, (1.5, 0.0), told_room(furniture=[(0.0, 0, 0, 0.3, 0.3)])) < 60
    assert not body.collided


def test_indoors_one_gets_into_a_passage_hardly_wider_than_a_person() -> None:
    # A counter 0.6 m from the wall: 0.05 m of room on either side of a person.
    body = Point(-2.0, 0.0)
    steps = indoor_walk(body, (2.7, 1.2), told_room(furniture=[(1.9, 1.0, 0.0, 0.5, 0.8), (0.4, -1.0, 0.0, 0.3, 0.9)]))
    assert steps < 60
    assert math.dist(body.pose[:2], (2.7, 1.2)) <= 0.3


def test_indoors_nobody_pushes_against_what_there_is_no_way_around() -> None:
    body = Point(-1.5, 0.0)
    assert indoor_walk(body, (1.5, 0.0), told_room(furniture=[(0.0, 0, 0, 0.2, 2.0)]), steps=30) == 30
    assert math.dist(body.pose[:2], (-1.5, 0.0)) < 1.6
    assert not body.collided


def test_indoors_one_passes_who_stands_in_the_way_on_the_right_without_touching_them() -> None:
    body = Point(-2.0, 0.0)
    body.discs = [(0.0, 0.0, 0.5)]
    passed: list[float] = []
    step = body.do

    def noted(action: Action) -> None:
        step(action)
        assert not body.collided
        if abs(body.pose[0]) < 0.5:
            passed.append(float(body.pose[1]))

    body.do = noted  # type: ignore[method-assign]
    assert indoor_walk(body, (2.0, 0.0), told_room((0.0, 0.0))) < 20
    assert passed
    assert max(passed) < 0.0


def test_two_who_meet_where_only_one_fits_through_the_later_one_by_name_gets_out_of_the_way() -> None:
    # A gap of 0.7 m in a wall across the room, with a person on either side who wants through.
    wall = [(0.0, 1.175, 0.0, 0.6, 0.825), (0.0, -1.175, 0.0, 0.6, 0.825)]
    bodies = {"resident_1": Point(-1.6, 0.0), "resident_2": Point(1.6, 0.0)}
    goals = {"resident_1": (2.3, 0.0), "resident_2": (-2.3, 0.0)}
    walkers = {name: IndoorWalker(name) for name in bodies}
    for k in range(60):
        for name, body in bodies.items():
            them = next(them for them in bodies if them != name)
            other = bodies[them]
            body.discs = [(float(other.pose[0]), float(other.pose[1]), 0.5)]
            status = "collision" if body.collided else "ok"
            state = {"room": "hall", "action_status": status, "action_code": "hit_body", "time": float(k), "doors": []}
            told = told_room((float(other.pose[0]), float(other.pose[1])), furniture=wall, agent=them)
            walkers[name].notice({"pose": body.pose, "state": state}, told)
            action = walkers[name].towards({"pose": body.pose, "state": state}, goals[name], near=0.3)
            if action is not None:
                body.do(action)
    assert all(math.dist(bodies[name].pose[:2], goal) <= 0.3 for name, goal in goals.items())


def test_who_rests_chest_to_chest_with_somebody_goes_where_there_is_room() -> None:
    walker, body, other = IndoorWalker("resident_2"), Point(0.0, 0.0), (0.55, 0.0)
    for k in range(20):
        state = {"room": "hall", "action_status": "ok", "time": float(k), "doors": [{"position": (-3.0, 0.0, 0.0)}]}
        walker.notice({"pose": body.pose, "state": state}, told_room(other))
        action = walker.aside({"pose": body.pose, "state": state}, 0.8)
        if action is None:
            break
        body.do(action)
    assert math.dist(body.pose[:2], other) >= 0.95
    assert math.dist(body.pose[:2], (-3.0, 0.0)) >= 0.9


def test_nobody_walks_off_the_map_to_a_point_at_its_very_edge() -> None:
    walker = Walker(map_with_wall(), rng(0, "walk"))
    body = Point(-20.0, HALF - 5.0)
    walk(walker, body, (-20.0, HALF - 0.25), 30)
    assert HALF - 0.6 <= body.pose[1] <= HALF - 0.28


def test_rooms_one_left_are_known_again_the_last_six_of_them_and_by_who_goes_on_from_a_state() -> None:
    walker, pose = IndoorWalker(), np.array([0.0, 0, 0, 1, 0, 0])

    def bump_in(room: str) -> None:
        walker.notice({"pose": pose, "state": {"room": room, "action_status": "collision"}}, {})

    def known(walker: IndoorWalker) -> dict[str, int]:
        rooms = walker.state()["rooms"]
        return {kept["room"]: int(np.unpackbits(kept["grid"]["bumps"]).sum()) for kept in rooms.values()}

    for room in ("hall", "kitchen", "bath", "loft", "cellar", "shop"):
        bump_in(room)
    pose[3:5] = 0.0, 1.0
    bump_in("kitchen")
    assert known(walker) == {"hall": 1, "bath": 1, "loft": 1, "cellar": 1, "shop": 1, "kitchen": 2}
    bump_in("bank")
    assert list(known(walker)) == ["bath", "loft", "cellar", "shop", "kitchen", "bank"]
    other = IndoorWalker()
    other.restore(walker.state())
    assert known(other) == known(walker)
    assert other.towards({"pose": pose, "state": {"room": "bank"}}, (2.0, 0.0), near=0.3) is not None


def test_who_is_stopped_again_and_again_beside_a_wall_steps_back_and_goes_another_way() -> None:
    cells = np.full((160, 160), OPEN, np.uint8)
    cells[:80, :] = BLOCKED
    public = PublicMap(HALF, WalkableMap(cells, HALF), HeightField.flat(HALF), [], [], [], [])
    body = Point(-15.0, 0.25)
    # So near to the wall that there is no room on the right, and so wide that a step to the left does not pass it.
    body.discs = [(-7.6, 0.25, 1.5)]
    walk(Walker(public, rng(0, "walk")), body, (30.0, 0.25), 200)
    assert math.hypot(body.pose[0] - 30.0, body.pose[1] - 0.25) <= 0.5


def test_who_needs_room_to_turn_has_it_at_each_corner() -> None:
    cells = np.full((160, 160), OPEN, np.uint8)
    # Two ways through a wall: one is a metre wide, the other one, farther off, four.
    cells[:, 78:82] = BLOCKED
    cells[60:62, 78:82] = cells[20:28, 78:82] = OPEN
    public = PublicMap(HALF, WalkableMap(cells, HALF), HeightField.flat(HALF), [], [], [], [])
    narrow = public.router.path((-20.0, -15.0), (20.0, -5.0))
    wide = public.router.path((-20.0, -15.0), (20.0, -5.0), room=1.0)
    assert narrow is not None
    assert wide is not None
    assert public.walkable.clearance_at(narrow).min() < 0.9 <= public.walkable.clearance_at(wide).min()
    along_the_edge = public.router.path((-39.8, -30.0), (-39.8, 30.0), room=1.0)
    assert along_the_edge is not None
    assert along_the_edge[:, 0].min() >= 1.0 - HALF
    body = Point(-20.0, -15.0)
    walker = Walker(public, rng(0, "walk"))
    status = {"action_status": "ok", "action_code": ""}
    while abs(body.pose[0]) > 1.0:
        action = walker.towards((20.0, -5.0), 1.0, {"pose": body.pose, "state": status}, {"entities": {}}, room=1.0)
        assert action is not None
        body.do(action)
    assert -30.0 < body.pose[1] < -26.0


def test_a_step_past_a_post_keeps_to_the_way_though_there_is_room_where_it_begins() -> None:
    cells = np.full((160, 160), OPEN, np.uint8)
    cells[80, 80] = BLOCKED  # a post at (0.25, 0.25)
    public = PublicMap(HALF, WalkableMap(cells, HALF), HeightField.flat(HALF), [], [], [], [])
    walker, body = Walker(public, rng(0, "walk")), Point(-0.75, -0.6)
    # Six degrees off the way, towards the post, which the way passes by 0.85 m.
    body.pose[3:5] = math.cos(0.11), math.sin(0.11)
    observation = {"pose": body.pose, "state": {"action_status": "ok"}}
    action = walker.towards((8.0, -0.6), 1.0, observation, {"entities": {}})
    assert action is not None
    assert action["type"] == "turn_right"
    body.pose[:2] = -0.75, -2.75
    clear = walker.towards((8.0, -2.75), 1.0, observation, {"entities": {}})
    assert clear is not None
    assert clear["type"] == "move_forward"


def test_on_foot_one_steps_back_from_a_tram_and_lets_it_pass() -> None:
    walker, body = Walker(map_with_wall(), rng(0, "walk")), Point(-30.0, 0.0)
    body.discs = [(-25.0, 0.0, 2.0)]  # it stands there for half a minute
    stopped = 0
    for second in range(60):
        if second == 30:
            body.discs = []
        stopped += body.collided
        state = {
            "action_status": "collision" if body.collided else "ok",
            "action_code": "hit_body",
            "action_reason": "stopped by tram",
        }
        action = walker.towards((-15.0, 0.0), 1.0, {"pose": body.pose, "state": state}, {"entities": {}})
        if action is None:
            break
        body.do(action)
    assert stopped <= 5
    assert math.dist(body.pose[:2], (-15.0, 0.0)) <= 0.5
