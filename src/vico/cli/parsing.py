"""How words of the command line become values, and what is said of those that can't."""

from __future__ import annotations

import difflib
import types
from collections.abc import Mapping, Sequence
from typing import Any, Union, get_args

from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from vico.errors import InputError

#: Reads numbers with our own words for what is none, and options that may be left out without "None" in their help.
REGISTRY = ConstructorRegistry()
_LEFT_OUT = "unset"


@REGISTRY.primitive_rule
def _numbers(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    if info.type not in (int, float):
        return None
    kind, words, example = (int, "whole number", "300") if info.type is int else (float, "number", "0.5")

    def read(given: list[str]) -> int | float:
        try:
            return kind(given[0])
        except ValueError:
            raise ValueError(f"{given[0]!r} is no {words}; give one such as {example}") from None

    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=kind.__name__.upper(),
        instance_from_str=read,
        is_instance=lambda value: isinstance(value, kind) or (kind is float and isinstance(value, int)),
        str_from_instance=lambda value: [str(value)],
    )


@REGISTRY.primitive_rule
def _optional(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    kinds = get_args(info.type)
    if info.type_origin not in (Union, types.UnionType) or len(kinds) != 2 or type(None) not in kinds:
        return None
    inner = next(kind for kind in kinds if kind is not type(None))
    spec = ConstructorRegistry.get_primitive_spec(PrimitiveTypeInfo.make(inner, info.markers))
    if not isinstance(spec, PrimitiveConstructorSpec):
        return None
    return PrimitiveConstructorSpec(
        nargs=spec.nargs,
        metavar=spec.metavar,
        instance_from_str=spec.instance_from_str,
        is_instance=lambda value: True if value is None else spec.is_instance(value),
        str_from_instance=lambda value: [_LEFT_OUT] if value is None else spec.str_from_instance(value),
        choices=spec.choices,
    )


def check_verb(given: Sequence[str], verbs: Mapping[str, Sequence[str]]) -> None:
    """Make sure that the words before the options are a verb.

    Parameters
    ----------
    verbs
        By the first word, what may come after it; empty where that is up to the verb.

    Raises
    ------
    InputError
        If they are not; the verb that is nearest is named.
    """
    if not given or given[0].startswith("-"):
        return
    first, *rest = given
    if first not in verbs:
        _refuse(first, "", verbs)
    second = rest[0] if rest else ""
    if verbs[first] and second and not second.startswith("-") and second not in verbs[first]:
        _refuse(second, f"{first} ", verbs[first])


def _refuse(word: str, before: str, known: Sequence[str] | Mapping[str, Any]) -> None:
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.55)
    # "build" is a verb of several things, and none by itself.
    meant = f"did you mean vico {before}{near[0]}?" if near else f"there are {', '.join(known)}"
    raise InputError(f"no verb {before + word!r}; {meant}")
