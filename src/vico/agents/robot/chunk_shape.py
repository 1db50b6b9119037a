"""Sizes of an action-chunk policy, which training, network and agent share."""

from __future__ import annotations

from dataclasses import dataclass

from vico.agents.robot.increments import INCREMENTS, STATE


@dataclass(frozen=True)
class ChunkShape:
    """Sizes of a policy.

    Attributes
    ----------
    side
        Of the picture, pixels.
    chunk
        Actions that it gives at once.
    state, action
        Numbers of each.
    words, vocabulary
        Words of an instruction that are read, and how many it tells apart.
    width, heads, encoders, decoders, dropout
        Of the transformer.
    """

    side: int = 96
    chunk: int = 20
    state: int = len(STATE)
    action: int = len(INCREMENTS)
    words: int = 24
    vocabulary: int = 512
    width: int = 256
    heads: int = 8
    encoders: int = 4
    decoders: int = 2
    dropout: float = 0.1
