"""The reader of timetables: real feeds, every corner of the format, and nonsense."""

import contextlib
import io
import re
import zipfile
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vico.errors import InputError, MissingFileError, SchemaError, VicoError
from vico.geo.frame import LocalFrame
from vico.geo.gtfs import kind_of, read_gtfs, seconds_of
from vico.geo.gtfs_feed import Feed, Pattern

FRAME = LocalFrame(49.41013, 8.70711)
HALF = 400.0

# Stops a, b, c lie in the window from west to east, far is 11 km north.
TABLES = {
    "agency.txt": "agency_id,agency_name,agency_url,agency_timezone\n1,City Buses,http://example.org,Europe/Berlin\n",
    "stops.txt": (
        "stop_id,stop_name,stop_lat,stop_lon,location_type\na,A,49.41013,8.7043,\nb,B,49.41013,8.70711,0\n"
        "c,C,49.41013,8.7099,\nfar,Far,49.51,8.707,\nhall,Station,49.41013,8.70711,1\nbad,Bad,x,y,0\n"
    ),
    "routes.txt": (
        "route_id,agency_id,route_short_name,route_long_name,route_type,route_color\n"
        "r,1,7,Round,3,00ff7F\nt,1,T,Tram,0,\nx,1,X,Ferry,4,\n"
    ),
    "trips.txt": (
        "route_id,service_id,trip_id,direction_id,shape_id\nr,week,one,0,s\nr,week,two,1,\nr,sat,three,0,s\nt,week,four,0,\n"
    ),
    "stop_times.txt": (
        "trip_id,arrival_time,departure_time,stop_id,stop_sequence\n"
        "one,,,b,20\none,23:50:00,23:50:00,far,1\none,24:10:00,24:11:00,a,10\none,24:21:00,24:21:00,c,30\n"
        "two, 6:00:00, 6:00:00,c,1\ntwo,06:03:00,06:04:00,a,2\n"
        "three,08:00:00,08:00:00,a,1\nthree,08:02:00,08:02:00,c,2\nfour,08:00:00,08:00:00,a,1\nfour,08:02:00,08:02:00,c,2\n"
    ),
    "calendar.txt": (
        "service_id,monday,tuesday,wednesday,thursday,friday,saturday,sunday,start_date,end_date\n"
        "week,1,1,1,1,1,0,0,20240101,20240114\nsat,0,0,0,0,0,1,0,20240101,20240114\n"
    ),
    "calendar_dates.txt": "service_id,date,exception_type\nweek,20240101,2\nsat,20240103,1\n",
    "shapes.txt": "shape_id,shape_pt_lat,shape_pt_lon,shape_pt_sequence\ns,49.41013,8.7099,2\ns,49.41013,8.7043,1\n",
}


def feed_bytes(tables: dict[str, Any]) -> bytes:
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in tables.items():
            archive.writestr(name, content)
    return sink.getvalue()


def read(tmp_path: Path, tables: dict[str, Any], **options: Any) -> Feed:
    path = tmp_path / "feed.zip"
    path.write_bytes(feed_bytes(tables))
    return read_gtfs(path, FRAME, HALF, **options)


def test_the_busiest_weekday_is_chosen(tmp_path: Path) -> None:
    # On the third, a Wednesday, the Saturday's trip runs too.
    assert read(tmp_path, TABLES).day == "2024-01-03"


def test_calls_are_cut_to_the_window_and_times_filled_in(tmp_path: Path) -> None:
    one = next(p for p in read(tmp_path, TABLES).patterns if p.stops == ("a", "b", "c"))
    assert one.departures == (24 * 3600 + 11 * 60,)
    assert one.travel == (0, 300, 600)
    assert [round(x) for x, _ in one.line] == [-204, 202]


