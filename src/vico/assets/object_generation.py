"""Models of objects from text: a picture of the words, a mesh of the picture, and an entry of a user's own data.

Paper, object replacement: Stable Diffusion makes the picture, One-2-3-45 the mesh. Here any text-to-image pipeline of
`diffusers` makes the picture, and Shap-E (Jun and Nichol 2023), which comes with `diffusers` too, the mesh. Picture and
mesh are kept, so that the same words cost nothing again. An entry is mesh, model, and what of the map it stands for.
"""

from __future__ import annotations

import hashlib
import importlib
import io
import json
import re
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from inspect import signature
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.assets.mesh_cleaning import Along, RawMesh, object_surface
from vico.assets.models.library import OUTDOOR
from vico.assets.models.schema import ModelFile
from vico.errors import EmptyInputError, InputError, MissingExtraError, OutputExistsError
from vico.io.arrays import read_npz
from vico.io.cache import cache_folder
from vico.io.data_files import PACKAGED, DataRecord, cached_data, data_files, parse_record, read_record
from vico.io.diffusion import ModelFolder, load_pipeline
from vico.io.files import write_bytes, write_json
from vico.world.glb import glb_bytes
from vico.world.mesh import Surface

SHAP_E = "ShapEImg2ImgPipeline"
_SHAP_E_STEP = 8  # pipelines take sides that are multiples of this


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
        if self.side < _SHAP_E_STEP or self.side % _SHAP_E_STEP or self.steps < 1:
            raise InputError(
                f"picture: {self.side} pixels, {self.steps} steps; give a multiple of {_SHAP_E_STEP} and at least "
                "1 step"
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


def network_versions() -> dict[str, str]:
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


GUIDE = "docs/generating_objects.md"
_ROOM = "assets/generation"
_FORMAT = 1  # raise when what is kept changes
_LONGEST_PROMPT = 500

Say = Callable[[str], None]


class PromptWords(DataRecord):
    """What stands before and after the user's words, and what the picture must not show."""

    before: str
    after: str
    never: str


class ModelNames(DataRecord):
    """Which models are asked if none is named."""

    text_to_image: str
    image_to_mesh: str
    words: PromptWords


class _Licences(DataRecord):
    allowed: tuple[str, ...]


@dataclass(frozen=True)
class GenerationRequest:
    """What is asked for.

    Attributes
    ----------
    prompt
        The thing, in words.
    seed
        Of the noise that picture and mesh start from.
    size, along, turn, faces
        See `object_surface`.
    """

    prompt: str
    size: float
    seed: int = 0
    along: Along = "height"
    turn: float = 0.0
    faces: int = 1500


@dataclass(frozen=True)
class Networks:
    """Where the networks lie, and how they run; see `DiffusionPicture` and `ShapEMesh`."""

    text_to_image: ModelFolder | None
    image_to_mesh: ModelFolder | None
    steps: int = 30
    mesh_steps: int = 64
    cells: int = 128
    side: int = 512
    device: str = "cpu"


@dataclass(frozen=True)
class GeneratedObject:
    """What was made.

    Attributes
    ----------
    surface
        See `object_surface`.
    picture
        What the mesh was made of, PNG; None for a mesh that was given.
    licence, credit
        Of what made it.
    record
        Everything that it depends on, plain values.
    """

    surface: Surface
    picture: bytes | None
    licence: str
    credit: str
    record: dict[str, Any] = field(compare=False)


@cached_data
def model_names() -> ModelNames:
    """Return the models that are asked if none is named; the user's file takes the place of ours.

    Raises
    ------
    SchemaError
        If a file can't be used.
    """
    return read_record(data_files(_ROOM, "models")[-1], ModelNames, guide=GUIDE)


def check_licence(model: ModelFolder, *, accepted: bool) -> str:
    """Return the licence of a model whose results may be used for anything.

    Raises
    ------
    InputError
        If it does not say so and the user has not accepted it.
    """
    # Not the user's data: what they may use beyond this they say at each call.
    allowed = read_record(PACKAGED / _ROOM / "licences.toml", _Licences, guide=GUIDE).allowed
    if model.licence in allowed or accepted:
        return model.licence or "as its provider states"
    said = f"its licence is {model.licence}" if model.licence else "its model card states no licence"
    raise InputError(
        f"{model.name}: {said}, which does not let everybody use what it makes for anything; give another model, or "
        f"say --accept-licence if you may ({GUIDE})"
    )


def generate_from_text(
    request: GenerationRequest,
    networks: Networks,
    *,
    picture: Path | None = None,
    accept_licence: bool = False,
    say: Say = lambda _: None,
) -> GeneratedObject:
    """Make a thing of words, or of a picture.

    Parameters
    ----------
    request
        What is asked for.
    networks
        What makes it.
    picture
        A picture of the thing, instead of the one that a network makes.
    accept_licence
        Use models whatever their licence.
    say
        Told what happens, a sentence a call.

    Raises
    ------
    InputError, EmptyInputError, SchemaError, MissingExtraError
        If something can't be used, is not installed, or what comes out is no thing.
    """
    if not request.prompt.strip() or len(request.prompt) > _LONGEST_PROMPT:
        raise InputError(f"prompt: {len(request.prompt)} letters; say what the thing is in 1 to {_LONGEST_PROMPT}")
    mesh_model = networks.image_to_mesh
    if mesh_model is None or (picture is None and networks.text_to_image is None):
        raise InputError("generate: name the models that make the picture and the mesh")
    used = network_versions()
    makers = (
        [mesh_model] if picture is not None or networks.text_to_image is None else [networks.text_to_image, mesh_model]
    )
    licences = [check_licence(model, accepted=accept_licence) for model in makers]
    if picture is None and networks.text_to_image is not None:
        png, about = _picture(request, networks, networks.text_to_image, used, say)
    else:
        png, about = _given_picture(picture), {"picture": "given"}
    raw, mesh_about = _mesh(png, request, networks, mesh_model, used, say)
    surface = object_surface(raw, size=request.size, along=request.along, turn=request.turn, faces=request.faces)
    credit = f"{request.prompt}, made by " + " and ".join(
        f"{model.name} ({licence})" for model, licence in zip(makers, licences, strict=True)
    )
    record = {**about, **mesh_about, "triangles_made": len(raw.faces), **_request_record(request)}
    return GeneratedObject(surface, png, " AND ".join(dict.fromkeys(licences)), credit, record)


def generate_from_mesh(
    request: GenerationRequest, raw: RawMesh, *, digest: str, licence: str, credit: str
) -> GeneratedObject:
    """Make a thing of a mesh that was made elsewhere; `digest` is of its file."""
    surface = object_surface(raw, size=request.size, along=request.along, turn=request.turn, faces=request.faces)
    record = {"mesh": {"sha256": digest}, "triangles_made": len(raw.faces), **_request_record(request)}
    return GeneratedObject(surface, None, licence, credit, record)


def _request_record(request: GenerationRequest) -> dict[str, Any]:
    return {
        "prompt": request.prompt, "seed": request.seed, "size": request.size, "along": request.along,
        "turn": request.turn, "faces": request.faces,
    }  # fmt: skip


def _picture(
    request: GenerationRequest, networks: Networks, model: ModelFolder, used: Mapping[str, str], say: Say
) -> tuple[bytes, dict[str, Any]]:
    """Return the picture of a prompt, PNG, and what it depends on."""
    words = model_names().words
    prompt = f"{words.before}{request.prompt}{words.after}"
    about = {
        "prompt": prompt, "never": words.never, "seed": request.seed, "model": model.name, "revision": model.digest,
        "steps": networks.steps, "side": networks.side, "device": networks.device, "versions": dict(used),
    }  # fmt: skip

    def make() -> bytes:
        say(f"making a picture with {model.name}")
        maker = DiffusionPicture(model, steps=networks.steps, side=networks.side, device=networks.device)
        packed = io.BytesIO()
        Image.fromarray(maker.picture(prompt, never=words.never, seed=request.seed)).save(packed, "PNG")
        return packed.getvalue()

    return _read_or_make("picture", about, make, _pixels), {"picture": about}


def _mesh(
    png: bytes, request: GenerationRequest, networks: Networks, model: ModelFolder, used: Mapping[str, str], say: Say
) -> tuple[RawMesh, dict[str, Any]]:
    """Return the mesh of a picture, and what it depends on."""
    about = {
        "picture": hashlib.sha256(png).hexdigest(), "seed": request.seed, "model": model.name,
        "revision": model.digest, "steps": networks.mesh_steps, "cells": networks.cells, "device": networks.device,
        "versions": dict(used),
    }  # fmt: skip

    def make() -> bytes:
        say(f"making a mesh with {model.name}")
        maker = ShapEMesh(model, steps=networks.mesh_steps, cells=networks.cells, device=networks.device)
        raw, packed = maker.mesh(_pixels(png), seed=request.seed), io.BytesIO()
        np.savez_compressed(packed, points=raw.points, faces=raw.faces, colours=raw.colours)
        return packed.getvalue()

    return _raw(_read_or_make("mesh", about, make, _raw)), {"mesh": about}


def _read_or_make(
    kind: str, about: Mapping[str, Any], make: Callable[[], bytes], read: Callable[[bytes], object]
) -> bytes:
    """Return what was made of the same before, if it is whole, else what is made now."""
    key = hashlib.sha256(json.dumps([_FORMAT, kind, about], sort_keys=True).encode()).hexdigest()
    path = cache_folder() / "generated" / f"{kind}-{key[:32]}"
    if path.is_file():
        found = path.read_bytes()
        try:
            read(found)
        except (OSError, ValueError, KeyError, EOFError, SyntaxError, zipfile.BadZipFile):
            pass  # torn: made again
        else:
            return found
    made = make()
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, made)
    return made


