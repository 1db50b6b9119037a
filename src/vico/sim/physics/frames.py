"""How long a frame of physics lasts: the one place where that is decided.

The specification asks for 100 frames a second. That is what robots get whose motors are commanded directly, that have
fallen, that hold or move things, or near which things fall or are pushed. Gaits and wheels that follow velocities,
among people and vehicles, need no more than 50, and cost half as much. Rotors act before each of a frame's steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

#: Seconds a frame lasts: where forces matter, and where nothing but driving and walking goes on.
FINE, COARSE = 0.01, 0.02
#: Steps in which an engine solves a frame, at least: 1/200 s each in fine frames, 1/150 s in coarse ones.
SOLVER_STEPS = {FINE: 2, COARSE: 3}


@dataclass(frozen=True)
class FrameNeeds:
    """What goes on among the robots of a run.

    Attributes
    ----------
    motor_commands
        Somebody commands a robot's motors directly.
    fallen
        A robot lies on the ground, or gets up: limbs are thrown about.
    manipulation
        A robot's hand is at work, or holds a thing.
    loose_objects
        A free rigid object moves.
    """

    motor_commands: bool = False
    fallen: bool = False
    manipulation: bool = False
    loose_objects: bool = False

    @property
    def forces_matter(self) -> bool:
        """Whether anything asks for fine frames, with friction that holds things still."""
        return self.motor_commands or self.fallen or self.manipulation or self.loose_objects


def frame_length(needs: FrameNeeds, dt: float) -> float:
    """Return the seconds a frame lasts within the next `dt` seconds, a multiple of 0.01.

    Fine where anything needs it, and where coarse frames would not fit into `dt`.
    """
    return FINE if needs.forces_matter or round(dt / FINE) % round(COARSE / FINE) else COARSE


@dataclass
class FrameCount:
    """How many frames of either length a run has had; part of the state.

    Attributes
    ----------
    fine, coarse
        Frames of 0.01 and of 0.02 s.
    """

    fine: int = 0
    coarse: int = 0

    def add(self, frame: float, count: int = 1) -> None:
        """Count frames of a length."""
        if frame == FINE:
            self.fine += count
        else:
            self.coarse += count

    def record(self) -> dict[str, Any]:
        """Return what a run reports of its frames."""
        return {
            "fine": {"seconds": FINE, "frames": self.fine},
            "coarse": {"seconds": COARSE, "frames": self.coarse},
            "rule": "fine where motors are commanded, robots fell or hold things, or things fall or are pushed",
        }
