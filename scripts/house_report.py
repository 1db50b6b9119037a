"""Count what makes the code hard to find one's way in: long functions, numbered slots, shared names, sideways imports.

    python scripts/house_report.py
    python scripts/house_report.py --source ../other/checkout/src/vico --list

Everything is read from the source as text; nothing of it is imported or run.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

SOURCE = Path(__file__).parents[1] / "src" / "vico"
Function = ast.FunctionDef | ast.AsyncFunctionDef
_BRANCHES = (ast.If, ast.For, ast.AsyncFor, ast.While, ast.ExceptHandler, ast.match_case)
_CONDITIONS = (ast.IfExp, ast.comprehension)
# Coordinates of a point are no magic: x, y and z (and a fourth, homogeneous one) are known by their place.
_COORDINATES = 3


def complexity(function: Function, *, operators: bool) -> int:
    """Return McCabe's number; with `operators`, ``and``, ``or`` and inner loops count too."""
    total = 1
    pending: list[ast.AST] = list(ast.iter_child_nodes(function))
    while pending:
        node = pending.pop()
        total += isinstance(node, _BRANCHES) or (operators and isinstance(node, _CONDITIONS))
        if isinstance(node, (ast.For, ast.While, ast.Try)) and node.orelse:
            total += 1
        if operators and isinstance(node, ast.BoolOp):
            total += len(node.values) - 1
        pending.extend(ast.iter_child_nodes(node))
    return total


