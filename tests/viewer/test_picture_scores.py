"""FID and KID: against Gaussians whose distance is known, and through a tiny network of random weights."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from vico.errors import EmptyInputError, InputError, MissingFileError, SchemaError
from vico.viewer.picture_scores import FeatureNetwork, frechet_distance, kernel_distance, pictures_in, scores

GENERATOR = np.random.Generator(np.random.PCG64(3))


def gaussians(count: int, shift: float, scale: float) -> NDArray[np.float64]:
    return shift + scale * GENERATOR.normal(size=(count, 8))


def test_frechet_distance_of_gaussians() -> None:
    a, b = gaussians(60_000, 0.0, 1.0), gaussians(60_000, 0.5, 2.0)
    # Squared gap of the means, and of the spreads, in each of 8 dimensions.
    assert frechet_distance(a, b) == pytest.approx(8 * (0.25 + 1.0), rel=0.02)
    assert frechet_distance(a, a) == pytest.approx(0.0, abs=1e-9)


def test_kernel_distance_is_unbiased_and_grows() -> None:
    same, _ = kernel_distance(gaussians(400, 0, 1), gaussians(400, 0, 1))
    other, spread = kernel_distance(gaussians(400, 0, 1), gaussians(400, 1.0, 1))
    assert abs(same) < 0.02
    assert other > 1.0 > spread
    assert scores(gaussians(9, 0, 1), gaussians(7, 0, 1)).photos == 7


def varint(value: int) -> bytes:
    out = b""
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])


def field(number: int, value: int | bytes | str) -> bytes:
    """One field of a protocol buffer."""
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    data = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(data)) + data


def tiny_network(path: Path) -> None:
    """Write a network of random weights: a convolution of 8 x 8 pixels to 6 channels."""
    weights = GENERATOR.normal(size=(6, 3, 8, 8)).astype(np.float32) / 20
    tensor = b"".join(field(1, n) for n in weights.shape) + field(2, 1) + field(8, "w") + field(9, weights.tobytes())
    ints = field(1, "strides") + field(8, 8) + field(8, 8) + field(20, 7)
    node = field(1, "x") + field(1, "w") + field(2, "y") + field(4, "Conv") + field(5, ints)

    def value(name: str, *shape: int) -> bytes:
        dimensions = b"".join(field(1, field(1, n)) for n in shape)
        return field(1, name) + field(2, field(1, field(1, 1) + field(2, dimensions)))

    graph = field(1, node) + field(2, "g") + field(5, tensor)
    graph += field(11, value("x", 4, 3, 32, 32)) + field(12, value("y", 4, 6, 4, 4))
    path.write_bytes(field(1, 8) + field(7, graph) + field(8, field(1, "") + field(2, 13)))


def test_pictures_go_through_a_network_of_ones_own(tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime", reason="needs pip install 'virtual-community[scores]'")
    for name, level in (("a", 90), ("b", 96), ("c", 200)):
        (tmp_path / name).mkdir()
        for k in range(10):
            pixels = np.clip(GENERATOR.normal(level, 30, (40, 50, 3)), 0, 255).astype(np.uint8)
            Image.fromarray(pixels).save(tmp_path / name / f"{k}.png")
    tiny_network(tmp_path / "tiny.onnx")
    network = FeatureNetwork(tmp_path / "tiny.onnx")
    a, b, c = (network.features(pictures_in(tmp_path / name)) for name in "abc")
    assert a.shape == (10, 6)
    near, far = scores(a, b), scores(a, c)
    assert near.fid < 0.2 * far.fid
    assert near.kid < 0.2 * far.kid
    (tmp_path / "bad.onnx").write_bytes(b"nonsense")
    with pytest.raises(SchemaError, match="no network that onnxruntime reads"):
        FeatureNetwork(tmp_path / "bad.onnx")


def test_what_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(EmptyInputError, match="0 pictures"):
        pictures_in(tmp_path)
    with pytest.raises(MissingFileError, match="weights of a feature network"):
        FeatureNetwork(tmp_path / "none.onnx")
    with pytest.raises(InputError, match="scale 'loud'"):
        FeatureNetwork(tmp_path / "none.onnx", scale="loud")
