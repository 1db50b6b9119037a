"""People in the browser are posed as `vico.sim.recording.PosedPeople` poses them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vico.assets.motions.clip import rotation_matrices
from vico.assets.people import body_of
from vico.seeds import rng
from vico.sim.animation import LONGEST_BLEND, STYLE, Transition, clip_index, free_hands, joint_places, pose, style_of
from vico.sim.recording import PosedPeople, read_run
from vico.sim.recording.run import looks_and_manners
from vico.viewer.headless import BrowserPage

# Tables are read between their rows: no joint is farther off than this, metres and radians (all but straight knees turn
# most), and none of those who change from one motion into another.
_FARTHEST, _TURNED, _CHANGING = 0.02, np.radians(6.0), 0.03

_POSE = """(async () => {
  const { poseOf } = await import("/page/motion.js");
  const { PersonFile, Pose, forwardKinematics } = await import("/page/skeleton.js");
  const { motionAt } = await import("/page/people.js");
  const { Between } = await import("/page/between.js");
  const files = new Map(), found = [];
  for (const step of STEPS) {
    const { decodeFrames } = await import("/page/protocol.js");
    const frames = decodeFrames(await (await fetch(`/api/frames?first=${step}&last=${step}`)).arrayBuffer());
    const between = new Between();
    between.set(frames[0], frames[0], 0);
    const { entity } = frames[0].people;
    for (let row = 0; row < entity.length; row++) {
      if (!files.has(entity[row])) {
        const answer = await fetch(`/api/person/${entity[row]}.bin`);
        files.set(entity[row], new PersonFile(await answer.arrayBuffer()));
      }
      const file = files.get(entity[row]), pose = new Pose();
      poseOf(file, motionAt(file, between, row), frames[0].time, pose);
      const { placed } = forwardKinematics(file, pose);
      found.push([step, entity[row], [...placed], [...pose.quaternions]]);
    }
  }
  return found;
})()"""


def test_poses_equal_those_of_posed_people(page: BrowserPage, page_run: Path) -> None:
    steps = list(range(1, 40, 4))
    told = page.evaluate(_POSE.replace("STEPS", repr(steps)))
    run = read_run(page_run)
    posed = PosedPeople(run)
    since = {
        (int(s), int(e)): float(t)
        for s, e, t in zip(*(run.columns("people")[k] for k in ("step", "entity", "clip_time")), strict=True)
    }
    far, turned, changing = [], [], []
    for step, entity, places, quaternions in told:
        mine = posed.at(step, [entity])
        expected = joint_places(mine.joints, mine.rotations, mine.offsets)[0]
        away = np.linalg.norm(np.reshape(places, (55, 3)) - expected, axis=1)
        if since[step, entity] < LONGEST_BLEND:
            changing.append(away.max())
            continue
        far.append(away.max())
        turned.append(_angles(np.reshape(quaternions, (55, 4)), mine.rotations[0])[:25].max())
    assert len(far) > 40
    assert max(far) < _FARTHEST
    assert max(turned) < _TURNED
    assert len(changing) > 3
    assert max(changing) < _CHANGING


_BLENDS = """(async () => {
  const { poseOf } = await import("/page/motion.js");
  const { PersonFile, Pose, forwardKinematics } = await import("/page/skeleton.js");
  const file = new PersonFile(await (await fetch("/api/person/ENTITY.bin")).arrayBuffer());
  return CASES.map(([clip, phase, pace, clipBefore, phaseBefore, paceBefore, since]) => {
    const pose = new Pose();
    poseOf(file, { clip, phase, pace, clipBefore, phaseBefore, paceBefore, since }, 1234.5, pose);
    return [...forwardKinematics(file, pose).placed];
  });
})()"""
_PACES = {"run": (1.6, 3.5), "walk": (0.4, 2.0), "carry": (0.4, 2.0)}


def test_one_motion_passes_into_another_by_the_same_steps(page: BrowserPage, page_run: Path) -> None:
    run, numbers = read_run(page_run), rng(0, "test", "blends")
    names = ["idle", "walk", "run", "carry", "sit", "turn", "sleep", "phone", "ride_bike"]

    def motion(name: str) -> tuple[int, float, float]:
        return clip_index(name), float(numbers.uniform()), float(numbers.uniform(*_PACES.get(name, (0.0, 0.0))))

    pairs = [(a, b) for a in names for b in names if a != b or a in _PACES]
    cases = [(*motion(b), *motion(a), float(numbers.uniform(0.0, 1.0))) for a, b in pairs for _ in range(3)]
    entity = next(agent["entity"] for agent in run.agents if agent["kind"] == "resident")
    told = page.evaluate(_BLENDS.replace("ENTITY", str(entity)).replace("CASES", repr([list(c) for c in cases])))
    looks, manners = looks_and_manners(run.manifest["seed"], run.agents, run.cast)
    stream = rng(run.manifest["seed"], "manner", manners[entity])
    style = np.repeat(np.array([style_of(body_of(looks[entity]), stream, age=looks[entity].age)], STYLE), len(cases))
    clip, phase, pace, *before = (np.array(column) for column in zip(*cases, strict=True))
    rotations, offsets = pose(clip, phase, pace, style, second=1234.5, after=Transition(*before))
    expected = joint_places(style["joints"], rotations, offsets)
    away = np.linalg.norm(np.reshape(told, (-1, 55, 3)) - expected, axis=2).max(axis=1)
    assert away.max() < _CHANGING, cases[int(away.argmax())]


def _angles(quaternions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """Return how far joints are turned from each other, radians."""
    x, y, z, w = np.asarray(quaternions, np.float64).T
    mine = np.empty((len(quaternions), 3, 3))
    mine[:, 0] = np.column_stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)])
    mine[:, 1] = np.column_stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)])
    mine[:, 2] = np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    cosine = (np.einsum("jrc,jrc->j", mine, rotation_matrices(rotations)) - 1) / 2
    return np.asarray(np.arccos(np.clip(cosine, -1, 1)))


@pytest.mark.parametrize("second", [0.0, 3.7, 28812.4])
def test_restlessness_is_the_same(page: BrowserPage, second: float) -> None:
    from vico.sim.animation.postures import restlessness

    script = f'import("/page/motion.js").then((m) => m.restlessness({second}, 0.3, 0.62))'
    assert page.evaluate(script) == pytest.approx(restlessness(second, 0.3, 0.62), abs=1e-6)


_HOLDS = """(async () => {
  const { poseOf } = await import("/page/motion.js");
  const { holdUp } = await import("/page/holds.js");
  const { PersonFile, Pose, forwardKinematics } = await import("/page/skeleton.js");
  const file = new PersonFile(await (await fetch("/api/person/ENTITY.bin")).arrayBuffer());
  return CASES.map(([hold, share, width]) => {
    const pose = new Pose();
    poseOf(file, { clip: CLIP, phase: 0.3, pace: 1.2, clipBefore: CLIP, phaseBefore: 0, paceBefore: 1.2,
      since: 10 }, 50, pose);
    holdUp(file, pose, { hold, share, width });
    return [...forwardKinematics(file, pose).placed];
  });
})()"""


def test_arms_hold_umbrellas_placards_and_boxes_alike(page: BrowserPage, page_run: Path) -> None:
    run = read_run(page_run)
    cases = [(hold, share, 0.4) for hold in (1, 2, 3, 4) for share in (0.3, 1.0)]
    entity = next(agent["entity"] for agent in run.agents if agent["kind"] == "resident")
    walk, script = clip_index("walk"), _HOLDS.replace("ENTITY", str(entity))
    told = page.evaluate(script.replace("CLIP", str(walk)).replace("CASES", repr([list(c) for c in cases])))
    looks, manners = looks_and_manners(run.manifest["seed"], run.agents, run.cast)
    stream = rng(run.manifest["seed"], "manner", manners[entity])
    n = len(cases)
    style = np.repeat(np.array([style_of(body_of(looks[entity]), stream, age=looks[entity].age)], STYLE), n)
    hold, share, width = (np.array(column) for column in zip(*cases, strict=True))
    hands = free_hands(n)._replace(hold=hold, share=share, width=width)
    same = np.full(n, walk), np.full(n, 0.3), np.full(n, 1.2)
    after = Transition(np.full(n, walk), np.zeros(n), np.full(n, 1.2), np.full(n, 10.0))
    rotations, offsets = pose(*same, style, second=50.0, after=after, hands=hands)
    away = np.linalg.norm(np.reshape(told, (-1, 55, 3)) - joint_places(style["joints"], rotations, offsets), axis=2)
    assert away.max() < _FARTHEST, cases[int(away.max(axis=1).argmax())]
