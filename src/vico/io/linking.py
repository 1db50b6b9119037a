"""Linking of compiled functions that call each other into one piece of machine code, optimised once.

numba optimises each function by itself, with all that it calls linked in, and makes machine code of it, however deep it
lies below what Python calls. Most of our functions are called by compiled ones alone; one five calls deep was optimised
six times. Here such a function is only linked, and what Python calls is optimised whole, as a compiler of C does with a
file. Results are the same to the bit, but where `fastmath` leaves them open. Where loops come out slower for it, a
callee is optimised alone, too, which saves the machine code only.

It is done with what numba has for compilers of one's own: `njit`'s `pipeline_class`, and a pass in place of one of
numba's. What a pass may be and do is numba's, so this is the one module that another numba may ask to be looked at.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.environment import lookup_environment
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import NativeLowering
from numba.extending import overload
from numba.np import arrayobj

from vico.io.references import only_borrows


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


class CalleeCompiler(CompilerBase):  # type: ignore[misc]
    """Compiles what compiled functions call, to be linked; Python must not call it."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        return [_pipeline(self.state, _CalleeLowering)]


class OptimisedCalleeCompiler(CompilerBase):  # type: ignore[misc]
    """Compiles what compiled functions call, optimised before it is linked."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        return [_pipeline(self.state, _OptimisedCalleeLowering)]


class KernelCompiler(CompilerBase):  # type: ignore[misc]
    """Compiles what Python calls, where what it calls is compiled to be linked."""

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
