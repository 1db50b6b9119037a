import gc
import weakref
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from vico.seeds import rng
from vico.threads import WORKERS
from vico.world.glb import glb_bytes, read_glb, write_glb
from vico.world.mesh import Material, Surface


def corners(surface: Surface) -> list[np.ndarray]:
    """What every corner of every triangle has: all that can be seen of a surface."""
    fields = (surface.positions, surface.normals, surface.uv, surface.colour, surface.entity)
    return [values[surface.triangles] for values in fields]


def patchwork(count: int, kinds: int, seed: int) -> Surface:
    """Triangles over vertices of which many are equal in all they have."""
    random = rng(seed, "patchwork")
    which = random.integers(0, kinds, count)
    normals = random.normal(size=(kinds, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Surface(
        random.integers(-3, 4, (kinds, 3)).astype(np.float32)[which],
        normals.astype(np.float32)[which],
        random.random((kinds, 2)).astype(np.float32)[which],
        random.integers(0, 255, (kinds, 3)).astype(np.uint8)[which],
        random.integers(0, 3, kinds).astype(np.int32)[which],
        random.integers(0, count, (count // 2, 3)).astype(np.int32),
    )


def whole(surface: Surface) -> Surface:
    """The triangles whose corners lie in three places: the others can't be seen and are not written."""
    places = surface.positions[surface.triangles]
    sides = [(places[:, k] != places[:, k - 1]).any(axis=1) for k in range(3)]
    return replace(surface, triangles=surface.triangles[np.all(sides, axis=0)])


@settings(max_examples=20, deadline=None)
@given(st.integers(2, 2000), st.integers(1, 500), st.integers(0, 2**32 - 1))
def test_equal_vertices_are_written_once_and_no_corner_changes(
    tmp_path_factory: pytest.TempPathFactory, count: int, kinds: int, seed: int
) -> None:
    path = tmp_path_factory.getbasetemp() / "patchwork.glb"
    given_ = whole(patchwork(count, kinds, seed))
    assume(len(given_.triangles))
    write_glb(path, {"all": [given_]})
    (back,) = read_glb(path)["all"]
    for was, is_ in zip(corners(given_), corners(back), strict=True):
        np.testing.assert_array_equal(was, is_)
    if count >= 256:
        assert len(back.positions) <= kinds


def test_files_of_the_same_pictures_share_them_while_they_are_in_use(tmp_path: Path) -> None:
    picture = rng(2, "picture").integers(0, 256, (16, 32, 4)).astype(np.uint8)
    for name, seed in (("a", 1), ("b", 2)):
        surface = replace(whole(patchwork(60, 50, seed)), material=Material(f"wall {name}", picture))
        write_glb(tmp_path / f"{name}.glb", {"all": [surface]})
    pictures = [read_glb(tmp_path / f"{name}.glb")["all"][0].material.texture for name in "ab"]
    assert pictures[0] is not None
    assert np.array_equal(pictures[0], picture)
    (first,) = read_glb(tmp_path / "a.glb")["all"]
    (second,) = read_glb(tmp_path / "b.glb")["all"]
    assert first.material.texture is second.material.texture is not None
    with pytest.raises(ValueError, match="read-only"):
        first.material.texture[0, 0] = 0
    gone = weakref.ref(first.material.texture)
    del first, second, pictures
    gc.collect()
    assert gone() is None


def test_small_surfaces_have_short_indices(tmp_path: Path) -> None:
    for count, size in ((60_000, 2), (70_000, 4)):
        surface = patchwork(count, count, 0)
        surface = replace(surface, positions=rng(1, "places").random((count, 3)).astype(np.float32))  # none are equal
        surface = whole(surface)
        write_glb(tmp_path / "a.glb", {"all": [surface]})
        indices = (tmp_path / "a.glb").stat().st_size - 40 * count
        assert size <= indices / surface.triangles.size < size + 0.05
        (back,) = read_glb(tmp_path / "a.glb")["all"]
        np.testing.assert_array_equal(back.triangles, surface.triangles)


def test_files_are_the_same_however_many_threads_encode_them(monkeypatch: pytest.MonkeyPatch) -> None:
    random = rng(0, "pictures")
    triangle = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    surfaces = [
        Surface.from_triangles(
            triangle,
            np.array([(0, 1, 2)]),
            material=Material(f"m{k}", random.integers(0, 255, (64, 64, 3)).astype(np.uint8), photo=k % 2 == 0),
        )
        for k in range(7)
    ]
    files = []
    for many in ("1", "2", "5"):
        monkeypatch.setenv(WORKERS, many)
        files.append(glb_bytes({"one": surfaces[:4], "two": surfaces[2:]}))
    assert files[0] == files[1] == files[2]
