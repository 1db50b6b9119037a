"""`vico world build`, `vico world info`, `vico check world`."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.cli.output import check_output, print_json, print_table, progress_bars
from vico.world.folder import World, read_world, stage_seconds
from vico.world.threads import in_order
from vico.worldgen.indoor.layout_llm import LlmLayoutAuthor
from vico.worldgen.photos.streetview_photo import Photographer
from vico.worldgen.photos.texturing import Texturing
from vico.worldgen.pipeline import build_world, extract_centre, rebuild_world
from vico.worldgen.previews import Overhead, Viewpoint
from vico.worldgen.sources import Sources


def photograph(world: World, views: Sequence[Viewpoint | Overhead]) -> Iterator[NDArray[np.uint8]]:
    """Take pictures with our own renderer."""
    from vico.render.cameras import Cameras
    from vico.render.frames import render, render_top_down
    from vico.render.world_scene import scene_of

    scene = scene_of(world, rooms=False)

    def take(view: Viewpoint | Overhead) -> NDArray[np.uint8]:
        if isinstance(view, Overhead):
            return render_top_down(scene, world.half, view.side)
        cameras = Cameras(
            np.array([view.position]),
            np.array([view.forward]),
            fov_y=view.fov_y,
            width=view.width,
            height=view.height,
        )
        return render(scene, cameras, depth=False, segmentation=False, samples=2, threads=1).rgb[0]

    scene.light()
    yield from in_order(take, views)


def build(
    sources: Sources,
    *,
    out: Path,
    lat: float | None = None,
    lon: float | None = None,
    half: float = 400.0,
    seed: int = 0,
    texturing: Texturing | None = None,
    author: LlmLayoutAuthor | None = None,
    force: bool = False,
    json: bool = False,
) -> int:
    """Build a world; without a centre around the map's middle."""
    if lat is None or lon is None:
        lat, lon = extract_centre(sources.osm)
    check_output(out, *sources.files(), force=force)
    with progress_bars() as report:
        build_world(
            sources,
            lat=lat,
            lon=lon,
            half=half,
            seed=seed,
            out=out,
            force=force,
            progress=report,
            photograph=photograph,
            texturing=texturing,
            studio=studio,
            author=author,
        )
    if author is not None:
        print(f"language model: {author.model.budget.spent}", file=sys.stderr)
    return info(out, json=json)


def layout_author(calls: int | None, tokens: int | None, cost: float | None) -> LlmLayoutAuthor:
    """The language model that the environment names, as an author of floor plans."""
    from vico.geo.web import cache_folder
    from vico.llm import Budget, LanguageModel

    budget = Budget(calls=calls, tokens=tokens, cost=cost)
    return LlmLayoutAuthor(LanguageModel.from_environment(cache=cache_folder() / "llm", budget=budget))


def studio(world: World) -> Photographer:
    """Take pictures of an unfinished world with pinhole cameras whose principal point is the middle."""
    from vico.render.cameras import Cameras
    from vico.render.frames import render
    from vico.render.world_scene import scene_of

    scene = scene_of(world, rooms=False)

    def take(
        position: NDArray[np.float64], rotation: NDArray[np.float64], intrinsics: NDArray[np.float64], w: int, h: int
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.int32]]:
        fov = 2 * math.atan(h / 2 / intrinsics[1, 1])
        camera = Cameras(position[None], rotation[2][None], up=-rotation[1], fov_y=fov, width=w, height=h)
        frames = render(scene, camera, samples=1)
        return frames.rgb[0], frames.depth[0], frames.segmentation[0]

    return take


def locate(
    lat: float | None, lon: float | None, half: float, *, overpass: str | None = None, refresh: bool = False
) -> Path:
    """Find a map that covers a window: the packaged extract, else one from an Overpass server (``off``: none)."""
    from vico.geo.overpass import Overpass
    from vico.worldgen.packaged import map_for

    endpoint = overpass or os.environ.get("VICO_OVERPASS")
    source = None if endpoint == "off" else Overpass(endpoint, refresh=refresh)
    return map_for(lat, lon, half, source=source)


