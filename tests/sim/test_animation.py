import subprocess
import sys
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from vico.assets.people import J, SkinnedBody, body_of, random_appearance
from vico.errors import InputError
from vico.render.skinning import BodyBatch, batch_bodies, skin
from vico.seeds import rng
from vico.sim.animation import (
    CLIPS,
    LONGEST_BLEND,
    Transition,
    clip_index,
    ground_under_feet,
    hand_frames,
    hand_position,
    pose,
    stride_length,
    style_of,
)
from vico.sim.animation.motions import pace_of_step
from vico.sim.animation.postures import TURN_CYCLE

LOOKS = [random_appearance(rng(5, "walker", k)) for k in range(6)]
N = len(LOOKS)


# Not while tests are collected: what makes bodies would be compiled then.
@cache
def bodies() -> list[SkinnedBody]:
    return [body_of(look, source="procedural") for look in LOOKS]


@cache
def crowd() -> BodyBatch:
    return batch_bodies(bodies(), range(1, N + 1))


@cache
def styles() -> NDArray[np.void]:
    each = enumerate(zip(bodies(), LOOKS, strict=True))
    return np.stack([style_of(b, rng(5, "manner", k), age=look.age) for k, (b, look) in each])


def posed(clip: str, phase: float, speed: float = 0.0, x: float | NDArray[np.float64] = 0.0) -> NDArray[np.float32]:
    """Everybody's vertices in one pose, at x."""
    rotations, offsets = pose(np.full(N, clip_index(clip)), np.full(N, phase), np.full(N, speed), styles())
    positions = np.zeros((N, 3))
    positions[:, 0] = x
    return skin(crowd(), rotations, offsets, positions, np.zeros(N))[0]


def feet(person: int, side: str) -> NDArray[np.int64]:
    """Vertices of a shoe's sole."""
    first, last = crowd().starts[person], crowd().starts[person + 1]
    own = np.isin(crowd().weight_joints[first:last, 0], [J[f"{side}_ankle"], J[f"{side}_foot"]])
    return first + np.flatnonzero(own & (crowd().vertices[first:last, 2] < 0.03))


@pytest.mark.parametrize(("clip", "speed"), [("walk", 0.3), ("walk", 1.0), ("walk", 1.8), ("carry", 1.0), ("run", 2.5)])
def test_a_planted_foot_stays_within_half_a_centimetre_while_the_body_moves_on(clip: str, speed: float) -> None:
    stride = stride_length(np.full(N, clip_index(clip)), np.full(N, speed), styles()["height"])
    # The left foot is flat on the ground in this part of its stance.
    duty = 0.36 if clip == "run" else 0.62
    start, end = 0.2 * duty, 0.5 * duty
    before, after = (posed(clip, p, speed, x=p * stride) for p in (start, end))
    travelled = (end - start) * stride.min()
    assert travelled > 0.06
    for person in range(N):
        sole = feet(person, "left")
        assert np.linalg.norm(after[sole] - before[sole], axis=1).max() < 0.005


@pytest.mark.parametrize(
    ("clip", "speed"),
    [
        ("walk", 0.3),
        ("walk", 1.0),
        ("walk", 1.8),
        ("run", 2.5),
        ("idle", 0.0),
        ("turn", 0.0),
        ("pick", 0.0),
        ("sit", 0.0),
        ("sleep", 0.0),
    ],
)
def test_nobody_sinks_more_than_a_centimetre_into_the_ground(clip: str, speed: float) -> None:
    lowest = min(posed(clip, p, speed)[:, 2].min() for p in np.linspace(0, 1, 25))
    assert lowest > -0.01


@pytest.mark.parametrize("clip", ["idle", "talk", "wave", "walk", "carry", "drink"])
def test_somebody_standing_or_walking_always_touches_the_ground(clip: str) -> None:
    for phase in np.linspace(0, 1, 25):
        vertices = posed(clip, phase, 1.0 if clip in ("walk", "carry") else 0.0)
        lows = [vertices[crowd().starts[i] : crowd().starts[i + 1], 2].min() for i in range(N)]
        assert max(lows) < 0.012


