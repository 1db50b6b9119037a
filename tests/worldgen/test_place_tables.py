"""Tables of places as spreadsheets save them."""

from pathlib import Path

import pytest

from vico.errors import SchemaError
from vico.worldgen.batch import PlaceTable, read_place_table


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


@pytest.mark.parametrize(
    "header",
    [
        "place_name;Latitude (WGS84);Longitude (WGS84)", "City name;lat [°];lon [°]", "Name;Lat.;Long.",
        "Ort;Breitengrad;Längengrad", "Nom;Latitude;Longitude", "Nombre;Latitud;Longitud",
        "Città;Latitudine;Longitudine", "Naam;Breedtegraad;Lengtegraad", "Nazwa;Szerokość;Długość",
        "MIASTO;SZEROKOSC;DLUGOSC", "Название;Широта;Долгота", "名称;纬度;经度", "名前;緯度;経度（度）",
        "도시;위도;경도",
        "الاسم;خط العرض;خط الطول", "שם;קו רוחב;קו אורך", "La\u0308nge;Name;Breite",
    ],
)  # fmt: skip
def test_usual_names_of_columns_in_many_languages_are_known(tmp_path: Path, header: str) -> None:
    cells = "11,6;Town;52,1" if header.startswith("La") else "Town;52,1;11,6"
    (row,) = read(tmp_path, f"{header}\n{cells}\n").rows
    assert (row.name, row.lat, row.lon) == ("Town", 52.1, 11.6)


@pytest.mark.parametrize(
    ("header", "text", "metres"),
    [
        ("radius", "1,000", 1000), ("radius", "1.000", 1000), ("radius", "1 000 m", 1000), ("radius", "1'000", 1000),
        ("radius", "1.000,5", 1000.5), ("radius", "400.000", 400), ("radius", "62,5", 62.5), ("radius", "0,4 km", 400),
        ("radius", "1.250 km", 1250), ("radius (km)", "0.3", 300), ("radius_m", "300", 300), ("Umkreis", "300", 300),
        ("radius [ft]", "1000", 304.8), ("radius (km)", "300 m", 300),
    ],
)  # fmt: skip
def test_radii_as_people_write_them(tmp_path: Path, header: str, text: str, metres: float) -> None:
    (row,) = read(tmp_path, f"name;lat;lon;{header}\nTown;52,1;11,6;{text}\n").rows
    assert row.radius == pytest.approx(metres)


@pytest.mark.parametrize("text", ["wide", "1.00.000", "-5", "0", "3 parsecs"])
def test_radii_that_are_none_are_told(tmp_path: Path, text: str) -> None:
    with pytest.raises(SchemaError, match="is no positive number of metres"):
        read(tmp_path, f"name;lat;lon;radius\nTown;52,1;11,6;{text}\n")


def test_southern_and_western_degrees_are_negative(tmp_path: Path) -> None:
    (row,) = read(tmp_path, "name,lat,lon\nRio,22.9° S,43.2 W\n").rows
    assert (row.lat, row.lon) == (-22.9, -43.2)


def test_dashes_for_minus_signs_are_read(tmp_path: Path) -> None:
    (row,) = read(tmp_path, "name,lat,lon\nRio,\N{EN DASH}22.9,\N{MINUS SIGN}43.2\n").rows
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
