"""The numbers of the opinion model, read from ``vico/data/influence/opinion.toml``; docs/influence.md explains each."""

from __future__ import annotations

from hashlib import sha256
from typing import Annotated, Literal

from pydantic import Field

from vico.challenges.influence.lexicon import GUIDE
from vico.io.data_files import PACKAGED, DataRecord, cached_data, read_record

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
NotPositive = Annotated[float, Field(le=0.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]

_FILE = PACKAGED / "influence" / "opinion.toml"


class PriorConstants(DataRecord):
    """What is felt before any talk; `chance` is a standard deviation."""

    values: NotNegative
    hobbies: NotNegative
    group: NotNegative
    ties: NotNegative
    similarity: NotNegative
    chance: NotNegative


class MessageConstants(DataRecord):
    """How well a message is received."""

    value: Annotated[tuple[Positive, ...], Field(min_length=1)]
    hobby: Positive
    group: Positive
    other: NotPositive
    opposed: NotPositive
    common: Annotated[float, Field(ge=1.0)]
    unbacked: Share
    attention: Positive
    words_a_topic: Positive
    longest: Positive
    repeated: Share
    same_words: Share
    annoyance: NotPositive
    canned: Share
    appeals: Annotated[int, Field(ge=0)]
    flattery: NotNegative
    flattered_again: NotPositive
    pressure: NotPositive
    boasting: NotPositive


class ListenerConstants(DataRecord):
    """How a listener takes it."""

    base: Positive
    openness: NotNegative
    agreeableness: NotNegative
    hurt: NotNegative
    contact: NotNegative
    rounds: Annotated[int, Field(ge=1)]
    conversations: Annotated[int, Field(ge=1)]
    tired: Share


class ReplyConstants(DataRecord):
    """From which reception on a reply is warm, and below which it is cool."""

    warm: float
    cool: float


class SumForm(DataRecord):
    """Receptions add up, up to `most`, and fade with a half-life in hours."""

    name: str
    form: Literal["sum"]
    scale: Positive
    most: Positive
    half_life: Positive


class AverageForm(DataRecord):
    """Receptions are averaged with what was felt before; the older ones weigh less."""

    name: str
    form: Literal["average"]
    scale: Positive
    prior_weight: Positive
    message_weight: Positive
    forgetting: NotNegative


class SocialForm(DataRecord):
    """Receptions move an opinion the less the farther it has gone; at day's end friends' opinions are heard."""

    name: str
    form: Literal["social"]
    scale: Positive
    most: Positive
    half_life: Positive
    listens_to_friends: Share


Variant = SumForm | AverageForm | SocialForm


class OpinionConstants(DataRecord):
    """All numbers of the model."""

    prior: PriorConstants
    message: MessageConstants
    listener: ListenerConstants
    reply: ReplyConstants
    variant: tuple[Annotated[Variant, Field(discriminator="form")], ...]


@cached_data
def opinion_constants() -> OpinionConstants:
    """Return the numbers. They are the package's alone: results could not be compared otherwise.

    Raises
    ------
    SchemaError
        If the file is not as it should be.
    """
    return read_record(_FILE, OpinionConstants, guide=GUIDE)


@cached_data
def opinion_digest() -> str:
    """Return the first 12 hex digits of the file's SHA-256, to name in results."""
    return sha256(_FILE.read_bytes()).hexdigest()[:12]