def test_both_feet_leave_the_ground_when_running() -> None:
    lows = [posed("run", p, 2.5)[:, 2].min() for p in np.linspace(0, 1, 40)]
    assert max(lows) > 0.01


@pytest.mark.parametrize("clip", CLIPS)
def test_a_cycle_closes(clip: str) -> None:
    speed = {"walk": 1.2, "carry": 1.0, "run": 2.5}.get(clip, 0.0)
    np.testing.assert_allclose(posed(clip, 0.0, speed), posed(clip, 1.0 - 1e-7, speed), atol=2e-3)


@pytest.mark.parametrize("clip", CLIPS)
def test_motion_is_smooth(clip: str) -> None:
    speed = {"walk": 1.2, "carry": 1.0, "run": 2.5}.get(clip, 0.0)
    frames = np.array([posed(clip, p, speed) for p in np.linspace(0, 1, 101)])
    # A hundredth of a cycle takes at least 7 ms when running: nothing moves faster than 14 m/s.
    assert np.abs(np.diff(frames, axis=0)).max() < 0.12


@pytest.mark.parametrize("clip", CLIPS)
def test_limbs_keep_their_length_and_nothing_is_nan(clip: str) -> None:
    rotations, offsets = pose(np.full(N, clip_index(clip)), np.linspace(0, 0.9, N), np.full(N, 1.0), styles())
    assert np.isfinite(rotations).all()
    assert np.isfinite(offsets).all()
    assert np.linalg.norm(rotations, axis=2).max() <= np.pi + 1e-5


@pytest.mark.parametrize("clip", ["walk", "run", "sit", "idle", "pick", "ride_bike"])
def test_knees_bend_backward_only(clip: str) -> None:
    for phase in np.linspace(0, 1, 20):
        rotations, _ = pose(np.full(N, clip_index(clip)), np.full(N, phase), np.full(N, 1.5), styles())
        knees = rotations[:, [J["left_knee"], J["right_knee"]], 1]
        assert knees.min() > -0.05


def test_arms_swing_against_the_legs() -> None:
    rotations, offsets = pose(np.full(N, clip_index("walk")), np.zeros(N), np.full(N, 1.2), styles())
    palms = hand_frames(crowd().joints, rotations, offsets)[:, :, :3, 3]
    # At phase 0 the left heel strikes ahead, so the right hand is ahead.
    assert (palms[:, 1, 0] > palms[:, 0, 0]).all()


def test_a_hand_that_reaches_is_ahead_and_a_hand_that_picks_is_low() -> None:
    for clip, axis, low, high in (("reach", 0, 0.40, 0.9), ("pick", 2, 0.0, 0.45), ("drink", 2, 1.1, 2.0)):
        for person in range(N):
            rotations, offsets = pose(
                np.array([clip_index(clip)]), np.array([0.5]), np.zeros(1), styles()[person : person + 1]
            )
            place = hand_position(rotations[0], offsets[0], bodies()[person], 1)
            scale = bodies()[person].height / 1.72
            assert low * scale < place[axis] < high * scale


def test_seats_are_at_the_height_of_chairs() -> None:
    vertices = posed("sit", 0.0)
    for person in range(N):
        own = slice(crowd().starts[person], crowd().starts[person + 1])
        hips = np.isin(crowd().weight_joints[own, 0], [J["pelvis"]])
        assert 0.28 < np.quantile(vertices[own][hips, 2], 0.02) < 0.50


def test_the_pelvis_bobs_by_centimetres_at_a_walk() -> None:
    heights = np.array(
        [
            pose(np.full(N, clip_index("walk")), np.full(N, p), np.full(N, 1.3), styles())[1][:, 2]
            for p in np.linspace(0, 1, 50)
        ]
    )
    assert np.ptp(heights, axis=0).min() > 0.02
    assert np.ptp(heights, axis=0).max() < 0.08


def test_stride_grows_with_speed_and_stature() -> None:
    walk = clip_index("walk")
    slow, quick, tall = stride_length(walk, np.array([0.5, 1.5, 1.5]), np.array([1.7, 1.7, 1.9]))
    assert slow < quick < tall
    assert 1.2 < stride_length(walk, 1.0, 1.72) < 1.35
    assert np.isinf(stride_length(clip_index("sit"), 0.0, 1.7))