def test_trams_are_listed_with_their_patterns(tmp_path: Path) -> None:
    feed = read(tmp_path, TABLES)
    assert [(route.name, route.kind) for route in feed.routes] == [("7", "bus"), ("T", "tram")]
    assert {pattern.route for pattern in feed.patterns} == {"r", "t"}
    assert feed.routes[0].colour == "#00ff7f"
    assert feed.attribution == "City Buses"


def test_faulty_rows_are_named(tmp_path: Path) -> None:
    assert ("stop bad", "no place on Earth (x, y)") in read(tmp_path, TABLES).broken


def test_a_day_can_be_asked_for(tmp_path: Path) -> None:
    assert {p.departures for p in read(tmp_path, TABLES, day=date(2024, 1, 6)).patterns} == {(8 * 3600,)}
    with pytest.raises(InputError, match="nothing in the window runs on 2024-02-01; it runs from 2024-01-02 to"):
        read(tmp_path, TABLES, day=date(2024, 2, 1))


def test_frequencies_repeat_a_trip(tmp_path: Path) -> None:
    table = (
        "trip_id,start_time,end_time,headway_secs\ntwo,06:00:00,07:00:00,900\ntwo,09:00:00,09:30:00,600\ntwo,x,1,0\n"
    )
    two = next(p for p in read(tmp_path, TABLES | {"frequencies.txt": table}).patterns if p.stops == ("c", "a"))
    assert two.departures == (21600, 22500, 23400, 24300, 32400, 33000, 33600)
    assert two.travel == (0, 180)


def test_a_frequency_that_ends_before_it_begins_goes_past_midnight(tmp_path: Path) -> None:
    table = "trip_id,start_time,end_time,headway_secs\ntwo,22:00:00,01:00:00,3600\n"
    feed = read(tmp_path, TABLES | {"frequencies.txt": table})
    assert next(p for p in feed.patterns if p.stops == ("c", "a")).departures == (79200, 82800, 86400)
    assert "read as past midnight, 25:00" in dict(feed.broken)["trip two"]


def test_a_headway_may_have_decimals(tmp_path: Path) -> None:
    table = "trip_id,start_time,end_time,headway_secs\ntwo,06:00:00,06:30:00,600.0\n"
    two = next(p for p in read(tmp_path, TABLES | {"frequencies.txt": table}).patterns if p.stops == ("c", "a"))
    assert two.departures == (21600, 22200, 22800)


def test_a_trip_whose_frequencies_make_no_timetable_does_not_run_at_its_template_s_time(tmp_path: Path) -> None:
    table = "trip_id,start_time,end_time,headway_secs\ntwo,06:00:00,07:00:00,often\n"
    feed = read(tmp_path, TABLES | {"frequencies.txt": table})
    assert ("c", "a") not in {p.stops for p in feed.patterns}
    assert "makes no timetable" in dict(feed.broken)["trip two"]


@pytest.mark.parametrize("blank", ["", "\ufeff", "\r\n\r\n"])
def test_empty_optional_tables_are_as_if_they_were_not_there(tmp_path: Path, blank: str) -> None:
    empty = dict.fromkeys(("agency.txt", "calendar_dates.txt", "frequencies.txt", "shapes.txt"), blank)
    bare = {name: text for name, text in TABLES.items() if name not in empty}
    assert read(tmp_path, TABLES | empty).patterns == read(tmp_path, bare).patterns != ()


