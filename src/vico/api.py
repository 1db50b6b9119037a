"""The front door: what one does with Virtual Community, a function a capability, with the usual choices made.

Everything here is done by the rooms; whoever needs more options calls them: `vico.worldgen.pipeline`, `vico.community`,
`vico.envs`, `vico.render`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from vico.community import Community, CommunityFinding, date_of, read_community, write_community
from vico.community import build_community as _build_community
from vico.community import check_community as _check_community
from vico.errors import InputError
from vico.render import Cameras, render
from vico.render.world_scene import scene_of
from vico.world.check import WorldFinding
from vico.world.check import check_world as _check_world
from vico.world.folder import read_world as _read_world
from vico.world.world import World
from vico.worldgen import pipeline
from vico.worldgen.previews import viewpoints
from vico.worldgen.request import Sources, locate_map, packaged_extract

#: Height of a standing person's eyes above the ground, metres.
EYE_HEIGHT = 1.65


def build_world(
    out: Path | str,
    *,
    lat: float | None = None,
    lon: float | None = None,
    radius: float = 400.0,
    osm: Path | str | None = None,
    dem: Path | str | None = None,
    seed: int = 0,
    force: bool = False,
) -> World:
    """Build a world folder and read it.

    Parameters
    ----------
    out
        Folder to make.
    lat, lon
        The window's centre, degrees. Without it the middle of `osm`; without that too, packaged central Helsinki.
    radius
        Half the window's side, metres.
    osm
        Map extract. Without it the packaged one is used if it covers the window, else an Overpass server is asked:
        the one of the environment's VICO_OVERPASS, ``off`` for none.
    dem
        Elevation file; flat ground without.
    seed
        Decides what the map leaves open.
    force
        Replace what is at `out`.

    Raises
    ------
    OutputExistsError
        If `out` holds something and `force` is false.
    InputError, MissingFileError, SchemaError, EmptyInputError, SourceError
        If the input can't be used; each says how to mend it.
    """
    if (lat is None) != (lon is None):
        raise InputError("build_world: lat and lon go together")
    if lat is None or lon is None:
        packaged = packaged_extract()
        lat, lon = (packaged.lat, packaged.lon) if osm is None else pipeline.extract_centre(Path(osm))
    osm = locate_map(lat, lon, radius) if osm is None else Path(osm)
    sources = Sources(osm, dem=() if dem is None else (Path(dem),))
    pipeline.build_world(sources, lat=lat, lon=lon, half=radius, seed=seed, out=Path(out), force=force)
    return _read_world(Path(out))


def read_world(path: Path | str) -> World:
    """Read a world folder; its parts are read when they are first asked for.

    Raises
    ------
    MissingFileError, SchemaError
        If `path` is no world, or one of another version.
    """
    return _read_world(Path(path))


def check_world(world: World | Path | str) -> list[WorldFinding]:
    """Check a world: schema, hashes, buildings, entrances, rooms, lanes, transit; empty if all is well."""
    return _check_world(_world(world))


def build_community(
    world: World | Path | str,
    residents: int = 15,
    seed: int = 0,
    *,
    out: Path | str | None = None,
    day: str | None = None,
    days: int = 1,
) -> Community:
    """People a world with residents who have homes, jobs, friends, groups and a full day, or several.

    Parameters
    ----------
    world
        Where they live.
    residents
        How many, 1 or more.
    seed
        Decides who they are.
    out
        Folder to write the community to; None only returns it.
    day, days
        First day, a date like ``2025-06-07`` or a day of the week like ``saturday``, and how many days everybody has a
        schedule for.

    Raises
    ------
    EmptyInputError
        If the world has no homes, too few beds, or nowhere to meet.
    InputError, OutputExistsError
        If `residents` is not positive, or `out` holds something.
    """
    place = _world(world)
    first = None if day is None else date_of(day)
    community = _build_community(place, residents=residents, seed=seed, date=first, days=days)
    if out is not None:
        write_community(community, Path(out), world=place.path)
    return community


def check_community(community: Community | Path | str, world: World | Path | str) -> list[CommunityFinding]:
    """Check that a community is grounded in its world; empty if all is well."""
    place = _world(world)
    people = community if isinstance(community, Community) else read_community(Path(community), place)
    return _check_community(people, place)


@dataclass(frozen=True)
class WorldView:
    """A picture of a world.

    Attributes
    ----------
    rgb
        uint8, shape ``(height, width, 3)``.
    depth
        Metres along the optical axis, 0 where nothing was hit, float32, shape ``(height, width)``.
    segmentation
        Entities, int32, shape ``(height, width)``; 0 where nothing was hit.
    names
        Kind and name of the entities in view, by entity.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.int32]
    names: dict[int, dict[str, str]]

    def __repr__(self) -> str:
        height, width = self.depth.shape
        return f"WorldView({width} x {height} pixels, {len(self.names)} named things in view)"

    def save(self, path: Path | str) -> None:
        """Write the colours as a picture file; the ending decides the format."""
        Image.fromarray(self.rgb).save(path)


def view_world(
    world: World | Path | str,
    *,
    at: ArrayLike | None = None,
    toward: ArrayLike | None = None,
    width: int = 640,
    height: int = 360,
    fov_y: float = 1.0,
) -> WorldView:
    """Take a picture of a world at eight in the morning.

    Parameters
    ----------
    at
        The eye: x and y (a standing person's), or x, y and z, ENU metres. Without it, a street with much to see.
    toward
        Point the camera looks at, x and y or x, y and z, ENU metres; the window's centre without.
    width, height
        Pixels.
    fov_y
        Vertical field of view, radians.
    """
    place = _world(world)
    if at is None:
        found = viewpoints(place, count=1)
        if not found:
            raise InputError("view_world: this world has no street with room to look along; say from where with `at`")
        view = found[0]
        eye, forward = np.asarray(view.position, np.float64), np.asarray(view.forward, np.float64)
    else:
        eye = _point(place, at)
        forward = _point(place, (0.0, 0.0) if toward is None else toward) - eye
        if not np.linalg.norm(forward) > 0.0:
            raise InputError("view_world: the camera looks at the point where it stands; give another `toward`")
        forward = forward / np.linalg.norm(forward)
    camera = Cameras(eye[None], forward[None], fov_y=fov_y, width=width, height=height)
    frames = render(scene_of(place, rooms=False), camera, samples=2)
    seen = [int(entity) for entity in np.unique(frames.segmentation[0]) if entity in place.entities]
    names = {entity: dict(place.entities[entity]) for entity in seen}
    return WorldView(frames.rgb[0], frames.depth[0], frames.segmentation[0], names)


def _world(world: World | Path | str) -> World:
    return world if isinstance(world, World) else _read_world(Path(world))


def _point(world: World, point: ArrayLike) -> NDArray[np.float64]:
    """Return a point in space; one on the map is at the height of eyes above the ground."""
    xyz = np.asarray(point, np.float64).reshape(-1)
    if xyz.size not in (2, 3) or not np.isfinite(xyz).all():
        raise InputError(f"view_world: {point!r} is no point; give x and y, or x, y and z, in metres")
    if xyz.size == 3:
        return xyz
    return np.append(xyz, float(world.height(xyz)) + EYE_HEIGHT)
