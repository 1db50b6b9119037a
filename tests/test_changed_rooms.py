"""`make test-changed` asks for the tests of the rooms that changed and of those above."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from test_changed import tests_of as asked_by


def test_a_room_asks_for_itself_and_those_that_may_import_it() -> None:
    asked = asked_by(["src/vico/worldgen/roofs/stage.py"])
    assert {"tests/worldgen", "tests/viewer", "tests/cli"} <= set(asked)
    assert not {"tests/geo", "tests/world", "tests/sim"} & set(asked)


def test_what_lies_below_all_asks_for_all() -> None:
    for name in ("src/vico/seeds.py", "src/vico/data/helsinki.osm.pbf", "tests/conftest.py", "constraints.txt"):
        assert asked_by([name]) == ["tests"]


def test_a_test_asks_for_itself_and_a_helper_for_those_that_name_it() -> None:
    assert asked_by(["tests/sim/test_trams.py"]) == ["tests/sim/test_trams.py"]
    asked = asked_by(["tests/road_city.py"])
    assert "tests/worldgen/test_roads.py" in asked
    assert "tests/sim/environment/test_driving.py" in asked, "through another helper"
    assert not any(name.startswith("tests/llm") for name in asked)


def test_a_page_asks_for_what_reads_the_pages() -> None:
    asked = asked_by(["docs/architecture.md"])
    assert "tests/test_docs.py" in asked
    assert all(name.startswith("tests/test_") for name in asked)
