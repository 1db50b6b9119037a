"""Who is stuck, and who was taken out of a jam: told, so that nothing vanishes uncounted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.sim.traffic.records import NONE

#: Who has stood still, or walked on the spot, for so long is stuck, s.
STUCK_AFTER = 60.0
#: So many rescues are kept with all particulars; all are counted.
KEPT = 64

#: A rescue: index and place of the vehicle before it, seconds from the start of the traffic to it, how long it had
#: stood, and the entity before it (0 for none).
_RESCUE = np.dtype(
    [
        ("vehicle", np.int32),
        ("x", np.float64),
        ("y", np.float64),
        ("at", np.float64),
        ("stood", np.float64),
        ("before", np.int64),
    ]
)


@dataclass(frozen=True)
class Jam:
    """Somebody who got nowhere.

    Attributes
    ----------
    entity
        Whose body.
    position
        Where, ENU metres, shape ``(2,)``.
    at, stood
        When this was so, seconds after the traffic began, and for how long it had been.
    before
        Entity of whom it stood behind, 0 for nobody.
    """

    entity: int
    position: tuple[float, float]
    at: float
    stood: float
    before: int


class JamLog:
    """Remembers rescues: part of the traffic's state.

    Attributes
    ----------
    elapsed
        Seconds since the traffic began, shape ``(1,)``.
    """

    def __init__(self, first_entity: int) -> None:
        self._first = first_entity
        self.elapsed = np.zeros(1)
        self._rescues = np.zeros(KEPT, _RESCUE)
        self._count = np.zeros(1, np.int64)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every array by name, not copied."""
        found = {"elapsed": self.elapsed, "rescues": self._count}
        return found | {f"rescue_{name}": self._rescues[name] for name in _RESCUE.fields or ()}

    @property
    def count(self) -> int:
        """How many vehicles were taken out of jams."""
        return int(self._count[0])

    def note_rescue(self, vehicle: int, xy: tuple[float, float], stood: float, before: int) -> None:
        """Remember that a vehicle was taken away from where it had stood."""
        if self._count[0] < KEPT:
            self._rescues[self._count[0]] = (vehicle, *xy, self.elapsed[0], stood, before)
        self._count[0] += 1

    def rescued(self) -> list[Jam]:
        """Return the first rescues."""
        kept = self._rescues[: min(self.count, KEPT)]
        return [
            Jam(
                self._first + int(r["vehicle"]),
                (float(r["x"]), float(r["y"])),
                float(r["at"]),
                float(r["stood"]),
                int(r["before"]),
            )
            for r in kept
        ]


def entity_before(blocker: int, entities: NDArray[np.int32]) -> int:
    """Return the entity of the body a vehicle stands behind, 0 for nobody; `entities` of all bodies of the step."""
    return int(entities[blocker]) if NONE < blocker < len(entities) else 0
