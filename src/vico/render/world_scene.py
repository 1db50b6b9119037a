"""The scene of a world folder: ground, buildings, roofs, rooms and everything placed.

Heads of street lamps and shop windows shine on their surroundings. A front says which room lies behind which stretch of
glass.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.assets.interior import WINDOW
from vico.exact import apply_matrix
from vico.render.lighting import Lighting
from vico.render.records import GROUND_WINDOWS, LAMP, ROOM_FRONT, UPPER_WINDOWS
from vico.render.scene import Scene
from vico.world.far_colours import WINDOWS
from vico.world.mesh import Material, Surface
from vico.world.model import Category

if TYPE_CHECKING:
    from vico.assets.vehicle_parts import Cabin
    from vico.render.materials import Palette
    from vico.world.model import Entrance, Room
    from vico.world.world import World
#: Kinds of things whose bright parts shine.
LAMP_KINDS = ("street_lamp", "lamp", "lantern")
#: What shines in them.
HEAD = Material("lamp head", emission=1.0)
# A part shines that is at least this bright in each channel, sRGB, and this far up, metres.
_BRIGHT, _UP = 190, 1.8
_BELOW = 0.72  # light below a lamp, whatever its height; 1 is a sunny wall's
# How far a lamp's light reaches.
_HEIGHTS = 3.4  # in its heights
_FARTHEST = 24.0  # metres
# Points that shine along the front of a shop, metres.
_APART = 4.0
_BEFORE = 0.5  # the pane
_ABOVE = 2.0  # its foot
_SHOP_LIGHT = 1.8  # of each
_SHOP_REACH = 9.0
_TALL = 1.8


def with_lit_heads(surfaces: Sequence[Surface]) -> list[Surface]:
    """Return a lamp's model with bright parts high up that shine; as it is where something in it does already."""
    if any(surface.material.emission > 0.0 for surface in surfaces):
        return list(surfaces)
    found: list[Surface] = []
    for surface in surfaces:
        corners = surface.triangles
        bright = (surface.colour[corners].min(axis=(1, 2)) >= _BRIGHT) & (
            surface.positions[corners][:, :, 2].min(axis=1) >= _UP
        )
        if bright.any():
            found.append(replace(surface, triangles=corners[bright], material=HEAD))
            surface = replace(surface, triangles=corners[~bright])
        if len(surface.triangles):
            found.append(surface)
    return found


def placed_lamps(
    models: Mapping[str, Sequence[Surface]], names: Sequence[str], transforms: NDArray[np.float64]
) -> NDArray[np.void]:
    """Return the `LAMP` of each placed model that shines; transforms are model to world, shape ``(n, 4, 4)``."""
    heads = {name: _head(models[name]) for name in set(names)}
    found = [(heads[name], transform) for name, transform in zip(names, transforms, strict=True)]
    shining = [(head, transform) for head, transform in found if head is not None]
    lamps = np.zeros(len(shining), LAMP)
    for lamp, (head, transform) in zip(lamps, shining, strict=True):
        place, is_globe = head
        height = float(place[2] * transform[2, 2])
        # Just below the head, or it would shine into itself alone.
        lamp["x"], lamp["y"], lamp["z"] = apply_matrix(place, transform[:3, :3]) + transform[:3, 3]
        # A globe shines all around, else the ground gets most.
        lamp["axis_z"], lamp["spread"], lamp["share"] = -1.0, (0.3 if is_globe else 1.1), (0.7 if is_globe else 0.3)
        # Bright below and even around: the lamp's light is spread over its height's square.
        lamp["size"] = 0.6 * height**2
        lamp["power"] = _BELOW * (height**2 + lamp["size"])
        lamp["inverse_reach"] = 1.0 / min(_HEIGHTS * height, _FARTHEST) ** 2
    return lamps


def _head(surfaces: Sequence[Surface]) -> tuple[NDArray[np.float64], bool] | None:
    """Return where a model shines, and whether it does so all around."""
    shining = [s.positions[s.triangles].reshape(-1, 3) for s in surfaces if s.material.emission > 0.0]
    if not shining:
        return None
    points = np.concatenate(shining).astype(np.float64)
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2, bool(high[2] - low[2] > 0.2)


def shop_lamps(static: Iterable[Surface], materials: ArrayLike) -> NDArray[np.void]:
    """Return `LAMP` before the windows of shops: points along the lower edges of surfaces of these materials."""
    wanted = tuple(np.atleast_1d(np.asarray(materials)).tolist())
    found = [_before_panes(s) for s in static if s.material.name.startswith(wanted)]
    return np.concatenate(found) if found else np.zeros(0, LAMP)


