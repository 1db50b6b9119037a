"""Making an episode: a community of fifteen, and which two of them court the others."""

from __future__ import annotations

from vico.agents.stays import stays_of
from vico.challenges.influence.constants import opinion_digest
from vico.challenges.influence.model import RESIDENTS, InfluenceSettings, InfluenceTask
from vico.community import build_community
from vico.community.model import Community
from vico.errors import EmptyInputError
from vico.seeds import rng
from vico.world.world import World

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
