"""The run as the renderer sees it: the world's meshes once, and everything that moves anew in every step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.assets.people import PASSERS_BY, Appearance, body_of, passer_by
from vico.community.model import Resident
from vico.render import Cameras, Frames, Lighting, Stills, render
from vico.render.skinning import Crowd, crowd_of, skin
from vico.render.world_scene import scene_of
from vico.sim.animation import clip_index, hand_frames, pose, stride_length, style_of
from vico.sim.bodies import Drawn
from vico.sim.config import DAY, SimConfig
from vico.sim.observations import Views
from vico.sim.stage import Stage
from vico.sim.state import Vehicle
from vico.world.folder import World
from vico.world.mesh import Surface
from vico.world.seeds import rng
from vico.world.threads import in_order

# The sun moves slowly: the light is set anew this often, seconds.
_LIGHT_EVERY = 60.0
# Who can't be seen (riders behind a bus's windows) waits far below the ground.
_AWAY = np.array([0.0, 0.0, -1000.0])


class Seen(Protocol):
    """What the renderer asks of a simulation."""

    @property
    def world(self) -> World:
        """Where it happens."""

    @property
    def config(self) -> SimConfig:
        """What the run is asked to be."""

    @property
    def colours_later(self) -> bool:
        """Whether `look` may return before RGB is there."""

    @property
    def stage(self) -> Stage:
        """Everybody and everything, as it is now."""

    @property
    def residents(self) -> Sequence[Resident]:
        """Who lives there, in the order of their avatars."""

    @property
    def shapes(self) -> Mapping[str, Sequence[Surface]]:
        """Shapes of loose things, by name."""

    def entity(self, entity: int) -> dict[str, str]:
        """Kind and name of an entity."""


class SceneEyes:
    """Renders what agents see.

    Parameters
    ----------
    sim
        The simulation to look at, complete with its loose things.
    """

    def __init__(self, sim: Seen) -> None:
        self._image = sim.config.image
        self._frames: Frames | None = None
        self._scene = scene_of(sim.world, prototypes=_shapes(sim))
        self._attach(sim)

    def moved_to(self, sim: Seen) -> SceneEyes:
        """Eyes for another simulation: with this scene, where it has all that is to be seen, else with a new one."""
        known = set(_shapes(sim)) <= set(self._scene.names)
        if sim.world is not self._sim.world or not known or sim.config.image != self._image:
            return SceneEyes(sim)
        self._attach(sim)
        return self

    def _attach(self, sim: Seen) -> None:
        self._sim = sim
        self._lit = -1.0
        self.finish()
        self._stills = Stills()
        self._people(sim)

    def _people(self, sim: Seen) -> None:
        stage = sim.stage
        looks = [Appearance.from_dict(r.appearance) for r in sim.residents]
        strangers = stage.people.names[len(looks) :]
        entities = stage.people.entity.tolist()
        walkers = stage.traffic.walkers.entity.tolist() if stage.traffic is not None else []
        # Which of the shared looks come, and in which order, is the run's; no two alike before all have come.
        order = rng(sim.config.seed, "looks").permutation(PASSERS_BY)
        looks += [passer_by(int(order[k % PASSERS_BY])) for k in range(len(strangers) + len(walkers))]
        made = dict(zip(dict.fromkeys(looks), in_order(body_of, dict.fromkeys(looks)), strict=True))
        bodies = [made[look] for look in looks]
        self._crowd: Crowd = crowd_of(bodies, [*entities, *walkers])
        names = [*stage.people.names, *(f"pedestrian_{k}" for k in range(len(walkers)))]
        style = [
            style_of(body, rng(sim.config.seed, "manner", name), age=look.age)
            for body, name, look in zip(bodies, names, looks, strict=True)
        ]
        self._style = np.stack(style) if style else np.zeros((0, 1), np.float32)
        self._height = np.array([body.height for body in bodies], np.float64)

    def look(self, stage: Stage, poses: NDArray[np.float64], own: NDArray[np.int32]) -> Views:
        """Render one view a pose, in one call; each without the body that is its own."""
        self.finish()
        self._light(stage)
        self._set_people_and_things(stage)
        cameras = Cameras(poses[:, :3], poses[:, 3:], width=self._image, height=self._image)
        later = self._sim.colours_later
        frames = render(self._scene, cameras, without=own, before=self._stills, colours_later=later)
        self._frames = frames if later else None
        return Views(frames.rgb, frames.depth, frames.segmentation, cameras.extrinsics, cameras.intrinsics)

    def finish(self) -> None:
        """Wait for colours that are still being worked on."""
        if self._frames is not None:
            self._frames.finish()
            self._frames = None

    def under_way(self) -> Callable[[], None]:
        """What to call, from any thread, to wait for the colours of the last look."""
        return self._frames.finish if self._frames is not None else _nothing

    def photograph(self, stage: Stage, cameras: Cameras, *, samples: int = 2) -> NDArray[np.uint8]:
        """Take stills with any cameras, smoothed by `samples` squared; uint8, shape ``(k, h, w, 3)``."""
        self.finish()
        self._light(stage)
        self._set_people_and_things(stage)
        return render(self._scene, cameras, depth=False, segmentation=False, samples=samples).rgb

    def names(self, entities: Sequence[int]) -> dict[int, dict[str, str]]:
        """Kind and name of entities."""
        return {entity: self._sim.entity(entity) for entity in entities}

    def _light(self, stage: Stage) -> None:
        moment = stage.second // _LIGHT_EVERY
        if moment != self._lit:
            self._lit = moment
            origin = self._sim.world.manifest.origin
            self._scene.lighting = Lighting.at(moment * _LIGHT_EVERY % DAY, origin.lat)

    def _set_people_and_things(self, stage: Stage) -> None:
        p = stage.people
        speed = np.hypot(p.velocity[:, 0], p.velocity[:, 1])
        clip, phase, yaw = p.clip.astype(np.int64), p.phase.copy(), p.yaw.copy()
        position = p.position.copy()
        position[p.vehicle == Vehicle.BUS] += _AWAY
        if stage.traffic is not None:
            walkers = stage.traffic.walkers
            pace, walked = stage.traffic.gait
            height = self._height[len(p) :]
            moving = pace > 0.05
            clips = np.where(moving, clip_index("walk"), clip_index("idle"))
            stride = np.where(moving, stride_length(clips, pace, height), 2.0)
            # People at rest breathe by the clock, each at their own time.
            at_rest = stage.second * 0.5 + np.arange(len(pace)) * 0.37
            clip = np.concatenate([clip, clips])
            phase = np.concatenate([phase, np.where(moving, walked / stride, at_rest) % 1.0])
            speed = np.concatenate([speed, pace])
            position = np.vstack([position, walkers.position])
            yaw = np.concatenate([yaw, walkers.yaw])
        rotations, offsets = pose(clip, phase, speed, self._style)
        crowd = self._crowd
        vertices, normals = skin(crowd, rotations, offsets, position, yaw)
        self._scene.set_skinned(vertices, normals, crowd.triangles, crowd.colour, crowd.entity)
        drawn = [s.draw() for s in (stage.traffic, stage.transit, stage.robots) if s is not None]
        if len(stage.goods):
            drawn.append(self._goods(stage, rotations, offsets))
        index = [np.array([self._scene.names[d.prototypes[i]] for i in d.index], np.int32) for d in drawn]
        self._scene.set_rigid(
            _joined(index, (0,), np.int32),
            _joined([d.transforms for d in drawn], (0, 4, 4), np.float32),
            _joined([d.entity for d in drawn], (0,), np.int32),
        )

    def _goods(self, stage: Stage, rotations: NDArray[np.float32], offsets: NDArray[np.float32]) -> Drawn:
        """Loose things: where they lie, or hanging from the hand that holds them."""
        goods, p = stage.goods, stage.people
        names = sorted(set(goods.prototypes))
        transforms = np.zeros((len(goods), 4, 4))
        c, s = np.cos(goods.yaw), np.sin(goods.yaw)
        transforms[:, 0, 0], transforms[:, 0, 1] = c, -s
        transforms[:, 1, 0], transforms[:, 1, 1] = s, c
        transforms[:, 2, 2] = transforms[:, 3, 3] = 1.0
        transforms[:, :3, 3] = goods.position
        held = np.flatnonzero(goods.hand >= 0)
        if len(held):
            palms = hand_frames(self._crowd.joints[: len(p)], rotations[: len(p)], offsets[: len(p)])
            for k in held:
                i = int(np.flatnonzero(p.entity == goods.holder[k])[0])
                x, y, z = palms[i, goods.hand[k], :3, 3]
                cy, sy = np.cos(p.yaw[i]), np.sin(p.yaw[i])
                hanging = z - goods.size[k, 2]
                transforms[k, :3, 3] = p.position[i] + np.array([cy * x - sy * y, sy * x + cy * y, hanging])
        index = np.array([names.index(name) for name in goods.prototypes], np.int32)
        return Drawn(names, index, transforms.astype(np.float32), goods.entity)


def _nothing() -> None:
    pass


def _shapes(sim: Seen) -> dict[str, Sequence[Surface]]:
    """Every shape that moves in a run, by name."""
    shapes: dict[str, Sequence[Surface]] = {}
    for system in (sim.stage.traffic, sim.stage.transit, sim.stage.robots):
        if system is not None:
            shapes |= system.prototypes()
    return shapes | dict(sim.shapes)


def _joined(parts: list[NDArray[Any]], empty: tuple[int, ...], kind: Any) -> NDArray[Any]:
    return np.concatenate(parts) if parts else np.zeros(empty, kind)
