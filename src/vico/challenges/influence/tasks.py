"""Episodes of the influence challenge: who courts whom, when, how it is played, and how an episode is drawn.

An episode has a community of fifteen, two of whom court the others.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any, Literal, get_args

from vico.agents.day_plan import stays_of
from vico.challenges.influence.opinion import opinion_digest
from vico.challenges.records import Setting
from vico.clock import DAY, seconds_of_day
from vico.community import build_community
from vico.community.model import Community
from vico.errors import EmptyInputError, InputError
from vico.seeds import rng
from vico.world.world import World

RESIDENTS = 15
Assignment = Literal["first", "swapped"]
Simulated = Literal["full", "schedule"]


@dataclass(frozen=True)
class InfluenceSettings:
    """Settings of an episode, by the names a job's setting has them under.

    Attributes
    ----------
    assignment
        Who plays whom: ``first``: the method's first strategy plays the first character; ``swapped``: the second one;
        ``both``: the day is played twice.
    simulation
        ``full``: bodies in the simulation, steps of 1 s. ``schedule``: no bodies; members are where their schedule
        says, and walks take as long as the router says.
    start, hours
        When the day of talk begins, ``HH:MM``, and how long it is.
    members
        ``model``: members answer and rank by the opinion model; ``llm``: by a language model.
    target_model, dialogue_model, member_model
        Names of models on the endpoint of ``VICO_LLM_BASE_URL``; empty: ``VICO_LLM_MODEL``.
    llm_tokens
        Most tokens an episode may use; 0 sets no limit.
    """

    assignment: str = "both"
    simulation: str = "full"
    start: str = "16:00"
    hours: float = 4.0
    members: str = "model"
    target_model: str = ""
    dialogue_model: str = ""
    member_model: str = ""
    llm_tokens: int = 0

    @property
    def begins(self) -> float:
        """When the day of talk begins, seconds of the day."""
        return float(seconds_of_day(self.start))

    @property
    def ends(self) -> float:
        """When it is over, seconds of the day."""
        return self.begins + self.steps

    @property
    def steps(self) -> int:
        """How many seconds it has."""
        return round(self.hours * 3600)

    @property
    def assignments(self) -> tuple[Assignment, ...]:
        """The assignments that are played."""
        if self.assignment == "both":
            return get_args(Assignment)
        return ("swapped",) if self.assignment == "swapped" else ("first",)

    def record(self) -> dict[str, bool | int | float | str]:
        """Return them as a job's setting."""
        return asdict(self)


def settings_of(setting: Setting) -> InfluenceSettings:
    """Return the settings of a job.

    Raises
    ------
    InputError
        If one is unknown or not usable.
    """
    known = {field.name: field for field in fields(InfluenceSettings)}
    for name, value in setting.items():
        if name not in known:
            raise InputError(f"influence: no setting {name!r}; there are {', '.join(known)}")
        wanted = type(getattr(InfluenceSettings(), name))
        fits = isinstance(value, (int, float) if wanted is float else wanted) and not isinstance(value, bool)
        if not fits:
            raise InputError(f"influence: setting {name} is {value!r}; give a {wanted.__name__}")
    typed: dict[str, Any] = {name: float(value) if name == "hours" else value for name, value in setting.items()}
    found = InfluenceSettings(**typed)
    _check_choice("assignment", found.assignment, ("both", *get_args(Assignment)))
    _check_choice("simulation", found.simulation, get_args(Simulated))
    _check_choice("members", found.members, ("model", "llm"))
    if not found.hours >= 0.1 or found.ends > DAY:
        raise InputError(f"influence: {found.hours:g} hours from {found.start}; a day of talk ends by midnight")
    if found.llm_tokens < 0:
        raise InputError(f"influence: llm_tokens is {found.llm_tokens}; it must not be negative")
    return found


def _check_choice(name: str, value: str, options: tuple[str, ...]) -> None:
    if value not in options:
        raise InputError(f"influence: setting {name} is {value!r}; use {', '.join(options)}")


@dataclass(frozen=True)
class InfluenceTask:
    """What is asked in an episode; the same for all strategies.

    Attributes
    ----------
    mains
        Ids of the two main agents, the first character first.
    members
        Ids of those who are courted.
    begins, ends
        Seconds of the day.
    opinion
        Digest of the opinion model's numbers.
    """

    world: str
    world_digest: str
    seed: int
    mains: tuple[str, str]
    members: tuple[str, ...]
    begins: float
    ends: float
    opinion: str

    def record(self) -> dict[str, Any]:
        """Return it as plain data."""
        return (
            {"schema_name": "vico.influence", "version": 1}
            | asdict(self)
            | {
                "mains": list(self.mains),
                "members": list(self.members),
            }
        )


def strategies_of(method: str) -> tuple[str, str]:
    """Return the two strategies of a method, as in ``ours+nearest``; one alone plays against itself.

    Raises
    ------
    InputError
        If there are more than two.
    """
    parts = method.split("+")
    if len(parts) > 2 or not all(parts):
        raise InputError(f"influence: method {method!r}; give two strategies, such as ours+nearest")
    return (parts[0], parts[0]) if len(parts) == 1 else (parts[0], parts[1])


# Main agents are grown up.
_GROWN_UP = 18


def community_of(world: World, seed: int) -> Community:
    """Return the community of an episode: the same world and seed give the same people."""
    return build_community(world, residents=RESIDENTS, seed=seed)


def rides_in(community: Community, world: World, *, begins: float, ends: float) -> bool:
    """Return whether somebody's day has them ride a bus, a tram or a bicycle between two times, seconds of the day."""
    return any(
        stay.mode != "walk" and stay.leave < ends and stay.due > begins
        for resident in community.residents
        for stay in stays_of(resident.schedule, world.place_by_id)
    )


def generate_influence(world: World, community: Community, seed: int, settings: InfluenceSettings) -> InfluenceTask:
    """Make an episode's task: two adults of different households, drawn by the seed, court everybody else.

    Raises
    ------
    EmptyInputError
        If there are no two such people.
    """
    adults = [resident for resident in community.residents if resident.age >= _GROWN_UP]
    pairs = [
        (one.id, other.id)
        for k, one in enumerate(adults)
        for other in adults[k + 1 :]
        if one.household is None or one.household != other.household
    ]
    if not pairs:
        raise EmptyInputError("influence: the community has no two adults of different households; use a larger world")
    first, second = pairs[int(rng(seed, "influence", "main agents").integers(len(pairs)))]
    return InfluenceTask(
        world=world.manifest.name,
        world_digest=world.digest,
        seed=seed,
        mains=(first, second),
        members=tuple(r.id for r in community.residents if r.id not in (first, second)),
        begins=settings.begins,
        ends=settings.ends,
        opinion=opinion_digest(),
    )
