"""3D tilesets: walked down to the wanted detail, cut to a window, in the local frame, with welded borders.

OGC 3D Tiles 1.0 and 1.1: explicit tilesets, nested ones too, of b3dm and glTF tiles (Draco or plain), local or served,
Google's Photorealistic 3D Tiles among them. What can't be read is left out and named; its parent stands in for it. The
result is one mesh of textured triangles; vertices on the borders of neighbour tiles are brought together.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vico.errors import EmptyInputError, InputError, MissingExtraError, SchemaError, VicoError
from vico.geo.frame import LocalFrame
from vico.geo.gltf import read_gltf
from vico.geo.tiles3d_files import (
    ECEF,
    LARGEST,
    MOST_BYTES,
    WEB_MERCATOR,
    TileContent,
    TileFile,
    TileSource,
    TileWindow,
    read_tile_file,
    tile_source,
)


@dataclass(frozen=True)
class TileMesh:
    """Textured triangles of a 3D tileset, ENU metres.

    Attributes
    ----------
    positions
        float64, shape ``(n, 3)``.
    triangles
        Vertex indices, counter-clockwise seen from outside, int32, shape ``(m, 3)``.
    uv
        Texture coordinates, float32, shape ``(n, 2)``; v = 0 is the texture's row 0.
    texture_of
        Index into `textures` of each triangle, or -1 where it has none, int32, shape ``(m,)``.
    textures
        sRGB, uint8, shape ``(h, w, 3)`` each.
    colour
        Base colour of each vertex, sRGB uint8, shape ``(n, 3)``; multiplies the texture.
    attributions
        Whom to credit, each once.
    """

    positions: NDArray[np.float64]
    triangles: NDArray[np.int32]
    uv: NDArray[np.float32]
    texture_of: NDArray[np.int32]
    textures: tuple[NDArray[np.uint8], ...]
    colour: NDArray[np.uint8]
    attributions: tuple[str, ...] = ()


def weld_borders(
    positions: NDArray[np.float64], triangles: NDArray[np.int32], owner: NDArray[np.int64], reach: float
) -> NDArray[np.float64]:
    """Bring together the border vertices of neighbour tiles.

    Parameters
    ----------
    positions, triangles
        The mesh, shapes ``(n, 3)`` and ``(m, 3)``.
    owner
        The tile of each vertex, shape ``(n,)``.
    reach
        How far a vertex may move, metres.

    Returns
    -------
    ndarray
        Positions in which a vertex on the open border of a tile that has one of an earlier tile's border within reach
        lies where the nearest of those does.
    """
    # Corners that differ only in their texture coordinates are one place: an edge is open if no other triangle of its
    # tile has it.
    place = _places(np.concatenate([owner[:, None], np.round(positions * 1e4).astype(np.int64)], axis=1))
    edges = np.sort(place[triangles][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    if not len(edges):
        return positions
    pairs, times = np.unique(edges[:, 0] * len(positions) + edges[:, 1], return_counts=True)
    unique = np.stack(np.divmod(pairs, len(positions)), axis=1)
    border = np.unique(unique[times == 1])
    if not len(border):
        return positions
    one = np.zeros(int(place.max()) + 1, np.int64)
    one[place] = np.arange(len(place))
    vertices = one[border]
    spots, tiles = positions[vertices], owner[vertices]
    distance, near = cKDTree(spots).query(spots, k=min(8, len(spots)), distance_upper_bound=reach)
    distance, near = np.atleast_2d(distance), np.atleast_2d(near)
    target = np.arange(len(spots))
    for column in range(near.shape[1] - 1, -1, -1):  # the nearest is looked at last and wins
        index = np.minimum(near[:, column], len(spots) - 1)
        earlier = np.isfinite(distance[:, column]) & (tiles[index] < tiles)
        target = np.where(earlier, index, target)
    while True:  # a target may itself have moved to an earlier tile
        further = target[target]
        if (further == target).all():
            break
        target = further
    moved = np.arange(int(place.max()) + 1)
    moved[border] = border[target]
    return positions[one[moved]][place]


def _places(rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return a number for each row; equal rows have the same one."""
    # One number a row is sorted many times faster than rows; the rare rows that share one by chance are told apart.
    mix = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0x27D4EB2F165667C5], np.uint64)
    hashed = (rows.astype(np.uint64) * mix).sum(axis=1, dtype=np.uint64)
    _, first, place = np.unique(hashed ^ (hashed >> np.uint64(29)), return_index=True, return_inverse=True)
    if not np.array_equal(rows[first][place], rows):
        _, place = np.unique(rows, axis=0, return_inverse=True)
    return np.asarray(place.ravel(), np.int64)


