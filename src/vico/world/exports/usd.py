"""OpenUSD: one binary stage with textured meshes, instanced models, labels, light, and colliders (UsdPhysics)."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from vico.errors import MissingExtraError
from vico.io.files import write_bytes
from vico.world.mesh import Material, Surface
from vico.world.objects import Objects
from vico.world.world import World

_SEEN = ("ground", "buildings", "roofs")
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
