"""Motions of other programs move our bodies as they moved theirs."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from assets.motions import rigs
from vico.assets.motions import (
    MotionClip,
    import_motion,
    motion_from_smplx,
    read_amass,
    read_bvh,
    read_gltf_motion,
    smplx_of,
)
from vico.assets.motions.clip import joint_positions
from vico.assets.people import Appearance, J, body_of
from vico.errors import InputError, MissingFileError, SchemaError

FRAMES = 5
TURNS = rigs.random_turns(rigs.MIXAMO, FRAMES, seed=1)
ROOT = np.array([0.0, 0.95, 0.0]) + np.linspace(0.0, 1.0, FRAMES)[:, None] * np.array([0.3, 0.0, 1.0])
# Our forward, left and up in the rigs' axes.
AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
BONES = {
    f"{side}_{ours}": (f"{side.title()}{theirs}", f"{side.title()}{end}", f"{side}_{our_end}")
    for side in ("left", "right")
    for ours, theirs, end, our_end in (
        ("hip", "UpLeg", "Leg", "knee"),
        ("knee", "Leg", "Foot", "ankle"),
        ("shoulder", "Arm", "ForeArm", "elbow"),
        ("elbow", "ForeArm", "Hand", "wrist"),
    )
}


def joints() -> Any:
    return body_of(Appearance(), source="procedural").joints.astype(np.float64)


def directions(places: Any, start: int, end: int) -> Any:
    way = places[:, end] - places[:, start]
    return way / np.linalg.norm(way, axis=1, keepdims=True)


def bones_agree(clip: MotionClip, rig: rigs.Rig) -> None:
    """Every limb of ours points where the rig's does, in every frame."""
    index = {name: k for k, (name, _, _) in enumerate(rig)}
    theirs, ours = rigs.places(rig, TURNS, ROOT) @ AXES.T, joint_positions(clip, t_pose())
    for name, (start, end, our_end) in BONES.items():
        np.testing.assert_allclose(
            directions(ours, J[name], J[our_end]), directions(theirs, index[start], index[end]), atol=1e-4
        )


def t_pose() -> Any:
    """Joints with limbs straight along the axes, as the T-pose has them; real bodies' bend a little."""
    straight = joints()
    for side, way in (("left", 1.0), ("right", -1.0)):
        for a, b, axis in (("hip", "knee", -2), ("knee", "ankle", -2), ("shoulder", "elbow", 1), ("elbow", "wrist", 1)):
            start, end = J[f"{side}_{a}"], J[f"{side}_{b}"]
            length = np.linalg.norm(joints()[end] - joints()[start])
            straight[end] = straight[start]
            straight[end, abs(axis)] += length * (way if axis == 1 else -1.0)
    return straight


@pytest.mark.parametrize("rig", [rigs.MIXAMO, rigs.arms_down(rigs.MIXAMO)], ids=["t_pose", "arms_down"])
@pytest.mark.parametrize("unit", [1.0, 100.0])
def test_limbs_point_where_those_of_a_bvh_do(tmp_path: Path, rig: rigs.Rig, unit: float) -> None:
    path = tmp_path / "dance.bvh"
    path.write_text(rigs.bvh(rig, TURNS, ROOT, unit=unit))
    clip = read_bvh(path)
    assert (clip.name, len(clip), clip.rate) == ("dance", FRAMES, pytest.approx(30.0))
    bones_agree(clip, rig)
    moved = clip.position[-1] - clip.position[0]
    assert moved[0] / moved[1] == pytest.approx(1 / 0.3, rel=1e-3)
    assert moved[2] == pytest.approx(0.0, abs=1e-4)
    assert moved[0] == pytest.approx(1.0, rel=0.1)