def _before_panes(surface: Surface) -> NDArray[np.void]:
    corners = surface.positions[surface.triangles].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    entity = surface.entity[surface.triangles[:, 0]]
    order = np.argsort(corners[:, :, 2], axis=1)
    corners = np.take_along_axis(corners, order[:, :, None], axis=1)
    # Of each wall's two triangles, the one that stands on its edge.
    low, other, top = corners[:, 0], corners[:, 1], corners[:, 2]
    stands = (abs(normal[:, 2]) < 0.1) & (top[:, 2] - low[:, 2] > _TALL) & (other[:, 2] - low[:, 2] < 0.5)
    lamps: list[NDArray[np.void]] = []
    for a, b, out, owner in zip(low[stands], other[stands], normal[stands], entity[stands], strict=True):
        number = max(round(float(np.hypot(*(b - a)[:2])) / _APART), 1)
        if np.hypot(*(b - a)[:2]) < 1.0:
            continue
        share = (np.arange(number) + 0.5)[:, None] / number
        place = a + share * (b - a) + _BEFORE * out
        row = np.zeros(number, LAMP)
        row["x"], row["y"], row["z"] = place[:, 0], place[:, 1], place[:, 2] + _ABOVE
        row["axis_x"], row["axis_y"], row["axis_z"] = 0.85 * out[0], 0.85 * out[1], -0.53
        row["spread"], row["share"], row["size"] = 0.9, 0.15, 2.5
        row["power"], row["inverse_reach"], row["entity"] = _SHOP_LIGHT, 1.0 / _SHOP_REACH**2, owner
        lamps.append(row)
    return np.concatenate(lamps) if lamps else np.zeros(0, LAMP)


#: What shows its rooms to the street.
OPEN_TO_SIGHT = frozenset({Category.STORE, Category.FOOD, Category.ENTERTAINMENT})
# Fronts on one wall: their doors lie no farther than this off each other's plane, metres.
_SAME_WALL = 0.6
# Panes that reach farther to the side than their room by so much show its wall, metres.
_REST = 0.8


def room_fronts(world: World) -> NDArray[np.void]:
    """Return the `ROOM_FRONT` of every shop, café and the like that has a room with a door to a street.

    Those on one wall meet halfway between their doors; of several behind one door the first one's room is seen.
    """
    entrances = {entrance.id: entrance for entrance in world.entrances}
    first: dict[str, str] = {}
    have_rooms = {room.place for room in world.rooms if any(not door.to for door in room.doors)}
    for place in world.places:
        if place.category in OPEN_TO_SIGHT and place.entrance in entrances and place.id in have_rooms:
            first.setdefault(place.entrance or "", place.id)
    shown = {place: entrance for entrance, place in first.items()}
    found, where = [], []
    for k, room in enumerate(world.rooms):
        door = next((door for door in room.doors if not door.to), None)
        if room.place not in shown or door is None:
            continue
        entrance = entrances[shown.pop(room.place)]
        found.append((*_ends(entrance, room), k))
        where.append(entrance.building)
    fronts = np.array(found, ROOM_FRONT) if found else np.zeros(0, ROOM_FRONT)
    _share_walls(fronts, where)
    return fronts[fronts["right"] - fronts["left"] > 0.5]


def _ends(entrance: Entrance, room: Room) -> tuple[float, ...]:
    """Return both frames, and how far the room reaches in its own."""
    door = next(door for door in room.doors if not door.to)
    # Inwards, along the axis of the room that a step in from the door is nearest to.
    toward = math.atan2(door.inside[1] - door.position[1], door.inside[0] - door.position[0])
    quarter = round((toward - room.yaw) / (math.pi / 2)) % 4
    yaw = room.yaw + quarter * math.pi / 2
    ix, iy = math.cos(yaw), math.sin(yaw)
    dx, dy = room.centre[0] - door.position[0], room.centre[1] - door.position[1]
    middle, depth = dx * iy - dy * ix, dx * ix + dy * iy
    deep, wide = (room.size[0], room.size[1]) if quarter % 2 == 0 else (room.size[1], room.size[0])
    # The middle of the room's wall goes behind the door on the street: so most panes beside it have the room behind.
    off = depth - deep / 2
    return (
        *entrance.position,
        -math.cos(entrance.facing),
        -math.sin(entrance.facing),
        door.position[0] + off * ix + middle * iy,
        door.position[1] + off * iy - middle * ix,
        room.centre[2],
        ix,
        iy,
        -_REST - wide / 2,
        wide / 2 + _REST,
        room.size[2],
        deep,
        wide / 2 - 0.02,
    )


def _share_walls(fronts: NDArray[np.void], buildings: Sequence[str]) -> None:
    """Cut fronts of one wall where they meet."""
    by_building: dict[str, list[int]] = {}
    for k, building in enumerate(buildings):
        by_building.setdefault(building, []).append(k)
    for group in by_building.values():
        for i in group:
            for j in group:
                if i != j:
                    _cut(fronts[i], fronts[j])