@pytest.mark.parametrize(
    ("name", "old", "new", "reason"),
    [
        ("routes.txt", ",3,", ",1,", r"no bus .* only 1 of route_type 1 \(underground\)"),
        ("routes.txt", "r,1,7,Round,3,00ff7F\n", "", "routes.txt has no rows"),
        ("trips.txt", "\nr,", "\ngone,", "3 are of routes that routes.txt has not"),
        ("stops.txt", ",\n", ",1\n", r"only 3 of location_type 1 \(stations\)"),
        ("calendar.txt", "20240101,20240114", "20240114,20240101", "no day is a day of service"),
        ("stop_times.txt", ":", ".", "trip one: its time"),
    ],
)
def test_a_feed_that_gives_nothing_says_why(tmp_path: Path, name: str, old: str, new: str, reason: str) -> None:
    tables = TABLES | {
        "routes.txt": TABLES["routes.txt"].replace("t,1,T,Tram,0,\nx,1,X,Ferry,4,\n", ""),
        "stops.txt": "stop_id,stop_name,stop_lat,stop_lon,location_type\na,A,49.41013,8.7043,\nb,B,49.41013,8.707,\n"
        "c,C,49.41013,8.7099,\n",
        "trips.txt": TABLES["trips.txt"].replace("t,week,four,0,\n", ""),
        "calendar_dates.txt": "",
    }
    assert not read(tmp_path, tables).nothing
    assert old in tables[name]
    assert re.search(reason, read(tmp_path, tables | {name: tables[name].replace(old, new)}).nothing)


def test_trips_and_calls_that_name_what_is_not_there_are_told(tmp_path: Path) -> None:
    tables = TABLES | {
        "trips.txt": TABLES["trips.txt"] + "gone,week,five,0,\n",
        "stop_times.txt": TABLES["stop_times.txt"] + "two,06:05:00,06:05:00,0a,3\n",
    }
    faults = dict(read(tmp_path, tables).broken)
    assert faults["trips.txt"] == "1 of its trips are of routes that routes.txt has not ('gone' for one); left out"
    assert faults["stop_times.txt"] == "1 of its calls are at stops that stops.txt has not ('0a' for one)"


def test_a_byte_order_mark_a_folder_and_missing_optional_tables_are_no_trouble(tmp_path: Path) -> None:
    needed = ("stops.txt", "routes.txt", "trips.txt", "stop_times.txt", "calendar.txt")
    tables = {f"feed/{name}": b"\xef\xbb\xbf" + TABLES[name].encode() for name in needed}
    feed = read(tmp_path, tables)
    assert feed.day == "2024-01-01"
    assert feed.attribution == "feed.zip"
    assert all(not pattern.line for pattern in feed.patterns)


def test_a_feed_of_elsewhere_is_empty(tmp_path: Path) -> None:
    path = tmp_path / "feed.zip"
    path.write_bytes(feed_bytes(TABLES))
    feed = read_gtfs(path, LocalFrame(-33.0, 151.0), HALF)
    assert (feed.stops, feed.patterns, feed.day) == ((), (), "")


def test_stops_of_elsewhere_are_told_with_where_they_lie(tmp_path: Path) -> None:
    path = tmp_path / "feed.zip"
    path.write_bytes(feed_bytes(TABLES))
    what, why = read_gtfs(path, LocalFrame(-33.0, 151.0), HALF).broken[-1]
    assert what == "stops.txt"
    assert "none of its 4 stops lies in the window; they lie at latitudes 49.4101..49.5100" in why
    assert "exchanged" not in why


def test_exchanged_latitudes_and_longitudes_are_told(tmp_path: Path) -> None:
    turned = TABLES["stops.txt"].replace("stop_lat,stop_lon", "stop_lon,stop_lat")
    assert (
        "look exchanged, the other way round 3 would;" in read(tmp_path, TABLES | {"stops.txt": turned}).broken[-1][1]
    )


@pytest.mark.parametrize(
    ("separator", "encoding", "said"),
    [
        (";", "utf-8", "separated by semicolons"),
        ("\t", "utf-8", "separated by tabs"),
        (",", "utf-16", "in UTF-16"),
        (",", "utf-16-le", "in UTF-16"),
    ],
)
def test_other_separators_and_encodings_are_read_and_told(
    tmp_path: Path, separator: str, encoding: str, said: str
) -> None:
    tables = {name: text.replace(",", separator).encode(encoding) for name, text in TABLES.items()}
    feed = read(tmp_path, tables)
    assert feed.patterns == read(tmp_path, TABLES).patterns
    assert said in dict(feed.broken)["stops.txt"]


