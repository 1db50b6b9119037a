"""Profiles of a community's residents, as everybody may know them."""

from __future__ import annotations

from vico.agents.influence.profiles import FIVE, Profile, Tie
from vico.community.model import Community


def profiles_of(community: Community) -> list[Profile]:
    """Return what may be known of each resident, in the community's order."""
    ties: dict[str, list[Tie]] = {resident.id: [] for resident in community.residents}
    for relation in community.relations:
        first, second = relation.between
        ties[first].append(Tie(second, str(relation.kind), relation.strength))
        ties[second].append(Tie(first, str(relation.kind), relation.strength))
    found = []
    for resident in community.residents:
        five = [float(getattr(resident.personality, name)) for name in FIVE]
        found.append(
            Profile(
                id=resident.id,
                name=resident.name,
                age=resident.age,
                occupation=resident.occupation,
                values=tuple(resident.values),
                five=(five[0], five[1], five[2], five[3], five[4]),
                traits=tuple(resident.personality.traits),
                hobbies=tuple(resident.hobbies),
                groups=tuple(group.name for group in community.groups_of(resident.id)),
                ties=tuple(ties[resident.id]),
                lifestyle=resident.lifestyle,
                biography=resident.biography,
            )
        )
    return found
