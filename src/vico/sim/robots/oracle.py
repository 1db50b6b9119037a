"""Oracle grasp: a run may have hands that never lose what they closed on.

Given is this, and nothing else: when a closing jaw touches a thing whose box the middle between the pads is inside of,
or no farther than `MARGIN` from, the thing keeps the place in the hand's frame that it has then, whatever it weighs and
wherever it is touched, until the jaw opens by `OPENS`. While it is held it weighs nothing and collides with nothing,
and the fingers stay where they touched it. To come there, to close on it, and to come down again is the robot's own
affair, and it does not go through doors. One sees it in the observation (``state.held``).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.errors import SchemaError
from vico.exact import apply_matrix, product
from vico.kinematics.arm import Chain, hand_pose
from vico.quaternions import matrix_of, quaternion_of
from vico.sim.physics.engine import PhysicsEngine
from vico.sim.state import MovableObjects

Array = NDArray[np.float64]

#: How far from a thing's box the middle of the jaw may be, and how far each finger opens to let go, metres.
MARGIN, OPENS = 0.02, 0.006
# A jaw that has closed by less than this since it was looked at stands still, metres.
_CLOSES = 2e-4
_FINGERS = slice(7, 9)  # of the targets of an arm's motors


class Hand(NamedTuple):
    """A hand: its arm, the names of the links of its fingers, and how far each of them opens at most, metres."""

    chain: Chain
    fingers: tuple[str, ...]
    opening: float


class OracleGrasp:
    """What the hands of a run's robots hold by oracle.

    Parameters
    ----------
    hands
        By robot.
    entities
        Of all robots, int32, shape ``(n,)``.

    Attributes
    ----------
    entity
        Of the thing in each robot's hand, 0 for none, int32, shape ``(n,)``.
    """

    def __init__(self, hands: Mapping[int, Hand], entities: NDArray[np.int32]) -> None:
        self._hands, self._robots = dict(hands), entities
        self.entity = np.zeros(len(entities), np.int32)
        self._place = np.zeros((len(entities), 7))  # of the thing in the hand's frame: position, quaternion
        self._apart = np.zeros(len(entities))  # of fingers, when they were looked at last
        self._touched = np.zeros(len(entities))  # and when they touched what they hold

    def hold(self, engine: PhysicsEngine, objects: MovableObjects) -> None:
        """Take what hands have closed on, keep it in its place, and let go of it."""
        for robot, own in self._hands.items():
            angles = engine.joints(robot)[0]
            apart, before = float(angles[_FINGERS].min()), float(self._apart[robot])
            self._apart[robot] = apart
            if self.entity[robot]:
                k = objects.index(int(self.entity[robot]))
                if objects.holder[k] != self._robots[robot]:
                    self.entity[robot] = 0  # somebody has taken it
                elif apart > self._touched[robot] + OPENS and apart >= before:
                    self.entity[robot] = objects.holder[k] = 0
                else:
                    self._move(robot, k, _hand(engine, robot, own.chain, angles[:7]), objects)
            elif apart < before - _CLOSES:
                self._close(robot, engine, _hand(engine, robot, own.chain, angles[:7]), objects)

    def spread(self, robots: NDArray[np.int64], targets: Array) -> Array:
        """Return motor targets of robots, shape ``(k, m)``, with fingers kept where they touch what they hold."""
        holds = self.entity[robots] != 0
        if not holds.any():
            return targets
        kept = targets.copy()
        kept[holds, _FINGERS] = np.maximum(kept[holds, _FINGERS], self._touched[robots[holds], None])
        return kept

    def _close(self, robot: int, engine: PhysicsEngine, hand: Array, objects: MovableObjects) -> None:
        """Take a thing that a closing jaw touches and is about."""
        links, contacts = engine.link_names(robot), engine.contacts()
        own = self._hands[robot]
        touched = set().union(*(contacts.objects_at(robot, links.index(name)) for name in own.fingers))
        if not touched:
            return
        at, turn = hand[:, 3], hand[:, :3]
        for k in np.flatnonzero((objects.holder == 0) & (objects.room < 0)).tolist():
            lies, half = objects.rotation(k), objects.size[k] / 2
            inside = apply_matrix(at - objects.position[k], lies.T) - (0.0, 0.0, half[2])
            if np.all(np.abs(inside) <= half + MARGIN):
                away = apply_matrix(objects.position[k] - at, turn.T)
                self._place[robot] = [*away, *quaternion_of(product(turn.T, lies))]
                # Who holds what is as wide as the jaw can still open it.
                self._touched[robot] = min(float(self._apart[robot]), own.opening - OPENS - _CLOSES)
                self.entity[robot], objects.holder[k], objects.hand[k] = objects.entity[k], self._robots[robot], -1
                return

    def _move(self, robot: int, k: int, hand: Array, objects: MovableObjects) -> None:
        place = self._place[robot]
        objects.position[k] = hand[:, 3] + apply_matrix(place[:3], hand[:, :3])
        objects.set_rotation(k, product(hand[:, :3], matrix_of(place[3:])))

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future, copied."""
        return {
            "oracle_entity": self.entity.copy(),
            "oracle_place": self._place.copy(),
            "oracle_fingers": np.column_stack([self._apart, self._touched]),
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held.

        Raises
        ------
        SchemaError
            If it was saved without oracle grasp, or of other robots.
        """
        if "oracle_entity" not in arrays or arrays["oracle_entity"].shape != self.entity.shape:
            raise SchemaError("robots: the saved state is of a run without oracle grasp, or of other robots")
        self.entity[:], self._place[:] = arrays["oracle_entity"], arrays["oracle_place"]
        self._apart[:], self._touched[:] = arrays["oracle_fingers"].T


def _hand(engine: PhysicsEngine, robot: int, chain: Chain, angles: Array) -> Array:
    """Return the pose of the middle between the pads in the world, shape ``(3, 4)``."""
    count, pose = len(chain.places), np.empty((3, 4))
    hand_pose(chain, np.ascontiguousarray(angles), np.empty((count, 3)), np.empty((count, 3)), pose)
    base = engine.base(robot)
    at = apply_matrix(pose[:, 3], base.rotation) + base.position
    return np.column_stack([product(base.rotation, pose[:, :3]), at])
