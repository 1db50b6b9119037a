"""Pictures of an episode: kept while it is played, or read from a recording; as small as the dataset wants them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.errors import InputError, SchemaError
from vico.io.files import read_json, write_json
from vico.runner.loop import Hook, Step
from vico.sim.recording import Run
from vico.sim.recording.schema import VIEWS

#: Outputs a dataset may hold, with the type of their values and their colours a pixel.
PICTURES: dict[str, tuple[type[np.generic], int]] = {
    "rgb": (np.uint8, 3),
    "depth": (np.float32, 1),
    "segmentation": (np.int32, 1),
}
_INDEX = "pictures.json"

Pictures = Mapping[str, NDArray[Any]]


class PictureSource(Protocol):
    """Where an agent's pictures come from."""

    def of(self, agent: str, steps: Sequence[int], *, size: int, outputs: Sequence[str]) -> Iterator[Pictures]:
        """Yield an agent's pictures at steps, in their order: by output, ``(size, size)``, rgb ``(size, size, 3)``.

        Raises
        ------
        InputError
            If there are none of one of the outputs or steps; the message says how to have some.
        """


def reduced(picture: NDArray[Any], size: int) -> NDArray[Any]:
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
                self._file(name, output).write(np.ascontiguousarray(reduced(seen[output], self._size), kind).tobytes())

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
            yield {output: reduced(np.asarray(array[place[step]]), size) for output, array in arrays.items()}

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
                yield {output: reduced(arrays[output], size) for output in outputs}
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
            yield {"rgb": reduced(frame, size)}
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
