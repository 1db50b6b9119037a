"""MuJoCo: the ground as a height field, buildings as convex bodies, street furniture as boxes, textured looks."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.io.files import write_bytes
from vico.world.mesh import Surface, joined
from vico.world.world import World

_CELL = 1.0  # metres between the height field's corners
_DEPTH = 5.0  # metres of solid below its lowest point
_SEEN = ("ground", "buildings", "roofs")
_LEAST = 1e-4


def write_mjcf(world: World, folder: Path, *, rooms: bool) -> dict[str, int]:
    """Write ``world.xml`` with its ``assets``: z up, metres, the origin at the window's centre.

    Collision lies in geom group 3 and looks in group 2, as is usual; looks take no part in contacts.
    """
    root = Element("mujoco", model=_name(world.manifest.name))
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


def _name(text: str) -> str:
    return "".join(c if c.isalnum() or c in "_-" else "_" for c in text)


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
    for surface in joined(surfaces):
        # MuJoCo has no vertex colours: one mesh a tint of a material, tints rounded to a few steps.
        tints, tint_of = np.unique(_tints(surface), axis=0, return_inverse=True)
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


def _tints(surface: Surface) -> NDArray[np.uint8]:
    colour = surface.colour[surface.triangles[:, 0]].astype(np.int64)
    return np.minimum((colour + 32) // 64 * 64, 255).astype(np.uint8)


def _obj(surface: Surface, faces: NDArray[np.int32]) -> bytes:
    used, index = np.unique(faces, return_inverse=True)
    lines = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in surface.positions[used].tolist()]
    lines += [f"vt {u:.5f} {v:.5f}" for u, v in surface.uv[used].tolist()]
    lines += [f"vn {x:.4f} {y:.4f} {z:.4f}" for x, y, z in surface.normals[used].tolist()]
    corners = (index.reshape(-1, 3) + 1).tolist()
    lines += [f"f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}" for a, b, c in corners]
    return ("\n".join(lines) + "\n").encode()