def _pixels(png: bytes) -> NDArray[np.uint8]:
    with Image.open(io.BytesIO(png), formats=("PNG",)) as file:
        return np.asarray(file.convert("RGB"), np.uint8)


def _raw(packed: bytes) -> RawMesh:
    arrays = read_npz(packed)
    return RawMesh(arrays["points"], arrays["faces"], arrays["colours"])


def _given_picture(path: Path | None) -> bytes:
    """Return a picture that the user has as PNG; what it shows through is white."""
    if path is None:
        raise InputError("generate: neither words for a network nor a picture")
    try:
        with Image.open(path, formats=("PNG", "JPEG", "WEBP")) as file:
            whole = file.convert("RGBA")
    except FileNotFoundError:
        raise InputError(f"{path}: no such picture") from None
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InputError(f"{path}: not a readable picture ({error}); give PNG, JPEG or WebP") from None
    paper = Image.new("RGBA", whole.size, (255, 255, 255, 255))
    packed = io.BytesIO()
    Image.alpha_composite(paper, whole).convert("RGB").save(packed, "PNG")
    return packed.getvalue()


_NAME = re.compile(r"[a-z][a-z0-9_]{0,59}")
_TAG = re.compile(r"([A-Za-z0-9_:]{1,60})=(.{1,100})")
_PREFIX = "generated_"


