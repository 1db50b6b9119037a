"""An agent's view at a step, as pictures for the page: colour, depth, and segmentation with its names."""

from __future__ import annotations

import io
import threading
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.errors import InputError, MissingFileError, VicoError
from vico.sim.loop.simulation import Simulation
from vico.sim.recording import Run
from vico.viewer.run_film import RepeatedRun

#: Pictures there are; ``names`` tells what the colours of the segmentation are.
OUTPUTS = ("rgb", "depth", "segmentation", "names")

# At so many metres depth has faded to a third.
_FADES = 20.0
_FARTHEST = 50.0
# Steps that are simulated again at most for one picture.
_MOST_REPEATED = 600


class NoPictureError(InputError):
    """A step has no picture, or not yet, of what an agent sees; nothing is wrong with the question."""


class AgentView(NamedTuple):
    """What an agent sees.

    Attributes
    ----------
    pictures
        By output, each of shape ``(h, w, ...)``.
    names
        Kind and name of what the segmentation shows, by entity.
    """

    pictures: Mapping[str, NDArray[Any]]
    names: Mapping[int, Mapping[str, str]]


def render_agent_view(sim: Simulation, agent: str) -> AgentView:
    """Render what an agent sees now.

    Raises
    ------
    InputError
        If nobody is called so.
    NoPictureError
        If it has no camera.
    """
    if agent not in sim.agents:
        raise InputError(f"nobody is called {agent!r}")
    index, robots = sim.agents.index(agent), sim.state.robots
    if robots is not None and index >= len(sim.state.people) and not robots.sees(index - len(sim.state.people)):
        raise NoPictureError(f"{agent} has no camera")
    seeing, sim.seeing = sim.seeing, [index]
    try:
        observations, infos = sim.observe([agent])
        observation, info = observations[agent], infos[agent]
        sim.picture_waiter()()
        pictures: dict[str, NDArray[Any]] = {
            name: np.array(observation[name]) for name in ("rgb", "depth", "segmentation") if name in observation
        }
        return AgentView(pictures, dict(info["entities"]))
    finally:
        sim.seeing = seeing


def picture_of(seen: AgentView, output: str) -> tuple[bytes | dict[str, Any], str]:
    """Return a picture's bytes, or the names as a record, and the type of the content.

    Raises
    ------
    InputError
        If there is no such picture.
    """
    source = "segmentation" if output == "names" else output
    if output not in OUTPUTS or source not in seen.pictures:
        known = ", ".join(seen.pictures)
        raise InputError(f"there is no {output!r} of what it sees; the run has {known or 'no pictures'}")
    image = seen.pictures[source]
    if output == "rgb":
        return _bytes(image, "JPEG", quality=88), "image/jpeg"
    if output == "depth":
        near = np.where(image > 0, np.maximum(255.0 * np.exp(-image / _FADES), 1.0), 0.0)
        near[image > _FARTHEST] = 1.0
        return _bytes(near.astype(np.uint8), "PNG"), "image/png"
    if output == "segmentation":
        return _bytes(_colour(image.astype(np.int64)), "PNG"), "image/png"
    return {"names": _entity_names(image, seen.names)}, "application/json"


class RecordedViews:
    """What agents of a recording saw: from its films, or simulated again from the checkpoint before the step.

    Parameters
    ----------
    run
        The recording.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._lock = threading.Lock()
        self._repeated: RepeatedRun | None = None
        self._seen: tuple[str, int, AgentView] | None = None

    def view(self, agent: str, step: int, output: str) -> tuple[bytes | dict[str, Any], str]:
        """Return a picture; see `picture_of`.

        Raises
        ------
        InputError
            If nobody is called so, or there is no such picture.
        NoPictureError
            If there is none of the step, and none can be made.
        SchemaError
            If this version of vico makes another run of what was recorded.
        """
        if agent not in {one["name"] for one in self._run.agents}:
            raise InputError(f"nobody is called {agent!r}")
        if output not in OUTPUTS:
            raise InputError(f"there is no {output!r} of what it sees; there are {', '.join(OUTPUTS)}")
        with self._lock:
            if output == "rgb" and (film := self._run.views.get(agent)) is not None:
                for _, picture in film.frames({step}):
                    return picture_of(AgentView({"rgb": picture}, {}), "rgb")
            return picture_of(self._again(agent, step), output)

    def _again(self, agent: str, step: int) -> AgentView:
        if self._seen is not None and self._seen[:2] == (agent, step):
            return self._seen[2]
        if self._repeated is None:
            try:
                self._repeated = RepeatedRun.of_folders(self._run)
            except (MissingFileError, VicoError) as error:
                raise NoPictureError(
                    f"no film of what {agent} saw, and it cannot be simulated again: {error}"
                ) from None
        before = max([k for k in self._run.checkpoints if k <= step], default=0)
        if step - before > _MOST_REPEATED:
            raise NoPictureError(
                f"no film of what {agent} saw, and the checkpoint before it is {step - before} steps away"
            )
        if step < self._repeated.step and before == 0:
            self._repeated = RepeatedRun.of_folders(self._run)
        self._repeated.go_to(step)
        seen = render_agent_view(self._repeated.sim, agent)
        self._seen = agent, step, seen
        return seen


def _bytes(image: NDArray[np.uint8], form: str, **options: Any) -> bytes:
    sink = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(image)).save(sink, form, **options)
    return sink.getvalue()


def _colour(entity: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Return a colour for each entity, far from those of its neighbours by number; shape ``(..., 3)``."""
    mixed = (entity.astype(np.uint64) * np.uint64(2654435761)) & np.uint64(0xFFFFFFFF)
    parts = np.stack([(mixed >> np.uint64(shift)) & np.uint64(0xFF) for shift in (24, 16, 8)], axis=-1)
    return np.where(entity[..., None] > 0, 40 + parts * 200 // 255, 0).astype(np.uint8)


def _entity_names(image: NDArray[np.int32], names: Mapping[int, Mapping[str, str]]) -> list[dict[str, Any]]:
    entities, pixels = np.unique(image[image > 0], return_counts=True)
    colours = _colour(entities.astype(np.int64)).reshape(-1, 3)
    told = [
        {"entity": entity, "kind": "", "name": str(entity), "colour": colour, "pixels": count, **names.get(entity, {})}
        for entity, colour, count in zip(entities.tolist(), colours.tolist(), pixels.tolist(), strict=True)
    ]
    return sorted(told, key=lambda one: -one["pixels"])
