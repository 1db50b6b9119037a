"""Compiled functions, kept between runs in the cache folder and never used when stale.

numba's own cache lies beside the sources and judges a function by the file it stands in. That file is not all that went
into the machine code: functions called from other files are compiled into it, and so are constants and the fields of
records. After an update of a checkout such code would be old, or could not even be read: its index names classes that
are called otherwise by now. Here a module's compiled functions have a folder named after what the module and all that
it imports of its package say, so a changed source has a folder of its own, and one that is back has its old one.
Processes that start at once compile each function once: whoever comes second waits for what the first one keeps.

numba optimises each function by itself, with all that it calls linked in, and makes machine code of it, however deep it
lies below what Python calls. Most of our functions are called by compiled ones alone; one five calls deep was optimised
six times. Here such a function is only linked, and what Python calls is optimised whole, as a compiler of C does with a
file. Results are the same to the bit, but where `fastmath` leaves them open. Where loops come out slower for it, a
callee is optimised alone, too, which saves the machine code only.

Functions that only borrow arrays do not count references to them (`vico.io.references`).
"""

from __future__ import annotations

import fcntl
import gc
import hashlib
import importlib.metadata
import logging
import os
import pickle
import re
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numba
from numba.core import types
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import register_pass
from numba.core.environment import lookup_environment
from numba.core.registry import CPUDispatcher
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import NativeLowering
from numba.core.types.misc import unliteral
from numba.extending import overload
from numba.np import arrayobj

from vico.io.cache import cache_folder
from vico.io.references import only_borrows

_log = logging.getLogger(__name__)

_DAY = 86_400.0
_UNUSED = 30 * _DAY  # after this long a folder of compiled code goes
_KEPT = 8  # folders a module keeps: states of its sources between which one goes to and fro


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
    settings = {"nopython": True, "no_cfunc_wrapper": True, **options}
    return _Kernel(function, settings, _Callee(function, settings, optimised=optimised_alone))


def inlined(function: Any) -> Any:
    """Compile a function as `compiled` does, into each of its compiled callers.

    For what is called once or twice in a loop with many arrays, as tuples of them are: every field of every array is
    copied onto the stack for a call, which takes longer than much of what is done with them. Results are the same.
    """
    return compiled(function, forceinline=True)


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


class _Callee(CPUDispatcher):  # type: ignore[misc]
    """A compiled function as compiled functions call it; Python cannot.

    Parameters
    ----------
    function
        In Python.
    options
        Of ``numba.njit``.
    optimised
        Optimise it before it is linked, too.
    """

    def __init__(self, function: Any, options: dict[str, Any], *, optimised: bool = False) -> None:
        compiler = _OptimisedCalleeCompiler if optimised else _CalleeCompiler
        super().__init__(function, targetoptions={**options, "no_cpython_wrapper": True}, pipeline_class=compiler)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Compile for arguments of some types, once for all constants of a type: the caller's optimiser knows them."""
        return super().get_call_template(
            [unliteral(one) for one in args], {name: unliteral(one) for name, one in kws.items()}
        )

    def add_overload(self, cres: Any) -> None:
        """Keep what was compiled for arguments of some types; unlike numba's own, hidden from who calls from Python."""
        self.overloads[tuple(cres.signature.args)] = cres


def _refuse_slice(src_shapes: Any, index_shape: Any) -> None:
    """Say, in compiled code, that an array does not fit where it is to be put: without the shapes."""
    raise NotImplementedError


overload(_refuse_slice)(arrayobj.ol_raise_with_shape_context_generic)


@contextmanager
def _brief_refusals() -> Iterator[None]:
    """Let slices refuse briefly what does not fit: numba's message of shapes compiles half of what strings can do."""
    numbas, arrayobj.raise_with_shape_context = arrayobj.raise_with_shape_context, _refuse_slice
    try:
        yield
    finally:
        arrayobj.raise_with_shape_context = numbas


def _lower(run_pass: Any, state: Any) -> None:
    """Turn typed code into LLVM's, as `run_pass` of numba does it."""
    # Of its own: numba makes a context for each function.
    state.targetctx.enable_nrt = not only_borrows(state)
    with _brief_refusals():
        run_pass(state)


