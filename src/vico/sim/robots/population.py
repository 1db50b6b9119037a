"""The robots of a run: driven by physics, steered by routes, velocities or motor commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.assets.robots import TICK, ActionSpace
from vico.errors import InputError
from vico.sim.bodies.arrays import Bodies, Drawn
from vico.sim.bodies.collisions import DeckPose
from vico.sim.bodies.state_arrays import MovableObjects, People
from vico.sim.physics import PhysicsEngine
from vico.sim.physics.records import FrameCount, FrameNeeds, frame_length
from vico.sim.physics.surroundings import LooseObjects
from vico.sim.robots import arm_tasks, commands, drawing, flying, hardware, trips
from vico.sim.robots.commands import decide
from vico.sim.robots.falls import watch_falls
from vico.sim.robots.hardware import AllRotors, charge_of, command_motors, commanded_velocities, watch_batteries
from vico.sim.robots.manipulator import Hand, OracleGrasp, TaskKind
from vico.sim.robots.path_following import RobotStatus
from vico.sim.robots.path_planning import turning_radius
from vico.sim.robots.scene import RobotScene, spawn_poses
from vico.sim.robots.state import NONE, NOTES, Circles, RobotArrays, RobotEvent, RobotMode, RobotRun
from vico.sim.robots.trips import outdoor_path
from vico.world.mesh import Surface
from vico.world.model import FIRST_BODY
from vico.world.world import World

# What the arrays hold: members of an enumeration are slow to look up at every frame.
_MOTORS, _FALLEN = int(RobotMode.MOTORS), int(RobotStatus.FALLEN)
# Digits of the grip that robots are told: weather that changes writes it into physics seldom.
_GRIP_DIGITS = 2
# Metres above ground below which robots that fly come near things that lie there.
_LOW_FLIGHT = 4.0


class RobotPopulation:
    """All robots of a run.

    Parameters
    ----------
    world
        Where they are.
    kinds
        Names of their models, in order; robot ``i`` is the agent ``robot_i``.
    places
        Where each starts: x, y, yaw, shape ``(n, 3)``; None: reachable places apart from each other, by `seed`.
    seed
        Decides places and errands.
    first_entity
        Entity of robot 0; the others follow.
    errands
        Robots nobody commands go from place to place on their own.
    packs
        Use installed packages' models; False: our own alone.
    scene
        What is fixed, as another population of the same world and kinds has it; made if it is not given, which
        takes seconds.

    Raises
    ------
    InputError
        If a model is not known, or places do not fit.
    """

    def __init__(
        self,
        world: World,
        kinds: Sequence[str],
        places: ArrayLike | None = None,
        *,
        seed: int = 0,
        first_entity: int = FIRST_BODY,
        errands: bool = False,
        packs: bool = True,
        scene: RobotScene | None = None,
    ) -> None:
        self.scene = scene if scene is not None else RobotScene(world, kinds, packs=packs)
        if self.scene.world is not world or self.scene.kinds != tuple(kinds):
            raise InputError("robots: the scene given was made of another world or other robots; make one of these")
        self.world, self.kinds, self.models = world, self.scene.kinds, self.scene.models
        self.names = [f"robot_{i}" for i in range(len(kinds))]
        self.entities = np.arange(first_entity, first_entity + len(kinds)).astype(np.int32)
        self.errands = errands
        where = spawn_poses(world, len(kinds), seed) if places is None else np.asarray(places, np.float64)
        if where.shape != (len(kinds), 3):
            raise InputError(f"robots: {len(kinds)} robots need as many places of x, y, yaw, not {where.shape}")
        engine = self.scene.engine(where)
        self.run = RobotRun(self.scene, engine, self.entities, seed, RobotArrays.idle(self.scene))
        self._outdoors = engine
        self._loose = LooseObjects(engine, MovableObjects.none())

    @property
    def engine(self) -> PhysicsEngine:
        """Physics of all robots, outdoors and in rooms."""
        return self.run.engine

    def __len__(self) -> int:
        return len(self.models)

    @property
    def mode(self) -> NDArray[np.int8]:
        """Who decides what each does, a `RobotMode`, shape ``(n,)``."""
        return self.run.arrays.mode

    @property
    def status(self) -> NDArray[np.int8]:
        """How each fares, a `RobotStatus`, shape ``(n,)``."""
        return self.run.arrays.status

    # How their actions went.

    def begin(self, who: NDArray[np.bool_] | None = None) -> None:
        """Forget how the last actions went of the robots that act now; None: all of them."""
        chosen = slice(None) if who is None else who
        arrays = self.run.arrays
        arrays.action_status[chosen] = 0
        arrays.reason[chosen] = ""
        arrays.reason_code[chosen] = 0

    @property
    def action_status(self) -> NDArray[np.int8]:
        """How each one's last action went, as `vico.rules.ActionStatus`, shape ``(n,)``."""
        return self.run.arrays.action_status

    @property
    def reason(self) -> NDArray[np.str_]:
        """Why, in words; "" if it was done; shape ``(n,)``."""
        return self.run.arrays.reason

    @property
    def reason_code(self) -> NDArray[np.int16]:
        """Why, as `vico.rules.ReasonCode`, shape ``(n,)``."""
        return self.run.arrays.reason_code

    # Commands.

    def action_spaces(self, robot: int) -> Mapping[str, ActionSpace]:
        """Return what a robot can be commanded by, by name; the first is its own."""
        return self.models[robot].action_spaces

    def command(self, robot: int, vector: ArrayLike, space: str = "") -> None:
        """Follow a vector of an action space ("": the robot's own) until another command comes."""
        commands.command(self.run, robot, vector, space)

    def drive(self, robot: int, velocity: ArrayLike) -> None:
        """Follow a velocity (vx, vy, wz): metres a second in the base's frame, radians a second to the left.

        Robots that fly take (vx, vy, vz, wz).

        Raises
        ------
        InputError
            If the robot follows no velocities, or these are not so many finite numbers.
        """
        model = self.models[robot]
        spaces = [name for name, space in model.action_spaces.items() if space.drives == "velocity"]
        if not spaces:
            raise InputError(f"drive: {model.title} follows no velocities; command its motors")
        self.command(robot, velocity, spaces[0])

    def stop(self, robot: int) -> None:
        """Stand still."""
        commands.stop(self.run, robot)

    def has_way(self, robot: int, xy: ArrayLike) -> bool:
        """Return whether there is a way to a point that is wide enough for a robot."""
        if self.flies(robot):
            return not self.scene.airspace.refusal(flying.cruise_point(self.run, np.asarray(xy, np.float64)))
        if self.run.trips.room[robot] >= 0:
            return not self.trip_refusal(robot, -1, xy)
        return outdoor_path(self.run, robot, np.asarray(xy, np.float64)) is not None

    def go_to(self, robot: int, xy: ArrayLike, room: int = -1) -> bool:
        """Find a way to a point of a room (-1: outdoors) and take it; False, and nothing changes, if there is none."""
        return commands.go_to(self.run, robot, np.asarray(xy, np.float64), room)

    def flies(self, robot: int) -> bool:
        """Return whether a robot flies."""
        return self.models[robot].rotors is not None

    def flight_refusal(self, robot: int, target: ArrayLike) -> str:
        """Why a robot that flies can't fly to a point, ENU metres; "" if it can."""
        return self.scene.airspace.refusal(np.asarray(target, np.float64))

    def can_land(self, robot: int, xy: ArrayLike | None = None) -> bool:
        """Return whether a robot that flies can land at a point, or where it is."""
        return self.scene.airspace.is_flat(self.run.position(robot) if xy is None else xy)

    def fly_to(self, robot: int, target: ArrayLike) -> None:
        """Fly to a point, ENU metres, over or round what stands in between, and hover there."""
        flying.fly_to(self.run, robot, np.asarray(target, np.float64))

    def land(self, robot: int, xy: ArrayLike | None = None) -> None:
        """Land at a point, or where it is."""
        flying.land(self.run, robot, None if xy is None else np.asarray(xy, np.float64))

    def is_empty(self, robot: int) -> bool:
        """Return whether a robot's battery is empty: it stands still until that is exchanged."""
        return charge_of(self.run, robot) == 0.0

    def has_arm(self, robot: int) -> bool:
        """Return whether a robot has an arm."""
        return arm_tasks.arm_tasks_of(self.run, robot) is not None

    def in_hand(self, robot: int) -> int:
        """Return the entity of what a robot's hand holds; 0 for nothing."""
        return arm_tasks.object_in_hand(self.run, robot)

    def give_oracle_grasp(self) -> None:
        """Have hands never lose what they closed on, from now on; before the first step."""
        work = [one for one in self.run.work if one is not None]
        hands = {
            int(robot): Hand(one.chain, one.model.sensors.contacts, one.opening)
            for one in work
            for robot in one.robots.tolist()
        }
        self.run.oracle = OracleGrasp(hands, self.entities)

    def held_by_oracle(self, robot: int) -> int:
        """Return the entity of what a hand holds by oracle grasp; 0 for nothing, and in runs without that."""
        return 0 if self.run.oracle is None else int(self.run.oracle.entity[robot])

    def can_grasp(self, robot: int, size: NDArray[np.float64]) -> bool:
        """Return whether a robot's jaw is wide enough for a thing of some extents, metres."""
        return arm_tasks.can_grasp(self.run, robot, size)

    def offer(self, robot: int, person: ArrayLike) -> None:
        """Hold out what the hand holds to a person who stands at a point, ENU metres, until it is taken."""
        arm_tasks.begin_offer(self.run, robot, np.asarray(person, np.float64))

    def reach(self, robot: int, target: ArrayLike) -> None:
        """Bring the hand to a point, ENU metres."""
        arm_tasks.begin_task(self.run, robot, TaskKind.REACH, np.asarray(target, np.float64))

    def pick(self, robot: int, entity: int) -> None:
        """Pick a thing up from above.

        Raises
        ------
        InputError
            If the robot has no arm, or there is no such thing.
        """
        objects = self.run.objects
        found = np.flatnonzero(objects.entity == entity)
        if not len(found):
            raise InputError(f"pick: there is no thing {entity}")
        arm_tasks.begin_task(self.run, robot, TaskKind.PICK, objects.position[found[0]].copy(), entity)

    def place(self, robot: int, target: ArrayLike | int) -> None:
        """Put what the hand holds down at a point, ENU metres, or on the deck of the robot with an entity.

        Raises
        ------
        InputError
            If the robot has no arm, or nobody has such a deck.
        """
        if isinstance(target, int):
            spot = arm_tasks.deck_spot(self.run, robot, target)
            if spot is None:
                raise InputError(f"place: {target} has no deck")
            arm_tasks.begin_task(self.run, robot, TaskKind.PLACE, spot, target)
            return
        arm_tasks.begin_task(self.run, robot, TaskKind.PLACE, np.asarray(target, np.float64))

    def follow(self, robot: int, path: ArrayLike) -> None:
        """Follow a polyline, ENU metres, shape ``(k, 2)``, ``k >= 2``."""
        commands.follow_path(self.run, robot, path)

    def follow_body(self, robot: int, entity: int) -> None:
        """Keep near a body, wherever it goes outdoors."""
        commands.follow_body(self.run, robot, entity)

    # Time.

    def control_period(self, robot: int) -> float:
        """How often a robot's model wants to be controlled, seconds."""
        return self.models[robot].control_period

    def advance(self, dt: float, obstacles: Bodies, *, since: float = 0.0, substep: float | None = None) -> None:
        """Let `dt` seconds (a multiple of 0.01) of physics pass.

        `obstacles` are everybody else's bodies, where they are at the end of the sub-step of `substep` seconds (None:
        `dt`), of which `since` have passed. Robots decide where to go at its beginning. However a sub-step is cut into
        calls, the same frames are made, each when all of its time has passed.
        """
        ticks = round(dt / TICK)
        if ticks < 1 or abs(ticks * TICK - dt) > 1e-9:
            raise InputError(f"robots: {dt} s is no multiple of {TICK} s")
        if not len(self):
            return
        whole = dt if substep is None else substep
        if since == 0.0:
            self.engine.set_dynamic_obstacles(obstacles, whole)
            trips.set_room_obstacles(self.run, whole)
            decide(self.run, whole, obstacles, self.bodies(), errands=self.errands)
            if len(self._loose):
                self._loose.update(self._near_ground())
            arrays = self.run.arrays
            arrays.left_out[:] = np.maximum(arrays.left_out, (self.engine.left_out, self._loose.left_out))
        self._step(ticks, round((whole - since) / TICK))
        self._loose.write_back()
        if self.run.oracle is not None:
            self.run.oracle.hold(self.engine, self.run.objects)
        self.run.known_bodies = None
        if since + dt > whole - 1e-9:
            watch_falls(self.run, whole, obstacles)
            watch_batteries(self.run, whole)

    def _step(self, ticks: int, left: int) -> None:
        """Let physics pass, with each kind of robots told what to do as often as its model asks.

        `left` ticks of the sub-step were left before these.
        """
        arrays, groups = self.run.arrays, self.scene.groups
        now, owed = int(arrays.tick[0]), int(arrays.owed[0]) + ticks
        left += owed - ticks
        needs = self._needs()  # decided between sub-steps, not within
        holding = needs.forces_matter
        # Robots that walk and drive, by velocities or None.
        driven = [
            (group, memory, commanded_velocities(self.run, group))
            for group, memory, flight in zip(groups, self.run.memory, self.run.flights, strict=True)
            if flight is None
        ]
        rotors = AllRotors(self.run)
        lengths: dict[int, float] = {}  # of frames, by the ticks there are for one
        arrays.owed[0] = owed
        while owed:
            room = min([left, *[group.period - now % group.period for group, *_ in driven]])
            if room not in lengths:
                lengths[room] = frame_length(needs, room * TICK)
            frame = lengths[room]
            taken = round(frame / TICK)
            if taken > owed:
                return
            for group, memory, velocity in driven:
                if now % group.period == 0:
                    command_motors(self.run, group, memory, velocity)
            self.engine.step(frame=frame, holding=holding, actuate=rotors.begin_frame(now * TICK, frame))
            now, owed, left = now + taken, owed - taken, left - taken
            arrays.frames[0 if taken == 1 else 1] += 1
            arrays.tick[0], arrays.owed[0] = now, owed

    def _near_ground(self) -> NDArray[np.float64]:
        """Where the robots are that things can be near to: those high up in the air are not."""
        positions = np.array([self.run.position(i) for i in range(len(self))])
        outdoors = self.run.trips.room < 0
        flights = [flight.robots for flight in self.run.flights if flight is not None]
        if not flights:
            return positions[outdoors]
        flying = np.zeros(len(self), np.bool_)
        flying[np.concatenate(flights)] = True
        return positions[outdoors & (~flying | (positions[:, 2] < self.world.height(positions) + _LOW_FLIGHT))]

    def _needs(self) -> FrameNeeds:
        """Return what decides how long a frame is."""
        arrays = self.run.arrays
        return FrameNeeds(
            motor_commands=_MOTORS in arrays.mode.tolist(),
            fallen=_FALLEN in arrays.status.tolist(),
            manipulation=any(work is not None and work.busy for work in self.run.work) or self._holds_things(),
            loose_objects=self._loose.moving,
        )

    def _holds_things(self) -> bool:
        """Return whether a finger touches a thing: in soft friction what a jaw holds would creep out of it."""
        if not self._loose.entity.any():
            return False
        contacts = self.engine.contacts()
        for work in self.run.work:
            if work is None:
                continue
            for robot in work.robots.tolist():
                links = self.engine.link_names(robot)
                if any(contacts.objects_at(robot, links.index(name)) for name in work.model.sensors.contacts):
                    return True
        return False

    def set_grip(self, grip: float) -> None:
        """Have robots grip the ground with a share of what they do on dry ground, 0..1; told before every sub-step."""
        self.engine.set_friction(round(grip, _GRIP_DIGITS))

    def set_closed_ground(self, circles: Circles) -> None:
        """Have robots go round ground that events close, circles of x, y and radius; told like the grip."""
        commands.set_closed_ground(self.run, circles)

    def set_wind(self, east: float, north: float) -> None:
        """Have the mean wind 10 m above ground blow with so many m/s towards east and north; told like the grip."""
        for flight in self.run.flights:
            if flight is not None:
                flight.arrays.wind[:] = east, north

    def attach_objects(self, objects: MovableObjects) -> None:
        """Have physics move things that lie near robots, or fall; before the first step."""
        self._loose = LooseObjects(self._outdoors, objects)
        self.run.objects = objects

    def attach_people(self, people: People) -> None:
        """Have robots know of people indoors; before the first step."""
        self.run.people = people

    def physics_record(self) -> dict[str, Any]:
        """Return what a run reports of its physics: frames, and how many were near robots and found no room in it."""
        people, things = self.run.arrays.left_out.tolist()
        return {
            "engine": self.scene.physics.name,
            "frames": self.frames.record(),
            "left_out_at_most": {"people_and_vehicles": people, "objects": things},
        }

    @property
    def frames(self) -> FrameCount:
        """How many frames of physics there have been, by their length."""
        fine, coarse = self.run.arrays.frames.tolist()
        return FrameCount(fine, coarse)

    def events(self) -> list[RobotEvent]:
        """Return what happened since this was last asked."""
        run = self.run
        found = [RobotEvent(robot, NOTES[kind], run.position(robot)) for robot, kind in run.pending]
        run.pending.clear()
        return found

    # What can be seen and felt.

    def bodies(self) -> Bodies:
        """Oriented rectangles of the robots' outlines."""
        return self.run.bodies()

    # Doors and rooms.

    @property
    def rooms(self) -> NDArray[np.int32]:
        """Return the room each is in, -1 outdoors, int32, shape ``(n,)``."""
        return self.run.trips.room

    def outdoor_bodies(self) -> Bodies:
        """Oriented rectangles of the outlines of those that are outdoors."""
        bodies, outdoors = self.run.bodies(), self.run.trips.room < 0
        return bodies if outdoors.all() else bodies.where(outdoors)

    def room_at(self, point: ArrayLike) -> int:
        """Return the room that a point lies in, ENU metres, -1 for none."""
        return self.scene.rooms.room_at(np.asarray(point, np.float64)) if self.world.rooms else -1

    def trip_refusal(self, robot: int, room: int, point: ArrayLike) -> str:
        """Why a robot can't go to a point of a room (-1: outdoors), in words; "" if it can."""
        return trips.trip_refusal(self.run, robot, room, np.asarray(point, np.float64))

    def at_doors(self) -> list[tuple[int, int]]:
        """Return the robots that wait at doors, and the rooms behind those (-1: outdoors)."""
        doors = self.run.trips.door
        return [(robot, int(doors[robot])) for robot in np.flatnonzero(doors != NONE).tolist()]

    def trip_room(self, robot: int) -> int:
        """Return the room that a robot is going to, -1 outdoors, -2 for no trip."""
        return int(self.run.trips.goal_room[robot])

    def ride(self, robot: int, dt: float) -> float:
        """Have a robot ride on in a lift; return the seconds that it has."""
        self.run.trips.ride[robot] += dt
        return float(self.run.trips.ride[robot])

    def room_needed(self, robot: int) -> float:
        """Return how much room a robot needs around its middle, metres."""
        return turning_radius(self.models[robot])

    def pass_door(self, robot: int, room: int, taken: NDArray[np.float64]) -> bool:
        """Have a robot come through a door into a room (-1: outdoors); False if no spot there is clear of discs."""
        return trips.pass_door(self.run, robot, room, taken)

    def give_up(self, robot: int) -> None:
        """Have a robot end its way before it is there."""
        self.run.note(robot, "blocked")
        commands.stop(self.run, robot)
        self.run.arrays.status[robot] = RobotStatus.BLOCKED

    def prototypes(self) -> dict[str, list[Surface]]:
        """Shapes of all links, by ``robot/<model>/<link>``."""
        return drawing.prototypes_of(self.models)

    def draw(self) -> Drawn:
        """Poses of all links."""
        return drawing.drawn_links(self.run)

    def cameras(self) -> NDArray[np.float64]:
        """Where each robot's camera is, ENU metres, and the unit vector it looks along, shape ``(n, 6)``."""
        return drawing.cameras(self.run)

    def camera_heights(self) -> NDArray[np.float64]:
        """Height of each robot's camera above its body's bottom, metres; of the base's where there is no camera."""
        return np.asarray(self.cameras()[:, 2] - self.bodies().position[:, 2])

    def deck(self, entity: int) -> DeckPose | None:
        """Return the deck of the robot with this entity; None if it has none."""
        return drawing.deck_of(self.run, entity)

    def sees(self, robot: int) -> bool:
        """Return whether a robot has a camera."""
        return self.models[robot].sensors.camera is not None

    def readings(self, robot: int) -> Mapping[str, hardware.Reading]:
        """Return shape and bounds of what a robot feels of itself, by name."""
        return hardware.readings_of(self.models[robot])

    def observation(self, robot: int) -> dict[str, NDArray[Any]]:
        """Return what a robot feels of itself; see `vico.sim.robots.hardware.proprioception`."""
        return hardware.proprioception(self.run, robot)

    def base_poses(self) -> NDArray[np.float64]:
        """Return where the bases are: x, y, z, quaternion w, x, y, z, float64, shape ``(n, 7)``."""
        bases = [self.engine.base(i) for i in range(len(self))]
        return np.array([np.concatenate([base.position, base.quaternion]) for base in bases]).reshape(-1, 7)

    def joint_names(self, robot: int) -> tuple[str, ...]:
        """Return the names of a robot's joints, in the order of `joint_positions`."""
        return self.models[robot].joints

    def joint_positions(self) -> list[NDArray[np.float64]]:
        """Return the angles of each robot's joints, rad; as many as it has."""
        return [np.array(self.engine.joints(i)[0]) for i in range(len(self))]

    # State.

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future."""
        return self.run.state_arrays() | self._loose.arrays()

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        self.run.restore(arrays)
        self._loose.restore(arrays)
