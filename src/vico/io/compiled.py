"""Compiled functions: numba's dispatchers, with machine code kept in the cache folder and never used when stale.

numba's own cache checks the file of a function. A changed comment in it compiles everything anew. A changed function,
constant or record of another file, which is part of the machine code, goes unnoticed. Here the name of kept code is a
digest of its content (`vico.io.kernel_digest`): the function, the functions that it calls, the values of constants, and
the fields of records. No other change compiles anything.

Processes that start together compile each function once: the second process waits, and loads the first one's code.

Called functions are linked into their compiled callers and optimised there, once (`vico.io.linking`). Functions that
only borrow arrays do not count references to them (`vico.io.references`).
"""

from __future__ import annotations

import fcntl
import gc
import logging
import os
import pickle
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numba
from numba.core.compiler_lock import global_compiler_lock

from vico.io.cache import cache_folder
from vico.io.kernel_digest import UnknownPartError, kernel_digest
from vico.io.linking import CalleeCompiler, KernelCompiler, OptimisedCalleeCompiler

_log = logging.getLogger(__name__)

_DAY = 86_400.0
_UNUSED = 30 * _DAY  # after this long compiled code goes


def compiled(function: Any = None, /, *, optimised_alone: bool = False, **options: Any) -> Any:
    """Compile a function with numba when it is first called, or load what an earlier run compiled.

    Parameters
    ----------
    function
        What to compile; left out where options are given: ``@compiled`` or ``@compiled(nogil=True)``.
    optimised_alone
        Optimise it before it is linked into compiled callers, too. Takes longer to compile; loops may be better for it.
    options
        Of ``numba.njit``, but `cache`.

    Returns
    -------
    object
        numba's dispatcher, or a decorator that makes one.
    """
    if function is None:
        return lambda given: compiled(given, optimised_alone=optimised_alone, **options)
    if numba.config.DISABLE_JIT:
        return function
    settings = {"no_cfunc_wrapper": True, **options}
    for_callers = OptimisedCalleeCompiler if optimised_alone else CalleeCompiler
    callee = numba.njit(**settings, no_cpython_wrapper=True, pipeline_class=for_callers)(function)
    callee.compile = _for_types(callee.compile)
    callee.add_overload = lambda made: callee.overloads.update({tuple(made.signature.args): made})  # hidden from Python
    kernel = numba.njit(**settings, pipeline_class=KernelCompiler)(function)
    # What numba asks of it for a call in compiled code, and before it is first called with arguments of some types.
    kernel.get_call_template, kernel.get_overload = callee.get_call_template, callee.get_overload
    kernel.compile = _for_types(_Compilation(kernel))
    return kernel


