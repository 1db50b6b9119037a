"""What is there to see: static surfaces, placed prototypes, and what moves, replaced each frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from vico.errors import InputError
from vico.render.arrays import ANYWHERE, CROWD, INDOORS, OUTDOORS, Arrays, Avatars, Groups, Instances, Prototypes
from vico.render.geometry import Mesh, Soup, clustered, grouped, joined_meshes, mesh_of, simplified, soup_of
from vico.render.lighting import Lighting, cloud_map, light_numbers, linear_table, sky_table, tone_table, unit
from vico.render.shade import SKY_SIZE, Light, paint_sky
from vico.render.shadows import relief_map, shadow_map
from vico.render.textures import DOUBLE_SIDED, pack_textures
from vico.world.mesh import Material, Surface

# A level of detail is left for the next coarser one below these sizes on screen, pixels.
_LEVEL_PIXELS = (1e9, 48.0, 20.0)
_LEVEL_CELLS = (0.07, 0.16)
_SHADOW_METRES, _RELIEF_METRES = 0.4, 1.5


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
    lighting
        The light of the moment; assign `Scene.lighting` to change it.

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
        lighting: Lighting | None = None,
    ) -> None:
        models = dict(prototypes or {})
        materials = _Materials()
        linear = linear_table()
        outside = soup_of(static, [materials.number(s.material) for s in static], linear)
        inside = soup_of(indoor, [materials.number(s.material) for s in indoor], linear)
        model_soups = [
            soup_of(surfaces, [materials.number(s.material) for s in surfaces], linear) for surfaces in models.values()
        ]
        # Avatars have no texture: their colour is in the vertices.
        self._skin = materials.number(Material("vico skin"))
        textures = pack_textures(materials.entries)
        both = (textures.flags & DOUBLE_SIDED) != 0
        outside, outer = clustered(outside, both)
        inside, inner = clustered(inside, both)
        triangles, vertices = len(outside.triangles), len(outside.position)
        inner.span[:] += np.array([triangles, triangles, vertices, vertices], np.int32)
        clusters = grouped(
            np.concatenate([outer.low, inner.low]),
            np.concatenate([outer.high, inner.high]),
            np.concatenate([outer.cone, inner.cone]),
            np.concatenate([outer.span, inner.span]),
        )
        where = np.full(len(clusters.span), OUTDOORS, np.uint8)
        where[len(outer.span) :] = INDOORS
        meshes = [mesh_of(outside), mesh_of(inside)]
        triangles, vertices = triangles + len(inside.triangles), vertices + len(inside.position)
        levels = np.zeros((len(models), 3, 4), np.int32)
        bounds = np.zeros((2, len(models), 3), np.float32)
        pixels = np.tile(np.array(_LEVEL_PIXELS, np.float32), (len(models), 1))
        for k, soup in enumerate(model_soups):
            if not len(soup.triangles):
                continue
            bounds[:, k] = soup.position.min(axis=0), soup.position.max(axis=0)
            size = float(np.linalg.norm(bounds[1, k] - bounds[0, k]))
            for level in range(3):
                coarse: Soup | None = soup
                if level:
                    coarse = simplified(soup, max(size * _LEVEL_CELLS[level - 1], 1e-6))
                    if coarse is None:
                        levels[k, level] = levels[k, level - 1]
                        continue
                assert coarse is not None
                counts = len(coarse.triangles), len(coarse.position)
                levels[k, level] = triangles, triangles + counts[0], vertices, vertices + counts[1]
                triangles, vertices = triangles + counts[0], vertices + counts[1]
                meshes.append(mesh_of(coarse))
        mesh = joined_meshes(meshes)
        self.names = {name: k for k, name in enumerate(models)}
        self.version = 0  # of all that stays where it is
        self.rooms = np.zeros((0, 7)) if rooms is None else np.asarray(rooms, np.float64).reshape(-1, 7)
        self._static_size = len(mesh.triangle), len(mesh.x)
        self._lighting = lighting or Lighting()
        self._light: Light | None = None
        self._shadow_key: tuple[float, ...] | None = None
        self._shadow: tuple[NDArray[np.uint16], NDArray[np.float32]] | None = None
        self._relief: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None
        self._low = outer.low.min(axis=0).astype(np.float64) if len(outer.low) else np.zeros(3)
        self._high = outer.high.max(axis=0).astype(np.float64) if len(outer.high) else np.ones(3)
        empty = Instances(
            np.zeros((0, 12), np.float32),
            np.zeros(0, np.int32),
            np.zeros(0, np.int32),
            np.zeros(0, np.uint8),
            np.zeros((0, 4), np.float32),
            _NO_GROUPS,
        )
        self._placed = self._spacious = empty
        # The mesh and the arrays whose triangles and colours it holds.
        self._clothed: tuple[Any, ...] | None = None
        self.arrays = Arrays(
            mesh,
            textures,
            clusters,
            where,
            Prototypes(bounds[0], bounds[1], levels, pixels),
            empty,
            _no_avatars(),
            np.zeros(3, np.int64),
        )

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
        rows = _rows(transforms, len(number))
        inside = np.broadcast_to(np.asarray(indoor, bool), len(number))
        where = np.where(inside, INDOORS, OUTDOORS).astype(np.uint8)
        added = _neighbours_together(self._instances(rows, number, _entities(entities, len(number)), where))
        moving = self._moving()
        self._placed = _joined(self._placed, added)
        self._set_instances(moving)
        outdoors = ~inside
        if outdoors.any():
            # Shadows must reach what stands up from the static surfaces, too.
            self._low = np.minimum(self._low, rows[outdoors][:, [3, 7, 11]].min(axis=0))
            self._high = np.maximum(self._high, rows[outdoors][:, [3, 7, 11]].max(axis=0) + np.array([0, 0, 12.0]))
        self._light = self._shadow = self._relief = None
        self.version += 1

    def set_rigid(self, prototype_index: ArrayLike, transforms: ArrayLike, entity: ArrayLike) -> None:
        """Replace the things that move as a whole; `prototype_index` are values of `Scene.names`."""
        number = np.atleast_1d(np.asarray(prototype_index, np.int32))
        if number.size and (number.min() < 0 or number.max() >= len(self.names)):
            raise InputError(f"scene: prototype index {int(number.max())} of {len(self.names)}")
        rows = _rows(transforms, len(number))
        where = np.full(len(number), ANYWHERE, np.uint8)
        self._set_instances(self._instances(rows, number, _entities(entity, len(number)), where))

    def set_skinned(
        self,
        vertices: NDArray[np.float32],
        normals: NDArray[np.float32],
        triangles: NDArray[np.int32],
        colour: NDArray[np.uint8],
        entity: NDArray[np.int32],
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
        """
        vertex_count, triangle_count = len(vertices), len(triangles)
        if not vertex_count or not triangle_count:
            self._replace(avatars=_no_avatars())
            self._clothed = None
            self.arrays.counts[2] = 0
            return
        first_triangle, first_vertex = self._static_size
        mesh = self.arrays.mesh
        if len(mesh.x) < first_vertex + vertex_count or len(mesh.triangle) < first_triangle + triangle_count:
            mesh = _with_room(mesh, self._static_size, vertex_count * 5 // 4, triangle_count * 5 // 4)
            self._replace(mesh=mesh)
        known = self._clothed
        if known is None or any(a is not b for a, b in zip(known, (mesh, triangles, colour, entity), strict=True)):
            self._clothed = None
            span = self._clothe(mesh, triangles, colour, entity)
            self._clothed = (mesh, triangles, colour, entity)
        else:
            span = self.arrays.avatars.span
        low, high = np.zeros((len(span), 3), np.float32), np.zeros((len(span), 3), np.float32)
        posed = np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(normals, np.float32)
        if not _pose_avatars(mesh, *posed, first_vertex, span, low, high):
            raise InputError("scene: a vertex of an avatar is not finite")
        self._replace(avatars=Avatars(low, high, span))
        self.arrays.counts[2] = len(span)

    def _clothe(
        self, mesh: Mesh, triangles: NDArray[np.int32], colour: NDArray[np.uint8], entity: NDArray[np.int32]
    ) -> NDArray[np.int32]:
        """Write what of the avatars no pose changes; returns each body's range of triangles and vertices."""
        first_triangle, first_vertex = self._static_size
        topology = np.ascontiguousarray(triangles, np.int32)
        owner = np.ascontiguousarray(entity, np.int32)
        if topology.min() < 0 or topology.max() >= len(owner):
            raise InputError("scene: an avatar's triangle names a vertex that is not there")
        change = np.flatnonzero(np.diff(owner[topology[:, 0]])) + 1
        starts = np.concatenate([[0], change])
        ends = np.append(starts[1:], len(topology))
        vertices = slice(first_vertex, first_vertex + len(owner))
        mesh.corner[vertices, 6:8] = 0.0
        mesh.corner[vertices, 8:11] = linear_table()[colour]
        faces = slice(first_triangle, first_triangle + len(topology))
        mesh.triangle[faces, :3] = topology + np.int32(first_vertex)
        mesh.triangle[faces, 3] = self._skin
        mesh.entity[faces] = owner[topology[:, 0]]
        least = np.minimum.reduceat(topology.min(axis=1), starts)
        most = np.maximum.reduceat(topology.max(axis=1), starts)
        span = [first_triangle + starts, first_triangle + ends, first_vertex + least, first_vertex + most + 1]
        return np.stack(span, axis=1).astype(np.int32)

    def light(self) -> Light:
        """The tables the shader reads, made anew where the light or the static scene has changed."""
        if self._light is None:
            light = self._lighting
            sun = unit(light.shadow_direction or light.sun_direction)
            low, high = self._low, self._high + np.array([0.0, 0.0, 2.0])
            if self._shadow is None or self._shadow_key != tuple(sun):
                side = float((high - low)[:2].max())
                size = int(np.clip(2 ** np.ceil(np.log2(max(side / _SHADOW_METRES, 1.0))), 64, 2048))
                self._shadow = shadow_map(self.arrays, sun, low, high, size)
                self._shadow_key = tuple(sun)
            if self._relief is None:
                side = float((high - low)[:2].max())
                self._relief = relief_map(self.arrays, low, high, int(np.clip(side / _RELIEF_METRES, 16, 768)), 4.5)
            numbers, tone = light_numbers(light), tone_table()
            sky = np.zeros(SKY_SIZE * SKY_SIZE, np.uint32)
            paint_sky(numbers, sky_table(light), cloud_map(), tone, sky)
            self._light = Light(numbers, tone, sky, *self._shadow, *self._relief)
        return self._light

    def room_of(self, position: NDArray[np.float64]) -> int:
        """Number of the room that holds a point, or -1."""
        return int(_room_of(self.rooms, float(position[0]), float(position[1]), float(position[2])))

    def _moving(self) -> Instances:
        moving = slice(int(self.arrays.counts[1]), int(self.arrays.counts[0]))
        all_of = self.arrays.instances
        return Instances(
            all_of.matrix[moving],
            all_of.prototype[moving],
            all_of.entity[moving],
            all_of.where[moving],
            all_of.sphere[moving],
            _NO_GROUPS,
        )

    def _instances(
        self,
        rows: NDArray[np.float32],
        number: NDArray[np.int32],
        entity: NDArray[np.int32],
        where: NDArray[np.uint8],
    ) -> Instances:
        """Placed prototypes with their bounding spheres."""
        low, high = self.arrays.prototypes.low[number], self.arrays.prototypes.high[number]
        matrices = rows.reshape(-1, 3, 4)
        centre = np.einsum("nij,nj->ni", matrices[:, :, :3], (low + high) / 2) + matrices[:, :, 3]
        scale = np.linalg.norm(matrices[:, :, :3], axis=1).max(axis=1) if len(rows) else np.zeros(0)
        # A hair more than exact, for the rounding.
        radius = np.linalg.norm(high - low, axis=1) / 2 * scale * 1.001
        sphere = np.concatenate([centre, radius[:, None]], axis=1).astype(np.float32)
        return Instances(rows, number, entity, where, sphere, _NO_GROUPS)

    def _set_instances(self, moving: Instances) -> None:
        """Put what moves behind what stays; copying all that stays is left for when there is no room."""
        fixed, count = len(self._placed.entity), len(moving.entity)
        if self._spacious is not self._placed or len(self.arrays.instances.entity) < fixed + count:
            self._replace(instances=_with_spare(self._placed, count * 5 // 4 + 8))
            self._spacious = self._placed
        all_of, rows = self.arrays.instances, slice(fixed, fixed + count)
        all_of.matrix[rows], all_of.prototype[rows], all_of.entity[rows] = (
            moving.matrix,
            moving.prototype,
            moving.entity,
        )
        all_of.where[rows], all_of.sphere[rows] = moving.where, moving.sphere
        self.arrays.counts[0], self.arrays.counts[1] = fixed + count, fixed

    def _replace(
        self, *, mesh: Mesh | None = None, instances: Instances | None = None, avatars: Avatars | None = None
    ) -> None:
        a = self.arrays
        self.arrays = Arrays(
            mesh or a.mesh,
            a.textures,
            a.clusters,
            a.cluster_where,
            a.prototypes,
            instances or a.instances,
            avatars or a.avatars,
            a.counts,
        )


class _Materials:
    """Numbers for materials: equal objects share one."""

    def __init__(self) -> None:
        self.entries: list[Material] = []
        self._known: dict[int, int] = {}

    def number(self, material: Material) -> int:
        if id(material) not in self._known:
            self._known[id(material)] = len(self.entries)
            self.entries.append(material)
        return self._known[id(material)]


def _no_avatars() -> Avatars:
    return Avatars(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32), np.zeros((0, 4), np.int32))


def _joined(a: Instances, b: Instances) -> Instances:
    where, sphere = np.concatenate([a.where, b.where]), np.concatenate([a.sphere, b.sphere])
    return Instances(
        np.concatenate([a.matrix, b.matrix]),
        np.concatenate([a.prototype, b.prototype]),
        np.concatenate([a.entity, b.entity]),
        where,
        sphere,
        _groups_of(where, sphere),
    )


def _with_spare(a: Instances, spare: int) -> Instances:
    def wide(values: NDArray[Any]) -> NDArray[Any]:
        return np.concatenate([values, np.zeros((spare, *values.shape[1:]), values.dtype)])

    return Instances(wide(a.matrix), wide(a.prototype), wide(a.entity), wide(a.where), wide(a.sphere), a.groups)


_NO_GROUPS = Groups(
    np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32), np.zeros(0, np.uint8), np.zeros(0, np.float32)
)


def _groups_of(where: NDArray[np.uint8], sphere: NDArray[np.float32]) -> Groups:
    if not len(where):
        return _NO_GROUPS
    starts = np.arange(0, len(where), CROWD)
    radius = sphere[:, 3:]
    # A hair more than exact, for the rounding of sums in single precision.
    low = np.minimum.reduceat(sphere[:, :3] - radius, starts) - np.float32(0.001)
    high = np.maximum.reduceat(sphere[:, :3] + radius, starts) + np.float32(0.001)
    least, most = np.minimum.reduceat(where, starts), np.maximum.reduceat(where, starts)
    mixed = np.where(least == most, least, np.uint8(ANYWHERE)).astype(np.uint8)
    return Groups(low, high, mixed, np.maximum.reduceat(radius[:, 0], starts))


def _neighbours_together(a: Instances) -> Instances:
    """The same things in another order: outdoors, then indoors, each along a curve that fills space."""
    if not len(a.entity):
        return a
    centre = a.sphere[:, :3].astype(np.float64)
    cell = np.floor((centre - centre.min(axis=0)) / max(float(np.ptp(centre, axis=0).max()), 1e-6) * 1023.0)
    code = np.zeros(len(cell), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cell[:, axis].astype(np.int64) >> bit) & 1) << (3 * bit + axis)
    order = np.lexsort((np.arange(len(code)), code, a.where))
    return Instances(a.matrix[order], a.prototype[order], a.entity[order], a.where[order], a.sphere[order], a.groups)


