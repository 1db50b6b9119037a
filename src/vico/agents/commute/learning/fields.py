"""Names of the numbers that an agent of the abstract city is made of, of its actions, and of what a policy sees."""

from __future__ import annotations

import math

#: Columns of the state of agents. Time, due and since are seconds of the day; positions ENU metres; heading radians
#: counter-clockwise from east. Call and round are of the bus one rides; last is 1 on a day's last commute.
(X, Y, HEADING, VEHICLE, TIME, DUE, GOAL_X, GOAL_Y, CASH, SINCE, CALL, ROUND, HIT, BEGAN, LAST) = range(15)
ALL_FIELDS = 15

#: What one rides.
FOOT, BIKE, BUS = range(3)

#: Actions by number; forward is a step of 1 m on foot and of 3 m on a bicycle, a turn is 30 degrees.
(FORWARD, TURN_LEFT, TURN_RIGHT, ENTER_BUS, EXIT_BUS, ENTER_BIKE, EXIT_BIKE) = range(7)
ACTIONS = ("move_forward", "turn_left", "turn_right", "enter_bus", "exit_bus", "enter_bike", "exit_bike")
TURN = math.radians(30.0)

#: Rays along which one sees how far it is to what stands in the way, the first ahead, counter-clockwise.
RAYS = 16

#: What a policy sees, in order. Directions are cosine and sine from ahead, and ``log(1 + metres) / 6``.
SEEN_NAMES = (
    "goal_ahead",
    "goal_left",
    "goal_distance",
    "time_left",
    "on_foot",
    "on_bicycle",
    "in_bus",
    "was_stopped",
    "cash",
    "station_ahead",
    "station_left",
    "station_distance",
    "station_gives",
    "station_takes",
    "stop_ahead",
    "stop_left",
    "stop_distance",
    "bus_soon",
    "last",
    *(f"free_{round(360 * k / RAYS)}" for k in range(RAYS)),
)
SEEN = len(SEEN_NAMES)
