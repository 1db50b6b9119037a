"""Scripts, benchmarks and examples import modules and names that exist: no test runs all of them."""

import ast
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = sorted(path for folder in ("scripts", "benchmarks", "examples") for path in (ROOT / folder).rglob("*.py"))


@cache
def names_of(module: str) -> frozenset[str]:
    """Return the names that a module of ours binds, and the modules below it; empty if there is no such module."""
    place = ROOT / "src" / module.replace(".", "/")
    path = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    if not path.exists():
        return frozenset()
    found = {"__doc__"} | {inner.stem for inner in place.iterdir()} if place.is_dir() else {"__doc__"}
    body = ast.parse(path.read_text(encoding="utf-8")).body
    is_lazy = any(isinstance(node, ast.FunctionDef) and node.name == "__getattr__" for node in body)
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.ImportFrom | ast.Import):
            found.update(alias.asname or alias.name for alias in node.names)
        else:
            inner = list(ast.walk(node))
            found.update(one.id for one in inner if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store))
            if is_lazy:  # the package's table of names that are looked up when they are first asked for
                found.update(one.value for one in inner if isinstance(one, ast.Constant) and isinstance(one.value, str))
    return frozenset(found)


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_what_a_program_imports_is_there(path: Path) -> None:
    missing = [
        f"{path.name}:{node.lineno}: {node.module}.{alias.name}"
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "vico"
        for alias in node.names
        if alias.name not in names_of(node.module or "")
    ]
    assert missing == []