def _for_types(compile_or_load: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Let code be made once for all constants of a type: the optimiser knows them where it matters."""

    def compile_once(signature: Any) -> Any:
        if isinstance(signature, tuple):
            signature = tuple(numba.types.unliteral(one) for one in signature)
        return compile_or_load(signature)

    return compile_once


def inlined(function: Any) -> Any:
    """Compile a function as `compiled` does, into each of its compiled callers.

    It is for functions that a loop calls with many arrays, such as tuples of arrays: a call copies every field of every
    array onto the stack, which often takes longer than the function itself. Results are the same.
    """
    return compiled(function, forceinline=True)


def compiled_folder() -> Path:
    """Return where compiled code is kept: ``$NUMBA_CACHE_DIR``, else `compiled` in the cache folder."""
    return Path(numba.config.CACHE_DIR or cache_folder() / "compiled")


class _Compilation:
    """Compiles a kernel for arguments of some types, or loads its kept code."""

    def __init__(self, kernel: Any) -> None:
        self._kernel = kernel
        self._make: Callable[[Any], Any] = kernel.compile

    def __call__(self, signature: Any) -> Any:
        """Compile for arguments of some types, or load what was kept."""
        # numba's own lock first: threads of this process must not wait for each other in two orders.
        with global_compiler_lock:
            try:
                place = KernelFolder(self._kernel.py_func, kernel_digest(self._kernel, signature))
            except UnknownPartError as error:
                _log.warning("%s: compiled anew at each start: %s", self._kernel.__qualname__, error)
                return self._make(signature)
            with place.turn() as can_be_kept, _rare_collections():
                return self._kept(place, signature) if can_be_kept else self._make(signature)

    def _kept(self, place: KernelFolder, types: Any) -> Any:
        place.use_for(self._kernel)
        try:
            return self._make(types)
        except (AttributeError, ImportError, EOFError, pickle.UnpicklingError):
            # Cut off, or it names what is no longer there. An error of the compiler's own comes again.
            if not place.remove():
                raise
        except OSError as error:
            if (made := self._kernel.overloads.get(types)) is None:
                raise
            _tell(place.folder, error.strerror or str(error))
            return made.entry_point
        return self._make(types)


class KernelFolder:
    """Place of the code of one kernel for arguments of some types: a cache locator of numba.

    Parameters
    ----------
    function
        In Python.
    digest
        Of all that the code is made from.
    """

    _chosen: KernelFolder | None = None  # for the kernel that is being given a cache

    def __init__(self, function: Any, digest: str) -> None:
        self._digest = digest
        self._name = f"{function.__qualname__.replace('<', '').replace('>', '')}-{digest}"
        self.folder = compiled_folder() / function.__module__

    @classmethod
    def from_function(cls, function: Any, file: str) -> KernelFolder | None:
        """Return the place chosen for a function."""
        return cls._chosen

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(self.folder)

    def get_source_stamp(self) -> str:
        """Return the stamp that kept code must bear to be used."""
        return self._digest

    def get_disambiguator(self) -> str:
        """Return the text that distinguishes this code from other code of the same function."""
        return self._digest

    def ensure_cache_path(self) -> None:
        """Make the folder."""
        self.folder.mkdir(parents=True, exist_ok=True)

    def use_for(self, kernel: Any) -> None:
        """Let numba look here for a kernel's code, and keep it here. Within numba's lock."""
        chosen_before, named_before = KernelFolder._chosen, numba.config.CACHE_LOCATOR_CLASSES
        KernelFolder._chosen, numba.config.CACHE_LOCATOR_CLASSES = self, f"{__name__}.{KernelFolder.__name__}"
        try:
            kernel.enable_caching()
        finally:
            KernelFolder._chosen, numba.config.CACHE_LOCATOR_CLASSES = chosen_before, named_before

    def remove(self) -> bool:
        """Remove the code; return whether there was any."""
        there = self._files()
        for file in there:
            with suppress(OSError):
                file.unlink()
        return bool(there)

    def _files(self) -> list[Path]:
        return [file for file in self.folder.glob("*.nb?") if f"-{self._digest}." in file.name]

    @contextmanager
    def turn(self) -> Iterator[bool]:
        """Hold the lock for making this code; yield whether code can be kept here, or is here already.

        Another process that needs the code waits for the lock, and then loads the code.
        """
        try:
            if not self.folder.is_dir():
                self.ensure_cache_path()
            lock = self.folder / f"{self._digest}.lock"
            new = not lock.exists()
            handle = os.open(lock, os.O_CREAT | os.O_RDWR, 0o666)
        except OSError as error:
            there = bool(self._files())  # in a folder that is only to be read
            if not there:
                _tell(self.folder, error.strerror or str(error))
            yield there
            return
        try:
            if new:
                _sweep(self.folder)
            elif os.fstat(handle).st_mtime < time.time() - _DAY:
                for file in (lock, *self._files()):
                    with suppress(OSError):
                        os.utime(file)
            with suppress(OSError):  # a file system without locks: then each compiles for itself
                fcntl.flock(handle, fcntl.LOCK_EX)
            yield True
        finally:
            os.close(handle)  # which lets go of the lock, as the end of the process would


@contextmanager
def _rare_collections() -> Iterator[None]:
    """Run the garbage collector more rarely: it took an eighth of the time of compiling, which makes many objects."""
    usual = gc.get_threshold()
    gc.set_threshold(max(usual[0], 50_000), *usual[1:])
    try:
        yield
    finally:
        gc.set_threshold(*usual)


@cache
def _sweep(folder: Path) -> None:
    """Remove files that were not used for long; once in a process."""
    for file in folder.iterdir():
        with suppress(OSError):
            if file.stat().st_mtime < time.time() - _UNUSED:
                file.unlink()


@lru_cache
def _tell(folder: Path, why: str) -> None:
    _log.warning(
        "%s: compiled code cannot be kept (%s), so every start compiles anew: make it writable, or name another folder "
        "with VICO_CACHE",
        folder.parent,
        why,
    )
