"""The mind of a main agent: a strategy, its conversations, and whom it has given up on for a while. No body."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from vico.agents.influence.days import DayPlan, Stay
from vico.agents.influence.language import shortened
from vico.agents.influence.profiles import Profile
from vico.agents.influence.situation import ROUNDS, Situation, Talk
from vico.agents.influence.strategies import Strategy
from vico.agents.influence.visits import Ending, Visit, visit_of
from vico.agents.state import AgentState, generator_state, restore_generator
from vico.seeds import rng

# Who cannot be met, or gives no answer, is left alone for so long, seconds.
GIVEN_UP = 600.0
# A member is met so long after they are to be there, seconds: people are late.
_SETTLED = 30.0
_LONGEST = 800


class Courtship:
    """Decides whom to see and what to say, and remembers what came of it.

    Parameters
    ----------
    me, rival
        The main agents.
    members
        Profiles of the others.
    days
        Everybody's day, by id.
    address
        By id, what tells a member from the others when spoken to.
    strategy
        Whom to see, and what to say.
    ends
        When the day of talk is over, seconds of the day.
    seed
        Of the run. Chance hangs on it and on who `me` is, not on who is named first.

    Attributes
    ----------
    talks
        Conversations, the present one last.
    visits
        Whom one went to see, and what became of it; the present visit last.
    """

    def __init__(
        self,
        me: Profile,
        rival: Profile,
        members: Sequence[Profile],
        days: Mapping[str, DayPlan],
        address: Mapping[str, str],
        *,
        strategy: Strategy,
        ends: float,
        seed: int,
    ) -> None:
        self.me, self.rival, self.strategy, self.ends = me, rival, strategy, ends
        self._members = {profile.id: profile for profile in members}
        self._days, self._address = days, address
        self._rng = rng(seed, "courtship", me.id)
        self.talks: list[Talk] = []
        self.visits: list[Visit] = []
        self._not_before: dict[str, float] = {}

    def choose(self, time: float, here: tuple[float, float], seconds_to: Callable[[str], float]) -> str | None:
        """Return whom to see next; None to wait a little."""
        member = self.strategy.target.choose(self.situation(time, here, seconds_to), self._rng)
        return member if member in self._members else None

    def meeting(self, member: str, time: float, seconds_to: Callable[[str], float]) -> Stay | None:
        """Return the stay in which a member is met if one sets out now; None if there is none left today."""
        for stay in self._days[member].chances(time, self.ends):
            assert stay.place is not None
            if max(time + seconds_to(stay.place), stay.start + _SETTLED) < min(stay.end, self.ends):
                return stay
        return None

    def set_out(self, member: str, place: str, time: float) -> None:
        """Note that one sets out to see a member at a place."""
        self.visits.append(Visit(member, place, time, self.ends))

    def begin(self, member: str, time: float) -> None:
        """Note that a conversation begins."""
        self.talks.append(Talk(member, time))

    def message(self, time: float, here: tuple[float, float], seconds_to: Callable[[str], float]) -> str | None:
        """Return what is said next in the present conversation, with the listener's name first; None to end it."""
        talk = self.talks[-1]
        if len(talk.said) >= ROUNDS:
            self._end_visit("talked", time)
            return None
        said = self.strategy.dialogue.say(self.situation(time, here, seconds_to), talk, self._rng)
        said = None if said is None else shortened(said, _LONGEST)
        if not said:
            if talk.said:
                self._end_visit("talked", time)
            else:  # nothing new to say to them: others first
                self.give_up(talk.target, time, "nothing to say")
            return None
        talk.said.append(said)
        return f"{self._address[talk.target]}! {said[0].upper()}{said[1:]}"

    def heard(self, answer: str) -> None:
        """Note what the member answered."""
        self.talks[-1].answers.append(shortened(answer, _LONGEST))

    def give_up(self, member: str, time: float, why: Ending) -> None:
        """End the visit to a member, and leave them alone for a while."""
        self._not_before[member] = time + GIVEN_UP
        self._end_visit(why, time)

    def break_off(self, time: float, why: Ending) -> None:
        """End a conversation in which the last message was not listened to; `why` counts if no other one was."""
        talk = self.talks[-1]
        heard = len(talk.said) > 1 if why == "on the way" else bool(talk.answers)
        self.give_up(talk.target, time, "talked" if heard else why)

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "generator": generator_state(self._rng),
            "talks": {str(k): talk.record() for k, talk in enumerate(self.talks)},
            "visits": {str(k): visit.record() for k, visit in enumerate(self.visits)},
            "not_before": dict(self._not_before),
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        restore_generator(self._rng, state["generator"])
        self.talks = [_talk_of(state["talks"][str(k)]) for k in range(len(state["talks"]))]
        self.visits = [visit_of(state["visits"][str(k)]) for k in range(len(state["visits"]))]
        self._not_before = {str(name): float(time) for name, time in state["not_before"].items()}

    def _end_visit(self, ending: Ending, time: float) -> None:
        visit = self.visits[-1]
        visit.ending, visit.ended = ending, time

    def situation(self, time: float, here: tuple[float, float], seconds_to: Callable[[str], float]) -> Situation:
        """Return what is known when a target is chosen or something is said."""
        return Situation(
            time=time,
            ends=self.ends,
            here=here,
            me=self.me,
            rival=self.rival,
            members=self._members,
            days=self._days,
            talks=tuple(self.talks),
            not_before=self._not_before,
            seconds_to=seconds_to,
            address=self._address,
        )


def _talk_of(record: Mapping[str, Any]) -> Talk:
    said, answers = ([str(text) for text in record[name]] for name in ("said", "answers"))
    return Talk(str(record["target"]), float(record["began"]), said, answers)
