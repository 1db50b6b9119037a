"""Models of `diffusers`: where one lies, under which licence, and how it is loaded. Safetensors only.

Weights in pickles (``.bin``, ``.ckpt``, ``.pt``) can run code when they are read, so they never are: a folder that has
nothing else is refused, and of a hub only configurations and safetensors are fetched.
"""

from __future__ import annotations

import hashlib
import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vico.errors import MissingExtraError, MissingFileError, SchemaError, SourceError, sentence_of
from vico.io.files import read_json, sha256_of

INDEX = "model_index.json"
_PICKLES = (".bin", ".ckpt", ".pt", ".pth", ".pkl", ".pickle")
_READ = (".json", ".txt", ".model", ".safetensors")
_HALF = "fp16"
_FETCHED = ("README.md", INDEX, "*/*.json", "*/*.txt", "*/*.model", "*/*.safetensors")
_FRONT = "---"
_MOST_CARD = 1 << 20


@dataclass(frozen=True)
class ModelFolder:
    """A model on disk.

    Attributes
    ----------
    path
        Its folder.
    name
        As the user called it: a name on a hub, or the folder's own.
    digest
        SHA-256 of every file that is read of it: another revision is another model.
    kind
        Class of its pipeline, such as ``ShapEImg2ImgPipeline``.
    licence
        As its model card states it, in lower case; "" where it has none.
    variant
        ``fp16`` where the weights come in half precision only, else None.
    """

    path: Path
    name: str
    digest: str
    kind: str
    licence: str
    variant: str | None


def model_folder(model: str | Path, *, revision: str | None = None) -> ModelFolder:
    """Find a model: in a folder, which is never looked for elsewhere, or by its name on the hub.

    Parameters
    ----------
    model
        A folder as ``save_pretrained`` writes it, or a name such as ``openai/shap-e-img2img``.
    revision
        Commit, tag or branch on the hub.

    Raises
    ------
    MissingFileError, SchemaError
        If the folder is no model, or its weights are no safetensors.
    MissingExtraError, SourceError
        If it has to be fetched, and the client is not installed or the hub can't be reached.
    """
    path = Path(model)
    if path.is_dir():
        name = path.resolve().name
    elif path.is_absolute() or str(model).startswith((".", "~")) or str(model).count("/") != 1:
        raise MissingFileError(f"{model}: no such folder, and no name of a model on a hub (OWNER/NAME)")
    else:
        path, name = _fetch(str(model), revision), str(model)
    kind, components = _components(path)
    variants = [variant for folder in components if (variant := _variant(folder)) is not None]
    return ModelFolder(
        path, name, _digest(path, components), kind, _licence(path / "README.md"), variants[0] if variants else None
    )


def load_pipeline(
    kind: str,
    model: str | Path,
    *,
    device: str = "cpu",
    without: tuple[str, ...] = (),
    variant: str | None = None,
    checked: bool = False,
) -> Any:
    """Load a pipeline of `diffusers`.

    Parameters
    ----------
    kind
        Its class there.
    model
        A folder, which is never looked for elsewhere, or a name on the hub.
    device
        Where it runs, "cpu" or "cuda".
    without
        Parts of the model to leave out.
    variant
        Of the files of its weights.
    checked
        Keep the model's own check of what its pictures show.

    Raises
    ------
    MissingExtraError
        If torch or diffusers are not installed.
    SchemaError
        If the model can't be loaded.
    """
    try:
        diffusers, torch = importlib.import_module("diffusers"), importlib.import_module("torch")
    except ImportError:
        raise MissingExtraError(
            "diffusion: torch or diffusers are not installed; type: pip install 'virtual-community[diffusion]'"
        ) from None
    half = {} if variant is None else {"variant": variant}
    try:
        loaded = getattr(diffusers, kind).from_pretrained(
            str(model), use_safetensors=True, local_files_only=Path(model).is_dir(), **half, **dict.fromkeys(without)
        )
    except (OSError, ValueError, TypeError, KeyError) as error:
        reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise SchemaError(
            f"diffusion: {model}: can't be loaded as {kind} ({reason}); give a folder or a model's name"
        ) from None
    loaded = loaded.to(device, torch.float32 if device == "cpu" else torch.float16)
    loaded.set_progress_bar_config(disable=True)
    if not checked and getattr(loaded, "safety_checker", None) is not None:
        loaded.safety_checker = None  # it blacks out whole pictures; these are of walls
    return loaded