def test_windows_letters_are_read_and_told(tmp_path: Path) -> None:
    named = TABLES["stops.txt"].replace(",A,", ",Schloßstraße,").encode("cp1252")
    feed = read(tmp_path, TABLES | {"stops.txt": named})
    assert "Schloßstraße" in {stop.name for stop in feed.stops}
    assert "in Windows-1252" in dict(feed.broken)["stops.txt"]


def test_decimal_commas_are_read(tmp_path: Path) -> None:
    table = TABLES["stops.txt"].replace(",", ";").replace("49.", "49,").replace("8.7", "8,7")
    assert read(tmp_path, TABLES | {"stops.txt": table}).stops == read(tmp_path, TABLES).stops


def test_upper_case_names_of_columns_and_tables_blank_lines_and_blanks_are_no_trouble(tmp_path: Path) -> None:
    tables: dict[str, Any] = {}
    for name, text in TABLES.items():
        header, *rows = text.splitlines()
        cells = [" , ".join(row.split(",")) for row in rows]
        tables[name.upper().replace(".TXT", ".txt")] = "\n".join(["", header.upper(), "", *cells, " , ,", ""])
    assert read(tmp_path, tables).patterns == read(tmp_path, TABLES).patterns


def test_agencies_without_a_name_are_no_trouble(tmp_path: Path) -> None:
    assert read(tmp_path, TABLES | {"agency.txt": "agency_id,agency_url\n1,x\n"}).attribution == "feed.zip"


def test_times_that_are_none_are_named(tmp_path: Path) -> None:
    table = TABLES["stop_times.txt"].replace("two, 6:00:00, 6:00:00", "two,six,six")
    faults = dict(read(tmp_path, TABLES | {"stop_times.txt": table}).broken)
    assert faults["trip two"] == "its time 'six' is none (8:00 or 08:00:00 would be); left out"


def test_a_calendar_that_ended_before_the_map_is_told(tmp_path: Path) -> None:
    path = tmp_path / "feed.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in TABLES.items():
            archive.writestr(zipfile.ZipInfo(name, (2024, 1, 1, 0, 0, 0)), content)
    assert "calendar" not in dict(read_gtfs(path, FRAME, HALF).broken)
    told = dict(read_gtfs(path, FRAME, HALF, as_of=date(2026, 3, 1)).broken)["calendar"]
    assert "ended on 2024-01-13, 2 years before 2026-03-01" in told


def test_a_calendar_that_ended_before_the_feed_was_packed_is_told(tmp_path: Path) -> None:
    path = tmp_path / "feed.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in TABLES.items():
            archive.writestr(zipfile.ZipInfo(name, (2024, 2, 1, 0, 0, 0)), content)
    assert "19 days before 2024-02-01" in dict(read_gtfs(path, FRAME, HALF).broken)["calendar"]


