import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vico.assets.people import (
    BAGS,
    BOTTOMS,
    HAIR,
    HATS,
    JOINTS,
    OVERS,
    PARENTS,
    SHOES,
    TOPS,
    Appearance,
    J,
    anny,
    body_of,
    random_appearance,
)
from vico.assets.people.bake import cut, decimate, open_loops
from vico.assets.people.model import dress_for_weather
from vico.errors import InputError, MissingExtraError
from vico.seeds import rng

SOURCES = [
    "procedural",
    pytest.param(
        "anny",
        marks=pytest.mark.skipif(not anny.available(), reason="no baked bodies: vico assets install people"),
    ),
]
CROWD = [random_appearance(rng(0, "crowd", k)) for k in range(12)]


def test_the_skeleton_has_smpl_x_s_55_joints_children_after_parents() -> None:
    assert len(JOINTS) == len(PARENTS) == 55
    assert all(PARENTS[j] < j for j in range(55))
    assert (JOINTS[:3], JOINTS[21:26], JOINTS[54]) == (
        ("pelvis", "left_hip", "right_hip"),
        ("right_wrist", "jaw", "left_eye", "right_eye", "left_index1"),
        "right_thumb3",
    )


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("number", range(len(CROWD)))
def test_a_body_is_a_sound_mesh(source: str, number: int) -> None:
    body = body_of(CROWD[number], source=source)  # type: ignore[arg-type]
    assert np.isfinite(body.vertices).all()
    assert body.triangles.min() >= 0
    assert body.triangles.max() < len(body.vertices)
    np.testing.assert_allclose(np.linalg.norm(body.normals, axis=1), 1, atol=1e-3)
    np.testing.assert_allclose(body.weights.sum(1), 1, atol=1e-5)
    assert (np.diff(body.weights, axis=1) <= 1e-6).all()


@pytest.mark.parametrize("source", SOURCES)
def test_a_body_stands_on_the_floor_and_is_as_tall_as_asked(source: str) -> None:
    for look in CROWD:
        body = body_of(replace(look, hair="bald", age=min(look.age, 29)), source=source)  # type: ignore[arg-type]
        assert body.vertices[:, 2].min() == pytest.approx(0, abs=0.01)
        assert body.vertices[:, 2].max() == pytest.approx(look.height, abs=0.015)


@pytest.mark.parametrize("source", SOURCES)
def test_faces_look_along_x_and_the_left_hand_is_on_the_left(source: str) -> None:
    body = body_of(CROWD[0], source=source)  # type: ignore[arg-type]
    eyes = body.rest_joints[[J["left_eye"], J["right_eye"]]]
    assert (eyes[:, 0] > body.rest_joints[J["head"], 0]).all()
    assert body.rest_joints[J["left_wrist"], 1] > 0.2 > -0.2 > body.rest_joints[J["right_wrist"], 1]


@pytest.mark.parametrize("source", SOURCES)
def test_in_the_t_pose_arms_lie_along_y_and_legs_along_z(source: str) -> None:
    joints = body_of(CROWD[1], source=source).joints.astype(float)  # type: ignore[arg-type]
    for side in ("left", "right"):
        arm = joints[J[f"{side}_wrist"]] - joints[J[f"{side}_shoulder"]]
        leg = joints[J[f"{side}_ankle"]] - joints[J[f"{side}_hip"]]
        np.testing.assert_allclose(np.abs(arm / np.linalg.norm(arm)), (0, 1, 0), atol=1e-4)
        np.testing.assert_allclose(leg / np.linalg.norm(leg), (0, 0, -1), atol=1e-4)


@pytest.mark.parametrize("source", SOURCES)
def test_a_heavy_build_has_a_deeper_waist(source: str) -> None:
    plain = Appearance(top="t-shirt")
    waist = {}
    for name, look in {
        "slim": replace(plain, build=0.0),
        "heavy": replace(plain, build=1.0),
    }.items():
        body = body_of(look, source=source, detail="full")  # type: ignore[arg-type]
        middle = np.abs(body.vertices[:, 2] - 0.62 * look.height) < 0.02 * look.height
        trunk = middle & np.isin(body.weight_joints[:, 0], [J["pelvis"], J["spine1"], J["spine2"], J["spine3"]])
        waist[name] = np.ptp(body.vertices[trunk, 0])
    assert waist["heavy"] > 1.1 * waist["slim"]


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(
    ("field", "choices"),
    [
        ("hair", HAIR),
        ("top", TOPS),
        ("bottom", BOTTOMS),
        ("shoes", SHOES),
        ("hat", HATS),
        ("over", OVERS),
        ("bag", BAGS),
    ],
)
def test_every_choice_of_hair_and_clothes_makes_a_different_body(
    source: str, field: str, choices: tuple[str, ...]
) -> None:
    def fingerprint(choice: str) -> bytes:
        body = body_of(replace(Appearance(age=50), **{field: choice}), source=source)  # type: ignore[arg-type]
        return body.vertices.tobytes() + body.colour.tobytes()

    assert len({fingerprint(choice) for choice in choices}) == len(choices)


