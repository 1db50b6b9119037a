"""docs/architecture.md names modules, data and functions that exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "vico"
TEXT = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
ROWS = [line for line in TEXT.partition("### Where is it decided")[2].splitlines() if line.startswith("|")][2:]


@pytest.mark.parametrize("row", [row for row in ROWS if not row.startswith("| **")])
def test_what_a_row_names_is_there(row: str) -> None:
    where = row.split("|")[2]
    paths = [path for path in re.findall(r"`([\w/.]+)`", where) if "/" in path]
    assert paths or "evaluate.py" in where
    for path in paths:
        assert (SOURCE / path).exists(), path
    for path, name in re.findall(r"`([\w/.]+)`: `(\w+)`", where):
        assert re.search(rf"\b{name}\b", (SOURCE / path).read_text(encoding="utf-8")), f"{path}: {name}"


def test_every_room_has_a_row() -> None:
    rooms = {path.parent.name for path in SOURCE.glob("*/__init__.py")}
    assert {room for room in rooms if f"`{room}/`" not in TEXT} == set()
