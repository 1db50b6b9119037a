"""The commute challenge: a resident's day of appointments, by foot, bus, tram and rented bicycle."""

from vico.challenges.commute.challenge import COMMUTE
from vico.challenges.commute.generate import generate_commute
from vico.challenges.commute.model import CommuteTask, read_task, write_task
from vico.challenges.commute.play import play_day

__all__ = ["COMMUTE", "CommuteTask", "generate_commute", "play_day", "read_task", "write_task"]