@pytest.mark.parametrize("source", SOURCES)
def test_the_younger_the_larger_the_head(source: str) -> None:
    eyes = []
    for age, height in ((5, 1.1), (8, 1.28), (12, 1.5), (30, 1.75)):
        body = body_of(Appearance(age=age, height=height), source=source, detail="full")  # type: ignore[arg-type]
        eyes.append(float(body.joints[J["left_eye"], 2]) / body.height)
    assert eyes == sorted(eyes)
    assert eyes[0] < 0.922 < 0.93 < eyes[-1]


@pytest.mark.parametrize("source", SOURCES)
def test_glasses_stand_before_eyes_and_cheeks_all_around(source: str) -> None:
    for look in (Appearance(1.0, 60, glasses=True, build=0.9), Appearance(0.0, 9, 1.3, glasses=True)):
        body = body_of(look, source=source, detail="full")  # type: ignore[arg-type]
        frame = (body.colour == (30, 28, 30)).all(1) & (body.vertices[:, 2] > 0.8 * look.height)
        eyes = body.rest_joints[[J["left_eye"], J["right_eye"]]]
        rims = body.vertices[frame & (body.vertices[:, 0] > eyes[:, 0].min())]
        assert np.ptp(rims[:, 2]) > 0.12 * (look.height - eyes[0, 2]) / 0.475
        own = body.vertices[~frame & (body.weight_joints[:, 0] == J["head"])]
        near = np.linalg.norm(own[:, None, 1:] - rims[None, :, 1:], axis=2) < 0.004
        # The nose passes between the lenses.
        near &= (np.abs(own[:, 1]) > 0.02)[:, None]
        ahead = np.where(near, own[:, None, 0] - rims[None, :, 0], -1.0)
        assert ahead.max() < 0.003


@pytest.mark.parametrize("source", SOURCES)
def test_cut_hair_stays_on_the_neck(source: str) -> None:
    colour = (90, 200, 90)
    for age, height in ((8, 1.28), (40, 1.75)):
        look = Appearance(1.0, age, height, hair="short", hair_colour=colour)
        body = body_of(look, source=source, detail="full")  # type: ignore[arg-type]
        green = body.colour[:, 1] > 1.5 * body.colour[:, 0].astype(float)
        eye = body.rest_joints[J["left_eye"], 2]
        low = body.vertices[green & (body.vertices[:, 2] < eye - 0.02)]
        skin = body.vertices[~green & (np.abs(body.vertices[:, 2] - eye) < 0.2)]
        assert len(low) > 0
        away = np.linalg.norm(low[:, None] - skin[None], axis=2).min(1)
        assert away.max() < 0.035


@pytest.mark.skipif(not anny.available(), reason="no baked bodies: vico assets install people")
@pytest.mark.parametrize("fine", [True, False])
def test_skin_lies_deep_under_a_top(fine: bool) -> None:
    """Where shoulders bend, the cloth and the skin under it part ways by up to a centimetre."""
    look = Appearance(top="jumper", top_colour=(0, 255, 0), skin=(220, 150, 110))
    body = anny.body(look, fine=fine)
    cloth = (body.colour == look.top_colour).all(axis=1)
    low = body.vertices[:, 2] < body.joints[J["neck"], 2] - 0.1
    skin = low & (body.colour == look.skin).all(axis=1) & (np.abs(body.vertices[:, 1]) < 0.2)
    apart = body.vertices[skin][:, None] - body.vertices[cloth][None]
    nearest = np.argmin((apart**2).sum(axis=2), axis=1)
    depth = -(apart[np.arange(len(nearest)), nearest] * body.normals[cloth][nearest]).sum(axis=1)
    assert len(depth) > 10
    assert depth.min() > 0.012


