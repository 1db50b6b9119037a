"""Street furniture and furniture out of the Debian package `sweethome3d-furniture`, for worlds that ask for them.

The package is optional and only its models are used: read out of the archives, thinned, fitted into our models'
outlines, and kept as one GLB in the user's cache. A world that uses them carries them in its own meshes, with credits.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from vico.assets.models.furniture import furniture_models
from vico.assets.models.model import Model
from vico.assets.models.street import street_models
from vico.assets.packages import FetchError, IntegrityError
from vico.assets.things.archive import COLLECTIONS, SYSTEM_FOLDER, Archive, ArchiveEntry, archives
from vico.assets.things.fit import OURS, StandIn, fitted
from vico.assets.things.obj import ObjMesh, read_obj
from vico.assets.things.stand_ins import STAND_INS
from vico.errors import MissingExtraError, SchemaError
from vico.io.cache import cache_folder
from vico.io.files import read_json, sha256_of, write_json
from vico.world.glb import read_glb, write_glb
from vico.world.mesh import Surface

PACK = "sweethome3d-furniture"
_SCHEMA = "vico.things"
_MINUTES = 20
# Raise when what is baked changes beside the table, so that older caches are left alone.
_BAKE = 2


@dataclass(frozen=True)
class Credit:
    """Whom a world owes thanks for models of one collection.

    Attributes
    ----------
    collection
        Name of the collection, with the pack's.
    licence
        SPDX identifier.
    words
        The models, who made them, and that they were changed.
    """

    collection: str
    licence: str
    words: str


def our_models() -> dict[str, Model]:
    """All models of ours that stand in worlds, by name."""
    return {**street_models(), **furniture_models()}


def fetch_things(pack: Path | None = None, *, force: bool = False, say: Callable[[str], None] = lambda _: None) -> Path:
    """Find or fetch the pack, and bake its models into the cache.

    Parameters
    ----------
    pack
        A ``.deb`` of the pack or a folder with its archives; None: where the system has it installed, else what
        ``apt-get download`` gives (nothing is installed on the system, and the download is not kept).
    force
        Bake again even if that was done.
    say
        Told what happens, with licences and credits, a sentence a call.

    Returns
    -------
    Path
        The baked file.

    Raises
    ------
    FetchError
        If it is not there and can't be fetched.
    MissingFileError, IntegrityError
        If `pack` is not it, or is damaged.
    """
    baked = baked_things()
    if available_things() and not force and pack is None:
        say(f"things: {PACK} is in {baked}")
        return baked
    if pack is None and any((SYSTEM_FOLDER / f"{c.file}.sh3f").is_file() for c in COLLECTIONS.values()):
        pack = SYSTEM_FOLDER
    if pack is not None:
        _bake(archives(pack), baked, say)
    else:
        baked.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=baked.parent, prefix=f".{PACK}-") as folder:
            _bake(archives(_downloaded(Path(folder), say)), baked, say)
    return baked


def _downloaded(folder: Path, say: Callable[[str], None]) -> Path:
    """Have apt download the package; it checks the archive's signature."""
    mend = (
        f"get {PACK}'s .deb from a Debian or Ubuntu mirror and type `vico assets install things --pack FILE`; "
        "until then our own models serve"
    )
    if shutil.which("apt-get") is None:
        raise FetchError(f"things: this machine has no apt-get: {mend}")
    say(f"fetching {PACK} (120 MB) with apt-get download")
    command = ["apt-get", "-q", "download", PACK]
    try:
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=60 * _MINUTES, check=False,
            env={**os.environ, "LC_ALL": "C"},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise FetchError(f"things: apt-get did not finish in {_MINUTES} minutes: {mend}") from None
    found = sorted(folder.glob(f"{PACK}_*.deb"))
    if done.returncode or len(found) != 1:
        words = [line for line in done.stderr.splitlines() if line.startswith("E:")] or ["it gave no file"]
        raise FetchError(f"things: apt-get can't download {PACK} ({words[-1]}): run apt-get update, or {mend}")
    return found[0]


