"""Compiled functions that need no reference counts for arrays: those that only borrow them.

In every function numba counts who refers to each array, one atomic operation for each array of each tuple that is
handed on, and takes out again what it can see through. In kernels that hand tuples of dozens of arrays from rule to
rule, that was a fifth of all time. A function that is handed arrays, looks at them and writes into them, and returns
numbers alone need not count: whoever called it refers to them until it has returned.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.core import ir, types

# What makes one array of another, without memory of its own: it lives as long as that one.
_VIEWS = frozenset(
    {"getattr", "getitem", "static_getitem", "getiter", "iternext", "pair_first", "pair_second", "exhaust_iter"}
    | {"build_tuple", "cast", "phi"}
)


def only_borrows(state: Any) -> bool:
    """Return whether a function refers to no array beyond those it is called with, and returns none.

    Parameters
    ----------
    state
        Of numba's compiler, types known.

    Returns
    -------
    bool
        False where in doubt: then its references are counted.
    """
    models, typemap = state.targetctx.data_model_manager, state.typemap

    def refers(kind: types.Type) -> bool:
        return bool(models[kind].contains_nrt_meminfo())

    statements = [one for block in state.func_ir.blocks.values() for one in block.body]
    return not refers(state.return_type) and all(_borrows(one, typemap, refers) for one in statements)


def _borrows(statement: Any, typemap: dict[str, types.Type], refers: Callable[[types.Type], bool]) -> bool:
    """Return whether nothing is referred to after a statement that was not before; `refers`: whether a type may."""
    if isinstance(statement, ir.Assign):
        return not refers(typemap[statement.target.name]) or _is_view(statement.value, typemap)
    if isinstance(statement, ir.SetItem | ir.StaticSetItem):
        # What overlaps is copied before.
        return not refers(typemap[statement.value.name]) and not _picks(statement.index, typemap)
    if isinstance(statement, ir.SetAttr):
        return not refers(typemap[statement.value.name]) and not refers(typemap[statement.target.name])
    return True


def _is_view(value: Any, typemap: dict[str, types.Type]) -> bool:
    """Return whether a value is made without memory of its own."""
    if isinstance(value, ir.Expr):
        return value.op in _VIEWS and not (value.op == "getitem" and _picks(value.index, typemap))
    return isinstance(value, ir.Var | ir.Arg | ir.Global | ir.FreeVar | ir.Const)


def _picks(index: Any, typemap: dict[str, types.Type]) -> bool:
    """Return whether an index may be one of arrays, which pick elements one by one."""
    kind = typemap[index.name] if isinstance(index, ir.Var) else None
    members = getattr(kind, "types", (kind,))  # of a tuple
    return any(isinstance(one, types.Array) for one in members)
