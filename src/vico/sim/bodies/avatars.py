"""Avatars in motion: what an action asked for is walked out over the sub-steps of the second."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.rules import STAIRS_SPEED, ActionStatus, ReasonCode
from vico.sim.animation import CLIPS, LONGEST_BLEND
from vico.sim.animation.clips import is_gait
from vico.sim.animation.gait import RUN_START, WALK_START
from vico.sim.animation.motions import pace_of_step, stride_of
from vico.sim.animation.postures import TURN_CYCLE, TURN_START
from vico.sim.bodies.arrays import Bodies
from vico.sim.bodies.collisions import SolidMap, sweep
from vico.sim.bodies.footprints import IN_BUS, Rectangle, concatenate_records, gaps, records_of
from vico.sim.bodies.rooms import Indoor
from vico.sim.bodies.state_arrays import RADIUS, RIDER_REACH, People, Posture, Vehicle
from vico.world.heights import HeightField
from vico.world.walkable import WalkableMap

CLIP = {name: i for i, name in enumerate(CLIPS)}

_CYCLES_PER_SECOND = 0.5
_STANDING, _FASTEST_WALK = 0.01, 1.6  # m/s
_SAME_PACE = 0.02  # m/s by which another speed asks for other strides
# As plain numbers, for kernels.
_IDLE, _SIT, _SLEEP, _TURN, _WALK, _RUN, _CARRY, _RIDE_BIKE, _RIDE_BUS, _STAND = (
    CLIP[name] for name in ("idle", "sit", "sleep", "turn", "walk", "run", "carry", "ride_bike", "ride_bus", "stand")
)
_CARRY_LEFT, _CARRY_RIGHT = CLIP["carry_left"], CLIP["carry_right"]
# What a gesture is on a chair: most are made there too, for others one stays seated; who gets in sits down after it.
_ON_A_CHAIR = np.array([CLIP.get(f"sit_{name}", _SIT) for name in CLIPS])
_ON_A_CHAIR[CLIP["enter_vehicle"]] = CLIP["enter_vehicle"]
# Whether a motion is brought to an end once it has begun (that of no clip, -1, is the last), and where in it that is.
_FINISHED = np.isin(np.arange(len(CLIP) + 1), [CLIP[name] for name in ("drink", "eat", "talk")])
_DONE = 0.95
_STANDING_UP, _SITTING = int(Posture.STANDING), int(Posture.SITTING)
_IN_BUS, _ON_BIKE = int(Vehicle.BUS), int(Vehicle.BIKE)


class _Motion(NamedTuple):
    """What decides which clip shows somebody; columns of `People`."""

    velocity: NDArray[np.float64]
    move_speed: NDArray[np.float64]
    turned: NDArray[np.float64]
    posture: NDArray[np.int8]
    vehicle: NDArray[np.int8]
    held: NDArray[np.int32]
    action_clip: NDArray[np.int16]
    height: NDArray[np.float64]
    tread: NDArray[np.float64]  # of the stairs they are on, metres; 0 elsewhere


class _Clips(NamedTuple):
    """Which clip shows somebody, and which did before; columns of `People`."""

    clip: NDArray[np.int16]
    phase: NDArray[np.float64]
    pace: NDArray[np.float64]
    clip_before: NDArray[np.int16]
    phase_before: NDArray[np.float64]
    pace_before: NDArray[np.float64]
    clip_time: NDArray[np.float64]


class Avatars:
    """Moves the people of a run.

    Parameters
    ----------
    people
        Their arrays; changed in place.
    indoor, walkable, height
        Where walls, furniture, free ground are, and how high the ground is.

    Attributes
    ----------
    solids
        What never moves, as the sweep takes it.
    """

    def __init__(self, people: People, indoor: Indoor, walkable: WalkableMap, height: HeightField) -> None:
        self.people = people
        self._indoor = indoor
        self._walkable = walkable
        self._height = height
        # A room may be missing altogether, but numba wants arrays of the right shape.
        self.solids = SolidMap(
            np.ascontiguousarray(walkable.clearance),
            walkable.half,
            indoor.boxes if len(indoor.boxes) else np.zeros((1, 5)),
            indoor.furniture,
            indoor.furniture_start if len(indoor.boxes) else np.zeros(2, np.int64),
        )

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Everything that decides what avatars do next."""
        return self.people.arrays()

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        self.people.restore(arrays)

    def bodies(self) -> Bodies:
        """Bodies outdoors."""
        return self.people.bodies()

    def begin(self, who: NDArray[np.bool_]) -> None:
        """Start the step of some avatars: they want nothing yet, and nothing has gone wrong."""
        p = self.people
        through = p.at_door()  # these go on
        p.move_left[who] = 0.0
        p.turn_left[who] = 0.0
        p.move_speed[who] = 0.0
        p.velocity[who] = 0.0
        p.status[who] = ActionStatus.OK
        p.contact[who] = 0
        p.reason[who] = ""
        p.reason_code[who] = ReasonCode.NONE
        # Who has a cup at the mouth puts it down again, and who has turned to somebody talks, unless they do otherwise.
        begun = (p.clip == _TURN) | ((p.phase > 1.0 - _DONE) & (p.phase < _DONE))
        goes_on = _FINISHED[p.action_clip] & begun
        p.action_clip[who & ~goes_on & ~through] = -1

    def space(self) -> NDArray[np.int32]:
        """Return the room each avatar is in, `OUTDOORS` or `IN_BUS`: only those of one space can touch."""
        return np.where(self.people.vehicle == _IN_BUS, IN_BUS, self.people.room).astype(np.int32)

    def advance(
        self,
        dt: float,
        obstacles: NDArray[np.void],
        *,
        share: NDArray[np.float64],
        carried: tuple[NDArray[np.int64], NDArray[np.float64]] | None = None,
    ) -> None:
        """Turn and walk on by `dt` seconds.

        Parameters
        ----------
        obstacles
            Bodies that are no avatars, in the street and in rooms, dtype `vico.sim.bodies.footprints.BODY`.
        share
            Which part of each avatar's remaining turn belongs to this sub-step (1 in the last one of its action),
            shape ``(n,)``.
        carried
            Who was already moved in this sub-step, and how fast, m/s, shapes ``(k,)`` and ``(k, 2)``.
        """
        p = self.people
        if not len(p):
            return
        moving = (p.move_left > 0.0) | (p.turn_left != 0.0)
        p.velocity[:] = 0.0
        turned = np.zeros(len(p))
        tread = self.treads()
        if moving.any():
            # Turning comes first, within the first half of the second, so that a walk starts in the new direction.
            turn = p.turn_left * share
            pace = np.where(tread > 0.0, np.minimum(STAIRS_SPEED, p.move_speed), p.move_speed)
            distance = np.minimum(p.move_left, pace * dt)
            before = p.position[:, :2].copy()
            bodies = concatenate_records([records_of(p.bodies_of(slice(None)), self.space()), obstacles])
            moved, contact = sweep(distance, turn, p.yaw, bodies, self.solids)
            p.position[:, 0], p.position[:, 1] = bodies["x"][: len(p)], bodies["y"][: len(p)]
            turned = turn
            hit = contact != 0
            p.turn_left -= turn
            p.move_left -= moved
            p.move_left[hit | (p.move_left < 1e-9)] = 0.0
            p.turn_left[hit] = 0.0
            p.status[hit] = ActionStatus.COLLISION
            p.contact[hit] = contact[hit]
            p.velocity[:] = (p.position[:, :2] - before) / dt
            self.settle((moved > 0.0).nonzero()[0])
        if carried is not None:
            p.velocity[carried[0]] = carried[1]
        self._animate(turned, tread, dt)

    def treads(self) -> NDArray[np.float64]:
        """Return how deep the treads of the stairs are that avatars walk on, metres, shape ``(n,)``; 0 elsewhere."""
        p = self.people
        found = self._indoor.treads_under(p.room)
        if self._height.stairs is None:
            return found
        afoot = (p.room < 0) & (p.vehicle == Vehicle.NONE)
        return np.where(afoot, self._height.going_at(p.position), found)

    def settle(self, who: NDArray[np.int64]) -> None:
        """Put feet on the ground or the floor."""
        p = self.people
        in_room = p.room[who] >= 0
        outdoors, indoors = who[~in_room], who[in_room]
        if len(outdoors):
            p.position[outdoors, 2] = self._height(p.position[outdoors, :2])
        if len(indoors):
            p.position[indoors, 2] = self._indoor.floors_at(p.room[indoors], p.position[indoors])

    def _animate(self, turned: NDArray[np.float64], tread: NDArray[np.float64], dt: float) -> None:
        p = self.people
        doing = p.posture, p.vehicle, p.held, p.action_clip
        motion = _Motion(p.velocity, p.move_speed, turned, *doing, p.height, tread)
        before = p.clip_before, p.phase_before, p.pace_before, p.clip_time
        _advance_clips(motion, _Clips(p.clip, p.phase, p.pace, *before), dt)


