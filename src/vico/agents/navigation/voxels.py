"""Voxels of what depth pictures showed around the agent, 0.1 m each, and the room they leave to walk in.

The compiled loops add what is seen, clear what is seen through, and count the room around columns.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.agents.base import HEADING_SLICE, AgentState
from vico.exact import dot
from vico.io.compiled import compiled

#: Side of a voxel, metres, and how many make a metre.
VOXEL, PER_METRE = 0.1, 10
#: Columns along the side of a chunk, and chunks along the side of what is kept: powers of 2, for both wrap around.
CHUNK, CHUNKS = 32, 16
SIDE = CHUNK * CHUNKS
#: Levels of a column, and which is the floor where a floor is known: its middle lies there.
LEVELS, FLOOR = 64, 1
#: In the way is what lies between so many levels above the floor: 0.15 to 1.85 m.
HEAD = 18
#: Of a chunk without a known floor.
UNKNOWN = -1

#: What moves is taken to be where it was seen for so many seconds, and what one bumped into for so many.
FADES, BUMP_LASTS = 4, 900
#: Squared distances, in voxels, up to which a column counts as touching something, as near it, and as beside it.
TOUCHING = 4
NEAR = 8
BESIDE = 20
_REACH = 4  # the root of the last one, rounded down
#: Costs of a step onto a cell: free, not seen yet, beside something, near something; 0 is blocked.
FREE_COST = 10
UNSEEN_COST = 11
BESIDE_COST = 16
NEAR_COST = 40

_PUSH = 0.03  # metres along the ray: a surface on the border of two columns counts for the one behind it
_EDGE = 0.15  # metres behind a voxel that a pixel must be to have been seen through it
_RADIUS = 0.09  # of a voxel, metres
_NEAREST = 0.3  # metres before the eye within which nothing is cleared

MOVES, IGNORED = 1, 2


class Voxels(NamedTuple):
    """What is kept of some 51 m around; indices wrap around.

    Attributes
    ----------
    mask
        Which levels of a column hold something, one bit each, uint64, shape ``(SIDE, SIDE)``, ``[iy, ix]``.
    until
        Second up to which a column counts as taken by what moves or stopped a step, int64, shape ``(SIDE, SIDE)``.
    ground
        Level of the floor in a column, `UNKNOWN` where it is to be found from the column, int8, shape ``(SIDE, SIDE)``.
    solid
        Whether a column is in the way, uint8, shape ``(SIDE, SIDE)``: as it was counted.
    counts
        How many columns in the way touch a column, are near, are beside it; uint8, shape ``(SIDE, SIDE, 3)``.
    cost
        Of a step onto a column, 0 where it is blocked, uint8, shape ``(SIDE, SIDE)``.
    key
        Column and row of the chunk that lies in a place, int64, shape ``(CHUNKS, CHUNKS, 2)``.
    base
        Height of a chunk's lowest level's lower side, metres, float64, shape ``(CHUNKS, CHUNKS)``.
    flags
        Whether a chunk is there, changed, and has columns with a time to look at; bool, shape ``(CHUNKS, CHUNKS, 3)``.
    """

    mask: NDArray[np.uint64]
    until: NDArray[np.int64]
    ground: NDArray[np.int8]
    solid: NDArray[np.uint8]
    counts: NDArray[np.uint8]
    cost: NDArray[np.uint8]
    key: NDArray[np.int64]
    base: NDArray[np.float64]
    flags: NDArray[np.bool_]


THERE, CHANGED, TIMED = range(3)


def empty_voxels() -> Voxels:
    """Return voxels that know nothing."""
    whole = (SIDE, SIDE)
    return Voxels(
        np.zeros(whole, np.uint64),
        np.zeros(whole, np.int64),
        np.full(whole, UNKNOWN, np.int8),
        np.zeros(whole, np.uint8),
        np.zeros((*whole, 3), np.uint8),
        np.full(whole, UNSEEN_COST, np.uint8),
        np.zeros((CHUNKS, CHUNKS, 2), np.int64),
        np.zeros((CHUNKS, CHUNKS)),
        np.zeros((CHUNKS, CHUNKS, 3), np.bool_),
    )


class Camera(NamedTuple):
    """A picture's lens and place.

    Attributes
    ----------
    lens
        Focal lengths and centre, ``fx, fy, cx, cy``, pixels.
    rotation, shift
        World to camera, shapes ``(3, 3)`` and ``(3,)``.
    """

    lens: NDArray[np.float64]
    rotation: NDArray[np.float64]
    shift: NDArray[np.float64]


@compiled
def add_points(voxels, depth, segmentation, camera, special, limits):
    """Enter every `limits[0]`-th pixel's point up to `limits[1]` metres off; what moves until `limits[2]`.

    Where the ground is unknown, what lies above `limits[3]`, the eye, is left out: nobody sees a floor from below.
    `special`: entities, ascending, and whether each `MOVES` or is `IGNORED`, int64, shape ``(k, 2)``.
    """
    step, reach, until, eye = int(limits[0]), limits[1], np.int64(limits[2]), limits[3]
    height, width = depth.shape
    fx, fy, cx, cy = camera.lens
    rotation, shift = camera.rotation, camera.shift
    before, what = -1, 0
    for row in range(0, height, step):
        for column in range(0, width, step):
            z = np.float64(depth[row, column])
            if z <= 0.0 or z > reach:
                continue
            entity = segmentation[row, column]
            if entity != before:
                before, what = entity, _kind_of(entity, special)
            if what == IGNORED:
                continue
            z += _PUSH
            x = (column + 0.5 - cx) / fx * z - shift[0]
            y = (row + 0.5 - cy) / fy * z - shift[1]
            z -= shift[2]
            i = math.floor((rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z) * PER_METRE)
            j = math.floor((rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z) * PER_METRE)
            up = rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z
            _enter_column(voxels, i, j, (up, eye), what == MOVES, until)


@compiled(inline="always")
def _kind_of(entity, special):
    for k in range(len(special)):
        if special[k, 0] == entity:
            return special[k, 1]
    return 0


@compiled(inline="always")
def _enter_column(voxels, i, j, heights, moves, until):
    a, b = (i >> 5) & (CHUNKS - 1), (j >> 5) & (CHUNKS - 1)
    if not voxels.flags[b, a, THERE] or voxels.key[b, a, 0] != i >> 5 or voxels.key[b, a, 1] != j >> 5:
        return
    up, eye = heights
    level = math.floor((up - voxels.base[b, a]) * PER_METRE)
    if level < 0 or level >= LEVELS:
        return
    i, j = i & (SIDE - 1), j & (SIDE - 1)
    ground = voxels.ground[j, i]
    if (ground == UNKNOWN and up > eye) or (ground != UNKNOWN and level > ground + HEAD):
        return
    if moves:
        if level > ground + 1:
            voxels.until[j, i] = until
            voxels.flags[b, a, TIMED] = True
        return
    bit = np.uint64(1) << np.uint64(level)
    if not voxels.mask[j, i] & bit:
        voxels.mask[j, i] |= bit
        voxels.flags[b, a, CHANGED] = True


@compiled
def clear_seen_through(voxels, depth, camera, eye, limits):
    """Clear voxels through which a picture shows what lies behind; and what moved on, up to `limits[1]` metres off.

    `limits[2]`: the second up to which what was seen now counts; what is to last longer (bumps) stays.
    """
    reach, until = limits[1], np.int64(limits[2])
    for b in range(CHUNKS):
        for a in range(CHUNKS):
            if not voxels.flags[b, a, THERE]:
                continue
            corner_x = voxels.key[b, a, 0] * CHUNK * VOXEL
            corner_y = voxels.key[b, a, 1] * CHUNK * VOXEL
            half = CHUNK * VOXEL / 2
            away = math.hypot(corner_x + half - eye[0], corner_y + half - eye[1])
            if away > reach + 1.5 * half:
                continue
            for jj in range(CHUNK):
                for ii in range(CHUNK):
                    j, i = b * CHUNK + jj, a * CHUNK + ii
                    if voxels.mask[j, i] == 0 and voxels.until[j, i] == 0:
                        continue
                    x, y = corner_x + (ii + 0.5) * VOXEL, corner_y + (jj + 0.5) * VOXEL
                    if _clear_column(voxels, (j, i, b, a), (x, y), depth, camera, reach, until):
                        voxels.flags[b, a, CHANGED] = True


@compiled(inline="always")
def _clear_column(voxels, place, point, depth, camera, reach, until):
    j, i, b, a = place
    rotation, shift = camera.rotation, camera.shift
    ground = voxels.ground[j, i]
    low, high = (0, LEVELS) if ground == UNKNOWN else (ground + 2, ground + HEAD + 1)
    base = voxels.base[b, a]
    # Where the column meets level 0's middle, in the camera's frame; a level up is `VOXEL` of the camera's up.
    up = base + VOXEL / 2
    x = rotation[0, 0] * point[0] + rotation[0, 1] * point[1] + rotation[0, 2] * up + shift[0]
    y = rotation[1, 0] * point[0] + rotation[1, 1] * point[1] + rotation[1, 2] * up + shift[1]
    z = rotation[2, 0] * point[0] + rotation[2, 1] * point[1] + rotation[2, 2] * up + shift[2]
    top = z + rotation[2, 2] * VOXEL * high
    if max(z, top) < _NEAREST or min(z, top) > reach:
        return False
    changed = False
    for level in range(low, high):
        bit = np.uint64(1) << np.uint64(level)
        if voxels.mask[j, i] & bit:
            rise = level * VOXEL
            if _is_seen_through(
                x + rotation[0, 2] * rise, y + rotation[1, 2] * rise, z + rotation[2, 2] * rise, depth, camera.lens
            ):
                voxels.mask[j, i] &= ~bit
                changed = True
    if 0 < voxels.until[j, i] <= until:
        rise = (max(ground, 0) + 10) * VOXEL
        if _is_seen_through(
            x + rotation[0, 2] * rise, y + rotation[1, 2] * rise, z + rotation[2, 2] * rise, depth, camera.lens
        ):
            voxels.until[j, i] = 0
            changed = True
    return changed


@compiled(inline="always")
def _is_seen_through(x, y, z, depth, lens):
    """Tell whether all of a voxel, given in the camera's frame, lies before what a picture shows there."""
    if z < _NEAREST:
        return False
    u, v = lens[0] * x / z + lens[2], lens[1] * y / z + lens[3]
    size = lens[0] * _RADIUS / z
    u0, v0, u1, v1 = int(u - size), int(v - size), int(u + size), int(v + size)
    if u - size < 0.0 or v - size < 0.0 or u1 >= depth.shape[1] or v1 >= depth.shape[0]:
        return False
    behind = z + _EDGE
    if 0.0 < depth[int(v), int(u)] < behind:
        return False
    for row in (v0, v1):
        for column in (u0, u1):
            if 0.0 < depth[row, column] < behind:
                return False
    return True


