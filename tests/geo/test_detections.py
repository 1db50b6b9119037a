"""Files of detections: COCO and GeoJSON, posed, broken, and beside the point."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from detected_city import HEIGHT, WIDTH, coco, write_poses
from vico.errors import MissingFileError, SchemaError
from vico.geo.detections import rays_of, read_detections
from vico.geo.frame import LocalFrame
from vico.geo.street_image_folder import FolderImages
from vico.geo.street_images import undistort

FRAME = LocalFrame(60.169, 24.9435)
CAMERA = (0.0, -10.0, 0.0)


def written(folder: Path, content: Any) -> Path:
    path = folder / "found.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def test_rays_of_coco_boxes_point_at_the_things(tmp_path: Path) -> None:
    write_poses(tmp_path, FRAME, [CAMERA])
    content = coco([CAMERA], [("bench", (2.0, 1.0), 0.0, 0.8)])
    content["annotations"] += [
        {"id": 7, "image_id": 5, "category_id": 0, "bbox": [1, 1, 5, 5]},
        {"id": 8, "image_id": 0, "category_id": 0, "bbox": [1, 1, 0, 5]},
        {"id": 9, "image_id": 0, "category_id": 0, "bbox": [WIDTH - 9, 1, 20, 5]},
    ]
    found = read_detections(written(tmp_path, content), FRAME, 50.0)
    (one,) = found.sightings
    to = np.array([2.0, 1.0, 0.0]) - (0.0, -10.0, 2.0)
    assert one.foot == pytest.approx(to / np.linalg.norm(to), abs=1e-6)
    assert (one.photo, one.score, found.attribution) == ("0.jpg", 0.9, "Jo Doe, CC0")
    reasons = dict(found.refused)
    assert sorted(reasons) == ["d7", "d8", "d9"]
    assert "no image 5" in reasons["d7"]
    assert "no area" in reasons["d8"]
    assert "leaves photo" in reasons["d9"]


def test_a_panorama_and_a_bent_lens_are_looked_through(tmp_path: Path) -> None:
    write_poses(tmp_path, FRAME, [(0.0, 0.0, 90.0)], projection="equirectangular")
    (pose,) = FolderImages(tmp_path).poses(FRAME)
    ahead, behind, up = rays_of(pose, [(1000, 500), (0, 500), (1000, 0)], 2000, 1000)
    assert np.array([ahead, behind, up]) == pytest.approx(np.array([[1, 0, 0], [-1, 0, 0], [0, 0, 1]]), abs=1e-9)

    write_poses(tmp_path, FRAME, [(0.0, 0.0, 0.0)], focal=0.8, k1=-0.2, k2=0.05)
    (pose,) = FolderImages(tmp_path).poses(FRAME)
    picture = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    picture[900:904, 1300:1304] = 255  # where a straight lens would have it is found by straightening the picture
    straight = undistort(picture, 0.8 * WIDTH, -0.2, 0.05)
    row, column = np.argwhere(straight[..., 0] > 128).mean(axis=0) + 0.5
    ray = rays_of(pose, [(1302.0, 902.0)], WIDTH, HEIGHT)[0] @ pose.rotation.T
    at = ray[:2] / ray[2] * 0.8 * WIDTH + (WIDTH / 2, HEIGHT / 2)
    assert at == pytest.approx([column, row], abs=0.8)


def test_geojson_has_boxes_and_places(tmp_path: Path) -> None:
    write_poses(tmp_path, FRAME, [CAMERA])
    lat, lon = (float(v) for v in FRAME.to_geodetic((5.0, 6.0)))
    box = {"class": "bench", "photo": "0.jpg", "bbox": [10, 10, 20, 30], "width": WIDTH, "height": HEIGHT}
    features = [
        {"type": "Feature", "geometry": None, "properties": box},
        {"type": "Feature", "id": "x", "geometry": {"type": "Point", "coordinates": [lon, lat]},
         "properties": {"object_value": "object--bench", "photos": ["a", "b"], "score": 0.5}},
        {"type": "Feature", "id": "far", "geometry": {"type": "Point", "coordinates": [lon + 1, lat]},
         "properties": {"class": "bench"}},
        {"type": "Feature", "id": "none", "geometry": None, "properties": {"class": "bench"}},
    ]  # fmt: skip
    content = {"type": "FeatureCollection", "features": features}
    found = read_detections(written(tmp_path, content), FRAME, 50.0)
    assert [one.name for one in found.sightings] == ["bench"]
    (place,) = found.located
    assert (place.id, place.name, place.photos, place.score) == ("dx", "object--bench", ("a", "b"), 0.5)
    assert place.xy == pytest.approx([5.0, 6.0], abs=1e-3)
    assert dict(found.refused) == {
        "dfar": "it lies outside the window",
        "dnone": "neither a box in a photo nor a point",
    }


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("{", "not valid JSON"),
        ([{"image_id": 1}], "a bare list, as COCO's results are"),
        ({"things": []}, "neither COCO"),
        ({"annotations": [{}], "images": [], "categories": []}, "annotations.0.image_id: field required"),
        ({"annotations": [{"id": 1, "image_id": 1, "category_id": 1, "bbox": [0, 0, 1, 1], "score": 2}],
          "images": [], "categories": []}, "annotations.0.score"),
        ({"annotations": [{"id": 1, "image_id": 1, "category_id": 1, "bbox": [0, 0, 1, 1]}] * 2,
          "images": [], "categories": []}, "id 1 twice"),
        ({"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {}}]},
         "features.0.properties.class: field required"),
    ],
)  # fmt: skip
def test_a_broken_file_is_a_sentence_that_names_the_field(content: Any, says: str, tmp_path: Path) -> None:
    with pytest.raises(SchemaError, match=re.escape(says)):
        read_detections(written(tmp_path, content), FRAME, 50.0)


def test_boxes_without_poses_say_where_to_put_them(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"put photos.json .* beside it, or give the folder with --photos"):
        read_detections(written(tmp_path, coco([CAMERA], [("bench", (0.0, 0.0), 0.0, 1.0)])), FRAME, 50.0)
    with pytest.raises(MissingFileError, match="no such file of detections"):
        read_detections(tmp_path / "none.json", FRAME, 50.0)