def _rows(transforms: ArrayLike, count: int) -> NDArray[np.float32]:
    matrices = np.asarray(transforms, np.float32)
    if matrices.shape != (count, 4, 4):
        raise InputError(f"scene: transforms of shape {matrices.shape}; expected ({count}, 4, 4)")
    if not np.isfinite(matrices).all():
        raise InputError("scene: a transform is not finite")
    return np.ascontiguousarray(matrices[:, :3].reshape(count, 12))


def _entities(values: ArrayLike, count: int) -> NDArray[np.int32]:
    entities = np.atleast_1d(np.asarray(values, np.int32))
    if entities.shape != (count,):
        raise InputError(f"scene: entities of shape {entities.shape}; expected ({count},)")
    return np.ascontiguousarray(entities)


def _with_room(mesh: Mesh, used: tuple[int, int], vertices: int, triangles: int) -> Mesh:
    """A copy of the static part with space for avatars behind it."""
    t, v = used

    def grown(values: NDArray[Any], keep: int, extra: int) -> NDArray[Any]:
        return np.concatenate([values[:keep], np.zeros((extra, *values.shape[1:]), values.dtype)])

    return Mesh(
        grown(mesh.x, v, vertices),
        grown(mesh.y, v, vertices),
        grown(mesh.z, v, vertices),
        grown(mesh.corner, v, vertices),
        grown(mesh.triangle, t, triangles),
        grown(mesh.entity, t, triangles),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _room_of(rooms: NDArray[np.float64], x: float, y: float, z: float) -> int:
    for k in range(len(rooms)):
        dx, dy, dz = x - rooms[k, 0], y - rooms[k, 1], z - rooms[k, 2]
        if not -0.05 <= dz <= rooms[k, 5]:
            continue
        if dx * dx + dy * dy > (rooms[k, 3] ** 2 + rooms[k, 4] ** 2) * 1.01:
            continue
        c, s = np.cos(rooms[k, 6]), np.sin(rooms[k, 6])
        if abs(dx * c + dy * s) <= rooms[k, 3] and abs(dy * c - dx * s) <= rooms[k, 4]:
            return k
    return -1


@njit(cache=True, nogil=True, error_model="numpy")
def _pose_avatars(
    mesh: Mesh,
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
    first_vertex: int,
    span: NDArray[np.int32],
    low: NDArray[np.float32],
    high: NDArray[np.float32],
) -> bool:
    """Write positions, normals and bounds; False if a position is not finite."""
    xs, ys, zs, corners = mesh.x, mesh.y, mesh.z, mesh.corner
    total = np.float32(0.0)
    for i in range(len(vertices)):
        k = first_vertex + i
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        xs[k], ys[k], zs[k] = x, y, z
        # Zero for finite numbers, else none.
        total += (x - x) + (y - y) + (z - z)
        corner = corners[k]
        corner[0], corner[1], corner[2] = x, y, z
        corner[3], corner[4], corner[5] = normals[i, 0], normals[i, 1], normals[i, 2]
    for body in range(len(span)):
        for axis in range(3):
            line = xs if axis == 0 else (ys if axis == 1 else zs)
            smallest = largest = line[span[body, 2]]
            for v in range(span[body, 2], span[body, 3]):
                smallest, largest = min(smallest, line[v]), max(largest, line[v])
            low[body, axis], high[body, axis] = smallest, largest
    return bool(total == 0.0)