@compiled
def count_changes(voxels, now, least):
    """Count anew around the columns that came to be in the way, or ceased to be; `least`: voxels that make it so."""
    for b in range(CHUNKS):
        for a in range(CHUNKS):
            if not (voxels.flags[b, a, CHANGED] or voxels.flags[b, a, TIMED]):
                continue
            timed = False
            for jj in range(CHUNK):
                for ii in range(CHUNK):
                    j, i = b * CHUNK + jj, a * CHUNK + ii
                    if 0 < voxels.until[j, i] <= now:
                        voxels.until[j, i] = 0
                    taken = voxels.until[j, i] > 0
                    timed |= taken
                    solid = taken or _is_solid(voxels.mask[j, i], voxels.ground[j, i], least)
                    if solid != voxels.solid[j, i]:
                        voxels.solid[j, i] = solid
                        _count_around(voxels, j, i, 1 if solid else -1)
                    elif voxels.counts[j, i, 2] == 0:
                        voxels.cost[j, i] = _cost_of(voxels, j, i)
            voxels.flags[b, a, CHANGED] = False
            voxels.flags[b, a, TIMED] = timed


@compiled
def assign_chunk(voxels, place, key, base, ground):
    """Give a place, row and column of a chunk, to another chunk, of which nothing is known but its floor."""
    b, a = place
    for jj in range(CHUNK):
        for ii in range(CHUNK):
            j, i = b * CHUNK + jj, a * CHUNK + ii
            voxels.mask[j, i] = 0
            voxels.until[j, i] = 0
            voxels.ground[j, i] = ground[jj, ii]
            if voxels.solid[j, i]:
                voxels.solid[j, i] = False
                _count_around(voxels, j, i, -1)
            elif voxels.counts[j, i, 2] == 0:
                voxels.cost[j, i] = UNSEEN_COST
    voxels.key[b, a, 0], voxels.key[b, a, 1] = key
    voxels.base[b, a] = base
    voxels.flags[b, a, THERE] = True
    voxels.flags[b, a, CHANGED] = voxels.flags[b, a, TIMED] = False


