"""Trades, hobbies and groups are data that anybody may add to."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from vico.community import catalogue
from vico.community.place_index import usual_spans
from vico.community.work import job_of
from vico.errors import InputError, SchemaError

PAGE = Path(__file__).parents[2] / "docs" / "adding_people.md"


@pytest.fixture
def own_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's folder of data."""
    folder = tmp_path / "community"
    folder.mkdir()
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    return folder


def test_a_trade_hobby_and_group_of_the_documentation_are_read_beside_ours(own_data: Path) -> None:
    text = PAGE.read_text(encoding="utf-8")
    for name, block in re.findall(r"`(\w+\.toml)`:\n\n```toml\n(.*?)```", text, re.DOTALL):
        (own_data / name).write_text(block, encoding="utf-8")
    trade = job_of("boat builder")
    assert trade is not None
    assert trade.kinds == ("boatyard", "harbour")
    assert job_of("barista") is not None
    cafes = catalogue.kind_sets()["cafes"]
    assert next(h for h in catalogue.hobbies() if h.name == "model ships").kinds == (*cafes, "harbour")
    assert next(c for c in catalogue.circles() if c.name == "Harbour round").starts == (9 * 60, 10 * 60 + 30)


def test_an_unknown_field_is_told_with_file_and_field(own_data: Path) -> None:
    path = own_data / "trades_wrong.toml"
    path.write_text('[[trade]]\ntitle = "smith"\nsalary = 3\n')
    with pytest.raises(SchemaError, match=rf"{re.escape(str(path))}: trade\.0\."):
        catalogue.trades()


def test_a_set_of_kinds_that_nobody_wrote_is_told(own_data: Path) -> None:
    (own_data / "leisure_wrong.toml").write_text('[[hobby]]\nname = "nothing"\nkinds = ["@nowhere"]\n')
    with pytest.raises(SchemaError, match="no set is called '@nowhere'; there are art, bars"):
        catalogue.hobbies()


def test_a_folder_of_data_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("VICO_DATA", str(tmp_path / "missing"))
    with pytest.raises(InputError, match="VICO_DATA"):
        catalogue.trades()


def test_every_shift_of_a_trade_is_one_that_days_are_written_for() -> None:
    assert {job.shift for job in catalogue.trades()} <= set(catalogue.Shift.__args__)


def test_values_that_hobbies_and_groups_name_exist() -> None:
    known = {value.name for value in catalogue.basic_values()}
    named = {v for entry in (*catalogue.hobbies(), *catalogue.circles()) for v in entry.values}
    assert named <= known


def test_usual_hours_of_a_kind_of_ones_own(own_data: Path) -> None:
    (own_data / "hours_mine.toml").write_text('[[usual]]\nhours = "05:00-14:00"\nkinds = ["fish_market"]\n')
    assert usual_spans("fish_market", "store") == [(300, 840)]
    assert usual_spans("cafe", "food") == [(450, 1140)]


def test_usual_hours_of_days_alone_are_told(own_data: Path) -> None:
    (own_data / "hours_mine.toml").write_text('[[usual]]\nhours = "Mo-Fr; Sa 10:00-12:00"\nkinds = ["fish_market"]\n')
    with pytest.raises(SchemaError, match=r"'Mo-Fr; Sa 10:00-12:00' names days without hours"):
        usual_spans("fish_market", "store")


def test_usual_hours_that_nobody_can_read_are_told(own_data: Path) -> None:
    (own_data / "hours_mine.toml").write_text('[[usual]]\nhours = "at dawn"\nkinds = ["fish_market"]\n')
    with pytest.raises(SchemaError, match=r"hours_mine\.toml: usual\.0\.hours: 'at dawn' says no hours"):
        usual_spans("fish_market", "store")
