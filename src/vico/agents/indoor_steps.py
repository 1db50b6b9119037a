"""Getting on within a room: by what stands there, past who stands or comes there, and out of corners."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from vico.agents.base import Action, Info, Observation
from vico.agents.indoor_walk import IndoorWalker
from vico.agents.state import AgentState
from vico.agents.way_past import WayPast

# How often who is stopped by no person in view steps aside somewhere instead of trying again; how far, metres, and how
# far it turns for that, degrees.
_STEPS_ASIDE, _FAR, _TURN = 0.5, (0.3, 0.8), (60.0, 170.0)


class IndoorSteps:
    """Walks within rooms.

    Parameters
    ----------
    name
        One's own, as others see it.
    generator
        Decides where to step who is stopped by something that is not in view.
    """

    def __init__(self, name: str, generator: np.random.Generator) -> None:
        self._rng = generator
        self._walker, self._past = IndoorWalker(), WayPast(name)
        self._aside: list[Action] = []

    def state(self) -> AgentState:
        """Return all it remembers; the generator is its owner's to save."""
        aside = [dict(action) for action in self._aside]
        return {"walker": self._walker.state(), "past": self._past.state(), "aside": aside}

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._walker.restore(state["walker"])
        self._past.restore(state["past"])
        self._aside = [dict(action) for action in state["aside"]]

    def towards(self, target: ArrayLike, near: float, observation: Observation, info: Info) -> Action | None:
        """Return the next action on the way to a point of the room; None once within `near` metres of it."""
        if self._aside:
            return self._aside.pop()
        position, goal = (np.asarray(point, np.float64)[:2] for point in (observation["pose"], target))
        self._past.notice(observation, info)
        if self._past.is_on:
            if math.dist(position, goal) <= near:
                return None
            self._walker.notice(observation, info)
            point, within = self._walker.on_the_way(observation, goal, near=near, others=self._past.met)
            action = self._past.towards(point, within, observation, info)
            return action or self._walker.towards(observation, target, near=near)
        if observation["state"]["action_status"] == "collision" and self._rng.random() < _STEPS_ASIDE:
            self._aside = [{"type": "move_forward", "distance": float(self._rng.uniform(*_FAR))}]
            side = "turn_left" if self._rng.random() < 0.5 else "turn_right"
            return {"type": side, "degrees": float(self._rng.uniform(*_TURN))}
        self._walker.notice(observation, info)
        return self._walker.towards(observation, target, near=near)

    def make_room(self, observation: Observation, info: Info) -> Action | None:
        """Return the next action of who only stands in a room, to let somebody pass or get up, or None."""
        return self._past.make_room(observation, info)


__all__ = ["IndoorSteps"]
