"""A main agent in the simulation: it walks to members, talks with them, and goes on to the next."""

from __future__ import annotations

import math

import numpy as np

from vico.agents.base import Action, Info, Observation
from vico.agents.influence.courtship import Courtship
from vico.agents.influence.situation import TALKING_DISTANCE
from vico.agents.influence.visiting import Visitor, seen_body
from vico.agents.influence.visits import Ending
from vico.agents.state import AgentState, generator_state, restore_generator
from vico.clock import DAY
from vico.rules import WALK_SPEED
from vico.seeds import rng
from vico.world.public import PublicMap

# One thinks again after so many seconds where there is nobody to see, waits so long for an answer, and looks for
# somebody no longer than the way takes and so many seconds more.
_THINK, _ANSWER, _SEARCH = 30.0, 6.0, 600.0
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
        return self._begin(observation, info, time) if step is None else step

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
        self._thinks_at = time + _THINK
        here = self._door(observation)
        of_day = time % DAY
        seconds_to = self._seconds_from(here)
        target = self.courtship.choose(of_day, here, seconds_to)
        stay = None if target is None else self.courtship.meeting(target, of_day, seconds_to)
        if target is None or stay is None or stay.place is None:
            return False
        self._target = target
        starts = time + max(0.0, stay.start - of_day)
        self._until = max(time + 1.5 * seconds_to(stay.place), starts) + _SEARCH
        self._visitor.start(target, stay.place)
        self.courtship.set_out(target, stay.place, of_day)
        return True

    def _begin(self, observation: Observation, info: Info, time: float) -> Action:
        self._talks = True
        self.courtship.begin(self._target, time % DAY)
        return self._say(observation, info, time)

    def _talk(self, observation: Observation, info: Info, time: float) -> Action:
        """Wait for the answer, then say the next thing."""
        answers = [
            e["text"] for e in observation["events"] if e["speaker"] == self._target and e["time"] >= self._spoke_at
        ]
        if answers:
            self.courtship.heard(answers[-1])
            if _ON_THE_WAY in answers[-1].lower():
                return self._break_off(time, "on the way")
            return self._say(observation, info, time)
        return {"type": "wait"} if time - self._spoke_at <= _ANSWER else self._break_off(time, "no answer")

    def _say(self, observation: Observation, info: Info, time: float) -> Action:
        seen = seen_body(info, self._target)
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

    def _seconds_from(self, here: tuple[float, float]) -> _Ways:
        return _Ways(self._map, here, self._ways)


class _Ways:
    """Tells how long walks to places take; positions a few metres apart share their answers."""

    def __init__(self, public_map: PublicMap, here: tuple[float, float], known: dict[tuple[int, int, str], float]):
        self._map, self._here, self._known = public_map, here, known

    def __call__(self, place: str) -> float:
        key = (round(self._here[0] / 8.0), round(self._here[1] / 8.0), place)
        if key not in self._known:
            known = self._map.place_by_id.get(place)
            far = math.inf if known is None else self._map.router.seconds(self._here, known.position, WALK_SPEED)
            self._known[key] = far
        return self._known[key]
