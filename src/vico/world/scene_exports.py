"""Looks and collision shapes of a world, as glTF, MuJoCo's MJCF, and OpenUSD.

glTF
    One glTF 2.0 file (GLB) with everything that can be seen; models are stored once and placed by nodes.
MJCF
    The ground as a height field, buildings as convex bodies, street furniture as boxes, textured looks.
OpenUSD
    One binary stage with textured meshes, instanced models, labels, light, and colliders (UsdPhysics).
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.errors import MissingExtraError
from vico.io.files import write_bytes
from vico.world.glb import glb_bytes
from vico.world.mesh import Material, Surface, merge_surfaces
from vico.world.objects import Objects
from vico.world.world import World

_SEEN = ("ground", "buildings", "roofs")
_OF_BUILDINGS = ("buildings", "roofs")
# ENU, z up, to glTF's axes, y up.
_AXES = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], np.float64)


def write_gltf(world: World, folder: Path, *, rooms: bool) -> dict[str, int]:
    """Write ``world.glb``: y up, metres, the origin at the window's centre.

    Nodes are named by the ids of buildings and objects, so that programs which pick can tell them apart.
    """
    names = [*_SEEN, "rooms"] if rooms else list(_SEEN)
    objects = world.objects if rooms else world.objects.where(world.objects.outdoors)
    models = world.prototypes()
    used = sorted(set(objects.prototype.tolist()))
    layers: dict[str, Sequence[Surface]] = {}
    buildings = {building.entity: building for building in world.buildings}
    known = {building.id: building for building in world.buildings}
    for name in names:
        for surface in world.surfaces(name):
            for entity, part in _by_entity(surface, set(buildings)) if name in _OF_BUILDINGS else [(0, surface)]:
                node = buildings[entity].id if entity else name
                layers[node] = [*layers.get(node, ()), part]
    layers |= {f"model {name}": models[name] for name in used}
    glb = glb_bytes(layers)
    length = struct.unpack_from("<I", glb, 12)[0]
    text, binary = json.loads(glb[20 : 20 + length]), glb[28 + length :]
    mesh_of: dict[str, int] = {}
    nodes: list[dict[str, Any]] = []
    for node in text["nodes"]:
        if node["name"].startswith("model "):
            if "mesh" in node:
                mesh_of[node["name"].removeprefix("model ")] = node["mesh"]
        else:
            if building := known.get(node["name"]):
                facts = {"kind": "building", "entity": building.entity, "name": building.name, "use": building.use}
                node["extras"] = {key: value for key, value in facts.items() if value is not None}
            nodes.append(node)
    matrices = _AXES @ objects.transforms().astype(np.float64) @ _AXES.T
    for k, prototype in enumerate(objects.prototype.tolist()):
        if prototype in mesh_of:
            nodes.append(
                {
                    "name": str(objects.id[k]),
                    "mesh": mesh_of[prototype],
                    "matrix": [round(float(v), 6) for v in matrices[k].T.ravel()],
                    "extras": {"kind": str(objects.kind[k]), "entity": int(objects.entity[k])},
                }
            )
    text["nodes"] = nodes
    text["scenes"] = [{"name": world.manifest.name, "nodes": list(range(len(nodes)))}]
    origin = world.manifest.origin
    text["asset"]["copyright"] = "; ".join(source.attribution for source in world.manifest.sources)
    text["asset"]["extras"] = {
        "latitude": origin.lat,
        "longitude": origin.lon,
        "buildings": {building.id: building.entity for building in world.buildings},
    }
    write_bytes(folder / "world.glb", _glb_container(text, binary))
    return {"nodes": len(nodes), "models": len(mesh_of), "layers": len(names)}


def _by_entity(surface: Surface, buildings: set[int]) -> Iterator[tuple[int, Surface]]:
    """Split a surface into the parts of buildings; what is of none has the number 0."""
    owner = surface.entity[surface.triangles[:, 0]] if len(surface.triangles) else np.zeros(0, np.int32)
    owner = np.where(np.isin(owner, list(buildings)), owner, 0)
    for entity in np.unique(owner).tolist():
        used, corners = np.unique(surface.triangles[owner == entity], return_inverse=True)
        yield (
            entity,
            replace(
                surface,
                positions=surface.positions[used],
                normals=surface.normals[used],
                uv=surface.uv[used],
                colour=surface.colour[used],
                entity=surface.entity[used],
                triangles=corners.reshape(-1, 3).astype(np.int32),
            ),
        )


def _glb_container(document: dict[str, Any], binary: bytes) -> bytes:
    text = json.dumps(document, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


_CELL = 1.0  # metres between the height field's corners
_DEPTH = 5.0  # metres of solid below its lowest point
_LEAST = 1e-4


def write_mjcf(world: World, folder: Path, *, rooms: bool) -> dict[str, int]:
    """Write ``world.xml`` with its ``assets``: z up, metres, the origin at the window's centre.

    Collision lies in geom group 3 and looks in group 2, as is usual; looks take no part in contacts.
    """
    root = Element("mujoco", model="".join(c if c.isalnum() or c in "_-" else "_" for c in world.manifest.name))
    SubElement(root, "compiler", meshdir="assets", texturedir="assets", angle="radian")
    SubElement(root, "option", timestep="0.002")
    visual = SubElement(root, "visual")
    SubElement(visual, "map", zfar=str(4 * world.half), znear="0.02")
    SubElement(visual, "headlight", ambient="0.45 0.45 0.45", diffuse="0.45 0.45 0.45")
    default = SubElement(root, "default")
    for name, attributes in {
        "collision": {"group": "3", "rgba": "0.7 0.7 0.7 0.4"},
        "looks": {"group": "2", "contype": "0", "conaffinity": "0", "mass": "0"},
    }.items():
        SubElement(SubElement(default, "default", {"class": name}), "geom", attributes)
    asset, body = SubElement(root, "asset"), SubElement(root, "worldbody")
    SubElement(body, "light", pos=f"0 0 {2 * world.half}", dir="-0.4 0.3 -0.87", directional="true")
    _ground(world, asset, body, folder)
    layers = [*_SEEN, "rooms"] if rooms else list(_SEEN)
    looks = _looks([s for layer in layers for s in world.surfaces(layer)], asset, body, folder)
    hulls = _hulls(world, asset, body)
    boxes = _boxes(world, body, rooms)
    indent(root)
    write_bytes(folder / "world.xml", b'<?xml version="1.0" encoding="utf-8"?>\n' + tostring(root, encoding="utf-8"))
    return {"hulls": hulls, "boxes": boxes, "materials": looks}


def _numbers(values: Any) -> str:
    return " ".join(f"{float(v):.6g}" for v in np.ravel(values))


def _ground(world: World, asset: Element, body: Element, folder: Path) -> None:
    half = world.half
    count = round(2 * half / _CELL) + 1
    axis = np.linspace(-half, half, count)
    xx, yy = np.meshgrid(axis, axis)
    heights = world.height(np.stack([xx, yy], axis=-1))
    low, high = float(heights.min()), float(heights.max())
    if high - low < _LEAST:
        SubElement(
            body,
            "geom",
            {"class": "collision", "type": "plane", "name": "ground", "pos": _numbers([0, 0, low])},
            size=_numbers([half, half, 1]),
        )
        return
    # MuJoCo's own binary layout: rows, columns, then the heights, which it scales to 0..1.
    write_bytes(folder / "assets" / "ground.bin", struct.pack("<ii", count, count) + heights.astype("<f4").tobytes())
    SubElement(asset, "hfield", name="ground", file="ground.bin", size=_numbers([half, half, high - low, _DEPTH]))
    SubElement(
        body, "geom", {"class": "collision", "type": "hfield", "name": "ground"}, hfield="ground", pos=f"0 0 {low:.6g}"
    )


def _hulls(world: World, asset: Element, body: Element) -> int:
    count = 0
    for surface in world.surfaces("collision"):
        points = np.unique(surface.positions.astype(np.float64), axis=0)
        if len(points) < 4 or np.linalg.matrix_rank(points - points[0], tol=1e-3) < 3:
            continue
        middle = (points.min(0) + points.max(0)) / 2
        SubElement(asset, "mesh", name=f"hull{count}", vertex=_numbers(points - middle), inertia="convex")
        SubElement(
            body,
            "geom",
            {"class": "collision", "type": "mesh", "name": f"{int(surface.entity[0])}/{count}"},
            mesh=f"hull{count}",
            pos=_numbers(middle),
        )
        count += 1
    return count


def _boxes(world: World, body: Element, rooms: bool) -> int:
    objects = world.objects.where(world.objects.solid & (world.objects.outdoors | rooms))
    feet = objects.feet()
    for k in range(len(objects)):
        size = np.linalg.norm([feet[k, 1] - feet[k, 0], feet[k, 2] - feet[k, 1]], axis=1) / 2
        tall = max(float(objects.size_z[k]) / 2, 0.01)
        SubElement(
            body,
            "geom",
            {"class": "collision", "type": "box", "name": f"{int(objects.entity[k])}/{objects.id[k]}"},
            size=_numbers([*np.maximum(size, 0.01), tall]),
            pos=_numbers([objects.x[k], objects.y[k], objects.z[k] + tall]),
            euler=_numbers([0, 0, objects.yaw[k]]),
        )
    return len(objects)


def _looks(surfaces: list[Surface], asset: Element, body: Element, folder: Path) -> int:
    count = 0
    for surface in merge_surfaces(surfaces):
        # MuJoCo has no vertex colours: one mesh a tint of a material, tints rounded to a few steps.
        colour = surface.colour[surface.triangles[:, 0]].astype(np.int64)
        tints, tint_of = np.unique(
            np.minimum((colour + 32) // 64 * 64, 255).astype(np.uint8), axis=0, return_inverse=True
        )
        tint_of = np.ravel(tint_of)
        faces_of = np.bincount(tint_of)
        # A mesh needs four corners there: a lone triangle takes the tint that most others have.
        lone = [k for k in range(len(tints)) if len(np.unique(surface.triangles[tint_of == k])) < 4]
        tint_of = np.where(np.isin(tint_of, lone), int(faces_of.argmax()), tint_of)
        texture = surface.material.texture
        if texture is not None:
            picture = io.BytesIO()
            Image.fromarray(texture[:, :, :3][::-1]).save(picture, "PNG")
            write_bytes(folder / "assets" / f"texture{count}.png", picture.getvalue())
            SubElement(asset, "texture", type="2d", name=f"texture{count}", file=f"texture{count}.png")
        for k, tint in enumerate(tints):
            faces = surface.triangles[tint_of == k]
            if len(np.unique(faces)) < 4:
                continue
            name = f"looks{count}_{k}"
            write_bytes(folder / "assets" / f"{name}.obj", _obj(surface, faces))
            SubElement(asset, "mesh", name=name, file=f"{name}.obj", inertia="shell")
            attributes = {"name": name, "rgba": _numbers([*(tint / 255.0), 1.0])}
            if texture is not None:
                attributes |= {"texture": f"texture{count}"}
            SubElement(asset, "material", attributes)
            SubElement(body, "geom", {"class": "looks", "type": "mesh"}, mesh=name, material=name)
        count += 1
    return count


def _obj(surface: Surface, faces: NDArray[np.int32]) -> bytes:
    used, index = np.unique(faces, return_inverse=True)
    lines = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in surface.positions[used].tolist()]
    lines += [f"vt {u:.5f} {v:.5f}" for u, v in surface.uv[used].tolist()]
    lines += [f"vn {x:.4f} {y:.4f} {z:.4f}" for x, y, z in surface.normals[used].tolist()]
    corners = (index.reshape(-1, 3) + 1).tolist()
    lines += [f"f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}" for a, b, c in corners]
    return ("\n".join(lines) + "\n").encode()


_LABELS = {"ground": "ground", "buildings": "building", "roofs": "roof", "rooms": "room"}
_GRAVITY = 9.81  # m/s²
_FRICTION = 0.8, 0.7  # of stone and asphalt: at rest and sliding; nothing bounces
_SUN, _SKY = 3000.0, 500.0  # intensities of a bright day as Isaac Sim's own scenes have them


def write_usd(world: World, folder: Path, *, rooms: bool) -> dict[str, int]:
    """Write ``world.usdc`` with its ``textures``: z up, metres, the origin at the window's centre.

    Raises
    ------
    MissingExtraError
        If OpenUSD is not installed.
    """
    try:
        from pxr import Gf, Usd, UsdGeom, UsdLux, UsdPhysics
    except ImportError:
        raise MissingExtraError("OpenUSD is not installed: pip install 'virtual-community[usd]'") from None
    stage = Usd.Stage.CreateNew(str(folder / "world.usdc"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    top = UsdGeom.Xform.Define(stage, "/World").GetPrim()
    stage.SetDefaultPrim(top)
    origin = world.manifest.origin
    top.SetCustomDataByKey("latitude", origin.lat)
    top.SetCustomDataByKey("longitude", origin.lon)
    top.SetCustomDataByKey("credits", "; ".join(source.attribution for source in world.manifest.sources))
    scene = UsdPhysics.Scene.Define(stage, "/World/physics")
    scene.CreateGravityDirectionAttr(Gf.Vec3f(0.0, 0.0, -1.0))
    scene.CreateGravityMagnitudeAttr(_GRAVITY)
    sun = UsdLux.DistantLight.Define(stage, "/World/lights/sun")
    sun.CreateIntensityAttr(_SUN)
    sun.AddRotateXYZOp().Set(Gf.Vec3f(40.0, 0.0, 30.0))
    UsdLux.DomeLight.Define(stage, "/World/lights/sky").CreateIntensityAttr(_SKY)
    writer = _Writer(stage, folder)
    layers = [*_SEEN, "rooms"] if rooms else list(_SEEN)
    for layer in layers:
        _label(UsdGeom.Scope.Define(stage, f"/World/{layer}").GetPrim(), _LABELS[layer])
        for k, surface in enumerate(world.surfaces(layer)):
            writer.mesh(f"/World/{layer}/part_{k}", surface)
    instances = _instances(world, writer, rooms)
    UsdGeom.Scope.Define(stage, "/World/collision")
    hulls = 0
    for k, surface in enumerate(world.surfaces("collision")):
        mesh = writer.mesh(f"/World/collision/hull_{k}", surface)
        UsdGeom.Imageable(mesh).CreatePurposeAttr(UsdGeom.Tokens.guide)
        writer.collides(mesh.GetPrim(), UsdPhysics.Tokens.convexHull)
        hulls += 1
    for prim in stage.GetPrimAtPath("/World/ground").GetChildren():
        writer.collides(prim, UsdPhysics.Tokens.none)
    stage.GetRootLayer().Save()
    return {"meshes": writer.meshes, "materials": len(writer.materials), "instances": instances, "hulls": hulls}


class _Writer:
    """Writes meshes and, once each, their materials and textures."""

    def __init__(self, stage: Any, folder: Path) -> None:
        self.stage = stage
        self.folder = folder
        self.materials: dict[str, Any] = {}
        self.meshes = 0
        self.friction: Any = None

    def collides(self, prim: Any, approximation: str | None = None) -> None:
        """Make a prim take part in contacts, a mesh as its hull or as it is."""
        from pxr import UsdPhysics, UsdShade

        if self.friction is None:
            self.friction = UsdShade.Material.Define(self.stage, "/World/materials/friction")
            values = UsdPhysics.MaterialAPI.Apply(self.friction.GetPrim())
            values.CreateStaticFrictionAttr(_FRICTION[0])
            values.CreateDynamicFrictionAttr(_FRICTION[1])
            values.CreateRestitutionAttr(0.0)
        UsdPhysics.CollisionAPI.Apply(prim)
        if approximation is not None:
            UsdPhysics.MeshCollisionAPI.Apply(prim).CreateApproximationAttr(approximation)
        binding = UsdShade.MaterialBindingAPI.Apply(prim)
        binding.Bind(self.friction, UsdShade.Tokens.weakerThanDescendants, "physics")

    def mesh(self, path: str, surface: Surface) -> Any:
        from pxr import Sdf, UsdGeom, UsdShade, Vt

        mesh = UsdGeom.Mesh.Define(self.stage, path)
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(surface.positions, np.float32)))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(surface.triangles), 3, np.int32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.ascontiguousarray(surface.triangles.ravel())))
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(surface.normals, np.float32)))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateDoubleSidedAttr(surface.material.double_sided)
        if len(surface.positions):
            low, high = surface.positions.min(0), surface.positions.max(0)
            mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack([low, high]).astype(np.float32)))
        values = UsdGeom.PrimvarsAPI(mesh)
        colour = values.CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, UsdGeom.Tokens.vertex)
        colour.Set(Vt.Vec3fArray.FromNumpy(_linear(surface.colour)))
        entity = values.CreatePrimvar("entity", Sdf.ValueTypeNames.IntArray, UsdGeom.Tokens.vertex)
        entity.Set(Vt.IntArray.FromNumpy(np.ascontiguousarray(surface.entity, np.int32)))
        if surface.material.texture is not None:
            # USD counts a texture's rows from below.
            uv = surface.uv.astype(np.float32) * np.array([1, -1], np.float32) + np.array([0, 1], np.float32)
            st = values.CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
            st.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(uv)))
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(self._material(surface.material))
        self.meshes += 1
        return mesh

    def _material(self, material: Material) -> Any:
        from pxr import Sdf, UsdShade

        if material.name in self.materials:
            return self.materials[material.name]
        name = f"m{len(self.materials)}"
        path = f"/World/materials/{name}"
        made = UsdShade.Material.Define(self.stage, path)
        shader = UsdShade.Shader.Define(self.stage, f"{path}/surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.9)
        made.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        base = shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f)
        reader = UsdShade.Shader.Define(self.stage, f"{path}/colour")
        if material.texture is None:
            reader.CreateIdAttr("UsdPrimvarReader_float3")
            reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
            base.ConnectToSource(reader.ConnectableAPI(), "result")
        else:
            picture = io.BytesIO()
            Image.fromarray(material.texture).save(picture, "PNG")
            write_bytes(self.folder / "textures" / f"{name}.png", picture.getvalue())
            reader.CreateIdAttr("UsdUVTexture")
            reader.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(f"./textures/{name}.png")
            for side in ("wrapS", "wrapT"):
                reader.CreateInput(side, Sdf.ValueTypeNames.Token).Set("repeat")
            st = UsdShade.Shader.Define(self.stage, f"{path}/st")
            st.CreateIdAttr("UsdPrimvarReader_float2")
            st.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
            reader.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(st.ConnectableAPI(), "result")
            base.ConnectToSource(reader.ConnectableAPI(), "rgb")
            if material.cutout:
                opacity = shader.CreateInput("opacity", Sdf.ValueTypeNames.Float)
                opacity.ConnectToSource(reader.ConnectableAPI(), "a")
                shader.CreateInput("opacityThreshold", Sdf.ValueTypeNames.Float).Set(0.5)
        self.materials[material.name] = made
        return made


def _linear(colour: Any) -> Any:
    """SRGB bytes as the linear colours USD keeps."""
    share = colour.astype(np.float64) / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.ascontiguousarray(linear, np.float32)


def _label(prim: Any, name: str) -> None:
    """Label a prim for cameras that segment: by OpenUSD's schema, and by that of older Omniverse programs."""
    from pxr import Sdf, UsdSemantics, Vt

    UsdSemantics.LabelsAPI.Apply(prim, "class").CreateLabelsAttr(Vt.TokenArray([name]))
    prim.AddAppliedSchema("SemanticsAPI:Semantics_class")
    for key, value in (("semanticType", "class"), ("semanticData", name)):
        prim.CreateAttribute(f"semantic:Semantics_class:params:{key}", Sdf.ValueTypeNames.String).Set(value)


