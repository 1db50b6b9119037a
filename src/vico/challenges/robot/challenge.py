"""The community robot challenge, as `vico eval robot` plays it."""

from __future__ import annotations

from vico.agents.robot import METHODS
from vico.challenges.of_robots import RobotsChallenge
from vico.challenges.records import OF_POLICIES, Metric
from vico.challenges.robot.episode import play_robot_task
from vico.challenges.robot.generate import generate_robot_task
from vico.challenges.robot.judge import CAUSES
from vico.challenges.robot.model import CATEGORIES, Category, RobotTask
from vico.challenges.robot.policy_files import LEARNED
from vico.challenges.robot.thresholds import PERIOD, RESIDENTS, STEPS

_SR = Metric("SR", "SR", "%", "higher", 0.0, 100.0, about="success rate: episodes in which the thing was brought")
_TS = Metric("Ts", "Ts", "s", "lower", 0.0, about="seconds until it was; the limit where it was not")
_TOGETHER = Metric(
    "together", "With the person on the way home", "%", "higher", 0.0, 100.0,
    about="share of the person's way home on which a robot was near",
)  # fmt: skip
_FORCE = Metric("force", "Grip on the weaker finger", "N", "higher", 0.0, about="force that held the thing")
_DROPS = Metric("drops", "Drops", "an episode", "lower", 0.0, digits=2, about="times that the thing was let fall")
# Robots act 10 to 100 times a second.
_PERIODS = (0.01, 0.1)

#: Carry and Deliver by a mobile manipulator and a carrier, with real contact; see `vico.challenges.robot.generate`.
#:
#: Settings of a job: ``steps``, seconds at most; ``period``, seconds between two actions of a robot; ``oracle_grasp``,
#: whether hands never lose what they closed on; of methods that were learned ``policy``, where theirs lies, and its
#: hash ``policy_sha256``.
ROBOT: RobotsChallenge[Category, RobotTask] = RobotsChallenge(
    name="robot",
    categories=CATEGORIES,
    methods=(*METHODS, *LEARNED),
    residents=RESIDENTS,
    steps=STEPS,
    period=PERIOD,
    periods=_PERIODS,
    columns={"carry": (_SR, _TS, _TOGETHER, _DROPS, _FORCE), "deliver": (_SR, _TS, _DROPS, _FORCE)},
    failures=dict.fromkeys(CATEGORIES, CAUSES),
    draw_task=generate_robot_task,
    play_task=play_robot_task,
    settings=("oracle_grasp", *OF_POLICIES),
    told_settings="steps, period and oracle_grasp",
)
