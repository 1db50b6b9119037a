"""What the model is asked to reply with; the fields of a day's activities are those of the paper's prompt."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, create_model

from vico.community.catalogue import basic_values

# Whole numbers: servers that hold replies to a schema know their bounds, but not those of fractions.
Percent = Annotated[int, Field(ge=0, le=100)]

# The longest lists that are read: what is longer is no draft but a model that does not end.
_MOST_ACTIVITIES, _MOST_GROUPS, _MOST_TIES = 48, 40, 120


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
