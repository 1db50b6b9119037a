"""BVH files and joints' names as many programs spell them are read as one and the same motion."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from assets.motions import rigs
from vico.assets.motions import MotionClip, read_bvh
from vico.assets.motions.retargeting import Skeleton, joints_by_name

TURNS = rigs.random_turns(rigs.MIXAMO, 3, seed=5)
TEXT = rigs.bvh(rigs.MIXAMO, TURNS, np.tile([0.0, 0.95, 0.0], (3, 1)))
NAMES = [name for name, _, _ in rigs.MIXAMO]
#: The parts of `NAMES` in the words of other programs.
PROGRAMS = {
    "blender": "spine spine.001 spine.002 spine.003 spine.004 spine.006 thigh.@ shin.@ foot.@ toe.@ shoulder.@ "
    "upper_arm.@ forearm.@ hand.@ f_index.01.@",
    "blender_deform": "DEF-spine DEF-spine.001 DEF-spine.002 DEF-spine.003 DEF-spine.004 DEF-spine.006 DEF-thigh.@ "
    "DEF-shin.@ DEF-foot.@ DEF-toe.@ DEF-shoulder.@ DEF-upper_arm.@ DEF-forearm.@ DEF-hand.@ DEF-f_index.01.@",
    "blender_in_threejs": "hips spine spine001 spine002 neck head thigh@ shin@ foot@ toe@ shoulder@ upper_arm@ "
    "forearm@ hand@ index01@",
    "unreal": "pelvis spine_01 spine_02 spine_03 neck_01 head thigh_@ calf_@ foot_@ ball_@ clavicle_@ upperarm_@ "
    "lowerarm_@ hand_@ index_01_@",
    "biped": "Bip01_Pelvis Bip01_Spine Bip01_Spine1 Bip01_Spine2 Bip01_Neck Bip01_Head Bip01_@_Thigh Bip01_@_Calf "
    "Bip01_@_Foot Bip01_@_Toe0 Bip01_@_Clavicle Bip01_@_UpperArm Bip01_@_Forearm Bip01_@_Hand Bip01_@_Finger1",
    "cmu": "root lowerback upperback thorax lowerneck head @femur @tibia @foot @toes @clavicle @humerus @radius @wrist "
    "@index1",
    "rokoko": "Hips Spine1 Spine2 Spine3 Neck Head @@Thigh @@Shin @@Foot @@Toe @@Shoulder @@Arm @@ForeArm @@Hand "
    "@@HandIndex1",
    "xsens": "Pelvis L5 L3 T8 Neck Head @@UpperLeg @@LowerLeg @@Foot @@Toe @@Shoulder @@UpperArm @@ForeArm @@Hand "
    "@@Index1",
    "daz": "pelvis abdomenLower abdomenUpper chestUpper neckLower head @ThighBend @Shin @Foot @Toe @Collar @ShldrBend "
    "@ForearmBend @Hand @Index1",
    "optitrack": "Bob_Hip Bob_Ab Bob_Spine2 Bob_Chest Bob_Neck Bob_Head Bob_@Thigh Bob_@Shin Bob_@Foot Bob_@Toe "
    "Bob_@Shoulder Bob_@UArm Bob_@FArm Bob_@Hand Bob_@Index1",
    "vrm": "J_Bip_C_Hips J_Bip_C_Spine J_Bip_C_Chest J_Bip_C_UpperChest J_Bip_C_Neck J_Bip_C_Head J_Bip_@_UpperLeg "
    "J_Bip_@_LowerLeg J_Bip_@_Foot J_Bip_@_ToeBase J_Bip_@_Shoulder J_Bip_@_UpperArm J_Bip_@_LowerArm J_Bip_@_Hand "
    "J_Bip_@_Index1",
    "deepmotion": "hips_JNT spine_JNT spine1_JNT spine2_JNT neck_JNT head_JNT @_upleg_JNT @_leg_JNT @_foot_JNT "
    "@_toebase_JNT @_shoulder_JNT @_arm_JNT @_forearm_JNT @_hand_JNT @_handIndex1_JNT",
}
#: Programs that write sides as small letters.
SMALL = ("unreal", "cmu", "daz", "deepmotion")


def spelt(program: str) -> dict[str, str]:
    """Our rig's names in a program's words."""
    parts = [name for name in NAMES if not name.startswith("Right")]
    found = {}
    for part, word in zip(parts, PROGRAMS[program].split(), strict=True):
        for side in ("Left", "Right"):
            letter = side[0].lower() if program in SMALL else side[0]
            found[part.replace("Left", side)] = word.replace("@@", side).replace("@", letter)
    return found


def read(path: Path, text: str) -> MotionClip:
    path.write_text(text, encoding="utf-8")
    return read_bvh(path)


def renamed(name_of: Callable[[str], str]) -> str:
    return re.sub(r"mixamorig:(\w+)", lambda match: name_of(match[1]), TEXT)


def same(one: MotionClip, other: MotionClip) -> None:
    np.testing.assert_array_equal(one.pose, other.pose)
    np.testing.assert_array_equal(one.position, other.position)


@pytest.mark.parametrize(
    "prefix",
    [
        "mixamorig9_", "mixamorig9", "mixamorig9:", "mixamorig_", "mixamorig", "mixamorig12", "Mixamorig1:",
        "Armature|mixamorig:", "Armature|", "Armature_mixamorig9_", "Armature/", "Armature", "Character1_", "A:b:", "",
    ],
)  # fmt: skip
def test_prefixes_of_joints_do_not_matter(tmp_path: Path, prefix: str) -> None:
    same(read(tmp_path / "a.bvh", renamed(lambda name: prefix + name)), read(tmp_path / "b.bvh", TEXT))


def test_the_numbers_that_a_program_gives_all_nodes_do_not_matter(tmp_path: Path) -> None:
    numbered = renamed(lambda name: f"mixamorig:{name}_0{NAMES.index(name)}")
    same(read(tmp_path / "a.bvh", numbered), read(tmp_path / "b.bvh", TEXT))


@pytest.mark.parametrize("program", PROGRAMS)
def test_joints_are_found_by_the_words_of_many_programs(tmp_path: Path, program: str) -> None:
    names = spelt(program)
    wanted = read(tmp_path / "b.bvh", TEXT)
    found = read(tmp_path / "a.bvh", renamed(lambda name: names[name]))
    if program.startswith(
        "blender"
    ):  # its chain is split into spine and neck elsewhere, or its fingers named otherwise
        np.testing.assert_array_equal(found.orientation, wanted.orientation)
    np.testing.assert_allclose(
        found.pose[:, [0, 1, 3, 4, 15, 16, 17, 18]], wanted.pose[:, [0, 1, 3, 4, 15, 16, 17, 18]], atol=1e-6
    )


def test_targets_of_a_rig_stand_for_no_joint() -> None:
    names = ["root", *(spelt("unreal")[name] for name in NAMES), "ik_foot_root", "ik_foot_l", "ik_hand_r"]
    skeleton = Skeleton(tuple(names), np.arange(-1, len(names) - 1), np.zeros((len(names), 3)))
    found = {ours: names[k] for ours, k in joints_by_name(skeleton, source="a").items()}
    assert (found["pelvis"], found["left_ankle"], found["right_wrist"]) == ("pelvis", "foot_l", "hand_r")


@pytest.mark.parametrize(
    "change",
    [
        lambda text: re.sub(r"\n\t*\{", " {", text),
        lambda text: re.sub(r"\n(\t*)\{\n\t*", r"\n\1{ ", text),
        lambda text: re.sub(r"\n\t*\}", " }", text),
        lambda text: re.sub(r"\n\t*CHANNELS", " CHANNELS", text),
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("\n", "\n\n"),
        lambda text: text.replace(" ", "\t"),
        lambda text: "\ufeff" + text,
        lambda text: re.sub(r"[XYZ](position|rotation)", lambda match: match[0].lower(), text),
        lambda text: re.sub(r"([XYZ])(pos|rot)\w+", r"\1_\2", text),
        lambda text: re.sub("HIERARCHY|ROOT|JOINT|OFFSET|CHANNELS|MOTION", lambda match: match[0].title(), text),
        lambda text: re.sub("HIERARCHY|End Site|ROOT|JOINT|Frame", lambda match: match[0].lower(), text),
        lambda text: text.replace("End Site", "END SITE").replace("Frames:", "FRAMES :"),
        lambda text: text.replace("Frames: ", "Frames:").replace("Frame Time: ", "Frame Time:"),
        lambda text: re.sub(r"\n[-\d].*", lambda match: match[0].replace(" ", ", "), text),
        lambda text: text.replace("}\nMOTION", "}\nROOT Sword\n{\nOFFSET 0 0 0\nCHANNELS 0\n}\nMOTION"),
    ],
)  # fmt: skip
def test_a_bvh_is_read_however_its_program_sets_it(tmp_path: Path, change: Callable[[str], str]) -> None:
    assert change(TEXT) != TEXT
    same(read(tmp_path / "a.bvh", change(TEXT)), read(tmp_path / "b.bvh", TEXT))


def test_smpl_s_foot_is_not_its_ankle() -> None:
    names = ["Pelvis", "Head", "L_Hip", "L_Knee", "L_Ankle", "L_Foot", "L_Shoulder", "L_Elbow"]
    names += [name.replace("L_", "R_") for name in names if name.startswith("L_")]
    skeleton = Skeleton(tuple(names), np.arange(-1, len(names) - 1), np.zeros((len(names), 3)))
    found = {ours: names[k] for ours, k in joints_by_name(skeleton, source="a").items()}
    assert (found["left_ankle"], found["left_foot"]) == ("L_Ankle", "L_Foot")
