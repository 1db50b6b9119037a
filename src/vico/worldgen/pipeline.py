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
from pathlib import Path

from vico.errors import InputError, MissingFileError
from vico.geo.osm import extract_bounds
from vico.io.files import (
    FolderKind,
    FolderLock,
    check_replaceable,
    folder_errors,
    new_folder,
    read_json,
    remove_path,
    write_json,
)
from vico.world.folder import read_world
from vico.world.model import Manifest
from vico.world.world import STAGES, WORLD_FOLDER, seal
from vico.worldgen.background_stages import BackgroundStages
from vico.worldgen.construction import map_of
from vico.worldgen.evidence import read_evidence
from vico.worldgen.indoor.layout_llm import LlmLayoutAuthor
from vico.worldgen.previews import write_previews
from vico.worldgen.recipe import make_world
from vico.worldgen.report import write_report
from vico.worldgen.request import LEAST_RADIUS, MOST_RADIUS, BuildOptions, Sources, WorldRequest
from vico.worldgen.stages import Progress, Stages

#: Files that a tile lacks: its streets are its city's, and only that has them as OpenDRIVE.
OF_A_CITY = ("roads.xodr",)
_REQUEST = "request.json"
_DEFAULTS = BuildOptions()


def extract_centre(path: Path) -> tuple[float, float]:
    """Latitude and longitude of the middle of an OSM extract: of its stated bounds, else of its nodes.

    Raises
    ------
    MissingFileError, SchemaError
        If there is no such file, or it is broken or empty.
    """
    south, west, north, east = extract_bounds(path)
    return (south + north) / 2, (west + east) / 2


def build_world(
    sources: Sources | Path,
    *,
    lat: float,
    lon: float,
    half: float = 400.0,
    seed: int = 0,
    out: Path,
    force: bool = False,
    options: BuildOptions = _DEFAULTS,
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
    seed
        Decides what the map leaves open.
    out
        Folder to make. Until it is whole the files lie in ``<out>.partial``; a build that was killed there goes on.
    force
        Replace what is at `out`.
    options
        How it is built.

    Returns
    -------
    Manifest
        What was built.

    Raises
    ------
    OutputExistsError
        If `out` holds something and `force` is false.
    OutputError
        If another process is building it, the disk is full, or the folder is taken away meanwhile.
    InputError, MissingFileError, SchemaError, EmptyInputError, MissingExtraError
        If the input can't be used; each says how to mend it.
    """
    out = Path(out)
    if not isinstance(sources, Sources):
        sources = Sources(Path(sources))
    if not (math.isfinite(half) and LEAST_RADIUS <= half <= MOST_RADIUS):
        raise InputError(f"radius: {half:g} m; it must lie within {LEAST_RADIUS:g}..{MOST_RADIUS:g} m")
    if seed < 0:
        raise InputError(f"seed: {seed}; it must not be negative")
    check_replaceable(out, force=force, kind=WORLD_FOLDER)
    half = math.ceil(half * 2) / 2  # a whole number of cells
    request = WorldRequest(sources, lat, lon, half, seed, options.texturing, options.author, options.previews)
    return _build(request, out, options, WORLD_FOLDER)


def rebuild_world(
    path: Path,
    again: Collection[str],
    *,
    progress: Progress | None = None,
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
        content = read_json(kept / _REQUEST)
    except MissingFileError:
        raise InputError(f"{path}: its {STAGES} folder is gone, so no stage can be run alone; build it anew") from None
    if content["drawn_layouts"] and author is None:
        raise InputError(f"{path}: a language model drew its floor plans; say again which: add --layout-llm")
    names = sorted(p.stem for p in kept.glob("*.stage"))
    for name in again:
        if name not in names:
            raise InputError(f"{path}: no stage {name!r} can be run alone; there are {', '.join(names)}")
    partial = Path(path).with_name(f"{Path(path).name}.partial")
    if partial.is_dir():
        with FolderLock(partial, name=Path(path)):
            shutil.rmtree(partial)
    with folder_errors(partial, name=Path(path)):
        shutil.copytree(kept, partial / STAGES, copy_function=os.link)
    request = WorldRequest.from_json(content, author=author)
    return _build(request, world.path or Path(path), BuildOptions(again=again, progress=progress), WORLD_FOLDER)


def build_requested(request: WorldRequest, out: Path) -> Manifest:
    """Build what a request says, as a city does tile by tile, in place of what is at `out`."""
    return _build(request, out, _DEFAULTS)


def _build(request: WorldRequest, out: Path, options: BuildOptions, kind: FolderKind | None = None) -> Manifest:
    """Run all stages into a neighbour folder of `out`, and put that in its place."""
    if request.sources.tiles or request.sources.photos:
        request.texturing.require_extras()
    folder = out.with_name(f"{out.name}.partial")
    with new_folder(out, force=True, work=folder, kind=kind):
        planned, part = (None, None) if request.place is None else (request.place.own, map_of(request.place))
        stages = Stages(folder / STAGES, again=options.again, progress=options.progress, beside=planned)
        evidence = read_evidence(request.sources, request.frame, request.reach, stages, part=part)
        for path in folder.iterdir():
            # What a build before left goes, except what its stages made.
            if path.name != STAGES or not path.is_dir():
                remove_path(path)
        if not (folder / STAGES).exists() and (out / STAGES).is_dir():
            # What did not change need not be made.
            shutil.copytree(out / STAGES, folder / STAGES, copy_function=os.link)
        write_json(folder / STAGES / _REQUEST, request.to_json())
        with BackgroundStages(request, folder / STAGES) as ahead:
            world = make_world(evidence, request, folder, stages, ahead)
        del evidence  # the mesh of a photographed city is large, and so are its pictures
        if part is None:
            with stages.timer("previews"):
                stages.report("previews", write_previews(world, folder, views=request.previews))
        stages.sweep()
        if not options.keep_stages:
            shutil.rmtree(folder / STAGES)
        made = world.manifest.model_copy(update={"stages": stages.reports})
        manifest = seal(folder, made, seconds=stages.seconds, without=() if part is None else (*OF_A_CITY, "map.png"))
        write_report(read_world(folder))
    return manifest
