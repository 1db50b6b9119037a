"""Compiled functions, kept between runs in the cache folder and never used when stale.

numba's own cache lies beside the sources and judges a function by the file it stands in. That file is not all that went
into the machine code: functions called from other files are compiled into it, and so are constants and the fields of
records. After an update of a checkout such code would be old, or could not even be read: its index names classes that
are called otherwise by now. Here a module's compiled functions have a folder named after what the module and all that
it imports of its package say, so a changed source has a folder of its own, and one that is back has its old one.
Processes that start at once compile each function once: whoever comes second waits for what the first one keeps.
"""

from __future__ import annotations

import fcntl
import hashlib
import importlib.metadata
import logging
import os
import pickle
import re
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.compiler_lock import global_compiler_lock

from vico.io.cache import cache_folder

_log = logging.getLogger(__name__)

_DAY = 86_400.0
_UNUSED = 30 * _DAY  # after this long a folder of compiled code goes
_KEPT = 8  # folders a module keeps: states of its sources between which one goes to and fro


def compiled(function: Any = None, /, **options: Any) -> Any:
    """Compile a function with numba when it is first called, or load what an earlier run compiled.

    Parameters
    ----------
    function
        What to compile; left out where options are given: ``@compiled`` or ``@compiled(nogil=True)``.
    options
        Of ``numba.njit``, but `cache`.

    Returns
    -------
    object
        numba's dispatcher, or a decorator that makes one.
    """
    if function is None:
        return lambda given: compiled(given, **options)
    dispatcher = numba.njit(**options)(function)
    dispatcher._cache = _KeptCode(function)  # what `cache=True` would set to numba's own
    dispatcher.compile = _in_turn(dispatcher.compile, dispatcher._cache)
    return dispatcher


def compiled_folder() -> Path:
    """Return where compiled code is kept: ``$NUMBA_CACHE_DIR``, else `compiled` in the cache folder."""
    return Path(numba.config.CACHE_DIR or cache_folder() / "compiled")


def source_digest(path: Path, module: str) -> str:
    """Return a digest of what the compiled functions of a module are made from.

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


class _Place:
    """Where the compiled functions of one module lie; what numba calls a cache locator."""

    def __init__(self, function: Any, file: Path) -> None:
        self._line = function.__code__.co_firstlineno
        self._folder = _folder(compiled_folder(), function.__module__, file)

    @classmethod
    def from_function(cls, function: Any, file: str) -> _Place | None:
        return cls(function, Path(file)) if os.path.isfile(file) else None

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return ""  # the folder's name is one

    def get_disambiguator(self) -> str:
        return str(self._line)

    def ensure_cache_path(self) -> None:
        if not self._folder.is_dir():
            self._folder.mkdir(parents=True, exist_ok=True)
            _sweep(self._folder)


@cache
def _folder(base: Path, module: str, file: Path) -> Path:
    """Return the folder of a module, marked as used."""
    folder = base / f"{module}-{source_digest(file, module)}"
    try:
        if folder.stat().st_mtime < time.time() - _DAY:
            os.utime(folder)
    except OSError:
        pass  # not there yet, or another user's
    return folder


def _sweep(new: Path) -> None:
    """Remove what a module no longer needs when it gets a folder, and what no module has used for long."""
    used = {folder: folder.stat().st_mtime for folder in new.parent.glob("*-*") if folder.is_dir()}
    old = {folder for folder, when in used.items() if when < time.time() - _UNUSED}
    module = new.name.rpartition("-")[0]
    own = sorted((folder for folder in used if folder.name.rpartition("-")[0] == module), key=used.__getitem__)
    for folder in old | set(own[:-_KEPT]):
        shutil.rmtree(folder, ignore_errors=True)


class _KeptCodeFiles(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_Place,)


class _KeptCode(FunctionCache):  # type: ignore[misc]
    """numba's cache of a function's compiled code, in our folder. What cannot be read or kept is compiled anew."""

    _impl_class = _KeptCodeFiles

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except (AttributeError, ImportError, EOFError, pickle.UnpicklingError):
            # The code names what is no longer there (a record of a module that this one never imports), or was cut off.
            try:
                self.flush()
            except OSError:
                self.disable()
        except OSError:
            pass  # the folder cannot be read: said when the code is to be kept
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError as error:
            self.disable()
            _tell(Path(self.cache_path).parent, error.strerror or str(error))

    @contextmanager
    def turn(self) -> Iterator[None]:
        """Hold the right to compile this function among all processes; another that wants to compile it waits."""
        try:
            self._impl.locator.ensure_cache_path()
            handle = os.open(Path(self.cache_path) / f"{self._impl.filename_base}.lock", os.O_CREAT | os.O_RDWR)
        except OSError:
            yield  # the folder cannot be written: said when the code is to be kept
            return
        try:
            with suppress(OSError):  # a file system without locks: then each compiles for itself
                fcntl.flock(handle, fcntl.LOCK_EX)
            yield
        finally:
            os.close(handle)  # which lets go of the lock, as the end of the process would


def _in_turn(compile_here: Callable[[Any], Any], cache: _KeptCode) -> Callable[[Any], Any]:
    """Let one process compile a function while others wait, who then load what it kept."""

    def compile_or_load(signature: Any) -> Any:
        # numba's own lock first: threads of this process must not wait for each other in two orders.
        with global_compiler_lock, cache.turn():
            return compile_here(signature)

    return compile_or_load


@lru_cache
def _tell(folder: Path, why: str) -> None:
    _log.warning(
        "%s: compiled code cannot be kept (%s), so every start compiles anew: make it writable, or name another folder "
        "with VICO_CACHE",
        folder,
        why,
    )