def _instances(world: World, writer: _Writer, rooms: bool) -> int:
    """Place the things of the world as instances of models: one model for each look, kind and foot."""
    from pxr import UsdGeom, Vt

    objects = world.objects if rooms else world.objects.where(world.objects.outdoors)
    models = world.prototypes()
    chosen = objects.where(np.isin(objects.prototype, [name for name, parts in models.items() if parts]))
    instancer = UsdGeom.PointInstancer.Define(writer.stage, "/World/objects")
    _, first, index = np.unique(_model_names(chosen), return_index=True, return_inverse=True)
    paths = []
    for k, row in enumerate(first.tolist()):
        name = str(chosen.prototype[row])
        root = UsdGeom.Xform.Define(writer.stage, f"/World/objects/models/model_{k}")
        root.GetPrim().SetCustomDataByKey("prototype", name)
        _label(root.GetPrim(), str(chosen.kind[row]))
        for j, surface in enumerate(models[name]):
            writer.mesh(f"{root.GetPath()}/part_{j}", surface)
        if chosen.solid[row]:
            _box(writer, f"{root.GetPath()}/collider", chosen.where(np.array([row])))
        paths.append(root.GetPath())
    instancer.CreatePrototypesRel().SetTargets(paths)
    instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(np.ravel(index).astype(np.int32)))
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(chosen.position.astype(np.float32)))
    scales = np.repeat(chosen.scale.astype(np.float32)[:, None], 3, axis=1)
    instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(scales)))
    turns = np.zeros((len(chosen), 4), np.float16)
    turns[:, 2], turns[:, 3] = np.sin(chosen.yaw / 2), np.cos(chosen.yaw / 2)  # (i, j, k, real) in memory
    instancer.CreateOrientationsAttr(Vt.QuathArray.FromNumpy(turns))
    instancer.CreateIdsAttr(Vt.Int64Array.FromNumpy(chosen.entity.astype(np.int64)))
    return len(chosen)