@dataclass(frozen=True)
class ObjectEntry:
    """What the thing is called and stands for.

    Attributes
    ----------
    name
        Of the model; one that there is already takes the other's place.
    kind
        What it is; the name without.
    solid
        Whether bodies are stopped by it.
    tags
        Of the map, ``key=value``: things mapped so look like this.
    """

    name: str
    kind: str = ""
    solid: bool = True
    tags: Sequence[str] = ()

    def __post_init__(self) -> None:
        for what, value in (("name", self.name), ("kind", self.kind or self.name)):
            if not _NAME.fullmatch(value):
                raise InputError(f"{what}: {value!r}; small letters, digits and _ only, a letter first")
        for tag in self.tags:
            if not _TAG.fullmatch(tag):
                raise InputError(f"tag: {tag!r}; write key=value, as in amenity=post_box")


def object_name(prompt: str) -> str:
    """Return a name for a model of a thing that words describe: ``a red post box`` is ``red_post_box``."""
    words = re.findall(r"[a-z0-9]+", prompt.lower())
    words = words[1:] if len(words) > 1 and words[0] in ("a", "an", "the") else words
    name = "_".join(words)[:60].strip("_")
    return name if _NAME.fullmatch(name) else "thing_" + hashlib.sha256(prompt.encode()).hexdigest()[:8]