def test_a_gltf_of_the_same_rig_gives_the_same_motion(tmp_path: Path) -> None:
    (tmp_path / "a.bvh").write_text(rigs.bvh(rigs.MIXAMO, TURNS, ROOT))
    (tmp_path / "a.glb").write_bytes(rigs.glb(rigs.MIXAMO, TURNS, ROOT))
    one, other = import_motion(tmp_path / "a.bvh"), import_motion(tmp_path / "a.glb")
    assert other.name == "dance"
    bones_agree(other, rigs.MIXAMO)
    np.testing.assert_allclose(other.position, one.position, atol=1e-3)
    np.testing.assert_allclose(joint_positions(other, joints()), joint_positions(one, joints()), atol=2e-3)


def test_feet_stand_on_the_ground_where_they_are_lowest(tmp_path: Path) -> None:
    still = np.zeros_like(TURNS)
    high = ROOT + np.array([0.0, 3.0, 0.0])
    (tmp_path / "a.bvh").write_text(rigs.bvh(rigs.MIXAMO, still, high))
    body = joints()
    feet = [J["left_ankle"], J["right_ankle"]]
    placed = joint_positions(read_bvh(tmp_path / "a.bvh"), body)
    np.testing.assert_allclose(placed[:, feet, 2], np.tile(body[feet, 2], (FRAMES, 1)), atol=0.01)


def test_smplx_comes_back_as_it_went() -> None:
    rng = np.random.default_rng(2)
    poses, trans = rng.normal(0.0, 0.5, (7, 165)), rng.normal(0.0, 1.0, (7, 3))
    found = smplx_of(motion_from_smplx(poses, trans, 60.0))
    np.testing.assert_allclose(found["poses"], poses, atol=1e-5)
    np.testing.assert_allclose(found["trans"], trans, atol=1e-5)
    np.testing.assert_allclose(found["pose_hand"], poses[:, 75:], atol=1e-5)
    assert found["mocap_frame_rate"] == 60.0


def test_smplx_s_axes_are_renamed() -> None:
    # In AMASS somebody who stands and looks along -y is turned a quarter about x: y up becomes z up.
    poses = np.zeros((1, 165))
    poses[0, 0] = np.pi / 2
    # About the forward axis (z of SMPL-X) the left arm (along x) goes up.
    poses[0, 3 * J["left_shoulder"] + 2] = np.pi / 2
    body = t_pose()
    placed = joint_positions(motion_from_smplx(poses, np.array([[0.0, 0.0, 0.95]]), 30.0), body)[0]
    up = placed[J["head"]] - placed[0]
    assert up[2] > 0.9 * np.linalg.norm(up)
    toes = placed[J["left_foot"]] - placed[J["left_ankle"]]
    assert toes[1] < -0.5 * np.linalg.norm(toes)
    assert placed[J["left_elbow"]][2] - placed[J["left_shoulder"]][2] > 0.2
    assert placed[J["left_hip"]][0] > placed[J["right_hip"]][0]
    assert placed[0, 2] == pytest.approx(body[0, 2], rel=1e-5)


@pytest.mark.parametrize("width", [165, 156, 72])
def test_amass_files_of_every_model_are_read(tmp_path: Path, width: int) -> None:
    poses = np.zeros((3, width))
    poses[:, 3 * J["left_knee"]] = 0.7
    np.savez(tmp_path / "walk.npz", poses=poses, trans=np.ones((3, 3)), mocap_frame_rate=120.0, betas=np.zeros(10))
    clip = read_amass(tmp_path / "walk.npz")
    assert clip.rate == 120.0
    assert clip.pose[1, J["left_knee"] - 1].tolist() == pytest.approx([0.0, 0.7, 0.0])


def amass_arrays(poses: Any) -> dict[str, Any]:
    parts = {"root_orient": 3, "pose_body": 63, "pose_jaw": 3, "pose_eye": 6, "pose_hand": 90}
    ends = np.cumsum(list(parts.values()))
    return dict(zip(parts, np.split(poses, ends[:-1], axis=1), strict=True))


