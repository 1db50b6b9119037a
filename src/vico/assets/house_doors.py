"""Doors of houses: where their leaves are on the facades' sheet of doors, and the shapes of those that swing.

A closed leaf is part of a facade's picture: a panel a few centimetres before the wall, with a cell of the sheet on it.
Here such panels are found again among a world's meshes, one an entrance, so that leaves can swing and what is behind
them be seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vico.world.mesh import Material, Surface
from vico.world.model import Entrance

#: Texels of the sheet of doors, and the name of its material.
SHEET, DOOR_MATERIAL = (2048, 512), "doors"


@dataclass(frozen=True)
class Cell:
    """A rectangle of the sheet, pixels from its lower left corner."""

    x: int
    y: int
    width: int
    height: int

    def uv(self) -> tuple[float, float, float, float]:
        """Left, bottom, right and top in texture coordinates, a texel and a half within the cell's border."""
        return (
            (self.x + CELL_RIM) / SHEET[0],
            (self.y + CELL_RIM) / SHEET[1],
            (self.x + self.width - CELL_RIM) / SHEET[0],
            (self.y + self.height - CELL_RIM) / SHEET[1],
        )


#: Texels at the border of a cell that are not shown.
CELL_RIM = 1.5
#: The cells with doors.
DOOR_CELLS = {
    "double": Cell(0, 256, 128, 256),
    "panelled": Cell(128, 256, 128, 256),
    "single": Cell(256, 256, 128, 256),
    "glass": Cell(384, 256, 128, 256),
    "office": Cell(512, 256, 256, 256),
    "hotel": Cell(768, 256, 256, 256),
    "portal": Cell(1024, 256, 256, 256),
    "gate": Cell(1280, 256, 256, 256),
}


class _Leaves(NamedTuple):
    """What of a cell moves: from left to right, texels; the border between two leaves; top; the step before it, m."""

    left: float
    right: float
    middle: float | None
    top: float
    step: float


_LEAVES = {
    "double": _Leaves(9.0, 119.0, 64.0, 202.0, 0.075),
    "panelled": _Leaves(9.0, 119.0, 64.0, 202.0, 0.075),
    "single": _Leaves(9.0, 119.0, None, 202.0, 0.075),
    "glass": _Leaves(6.0, 122.0, 64.0, 209.0, 0.02),
    "office": _Leaves(66.0, 190.0, 128.0, 203.0, 0.075),
    "hotel": _Leaves(66.0, 190.0, 128.0, 203.0, 0.075),
    "portal": _Leaves(44.0, 212.0, 128.0, 129.0, 0.105),
    "gate": _Leaves(2.0, 254.0, None, 246.0, 0.02),
}
_NAMES = tuple(_LEAVES)
_GATE = _NAMES.index("gate")
# A panel belongs to an entrance that is no farther off than this, metres.
_OFF = 0.3  # its plane
_ALONG = 3.0
_UP = 2.0  # or down
_EQUAL = 2e-4  # of texture coordinates
_THICK = 0.045  # of leaves, metres
_AJAR = math.radians(84.0)  # how far open leaves are turned
# Of the hall behind a door, metres.
_HALL_DEEP = 2.4
_HALL_SHALLOW = 1.3
_HALL_BESIDE = 0.45
#: How far before and behind the plane of a closed leaf the wall is open, metres.
BEFORE, BEHIND = 0.03, 0.25

#: A door: kind (row of the cells, -1: none was found), middle of the sill in the plane of the closed leaf, way in, half
#: the opening's width and its height, metres; colour of the leaf, and half the width of one of two leaves (0: there is
#: one). Of doors that were not found only the place and the way in mean something.
HOUSE_DOOR = np.dtype(
    [
        ("kind", np.int32),
        ("x", np.float64),
        ("y", np.float64),
        ("z", np.float64),
        ("inward_x", np.float64),
        ("inward_y", np.float64),
        ("half_width", np.float64),
        ("height", np.float64),
        ("colour", np.uint8, (3,)),
        ("uv", np.float32, (4,)),
    ],
    align=True,
)


