"""The bodies that people are drawn with, and how these change when people change clothes."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.assets.people import Appearance, SkinnedBody, body_of
from vico.assets.people.weather_clothes import dressed
from vico.community.model import Resident
from vico.errors import InputError
from vico.render.skinning import BodyBatch, batch_bodies
from vico.seeds import rng
from vico.sim.animation import STYLE, style_of
from vico.sim.config import SimConfig
from vico.sim.detail import CROWD
from vico.sim.holding import habit_of
from vico.sim.passers_by import manner_of_pedestrian
from vico.sim.simulation_state import SimulationState
from vico.threads import in_order

# Metres: of who has no body yet, whom nobody sees.
_USUAL_HEIGHT = 1.7
_Detail = Literal["far", "light", "full"]


class Cast(Protocol):
    """Who is drawn: what is asked of a simulation."""

    @property
    def config(self) -> SimConfig:
        """What the run is asked to be."""

    @property
    def state(self) -> SimulationState:
        """Everybody and everything, as it is now."""

    @property
    def residents(self) -> Sequence[Resident]:
        """Who takes part, the first of its people."""

    @property
    def looks(self) -> Sequence[Appearance]:
        """How people look at the start, in the order of their avatars, and after them the pedestrians."""


class DrawnPeople:
    """Bodies of agents and pedestrians, and what tells their movements apart.

    Parameters
    ----------
    sim
        Whose people they are.
    detail
        Of the bodies.
    far
        Whether a crowd has a second, coarser body each.
    everybody
        Whether all have a body; else those that `choose` is told, and at first nobody.

    Attributes
    ----------
    rows
        Who has a body: numbers of agents, and after them of pedestrians, ascending.
    batch
        Their bodies, and after them those for far away, as `vico.render.skinning.skin` takes them.
    looks
        How everybody looks now.
    style
        A `STYLE` record each, shape ``(n,)``.
    height
        Metres, float64, shape ``(n,)``; a usual one of those who never had a body.
    entities
        int32, shape ``(n,)``.
    habit
        How little each pedestrian minds rain, 0..1, float64.
    """

    def __init__(self, sim: Cast, *, detail: Literal["light", "full"], far: bool, everybody: bool = True) -> None:
        people, looks = sim.state.people, list(sim.looks)
        walkers = sim.state.traffic.walkers.entity.tolist() if sim.state.traffic is not None else []
        self._detail, self._seed = detail, sim.config.seed
        self._own = [Appearance.from_dict(resident.appearance) for resident in sim.residents]
        # What the looks at the start are for.
        self._clothes = np.tile(sim.state.clothes_at_start, (len(self._own), 1))
        self.looks = looks
        self._worn = _worn_bodies(sim)
        self._names = [*people.names, *(manner_of_pedestrian(k) for k in range(len(walkers)))]
        self._bodies: dict[int, SkinnedBody] = {}
        self._far: dict[int, SkinnedBody] = {}
        self._has_far = far and len(looks) >= CROWD
        self._being_made: dict[Appearance, Future[Any]] = {}
        self._maker: ThreadPoolExecutor | None = None
        self.entities = np.array([*people.entity.tolist(), *walkers], np.int32)
        self.habit = np.array([habit_of(self._seed, name) for name in self._names[len(people) :]], np.float64)
        self.style = np.zeros(len(looks), STYLE)
        self.height = np.full(len(looks), _USUAL_HEIGHT)
        self.rows = np.zeros(0, np.int64)
        self._batch()
        if everybody:
            self.choose(np.arange(len(looks)))

    @property
    def nbytes(self) -> int:
        """Bytes of the bodies."""
        rest = sum(body.triangles.nbytes for bodies in (self._bodies, self._far) for body in bodies.values())
        return self.batch.nbytes + rest

    def choose(self, rows: NDArray[np.int64]) -> None:
        """Have bodies for some, by their numbers, ascending, and for nobody else."""
        if np.array_equal(rows, self.rows):
            return
        wanted = set(rows.tolist())
        for bodies in (self._bodies, self._far):
            for i in bodies.keys() - wanted:
                del bodies[i]
        new = [i for i in rows.tolist() if i not in self._bodies]
        self._bodies |= self._made(new, self._detail)
        if self._has_far:
            self._far |= self._made(new, "far")
        for i in new:
            self._describe(i)
        self.rows = rows.copy()
        self._batch()

    def follow(self, state: SimulationState) -> None:
        """Have people look as they are dressed now; bodies are made once a look."""
        wanted = state.people.clothes[: len(self._own)]
        for i in np.flatnonzero(state.people.at_door()[: len(self._own)]).tolist():
            # Who is about to leave home: the body is made before it is needed.
            if i in self._bodies and state.people.door[i] == state.homes[i] and state.people.room[i] >= 0:
                self._prepare(self._look(i, state.weather_to_dress_for()))
        if np.array_equal(wanted, self._clothes):
            return
        changed = []
        for i in np.flatnonzero((wanted != self._clothes).any(axis=1)).tolist():
            look = self._look(i, wanted[i])
            if look != self.looks[i] and self._names[i] not in self._worn:
                self.looks[i] = look
                changed.append(i)
        self._clothes[:] = wanted
        drawn = [i for i in changed if i in self._bodies]
        for i in drawn:
            near, far = self._body(self.looks[i])
            self._bodies[i] = near
            if self._has_far:
                self._far[i] = far
            self._describe(i)
        if drawn:
            self._batch()

    def _look(self, i: int, weather: NDArray[np.float64]) -> Appearance:
        temperature, rain, snow = weather.tolist()
        return dressed(self._own[i], temperature, rain, snow)

    def _prepare(self, look: Appearance) -> None:
        """Begin to make a body."""
        if look in self._being_made or look in self.looks:
            return
        if self._maker is None:
            self._maker = ThreadPoolExecutor(1, "bodies")
        self._being_made[look] = self._maker.submit(self._make, look)

    def _make(self, look: Appearance) -> tuple[SkinnedBody, SkinnedBody]:
        near = body_of(look, detail=self._detail)
        return near, body_of(look, detail="far") if self._has_far else near

    def _body(self, look: Appearance) -> tuple[SkinnedBody, SkinnedBody]:
        """Return somebody's body from near and far, waiting for it if it is being made."""
        begun = self._being_made.pop(look, None)
        return self._make(look) if begun is None else begun.result()

    def _made(self, rows: Sequence[int], detail: _Detail) -> dict[int, SkinnedBody]:
        """Make bodies, those of a look once; who wears one of their own has it in any detail."""
        kinds = list(dict.fromkeys(self.looks[i] for i in rows))
        made = dict(zip(kinds, in_order(partial(body_of, detail=detail), kinds), strict=True))
        bodies = {i: made[self.looks[i]] for i in rows}
        for name, path in self._worn.items():
            from vico.assets.people.worn import worn  # few wear anything of their own

            k = self._names.index(name)
            if k in bodies:
                bodies[k] = worn(bodies[k], path) if detail != "far" else self._bodies[k]
        return bodies

    def _describe(self, i: int) -> None:
        """Note what tells somebody's movements apart."""
        body, look = self._bodies[i], self.looks[i]
        self.style[i] = style_of(body, rng(self._seed, "manner", self._names[i]), age=look.age)
        self.height[i] = body.height

    def _batch(self) -> None:
        rows = self.rows.tolist()
        bodies = [self._bodies[i] for i in rows] + [self._far[i] for i in rows if self._has_far]
        entities = self.entities[self.rows].tolist()
        self.batch: BodyBatch = batch_bodies(bodies, entities * (2 if self._has_far else 1))
        # Their vertices are kept once.
        self._bodies = {i: self.batch.body(k, self._bodies[i]) for k, i in enumerate(rows)}
        if self._has_far:
            self._far = {i: self.batch.body(k, self._far[i]) for k, i in enumerate(rows, len(rows))}


def _worn_bodies(sim: Cast) -> dict[str, Path]:
    """Return the files of those who wear a body of their own, by agent's name.

    Raises
    ------
    InputError
        If there is no such agent.
    """
    people = sim.state.people
    for name in sim.config.worn:
        if name not in people.names:
            there = ", ".join(people.names) or "none"
            raise InputError(f"worn: nobody is called {name!r}; there are {there}")
    return {name: Path(path) for name, path in sim.config.worn.items()}
