"""Questions to a language model: the replies it is asked for, its prompts, and rounds in which drafts are repaired.

Many questions are asked at a time; the order of replies changes nothing. The model is told facts of the world and of
the bodies that it is to give lives, in words and bounded lists. The fields of a day's activities are those of the
paper's prompt. What a model wrote is untrusted, as is what maps call their places.
"""

from __future__ import annotations

import re
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, Generic, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, create_model

from vico.clock import clock_of
from vico.community.catalogue import basic_values
from vico.community.model import Community, ItemType, Origin, RelationKind, Resident
from vico.community.people import ALONE_FROM, GROWN_UP
from vico.community.place_index import GUEST_KINDS, PlaceIndex, kind_of
from vico.community.work import STUDY_KINDS, employers, jobs_at
from vico.errors import InputError, LlmBudgetError, LlmReplyError, SourceError
from vico.llm import LanguageModel, Message
from vico.llm.prompts import Prompt
from vico.seeds import rng
from vico.world.model import Category, Place

T = TypeVar("T", bound=BaseModel)

#: Called with how many questions of a stage are done, and of how many.
Progress = Callable[[str, int, int], None]

_SETUP = (401, 403, 404)  # statuses that no waiting mends
_PATIENCE = 3  # questions in a row that a server may fail at before it is left alone
_MOST_DETAIL = 240


@dataclass
class ModelDraft(Generic[T]):
    """A question, and what came of it.

    Attributes
    ----------
    item
        What is asked for, such as ``household_2``.
    prompt
        The words it is asked with.
    messages
        The question; findings of a draft are added.
    reply
        The record that has to come back.
    value
        The last reply, whether accepted or not; None if there is none.
    origin
        `Origin.WRITTEN` once it is accepted, else why it is not.
    detail
        More of why: the same whenever the same replies come.
    told
        The same for people, with the server's own words.
    """

    item: str
    prompt: Prompt
    messages: list[Message]
    reply: type[T]
    value: T | None = None
    origin: Origin = Origin.NO_ANSWER
    detail: str = ""
    told: str = ""
    findings: list[str] = field(default_factory=list)


#: Says what is wrong with a draft, a sentence each; called in the order of the drafts, never in parallel.
Judge = Callable[[ModelDraft[T]], list[str]]


