"""Encoded pictures of one demonstration: colours as video or PNG, depth and entities exactly."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from PIL import Image

#: H.264 that looks like the picture and is decoded from anywhere: every second frame is whole, none looks ahead.
VIDEO_OPTIONS = {"crf": "18", "preset": "veryfast", "g": "2", "bf": "0", "sc_threshold": "0"}
_EXACT: dict[str, Any] = {"depth": np.float32, "segmentation": np.int32}


class PictureWriter(Protocol):
    """Takes a demonstration's pictures, a frame after the other."""

    def add(self, pictures: Mapping[str, NDArray[Any]]) -> None:
        """Take the pictures of a frame, by output."""

    def close(self) -> None:
        """Finish the files."""


@dataclass(frozen=True)
class PictureFiles:
    """Where a demonstration's encoded pictures lie."""

    folder: Path
    stem: str

    @property
    def video(self) -> Path:
        """Colours as H.264."""
        return self.folder / f"{self.stem}.rgb.mp4"

    @property
    def blobs(self) -> Path:
        """A row a frame, with a column of encoded files for each output."""
        return self.folder / f"{self.stem}.pictures.parquet"

    def exact(self, output: str) -> Path:
        """Depth or entities as an array, shape ``(n, size, size)``."""
        return self.folder / f"{self.stem}.{output}.npy"


class VideoWriter:
    """Writes colours as H.264 and the rest as arrays.

    Parameters
    ----------
    files
        Where to.
    outputs
        What there will be.
    size
        Side of the pictures, pixels; even.
    fps
        Frames a second.
    frames
        How many there will be.
    """

    def __init__(self, files: PictureFiles, outputs: Sequence[str], *, size: int, fps: int, frames: int) -> None:
        self._exact: dict[str, Any] = {
            name: np.lib.format.open_memmap(files.exact(name), "w+", _EXACT[name], (frames, size, size))
            for name in outputs
            if name in _EXACT
        }
        self._container: Any = None
        self._frames = 0
        if "rgb" in outputs:
            self._container = av.open(str(files.video), "w")
            self._stream = self._container.add_stream("libx264", rate=fps, options=dict(VIDEO_OPTIONS))
            self._stream.width = self._stream.height = size
            self._stream.pix_fmt = "yuv420p"
            self._stream.time_base = self._frame_time = Fraction(1, fps)
            # One thread: the same bytes whatever the machine is busy with.
            self._stream.codec_context.thread_count = 1

    def add(self, pictures: Mapping[str, NDArray[Any]]) -> None:
        """Take the pictures of a frame."""
        for name, array in self._exact.items():
            array[self._frames] = pictures[name]
        if self._container is not None:
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(pictures["rgb"]), format="rgb24")
            frame.pts, frame.time_base = self._frames, self._frame_time
            self._container.mux(self._stream.encode(frame))
        self._frames += 1

    def close(self) -> None:
        """Finish the files."""
        if self._container is not None:
            self._container.mux(self._stream.encode(None))
            self._container.close()
        for array in self._exact.values():
            array.flush()
        self._exact.clear()


class BlobWriter:
    """Writes colours as PNG and the rest as ``.npy``, all in one file with a row a frame."""

    def __init__(self, files: PictureFiles, outputs: Sequence[str], *, size: int, fps: int, frames: int) -> None:
        self._files = files
        self._rows: dict[str, list[bytes]] = {name: [] for name in outputs}

    def add(self, pictures: Mapping[str, NDArray[Any]]) -> None:
        """Take the pictures of a frame."""
        for name, rows in self._rows.items():
            rows.append(png_of(pictures[name]) if name == "rgb" else npy_of(pictures[name]))

    def close(self) -> None:
        """Finish the file."""
        if self._rows:
            table = pa.table({name: pa.array(rows, pa.binary()) for name, rows in self._rows.items()})
            pq.write_table(table, self._files.blobs, compression="zstd", use_dictionary=False)


def png_of(picture: NDArray[np.uint8]) -> bytes:
    """Return a picture as PNG."""
    sink = io.BytesIO()
    Image.fromarray(picture).save(sink, "PNG", compress_level=3)
    return sink.getvalue()


def npy_of(array: NDArray[Any]) -> bytes:
    """Return an array as the content of a ``.npy`` file."""
    sink = io.BytesIO()
    np.save(sink, array, allow_pickle=False)
    return sink.getvalue()


def array_of_blob(output: str, blob: bytes) -> NDArray[Any]:
    """Undo `png_of` and `npy_of`."""
    if output == "rgb":
        return np.asarray(Image.open(io.BytesIO(blob)).convert("RGB"))
    array: NDArray[Any] = np.load(io.BytesIO(blob), allow_pickle=False)
    return array


def joined_video(out: Path, videos: Sequence[Path], lengths: Sequence[int], *, fps: int) -> None:
    """Put videos of `VideoWriter` one after the other, without encoding anything again.

    Parameters
    ----------
    lengths
        Frames of each.
    """
    with av.open(str(out), "w") as container:
        stream: Any = None
        before = 0
        for path, length in zip(videos, lengths, strict=True):
            with av.open(str(path)) as source:
                its: Any = source.streams.video[0]
                if stream is None:
                    stream = container.add_stream_from_template(its)
                    stream.time_base = its.time_base
                offset = int(before / fps / its.time_base)
                for packet in source.demux(its):
                    if packet.dts is None:
                        continue
                    packet.pts, packet.dts = packet.pts + offset, packet.dts + offset
                    packet.stream = stream
                    container.mux(packet)
            before += length


def frames_of_video(path: Path, first: int, count: int, *, fps: int) -> Iterator[NDArray[np.uint8]]:
    """Yield `count` pictures of a video from its frame `first` on, uint8, shape ``(h, w, 3)``."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        if first:
            container.seek(int(first / fps / stream.time_base), stream=stream, backward=True)
        for frame in container.decode(stream):
            place = round(float(frame.time) * fps)
            if place >= first + count:
                return
            if place >= first:
                yield frame.to_ndarray(format="rgb24")