_Z_UP: dict[str, NDArray[np.float64]] = {
    "X": np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
    "Y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "Z": np.eye(3),
}
_READ_EXTENSIONS = {
    "3DTILES_content_gltf",
    "3DTILES_multiple_contents",
    "3DTILES_metadata",
    "3DTILES_batch_table_hierarchy",
}


@dataclass(frozen=True)
class TileLimits:
    """Limits on what is read of a tileset.

    Attributes
    ----------
    tiles
        Tiles looked at, and files fetched.
    depth
        Levels, those of nested tilesets counted on.
    total
        Bytes fetched in all.
    triangles
        In the window.
    """

    tiles: int = 100_000
    depth: int = 96
    total: int = 8 << 30
    triangles: int = 40_000_000


@dataclass(frozen=True)
class TileReport:
    """Report on a tileset that was read.

    Attributes
    ----------
    read
        Files whose triangles are in the mesh.
    left_out
        Files that are not, though they were wanted: address (without keys) and reason.
    crs
        The coordinates the tileset was taken to be in.
    """

    read: int
    left_out: tuple[tuple[str, str], ...]
    crs: str


@dataclass(frozen=True)
class _Piece:
    """The triangles of one file, in the local frame."""

    positions: NDArray[np.float64]
    triangles: NDArray[np.int32]
    uv: NDArray[np.float32]
    colour: NDArray[np.uint8]
    texture_of: NDArray[np.int32]
    textures: tuple[NDArray[np.uint8], ...]
    credit: str


@dataclass
class _Found:
    """Content below a tile: pieces, and whether anything of it is missing."""

    pieces: list[_Piece] = field(default_factory=list)
    missing: bool = False

    def __iadd__(self, other: _Found) -> _Found:
        self.pieces += other.pieces
        self.missing |= other.missing
        return self


def read_tileset(
    source: str | Path | TileSource,
    frame: LocalFrame,
    half: float,
    *,
    error: float = 2.0,
    margin: float = 20.0,
    crs: str | None = None,
    weld: float = 0.2,
    limits: TileLimits | None = None,
) -> tuple[TileMesh, TileReport]:
    """Read what a 3D tileset shows of a window.

    Parameters
    ----------
    source
        What `tile_source` makes, or takes: ``google``, an http(s) address, a folder with a ``tileset.json`` or its
        path, or an archive of one.
    frame, half
        Local frame whose origin is the window's centre, and half the window's side, metres.
    error
        Geometric error, metres, at which a tile is good enough; 0 goes down to the leaves.
    margin
        How far beyond the window triangles are kept, metres.
    crs
        Coordinates of the tileset. By default earth-centred ones (``EPSG:4978``), or Web Mercator metres
        (``EPSG:3857``) where the outermost volume touches the window as those but not as earth-centred.
    weld
        Border vertices of neighbour tiles closer than this become one, metres, so that no ray slips between; 0 for
        none.
    limits
        What the tileset may ask of us.

    Returns
    -------
    tuple
        The mesh, z as the tileset gives it (for earth-centred ones metres above the WGS 84 ellipsoid); and what was
        read and left out.

    Raises
    ------
    MissingFileError, SchemaError, SourceError, InputError
        If the outermost file can't be had or read, or the tileset asks for too much.
    EmptyInputError
        If nothing of it lies in the window.
    MissingExtraError
        If it is Draco-compressed and DracoPy is not installed.

    Notes
    -----
    Paper, appendix A.1, mesh preprocessing: ECEF to ENU, tiles joined by merging border vertices.
    """
    if not (math.isfinite(error) and error >= 0.0):
        raise InputError(f"tiles: geometric error {error:g} m; it must not be negative")
    files = tile_source(source) if isinstance(source, str | Path) else source
    outermost = read_tile_file(files.get(files.root), files.name(files.root))
    if outermost.tileset is None:
        raise SchemaError(f"{files.name(files.root)}: is a single tile; give the tileset.json that names it")
    walk = _Walk(files, error, limits or TileLimits())
    walk.window = _window(outermost.tileset["root"], frame, half + margin, crs, files.name(files.root))
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is sorted out point by point
        found = walk.tileset(outermost.tileset, files.root, np.eye(4), 0, (files.root,))
    if not found.pieces:
        why = f": {walk.left_out[0][0]}: {walk.left_out[0][1]}" if walk.left_out else ""
        raise EmptyInputError(
            f"{files.name(files.root)}: nothing of it can be read within {half:g} m of {frame.lat}, {frame.lon}{why}; "
            "give a tileset of this place (and its crs, if it is not earth-centred)"
        )
    mesh = _merge_pieces(found.pieces, weld)
    return mesh, TileReport(len(found.pieces), tuple(walk.left_out), walk.window.crs)


