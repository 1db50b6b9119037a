"""What children do between getting up and lying down that is fixed: lessons, lunch at school, waiting to be fetched."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vico.community.childhood import childhood
from vico.community.day import MIDNIGHT, Block, Day, in_fives
from vico.community.model import ActivityTag, ItemType
from vico.community.people import Lessons, ResidentDraft
from vico.community.place_index import PlaceIndex

# Sleep that children need by age, minutes (American Academy of Sleep Medicine, 2016, middle of the ranges).
_AGES, _SLEEP = (5, 9, 13, 17), (650, 610, 560, 510)
# When they wake by themselves, minutes of the day, by age.
_WAKE = (405, 410, 425, 450)
# Around when lunch is, and how long it takes, minutes.
_NOON, _LUNCH = 11 * 60 + 50, 30
# Stretches of lessons at home, minutes of the day.
_AT_HOME = ((9 * 60, 12 * 60), (13 * 60, 16 * 60))


class SchoolDays:
    """Writes children's days at school, or at home where there is none.

    Parameters
    ----------
    rng
        Decides what is left open.
    put
        Puts a block into a day in which it fits.
    """

    def __init__(self, rng: np.random.Generator, index: PlaceIndex, put: Callable[[Day, Block], None]) -> None:
        self._rng, self._index, self._put = rng, index, put

    @staticmethod
    def sleep(rng: np.random.Generator, draft: ResidentDraft) -> tuple[float, float]:
        """Return when a child wakes by itself, minute of the day, and how long it sleeps, minutes."""
        natural = float(np.interp(draft.age, _AGES, _WAKE)) + 40 * (1 - draft.early)
        return natural, float(np.interp(draft.age, _AGES, _SLEEP))

    def write(self, draft: ResidentDraft, day: Day) -> None:
        """Put a child's school day in; there may be none."""
        lessons = draft.lessons
        if lessons is None:
            return
        if lessons.place is None:
            self._at_home(day)
        elif draft.shift is not None:
            self._at_school(draft, day, lessons)

    def _at_school(self, draft: ResidentDraft, day: Day, lessons: Lessons) -> None:
        assert lessons.school is not None
        assert lessons.place is not None
        assert draft.shift is not None
        rng, school, (start, end) = self._rng, lessons.school, draft.shift
        words = childhood()
        over = min(end, max(lessons.end, lessons.start + 60))
        noon = int(np.clip(in_fives(_NOON + float(rng.integers(-2, 5)) * 5), start + 60, over - _LUNCH))
        study = ActivityTag.STUDY
        lunch = words.at_home.at_school[int(rng.integers(len(words.at_home.at_school)))]
        blocks = [Block(start, noon, ItemType.MAIN, school.morning, lessons.place, "work", study)]
        blocks.append(Block(noon, noon + _LUNCH, ItemType.MEAL, lunch, lessons.place, "lunch"))
        if over - noon - _LUNCH >= 10:
            blocks.append(Block(noon + _LUNCH, over, ItemType.MAIN, school.afternoon, lessons.place, "work", study))
        else:
            blocks[-1].end = over
        if end > over:
            blocks.append(Block(over, end, ItemType.MAIN, school.club, lessons.place, "work", ActivityTag.LEISURE))
        for block in blocks:
            self._put(day, block)

    def _at_home(self, day: Day) -> None:
        words = childhood().home_school
        for window, text in zip(_AT_HOME, (words.morning, words.afternoon), strict=True):
            for minutes in (150, 120, 90, 60):
                starts = day.starts(day.home, minutes, window, [(0, MIDNIGHT)])
                if starts:
                    block = Block(
                        starts[0], starts[0] + minutes, ItemType.MAIN, text, day.home, "work", ActivityTag.STUDY
                    )
                    if day.add(block):
                        break