@pytest.mark.parametrize("name", ["transl", "translation", "smpl_trans"])
def test_a_translation_under_another_usual_name_counts_and_is_told(tmp_path: Path, name: str) -> None:
    poses, trans = np.zeros((3, 156)), np.arange(9.0).reshape(3, 3)
    np.savez(tmp_path / "a.npz", poses=poses, mocap_framerate=30.0, trans=trans)
    np.savez(tmp_path / "b.npz", poses=poses, fps=30, **{name: trans})
    own, other = read_amass(tmp_path / "a.npz"), read_amass(tmp_path / "b.npz")
    np.testing.assert_array_equal(own.position, other.position)
    assert own.rate == other.rate
    assert (own.notes, f"its translation is {name}" in other.notes[0]) == ((), True)


def test_an_archive_that_is_none_is_refused_in_our_own_words(tmp_path: Path) -> None:
    objects = np.array([1, "a", None], dtype=object)
    np.savez(tmp_path / "objects.npz", poses=objects, trans=np.zeros((3, 3)), mocap_framerate=30.0)
    (tmp_path / "junk.npz").write_bytes(b"junk")
    for name, words in (("objects", "one holds Python objects"), ("junk", "is no .npz archive")):
        with pytest.raises(SchemaError, match=words) as refused:
            read_amass(tmp_path / f"{name}.npz")
        assert "pickle" not in str(refused.value)


def test_amass_parts_are_the_pose_they_were_cut_from(tmp_path: Path) -> None:
    poses, trans = np.random.default_rng(4).normal(0.0, 0.3, (3, 165)), np.ones((3, 3))
    np.savez(tmp_path / "whole.npz", poses=poses, trans=trans, mocap_frame_rate=60.0)
    np.savez(tmp_path / "parts.npz", trans=trans, mocap_frame_rate=np.array([60.0]), **amass_arrays(poses))
    whole, parts = read_amass(tmp_path / "whole.npz"), read_amass(tmp_path / "parts.npz")
    np.testing.assert_array_equal(parts.pose, whole.pose)
    np.testing.assert_array_equal(parts.orientation, whole.orientation)
    np.testing.assert_array_equal(parts.position, whole.position)


def test_hands_and_face_rest_in_an_amass_file_of_the_body_alone(tmp_path: Path) -> None:
    arrays = amass_arrays(np.random.default_rng(4).normal(0.0, 0.3, (3, 165)))
    body = {name: arrays[name] for name in ("root_orient", "pose_body")}
    np.savez(tmp_path / "a.npz", trans=np.ones((3, 3)), mocap_frame_rate=60.0, **body)
    clip = read_amass(tmp_path / "a.npz")
    assert clip.pose[:, :21].any()
    assert not clip.pose[:, 21:].any()


def test_an_amass_file_without_translation_stays_on_the_spot_and_on_the_ground(tmp_path: Path) -> None:
    upright = np.tile([np.pi / 2, 0.0, 0.0], (3, 1))
    np.savez(tmp_path / "a.npz", root_orient=upright, pose_body=np.zeros((3, 63)), mocap_frame_rate=60.0)
    body = joints()
    placed = joint_positions(read_amass(tmp_path / "a.npz"), body)
    np.testing.assert_allclose(placed[:, J["left_ankle"], 2], body[J["left_ankle"], 2], atol=0.01)
    assert not np.diff(placed, axis=0).any()


class _Trap:
    """Deletes a file when it is unpickled."""

    def __init__(self, victim: Path) -> None:
        self.victim = victim

    def __reduce__(self) -> Any:
        return os.unlink, (str(self.victim),)