@compiled
def _clip_of(motion, k, speed):
    """Return the clip that shows what somebody does, at a speed over the ground in m/s."""
    if motion.vehicle[k] == _ON_BIKE:
        return _RIDE_BIKE
    if speed > _STANDING:
        if motion.move_speed[k] > _FASTEST_WALK and motion.tread[k] == 0.0:
            return _RUN
        left, right = motion.held[k, 0] > 0, motion.held[k, 1] > 0
        if left and right:
            return _CARRY
        if left:
            return _CARRY_LEFT
        return _CARRY_RIGHT if right else _WALK
    sits = motion.posture[k] == _SITTING
    if motion.action_clip[k] >= 0 and (sits or motion.turned[k] == 0.0):
        return _ON_A_CHAIR[motion.action_clip[k]] if sits else np.int64(motion.action_clip[k])
    if motion.vehicle[k] == _IN_BUS:
        return _RIDE_BUS if sits else _STAND
    if motion.posture[k] == _STANDING_UP:
        return _TURN if motion.turned[k] != 0.0 else _IDLE
    return _SIT if sits else _SLEEP


@compiled
def _begin_clip(clips, k, now, pace):
    """Begin another clip: gaits go on from the feet, the others from their start."""
    was = clips.clip[k]
    clips.clip_before[k], clips.phase_before[k], clips.pace_before[k] = was, clips.phase[k], clips.pace[k]
    clips.clip[k], clips.clip_time[k] = now, 0.0
    if is_gait(now):
        clips.pace[k] = pace
    if is_gait(now) and is_gait(was):
        return
    start = 0.0
    if is_gait(now):
        start = RUN_START if now == _RUN else WALK_START
        if was == _TURN and clips.phase[k] > 0.5:
            start += 0.5  # the left foot is in the air: the right one is below the hips
    elif now == _TURN:
        start = TURN_START
    clips.phase[k] = start


