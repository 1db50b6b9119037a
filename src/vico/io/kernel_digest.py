"""Digest of the content of a compiled function: all that its machine code is made from.

Machine code depends on the function's bytecode, on the bytecode of each function that it calls, on the values of the
module constants that any of them uses, and on the types of the arguments with the fields of their records. Python
itself gives all of these. Comments, line numbers and docstrings play no part.
"""

from __future__ import annotations

import enum
import hashlib
import importlib.metadata
import sys
from collections.abc import Callable, Iterable
from functools import cache, lru_cache
from opcode import opmap
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, MethodDescriptorType, ModuleType
from typing import Any

import numba
import numpy as np

_PLAIN = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis), range, slice)


class UnknownPartError(TypeError):
    """A kernel uses something that the digest cannot describe, so that kept code could be stale."""


def kernel_digest(kernel: Any, arguments: Any) -> str:
    """Return a digest of all that goes into a kernel's code.

    Parameters
    ----------
    kernel
        What ``numba.njit`` makes.
    arguments
        Types of numba, which the code is for.

    Returns
    -------
    str
        24 hexadecimal digits.

    Raises
    ------
    UnknownPartError
        If it refers to something that cannot be described.
    """
    parts = _Parts()
    parts.add(_versions())
    parts.add_value(kernel)
    parts.add_type(arguments)
    return parts.digest()


@lru_cache
def _versions() -> str:
    """Return the versions of the compilers, and a digest of the modules that link code."""
    made_by = [f"{name} {importlib.metadata.version(name)}" for name in ("numba", "llvmlite", "numpy")]
    rules = [Path(__file__).with_name(name).read_bytes() for name in ("linking.py", "references.py")]
    return f"{sys.version} {made_by} {hashlib.sha256(b''.join(rules)).hexdigest()}"


class _Parts:
    """A digest in the making; a function or class that comes again is named by its number."""

    def __init__(self) -> None:
        self._whole = hashlib.sha256()
        self._seen: dict[Any, int] = {}

    def digest(self) -> str:
        """Return a digest of all."""
        return self._whole.hexdigest()[:24]

    def add(self, *texts: str | bytes) -> None:
        """Add texts."""
        for text in texts:
            data = text.encode() if isinstance(text, str) else text
            self._whole.update(len(data).to_bytes(8, "little") + data)

    def add_value(self, value: Any) -> None:
        """Add the value of a name."""
        if type(value) in _PLAIN:
            self.add(type(value).__name__, repr(value))
        elif isinstance(function := getattr(value, "py_func", None), FunctionType):
            self.add("kernel")
            self.add_value(sorted(value.targetoptions.items()))
            self._add_function(function)
        else:
            for kind, describe in self._KINDS:
                if isinstance(value, kind):
                    describe(self, value)
                    return
            if not (_is_foreign(type(value)) and isinstance(name := getattr(value, "__name__", None), str)):
                raise UnknownPartError(f"what is a {type(value).__module__}.{type(value).__qualname__} to its code?")
            self.add("foreign", str(value.__module__), name)

    def add_type(self, kind: Any) -> None:
        """Add a type of numba, a tuple of types or a signature."""
        if isinstance(kind, tuple | list):
            self.add(f"{len(kind)} types")
            for one in kind:
                self.add_type(one)
            return
        self.add(type(kind).__name__)
        if (dispatcher := getattr(kind, "dispatcher", None)) is not None:
            self.add_value(dispatcher)
            return
        self.add(str(kind))
        if isinstance(kind, numba.types.BaseTuple):
            self.add_type(tuple(kind))
        if (made_by := getattr(kind, "instance_class", None)) is not None:
            self.add_value(made_by)
        if isinstance(kind, numba.types.Record):
            for name in kind.fields:
                self.add(name, str(kind.offset(name)))
                self.add_type(kind.typeof(name))
        for part in ("dtype", "yield_type", "return_type", "args", "type"):
            inner = getattr(kind, part, None)
            if inner is not kind and isinstance(inner, numba.types.Type | tuple):
                self.add_type(inner)

    def _comes_again(self, thing: Any) -> bool:
        number = self._seen.setdefault(thing, len(self._seen))
        self.add(str(number))
        return number < len(self._seen) - 1

    def _add_function(self, function: FunctionType) -> None:
        if self._comes_again(function):
            return
        self.add(function.__module__, function.__qualname__)
        self.add_value(function.__defaults__)
        self.add_value(sorted((function.__kwdefaults__ or {}).items()))
        self.add_value(tuple(cell.cell_contents for cell in function.__closure__ or ()))
        consts = function.__code__.co_consts
        documented = bool(consts) and isinstance(consts[0], str) and consts[0] == function.__doc__
        said, looked_up, names = _code(function.__code__, documented)
        self.add(said)
        for name in looked_up:
            if name in function.__globals__:
                self.add(name)
                value = function.__globals__[name]
                self._add_module(value, names) if isinstance(value, ModuleType) else self.add_value(value)

    def _add_module(self, module: ModuleType, names: Iterable[str]) -> None:
        """Add all of a module that bears a name which the function uses."""
        self.add("module", module.__name__)
        if _is_foreign_name(module.__name__):
            return
        for name in names:
            if name in vars(module):
                self.add(name)
                value = vars(module)[name]
                self._add_module(value, names) if isinstance(value, ModuleType) else self.add_value(value)

    def _add_class(self, kind: type) -> None:
        self.add("class", kind.__module__, kind.__qualname__)
        if self._comes_again(kind) or _is_foreign(kind) or issubclass(kind, BaseException):
            return
        if issubclass(kind, tuple) and hasattr(kind, "_fields"):
            self.add(repr(kind._fields))
            self.add_value(sorted(getattr(kind, "_field_defaults", {}).items()))
        elif issubclass(kind, enum.Enum):
            for name, member in kind.__members__.items():
                self.add(name)
                self.add_value(member.value)
        else:
            raise UnknownPartError(f"what is class {kind.__module__}.{kind.__qualname__} to its code?")

    def _add_sequence(self, values: tuple[Any, ...] | list[Any]) -> None:
        if type(values) is not tuple and type(values) is not list:
            self.add_value(type(values))
        self.add(f"{len(values)} values")
        for value in values:
            self.add_value(value)

    def _add_set(self, values: frozenset[Any]) -> None:
        self.add_value(sorted(values, key=repr))

    def _add_mapping(self, values: dict[Any, Any]) -> None:
        self._add_sequence(list(values.items()))

    def _add_member(self, member: enum.Enum) -> None:
        self.add("member", member.name)
        self.add_value(type(member))

    def _add_array(self, array: Any) -> None:
        self._add_dtype(array.dtype)
        self.add(repr(array.shape), repr(array.strides), array.tobytes())

    def _add_scalar(self, value: Any) -> None:
        self._add_dtype(value.dtype)
        self.add(value.tobytes())

    def _add_dtype(self, dtype: Any) -> None:
        self.add("dtype", repr(dtype), str(dtype.itemsize), repr(sorted((dtype.fields or {}).items())))

    def _add_named(self, function: Any) -> None:
        self.add("function", str(getattr(function, "__module__", "")), function.__name__)

    def _add_python(self, function: FunctionType) -> None:
        """Add a plain function: by name if numba has its own version of it, else by its code."""
        self._add_named(function) if _is_foreign(function) else self._add_function(function)

    def _add_numba_type(self, kind: Any) -> None:
        self.add("numba", str(kind))

    _KINDS: tuple[tuple[Any, Callable[[_Parts, Any], None]], ...] = (
        (enum.Enum, _add_member),
        (np.ndarray, _add_array),
        (np.generic, _add_scalar),
        (np.dtype, _add_dtype),
        (tuple | list, _add_sequence),
        (frozenset | set, _add_set),
        (dict, _add_mapping),
        (type, _add_class),
        (FunctionType, _add_python),
        (BuiltinFunctionType | MethodDescriptorType | np.ufunc, _add_named),
        (numba.types.Type, _add_numba_type),
    )


