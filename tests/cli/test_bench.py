"""`vico bench` says how fast the machine is beside that of the README's figures."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from vico.cli import demo
from vico.cli.machine_speed import REFERENCE_COMPILED, REFERENCE_PYTHON, compiled_speed, python_speed, speed_table

SCRIPT = """import sys
from pathlib import Path
Path(sys.argv[sys.argv.index("--table") + 1]).write_text("# A thing\\n\\n| a | b |\\n|---|---|\\n| 1 | 2 |\\n")
"""


def test_speeds_are_those_of_a_processor_of_our_days() -> None:
    # Turns of an interpreter's loop take 5 ns to 0.5 us, two products and a difference one after the other 1 to 50 ns.
    assert 2.0 < python_speed() < 2_000.0
    assert 20.0 < compiled_speed() < 2_000.0


def test_the_table_has_both_machines_and_their_ratio() -> None:
    (table,) = demo.tables_of(speed_table())
    rows = table["rows"]
    assert [row["there"] for row in rows] == [f"{REFERENCE_PYTHON:.0f}", f"{REFERENCE_COMPILED:.0f}"]
    for row in rows:
        assert float(row["here / there"]) == pytest.approx(float(row["here"]) / float(row["there"]), abs=0.02)


@pytest.mark.parametrize("as_json", [False, True])
def test_a_benchmark_is_printed_with_the_speed_of_the_machine(
    as_json: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "world.py").write_text(SCRIPT)
    monkeypatch.setattr(demo, "SCRIPTS", tmp_path)
    report = tmp_path / "report.md"
    assert demo.bench("world", json=as_json, table=report) == 0
    printed = capsys.readouterr().out
    assert "here / there" not in report.read_text()
    if not as_json:
        assert printed.startswith("# A thing")
        assert "| Python, empty |" in printed
    else:
        told = json.loads(printed)
        assert [table["rows"] for table in told["tables"]] == [[{"a": "1", "b": "2"}]]
        assert [row["loop"] for row in told["machine"]] == ["Python, empty", "compiled, products"]
