"""Arm tasks: reach, pick, place and hand over with inverse kinematics and real contact. Nothing is glued to a hand.

A task drives near its object, plans where the hand has to go in the frame of the base as it stands there, moves the arm
along those paths, and says how it went. What a hand holds it holds by friction. A thing can be put on another robot's
deck: the arm's robot stands beside it, with nothing between.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.exact import apply_matrix
from vico.geometry import distances, rotation_matrix
from vico.kinematics.arm import hand_pose, reach_pose
from vico.kinematics.hand_paths import CARRY, downward, path_down, path_to_carry
from vico.sim.bodies.arrays import Bodies
from vico.sim.bodies.collisions import DeckPose
from vico.sim.bodies.state_arrays import MovableObjects
from vico.sim.physics.records import Base
from vico.sim.robots.drawing import deck_of
from vico.sim.robots.manipulator import ARM_GOAL, ARM_NOW, ArmTasks, TaskKind, TaskStage
from vico.sim.robots.path_following import RobotStatus, footprint_discs
from vico.sim.robots.state import RobotMode, RobotRun
from vico.sim.robots.trips import outdoor_path

# Metres from the edges of a deck that things are put at; free room between two robots where the arm's way ends.
_FROM_EDGE, _BESIDE = 0.16, 0.3


def deck_spot(run: RobotRun, robot: int, entity: int) -> NDArray[np.float64] | None:
    """Where on the deck of the robot with an entity another one can put something, ENU metres; None without a deck.

    It is near the edge of the side, left or right, that the other one is on: before and behind a deck there is more of
    its robot than an arm reaches across.
    """
    deck = deck_of(run, entity)
    if deck is None:
        return None
    return np.asarray(deck.position + apply_matrix(_spot_in_deck_frame(run, robot, deck), deck.rotation))


def _spot_in_deck_frame(run: RobotRun, robot: int, deck: DeckPose) -> NDArray[np.float64]:
    """Return the spot in the frame of the deck's robot."""
    x, y, _ = apply_matrix(run.position(robot) - deck.position, deck.rotation.T) - deck.centre
    half = np.array([deck.length, deck.width]) / 2 - _FROM_EDGE
    return np.asarray(deck.centre + np.array([min(max(x, -half[0]), half[0]), math.copysign(half[1], y), 0.0]))


def path_beside_deck(run: RobotRun, robot: int, entity: int) -> NDArray[np.float64] | None:
    """Return a way round the robot with an entity to where another one stands beside its deck; None if there is none.

    Raises
    ------
    ValueError
        If there is no such robot.
    """
    carrier, deck = run.entities.tolist().index(entity), deck_of(run, entity)
    if deck is None:
        return None
    mine, theirs, base = run.scene.models[robot], run.scene.models[carrier], run.engine.base(carrier)
    spot = _spot_in_deck_frame(run, robot, deck)
    spot[1] = math.copysign(theirs.half_width + mine.half_width + _BESIDE, spot[1] - deck.centre[1])
    goal = deck.position + apply_matrix(spot, deck.rotation)
    pose = float(base.position[0]), float(base.position[1]), base.yaw
    closed = footprint_discs(pose, theirs.half_length, theirs.half_width, mine.half_width + _BESIDE / 2)
    return outdoor_path(run, robot, goal, np.array(closed))


Array = NDArray[np.float64]


#: Metres from the base's middle to what the hand reaches for, tried one after the other; how exact that is.
STANDOFFS, _EXACT = (0.60, 0.54, 0.66), 0.03
#: Metres the hand lifts; room beside a thing for each finger.
LIFT, ROOM = 0.16, 0.02
# Tilts of the hand that are tried, rad.
_TILTS = (0.0, 0.25, -0.25, 0.5, -0.5)
_NEAR = 1.1  # m from the base's middle at which a target is near enough to align with it
_NEAR_ENOUGH = 2.2  # m of the same for who has to wait for others
_STRAIGHT = 0.25  # m/s at most while it aligns
_TURN = 0.9  # rad/s at most while it aligns
_DONE = {TaskKind.PICK: "picked", TaskKind.PLACE: "placed", TaskKind.OFFER: "handed_over"}
# Metres before a person, and above the ground there, that things are held out to them.
_ARM_LENGTH, _HELD_OUT = 0.45, 0.95
_LOW = 0.05  # metres below where things are carried that make a hand low
_GRIP_TIME = 1.2  # s that fingers take to close or open
_STALE = 25.0  # s in one stage after which a task has failed
_SETTLED = 0.02  # rad from the end of the arm's way at which it is there
# Metres from the base's middle in which what is in the hand can be, and that the hand may be out of its box.
_REACH, _ABOUT = 1.5, 0.05
_PEOPLE = 0.9  # metres ahead of the base in which nobody may be


