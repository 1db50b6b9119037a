"""Two legs: a clock, plain steps, a trained network that corrects them, and standing on ground that is not level.

Half of a stride is like the other half with left and right exchanged. So the network knows one half alone, in which the
first leg swings; in the other half it sees the mirror image of the robot, and its answer is mirrored back.

The network sees nothing of the ground. Standing as on level ground, a robot on the ramp of a kerb leans, and walks down
it to catch itself. So while it stands, ankles are turned as the ground slopes below each sole, and the leg on higher
ground is bent; the network sees the joints without that, as on level ground.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel, TwoLegs
from vico.exact import apply_matrix
from vico.io.compiled import compiled
from vico.sim.physics.records import Base, Motion
from vico.sim.robots.controller import Array, Gains, MotorController, approach, planar_motion
from vico.sim.robots.quadruped import dense_layer

LEG = 5  # joints of a leg
LEGS = 10  # joints of both
# Where the parts of what the network sees begin.
_SEEN_VELOCITY = 0  # of the base in its own frame
_SEEN_SPIN = 3
_SEEN_GRAVITY = 6
_SEEN_COMMAND = 9
_SEEN_CLOCK = 12  # sine and cosine of where in its stride it is
_SEEN_ANGLES = 14  # of the joints, less those at rest
_SEEN_SPEEDS = 24
_SEEN_ACTION = 34  # the last one
OBSERVED = 44
# Entries of a robot's memory.
PHASE = 0  # where in its stride it is, 0..1
STEPPING = 1  # whether it steps
CALM = 2  # s it has been calm
COMMAND = 3  # the velocity it follows: vx, vy, wz
ACTION = 6  # the last one
GROUND = 16  # how far ankles and knees are fitted to the ground, left and right, rad
IDLE = 20  # s since it stopped without a command
PLACE = 21  # held since then: x, y, yaw, ENU
MEMORY = 24
#: Metres a second and radians of tilt beyond which a standing robot steps to catch itself, and a stepping one goes on:
#: steps sway.
_PUSHED, _TILTED = (0.22, 0.60), (0.09, 0.20)
#: Seconds of calm after which it stands.
_PATIENCE = 0.7
#: How far knees bend in a swing, rad, and how far a hip swings for each m/s, rad.
_LIFT, _SWING = 0.60, 0.20
#: Radians for one unit of the network's answer, and the least and largest of that.
SCALE, ACTION_LIMIT = 0.25, 5.0


class StepSettings(NamedTuple):
    """What a robot's steps are made of.

    Attributes
    ----------
    period
        Seconds between two calls.
    stride
        Seconds of two steps.
    rest
        Angles of a leg at rest, rad, shape ``(5,)``.
    low, high
        Bounds of all joints, rad, shape ``(10,)``.
    """

    period: float
    stride: float
    rest: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


@compiled
def is_mirrored(memory):
    """Whether the right leg's swing is next, or under way."""
    return memory[PHASE] >= 0.5 - 1e-9


@compiled
def advance_clock(settings, planar, tilt, memory):
    """Let the stride of a robot go on, begin or end.

    Parameters
    ----------
    planar
        vx, vy, wz in the base's frame.
    tilt
        Of its base, rad.
    """
    # Without a command it steps no longer for being steered back to its place.
    follows = memory[COMMAND] != 0.0 or memory[COMMAND + 1] != 0.0 or memory[COMMAND + 2] != 0.0
    asked = follows and memory[IDLE] == 0.0
    steps = 1 if memory[STEPPING] > 0.0 else 0
    if asked or math.hypot(planar[0], planar[1]) > _PUSHED[steps] or tilt > _TILTED[steps]:
        memory[CALM] = 0.0
        memory[STEPPING] = 1.0
    else:
        memory[CALM] += settings.period
    if memory[STEPPING] > 0.0:
        before = memory[PHASE]
        after = before + settings.period / settings.stride
        half = math.floor(2.0 * after + 1e-9)
        if memory[CALM] > _PATIENCE and half != math.floor(2.0 * before + 1e-9):
            after = 0.5 * half  # both feet are on the ground
            memory[STEPPING] = 0.0
        swapped = is_mirrored(memory)
        memory[PHASE] = after - math.floor(after + 1e-9)
        if swapped != is_mirrored(memory):  # the other leg begins to swing: left and right of the last action change
            for k in range(LEG):
                sign = -1.0 if k < 2 else 1.0
                a, b = memory[ACTION + k], memory[ACTION + LEG + k]
                memory[ACTION + k], memory[ACTION + LEG + k] = sign * b, sign * a