def house_doors(panels: Sequence[Surface], entrances: Sequence[Entrance]) -> NDArray[np.void]:
    """Find the doors of entrances among the panels of facades.

    Parameters
    ----------
    panels
        The world's surfaces of the material `DOOR_MATERIAL`.
    entrances
        Where doors are.

    Returns
    -------
    ndarray
        `HOUSE_DOOR`, shape ``(entrances,)``.
    """
    doors = np.zeros(len(entrances), HOUSE_DOOR)
    doors["kind"] = -1
    facing = np.array([e.facing for e in entrances], np.float64)
    at = np.array([e.position for e in entrances], np.float64).reshape(-1, 3)
    doors["x"], doors["y"], doors["z"] = at.T
    doors["inward_x"], doors["inward_y"] = -np.cos(facing), -np.sin(facing)
    doors["half_width"], doors["height"] = 0.45, 2.0
    kinds, corners, colours, uv = _door_panels(panels)
    if not len(kinds):
        return doors
    middle = corners.mean(axis=1)
    beside = cKDTree(middle[:, :2]).query_ball_point(at[:, :2], math.hypot(_OFF, _ALONG), return_sorted=True)
    for k in range(len(doors)):
        near = np.array(beside[k], np.int64)
        out = np.array([-doors["inward_x"][k], -doors["inward_y"][k]])
        off = middle[near, :2] - at[k, :2]
        along = np.abs(off @ np.array([-out[1], out[0]]))
        low = np.abs(corners[near, 0, 2] - at[k, 2])
        fits = np.flatnonzero((np.abs(off @ out) < _OFF) & (along < _ALONG) & (low < _UP))
        if len(fits):
            nearest = int(near[fits[along[fits].argmin()]])
            _describe(doors[k : k + 1], int(kinds[nearest]), corners[nearest], uv[nearest])
            doors["colour"][k] = colours[nearest]
    return doors


