"""A community of what the model wrote and what it left: days, ties, and the validator's word on the whole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from vico.community.findings import CommunityFinding
from vico.community.llm.fitting import FittedDay
from vico.community.llm.lives import Lives
from vico.community.llm.network import Network, groups_by_member
from vico.community.model import Community, Group, Relation, RelationKind, Resident, ScheduleItem
from vico.community.rides import with_rides
from vico.community.tags import with_tags
from vico.community.validator import check_community
from vico.seeds import rng

# Of who is in a group together and of whom the model says no more.
_ACQUAINTED = 0.4


def assemble(
    lives: Lives, groups: Sequence[Group], network: Network, days: Mapping[str, FittedDay], author: str
) -> tuple[Community, list[CommunityFinding]]:
    """Put a community together, and check it.

    Parameters
    ----------
    groups
        All there are, old and new.
    days
        Those that the model planned, by id; all others have their plain day.
    author
        Who is named as its author.

    Returns
    -------
    community, findings
        Findings name the residents whose days can't stay.
    """
    cast = lives.cast
    mine = groups_by_member(groups)
    people, fitted = [], []
    for before in cast.base.residents:
        person, joined = lives.people[before.id], mine.get(before.id, [])
        if before.id in days:
            schedule = days[before.id].items
            fitted.append(before.id)
        elif _is_as_before(lives, before, joined):
            schedule = _renamed(lives, before)
        else:
            plain = lives.plain_day(before.id, joined)
            schedule = plain.items or before.schedule  # what does not fit is found below
            fitted.append(before.id)
        known = [*person.known_places, *(i.place for i in schedule if i.place), *(g.place for g in joined)]
        people.append(person.model_copy(update={"schedule": schedule, "known_places": list(dict.fromkeys(known))}))
    people = _riding(lives, people, groups, fitted)
    community = cast.base.model_copy(
        update={
            "author": author,
            "residents": people,
            "groups": list(groups),
            "relations": _relations(lives, groups, network),
        }
    )
    community = with_tags(community, cast.index.world.places)
    return community, check_community(community, cast.index.world)


def _is_as_before(lives: Lives, before: Resident, groups: Sequence[Group]) -> bool:
    """Whether somebody's work and meetings are those of the procedural author, so that the day is, too."""
    meetings = {(g.place, g.start, g.end) for g in groups}
    old = {(g.place, g.start, g.end) for g in lives.cast.base.groups_of(before.id)}
    return meetings == old and lives.people[before.id].workplace == before.workplace


def _renamed(lives: Lives, before: Resident) -> list[ScheduleItem]:
    renamed = lives.renames(before)
    return [item.model_copy(update={"activity": renamed(item.activity)}) for item in before.schedule]


def _riding(lives: Lives, people: Sequence[Resident], groups: Sequence[Group], fitted: Sequence[str]) -> list[Resident]:
    """Let those whose days are new take buses, trams and bicycles where it is worth it to them."""
    base = lives.cast.base
    chosen = set(fitted)
    riding = with_rides(
        [r for r in people if r.id in chosen], groups, lives.cast.index,
        lambda name: rng(base.seed, "community", "llm", "rides", name),
    )  # fmt: skip
    by_id = {r.id: r for r in riding}
    return [by_id.get(r.id, r) for r in people]


def _relations(lives: Lives, groups: Sequence[Group], network: Network) -> list[Relation]:
    """Return the ties: families and neighbours stay, colleagues are who works together, the rest is the model's."""
    base, people = lives.cast.base, lives.people
    order = {r.id: k for k, r in enumerate(base.residents)}
    together = _pairs_of_groups(groups, order)
    old_together = _pairs_of_groups(base.groups, order)
    found: dict[tuple[str, str], Relation] = {}
    for tie in base.relations:
        a, b = tie.between
        stale = tie.between in old_together and tie.between not in together
        if _holds(tie, people[a], people[b], stale=stale):
            note = tie.note.partition(";")[0] if stale else tie.note
            found[a, b] = tie.model_copy(update={"note": note})
    for tie in network.ties:
        if found.get(tie.between) is None or found[tie.between].kind is not RelationKind.FAMILY:
            found[tie.between] = tie
    for pair, name in together.items():
        # Of the procedural author's groups, who became friends was decided there.
        new = pair not in found and pair not in old_together
        if new and people[pair[0]].household != people[pair[1]].household:
            found[pair] = Relation(
                between=pair, kind=RelationKind.FRIEND, note=f"both in {name}", strength=_ACQUAINTED,
                since=base.date.year,
            )  # fmt: skip
    return [found[pair] for pair in sorted(found, key=lambda pair: (order[pair[0]], order[pair[1]]))]


def _pairs_of_groups(groups: Sequence[Group], order: Mapping[str, int]) -> dict[tuple[str, str], str]:
    """Return who is in a group with whom, in the community's order, and the name of the first such group."""
    pairs: dict[tuple[str, str], str] = {}
    for group in groups:
        members = sorted(group.members, key=lambda name: order[name])
        for k, a in enumerate(members):
            for b in members[k + 1 :]:
                pairs.setdefault((a, b), group.name)
    return pairs


def _holds(tie: Relation, a: Resident, b: Resident, *, stale: bool) -> bool:
    """Whether a tie of the procedural author is still one; `stale` if a group that they shared is gone."""
    if tie.kind is RelationKind.COLLEAGUE:
        return a.workplace is not None and a.workplace == b.workplace
    if tie.kind is RelationKind.FRIEND:
        return a.household == b.household or not stale
    return True