@compiled
def _put_legs(out, first, values, rest, swap, scale):
    """Write the numbers of both legs, less those at rest, the leg that swings first."""
    for k in range(LEGS):
        j = (k + LEG) % LEGS if swap else k
        sign = -1.0 if swap and k % LEG < 2 else 1.0
        out[first + k] = sign * (values[j] - rest[k % LEG]) * scale


@compiled
def observe(settings, moving, joints, memory, out):
    """Write what the network sees of a robot.

    Parameters
    ----------
    moving
        Rotation, velocity and angular velocity (in its own frame) of the base.
    joints
        Angles and speeds.
    """
    rotation, velocity, spin = moving
    command = memory[COMMAND : COMMAND + 3]
    swap = is_mirrored(memory)
    s = -1.0 if swap else 1.0
    for k in range(3):
        v = rotation[0, k] * velocity[0] + rotation[1, k] * velocity[1] + rotation[2, k] * velocity[2]
        sideways = s if k == 1 else 1.0
        out[_SEEN_VELOCITY + k] = sideways * v
        out[_SEEN_SPIN + k] = (1.0 if k == 1 else s) * 0.5 * spin[k]
        out[_SEEN_GRAVITY + k] = sideways * -rotation[2, k]
        out[_SEEN_COMMAND + k] = command[k] if k == 0 else s * command[k]
    angle = 2.0 * math.pi * (memory[PHASE] - (0.5 if swap else 0.0))
    out[_SEEN_CLOCK] = math.sin(angle) * memory[STEPPING]
    out[_SEEN_CLOCK + 1] = math.cos(angle) * memory[STEPPING]
    _put_legs(out, _SEEN_ANGLES, joints[0], settings.rest, swap, 1.0)
    _put_legs(out, _SEEN_SPEEDS, joints[1], np.zeros(LEG), swap, 0.05)
    out[_SEEN_ACTION:OBSERVED] = memory[ACTION : ACTION + LEGS]


@compiled
def leg_targets(settings, action, memory, out):
    """Write the joints' targets, of plain steps and the network's answer to them; that becomes the last action."""
    swap = is_mirrored(memory)
    s = 2.0 * (memory[PHASE] - (0.5 if swap else 0.0))
    lift = memory[STEPPING] * max(0.0, math.sin(math.pi * s)) ** 2
    swing = memory[STEPPING] * _SWING * memory[COMMAND] * math.cos(math.pi * s)
    for k in range(LEGS):
        part, first = k % LEG, k < LEG
        bend = (-0.5 if part == 2 else (1.0 if part == 3 else -0.5)) * _LIFT * lift if first and part >= 2 else 0.0
        ahead = (swing if part == 2 else -swing) * (1.0 if first else -1.0) if part == 2 or part == 4 else 0.0
        a = min(max(action[k], -ACTION_LIMIT), ACTION_LIMIT)
        angle = settings.rest[part] + bend + ahead + SCALE * a
        j = (k + LEG) % LEGS if swap else k
        if swap and part < 2:
            angle = -angle
        out[j] = min(max(angle, settings.low[j]), settings.high[j])
        memory[ACTION + k] = a


# Where the joints that fit a leg to the ground are among its own.
_HIP = 2
KNEE = 3
_ANKLE = 4
#: From which axis to which each joint of a leg turns: yaw, roll, and three times pitch.
_TURNS = ((0, 1), (1, 2), (2, 0), (2, 0), (2, 0))
#: Radians and metres of a slope and between two soles beyond which it stands as if there were no more.
_STEEPEST, _HIGHEST = 0.35, 0.12
#: Radians a second by which joints are fitted to the ground when it stands, and go back when it steps.
_FIT, _UNFIT = 3.0, 1.0
#: Seconds of calm after which the stance stays as it is: fitted on and on it creeps, and turns.
_FELT = 2.0
#: Seconds without a command after which the place where a robot is becomes the one it holds: by then it has stopped.
_SETTLED = 0.8
#: How it is steered back there, ahead, aside and turning: m/s and rad/s for each metre and radian beyond some slack,
#: and the most of it (the network was trained for more).
_RETURN, _SLACK, _FASTEST = (2.0, 2.0, 1.5), (0.05, 0.05, 0.1), (0.2, 0.2, 0.3)
#: Seconds of calm after which it is steered back: who still catches itself from a push would fall by it.
_CAUGHT = 0.2
#: Metres the place is away at most: it comes along with a robot that is pushed further, which then does not go back all
#: the way into whom it can't see.
_LEASH = 0.4


