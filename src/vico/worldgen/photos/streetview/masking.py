"""Street photos made fit for walls: people and vehicles masked, masked things painted over, colours brought in line."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.errors import MissingExtraError, MissingFileError
from vico.worldgen.photos.streetview.matching import opencv

_TALLEST = 3.4  # metres: a bus
_PERSON = 2.0  # metres, height of people at most
_VEHICLE = 2.4  # metres, height of vehicles at most
_LEAST_TALL = 0.5  # metres: what is lower is no person and no vehicle
_LEAST_WIDE = 0.2  # metres: nor what is narrower
_CONTACT = 0.5  # metres: it stands on the ground, so its foot hides what is lower than this
_FARTHEST = 45.0  # metres: beyond, a person is a few pixels
_SHIFTS = ((0, 0), (0, 3), (0, -3), (3, 0), (-3, 0))  # pixels that the two pictures may be out of step by


@dataclass(frozen=True)
class PhotoView:
    """A photo, and the world rendered from where it was taken.

    Attributes
    ----------
    photo, render
        sRGB, uint8, shape ``(h, w, 3)``.
    depth
        Metres along the optical axis, 0 where nothing is, shape ``(h, w)``.
    above
        How high above the ground lies what the render shows, metres, infinite where nothing is, shape ``(h, w)``.
    focal
        Pixels.
    """

    photo: NDArray[np.uint8]
    render: NDArray[np.uint8]
    depth: NDArray[np.float32]
    above: NDArray[np.float32]
    focal: float


class Movers(Protocol):
    """Finds what moves."""

    def mask(self, view: PhotoView) -> NDArray[np.bool_]:
        """Pixels of the photo that show people, vehicles, or other things that come and go, shape ``(h, w)``."""
        ...


@dataclass(frozen=True)
class StandingDifferences:
    """Things that stand on the ground and that the world does not show; needs no weights.

    Attributes
    ----------
    width
        Pixels of the picture it works on.
    sure
        How many times the usual difference of photo and render marks a thing that is not in the world.

    Notes
    -----
    How much the two differ on most of the ground, and on most of the walls, tells what is usual in this photo. Larger
    differences which reach the ground and are as large as a person are cut out by GrabCut.
    What else differs there (a shop front the world does not know) is masked too: it is left to other photos.
    """

    width: int = 512
    sure: float = 3.0

    def mask(self, view: PhotoView) -> NDArray[np.bool_]:
        """See `Movers`."""
        cv2 = opencv()
        height, width = view.depth.shape
        share = min(self.width / width, 1.0)
        size = round(width * share), round(height * share)
        photo, render = (cv2.resize(p, size, interpolation=cv2.INTER_AREA) for p in (view.photo, view.render))
        depth, above = (cv2.resize(a, size, interpolation=cv2.INTER_NEAREST) for a in (view.depth, view.above))
        solid = depth > 0
        zone = solid & (above < _TALLEST) & (depth < _FARTHEST)
        if not zone.any():
            return np.zeros(view.depth.shape, np.bool_)
        # Pavements are plain and walls are not: each has a usual difference of its own.
        low = zone & (above < _CONTACT)
        wall = solid & (above >= _CONTACT) & (depth < _FARTHEST)
        ratio = np.zeros(depth.shape, np.float32)
        for gap, least in ((_difference(photo, render, solid), 10.0), (_edge_surplus(photo, render), 4.0)):
            for part in (low, wall):
                if part.any():
                    middle = float(np.median(gap[part]))
                    spread = 1.4826 * float(np.median(np.abs(gap[part] - middle)))
                    ratio[part] = np.maximum(ratio[part], gap[part] / max(middle + self.sure * spread, least))
        seeds = (zone & (ratio > 1.0)).astype(np.uint8)
        seeds = cv2.morphologyEx(seeds, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
        seeds = cv2.morphologyEx(seeds, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
        core, reach = _standing_things(seeds, depth, above, view.focal * share)
        if not core.any():
            return np.zeros(view.depth.shape, np.bool_)
        things = _cut_out(photo, core, reach & solid, ratio)
        grown = cv2.dilate(things.astype(np.uint8), np.ones((5, 5), np.uint8))
        full = cv2.resize(grown, (width, height), interpolation=cv2.INTER_NEAREST)
        return np.asarray(full > 0)


def _difference(photo: NDArray[np.uint8], render: NDArray[np.uint8], solid: NDArray[np.bool_]) -> NDArray[np.float32]:
    """How much the pictures differ in colour and in light, exposure and a few pixels' shift aside."""
    cv2 = opencv()
    a, b = (
        cv2.cvtColor(cv2.GaussianBlur(p, (0, 0), 2.0), cv2.COLOR_RGB2LAB).astype(np.float32) for p in (photo, render)
    )
    for k in range(3):  # the render in the photo's exposure
        (low_a, mid_a, high_a), (low_b, mid_b, high_b) = (np.percentile(p[..., k][solid], (15, 50, 85)) for p in (a, b))
        gain = np.clip((high_a - low_a + 4) / (high_b - low_b + 4), 0.5, 2.0)
        b[..., k] = (b[..., k] - mid_b) * gain + mid_a
    gaps = [np.abs(a - np.roll(b, shift, (0, 1))) @ np.array([0.7, 1.3, 1.3], np.float32) for shift in _SHIFTS]
    return np.asarray(cv2.GaussianBlur(np.min(gaps, axis=0), (0, 0), 1.5))


