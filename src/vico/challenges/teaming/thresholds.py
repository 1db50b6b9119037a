"""Every number that the teaming tasks are judged and drawn by, in one place."""

from __future__ import annotations

#: Longest duration of an episode, seconds; how often robots act, seconds, and bounds of that.
STEPS, PERIOD, PERIODS = 600, 0.5, (0.02, 1.0)

#: Walks that tasks ask for, metres: at least, at most.
LEAST_WALK, MOST_WALK = 15.0, 45.0
#: The person waits so far from the robot at the start, metres; robots of a team stand so far apart.
WAITS_WITHIN, BESIDE = (3.0, 8.0), (2.0, 6.0)
#: Walking pace of the people, metres a second (the old are slower, as they are else).
PACES = (0.5, 0.8)

#: A robot is upright that leans no more than this, cosine of the angle; slower than this it stands, metres a second,
#: and for so long it has to, seconds.
UPRIGHT, STILL, STANDS_FOR = 0.9, 0.15, 2.0

#: Accompany: nearer than this to the person one walks with them, metres; for this share of the way at least.
WITH_DISTANCE, WITH_SHARE = 4.0, 0.8
#: Nearer than this to the door one waits at it, metres; one is to be there so soon after the person went in, seconds,
#: and for this share of the time from then until they come out.
DOOR_DISTANCE, DOOR_GRACE, DOOR_SHARE = 4.0, 20.0, 0.9
#: Who comes out again stays inside for so long, seconds.
STAYS = (25.0, 45.0)

#: Guide: the person follows a robot that is nearer than this and in sight, metres; who has had none in sight for so
#: many seconds gives up.
FOLLOWS_WITHIN, GIVES_UP = 7.0, 60.0
#: Both are there within this of the destination, metres, and no farther apart than the second.
ARRIVED, TOGETHER = 4.0, 4.0
#: How often the person stops on the way to look at something, at most, and for how long, seconds.
MOST_PAUSES, PAUSES = 2, (6.0, 14.0)

#: Spot: radius of the area in which the thing lies, metres; the robots begin so far from its middle.
AREA, AREA_WITHIN = 15.0, (20.0, 35.0)
#: The robot on the ground stands beside the thing within this distance, metres.
BESIDE_THING = 2.0
#: A thing was in view once so many pixels of it were, within so many metres.
SEEN_PIXELS, SEEN_DISTANCE = 4, 30.0
#: Robots on the ground that the thing may be brought to, by chance.
GROUND_ROBOTS = ("go2", "husky")
#: Things are so large that they are seen from above: their two largest sides, multiplied, square metres.
LEAST_AREA = 0.06

#: People who live in the world.
RESIDENTS = 15
