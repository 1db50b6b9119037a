"""Count what makes code hard to find one's way in: many small modules, helpers that are called once, packed parameters.

    python scripts/house_report.py
    python scripts/house_report.py --source ../other/checkout/src/vico --list

Everything is read from the source as text; nothing of it is imported or run. The counts point to places to read.
"""

from __future__ import annotations

import argparse
import ast
import io
import re
import statistics
import sys
import tokenize
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

SOURCE = Path(__file__).parents[1] / "src" / "vico"
Function = ast.FunctionDef | ast.AsyncFunctionDef
_MOST_NAMED = 20
# Coordinates of a point are no magic: x, y and z (and a fourth, homogeneous one) are known by their place.
_COORDINATES = 3
# A tuple parameter that is unpacked into so many names should be a record.
_PACKED = 5
_COMPILED = frozenset({"compiled", "njit", "jit", "vectorize", "guvectorize"})
_BARE_TOKENS = frozenset(
    {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENCODING,
     tokenize.ENDMARKER}
)  # fmt: skip
# Participles that do not end in -ed, and nouns and verbs that do.
_PARTICIPLES = frozenset(
    ["begun", "bent", "bound", "bought", "brought", "built", "caught", "chosen", "done", "drawn", "driven",
     "fallen", "felt", "fitted", "forgotten", "found", "given", "gone", "grown", "heard", "held", "hidden",
     "kept", "known", "laid", "led", "left", "lent", "lit", "lost", "made", "meant", "met", "paid", "ridden",
     "risen", "said", "seen", "sent", "shown", "shut", "spent", "spoken", "stood", "stuck", "taken", "taught",
     "told", "torn", "thrown", "understood", "won", "worn", "written"]
)  # fmt: skip
_NO_PARTICIPLES = frozenset(["bed", "embed", "feed", "need", "red", "seed", "shed", "speed", "weed"])