def arm_tasks_of(run: RobotRun, robot: int) -> tuple[ArmTasks, int, Array] | None:
    """Return the work a robot is part of, its row in that, and its controller's memory; None without an arm."""
    for group, work, memory in zip(run.scene.groups, run.work, run.memory, strict=True):
        if work is not None and robot in group.robots:
            row = work.row(robot)
            return work, row, memory[row]
    return None


def _arm_tasks(run: RobotRun, robot: int, what: str) -> tuple[ArmTasks, int, Array]:
    found = arm_tasks_of(run, robot)
    if found is None:
        raise InputError(f"{what}: {run.scene.models[robot].title} has no arm")
    return found


# Commands.


def begin_task(run: RobotRun, robot: int, kind: TaskKind, target: Array, entity: int = 0) -> None:
    """Begin a task.

    Raises
    ------
    InputError
        If the robot has no arm.
    """
    work, row, _ = _arm_tasks(run, robot, kind.name.lower())
    abandon_task(run, robot)
    a = work.arrays
    a.kind[row], a.entity[row], a.target[row] = kind, entity, target
    a.stage[row] = TaskStage.RAISE if kind == TaskKind.PLACE and not _is_raised(run, robot, work) else TaskStage.GO
    a.timer[row], a.tries[row] = 0.0, 0
    work.ways[row] = work.no_way()
    run.set_mode(robot, RobotMode.TASK)
    path = None
    if kind == TaskKind.PLACE and entity:
        path = path_beside_deck(run, robot, entity)
    elif float(np.hypot(*(target - run.position(robot))[:2])) > _NEAR:
        path = outdoor_path(run, robot, target)
    if path is not None:
        run.followers[robot].begin(path)


def begin_offer(run: RobotRun, robot: int, person: Array) -> None:
    """Begin to hold out what is held to a person who stands at a point.

    Raises
    ------
    InputError
        If the robot has no arm.
    """
    away = run.position(robot)[:2] - person[:2]
    away = away / max(float(np.hypot(*away)), 1e-6)
    begin_task(run, robot, TaskKind.OFFER, person + np.array([*(away * _ARM_LENGTH), _HELD_OUT]))


def abandon_task(run: RobotRun, robot: int) -> None:
    """Leave a task, or motor commands: the arm stays where it is, and holds what it holds."""
    found = arm_tasks_of(run, robot)
    if found is not None:
        work, row, memory = found
        work.arrays.kind[row] = TaskKind.NOTHING
        if run.arrays.mode[robot] == RobotMode.MOTORS:
            rest = work.model.rest
            memory[ARM_NOW] = run.arrays.command[robot, : len(rest)] - rest
            work.arrays.held[row] = _object_between_fingers(run, robot, work)
        memory[ARM_GOAL] = memory[ARM_NOW]


def object_in_hand(run: RobotRun, robot: int) -> int:
    """Entity of the thing that a robot's hand holds; 0 for none. What slipped out, or was taken, is held no more."""
    found = arm_tasks_of(run, robot)
    if found is None:
        return 0
    work, row, _ = found
    if run.oracle is not None and run.oracle.entity[robot]:
        return int(run.oracle.entity[robot])
    if run.arrays.mode[robot] == RobotMode.MOTORS:
        return int(_object_between_fingers(run, robot, work)[0])
    held = work.arrays.held[row]
    thing = _object(run, int(held[0])) if held[0] else None
    # Of a thing that is being handed over its taker says so.
    if thing is not None and work.arrays.kind[row] not in (TaskKind.PLACE, TaskKind.OFFER):
        objects, k = thing
        if objects.holder[k] or _depth_below_hand(run, robot, work, objects, k) is None:
            held[:] = 0.0
    return int(held[0])


def _object_between_fingers(run: RobotRun, robot: int, work: ArmTasks) -> tuple[float, float]:
    """Return what all fingers touch and is between them, and how far its underside is below the grip; else zeros."""
    links, contacts = run.engine.link_names(robot), run.engine.contacts()
    fingers = [contacts.objects_at(robot, links.index(name)) for name in work.model.sensors.contacts]
    if not fingers or not set.intersection(*fingers):
        return 0.0, 0.0
    objects = run.objects
    near = np.hypot(*(objects.position[:, :2] - run.position(robot)[:2]).T) < _REACH
    for k in np.flatnonzero(near & (objects.holder == 0)).tolist():
        depth = _depth_below_hand(run, robot, work, objects, k)
        if depth is not None:
            return float(objects.entity[k]), depth
    return 0.0, 0.0