def test_people_move_in_manners_of_their_own() -> None:
    same = np.stack([style_of(bodies()[0], rng(5, "manner", k)) for k in range(5)])
    rotations, _ = pose(np.full(5, clip_index("walk")), np.full(5, 0.1), np.full(5, 1.2), same)
    assert len({row.tobytes() for row in rotations}) == 5


def test_an_unknown_motion_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match="no motion 'moonwalk'; known are idle, walk"):
        clip_index("moonwalk")


def test_nobody_is_posed_without_fuss() -> None:
    rotations, offsets = pose(np.zeros(0, int), np.zeros(0), np.zeros(0), np.zeros(0, styles().dtype))
    assert rotations.shape == (0, 55, 3)
    assert offsets.shape == (0, 3)


def test_poses_have_the_same_bytes_in_a_fresh_process() -> None:
    program = (
        "import hashlib, numpy as np; from vico.assets.people import Appearance, body_of;"
        "from vico.sim.animation import *;"
        "s = style_of(body_of(Appearance(), source='procedural'))[None];"
        "r, o = pose(np.array([clip_index('walk')]), np.array([0.3]), np.array([1.1]), s);"
        "print(hashlib.sha256(r.tobytes() + o.tobytes()).hexdigest())"
    )
    runs = {subprocess.run([sys.executable, "-c", program], capture_output=True, check=True).stdout for _ in range(2)}
    assert len(runs) == 1