def _fetch(name: str, revision: str | None) -> Path:
    """Fetch a model's configurations and safetensors; those in half precision only where there are no others."""
    try:
        hub = importlib.import_module("huggingface_hub")
    except ImportError:
        raise MissingExtraError(
            f"{name}: no such folder, and the hub's client is not installed; "
            "type: pip install 'virtual-community[diffusion]'"
        ) from None
    try:
        path = Path(hub.snapshot_download(
            name, revision=revision, allow_patterns=list(_FETCHED), ignore_patterns=[f"*.{_HALF}.*"]
        ))  # fmt: skip
        if any(not list(folder.glob("*.safetensors")) for folder in _components(path)[1] if _has_weights(folder)):
            path = Path(hub.snapshot_download(name, revision=revision, allow_patterns=list(_FETCHED)))
    except (SchemaError, MissingFileError):
        raise
    except Exception as error:  # whatever the client and what it is built on raise
        raise SourceError(
            f"{name}: no such folder, and the hub does not give it ({sentence_of(error).splitlines()[0]}); "
            "give a folder that holds the model"
        ) from None
    return path


def _components(path: Path) -> tuple[str, list[Path]]:
    """Return the class of a model's pipeline, and the folders of its parts."""
    try:
        index = read_json(path / INDEX)
        kind = index["_class_name"]
        parts = [name for name, entry in index.items() if isinstance(entry, list) and entry and entry[0] is not None]
    except FileNotFoundError:
        raise MissingFileError(
            f"{path}: holds no {INDEX}; give a folder as `save_pretrained` of diffusers writes it"
        ) from None
    except (KeyError, TypeError, AttributeError):
        raise SchemaError(f"{path / INDEX}: not the index of a model of diffusers; fetch the model again") from None
    if not isinstance(kind, str) or any("/" in name or name.startswith(".") for name in parts):
        raise SchemaError(f"{path / INDEX}: not the index of a model of diffusers; fetch the model again")
    return kind, [path / name for name in sorted(parts) if (path / name).is_dir()]


def _has_weights(folder: Path) -> bool:
    """Whether a part has weights: configurations of tokenisers, schedulers and processors are called otherwise."""
    return (folder / "config.json").is_file()


def _variant(folder: Path) -> str | None:
    """Return ``fp16`` where a part's weights come only so; refuse a part whose weights are pickles only."""
    safe = sorted(folder.glob("*.safetensors"))
    pickles = sorted(path.name for path in folder.iterdir() if path.suffix in _PICKLES)
    if pickles and not safe:
        raise SchemaError(
            f"{folder}: its weights are in {pickles[0]} alone, which can run code when it is read; give a model whose "
            "weights are .safetensors"
        )
    if _has_weights(folder) and not safe:
        raise MissingFileError(
            f"{folder}: no safetensors there; fetch the model again, or convert its weights once "
            "(docs/generating_objects.md)"
        )
    return _HALF if safe and all(f".{_HALF}." in path.name for path in safe) else None


def _digest(path: Path, components: list[Path]) -> str:
    total = hashlib.sha256()
    for folder in (path, *components):
        for file in sorted(folder.iterdir()):
            if file.is_file() and file.suffix in _READ:
                total.update(f"{file.relative_to(path).as_posix()} {sha256_of(file)}\n".encode())
    return total.hexdigest()


def _licence(card: Path) -> str:
    """Return the licence that a model card's head states (``license: mit``)."""
    if not card.is_file() or card.stat().st_size > _MOST_CARD:
        return ""
    lines = card.read_text(encoding="utf-8", errors="replace").splitlines()
    if not lines or lines[0].strip() != _FRONT:
        return ""
    said: dict[str, str] = {}
    for line in lines[1:]:
        if line.strip() == _FRONT:
            break
        key, colon, value = line.partition(":")
        if colon and key in ("license", "license_name"):
            said[key] = value.strip().strip("\"'").lower()
    stated = said.get("license", "")
    return said.get("license_name", stated) if stated == "other" else stated
