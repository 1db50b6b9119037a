"""A commuter's day that is short enough to reason about."""

from __future__ import annotations

from vico.challenges.commute.tasks import Appointment, Commuter, CommuteTask


def appointment(k: int, start: int, end: int) -> Appointment:
    return Appointment(
        place=f"p{k}", name=f"Place {k}", kind="shop", position=(300.0 * k, 0.0), start=start, end=end,
        candidates=[f"p{k}"],
    )  # fmt: skip


def toy_task() -> CommuteTask:
    """Three places in a row, 300 m apart: at 9:00 one leaves, at 9:08 one is due, and so on."""
    return CommuteTask(
        world="toy", world_digest="0", seed=0, community=0,
        resident=Commuter(id="resident_0", name="Ada Oak", age=30, occupation="baker", lifestyle="Early.", cash=50.0),
        appointments=[appointment(0, 31_800, 32_400), appointment(1, 32_880, 33_600), appointment(2, 34_000, 34_900)],
    )  # fmt: skip