@cache
def _code(code: CodeType, documented: bool = False) -> tuple[bytes, tuple[str, ...], tuple[str, ...]]:
    """Return a digest of a function's bytecode, the names it looks up in its module, and all names it uses."""
    said = _Parts()
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags)
    names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    said.add(code.co_code, code.co_exceptiontable, repr(counts), repr(names))
    looked_up, used = set(names_looked_up(code)), set(code.co_names)
    for place, constant in enumerate(code.co_consts):
        if isinstance(constant, CodeType):
            inner, inner_looked_up, inner_used = _code(constant)
            said.add(inner)
            looked_up |= set(inner_looked_up)
            used |= set(inner_used)
        else:
            said.add_value(None if documented and place == 0 else constant)
    return said.digest().encode(), tuple(sorted(looked_up)), tuple(sorted(used))


_LOAD_GLOBAL, _EXTENDED = opmap["LOAD_GLOBAL"], opmap["EXTENDED_ARG"]


def names_looked_up(code: CodeType) -> list[str]:
    """Return the names that a function, not those within it, looks up in its module; faster than `dis`."""
    found, extended = [], 0
    said = code.co_code
    for place in range(0, len(said), 2):
        step, argument = said[place], said[place + 1] | extended
        extended = argument << 8 if step == _EXTENDED else 0
        if step == _LOAD_GLOBAL:
            found.append(code.co_names[argument >> 1])
    return found


def _is_foreign(thing: Any) -> bool:
    """Return whether something comes with Python, numpy or numba, whose versions are in each digest."""
    return _is_foreign_name(str(thing.__module__))


def _is_foreign_name(module: str) -> bool:
    return module.partition(".")[0] in _FOREIGN


_FOREIGN = frozenset({"builtins", "math", "cmath", "numpy", "numba", "typing", "operator", "collections"})
