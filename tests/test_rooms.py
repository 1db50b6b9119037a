"""Imports point down the house: a room may use only the rooms on lower floors."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "vico"

# What lies below all rooms: single modules, and the room `io`, which uses nothing of ours but these.
GROUND = {
    "errors",
    "version",
    "seeds",
    "threads",
    "exact",
    "geometry",
    "rules",
    "clock",
    "observation_arrays",
    "english",
}

# Room -> the rooms (or single modules) of ours it may import. docs/architecture.md explains the order.
ALLOWED = {
    "io": set(),
    "jobs": {"io"},
    "kinematics": {"io"},
    "geo": {"io"},
    "world": {"geo.frame", "geo.overlay", "io"},
    "assets": {"world", "io"},
    "llm": {"io"},
    "worldgen": {"geo", "world", "assets", "render", "llm", "jobs", "io"},
    "community": {"world", "llm", "io"},
    "render": {"world", "assets", "io"},
    "sim": {"world", "community", "render", "assets", "kinematics", "io"},
    "envs": {"sim", "world", "community", "io.compiled"},
    "agents": {
        "envs",
        "kinematics",
        "llm",
        "io.compiled",
        "io.data_files",
        "io.arrays",
        "world.public",
        "world.routing",
        "world.trips",
        "world.walkable",
        "world.model",
        "world.transit",
        "world.heights",
    },
    "runner": {"agents", "envs", "sim", "world", "io"},
    "challenges": {"runner", "envs", "agents", "community", "world", "assets", "kinematics", "llm", "jobs", "io"},
    "datasets": {"challenges", "runner", "sim", "world", "assets", "jobs", "io"},
}
OPEN = {"viewer", "cli"}  # and the front door, api.py

# What the stages of world generation share -> what of it that may import. A stage knows these and no other stage.
SHARED = {
    "facts": set(),
    "texture_canvas": set(),
    "facades": {"facts", "texture_canvas"},
}


def imported(path: Path) -> list[str]:
    """Dotted names under `vico` that a file imports, at any depth."""
    names: list[str] = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import; write the full name"
            module = node.module or ""
            package = (SOURCE.parent / module.replace(".", "/")).is_dir()
            names += [f"{module}.{alias.name}" for alias in node.names] if package else [module]
    return [name.removeprefix("vico.") for name in names if name.startswith("vico.")]


@pytest.mark.parametrize("room", sorted(ALLOWED))
def test_a_room_imports_only_lower_rooms(room: str) -> None:
    allowed = ALLOWED[room] | {room} | GROUND
    faults = [
        f"{path.relative_to(SOURCE)} imports vico.{name}"
        for path in sorted((SOURCE / room).rglob("*.py"))
        for name in imported(path)
        if not any(name == a or name.startswith(f"{a}.") for a in allowed)
    ]
    assert faults == []


# The floors inside `sim`, lowest first: packages and single modules. One of a floor may not import another of the same.
FLOORS_OF_SIM = (
    {"animation", "environment"},
    {"bodies"},
    {"physics", "traffic", "perception"},
    {"robots", "transit"},
    {"state", "config"},
    {"people", "cameras"},
    {"actions", "observations", "pictures"},
    {"loop"},
    {"recording"},
)


def test_imports_inside_sim_point_down_its_floors() -> None:
    floor = {part: k for k, parts in enumerate(FLOORS_OF_SIM) for part in parts}
    faults = []
    for path in sorted((SOURCE / "sim").rglob("*.py")):
        part = path.relative_to(SOURCE / "sim").with_suffix("").parts[0]
        if part == "__init__":
            continue
        for name in imported(path):
            room, _, rest = name.partition(".")
            other = rest.split(".")[0]
            if room == "sim" and other != part and not floor[other] < floor[part]:
                faults.append(f"{path.relative_to(SOURCE)} imports vico.{name}")
    assert faults == []
    assert len(floor) == len(list((SOURCE / "sim").glob("[!_]*"))), "every part of sim has its floor"


def parts_of_worldgen() -> list[str]:
    """Folders and modules that stages share, and the stages' folders."""
    return sorted(
        SHARED.keys() | {"previews"} | {path.parent.name for path in (SOURCE / "worldgen").glob("*/__init__.py")}
    )


@pytest.mark.parametrize("part", parts_of_worldgen())
def test_a_stage_knows_no_other_stage(part: str) -> None:
    allowed = SHARED.get(part, SHARED.keys()) | {part}
    folder = SOURCE / "worldgen" / part
    files = sorted(folder.rglob("*.py")) if folder.is_dir() else [folder.with_suffix(".py")]
    faults = [
        f"{path.relative_to(SOURCE)} imports vico.{name}"
        for path in files
        for name in imported(path)
        if name.startswith("worldgen") and not any(f"{name}.".startswith(f"worldgen.{a}.") for a in allowed)
    ]
    assert files
    assert faults == []


