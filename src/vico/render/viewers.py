"""Pictures of many viewers in one call, each through a lens of its own.

A viewer may be given normals, optical flow and past places beside colour, depth and segmentation.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.exact import apply_matrix
from vico.render.cameras import Cameras, CubeMap, Lens, cube_map
from vico.render.frames import PLAIN_QUALITY, Frames, PictureRequest, RenderQuality, take_pictures
from vico.render.motion import PastPlaces, PlacedInstances, past_places, placement_of
from vico.render.scene import Scene
from vico.render.view import ViewCache

if TYPE_CHECKING:
    from vico.render.gl.renderer import GlRenderer


RENDERERS = ("cpu", "gl")
#: What can be asked for, and what is given where nobody asks.
OUTPUTS = ("rgb", "depth", "segmentation", "normals", "flow", "semantic")
USUAL_OUTPUTS = ("rgb", "depth", "segmentation")


def check_outputs(outputs: Sequence[str]) -> tuple[str, ...]:
    """Return outputs in their usual order.

    Raises
    ------
    InputError
        If there is none, or one is unknown.
    """
    unknown = [name for name in outputs if name not in OUTPUTS]
    if unknown or not outputs:
        raise InputError(f"outputs: {unknown[0] if unknown else 'none'!r}; take some of {', '.join(OUTPUTS)}")
    return tuple(name for name in OUTPUTS if name in outputs)


@dataclass(frozen=True)
class _Glance:
    """Where a viewer was when it looked last, and where everything was then."""

    second: float
    placement: PlacedInstances
    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    room: int


@dataclass
class Viewers:
    """Who looks, and what is kept between one look and the next.

    Attributes
    ----------
    scene
        What they look at.
    outputs
        See `OUTPUTS`; of ``semantic``, the classes are given by `classify`.
    classify
        Returns the classes (uint8) of a segmentation image.
    quality
        How carefully colours are made.
    renderer
        ``"cpu"``, or ``"gl"`` for OpenGL (`vico.render.gl`).
    glances
        Where each viewer was when it looked last, and where everything was, by the entity that it leaves out.
    """

    scene: Scene
    outputs: tuple[str, ...] = USUAL_OUTPUTS
    classify: Callable[[NDArray[np.int32]], NDArray[np.uint8]] | None = None
    quality: RenderQuality = PLAIN_QUALITY
    renderer: str = "cpu"
    _gl: GlRenderer | None = None
    _caches: dict[Lens, ViewCache] = field(default_factory=dict)
    glances: dict[int, _Glance] = field(default_factory=dict)

    def take(
        self,
        poses: NDArray[np.float64],
        own: NDArray[np.int32],
        lenses: Sequence[Lens],
        *,
        second: float = 0.0,
    ) -> PictureSet:
        """Begin to take pictures.

        Parameters
        ----------
        poses
            Optical centres (ENU metres) and directions of the optical axes, shape ``(k, 6)``.
        own
            Entity that each viewer leaves out of its picture, and by which its last look is remembered, shape ``(k,)``.
        lenses
            One a viewer.
        second
            When; flow needs a look at an earlier time.
        """
        rotation = Cameras(poses[:, :3], poses[:, 3:]).rotation
        glances = self._looked_back(poses[:, :3], rotation, own, second) if "flow" in self.outputs else None
        asked = _Asked(self.outputs, self.classify, glances, rotation, tuple(lenses))
        groups: dict[Lens, list[int]] = {}
        for k, lens in enumerate(lenses):
            groups.setdefault(lens, []).append(k)
        parts = [self._take_alike(lens, np.array(members), poses, own, asked) for lens, members in groups.items()]
        return PictureSet(parts, asked)

    def _take_alike(
        self,
        lens: Lens,
        members: NDArray[np.int64],
        poses: NDArray[np.float64],
        own: NDArray[np.int32],
        asked: _Asked,
    ) -> _Part:
        """Begin to take the pictures of the viewers that have one and the same lens."""
        position, forward = poses[members, :3], poses[members, 3:]
        up: Any = (0.0, 0.0, 1.0)
        cube, faces, width, height, fov = None, 1, lens.width, lens.height, np.radians(lens.fov)
        if not lens.is_pinhole:
            cube = cube_map(lens)
            faces, width, height, fov = len(cube.faces), cube.side, cube.side, np.pi / 2
            turned = np.einsum("fac,kcw->kfaw", cube.faces, asked.rotation[members])
            forward, up = turned[:, :, 0].reshape(-1, 3), turned[:, :, 1].reshape(-1, 3)
            position = np.repeat(position, faces, axis=0)
        cameras = Cameras(
            position,
            forward,
            up=up,
            fov_y=float(fov),
            width=width,
            height=height,
            hidden_entity=np.repeat(own[members], faces),
        )
        past = [] if asked.glances is None else [asked.glances[k][0] for k in members for _ in range(faces)]
        request = PictureRequest(
            rgb="rgb" in asked.outputs,
            depth="depth" in asked.outputs,
            segmentation="segmentation" in asked.outputs or "semantic" in asked.outputs,
            normals="normals" in asked.outputs,
            past=tuple(past),
            quality=self.quality,
        )
        frames = self._render(lens, cameras, request)
        return _Part(lens, cube, members, frames)

    def _render(self, lens: Lens, cameras: Cameras, request: PictureRequest) -> Frames:
        if self.renderer == "cpu":
            cache = self._caches.setdefault(lens, ViewCache(deferred=True))
            return take_pictures(self.scene, cameras, request, cache=cache)
        from vico.render.gl.renderer import GlRenderer

        if self._gl is None or self._gl.scene is not self.scene:
            self._gl = GlRenderer(self.scene)
        return self._gl.take(cameras, request)

    def _looked_back(
        self, position: NDArray[np.float64], rotation: NDArray[np.float64], own: NDArray[np.int32], second: float
    ) -> list[tuple[PastPlaces, NDArray[np.float64] | None]]:
        """Return what was where when each viewer looked last, and how it was turned; remember how all is now."""
        now = placement_of(self.scene)
        known: dict[int, PastPlaces] = {}
        found: list[tuple[PastPlaces, NDArray[np.float64] | None]] = []
        for k, entity in enumerate(own.tolist()):
            room = self.scene.room_number(position[k])
            last = self.glances.get(entity)
            self.glances[entity] = _Glance(second, now, position[k].copy(), rotation[k], room)
            # Through a door, or back in time, nothing is where it was.
            if last is None or last.room != room or not last.second < second:
                found.append((past_places(now, now, position[k]), None))
                continue
            if id(last.placement) not in known:
                known[id(last.placement)] = past_places(last.placement, now, position[k])
            found.append((known[id(last.placement)]._replace(eye=last.position), last.rotation))
        return found


@dataclass(frozen=True)
class _Asked:
    """What pictures are to show; `glances` and `rotation` are of all viewers."""

    outputs: tuple[str, ...]
    classify: Callable[[NDArray[np.int32]], NDArray[np.uint8]] | None
    glances: list[tuple[PastPlaces, NDArray[np.float64] | None]] | None
    rotation: NDArray[np.float64]
    lenses: tuple[Lens, ...]


@dataclass(frozen=True)
class _Part:
    """Viewers with one lens, and what was rendered for them: a picture each, or the faces of a cube each."""

    lens: Lens
    cube: CubeMap | None
    members: NDArray[np.int64]
    frames: Frames


class PictureSet:
    """Pictures of viewers that may still be worked on.

    Attributes
    ----------
    pictures
        By output, one array a viewer, to be read after `wait_for`.
    intrinsics
        Of each viewer's lens, float64, shape ``(k, 3, 3)``.
    """

    def __init__(self, parts: Sequence[_Part], asked: _Asked) -> None:
        self._asked = asked
        self._place: dict[int, tuple[_Part, int]] = {}
        for part in parts:
            for place, k in enumerate(part.members.tolist()):
                self._place[k] = part, place
        count = len(self._place)
        self.intrinsics = np.array([lens.intrinsics for lens in asked.lenses]).reshape(-1, 3, 3)
        self.pictures: dict[str, list[NDArray[Any]]] = {
            name: [self._room_for(name, k) for k in range(count)] for name in asked.outputs
        }
        self._locks = [threading.Lock() for _ in range(count)]
        # What needs more than rendering.
        self._open = [self._needs_more(k) for k in range(count)]

    def _needs_more(self, k: int) -> bool:
        part, _ = self._place[k]
        return part.cube is not None or any(name in ("normals", "flow", "semantic") for name in self._asked.outputs)

    def _room_for(self, name: str, k: int) -> NDArray[Any]:
        """Return the array of a picture: the rendered one where that is all there is to it."""
        part, place = self._place[k]
        if part.cube is None and name in ("rgb", "depth", "segmentation"):
            rendered: NDArray[Any] = getattr(part.frames, name)[place]
            return rendered
        shape, kind = output_shape(name, part.lens)
        return np.zeros(shape, kind)

    def wait_for(self, k: int) -> None:
        """Return when a viewer's pictures are there."""
        part, place = self._place[k]
        if part.cube is None:
            part.frames.wait_for(place)
        self._complete(k)

    def wait(self) -> None:
        """Return when all pictures are there."""
        for part, _ in self._place.values():
            part.frames.wait()
        for k in self._place:
            self._complete(k)

    def _complete(self, k: int) -> None:
        """Work out what is derived from a viewer's rendered pictures, once, whoever asks."""
        if self._open[k]:
            with self._locks[k]:
                if self._open[k]:
                    self._finish(k)
                    self._open[k] = False

    def _finish(self, k: int) -> None:
        part, place = self._place[k]
        frames, cube = part.frames, part.cube
        count = 1 if cube is None else len(cube.faces)
        faces = slice(place * count, (place + 1) * count)
        if cube is not None:
            for face in range(faces.start, faces.stop):
                frames.wait_for(face)
        out = {name: pictures[k] for name, pictures in self.pictures.items()}

        def through_lens(values: NDArray[Any]) -> NDArray[Any]:
            return values[place] if cube is None else cube.sample_nearest(values[faces])

        if cube is not None and "rgb" in out:
            out["rgb"][:] = cube.sample_bilinear(frames.rgb[faces])
        if cube is not None and "depth" in out:
            out["depth"][:] = through_lens(frames.depth) * cube.stretch
        if cube is not None and "segmentation" in out:
            out["segmentation"][:] = through_lens(frames.segmentation)
        if "semantic" in out and self._asked.classify is not None:
            out["semantic"][:] = self._asked.classify(through_lens(frames.segmentation))
        if "normals" in out:
            out["normals"][:] = apply_matrix(through_lens(frames.normals), self._asked.rotation[k].astype(np.float32))
        if "flow" in out:
            out["flow"][:] = self._flow(k, through_lens(frames.places))

    def _flow(self, k: int, places: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return how many pixels each seen point has moved since the viewer looked last; 0 where that is not known."""
        assert self._asked.glances is not None
        before = self._asked.glances[k][1]
        if before is None:
            return np.zeros((*places.shape[:2], 2), np.float32)
        lens = self._asked.lenses[k]
        was = lens.project(apply_matrix(places, before))
        part, _ = self._place[k]
        if part.cube is not None:
            moved = part.cube.pixel - was
        else:
            moved = np.stack(np.meshgrid(np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5), axis=-1) - was
        if lens.projection == "panorama":
            # The short way round.
            moved[..., 0] = (moved[..., 0] + lens.width / 2) % lens.width - lens.width / 2
        if part.cube is not None:
            moved[part.cube.nearest < 0] = 0.0
        return np.nan_to_num(moved, nan=0.0).astype(np.float32)


def output_shape(output: str, lens: Lens) -> tuple[tuple[int, ...], Any]:
    """Return shape and type of an output's array."""
    plane = lens.height, lens.width
    kinds: Mapping[str, tuple[tuple[int, ...], Any]] = {
        "rgb": ((*plane, 3), np.uint8),
        "depth": (plane, np.float32),
        "segmentation": (plane, np.int32),
        "normals": ((*plane, 3), np.float32),
        "flow": ((*plane, 2), np.float32),
        "semantic": (plane, np.uint8),
    }
    return kinds[output]