def _window(root: dict[str, Any], frame: LocalFrame, reach: float, crs: str | None, where: str) -> TileWindow:
    """Return the window in the tileset's coordinates, which are found out if nobody says."""
    transform = _transform(root, where)
    for system in (crs,) if crs else (ECEF, WEB_MERCATOR):
        window = TileWindow.of(frame, reach, system)
        try:
            if window.touches(root.get("boundingVolume", {}), transform):
                return window
        except (ValueError, TypeError, OverflowError) as error:
            raise SchemaError(f"{where}: the outermost tile's volume is broken ({error}); export it anew") from None
    raise EmptyInputError(
        f"{where}: does not reach within {reach:g} m of {frame.lat}, {frame.lon}; give a tileset of this place "
        "(and its crs, if it is not earth-centred)"
    )


def _transform(tile: dict[str, Any], where: str) -> NDArray[np.float64]:
    """Return a tile's own transform, stored by columns."""
    if "transform" not in tile:
        return np.eye(4)
    try:
        matrix = np.asarray(tile["transform"], np.float64)
    except (ValueError, TypeError):
        matrix = np.zeros(0)
    if matrix.shape != (16,) or not (np.abs(matrix) < LARGEST).all():
        raise SchemaError(f"{where}: a tile's transform is no 16 numbers of sensible size; export it anew")
    return matrix.reshape(4, 4).T