class StanceSettings(NamedTuple):
    """What a robot's stance is made of.

    Attributes
    ----------
    period
        Seconds between two calls.
    places
        Where the joints of the left leg are, each in the frame of the one before, and the middle of its sole in that of
        the ankle; metres, shape ``(6, 3)``.
    knee
        Its angle at rest, rad.
    """

    period: float
    places: NDArray[np.float64]
    knee: float


@compiled
def sole_slope(places, rotation, angles, side):
    """Return how far a sole slopes down ahead, rad, and its height above the origin of the base, metres.

    Parameters
    ----------
    rotation
        Base to world.
    angles
        Of the leg's joints.
    side
        1 for the left leg, -1 for the right.
    """
    up = rotation[2].copy()  # of the axes of one link after the other
    height = 0.0
    for link in range(LEG + 1):
        height += up[0] * places[link, 0] + side * up[1] * places[link, 1] + up[2] * places[link, 2]
        if link < LEG:
            a, b = _TURNS[link]
            c, s = math.cos(angles[link]), math.sin(angles[link])
            up[a], up[b] = c * up[a] + s * up[b], c * up[b] - s * up[a]
    return -math.asin(min(max(up[0], -1.0), 1.0)), height


@compiled
def fit_stance(stance, rotation, angles, memory):
    """Fit the stance of a robot that stands to the ground below its soles; let that go of one that steps."""
    stands = memory[STEPPING] == 0.0
    if stands and memory[CALM] > _FELT:
        return
    slopes, heights = np.zeros(2), np.zeros(2)
    for leg in range(2):
        slopes[leg], heights[leg] = sole_slope(
            stance.places, rotation, angles[LEG * leg : LEG * (leg + 1)], 1.0 - 2.0 * leg
        )
    length = -(stance.places[KNEE, 2] + stance.places[_ANKLE, 2])
    rate = (_FIT if stands else _UNFIT) * stance.period
    for leg in range(2):
        ankle = knee = 0.0
        if stands:
            ankle = min(max(slopes[leg], -_STEEPEST), _STEEPEST)
            shorter = min(max(heights[leg] - heights[1 - leg], 0.0), _HIGHEST)
            knee = 2.0 * math.acos(math.cos(0.5 * stance.knee) - shorter / length) - stance.knee
        for k, wanted in ((GROUND + leg, ankle), (GROUND + 2 + leg, knee)):
            memory[k] += min(max(wanted - memory[k], -rate), rate)


@compiled
def fit_to_ground(memory, angles, sign):
    """Add what the ground asks for to angles of the joints (`sign` 1), or take it from them (-1)."""
    for leg in range(2):
        ankle, knee = sign * memory[GROUND + leg], sign * memory[GROUND + 2 + leg]
        first = LEG * leg
        angles[first + _HIP] -= 0.5 * knee
        angles[first + KNEE] += knee
        angles[first + _ANKLE] += ankle - 0.5 * knee


@compiled
def target_velocity(period, command, position, rotation, memory, out):
    """Write the velocity to go over to: the command; without one, that by which a robot gets back to where it stopped.

    Only one that steps is steered back: one that stands does not begin to step for it, and one that is calm stands
    still wherever it is.

    Parameters
    ----------
    command
        vx, vy, wz in the base's frame.
    position, rotation
        Of the base, ENU.
    out
        In the base's frame, shape ``(3,)``; written.
    """
    out[:] = command
    if command.any():
        memory[IDLE] = 0.0
        return
    if memory[IDLE] == 0.0 and memory[COMMAND : COMMAND + 3].any():  # it brakes
        return
    place = memory[PLACE : PLACE + 3]
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    if memory[IDLE] < _SETTLED:
        memory[IDLE] += period
        place[0], place[1], place[2] = position[0], position[1], yaw
    dx, dy = place[0] - position[0], place[1] - position[1]
    share = _LEASH / max(math.hypot(dx, dy), _LEASH)
    dx, dy = share * dx, share * dy
    place[0], place[1] = position[0] + dx, position[1] + dy
    if memory[STEPPING] == 0.0 or memory[CALM] < _CAUGHT:
        return
    c, s = math.cos(yaw), math.sin(yaw)
    turn = (place[2] - yaw + math.pi) % (2.0 * math.pi) - math.pi
    missing = (c * dx + s * dy, c * dy - s * dx, turn)
    for k in range(3):
        beyond = max(abs(missing[k]) - _SLACK[k], 0.0)
        out[k] = math.copysign(min(_RETURN[k] * beyond, _FASTEST[k]), missing[k])


#: What a command may change by in a second: m/s ahead and aside, rad/s.
_SLEW = (1.5, 1.0, 3.0)
#: Seconds a fallen one lies before it is lifted, and m/s that it is.
_LIFTED_AFTER, _LIFT_SPEED = 3.0, 0.35
# How hard a fallen one is pulled to where it should be, and upright.
_PULL = 1500.0  # N/m
_HOLD = 400.0  # Ns/m
_UPRIGHT = 200.0  # Nm
_UPRIGHT_HOLD = 60.0  # Nms