def _model_names(objects: Objects) -> Any:
    """Return what tells models apart: how they look, what they are, and the size of what is solid of them."""
    sides = [f"{v:.2f}" for v in (np.column_stack(_foot(objects)) / objects.scale[:, None]).ravel().tolist()]
    size = [" ".join(sides[3 * k : 3 * k + 3]) if objects.solid[k] else "" for k in range(len(objects))]
    rows = zip(objects.prototype.tolist(), objects.kind.tolist(), size, strict=True)
    return np.array(["\n".join(row) for row in rows], np.str_)


def _foot(objects: Objects) -> tuple[Any, Any, Any]:
    """Return the sides of the boxes that stand in people's way, metres."""
    feet = objects.feet()
    wide, deep = (np.linalg.norm(feet[:, k + 1] - feet[:, k], axis=1) for k in (0, 1))
    return wide, deep, np.maximum(objects.size_z, 0.02)


def _box(writer: _Writer, path: str, thing: Objects) -> None:
    """Give a model the box that bodies meet, at the scale 1."""
    from pxr import Gf, UsdGeom

    wide, deep, tall = (max(float(side[0] / thing.scale[0]), 0.02) for side in _foot(thing))
    box = UsdGeom.Cube.Define(writer.stage, path)
    box.CreateSizeAttr(1.0)
    box.CreateExtentAttr([(-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)])
    box.CreatePurposeAttr(UsdGeom.Tokens.guide)
    box.AddTranslateOp().Set(Gf.Vec3d(0.0, 0.0, tall / 2))
    box.AddScaleOp().Set(Gf.Vec3f(wide, deep, tall))
    writer.collides(box.GetPrim())
