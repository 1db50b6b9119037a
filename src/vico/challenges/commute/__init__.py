"""The commute challenge: a resident's day of appointments, by foot, bus, tram and rented bicycle."""

from vico.challenges.commute.challenge import COMMUTE, play_day
from vico.challenges.commute.generate import generate_commute
from vico.challenges.commute.tasks import CommuteTask, read_task, write_task

__all__ = ["COMMUTE", "CommuteTask", "generate_commute", "play_day", "read_task", "write_task"]