@dataclass(frozen=True)
class Module:
    """A file of Python, as text and parsed."""

    path: Path
    name: str
    text: str
    tree: ast.Module

    @cached_property
    def functions(self) -> list[Function]:
        """Every function, methods and inner ones too."""
        return [node for node in ast.walk(self.tree) if isinstance(node, Function)]

    @cached_property
    def code_lines(self) -> int:
        """How many lines hold code: no blank lines, comments or docstrings."""
        lines: set[int] = set()
        for token in tokenize.generate_tokens(io.StringIO(self.text).readline):
            if token.type not in _BARE_TOKENS:
                lines.update(range(token.start[0], token.end[0] + 1))
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Module | ast.ClassDef | Function) and node.body and _is_docstring(node.body[0]):
                lines.difference_update(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
        return len(lines)

    @property
    def import_lines(self) -> int:
        """How many lines import."""
        return sum(
            (node.end_lineno or node.lineno) - node.lineno + 1
            for node in ast.walk(self.tree)
            if isinstance(node, ast.Import | ast.ImportFrom)
        )


@dataclass
class Measure:
    """A count, what it counts, and the places where it is worst."""

    title: str
    value: float
    places: Sequence[str] = field(default_factory=list)


def read_modules(source: Path) -> list[Module]:
    """Read the modules of a package; files with nothing but a docstring are none."""
    found = []
    for path in sorted(source.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        tree = ast.parse(text)
        if any(not _is_docstring(node) for node in tree.body):
            name = ".".join((source.name, *path.relative_to(source).with_suffix("").parts))
            found.append(Module(path, name.removesuffix(".__init__"), text, tree))
    return found


def measures(source: Path) -> list[Measure]:
    """Count everything in a package's folder."""
    modules = read_modules(source)
    every = [(module, function) for module in modules for function in module.functions]
    lines, code = sum(m.text.count("\n") for m in modules), sum(m.code_lines for m in modules)
    once = called_once(modules)
    top = sum(isinstance(node, Function) for module in modules for node in module.tree.body)
    importers = imported_by(modules)
    single = [name for name, others in importers.items() if len(others) == 1]
    protocols = implementers(modules)
    participles = [f"{module.name}.{f.name}" for module, f in every if is_participle(f.name)]
    packed = [f"{module.name}.{f.name}" for module, f in every if unpacks_parameter(f)]
    slots = Counter(module.name for module in modules for _ in numbered_slots(module.tree))
    numbers = [f"{module.name}:{node.lineno}" for module in modules for node in packed_numbers(module.tree)]
    circles = circles_of(modules)
    root = [module.name for module in modules if module.path.parent == source / "sim"]
    return [
        Measure("modules", len(modules)),
        Measure("lines of Python", lines),
        Measure("lines of code", code),
        Measure("median lines of a module", statistics.median(module.text.count("\n") for module in modules)),
        Measure("functions", len(every)),
        Measure("code lines a function", round(code / len(every), 1)),
        Measure("module-level functions called once, %", round(100 * len(once) / top, 1), once),
        Measure("import lines, % of all", round(100 * sum(m.import_lines for m in modules) / lines, 1)),
        Measure("modules that one other imports", len(single), single),
        Measure("protocols", len(protocols)),
        Measure("protocols with one implementer", *_where(protocols, 1)),
        Measure(f"functions that unpack a parameter into {_PACKED} names or more", len(packed), packed),
        Measure("numbered slots: literal indices above 3", slots.total(), _worst(slots)),
        Measure("lines that assign three bare numbers or more", len(numbers), numbers),
        Measure("functions named by a bare participle", len(participles), participles),
        Measure("of these public", sum(not name.split(".")[-1].startswith("_") for name in participles)),
        Measure("compiled functions", sum(is_compiled(function) for _, function in every)),
        Measure("comments that switch a type check off", *_switched_off(modules)),
        Measure("modules in the root of sim/", len(root), root),
        Measure("circles of imports", len(circles), circles),
    ]


def called_once(modules: Sequence[Module]) -> list[str]:
    """Return the module-level functions that one place alone refers to, by module and name.

    Names are looked up as Python would: a private one in its own module, a public one there and where it is imported.
    """
    used: dict[tuple[str, str], int] = Counter()
    for module in modules:
        origin = {node.name: (module.name, node.name) for node in module.tree.body if isinstance(node, Function)}
        for node in ast.walk(module.tree):
            if isinstance(node, ast.ImportFrom) and node.module is not None:
                origin |= {alias.asname or alias.name: (node.module, alias.name) for alias in node.names}
        aliases = {name: f"{module_}.{own}" for name, (module_, own) in origin.items()}
        for node in ast.walk(module.tree):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id in origin:
                used[origin[node.id]] += 1
            elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in aliases:
                used[aliases[node.value.id], node.attr] += 1
    return [
        f"{module.name}.{node.name}"
        for module in modules
        for node in module.tree.body
        if isinstance(node, Function) and used[module.name, node.name] == 1
    ]


def imported_by(modules: Sequence[Module]) -> Mapping[str, set[str]]:
    """Return which modules import each."""
    names = {module.name for module in modules}
    found: dict[str, set[str]] = defaultdict(set)
    for module in modules:
        for node in ast.walk(module.tree):
            if isinstance(node, ast.ImportFrom) and node.module is not None:
                for name in {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)} & names:
                    found[name].add(module.name)
    return found


def implementers(modules: Sequence[Module]) -> dict[str, list[str]]:
    """Return, for each protocol, the classes that have all its members."""
    members: dict[str, set[str]] = {}
    classes: list[tuple[str, set[str]]] = []
    for module in modules:
        for node in ast.walk(module.tree):
            if not isinstance(node, ast.ClassDef):
                continue
            name = f"{module.name}.{node.name}"
            if any(ast.unparse(base).split("[")[0].split(".")[-1] == "Protocol" for base in node.bases):
                members[name] = _members(node)
            else:
                classes.append((name, _members(node)))
    return {name: [one for one, own in classes if has <= own] for name, has in members.items() if has}


def unpacks_parameter(function: Function) -> bool:
    """Whether a function takes a tuple apart that it was given as one parameter."""
    parameters = {one.arg for one in (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)}
    return any(
        isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Tuple)
        and len(node.targets[0].elts) >= _PACKED
        and isinstance(node.value, ast.Name)
        and node.value.id in parameters
        for node in ast.walk(function)
    )