def test_nothing_in_an_amass_file_is_unpickled(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("alive")
    trap = np.array(_Trap(victim), dtype=object)
    np.savez(tmp_path / "a.npz", poses=np.zeros((2, 156)), trans=np.zeros((2, 3)), mocap_framerate=30, gender=trap)
    assert len(read_amass(tmp_path / "a.npz")) == 2
    np.savez(tmp_path / "b.npz", poses=trap, trans=np.zeros((2, 3)), mocap_framerate=30)
    with pytest.raises(SchemaError, match="no readable"):
        read_amass(tmp_path / "b.npz")
    with pytest.raises(InputError, match="pickles run code"):
        import_motion(tmp_path / "b.pkl")
    assert victim.read_text() == "alive"


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"poses": np.zeros((0, 156)), "trans": np.zeros((0, 3)), "mocap_framerate": 30}, "has no frame"),
        ({"root_orient": np.zeros((0, 3)), "pose_body": np.zeros((0, 63)), "mocap_framerate": 30}, "has no frame"),
        ({"betas": np.zeros(16), "gender": "male"}, "it holds betas, gender"),
        ({"root_orient": np.zeros((2, 3)), "mocap_framerate": 30}, "it holds root_orient, mocap_framerate"),
        ({"poses": np.zeros((2, 156)), "trans": np.zeros((2, 3))}, "it holds poses, trans"),
        ({"poses": np.zeros((2, 156)), "root_position": np.zeros((2, 3)), "fps": 30}, "no trans, but root_position"),
        ({"root_orient": np.zeros((2, 3)), "pose_body": np.zeros((3, 63)), "mocap_framerate": 30}, r"be \(2, 63\)"),
    ],
)
def test_amass_files_without_a_motion_are_refused_in_a_sentence(tmp_path: Path, arrays: Any, words: str) -> None:
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises((SchemaError, InputError), match=rf"a\.npz: .*{words}"):
        read_amass(tmp_path / "a.npz")


def test_a_motion_comes_back_from_its_file(tmp_path: Path) -> None:
    clip = motion_from_smplx(np.zeros((4, 165)), np.zeros((4, 3)), 30.0, name="stand")
    clip.write(tmp_path / "stand.motion")
    again = import_motion(tmp_path / "stand.motion")
    assert (again.name, again.rate, again.seconds) == ("stand", 30.0, pytest.approx(4 / 30))
    np.testing.assert_array_equal(again.pose, clip.pose)


def _bvh_of(change: Any) -> str:
    return change(rigs.bvh(rigs.MIXAMO, TURNS, ROOT))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: "", "no whole BVH hierarchy"),
        (lambda text: text[: text.index("\n}") - 1], "no whole BVH hierarchy"),
        (lambda text: text.rsplit("\n", 3)[0], "3 of 5 frames"),
        (lambda text: text.replace("OFFSET", "OFFSETS", 1), "line 4"),
        (lambda text: text.replace("Zrotation", "Wrotation", 1), "line 5"),
        (lambda text: text.replace("\n0.0 ", "\nnan ", 1), "no frame of 75 numbers"),
        (lambda text: text.replace("UpLeg", "Tentacle"), "no joint stands for left_hip"),
        (lambda text: text.replace("Frame Time: 0.0", "Frame Time: -0.0"), "line 144: a frame takes -0.0333333 s"),
        (lambda text: text.replace("Frame Time: 0.0", "Frame Time: 0,0"), "line 144: a number has a comma"),
        (lambda text: text.replace("Frame Time: 0.0", "Frame Time: 500.0"), "line 144: a frame takes 500.033 s"),
        (lambda text: text.replace("Frame Time: 0.0", "Frame Time: soon 0.0"), "line 144: .* gives no seconds"),
        (lambda text: text.replace("OFFSET 0.0 0.0", "OFFSET 0,0 0.0", 1), "line 4: a number has a comma"),
        (lambda text: text.replace("\n0.0 ", "\n0,0 ", 1), "line 145: a number has a comma"),
        (
            lambda text: text[: text.index("Frames")] + "Frames: 0\nFrame Time: 0.1\n",
            "line 143: the motion has no frame",
        ),
        (lambda text: text[: text.index("Frames")], "no lines Frames: and Frame Time:"),
    ],
)
def test_broken_bvh_is_refused_in_a_sentence(tmp_path: Path, change: Any, words: str) -> None:
    path = tmp_path / "a.bvh"
    path.write_text(_bvh_of(change))
    with pytest.raises((SchemaError, InputError), match=words):
        read_bvh(path)


