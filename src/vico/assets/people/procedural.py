"""Our own people: lofted bodies with face, hands, hair and clothes, from anthropometric proportions. No data needed.

Lengths are shares of the stature unless said, of bodies of average build: segment lengths after Drillis and Contini (as
in Winter, *Biomechanics and Motor Control of Human Movement*), girths fitted by eye to photographs. Clothes add
to them.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vico.assets.people.clothing import darker, front_of, worn_parts
from vico.assets.people.heads import head_parts
from vico.assets.people.lofts import BodyPart, LoftRing, Weights, blend, dense, loft, merge_parts, skin_parts
from vico.assets.people.model import FINGERS, JOINTS, Appearance, Colour, J, SkinnedBody

# Height of the ring, then front, back and half-width for a male and for a female body of average build.
TORSO = np.array(
    [
        [0.478, 0.045, 0.050, 0.070, 0.045, 0.050, 0.072],
        [0.492, 0.057, 0.068, 0.088, 0.058, 0.072, 0.093],
        [0.510, 0.062, 0.075, 0.096, 0.062, 0.080, 0.102],
        [0.530, 0.062, 0.075, 0.098, 0.062, 0.079, 0.105],
        [0.560, 0.061, 0.066, 0.095, 0.060, 0.067, 0.101],
        [0.590, 0.060, 0.056, 0.089, 0.058, 0.054, 0.089],
        [0.620, 0.059, 0.050, 0.085, 0.055, 0.047, 0.079],
        [0.650, 0.060, 0.050, 0.085, 0.055, 0.047, 0.077],
        [0.680, 0.063, 0.054, 0.089, 0.060, 0.051, 0.081],
        [0.710, 0.067, 0.059, 0.094, 0.072, 0.055, 0.086],
        [0.735, 0.069, 0.062, 0.099, 0.076, 0.058, 0.090],
        [0.760, 0.066, 0.064, 0.103, 0.068, 0.060, 0.093],
        [0.785, 0.058, 0.062, 0.107, 0.056, 0.059, 0.097],
        [0.805, 0.049, 0.057, 0.108, 0.047, 0.054, 0.098],
        [0.820, 0.040, 0.048, 0.094, 0.039, 0.045, 0.084],
        [0.832, 0.035, 0.041, 0.066, 0.034, 0.038, 0.059],
        [0.842, 0.031, 0.037, 0.043, 0.029, 0.034, 0.038],
        [0.855, 0.029, 0.034, 0.033, 0.026, 0.031, 0.029],
        [0.885, 0.028, 0.033, 0.032, 0.025, 0.030, 0.028],
    ]
)
# Height, front, back, half-width of a leg.
LEG = np.array(
    [
        [0.515, 0.040, 0.048, 0.036],
        [0.495, 0.050, 0.058, 0.046],
        [0.470, 0.053, 0.057, 0.049],
        [0.440, 0.052, 0.051, 0.047],
        [0.400, 0.049, 0.046, 0.044],
        [0.350, 0.043, 0.041, 0.039],
        [0.315, 0.037, 0.036, 0.034],
        [0.285, 0.034, 0.031, 0.032],
        [0.260, 0.031, 0.032, 0.031],
        [0.225, 0.029, 0.038, 0.032],
        [0.190, 0.027, 0.037, 0.030],
        [0.140, 0.023, 0.030, 0.024],
        [0.095, 0.020, 0.024, 0.019],
        [0.060, 0.019, 0.022, 0.018],
        [0.040, 0.019, 0.022, 0.018],
    ]
)
# Distance along the arm from the shoulder joint, then half-thickness front-back and across.
ARM = np.array(
    [
        [-0.040, 0.020, 0.014],
        [-0.018, 0.031, 0.021],
        [0.004, 0.035, 0.027],
        [0.035, 0.034, 0.029],
        [0.070, 0.030, 0.028],
        [0.110, 0.027, 0.026],
        [0.150, 0.024, 0.024],
        [0.172, 0.023, 0.023],
        [0.192, 0.025, 0.023],
        [0.220, 0.025, 0.022],
        [0.260, 0.021, 0.019],
        [0.300, 0.017, 0.015],
        [0.318, 0.016, 0.0125],
    ]
)
UPPER_ARM, FOREARM = 0.172, 0.148
# Along the arm to the knuckle, sideways towards the thumb, length, of index, middle, pinky and ring finger.
FINGER = {
    "index": (0.376, 0.0150, 0.043),
    "middle": (0.380, 0.0050, 0.047),
    "pinky": (0.367, -0.0145, 0.034),
    "ring": (0.376, -0.0050, 0.043),
}
# What a garment adds to every radius.
TOP_EASE = {
    "t-shirt": 0.004,
    "shirt": 0.005,
    "jumper": 0.008,
    "hoodie": 0.010,
    "jacket": 0.011,
    "suit": 0.008,
    "coat": 0.013,
    "dress": 0.002,
}
LEG_EASE = {"trousers": 0.007, "jeans": 0.0035, "shorts": 0.009, "skirt": 0.0, "leggings": 0.0008}


# Arms rest this far below the horizontal: halfway between walking and reaching, where shoulders deform best.
_ARM_DROP = np.radians(58)
_TORSO_SIDES = 18


class _Tailor:
    """One person's measures, in metres, while their parts are lofted."""

    def __init__(self, look: Appearance) -> None:
        self.look = look
        self.h = look.height
        male = look.gender
        child = float(np.clip((16 - look.age) / 11, 0, 1))
        self.head = (0.132 + 0.040 * child) * self.h
        # The trunk makes room for a child's larger head.
        self.trunk = 1 - 0.040 * child / 0.87
        self.fat = (look.build - 0.45) * 2
        self.brawn = (look.muscle - 0.5) * 2 * (0.5 + 0.5 * male)
        self.shoulder_y = (0.098 + 0.012 * male + 0.004 * self.brawn - 0.004 * child) * self.h
        self.hip_y = (0.053 - 0.003 * male) * self.h
        self.torso = TORSO[:, 4:7] * (1 - male) + TORSO[:, 1:4] * male
        if child > 0:
            plain = TORSO[:, 1:4] * np.array([0.92, 0.9, 0.92])
            self.torso = self.torso * (1 - child) + plain * child
        z = TORSO[:, 0]
        belly = np.exp(-(((z - 0.61) / 0.07) ** 2))
        chest = np.exp(-(((z - 0.75) / 0.05) ** 2))
        trunk = np.where(z < 0.84, 1.0, 0.35)
        self.torso = self.torso * (1 + 0.14 * self.fat * trunk[:, None])
        self.torso[:, 0] += (0.030 * max(self.fat, 0) + 0.0004 * max(look.age - 35, 0) * male) * belly
        self.torso[:, 2] += 0.012 * self.fat * belly
        self.torso += 0.005 * self.brawn * chest[:, None]
        self.limb = 1 + 0.13 * self.fat + 0.08 * self.brawn
        self.limb *= 0.94 + 0.06 * male
        self.joints = self._skeleton()

    def z(self, share: float) -> float:
        """Metres above the floor of a share of the stature; the trunk is compressed under a child's head."""
        return share * self.h * self.trunk

    def _skeleton(self) -> NDArray[np.float64]:
        joints = np.zeros((len(JOINTS), 3))
        h, z = self.h, self.z
        spine = (("pelvis", 0.0, 0.535), ("spine1", -0.006, 0.60), ("spine2", -0.006, 0.665), ("spine3", -0.008, 0.735))
        for name, x, height in (*spine, ("neck", -0.014, 0.838), ("head", -0.002, 0.888)):
            joints[J[name]] = x * h, 0, z(height)
        chin = h - self.head
        joints[J["jaw"]] = 0.1 * self.head, 0, chin + 0.28 * self.head
        for side, left in (("left", 1.0), ("right", -1.0)):
            joints[J[f"{side}_eye"]] = 0.34 * self.head, left * 0.16 * self.head, chin + 0.52 * self.head
            joints[J[f"{side}_hip"]] = 0, left * self.hip_y, z(0.510)
            joints[J[f"{side}_knee"]] = 0.004 * h, left * self.hip_y * 0.97, z(0.285)
            joints[J[f"{side}_ankle"]] = -0.004 * h, left * self.hip_y * 0.94, z(0.042)
            joints[J[f"{side}_foot"]] = 0.070 * h, left * self.hip_y * 1.02, z(0.011)
            joints[J[f"{side}_collar"]] = -0.004 * h, left * 0.022 * h, z(0.798)
            joints[J[f"{side}_shoulder"]] = -0.006 * h, left * self.shoulder_y, z(0.803)
            for name, along in (("elbow", UPPER_ARM), ("wrist", UPPER_ARM + FOREARM)):
                joints[J[f"{side}_{name}"]] = self.on_arm(joints, side, along)
            for finger, points in self.fingers(joints, side).items():
                for k in range(3):
                    joints[J[f"{side}_{finger}{k + 1}"]] = points[k]
        return joints

    def arm_axes(self, side: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Direction of the hanging arm and the direction its palm faces."""
        left = 1.0 if side == "left" else -1.0
        along = np.array([0.0, left * np.cos(_ARM_DROP), -np.sin(_ARM_DROP)])
        return along, np.array([0.0, -left * np.sin(_ARM_DROP), -np.cos(_ARM_DROP)])

    def on_arm(
        self, joints: NDArray[np.float64], side: str, along: float, ahead: float = 0.0, palm: float = 0.0
    ) -> NDArray[np.float64]:
        """Return a point by shares of the stature along the arm, forward, and to the palm's side."""
        axis, facing = self.arm_axes(side)
        ease = self.trunk * self.h
        start = joints[J[f"{side}_shoulder"]]
        if along < 0:
            # Inside the trunk the centre line runs level, so that the shoulder caps the arm instead of a puff.
            axis = np.array([0.0, np.sign(axis[1]), -0.1])
        return start + ease * (along * axis + palm * facing + ahead * np.array([1.0, 0, 0]))

    def fingers(self, joints: NDArray[np.float64], side: str) -> dict[str, list[NDArray[np.float64]]]:
        """Four points along each finger, knuckle to tip, a little curled."""
        points: dict[str, list[NDArray[np.float64]]] = {}
        for finger in FINGERS:
            if finger == "thumb":
                along, ahead, palm, length, way = 0.336, 0.012, 0.006, 0.058, np.array([0.72, 0.62, 0.3])
            else:
                along, ahead, length = FINGER[finger]
                palm, way = 0.0, np.array([1.0, 0.25 * ahead / 0.015 * 0.3, 0.12])
            way = way / np.linalg.norm(way)
            at, row = np.array([along, ahead, palm]), []
            for k, share in enumerate((0.0, 0.45, 0.30, 0.25)):
                if k:
                    bend = way + np.array([0, 0, 0.16 * (k - 1)])
                    at = at + share * length * bend / np.linalg.norm(bend)
                row.append(self.on_arm(joints, side, *at))
            points[finger] = row
        return points


def _spine_weights(share: float) -> Weights:
    """Who carries a slice of the trunk at a share of the stature."""
    stops = (
        (0.54, "pelvis"),
        (0.605, "spine1"),
        (0.675, "spine2"),
        (0.75, "spine3"),
        (0.835, "spine3"),
        (0.86, "neck"),
    )
    if share <= stops[0][0]:
        return {J["pelvis"]: 1.0}
    for (low, below), (high, above) in pairwise(stops):
        if share <= high:
            return blend({J[below]: 1.0}, {J[above]: 1.0}, (share - low) / (high - low))
    return blend({J["neck"]: 1.0}, {J["head"]: 1.0}, min((share - 0.86) / 0.03, 1.0))


def _torso(tailor: _Tailor) -> list[BodyPart]:
    look, h = tailor.look, tailor.h
    # A waistband shows where the top is tucked in; a hem falls over it otherwise.
    tucked = look.bottom == "skirt" or look.top == "shirt"
    hem = 0.585 if tucked and look.top in ("t-shirt", "shirt", "jumper") else 0.505
    neckline = {"t-shirt": 0.838, "dress": 0.815, "hoodie": 0.848, "shirt": 0.852, "coat": 0.850}.get(look.top, 0.843)
    ease = TOP_EASE[look.top]
    below = look.top_colour if look.top == "dress" else look.bottom_colour
    heights = np.unique(np.concatenate([TORSO[:, 0], [hem, neckline]]))
    rings = []
    for share in heights:
        radii = np.array([np.interp(share, TORSO[:, 0], tailor.torso[:, k]) for k in range(3)])
        if share >= neckline:
            colour, room = look.skin, 0.0
        elif share >= hem:
            # Cloth hangs from the chest: the waist is hidden a little.
            colour, room = look.top_colour, ease * (1.0 if share < 0.80 else 0.6)
        else:
            colour, room = below, 0.001 + LEG_EASE[look.bottom] * 0.5
        # Nothing hangs open between the trousers' seat and the thighs.
        front, back, side = (radii + room) * h
        lean = -0.006 - 0.010 * np.clip((share - 0.74) / 0.1, 0, 1)
        square = 2.0 + 0.5 * float(np.clip((share - 0.5) / 0.05, 0, 1) * np.clip((0.83 - share) / 0.05, 0, 1))
        centre = (lean * h, 0.0, tailor.z(float(share)))
        rings.append(LoftRing(centre, front, back, side, _spine_weights(float(share)), colour, square))
    part = loft(rings, sides=_TORSO_SIDES, close_start=True)
    _share_with_collars(part, tailor)
    parts = [part]
    hems = {
        "suit": (0.60, 0.462, 1.04),
        "coat": (0.60, 0.315, 1.12),
        "dress": (0.62, 0.300, 1.30),
        "jacket": (0.56, 0.49, 1.0),
    }
    if look.top in hems:
        parts.append(_skirt(tailor, *hems[look.top], ease=ease + 0.003, colour=look.top_colour))
    if look.bottom == "skirt" and look.top not in ("dress", "coat"):
        parts.append(_skirt(tailor, 0.60, 0.325, 1.15, ease=0.010, colour=look.bottom_colour))
    rows = [tailor.z(float(share)) for share in TORSO[:, 0]]
    return parts + front_of(look, merge_parts(parts), tailor.z, neckline, rows)


def _share_with_collars(part: BodyPart, tailor: _Tailor) -> None:
    """Let the shoulders' corners move with the collar bones."""
    h = tailor.h
    for side, left in (("left", 1.0), ("right", -1.0)):
        out = np.clip((left * part.vertices[:, 1] / h - 0.035) / 0.06, 0, 1)
        up = np.clip((part.vertices[:, 2] / tailor.z(1.0) - 0.73) / 0.05, 0, 1)
        low = np.clip((0.85 - part.vertices[:, 2] / tailor.z(1.0)) / 0.02, 0, 1)
        share = (0.75 * out * up * low)[:, None]
        part.weights = part.weights * (1 - share) + share * dense(
            {J[f"{side}_collar"]: 0.8, J[f"{side}_shoulder"]: 0.2}
        )


def _skirt(tailor: _Tailor, top: float, hem: float, flare: float, *, ease: float, colour: Colour) -> BodyPart:
    """Cloth that hangs from the waist, carried by pelvis and thighs."""
    h = tailor.h
    shares = np.append(np.linspace(top, hem, 7), hem - 0.004)
    rings = []
    hips = np.array([np.interp(0.515, TORSO[:, 0], tailor.torso[:, k]) for k in range(3)])
    for share in shares:
        down = float(np.clip((0.515 - share) / (0.515 - hem), 0, 1)) if share < 0.515 else 0.0
        radii = np.array([np.interp(max(share, 0.515), TORSO[:, 0], tailor.torso[:, k]) for k in range(3)])
        radii = radii + (hips * flare - hips) * down + ease
        centre = (-0.006 * h, 0.0, tailor.z(float(share)))
        front, back, side = radii * h
        rings.append(LoftRing(centre, front, back, side, _spine_weights(float(share)), colour, 2.3))
    # Turned in at the hem, so that the cloth has an inside.
    front, back, side = 0.97 * front, 0.97 * back, 0.97 * side
    rings.append(
        LoftRing(
            (-0.006 * h, 0.0, tailor.z(hem + 0.004)), front, back, side, _spine_weights(hem), darker(colour, 0.5), 2.3
        )
    )
    part = loft(rings, sides=_TORSO_SIDES)
    # Lofted downwards, the outline runs the other way round; the triangles follow.
    share = np.clip((tailor.z(0.53) - part.vertices[:, 2]) / (tailor.z(0.53) - tailor.z(0.40)), 0, 1)
    left = np.clip(part.vertices[:, 1] / (0.09 * h) + 0.5, 0, 1)
    carried = left[:, None] * dense({J["left_hip"]: 1.0}) + (1 - left)[:, None] * dense({J["right_hip"]: 1.0})
    mixing = (0.72 * share)[:, None]
    part.weights = part.weights * (1 - mixing) + mixing * carried
    return part


def _leg(tailor: _Tailor, side: str) -> list[BodyPart]:
    look, h = tailor.look, tailor.h
    hip, knee, ankle = (tailor.joints[J[f"{side}_{name}"]] for name in ("hip", "knee", "ankle"))
    covered = {"shorts": 0.325, "skirt": 1.0}.get(look.bottom, 0.052)
    if look.top == "dress" and look.bottom != "leggings":
        covered = 1.0
    boots = 0.125 if look.shoes == "boots" else 0.0
    stops = [covered] if covered < 1 else []
    heights = np.unique(np.concatenate([LEG[:, 0], stops, [boots] if boots > 0.05 else []]))[::-1]
    straight = look.bottom in ("trousers", "jeans") and covered < 1
    rings = []
    for share in heights:
        radii = np.array([np.interp(share, LEG[::-1, 0], LEG[::-1, k]) for k in (1, 2, 3)]) * tailor.limb
        colour, room = look.skin, 0.0
        if share < boots + 1e-9:
            colour, room = look.shoes_colour, 0.004
        elif share >= covered - 1e-9 and covered < 1:
            colour, room = look.bottom_colour, LEG_EASE[look.bottom]
            if straight and share < 0.3:
                # Trouser legs hang from the knee rather than follow the calf.
                radii = np.maximum(
                    radii, np.array([0.027, 0.031, 0.026]) * (1.0 if look.bottom == "trousers" else 0.86)
                )
        front, back, half = (radii + room) * h
        z = tailor.z(float(share))
        centre = _between_joints(hip, knee, ankle, z)
        # Thighs may touch, not cross.
        half = min(half, abs(centre[1]) + 0.004 * h)
        rings.append(LoftRing(centre, front, back, half, _leg_weights(side, share), colour, 2.15))
    if covered < 1 and covered < 0.1 and not boots:
        cuff = rings[-1]
        rings.append(
            LoftRing(
                np.asarray(cuff.centre) + np.array([0, 0, 0.01 * h]),
                0.012 * h,
                0.014 * h,
                0.012 * h,
                cuff.weights,
                cuff.colour,
            )
        )
    return [loft(rings, sides=12), *_shoe(tailor, side)]


def _between_joints(
    hip: NDArray[np.float64], knee: NDArray[np.float64], ankle: NDArray[np.float64], z: float
) -> NDArray[np.float64]:
    """Return the leg's centre line at a height."""
    heights = [ankle[2], knee[2], hip[2]]
    return np.array(
        [
            float(np.interp(z, heights, [ankle[0], knee[0], hip[0]])),
            float(np.interp(z, heights, [ankle[1], knee[1], hip[1]])),
            z,
        ]
    )


def _leg_weights(side: str, share: float) -> Weights:
    hip, knee, ankle = ({J[f"{side}_{name}"]: 1.0} for name in ("hip", "knee", "ankle"))
    if share > 0.46:
        return blend(hip, {J["pelvis"]: 1.0}, float(np.clip((share - 0.46) / 0.055, 0, 1)) * 0.75)
    if share > 0.16:
        return blend(hip, knee, float(np.clip((0.318 - share) / 0.066, 0, 1)))
    return blend(knee, ankle, float(np.clip((0.062 - share) / 0.03, 0, 1)))


def _shoe(tailor: _Tailor, side: str) -> list[BodyPart]:
    """Return an upper over a flat sole, the toe cap carried by the ball of the foot."""
    look, h = tailor.look, tailor.h
    ankle, ball = tailor.joints[J[f"{side}_ankle"]], tailor.joints[J[f"{side}_foot"]]
    rear, toes = {J[f"{side}_ankle"]: 1.0}, {J[f"{side}_foot"]: 1.0}
    base = 0.012 * h
    sole_colour: Colour = (228, 226, 220) if look.shoes == "trainers" else (36, 32, 30)
    bare = look.shoes == "sandals"
    upper, sole = [], []
    for x, top, half in (
        (-0.040, 0.020, 0.010),
        (-0.036, 0.042, 0.017),
        (-0.020, 0.050, 0.020),
        (0.004, 0.046, 0.0205),
        (0.030, 0.034, 0.0215),
        (0.056, 0.024, 0.025),
        (0.078, 0.019, 0.0265),
        (0.098, 0.014, 0.0225),
        (0.110, 0.010, 0.013),
        (0.114, 0.004, 0.004),
    ):
        at = ankle[0] + x * h
        y = float(np.interp(at, [ankle[0], ball[0]], [ankle[1], ball[1]]))
        weights = blend(rear, toes, float(np.clip((x - 0.060) / 0.022, 0, 1)))
        colour = look.skin if bare and -0.03 < x < 0.105 else look.shoes_colour
        upper.append(LoftRing((at, y, base), top * h, 0.002 * h, half * h, weights, colour, 2.2))
        grow = half * h + 0.0025 * h
        sole.append(LoftRing((at, y, base), 0.0012 * h, base, grow, weights, sole_colour, 5.0))
    ends = {"sides": 10, "forward": (0.0, 0.0, 1.0), "close_start": True, "close_end": True}
    return [loft(upper, **ends), loft(sole, **ends | {"sides": 8})]  # type: ignore[arg-type]


def _arm(tailor: _Tailor, side: str) -> list[BodyPart]:
    look = tailor.look
    scale = tailor.h * tailor.trunk
    sleeve = 0.095 if look.top in ("t-shirt", "dress") else 0.322
    ease = TOP_EASE[look.top] * 0.8
    stations = np.unique(np.concatenate([ARM[:, 0], [sleeve]]))
    rings = []
    for along in stations:
        ahead = np.interp(along, ARM[:, 0], ARM[:, 1])
        across = np.interp(along, ARM[:, 0], ARM[:, 2])
        grow = tailor.limb + 0.10 * tailor.brawn * float(np.exp(-(((along - 0.07) / 0.06) ** 2)))
        inside = along <= sleeve + 1e-9
        room = ease * float(np.clip((along + 0.04) / 0.05, 0, 1)) if inside else 0.0
        colour = look.top_colour if along < sleeve - 1e-9 else look.skin
        if inside and sleeve > 0.3 and along > 0.2:
            ahead, across = max(ahead, 0.019), max(across, 0.018)
        if along > sleeve - 1e-9 and not inside:
            room = 0.0
        centre = tailor.on_arm(tailor.joints, side, float(along))
        radii = (ahead * grow + room) * scale, (across * grow + room) * scale
        rings.append(LoftRing(centre, radii[0], radii[0], radii[1], _arm_weights(side, float(along)), colour, 2.1))
        if abs(along - sleeve) < 1e-9:
            # The cuff turns in to the skin.
            thin = max(np.interp(along, ARM[:, 0], ARM[:, 1]) * tailor.limb, 0.012) * scale * 0.95
            thin2 = max(np.interp(along, ARM[:, 0], ARM[:, 2]) * tailor.limb, 0.010) * scale * 0.95
            rings[-1] = LoftRing(centre, radii[0], radii[0], radii[1], rings[-1].weights, look.top_colour, 2.1)
            back = tailor.on_arm(tailor.joints, side, float(along) - 0.0005)
            rings.append(LoftRing(back, thin, thin, thin2, rings[-1].weights, look.skin, 2.1))
    sleeve_part = loft(rings, sides=10)
    return [sleeve_part, *_hand(tailor, side)]


def _arm_weights(side: str, along: float) -> Weights:
    collar, shoulder, elbow, wrist = ({J[f"{side}_{n}"]: 1.0} for n in ("collar", "shoulder", "elbow", "wrist"))
    if along < 0.06:
        return blend(collar, shoulder, float(np.clip((along + 0.045) / 0.06, 0.15, 1)))
    if along < 0.25:
        return blend(shoulder, elbow, float(np.clip((along - (UPPER_ARM - 0.022)) / 0.044, 0, 1)))
    return blend(elbow, wrist, float(np.clip((along - 0.310) / 0.02, 0, 1)))


def _hand(tailor: _Tailor, side: str) -> list[BodyPart]:
    look, scale = tailor.look, tailor.h * tailor.trunk
    wrist = {J[f"{side}_wrist"]: 1.0}
    palm = []
    for along, ahead, half, thick in (
        (0.312, 0.0, 0.0125, 0.0095),
        (0.328, 0.0, 0.0150, 0.0095),
        (0.345, 0.001, 0.0200, 0.0095),
        (0.362, 0.001, 0.0215, 0.0085),
        (0.378, 0.0, 0.0200, 0.0065),
        (0.384, 0.0, 0.0170, 0.0040),
    ):
        centre = tailor.on_arm(tailor.joints, side, along, ahead)
        palm.append(LoftRing(centre, half * scale, half * scale, thick * scale, wrist, look.skin, 2.5))
    parts = [loft(palm, sides=10, close_end=True)]
    for finger, points in tailor.fingers(tailor.joints, side).items():
        radius = (0.0068 if finger == "thumb" else 0.0047 if finger == "pinky" else 0.0056) * scale
        rings = []
        for k, point in enumerate(points):
            bones = {J[f"{side}_{finger}{min(k + 1, 3)}"]: 1.0}
            before = {J[f"{side}_{finger}{k}"]: 1.0} if 1 <= k < 3 else wrist if k == 0 else bones
            size = radius * (1.1, 1.0, 0.9, 0.45)[k]
            rings.append(LoftRing(point, size, size, size, blend(before, bones, 0.5), look.skin))
        parts.append(loft(rings, sides=5, close_end=True))
    return parts


def body(look: Appearance, *, fine: bool = False) -> SkinnedBody:
    """Loft somebody.

    Parameters
    ----------
    look
        How they look.
    fine
        With hair, eyebrows and glasses for close-ups.

    Returns
    -------
    SkinnedBody
        About 2,000 vertices, fine about 3,500.
    """
    tailor = _Tailor(look)
    parts = _torso(tailor)
    trunk = list(parts)
    for side in ("left", "right"):
        legs = _leg(tailor, side)
        trunk += legs[:1]
        parts += [*legs, *_arm(tailor, side)]
    parts += worn_parts(look, tailor.joints, trunk)
    parts += head_parts(look, tailor.head, tailor.h, fine=fine)
    return skin_parts(parts, tailor.joints, look.height)