class ModelDesk:
    """Asks a model for drafts, some at a time, and has them mended.

    Parameters
    ----------
    model
        Whom to ask.
    workers
        Questions under way at a time.
    rounds
        How often a draft may be mended for what its judge finds; a reply that is no such record is mended by the
        client as often.
    progress
        Told how far things are.

    Attributes
    ----------
    over
        Why nobody is asked any more; empty while the model answers.
    answers
        Replies that came, from the cache or a recording, too.
    """

    def __init__(
        self, model: LanguageModel, *, workers: int = 4, rounds: int = 2, progress: Progress = lambda *_: None
    ) -> None:
        if workers < 1:
            raise InputError(f"community build: {workers} questions at a time; ask for at least 1")
        self.model, self.workers, self.rounds = model, workers, rounds
        self.over = ""
        self.answers = 0
        self._progress = progress
        self._failed = 0  # questions in a row
        self._lock = threading.Lock()

    def settle(self, stage: str, drafts: Sequence[ModelDraft[T]], judge: Judge[T]) -> None:
        """Ask for drafts until each is accepted or its rounds are used up; the result stands in them.

        All that are asked at a time are judged one after the other once their replies are there, so that it does not
        matter which came first.
        """
        waiting = list(drafts)
        for turn in range(self.rounds + 1):
            asked = waiting
            self._ask_all(stage, asked, turn)
            waiting = []
            for draft in asked:
                if draft.value is None or draft.origin is not Origin.WRITTEN:
                    continue
                draft.findings = judge(draft)
                if draft.findings:
                    draft.origin, draft.detail = Origin.NOT_GROUNDED, draft.findings[0][:_MOST_DETAIL]
                    draft.told = draft.detail
                    draft.messages = [
                        *draft.messages[:2],
                        *draft.prompt.mending(draft.value.model_dump_json(), draft.findings),
                    ]
                    waiting.append(draft)
            if not waiting:
                return

    def _ask_all(self, stage: str, drafts: Sequence[ModelDraft[T]], turn: int) -> None:
        name = stage if turn == 0 else f"{stage}, mended"
        done = 0
        self._progress(name, 0, len(drafts))
        with ThreadPoolExecutor(self.workers) as pool:
            waiting = [pool.submit(self._ask, draft) for draft in drafts]
            try:
                for one in waiting:
                    one.result()
                    done += 1
                    self._progress(name, done, len(drafts))
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise

    def _ask(self, draft: ModelDraft[T]) -> None:
        """Ask one question and note what came, or why nothing did."""
        if self.over:
            self._mark_unanswered(draft, self.over)
            return
        try:
            reply = self.model.ask(draft.messages, draft.reply, rounds=self.rounds)
        except LlmReplyError as error:
            self._count_answer()
            if draft.origin is not Origin.NOT_GROUNDED:
                draft.origin = Origin.UNUSABLE
                draft.detail = (error.findings[0] if error.findings else "")[:_MOST_DETAIL]
            draft.told = str(error)
        except LlmBudgetError as error:
            self._give_up(draft, str(error))
        except SourceError as error:
            with self._lock:
                self._failed += 1
                hopeless = error.status in _SETUP or self._failed >= _PATIENCE
            if hopeless:
                self._give_up(draft, str(error))
            else:
                self._mark_unanswered(draft, str(error))
        except InputError as error:
            if not self.model.replays:
                raise
            # What the server did not answer when the calls were recorded is not in the recording.
            self._mark_unanswered(draft, str(error))
        else:
            self._count_answer()
            draft.value, draft.origin, draft.detail, draft.told = reply.value, Origin.WRITTEN, "", ""

    def _count_answer(self) -> None:
        with self._lock:
            self._failed = 0
            self.answers += 1

    def _give_up(self, draft: ModelDraft[Any], why: str) -> None:
        with self._lock:
            self.over = self.over or why
        self._mark_unanswered(draft, why)

    @staticmethod
    def _mark_unanswered(draft: ModelDraft[Any], why: str) -> None:
        if draft.origin is not Origin.NOT_GROUNDED:
            draft.origin = Origin.NO_ANSWER
        draft.told = why


# Whole numbers: servers that hold replies to a schema know their bounds, but not those of fractions.
Percent = Annotated[int, Field(ge=0, le=100)]

# The longest lists that are read: what is longer is no draft but a model that does not end.
_MOST_ACTIVITIES = 48
_MOST_GROUPS = 40
_MOST_TIES = 120


class _Reply(BaseModel):
    model_config = ConfigDict(extra="forbid")


class PersonalityReply(_Reply):
    """The big five, 0..100, and words for what stands out."""

    openness: Percent
    conscientiousness: Percent
    extraversion: Percent
    agreeableness: Percent
    neuroticism: Percent
    traits: Annotated[list[str], Field(min_length=1, max_length=4)]


class CharacterReply(_Reply):
    """Who somebody is; `workplace` is the name of a place, or null."""

    id: str
    name: str
    occupation: str
    workplace: str | None
    values: Annotated[list[str], Field(min_length=1, max_length=3)]
    personality: PersonalityReply
    hobbies: Annotated[list[str], Field(min_length=1, max_length=4)]
    lifestyle: str
    biography: str


class Characters(_Reply):
    """The people of one household."""

    characters: Annotated[list[CharacterReply], Field(min_length=1, max_length=12)]


class GroupReply(_Reply):
    """People who meet; `place` is the name of a place, `members` are ids."""

    name: str
    description: str
    activity: str
    place: str
    members: Annotated[list[str], Field(min_length=2)]
    start_time: str
    end_time: str


class TieReply(_Reply):
    """What two people, given by their ids, are to each other."""

    between: Annotated[list[str], Field(min_length=2, max_length=2)]
    kind: Literal["friend", "colleague"]
    note: str
    strength: Percent
    since: int


class SocialNetwork(_Reply):
    """Groups, and ties between two."""

    groups: Annotated[list[GroupReply], Field(min_length=1, max_length=_MOST_GROUPS)]
    ties: Annotated[list[TieReply], Field(max_length=_MOST_TIES)]


class ActivityReply(_Reply):
    """A stretch of a day, with the fields of the paper's daily plan prompt."""

    type: Literal["commute", "meal", "sleep", "main"]
    activity: str
    place: str | None
    building: str | None
    start_time: str
    end_time: str