class _Walk:
    """The way down a tileset."""

    window: TileWindow

    def __init__(self, files: TileSource, error: float, limits: TileLimits) -> None:
        self.files = files
        self.error = error
        self.limits = limits
        self.left_out: list[tuple[str, str]] = []
        self.tiles = self.fetched = self.bytes = self.triangles = 0

    def tileset(
        self, document: dict[str, Any], base: str, above: NDArray[np.float64], depth: int, trail: tuple[str, ...]
    ) -> _Found:
        """Everything wanted of a tileset."""
        for name in document.get("extensionsRequired", []) or []:
            if name not in _READ_EXTENSIONS:
                return self._leave_out(base, f"requires the extension {str(name)[:60]}, which is not read")
        asset = document.get("asset")
        axis = str(asset.get("gltfUpAxis", "Y")).upper() if isinstance(asset, dict) else "Y"
        said = document.get("geometricError")
        start = float(said) if isinstance(said, int | float) and math.isfinite(said) else math.inf
        return self.tile(document["root"], _Place(base, above, "REPLACE", start, axis, depth, trail))

    def tile(self, tile: dict[str, Any], place: _Place) -> _Found:
        """Everything wanted of a tile and what is below it."""
        self.tiles += 1
        if self.tiles > self.limits.tiles:
            raise _TooMuch(
                f"{self.files.name(place.base)}: more than {self.limits.tiles:,} tiles; give a larger geometric error "
                "or a smaller window"
            )
        if place.depth > self.limits.depth:
            return self._leave_out(place.base, f"goes on for more than {self.limits.depth} levels")
        try:
            here = place.inside(tile, self.files.name(place.base))
            volume = tile.get("boundingVolume")
            if not isinstance(volume, dict):
                raise SchemaError("has a tile without a bounding volume")
            if not self.window.touches(volume, here.transform):
                return _Found()
            children = [child for child in tile.get("children") or [] if isinstance(child, dict)]
            contents = list(_contents(tile))
        except (VicoError, ValueError, TypeError, KeyError, AttributeError, OverflowError) as error:
            return self._leave_out(place.base, f"a tile is broken ({' '.join(str(error).split())[:120]})")
        if "implicitTiling" in tile or "3DTILES_implicit_tiling" in (tile.get("extensions") or {}):
            return self._leave_out(place.base, "uses implicit tiling, which is not read; export explicit tiles")
        deeper = bool(children) and here.error > self.error
        if not deeper:
            return self._content(contents, here)
        if here.refine == "ADD":
            found = self._content(contents, here)
            found.missing = False
            for child in children:
                found += self.tile(child, here.below())
            return found
        found = _Found()
        for child in children:
            found += self.tile(child, here.below())
        if found.missing and contents:
            # Finer and coarser triangles of one place must not lie over each other: all of the parent, or none.
            before = len(self.left_out)
            instead = self._content(contents, here)
            if instead.pieces and not instead.missing:
                return instead
            del self.left_out[before:]
        # Nothing stands in further up for what an empty tile could not show, unless it shows nothing at all.
        return _Found(found.pieces, found.missing and not found.pieces)

    def _content(self, uris: list[str | None], place: _Place) -> _Found:
        found = _Found()
        for uri in uris:
            found += (
                self._leave_out(place.base, "a tile's content has no address")
                if uri is None
                else self._file(uri, place)
            )
        return found

    def _file(self, uri: str, place: _Place) -> _Found:
        """Return what one file shows, and all below it if it is a tileset."""
        try:
            address = self.files.resolve(uri, place.base)
        except (VicoError, ValueError) as error:
            return self._leave_out(uri.partition("?")[0][:200], str(error), plain=True)
        name = self.files.name(address)
        if address in place.trail:
            return self._leave_out(address, "is a tileset that holds itself")
        try:
            file = self._open_file(address, name)
            if file.tileset is not None:
                return self.tileset(file.tileset, address, place.transform, place.depth + 1, (*place.trail, address))
            found = _Found()
            for reason in file.left_out:
                self.left_out.append((name, reason))
            for model in file.models:
                piece = self._piece(model, name, address, place)
                if piece is not None:
                    found.pieces.append(piece)
            return found
        except (MissingExtraError, _TooMuch):
            raise
        except VicoError as error:
            return self._leave_out(address, str(error).removeprefix(f"{name}: "))

    def _open_file(self, address: str, name: str) -> TileFile:
        self.fetched += 1
        data = self.files.get(address)
        self.bytes += len(data)
        if self.fetched > self.limits.tiles or self.bytes > self.limits.total:
            raise _TooMuch(
                f"{name}: {self.fetched:,} files and {self.bytes:,} bytes so far are too many; give a larger geometric "
                "error or a smaller window"
            )
        return read_tile_file(data, name)

    def _piece(self, content: TileContent, name: str, address: str, place: _Place) -> _Piece | None:
        """Return a model in the local frame, cut to the window; None if nothing of it is there."""

        def resource(uri: str) -> bytes:
            data = self.files.get(self.files.resolve(uri, address))
            if len(data) > MOST_BYTES:
                raise SchemaError(f"{name}: {len(data):,} bytes are too many for a tile")
            return data

        scene = read_gltf(content.model, name, resource=resource)
        turn = _Z_UP.get(place.axis, _Z_UP["Y"])
        reach = self.window.reach
        positions, triangles, uv, colour, texture_of = [], [], [], [], []
        count = 0
        for part in scene.parts:
            points = part.positions @ turn.T + (scene.centre + content.centre)
            points = self.window.to_enu(points @ place.transform[:3, :3].T + place.transform[:3, 3])
            good = np.asarray(np.isfinite(points).all(axis=1))
            corner = np.where(good[:, None], points, np.inf)[part.triangles][..., :2]
            near = ((corner.min(axis=1) <= reach) & (corner.max(axis=1) >= -reach)).all(axis=1)
            near &= good[part.triangles].all(axis=1)
            if not near.any():
                continue
            used, faces = np.unique(part.triangles[near], return_inverse=True)
            positions.append(points[used])
            triangles.append(faces.reshape(-1, 3).astype(np.int32) + np.int32(count))
            uv.append(part.uv[used])
            colour.append(part.colour[used])
            texture_of.append(np.full(int(near.sum()), part.texture, np.int32))
            count += len(used)
        if not positions:
            return None
        self.triangles += sum(map(len, triangles))
        if self.triangles > self.limits.triangles:
            raise _TooMuch(
                f"{name}: more than {self.limits.triangles:,} triangles; give a larger geometric error "
                "or a smaller window"
            )
        shown = np.concatenate(texture_of)
        wanted = np.unique(shown[shown >= 0])
        return _Piece(
            np.concatenate(positions),
            np.concatenate(triangles),
            np.concatenate(uv),
            np.concatenate(colour),
            np.where(shown >= 0, np.searchsorted(wanted, shown), -1).astype(np.int32),
            tuple(scene.textures[k] for k in wanted.tolist()),
            scene.copyright,
        )

    def _leave_out(self, address: str, reason: str, *, plain: bool = False) -> _Found:
        self.left_out.append((address if plain else self.files.name(address), reason))
        return _Found(missing=True)