def test_no_circle_of_imports() -> None:
    modules = {
        ".".join(path.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__"): path
        for path in sorted(SOURCE.rglob("*.py"))
    }
    unvisited = set(modules)
    circles: list[str] = []

    def visit(name: str, chain: tuple[str, ...]) -> None:
        if name in chain:
            circles.append(" -> ".join((*chain[chain.index(name) :], name)))
        if name not in unvisited:
            return
        unvisited.discard(name)
        for other in dict.fromkeys(imported(modules[name])):
            if other in modules:
                visit(other, (*chain, name))

    for name in modules:
        visit(name, ())
    assert circles == []


def test_every_room_has_a_floor() -> None:
    rooms = {path.parent.name for path in SOURCE.glob("*/__init__.py")}
    assert rooms == set(ALLOWED) | OPEN


def test_only_kernels_have_no_annotations() -> None:
    bare: list[str] = []

    def visit(node: ast.AST, path: Path, kernel: bool) -> None:
        for inner in ast.iter_child_nodes(node):
            inside = kernel
            if isinstance(inner, ast.FunctionDef | ast.AsyncFunctionDef):
                # Functions of numba, and of Quadrants, which Genesis compiles with.
                made_by = {ast.unparse(one).partition("(")[0] for one in inner.decorator_list}
                inside |= bool(made_by & {"compiled", "inlined", "qd.func", "qd.kernel"})
                arguments = [*inner.args.posonlyargs, *inner.args.args, *inner.args.kwonlyargs]
                known = [one.annotation or one.arg in ("self", "cls") for one in arguments]
                if not inside and not (all(known) and inner.returns):
                    bare.append(f"{path.relative_to(SOURCE)}:{inner.lineno} {inner.name}")
            visit(inner, path, inside)

    for path in sorted(SOURCE.rglob("*.py")):
        visit(ast.parse(path.read_text()), path, kernel=False)
    assert bare == []


def test_modules_stay_readable() -> None:
    long = {str(p.relative_to(SOURCE)): n for p in SOURCE.rglob("*.py") if (n := len(p.read_text().splitlines())) > 700}
    assert long == {}


def test_what_lies_below_all_rooms_imports_only_its_like() -> None:
    faults = [f"{name} imports vico.{used}" for name in sorted(GROUND) for used in imported(SOURCE / f"{name}.py")]
    # ... and what compiles loops, which itself uses nothing else of ours.
    assert [fault for fault in faults if fault.rpartition("vico.")[2] not in GROUND | {"io.compiled"}] == []


_OVERLAYS = {"intersection", "difference", "union", "union_all", "unary_union", "symmetric_difference", "buffer"} | {
    "polygonize", "make_valid", "set_precision", "simplify", "offset_curve",
}  # fmt: skip
# Overlays of what is our own: lines between grid points that already meet, a table of countries.
_EXACT = {"geo/overlay.py", "worldgen/ground/polygons.py", "worldgen/facts/street_habits.py"}


def test_geometry_from_outside_is_overlaid_by_one_module() -> None:
    found = {
        f"{path.relative_to(SOURCE)}:{node.lineno}: shapely.{node.func.attr}"
        for room in ("geo", "world", "worldgen")
        for path in sorted((SOURCE / room).rglob("*.py"))
        if path.relative_to(SOURCE).as_posix() not in _EXACT
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr in _OVERLAYS
        and isinstance(node.func.value, ast.Name)
        and node.func.value.id == "shapely"
    }
    assert found == set(), "use vico.geo.overlay: plain overlays fail on outlines that nearly coincide"


_COMPILING = {
    f"io/{name}.py" for name in ("compiled", "kernel_digest", "linking", "references")
}  # the first, its parts


def test_functions_are_compiled_through_one_module() -> None:
    found = [
        f"{path.relative_to(SOURCE)}:{node.lineno}"
        for path in sorted(SOURCE.rglob("*.py"))
        if path.relative_to(SOURCE).as_posix() not in _COMPILING
        for node in ast.walk(ast.parse(path.read_text()))
        if (isinstance(node, ast.Import) and any(alias.name.split(".")[0] == "numba" for alias in node.names))
        or (isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "numba")
    ]
    assert found == [], "use vico.io.compiled: numba's own cache runs old code after an update"
