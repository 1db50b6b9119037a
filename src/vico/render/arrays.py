"""A scene and a thread's scratch memory as plain arrays, for the compiled code; offsets of the shader's queue."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.geometry import Clusters, Mesh
from vico.render.materials import Textures
from vico.render.records import BOX, MODEL_VIEW, TRIANGLE_SETUP

# Spare places behind a picture's last pixel: `fill` and shadows work in blocks.
PAD = 32
# Pixels along a tile of the coarse depth buffer, and tiles along a block of the coarser one above it.
TILE, BLOCK = 8, 4
# Triangles whose setup the shader keeps at hand; a power of two.
SETUPS = 2048
# Where a thing is.
OUTDOORS = 0
INDOORS = 1
ANYWHERE = 2
SHADOWLESS = 3  # outdoors, and darkens nothing
# Static instances that are looked at together.
INSTANCE_GROUP = 48
# Rows of `Buffers.vertex`: camera frame, metres; picture, pixels; 1 / metres.
VIEW_X, VIEW_Y, VIEW_Z, SCREEN_X, SCREEN_Y, INVERSE_DEPTH = range(6)
# The shader's queue: places for pixels, and from one field to the next. Runs are laid down in blocks of `RUN`, over the
# end, too. See `vico.render.shading.pixels` for the fields.
QUEUE, RUN = 256, 8
STRIDE = QUEUE + 2 * RUN
REAL_FIELDS, WHOLE_FIELDS = 24, 15


class Prototypes(NamedTuple):
    """Meshes that are drawn many times.

    Attributes
    ----------
    low, high
        Bounds in model space, metres, float32, shape ``(p, 3)``.
    levels
        Each level of detail, finest first, `SPAN`, shape ``(p, 3)``.
    pixels
        A level is used below this size on screen, pixels, float32, shape ``(p, 3)``.
    cabin
        Row of `cabins` of what can be looked into, else -1, int32, shape ``(p,)``.
    cabins
        `CABIN`, at least one.
    """

    low: NDArray[np.float32]
    high: NDArray[np.float32]
    levels: NDArray[np.void]
    pixels: NDArray[np.float32]
    cabin: NDArray[np.int32]
    cabins: NDArray[np.void]


class InstanceGroups(NamedTuple):
    """Neighbours among the static instances, `INSTANCE_GROUP` at a time, shape ``(g, ...)``.

    Attributes
    ----------
    low, high
        Corners of a box around them, world metres, float32.
    where
        OUTDOORS or INDOORS if all are, else ANYWHERE, uint8.
    radius
        Of the largest bounding sphere among them, metres, float32.
    """

    low: NDArray[np.float32]
    high: NDArray[np.float32]
    where: NDArray[np.uint8]
    radius: NDArray[np.float32]


class Instances(NamedTuple):
    """Placed prototypes: the static ones first, in groups of neighbours; then what moves; then spare room.

    Attributes
    ----------
    matrix
        Upper three rows of the model-to-world transform, metres, float32, shape ``(n, 3, 4)``.
    prototype
        Row of `Prototypes`, int32, shape ``(n,)``.
    entity
        Id in segmentation images where the prototype's triangles have none, int32, shape ``(n,)``.
    where
        OUTDOORS, INDOORS, ANYWHERE or SHADOWLESS, uint8, shape ``(n,)``.
    sphere
        Bounding sphere in the world, `SPHERE`, shape ``(n,)``.
    groups
        Of the static ones.
    """

    matrix: NDArray[np.float32]
    prototype: NDArray[np.int32]
    entity: NDArray[np.int32]
    where: NDArray[np.uint8]
    sphere: NDArray[np.void]
    groups: InstanceGroups


class PosedAvatars(NamedTuple):
    """Posed bodies.

    Attributes
    ----------
    low, high
        Bounds, world metres, float32, shape ``(a, 3)``.
    span
        Triangles and vertices of each, `SPAN`, shape ``(a,)``.
    limbs
        Capsules that throw each one's shadow, both ends and radius, world metres, float32, shape ``(a, limbs, 7)``;
        none where they are not known.
    """

    low: NDArray[np.float32]
    high: NDArray[np.float32]
    span: NDArray[np.void]
    limbs: NDArray[np.float32]


class SceneArrays(NamedTuple):
    """A whole scene for the compiled code.

    *Items* are what is drawn as one; their codes count clusters first, then instances, then avatars.

    Attributes
    ----------
    mesh, textures, clusters, prototypes, instances, avatars
        See there.
    cluster_where
        OUTDOORS or INDOORS, uint8, shape ``(c,)``.
    counts
        A `COUNTS` record.
    windows
        `LIT_WINDOWS`, ascending by building. All windows of buildings that are not among them are on.
    openings
        Doors that are not closed, `OPENING`.
    beams
        Headlights, `LAMP`, of what moves.
    """

    mesh: Mesh
    textures: Textures
    clusters: Clusters
    cluster_where: NDArray[np.uint8]
    prototypes: Prototypes
    instances: Instances
    avatars: PosedAvatars
    counts: Any
    windows: NDArray[np.void]
    openings: NDArray[np.void]
    beams: NDArray[np.void]


class Buffers(NamedTuple):
    """Scratch memory of one thread, for pictures of one size.

    Attributes
    ----------
    keys
        Inverse depth and triangle number of each pixel (see `vico.render.visibility.rasteriser`), uint64, ``(h * w +
        PAD,)``.
    tiles, blocks
        Bits of the inverse of the farthest depth in each tile, and in each block of tiles, uint32.
    strip
        One row of keys, uint64, shape ``(w,)``.
    vertex
        Vertices of one item; rows as named above, float32, shape ``(6, most)``.
    model_view, box
        `MODEL_VIEW` and `BOX` of one item.
    candidate, bucket, ordered
        What may be in view, its distance as a small number, and the same nearest first, int32.
    drawn
        Codes of the items that were drawn, int32.
    base
        First triangle number (from 1 up) of each drawn item, then the end, int64.
    first_triangle
        Row of the mesh of each drawn item's first triangle, int32.
    slot
        Where in `drawn` an item is, -1: nowhere, int32.
    sun, contact
        What moving things leave of the sun and of the light at the ground, 0..1, float32, shape ``(h * w + PAD,)``.
    inside
        1 where the inside of a vehicle is seen, else 0, float32, ``(h * w + PAD,)``; written where there is one.
    glass
        Share of what lies behind a pane on the ground floor that is seen through it, of 255, uint8, ``(h * w + PAD,)``;
        written where `interiors` of the light are on.
    changed
        Whether a pixel differs from what is known of the picture, bool, shape ``(h * w + PAD,)``.
    real, whole
        Fields of the shader's queue, float32 and uint32; scratch memory of the shadows before.
    sky_real, sky_whole
        The same for pixels that show the sky.
    setup, setup_number
        `TRIANGLE_SETUP` and number of triangles lately shaded, shape ``(SETUPS,)``.
    """

    keys: NDArray[np.uint64]
    tiles: NDArray[np.uint32]
    blocks: NDArray[np.uint32]
    strip: NDArray[np.uint64]
    vertex: NDArray[np.float32]
    model_view: Any
    box: Any
    candidate: NDArray[np.int32]
    bucket: NDArray[np.int32]
    ordered: NDArray[np.int32]
    drawn: NDArray[np.int32]
    base: NDArray[np.int64]
    first_triangle: NDArray[np.int32]
    slot: NDArray[np.int32]
    sun: NDArray[np.float32]
    contact: NDArray[np.float32]
    inside: NDArray[np.float32]
    glass: NDArray[np.uint8]
    changed: NDArray[np.bool_]
    real: NDArray[np.float32]
    whole: NDArray[np.uint32]
    sky_real: NDArray[np.float32]
    sky_whole: NDArray[np.uint32]
    setup: NDArray[np.void]
    setup_number: NDArray[np.int32]

    def fit(self, scene: SceneArrays, width: int, height: int) -> bool:
        """Return whether they are of this picture's size and large enough for the scene."""
        if len(self.strip) != width or len(self.keys) != width * height + PAD:
            return False
        return len(self.candidate) >= _item_count(scene) and self.vertex.shape[1] >= _most_vertices(scene)

    def hold(self, scene: SceneArrays, width: int, height: int) -> bool:
        """Return whether they are large enough for a picture of this size."""
        across, down = -(-width // TILE), -(-height // TILE)
        enough = len(self.strip) >= width and len(self.keys) >= width * height + PAD
        enough &= len(self.tiles) >= across * down
        enough &= len(self.blocks) >= -(-across // BLOCK) * -(-down // BLOCK)
        return enough and len(self.candidate) >= _item_count(scene) and self.vertex.shape[1] >= _most_vertices(scene)

    def cut(self, height: int, width: int) -> Buffers:
        """Return them as those of a smaller picture."""
        pixels = height * width + PAD
        parts = {
            name: getattr(self, name)[:pixels] for name in ("keys", "sun", "contact", "inside", "glass", "changed")
        }
        return self._replace(strip=self.strip[:width], **parts)


def buffers_for(scene: SceneArrays, width: int, height: int) -> Buffers:
    """Return scratch memory for pictures of this size."""
    items, pixels = _item_count(scene), width * height
    tiles = ((width + TILE - 1) // TILE) * ((height + TILE - 1) // TILE)
    side = TILE * BLOCK
    blocks = ((width + side - 1) // side) * ((height + side - 1) // side)
    return Buffers(
        keys=np.zeros(pixels + PAD, np.uint64),
        tiles=np.zeros(tiles, np.uint32),
        blocks=np.zeros(blocks, np.uint32),
        strip=np.zeros(width, np.uint64),
        vertex=np.zeros((6, _most_vertices(scene)), np.float32),
        model_view=np.zeros(1, MODEL_VIEW)[0],
        box=np.zeros(1, BOX)[0],
        candidate=np.zeros(items, np.int32),
        bucket=np.zeros(items, np.int32),
        ordered=np.zeros(items, np.int32),
        drawn=np.zeros(items, np.int32),
        base=np.zeros(items + 1, np.int64),
        first_triangle=np.zeros(items, np.int32),
        slot=np.full(items, -1, np.int32),
        sun=np.ones(pixels + PAD, np.float32),
        contact=np.ones(pixels + PAD, np.float32),
        inside=np.zeros(pixels + PAD, np.float32),
        glass=np.zeros(pixels + PAD, np.uint8),
        changed=np.zeros(pixels + PAD, np.bool_),
        real=np.zeros(REAL_FIELDS * STRIDE, np.float32),
        whole=np.zeros(WHOLE_FIELDS * STRIDE, np.uint32),
        sky_real=np.zeros(REAL_FIELDS * STRIDE, np.float32),
        sky_whole=np.zeros(WHOLE_FIELDS * STRIDE, np.uint32),
        setup=np.zeros(SETUPS, TRIANGLE_SETUP),
        setup_number=np.zeros(SETUPS, np.int32),
    )


def _item_count(scene: SceneArrays) -> int:
    return len(scene.cluster_where) + len(scene.instances.entity) + len(scene.avatars.span) + 1


def _most_vertices(scene: SceneArrays) -> int:
    """Return how many vertices the largest item has."""
    return max(int(scene.counts["fixed_vertices"]), widest(scene.avatars.span))


def widest(spans: NDArray[np.void]) -> int:
    """Return the most vertices of any range."""
    return int((spans["end_vertex"] - spans["first_vertex"]).max(initial=1))


# Fields, float32: texture coordinates in texels and their step between samples; colour; normal; position; share of the
# sky that is seen; light of its own; shares of the sun and the sky that moving things leave. `LAMPS`: light of lamps.
U, V, SU, SV, RED, GREEN, BLUE, NX, NY, NZ, X, Y, Z, SKY, SHINE, SUN, AROUND = (k * STRIDE for k in range(17))
F, G, A, B, LEVEL, LIT, LAMPS = (k * STRIDE for k in range(17, 24))
# Fields, uint32: first texel, columns and rows of the texture's level, the pixel, and whose window it shows.
START, COLUMNS, ROWS, PIXEL = (k * STRIDE for k in range(4))
WINDOW = 14 * STRIDE
I0, I1, I2, I3, T0, T1, T2, T3, PAIR, MIDDLE = (k * STRIDE for k in range(4, 14))
# What is seen through a pane, once it is known: where a moving thing's share of the sun was.
SEEN = SUN