def can_grasp(run: RobotRun, robot: int, size: Array) -> bool:
    """Return whether a jaw is wide enough for the narrower of a thing's level sides."""
    work, _, _ = _arm_tasks(run, robot, "pick")
    return float(np.min(size[:2])) / 2 + ROOM <= work.opening


def handled_object(run: RobotRun, robot: int) -> int:
    """Entity of the thing that a robot holds or is about to pick, which is not in its way; 0 for none."""
    found = arm_tasks_of(run, robot)
    if found is None:
        return 0
    work, row, _ = found
    held = object_in_hand(run, robot)
    picking = int(work.arrays.entity[row]) if work.arrays.kind[row] == TaskKind.PICK else 0
    return held or picking


# Decisions.


def decide_task(run: RobotRun, robot: int, everybody: Bodies, dt: float) -> bool:
    """Go on with a robot's task; return whether it is still driving to where that is."""
    found = arm_tasks_of(run, robot)
    assert found is not None
    work, row, memory = found
    a = work.arrays
    run.arrays.status[robot] = RobotStatus.MOVING
    stage = TaskStage(int(a.stage[row]))
    if stage == TaskStage.RAISE and not len(work.ways[row]):
        work.ways[row] = path_to_carry(work.chain, memory[ARM_NOW][:7] + work.model.rest[:7])
        a.point[row] = 0
    if stage == TaskStage.GO:
        away = float(np.hypot(*(a.target[row] - run.position(robot))[:2]))
        waits = run.followers[robot].status == RobotStatus.WAITING and away < _NEAR_ENOUGH
        # A way beside a deck is gone to its end.
        if a.kind[row] == TaskKind.PLACE and a.entity[row]:
            away, waits = math.inf, False
        if away > _NEAR and len(run.followers[robot].path) and not waits:
            return True
        run.followers[robot].end()
        _next(work, row, TaskStage.ALIGN)
        return False
    a.timer[row] += dt
    if a.timer[row] > _STALE:
        _finish(run, robot, work, row, "failed")
        return False
    if stage == TaskStage.ALIGN:
        _align(run, robot, work, row, everybody)
    elif stage == TaskStage.PLAN:
        _plan(run, robot, work, row, memory)
    elif stage == TaskStage.GRIP and a.kind[row] == TaskKind.OFFER:
        _wait_for_taker(run, work, row, memory)
    elif stage == TaskStage.GRIP:
        # Close past the thing, against the fingers' largest force, or open; then lift.
        memory[ARM_GOAL][7:] = 0.0 if a.kind[row] == TaskKind.PICK else work.opening
        if a.timer[row] > _GRIP_TIME:
            _next(work, row, TaskStage.LIFT)
    else:
        _move(run, robot, work, row, memory)
    return False


def _is_raised(run: RobotRun, robot: int, work: ArmTasks) -> bool:
    """Return whether the hand is as high as things are carried: somebody may want them put down before they are."""
    poses = np.empty((7, 3)), np.empty((7, 3)), np.empty((3, 4))
    hand_pose(work.chain, run.engine.joints(robot)[0][:7].copy(), *poses)
    return float(poses[2][2, 3]) > CARRY[2] - _LOW


def _next(work: ArmTasks, row: int, stage: TaskStage) -> None:
    work.arrays.stage[row], work.arrays.timer[row] = stage, 0.0


def _finish(run: RobotRun, robot: int, work: ArmTasks, row: int, what: str) -> None:
    run.note(robot, what)
    abandon_task(run, robot)
    run.arrays.mode[robot] = RobotMode.IDLE
    run.arrays.status[robot] = RobotStatus.ARRIVED if what != "failed" else RobotStatus.BLOCKED


def _in_base(base: Base, point: Array) -> Array:
    """Return a point in the frame of the base."""
    return np.asarray(apply_matrix(point - base.position, base.rotation.T))


