"""A community on disk.

::

    community.json   manifest, written last: a folder that has it is whole
    residents.json   people with their schedules
    groups.json relations.json
    authorship.json  who wrote what, where a language model was asked
    days.json        schedules of further days; empty where there are none, missing in folders of version 1
    origin.json      where the world was; not hashed, no part of the community's identity
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

from vico.community.model import (
    SCHEMA,
    VERSION,
    Authorship,
    Community,
    CommunityDay,
    CommunityManifest,
    Group,
    Relation,
    Resident,
    with_tags,
)
from vico.errors import MissingFileError, SchemaError
from vico.io.files import (
    FolderKind,
    check_replaceable,
    new_folder,
    read_json,
    write_bytes,
    write_json,
    wrong_folder_sentence,
)
from vico.world.folder import is_world
from vico.world.model import Record
from vico.world.world import World

R = TypeVar("R", bound=Record)

_PARTS = ("residents.json", "groups.json", "relations.json", "days.json")
# Version 1 had one day, and everybody came to every meeting; what version 2 adds has defaults that say so.
_READ = (1, VERSION)
_AUTHORSHIP = "authorship.json"
#: What `write_community` makes.
COMMUNITY_FOLDER = FolderKind(
    "community", "community.json", lambda _: ("community.json", "origin.json", _AUTHORSHIP, *_PARTS)
)


def _contents(community: Community) -> tuple[dict[str, bytes], bytes]:
    """Return the bytes of the parts, and of the manifest."""
    lists: tuple[Sequence[Record], ...] = (
        community.residents,
        community.groups,
        community.relations,
        community.further_days,
    )
    parts: dict[str, bytes] = {}
    for name, records in zip(_PARTS, lists, strict=True):
        rows = [json.dumps(r.model_dump(mode="json"), ensure_ascii=False, indent=1) for r in records]
        parts[name] = ("[\n" + ",\n".join(rows) + "\n]\n").encode()
    if community.authorship is not None:
        parts[_AUTHORSHIP] = (
            json.dumps(community.authorship.model_dump(mode="json"), ensure_ascii=False, indent=1) + "\n"
        ).encode()
    manifest = CommunityManifest(
        producer=community.producer,
        author=community.author,
        seed=community.seed,
        date=community.date,
        weekday=community.weekday,
        world=community.world,
        counts={name.removesuffix(".json"): len(records) for name, records in zip(_PARTS, lists, strict=True)},
        files={name: hashlib.sha256(content).hexdigest() for name, content in parts.items()},
    )
    text = json.dumps(manifest.model_dump(mode="json"), indent=1, sort_keys=True, ensure_ascii=False) + "\n"
    return parts, text.encode()


def digest_of(community: Community) -> str:
    """SHA-256 of the bytes of ``community.json``, which holds the hashes of the rest: the community's identity."""
    return hashlib.sha256(_contents(community)[1]).hexdigest()


def write_community(
    community: Community, path: Path, *, force: bool = False, world: Path | None = None
) -> CommunityManifest:
    """Write a community, whole or not at all: into a neighbouring folder that takes its name at the end.

    Parameters
    ----------
    path
        Folder to make.
    force
        Replace a community that is there.
    world
        Folder of the world, remembered so that it need not be named again.

    Raises
    ------
    OutputExistsError
        If `path` exists and `force` is not given, or holds anything but a community.
    """
    path = Path(path)
    check_replaceable(path, force=force, kind=COMMUNITY_FOLDER)
    parts, manifest = _contents(community)
    with new_folder(path, force=force, kind=COMMUNITY_FOLDER) as fresh:
        for name, content in parts.items():
            write_bytes(fresh / name, content)
        if world is not None:
            write_json(fresh / "origin.json", {"world": os.path.relpath(Path(world).resolve(), path.resolve())})
        write_bytes(fresh / "community.json", manifest)
    return CommunityManifest.model_validate_json(manifest)


