"""Whether cities look like themselves: views without any lettering, matched to names by who has not seen them.

    python benchmarks/blind_test.py views --worlds WORLDS --out OUT [--each 2] [--skip 0] [--count 24]
    python benchmarks/blind_test.py score --out OUT --answers answers.json [--note TEXT]
        [--table benchmarks/results/blind_test.md]

WORLDS holds world folders named CITY_LETTER. Views are taken where the world's own previews would be, at eye height
along streets with houses on both sides, without the first `--skip` of each world, by which one may have mended worlds.
Names on boards are painted over. ``OUT/view_NN.png`` go to the judge with the list of names that ``OUT/names.txt``
holds; ``OUT/key.json`` doesn't. The answers are an object from the number of a view to ``{"city": NAME, "cue": TEXT}``.
"""

from __future__ import annotations

import argparse
import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import shapely
from PIL import Image
from reporting import publish
from scipy import ndimage

from vico.api import read_world
from vico.seeds import rng
from vico.world.mesh import Surface
from vico.world.world import World
from vico.worldgen.previews import Viewpoint, render_views, viewpoints

_SIGNS = "signs_"
# Pixels of a board that are looked at, and so many of them around each, down and across.
_STEP, _AROUND = 4, (7, 21)
# Spots of a world that are looked at; directions in which houses are to stand, radians, and how near, metres.
_TRIED, _TURNS, _REACH = 24, (-0.7, -0.35, 0.35, 0.7), 110.0


def without_names(world: World) -> World:
    """Return a world whose boards say nothing: each has the colour of its ground, nearly all over."""
    layers = {layer: world.surfaces(layer) for layer in ("ground", "buildings", "roofs", "rooms")}
    layers["buildings"] = [_blank(surface) for surface in layers["buildings"]]
    known = {
        name: getattr(world, name)
        for name in ("height", "buildings", "places", "entrances", "rooms", "objects", "roads", "walkable", "parking")
    }
    return World(world.manifest, None, layers=layers, models=dict(world.prototypes()), **known)


def _blank(surface: Surface) -> Surface:
    material = surface.material
    if not material.name.startswith(_SIGNS) or material.texture is None:
        return surface
    # Letters cover less than half of a board: what lies in the middle of all colours around is the ground's.
    few = material.texture[::_STEP, ::_STEP]
    ground = ndimage.median_filter(few, size=(*_AROUND, 1))
    blank = ground.repeat(_STEP, axis=0).repeat(_STEP, axis=1)[: material.texture.shape[0], : material.texture.shape[1]]
    return replace(surface, material=replace(material, texture=np.ascontiguousarray(blank)))


def take(worlds: Path, out: Path, each: int, count: int, skip: int) -> None:
    """Take the views, in an order that tells nothing."""
    cities: dict[str, list[Path]] = {}
    for folder in sorted(path.parent for path in worlds.glob("*/world.json")):
        cities.setdefault(folder.name.rpartition("_")[0], []).append(folder)
    taken: list[tuple[str, np.ndarray]] = []
    for city, folders in cities.items():
        views: list[tuple[str, np.ndarray]] = []
        for folder in folders:
            world = without_names(read_world(folder))
            walls = shapely.STRtree([shapely.Polygon(b.footprint[0]) for b in world.buildings])
            lined = [spot for spot in viewpoints(world, count=_TRIED) if _is_lined(spot, walls)]
            spots = lined[skip : skip + each]
            views += [(f"{folder.name} {k}", frame) for k, frame in enumerate(render_views(world, spots))]
        # The best of every district first, so that two views of a city are of two districts.
        views.sort(key=lambda view: (view[0].split()[1], view[0]))
        taken += [(f"{city}|{name}", frame) for name, frame in views[: each + 1]]
    chosen = _evenly(taken, count)
    order = rng(0, "blind test").permutation(len(chosen))
    out.mkdir(parents=True, exist_ok=True)
    key = {}
    for number, k in enumerate(order.tolist()):
        name, frame = chosen[k]
        Image.fromarray(frame).save(out / f"view_{number:02d}.png")
        key[f"{number:02d}"] = name.split("|")[0]
    (out / "key.json").write_text(json.dumps(key, indent=1) + "\n")
    (out / "names.txt").write_text("\n".join(sorted(cities)) + "\n")


def _is_lined(spot: Viewpoint, walls: shapely.STRtree) -> bool:
    """Return whether houses stand on both sides of a view: of a plain nobody can tell where it lies."""
    yaw, (x, y) = math.atan2(spot.forward[1], spot.forward[0]), spot.position[:2]
    met = 0
    for turn in _TURNS:
        end = x + _REACH * math.cos(yaw + turn), y + _REACH * math.sin(yaw + turn)
        met += len(walls.query(shapely.LineString([(x, y), end]), predicate="intersects")) > 0
    return met >= len(_TURNS) - 1


def _evenly(taken: Sequence[tuple[str, np.ndarray]], count: int) -> list[tuple[str, np.ndarray]]:
    """Return so many views: the first of every city, the second of every city, and so on."""
    seen: Counter[str] = Counter()
    ranked = []
    for k, (name, _) in enumerate(taken):
        city = name.split("|")[0]
        ranked.append((seen[city], k))
        seen[city] += 1
    return [taken[k] for _, k in sorted(ranked)[:count]]


def score(out: Path, answers: Path, note: str, table: Path | None) -> None:
    """Compare answers with the key; report the matrix and what each was told by."""
    key = json.loads((out / "key.json").read_text())
    given = json.loads(answers.read_text())
    names = sorted(set(key.values()))
    right = [number for number in key if given[number]["city"] == key[number]]
    counts = Counter((key[number], given[number]["city"]) for number in key)
    share = 100 * len(right) / len(key)
    lines = [
        "# Blind test: cities without lettering",
        "",
        f"{len(key)} views of {len(names)} cities at eye height, names on boards painted over, in an order that tells "
        "nothing; matched to the list of names by a judge who had seen none of them.",
        "",
        f"{len(right)} of {len(key)} right: {share:.0f} % (goal 85 %; {100 / len(names):.0f} % by guessing).",
        "",
        *([note, ""] if note else []),
        f"| is, down; was taken for | {' | '.join(names)} |",
        f"|:---|{'---:|' * len(names)}",
        *(f"| {a} | {' | '.join(str(counts[a, b] or '') for b in names)} |" for a in names),
        "",
        "| view | is | was taken for | by what |",
        "|---:|:---|:---|:---|",
        *(
            f"| {number} | {key[number]} | {given[number]['city']} | {given[number]['cue'].replace('|', '/')} |"
            for number in sorted(key)
        ),
    ]
    publish(lines, table)


def main() -> None:
    """Take views or score answers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("views", "score"))
    parser.add_argument("--worlds", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--each", type=int, default=2, help="views of a world")
    parser.add_argument("--count", type=int, default=24, help="views in all")
    parser.add_argument("--skip", type=int, default=0, help="the first views of a world, which are left out")
    parser.add_argument("--answers", type=Path)
    parser.add_argument("--note", default="", help="a sentence for the table")
    parser.add_argument("--table", type=Path)
    arguments = parser.parse_args()
    if arguments.what == "views":
        take(arguments.worlds, arguments.out, arguments.each, arguments.count, arguments.skip)
    else:
        score(arguments.out, arguments.answers, arguments.note, arguments.table)


if __name__ == "__main__":
    main()
