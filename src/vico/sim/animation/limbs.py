"""Limbs and trunk of a body, moved one at a time; rotations and two-bone limbs. Compiled.

Signs, in the body's axes (x forward, y left, z up): turning about +y leans forward or points toes down; about +x
lowers the right side; about +z turns left. Arms lie along y in the T-pose, so an arm is lowered about x, swung about
y, and its elbow bends about z.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.people import PARENTS, J
from vico.io.compiled import compiled
from vico.render.skinning import rotation_matrix
from vico.sim.animation.motions import SOLE_PITCHES

Array = NDArray[Any]
# Axes of the body: forward, left, up.
X, Y, Z = range(3)


@compiled
def rotation_about(axis: int, angle: float) -> Array:
    """Return the rotation matrix about `X`, `Y` or `Z`; radians."""
    c, s = np.cos(angle), np.sin(angle)
    m = np.zeros((3, 3))
    a, b = (axis + 1) % 3, (axis + 2) % 3
    m[axis, axis] = 1.0
    m[a, a], m[a, b], m[b, a], m[b, b] = c, -s, s, c
    return m


@compiled
def compose(a: Array, b: Array) -> Array:
    """Return the product of two 3x3 matrices, without a call to BLAS."""
    m = np.empty((3, 3))
    for r in range(3):
        for c in range(3):
            m[r, c] = a[r, 0] * b[0, c] + a[r, 1] * b[1, c] + a[r, 2] * b[2, c]
    return m


@compiled
def relative_rotation(a: Array, b: Array) -> Array:
    """Return rotation `b` as seen from `a`: the inverse of `a` times `b`."""
    m = np.empty((3, 3))
    for r in range(3):
        for c in range(3):
            m[r, c] = a[0, r] * b[0, c] + a[1, r] * b[1, c] + a[2, r] * b[2, c]
    return m


@compiled
def rotate(a: Array, v: Array) -> Array:
    """Return a 3x3 matrix times a vector."""
    out = np.empty(3)
    for r in range(3):
        out[r] = a[r, 0] * v[0] + a[r, 1] * v[1] + a[r, 2] * v[2]
    return out


@compiled
def cross(a: Array, b: Array) -> Array:
    """Return the cross product of two vectors."""
    out = np.empty(3)
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out


@compiled
def unit(v: Array) -> Array:
    """Return the direction of a vector."""
    return v / max(np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), 1e-12)


@compiled
def axis_angle(m: Array, out: Array) -> None:
    """Write the axis-angle vector of a rotation matrix, through its quaternion (stable at every angle)."""
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    q = np.empty(4)
    if trace > 0:
        s = 2.0 * np.sqrt(trace + 1.0)
        q[0], q[1], q[2], q[3] = 0.25 * s, (m[2, 1] - m[1, 2]) / s, (m[0, 2] - m[2, 0]) / s, (m[1, 0] - m[0, 1]) / s
    else:
        i = 0
        if m[1, 1] > m[i, i]:
            i = 1
        if m[2, 2] > m[i, i]:
            i = 2
        j, k = (i + 1) % 3, (i + 2) % 3
        s = 2.0 * np.sqrt(max(1.0 + m[i, i] - m[j, j] - m[k, k], 1e-12))
        q[0] = (m[k, j] - m[j, k]) / s
        q[1 + i], q[1 + j], q[1 + k] = 0.25 * s, (m[j, i] + m[i, j]) / s, (m[k, i] + m[i, k]) / s
    if q[0] < 0:
        q[:] = -q
    sine = np.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    factor = 2.0 if sine < 1e-9 else 2.0 * np.arctan2(sine, q[0]) / sine
    out[0], out[1], out[2] = factor * q[1], factor * q[2], factor * q[3]


@compiled
def two_bone_ik(start: Array, goal: Array, pole: Array, first: float, second: float) -> tuple[Array, Array, Array]:
    """Bend a limb of two bones to reach a point.

    Parameters
    ----------
    start, goal
        Where it hangs and where its end should be, metres.
    pole
        Direction the middle joint points to.
    first, second
        Bone lengths, metres.

    Returns
    -------
    first direction, second direction, hinge
        Unit vectors; the hinge is the axis that turns the first into the second.

    Notes
    -----
    A goal out of reach is approached in its direction.
    """
    way = goal - start
    distance = np.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
    along = way / max(distance, 1e-9)
    distance = min(max(distance, abs(first - second) + 1e-4), (first + second) * 0.9998)
    side = pole - along * (pole[0] * along[0] + pole[1] * along[1] + pole[2] * along[2])
    side = unit(side)
    cosine = (first * first + distance * distance - second * second) / (2 * first * distance)
    cosine = min(max(cosine, -1.0), 1.0)
    sine = np.sqrt(1 - cosine * cosine)
    upper = along * cosine + side * sine
    lower = unit(along * distance - upper * first)
    return upper, lower, unit(cross(side, along))


@compiled
def smoothstep(x: float) -> float:
    """Return 0 before 0, 1 after 1, and a curve with level ends between."""
    t = min(max(x, 0.0), 1.0)
    return t * t * (3 - 2 * t)


@compiled
def hermite(a: float, b: float, slope_a: float, slope_b: float, t: float) -> float:
    """Return the cubic from `a` to `b` over t = 0..1 with the given slopes at the ends."""
    u = t * t
    w = u * t
    return (2 * w - 3 * u + 1) * a + (w - 2 * u + t) * slope_a + (3 * u - 2 * w) * b + (w - u) * slope_b


LEFT, RIGHT = 0, 1
# +1 on the left, -1 on the right.
SIGN = (1.0, -1.0)


def _pair(name: str) -> tuple[int, int]:
    """Return the numbers of a joint on the left and on the right."""
    return J[f"left_{name}"], J[f"right_{name}"]


PELVIS, SPINE1, SPINE2, SPINE3, NECK, HEAD = (J[n] for n in ("pelvis", "spine1", "spine2", "spine3", "neck", "head"))
HIP, KNEE, ANKLE, FOOT = _pair("hip"), _pair("knee"), _pair("ankle"), _pair("foot")
SHOULDER, ELBOW, WRIST = _pair("shoulder"), _pair("elbow"), _pair("wrist")
# Five fingers of three joints each follow one another; the thumb comes last.
FIRST_FINGER, FINGER_COUNT, THUMB = _pair("index1"), 5, 4


class BodyPose(NamedTuple):
    """One person while they are posed.

    Attributes
    ----------
    local
        Rotation of each joint relative to its parent, shape ``(55, 3, 3)``; written.
    shift
        Of the pelvis from its place in the T-pose, body frame, metres, shape ``(3,)``; written.
    joints
        In the T-pose, body frame, metres, shape ``(55, 3)``.
    style
        A `STYLE` record.
    second
        Of the clock, for those who stand and wait.
    ground
        Under each foot (left, right), where it stands or stood last and where it comes down next: height above the
        body's origin, metres; slope, radians, toes down; how far it stands ahead of its place in the gait, metres; how
        much of its toes' end is over an edge and borne by nothing, metres; shape ``(2, 2, 4)``.
    hand
        That makes gestures: 0 left, 1 right.
    """

    local: NDArray[np.float64]
    shift: NDArray[np.float64]
    joints: NDArray[np.float64]
    style: Any
    second: float
    ground: NDArray[np.float64]
    hand: int


# Of `BodyPose.ground`.
HERE, NEXT = 0, 1
LEVEL, TILT, AHEAD, OVER = 0, 1, 2, 3
_FIRST_PITCH, _PITCHES = SOLE_PITCHES[0], len(SOLE_PITCHES)
_PITCH_STEP = SOLE_PITCHES[1] - SOLE_PITCHES[0]


@compiled
def _at_pitch(table: Array, pitch: float) -> float:
    at = min(max((pitch - _FIRST_PITCH) / _PITCH_STEP, 0.0), _PITCHES - 1.001)
    k = int(at)
    return table[k] + (at - k) * (table[k + 1] - table[k])


@compiled
def sole_depth(style: Any, side: int, pitch: float) -> float:
    """Return how far a foot so pitched reaches below its ankle, metres."""
    return _at_pitch(style.sole_depth[side], pitch)


@compiled
def sole_roll(style: Any, side: int, pitch: float) -> float:
    """Return how far the ankle is before where it is above a flat foot when the sole has rolled to a pitch, metres."""
    return _at_pitch(style.sole_roll[side], pitch)


@compiled
def curl_fingers(body: Any, side: int, curl: float, thumb: float) -> None:
    """Bring the fingers together and curl each of their joints; radians."""
    local, joints = body.local, body.joints
    sign, base = -SIGN[side], FIRST_FINGER[side]
    for finger in range(FINGER_COUNT):
        first = base + 3 * finger
        along = joints[first + 1] - joints[first]
        spread = np.arctan2(along[X], abs(along[Y]))
        share, bend = (0.8, curl) if finger < THUMB else (0.35, thumb)
        local[first] = compose(rotation_about(Z, -sign * share * spread), rotation_about(X, sign * 0.8 * bend))
        for k in range(1, 3):
            local[first + k] = rotation_about(X, sign * bend)


@compiled
def grip(body: Any, side: int, curl: float) -> None:
    """Close a hand around something."""
    curl_fingers(body, side, curl, 0.6 * curl)


@compiled
def hang_arm(local: Array, side: int, off: float, swing: float, bend: float, twist: float) -> None:
    """Hang an arm: `off` the body sideways, `swing` forward, elbow `bend`, palm `twist`ed backward; radians."""
    sign = SIGN[side]
    lowered = compose(rotation_about(X, -sign * (0.5 * np.pi - off)), rotation_about(Y, twist))
    local[SHOULDER[side]] = compose(rotation_about(Y, -swing), lowered)
    local[ELBOW[side]] = rotation_about(Z, -sign * bend)


@compiled
def joint_in_body(body: Any, joint: int) -> tuple[Any, Any]:
    """Return where a joint is and how its parent is turned, by following the chain from the pelvis."""
    local, shift, joints = body.local, body.shift, body.joints
    chain = np.empty(12, np.int64)
    count, j = 0, joint
    while j > 0:
        chain[count] = j
        count += 1
        j = PARENTS[j]
    turned = local[PELVIS].copy()
    place = joints[PELVIS] + shift
    previous = 0
    for k in range(count - 1, -1, -1):
        j = chain[k]
        place = place + rotate(turned, joints[j] - joints[previous])
        if k > 0:
            turned = compose(turned, local[j])
        previous = j
    return place, turned


@compiled
def reach(body: Any, side: int, goal: Array, pole: Array) -> None:
    """Bring a wrist to a point of the body's frame, the elbow towards `pole`."""
    local, joints = body.local, body.joints
    shoulder, elbow, wrist = SHOULDER[side], ELBOW[side], WRIST[side]
    start, parent = joint_in_body(body, shoulder)
    first = np.sqrt(((joints[elbow] - joints[shoulder]) ** 2).sum())
    second = np.sqrt(((joints[wrist] - joints[elbow]) ** 2).sum())
    upper, lower, hinge = two_bone_ik(start, goal, pole, first, second)
    sign = SIGN[side]
    # The left elbow bends about -z, the right one about +z.
    up = hinge * -sign
    arm, forearm = np.empty((3, 3)), np.empty((3, 3))
    arm[:, 1], arm[:, 2] = upper * sign, up
    arm[:, 0] = cross(arm[:, 1].copy(), up)
    forearm[:, 1], forearm[:, 2] = lower * sign, up
    forearm[:, 0] = cross(forearm[:, 1].copy(), up)
    local[shoulder] = relative_rotation(parent, arm)
    local[elbow] = relative_rotation(arm, forearm)
    local[wrist] = rotation_about(X, 0.0)


