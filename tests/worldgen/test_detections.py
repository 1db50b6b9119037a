"""Things that photos show: triangulated, outliers rejected, matched to the map by rule, each with its photos."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from detected_city import coco, write_poses
from vico.errors import SchemaError
from vico.geo.detections import read_detections
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, OsmNode
from vico.seeds import rng
from vico.world.folder import read_world
from vico.world.heights import HeightField
from vico.world.world import World, detected_objects
from vico.worldgen.objects.detections import DetectedThings, detected_classes, things_from_detections
from vico.worldgen.pipeline import build_world
from vico.worldgen.request import BuildOptions, Sources, packaged_extract

FRAME = LocalFrame(60.169, 24.9435)
GROUND = HeightField.flat(60.0)
#: Along a street, every 8 m, looking half left and half right.
CAMERAS = [(x, 0.0, heading) for x in (-24.0, -16.0, -8.0, 0.0, 8.0) for heading in (45.0, 135.0)]
THINGS = [("bench", (0.0, 9.0), 0.0, 0.8), ("bench", (6.0, 8.0), 0.0, 0.8), ("fire hydrant", (-6.0, -7.0), 0.0, 0.9),
          ("traffic light", (2.0, -9.0), 2.4, 3.4)]  # fmt: skip


def seen(folder: Path, content: dict, mapped: list[OsmNode] | None = None) -> DetectedThings:
    write_poses(folder, FRAME, CAMERAS)
    (folder / "found.json").write_text(json.dumps(content))
    osm = OsmData(FRAME, 50.0, 60.0, mapped or [], [], [], [])
    return things_from_detections(osm, read_detections(folder / "found.json", FRAME, 50.0), GROUND)


def test_things_are_triangulated_though_boxes_are_rough_and_some_are_wrong(tmp_path: Path) -> None:
    content = coco(CAMERAS, THINGS)
    random = rng(3, "boxes")
    for one in content["annotations"]:
        one["bbox"] = [v + float(random.normal(0.0, 8.0)) for v in one["bbox"]]  # a degree is some 18 pixels
    for k, image in enumerate((0, 3, 6)):  # benches that no other photo shows, high up, so on no near ground
        content["annotations"].append({"id": 900 + k, "image_id": image, "category_id": 0,
                                       "bbox": [200.0 + 300 * k, 100.0, 60.0, 60.0], "score": 0.99})  # fmt: skip
    things = seen(tmp_path, content)
    assert len(things.records) == len(THINGS)
    for name, place, *_ in THINGS:
        near = [r for r in things.records if r.name == name and math.dist(r.seen_at, place) < 0.7]
        assert len(near) == 1, (name, [r.seen_at for r in things.records])
        assert near[0].how == "triangulated"
        assert len(near[0].photos) >= 2
        assert near[0].spread < 0.5
        assert near[0].decision == "new"
        assert near[0].off_map is None
    dropped = {one.id: one.reason for one in things.dropped}
    assert {"d900", "d901", "d902"} <= set(dropped)
    assert all("foot meets no ground" in dropped[key] for key in ("d900", "d901", "d902"))


def test_one_photo_places_only_what_is_near_sure_and_on_the_ground(tmp_path: Path) -> None:
    camera = [CAMERAS[0]]
    things = [("bench", (-16.0, 6.0), 0.0, 0.8), ("mailbox", (5.0, 28.0), 0.0, 1.2),
              ("stop sign", (-15.0, 8.0), 2.0, 2.8), ("zebra", (-16.0, 9.0), 0.0, 1.0),
              ("tent", (-14.0, 11.0), 0.0, 1.5)]  # fmt: skip
    made = seen(tmp_path, coco(camera, things, tent=0.2))
    assert [(r.name, r.how, r.photos) for r in made.records] == [("bench", "on the ground", ("0.jpg",))]
    assert made.records[0].seen_at == pytest.approx((-16.0, 6.0), abs=0.05)
    reasons = [one.reason for one in made.dropped]
    assert sorted(reason.split(",")[0].split(";")[0] for reason in reasons) == sorted(
        ["seen in one photo alone", "seen in fewer than 3 photos that agree", "class 'zebra' stands for nothing",
         "score under 0.3"])  # fmt: skip


def test_the_map_wins_or_a_thing_moves_by_a_rule_that_the_record_tells(tmp_path: Path) -> None:
    mapped = [
        OsmNode(1, np.array([0.5, 9.5]), {"amenity": "bench"}),
        OsmNode(2, np.array([6.0, 11.2]), {"amenity": "bench"}),
        OsmNode(3, np.array([-6.0, -7.0]), {"amenity": "post_box"}),
    ]
    things = seen(tmp_path, coco(CAMERAS, THINGS), mapped)
    told = {r.object: (r.name, r.decision) for r in things.records}
    assert told["n1"] == ("bench", "map wins")
    assert told["n2"] == ("bench", "moved")
    assert sorted(name for name, decision in told.values() if decision == "new") == ["fire hydrant", "traffic light"]
    after = things.on(OsmData(FRAME, 50.0, 60.0, mapped, [], [], []))
    assert after.nodes[0].xy is mapped[0].xy
    assert after.nodes[1].xy == pytest.approx([6.0, 8.0], abs=0.1)
    assert {next(iter(node.tags.items())) for node in after.nodes[3:]} == {
        ("emergency", "fire_hydrant"), ("highway", "traffic_signals")}  # fmt: skip
    assert all(node.id < 0 for node in after.nodes[3:])


def test_what_an_order_of_the_file_is_does_not_matter(tmp_path: Path) -> None:
    content = coco(CAMERAS, THINGS)
    first = {(r.name, r.seen_at) for r in seen(tmp_path, content).records}
    content["annotations"].reverse()
    again = {(r.name, r.seen_at) for r in seen(tmp_path, content).records}
    assert [a[0] for a in sorted(first)] == [a[0] for a in sorted(again)]
    for (_, a), (_, b) in zip(sorted(first), sorted(again), strict=True):
        assert a == pytest.approx(b, abs=0.05)


def test_classes_are_data_that_is_checked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    (tmp_path / "worldgen/objects").mkdir(parents=True)
    file = tmp_path / "worldgen/objects" / "detections_mine.toml"
    file.write_text('[[class]]\nnames = ["Bench"]\ntags = { amenity = "nothing at all" }\n')
    with pytest.raises(SchemaError, match=r"class.0.tags: no model stands for them"):
        detected_classes()
    other = tmp_path / "other"
    (other / "worldgen/objects").mkdir(parents=True)
    (other / "worldgen/objects" / "detections_mine.toml").write_text(
        '[[class]]\nnames = ["Bench"]\ntags = { leisure = "x", amenity = "clock" }\n'
    )
    monkeypatch.setenv("VICO_DATA", str(other))
    assert detected_classes().by_name["bench"].tags["amenity"] == "clock"
    assert detected_classes().rules.same == 4.0


def test_a_world_says_what_each_detection_became(corner: World, tmp_path: Path) -> None:
    """A hydrant where the map has none: it stands in the world, with its photos; all else is as it was."""
    cells = np.argwhere(corner.walkable.cls > 0)
    middles = corner.walkable.centre_of(cells)
    inner = np.abs(middles).max(axis=1) < 45.0
    x, y = middles[inner][corner.walkable.clearance_at(middles[inner]).argmax()]
    place = float(x), float(y)
    cameras = [(place[0] + dx, place[1] + dy, heading) for dx, dy, heading in
               ((-7.0, 0.0, 90.0), (0.0, -7.0, 0.0), (7.0, 0.0, 270.0))]  # fmt: skip
    write_poses(tmp_path, FRAME, cameras)
    (tmp_path / "found.json").write_text(json.dumps(coco(cameras, [("fire hydrant", place, 0.0, 0.9)])))
    out = tmp_path / "world"
    build_world(Sources(packaged_extract().path, detections=tmp_path / "found.json"), lat=60.1690, lon=24.9435,
                half=60.0, seed=0, out=out, options=BuildOptions(previews=False))  # fmt: skip
    world = read_world(out)
    (told,) = detected_objects(world)
    assert (told.decision, told.photos, told.how) == ("new", ("0.jpg", "1.jpg", "2.jpg"), "triangulated")
    row = np.flatnonzero(world.objects.id == told.object)
    assert len(row) == 1, [stage.dropped for stage in world.manifest.stages if stage.name == "objects"]
    assert math.dist((world.objects.x[row[0]], world.objects.y[row[0]]), place) < 3.5
    assert any(source.kind == "detections" and "Jo Doe" in source.attribution for source in world.manifest.sources)
    assert detected_objects(corner) == []
    assert not corner.file("detections.json").exists()