def _bake(opened: Mapping[str, Archive], path: Path, say: Callable[[str], None]) -> None:
    """Make every stand-in, and keep them with who made them; one that can't be made is left out and told."""
    solids: dict[tuple[str, str], tuple[ArchiveEntry, ObjMesh]] = {}

    def look(piece: StandIn) -> tuple[ArchiveEntry, ObjMesh]:
        key = piece.pack, piece.name
        if key not in solids:
            archive = opened.get(piece.pack)
            if archive is None:
                raise IntegrityError(f"the pack lacks {COLLECTIONS[piece.pack].file}.sh3f")
            entry = archive.entries.get(piece.name)
            if entry is None:
                raise IntegrityError(f"{archive.name} lacks {piece.name}")
            solid = read_obj(entry.model, archive.read)
            if not solid.digest.startswith(piece.digest):
                raise IntegrityError(f"{archive.name}: {piece.name} is not the one this version of vico was tried with")
            solids[key] = entry, solid
        return solids[key]

    models = our_models()
    layers: dict[str, Sequence[Surface]] = {}
    made_of: dict[str, list[dict[str, str]]] = {}
    with ExitStack() as stack:
        for archive in opened.values():
            stack.enter_context(archive)
        say(f"things: thinning and fitting {len(STAND_INS)} models")
        for name, pieces in STAND_INS.items():
            try:
                layers[name] = fitted(pieces, name, models, look)
            except IntegrityError as error:
                say(f"things: {name} stays our own model: {error}")
                continue
            foreign = {(p.pack, p.name): look(p)[0].creator for p in pieces if p.pack != OURS}
            made_of[name] = [{"pack": k[0], "name": k[1], "creator": who} for k, who in sorted(foreign.items())]
    if not layers:
        raise IntegrityError(f"things: none of the models could be made of this pack; is it {PACK} 1.8?")
    write_glb(path, layers)
    write_json(_record(path), {"schema": _SCHEMA, "sha256": sha256_of(path), "models": made_of})
    read_things.cache_clear()
    for credit in credits_of(layers):
        say(f"{credit.collection}: {credit.licence}. {credit.words}")


def _record(path: Path) -> Path:
    return path.with_suffix(".json")


@cache
def baked_things() -> Path:
    """Where the baked models are, or would be, for this version's choice of them."""
    choice = hashlib.sha256(repr((_BAKE, sorted(STAND_INS.items()))).encode()).hexdigest()[:16]
    return cache_folder() / "baked" / f"things-{choice}.glb"


def available_things() -> bool:
    """Whether the pack's models are baked and whole."""
    try:
        read_things()
    except (MissingExtraError, SchemaError):
        return False
    return True


@cache
def read_things() -> tuple[dict[str, list[Surface]], dict[str, list[dict[str, str]]], str]:
    """Return surfaces by the name of our model, what each is made of, and the SHA-256 of all.

    Raises
    ------
    MissingExtraError
        If nothing was baked.
    SchemaError
        If the cache is damaged.
    """
    path = baked_things()
    mend = "type `vico assets install things --force`"
    try:
        record = read_json(_record(path))
        if record["schema"] != _SCHEMA or record["sha256"] != sha256_of(path):
            raise ValueError
        made_of = {
            str(name): [{key: str(row[key]) for key in ("pack", "name", "creator")} for row in rows]
            for name, rows in record["models"].items()
        }
        if any(row["pack"] not in COLLECTIONS for rows in made_of.values() for row in rows):
            raise ValueError
    except FileNotFoundError:
        raise MissingExtraError("things: no pack of models is installed; type `vico assets install things`") from None
    except (KeyError, TypeError, AttributeError, ValueError):
        raise SchemaError(f"{path}: not what was baked there; {mend}") from None
    return read_glb(path), made_of, str(record["sha256"])


def credits_of(names: Iterable[str]) -> list[Credit]:
    """Whom to thank for these of the stand-ins, a row for each collection they are from."""
    _, made_of, _ = read_things()
    rows = {(row["pack"], row["creator"], row["name"]) for name in names for row in made_of.get(name, ())}
    found: list[Credit] = []
    for letter, collection in COLLECTIONS.items():
        by: dict[str, list[str]] = {}
        for pack, creator, name in sorted(rows):
            if pack == letter:
                by.setdefault(creator or collection.owner, []).append(name)
        if by:
            words = "; ".join(f"{', '.join(models)} by {who}" for who, models in by.items())
            credit = f"{words} ({collection.owner}); thinned and fitted"
            found.append(Credit(f"{PACK}, {collection.file}", collection.licence, credit))
    return found