@compiled
def reach_by(body: Any, side: int, goal: Array, pole: Array, share: float) -> None:
    """Go a share of the way from the arm's present pose to reaching a point, joint by joint."""
    local = body.local
    shoulder, elbow = local[SHOULDER[side]].copy(), local[ELBOW[side]].copy()
    reach(body, side, goal, pole)
    local[SHOULDER[side]] = part_way(shoulder, local[SHOULDER[side]], share)
    local[ELBOW[side]] = part_way(elbow, local[ELBOW[side]], share)


@compiled
def part_way(a: Array, b: Array, share: float) -> Array:
    """Return the rotation that is a share of the way from one to another."""
    way, step = np.empty(3), np.empty((3, 3))
    axis_angle(relative_rotation(a, b), way)
    rotation_matrix(way * share, step)
    return compose(a, step)


@compiled
def place_foot(body: Any, side: int, ankle: Array, pitch: float, out: float, toes: float) -> None:
    """Bring an ankle to a point; the foot pitched toes down, turned out, its toes bent up; radians."""
    sign = SIGN[side]
    foot = compose(rotation_about(Z, sign * out), rotation_about(Y, pitch))
    bend_leg(body, side, ankle, foot, np.array([1.0, sign * np.sin(out), 0.0]))
    body.local[FOOT[side]] = rotation_about(Y, -toes)