@compiled(inline="always")
def _is_solid(mask, ground, least):
    """Tell whether a column holds at least so many voxels between ankle and head above its floor."""
    if mask == 0:
        return False
    low, high = ground + 2, ground + HEAD + 1
    if ground == UNKNOWN:
        floor = lowest_level(mask)
        # A tread has the riser behind it in its column, too.
        low, high = floor + 4, min(floor + HEAD, LEVELS)
    found = 0
    for level in range(low, high):
        if mask & (np.uint64(1) << np.uint64(level)):
            found += 1
    return found >= least


@compiled(inline="always")
def lowest_level(mask):
    """Return the lowest level that holds something; of a mask that is not 0."""
    level = 0
    while not mask & (np.uint64(1) << np.uint64(level)):
        level += 1
    return level


@compiled(inline="always")
def _count_around(voxels, j, i, change):
    for dy in range(-_REACH, _REACH + 1):
        for dx in range(-_REACH, _REACH + 1):
            square = dx * dx + dy * dy
            if square > BESIDE:
                continue
            y, x = (j + dy) & (SIDE - 1), (i + dx) & (SIDE - 1)
            voxels.counts[y, x, 2] += change
            if square <= NEAR:
                voxels.counts[y, x, 1] += change
            if square <= TOUCHING:
                voxels.counts[y, x, 0] += change
            voxels.cost[y, x] = _cost_of(voxels, y, x)