def _edge_surplus(photo: NDArray[np.uint8], render: NDArray[np.uint8]) -> NDArray[np.float32]:
    """How much more edges the photo has than the render: a dark car looks like a shadow, but for its edges."""
    cv2 = opencv()
    busy = []
    for picture in (photo, render):
        grey = cv2.GaussianBlur(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), (0, 0), 1.0).astype(np.float32)
        edges = np.hypot(cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1)) / 8
        # The largest nearby: an edge that is a few pixels off in the render is there all the same.
        busy.append(edges if picture is photo else cv2.dilate(edges, np.ones((9, 9), np.uint8)))
    return np.asarray(cv2.GaussianBlur(np.maximum(busy[0] - 1.5 * busy[1], 0), (0, 0), 3.0))


def _standing_things(
    seeds: NDArray[np.uint8], depth: NDArray[np.float32], above: NDArray[np.float32], focal: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the patches that stand on the ground and are as large as a person, and where each thing's rest may be.

    What hides the ground shows best, and tells where a thing stands and how wide it is; its upper part is before a
    wall, where the difference may be small: a person's reach is a man's height, a vehicle's a van's.
    """
    cv2 = opencv()
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(seeds, connectivity=8)
    core, reach = np.zeros(seeds.shape, np.bool_), np.zeros(seeds.shape, np.bool_)
    width = seeds.shape[1]
    for k in range(1, count):
        x, y, wide, tall, area = boxes[k].tolist()
        if area < 10:
            continue
        part = labels[y : y + tall, x : x + wide] == k
        foot = part & (above[y : y + tall, x : x + wide] < _CONTACT)
        if not foot.any():
            continue
        # A thing stands where its lowest pixels are: there the render shows the ground at the thing's own distance.
        bottom = int(np.flatnonzero(foot.any(axis=1))[-1])
        line = foot & (np.arange(tall)[:, None] >= bottom - 2)
        metre = focal / max(float(np.median(depth[y : y + tall, x : x + wide][line])), 0.5)
        if tall < _LEAST_TALL * metre or wide < _LEAST_WIDE * metre or area < 0.2 * wide * tall:
            continue
        core[y : y + tall, x : x + wide] |= part
        upright = _PERSON if wide < 1.3 * metre else _VEHICLE
        top = max(int(y + bottom - upright * metre), 0)
        aside = max(round(0.15 * metre), 1)
        reach[top : y + bottom + 2, max(x - aside, 0) : min(x + wide + aside, width)] = True
        reach[y : y + tall, x : x + wide] |= part
    return core, reach


def _cut_out(
    photo: NDArray[np.uint8], core: NDArray[np.bool_], reach: NDArray[np.bool_], ratio: NDArray[np.float32]
) -> NDArray[np.bool_]:
    """Return the things with the outline of their colours, within their reach and never smaller than their cores."""
    cv2 = opencv()
    sure = cv2.erode(core.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    near = cv2.dilate(reach.astype(np.uint8), np.ones((31, 31), np.uint8)) > 0
    if not sure.any() or (near & ~reach).sum() < 50:
        return core
    label = np.full(core.shape, cv2.GC_BGD, np.uint8)
    label[reach] = cv2.GC_PR_BGD
    label[reach & (ratio > 0.5)] = cv2.GC_PR_FGD
    label[core] = cv2.GC_PR_FGD
    label[sure] = cv2.GC_FGD
    # Only pixels near a thing show how its surroundings look.
    rows, columns = np.flatnonzero(near.any(axis=1)), np.flatnonzero(near.any(axis=0))
    box = slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
    label = np.ascontiguousarray(label[box])
    # GrabCut starts its colour clusters from OpenCV's own stream: the same each time.
    cv2.setRNGSeed(1)
    smooth = np.ascontiguousarray(cv2.GaussianBlur(photo, (0, 0), 0.8)[box])
    cv2.grabCut(smooth, label, None, np.zeros((1, 65)), np.zeros((1, 65)), 2, cv2.GC_INIT_WITH_MASK)
    things = core.copy()
    things[box] |= ((label == cv2.GC_FGD) | (label == cv2.GC_PR_FGD)) & reach[box]
    return np.asarray(cv2.morphologyEx(things.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8)) > 0)


@dataclass(frozen=True)
class LanguageGroundedMovers:
    """Grounding DINO finds what the words say, Segment Anything cuts it out: the paper's LangSAM, by transformers.

    Attributes
    ----------
    detector, segmenter
        Folders (or names in the user's cache) of weights: a Grounding DINO and a SAM model. Nothing is downloaded.
    words
        What moves, each thing ended by a full stop.
    sure
        Least confidence of a box, and of its words.
    device
        Where torch computes.
    """

    detector: str
    segmenter: str
    words: str = "person. car. bus. truck. bicycle. motorcycle. tram."
    sure: float = 0.3
    device: str = "cpu"

    def mask(self, view: PhotoView) -> NDArray[np.bool_]:
        """See `Movers`.

        Raises
        ------
        MissingExtraError, MissingFileError
            If transformers and torch are not installed, or the weights are not there.
        """
        torch, kit = _transformers()
        height, width = view.photo.shape[:2]
        look, find = (
            self._load_weights(kit, name, self.detector)
            for name in ("AutoProcessor", "GroundingDinoForObjectDetection")
        )
        inputs = look(images=view.photo, text=self.words, return_tensors="pt").to(self.device)
        find = find.to(self.device).eval()
        with torch.inference_mode():
            answer = find(**inputs)
        boxes = look.post_process_grounded_object_detection(
            answer, inputs["input_ids"], threshold=self.sure, text_threshold=self.sure, target_sizes=[(height, width)]
        )[0]["boxes"]
        mask = np.zeros((height, width), np.bool_)
        if not len(boxes):
            return mask
        cut, model = (self._load_weights(kit, name, self.segmenter) for name in ("SamProcessor", "SamModel"))
        prompt = cut(view.photo, input_boxes=[boxes.tolist()], return_tensors="pt")
        sizes = prompt["original_sizes"].tolist(), prompt["reshaped_input_sizes"].tolist()
        model = model.to(self.device).eval()
        with torch.inference_mode():
            found = model(**prompt.to(self.device), multimask_output=False)
        layers = cut.image_processor.post_process_masks(found.pred_masks.cpu(), *sizes)[0]
        mask |= layers.numpy().reshape(-1, height, width).astype(np.bool_).any(axis=0)
        return mask

    @staticmethod
    def _load_weights(kit: Any, name: str, weights: str) -> Any:
        try:
            return getattr(kit, name).from_pretrained(weights, local_files_only=True)
        except (OSError, ValueError) as error:
            raise MissingFileError(
                f"{weights}: {name} finds no weights there ({str(error).splitlines()[0][:160]}); "
                "leave the detector out to use the one that needs none"
            ) from None


def _transformers() -> tuple[Any, Any]:
    try:
        return importlib.import_module("torch"), importlib.import_module("transformers")
    except ImportError:
        raise MissingExtraError(
            "language-grounded masks: transformers is not installed; type: pip install 'virtual-community[diffusion]'"
        ) from None


#: Fills the masked pixels of an RGB picture from what is around them.
Painter = Callable[[NDArray[np.uint8], NDArray[np.bool_]], NDArray[np.uint8]]

_KNOTS = 33
_STEEPEST = 1.8


@dataclass(frozen=True)
class FastMarchingFill:
    """Fills by fast marching (Telea 2004): smooth, and at once.

    Attributes
    ----------
    radius
        Pixels around a filled one that count.
    """

    radius: float = 5.0

    def __call__(self, picture: NDArray[np.uint8], mask: NDArray[np.bool_]) -> NDArray[np.uint8]:
        """See `Painter`."""
        cv2 = opencv()
        if not mask.any():
            return picture
        return np.asarray(cv2.inpaint(picture, mask.astype(np.uint8), self.radius, cv2.INPAINT_TELEA))


@dataclass(frozen=True)
class PatchFill:
    """Fills with patches of the picture itself (Barnes et al. 2009), through PyPatchMatch.

    Attributes
    ----------
    side
        Of a patch, pixels.
    """

    side: int = 5

    def __call__(self, picture: NDArray[np.uint8], mask: NDArray[np.bool_]) -> NDArray[np.uint8]:
        """See `Painter`.

        Raises
        ------
        MissingExtraError
            If it is not installed.
        """
        try:
            import patchmatch
        except ImportError:
            raise MissingExtraError(
                "patches: PyPatchMatch is not installed; type: pip install 'virtual-community[patches]'"
            ) from None
        if not mask.any():
            return picture
        patchmatch.set_random_seed(1)
        filled: NDArray[Any] = patchmatch.inpaint(picture, mask.astype(np.uint8)[..., None], patch_size=self.side)
        return np.where(mask[..., None], filled, picture).astype(np.uint8)


@dataclass(frozen=True)
class ColourCurve:
    """Brings one photo's colours in line with others: a rising curve of lightness, a shift and gain of the tints.

    Attributes
    ----------
    source, target
        Lightnesses (CIE L*, 0..100) and what becomes of them, rising, shape ``(k,)``.
    gain, shift
        Of a* and b*: ``tint * gain + shift``, shape ``(2,)``.
    """

    source: NDArray[np.float64]
    target: NDArray[np.float64]
    gain: NDArray[np.float64]
    shift: NDArray[np.float64]

    def apply(self, lab: NDArray[np.float32]) -> NDArray[np.float32]:
        """Lab colours of shape ``(..., 3)`` brought in line."""
        light = np.interp(lab[..., 0], self.source, self.target)
        tints = lab[..., 1:] * self.gain + self.shift
        return np.concatenate([light[..., None], tints], axis=-1).astype(np.float32)


def colour_curve(
    photo: NDArray[np.float32], reference: NDArray[np.float32], weight: NDArray[Any] | None = None
) -> ColourCurve:
    """Return the curve that gives a photo's colours the histogram of a reference.

    Parameters
    ----------
    photo, reference
        Lab colours of the same places or of like ones, shapes ``(n, 3)`` and ``(m, 3)``.
    weight
        Of the photo's colours.

    Notes
    -----
    Histogram matching of lightness at 33 quantiles, its slope bounded so that noise in a flat wall is not blown up.
    """
    shares = np.linspace(0.01, 0.99, _KNOTS)
    source = _quantiles(photo[:, 0], shares, weight)
    target = _quantiles(reference[:, 0], shares, None)
    rise, run = np.diff(target), np.diff(source)
    steep = np.clip(rise / np.maximum(run, 1e-3), 0.25, _STEEPEST)
    curve = np.concatenate([[0.0], np.cumsum(steep * np.maximum(run, 1e-3))])
    knots = source[0] + np.concatenate([[0.0], np.cumsum(np.maximum(run, 1e-3))])
    curve += float(np.mean(target - curve))
    # Detail is darker and lighter than any patch's mean: the ends go on as steeply as the whole.
    slope = float(np.clip((target[-1] - target[0]) / max(source[-1] - source[0], 1.0), 0.5, _STEEPEST))
    knots = np.concatenate([[knots[0] - 40.0], knots, [knots[-1] + 40.0]])
    curve = np.clip(np.concatenate([[curve[0] - 40.0 * slope], curve, [curve[-1] + 40.0 * slope]]), 0.0, 100.0)
    spread = np.maximum(np.std(photo[:, 1:], axis=0), 0.5), np.maximum(np.std(reference[:, 1:], axis=0), 0.5)
    gain = np.clip(spread[1] / spread[0], 0.7, 1.4).astype(np.float64)
    shift = np.median(reference[:, 1:], axis=0) - np.median(photo[:, 1:], axis=0) * gain
    return ColourCurve(knots, curve, gain, np.asarray(shift, np.float64))


def lab_of(rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """SRGB colours of shape ``(..., 3)`` as CIE L*a*b*, float32 of the same shape."""
    cv2 = opencv()
    flat = rgb.reshape(1, -1, 3).astype(np.float32) / 255
    if not rgb.size:
        return flat.reshape(rgb.shape).astype(np.float32)
    return np.asarray(cv2.cvtColor(flat, cv2.COLOR_RGB2LAB).reshape(rgb.shape), np.float32)


def rgb_of(lab: NDArray[np.float32]) -> NDArray[np.float32]:
    """CIE L*a*b* colours as sRGB in 0..255, not rounded."""
    cv2 = opencv()
    flat = np.ascontiguousarray(lab.reshape(1, -1, 3), np.float32)
    return np.asarray(cv2.cvtColor(flat, cv2.COLOR_LAB2RGB).reshape(lab.shape) * 255, np.float32)


def _quantiles(values: NDArray[Any], shares: NDArray[np.float64], weight: NDArray[Any] | None) -> NDArray[np.float64]:
    if weight is None:
        return np.asarray(np.quantile(values, shares), np.float64)
    order = np.argsort(values, kind="stable")
    total = np.cumsum(np.asarray(weight, np.float64)[order])
    return np.asarray(values[order][np.searchsorted(total, shares * total[-1])], np.float64)