class DayPlan(_Reply):
    """A resident's day."""

    schedule: Annotated[list[ActivityReply], Field(min_length=3, max_length=_MOST_ACTIVITIES)]


def characters_of(ids: Sequence[str], workplaces: Sequence[str]) -> type[Characters]:
    """Return `Characters` of just these people, who work at one of these places or at none."""
    value: Any = Literal[tuple(one.name for one in basic_values())]
    work: Any = (Literal[tuple(workplaces)] | None) if workplaces else None
    one = create_model(
        "CharacterReply",
        __base__=CharacterReply,
        id=(_one_of(ids), ...),
        workplace=(work, ...),
        values=(Annotated[list[value], Field(min_length=1, max_length=3)], ...),
    )
    people: Any = Annotated[list[one], Field(min_length=len(ids), max_length=len(ids))]
    return create_model("Characters", __base__=Characters, characters=(people, ...))


def social_network_of(ids: Sequence[str], places: Sequence[str]) -> type[SocialNetwork]:
    """Return a `SocialNetwork` of just these people, who meet at one of these places."""
    person: Any = _one_of(ids)
    members: Any = Annotated[list[person], Field(min_length=2, max_length=len(ids))]
    group = create_model("GroupReply", __base__=GroupReply, place=(_one_of(places), ...), members=(members, ...))
    pair: Any = Annotated[list[person], Field(min_length=2, max_length=2)]
    tie = create_model("TieReply", __base__=TieReply, between=(pair, ...))
    groups: Any = Annotated[list[group], Field(min_length=1, max_length=_MOST_GROUPS)]
    ties: Any = Annotated[list[tie], Field(max_length=_MOST_TIES)]
    return create_model("SocialNetwork", __base__=SocialNetwork, groups=(groups, ...), ties=(ties, ...))


def day_plan_of(places: Sequence[str]) -> type[DayPlan]:
    """Return a `DayPlan` at just these places."""
    place: Any = _one_of(places) | None
    activity = create_model("ActivityReply", __base__=ActivityReply, place=(place, ...))
    schedule: Any = Annotated[list[activity], Field(min_length=3, max_length=_MOST_ACTIVITIES)]
    return create_model("DayPlan", __base__=DayPlan, schedule=(schedule, ...))


def _one_of(values: Sequence[str]) -> Any:
    return Literal[tuple(values)]


# Marks of other formats have no business in a life's story, and are how text escapes into something else.
_MARKS = re.compile(r"[<>{}\[\]`\\|]|https?://|www\.", re.IGNORECASE)
_NAME = re.compile(r"[^\W\d_]+(?:[-'’ .]+[^\W\d_]+)*\.?")

#: The longest text of each kind, characters.
MOST = {
    "name": 60, "occupation": 60, "hobby": 60, "trait": 40, "lifestyle": 240, "biography": 1200, "group name": 60,
    "description": 300, "activity": 160, "note": 120,
}  # fmt: skip
_MOST_LABEL = 90


def fault_of(kind: str, text: str) -> str:
    """Return what is wrong with a text of a kind, or return an empty string."""
    if not text.strip():
        return "is empty: write something"
    if len(text) > MOST[kind]:
        return f"has {len(text)} characters: write {MOST[kind]} at most"
    if not text.isprintable():
        return "holds line breaks or control characters: write plain sentences on one line"
    if (mark := _MARKS.search(text)) is not None:
        return f"holds {mark[0]!r}: write plain sentences, without markup or addresses"
    return ""


def faults_of(where: str, kind: str, texts: Sequence[str]) -> list[str]:
    """Return what is wrong with some texts of a kind, a sentence each."""
    faults = [(k, fault_of(kind, text)) for k, text in enumerate(texts)]
    return [f"{where}: {kind} {k + 1 if len(texts) > 1 else ''}".rstrip() + f" {fault}" for k, fault in faults if fault]


def name_fault(name: str) -> str:
    """Return what is wrong with a person's name, or return an empty string."""
    if fault := fault_of("name", name):
        return fault
    if not _NAME.fullmatch(name) or len(name.split()) < 2 or len(name.split()[0]) < 2:
        return "is no first and last name in letters"
    return ""