def _door_panels(
    panels: Sequence[Surface],
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.uint8], NDArray[np.float32]]:
    """Return kind, corners (lower left, lower right, upper right, upper left), colour and cell of panels with doors."""
    kinds, corners, colours, cells = [], [], [], []
    for surface in panels:
        # Panels are quads: two triangles with the corners 0 1 2 and 0 2 3.
        quads = surface.triangles[: len(surface.triangles) // 2 * 2].reshape(-1, 6)[:, [0, 1, 2, 5]]
        uv = surface.uv[quads]
        for number, name in enumerate(_NAMES):
            left, bottom, right, top = DOOR_CELLS[name].uv()
            is_door = (np.abs(uv[:, 0] - (left, bottom)).max(axis=1) < _EQUAL) & (
                np.abs(uv[:, 2] - (right, top)).max(axis=1) < _EQUAL
            )
            found = np.flatnonzero(is_door)
            kinds.append(np.full(len(found), number))
            corners.append(surface.positions[quads[found]].astype(np.float64))
            colours.append(surface.colour[quads[found, 0]])
            cells.append(np.concatenate([uv[found, 0], uv[found, 2]], axis=1))
    if not kinds:
        none = np.zeros((0, 4), np.float32)
        return np.zeros(0, np.int64), np.zeros((0, 4, 3)), np.zeros((0, 3), np.uint8), none
    return np.concatenate(kinds), np.concatenate(corners), np.concatenate(colours), np.concatenate(cells)


def _describe(door: NDArray[np.void], kind: int, corners: NDArray[np.float64], uv: NDArray[np.float32]) -> None:
    """Write what a panel says of its door."""
    name = _NAMES[kind]
    cell, leaves = DOOR_CELLS[name], _LEAVES[name]
    wide, high = np.linalg.norm(corners[1] - corners[0]), corners[2, 2] - corners[1, 2]
    right = (corners[1] - corners[0]) / wide
    first, last = ((v - CELL_RIM) / (cell.width - 2 * CELL_RIM) for v in (leaves.left, leaves.right))
    top = (leaves.top - CELL_RIM) / (cell.height - 2 * CELL_RIM)
    sill = float(door["z"][0]) + leaves.step
    share = (sill - corners[0, 2]) / high
    middle = corners[0] + right * wide * (first + last) / 2
    door["kind"] = kind
    door["x"], door["y"], door["z"] = middle[0], middle[1], sill
    door["inward_x"], door["inward_y"] = -right[1], right[0]
    door["half_width"], door["height"] = wide * (last - first) / 2, (top - share) * high
    u0, v0, u1, v1 = uv
    door["uv"] = u0 + first * (u1 - u0), v0 + share * (v1 - v0), u0 + last * (u1 - u0), v0 + top * (v1 - v0)


def leaf_names(door: NDArray[np.void]) -> list[str]:
    """Return the names of a door's leaves, the left one first as seen from outside; none of a door not found."""
    if door["kind"] < 0:
        return []
    colour = "".join(f"{int(c):02x}" for c in door["colour"])
    size = f"{round(1000 * float(door['half_width']))}x{round(1000 * float(door['height']))}"
    sides = ("left",) if _LEAVES[_NAMES[int(door["kind"])]].middle is None else ("left", "right")
    return [f"door {_NAMES[int(door['kind'])]} {colour} {size} {side}" for side in sides]


def is_gate(door: NDArray[np.void]) -> bool:
    """Whether a door is a gate, which goes up and does not swing."""
    return int(door["kind"]) == _GATE


def leaf_surfaces(door: NDArray[np.void], material: Material) -> list[list[Surface]]:
    """Return the shapes of a door's leaves, in the order of `leaf_names`.

    At the origin is the hinge's foot; closed, x runs along the wall to the right as seen from outside, y inwards.
    """
    wide, high = 2.0 * float(door["half_width"]), float(door["height"])
    u0, v0, u1, v1 = (float(v) for v in door["uv"])
    colour = door["colour"]
    if len(leaf_names(door)) == 1:
        return [[_leaf(0.0, wide, high, (u0, v0, u1, v1), colour, material)]]
    middle = (u0 + u1) / 2
    left = _leaf(0.0, wide / 2, high, (u0, v0, middle, v1), colour, material)
    right = _leaf(-wide / 2, 0.0, high, (middle, v0, u1, v1), colour, material)
    return [[left], [right]]


def _leaf(
    x0: float,
    x1: float,
    high: float,
    uv: tuple[float, float, float, float],
    colour: NDArray[np.uint8],
    material: Material,
) -> Surface:
    """Return a board from `x0` to `x1` that shows the same from both sides."""
    y0, y1, (u0, v0, u1, v1) = 0.0, _THICK, uv
    edge = (u0 + 0.02 * (u1 - u0), u1 - 0.02 * (u1 - u0))
    quads = [
        ([(x0, y0, 0), (x1, y0, 0), (x1, y0, high), (x0, y0, high)], (u0, u1)),
        ([(x1, y1, 0), (x0, y1, 0), (x0, y1, high), (x1, y1, high)], (u1, u0)),
        ([(x0, y1, 0), (x0, y0, 0), (x0, y0, high), (x0, y1, high)], (edge[0], edge[0])),
        ([(x1, y0, 0), (x1, y1, 0), (x1, y1, high), (x1, y0, high)], (edge[1], edge[1])),
    ]
    corners = np.array([quad for quad, _ in quads], np.float64).reshape(-1, 3)
    coordinates = np.array([[(a, v0), (b, v0), (b, v1), (a, v1)] for _, (a, b) in quads]).reshape(-1, 2)
    first = 4 * np.arange(len(quads))[:, None]
    faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    return Surface.from_triangles(corners, faces, colour=tuple(colour.tolist()), uv=coordinates, material=material)


def leaf_poses(door: NDArray[np.void], share: float) -> NDArray[np.float64]:
    """Return where a door's leaves are when it is open by `share` (0..1): model to world, shape ``(leaves, 4, 4)``.

    Gates go up behind the wall, all others swing inwards.
    """
    ix, iy, half = float(door["inward_x"]), float(door["inward_y"]), float(door["half_width"])
    base = np.eye(4)
    base[:2, 0], base[:2, 1] = (iy, -ix), (ix, iy)
    base[:3, 3] = door["x"], door["y"], door["z"]
    poses = []
    for side in (-1.0, 1.0)[: len(leaf_names(door))]:
        local = np.eye(4)
        local[0, 3] = side * half
        if is_gate(door):
            local[1:3, 3] = BEHIND * min(8.0 * share, 1.0), share * float(door["height"])
        else:
            # Doors start and stop softly.
            angle = -side * _AJAR * share * share * (3.0 - 2.0 * share)
            c, s = math.cos(angle), math.sin(angle)
            local[:2, :2] = (c, -s), (s, c)
        poses.append(base @ local)
    return np.array(poses).reshape(-1, 4, 4)


#: Depth of halls and how much wider than their doors they are to each side, metres, the best first.
HALLS = ((_HALL_DEEP, _HALL_BESIDE), (_HALL_DEEP, 0.03), (_HALL_SHALLOW, 0.03))
_LIT = Material("hall lit", emission=0.8)
_DARK = Material("hall dark")
_WALL, _FLOOR, _CEILING, _REAR, _INNER = (
    (168, 160, 144),
    (120, 104, 90),
    (150, 145, 137),
    (196, 186, 168),
    (112, 82, 58),
)
_MOUTH, _BACK = 0.95, 0.55  # how light halls are there


def hall_name(door: NDArray[np.void], size: int, *, lit: bool) -> str:
    """Return the name of the hall behind a door; `size` is a row of `HALLS`."""
    wide, high = round(2000 * float(door["half_width"])), round(1000 * float(door["height"]))
    return f"hall {wide}x{high} {size} {'lit' if lit else 'dark'}"


def hall_surface(door: NDArray[np.void], size: int, *, lit: bool) -> Surface:
    """Return the inside of the hall behind a door: jambs, then walls, floor, ceiling and a door at its back.

    At the origin is the middle of the sill; x runs to the right as seen from outside, y inwards.
    """
    deep, beside = HALLS[size]
    half, high = float(door["half_width"]), float(door["height"])
    quads = [_side(x, -BEFORE, BEHIND, high) for x in (-half, half)] + _levels(half, -BEFORE, BEHIND, high)
    wide, tall = half + beside, high + 0.25
    quads += [_side(x, BEHIND, deep, tall) for x in (-wide, wide)] + _levels(wide, BEHIND, deep, tall)
    quads.append(([(-wide, deep, 0), (wide, deep, 0), (wide, deep, tall), (-wide, deep, tall)], _REAR))
    x, y = min(0.42, half), deep - 0.02
    quads.append(([(-x, y, 0), (x, y, 0), (x, y, 2.0), (-x, y, 2.0)], _INNER))
    corners = np.array([quad for quad, _ in quads], np.float64).reshape(-1, 3)
    paint = np.repeat(np.array([colour for _, colour in quads], np.float64), 4, axis=0)
    share = np.clip(corners[:, 1:2] / deep, 0.0, 1.0)
    colour = paint * (_MOUTH + share * (_BACK - _MOUTH))
    first = 4 * np.arange(len(quads))[:, None]
    faces = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    made = Surface.from_triangles(corners, faces, colour=colour.astype(np.uint8), material=_LIT if lit else _DARK)
    # All look out to the street: as light as the front of the house, and no snow falls on floors.
    normals = np.tile(np.array([0.0, -1.0, 0.0], np.float32), (len(made.normals), 1))
    return replace(made, normals=normals)


def _side(x: float, y0: float, y1: float, high: float) -> tuple[list[tuple[float, float, float]], tuple[int, int, int]]:
    """Return a side wall that faces the middle, and its colour."""
    ys = (y0, y1) if x < 0 else (y1, y0)
    return [(x, ys[0], 0.0), (x, ys[1], 0.0), (x, ys[1], high), (x, ys[0], high)], _WALL


def _levels(
    half: float, y0: float, y1: float, high: float
) -> list[tuple[list[tuple[float, float, float]], tuple[int, int, int]]]:
    """Return floor and ceiling, and their colours."""
    floor = [(-half, y0, 0.0), (half, y0, 0.0), (half, y1, 0.0), (-half, y1, 0.0)]
    ceiling = [(-half, y1, high), (half, y1, high), (half, y0, high), (-half, y0, high)]
    return [(floor, _FLOOR), (ceiling, _CEILING)]


def opening_of(door: NDArray[np.void]) -> tuple[float, ...]:
    """Return place, way in, size and reach of the part of a wall that an open door is, as the renderer takes them."""
    place = (float(door[name]) for name in ("x", "y", "z", "inward_x", "inward_y", "half_width", "height"))
    return *place, BEFORE, BEHIND