def entry_files(entry: ObjectEntry, folder: Path) -> list[Path]:
    """Where `write_entry` writes: the mesh, the model, the record, the picture, and the tags."""
    stem, models = f"{_PREFIX}{entry.name}", folder / OUTDOOR
    return [
        models / f"{stem}.glb",
        models / f"{stem}.toml",
        folder / "generated" / f"{entry.name}.json",
        folder / "generated" / f"{entry.name}.png",
        folder / "worldgen" / "objects" / f"kinds_{stem}.toml",
    ]


def check_name_free(entry: ObjectEntry, folder: Path, *, force: bool) -> None:
    """Refuse a name that is taken there.

    Raises
    ------
    OutputExistsError
        If it is, and `force` is false.
    """
    taken = [path for path in entry_files(entry, folder) if path.exists()]
    if taken and not force:
        raise OutputExistsError(f"{taken[0]}: exists; give another --name, or --force to replace it")


def write_entry(thing: GeneratedObject, entry: ObjectEntry, folder: Path, *, force: bool = False) -> Path:
    """Write a thing into a folder of one's own data (``VICO_DATA``), and return the model's file.

    Raises
    ------
    OutputExistsError, OutputError
        If its name is taken, or the folder can't be written.
    """
    check_name_free(entry, folder, force=force)
    glb, model, record, picture, kinds = entry_files(entry, folder)
    mesh = glb_bytes({entry.name: [thing.surface]})
    digest = hashlib.sha256(mesh).hexdigest()
    text = _model_text(thing, entry, glb.name, digest)
    parse_record(text, ModelFile, source=str(model), guide=GUIDE)
    for path in (glb, record, kinds):
        path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(glb, mesh)
    write_json(record, {**thing.record, "triangles": len(thing.surface.triangles), "licence": thing.licence,
                        "credit": thing.credit, "sha256": digest})  # fmt: skip
    if thing.picture is not None:
        write_bytes(picture, thing.picture)
    if entry.tags:
        write_bytes(kinds, _kinds_text(entry).encode())
    write_bytes(model, text.encode())
    return model


def _model_text(thing: GeneratedObject, entry: ObjectEntry, file: str, digest: str) -> str:
    said = {"file": file, "sha256": digest, "licence": thing.licence, "credit": thing.credit}
    return (
        f"# Made by `vico assets generate`; see {GUIDE}.\n"
        'group = "amenity"\n\n'
        f"[model.{entry.name}]\n"
        f"kind = {_toml_string(entry.kind or entry.name)}\n"
        f"solid = {'true' if entry.solid else 'false'}\n\n"
        f"[model.{entry.name}.mesh]\n" + "".join(f"{key} = {_toml_string(value)}\n" for key, value in said.items())
    )


def _kinds_text(entry: ObjectEntry) -> str:
    found = [match for tag in entry.tags if (match := _TAG.fullmatch(tag)) is not None]
    return f"# Things of the map that look like {entry.name}.\n" + "".join(
        f"[tags.{_toml_string(key)}]\n"
        + "".join(f"{_toml_string(m[2])} = {_toml_string(entry.name)}\n" for m in found if m[1] == key)
        for key in dict.fromkeys(match[1] for match in found)
    )


def _toml_string(text: str) -> str:
    # TOML's basic strings escape as JSON's do, but for the one control character that JSON leaves bare.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
