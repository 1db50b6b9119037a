"""The author that asks a language model, and falls back on the procedural one item by item.

The community is put together of what the model wrote and what it left: days, ties, and the validator's word on the
whole.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pydantic import BaseModel

from vico.community.author import procedural_author
from vico.community.llm.characters import write_characters, write_days
from vico.community.llm.lives import FittedDay, Lives
from vico.community.llm.network import Network, groups_by_member, network_items, with_old_groups, write_network
from vico.community.llm.prompting import Cast, Characters, DayPlan, ModelDesk, ModelDraft, Progress, SocialNetwork
from vico.community.mode_choice import with_rides
from vico.community.model import (
    AuthoredItem,
    Authorship,
    Community,
    CommunityFinding,
    Group,
    Origin,
    Relation,
    RelationKind,
    Resident,
    with_tags,
)
from vico.community.place_index import PlaceIndex
from vico.community.validator import check_community
from vico.errors import InputError
from vico.llm import LanguageModel
from vico.llm.prompts import Prompt, read_prompt
from vico.seeds import rng
from vico.world.world import World

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
            renamed = lives.renames(before)
            schedule = [item.model_copy(update={"activity": renamed(item.activity)}) for item in before.schedule]
        else:
            plain = lives.plain_day(before.id, joined)
            schedule = plain.items or before.schedule  # what does not fit is found below
            fitted.append(before.id)
        known = [*person.known_places, *(i.place for i in schedule if i.place), *(g.place for g in joined)]
        people.append(person.model_copy(update={"schedule": schedule, "known_places": list(dict.fromkeys(known))}))
    # Only those whose days are new choose anew between walking and riding.
    fitted_ids = set(fitted)
    riding = with_rides(
        [r for r in people if r.id in fitted_ids], groups, cast.index,
        lambda name: rng(cast.base.seed, "community", "llm", "rides", name),
    )  # fmt: skip
    by_id = {r.id: r for r in riding}
    people = [by_id.get(r.id, r) for r in people]
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


_ROOM = "community"
_REPLIES: Mapping[str, type[BaseModel]] = {
    "characters": Characters,
    "social_network": SocialNetwork,
    "daily_plan": DayPlan,
}


@dataclass
class LlmReport:
    """Outcome of asking a model, for people to read; `Community.authorship` holds what lasts.

    Attributes
    ----------
    authorship
        Whose each item is.
    troubles
        What questions got instead of a usable reply, by item, in the words of whoever failed.
    over
        Why the model was asked no more; empty if it answered to the end.
    """

    authorship: Authorship
    troubles: dict[str, str] = field(default_factory=dict)
    over: str = ""


class LlmCommunityAuthor:
    """An `Author` that asks a language model for characters, groups, ties and days.

    Bodies, ages, homes, households and children's schools are the procedural author's, whose community is also what
    stands for each item that the model does not write, or not so that the validator takes it. It never fails for what
    the model or its server does.

    Parameters
    ----------
    model
        Whom to ask.
    workers
        Questions under way at a time. The result does not depend on it, unless a budget is spent or the server fails
        on the way: then it may be others who are left to the procedural author.
    rounds
        How often a draft may be mended.
    only
        Refuse a community with items that the model was to write and did not.
    progress
        Told how far things are.

    Attributes
    ----------
    report
        Of the last community; None before.
    """

    def __init__(
        self,
        model: LanguageModel,
        *,
        workers: int = 4,
        rounds: int = 2,
        only: bool = False,
        progress: Progress = lambda *_: None,
    ) -> None:
        self.model, self.workers, self.rounds, self.only = model, workers, rounds, only
        self.report: LlmReport | None = None
        self._progress = progress
        self._prompts: Mapping[str, Prompt] = {
            name: read_prompt(_ROOM, name, reply) for name, reply in _REPLIES.items()
        }
        ModelDesk(model, workers=workers, rounds=rounds)  # so that unusable numbers are said at once

    def __call__(
        self, world: World, *, residents: int, seed: int, findings: Sequence[CommunityFinding] = ()
    ) -> Community:
        """Write a community; people named by `findings` of a draft before are left to the procedural author.

        Raises
        ------
        EmptyInputError
            If the world has no homes, or nowhere to meet.
        InputError
            If a recording is replayed that holds no answer to anything that is asked; or if the model left items to
            the procedural author and `only` is set.
        """
        base = procedural_author(world, residents=residents, seed=seed)
        cast = Cast(base, PlaceIndex(world, base.date))
        named = frozenset(f.where.partition(".")[0] for f in findings)
        unasked = frozenset(r.id for r in base.residents if r.id in named)
        desk = ModelDesk(self.model, workers=self.workers, rounds=self.rounds, progress=self._progress)
        community, items, drafts = self._write(desk, Lives(cast), unasked)
        if self.model.replays and desk.answers == 0:
            first = next((draft.told for draft in drafts if draft.told), "it holds no answer")
            raise InputError(f"community build: nothing that is asked was recorded so: {first}")
        authorship = Authorship(
            model=self.model.endpoint.model,
            prompts={name: prompt.digest for name, prompt in self._prompts.items()},
            items=items,
        )
        troubles = {draft.item: draft.told for draft in drafts if draft.told}
        self.report = LlmReport(authorship, troubles, desk.over)
        if self.only and authorship.fallen_back:
            left = authorship.fallen_back
            raise InputError(
                f"community build: {len(left)} of {len(items)} items were not written by {authorship.model}, the first "
                f"{left[0].item} ({left[0].origin.value}{f': {left[0].detail}' if left[0].detail else ''}"
                f"{f'; {desk.over}' if desk.over else ''}); leave --llm-only out to have them written by rule"
            )
        return community.model_copy(update={"authorship": authorship})

    def _write(
        self, desk: ModelDesk, lives: Lives, unasked: frozenset[str]
    ) -> tuple[Community, list[AuthoredItem], list[ModelDraft[Any]]]:
        characters, asked = write_characters(desk, self._prompts["characters"], lives, unasked=unasked)
        network, by_person = write_network(desk, self._prompts["social_network"], lives, unasked=unasked)
        groups = with_old_groups(lives, network)
        days, schedules, planned = write_days(
            desk, self._prompts["daily_plan"], lives, groups_by_member(groups), unasked=unasked
        )
        drafts = [*asked, *{id(draft): draft for draft in by_person.values()}.values(), *planned]
        items = [*characters, *network_items(lives, network, by_person), *schedules]
        written = any(one.origin is Origin.WRITTEN for one in items)
        name = self.model.endpoint.model if written else lives.cast.base.author
        kept: dict[str, FittedDay] = dict(days)
        while True:
            community, findings = assemble(lives, groups, network, kept, name)
            if not findings:
                return community, _by_resident(lives, items), drafts
            bad = {f.where.partition(".")[0]: f for f in reversed(findings)}
            off = [resident for resident in kept if resident in bad]
            if not off:
                break
            for resident in off:
                del kept[resident]
                name_of_day = f"{resident}.schedule"
                items = [_ungrounded_item(one, bad[resident]) if one.item == name_of_day else one for one in items]
        # Nothing of the model's can be named as the cause: the procedural author's whole community stands.
        items = [_ungrounded_item(one, findings[0]) for one in items]
        return lives.cast.base, _by_resident(lives, items), drafts


def _ungrounded_item(item: AuthoredItem, finding: CommunityFinding) -> AuthoredItem:
    """Return an item that the validator did not take in the whole community."""
    if item.origin is not Origin.WRITTEN:
        return item
    detail = f"in the whole community: {finding.where}: {finding.what}"[:240]
    return AuthoredItem(item=item.item, origin=Origin.NOT_GROUNDED, detail=detail)


def _by_resident(lives: Lives, items: Sequence[AuthoredItem]) -> list[AuthoredItem]:
    """Return items by resident; the community's own come last."""
    order = {r.id: k for k, r in enumerate(lives.cast.base.residents)}
    kinds = ("character", "groups", "schedule")
    return sorted(
        items,
        key=lambda one: (
            order.get(one.item.partition(".")[0], len(order)),
            kinds.index(one.item.rpartition(".")[2]) if one.item.rpartition(".")[2] in kinds else len(kinds),
        ),
    )
