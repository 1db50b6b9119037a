"""Whatever bytes come, the readers of tiles answer with triangles that are sound, or with one of our errors."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tile_files import at_place, b3dm, box, cmpt, glb, square
from vico.errors import VicoError
from vico.geo.frame import LocalFrame
from vico.geo.gltf import read_gltf
from vico.geo.tiles3d import TileLimits, read_tileset
from vico.geo.tiles3d_files import read_tile_file

FRAME = LocalFrame(60.169, 24.9435)
PICTURE = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
UV = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
MODEL = glb(*square(0, 0, 5, 40), picture=PICTURE, uv=UV)
BATCHED = b3dm(MODEL, features=b'{"BATCH_LENGTH":2,"RTC_CENTER":[1,2,3]}', batch=b'{"a":[1,2]}')
MANY = cmpt(BATCHED, MODEL)
QUICK = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def check(data: bytes) -> None:
    told = "tile"
    try:
        models = read_tile_file(data, "tile").models
        for model in models:
            scene = read_gltf(model.model, "tile")
            for part in scene.parts:
                assert np.isfinite(part.positions).all()
                assert part.triangles.min() >= 0
                assert part.triangles.max() < len(part.positions) == len(part.uv) == len(part.colour)
                assert -1 <= part.texture < len(scene.textures)
    except VicoError as error:
        told = str(error)
    assert "\n" not in told
    assert told.startswith("tile")


@QUICK
@given(st.sampled_from([MODEL, BATCHED, MANY]), st.data())
def test_flipped_bytes(data: bytes, draw: st.DataObject) -> None:
    broken = bytearray(data)
    for _ in range(draw.draw(st.integers(1, 4))):
        broken[draw.draw(st.integers(0, len(broken) - 1))] = draw.draw(st.integers(0, 255))
    check(bytes(broken))


@QUICK
@given(st.sampled_from([MODEL, BATCHED, MANY]), st.integers(0, 4000), st.binary(max_size=40))
def test_cut_and_lengthened_files(data: bytes, cut: int, tail: bytes) -> None:
    check(data[: cut % (len(data) + 1)] + tail)


NUMBERS = st.one_of(st.integers(-3, 70000), st.floats(), st.none(), st.text(max_size=3), st.just([]), st.just({}))


@QUICK
@given(st.data())
def test_changed_values_of_the_json(draw: st.DataObject) -> None:
    def edit(document: dict[str, Any]) -> None:
        for _ in range(draw.draw(st.integers(1, 3))):
            here: Any = document
            while True:
                keys = sorted(here) if isinstance(here, dict) else list(range(len(here)))
                if not keys:
                    return
                key = draw.draw(st.sampled_from(keys))
                if isinstance(here[key], dict | list) and draw.draw(st.booleans()):
                    here = here[key]
                    continue
                here[key] = draw.draw(NUMBERS)
                break

    check(glb(*square(0, 0, 5, 40), picture=PICTURE, uv=UV, edit=edit))


ODD = st.one_of(
    st.none(), st.integers(), st.floats(), st.text(max_size=4), st.lists(st.floats(), max_size=16), st.just({})
)
VOLUMES = st.one_of(st.just(box(0, 0, 300)), st.dictionaries(st.sampled_from(["box", "region", "sphere"]), ODD), ODD)
CONTENTS = st.one_of(
    st.just({"uri": "a.glb"}), st.just({"url": "tileset.json"}), st.dictionaries(st.just("uri"), ODD), ODD
)
KEYS = {
    "boundingVolume": VOLUMES,
    "geometricError": ODD,
    "refine": st.sampled_from(["ADD", "REPLACE", "add", "", 3, None]),
    "content": CONTENTS,
    "contents": ODD,
    "transform": ODD,
    "extensions": ODD,
}


def above(inner: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    children = st.lists(inner, max_size=3)
    known = {"boundingVolume": st.just(box(0, 0, 300)), "geometricError": st.just(9)}
    return st.fixed_dictionaries({**known, "children": children})


TILES = st.recursive(st.fixed_dictionaries({}, optional=KEYS), above, max_leaves=6)


@QUICK
@given(TILES, ODD)
def test_tilesets_of_nonsense(tmp_path: Path, tile: dict[str, Any], asset: Any) -> None:
    root = {
        "transform": at_place(60.169, 24.9435),
        "boundingVolume": box(0, 0, 300),
        "geometricError": 99,
        "refine": "ADD",
        "content": {"uri": "a.glb"},
        "children": [tile],
    }
    (tmp_path / "a.glb").write_bytes(MODEL)
    (tmp_path / "tileset.json").write_text(json.dumps({"asset": asset, "geometricError": 100, "root": root}))
    mesh, report = read_tileset(tmp_path, FRAME, 200.0, error=1.0, limits=TileLimits(tiles=500))
    assert report.read >= 1
    assert len(mesh.triangles) >= 2
    assert np.isfinite(mesh.positions).all()
