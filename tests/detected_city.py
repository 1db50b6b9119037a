"""Posed photos of things whose places are known, and the boxes that a detector would draw in them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vico.geo.frame import LocalFrame
from vico.geo.street_images import camera_rotation

WIDTH, HEIGHT, FOV = 1600, 1200, 60.0
Place = tuple[float, float]


def write_poses(folder: Path, frame: LocalFrame, cameras: Sequence[tuple[float, float, float]], **more: Any) -> None:
    """Write ``photos.json`` of cameras: x and y (metres) and heading (degrees); no picture is there."""
    rows = []
    for k, (x, y, heading) in enumerate(cameras):
        lat, lon = frame.to_geodetic((x, y))
        rows.append({"file": f"{k}.jpg", "lat": float(lat), "lon": float(lon), "heading": heading, "eye": 2.0,
                     **(more if more else {"fov": FOV})})  # fmt: skip
    text = json.dumps({"schema": "vico.photos", "version": 1, "attribution": "Jo Doe, CC0", "photos": rows})
    (folder / "photos.json").write_text(text)


def box_of(camera: tuple[float, float, float], thing: Place, low: float, high: float) -> list[float] | None:
    """Box of a thing half a metre wide between two heights, as a camera 2 m above flat ground sees it."""
    focal = HEIGHT / 2 / np.tan(np.radians(FOV) / 2)
    corners = np.array([[*thing, z] for z in (low, high)]) - (camera[0], camera[1], 2.0)
    seen = corners @ camera_rotation(camera[2]).T
    if seen[:, 2].min() < 1.0:
        return None
    u, v = seen[:, 0] / seen[:, 2] * focal + WIDTH / 2, seen[:, 1] / seen[:, 2] * focal + HEIGHT / 2
    wide = 0.5 / seen[0, 2] * focal
    left, top, tall = float(u.mean() - wide / 2), float(v[1]), float(v[0] - v[1])
    if left < 0 or left + wide > WIDTH or top < 0 or top + tall > HEIGHT:
        return None
    return [left, top, wide, tall]


def coco(
    cameras: Sequence[tuple[float, float, float]], things: Sequence[tuple[str, Place, float, float]], **scores: float
) -> dict[str, Any]:
    """COCO file of what the cameras see of things: class, place, lowest and highest point."""
    names = list(dict.fromkeys(name for name, *_ in things))
    annotations = []
    for k, camera in enumerate(cameras):
        for name, place, low, high in things:
            box = box_of(camera, place, low, high)
            if box is not None:
                annotations.append({"id": len(annotations), "image_id": k, "category_id": names.index(name),
                                    "bbox": box, "score": scores.get(name, 0.9), "iscrowd": 0})  # fmt: skip
    return {
        "info": {"description": "made for a test"},
        "images": [{"id": k, "file_name": f"{k}.jpg", "width": WIDTH, "height": HEIGHT} for k in range(len(cameras))],
        "annotations": annotations,
        "categories": [{"id": k, "name": name} for k, name in enumerate(names)],
    }
