from functools import cache

import numpy as np
import pytest

from vico.assets.people import JOINTS, PARENTS, J, SkinnedBody, body_of, random_appearance
from vico.render.limbs import LIMBS
from vico.render.skinning import BodyBatch, batch_bodies, rotation_matrix, skin
from vico.seeds import rng

N = 3
REST = np.zeros((N, len(JOINTS), 3), np.float32)
NOWHERE, AHEAD = np.zeros((N, 3)), np.zeros(N)


# Not while tests are collected: what makes bodies would be compiled then.
@cache
def bodies() -> list[SkinnedBody]:
    return [body_of(random_appearance(rng(2, "skinned", k)), source="procedural") for k in range(N)]


@cache
def crowd() -> BodyBatch:
    return batch_bodies(bodies(), [11, 12, 13])


def matrix(axis_angle: np.ndarray) -> np.ndarray:
    out = np.empty((3, 3))
    rotation_matrix(axis_angle, out)
    return out


def reference(body: int, rotations: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Plain linear blend skinning with homogeneous matrices, one joint at a time."""
    b = bodies()[body]
    world = np.zeros((55, 4, 4))
    for j in range(55):
        local = np.eye(4)
        local[:3, :3] = matrix(rotations[j].astype(float))
        local[:3, 3] = b.joints[j] + offset if j == 0 else b.joints[j].astype(float) - b.joints[PARENTS[j]]
        world[j] = local if j == 0 else world[PARENTS[j]] @ local
    out = np.zeros((len(b.vertices), 3))
    for v, (which, share) in enumerate(zip(b.weight_joints, b.weights, strict=True)):
        for j, w in zip(which, share, strict=True):
            inside = b.frames[j].astype(float) @ (b.vertices[v].astype(float) - b.rest_joints[j])
            out[v] += w * (world[j, :3, :3] @ inside + world[j, :3, 3])
    return out


def test_skinning_equals_the_textbook_formula() -> None:
    rotations = np.random.default_rng(1).normal(0, 0.4, (N, 55, 3)).astype(np.float32)
    offsets = np.array([[0.1, 0.0, -0.05]] * N, np.float32)
    vertices, _ = skin(crowd(), rotations, offsets, NOWHERE, AHEAD)
    for k in range(N):
        own = slice(crowd().starts[k], crowd().starts[k + 1])
        np.testing.assert_allclose(vertices[own], reference(k, rotations[k], offsets[k]), atol=2e-5)


def test_limbs_are_where_the_body_is() -> None:
    rotations = np.random.default_rng(3).normal(0, 0.4, (N, 55, 3)).astype(np.float32)
    limbs = np.empty((N, len(LIMBS), 7), np.float32)
    spots, yaw = np.array([[5.0, 2.0, 1.0]] * N), np.full(N, 0.7)
    vertices, _ = skin(crowd(), rotations, np.zeros((N, 3), np.float32), spots, yaw, limbs=limbs)
    start, along, radius = limbs[:, :, None, :3], limbs[:, :, None, 3:6] - limbs[:, :, None, :3], limbs[:, :, 6]
    assert (radius > 0.02).all()
    assert (radius < 0.22).all()
    for k in range(N):
        off = vertices[None, crowd().starts[k] : crowd().starts[k + 1]] - start[k]
        way = np.clip((off * along[k]).sum(-1) / (along[k] ** 2).sum(-1), 0.0, 1.0)
        outside = np.linalg.norm(off - way[..., None] * along[k], axis=-1) - radius[k, :, None]
        assert np.percentile(outside.min(axis=0), 95) < 0.05


def test_no_rotation_gives_the_t_pose() -> None:
    vertices, _ = skin(crowd(), REST, np.zeros((N, 3), np.float32), NOWHERE, AHEAD)
    for k, body in enumerate(bodies()):
        own = vertices[crowd().starts[k] : crowd().starts[k + 1]]
        span = np.ptp(own[:, 1])
        # Arm span is about the stature.
        assert 0.85 < span / body.height < 1.1


def test_yaw_and_position_move_the_whole_body_rigidly() -> None:
    offsets = np.zeros((N, 3), np.float32)
    plain, normals = skin(crowd(), REST, offsets, NOWHERE, AHEAD)
    yaw, place = 2.1, np.array([350.0, -120.0, 7.5])
    moved, turned = skin(crowd(), REST, offsets, np.tile(place, (N, 1)), np.full(N, yaw))
    rotation = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    np.testing.assert_allclose(moved, plain @ rotation.T + place, atol=2e-4)
    np.testing.assert_allclose(turned, normals @ rotation.T, atol=1e-5)


def test_normals_have_unit_length_in_every_pose() -> None:
    rotations = np.random.default_rng(2).normal(0, 0.5, (N, 55, 3)).astype(np.float32)
    _, normals = skin(crowd(), rotations, np.zeros((N, 3), np.float32), NOWHERE, AHEAD)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-4)


def test_bending_an_elbow_moves_the_hand_and_not_the_head() -> None:
    bent = REST.copy()
    bent[:, J["left_elbow"], 2] = -1.2
    offsets = np.zeros((N, 3), np.float32)
    moved = np.linalg.norm(
        skin(crowd(), bent, offsets, NOWHERE, AHEAD)[0] - skin(crowd(), REST, offsets, NOWHERE, AHEAD)[0], axis=1
    )
    hand = (crowd().weight_joints[:, 0] >= J["left_index1"]) & (crowd().weight_joints[:, 0] <= J["left_thumb3"])
    head = crowd().weight_joints[:, 0] == J["head"]
    assert moved[hand].min() > 0.1
    assert moved[head].max() < 1e-5


def test_every_vertex_carries_its_owner_s_entity() -> None:
    assert np.unique(crowd().entity).tolist() == [11, 12, 13]
    assert (crowd().entity[crowd().triangles[: crowd().triangle_starts[1]]] == 11).all()


def test_a_crowd_of_nobody_is_empty() -> None:
    empty = batch_bodies([], [])
    vertices, normals = skin(
        empty, np.zeros((0, 55, 3), np.float32), np.zeros((0, 3), np.float32), np.zeros((0, 3)), np.zeros(0)
    )
    assert vertices.shape == normals.shape == (0, 3)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, np.pi])
def test_rotation_matrices_are_rotations(angle: float) -> None:
    turned = matrix(np.array([0.6, 0.0, 0.8]) * angle)
    np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-12)
    assert turned.trace() == pytest.approx(1 + 2 * np.cos(angle), abs=1e-9)


def test_a_body_of_a_batch_is_the_same_body_and_takes_no_memory_of_its_own() -> None:
    for k, body in enumerate(bodies()):
        found = crowd().body(k, body)
        for name in ("vertices", "normals", "weight_joints", "weights", "colour"):
            np.testing.assert_array_equal(getattr(found, name), getattr(body, name))
            assert np.shares_memory(getattr(found, name), getattr(crowd(), name))
        np.testing.assert_array_equal(found.triangles, body.triangles)
    again = batch_bodies([crowd().body(k, body) for k, body in enumerate(bodies())], [11, 12, 13])
    np.testing.assert_array_equal(again.triangles, crowd().triangles)
    assert again.nbytes == crowd().nbytes >= sum(body.vertices.nbytes * 2 for body in bodies())
