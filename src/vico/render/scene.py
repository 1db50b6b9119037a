"""A scene: static surfaces, placed prototypes, and moving parts that are replaced each frame."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.assets.vehicle_parts import Cabin
from vico.errors import InputError
from vico.render.arrays import (
    ANYWHERE,
    INDOORS,
    OUTDOORS,
    SHADOWLESS,
    Instances,
    PosedAvatars,
    SceneArrays,
    widest,
)
from vico.render.compiled import kernel
from vico.render.geometry import Mesh, cluster_triangles, group_clusters, join_meshes, mesh_of, soup_of, spans
from vico.render.instances import (
    NO_GROUPS,
    entities_of,
    join_instances,
    matrix_rows,
    no_avatars,
    pose_avatars,
    prototypes_of,
    sort_by_locality,
    with_avatar_capacity,
    with_spare_capacity,
)
from vico.render.lamps import NO_LAMPS, LampGrid, beams_of, lamp_grid, shining_lamps
from vico.render.lighting import SKY_SIZE, Lighting, cloud_map, linear_table, paint_sky, sky_table, tone_table, unit
from vico.render.limbs import LIMBS
from vico.render.materials import Palette, Textures
from vico.render.records import COUNTS, LAMP, LIT_WINDOWS, OPENING, ROOM, ROOM_FRONT, SPHERE
from vico.render.shadows.maps import built_tops, relief_map, shadow_map
from vico.render.uniforms import Light, Record, ReliefMap, ShadowMap, light_uniforms
from vico.world.mesh import Material, Surface

_SHADOW_METRES, _RELIEF_METRES = 0.4, 1.5
_ALL_ON = np.zeros(0, LIT_WINDOWS)
_SKIN = Material("vico skin")
NO_OPENINGS = np.zeros(0, OPENING)
_NO_BEAMS = np.zeros(0, LAMP)


class Scene:
    """Everything the cameras may see.

    Parameters
    ----------
    static
        Outdoor surfaces that never move; each vertex holds its entity.
    prototypes
        Models by name, at the origin; entity 0 in them means the entity given when they are placed.
    indoor
        Surfaces of rooms. Only cameras inside a room see them, and such cameras see nothing of the outdoors.
    rooms
        Oriented boxes of the rooms, shape ``(r, 7)``: centre of the floor x, y, z, half length, half width, height,
        yaw.
    cabins
        Insides of vehicles that can be looked into, by the names of their models.
    lighting
        The light of the moment; assign `Scene.lighting` to change it.
    far
        Outdoor surfaces beyond the others, which get no shadows: maps of these end with the others.
    palette
        Keeps textures that scenes share; none: they are the scene's own.

    Attributes
    ----------
    material_names
        Of the rows of ``arrays.textures.materials``.
    fronts
        Glass on streets with rooms behind it, `ROOM_FRONT`; none unless assigned.
    lamps
        What stays where it is and shines on its surroundings, `LAMP`; none unless assigned, before the first picture.
    moment
        Seconds; decides where drops and flakes are in pictures taken now.
    shadowless
        How many of the last things that move throw no shadow.

    Notes
    -----
    Changing the scene while `render` runs in another thread is not safe; rendering from several threads is.
    """

    def __init__(
        self,
        static: Sequence[Surface],
        prototypes: Mapping[str, Sequence[Surface]] | None = None,
        *,
        indoor: Sequence[Surface] = (),
        rooms: ArrayLike | None = None,
        cabins: Mapping[str, Cabin] | None = None,
        lighting: Lighting | None = None,
        far: Sequence[Surface] = (),
        palette: Palette | None = None,
    ) -> None:
        models = dict(prototypes or {})
        materials = palette or Palette()
        linear = linear_table()
        outdoors = [*static, *far]
        outside = soup_of(outdoors, [materials.number(s.material) for s in outdoors], linear)
        inside = soup_of(indoor, [materials.number(s.material) for s in indoor], linear)
        model_soups = [
            soup_of(surfaces, [materials.number(s.material) for s in surfaces], linear) for surfaces in models.values()
        ]
        # Avatars have no texture: their colour is in the vertices.
        self._skin = materials.number(_SKIN)
        textures = materials.pack()
        self.material_names = materials.names
        outside, outer = cluster_triangles(outside, textures.double_sided)
        inside, inner = cluster_triangles(inside, textures.double_sided)
        _shift(inner.span, len(outside.triangles), len(outside.position))
        clusters = group_clusters(
            np.concatenate([outer.low, inner.low]),
            np.concatenate([outer.high, inner.high]),
            np.concatenate([outer.cone, inner.cone]),
            np.concatenate([outer.span, inner.span]),
        )
        where = np.full(len(clusters.span), OUTDOORS, np.uint8)
        where[len(outer.span) :] = INDOORS
        surfaces = join_meshes([mesh_of(outside), mesh_of(inside)])
        placeable, model_meshes = prototypes_of(model_soups, list(models), cabins or {})
        _shift(placeable.levels, len(surfaces.triangle), len(surfaces.x))
        mesh = join_meshes([surfaces, *model_meshes])
        self.names = {name: k for k, name in enumerate(models)}
        self.version = 0  # of all that stays where it is
        self.rooms = _rooms(np.zeros((0, 7)) if rooms is None else np.asarray(rooms, np.float64).reshape(-1, 7))
        self._static_size = len(mesh.triangle), len(mesh.x)
        self._lighting = lighting or Lighting()
        self._light: Light | None = None
        self.moment = 0.0
        self.shadowless = 0
        self.fronts = np.zeros(0, ROOM_FRONT)
        self.lamps = np.zeros(0, LAMP)
        self._grid: LampGrid | None = None
        # What `windows` of the arrays were made of.
        self._lit: tuple[ArrayLike | None, ArrayLike | None] = (None, None)
        self._beams = beams_of(models)
        self._shadow_key: tuple[float, ...] | None = None
        self._shadow: ShadowMap | None = None
        self._relief: ReliefMap | None = None
        self._low, self._high = _bounds(static)
        empty = Instances(
            np.zeros((0, 3, 4), np.float32),
            np.zeros(0, np.int32),
            np.zeros(0, np.int32),
            np.zeros(0, np.uint8),
            np.zeros(0, SPHERE),
            NO_GROUPS,
        )
        self._placed = self._spacious = empty
        # The mesh and the arrays whose triangles and colours it holds.
        self._clothed: tuple[Any, ...] | None = None
        self._bodies = no_avatars().span
        self.arrays = SceneArrays(
            mesh,
            textures,
            clusters,
            where,
            placeable,
            empty,
            no_avatars(),
            np.zeros(1, COUNTS)[0],
            _ALL_ON,
            NO_OPENINGS,
            _NO_BEAMS,
        )
        self.arrays.counts["fixed_vertices"] = max(widest(clusters.span), widest(placeable.levels.reshape(-1)))

    @property
    def nbytes(self) -> int:
        """Bytes of the scene's own arrays: without textures, which scenes may share."""
        drawn = sum(_bytes_of(part) for name, part in self.arrays._asdict().items() if name != "textures")
        return drawn + _bytes_of(self._placed) + _bytes_of(self._light or ())

    def share_textures(self, other: Scene) -> None:
        """Take the textures of a scene that was made later with the same palette, so that both have the same arrays."""
        self._replace(textures=other.arrays.textures)

    @property
    def lighting(self) -> Lighting:
        """The light of the moment.

        A new one costs the next picture some 20 ms for the sky, and up to a second where the direction of the shadows
        has changed: set it every few simulated minutes, not every step.
        """
        return self._lighting

    @lighting.setter
    def lighting(self, lighting: Lighting) -> None:
        if lighting != self._lighting:
            self._lighting, self._light = lighting, None

    def place(
        self, prototype_names: Sequence[str], transforms: ArrayLike, entities: ArrayLike, *, indoor: ArrayLike = False
    ) -> None:
        """Add things that stay where they are.

        Parameters
        ----------
        prototype_names
            One a thing.
        transforms
            Model to world (rotation, uniform scale, translation), shape ``(n, 4, 4)``.
        entities
            Shape ``(n,)``.
        indoor
            Whether a thing stands in a room (one value, or one a thing).
        """
        unknown = sorted({name for name in prototype_names if name not in self.names})
        if unknown:
            raise InputError(f"scene: no prototype called {unknown[0]}; there are {len(self.names)} others")
        number = np.array([self.names[name] for name in prototype_names], np.int32)
        rows = matrix_rows(transforms, len(number))
        inside = np.broadcast_to(np.asarray(indoor, bool), len(number))
        where = np.where(inside, INDOORS, OUTDOORS).astype(np.uint8)
        added = sort_by_locality(self._instances(rows, number, entities_of(entities, len(number)), where))
        moving = self._moving()
        self._placed = join_instances(self._placed, added)
        self._set_instances(moving)
        outdoors = ~inside
        if outdoors.any():
            # Shadows must reach what stands up from the static surfaces, too.
            self._low = np.minimum(self._low, rows[outdoors][:, :, 3].min(axis=0))
            self._high = np.maximum(self._high, rows[outdoors][:, :, 3].max(axis=0) + np.array([0, 0, 12.0]))
        self._light = self._shadow = self._relief = self._grid = None
        self.version += 1

    def set_rigid(
        self, prototype_index: ArrayLike, transforms: ArrayLike, entity: ArrayLike, *, shadowless: int = 0
    ) -> None:
        """Replace the things that move as a whole; `prototype_index` are values of `Scene.names`.

        The last `shadowless` of them are outdoors and throw no shadow.
        """
        number = np.atleast_1d(np.asarray(prototype_index, np.int32))
        if number.size and (number.min() < 0 or number.max() >= len(self.names)):
            raise InputError(f"scene: prototype index {int(number.max())} of {len(self.names)}")
        rows = matrix_rows(transforms, len(number))
        self.shadowless = shadowless
        where = np.full(len(number), ANYWHERE, np.uint8)
        where[len(number) - shadowless :] = SHADOWLESS
        self._replace(beams=self._beams.place(number, rows))
        self._set_instances(self._instances(rows, number, entities_of(entity, len(number)), where))

    def keep_detail(self, names: Iterable[str]) -> None:
        """Draw models in full from afar, too: those of few triangles between which nothing may be seen."""
        self.arrays.prototypes.pixels[[self.names[name] for name in names]] = 0.0

    def set_openings(self, openings: NDArray[np.void]) -> None:
        """Say which doors are not closed, `OPENING`: of what never moves, nothing is drawn within them."""
        if len(openings) or len(self.arrays.openings):
            self._replace(openings=np.ascontiguousarray(openings))

    def set_skinned(
        self,
        vertices: NDArray[np.float32],
        normals: NDArray[np.float32],
        triangles: NDArray[np.int32],
        colour: NDArray[np.uint8],
        entity: NDArray[np.int32],
        *,
        drawn: NDArray[np.int64] | None = None,
        limbs: NDArray[np.float32] | None = None,
    ) -> None:
        """Replace the posed avatars: all bodies in one mesh, each body's triangles and vertices in a row.

        Parameters
        ----------
        vertices, normals
            World positions and unit normals, float32, shape ``(V, 3)``.
        triangles
            int32, shape ``(T, 3)``. Passing the same arrays of triangles, colours and entities again is cheaper than
            passing equal ones; they must not be changed in between.
        colour
            sRGB, uint8, shape ``(V, 3)``.
        entity
            int32, shape ``(V,)``; a change of value starts the next body.
        drawn
            Which bodies are there at all, ascending; the vertices of the others are not read. None: every one.
        limbs
            Capsules of all bodies as from `vico.render.skinning.skin`: what throws their shadows. Without, ellipsoids
            do.
        """
        vertex_count, triangle_count = len(vertices), len(triangles)
        if not vertex_count or not triangle_count:
            self._replace(avatars=no_avatars())
            self._clothed = None
            self.arrays.counts["avatars"] = 0
            return
        first_triangle, first_vertex = self._static_size
        mesh = self.arrays.mesh
        if len(mesh.x) < first_vertex + vertex_count or len(mesh.triangle) < first_triangle + triangle_count:
            mesh = with_avatar_capacity(mesh, self._static_size, vertex_count * 5 // 4, triangle_count * 5 // 4)
            self._replace(mesh=mesh)
        known = self._clothed
        if known is None or any(a is not b for a, b in zip(known, (mesh, triangles, colour, entity), strict=True)):
            self._clothed = None
            self._bodies = self._clothe(mesh, triangles, colour, entity)
            self._clothed = (mesh, triangles, colour, entity)
        span = self._bodies if drawn is None else self._bodies[drawn]
        shown = limbs if drawn is None or limbs is None else limbs[drawn]
        self._pose(vertices, normals, span, shown, first=first_vertex)
        self.arrays.counts["avatars"] = len(span)

    def repose(
        self,
        vertices: NDArray[np.float32],
        normals: NDArray[np.float32],
        limbs: NDArray[np.float32] | None = None,
        *,
        span: NDArray[np.void] | None = None,
    ) -> None:
        """Move avatars to other places.

        Parameters
        ----------
        vertices, normals
            From the first vertex of the first avatar to the last one of the last, float32, shape ``(V, 3)``; those of
            avatars between that are not there are not read.
        limbs
            Those of the avatars that are there, as `PosedAvatars` has them.
        span
            Which are there, as `PosedAvatars` has them; None: those that are now.

        Raises
        ------
        InputError
            If there are not as many vertices, or one is not finite.
        """
        span = self.arrays.avatars.span if span is None else span
        first = int(span["first_vertex"].min()) if len(span) else 0
        wanted = int(span["end_vertex"].max(initial=first)) - first
        if len(vertices) != wanted or len(normals) != wanted:
            raise InputError(f"scene: {len(vertices)} vertices and {len(normals)} normals for avatars of {wanted}")
        self._pose(vertices, normals, span, limbs, first=first)
        self.arrays.counts["avatars"] = len(span)

    def _pose(
        self,
        vertices: NDArray[np.float32],
        normals: NDArray[np.float32],
        span: NDArray[np.void],
        limbs: NDArray[np.float32] | None,
        *,
        first: int,
    ) -> None:
        low, high = np.zeros((len(span), 3), np.float32), np.zeros((len(span), 3), np.float32)
        posed = np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(normals, np.float32)
        if not pose_avatars(self.arrays.mesh, *posed, first, span, low, high):
            raise InputError("scene: a vertex of an avatar is not finite")
        if limbs is None or len(limbs) != len(span):
            limbs = np.zeros((0, len(LIMBS), 7), np.float32)
        self._replace(avatars=PosedAvatars(low, high, span, np.ascontiguousarray(limbs, np.float32)))

    def _clothe(
        self, mesh: Mesh, triangles: NDArray[np.int32], colour: NDArray[np.uint8], entity: NDArray[np.int32]
    ) -> NDArray[np.void]:
        """Write what of the avatars no pose changes; return each body's `SPAN`."""
        first_triangle, first_vertex = self._static_size
        topology = np.ascontiguousarray(triangles, np.int32)
        owner = np.ascontiguousarray(entity, np.int32)
        if topology.min() < 0 or topology.max() >= len(owner):
            raise InputError("scene: an avatar's triangle names a vertex that is not there")
        change = np.flatnonzero(np.diff(owner[topology[:, 0]])) + 1
        starts = np.concatenate([[0], change])
        ends = np.append(starts[1:], len(topology))
        vertices = slice(first_vertex, first_vertex + len(owner))
        own = mesh.vertex[vertices]
        own["u"] = own["v"] = 0.0
        own["colour"] = linear_table()[colour]
        faces = slice(first_triangle, first_triangle + len(topology))
        mesh.triangle[faces]["vertices"] = topology + np.int32(first_vertex)
        mesh.triangle[faces]["material"] = self._skin
        mesh.entity[faces] = owner[topology[:, 0]]
        least = np.minimum.reduceat(topology.min(axis=1), starts)
        most = np.maximum.reduceat(topology.max(axis=1), starts)
        return spans(first_triangle + starts, first_triangle + ends, first_vertex + least, first_vertex + most + 1)

    def light(self) -> Light:
        """Return the tables the shader reads, made anew where the light or the static scene has changed."""
        if self._light is None:
            light = self._lighting
            sun = unit(light.shadow_direction or light.sun_direction)
            low, high = self._low, self._high + np.array([0.0, 0.0, 2.0])
            if self._shadow is None or self._shadow_key != tuple(sun):
                side = float((high - low)[:2].max())
                size = int(np.clip(2 ** math.ceil(math.log2(max(side / _SHADOW_METRES, 1.0))), 64, 2048))
                self._shadow = shadow_map(self.arrays, sun, low, high, size)
                self._shadow_key = tuple(sun)
            if self._relief is None:
                side = float((high - low)[:2].max())
                self._relief = relief_map(self.arrays, low, high, int(np.clip(side / _RELIEF_METRES, 16, 768)), 4.5)
            uniforms, tone = light_uniforms(light), tone_table()
            sky = np.zeros(SKY_SIZE * SKY_SIZE, np.uint32)
            paint_sky(uniforms, sky_table(light), cloud_map(), tone, sky)
            self._light = Light(uniforms, tone, sky, self._shadow, self._relief, self._shining())
        return self._light

    def _shining(self) -> LampGrid:
        """Return the lamps as they shine now."""
        if self._lighting.lamps <= 0.0 or not len(self.lamps):
            return NO_LAMPS
        if self._grid is None:
            self._grid = lamp_grid(self.lamps, built_tops(self.arrays, self._low, self._high))
        return shining_lamps(self._grid, self._lighting, self.arrays.windows)

    def light_rooms(self, lamp: ArrayLike, daylight: float) -> None:
        """Switch each room's lamps on, 0..1, shape ``(r,)``, and let a share of the daylight in by its windows."""
        self.rooms["lamp"] = lamp
        self.rooms["daylight"] = daylight * self.rooms["windows"]

    def light_windows(self, entities: ArrayLike | None, shares: ArrayLike | None = None) -> None:
        """Switch on shares of the light of buildings' windows.

        Parameters
        ----------
        entities
            Buildings, each once, in any order, shape ``(n,)``; all windows of others are on. None: those of all are.
            Passing the same arrays again is cheaper than passing equal ones; they must not be changed in between.
        shares
            Of upper floors and of the ground floor, 0..1, shape ``(n, 2)``; needed with `entities`.
        """
        if entities is self._lit[0] and shares is self._lit[1]:
            return
        self._lit = entities, shares
        windows = _ALL_ON if entities is None else _lit_windows(entities, shares)
        if not np.array_equal(windows, self.arrays.windows):
            self._replace(windows=windows)
            if self._light is not None:
                self._light = self._light._replace(
                    lamps=self._shining()
                )  # another one, for those who keep pictures taken by it

    def room_of(self, position: NDArray[np.float64]) -> Record | None:
        """Return the `ROOM` that holds a point, or None."""
        number = self.room_number(position)
        return self.rooms[number] if number >= 0 else None

    def room_number(self, position: NDArray[np.float64]) -> int:
        """Return the row of `rooms` that holds a point, or -1."""
        return int(_room_of(self.rooms, float(position[0]), float(position[1]), float(position[2])))

    def _moving(self) -> Instances:
        moving = slice(int(self.arrays.counts["static_instances"]), int(self.arrays.counts["instances"]))
        all_of = self.arrays.instances
        return Instances(
            all_of.matrix[moving],
            all_of.prototype[moving],
            all_of.entity[moving],
            all_of.where[moving],
            all_of.sphere[moving],
            NO_GROUPS,
        )

    def _instances(
        self,
        rows: NDArray[np.float32],
        number: NDArray[np.int32],
        entity: NDArray[np.int32],
        where: NDArray[np.uint8],
    ) -> Instances:
        """Return placed prototypes with their bounding spheres."""
        low, high = self.arrays.prototypes.low[number], self.arrays.prototypes.high[number]
        centre = np.einsum("nij,nj->ni", rows[:, :, :3], (low + high) / 2) + rows[:, :, 3]
        scale = np.linalg.norm(rows[:, :, :3], axis=1).max(axis=1) if len(rows) else np.zeros(0)
        sphere = np.zeros(len(rows), SPHERE)
        sphere["x"], sphere["y"], sphere["z"] = centre.T
        # A hair more than exact, for the rounding.
        sphere["radius"] = np.linalg.norm(high - low, axis=1) / 2 * scale * 1.001
        return Instances(rows, number, entity, where, sphere, NO_GROUPS)

    def _set_instances(self, moving: Instances) -> None:
        """Put what moves behind what stays; copying all that stays is left for when there is no room."""
        fixed, count = len(self._placed.entity), len(moving.entity)
        if self._spacious is not self._placed or len(self.arrays.instances.entity) < fixed + count:
            self._replace(instances=with_spare_capacity(self._placed, count * 5 // 4 + 8))
            self._spacious = self._placed
        all_of, rows = self.arrays.instances, slice(fixed, fixed + count)
        all_of.matrix[rows], all_of.prototype[rows], all_of.entity[rows] = (
            moving.matrix,
            moving.prototype,
            moving.entity,
        )
        all_of.where[rows], all_of.sphere[rows] = moving.where, moving.sphere
        self.arrays.counts["instances"], self.arrays.counts["static_instances"] = fixed + count, fixed

    def _replace(
        self, **changed: Mesh | Textures | Instances | PosedAvatars | NDArray[np.float32] | NDArray[np.void]
    ) -> None:
        self.arrays = self.arrays._replace(**changed)  # type: ignore[arg-type]


def _bounds(surfaces: Sequence[Surface]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the corners of the box around some surfaces, in single precision as meshes have them."""
    used = [surface.positions[_are_used(surface)] for surface in surfaces if len(surface.triangles)]
    if not used:
        return np.zeros(3), np.ones(3)
    low = np.min([points.min(axis=0) for points in used], axis=0)
    high = np.max([points.max(axis=0) for points in used], axis=0)
    return low.astype(np.float32).astype(np.float64), high.astype(np.float32).astype(np.float64)


def _bytes_of(part: Any) -> int:
    """Return the bytes of an array, or of all arrays in a tuple."""
    return sum(map(_bytes_of, part)) if isinstance(part, tuple) else int(getattr(part, "nbytes", 0))


def _are_used(surface: Surface) -> NDArray[np.bool_]:
    """Return which vertices of a surface a triangle has."""
    used = np.zeros(len(surface.positions), np.bool_)
    used[surface.triangles] = True
    return used


def _lit_windows(entities: ArrayLike, shares: ArrayLike | None) -> NDArray[np.void]:
    """Return `LIT_WINDOWS` in their order."""
    buildings = np.asarray(entities, np.int32).reshape(-1)
    on = np.asarray([] if shares is None else shares, np.float32)
    if on.shape != (len(buildings), 2):
        raise InputError(f"scene: shares of windows have shape {on.shape}, not ({len(buildings)}, 2)")
    order = np.argsort(buildings, kind="stable")
    windows = np.zeros(len(buildings), LIT_WINDOWS)
    windows["building"], windows["shares"] = buildings[order], on[order]
    return windows


def _rooms(boxes: NDArray[np.float64]) -> NDArray[np.void]:
    """Return `ROOM` records of rows in their order."""
    rooms = np.zeros(len(boxes), ROOM)
    for name, column in zip(("x", "y", "z", "half_length", "half_width", "height", "yaw"), boxes.T, strict=True):
        rooms[name] = column
    for name in ("windows", "lamp", "daylight"):
        rooms[name] = 1.0
    return rooms


def _shift(span: NDArray[np.void], triangles: int, vertices: int) -> None:
    """Make room for triangles and vertices before those of `SPAN` records."""
    span["first_triangle"] += triangles
    span["end_triangle"] += triangles
    span["first_vertex"] += vertices
    span["end_vertex"] += vertices


@kernel
def _room_of(rooms: NDArray[np.void], x: float, y: float, z: float) -> int:
    """Return the number of the room that holds a point, or -1."""
    for k in range(len(rooms)):
        room = rooms[k]
        dx, dy, dz = x - room.x, y - room.y, z - room.z
        if not -0.05 <= dz <= room.height:
            continue
        if dx * dx + dy * dy > (room.half_length**2 + room.half_width**2) * 1.01:
            continue
        c, s = np.cos(room.yaw), np.sin(room.yaw)
        if abs(dx * c + dy * s) <= room.half_length and abs(dy * c - dx * s) <= room.half_width:
            return k
    return -1
