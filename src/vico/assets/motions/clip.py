"""A recorded motion of a person on the 55 joints of SMPL-X, whatever file it came from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vico.assets.people import JOINTS
from vico.errors import InputError, SchemaError
from vico.io.plain_data import read_plain, write_plain

#: Motions are scaled to a body whose hips stand so high in the T-pose, metres.
HIP_HEIGHT = 0.92
#: Longest motion, frames; and fastest, frames a second.
MOST_FRAMES, MOST_RATE = 200_000, 1000.0

_SCHEMA = "vico.motion.1"


@dataclass(frozen=True)
class MotionClip:
    """A recorded motion.

    Attributes
    ----------
    name
        For people to read.
    rate
        Frames a second.
    position
        Of the pelvis, metres for a body whose hips are `HIP_HEIGHT` high, z up, float32, shape ``(t, 3)``.
    orientation
        Of the pelvis, axis-angle, radians: it turns a body in the T-pose that faces along x, float32, shape ``(t, 3)``.
    pose
        Of the other 54 joints in the order of `vico.assets.people.JOINTS`, axis-angle relative to the parent, radians,
        about axes that are the body's in the T-pose (x forward, y left, z up), float32, shape ``(t, 54, 3)``: the 162
        pose numbers of SMPL-X, its axes renamed.
    notes
        What of its file was read otherwise than it is written, a sentence each; not kept in files.

    Raises
    ------
    InputError
        If shapes do not fit each other, or a number is not finite.
    """

    name: str
    rate: float
    position: NDArray[np.float32]
    orientation: NDArray[np.float32]
    pose: NDArray[np.float32]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        t = len(self.position)
        if not 1 <= t <= MOST_FRAMES:
            raise InputError(f"motion {self.name!r}: {t} frames; it has to be 1..{MOST_FRAMES}")
        if not 0 < self.rate <= MOST_RATE:
            raise InputError(
                f"motion {self.name!r}: {self.rate} frames a second; it has to be above 0, to {MOST_RATE:g}"
            )
        shapes = {"position": (t, 3), "orientation": (t, 3), "pose": (t, len(JOINTS) - 1, 3)}
        for field, shape in shapes.items():
            array = getattr(self, field)
            if array.shape != shape:
                raise InputError(f"motion {self.name!r}: {field} has shape {array.shape}; it has to be {shape}")
            if not np.isfinite(array).all():
                raise InputError(f"motion {self.name!r}: {field} holds numbers that are not finite; repair the file")

    def __len__(self) -> int:
        return len(self.position)

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return len(self) / self.rate

    def rotations(self, frame: int) -> NDArray[np.float32]:
        """Return the joints of a frame as `vico.render.skinning` takes them, the pelvis first, shape ``(55, 3)``."""
        return np.concatenate([self.orientation[frame, None], self.pose[frame]])

    def offset(self, frame: int, pelvis: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return how far a body's pelvis is from its place in the T-pose, for a body standing where the motion begins.

        Parameters
        ----------
        pelvis
            Where the body's pelvis is in the T-pose, metres, shape ``(3,)``.
        """
        scale = float(pelvis[2]) / HIP_HEIGHT
        moved = self.position[frame].astype(np.float64) * scale
        moved[:2] -= self.position[0, :2].astype(np.float64) * scale
        return np.asarray(moved - [0.0, 0.0, pelvis[2]], np.float32)

    def write(self, path: Path) -> None:
        """Write it to a file, whole or not at all."""
        fields = {name: getattr(self, name) for name in ("name", "rate", "position", "orientation", "pose")}
        write_plain(path, {"schema": _SCHEMA, **fields})


def read_motion(path: Path) -> MotionClip:
    """Read what `MotionClip.write` wrote.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is damaged, or no motion.
    """
    record = read_plain(path)
    if not isinstance(record, dict) or record.pop("schema", None) != _SCHEMA:
        raise SchemaError(f"{path}: no motion of this version; import it anew with vico motion import")
    try:
        return MotionClip(**record)
    except (TypeError, AttributeError, InputError) as error:
        raise SchemaError(f"{path}: {error}; import it anew with vico motion import") from None