@compiled(inline="always")
def _cost_of(voxels, y, x):
    if voxels.counts[y, x, 0] > 0:
        return np.uint8(0)
    if voxels.counts[y, x, 1] > 0:
        return np.uint8(NEAR_COST)
    if voxels.counts[y, x, 2] > 0:
        return np.uint8(BESIDE_COST)
    return np.uint8(FREE_COST if voxels.mask[y, x] else UNSEEN_COST)


#: Kinds of entities that do not stay where they are seen, and those that are in nobody's way.
MOVING = ("resident", "assistant", "robot", "pedestrian", "car", "bus", "bicycle", "tram", "train", "cyclist")
PORTABLE = ("object",)

#: Metres up to which pictures are looked at, and every how many pixels.
REACH, STEP = 8.0, 2
# Half a voxel up to a whole one lies below a floor whose middle is level `FLOOR`'s.
_BELOW_FLOOR = (FLOOR + 0.5) * VOXEL
_SAMPLES = 8  # heights of the ground along the side of a chunk
# On stairs, how far below the lowest door the voxels begin, metres.
_BELOW_DOORS = 0.25
_STUMBLE = 0.34  # metres ahead of one's middle is what stopped a step
_BODY = 0.5  # ... and the middle of a body that did
_WIDEST = 4  # columns to either side that a stumble comes to cover

# The wall of a door is taken to go on so many columns to either side, and lies so far behind the door, metres.
_WALL, _BEHIND_WALL = 70, 0.05
_WHOLE_COLUMN = np.uint64((1 << 50) - 1)

Ground = Callable[[NDArray[np.float64]], NDArray[np.float64]] | float | None