def _cut(front: np.void, other: np.void) -> None:
    """End a front halfway to another one's door."""
    ix, iy = float(front["inward_x"]), float(front["inward_y"])
    dx, dy = float(other["x"] - front["x"]), float(other["y"] - front["y"])
    along, off = dx * iy - dy * ix, dx * ix + dy * iy
    if abs(off) > _SAME_WALL or ix * other["inward_x"] + iy * other["inward_y"] < 0.9:
        return
    if along > 0.0:
        front["right"] = min(float(front["right"]), along / 2)
    else:
        front["left"] = max(float(front["left"]), along / 2)


# Beginnings of the names of materials with windows in them.
_UPPER, _GROUND = ("wall_", "dormer", WINDOWS.name), ("ground_", "doors")
# Storeys in the pictures of those that show bays, the same width everywhere.
_STOREYS = {"wall_": 4, "ground_": 1}
# Their panes have pictures of their own of what stands in them.
_SHOP_WINDOWS = ("ground_shops", "ground_cafes", "ground_loft", "ground_lobby")
OUTDOOR_LAYERS = ("ground", "buildings", "roofs")


def scene_of(
    world: World,
    *,
    rooms: bool = True,
    lighting: Lighting | None = None,
    prototypes: Mapping[str, Sequence[Surface]] | None = None,
    cabins: Mapping[str, Cabin] | None = None,
    far: Sequence[Surface] = (),
    palette: Palette | None = None,
) -> Scene:
    """Put a world's parts together.

    Parameters
    ----------
    rooms
        Whether to take the rooms and the furniture in them.
    prototypes
        Further models that will move in the scene (vehicles, robots, goods), by name.
    cabins, far, palette
        As in `Scene`.
    """
    static = [surface for layer in OUTDOOR_LAYERS for surface in world.surfaces(layer)]
    indoor = world.surfaces("rooms") if rooms else []
    boxes = [
        (*room.centre, room.size[0] / 2, room.size[1] / 2, room.size[2], room.yaw) for room in world.rooms if rooms
    ]
    models = {**world.prototypes(), **(prototypes or {})}
    is_lamp = np.isin(world.objects.kind, LAMP_KINDS) & (world.objects.room == "")
    for name in np.unique(world.objects.prototype[is_lamp]).tolist():
        models[name] = with_lit_heads(models[name])
    scene = Scene(
        static,
        models,
        indoor=indoor,
        rooms=np.array(boxes).reshape(-1, 7),
        cabins=cabins,
        lighting=lighting,
        far=far,
        palette=palette,
    )
    _tell_windows(scene)
    if rooms:
        scene.fronts = room_fronts(world)
        glazed = [np.unique(s.entity) for s in indoor if s.material.name == WINDOW]
        known = np.concatenate(glazed) if glazed else np.zeros(0, np.int32)
        scene.rooms["windows"] = np.isin([room.entity for room in world.rooms], known)
    objects = world.objects
    taken = [k for k in range(len(objects.entity)) if rooms or not objects.room[k]]
    if taken:
        index = np.array(taken)
        cosine = np.cos(objects.yaw[index]) * objects.scale[index]
        sine = np.sin(objects.yaw[index]) * objects.scale[index]
        transforms = np.zeros((len(taken), 4, 4))
        transforms[:, 0, 0], transforms[:, 0, 1] = cosine, -sine
        transforms[:, 1, 0], transforms[:, 1, 1] = sine, cosine
        transforms[:, 2, 2], transforms[:, 3, 3] = objects.scale[index], 1.0
        transforms[:, 0, 3], transforms[:, 1, 3] = objects.x[index], objects.y[index]
        transforms[:, 2, 3] = objects.z[index]
        names = [str(objects.prototype[k]) for k in taken]
        inside = np.array([bool(objects.room[k]) for k in taken])
        scene.place(names, transforms, objects.entity[index], indoor=inside)
        shining = np.flatnonzero(is_lamp[index])
        lamps = placed_lamps(models, [names[k] for k in shining], transforms[shining])
        scene.lamps = np.concatenate([lamps, shop_lamps(static, _SHOP_WINDOWS)])
    return scene


def _tell_windows(scene: Scene) -> None:
    """Mark the materials whose light is that of windows."""
    records = scene.arrays.textures.materials
    for k, name in enumerate(scene.material_names):
        if records[k]["emission"] > 0.0:
            bays = name.startswith(tuple(_STOREYS)) and name not in _SHOP_WINDOWS
            records[k]["storeys"] = next(n for start, n in _STOREYS.items() if name.startswith(start)) if bays else 0
            records[k]["windows"] = UPPER_WINDOWS * name.startswith(_UPPER) + GROUND_WINDOWS * name.startswith(_GROUND)