def test_a_folder_is_told_to_be_zipped(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a folder; zip the tables in it"):
        read_gtfs(tmp_path, FRAME, HALF)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("8:00", 28800), ("08:00:00.000", 28800), (" 8:05 ", 29100), ("12:30:00 AM", 1800), ("1:00 pm", 46800),
     ("25:10", 90600), ("13:00 PM", None), ("8.00", None), ("", None)],
)  # fmt: skip
def test_times_as_typed(text: str, seconds: int | None) -> None:
    assert seconds_of(text) == seconds


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stops.txt": None}, "has no stops.txt"),
        ({"calendar.txt": None, "calendar_dates.txt": None}, "neither calendar.txt nor calendar_dates.txt"),
        ({"stops.txt": ""}, "stops.txt is empty, and no feed can do without"),
        ({"trips.txt": "route_id,service_id\n"}, "trips.txt has no column trip_id"),
        ({"stops.txt": b"\xff\xfes"}, "stops.txt: is no UTF-16 text"),
        ({"stops.txt": None, "feed.zip": b"PK"}, "holds feed.zip; unpack it"),
        ({"stops.txt": "stop_id\n" + "a" * 70_000}, "a line of more than"),
    ],
)
def test_what_is_no_feed_is_refused_in_one_sentence(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    tables = {name: text for name, text in (TABLES | change).items() if text is not None}
    with pytest.raises(SchemaError, match=message):
        read(tmp_path, tables)


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    with pytest.raises(SchemaError, match=r"stop_times.txt unpacks to an absurd size"):
        read(tmp_path, TABLES | {"stop_times.txt": TABLES["stop_times.txt"] + "one,,,a,1\n" * 900_000})


def test_no_file_and_no_zip_are_told_apart(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no such file"):
        read_gtfs(tmp_path / "no.zip", FRAME, HALF)
    (tmp_path / "text.zip").write_text("no zip")
    with pytest.raises(SchemaError, match="not a readable GTFS zip"):
        read_gtfs(tmp_path / "text.zip", FRAME, HALF)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_nonsense_gives_a_feed_or_a_sentence(tmp_path: Path, data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(sorted(TABLES)))
    rows = TABLES[name].split("\n")
    for _ in range(data.draw(st.integers(1, 4))):
        k = data.draw(st.integers(1, len(rows) - 1))
        cells = rows[k].split(",")
        cells[data.draw(st.integers(0, len(cells) - 1))] = data.draw(st.one_of(
            st.sampled_from(["", "-1", "99:99:99", "1e400", "nan", '"', "999:00:00", "00000000", "99991231", "0"]),
            st.text(max_size=8),
        ))  # fmt: skip
        rows[k] = ",".join(cells)
    packed = bytearray(feed_bytes(TABLES | {name: "\n".join(rows).encode("utf-8", "replace")}))
    if data.draw(st.booleans()):
        packed[data.draw(st.integers(0, len(packed) - 1))] ^= data.draw(st.integers(1, 255))
    path = tmp_path / "fuzz.zip"
    path.write_bytes(packed)
    patterns: tuple[Pattern, ...] = ()
    with contextlib.suppress(VicoError):
        patterns = read_gtfs(path, FRAME, HALF).patterns
    for pattern in patterns:
        assert len(pattern.travel) == len(pattern.stops)
        assert list(pattern.travel) == sorted(pattern.travel)


@given(st.integers(0, 99), st.integers(0, 59), st.integers(0, 59))
def test_times_run_beyond_midnight(hour: int, minute: int, second: int) -> None:
    assert seconds_of(f" {hour}:{minute:02}:{second:02}") == hour * 3600 + minute * 60 + second


def test_route_types_of_both_tables() -> None:
    assert [kind_of(t) for t in ("3", "3.0", "200", "700", "716", "11", "0", "900", "1", "717", "")] == [
        "bus", "bus", "bus", "bus", "bus", "bus", "tram", "tram", None, None, None,
    ]  # fmt: skip


def test_the_old_towns_feed_is_the_one_of_2016(shared_data: Path) -> None:
    feed = read_gtfs(shared_data / "places" / "heidelberg" / "gtfs_rnv_2016.zip", FRAME, HALF)
    assert {route.name for route in feed.routes} == {"30", "31", "32", "33", "35", "M2", "M4", "M5"}
    assert feed.attribution == "Rhein-Neckar-Verkehr GmbH (rnv)"
    assert feed.day == "2016-09-23"
    there = next(p for p in feed.patterns if p.route == "33" and p.stops[0] == "118101")
    assert len(there.departures) == 53
    assert there.travel == (0, 60, 120)


def test_the_cut_feed_of_2022_has_two_lines_there(shared_data: Path) -> None:
    feed = read_gtfs(shared_data / "places" / "heidelberg" / "gtfs_vrn_cut_2022.zip", FRAME, HALF)
    assert {route.name for route in feed.routes} == {"RNV 20", "RNV 30"}
