"""The networks that make a picture of words and a mesh of a picture, through `diffusers`.

Paper, object replacement: Stable Diffusion makes the picture, One-2-3-45 the mesh. Here any text-to-image pipeline of
`diffusers` makes the picture, and Shap-E (Jun and Nichol 2023), which comes with `diffusers` too, the mesh.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass, field
from inspect import signature
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.assets.generated.raw_mesh import RawMesh
from vico.errors import EmptyInputError, InputError, MissingExtraError
from vico.io.diffusion import ModelFolder, load_pipeline

SHAP_E = "ShapEImg2ImgPipeline"
_STEP = 8  # pipelines take sides that are multiples of this


class PictureMaker(Protocol):
    """Makes a picture of words."""

    def picture(self, prompt: str, *, never: str, seed: int) -> NDArray[np.uint8]:
        """Return an sRGB picture of `prompt`, without what `never` names, shape ``(h, w, 3)``."""
        ...


class MeshMaker(Protocol):
    """Makes a mesh of a picture."""

    def mesh(self, picture: NDArray[np.uint8], *, seed: int) -> RawMesh:
        """Return the mesh of what an sRGB picture of shape ``(h, w, 3)`` shows."""
        ...


@dataclass(frozen=True)
class DiffusionPicture:
    """Any model that `AutoPipelineForText2Image` of `diffusers` loads.

    Attributes
    ----------
    model
        Where it lies.
    steps, guidance
        Of the pipeline: denoising steps, weight of the prompt.
    side
        Pixels of a side.
    device
        Where it runs, "cpu" or "cuda".

    Raises
    ------
    MissingExtraError, InputError, SchemaError
        If torch or diffusers are not installed, an attribute can't be used, or the model can't be loaded.
    """

    model: ModelFolder
    steps: int = 30
    guidance: float = 7.0
    side: int = 512
    device: str = "cpu"
    _pipeline: Any = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.side < _STEP or self.side % _STEP or self.steps < 1:
            raise InputError(
                f"picture: {self.side} pixels, {self.steps} steps; give a multiple of {_STEP} and at least 1 step"
            )
        loaded = load_pipeline(
            "AutoPipelineForText2Image", self.model.path, device=self.device, variant=self.model.variant, checked=True
        )
        object.__setattr__(self, "_pipeline", loaded)

    def picture(self, prompt: str, *, never: str, seed: int) -> NDArray[np.uint8]:
        """See `PictureMaker`.

        Raises
        ------
        InputError
            If the model's own check refuses its picture.
        """
        torch = importlib.import_module("torch")
        # Models that are distilled know no other words than those that they are to follow.
        words = {"negative_prompt": never} if "negative_prompt" in signature(self._pipeline.__call__).parameters else {}
        made = self._pipeline(
            prompt=prompt,
            **words,
            height=self.side,
            width=self.side,
            num_inference_steps=self.steps,
            guidance_scale=self.guidance,
            generator=torch.Generator("cpu").manual_seed(seed),
        )
        if any(getattr(made, "nsfw_content_detected", None) or ()):
            raise InputError(f"{self.model.name}: its own check refuses the picture it made; try other words or a seed")
        return np.asarray(made.images[0].convert("RGB"), np.uint8)


@dataclass(frozen=True)
class ShapEMesh:
    """Shap-E's image-to-3D pipeline of `diffusers`.

    Attributes
    ----------
    model
        Where it lies.
    steps, guidance
        Of the pipeline: denoising steps, weight of the picture.
    cells
        Cells a side of the grid that the surface is read from.
    device
        Where it runs, "cpu" or "cuda".

    Raises
    ------
    MissingExtraError, InputError, SchemaError
        If torch, diffusers or transformers are not installed, the model is another, or it can't be loaded.
    """

    model: ModelFolder
    steps: int = 64
    guidance: float = 3.0
    cells: int = 128
    device: str = "cpu"
    _pipeline: Any = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.model.kind != SHAP_E:
            raise InputError(
                f"{self.model.name}: its pipeline is {self.model.kind}; a mesh is made by a model of {SHAP_E}, such as "
                "openai/shap-e-img2img"
            )
        if self.steps < 1 or not 8 <= self.cells <= 512:
            raise InputError(f"mesh: {self.steps} steps, {self.cells} cells; give 1 step or more, and 8 to 512 cells")
        loaded = load_pipeline(SHAP_E, self.model.path, device=self.device, variant=self.model.variant)
        object.__setattr__(self, "_pipeline", loaded)

    def mesh(self, picture: NDArray[np.uint8], *, seed: int) -> RawMesh:
        """See `MeshMaker`.

        Raises
        ------
        EmptyInputError
            If no surface comes out.
        """
        torch = importlib.import_module("torch")
        latents = self._pipeline(
            Image.fromarray(picture),
            num_inference_steps=self.steps,
            guidance_scale=self.guidance,
            generator=torch.Generator("cpu").manual_seed(seed),
            output_type="latent",
        ).images
        try:
            made = self._pipeline.shap_e_renderer.decode_to_mesh(latents[:1], self.device, grid_size=self.cells)
        except (RuntimeError, IndexError, ZeroDivisionError, ValueError) as error:
            # It fails at colouring a surface that has no points.
            raise EmptyInputError(
                f"{self.model.name}: no surface comes of the picture ({error}); try another seed"
            ) from None
        linear = np.stack([made.vertex_channels[c].float().cpu().numpy().reshape(-1) for c in "RGB"], axis=1)
        return RawMesh(
            made.verts.float().cpu().numpy().astype(np.float64),
            made.faces.cpu().numpy().astype(np.int64),
            _srgb(linear),
        )


def versions() -> dict[str, str]:
    """Return the versions of what networks run on: another one may make other pictures.

    Raises
    ------
    MissingExtraError
        If they are not installed.
    """
    try:
        return {name: str(importlib.import_module(name).__version__) for name in ("torch", "diffusers", "transformers")}
    except ImportError:
        raise MissingExtraError(
            "generate: torch, diffusers or transformers are not installed; "
            "type: pip install 'virtual-community[diffusion]'"
        ) from None


def _srgb(linear: NDArray[Any]) -> NDArray[np.uint8]:
    """Return colours as files hold them: Shap-E's are linear."""
    light = np.clip(np.nan_to_num(linear), 0.0, 1.0)
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.power(light, 1 / 2.4) - 0.055)
    return np.asarray(np.round(curve * 255), np.uint8)
