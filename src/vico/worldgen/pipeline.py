"""The build of a world: stage after stage into a neighbour folder, which takes its final name when it is whole.

A killed build leaves ``<out>.partial``, with what its stages made in ``.stages`` inside; the same command again goes on
from there. A finished world keeps its ``.stages`` too, so that one stage can be run again (`rebuild_world`); the folder
is no part of the world and may be deleted.
"""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Collection
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import osmium
from numpy.typing import NDArray
from PIL import Image

from vico.errors import InputError, MissingFileError, OutputExistsError, SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.osm import checked_extract
from vico.world.files import read_json, write_json
from vico.world.folder import World, read_world, seal
from vico.world.model import Manifest
from vico.world.threads import for_each
from vico.worldgen.evidence import gather
from vico.worldgen.indoor.layout_llm import LlmLayoutAuthor
from vico.worldgen.photos.texturing import Studio, Texturing
from vico.worldgen.previews import Overhead, Photograph, map_picture, viewpoints
from vico.worldgen.recipe import make_world
from vico.worldgen.report import write_report
from vico.worldgen.sources import Sources
from vico.worldgen.stages import Progress, Stages

STAGES = ".stages"
_REQUEST = "request.json"
_LEAST_RADIUS, _MOST_RADIUS = 50.0, 2000.0


def extract_centre(path: Path) -> tuple[float, float]:
    """Latitude and longitude of the middle of an OSM extract: of its stated bounds, else of its nodes.

    Raises
    ------
    MissingFileError, SchemaError
        If there is no such file, or it is broken or empty.
    """
    checked_extract(path)
    try:
        box = osmium.io.Reader(str(path)).header().box()
        if not box.valid():
            box = osmium.osm.Box()
            for node in osmium.FileProcessor(str(path), osmium.osm.NODE):
                box.extend(node.location)
    except RuntimeError as error:
        raise SchemaError(f"{path}: truncated or broken ({error}); download it again, or clip it anew") from None
    if not box.valid():
        raise SchemaError(f"{path}: holds no points; download it again, or clip it anew")
    return (
        (box.bottom_left.lat + box.top_right.lat) / 2,
        (box.bottom_left.lon + box.top_right.lon) / 2,
    )


def build_world(
    sources: Sources | Path,
    *,
    lat: float,
    lon: float,
    half: float = 400.0,
    dem: Path | None = None,
    seed: int = 0,
    out: Path,
    force: bool = False,
    again: Collection[str] = (),
    keep_stages: bool = True,
    progress: Progress | None = None,
    photograph: Photograph | None = None,
    texturing: Texturing | None = None,
    studio: Studio | None = None,
    author: LlmLayoutAuthor | None = None,
) -> Manifest:
    """Build a world folder.

    Parameters
    ----------
    sources
        What to build from; a path alone is an OpenStreetMap extract.
    lat, lon
        The window's centre, degrees.
    half
        Half the window's side, metres.
    dem
        Elevation file, where `sources` is a path.
    seed
        Decides what the map leaves open.
    out
        Folder to make. Until it is whole the files lie in ``<out>.partial``; a build that was killed there goes on.
    force
        Replace what is at `out`.
    again
        Names of stages to run even where their product is kept.
    keep_stages
        Keep what the stages made in ``<out>/.stages``, so that one can be run again.
    progress
        Called with a stage's name, how much of it is done, and how much there is.
    photograph
        Takes the street-level pictures; none are made without.
    texturing
        How photos come onto the walls.
    studio
        Renders the unfinished world for street photos to be matched with; they need it.
    author
        Draws the floor plans of places that no layout of `sources` covers.

    Returns
    -------
    Manifest
        What was built.

    Raises
    ------
    OutputExistsError
        If `out` holds something and `force` is false.
    InputError, MissingFileError, SchemaError, EmptyInputError, MissingExtraError
        If the input can't be used; each says how to mend it.
    """
    out = Path(out)
    if not isinstance(sources, Sources):
        sources = Sources(Path(sources), dem=() if dem is None else (Path(dem),))
    if not (math.isfinite(half) and _LEAST_RADIUS <= half <= _MOST_RADIUS):
        raise InputError(f"radius: {half:g} m; it must lie within {_LEAST_RADIUS:g}..{_MOST_RADIUS:g} m")
    if seed < 0:
        raise InputError(f"seed: {seed}; it must not be negative")
    if out.exists() and not force and (not out.is_dir() or any(out.iterdir())):
        raise OutputExistsError(f"{out}: exists already; choose another folder, or add --force to replace it")
    half = math.ceil(half * 2) / 2  # a whole number of cells
    frame = LocalFrame(lat, lon)
    folder = out.with_name(f"{out.name}.partial")
    stages = Stages(folder / STAGES, again=again, progress=progress)
    given = gather(sources, frame, half, stages)
    _clear(folder)
    if not (folder / STAGES).exists() and (out / STAGES).is_dir():
        shutil.copytree(out / STAGES, folder / STAGES, copy_function=os.link)  # what did not change need not be made
    texturing = texturing or Texturing()
    request: dict[str, Any] = {
        "lat": lat,
        "lon": lon,
        "half": half,
        "seed": seed,
        "sources": sources.to_json(),
        "texturing": asdict(texturing),
        "drawn_layouts": author is not None,
    }
    write_json(folder / STAGES / _REQUEST, request)
    world = make_world(
        given,
        half=half,
        seed=seed,
        folder=folder,
        sources=sources,
        stages=stages,
        texturing=texturing,
        studio=studio,
        author=author,
    )
    del given  # the mesh of a photographed city is large, and so are its pictures
    with stages.timed("previews"):
        counts = _pictures(world, folder, photograph)
    stages.report("previews", counts)
    stages.sweep()
    if not keep_stages:
        shutil.rmtree(folder / STAGES)
    manifest = seal(folder, world.manifest.model_copy(update={"stages": stages.reports}), seconds=stages.seconds)
    write_report(read_world(folder))
    _rename(folder, out)
    return manifest


