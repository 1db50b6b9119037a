"""Where a thing is to an arm, picture by picture: what learned policies are told instead of what a planner looks up."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.body import ArmBody, Stance
from vico.agents.robot.grasps import ThingBox, thing_box
from vico.agents.robot.sight import look
from vico.agents.state import AgentState
from vico.exact import dot, product

Array = NDArray[np.float64]

#: Newtons from which a finger counts as pressing; as in the environments that arms are trained in.
PRESSING = 0.5


class ThingPose(NamedTuple):
    """A box round a thing.

    Attributes
    ----------
    middle
        Metres, shape ``(3,)``.
    rotation
        Its axes in columns, right-handed, shape ``(3, 3)``.
    half
        Half its sides along these, metres, shape ``(3,)``.
    """

    middle: Array
    rotation: Array
    half: Array

    @property
    def low(self) -> float:
        """Height of its lowest point, metres."""
        return float(self.middle[2] - dot(np.abs(self.rotation[2]), self.half))

    def inside(self, stance: Stance) -> ThingPose:
        """Return it in the frame of a base, if it is one in the world."""
        return ThingPose(stance.inside(self.middle), product(stance.rotation.T, self.rotation), self.half)

    def outside(self, stance: Stance) -> ThingPose:
        """Return it in the world, if it is one in the frame of a base."""
        return ThingPose(stance.outside(self.middle), product(stance.rotation, self.rotation), self.half)

    def as_box(self) -> ThingBox:
        """Return the upright box that it is, or that stands round it."""
        upright = int(np.abs(self.rotation[2]).argmax())
        sides = [(self.half[k], self.rotation[:2, k]) for k in range(3) if k != upright]
        sides.sort(key=lambda side: float(side[0]))
        axes = np.array([axis / max(float(np.hypot(*axis)), 1e-9) for _, axis in sides])
        high = 2.0 * float(self.middle[2]) - self.low
        return ThingBox(self.middle[:2].copy(), axes, np.array([half for half, _ in sides]), self.low, high)


#: Truth instead of sight: from an entity to its box in the world; None for one that is not there.
Truth = Callable[[int], ThingPose | None]


def pose_of_box(box: ThingBox) -> ThingPose:
    """Return the pose of the box round a thing's points."""
    x, y = box.axes
    # Sides are ordered by their length: their axes may be left-handed.
    y = y if x[0] * y[1] - x[1] * y[0] > 0.0 else -y
    rotation = np.array([[x[0], y[0], 0.0], [x[1], y[1], 0.0], [0.0, 0.0, 1.0]])
    middle = np.array([*box.centre, (box.low + box.high) / 2])
    return ThingPose(middle, rotation, np.array([*box.half, (box.high - box.low) / 2]))


def presses(observation: Mapping[str, Any], entity: int = 0) -> NDArray[np.bool_]:
    """Return whether each finger presses on something, shape ``(2,)``.

    Parameters
    ----------
    entity
        Of a thing that both count as pressing on, too, while the robot is told that it holds it: with oracle grasp
        fingers feel nothing of what they hold.
    """
    if entity and entity in observation.get("state", {}).get("held", ()):
        return np.ones(2, bool)
    return np.asarray(np.asarray(observation["sensors"]["contacts"], np.float64) > PRESSING)


class ThingWatch:
    """Says where one thing is, in the frame of the base.

    While it is in view that is the least upright box round its points in depth and segmentation. Out of view it is
    where it was last, and in a grip it goes with the hand. With `truth` it is that.

    Parameters
    ----------
    body
        The arm.
    truth
        Where things really are, for an oracle; None for what is seen.
    """

    def __init__(self, body: ArmBody, *, truth: Truth | None = None) -> None:
        self._body, self._truth = body, truth
        self._last: ThingPose | None = None  # in the world
        self._in_hand: ThingPose | None = None  # in the frame of the hand

    @property
    def looks(self) -> bool:
        """Whether it needs pictures."""
        return self._truth is None

    def forget(self) -> None:
        """Begin anew, with another thing."""
        self._last = self._in_hand = None

    def where(self, observation: Mapping[str, Any], entity: int) -> ThingPose | None:
        """Return where a thing is now; None if it has not been seen yet.

        Parameters
        ----------
        observation
            With ``sensors``, and with depth and segmentation if it `looks`.
        """
        stance = Stance.of(observation)
        if self._truth is not None:
            found = self._truth(entity)
            return None if found is None else found.inside(stance)
        box = thing_box(look(observation).of(entity))
        hand = self._hand(observation)
        if box is not None:
            pose = pose_of_box(box)
        elif self._in_hand is not None and presses(observation, entity).all():
            pose = self._in_hand.outside(hand)
        elif self._last is not None:
            pose = self._last.inside(stance)
        else:
            return None
        self._last, self._in_hand = pose.outside(stance), pose.inside(hand)
        return pose

    def _hand(self, observation: Mapping[str, Any]) -> Stance:
        angles = np.asarray(observation["sensors"]["joint_position"], np.float64)
        pose = self._body.hand(angles[:7])
        return Stance(pose[:, 3], pose[:, :3])

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {name: None if pose is None else {**pose._asdict()} for name, pose in self._poses().items()}

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        last, in_hand = (
            None if state[name] is None else ThingPose(**{key: np.array(value) for key, value in state[name].items()})
            for name in self._poses()
        )
        self._last, self._in_hand = last, in_hand

    def _poses(self) -> dict[str, ThingPose | None]:
        return {"last": self._last, "in_hand": self._in_hand}