@pytest.mark.parametrize(("typed", "rate"), [("33.3333", 30.0), ("8.3333", 120.0), ("100", 10.0), ("1", 1000.0)])
def test_a_bvh_s_frame_times_in_milliseconds_are_read_and_told(tmp_path: Path, typed: str, rate: float) -> None:
    path = tmp_path / "a.bvh"
    path.write_text(re.sub(r"Frame Time: \S+", f"Frame Time: {typed}", _bvh_of(str)))
    clip = read_bvh(path)
    assert clip.rate == pytest.approx(rate, rel=1e-4)
    assert "read as milliseconds" in clip.notes[0]


def test_a_bvh_s_frame_times_in_seconds_are_what_they_say(tmp_path: Path) -> None:
    path = tmp_path / "a.bvh"
    for typed, rate in (("0.5", 2.0), ("0.04 s", 25.0), ("0.001", 1000.0)):
        path.write_text(re.sub(r"Frame Time: \S+", f"Frame Time: {typed}", _bvh_of(str)))
        clip = read_bvh(path)
        assert (clip.rate, clip.notes) == (pytest.approx(rate), ())


def _round(document: dict[str, Any]) -> None:
    document["nodes"][5]["children"] = [0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_round, "ancestors|two parents"),
        (lambda d: d.pop("animations"), "no animation"),
        (lambda d: d["buffers"][0].update(uri="../../etc/passwd"), "outside its folder"),
        (lambda d: d["buffers"][0].update(uri="http://example.org/a.bin"), "outside its folder"),
        (lambda d: d["accessors"][0].update(count=10**12), "claims"),
        (lambda d: d["accessors"][0].update(count=2), "no ascending times"),
        (lambda d: d["animations"][0]["channels"].clear(), "moves no joint"),
        (lambda d: [node.update(name="bone") for node in d["nodes"]], "no joint stands for"),
    ],
)
def test_broken_gltf_is_refused_in_a_sentence(tmp_path: Path, change: Any, words: str) -> None:
    path = tmp_path / "a.glb"
    path.write_bytes(rigs.glb(rigs.MIXAMO, TURNS, ROOT, change=change))
    with pytest.raises((SchemaError, InputError), match=words):
        read_gltf_motion(path)


def test_other_animations_are_chosen_by_name(tmp_path: Path) -> None:
    path = tmp_path / "a.glb"
    path.write_bytes(rigs.glb(rigs.MIXAMO, TURNS, ROOT))
    assert len(read_gltf_motion(path, animation="dance")) == FRAMES
    with pytest.raises(SchemaError, match="it has dance"):
        read_gltf_motion(path, animation="walk")


@pytest.mark.parametrize(
    ("name", "content"),
    [("a.npz", b"PK\x03\x04"), ("a.npz", b""), ("a.glb", b"glTF"), ("a.motion", b"x"), ("a.bvh", b"\xff\xfe\x00")],
)
def test_files_that_are_no_motion_are_refused(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(SchemaError, match=name):
        import_motion(tmp_path / name)
    with pytest.raises(MissingFileError):
        import_motion(tmp_path / f"none{Path(name).suffix}")


def test_shapes_that_are_no_smplx_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\(t, 165\)"):
        motion_from_smplx(np.zeros((3, 100)), np.zeros((3, 3)), 30.0)
    with pytest.raises(InputError, match="not finite"):
        motion_from_smplx(np.full((3, 165), np.nan), np.zeros((3, 3)), 30.0)
    with pytest.raises(InputError, match="position has shape"):
        motion_from_smplx(np.zeros((3, 165)), np.zeros((3, 2)), 30.0)
    with pytest.raises(InputError, match="convert FBX"):
        import_motion(tmp_path / "a.fbx")
    np.savez(tmp_path / "a.npz", poses=np.array([object()], dtype=object), trans=np.zeros(3), mocap_frame_rate=1.0)
    with pytest.raises(SchemaError, match=r"a\.npz"):
        read_amass(tmp_path / "a.npz")