def numbered_slots(tree: ast.Module) -> Iterator[ast.Subscript]:
    """Yield subscripts with a literal above `_COORDINATES`, also ``[19 + k]``: slots that a reader has to look up."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript):
            parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            parts = [side for part in parts for side in ([part.left, part.right] if _is_sum(part) else [part])]
            literals = [p.value for p in parts if isinstance(p, ast.Constant) and isinstance(p.value, int)]
            if any(value > _COORDINATES for value in literals):
                yield node


def packed_numbers(tree: ast.Module) -> Iterator[ast.Assign]:
    """Yield assignments at the level of a module of three bare numbers or more to as many names."""
    for node in tree.body:
        if (
            isinstance(node, ast.Assign)
            and isinstance(node.targets[0], ast.Tuple)
            and isinstance(node.value, ast.Tuple)
        ):
            bare = [one.operand if isinstance(one, ast.UnaryOp) else one for one in node.value.elts]
            if sum(isinstance(one, ast.Constant) and isinstance(one.value, int | float) for one in bare) >= 3:
                yield node


def is_participle(name: str) -> bool:
    """Whether a name is a participle and nothing else."""
    bare = name.strip("_")
    return bare in _PARTICIPLES or (re.fullmatch(r"[a-z]+ed", bare) is not None and bare not in _NO_PARTICIPLES)


def is_compiled(function: Function) -> bool:
    """Whether a decorator compiles a function."""
    names = [ast.unparse(one.func if isinstance(one, ast.Call) else one) for one in function.decorator_list]
    return any(name.split(".")[-1] in _COMPILED for name in names)


def circles_of(modules: Sequence[Module]) -> list[str]:
    """Return the modules that import each other in a circle, as they are loaded (imports inside functions aside)."""
    known = {module.name for module in modules}
    graph: dict[str, set[str]] = defaultdict(set)
    for module in modules:
        for node in module.tree.body:
            if isinstance(node, ast.ImportFrom) and node.module in known:
                inner = {f"{node.module}.{alias.name}" for alias in node.names} & known
                graph[module.name] |= inner or {str(node.module)}
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


def _switched_off(modules: Sequence[Module]) -> tuple[int, list[str]]:
    found = Counter({module.name: len(re.findall(r"# type: ignore", module.text)) for module in modules})
    return found.total(), _worst(found)


def _members(node: ast.ClassDef) -> set[str]:
    found = {one.name for one in node.body if isinstance(one, Function)}
    found |= {one.target.id for one in node.body if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name)}
    for one in ast.walk(node):  # what a method sets on itself
        if isinstance(one, ast.Attribute) and isinstance(one.ctx, ast.Store):
            found.add(one.attr)
    return {name for name in found if not name.startswith("__") or name == "__call__"}


def _is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def _is_sum(node: ast.expr) -> bool:
    return isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add)


def _where(found: Mapping[str, Sequence[str]], count: int) -> tuple[int, list[str]]:
    named = [f"{name}: {', '.join(others)}" for name, others in found.items() if len(others) == count]
    return len(named), named


def _worst(counted: Counter[str]) -> list[str]:
    return [f"{number:>5}  {name}" for name, number in counted.most_common() if number]


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--source", type=Path, default=SOURCE, help="the package's folder")
    parser.add_argument("--list", action="store_true", help=f"name up to {_MOST_NAMED} places of each count, too")
    parser.add_argument("--all", action="store_true", help="name all of them")
    given = parser.parse_args()
    found = measures(given.source)
    width = max(len(one.title) for one in found)
    for one in found:
        sys.stdout.write(f"{one.title:<{width}}  {one.value:>9,}\n")
        if given.list or given.all:
            sys.stdout.writelines(f"    {place}\n" for place in one.places[: None if given.all else _MOST_NAMED])
    return 0


if __name__ == "__main__":
    sys.exit(main())