def label_text(name: str) -> str:
    """Return a name off a map as one line, without control characters, of bounded length."""
    line = " ".join("".join(c if c.isprintable() else " " for c in name).split())
    return line if len(line) <= _MOST_LABEL else f"{line[: _MOST_LABEL - 3].rstrip()}..."


def renamer(names: Sequence[tuple[str, str]]) -> Callable[[str], str]:
    """Return a function that writes people's new first names for their old ones in a text."""
    changed = {old: new for old, new in names if old != new}
    if not changed:
        return lambda text: text
    pattern = re.compile(r"\b(" + "|".join(re.escape(old) for old in sorted(changed, key=len, reverse=True)) + r")\b")
    return lambda text: pattern.sub(lambda match: changed[match[1]], text)


# Workplaces offered to a household besides those of its members.
_OFFERED = 8
_LATE = 24 * 60


class PlaceLabels:
    """Names by which a model knows places: as on the map, with something added where two have the same."""

    def __init__(self, places: Sequence[Place]) -> None:
        names = {place.id: label_text(place.name) or place.id for place in places}
        counts = Counter(name.casefold() for name in names.values())
        self._label = {
            key: name if counts[name.casefold()] == 1 else f"{name} ({label_text(key)})" for key, name in names.items()
        }
        self._place = {label: key for key, label in self._label.items()}

    def __getitem__(self, place: str) -> str:
        """Return the label of a place."""
        return self._label[place]

    def place(self, label: str) -> str:
        """Return the id of the place with a label."""
        return self._place[label]


