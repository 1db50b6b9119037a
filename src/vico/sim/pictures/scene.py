"""Pictures of a simulation: the world's meshes are set once, everything that moves anew in every step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.library import in_hand_models
from vico.assets.transit_vehicles import cabin_of
from vico.render import Cameras, Lighting, Scene, render
from vico.render.cameras import Lens
from vico.render.frames import RenderQuality
from vico.render.lighting import SHADOW_STEP
from vico.render.limbs import LIMBS
from vico.render.scene import NO_OPENINGS
from vico.render.skinning import skin
from vico.render.viewers import PictureSet, Viewers
from vico.render.world_scene import scene_of
from vico.rules import STAIRS_SPEED
from vico.sim.animation import LONGEST_BLEND, ground_under_feet, joint_places, pose
from vico.sim.cameras import SemanticClasses, Views, lenses_by_entity
from vico.sim.environment import Environment
from vico.sim.pictures.buildings import DrawnDoors, RoomLamps, RoomsInSight, ScenePart, WindowLights
from vico.sim.pictures.hands import Holders, draw_in_hands, hands_of_pedestrians
from vico.sim.pictures.people import (
    DrawnPeople,
    MovingBodies,
    PersonMotion,
    RenderedSimulation,
    ViewingCameras,
    concatenate_motion,
    far_from_all,
    pedestrian_motion,
)
from vico.sim.state.simulation_state import SimulationState
from vico.world.mesh import Surface

# The sun moves slowly: the light is set anew this often, seconds.
_LIGHT_EVERY = 60.0
# Feet of who sits reach so far below where they would be on a seat of one's own height, and above, metres.
_FEET_HANG, _FEET_RISE = 0.1, 0.3
_ICE_SHINES = 0.6  # as much as wet ground does
# Of parts of a city.
_BESIDE = 2.0  # m beside one within which all have bodies
_SOON = 40.0  # m beside one within which they get bodies when some come there who have none
_SPARE_BODIES = 100  # bodies too many for which it is worth to choose anew
_OVERCAST = 0.45  # share of the daylight in rooms that a sky full of clouds takes


class SceneRenderer:
    """The `ObservationRenderer` of a running simulation: its world's meshes, and all that moves set anew each time.

    Parameters
    ----------
    sim
        The simulation to render, complete with its movable objects.
    detail
        Of people's bodies: "light", or "full" for pictures to look at, which takes three times as long to skin.
    part
        Of a city, to which the scene is limited; none: the whole world.
    """

    def __init__(
        self, sim: RenderedSimulation, *, detail: Literal["light", "full"] = "light", part: ScenePart | None = None
    ) -> None:
        self._detail, self._part = detail, part
        self._pictures: PictureSet | None = None
        self._doors = DrawnDoors.of(sim.state.base) if part is None else DrawnDoors(sim.state.base, part)
        self._scene = self._empty_scene(sim)
        self._attach(sim)

    def rebind(self, sim: RenderedSimulation) -> SceneRenderer:
        """Return a renderer of another simulation: with this scene if it has all that is to be seen, else a new one."""
        known = set(_shapes(sim, self._doors)) <= set(self._scene.names)
        if sim.world is not self._sim.world or not known:
            return SceneRenderer(sim, detail=self._detail, part=self._part)
        self._attach(sim)
        return self

    def _empty_scene(self, sim: RenderedSimulation) -> Scene:
        """Return the scene of a run, with nothing that moves in its place yet."""
        shapes, part = _shapes(sim, self._doors), self._part
        mirrored = sim.state.traffic is not None and sim.state.traffic.lanes.lefthand
        found = {name: cabin_of(name, mirrored=mirrored) for name in shapes}
        cabins = {name: cabin for name, cabin in found.items() if cabin is not None}
        if part is None:
            scene = scene_of(sim.world, prototypes=shapes, cabins=cabins)
        else:
            scene = scene_of(part.world, prototypes=shapes, cabins=cabins, far=part.far(), palette=part.palette)
        scene.keep_detail(self._doors.prototypes)
        return scene

    def _attach(self, sim: RenderedSimulation) -> None:
        self._sim, part = sim, self._part
        self._room_lamps = RoomLamps(sim.world, sim.state.environment.sky.first_day, part)
        self._window_lights = WindowLights(sim.world, sim.residents, self._room_lamps, part)
        self._lit: tuple[float, ...] = ()
        self.wait()
        self._viewers = Viewers(
            self._scene,
            sim.config.outputs,
            SemanticClasses(sim.world if part is None else part.world, sim.entity).of_image,
            RenderQuality.of(sim.config.quality),
            sim.config.renderer,
        )
        self._lenses = lenses_by_entity(sim.state, sim.config)
        self._usual_lens = Lens.of({}, side=sim.config.image)
        # Flow tells where each vertex has been: bodies keep their shape there.
        far = self._detail == "light" and "flow" not in self._viewers.outputs
        self._people = DrawnPeople(sim, detail=self._detail, far=far, everybody=part is None)
        self._rooms_in_sight = None if part is None else RoomsInSight(sim.state.indoor, part)

    def render(
        self,
        state: SimulationState,
        poses: NDArray[np.float64],
        own: NDArray[np.int32],
        *,
        moving: MovingBodies | None = None,
    ) -> Views:
        """Begin to render one view for each pose in one call; see `ObservationRenderer.render`.

        `moving` is what moves in the state, where scenes share it.
        """
        self.wait()
        self._set_light(state)
        lenses = [self._lenses.get(entity, self._usual_lens) for entity in own.tolist()]
        sights = ViewingCameras(poses[:, :3], np.array([lens.intrinsics[1, 1] for lens in lenses]))
        self._set_moving(moving or self._moving(state), sights)
        taken = self._viewers.take(poses, own, lenses, second=state.second)
        self._pictures = taken
        extrinsics = Cameras(poses[:, :3], poses[:, 3:]).extrinsics
        return Views(taken.pictures, extrinsics, taken.intrinsics, taken.wait_for)

    @property
    def glances(self) -> dict[int, Any]:
        """How things were when viewers looked last, by the entity of each; for `remember`."""
        return self._viewers.glances

    def remember(self, glances: Mapping[int, Any]) -> None:
        """Take over what `glances` of a renderer were with the same scene."""
        self._viewers.glances.update(glances)

    def forget(self, entity: int) -> None:
        """Forget how a viewer saw things last: it has looked from elsewhere since."""
        self._viewers.glances.pop(entity, None)

    def wait(self) -> None:
        """Wait for pictures that are still being worked on."""
        if self._pictures is not None:
            self._pictures.wait()
            self._pictures = None

    def picture_waiter(self) -> Callable[[], None]:
        """Return what to call, from any thread, to wait for the pictures of the last `render`."""
        return self._pictures.wait if self._pictures is not None else lambda: None

    def show(self, state: SimulationState) -> Scene:
        """Put light and everything that moves where they are in a state; return the scene, for cameras of one's own."""
        self.wait()
        self._set_light(state)
        self._set_moving(self._moving(state))
        return self._scene

    def render_cameras(self, state: SimulationState, cameras: Cameras, *, samples: int = 2) -> NDArray[np.uint8]:
        """Render any cameras, RGB only, smoothed by `samples` squared; uint8, shape ``(k, h, w, 3)``."""
        return render(self.show(state), cameras, depth=False, segmentation=False, samples=samples).rgb

    def names(self, entities: Sequence[int]) -> dict[int, dict[str, str]]:
        """Return kind and name of entities."""
        return {entity: self._sim.entity(entity) for entity in entities}

    def _set_light(self, state: SimulationState) -> None:
        moment = state.second // _LIGHT_EVERY
        environment, weather = state.environment, state.environment.weather
        # All that decides the light: a restore or a change of weather may come within the same minute.
        ground = environment.wet, environment.snow_cover, environment.ice
        lit: tuple[float, ...] = (
            moment,
            weather.clouds,
            weather.rain,
            weather.snow,
            weather.visibility,
            environment.lamps,
            *ground,
        )
        lit += tuple(value for circle in environment.agenda.effects.dark for value in circle)
        self._scene.moment = state.second
        daylight = (1.0 - environment.dark) * (1.0 - _OVERCAST * weather.clouds**2)
        self._scene.light_rooms(self._room_lamps.lit_rooms(state), round(16.0 * daylight) / 16.0)
        if lit != self._lit:
            self._lit = lit
            self._scene.lighting = _lighting(state.environment, moment * _LIGHT_EVERY)
        self._window_lights.set(self._scene, state)

    def _moving(self, state: SimulationState) -> MovingBodies:
        return MovingBodies(state, self._sim.world.height)

    def _set_moving(self, now: MovingBodies, sights: ViewingCameras | None = None) -> None:
        """Put everything that moves where it is now; people in less detail who are far from all that look at them."""
        state = now.state
        if not set(state.things.prototypes()) <= set(self._scene.names):
            # An event has begun whose things nobody had reckoned with.
            self._scene, self._lit = self._empty_scene(self._sim), ()
            self._viewers.scene = self._scene
            self._set_light(state)
        self._people.follow(state)
        motion = self._motion(now, None if sights is None else sights.eyes)
        people, bodies = len(motion.clip), self._people.batch
        here = np.ones(people, np.bool_) if self._part is None else self._part.holds(motion.position)
        far = np.zeros(people, np.bool_)
        if sights is not None and len(bodies) > people:
            far = far_from_all(sights, motion.position, self._people.height[self._people.rows])
        rotations, offsets = self._poses(motion, state.second, roughly=far)
        drawn = np.flatnonzero(np.concatenate([here & ~far, here & far])[: len(bodies)])
        limbs = np.empty((len(bodies), len(LIMBS), 7), np.float32)
        vertices, normals = skin(bodies, rotations, offsets, motion.position, motion.yaw, drawn=drawn, limbs=limbs)
        shape = bodies.triangles, bodies.colour, bodies.entity
        self._scene.set_skinned(vertices, normals, *shape, drawn=drawn, limbs=limbs)
        moving = [*now.shapes, *draw_in_hands(state, self._holders(motion, rotations, offsets))]
        if self._part is not None:
            moving = [self._part.shapes_in_tiles(shapes) for shapes in moving]
        doors = self._doors.draw(state) if len(state.leaves) else None
        moving += [] if doors is None else [doors.shapes]
        index = [np.array([self._scene.names[d.prototypes[i]] for i in d.index], np.int32) for d in moving]
        self._scene.set_rigid(
            _concatenate(index, (0,), np.int32),
            _concatenate([d.transforms for d in moving], (0, 4, 4), np.float32),
            _concatenate([d.entity for d in moving], (0,), np.int32),
            shadowless=0 if doors is None else len(doors.shapes.index),
        )
        self._scene.set_openings(NO_OPENINGS if doors is None else doors.openings)

    def _motion(self, now: MovingBodies, eyes: NDArray[np.float64] | None = None) -> PersonMotion:
        """Return how everybody on legs moves who has a body here.

        In parts of a city, give bodies to those who are there; where all that look are known, only to who may be seen.
        """
        if self._rooms_in_sight is not None:
            self._choose_bodies(now.state, self._rooms_in_sight, eyes)
        walkers = None if now.state.traffic is None else self._motion_of_pedestrians(now.state)
        if self._part is None:
            return now.agents if walkers is None else concatenate_motion(now.agents, walkers)
        rows, agents = self._people.rows, len(now.state.people)
        residents = now.agents.of(rows[rows < agents])
        return (
            residents if walkers is None else concatenate_motion(residents, walkers.of(rows[rows >= agents] - agents))
        )

    def _choose_bodies(self, state: SimulationState, rooms: RoomsInSight, eyes: NDArray[np.float64] | None) -> None:
        """Give bodies to all within a part, and to those who may come there soon: choosing anew takes a while."""
        part, people = rooms.part, state.people
        walkers = [] if state.traffic is None else [state.traffic.walkers.position]
        position = np.concatenate([people.position, *walkers])
        shown = np.ones(len(position), np.bool_)
        if eyes is not None:
            indoors = (people.room >= 0) & ~people.at_door() & (people.passing == 0)
            if indoors.any():
                shown[: len(people)][indoors] = rooms.seen_from(eyes)[people.room[indoors]]
        here, had = np.flatnonzero(part.holds(position, _BESIDE) & shown), self._people.rows
        if len(had) > 2 * len(here) + _SPARE_BODIES:
            self._people.choose(np.flatnonzero(part.holds(position, _SOON) & shown))
        elif len(np.setdiff1d(here, had, assume_unique=True)):
            shown[had] = True
            self._people.choose(np.flatnonzero(part.holds(position, _SOON) & shown))

    def _holders(self, motion: PersonMotion, rotations: NDArray[np.float32], offsets: NDArray[np.float32]) -> Holders:
        place = motion.position, motion.yaw, motion.clip, motion.phase, motion.hands
        people, rows = self._people, self._people.rows
        joints = people.batch.joints[: len(rows)]
        return Holders(rows, joints, rotations, offsets, *place, people.height[rows], people.entities[rows])

    @property
    def _style(self) -> NDArray[np.void]:
        """Manner of who has a body."""
        return self._people.style if self._part is None else self._people.style[self._people.rows]

    @property
    def scene(self) -> Scene:
        """What is rendered."""
        return self._scene

    @property
    def nbytes(self) -> int:
        """Bytes of the scene and of the bodies in it; textures, which scenes may share, aside."""
        return self._scene.nbytes + self._people.nbytes

    def holders(self, state: SimulationState) -> Holders:
        """Return everybody as they are posed, with what their hands hold."""
        motion = self._motion(self._moving(state))
        return self._holders(motion, *self._poses(motion, state.second))

    def motions(self, state: SimulationState) -> tuple[PersonMotion, NDArray[np.float64]]:
        """Return how everybody moves, and where their joints are, body frame, metres, shape ``(n, 55, 3)``."""
        motion = self._motion(self._moving(state))
        rotations, offsets = self._poses(motion, state.second)
        return motion, joint_places(self._people.batch.joints[: len(motion.clip)], rotations, offsets)

    def _poses(
        self, motion: PersonMotion, second: float, *, roughly: NDArray[np.bool_] | None = None
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return everybody's joint rotations and pelvis shifts, their feet on the ground as it is under each."""
        after = motion.after
        now, before = (
            self._ground(motion, (m.clip, m.phase, m.speed), rise, roughly) if count else None
            for m, rise, count in (
                (motion, motion.rise, len(motion.clip)),
                (after, motion.rise_before, int((after.since < LONGEST_BLEND).sum())),
            )
        )
        after = after._replace(ground=now if before is None else before)
        moves = motion.clip, motion.phase, motion.speed, self._style
        return pose(*moves, second=second, after=after, ground=now, hands=motion.hands)

    def _ground(
        self,
        motion: PersonMotion,
        course: tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]],
        rise: NDArray[np.float64],
        roughly: NDArray[np.bool_] | None,
    ) -> NDArray[np.float64]:
        """Return the ground under everybody's feet in a motion: clip, phase and speed."""
        place = motion.position, motion.yaw
        ground = ground_under_feet(*course, self._style, place, self._sim.world.height.footing, roughly=roughly)
        ground[~motion.on_ground] = 0.0
        indoor = self._sim.state.indoor
        for k in np.flatnonzero(indoor.treads_under(motion.room) > 0):
            clip, phase, speed = (part[k : k + 1] for part in course)
            here = motion.position[k : k + 1], motion.yaw[k : k + 1]
            treads = indoor.rooms[int(motion.room[k])].treads_at
            ground[k] = ground_under_feet(clip, phase, speed, self._style[k : k + 1], here, treads)[0]
        # From high seats feet hang; a step is there for them on stools.
        ground[~motion.on_ground, :, :, 0] -= np.clip(rise[~motion.on_ground], -_FEET_RISE, _FEET_HANG)[:, None, None]
        return ground

    def _motion_of_pedestrians(self, state: SimulationState) -> PersonMotion:
        """Return how the pedestrians of the traffic move."""
        assert state.traffic is not None
        walkers = state.traffic.walkers
        gait = state.traffic.gait
        clip, phase, pace, after = pedestrian_motion(gait, self._people.height[len(state.people) :], state.second)
        on_ground = gait.afoot
        still, outdoors = np.zeros(len(clip)), np.full(len(clip), -1, np.int32)
        over_ground = pace if gait.treads is None else np.where(gait.treads.depth > 0.0, STAIRS_SPEED, pace)
        after = after._replace(moved=np.zeros((len(clip), 4)), over_ground=over_ground)
        placard = state.traffic.gatherings.placards(walkers.position)
        hands = hands_of_pedestrians(self._people.habit, state.environment.weather.rain, placard, on_ground)
        return PersonMotion(
            clip, phase, pace, after, walkers.position, walkers.yaw, on_ground, outdoors, still, still, hands
        )