class _CalleeLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code of a function and all it calls, neither optimised nor loaded: callers link it."""

    def finalize(self) -> None:
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._optimise()
        self._finalized = True

    def _optimise(self) -> None:
        pass


class _OptimisedCalleeLibrary(_CalleeLibrary):
    """Code as numba would link it."""

    def _optimise(self) -> None:
        self._optimize_final_module()


@register_pass(mutates_CFG=True, analysis_only=False)
class _CalleeLowering(NativeLowering):  # type: ignore[misc]
    _name = "vico_callee_lowering"
    _library = _CalleeLibrary

    def run_pass(self, state: Any) -> bool:
        state.library = self._library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        _lower(super().run_pass, state)
        lowered = state["cr"]
        key = object()  # under which numba finds it; an address in memory otherwise
        state.targetctx.insert_user_function(key, lowered.fndesc, [state.library])
        state.reload_init.extend(state.library._reload_init)
        state["cr"] = lowered._replace(cfunc=key)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class _OptimisedCalleeLowering(_CalleeLowering):
    _name = "vico_optimised_callee_lowering"
    _library = _OptimisedCalleeLibrary


@register_pass(mutates_CFG=True, analysis_only=False)
class _KernelLowering(NativeLowering):  # type: ignore[misc]
    _name = "vico_kernel_lowering"

    def run_pass(self, state: Any) -> bool:
        _lower(super().run_pass, state)
        # Those of callees, too: they were not in memory when numba would have set them.
        for variable in state.library._final_module.global_variables:
            if variable.name.startswith("_ZN08NumbaEnv") and (environment := lookup_environment(variable.name)):
                state.library.codegen.set_env(variable.name, environment)
        return True


class _CalleeCompiler(CompilerBase):  # type: ignore[misc]
    def define_pipelines(self) -> list[Any]:
        return [_pipeline(self.state, _CalleeLowering)]


class _OptimisedCalleeCompiler(CompilerBase):  # type: ignore[misc]
    def define_pipelines(self) -> list[Any]:
        return [_pipeline(self.state, _OptimisedCalleeLowering)]


class _KernelCompiler(CompilerBase):  # type: ignore[misc]
    """numba's compiler for what Python calls, where what it calls is a `_Callee`."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        return [_pipeline(self.state, _KernelLowering)]


def _pipeline(state: Any, lowering: type) -> Any:
    """Return numba's own passes, but for the one that turns typed code into LLVM's."""
    # numba compiles its own functions (empty, min, sorts) anew for callers whose flags differ. Those that do not matter
    # to them are what they are in numba's own callers, so that each is compiled once a process.
    seen_by_callees = ConfigStack().top()
    for flag in ("release_gil", "no_cfunc_wrapper", "inline"):
        seen_by_callees.discard(flag)
    seen_by_callees.no_cpython_wrapper = True
    manager = DefaultPassBuilder.define_nopython_pipeline(state)
    manager.passes = [(lowering if one is NativeLowering else one, told) for one, told in manager.passes]
    manager.finalize()
    return manager


class _Kernel(CPUDispatcher):  # type: ignore[misc]
    """A compiled function as Python calls it. Other compiled functions see it as `_Callee`."""

    def __init__(self, function: Any, options: dict[str, Any], callee: _Callee) -> None:
        super().__init__(function, targetoptions=options, pipeline_class=_KernelCompiler)
        self._callee = callee
        self._cache = _KeptCode(function)  # what `cache=True` would set to numba's own

    @property
    def _numba_type_(self) -> Any:
        return types.Dispatcher(self._callee)

    def compile(self, sig: Any) -> Any:
        """Compile for arguments of some types, or load what another process compiled while this one waited."""
        # numba's own lock first: threads of this process must not wait for each other in two orders.
        with global_compiler_lock, self._cache.turn(), _rare_collections():
            return super().compile(sig)


@contextmanager
def _rare_collections() -> Iterator[None]:
    """Look for unreachable objects more rarely: a compiler makes millions, and an eighth of its time went into that."""
    usual = gc.get_threshold()
    gc.set_threshold(max(usual[0], 50_000), *usual[1:])
    try:
        yield
    finally:
        gc.set_threshold(*usual)


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


@lru_cache
def _tell(folder: Path, why: str) -> None:
    _log.warning(
        "%s: compiled code cannot be kept (%s), so every start compiles anew: make it writable, or name another folder "
        "with VICO_CACHE",
        folder,
        why,
    )
