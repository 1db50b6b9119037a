"""Who waits at a stop: comes up to it when the bus is due, boards from as near as one gets, and keeps off tracks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from vico.agents.travel import Traveller
from vico.rules import STATION_REACH, TRAM_WIDTH, ReasonCode, code_name
from vico.seeds import rng
from vico.world.heights import HeightField
from vico.world.public import PublicMap
from vico.world.transit import Line, Stop, TramLine
from vico.world.walkable import BLOCKED, ROADWAY, SIDEWALK, WalkableMap

HALF, EIGHT = 200.0, 8 * 3600.0
#: Where one waits for line a and, 30 m on, for line b; both go to the last stop. The road is south of y = 0, a track
#: north of the pavement.
STOP, OTHER_STOP, LAST_STOP = (-150.0, 1.0), (-120.0, 1.0), (150.0, 1.0)
TRACK_Y = 8.0
GOAL = (150.0, 3.0)
NO_VEHICLE, HIT_BODY = code_name(ReasonCode.NO_VEHICLE), code_name(ReasonCode.HIT_BODY)


def street(*solids: tuple[float, float, float]) -> PublicMap:
    """A street with two bus lines and a track; `solids` are circles (x, y, radius) where nobody can walk."""
    n = int(4 * HALF)
    axis = (np.arange(n) + 0.5) * 0.5 - HALF
    x, y = np.meshgrid(axis, axis)
    cls = np.where(y < 0.0, ROADWAY, SIDEWALK).astype(np.uint8)
    for cx, cy, radius in solids:
        cls[np.hypot(x - cx, y - cy) <= radius] = BLOCKED
    spots = {"first": STOP, "second": OTHER_STOP, "last": LAST_STOP}
    stops = [Stop(id=k, entity=1, name=k, wait=(*xy, 0.0), lane="", offset=0.0) for k, xy in spots.items()]
    lines = [
        Line(
            id=name,
            name=name,
            colour="#000000",
            stops=[begin, "last"],
            lanes=[],
            departures=[int(EIGHT) + wait + 600 * k for k in range(6)],
            travel=[0.0, 60.0, 120.0],
        )
        for name, begin, wait in (("a", "first", 60), ("b", "second", 90))
    ]
    track = TramLine(
        id="t", name="t", kind="tram", colour="#000000", track=[(-HALF, TRACK_Y), (HALF, TRACK_Y)], stops=[],
        offsets=[], departures=[], travel=[200.0],
    )  # fmt: skip
    return PublicMap(HALF, WalkableMap(cls, HALF), HeightField.flat(HALF), [], [], stops, lines, tram_lines=[track])


class Passenger:
    """Somebody on the way by bus, whom nothing stops but `ring`: others stand this near around the stop, metres."""

    def __init__(self, public: PublicMap, xy: tuple[float, float], *, ring: float = 0.0) -> None:
        self.xy, self.yaw, self.second, self.ring = np.array(xy), 0.0, EIGHT, ring
        self.traveller = Traveller(public, rng(0, "waits"), modes=("bus",))
        self.code, self.asked = "", ""

    @property
    def away(self) -> float:
        """Metres to the stop of line a."""
        return float(np.hypot(*(self.xy - STOP)))

    @property
    def line(self) -> str | None:
        """Which line the trip is by."""
        trip = self.traveller.trip
        return None if trip is None else next((leg.line for leg in trip.legs if leg.mode == "bus"), None)

    def act(self) -> None:
        """Do what the traveller says for a second; no bus ever comes."""
        state = {
            "vehicle": "",
            "time": self.second,
            "cash": 50.0,
            "action_status": "collision" if self.code == HIT_BODY else "ok",
            "action_code": self.code,
        }
        pose = np.array([*self.xy, 0.0, math.cos(self.yaw), math.sin(self.yaw), 0.0])
        action = self.traveller.towards(GOAL, {"pose": pose, "state": state}, {"entities": {}})
        assert action is not None
        self._do(action)
        self.second += 1.0

    def _do(self, action: dict[str, Any]) -> None:
        self.asked, self.code = str(action["type"]), ""
        if self.asked in ("turn_left", "turn_right"):
            self.yaw += math.radians(action["degrees"]) * (1 if self.asked == "turn_left" else -1)
        elif self.asked == "move_forward":
            there = self.xy + action["distance"] * np.array([math.cos(self.yaw), math.sin(self.yaw)])
            if np.hypot(*(there - STOP)) < self.ring:
                self.code = HIT_BODY
            else:
                self.xy = there
        elif self.asked == "enter_bus":
            self.code = NO_VEHICLE

    def until(self, what: str, seconds: int = 60) -> bool:
        """Act until something is asked for; return whether it was."""
        for _ in range(seconds):
            self.act()
            if self.asked == what:
                return True
        return False


def due(passenger: Passenger) -> float:
    """When the bus of the trip is to leave."""
    assert passenger.traveller.trip is not None
    return passenger.traveller.trip.legs[1].depart


def test_who_waits_beside_others_comes_up_to_the_stop_when_the_bus_is_due_and_not_before() -> None:
    waits = Passenger(street(), (-155.0, 1.0), ring=2.5)
    assert waits.until("enter_bus")
    assert 2.5 <= waits.away < 4.0
    waits.ring = 0.0  # the others go to their bus
    where, waits.second = waits.xy.copy(), due(waits) - 24.0
    while waits.second < due(waits) - 10.0:
        waits.act()
        assert waits.asked == "enter_bus"
    assert np.array_equal(waits.xy, where)
    while waits.second < due(waits):
        waits.act()
    assert waits.away < 1.5
    assert waits.until("enter_bus", 3)


def test_who_stands_at_the_stop_asks_for_the_bus_from_there_and_then_makes_room_for_it() -> None:
    waits = Passenger(street(), STOP)
    assert waits.until("enter_bus", 2)
    while waits.second < due(waits) - 20.0:
        waits.act()
        assert waits.asked == "enter_bus"
    furthest = 0.0
    while waits.second < due(waits) + 60.0:
        waits.act()
        furthest = max(furthest, float(waits.xy[1]) - STOP[1])
    assert furthest == pytest.approx(2.5, abs=0.3)  # back from the road


def test_where_something_stands_in_the_place_to_wait_one_boards_from_where_the_way_ends() -> None:
    waits = Passenger(street((STOP[0], 0.0, 2.5)), (-160.0, 1.0))
    assert waits.until("enter_bus")
    assert waits.line == "a"
    assert 1.3 < waits.away < 4.0


def test_where_the_way_ends_far_from_a_stop_one_takes_another() -> None:
    waits = Passenger(street((STOP[0], 0.0, 5.7)), (-160.0, 1.0))
    assert waits.until("enter_bus", 120)
    assert waits.line == "b"
    assert float(np.hypot(*(waits.xy - OTHER_STOP))) < STATION_REACH


def test_who_waited_in_vain_for_a_line_does_not_wait_for_it_again() -> None:
    waits = Passenger(street(), STOP)
    assert waits.until("enter_bus", 2)
    assert waits.line == "a"
    last = due(waits) + 240.0
    while waits.second <= last:
        waits.act()
        assert waits.line == "a"
    lines = set()
    for _ in range(120):
        waits.act()
        lines.add(waits.line)
    assert lines - {None} == {"b"}
    assert waits.asked == "enter_bus"
    assert float(np.hypot(*(waits.xy - OTHER_STOP))) < 1.5


@pytest.mark.parametrize(
    ("north", "is_free"),
    [(3.5, True), (TRACK_Y - TRAM_WIDTH / 2 - 0.9, True), (TRACK_Y - TRAM_WIDTH / 2 - 0.7, False), (-0.6, False)],
)
def test_nobody_waits_beside_others_on_a_track_or_on_the_road(north: float, is_free: bool) -> None:
    here = (STOP[0], north)
    stop = (STOP[0], north - 2.0 if north > 0 else 1.0)
    public = street()
    public.stops[0] = public.stops[0].model_copy(update={"wait": (*stop, 0.0)})
    waits = Passenger(public, here)
    waits.act()
    asked = []
    for _ in range(8):
        waits.xy, waits.code = np.array(here), HIT_BODY  # somebody stands before it
        waits.act()
        asked.append(waits.asked)
    assert ("enter_bus" in asked) == is_free


def test_who_can_come_no_nearer_to_a_stop_than_a_track_does_not_wait_there_but_goes_to_another() -> None:
    public = street((STOP[0], TRACK_Y - 5.0, 4.0))
    public.stops[0] = public.stops[0].model_copy(update={"wait": (STOP[0], TRACK_Y - 2.8, 0.0)})
    waits = Passenger(public, (STOP[0], TRACK_Y + 0.5))
    assert not waits.until("enter_bus", 12)
    assert waits.until("enter_bus", 120)
    assert waits.line == "b"
    assert abs(waits.xy[1] - TRACK_Y) > TRAM_WIDTH / 2 + 0.8
