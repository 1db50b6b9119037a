"""Dataset formats by name. A new one is a module beside these, and an entry here."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vico.datasets.formats import lerobot, tables, webdataset
from vico.datasets.layout import Layout
from vico.datasets.pictures import BlobWriter, PictureWriter, VideoWriter


@dataclass(frozen=True)
class Format:
    """Format of a dataset on the disk.

    Attributes
    ----------
    about
        In a few words.
    writer
        Encodes a demonstration's pictures: `PictureFiles`, outputs, ``size``, ``fps``, ``frames``.
    assemble
        Writes a whole dataset into a folder.
    episode_frames
        Yields an episode's frames: folder, index, outputs, fps.
    even
        Whether sides of pictures have to be even, as films want them.
    """

    about: str
    writer: Callable[..., PictureWriter]
    assemble: Callable[[Path, Layout], None]
    episode_frames: Callable[[Path, int, Sequence[str], int], Iterator[dict[str, Any]]]
    even: bool = False


FORMATS = {
    "lerobot": Format("LeRobot v3.0", VideoWriter, lerobot.assemble, lerobot.episode_frames, even=True),
    "webdataset": Format("WebDataset shards", BlobWriter, webdataset.assemble, webdataset.episode_frames),
    "parquet": Format("Parquet files", BlobWriter, tables.assemble, tables.episode_frames),
}
