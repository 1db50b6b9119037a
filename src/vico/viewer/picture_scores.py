"""Scores of pictures against photos: FID and KID by a user's feature network, of two folders of pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.errors import EmptyInputError, InputError, MissingExtraError, MissingFileError, SchemaError

#: What the network wants of bytes 0..255: factor and shift, or channels' means and spreads.
SCALES: dict[str, Callable[[NDArray[np.float32]], NDArray[np.float32]]] = {
    "0..255": lambda x: x,
    "0..1": lambda x: x / np.float32(255.0),
    "-1..1": lambda x: x / np.float32(127.5) - np.float32(1.0),
    "imagenet": lambda x: np.asarray((x / np.float32(255.0) - _MEAN) / _SPREAD, np.float32),
}
_MEAN: Any = np.array([0.485, 0.456, 0.406], np.float32)
_SPREAD: Any = np.array([0.229, 0.224, 0.225], np.float32)
_SUFFIXES = (".jpg", ".jpeg", ".png")
_BATCH = 16
_SUBSETS, _SUBSET = 100, 1000


@dataclass(frozen=True)
class Scores:
    """Distances between two sets of pictures; small is alike.

    Attributes
    ----------
    fid
        Fréchet distance of Gaussians fitted to the features (Heusel et al. 2017); depends on how many there are.
    kid, kid_spread
        Mean and standard deviation over subsets of the squared maximum mean discrepancy with the polynomial kernel
        of degree 3 (Bińkowski et al. 2018); unbiased.
    pictures, photos
        How many there were.
    features
        Numbers a picture.
    """

    fid: float
    kid: float
    kid_spread: float
    pictures: int
    photos: int
    features: int


class FeatureNetwork:
    """A network in an ONNX file that makes features of pictures.

    Parameters
    ----------
    path
        The file. Its input is a batch of pictures, ``(n, 3, h, w)`` or ``(n, h, w, 3)``; its first output ``(n, d)``,
        or ``(n, d, h, w)``, of which the mean is taken.
    scale
        One of `SCALES`.
    side
        Pixels, where the file leaves them open.

    Raises
    ------
    MissingExtraError
        If onnxruntime is not installed.
    MissingFileError, SchemaError
        If there is no such file, or it is no such network.
    """

    def __init__(self, path: Path, *, scale: str = "-1..1", side: int = 299) -> None:
        if scale not in SCALES:
            raise InputError(f"scale {scale!r}; it has to be one of {', '.join(SCALES)}")
        if not path.is_file():
            raise MissingFileError(f"{path}: no such file; give the weights of a feature network as ONNX")
        try:
            import onnxruntime
        except ImportError:
            raise MissingExtraError(
                "scores of pictures need onnxruntime: pip install 'virtual-community[scores]'"
            ) from None
        options = onnxruntime.SessionOptions()
        options.log_severity_level = 3
        try:
            self._session: Any = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        except Exception as error:  # whatever the runtime says of a file
            line = str(error).partition("\n")[0]
            raise SchemaError(f"{path}: no network that onnxruntime reads ({line}); export it to ONNX anew") from None
        first = self._session.get_inputs()[0]
        shape = [n if isinstance(n, int) else 0 for n in first.shape]
        if len(shape) != 4 or 3 not in (shape[1], shape[3]):
            raise SchemaError(f"{path}: takes {first.shape}; it has to take pictures, (n, 3, h, w) or (n, h, w, 3)")
        self._channels_first = shape[1] == 3
        height, width = shape[2:] if self._channels_first else shape[1:3]
        self._size = width or side, height or side
        self._name, self._batch, self._scale = first.name, shape[0] or _BATCH, SCALES[scale]

    def features(self, pictures: Sequence[Path]) -> NDArray[np.float64]:
        """Return the features of picture files, shape ``(n, d)``.

        Raises
        ------
        SchemaError
            If a file is no picture.
        """
        found = []
        for start in range(0, len(pictures), self._batch):
            batch = [self._read(path) for path in pictures[start : start + self._batch]]
            count = len(batch)
            batch += [batch[-1]] * (self._batch - count)
            values = self._scale(np.stack(batch).astype(np.float32))
            if self._channels_first:
                values = np.ascontiguousarray(values.transpose(0, 3, 1, 2))
            out = np.asarray(self._session.run(None, {self._name: values})[0], np.float64)
            out = out.mean(axis=tuple(range(2, out.ndim))) if out.ndim > 2 else out
            found.append(out.reshape(self._batch, -1)[:count])
        return np.concatenate(found)

    def _read(self, path: Path) -> NDArray[np.uint8]:
        try:
            with Image.open(path, formats=("JPEG", "PNG")) as image:
                return np.asarray(image.convert("RGB").resize(self._size, Image.Resampling.BILINEAR))
        except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
            raise SchemaError(f"{path}: not a readable picture ({error})") from None


def pictures_in(folder: Path) -> list[Path]:
    """Return the picture files of a folder and its folders, in their order.

    Raises
    ------
    EmptyInputError
        If there are fewer than two.
    """
    found = sorted(path for path in folder.rglob("*") if path.suffix.lower() in _SUFFIXES)
    if len(found) < 2:
        raise EmptyInputError(
            f"{folder}: {len(found)} pictures (.jpg, .png); scores need two at least, and mean little below 100"
        )
    return found


def scores(pictures: NDArray[np.float64], photos: NDArray[np.float64], *, seed: int = 0) -> Scores:
    """Return the distances between two sets of features, shape ``(n, d)`` and ``(m, d)``."""
    kid, spread = kernel_distance(pictures, photos, seed=seed)
    count, other = len(pictures), len(photos)
    return Scores(frechet_distance(pictures, photos), kid, spread, count, other, pictures.shape[1])


def frechet_distance(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the Fréchet distance of Gaussians fitted to two sets of features."""
    first, second = np.atleast_2d(np.cov(a, rowvar=False)), np.atleast_2d(np.cov(b, rowvar=False))
    values, vectors = np.linalg.eigh(first)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    # The trace of the root of the product is that of a symmetric matrix with the same eigenvalues.
    shared = np.sqrt(np.maximum(np.linalg.eigvalsh(root @ second @ root), 0.0)).sum()
    gap = a.mean(axis=0) - b.mean(axis=0)
    return float(gap @ gap + np.trace(first) + np.trace(second) - 2.0 * shared)


def kernel_distance(a: NDArray[np.float64], b: NDArray[np.float64], *, seed: int = 0) -> tuple[float, float]:
    """Return mean and spread of the unbiased squared discrepancy with the kernel ``(x y / d + 1) ** 3``."""
    generator = np.random.Generator(np.random.PCG64(seed))
    size, d = min(_SUBSET, len(a), len(b)), a.shape[1]
    found = []
    for _ in range(_SUBSETS):
        x, y = (part[generator.choice(len(part), size, replace=False)] for part in (a, b))
        own = [(k.sum() - np.trace(k)) / (size * (size - 1)) for k in ((x @ x.T / d + 1) ** 3, (y @ y.T / d + 1) ** 3)]
        found.append(sum(own) - 2.0 * float(((x @ y.T / d + 1) ** 3).mean()))
    return float(np.mean(found)), float(np.std(found))
