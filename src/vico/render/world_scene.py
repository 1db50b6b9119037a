"""The scene of a world folder: ground, buildings, roofs, rooms and everything placed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from vico.assets.interior import WINDOW
from vico.render.behind.fronts import room_fronts
from vico.render.lamps.found import LAMP_KINDS, lamps_placed, shop_lamps, with_lit_heads
from vico.render.lighting import Lighting
from vico.render.records import GROUND_WINDOWS, UPPER_WINDOWS
from vico.render.scene import Scene
from vico.world.far_colours import WINDOWS
from vico.world.mesh import Surface

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from vico.assets.vehicle_parts import Cabin
    from vico.render.palette import Palette
    from vico.world.world import World

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
        lamps = lamps_placed(models, [names[k] for k in shining], transforms[shining])
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
