"""A thing out of words: the picture and the mesh it comes from are kept, so that the same words cost nothing again."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.assets.generated.networks import DiffusionPicture, ShapEMesh, versions
from vico.assets.generated.raw_mesh import Along, RawMesh, object_surface
from vico.errors import InputError
from vico.io.cache import cache_folder
from vico.io.data_files import PACKAGED, DataRecord, cached_data, data_files, read_record
from vico.io.diffusion import ModelFolder
from vico.io.files import write_bytes
from vico.io.npz import read_npz
from vico.world.mesh import Surface

GUIDE = "docs/generating_objects.md"
_ROOM = "generation"
_FORMAT = 1  # raise when what is kept changes
_LONGEST_PROMPT = 500

Say = Callable[[str], None]


class Words(DataRecord):
    """What stands before and after the user's words, and what the picture must not show."""

    before: str
    after: str
    never: str


class ModelNames(DataRecord):
    """Which models are asked if none is named."""

    text_to_image: str
    image_to_mesh: str
    words: Words


class _Licences(DataRecord):
    allowed: tuple[str, ...]


@dataclass(frozen=True)
class ThingRequest:
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
class Thing:
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


def thing_of_words(
    request: ThingRequest,
    networks: Networks,
    *,
    picture: Path | None = None,
    accept_licence: bool = False,
    say: Say = lambda _: None,
) -> Thing:
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
    used = versions()
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
    record = {**about, **mesh_about, "triangles_made": len(raw.faces), **_asked(request)}
    return Thing(surface, png, " AND ".join(dict.fromkeys(licences)), credit, record)


def thing_of_mesh(request: ThingRequest, raw: RawMesh, *, digest: str, licence: str, credit: str) -> Thing:
    """Make a thing of a mesh that was made elsewhere; `digest` is of its file."""
    surface = object_surface(raw, size=request.size, along=request.along, turn=request.turn, faces=request.faces)
    record = {"mesh": {"sha256": digest}, "triangles_made": len(raw.faces), **_asked(request)}
    return Thing(surface, None, licence, credit, record)


def _asked(request: ThingRequest) -> dict[str, Any]:
    return {
        "prompt": request.prompt, "seed": request.seed, "size": request.size, "along": request.along,
        "turn": request.turn, "faces": request.faces,
    }  # fmt: skip


def _picture(
    request: ThingRequest, networks: Networks, model: ModelFolder, used: Mapping[str, str], say: Say
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

    return _kept("picture", about, make, _pixels), {"picture": about}


def _mesh(
    png: bytes, request: ThingRequest, networks: Networks, model: ModelFolder, used: Mapping[str, str], say: Say
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

    return _raw(_kept("mesh", about, make, _raw)), {"mesh": about}


def _kept(kind: str, about: Mapping[str, Any], make: Callable[[], bytes], read: Callable[[bytes], object]) -> bytes:
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
