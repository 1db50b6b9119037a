"""Films: MP4 files of RGB frames, written frame by frame or from a sequence, and read back."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from vico.errors import EmptyInputError, InputError
from vico.io.files import write_errors


def partial_film(path: Path) -> Path:
    """Return where a film is while it is written; what is there can be played at any time."""
    return path.with_name(f"{path.stem}.partial.mp4")


class FilmWriter:
    """An H.264 film that any browser plays; it takes its name only once it is whole.

    Until then it is at `partial_film`, in fragments of a frame: a killed program leaves a film of what it had done, and
    so does one that is interrupted. After an error nothing is left.

    Parameters
    ----------
    path
        File to write; its suffix must be ``.mp4``.
    rate
        Frames a second.
    crf
        Quality: 18 very good, 28 small.
    threads
        That encode. One leaves the other cores alone.
    """

    def __init__(self, path: Path, *, rate: int, crf: int = 23, threads: int = 1) -> None:
        if path.suffix != ".mp4":
            raise InputError(f"{path}: films are .mp4 files")
        self.path = path
        self.frames = 0
        self._partial = partial_film(path)
        self._rate, self._crf, self._threads = rate, crf, threads
        self._container: Any = None
        self._stream: Any = None

    def add(self, frame: NDArray[np.uint8]) -> None:
        """Append one frame, uint8, shape ``(h, w, 3)``; all alike, sides even."""
        if self._container is None:
            self._open(frame.shape[0], frame.shape[1])
        image = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24")
        with write_errors(self.path):
            self._container.mux(self._stream.encode(image))
        self.frames += 1

    def _open(self, height: int, width: int) -> None:
        if height % 2 or width % 2:
            raise InputError(f"{self.path}: frames of {width}x{height}; both sides must be even")
        flags = {"movflags": "frag_every_frame+empty_moov+default_base_moof", "flush_packets": "1"}
        self._container = av.open(str(self._partial), "w", options=flags)
        self._stream = self._container.add_stream("libx264", rate=self._rate)
        self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, "yuv420p"
        self._stream.time_base = Fraction(1, self._rate)
        self._stream.codec_context.thread_count = self._threads
        self._stream.options = {"crf": str(self._crf), "preset": "veryfast"}

    def close(self) -> None:
        """Finish the file and give it its name.

        Raises
        ------
        EmptyInputError
            If no frame was added.
        """
        if self._container is None:
            raise EmptyInputError(f"{self.path}: there is no frame to film")
        self._finish()
        _in_one_piece(self._partial)
        os.replace(self._partial, self.path)

    def keep(self) -> None:
        """Finish what is there, under the name it has while it is written."""
        if self._container is not None:
            self._finish()

    def discard(self) -> None:
        """Give the film up; nothing stays on disk."""
        if self._container is not None:
            with suppress(OSError):
                self._container.close()
            self._container = None
        self._partial.unlink(missing_ok=True)

    def _finish(self) -> None:
        container, self._container = self._container, None
        container.mux(self._stream.encode(None))
        container.close()

    def __enter__(self) -> FilmWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        interrupted = kind is not None and issubclass(kind, KeyboardInterrupt)
        try:
            with write_errors(self.path):
                if interrupted:
                    self.keep()
                elif kind is None:
                    self.close()
        except KeyboardInterrupt:
            interrupted = True
            raise
        finally:
            if not interrupted:
                self.discard()


def _in_one_piece(path: Path) -> None:
    """Write a film of fragments anew as the file that all players know, its table first; no picture is touched."""
    whole = path.with_name(f".{path.name}")
    try:
        with (
            av.open(str(path)) as fragments,
            av.open(str(whole), "w", options={"movflags": "+faststart"}) as film,
        ):
            stream = fragments.streams.video[0]
            copy = film.add_stream_from_template(stream)
            for packet in fragments.demux(stream):
                if packet.dts is not None:
                    packet.stream = copy
                    film.mux(packet)
        os.replace(whole, path)
    finally:
        whole.unlink(missing_ok=True)


def write_film(path: Path, frames: Iterable[NDArray[np.uint8]], *, rate: int, crf: int = 23, threads: int = 1) -> int:
    """Write a whole sequence of frames as a film; return how many there were."""
    with FilmWriter(path, rate=rate, crf=crf, threads=threads) as film:
        for frame in frames:
            film.add(frame)
        return film.frames


def read_film(path: Path, *, wanted: Collection[int] | None = None) -> Iterator[NDArray[np.uint8]]:
    """Yield the frames of a film, uint8, shape ``(h, w, 3)``.

    Parameters
    ----------
    wanted
        Numbers of the frames to yield, from 0; None for all. The others are decoded, but not turned into pictures,
        which takes most of the time.
    """
    with av.open(str(path)) as container:
        for number, frame in enumerate(container.decode(video=0)):
            if wanted is None or number in wanted:
                yield frame.to_ndarray(format="rgb24")
