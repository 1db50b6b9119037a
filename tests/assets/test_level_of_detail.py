import os
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from vico.assets.people import PASSERS_BY, Appearance, J, SkinnedBody, anny, bodies, body_of, passer_by, procedural
from vico.assets.people.bodies import body_path
from vico.assets.people.level_of_detail import simplify_body

SOURCES = [
    "procedural",
    pytest.param(
        "anny",
        marks=pytest.mark.skipif(not anny.available(), reason="no baked bodies: vico assets install people"),
    ),
]
CROWD = [passer_by(k) for k in range(8)]


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("VICO_CACHE", str(tmp_path))
    return tmp_path


def same(a: SkinnedBody, b: SkinnedBody) -> bool:
    return all(
        np.array_equal(getattr(a, field.name), getattr(b, field.name))
        and np.asarray(getattr(a, field.name)).dtype == np.asarray(getattr(b, field.name)).dtype
        for field in fields(SkinnedBody)
    )


def outline(body: SkinnedBody, axes: tuple[int, int]) -> NDArray[np.int64]:
    """Numbers of the cells of two centimetres that a body covers, seen along an axis."""
    corners = body.vertices[body.triangles][:, :, axes].astype(float)
    steps = np.array([(i, j, 12 - i - j) for i in range(13) for j in range(13 - i)]) / 12
    cells = np.floor(np.einsum("sk,tkc->tsc", steps, corners) / 0.02).astype(np.int64).reshape(-1, 2)
    return np.unique(cells[:, 0] * 10_000 + cells[:, 1])


@pytest.mark.parametrize("source", SOURCES)
def test_a_light_body_has_at_most_2000_triangles_and_1300_vertices(source: str) -> None:
    for look in CROWD:
        body = body_of(look, source=source)  # type: ignore[arg-type]
        assert 1000 < len(body.triangles) <= 2000
        assert len(body.vertices) <= 1350


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("axes", [(1, 2), (0, 2)], ids=["front", "side"])
def test_a_light_body_keeps_its_outline(source: str, axes: tuple[int, int]) -> None:
    for look in CROWD[:4]:
        full = outline(body_of(look, source=source, detail="full"), axes)  # type: ignore[arg-type]
        light = outline(body_of(look, source=source), axes)  # type: ignore[arg-type]
        assert len(np.intersect1d(full, light)) / len(np.union1d(full, light)) > 0.90


@pytest.mark.parametrize("source", SOURCES)
def test_a_light_body_s_vertices_are_vertices_of_the_one_it_is_made_of_in_their_colours(source: str) -> None:
    full = {"procedural": procedural, "anny": anny}[source].body(CROWD[0])
    light = body_of(CROWD[0], source=source)  # type: ignore[arg-type]
    known = {(*p, *c) for p, c in zip(full.vertices.tolist(), full.colour.tolist(), strict=True)}
    assert {(*p, *c) for p, c in zip(light.vertices.tolist(), light.colour.tolist(), strict=True)} <= known


@pytest.mark.parametrize("source", SOURCES)
def test_eyes_and_fingers_survive(source: str) -> None:
    for look in CROWD:
        body = body_of(look, source=source)  # type: ignore[arg-type]
        carriers = set(body.weight_joints[:, 0].tolist())
        assert {J["left_eye"], J["right_eye"]} <= carriers
        assert carriers & set(range(J["left_index1"], J["left_thumb3"] + 1))


def ball(radius: float, colour: tuple[int, int, int]) -> SkinnedBody:
    turns, rises = np.meshgrid(np.linspace(0, 2 * np.pi, 24, endpoint=False), np.linspace(0, np.pi, 13), indexing="ij")
    points = radius * np.stack([np.cos(turns) * np.sin(rises), np.sin(turns) * np.sin(rises), np.cos(rises)], -1)
    faces = []
    for i in range(24):
        for k in range(12):
            a, b, c, d = 13 * i + k, 13 * i + k + 1, 13 * ((i + 1) % 24) + k + 1, 13 * ((i + 1) % 24) + k
            faces += [(a, b, c), (a, c, d)]
    flat = points.reshape(-1, 3).astype(np.float32)
    count = len(flat)
    example = body_of(Appearance(), source="procedural")
    return SkinnedBody(
        flat,
        flat / radius,
        np.array(faces, np.int32),
        np.tile(np.array(colour, np.uint8), (count, 1)),
        np.zeros((count, 4), np.int32),
        np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1)),
        example.rest_joints,
        example.frames,
        example.joints,
        1.7,
    )


def together(a: SkinnedBody, b: SkinnedBody) -> SkinnedBody:
    joined = {
        name: np.concatenate([getattr(a, name), getattr(b, name)])
        for name in ("vertices", "normals", "colour", "weight_joints", "weights")
    }
    triangles = np.concatenate([a.triangles, b.triangles + len(a.vertices)])
    return SkinnedBody(
        triangles=triangles, **joined, rest_joints=a.rest_joints, frames=a.frames, joints=a.joints, height=1.7
    )


def test_skin_under_cloth_is_left_out_and_the_cloth_stays() -> None:
    light = simplify_body(together(ball(0.10, (200, 150, 120)), ball(0.12, (20, 20, 90))), 10_000)
    assert np.unique(light.colour, axis=0).tolist() == [[20, 20, 90]]


def test_skin_far_under_a_cloak_stays() -> None:
    light = simplify_body(together(ball(0.10, (200, 150, 120)), ball(0.30, (20, 20, 90))), 10_000)
    assert len(np.unique(light.colour, axis=0)) == 2


def test_a_closed_surface_stays_closed_when_thinned() -> None:
    light = simplify_body(ball(0.2, (90, 90, 90)), 120)
    assert len(light.triangles) <= 120
    edges = np.concatenate([light.triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    _, place = np.unique(np.round(light.vertices, 5), axis=0, return_inverse=True)
    _, times = np.unique(np.sort(place.ravel()[edges], axis=1), axis=0, return_counts=True)
    assert (times == 2).all()


def test_a_kept_body_equals_the_one_that_was_made(cache: Path) -> None:
    made = body_of(CROWD[1], source="procedural")
    assert len(list((cache / "bodies").iterdir())) == 1
    assert same(body_of(CROWD[1], source="procedural"), made)


def test_a_kept_body_is_not_made_again(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = body_of(CROWD[1], source="procedural")
    monkeypatch.setattr(bodies, "simplify_body", lambda body: pytest.fail("made again"))
    assert same(body_of(CROWD[1], source="procedural"), made)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 not a zip", b"\x93NUMPY"])
def test_a_damaged_kept_body_is_made_anew(cache: Path, content: bytes) -> None:
    made = body_of(CROWD[1], source="procedural")
    path = body_path(CROWD[1], "procedural", None)
    path.write_bytes(content)
    assert same(body_of(CROWD[1], source="procedural"), made)
    assert path.stat().st_size > 10_000


@pytest.mark.skipif(os.name == "nt", reason="a file in a folder's place is another error there")
def test_without_a_cache_to_write_to_bodies_are_made_all_the_same(cache: Path) -> None:
    (cache / "bodies").write_text("in the way")
    assert len(body_of(CROWD[2], source="procedural").triangles) > 1000


def test_passers_by_share_a_few_dozen_looks() -> None:
    assert passer_by(PASSERS_BY + 3) == passer_by(3)
    assert len({repr(passer_by(k)) for k in range(PASSERS_BY)}) == PASSERS_BY
