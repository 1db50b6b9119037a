"""Tables of places as spreadsheets save them."""

from pathlib import Path

import pytest

from vico.errors import SchemaError
from vico.worldgen.place_tables import PlaceTable, read_place_table


def read(tmp_path: Path, content: str | bytes) -> PlaceTable:
    path = tmp_path / "places.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_place_table(path)


@pytest.mark.parametrize(
    "content",
    [
        "name;lat;lon;radius\r\nTown;52,1000;11,6000;60\r\n",
        "name\tlat\tlon\tradius\r\nTown\t52.1\t11.6\t60\r\n".encode("utf-16"),
        "Name,Latitude,Longitude,Radius\nTown,52.1,11.6,60\n",
        "City,LNG,Lat,radius (m)\nTown,11.6,52.1,60 m\n",
        "name,x,y,radius\nTown,11.6,52.1,60\n",
        "sep=;\nname;lat;lon;radius\nTown;52,1;11,6;60\n;;;\n\n",
        'name,lat,lon,radius\nTown,52.1° N,E 11.6°,60\n,,,,\n"",,,\n',
        "name\tlat\tlon\tradius\nTown\t52°06'00.0\"N\t11°36'E\t60\n",
    ],
)
def test_tables_as_spreadsheets_save_them_are_read(tmp_path: Path, content: str | bytes) -> None:
    table = read(tmp_path, content)
    (row,) = table.rows
    assert (row.name, round(row.lat, 9), round(row.lon, 9), row.radius) == ("Town", 52.1, 11.6, 60.0)
    assert table.bad == ()


def test_southern_and_western_degrees_are_negative(tmp_path: Path) -> None:
    (row,) = read(tmp_path, "name,lat,lon\nRio,22.9° S,43.2 W\n").rows
    assert (row.lat, row.lon) == (-22.9, -43.2)


def test_a_bad_row_is_told_with_its_line_and_the_others_are_read(tmp_path: Path) -> None:
    table = read(tmp_path, "name,lat,lon\na/b,52.1,11.6\n,52.1,11.6\nTown,52.1,11.6\nTown,1,2\nN,11.6,152\n")
    assert [row.name for row in table.rows] == ["Town", "N"]
    assert [(row.name, row.reason.partition("places.csv:")[2]) for row in table.bad] == [
        ("a/b", "2: a/b: name 'a/b' can't be a folder's name"),
        ("line 3", "3: name '' can't be a folder's name"),
        ("Town", "5: Town: named as line 4 is; every world needs a folder of its own"),
    ]


def test_its_own_name_counts_before_other_spellings(tmp_path: Path) -> None:
    table = read(tmp_path, "city,name,lat,lon\nBig,Town,52.1,11.6\n")
    assert [row.name for row in table.rows] == ["Town"]
    assert "city: no such column is known; passed over" in table.notes[0]


def test_columns_of_the_author_s_own_are_passed_over_and_told(tmp_path: Path) -> None:
    assert (
        "Country, notes: no such columns are known"
        in read(tmp_path, "Country,name,lat,lon,notes\nD,T,1,2,x\n").notes[0]
    )


def test_windows_letters_are_read_and_told(tmp_path: Path) -> None:
    table = read(tmp_path, "name;lat;lon\nKöln;50,9;6,9\n".encode("cp1252"))
    assert table.rows[0].name == "Köln"
    assert "read as Windows-1252" in table.notes[0]


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"PK\3\4rest", "is a spreadsheet's own file; save it as CSV"),
        (b"place;breadth\nTown;1\n", r"lacks lat, lon \(separated by semicolons, it has name, breadth\)"),
        (b"name,lat,lon\nTown,52,1000,11,6000\n", "5 cells under 3 columns"),
        (b"name,lat,lon\nTown,11E,52N\n", "latitude '11E' is none; latitude and longitude look exchanged"),
        (b"name,lat,lon\nTown,680000,5770000\n", "680000, 5.77e.06 is not on Earth"),
        (b"name,lat,lon,radius\nTown,1,2,-5\n", "no positive number of metres"),
        (b"name,lat,lon,seed\nTown,1,2,1.5\n", "no whole number"),
    ],
)
def test_what_can_t_be_read_is_one_sentence(tmp_path: Path, content: bytes, why: str) -> None:
    with pytest.raises(SchemaError, match=why):
        read(tmp_path, content)
