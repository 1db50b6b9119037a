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


def test_mujoco_loads_the_world_and_a_ball_comes_to_rest_on_its_ground(helsinki: World, tmp_path: Path) -> None:
    import mujoco

    counts = export_world(helsinki, "mjcf", tmp_path / "out")
    assert counts["hulls"] == len(helsinki.surfaces("collision"))
    x, y = helsinki.places[0].position[:2]
    spec = mujoco.MjSpec.from_file(str(tmp_path / "out" / "world.xml"))
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
    hulls = [p for p in stage.Traverse() if p.HasAPI(UsdPhysics.MeshCollisionAPI)]
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
