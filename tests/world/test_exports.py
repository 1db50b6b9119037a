"""Exports: does each format's own reader find the same world in it?"""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

from vico.errors import InputError, OutputExistsError
from vico.world.exports import FORMATS, export_world
from vico.world.world import World


def test_trimesh_reads_the_gltf_with_every_object_where_it_stands(helsinki: World, tmp_path: Path) -> None:
    export_world(helsinki, "gltf", tmp_path / "out")
    scene = trimesh.load(tmp_path / "out" / "world.glb")
    outdoors = helsinki.objects.where(helsinki.objects.outdoors)
    assert len(outdoors) > 50
    models = helsinki.prototypes()
    for k in range(0, len(outdoors), 17):
        corners = np.concatenate([s.positions for s in models[str(outdoors.prototype[k])]])
        placed = corners @ outdoors.transforms()[k, :3, :3].T + outdoors.transforms()[k, :3, 3]
        names = [n for n in scene.graph.nodes_geometry if n == outdoors.id[k] or n.startswith(f"{outdoors.id[k]}_")]
        found = []
        for name in names:
            matrix, mesh = scene.graph[name]
            found.append(scene.geometry[mesh].vertices @ matrix[:3, :3].T + matrix[:3, 3])
        low, high = np.concatenate(found).min(0), np.concatenate(found).max(0)
        # glTF is y up: (x, y, z) of ours is (x, z, -y) there.
        np.testing.assert_allclose([low[0], low[1], -high[2]], placed.min(0)[[0, 2, 1]], atol=2e-3)
    walls = sum(len(s.triangles) for layer in ("ground", "buildings", "roofs") for s in helsinki.surfaces(layer))
    assert sum(len(g.faces) for g in scene.geometry.values()) >= walls


def test_each_building_is_a_node_of_the_gltf_by_its_id(helsinki: World, tmp_path: Path) -> None:
    export_world(helsinki, "gltf", tmp_path / "an export")
    content = (tmp_path / "an export" / "world.glb").read_bytes()
    text = json.loads(content[20 : 20 + int.from_bytes(content[12:16], "little")])
    nodes = {node["name"]: node for node in text["nodes"] if "mesh" in node}
    assert len(nodes) == len([node for node in text["nodes"] if "mesh" in node])
    for building in helsinki.buildings:
        parts = text["meshes"][nodes[building.id]["mesh"]]["primitives"]
        low = np.min([text["accessors"][p["attributes"]["POSITION"]]["min"] for p in parts], axis=0)
        high = np.max([text["accessors"][p["attributes"]["POSITION"]]["max"] for p in parts], axis=0)
        east, north = np.mean(building.footprint[0], axis=0)
        assert low[0] - 1 <= east <= high[0] + 1
        assert low[2] - 1 <= -north <= high[2] + 1
        assert nodes[building.id]["extras"]["entity"] == building.entity


def test_mujoco_loads_the_world_and_a_ball_comes_to_rest_on_its_ground(helsinki: World, tmp_path: Path) -> None:
    import mujoco

    counts = export_world(helsinki, "mjcf", tmp_path / "an export")
    assert counts["hulls"] == len(helsinki.surfaces("collision"))
    x, y = helsinki.places[0].position[:2]
    spec = mujoco.MjSpec.from_file(str(tmp_path / "an export" / "world.xml"))
    ball = spec.worldbody.add_body(pos=[x, y, float(helsinki.height((x, y))) + 0.5])
    ball.add_freejoint()
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0], mass=1.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(1500):
        mujoco.mj_step(model, data)
    assert data.qpos[2] == pytest.approx(float(helsinki.height(data.qpos[:2])) + 0.1, abs=0.06)


def test_openusd_reads_the_stage_it_is_given(helsinki: World, tmp_path: Path) -> None:
    pxr = pytest.importorskip("pxr", reason="OpenUSD is not installed: pip install 'virtual-community[usd]'")
    from pxr import Usd, UsdGeom, UsdPhysics

    del pxr
    export_world(helsinki, "usd", tmp_path / "out")
    stage = Usd.Stage.Open(str(tmp_path / "out" / "world.usdc"))
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    under = stage.GetPrimAtPath("/World/collision")
    hulls = [p for p in Usd.PrimRange(under) if p.HasAPI(UsdPhysics.MeshCollisionAPI)]
    assert len(hulls) == len(helsinki.surfaces("collision"))
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/objects"))
    outdoors = helsinki.objects.where(helsinki.objects.outdoors)
    places = np.array(instancer.GetPositionsAttr().Get())
    np.testing.assert_allclose(places, outdoors.position, atol=1e-3)
    # Its transforms, as USD itself composes them, turn the models as ours do.
    ours = outdoors.transforms()
    theirs = instancer.ComputeInstanceTransformsAtTime(0, 0)
    for k in range(0, len(outdoors), 23):
        np.testing.assert_allclose(np.array(theirs[k]).T, ours[k], atol=4e-3)
    for prim in stage.Traverse():
        for attribute in prim.GetAttributes():
            if attribute.GetName() == "inputs:file":
                assert (tmp_path / "out" / attribute.Get().path).is_file()