@compiled
def bend_leg(body: Any, side: int, ankle: Array, foot: Array, pole: Array) -> None:
    """Bring an ankle to a point, the foot turned in the body's frame as `foot` says, the knee towards `pole`."""
    local, shift, joints = body.local, body.shift, body.joints
    hip, knee = HIP[side], KNEE[side]
    start = joints[PELVIS] + shift + rotate(local[PELVIS], joints[hip] - joints[PELVIS])
    first = np.sqrt(((joints[knee] - joints[hip]) ** 2).sum())
    second = np.sqrt(((joints[ANKLE[side]] - joints[knee]) ** 2).sum())
    upper, lower, hinge = two_bone_ik(start, ankle, pole, first, second)
    thigh, shin = np.empty((3, 3)), np.empty((3, 3))
    # Knees bend backward about +y: the hinge turns the thigh into the shin.
    thigh[:, 1], thigh[:, 2] = hinge, -upper
    thigh[:, 0] = cross(hinge, -upper)
    shin[:, 1], shin[:, 2] = hinge, -lower
    shin[:, 0] = cross(hinge, -lower)
    local[hip] = relative_rotation(local[PELVIS], thigh)
    local[knee] = relative_rotation(thigh, shin)
    local[ANKLE[side]] = relative_rotation(shin, foot)