class VoxelMap:
    """Voxels of 0.1 m around the agent, in one room or outdoors.

    Memory is bounded: some 51 m x 51 m x 6.4 m are kept; what lies farther off gives its place to what is nearer.

    Parameters
    ----------
    ground
        Heights of the ground at points, shape ``(k, 2)``, ENU metres, shape ``(k,)``; or the one height of a level
        floor; None where it climbs unknown, as on stairs: then the lowest that is seen in a column is its floor.
    lowest
        Height of the lowest thing of interest where the ground is unknown, metres.
    least
        Voxels of a column, between ankle and head, that make it an obstacle.
    """

    def __init__(self, ground: Ground, *, lowest: float = 0.0, least: int = 1) -> None:
        self.climbs = ground is None
        self._ground, self._lowest, self._least = ground, lowest, least
        self.voxels = empty_voxels()

    @property
    def cost(self) -> NDArray[np.uint8]:
        """What a step onto a column costs, 0 where it is blocked; shape ``(SIDE, SIDE)``, indices wrap around."""
        return self.voxels.cost

    @property
    def base(self) -> float:
        """Height of level 0's lower side where the ground is unknown, metres."""
        return self._lowest - _BELOW_DOORS

    def see(self, observation: Mapping[str, Any], entities: Mapping[int, Mapping[str, str]], ignore: ArrayLike) -> None:
        """Enter what a depth picture shows, and clear what it shows to be gone.

        Parameters
        ----------
        observation
            With pictures.
        entities
            What the numbers of its segmentation stand for.
        ignore
            Entities that are in nobody's way.
        """
        eye = np.asarray(observation["pose"], np.float64)[:2]
        now = int(observation["state"]["time"])
        self._open_chunks(eye)
        intrinsics = np.asarray(observation["intrinsics"], np.float64)
        extrinsics = np.asarray(observation["extrinsics"], np.float64)
        lens = np.array([intrinsics[0, 0], intrinsics[1, 1], intrinsics[0, 2], intrinsics[1, 2]])
        camera = Camera(lens, np.ascontiguousarray(extrinsics[:3, :3]), np.ascontiguousarray(extrinsics[:3, 3]))
        depth = np.ascontiguousarray(observation["depth"], np.float32)
        segmentation = np.ascontiguousarray(observation["segmentation"], np.int32)
        height = -float(dot(camera.rotation[:, 2], camera.shift))
        limits = np.array([STEP, REACH, now + FADES, height])
        clear_seen_through(self.voxels, depth, camera, eye, limits)
        # Entities that are no lasting obstacles, and why not.
        passing = {int(entity): IGNORED for entity in np.asarray(ignore, np.int64).tolist()}
        for entity, about in entities.items():
            if about["kind"] in MOVING:
                passing.setdefault(int(entity), MOVES)
            elif about["kind"] in PORTABLE:
                passing.setdefault(int(entity), IGNORED)
        kinds = np.array(sorted(passing.items()), np.int64).reshape(-1, 2)
        add_points(self.voxels, depth, segmentation, camera, kinds, limits)
        self.refresh(now)

    def refresh(self, now: int) -> None:
        """Count what changed, and forget what was to be remembered up to a second of the day."""
        count_changes(self.voxels, now, self._least)

    def stumble(self, pose: NDArray[np.float64], now: int, *, times: int) -> None:
        """Remember that something stopped a step ahead.

        Parameters
        ----------
        pose
            Of who was stopped.
        now
            Second of the day.
        times
            How often in a row something solid did: what stops one again is wider than was thought. 0 for a body that
            moves, which is remembered for as long as one that was seen.
        """
        away, lasts = (_STUMBLE, BUMP_LASTS) if times else (_BODY, FADES)
        wide = min(times - 1, _WIDEST) if times else 1
        self._open_chunks(pose[:2])
        east, north = pose[HEADING_SLICE]
        for k in range(-wide, wide + 1):
            x = float(pose[0] + away * east - k * VOXEL * north)
            y = float(pose[1] + away * north + k * VOXEL * east)
            column, row = math.floor(x / VOXEL), math.floor(y / VOXEL)
            self.voxels.until[row % SIDE, column % SIDE] = now + lasts
            self.voxels.flags[(row // CHUNK) % CHUNKS, (column // CHUNK) % CHUNKS, TIMED] = True
        self.refresh(now)

    def assume_wall(self, point: NDArray[np.float64], ahead: NDArray[np.float64], now: int) -> None:
        """Take it that a wall stands across, until it is seen through: that of the door one came in by.

        Parameters
        ----------
        point
            On the wall, ENU metres.
        ahead
            Unit vector away from it, into the room.
        now
            Second of the day.
        """
        self._open_chunks(point[:2])
        for k in range(-_WALL, _WALL + 1):
            x = float(point[0] - _BEHIND_WALL * ahead[0] - k * VOXEL * ahead[1])
            y = float(point[1] - _BEHIND_WALL * ahead[1] + k * VOXEL * ahead[0])
            column, row = math.floor(x / VOXEL), math.floor(y / VOXEL)
            self.voxels.mask[row % SIDE, column % SIDE] |= _WHOLE_COLUMN
            self.voxels.flags[(row // CHUNK) % CHUNKS, (column // CHUNK) % CHUNKS, CHANGED] = True
        self.refresh(now)

    def forget_stumbles(self, now: int) -> bool:
        """Forget what one bumped into; return whether there was any."""
        bumps = self.voxels.until > now + FADES
        self.voxels.until[bumps] = 0
        self.refresh(now)
        return bool(bumps.any())

    def forget_moving(self) -> bool:
        """Forget where what moves was seen; return whether there was any."""
        there = bool(self.voxels.until.any())
        self.voxels.until[:] = 0
        self.refresh(0)
        return there

    @property
    def passing(self) -> bool:
        """Whether something that moves, or was bumped into, is taken to be somewhere."""
        return bool(self.voxels.flags[..., TIMED].any())

    def _open_chunks(self, eye: NDArray[np.float64]) -> None:
        """Have a place for each chunk in reach."""
        side = CHUNK * VOXEL
        low, high = (np.floor((eye + away) / side).astype(int).tolist() for away in (-REACH - VOXEL, REACH + VOXEL))
        missing = []
        for row in range(low[1], high[1] + 1):
            for column in range(low[0], high[0] + 1):
                b, a = row % CHUNKS, column % CHUNKS
                key = self.voxels.key[b, a]
                if not (self.voxels.flags[b, a, THERE] and key[0] == column and key[1] == row):
                    missing.append((column, row))
        self._open(missing)

    def _open(self, chunks: Sequence[tuple[int, int]]) -> None:
        """Give chunks, by column and row, their places."""
        if not chunks:
            return
        bases = np.full(len(chunks), self.base)
        levels = np.full((len(chunks), 1, 1), UNKNOWN, np.int8)
        if isinstance(self._ground, float):
            bases[:], levels[:] = self._ground - _BELOW_FLOOR, FLOOR
        elif self._ground is not None:
            axis = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
            corner = np.array(chunks, np.float64)[:, None, None, :]
            points = (corner + np.stack(np.meshgrid(axis, axis), axis=-1)) * (CHUNK * VOXEL)
            heights = self._ground(points.reshape(-1, 2)).reshape(points.shape[:3])
            bases = heights.min(axis=(1, 2)) - _BELOW_FLOOR
            levels = np.floor((heights - bases[:, None, None]) / VOXEL + 1e-6).astype(np.int8)
        for (column, row), base, level in zip(chunks, bases.tolist(), levels, strict=True):
            whole = level.repeat(CHUNK // len(level), 0).repeat(CHUNK // len(level), 1)
            assign_chunk(self.voxels, (row % CHUNKS, column % CHUNKS), (column, row), base, whole)

    # Plain data.

    def state(self) -> AgentState:
        """Return the columns that hold something, as arrays; few do, so they are listed."""
        v = self.voxels
        rows, columns = np.nonzero((v.mask != 0) | (v.until != 0))
        places = np.argwhere(v.flags[..., THERE])
        return {
            "chunks": v.key[places[:, 0], places[:, 1]].astype(np.int32),
            "column": (rows * SIDE + columns).astype(np.int32),
            "mask": v.mask[rows, columns],
            "until": v.until[rows, columns].astype(np.int32),
            "lowest": self._lowest,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Know what another map of the same ground knew."""
        self._lowest = float(state["lowest"])
        self.voxels = empty_voxels()
        self._open([(column, row) for column, row in np.asarray(state["chunks"]).reshape(-1, 2).tolist()])
        place = np.asarray(state["column"], np.int64)
        self.voxels.mask.ravel()[place] = np.asarray(state["mask"], np.uint64)
        self.voxels.until.ravel()[place] = np.asarray(state["until"], np.int64)
        self.voxels.flags[..., CHANGED] = self.voxels.flags[..., TIMED] = self.voxels.flags[..., THERE]
        self.refresh(0)