def rebuild_world(
    path: Path,
    again: Collection[str],
    *,
    progress: Progress | None = None,
    photograph: Photograph | None = None,
    studio: Studio | None = None,
    author: LlmLayoutAuthor | None = None,
) -> Manifest:
    """Run stages of a world again, and whatever depends on a result that changed.

    Raises
    ------
    InputError
        If the world has no such stage, or its kept stages were deleted.
    MissingFileError
        If `path` is no world, or one of the files it was built from is gone.
    """
    world = read_world(path)
    kept = Path(path) / STAGES
    try:
        request = read_json(kept / _REQUEST)
    except MissingFileError:
        raise InputError(f"{path}: its {STAGES} folder is gone, so no stage can be run alone; build it anew") from None
    if request["drawn_layouts"] and author is None:
        raise InputError(f"{path}: a language model drew its floor plans; say again which: add --layout-llm")
    names = sorted(p.stem for p in kept.glob("*.stage"))
    for name in again:
        if name not in names:
            raise InputError(f"{path}: no stage {name!r} can be run alone; there are {', '.join(names)}")
    partial = Path(path).with_name(f"{Path(path).name}.partial")
    shutil.rmtree(partial, ignore_errors=True)
    shutil.copytree(kept, partial / STAGES, copy_function=os.link)
    return build_world(
        Sources.from_json(request["sources"]),
        lat=request["lat"],
        lon=request["lon"],
        half=request["half"],
        seed=request["seed"],
        out=world.path or Path(path),
        force=True,
        again=again,
        progress=progress,
        photograph=photograph,
        texturing=Texturing(**request["texturing"]),
        studio=studio,
        author=author,
    )


def _clear(folder: Path) -> None:
    """Make the working folder, without anything a build before left there but what its stages made."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in folder.iterdir():
        if path.name == STAGES and path.is_dir():
            continue
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()


def _rename(folder: Path, out: Path) -> None:
    """Put the finished folder in its place; what was there goes once the new one is whole."""
    old = None
    if out.exists():
        old = out.with_name(f".{out.name}.old-{os.getpid()}")
        os.replace(out, old)
    os.replace(folder, out)
    if old is not None:
        if old.is_dir():
            shutil.rmtree(old)
        else:
            old.unlink()


def _pictures(world: World, folder: Path, photograph: Photograph | None) -> dict[str, int]:
    """The map, and street-level views if there is somebody to take them."""
    picture = map_picture(world)
    picture.save(folder / "map.png")
    if photograph is None:
        return {"maps": 1, "views": 0}
    views = viewpoints(world, count=8)
    (folder / "previews").mkdir(exist_ok=True)
    names = ["above", *(f"view_{k}" for k in range(len(views)))]
    frames = photograph(world, [Overhead(), *views])

    def save(taken: tuple[str, NDArray[np.uint8]]) -> None:
        name, frame = taken
        Image.fromarray(frame).save(folder / "previews" / f"{name}.png")

    for_each(save, zip(names, frames, strict=True))
    return {"maps": 1, "views": len(views)}
