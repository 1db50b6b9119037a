"""People in the browser are posed as `vico.sim.recording.PosedPeople` poses them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vico.assets.motions.rotations import matrices_of
from vico.sim.animation import LONGEST_BLEND, joint_places
from vico.sim.recording import PosedPeople, read_run
from vico.viewer.browser import BrowserPage

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


def _angles(quaternions: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """Return how far joints are turned from each other, radians."""
    x, y, z, w = np.asarray(quaternions, np.float64).T
    mine = np.empty((len(quaternions), 3, 3))
    mine[:, 0] = np.column_stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)])
    mine[:, 1] = np.column_stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)])
    mine[:, 2] = np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    cosine = (np.einsum("jrc,jrc->j", mine, matrices_of(rotations)) - 1) / 2
    return np.asarray(np.arccos(np.clip(cosine, -1, 1)))


@pytest.mark.parametrize("second", [0.0, 3.7, 28812.4])
def test_restlessness_is_the_same(page: BrowserPage, second: float) -> None:
    from vico.sim.animation.standing import restlessness

    script = f'import("/page/motion.js").then((m) => m.restlessness({second}, 0.3, 0.62))'
    assert page.evaluate(script) == pytest.approx(restlessness(second, 0.3, 0.62), abs=1e-6)
