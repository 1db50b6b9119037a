"""A thing that was made, as an entry of a folder of one's own data: mesh, model, and what of the map it stands for."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vico.assets.generated.generate import GUIDE, Thing
from vico.assets.models.schema import ModelFile
from vico.errors import InputError, OutputExistsError
from vico.io.data_files import parse_record
from vico.io.files import write_bytes, write_json
from vico.world.glb import glb_bytes

_NAME = re.compile(r"[a-z][a-z0-9_]{0,59}")
_TAG = re.compile(r"([A-Za-z0-9_:]{1,60})=(.{1,100})")
_PREFIX = "generated_"


@dataclass(frozen=True)
class Entry:
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


def name_of(prompt: str) -> str:
    """Return a name for a model of a thing that words describe: ``a red post box`` is ``red_post_box``."""
    words = re.findall(r"[a-z0-9]+", prompt.lower())
    words = words[1:] if len(words) > 1 and words[0] in ("a", "an", "the") else words
    name = "_".join(words)[:60].strip("_")
    return name if _NAME.fullmatch(name) else "thing_" + hashlib.sha256(prompt.encode()).hexdigest()[:8]


def files_of(entry: Entry, folder: Path) -> list[Path]:
    """Where `write_entry` writes: the mesh, the model, the record, the picture, and the tags."""
    stem, models = f"{_PREFIX}{entry.name}", folder / "models" / "outdoor"
    return [
        models / f"{stem}.glb",
        models / f"{stem}.toml",
        folder / "generated" / f"{entry.name}.json",
        folder / "generated" / f"{entry.name}.png",
        folder / "objects" / f"kinds_{stem}.toml",
    ]


def check_free(entry: Entry, folder: Path, *, force: bool) -> None:
    """Refuse a name that is taken there.

    Raises
    ------
    OutputExistsError
        If it is, and `force` is false.
    """
    taken = [path for path in files_of(entry, folder) if path.exists()]
    if taken and not force:
        raise OutputExistsError(f"{taken[0]}: exists; give another --name, or --force to replace it")


def write_entry(thing: Thing, entry: Entry, folder: Path, *, force: bool = False) -> Path:
    """Write a thing into a folder of one's own data (``VICO_DATA``), and return the model's file.

    Raises
    ------
    OutputExistsError, OutputError
        If its name is taken, or the folder can't be written.
    """
    check_free(entry, folder, force=force)
    glb, model, record, picture, kinds = files_of(entry, folder)
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


def _model_text(thing: Thing, entry: Entry, file: str, digest: str) -> str:
    said = {"file": file, "sha256": digest, "licence": thing.licence, "credit": thing.credit}
    return (
        f"# Made by `vico assets generate`; see {GUIDE}.\n"
        'group = "amenity"\n\n'
        f"[model.{entry.name}]\n"
        f"kind = {_quoted(entry.kind or entry.name)}\n"
        f"solid = {'true' if entry.solid else 'false'}\n\n"
        f"[model.{entry.name}.mesh]\n" + "".join(f"{key} = {_quoted(value)}\n" for key, value in said.items())
    )


def _kinds_text(entry: Entry) -> str:
    found = [match for tag in entry.tags if (match := _TAG.fullmatch(tag)) is not None]
    return f"# Things of the map that look like {entry.name}.\n" + "".join(
        f"[tags.{_quoted(key)}]\n" + "".join(f"{_quoted(m[2])} = {_quoted(entry.name)}\n" for m in found if m[1] == key)
        for key in dict.fromkeys(match[1] for match in found)
    )


def _quoted(text: str) -> str:
    # TOML's basic strings escape as JSON's do, but for the one control character that JSON leaves bare.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
