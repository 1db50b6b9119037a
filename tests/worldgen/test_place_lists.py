"""The 35 places of the paper's size: how many, where, of which files; and wrong names."""

from __future__ import annotations

from pathlib import Path

import pytest

from command_line import vico
from vico.errors import InputError
from vico.worldgen.batch import place_lists, rows_of


def test_there_are_35_places_in_at_least_17_countries_each_in_its_own_country() -> None:
    places = place_lists()["paper35"].places
    assert len(places) == 35
    assert len({place.country for place in places}) >= 17
    boxes = {"US": (24, 50, -125, -66), "CA": (41, 60, -141, -52), "MX": (14, 33, -118, -86),
             "AU": (-44, -10, 112, 154), "NZ": (-48, -34, 166, 179)}  # fmt: skip
    for place in places:
        south, north, west, east = boxes.get(place.country, (36, 71, -11, 32))  # the rest is in Europe
        assert south < place.lat < north, place.name
        assert west < place.lon < east, place.name
    assert {place.name for place in places if place.paper} == {"boston", "detroit"}


def test_places_with_data_are_built_of_it_and_the_others_are_fetched(shared_data: Path) -> None:
    places = place_lists()["paper35"]
    rows = {row.name: row for row in rows_of(places, extracts=shared_data / "places")}
    assert sorted(name for name, row in rows.items() if row.osm) == sorted(
        folder.name for folder in (shared_data / "places").iterdir()
    )
    assert rows["monaco"].dem.endswith("dem_srtm.tif")
    assert rows["paris"].osm == ""
    assert [row.name for row in rows_of(places, only={"rome", "oslo"})] == ["rome", "oslo"]
    with pytest.raises(InputError, match="'atlantis' is no place of the list"):
        rows_of(places, only={"atlantis"})


def test_without_a_network_each_place_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("VICO_OVERPASS", "off")
    assert vico("world", "build-many", "paper35", "--only", "oslo,rome", "--workers", "1", "--out", tmp_path) == 1
    said = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in said] == ["rome", "oslo"]
    assert all("asking a server is off" in line for line in said)
    assert vico("world", "build-many", "paper99", "--out", tmp_path) == 2
    assert "no list of that name; there are paper35" in capsys.readouterr().err
