"""What a controller returns for a robot does not depend, bit for bit, on which other robots are asked about with it."""

import numpy as np
import pytest

from robot_field import PACKS
from vico.assets.robots import robot_model
from vico.sim.physics.records import Motion
from vico.sim.robots.scene import controller_for


def motion(kind: str, packs: bool, count: int) -> Motion:
    """Robots that tilt, slide and swing their joints, each in another way."""
    rng = np.random.default_rng(5)
    joints = len(robot_model(kind, packs=packs).joints)
    turned = np.linalg.qr(np.eye(3) + 0.2 * rng.normal(size=(count, 3, 3)))[0]
    turned *= np.sign(np.einsum("kii->ki", turned))[:, None, :]
    parts = (rng.normal(size=(count, n)) for n in (3, 3, 3, joints, joints))
    position, velocity, spin, angles, speeds = parts
    return Motion(position, velocity, turned, spin, angles, speeds)


@pytest.mark.parametrize("packs", PACKS)
@pytest.mark.parametrize("kind", ["go2", "h1", "husky"])
def test_a_batch_of_robots_is_each_robot_alone(kind: str, packs: bool) -> None:
    count = 7
    controller = controller_for(robot_model(kind, packs=packs))
    moving = motion(kind, packs, count)
    command = np.random.default_rng(6).uniform(-0.6, 0.6, (count, 3))
    command[2] = 0.0  # one that stands among those that walk
    together, alone = np.zeros((count, controller.memory)), np.zeros((count, controller.memory))
    for _ in range(20):
        batch = controller.targets(moving, command, together)
        for k in range(count):
            row = slice(k, k + 1)
            single = controller.targets(moving.where(np.array([k])), command[row], alone[row])
            assert np.array_equal(single[0], batch[k])
            assert controller.gains(alone[row]) == [controller.gains(together)[k]]
        assert np.array_equal(together, alone)
