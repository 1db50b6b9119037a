"""The network of an action-chunk policy (extra ``imitation``: torch): a picture, joints and words in, actions out.

After ACT (Zhao et al., 2023), without its variational part: what the picture shows, how the joints are and what was
asked for become tokens of one transformer; a query for each action to come reads them. About 6 million parameters.
Only `vico.agents.robot.chunk_policy` and training import this module, so that the base install does without torch.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

from vico.agents.robot.increments import ChunkShape


class _Residual(nn.Module):  # type: ignore[misc]
    """Two convolutions beside their input."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Conv2d(channels, channels, 3, padding=1),
            nn.GroupNorm(8, channels),
            nn.ReLU(),
            nn.Conv2d(channels, channels, 3, padding=1),
            nn.GroupNorm(8, channels),
        )

    def forward(self, x: Tensor) -> Tensor:
        return torch.relu(x + self.layers(x))


def _halving_layers(before: int, after: int, size: int = 3) -> list[Any]:
    return [nn.Conv2d(before, after, size, stride=2, padding=size // 2), nn.GroupNorm(8, after), nn.ReLU()]


class ChunkNetwork(nn.Module):  # type: ignore[misc]
    """Predicts the coming actions, all at once.

    Parameters
    ----------
    shape
        Its sizes.
    """

    def __init__(self, shape: ChunkShape) -> None:
        super().__init__()
        width = shape.width
        self.shape = shape
        self.eyes = nn.Sequential(
            *_halving_layers(3, 32, 5),
            *_halving_layers(32, 64),
            _Residual(64),
            *_halving_layers(64, 128),
            _Residual(128),
            *_halving_layers(128, width),
        )
        cells = -(-shape.side // 16)
        self.cell_place = nn.Parameter(torch.randn(cells * cells, width) * 0.02)
        self.joints = nn.Sequential(nn.Linear(shape.state, width), nn.ReLU(), nn.Linear(width, width))
        self.words = nn.Embedding(shape.vocabulary + 1, width, padding_idx=0)
        self.word_place = nn.Parameter(torch.randn(shape.words, width) * 0.02)
        kind = {"batch_first": True, "norm_first": True, "dropout": shape.dropout}
        encoder = nn.TransformerEncoderLayer(width, shape.heads, 4 * width, **kind)
        decoder = nn.TransformerDecoderLayer(width, shape.heads, 4 * width, **kind)
        self.encoder = nn.TransformerEncoder(encoder, shape.encoders, enable_nested_tensor=False)
        self.decoder = nn.TransformerDecoder(decoder, shape.decoders)
        self.queries = nn.Parameter(torch.randn(shape.chunk, width) * 0.02)
        self.actions = nn.Sequential(nn.LayerNorm(width), nn.Linear(width, shape.action))

    def forward(self, pictures: Tensor, states: Tensor, words: Tensor) -> Tensor:
        """Return scaled actions, shape ``(n, chunk, action)``.

        Parameters
        ----------
        pictures
            uint8, shape ``(n, side, side, 3)``.
        states
            Scaled, float32, shape ``(n, state)``.
        words
            Numbers of the instruction's words, 0 for none, int64, shape ``(n, words)``.
        """
        seen = self.eyes(pictures.permute(0, 3, 1, 2).float() / 127.5 - 1.0)
        seen = seen.flatten(2).transpose(1, 2) + self.cell_place
        told = self.words(words) + self.word_place
        tokens = torch.cat([self.joints(states)[:, None], seen, told], dim=1)
        nothing = torch.zeros(len(words), 1 + seen.shape[1], dtype=torch.bool, device=words.device)
        masked = torch.cat([nothing, words == 0], dim=1)
        memory = self.encoder(tokens, src_key_padding_mask=masked)
        asked = self.queries.expand(len(words), -1, -1)
        found: Tensor = self.actions(self.decoder(asked, memory, memory_key_padding_mask=masked))
        return found
