"""A member of the community: lives its day, stops when a main agent speaks to it, answers, and goes on."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from vico.agents.base import Action, AgentState, FieldState, Info, Observation
from vico.agents.residents import Residents
from vico.agents.schedule import ScheduleFollower
from vico.agents.wayfinding import Stride
from vico.world.walkable import WalkableMap

# One stays for so long after what was said last, seconds, and is heard so far, metres.
_STAYS, _VOICE = 8.0, 3.0

#: Answers a message: told the message, how far away the speaker is (metres), and whether the member is on the way
#: somewhere; returns the words, or None for no answer.
Answer = Callable[[Mapping[str, Any], float, bool], str | None]


class CourtedMember(FieldState):
    """A resident who follows a day and can be talked with.

    Parameters
    ----------
    follower
        Whose day it is.
    name
        Of the agent.
    mains
        Those who court it; what others say is the follower's business.
    answer
        What it says to them.
    """

    _follower: ScheduleFollower
    _stays_until: float = -math.inf
    _to_say: list[str]

    def __init__(self, follower: ScheduleFollower, name: str, mains: Collection[str], answer: Answer) -> None:
        self.group: Residents | None = None
        self._follower, self._name, self._mains, self._answer = follower, name, frozenset(mains), answer
        self._to_say = []

    @property
    def rests_until(self) -> float:
        """Time before which it only waits, unless spoken to, met or moved."""
        return -math.inf if self._is_busy else self._follower.rests_until

    @property
    def stride(self) -> Stride | None:
        """What it goes on with unless spoken to, met, moved or stopped."""
        return None if self._is_busy else self._follower.stride

    @property
    def walks_until(self) -> float:
        """Time before which it goes on with `stride`."""
        return -math.inf if self._is_busy else self._follower.walks_until

    @property
    def acquaintances(self) -> Collection[str]:
        """Agents it would greet."""
        return self._follower.acquaintances

    @property
    def greeting_times(self) -> Mapping[str, float]:
        """When it last spoke with agents, seconds."""
        return self._follower.greeting_times

    @property
    def encounters(self) -> int:
        """Changes whenever `greeting_times` does."""
        return self._follower.encounters

    @property
    def _is_busy(self) -> bool:
        return bool(self._to_say) or math.isfinite(self._stays_until)

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming second."""
        if self.group is not None:
            self.group.forget(self._name)
        state = observation["state"]
        time = float(state["time"])
        courted = [message for message in observation["events"] if message["speaker"] in self._mains]
        if state["posture"] != "lying":  # who sleeps hears nothing
            for message in courted:
                self._listen(message, observation, time)
        if self._to_say:
            return {"type": "communicate", "text": self._to_say.pop(0), "range": _VOICE}
        if time < self._stays_until:
            return {"type": "wait"}
        self._stays_until = -math.inf
        if courted:
            others = [message for message in observation["events"] if message["speaker"] not in self._mains]
            observation = {**observation, "events": others}
        return self._follower.act(observation, info)

    def restore(self, state: AgentState) -> None:
        """Go on with the day where `state` was."""
        if self.group is not None:
            self.group.forget(self._name)
        super().restore(state)

    def _listen(self, message: Mapping[str, Any], observation: Observation, time: float) -> None:
        away = math.dist(observation["pose"][:2], message["position"][:2])
        on_the_way = bool(observation["state"]["vehicle"]) or not self._follower.has_arrived(time)
        answer = self._answer(message, away, on_the_way)
        if answer is None:
            return
        self._to_say.append(answer)
        if not on_the_way:
            self._stays_until = time + _STAYS


def courted_members(
    followers: Mapping[str, ScheduleFollower],
    mains: Sequence[str],
    answers: Mapping[str, Answer],
    walkable: WalkableMap,
) -> dict[str, CourtedMember]:
    """Return all but the main agents as members who can be talked with; they are asked as a group.

    Parameters
    ----------
    answers
        By member, what they say when spoken to.
    """
    members = {
        name: CourtedMember(follower, name, mains, answers[name])
        for name, follower in followers.items()
        if name not in mains
    }
    group = Residents(members, walkable)
    for name, member in members.items():
        member.group = followers[name].group = group
    return members