@compiled
def highest_pelvis(body: Any, side: int, ankle: Array, stretch: float) -> float:
    """Return how far up the pelvis may shift for a leg to reach its ankle, metres."""
    local, shift, joints = body.local, body.shift, body.joints
    length = np.sqrt(((joints[KNEE[side]] - joints[HIP[side]]) ** 2).sum())
    length = stretch * (length + np.sqrt(((joints[ANKLE[side]] - joints[KNEE[side]]) ** 2).sum()))
    hip = joints[PELVIS] + shift + rotate(local[PELVIS], joints[HIP[side]] - joints[PELVIS])
    dx, dy = ankle[X] - hip[X], ankle[Y] - hip[Y]
    up = np.sqrt(max(length * length - dx * dx - dy * dy, 0.01))
    return ankle[Z] + up - hip[Z] + shift[Z]


@compiled
def bend_trunk(local: Array, lean: float, roll: float, yaw: float, nod: float, stoop: float) -> None:
    """Bend the spine: lean forward, roll to the right, turn left; the head stays level but for `nod`."""
    third = compose(rotation_about(Z, yaw / 3), compose(rotation_about(X, roll / 3), rotation_about(Y, lean / 3)))
    local[SPINE1] = third
    local[SPINE2] = third
    local[SPINE3] = compose(third, rotation_about(Y, 0.6 * stoop))
    local[NECK] = rotation_about(Y, 0.15 * stoop - 0.4 * lean)
    back = compose(rotation_about(Y, -0.6 * lean - 0.75 * stoop + nod), rotation_about(X, -0.7 * roll))
    local[HEAD] = compose(back, rotation_about(Z, -0.8 * yaw))


@compiled
def stance(style: Any, side: int) -> tuple[float, float]:
    """Return where a foot stands at rest: its ankle's x and y, metres."""
    joints = style.joints
    x = joints[ANKLE[side], X] + (0.02 if side == 0 else -0.02) * style.asymmetry
    return x, joints[ANKLE[side], Y] * (0.6 + 0.5 * style.foot_spread)


@compiled
def stand_on_feet(body: Any, lifts: Array, pivots: Array) -> None:
    """Stand on both feet wherever the pelvis is.

    `lifts` raises each foot, metres; `pivots` says how far each, and the spot where it stands, is turned to the left,
    radians.
    """
    shift, ground, style = body.shift, body.ground, body.style
    high = 0.5 * (ground[0, HERE, LEVEL] + ground[1, HERE, LEVEL])
    ankles, pitch = np.empty((2, 3)), np.empty(2)
    for side in range(2):
        x, y = stance(style, side)
        c, s = np.cos(pivots[side]), np.sin(pivots[side])
        level, tilt = ground[side, HERE, LEVEL], ground[side, HERE, TILT]
        # Standing on a slope the shin stays upright: the foot turns about the ankle alone.
        pitch[side] = min(lifts[side] * 3, 0.5) + tilt
        depth = sole_depth(style, side, min(lifts[side] * 3, 0.5))
        ankles[side, X], ankles[side, Y] = c * x - s * y + np.sin(tilt) * depth, s * x + c * y
        ankles[side, Z] = level + np.cos(tilt) * depth + lifts[side]
        high = min(high, highest_pelvis(body, side, ankles[side], 0.999))
    shift[Z] = min(shift[Z], high)
    for side in range(2):
        out = 1.6 * style.toe_out + SIGN[side] * pivots[side]
        place_foot(body, side, ankles[side], pitch[side], out, 0.0)
