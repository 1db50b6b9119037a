"""What members answer without a language model: lines by tone, read from ``vico/data/influence/replies.toml``."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from vico.agents.influence.profiles import Profile
from vico.challenges.influence.lexicon import GUIDE
from vico.io.data_files import PACKAGED, DataRecord, cached_data, read_record

Some = Annotated[tuple[str, ...], Field(min_length=1)]


class ReplyLines(DataRecord):
    """Lines by what they say; in braces {you}, {rival} and {dear}."""

    warm: Some
    neutral: Some
    cool: Some
    stands_with_you: Some
    stands_with_rival: Some
    undecided: Some
    on_the_way: Some
    enough: Some


@cached_data
def reply_lines() -> ReplyLines:
    """Return the lines.

    Raises
    ------
    SchemaError
        If the file is not as it should be.
    """
    return read_record(PACKAGED / "influence" / "replies.toml", ReplyLines, guide=GUIDE)


def reply(kind: str, listener: Profile, speaker: Profile, rival: Profile, chance: np.random.Generator) -> str:
    """Return a line of a kind, as a listener says it to a speaker."""
    options: tuple[str, ...] = getattr(reply_lines(), kind)
    dear = [*listener.values, *listener.hobbies]
    line = options[int(chance.integers(len(options)))].format(
        you=speaker.first_name, rival=rival.first_name, dear=dear[int(chance.integers(len(dear)))] if dear else "people"
    )
    return line[0].upper() + line[1:]
