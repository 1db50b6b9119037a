"""Pictures of an episode: kept while it is played or read from a recording, reduced in size, and encoded.

Colours are encoded as video or PNG, depth and entities exactly.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import av
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from PIL import Image

from vico.errors import InputError, SchemaError
from vico.io.files import read_json, write_json
from vico.runner.loop import Hook, Step
from vico.sim.recording import Run
from vico.sim.recording.schema import VIEWS

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
    """Files of a demonstration's encoded pictures."""

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


#: Outputs a dataset may hold, with the type of their values and their colours a pixel.
PICTURES: dict[str, tuple[type[np.generic], int]] = {
    "rgb": (np.uint8, 3),
    "depth": (np.float32, 1),
    "segmentation": (np.int32, 1),
}
_INDEX = "pictures.json"

Pictures = Mapping[str, NDArray[Any]]


class PictureSource(Protocol):
    """Source of an agent's pictures."""

    def of(self, agent: str, steps: Sequence[int], *, size: int, outputs: Sequence[str]) -> Iterator[Pictures]:
        """Yield an agent's pictures at steps, in their order: by output, ``(size, size)``, rgb ``(size, size, 3)``.

        Raises
        ------
        InputError
            If there are none of one of the outputs or steps; the message says how to have some.
        """


def resize_picture(picture: NDArray[Any], size: int) -> NDArray[Any]:
    """Return a picture of `size` x `size` pixels, cut to a square: colours averaged, anything else picked.

    Depth is not averaged, for between two surfaces there is none; nor are entities.

    Raises
    ------
    InputError
        If it is smaller than that.
    """
    side = min(picture.shape[:2])
    if side < size:
        raise InputError(f"pictures: {side} pixels were recorded, fewer than the {size} asked for; give --size {side}")
    top, left = (picture.shape[0] - side) // 2, (picture.shape[1] - side) // 2
    square = picture[top : top + side, left : left + side]
    if side == size:
        return square
    if square.ndim == 3:
        return np.asarray(Image.fromarray(square).resize((size, size), Image.Resampling.BOX))
    middles = ((np.arange(size) + 0.5) * side / size).astype(np.intp)
    return square[np.ix_(middles, middles)]


class PictureKeeper(Hook):
    """Keeps what some agents see while an episode is played, at the size that is wanted, in files of plain numbers.

    Parameters
    ----------
    folder
        Where the files go; made if it is not there.
    agents
        Whose pictures are kept.
    size
        Side, pixels.
    outputs
        Some of `PICTURES`.
    """

    def __init__(self, folder: Path, agents: Sequence[str], *, size: int, outputs: Sequence[str]) -> None:
        self._folder, self._agents, self._size, self._outputs = folder, list(agents), size, list(outputs)
        self._steps: dict[str, list[int]] = {name: [] for name in agents}
        self._files: dict[tuple[str, str], BinaryIO] = {}
        self._stack = ExitStack()
        folder.mkdir(parents=True, exist_ok=True)

    def begin(self, observations: Mapping[str, dict[str, Any]]) -> None:
        """Keep the pictures before the first step."""
        self.keep(0, observations)

    def on_step(self, step: Step) -> None:
        """Keep a step's pictures."""
        self.keep(step.number, step.result.observations)

    def close(self) -> KeptPictures:
        """Finish the files, and return what reads them."""
        self._stack.close()
        record = {"size": self._size, "outputs": self._outputs, "steps": self._steps}
        write_json(self._folder / _INDEX, record)
        return KeptPictures(self._folder)

    def keep(self, number: int, observations: Mapping[str, dict[str, Any]]) -> None:
        """Keep what is seen at a step, by agent's name."""
        for name in self._agents:
            seen = observations.get(name, {})
            if any(output not in seen for output in self._outputs):
                continue
            self._steps[name].append(number)
            for output in self._outputs:
                kind = PICTURES[output][0]
                self._file(name, output).write(
                    np.ascontiguousarray(resize_picture(seen[output], self._size), kind).tobytes()
                )

    def _file(self, name: str, output: str) -> BinaryIO:
        if (name, output) not in self._files:
            path = self._folder / f"{name}.{output}"
            self._files[name, output] = self._stack.enter_context(path.open("wb"))
        return self._files[name, output]


class KeptPictures:
    """Reads what a `PictureKeeper` kept."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._record = read_json(folder / _INDEX)

    def of(self, agent: str, steps: Sequence[int], *, size: int, outputs: Sequence[str]) -> Iterator[Pictures]:
        """See `PictureSource.of`."""
        side = self._record["size"]
        place = {step: k for k, step in enumerate(self._record["steps"][agent])}
        if missing := [step for step in steps if step not in place]:
            raise InputError(f"{agent}: saw nothing at step {missing[0]}; it has to observe at every step")
        arrays = {output: self._array(agent, output, side) for output in outputs}
        for step in steps:
            yield {output: resize_picture(np.asarray(array[place[step]]), size) for output, array in arrays.items()}

    def _array(self, agent: str, output: str, side: int) -> NDArray[Any]:
        kind, colours = PICTURES[output]
        shape = (-1, side, side, colours) if colours > 1 else (-1, side, side)
        return np.memmap(self._folder / f"{agent}.{output}", kind, mode="r").reshape(shape)


@dataclass(frozen=True)
class RecordedPictures:
    """Reads the pictures of a recording: the arrays that `vico run --keep` left, else, for colours, the film."""

    run: Run

    def of(self, agent: str, steps: Sequence[int], *, size: int, outputs: Sequence[str]) -> Iterator[Pictures]:
        """See `PictureSource.of`."""
        folder = self.run.path / VIEWS / agent
        kept = {int(path.stem): path for path in folder.glob("*.npz")}
        if kept.keys() >= set(steps) and set(outputs) <= set(_arrays_in(kept[steps[0]])):
            for step in steps:
                arrays = _read_arrays(kept[step], outputs)
                yield {output: resize_picture(arrays[output], size) for output in outputs}
            return
        if list(outputs) != ["rgb"]:
            missing = next(output for output in outputs if output != "rgb")
            raise InputError(
                f"{self.run.path}: holds no {missing} of {agent}: record it with --keep {','.join(outputs)}, or build "
                "with --outputs rgb"
            )
        yield from self._film(agent, steps, size)

    def _film(self, agent: str, steps: Sequence[int], size: int) -> Iterator[Pictures]:
        view = self.run.views.get(agent)
        if view is None:
            raise InputError(
                f"{self.run.path}: holds no pictures of {agent}: record it with --observe {agent}, or build with "
                "--outputs none"
            )
        wanted = set(steps)
        found = 0
        for _, frame in view.frames(wanted):
            found += 1
            yield {"rgb": resize_picture(frame, size)}
        if found < len(wanted):
            raise InputError(
                f"{self.run.path}: the film of {agent} has {found} of {len(wanted)} steps; it has to observe at every "
                "step that it acts at, or build with --outputs none"
            )


def _arrays_in(path: Path) -> list[str]:
    try:
        with np.load(path, allow_pickle=False) as arrays:
            return list(arrays.files)
    except (OSError, ValueError) as error:
        raise SchemaError(f"{path}: not readable ({error}); run it anew") from None


def _read_arrays(path: Path, outputs: Sequence[str]) -> dict[str, NDArray[Any]]:
    try:
        with np.load(path, allow_pickle=False) as arrays:
            return {output: arrays[output] for output in outputs}
    except (OSError, ValueError, KeyError) as error:
        raise SchemaError(f"{path}: not readable ({error}); run it anew") from None
