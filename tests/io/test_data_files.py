"""Data of the package and of a user's own: which files, in which order, and what is said of wrong ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from vico.errors import InputError, SchemaError
from vico.io.data_files import DataRecord, cached_data, data_files, own_files, parse_record, read_record


class Bench(DataRecord):
    """A record to read."""

    seats: int
    at: tuple[float, float] = (0.0, 0.0)


def test_a_users_files_come_after_the_packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "community").mkdir()
    mine = tmp_path / "community" / "trades_aaa.toml"
    mine.write_text("")
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    assert [path.name for path in data_files("community", "trades")] == ["trades.toml", "trades_aaa.toml"]
    assert own_files("community") == [mine]
    assert data_files("assets/models/indoor", first=("shops",))[0].name == "shops.toml"


def test_a_folder_that_is_not_there_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VICO_DATA", str(tmp_path / "nowhere"))
    with pytest.raises(InputError, match=r"VICO_DATA: .*nowhere is no folder"):
        data_files("community")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("seats = 3.5", r"mine\.toml: seats: .*integer.*; see docs/x\.md"),
        ("seats = 3\nlegs = 4", r"mine\.toml: legs: extra inputs"),
        ("seats = 3\nat = [1, 'x']", r"mine\.toml: at\.1: .*number"),
        ("seats = ", r"mine\.toml: not valid TOML"),
        ("seats = 1979-05-27", r"mine\.toml: not valid TOML"),
    ],
)
def test_a_wrong_entry_is_told_with_file_and_field(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(SchemaError, match=message):
        read_record(path, Bench, guide="docs/x.md")


def test_a_file_of_another_encoding_or_of_monstrous_size_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes("# Bänke\nseats = 3".encode("latin-1"))
    with pytest.raises(SchemaError, match="not UTF-8"):
        read_record(path, Bench)
    path.write_bytes(b"#" * (5 << 20))
    with pytest.raises(SchemaError, match="larger than 4 MB"):
        read_record(path, Bench)


def test_whole_numbers_do_for_lengths() -> None:
    assert parse_record("seats = 2\nat = [1, 2]", Bench).at == (1.0, 2.0)


def test_what_was_made_of_data_is_kept_for_each_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []

    @cached_data
    def count(step: int) -> int:
        made.append(step)
        return len(made)

    assert [count(1), count(1), count(2)] == [1, 1, 2]
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    assert [count(1), count(1)] == [3, 3]
    monkeypatch.delenv("VICO_DATA")
    assert count(1) == 1


def test_a_folder_by_its_old_name_is_told_instead_of_ignored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "facades").mkdir()
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    with pytest.raises(InputError, match=r"facades: folders bear their room's name; move it to worldgen/facades there"):
        data_files("worldgen/facades", "regions")