@compiled
def _advance_clips(motion, clips, dt):
    """Choose everybody's clip and go on in it by `dt` seconds; `clips` are changed in place."""
    for k in range(len(clips.clip)):
        vx, vy = motion.velocity[k, 0], motion.velocity[k, 1]
        speed = math.sqrt(vx * vx + vy * vy)
        now = _clip_of(motion, k, speed)
        # Whom something stops, or who arrives, takes a shorter way in this sub-step, not shorter strides.
        pace = max(motion.move_speed[k], speed)
        if motion.tread[k] > 0.0:
            pace = pace_of_step(motion.tread[k], motion.height[k])
        if now != clips.clip[k] or (is_gait(now) and abs(pace - clips.pace[k]) > _SAME_PACE):
            _begin_clip(clips, k, now, pace)
        clips.clip_time[k] = min(clips.clip_time[k] + dt, LONGEST_BLEND)
        stride = stride_of(now, clips.pace[k], motion.height[k])
        if now == _TURN:
            on = motion.turned[k] / TURN_CYCLE
        else:
            on = dt * _CYCLES_PER_SECOND if stride == np.inf else speed * dt / stride
        clips.phase[k] = (clips.phase[k] + on) % 1.0


def free_ground(
    walkable: WalkableMap,
    near: NDArray[Any],
    bodies: Bodies,
    *,
    within: float = 2.0,
    connected: bool = True,
) -> NDArray[np.float64] | None:
    """Spot outdoors nearest to a point where someone can appear: on free ground, clear of every body.

    Returns
    -------
    ndarray or None
        ENU metres, shape ``(2,)``; None if there is no such spot within `within` metres.
    """
    point = np.asarray(near, np.float64)[:2]
    reach = int(np.ceil(within / walkable.cell))
    ix, iy = walkable.cell_of(point)
    columns = np.arange(max(0, ix - reach), min(walkable.n, ix + reach + 1))
    rows = np.arange(max(0, iy - reach), min(walkable.n, iy + reach + 1))
    cells = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    allowed = walkable.connected if connected else walkable.cls > 0
    spots = walkable.centre_of(cells[allowed[cells[:, 1], cells[:, 0]]])
    if float(walkable.clearance_at(point)) >= 0.3 and bool(walkable.inside(point)):
        spots = np.vstack([point[None], spots])
    spots = spots[np.abs(spots).max(axis=1) < walkable.half - 0.3] if len(spots) else spots
    away = np.hypot(*(spots - point).T) if len(spots) else np.zeros(0)
    for k in np.argsort(away, kind="stable"):
        if away[k] > within:
            return None
        if not len(bodies) or clearances(spots[k], bodies).min() > RADIUS + 0.05:
            return np.asarray(spots[k], np.float64)
    return None


def cyclist_fits(walkable: WalkableMap, position: NDArray[Any], yaw: float, bodies: Bodies) -> bool:
    """Return whether a cyclist at a position would be clear of the map's solids and of some bodies."""
    x, y = float(position[0]), float(position[1])
    core = Rectangle(x, y, math.cos(yaw), math.sin(yaw), RIDER_REACH, 0.0)
    along = np.linspace(-RIDER_REACH, RIDER_REACH, 7)[:, None] * np.array([core.cos, core.sin])
    spots = np.array([x, y]) + along
    if float(walkable.clearance_at(spots).min()) < 0.28 or not bool(walkable.inside(spots).all()):
        return False
    return not len(bodies) or float(gaps(core, records_of(bodies)).min()) > RADIUS + 0.01


def clearances(point: NDArray[Any], bodies: Bodies) -> NDArray[np.float64]:
    """Distance from a point to the outline of each body, metres; negative inside."""
    rounding = bodies.rounding
    d = np.asarray(point, np.float64)[:2] - bodies.position[:, :2]
    c, s = np.cos(bodies.yaw), np.sin(bodies.yaw)
    u = np.abs(c * d[:, 0] + s * d[:, 1]) - (bodies.half_length - rounding)
    v = np.abs(-s * d[:, 0] + c * d[:, 1]) - (bodies.half_width - rounding)
    outside = np.hypot(np.maximum(u, 0.0), np.maximum(v, 0.0))
    return np.where((u > 0.0) | (v > 0.0), outside, np.maximum(u, v)) - rounding