def rises(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """A slope of 8 % that ends at a kerb of 12 cm."""
    return 0.08 * points[:, 0] + np.where(points[:, 0] > 0.4, 0.12, 0.0)


@pytest.mark.parametrize("clip", ["walk", "carry"])
def test_soles_keep_to_slopes_and_kerbs_within_a_centimetre(clip: str) -> None:
    number, speed = np.full(N, clip_index(clip)), np.full(N, 1.2)
    stride = stride_length(number, speed, styles()["height"])
    for x in np.linspace(-1.2, 1.2, 49):
        places = np.column_stack([np.full(N, x), np.zeros(N), rises(np.full((N, 2), x))])
        moves = number, x / stride % 1.0, speed, styles()
        ground = ground_under_feet(*moves, (places, np.zeros(N)), rises)
        rotations, offsets = pose(*moves, ground=ground)
        vertices = skin(crowd(), rotations, offsets, places, np.zeros(N))[0].astype(np.float64)
        for person in range(N):
            lowest = np.inf
            for side in ("left", "right"):
                sole = vertices[feet(person, side)]
                # Where a foot crosses the kerb's edge, whether it is over it is a matter of millimetres.
                sole = sole[np.abs(sole[:, 0] - 0.4) > 0.08]
                if len(sole):
                    lowest = min(lowest, float((sole[:, 2] - rises(sole)).min()))
            assert lowest > -0.01
            assert lowest < 0.012 or abs(x - 0.4) < 0.8


@pytest.mark.parametrize("skew", [0.0, 1.1])  # of the kerb to the way, radians
def test_wherever_feet_meet_a_kerb_hips_do_not_plunge(skew: float) -> None:
    def drops(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.where(np.cos(skew) * points[..., 0] + np.sin(skew) * points[..., 1] > 0.0, 0.0, 0.12)

    frames = np.arange(-1.5, 1.5, 1.2 * 0.025)  # forty a second
    number, speed, away = np.full(N, clip_index("walk")), np.full(N, 1.2), np.zeros(N)
    stride = stride_length(number, speed, styles()["height"])
    for first in np.arange(0.0, 1.0, 0.125):
        pelvis = []
        for x in frames:
            places = np.column_stack([np.full(N, x), away, drops(np.full((N, 2), (x, 0.0)))])
            moves = number, (first + x / stride) % 1.0, speed, styles()
            ground = ground_under_feet(*moves, (places, away), drops)
            pelvis.append(places[:, 2] + pose(*moves, ground=ground)[1][:, 2])
        fallen = np.array(pelvis)[:-8] - np.array(pelvis)[8:]  # within 0.2 s
        assert (fallen < 0.14 * styles()["height"]).all()


def test_on_stairs_each_foot_stands_on_a_tread_and_the_body_rises_with_them() -> None:
    tread, riser = 0.2875, 0.2

    def stairs(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return riser * np.clip(np.floor(points[..., 0] / tread) + 1, 0, 8)

    number, pace = np.full(N, clip_index("walk")), np.array([pace_of_step(tread, tall) for tall in styles()["height"]])
    stride = stride_length(number, pace, styles()["height"])
    pelvis = []
    for x in np.arange(0.6, 1.5, 0.02):
        places = np.column_stack([np.full(N, x), np.zeros(N), np.full(N, riser * x / tread)])
        moves = number, x / stride % 1.0, pace, styles()
        ground = ground_under_feet(*moves, (places, np.zeros(N)), stairs)
        rotations, offsets = pose(*moves, ground=ground)
        pelvis.append(places[:, 2] + offsets[:, 2])
        vertices = skin(crowd(), rotations, offsets, places, np.zeros(N))[0].astype(np.float64)
        for person in range(N):
            soles = [vertices[feet(person, side)] for side in ("left", "right")]
            above = [float(np.min(sole[:, 2] - stairs(sole))) for sole in soles]
            # One foot always stands, on a tread.
            assert min(map(abs, above)) < 0.02
    rises = np.diff(pelvis, axis=0)
    assert rises.max() < 0.06
    assert rises.min() > -0.03


def changed(was: str, now: str, since: float, phase: float, speed: tuple[float, float] = (1.0, 1.0)) -> Any:
    """Everybody's rotations so long after one motion became another."""
    after = Transition(np.full(N, clip_index(was)), np.full(N, 0.2), np.full(N, speed[0]), np.full(N, since))
    return pose(np.full(N, clip_index(now)), np.full(N, phase), np.full(N, speed[1]), styles(), after=after)


@pytest.mark.parametrize(
    ("was", "now", "start"),
    [
        ("idle", "walk", 0.2914),
        ("walk", "idle", 0.0),
        ("walk", "run", 0.2),
        ("idle", "sit", 0.0),
        ("talk", "walk", 0.2914),
    ],
)
def test_a_motion_begins_as_the_one_before_ended(was: str, now: str, start: float) -> None:
    rotations, offsets = changed(was, now, 0.0, start)
    before, shifts = pose(np.full(N, clip_index(was)), np.full(N, 0.2), np.full(N, 1.0), styles())
    # Feet in the new motion may be turned a little otherwise.
    np.testing.assert_allclose(rotations, before, atol=0.03)
    np.testing.assert_allclose(offsets, shifts, atol=0.01)
    ended, _ = changed(was, now, LONGEST_BLEND, 0.4)
    np.testing.assert_array_equal(
        ended, pose(np.full(N, clip_index(now)), np.full(N, 0.4), np.full(N, 1.0), styles())[0]
    )


def test_feet_that_stand_do_not_turn_with_who_turns_on_the_spot() -> None:
    turn = np.full(N, clip_index("turn"))
    soles = []
    for phase in (0.05, 0.25, 0.45):
        rotations, offsets = pose(turn, np.full(N, phase), np.zeros(N), styles())
        yaw = np.full(N, (phase - 0.25) * TURN_CYCLE)
        soles.append(skin(crowd(), rotations, offsets, np.zeros((N, 3)), yaw)[0])
    for person in range(N):
        left = feet(person, "left")
        assert np.linalg.norm(soles[2][left] - soles[0][left], axis=1).max() < 0.01


def test_people_who_wait_do_not_move_in_unison() -> None:
    idle = np.full(N, clip_index("idle"))
    course = np.array(
        [pose(idle, np.zeros(N), np.zeros(N), styles(), second=t)[0][:, J["head"]] for t in range(0, 60, 2)]
    )
    moved = np.abs(np.diff(course, axis=0)).max(axis=2) > 0.03
    assert moved.any(axis=0).all()
    assert not (moved == moved[:, :1]).all()
