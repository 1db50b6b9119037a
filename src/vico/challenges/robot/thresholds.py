"""Every number that the community robot tasks are judged and drawn by (spec, section 4.3), in one place."""

from __future__ import annotations

#: Longest duration of an episode, seconds, and how often robots act, seconds: 20 Hz unless a setting says otherwise.
STEPS, PERIOD = 1500, 0.05

#: Deliver: the thing lies within this distance of the spot, metres. Carry: of the home's entrance, or inside.
DESTINATION_RADIUS = HOME_RADIUS = 3.0

#: A thing that moves less than this in a second is at rest, metres; for so long it has to be, seconds.
AT_REST, RESTS_FOR = 0.02, 1.0

#: Nearer than this to the person one goes along with them, metres (the paper's Carry).
FOLLOW_DISTANCE = 5.0

#: Walks from the start that tasks ask for, metres: robots drive at 0.8 m/s at most.
REACH, CARRY_REACH = 120.0, 200.0
#: Things lie within this distance of the middle of the region that is told, metres.
SOURCE_RADIUS = 6.0
#: The thing and the destination, or the start and the home, are so far from each other at least, metres.
APART = 20.0

#: The person walks home so fast, metres a second, and waits so long beside what they put down, seconds.
PACE_HOME, WAITS = 0.6, 60.0

#: A thing was found once so many pixels of it were in view of a robot within so many metres.
SEEN_PIXELS, SEEN_DISTANCE = 20, 10.0
#: A robot with an arm came to the thing within this distance, metres.
REACHED = 1.2
#: Tasks are drawn where the manipulator can come so near to the thing, and to where it is to be, and the carrier to
#: both, metres.
ARM_COMES, GOAL_COMES, CARRIER_COMES = 0.6, 2.0, 4.0

#: Things lie, and are put down, on ground that rises by so much a metre at most.
LEVEL = 0.1

#: People who live in the world.
RESIDENTS = 15

#: The jaw is so much wider than a thing, metres, on each side; things are so high at least and at most, metres.
JAW_ROOM, LOWEST, HIGHEST = 0.025, 0.05, 0.6