@dataclass(frozen=True)
class Cast:
    """The bodies, homes and households of a community that a model is to write, and what has to stay.

    Attributes
    ----------
    base
        The procedural author's community: bodies, ages, homes, children's schools; and what stands where the model
        fails.
    index
        The world on the community's day.
    """

    base: Community
    index: PlaceIndex

    @cached_property
    def labels(self) -> PlaceLabels:
        """Names of the places."""
        return PlaceLabels(self.index.world.places)

    @cached_property
    def households(self) -> list[list[Resident]]:
        """Residents by household, in the community's order."""
        found: dict[str, list[Resident]] = {}
        for resident in self.base.residents:
            found.setdefault(resident.household or resident.id, []).append(resident)
        return list(found.values())

    @cached_property
    def tied_to_small_children(self) -> frozenset[str]:
        """Ids of small children and of those who take them: their days go together, minute by minute, and stay."""
        found: set[str] = set()
        for household in self.households:
            for child in household:
                if child.age >= ALONE_FROM:
                    continue
                found.add(child.id)
                ways = set(_ways(child))
                found |= {other.id for other in household if other is not child and ways & set(_ways(other))}
        return frozenset(found)

    @cached_property
    def offers(self) -> list[list[str]]:
        """Ids of workplaces that each household may choose from: its own, and others that few other households get."""
        people = [r for r in self.base.residents if r.age >= GROWN_UP]
        taken = {r.workplace for r in people}
        free = [place.id for place in employers(self.index) if place.id not in taken]
        order = rng(self.base.seed, "community", "llm", "offers").permutation(len(free)).tolist()
        offers = []
        at = 0
        for household in self.households:
            own = [r.workplace for r in household if r.workplace is not None and r.age >= GROWN_UP]
            more = [free[order[(at + k) % len(free)]] for k in range(min(_OFFERED, len(free)))]
            at += _OFFERED
            homes = {r.home for r in household}
            offers.append([place for place in dict.fromkeys([*own, *more]) if place not in homes])
        return offers

    def scene(self) -> dict[str, Any]:
        """Return what a town this is, on which day."""
        counts = Counter(place.category.value for place in self.index.places())
        return {
            "name": label_text(self.base.world.name),
            "day": self.base.weekday,
            "places": {name: counts[name] for name in sorted(counts)},
        }

    def place_facts(self, place: str, *, jobs: bool = False, walk_from: str | None = None) -> dict[str, Any]:
        """Return what is to be known of a place: name, building, function, hours on the day.

        Parameters
        ----------
        jobs
            With the trades that it employs.
        walk_from
            With the minutes on foot from this place.
        """
        found = self.index.place_by_id[place]
        spans = [f"{clock_of(a * 60)[:5]}-{clock_of(min(b, _LATE) * 60)[:5]}" for a, b in self.index.hours(found)]
        facts: dict[str, Any] = {
            "name": self.labels[place],
            "building": found.building,
            "function": function_of(found),
            "open": "always" if found.category is Category.ACCOMMODATION else ", ".join(spans) or "closed",
        }
        if jobs:
            facts["employs"] = self.trades(place)
        if walk_from is not None:
            facts["minutes_on_foot_from_home"] = self.index.minutes(walk_from, place)
        return facts

    def trades(self, place: str) -> list[str]:
        """Return the occupations that somebody at a place may have."""
        found = self.index.place_by_id[place]
        study = ["student of ..."] if kind_of(found) in STUDY_KINDS else []
        return [*(job.title for job in jobs_at(found)), *study]

    def body(self, resident: Resident) -> dict[str, Any]:
        """Return what can be seen of somebody, and what is settled: name and age, looks, home, family, school."""
        kept = self.keeps_work(resident)
        return {
            "id": resident.id,
            "suggested_name": resident.name,
            "age": resident.age,
            "gender": resident.gender,
            "looks": looks_in_words(resident),
            "lives": self.home_in_words(resident),
            "family": self.family(resident),
            "settled": {
                "occupation": resident.occupation,
                "workplace": self.labels[resident.workplace] if resident.workplace else None,
            }
            if kept
            else None,
        }

    def keeps_work(self, resident: Resident) -> bool:
        """Whether somebody's occupation is settled: children's, and that of who takes small ones somewhere."""
        return resident.age < GROWN_UP or resident.id in self.tied_to_small_children

    def home_in_words(self, resident: Resident) -> str:
        """Return where somebody lives."""
        home = self.index.place_by_id[resident.home]
        return f"{'as a guest ' if kind_of(home) in GUEST_KINDS else ''}at {self.labels[home.id]}"

    def family(self, resident: Resident) -> list[str]:
        """Return who shares somebody's home, as ids with what they are to each other."""
        names = {r.id for r in self.base.residents if r.household == resident.household} - {resident.id}
        found = []
        for relation in self.base.relations_of(resident.id):
            other = relation.between[1] if relation.between[0] == resident.id else relation.between[0]
            if other in names and relation.kind in (RelationKind.FAMILY, RelationKind.FRIEND):
                found.append(f"{other}: {relation.note.partition(';')[0]}")
        return found

    def near(self, homes: Iterable[str], categories: Iterable[Category], most: int) -> list[str]:
        """Return the places of some categories near some homes, the nearest of each in turn, at most so many."""
        wanted = frozenset(categories)
        lists = [
            [place.id for place in self.index.by_nearness(home) if place.category in wanted]
            for home in dict.fromkeys(homes)
        ]
        longest = max((len(one) for one in lists), default=0)
        merged = dict.fromkeys(one[k] for k in range(longest) for one in lists if k < len(one))
        return list(merged)[:most]


def _ways(resident: Resident) -> list[tuple[str, str, str | None]]:
    """Return start, end and goal of the ways of a day."""
    return [
        (way.start, way.end, then.place) for way, then in pairwise(resident.schedule) if way.type is ItemType.COMMUTE
    ]


def function_of(place: Place) -> str:
    """Return what a place is for, in words: ``cafe (food)``."""
    return f"{label_text(kind_of(place).replace('_', ' '))} ({place.category.value})"


def looks_in_words(resident: Resident) -> str:
    """Return what one sees of somebody."""
    look = resident.appearance
    person = (
        ("girl" if resident.gender == "female" else "boy")
        if resident.age < GROWN_UP
        else ("woman" if resident.gender == "female" else "man")
    )
    build = "slim" if look["build"] < 0.35 else "heavily built" if look["build"] > 0.65 else "of medium build"
    hair = "bald" if look["hair"] == "bald" else f"{look['hair']} hair"
    extras = [word for word, has in (("beard", look["beard"]), ("glasses", look["glasses"])) if has]
    clothes: list[str] = [look["top"], look["bottom"], look["shoes"]]
    worn = [look.get("hat", "none"), look.get("over", "none"), look.get("bag", "none")]
    clothes += [one for one in worn if one != "none"]
    return ", ".join([f"{person}, {look['height']:.2f} m tall, {build}, {hair}", *extras, *clothes])