def rebuild(path: Path, stages: Sequence[str], *, author: LlmLayoutAuthor | None = None, json: bool = False) -> int:
    """Run stages of a world again."""
    with progress_bars() as report:
        rebuild_world(path, stages, progress=report, photograph=photograph, studio=studio, author=author)
    return info(path, json=json)


def build_table(
    table: Path, *, out: Path, workers: int, ray: bool = False, force: bool = False, json: bool = False
) -> int:
    """Build a table of places; 1 if any failed."""
    from vico.worldgen.many import build_many, read_place_table

    rows = read_place_table(table)
    outcomes = []
    with progress_bars() as report:
        report("places", 0, len(rows))
        for outcome in build_many(
            rows, out, locate=locate, photograph=photograph, studio=studio, workers=workers, force=force, ray=ray
        ):
            outcomes.append(outcome)
            report("places", len(outcomes), len(rows))
    order = {row.name: k for k, row in enumerate(rows)}
    outcomes.sort(key=lambda outcome: order[outcome.name])
    failed = [outcome for outcome in outcomes if outcome.state == "failed"]
    if json:
        print_json({"ok": not failed, "places": [asdict(outcome) for outcome in outcomes]})
    else:
        for o in outcomes:
            what = o.reason or f"{o.buildings} buildings, {o.places} places, {o.seconds:.1f} s"
            print(f"{o.name}: {o.state}: {what}")
    return 1 if failed else 0


def facts(world: World) -> dict[str, Any]:
    """What `world info` tells."""
    manifest = world.manifest
    seconds = stage_seconds(world)
    return {
        "name": manifest.name,
        "origin": [manifest.origin.lat, manifest.origin.lon],
        "half": manifest.half,
        "seed": manifest.seed,
        "digest": world.digest,
        **manifest.counts,
        "places_by_type": manifest.places_by_type,
        "dropped": {stage.name: len(stage.dropped) for stage in manifest.stages if stage.dropped},
        "seconds": {**seconds, "total": round(sum(seconds.values()), 3)},
        "megabytes": round(sum(world.file(name).stat().st_size for name in manifest.files) / 1e6, 2),
        "sources": [source.model_dump(mode="json") for source in manifest.sources],
    }


def info(path: Path, *, json: bool = False) -> int:
    """Say what a world holds."""
    content = facts(read_world(path))
    if json:
        print_json(content)
        return 0
    rows = {name: value for name, value in content.items() if not isinstance(value, dict | list)}
    rows |= {f"places: {kind}": number for kind, number in content["places_by_type"].items()}
    rows |= {f"seconds: {stage}": value for stage, value in content["seconds"].items()}
    rows |= {f"source: {source['name']}": source["attribution"] for source in content["sources"]}
    print_table(f"world {path}", rows)
    return 0


def check(path: Path, *, json: bool = False) -> int:
    """Check a world; 1 if anything is wrong."""
    from vico.world.check import check_world

    findings = check_world(read_world(path))
    if json:
        print_json({"ok": not findings, "findings": [finding._asdict() for finding in findings]})
    else:
        for finding in findings:
            at = "" if finding.at is None else f" at {finding.at[0]:.1f} m east, {finding.at[1]:.1f} m north"
            print(f"{finding.id}: {finding.where}{at}: {finding.what}")
        print(f"{path}: {len(findings)} findings" if findings else f"{path}: all is well")
    return 1 if findings else 0


def export(path: Path, to: str, *, out: Path, rooms: bool = False, force: bool = False, json: bool = False) -> int:
    """Write a world in another format."""
    from vico.world.exports import export_world

    check_output(out, path, force=force)
    counts = export_world(read_world(path), to, out, rooms=rooms, force=force)
    if json:
        print_json({"format": to, "out": str(out), **counts})
    else:
        print(f"{out}: {to}, " + ", ".join(f"{number:,} {name}" for name, number in counts.items()))
    return 0
