"""Animation of people: a library of procedural motions on the 55 joints, computed for everybody in one call.

A motion is a function of a phase in 0..1 (one cycle; two steps when walking), so it can be stopped, resumed, replayed
and stretched. Gaits are driven from the feet: a planted foot rolls over the ground where it stands, kerb or slope,
while the body passes over it, legs follow by two-bone inverse kinematics, the pelvis rides as high as the legs allow.
The caller advances the phase by distance / `stride_length`, so feet never slide.
"""

from vico.sim.animation.clips import LONGEST_BLEND, Hands
from vico.sim.animation.motions import CLIPS, STYLE, clip_index, stride_length, style_of
from vico.sim.animation.posing import (
    Transition,
    free_hands,
    ground_under_feet,
    hand_frames,
    hand_position,
    joint_places,
    pose,
)
from vico.sim.animation.postures import Hold

__all__ = [
    "CLIPS",
    "LONGEST_BLEND",
    "STYLE",
    "Hands",
    "Hold",
    "Transition",
    "clip_index",
    "free_hands",
    "ground_under_feet",
    "hand_frames",
    "hand_position",
    "joint_places",
    "pose",
    "stride_length",
    "style_of",
]
