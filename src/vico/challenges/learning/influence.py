"""The influence challenge for one learner: whom to see next; see `vico.challenges.influence`.

What a main agent decides is whom it goes to see; what it says is a strategy's (`dialogue`). The day is played without
bodies (setting ``simulation="schedule"`` of the challenge), so that a step is a visit and a day takes a second.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from vico.agents.influence.situation import Situation
from vico.agents.influence.strategies import REVISIT_PAUSE, ExpectedGainTarget
from vico.challenges.influence import evaluate
from vico.challenges.influence.challenge import Mover, Walks, movers_of, next_visit, plans_of
from vico.challenges.influence.day import Day, make_day
from vico.challenges.influence.tasks import RESIDENTS, InfluenceSettings, community_of, generate_influence
from vico.community.model import Community
from vico.errors import InputError, VicoError
from vico.world.world import World

#: Members of a community beside the two main agents.
MEMBERS = RESIDENTS - 2
#: What is told of each member, in order: whether they can be met now, half hours on the way there, whether they are in
#: peace after a talk, conversations / 3, hours since the last one (at most 4), openness, agreeableness, extraversion,
#: neuroticism, and a guess of how far they prefer one to the rival.
FEATURES = 10
_MANY, _TRIES = 2**31 - 1, 20


class GivenTarget:
    """Sees whom it is told to."""

    def __init__(self) -> None:
        self.target: str | None = None

    def choose(self, situation: Situation, chance: np.random.Generator) -> str | None:
        """Return who was given."""
        return self.target


class InfluenceEnv(gymnasium.Env[NDArray[np.float32], Any]):
    """A day of talk for one of two main agents.

    Action: 0 waits half a minute; ``k`` goes to see member ``k``, and talks with them where they can be met.

    Observation: float32, shape ``(1 + MEMBERS * FEATURES,)``: the share of the day that is left, then `FEATURES` of
    each member. Nothing of it is known to the learner alone: the challenge's strategies are given the same.

    Reward: by how much the number of members who rank the main agent first (mean over the variants of the opinion
    model) grew; sparse: at the day's end alone, so that both sum up to the members won over less those lost.

    Parameters
    ----------
    rival, dialogue
        Strategy of the other main agent; of what the learner's own says.
    hours
        Length of the day of talk, from 16:00 on.
    reward
        ``"shaped"`` or ``"sparse"``.
    tasks, seed, render_mode
        As `vico.challenges.learning.env.TaskEnv` takes them; there are no pictures.

    Raises
    ------
    InputError
        If a strategy or setting is unknown.
    """

    metadata = {"render_modes": []}  # noqa: RUF012

    def __init__(
        self,
        world: World,
        *,
        rival: str = "ours",
        dialogue: str = "ours",
        hours: float = 4.0,
        reward: str = "shaped",
        tasks: int | None = None,
        seed: int = 0,
        render_mode: str | None = None,
    ) -> None:
        if reward not in ("sparse", "shaped"):
            raise InputError(f"env: reward is {reward!r}; use 'sparse' or 'shaped'")
        if render_mode is not None:
            raise InputError("env: a day of talk has no pictures; leave render_mode out")
        self.render_mode = None
        self._world, self._reward, self._tasks, self._seed = world, reward, tasks, seed
        self._method = f"nearest/{dialogue}+{rival}"
        self._settings = InfluenceSettings(assignment="first", simulation="schedule", hours=hours)
        self._walks = Walks(world)
        self._known: dict[int, Community] = {}
        self._target, self._guess = GivenTarget(), ExpectedGainTarget()
        self._day: Day | None = None
        self._movers: list[Mover] = []
        self._won = 0.0
        self.observation_space = spaces.Box(-10.0, 10.0, (1 + MEMBERS * FEATURES,), np.float32)
        self.action_space = spaces.Discrete(1 + MEMBERS)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start a day; ``info`` holds its number as ``task``, and the members' names."""
        if seed is None and self._np_random is None:
            seed = self._seed
        super().reset(seed=seed)
        number = self._begin(seed)
        day = self._today
        names = {resident.id: resident.name for resident in day.community.residents}
        self._won = self._first()
        return self._observe(), self._info() | {
            "task": number,
            "instructions": f"Court the others for {names[day.ours]}.",
            "members": [names[member] for member in day.task.members],
        }

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """See somebody, or wait; the rival's visits that begin before one is free again take place, too.

        Raises
        ------
        InputError
            If the day is over, or has not begun.
        """
        day = self._today
        if self._is_over():
            raise InputError("env: the day is over; call reset() before step()")
        number = int(action)
        self._target.target = day.task.members[number - 1] if number else None
        next_visit(day, self._mine, self._plans, self._walks)
        self._play_rival()
        over = self._is_over()
        reward = 0.0
        if self._reward == "shaped" or over:
            before, self._won = self._won, self._first()
            reward = self._won - before
        return self._observe(), float(reward), over, False, self._info()

    def action_masks(self) -> NDArray[np.bool_]:
        """Return who can be met, as `sb3_contrib.MaskablePPO` asks for it."""
        return self._mask().astype(bool)

    @property
    def _today(self) -> Day:
        if self._day is None:
            raise InputError("env: no day has begun; call reset() before step()")
        return self._day

    @property
    def _mine(self) -> Mover:
        return next(one for one in self._movers if one.courtship.me.id == self._today.ours)

    def _is_over(self) -> bool:
        return self._mine.free_at >= self._today.task.ends

    def _begin(self, seed: int | None) -> int:
        if seed is not None:
            number = seed if self._tasks is None else seed % self._tasks
            self._make(number)
            return number
        for _ in range(_TRIES - 1):
            number = int(self.np_random.integers(self._tasks or _MANY))
            try:
                self._make(number)
                return number
            except VicoError:
                continue
        number = int(self.np_random.integers(self._tasks or _MANY))
        self._make(number)
        return number

    def _make(self, number: int) -> None:
        if number not in self._known:
            self._known[number] = community_of(self._world, number)
        community = self._known[number]
        task = generate_influence(self._world, community, number, self._settings)
        day = make_day(task, community, self._method, self._settings, "first")
        courtship = day.courtships[day.ours]
        courtship.strategy = replace(courtship.strategy, target=self._target)
        self._day, self._plans = day, plans_of(day)
        self._movers = movers_of(day, self._plans)
        self._target.target = None
        self._play_rival()

    def _play_rival(self) -> None:
        """Let the rival see whom it wants until the learner is to decide."""
        day, mine = self._today, self._mine
        rival = next(one for one in self._movers if one is not mine)
        ids = (mine.courtship.me.id, rival.courtship.me.id)
        until = min(mine.free_at, day.task.ends)
        while rival.free_at < until or (rival.free_at == until and until < day.task.ends and ids[1] < ids[0]):
            next_visit(day, rival, self._plans, self._walks)

    def _situation(self) -> Situation:
        mover = self._mine
        walks = self._walks
        return mover.courtship.situation(
            mover.free_at, walks.position(mover.place), lambda place: walks.seconds(mover.place, place)
        )

    def _observe(self) -> NDArray[np.float32]:
        situation = self._situation()
        reachable = situation.reachable()
        left = max(0.0, situation.ends - situation.time) / (3600.0 * self._settings.hours)
        rows = [self._features(situation, reachable, member) for member in self._today.task.members]
        return np.clip(np.concatenate([[left], *rows]), -10.0, 10.0).astype(np.float32)

    def _features(self, situation: Situation, reachable: Mapping[str, float], member: str) -> NDArray[np.float64]:
        talks = situation.talks_with(member)
        since = situation.time - talks[-1].began if talks else 4 * 3600.0
        profile = situation.members[member]
        traits = [profile.trait(name) for name in ("openness", "agreeableness", "extraversion", "neuroticism")]
        numbers = [
            float(member in reachable),
            reachable.get(member, 1800.0) / 1800.0,
            float(since <= REVISIT_PAUSE),
            len(talks) / 3.0,
            min(since, 4 * 3600.0) / 3600.0,
            *traits,
            self._guess.margin(situation, member),
        ]
        assert len(numbers) == FEATURES
        return np.array(numbers)

    def _mask(self) -> NDArray[np.int8]:
        reachable = self._situation().reachable()
        return np.array([1, *(member in reachable for member in self._today.task.members)], np.int8)

    def _first(self) -> float:
        """Return how many members rank the learner first now, the mean over the variants."""
        day = self._today
        now = min(self._mine.free_at, day.task.ends)
        choices = evaluate.first_choices(day.ledger, now=now, with_talk=True)
        return float(np.mean([sum(first == day.ours for first in found.values()) for found in choices.values()]))

    def _info(self) -> dict[str, Any]:
        visits = self._mine.courtship.visits
        return {
            "action_mask": self._mask(),
            "won": self._won,
            "visits": len(visits),
            "ending": visits[-1].ending if visits else "",
        }
