"""Films of what agents saw: H.264, a frame a step, in parts that begin where a checkpoint lets the recording go on."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from vico.sim.recording.schema import VIEWS

RATE = 10
#: Every so many frames one is stored whole.
KEY = 20


class ViewFilm:
    """One agent's film: H.264 in fragments of 20 frames, so that what is written can be played at any time."""

    def __init__(self, path: Path, width: int, height: int) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        flags = {"movflags": "frag_keyframe+empty_moov+default_base_moof", "flush_packets": "1"}
        self._container: Any = av.open(str(path), "w", options=flags)
        self._stream = self._container.add_stream("libx264", rate=RATE)
        # The encoder wants even sides: a last odd row or column is left out.
        self._stream.width, self._stream.height = width // 2 * 2, height // 2 * 2
        self._stream.pix_fmt = "yuv420p"
        self._stream.time_base = Fraction(1, RATE)
        # One thread and no look-ahead: the films must not fight the simulation for cores.
        self._stream.codec_context.thread_count = 1
        self._stream.options = {"crf": "27", "preset": "ultrafast", "tune": "zerolatency"}
        # A whole frame every 20 steps, and nowhere else: viewers take those as stills without decoding the rest.
        self._stream.options |= {"g": str(KEY), "sc_threshold": "0"}

    def add(self, number: int, picture: NDArray[np.uint8]) -> None:
        """Append a picture, uint8, shape ``(h, w, 3)``; `number` grows, and says when it is shown."""
        even = picture[: self._stream.height, : self._stream.width]
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(even), format="rgb24")
        frame.pts, frame.time_base = number, Fraction(1, RATE)
        self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Write what is left."""
        self._container.mux(self._stream.encode(None))
        self._container.close()


class ViewFilms:
    """Films of a run while it is recorded; one step's pictures are encoded while the next step is simulated.

    Parameters
    ----------
    run
        Folder of the run.
    """

    def __init__(self, run: Path) -> None:
        self._folder = run / VIEWS
        self._films: dict[str, tuple[int, ViewFilm]] = {}
        # The encoder lets go of the interpreter.
        self._crew = ThreadPoolExecutor(1, "films")
        self._filming: Future[None] | None = None

    def add(
        self,
        step: int,
        pictures: Mapping[str, NDArray[np.uint8]],
        wait: Callable[[], None],
        arrays: Mapping[str, Mapping[str, NDArray[Any]]] | None = None,
    ) -> None:
        """Append a step's pictures, by agent; they may be read once `wait` has returned.

        `arrays` are what is kept beside the film, by agent and output.
        """
        self._finish_filming()
        if pictures or arrays:
            self._filming = self._crew.submit(self._film, step, pictures, wait, arrays or {})

    def end_part(self) -> None:
        """Finish all files; what comes then begins others."""
        self._finish_filming()
        films, self._films = self._films, {}
        for _, film in films.values():
            film.close()

    def close(self) -> None:
        """Finish all files for good."""
        try:
            self.end_part()
        finally:
            self._crew.shutdown()

    def _film(
        self,
        step: int,
        pictures: Mapping[str, NDArray[np.uint8]],
        wait: Callable[[], None],
        arrays: Mapping[str, Mapping[str, NDArray[Any]]],
    ) -> None:
        wait()
        for name, kept in arrays.items():
            (self._folder / name).mkdir(parents=True, exist_ok=True)
            with (self._folder / name / f"{step:08d}.npz").open("wb") as file:
                np.savez_compressed(file, allow_pickle=False, **kept)
        for name, picture in pictures.items():
            if name not in self._films:
                self._films[name] = step, ViewFilm(self._folder / name / f"{step:08d}.mp4", *picture.shape[1::-1])
            first, film = self._films[name]
            film.add(step - first, picture)

    def _finish_filming(self) -> None:
        """Wait for the pictures of the step before; whatever went wrong with them is raised here."""
        if self._filming is not None:
            filming, self._filming = self._filming, None
            filming.result()


class View:
    """The film of what one agent saw, read from all its parts.

    Parameters
    ----------
    folder
        Of the agent's parts, each named by the step of its first frame.
    last
        Last recorded step; frames of later ones are left out.
    """

    def __init__(self, folder: Path, last: int) -> None:
        self._parts = sorted((int(path.stem), path) for path in folder.glob("*.mp4"))
        self._last = last

    def frames(self, wanted: Collection[int] | None = None) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        """Yield step and picture (uint8, shape ``(h, w, 3)``) of the steps `wanted`, in order; None for all.

        Steps at which the agent observed nothing are left out.
        """
        ends = [first for first, _ in self._parts[1:]] + [self._last + 1]
        for (first, path), end in zip(self._parts, ends, strict=True):
            if wanted is None or any(first <= step < end for step in wanted):
                for step, frame in _decode_frames(path, first):
                    if step < end and (wanted is None or step in wanted):
                        yield step, frame.to_ndarray(format="rgb24")

    def key_frames(self) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        """Yield step and picture of the frames that are stored whole, one in 20: what lies between isn't decoded."""
        for first, path in self._parts:
            for step, frame in _decode_frames(path, first, whole_only=True):
                if step <= self._last:
                    yield step, frame.to_ndarray(format="rgb24")


def _decode_frames(path: Path, first: int, *, whole_only: bool = False) -> Iterator[tuple[int, Any]]:
    """Yield step and decoded frame of a part that begins with step `first`."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        if whole_only:
            stream.codec_context.skip_frame = "NONKEY"
        for frame in container.decode(stream):
            yield first + round(frame.time * RATE), frame


def drop_views_after(run: Path, step: int) -> None:
    """Delete the parts of films that begin after a step, and arrays of later steps."""
    for pattern in ("*/*.mp4", "*/*.npz"):
        for path in (run / VIEWS).glob(pattern):
            if int(path.stem) > step:
                path.unlink()
