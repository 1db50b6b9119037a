"""The teaming challenge, as `vico eval teaming` plays it."""

from __future__ import annotations

from vico.agents.teaming import METHODS
from vico.challenges.of_robots import RobotsChallenge
from vico.challenges.records import Metric
from vico.challenges.teaming.episode import play_teaming_task
from vico.challenges.teaming.generate import generate_teaming_task
from vico.challenges.teaming.judge import CAUSES
from vico.challenges.teaming.model import CATEGORIES, Category, TeamingTask
from vico.challenges.teaming.thresholds import PERIOD, PERIODS, RESIDENTS, STEPS

_SR = Metric("SR", "SR", "%", "higher", 0.0, 100.0, about="success rate: episodes whose task was done")
_TS = Metric("Ts", "Ts", "s", "lower", 0.0, about="seconds until it was; the limit where it was not")
_TOGETHER = Metric(
    "together", "Together on the way", "%", "higher", 0.0, 100.0, about="share of the way on which they were near"
)
_SEEN = Metric("seen", "Thing first in view", "s", "lower", 0.0, about="seconds until the drone had the thing in view")

#: A humanoid, a quadruped and a drone at work with a person or another robot; see `vico.challenges.teaming`.
#:
#: Settings of a job: ``steps``, seconds at most; ``period``, seconds between two actions of a robot.
TEAMING: RobotsChallenge[Category, TeamingTask] = RobotsChallenge(
    name="teaming",
    categories=CATEGORIES,
    methods=METHODS,
    residents=RESIDENTS,
    steps=STEPS,
    period=PERIOD,
    periods=PERIODS,
    columns={"accompany": (_SR, _TS, _TOGETHER), "guide": (_SR, _TS, _TOGETHER), "spot": (_SR, _TS, _SEEN)},
    failures=CAUSES,
    draw_task=generate_teaming_task,
    play_task=play_teaming_task,
)