def _align(run: RobotRun, robot: int, work: ArmTasks, row: int, everybody: Bodies) -> None:
    """Turn to the target and stand so far off it that the arm reaches it."""
    a, base = work.arrays, run.engine.base(robot)
    x, y, _ = _in_base(base, a.target[row])
    standoff = STANDOFFS[int(a.tries[row]) % len(STANDOFFS)]
    error = math.atan2(y, x)
    missing = math.hypot(x, y) - standoff
    velocity = run.arrays.velocity[robot]
    if abs(error) > 0.08:
        velocity[2] = min(max(1.5 * error, -_TURN), _TURN)
    elif abs(missing) > _EXACT:
        velocity[0] = min(max(1.0 * missing, -_STRAIGHT), _STRAIGHT)
        velocity[2] = 1.0 * error
        if velocity[0] > 0.0 and _somebody_ahead(run, robot, base, everybody):
            velocity[:] = 0.0
            run.arrays.status[robot] = RobotStatus.WAITING
    elif abs(float(base.velocity[0])) + abs(float(base.velocity[1])) < 0.02:
        _next(work, row, TaskStage.PLAN)


def _somebody_ahead(run: RobotRun, robot: int, base: Base, everybody: Bodies) -> bool:
    ahead = base.position[:2] + base.rotation[:2, 0] * _PEOPLE / 2
    away = distances(everybody.position[:, :2], ahead) - everybody.half_length
    return bool(np.any((away < _PEOPLE / 2) & everybody.person))


def _object(run: RobotRun, entity: int) -> tuple[MovableObjects, int] | None:
    objects = run.objects
    found = np.flatnonzero(objects.entity == entity)
    return (objects, int(found[0])) if len(found) else None


def _plan(run: RobotRun, robot: int, work: ArmTasks, row: int, memory: Array) -> None:
    """Plan the arm's way from where the base stands now, or try another standoff."""
    a, base = work.arrays, run.engine.base(robot)
    kind = TaskKind(int(a.kind[row]))
    if kind == TaskKind.PLACE and a.entity[row]:
        spot = deck_spot(run, robot, int(a.entity[row]))
        if spot is not None:
            a.target[row] = spot
    goals = _goals(run, work, row, base, kind)
    opening = work.opening
    if goals is not None and kind == TaskKind.PICK:
        goals, opening = goals[:-1], goals[-1][0, 3]
    now = work.model.rest[:7] + memory[ARM_NOW][:7]
    way: tuple[Array, int] | None = None
    if goals is not None and kind in (TaskKind.PICK, TaskKind.PLACE):
        way = path_down(work.chain, now, goals, holds=kind == TaskKind.PLACE)
    elif goals is not None:
        reached = (reach_pose(work.chain, goal, now) for goal in goals)
        way = next(((angles[None], 0) for angles in reached if angles is not None), None)
    if way is None:
        a.tries[row] += 1
        if a.tries[row] >= len(STANDOFFS):
            _finish(run, robot, work, row, "failed")
        else:
            _next(work, row, TaskStage.ALIGN)
        return
    work.ways[row], a.turn_at[row] = way
    a.point[row] = 0
    if kind == TaskKind.PICK:
        memory[ARM_GOAL][7:] = opening
    _next(work, row, TaskStage.MOVE)


def _goals(run: RobotRun, work: ArmTasks, row: int, base: Base, kind: TaskKind) -> list[Array] | None:
    """Poses of the hand that would do, in the base's frame; of a pick last one with the opening in its corner."""
    a = work.arrays
    target = a.target[row]
    if kind == TaskKind.PICK:
        found = _object(run, int(a.entity[row]))
        return None if found is None else _grasps(work, base, *found)
    if kind == TaskKind.PLACE:
        target = target + np.array([0.0, 0.0, a.held[row, 1] + 0.01])
    at = _in_base(base, target)
    out = at[:2] / max(float(np.hypot(*at[:2])), 1e-6)
    aside = np.array([-out[1], out[0]])
    return [downward(at, aside * sign, tilt) for tilt in _TILTS for sign in (1.0, -1.0)]


def _grasps(work: ArmTasks, base: Base, objects: MovableObjects, k: int) -> list[Array] | None:
    """Grasps of a thing from above, across its narrower side first."""
    turn = rotation_matrix(objects.orientation[k])
    size = objects.size[k]
    middle = objects.position[k] + turn[:, 2] * size[2] / 2
    upright = int(np.abs(turn[2]).argmax())
    sides = sorted((axis for axis in range(3) if axis != upright), key=lambda axis: float(size[axis]))
    half = float(size[upright]) / 2
    # The pads, 7 cm high, hold the upper part of what is high, and do not touch the ground beside what is low.
    grip = np.array([0.0, 0.0, max(half - 0.06, 0.035 + 0.01 - half)]) + middle
    found: list[Array] = []
    for axis in sides:
        opening = float(size[axis]) / 2 + ROOM
        if opening > work.opening:
            continue
        along = apply_matrix(turn[:, axis], base.rotation.T)[:2]
        along = along / max(float(np.hypot(*along)), 1e-6)
        at = _in_base(base, grip)
        found += [downward(at, along * sign, tilt) for tilt in _TILTS for sign in (1.0, -1.0)]
        last = np.zeros((3, 4))
        last[0, 3] = opening
        return [*found, last]
    return None