def _lighting(environment: Environment, second: float) -> Lighting:
    """Return the light that a moment's sun, moon and weather make."""
    sky, weather = environment.sky, environment.weather
    held = np.floor(second / SHADOW_STEP) * SHADOW_STEP
    light = Lighting.under(
        tuple(sky.sun(second).tolist()),
        held_sun=tuple(sky.sun(held).tolist()),
        moon=tuple(sky.moon(held).tolist()),
        moon_lit=sky.moon_lit(second),
        clouds=weather.clouds,
        falling=weather.rain + 2.0 * weather.snow,
        visibility=weather.visibility,
        lamps=environment.lamps,
    )
    cover = environment.snow_cover
    wet = max(environment.wet, _ICE_SHINES * environment.ice) * (1.0 - cover)
    # The largest circle of ground on which the power is cut; a radius of 0 for none.
    unlit = max(environment.agenda.effects.dark, key=lambda circle: circle[2], default=(0.0, 0.0, 0.0))
    return replace(light, wet=wet, snow_cover=cover, rain=weather.rain, snowfall=weather.snow, unlit=unlit)


def _shapes(sim: RenderedSimulation, doors: DrawnDoors) -> dict[str, Sequence[Surface]]:
    """Return every shape that moves in a run, by name."""
    shapes: dict[str, Sequence[Surface]] = {}
    for system in (sim.state.traffic, sim.state.transit, sim.state.robots):
        if system is not None:
            shapes |= system.prototypes()
    in_hand = {name: model.surfaces for name, model in in_hand_models().items()}
    return shapes | doors.prototypes | in_hand | sim.state.things.prototypes() | dict(sim.shapes)


def _concatenate(parts: list[NDArray[Any]], empty: tuple[int, ...], kind: Any) -> NDArray[Any]:
    return np.concatenate(parts) if parts else np.zeros(empty, kind)
