"""Robots as models: what the registry knows, that models stand on their feet, and that packs are read exactly."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from vico.assets.packages import installed_folder
from vico.assets.robots import BUMPER, FourLegs, robot_model, robot_names
from vico.assets.robots.packs import GO2_PACKAGE, HUSKY_PACKAGE, dense_layers
from vico.assets.shapes import surface_with_normals
from vico.assets.simplification import simplify_mesh
from vico.errors import InputError, SchemaError
from vico.world.mesh import Surface

needs_go2 = pytest.mark.skipif(
    installed_folder(GO2_PACKAGE) is None, reason="the Go2 package is not installed (vico assets install robots)"
)
needs_husky = pytest.mark.skipif(
    installed_folder(HUSKY_PACKAGE) is None, reason="the Husky package is not installed (vico assets install robots)"
)
MODELS = [("drone", False), ("husky", False), ("go2", False), ("h1", False)]


def posed(name: str, packs: bool) -> list[Surface]:
    """All surfaces of a robot standing on z = 0."""
    model = robot_model(name, packs=packs)
    compiled = mujoco.MjSpec.from_string(model.mjcf).compile()
    data = mujoco.MjData(compiled)
    data.qpos[2] = model.stand
    for joint, angle in zip(model.joints, model.rest, strict=True):
        data.qpos[compiled.jnt_qposadr[compiled.actuator(joint).trnid[0]]] = angle
    mujoco.mj_kinematics(compiled, data)
    surfaces = []
    for link, parts in model.shapes.items():
        body = compiled.body(link).id
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
        surfaces += [part.moved(pose) for part in parts]
    return surfaces


def test_an_unknown_robot_is_refused_with_the_names_of_the_known_ones() -> None:
    with pytest.raises(InputError, match="robot 'spot' is not known; choose among drone, go2, h1, husky, manipulator"):
        robot_model("spot")


@pytest.mark.parametrize("name", ["cart.urdf", "robots/cart.xml", "CART.URDF", "cart.usd"])
def test_a_robot_s_file_is_refused_with_the_page_that_says_how_robots_are_added(name: str) -> None:
    with pytest.raises(InputError, match=r"are not taken yet; docs/robots\.md#adding-a-robot") as refused:
        robot_model(name)
    assert "\n" not in str(refused.value)
    page = Path(__file__).parents[2] / "docs" / "robots.md"
    assert "\n## Adding a robot\n" in page.read_text()


@pytest.mark.parametrize(("name", "meant"), [("huskey", "husky"), ("H1:velocty", "h1"), ("manipulater", "manipulator")])
def test_a_misspelt_robot_is_told_which_was_meant(name: str, meant: str) -> None:
    with pytest.raises(InputError, match=f"did you mean '{meant}'"):
        robot_model(name)


@pytest.mark.parametrize(("name", "kilograms"), [("drone", 2.064), ("husky", 50.0), ("go2", 15.0), ("h1", 51.4)])
def test_our_models_weigh_what_their_makers_publish(name: str, kilograms: float) -> None:
    compiled = mujoco.MjSpec.from_string(robot_model(name, packs=False).mjcf).compile()
    assert compiled.body_mass.sum() == pytest.approx(kilograms, rel=0.02)


@pytest.mark.parametrize(("name", "packs"), [*MODELS, pytest.param("husky", True, marks=needs_husky)])
def test_a_standing_robot_touches_the_ground_and_fits_its_outline(name: str, packs: bool) -> None:
    model = robot_model(name, packs=packs)
    points = np.concatenate([surface.positions for surface in posed(name, packs)])
    assert abs(points[:, 2].min()) < 0.01
    assert np.abs(points[:, 0]).max() <= model.half_length + 0.015
    assert np.abs(points[:, 1]).max() <= model.half_width + 0.015


@needs_go2
def test_the_installed_go2_touches_the_ground_and_fits_its_outline() -> None:
    model = robot_model("go2")
    points = np.concatenate([surface.positions for surface in posed("go2", True)])
    assert abs(points[:, 2].min()) < 0.01
    assert np.abs(points[:, :2]).max(axis=0) == pytest.approx([model.half_length, 0.165], abs=0.03)


@pytest.mark.parametrize("name", robot_names())
def test_a_robot_has_few_triangles(name: str) -> None:
    triangles = sum(len(s.triangles) for parts in robot_model(name).shapes.values() for s in parts)
    assert 1_000 < triangles < 9_000


@pytest.mark.parametrize("name", robot_names())
def test_servos_are_named_as_the_control_vector_and_the_bumper_is_there(name: str) -> None:
    model = robot_model(name)
    spec = mujoco.MjSpec.from_string(model.mjcf)
    assert [servo.name for servo in spec.actuators] == list(model.driven)
    assert BUMPER in [geom.name for geom in spec.geoms]
    assert len(model.rest) == len(model.joints)


def varint(value: int) -> bytes:
    out = b""
    while value > 127:
        out += bytes([value & 127 | 128])
        value >>= 7
    return out + bytes([value])


def message(*fields: tuple[int, int | str | bytes]) -> bytes:
    """A protocol-buffers message out of field numbers and values."""
    out = b""
    for number, value in fields:
        if isinstance(value, int):
            out += varint(number << 3) + varint(value)
        else:
            data = value.encode() if isinstance(value, str) else value
            out += varint(number << 3 | 2) + varint(len(data)) + data
    return out


def tensor(name: str, values: np.ndarray) -> bytes:
    dims = [(1, int(n)) for n in values.shape]
    return message(*dims, (2, 1), (8, name), (9, values.astype("<f4").tobytes()))


def network(kind: str = "Elu") -> tuple[bytes, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(4)
    first, second = rng.normal(size=(5, 3)), rng.normal(size=(2, 5))
    transposed = (5, message((1, "transB"), (3, 1), (20, 2)))
    graph = message(
        (1, message((1, "x"), (1, "w0"), (1, "b0"), (2, "h"), (4, "Gemm"), transposed)),
        (1, message((1, "h"), (2, "e"), (4, kind))),
        (1, message((1, "e"), (1, "w1"), (1, "b1"), (2, "y"), (4, "Gemm"), transposed)),
        *((5, tensor(n, v)) for n, v in (("w0", first), ("b0", np.ones(5)), ("w1", second), ("b1", np.zeros(2)))),
    )
    return message((1, 8), (7, graph)), first, second


def test_a_network_of_dense_layers_is_read_from_onnx(tmp_path: Path) -> None:
    content, first, second = network()
    (tmp_path / "net.onnx").write_bytes(content)
    layers = dense_layers(tmp_path / "net.onnx")
    assert [w.shape for w, _ in layers] == [(5, 3), (2, 5)]
    assert np.array_equal(layers[0][0], first.astype(np.float32))
    assert np.array_equal(layers[1][0], second.astype(np.float32))
    assert np.array_equal(layers[0][1], np.ones(5, np.float32))


@pytest.mark.parametrize("damage", ["cut", "tanh", "noise"])
def test_another_or_a_broken_network_is_refused(tmp_path: Path, damage: str) -> None:
    content = {"cut": network()[0][:-20], "tanh": network("Tanh")[0], "noise": b"\xff" * 64}[damage]
    (tmp_path / "net.onnx").write_bytes(content)
    with pytest.raises(SchemaError, match="not a network of dense layers"):
        dense_layers(tmp_path / "net.onnx")


@needs_go2
def test_the_installed_policy_has_the_layers_it_was_published_with() -> None:
    settings = robot_model("go2").controller
    assert isinstance(settings, FourLegs)
    policy = settings.policy
    assert policy is not None
    assert [w.shape for w in policy.weights] == [(512, 45), (256, 512), (128, 256), (12, 128)]


def test_a_decimated_sphere_stays_a_sphere() -> None:
    ball = trimesh.creation.icosphere(subdivisions=5)
    points, faces = np.asarray(ball.vertices), np.asarray(ball.faces)
    light, triangles, _ = simplify_mesh(points, faces, 800)
    assert 400 < len(triangles) <= 800
    assert np.abs(np.linalg.norm(light, axis=1) - 1).max() < 0.03
    surface = surface_with_normals(light, triangles, (9, 9, 9))
    outward = np.einsum("ij,ij->i", surface.normals, surface.positions)
    assert outward.min() > 0.85