def _move(run: RobotRun, robot: int, work: ArmTasks, row: int, memory: Array) -> None:
    """Go along the arm's way; close or open where it is down, and end where it ends."""
    a, way = work.arrays, work.ways[row]
    point, stage = int(a.point[row]), int(a.stage[row])
    rest = work.model.rest[:7]
    end = int(a.turn_at[row]) if stage == TaskStage.MOVE else len(way) - 1
    now = memory[ARM_NOW][:7] + rest
    # As far ahead as is gone until this is asked again.
    while point < end and float(np.abs(way[point] - now).max()) < 0.06:
        point += 1
    a.point[row] = point
    memory[ARM_GOAL][:7] = way[point] - rest
    angles = run.engine.joints(robot)[0][:7]
    there = point == end and float(np.abs(way[end] - angles).max()) < _SETTLED
    if not there:
        return
    kind = TaskKind(int(a.kind[row]))
    if stage == TaskStage.RAISE:
        _next(work, row, TaskStage.GO)
    elif stage == TaskStage.MOVE and kind == TaskKind.REACH:
        _finish(run, robot, work, row, "reached")
    elif stage == TaskStage.MOVE:
        _next(work, row, TaskStage.GRIP)
    elif stage == TaskStage.LIFT:
        _after_lift(run, robot, work, row, memory, kind)
    else:
        _finish(run, robot, work, row, _DONE[kind])


def _wait_for_taker(run: RobotRun, work: ArmTasks, row: int, memory: Array) -> None:
    """Hold on until somebody else holds the thing; then open."""
    a = work.arrays
    found = _object(run, int(a.held[row, 0]))
    own = run.entities[int(work.robots[row])]
    if found is not None and found[0].holder[found[1]] in (0, own):
        return
    memory[ARM_GOAL][7:] = work.opening
    a.held[row] = 0.0
    _next(work, row, TaskStage.LIFT)


def _after_lift(run: RobotRun, robot: int, work: ArmTasks, row: int, memory: Array, kind: TaskKind) -> None:
    """Look whether the thing came along, or stayed; bring the arm to where it is carried."""
    a = work.arrays
    if kind in (TaskKind.PLACE, TaskKind.OFFER):
        a.held[row] = 0.0
        memory[ARM_GOAL][7:] = 0.0
        work.ways[row] = work.model.rest[None, :7].copy()
    else:
        found = _object(run, int(a.entity[row]))
        depth = None if found is None else _depth_below_hand(run, robot, work, *found)
        if found is None or depth is None:
            memory[ARM_GOAL][7:] = work.opening
            a.tries[row] += 1
            a.held[row] = 0.0
            if a.tries[row] >= len(STANDOFFS):
                _finish(run, robot, work, row, "failed")
            else:
                _next(work, row, TaskStage.ALIGN)
            return
        a.held[row] = float(a.entity[row]), depth
        work.ways[row] = path_to_carry(work.chain, memory[ARM_NOW][:7] + work.model.rest[:7])
    a.point[row] = 0
    _next(work, row, TaskStage.TUCK)


def _depth_below_hand(run: RobotRun, robot: int, work: ArmTasks, objects: MovableObjects, k: int) -> float | None:
    """How far a held thing's underside is below the grip, metres; None if it is not between the fingers."""
    base = run.engine.base(robot)
    poses = np.empty((7, 3)), np.empty((7, 3)), np.empty((3, 4))
    hand_pose(work.chain, run.engine.joints(robot)[0][:7].copy(), *poses)
    hand = apply_matrix(poses[2][:, 3], base.rotation) + base.position
    lies, half = rotation_matrix(objects.orientation[k]), objects.size[k] / 2
    middle = objects.position[k] + lies[:, 2] * half[2]
    # Long things are not held by their middle.
    if np.any(np.abs(apply_matrix(hand - middle, lies.T)) > half + _ABOUT):
        return None
    return float(hand[2] - (middle[2] - (np.abs(lies[2]) * half).sum()))
