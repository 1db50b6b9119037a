"""What stands where, as depth pictures showed it: 0.1 m voxels around the agent, and the room they leave to walk in."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.agents.navigation.voxel_kernels import (
    BUMP_LASTS,
    CHANGED,
    CHUNK,
    CHUNKS,
    FADES,
    FLOOR,
    IGNORED,
    MOVES,
    SIDE,
    THERE,
    TIMED,
    UNKNOWN,
    VOXEL,
    Camera,
    add_points,
    clear_seen_through,
    count_changes,
    empty_voxels,
    take_chunk,
)
from vico.agents.state import AgentState
from vico.exact import dot

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
        add_points(self.voxels, depth, segmentation, camera, _special(entities, ignore), limits)
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
        for k in range(-wide, wide + 1):
            x = float(pose[0] + away * pose[3] - k * VOXEL * pose[4])
            y = float(pose[1] + away * pose[4] + k * VOXEL * pose[3])
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
            take_chunk(self.voxels, (row % CHUNKS, column % CHUNKS), (column, row), base, whole)

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


def _special(entities: Mapping[int, Mapping[str, str]], ignore: ArrayLike) -> NDArray[np.int64]:
    """Return entities that are no lasting obstacles, and why not."""
    found = {int(entity): IGNORED for entity in np.asarray(ignore, np.int64).tolist()}
    for entity, about in entities.items():
        if about["kind"] in MOVING:
            found.setdefault(int(entity), MOVES)
        elif about["kind"] in PORTABLE:
            found.setdefault(int(entity), IGNORED)
    return np.array(sorted(found.items()), np.int64).reshape(-1, 2)
