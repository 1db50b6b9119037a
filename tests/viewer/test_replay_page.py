"""The replay page: one file that holds everything, whatever names its people bear."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vico.sim.recording import read_run
from vico.viewer.replay import UNIT, RecordedEvent, Recording, page_data, recording_of, write_replay
from vico.world.world import World

HIDDEN = -32768


@pytest.fixture(scope="module")
def recording(helsinki_run: tuple[Path, dict[str, Any]]) -> Recording:
    return recording_of(read_run(helsinki_run[0]))


def decoded(data: dict[str, Any]) -> np.ndarray:
    """Tracks as the page's script decodes them."""
    whole = np.frombuffer(base64.b64decode(data["tracks"]), "<i2").reshape(data["steps"] + 1, len(data["bodies"]), 3)
    tracks = whole.astype(np.float64) * [data["unit"], data["unit"], 1e-4]
    tracks[(whole == HIDDEN).all(axis=-1)] = np.nan
    return tracks


def embedded(path: Path) -> dict[str, Any]:
    """The data a browser finds in the page: the text up to the first end of a script element."""
    page = path.read_text(encoding="utf-8")
    text = re.split(r"</script", page.split('<script id="data" type="application/json">')[1], flags=re.IGNORECASE)[0]
    content: dict[str, Any] = json.loads(text)
    return content


def test_tracks_read_back_within_two_centimetres(recording: Recording, helsinki: World) -> None:
    tracks = decoded(page_data(recording, helsinki))
    there = np.isfinite(recording.tracks).all(axis=-1)
    assert there.sum() > 50
    assert np.abs(tracks[there][:, :2] - recording.tracks[there][:, :2]).max() <= UNIT
    turn = tracks[there][:, 2] - recording.tracks[there][:, 2]
    assert np.abs(np.remainder(turn + np.pi, 2 * np.pi) - np.pi).max() <= 1e-3


def test_who_is_not_there_is_hidden(recording: Recording, helsinki: World) -> None:
    tracks = recording.tracks.copy()
    tracks[3:, 1] = np.nan
    data = page_data(replace(recording, tracks=tracks), helsinki)
    gone = np.isnan(decoded(data)).all(axis=-1)
    assert gone[3:, 1].all()
    assert not gone[:3, 1].any()


def test_far_bodies_keep_their_places(recording: Recording, helsinki: World) -> None:
    tracks = recording.tracks.copy()
    tracks[:, 0, 0] = 1900.0  # in a window of 4 km
    data = page_data(replace(recording, tracks=tracks), helsinki)
    assert np.abs(decoded(data)[:, 0, 0] - 1900.0).max() <= data["unit"] <= 0.1


def test_no_name_can_break_out_of_the_page(recording: Recording, helsinki: World, tmp_path: Path) -> None:
    evil = '</script><script>alert(1)</script><!-- \u2028 & \\" é'
    name = next(iter(recording.people))
    people = recording.people | {name: recording.people[name] | {"name": evil, "about": evil}}
    events = [RecordedEvent(1, "message", name, evil, (0.0, 0.0))]
    write_replay(tmp_path / "r.html", replace(recording, people=people, events=events), helsinki)
    plain = tmp_path / "plain.html"
    write_replay(plain, recording, helsinki)
    # The page as a browser cuts it: as many elements as without the name, and the name whole inside the data.
    assert len(re.findall("<script", (tmp_path / "r.html").read_text())) == len(
        re.findall("<script", plain.read_text())
    )
    data = embedded(tmp_path / "r.html")
    assert data["events"][0]["text"] == evil
    assert next(agent for agent in data["agents"] if agent["id"] == name)["name"] == evil
    assert "<!--" not in (tmp_path / "r.html").read_text().replace("<!doctype", "")


def test_the_page_asks_nothing_of_the_network(recording: Recording, helsinki: World, tmp_path: Path) -> None:
    write_replay(tmp_path / "r.html", recording, helsinki, picture=np.zeros((64, 64, 3), np.uint8))
    page = (tmp_path / "r.html").read_text()
    assert re.findall(r"https?://|//cdn|@import|\burl\(", page) == []
    assert [link for link in re.findall(r"""(?:src|href)\s*=\s*["']([^"']*)""", page) if link] == []
    assert page.count("data:image/webp;base64,") == 1 + len(embedded(tmp_path / "r.html")["agents"][0]["pictures"])


def test_the_page_tells_who_does_what_when(recording: Recording, helsinki: World, tmp_path: Path) -> None:
    write_replay(tmp_path / "r.html", recording, helsinki)
    data = embedded(tmp_path / "r.html")
    assert (data["start"], data["steps"]) == (8 * 3600, 8)
    assert {body["kind"] for body in data["bodies"]} >= {"resident", "robot", "car", "pedestrian"}
    residents = [agent for agent in data["agents"] if agent["schedule"]]
    assert len(residents) == 4
    for person in residents:
        assert person["schedule"][0]["start"] == "00:00:00"
        assert person["about"]
    seen = {agent["id"]: agent["pictures"] for agent in data["agents"]}
    assert [step for step, _ in seen["resident_0"]] == [0]
    assert seen["resident_1"] == []
    assert data["credit"] == "© OpenStreetMap contributors"
    assert len(data["buildings"]) == len(helsinki.buildings)
    assert len(data["places"]) == len(helsinki.places)
