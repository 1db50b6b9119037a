"""The author that asks a language model, and falls back on the procedural one item by item."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from pydantic import BaseModel

from vico.community.author import procedural_author
from vico.community.authorship import AuthoredItem, Authorship, Origin
from vico.community.findings import CommunityFinding
from vico.community.llm.asking import Draft, ModelDesk, Progress
from vico.community.llm.assembly import assemble
from vico.community.llm.cast import Cast
from vico.community.llm.characters import write_characters
from vico.community.llm.days import write_days
from vico.community.llm.fitting import FittedDay
from vico.community.llm.lives import Lives
from vico.community.llm.network import groups_by_member, network_items, with_old_groups, write_network
from vico.community.llm.replies import Characters, DayPlan, SocialNetwork
from vico.community.model import Community
from vico.community.place_index import PlaceIndex
from vico.errors import InputError
from vico.llm import LanguageModel
from vico.llm.prompts import Prompt, read_prompt
from vico.world.world import World

_ROOM = "community"
_REPLIES: Mapping[str, type[BaseModel]] = {
    "characters": Characters,
    "social_network": SocialNetwork,
    "daily_plan": DayPlan,
}


@dataclass
class LlmReport:
    """What came of asking a model, for people; `Community.authorship` says what lasts.

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
    ) -> tuple[Community, list[AuthoredItem], list[Draft[Any]]]:
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
                return community, _ordered(lives, items), drafts
            bad = {f.where.partition(".")[0]: f for f in reversed(findings)}
            off = [resident for resident in kept if resident in bad]
            if not off:
                break
            for resident in off:
                del kept[resident]
                items = _fallen(items, f"{resident}.schedule", bad[resident])
        # Nothing of the model's can be named as the cause: the procedural author's whole community stands.
        items = [_ungrounded(one, findings[0]) for one in items]
        return lives.cast.base, _ordered(lives, items), drafts


def _fallen(items: Sequence[AuthoredItem], name: str, finding: CommunityFinding) -> list[AuthoredItem]:
    return [_ungrounded(one, finding) if one.item == name else one for one in items]


def _ungrounded(item: AuthoredItem, finding: CommunityFinding) -> AuthoredItem:
    """Return an item that the validator did not take in the whole community."""
    if item.origin is not Origin.WRITTEN:
        return item
    detail = f"in the whole community: {finding.where}: {finding.what}"[:240]
    return AuthoredItem(item=item.item, origin=Origin.NOT_GROUNDED, detail=detail)


def _ordered(lives: Lives, items: Sequence[AuthoredItem]) -> list[AuthoredItem]:
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