class _WalkerMotion(NamedTuple):
    """`Motion` of robots on two legs, as compiled code takes it."""

    position: Array
    rotation: Array
    velocity: Array
    spin: Array
    angles: Array
    speeds: Array


@compiled
def _walk(layers, settings, motion, command, memory):
    """Return the joints' targets of all robots, shape ``(k, 10)``."""
    steps, stance, slew = settings
    count = len(command)
    seen, wanted = np.empty((count, OBSERVED)), np.empty(3)
    for k in range(count):
        mine, rotation, velocity, spin = memory[k], motion.rotation[k], motion.velocity[k], motion.spin[k]
        target_velocity(steps.period, command[k], motion.position[k], rotation, mine, wanted)
        approach(mine[COMMAND : COMMAND + 3], wanted, slew)
        planar = planar_motion(rotation, velocity, spin)
        advance_clock(steps, planar, math.acos(min(max(rotation[2, 2], -1.0), 1.0)), mine)
        fit_stance(stance, rotation, motion.angles[k], mine)
        level = motion.angles[k].copy()
        fit_to_ground(mine, level, -1.0)
        observe(steps, (rotation, velocity, spin), (level, motion.speeds[k]), mine, seen[k])
    x = seen.astype(np.float32)
    for index in range(len(layers)):
        x = dense_layer(x, layers[index][0], layers[index][1], index == len(layers) - 1)
    out = np.empty((count, LEGS))
    for k in range(count):
        leg_targets(steps, x[k].astype(np.float64), memory[k], out[k])
        fit_to_ground(memory[k], out[k], 1.0)
    return np.minimum(np.maximum(out, steps.low), steps.high)


class TwoLegWalker(MotorController):
    """Walks on two legs, stands, and steps to catch itself when it is pushed. Who fell is set on its feet."""

    memory = MEMORY

    def __init__(self, model: RobotModel) -> None:
        super().__init__(model)
        c, period = model.controller, model.control_period
        assert isinstance(c, TwoLegs)
        low, high = model.motor_limits
        steps = StepSettings(period, c.stride, np.array(model.rest[:LEG]), low, high)
        stance = StanceSettings(period, c.places, float(model.rest[KNEE]))
        self._settings = (steps, stance, np.array(_SLEW) * period)
        self._layers = tuple((np.ascontiguousarray(w), np.array(b)) for w, b in zip(c.weights, c.biases, strict=True))

    def targets(self, motion: Motion, command: Array, memory: Array) -> Array:
        """Joint angles, rad."""
        m = motion
        moving = _WalkerMotion(m.position, m.rotation, m.velocity, m.angular_velocity_body, m.angles, m.speeds)
        found: Array = _walk(self._layers, self._settings, moving, command, memory)
        return found

    def lying_targets(self, lying: float, base: Base) -> tuple[Array, Gains | None] | None:
        """Keep the legs as they are at rest."""
        return self.model.stance, None

    def lift(self, lying: float, base: Base, above_ground: float) -> tuple[str, Array] | None:
        """Be lifted by the chest and set upright, as by a crane: no robot of this kind gets up by itself."""
        c = self.model.controller
        assert isinstance(c, TwoLegs)
        up = lying - _LIFTED_AFTER
        if up < 0.0:
            return c.hoist, np.zeros((2, 3))
        height = min(self.model.stand + 0.01, 0.15 + _LIFT_SPEED * up)
        force = -_HOLD * base.velocity
        force[2] += c.mass * 9.81 + _PULL * (height - above_ground)
        force[2] = min(max(force[2], 0.0), 2.0 * c.mass * 9.81)
        axis = base.rotation[:, 2]
        torque = _UPRIGHT * np.array([axis[1], -axis[0], 0.0])
        turned = apply_matrix(base.angular_velocity_body, base.rotation)
        wrench = np.array([force, torque - _UPRIGHT_HOLD * turned])
        return c.hoist, apply_matrix(wrench, base.rotation.T)

    def stands(self, lying: float, base: Base, angles: Array, above_ground: float) -> bool:
        """Return whether it was set on its feet, and is still."""
        still = float(np.abs(base.velocity).max()) < 0.1 and float(np.abs(base.angular_velocity_body).max()) < 0.3
        bent = float(np.abs(angles - self.model.rest).max())
        return lying > _LIFTED_AFTER and abs(above_ground - self.model.stand) < 0.06 and still and bent < 0.3
