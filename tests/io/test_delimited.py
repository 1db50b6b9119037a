"""The reader of delimited text: separators, encodings, spellings of columns, and what is no table."""

import io

import pytest

from vico.errors import SchemaError
from vico.io.delimited import DelimitedText, decimal

COLUMNS = {"name": ("title",), "lat": ("latitude",)}


def table(content: bytes) -> DelimitedText:
    return DelimitedText(io.BytesIO(content), "t.csv", COLUMNS)


@pytest.mark.parametrize(("separator", "words"), [(",", "commas"), (";", "semicolons"), ("\t", "tabs"), ("|", "bars")])
def test_the_separator_is_found(separator: str, words: str) -> None:
    found = table(f"name{separator}lat\nA{separator}1\n".encode())
    assert (found.separator, found.header, list(found)) == (words, ["name", "lat"], [["A", "1"]])


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "cp1252"])
def test_the_encoding_is_found(encoding: str) -> None:
    assert list(table("name,lat\nRéunion €,1\n".encode(encoding))) == [["Réunion €", "1"]]


def test_a_mixed_file_keeps_both_encodings_letters() -> None:
    found = table("name,lat\nZürich,1\n".encode() + "Zürich,2\n".encode("cp1252"))
    assert list(found) == [["Zürich", "1"], ["Zürich", "2"]]
    assert found.foreign


def test_columns_are_known_by_other_spellings() -> None:
    assert table(b'"Title", LATITUDE ,Note\n').header == ["name", "lat", "Note"]


def test_a_spreadsheet_s_own_line_about_its_separator_is_followed() -> None:
    found = table(b"sep=;\nname;lat\nA, B;1\n")
    assert list(found) == [["A, B", "1"]]
    assert found.line == 3


def test_empty_rows_are_passed_over_and_lines_counted() -> None:
    found = table(b"\n\nname,lat\n,,,\n\nA,1\n")
    assert [(found.line, row) for row in found] == [(6, ["A", "1"])]


def test_commas_within_quotes_are_no_separators() -> None:
    assert list(table(b'name;lat\n"A; B";1\n')) == [["A; B", "1"]]


def test_line_ends_of_every_system_are_read() -> None:
    assert list(table(b"name,lat\rA,1\r\nB,2\n")) == [["A", "1"], ["B", "2"]]


def test_broken_utf_16_is_one_sentence() -> None:
    with pytest.raises(SchemaError, match="is no UTF-16"):
        list(table("name,lat\nA,1\n".encode("utf-16") + b"\x00"))


def test_an_endless_line_is_refused() -> None:
    with pytest.raises(SchemaError, match="a line of more than"):
        table(b"a" * 100_000)


@pytest.mark.parametrize(
    ("text", "value"),
    [("52.1", 52.1), (" 52,1 ", 52.1), ("-0,5", -0.5), ("\N{MINUS SIGN}3", -3.0), ("1e3", 1000.0), ("1.000,5", None),
     ("nan", None), ("inf", None), ("", None), ("1_0", None)],
)  # fmt: skip
def test_numbers_with_points_and_commas(text: str, value: float | None) -> None:
    assert decimal(text) == value
