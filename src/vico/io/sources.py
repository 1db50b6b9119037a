"""Digest of a module's source and of all that it imports of its package."""

from __future__ import annotations

import hashlib
import importlib.metadata
import re
from functools import cache, lru_cache
from pathlib import Path


def source_digest(path: Path, module: str) -> str:
    """Return a digest of what a module's results are made from.

    Parameters
    ----------
    path
        The module's file.
    module
        Its full name.

    Returns
    -------
    str
        24 hexadecimal digits: of the file, of every file of the same package that it imports, directly or not, and of
        numba's version.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    package, _, rest = module.partition(".")
    root = path.parents[rest.count(".") + 1 + (path.name == "__init__.py")] if rest else path.parent
    seen: set[Path] = set()
    waiting = [path]
    while waiting:
        if (file := waiting.pop()) not in seen:
            seen.add(file)
            waiting += _source(file, root, package)[1]
    whole = hashlib.sha256(_numba_version().encode())
    for file in sorted(seen):
        whole.update(f"\n{file.relative_to(root)} ".encode() + _source(file, root, package)[0])
    return whole.hexdigest()[:24]


@lru_cache
def _numba_version() -> str:
    return importlib.metadata.version("numba")


@cache
def _source(file: Path, root: Path, package: str) -> tuple[bytes, tuple[Path, ...]]:
    """Return the digest of a file, and the files of the package that it imports anywhere."""
    text = file.read_bytes()
    found = {
        _file_of(name, root)
        for statement in _imports(package).finditer(text)
        for name in _imported(*(part.decode() if part else "" for part in statement.groups()))
    }
    return hashlib.sha256(text).digest(), tuple(sorted(path for path in found if path))


@lru_cache
def _imports(package: str) -> re.Pattern[bytes]:
    """Match `from PACKAGE... import NAMES` and `import PACKAGE...`: parsing would take longer than all the rest."""
    name = rf"{re.escape(package)}(?:\.\w+)*"
    pattern = rf"^[ \t]*(?:from[ \t]+({name})[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)|import[ \t]+({name}))"
    return re.compile(pattern.encode(), re.MULTILINE)


def _imported(module: str, names: str, plain: str) -> list[str]:
    """Return the modules that a statement may import: what is imported from a package may be a module of it."""
    if plain:
        return [plain]
    bare = re.sub(r"#[^\n]*", "", names).strip("()")
    return [module, *(f"{module}.{name.split()[0]}" for name in bare.split(",") if name.strip())]


@cache
def _file_of(module: str, root: Path) -> Path | None:
    path = root.joinpath(*module.split("."))
    return next((file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()), None)