def arguments(function: Function) -> int:
    """Return how many arguments a function takes, without ``self`` and ``cls``."""
    given = function.args
    names = [a.arg for a in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return len([name for name in names if name not in ("self", "cls")])


def functions(tree: ast.Module) -> Iterator[Function]:
    """Yield every function of a module, methods and inner ones too."""
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield node


def magic_indices(tree: ast.Module) -> Iterator[ast.Subscript]:
    """Yield subscripts with a literal index above `_COORDINATES`: slots that a reader would have to look up."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Subscript):
            continue
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        literals = [p.value for p in parts if isinstance(p, ast.Constant) and isinstance(p.value, int)]
        if any(value > _COORDINATES for value in literals):
            yield node


def public_classes(tree: ast.Module) -> list[str]:
    """Return the names of a module's public classes."""
    return [node.name for node in tree.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_")]


def stage_imports(source: Path, trees: dict[Path, ast.Module]) -> Counter[tuple[str, str]]:
    """Return how many names each stage of world generation imports from another stage."""
    worldgen = source / "worldgen"
    # Facades are dressed by the buildings' stage; where a checkout has no floor of facts yet, they were a stage too.
    libraries = {"facades"} if (worldgen / "facts").is_dir() else set()
    stages = ({p.parent.name for p in worldgen.glob("*/stage.py")} | {"photos", "streets", "facades"}) - libraries
    found: Counter[tuple[str, str]] = Counter()
    for path, tree in trees.items():
        if not path.is_relative_to(worldgen) or path.parent == worldgen:
            continue
        here = path.relative_to(worldgen).parts[0]
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("vico.worldgen."):
                there = str(node.module).split(".")[2]
                if here in stages and there in stages and there != here:
                    found[here, there] += len(node.names)
    return found


def circles(source: Path, trees: dict[Path, ast.Module]) -> list[str]:
    """Return the modules that import each other in a circle, as they are loaded (imports inside functions aside)."""
    names = {path: "vico." + ".".join(path.relative_to(source).with_suffix("").parts) for path in trees}
    names = {path: name.removesuffix(".__init__") for path, name in names.items()}
    known = set(names.values())
    graph: dict[str, set[str]] = defaultdict(set)
    for path, tree in trees.items():
        for node in tree.body:
            if isinstance(node, ast.ImportFrom) and node.module in known:
                inner = {f"{node.module}.{alias.name}" for alias in node.names} & known
                graph[names[path]] |= inner or {str(node.module)}
    done: set[str] = set()
    found: list[str] = []

    def visit(name: str, trail: list[str]) -> None:
        if name in trail:
            found.append(" -> ".join([*trail[trail.index(name) :], name]))
            return
        if name in done:
            return
        for other in sorted(graph[name]):
            visit(other, [*trail, name])
        done.add(name)

    sys.setrecursionlimit(10_000)
    for name in sorted(known):
        visit(name, [])
    return found


def undocumented_fields(source: Path, trees: dict[Path, ast.Module]) -> list[str]:
    """Return the fields of the simulation's array records that their class's docstring does not name."""
    missing = []
    for path, tree in trees.items():
        if not path.is_relative_to(source / "sim"):
            continue
        for node in ast.walk(tree):
            if not isinstance(node, ast.ClassDef):
                continue
            words = set(re.findall(r"\w+", ast.get_docstring(node) or ""))
            for field in node.body:
                if (
                    isinstance(field, ast.AnnAssign)
                    and isinstance(field.target, ast.Name)
                    and "NDArray" in ast.unparse(field.annotation)
                    and field.target.id not in words
                ):
                    missing.append(f"{node.name}.{field.target.id}")
    return missing


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--source", type=Path, default=SOURCE, help="the package's folder")
    parser.add_argument("--list", action="store_true", help="name what is counted, too")
    given = parser.parse_args()
    trees = {path: ast.parse(path.read_text()) for path in sorted(given.source.rglob("*.py"))}
    lines = {path: len(path.read_text().splitlines()) for path in trees}
    every = [(path, f) for path, tree in trees.items() for f in functions(tree)]
    branches = [(complexity(f, operators=False), f"{p.relative_to(given.source)}:{f.name}") for p, f in every]
    conditions = [(complexity(f, operators=True), f"{p.relative_to(given.source)}:{f.name}") for p, f in every]
    many = [(arguments(f), f"{p.relative_to(given.source)}:{f.name}") for p, f in every]
    magic = Counter(str(p.relative_to(given.source)) for p, tree in trees.items() for _ in magic_indices(tree))
    owners: dict[str, list[str]] = defaultdict(list)
    for path, tree in trees.items():
        for name in public_classes(tree):
            owners[name].append(str(path.relative_to(given.source)))
    shared = {name: paths for name, paths in owners.items() if len(paths) > 1}
    sideways = stage_imports(given.source, trees)
    missing = undocumented_fields(given.source, trees)
    rows: list[tuple[str, int, list[str]]] = [
        ("lines of Python", sum(lines.values()), []),
        ("modules", len(trees), []),
        ("modules over 300 lines", sum(n > 300 for n in lines.values()), []),
        ("modules over 500 lines", sum(n > 500 for n in lines.values()), _worst((n, str(p)) for p, n in lines.items())),
        ("functions over complexity 10", sum(n > 10 for n, _ in branches), []),
        ("functions over complexity 14", sum(n > 14 for n, _ in branches), _worst(branches)),
        ("functions over complexity 15, each and/or counted", sum(n > 15 for n, _ in conditions), _worst(conditions)),
        ("functions with more than 8 arguments", sum(n > 8 for n, _ in many), _worst(many)),
        ("literal indices above 3", sum(magic.values()), _worst((n, p) for p, n in magic.items())),
        ("public classes that share a name", len(shared), [f"{n}: {', '.join(p)}" for n, p in sorted(shared.items())]),
        ("pairs of stages that import from each other", len(sideways), [f"{a} <- {b}" for a, b in sorted(sideways)]),
        ("names they import", sum(sideways.values()), []),
        ("array fields of sim that no docstring names", len(missing), missing),
        ("circles of imports", len(circles(given.source, trees)), circles(given.source, trees)),
    ]
    width = max(len(title) for title, _, _ in rows)
    for title, number, named in rows:
        sys.stdout.write(f"{title:<{width}}  {number:>7,}\n")
        if given.list:
            sys.stdout.writelines(f"    {entry}\n" for entry in named)
    return 0


def _worst(counted: Iterator[tuple[int, str]] | list[tuple[int, str]], most: int = 12) -> list[str]:
    return [f"{number:>5}  {name}" for number, name in sorted(counted, reverse=True)[:most]]


if __name__ == "__main__":
    sys.exit(main())
