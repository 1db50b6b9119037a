"""Imports point down the house: a room may use only the rooms on lower floors."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "vico"

# Room -> the rooms (or single modules) of ours it may import. docs/architecture.md explains the order.
ALLOWED = {
    "geo": set(),
    "world": {"geo.frame"},
    "assets": {"world"},
    "llm": set(),
    "worldgen": {"geo", "world", "assets", "llm"},
    "community": {"world", "llm"},
    "render": {"world", "assets"},
    "sim": {"world", "community", "render", "assets"},
    "envs": {"sim", "world", "community"},
    "agents": {
        "envs",
        "world.public",
        "world.routing",
        "world.walkable",
        "world.seeds",
        "world.model",
        "world.heights",
    },
    "challenges": {"envs", "agents", "community", "world", "assets"},
}
OPEN = {"viewer", "cli"}


def imported(path: Path) -> list[str]:
    """Dotted names under `vico` that a file imports, at any depth."""
    names: list[str] = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import; write the full name"
            module = node.module or ""
            names += [f"{module}.{alias.name}" for alias in node.names] if module == "vico" else [module]
    return [name.removeprefix("vico.") for name in names if name.startswith("vico.")]


@pytest.mark.parametrize("room", sorted(ALLOWED))
def test_a_room_imports_only_lower_rooms(room: str) -> None:
    allowed = ALLOWED[room] | {room, "errors"}
    faults = [
        f"{path.relative_to(SOURCE)} imports vico.{name}"
        for path in sorted((SOURCE / room).rglob("*.py"))
        for name in imported(path)
        if name != "__version__" and not any(name == a or name.startswith(f"{a}.") for a in allowed)
    ]
    assert faults == []


def test_every_room_has_a_floor() -> None:
    rooms = {path.parent.name for path in SOURCE.glob("*/__init__.py")}
    assert rooms == set(ALLOWED) | OPEN


def test_modules_stay_readable() -> None:
    long = {str(p.relative_to(SOURCE)): n for p in SOURCE.rglob("*.py") if (n := len(p.read_text().splitlines())) > 700}
    assert long == {}
