"""A main agent: its mind, which has no body, and its agent in the simulation.

`Courtship` holds a strategy, its conversations, and whom it has given up on for a while. `MainAgent` walks to members,
talks with them, and goes on to the next.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from vico.agents.base import Action, AgentState, Info, Observation, generator_state, restore_generator
from vico.agents.influence.situation import (
    ROUNDS,
    TALKING_DISTANCE,
    DayPlan,
    Ending,
    PlannedStay,
    Profile,
    Situation,
    Talk,
    Visit,
)
from vico.agents.influence.strategies import Strategy, shorten
from vico.agents.influence.visiting import Visitor, body_in_view
from vico.clock import DAY
from vico.rules import WALK_SPEED
from vico.seeds import rng
from vico.world.public import PublicMap

# Who cannot be met, or gives no answer, is left alone for so long, seconds.
GIVE_UP_TIME = 600.0
# A member is met so long after they are to be there, seconds: people are late.
_SETTLED_AFTER = 30.0
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

    def meeting(self, member: str, time: float, seconds_to: Callable[[str], float]) -> PlannedStay | None:
        """Return the stay in which a member is met if one sets out now; None if there is none left today."""
        for stay in self._days[member].chances(time, self.ends):
            assert stay.place is not None
            if max(time + seconds_to(stay.place), stay.start + _SETTLED_AFTER) < min(stay.end, self.ends):
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
        said = None if said is None else shorten(said, _LONGEST)
        if not said:
            if talk.said:
                self._end_visit("talked", time)
            else:  # nothing new to say to them: others first
                self.give_up(talk.target, time, "nothing to say")
            return None
        talk.said.append(said)
        return f"{self._address[talk.target]}! {said[0].upper()}{said[1:]}"

    def note_answer(self, answer: str) -> None:
        """Note what the member answered."""
        self.talks[-1].answers.append(shorten(answer, _LONGEST))

    def give_up(self, member: str, time: float, why: Ending) -> None:
        """End the visit to a member, and leave them alone for a while."""
        self._not_before[member] = time + GIVE_UP_TIME
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
        self.talks = [_talk_from_record(state["talks"][str(k)]) for k in range(len(state["talks"]))]
        self.visits = [Visit(**state["visits"][str(k)]) for k in range(len(state["visits"]))]
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


def _talk_from_record(record: Mapping[str, Any]) -> Talk:
    said, answers = ([str(text) for text in record[name]] for name in ("said", "answers"))
    return Talk(str(record["target"]), float(record["began"]), said, answers)


_THINK_TIME = 30.0  # seconds until one thinks again where there is nobody to see
_ANSWER_TIME = 6.0  # seconds that one waits for an answer
_SEARCH_TIME = 600.0  # seconds that one looks for somebody, beside those of the way
# How far a voice is to carry, metres.
_VOICE = 3.0
_ON_THE_WAY = "on my way"


class MainAgent:
    """Courts members for a day, from observations, the public map and what is public of people alone.

    Parameters
    ----------
    courtship
        Decides whom to see and what to say.
    public_map
        Streets and places.
    seed
        Of the run.
    """

    def __init__(self, courtship: Courtship, public_map: PublicMap, *, seed: int = 0) -> None:
        self.courtship = courtship
        self._map = public_map
        self._rng = rng(seed, "main agent", courtship.me.id)
        self._visitor = Visitor(public_map, self._rng)
        self._target = ""
        self._thinks_at = self._until = -math.inf
        self._talks = False
        self._spoke_at = -math.inf
        self._ways: dict[tuple[int, int, str], float] = {}

    @property
    def tokens(self) -> int:
        """Tokens of language models that were used."""
        return sum(asker.usage.tokens for asker in self.courtship.strategy.askers)

    @property
    def cost(self) -> float:
        """US dollars that were spent."""
        return sum(asker.usage.cost for asker in self.courtship.strategy.askers)

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming second."""
        time = float(observation["state"]["time"])
        if self._talks:
            return self._talk(observation, info, time)
        if not self._target and not self._choose(observation, time):
            return {"type": "wait"}
        step = self._visitor.towards(observation, info)
        if self._visitor.failure:
            return self._give_up(time, self._visitor.failure)
        if step is not None and time > self._until:
            return self._give_up(time, "not found" if self._visitor.is_there else "not reached")
        if step is not None:
            return step
        self._talks = True
        self.courtship.begin(self._target, time % DAY)
        return self._say(observation, info, time)

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "generator": generator_state(self._rng),
            "courtship": self.courtship.state(),
            "visitor": self._visitor.state(),
            "target": self._target,
            "talks": self._talks,
            "times": np.array([self._thinks_at, self._until, self._spoke_at]),
        }

    def restore(self, state: AgentState) -> None:
        """Go on where another one was."""
        restore_generator(self._rng, state["generator"])
        self.courtship.restore(state["courtship"])
        self._visitor.restore(state["visitor"])
        self._target, self._talks = str(state["target"]), bool(state["talks"])
        self._thinks_at, self._until, self._spoke_at = (float(t) for t in state["times"])

    def _choose(self, observation: Observation, time: float) -> bool:
        """Choose whom to see and set out; return whether there is anybody."""
        if time < self._thinks_at:
            return False
        self._thinks_at = time + _THINK_TIME
        here = self._door(observation)
        of_day = time % DAY
        seconds_to = self._seconds_from(here)
        target = self.courtship.choose(of_day, here, seconds_to)
        stay = None if target is None else self.courtship.meeting(target, of_day, seconds_to)
        if target is None or stay is None or stay.place is None:
            return False
        self._target = target
        starts = time + max(0.0, stay.start - of_day)
        self._until = max(time + 1.5 * seconds_to(stay.place), starts) + _SEARCH_TIME
        self._visitor.start(target, stay.place)
        self.courtship.set_out(target, stay.place, of_day)
        return True

    def _talk(self, observation: Observation, info: Info, time: float) -> Action:
        """Wait for the answer, then say the next thing."""
        answers = [
            e["text"] for e in observation["events"] if e["speaker"] == self._target and e["time"] >= self._spoke_at
        ]
        if answers:
            self.courtship.note_answer(answers[-1])
            if _ON_THE_WAY in answers[-1].lower():
                return self._break_off(time, "on the way")
            return self._say(observation, info, time)
        return {"type": "wait"} if time - self._spoke_at <= _ANSWER_TIME else self._break_off(time, "no answer")

    def _say(self, observation: Observation, info: Info, time: float) -> Action:
        seen = body_in_view(info, self._target)
        if seen is not None and seen[2] > TALKING_DISTANCE:
            return self._break_off(time, "no answer")
        here = self._door(observation)
        text = self.courtship.message(time % DAY, here, self._seconds_from(here))
        if text is None:
            self._end()
            return {"type": "wait"}
        self._spoke_at = time
        return {"type": "communicate", "text": text, "range": _VOICE}

    def _break_off(self, time: float, why: Ending) -> Action:
        self.courtship.break_off(time % DAY, why)
        self._end()
        return {"type": "wait"}

    def _give_up(self, time: float, why: Ending) -> Action:
        self.courtship.give_up(self._target, time % DAY, why)
        self._end()
        return {"type": "wait"}

    def _end(self) -> None:
        self._target, self._talks, self._thinks_at = "", False, -math.inf

    def _door(self, observation: Observation) -> tuple[float, float]:
        """Return where ways begin, ENU metres: where one stands; indoors, before the door of the place."""
        inside = self._map.place_by_id.get(observation["state"]["place"])
        x, y = observation["pose"][:2] if inside is None else inside.position[:2]
        return float(x), float(y)

    def _seconds_from(self, here: tuple[float, float]) -> _WalkTimes:
        return _WalkTimes(self._map, here, self._ways)


class _WalkTimes:
    """Tells how long walks to places take; positions a few metres apart share their answers."""

    def __init__(
        self, public_map: PublicMap, here: tuple[float, float], known: dict[tuple[int, int, str], float]
    ) -> None:
        self._map, self._here, self._known = public_map, here, known

    def __call__(self, place: str) -> float:
        key = (round(self._here[0] / 8.0), round(self._here[1] / 8.0), place)
        if key not in self._known:
            known = self._map.place_by_id.get(place)
            far = math.inf if known is None else self._map.router.seconds(self._here, known.position, WALK_SPEED)
            self._known[key] = far
        return self._known[key]