def test_an_apron_goes_with_the_thighs_below_it() -> None:
    colour = (1, 200, 3)
    body = body_of(Appearance(over="apron", over_colour=colour, bottom="trousers"))
    apron = np.flatnonzero((np.round(body.colour) == colour).all(axis=1))
    low = apron[body.vertices[apron, 2] < body.rest_joints[J["left_knee"], 2] + 0.25]
    # Bodies made without the downloaded meshes have 14.
    assert len(low) >= 14
    left, right = (
        np.where(body.weight_joints[low] == J[side], body.weights[low], 0.0).sum(axis=1)
        for side in ("left_hip", "right_hip")
    )
    assert (left + right).min() > 0.8
    # Each side with its own.
    aside = body.vertices[low, 1]
    assert left[aside > 0.06].min() > 0.8
    assert right[aside < -0.06].min() > 0.8


def test_people_dress_for_the_weather() -> None:
    summer = Appearance(top="t-shirt", bottom="shorts", shoes="sandals")
    snow = dress_for_weather(summer, -5.0, snow=1.0)
    assert (snow.top, snow.bottom, snow.shoes, snow.hat) == ("coat", "jeans", "boots", "beanie")
    assert dress_for_weather(summer, 25.0) == summer
    assert dress_for_weather(summer, 17.0, rain=2.0).top == "jacket"
    assert dress_for_weather(Appearance(top="coat", age=80), 28.0).top == "t-shirt"
    builder = Appearance(top="hoodie", over="vest", hat="hard hat")
    assert dress_for_weather(builder, -5.0).hat == "hard hat"


def test_an_appearance_survives_json() -> None:
    for look in CROWD:
        assert Appearance.from_dict(look.to_dict()) == look


def test_an_unknown_field_is_named() -> None:
    with pytest.raises(InputError, match="unknown field 'monocle'"):
        Appearance.from_dict({"monocle": True})


@pytest.mark.parametrize(("field", "value"), [("height", 3.0), ("gender", 2), ("top", "toga"), ("ancestry", (0, 0, 0))])
def test_an_impossible_look_is_refused_with_its_field(field: str, value: object) -> None:
    with pytest.raises(InputError, match=field):
        Appearance(**{field: value})  # type: ignore[arg-type]


def test_a_body_of_data_that_are_not_there_says_what_to_type(tmp_path: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VICO_CACHE", str(tmp_path))
    with pytest.raises(MissingExtraError, match="vico assets install people"):
        body_of(CROWD[0], source="anny")


def test_without_data_the_best_body_is_our_own(tmp_path: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VICO_CACHE", str(tmp_path))
    np.testing.assert_array_equal(body_of(CROWD[0]).vertices, body_of(CROWD[0], source="procedural").vertices)


@pytest.mark.parametrize("detail", ["full", "light"])
def test_the_same_look_gives_the_same_bytes_in_a_fresh_process(detail: str, tmp_path: Path) -> None:
    program = (
        "import hashlib; from vico.assets.people import *; from vico.seeds import rng;"
        f"b = body_of(random_appearance(rng(0, 'crowd', 3)), source='procedural', detail={detail!r});"
        "print(hashlib.sha256(b.vertices.tobytes() + b.normals.tobytes() + b.colour.tobytes()).hexdigest())"
    )
    runs = set()
    for k in range(2):
        cache = os.environ | {"VICO_CACHE": str(tmp_path / str(k))}
        runs.add(subprocess.run([sys.executable, "-c", program], capture_output=True, check=True, env=cache).stdout)
    assert len(runs) == 1


def grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.meshgrid(np.arange(n, dtype=float), np.arange(n, dtype=float), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)])
    faces = []
    for i in range(n - 1):
        for j in range(n - 1):
            a = i * n + j
            faces += [(a, a + n, a + n + 1), (a, a + n + 1, a + 1)]
    return points, np.array(faces)


def area(points: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return float(np.cross(b - a, c - a)[:, 2].sum() / 2)


def test_cutting_keeps_exactly_the_positive_side() -> None:
    from scipy.sparse import identity

    points, triangles = grid(5)
    rows, left = cut(identity(25, format="csr"), triangles, points[:, 0] - 1.3)
    assert area(rows @ points, left) == pytest.approx(4 * 2.7)


def test_thinning_a_flat_sheet_keeps_its_outline_and_area() -> None:
    points, triangles = grid(12)
    kept, left = decimate(points, triangles, 30, np.ones(len(points)))
    assert len(kept) <= 30
    assert area(points[kept], left) == pytest.approx(121, rel=0.02)
    assert len(open_loops(left)) >= 4