def read_manifest(path: Path) -> CommunityManifest:
    """Read the manifest of a community folder.

    Raises
    ------
    MissingFileError
        If there is no finished community at `path`.
    SchemaError
        If it is of another kind or version, or damaged.
    """
    path = Path(path)
    if not path.is_dir():
        raise MissingFileError(f"{path}: no such folder; make one with vico community build")
    if not (path / "community.json").exists():
        raise MissingFileError(wrong_folder_sentence(path, "community", "vico community build"))
    content = read_json(path / "community.json")
    found = content.get("schema_name") if isinstance(content, dict) else type(content).__name__
    if found != SCHEMA:
        raise SchemaError(f"{path}/community.json: schema {found!r} is not {SCHEMA!r}; give a community folder")
    if content.get("version") not in _READ:
        raise SchemaError(
            f"{path}/community.json: version {content.get('version')!r} of {SCHEMA}, but this vico reads "
            f"version {VERSION} and before; build the community anew"
        )
    try:
        return CommunityManifest.model_validate_json(json.dumps(content))
    except ValidationError as error:
        raise _invalid(path / "community.json", error) from None


def read_community(path: Path, world: World | None = None) -> Community:
    """Read a community folder.

    Parameters
    ----------
    world
        The world it is wanted for; another one is refused.

    Raises
    ------
    MissingFileError
        If there is no finished community at `path`.
    SchemaError
        If it is of another kind or version, damaged, or made for another world.
    """
    path = Path(path)
    manifest = read_manifest(path)
    if world is not None and manifest.world.digest != world.digest:
        raise SchemaError(
            f"{path}: made for world {manifest.world.name!r} ({manifest.world.digest[:12]}), not for "
            f"{world.manifest.name!r} ({world.digest[:12]}); give that world, or build a community for this one"
        )
    authorship = None
    if _AUTHORSHIP in manifest.files:
        try:
            authorship = Authorship.model_validate_json(_content(path / _AUTHORSHIP, manifest))
        except ValidationError as error:
            raise _invalid(path / _AUTHORSHIP, error) from None
    community = Community(
        producer=manifest.producer,
        author=manifest.author,
        seed=manifest.seed,
        date=manifest.date,
        world=manifest.world,
        residents=_records(path / "residents.json", Resident, manifest),
        groups=_records(path / "groups.json", Group, manifest),
        relations=_records(path / "relations.json", Relation, manifest),
        authorship=authorship,
        further_days=_records(path / "days.json", CommunityDay, manifest) if "days.json" in manifest.files else [],
    )
    # Folders of earlier versions, and days that a language model wrote, may say nothing about what an item is about.
    return with_tags(community, () if world is None else world.places)


def read_names(path: Path) -> dict[str, str]:
    """Read what residents of a community are called, by id, without the rest of it.

    Raises
    ------
    MissingFileError, SchemaError
        As `read_community`.
    """
    path = Path(path)
    return {resident.id: resident.name for resident in _records(path / "residents.json", Resident, read_manifest(path))}


def world_of(path: Path) -> Path | None:
    """Folder of the world that a community was made for, if it is still where it was."""
    origin = Path(path) / "origin.json"
    if not origin.exists():
        return None
    content = read_json(origin)
    if not isinstance(content, dict) or not isinstance(content.get("world"), str):
        raise SchemaError(f"{origin}: does not say where the world is; give it with --world")
    found = Path(os.path.normpath(Path(path).resolve() / content["world"]))
    return found if is_world(found) else None


def _records(path: Path, kind: type[R], manifest: CommunityManifest) -> list[R]:
    try:
        return TypeAdapter(list[kind]).validate_json(_content(path, manifest))  # type: ignore[valid-type]
    except ValidationError as error:
        raise _invalid(path, error) from None


def _content(path: Path, manifest: CommunityManifest) -> bytes:
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; build the community anew") from None
    if hashlib.sha256(content).hexdigest() != manifest.files.get(path.name):
        raise SchemaError(f"{path}: changed since the community was built; restore it, or build the community anew")
    return content


def _invalid(path: Path, error: ValidationError) -> SchemaError:
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"]) or "the whole file"
    return SchemaError(f"{path}: {where}: {first['msg']}; build the community anew")