def test_a_usd_stage_has_what_a_simulator_of_robots_needs(helsinki: World, tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="OpenUSD is not installed: pip install 'virtual-community[usd]'")
    from pxr import Usd, UsdGeom, UsdLux, UsdPhysics, UsdSemantics, UsdShade

    export_world(helsinki, "usd", tmp_path / "an export")
    stage = Usd.Stage.Open(str(tmp_path / "an export" / "world.usdc"))
    assert stage.HasAuthoredMetadata("kilogramsPerUnit")
    (scene,) = [UsdPhysics.Scene(p) for p in stage.Traverse() if p.IsA(UsdPhysics.Scene)]
    assert tuple(scene.GetGravityDirectionAttr().Get()) == (0, 0, -1)
    assert {p.GetTypeName() for p in stage.Traverse() if p.HasAPI(UsdLux.LightAPI)} == {"DistantLight", "DomeLight"}
    colliders = [p for p in stage.Traverse() if p.HasAPI(UsdPhysics.CollisionAPI)]
    for prim in colliders:
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("physics")
        assert UsdPhysics.MaterialAPI(material.GetPrim()).GetStaticFrictionAttr().Get() > 0
    # Each model says what it is, and the solid ones have the box that people and robots meet.
    outdoors = helsinki.objects.where(helsinki.objects.outdoors)
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/objects"))
    paths, index = instancer.GetPrototypesRel().GetTargets(), list(instancer.GetProtoIndicesAttr().Get())
    boxes = UsdGeom.BBoxCache(0, [UsdGeom.Tokens.guide])
    for k in range(0, len(outdoors), 7):
        model = stage.GetPrimAtPath(paths[index[k]])
        assert list(UsdSemantics.LabelsAPI(model, "class").GetLabelsAttr().Get()) == [outdoors.kind[k]]
        box = stage.GetPrimAtPath(paths[index[k]].AppendChild("collider"))
        assert box.IsValid() == bool(outdoors.solid[k])
        if box.IsValid():
            sides = np.array(boxes.ComputeLocalBound(box).ComputeAlignedRange().GetSize()) * outdoors.scale[k]
            corners = outdoors.feet()[k]
            wide, deep = np.linalg.norm(corners[1] - corners[0]), np.linalg.norm(corners[2] - corners[1])
            np.testing.assert_allclose(sides, [wide, deep, outdoors.size_z[k]], atol=0.03)


def test_geojson_lies_on_earth_where_the_world_does(helsinki: World, tmp_path: Path) -> None:
    counts = export_world(helsinki, "geojson", tmp_path / "out", rooms=True)
    west, south, east, north = helsinki.manifest.bbox
    content = {name: json.loads((tmp_path / "out" / f"{name}.geojson").read_text()) for name in counts}
    assert counts["buildings"] == len(helsinki.buildings)
    assert counts["places"] == len(helsinki.places)
    assert counts["rooms"] == len(helsinki.rooms)
    points = np.array([f["geometry"]["coordinates"][:2] for f in content["places"]["features"]])
    assert ((points > [west, south]) & (points < [east, north])).all()
    building = helsinki.buildings[0]
    ring = np.array(content["buildings"]["features"][0]["geometry"]["coordinates"][0])
    back = helsinki.frame.to_enu(ring[:, 1], ring[:, 0])
    np.testing.assert_allclose(back[:-1], building.footprint[0], atol=0.02)


def test_opendrive_is_the_worlds_own(helsinki: World, helsinki_path: Path, tmp_path: Path) -> None:
    export_world(helsinki, "xodr", tmp_path / "out")
    assert (tmp_path / "out" / "roads.xodr").read_bytes() == (helsinki_path / "roads.xodr").read_bytes()
    assert ElementTree.parse(tmp_path / "out" / "roads.xodr").getroot().tag == "OpenDRIVE"


@pytest.mark.parametrize("name", ["geojson", "xodr"])
def test_every_export_credits_its_sources(helsinki: World, tmp_path: Path, name: str) -> None:
    export_world(helsinki, name, tmp_path / "out")
    assert "OpenStreetMap contributors (ODbL-1.0)" in (tmp_path / "out" / "CREDITS.txt").read_text()


def test_an_unknown_format_and_a_full_folder_are_refused(helsinki: World, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="gltf, usd, mjcf, geojson, xodr"):
        export_world(helsinki, "fbx", tmp_path / "out")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    with pytest.raises(OutputExistsError, match="--force"):
        export_world(helsinki, "xodr", tmp_path / "out")
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
    assert sorted(FORMATS) == ["geojson", "gltf", "mjcf", "usd", "xodr"]