class _TooMuch(InputError):
    """A limit that ends the reading, instead of leaving out one tile."""


@dataclass(frozen=True)
class _Place:
    """A place in a tileset: what a tile takes from those above it."""

    base: str
    transform: NDArray[np.float64]
    refine: str
    error: float
    axis: str
    depth: int
    trail: tuple[str, ...]

    def inside(self, tile: dict[str, Any], where: str) -> _Place:
        """Return the placement of a tile of ours."""
        refine = tile.get("refine")
        error = tile.get("geometricError")
        transform = self.transform @ _transform(tile, where)
        if not (np.abs(transform) < LARGEST).all():
            raise SchemaError(f"{where}: the tiles' transforms grow beyond all bounds; export it anew")
        own = float(error) if isinstance(error, int | float) and math.isfinite(error) else self.error
        return _Place(
            self.base,
            transform,
            str(refine).upper() if refine else self.refine,
            own,
            self.axis,
            self.depth,
            self.trail,
        )

    def below(self) -> _Place:
        """Return the placement of the children."""
        return _Place(self.base, self.transform, self.refine, self.error, self.axis, self.depth + 1, self.trail)


def _contents(tile: dict[str, Any]) -> Iterator[str | None]:
    """Addresses of what a tile shows."""
    entries = [tile["content"]] if isinstance(tile.get("content"), dict) else []
    for more in (tile.get("contents"), (tile.get("extensions") or {}).get("3DTILES_multiple_contents", {})):
        many = more.get("contents", more.get("content")) if isinstance(more, dict) else more
        entries += [entry for entry in many or [] if isinstance(entry, dict)]
    for entry in entries:
        uri = entry.get("uri", entry.get("url"))
        yield uri if isinstance(uri, str) else None


def _merge_pieces(pieces: list[_Piece], weld: float) -> TileMesh:
    """One mesh of many pieces."""
    first = np.cumsum([0, *(len(p.positions) for p in pieces)])
    pictures = np.cumsum([0, *(len(p.textures) for p in pieces)])
    positions = np.concatenate([p.positions for p in pieces])
    triangles = np.concatenate([p.triangles + np.int32(n) for p, n in zip(pieces, first, strict=False)])
    texture_of = np.concatenate(
        [np.where(p.texture_of < 0, -1, p.texture_of + n) for p, n in zip(pieces, pictures, strict=False)]
    )
    if weld > 0 and len(pieces) > 1:
        owner = np.repeat(np.arange(len(pieces)), np.diff(first))
        positions = weld_borders(positions, triangles, owner, weld)
    return TileMesh(
        positions,
        triangles.astype(np.int32),
        np.concatenate([p.uv for p in pieces]),
        texture_of.astype(np.int32),
        tuple(picture for p in pieces for picture in p.textures),
        np.concatenate([p.colour for p in pieces]),
        credits_of(p.credit for p in pieces),
    )


def credits_of(said: Iterator[str] | list[str]) -> tuple[str, ...]:
    """Return whom to credit: the parts of ``asset.copyright`` between semicolons, the most frequent first."""
    names = Counter(name for text in said for part in text.split(";") if (name := part.strip()))
    return tuple(sorted(names, key=lambda name: -names[name]))
