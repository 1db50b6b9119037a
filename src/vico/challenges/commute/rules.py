"""The numbers of the commute challenge, all in one place; docs/commute.md explains them."""

from __future__ import annotations

from vico.rules import BIKE_SPEED, WALK_SPEED

#: Who is this near to the point of an appointment, on foot or on a bicycle (at the day's last one on foot), is there,
#: metres.
ARRIVAL = 3.0
#: Who is this far from where a commute began has left, metres.
LEFT = 5.0

#: Places of a day, and how far one lies from the next at least, metres as the crow flies.
LEAST_PLACES, MOST_PLACES = 4, 8
LEAST_LEG = 250.0
#: Places of which each is chosen.
CANDIDATES = 9

#: Between the end of a stay and the start of the next there are the metres as the crow flies at `WALK_SPEED`, and a
#: share of that time more, drawn from this range.
SLACK = (0.3, 1.1)

#: A stay takes so long at least, and the last one so long exactly: who is not there by then does not arrive; seconds.
LEAST_STAY = 300
LAST_STAY = 900

#: From the end of the first stay to the end of the last, hours, unless a job's setting says otherwise; and its bounds.
#: A day that does not fit is longer: with the least of them stays take no longer than they must, and nearly all that is
#: simulated are ways.
HOURS = 1.0
LEAST_HOURS, MOST_HOURS = 1.0, 14.0
#: The first stay ends in the hour from here on; bounds of all times; seconds of the day.
MORNING = 8 * 3600
EARLIEST, LATEST_END = 5 * 3600, 86_399

#: What an agent may do; `wait` is doing nothing.
LEGAL = ("move_forward", "turn_left", "turn_right", "enter_bus", "exit_bus", "enter_bike", "exit_bike", "wait")
#: Metres a step on foot, and on a bicycle; nobody runs.
MOST_ON_FOOT, MOST_ON_BIKE = WALK_SPEED, BIKE_SPEED

#: In a window of 800 m; smaller ones have as many for their size.
CARS, PEDESTRIANS = 30, 30
