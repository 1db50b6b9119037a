"""Speed of one thread of this machine, beside that of the machine of the README's figures."""

from __future__ import annotations

import time

from vico.io.compiled import compiled

# The machine of benchmarks/results, in million turns a second.
REFERENCE_PYTHON, REFERENCE_COMPILED = 107.0, 701.0
_TURNS = 1_000_000  # of the loop in Python
_COMPILED_TURNS = 20_000_000
_SPEED_TRIES = 5  # of which the fastest counts


def python_speed() -> float:
    """Return how many million turns of an empty loop Python takes a second: the fastest of a few tries."""
    best = float("inf")
    for _ in range(_SPEED_TRIES):
        began = time.perf_counter()
        for _ in range(_TURNS):
            pass
        best = min(best, time.perf_counter() - began)
    return _TURNS / best / 1e6


def compiled_speed() -> float:
    """Return how many million turns a second compiled code takes, where each waits for the last one's product."""
    best = float("inf")
    _turn(1)
    for _ in range(_SPEED_TRIES):
        began = time.perf_counter()
        _turn(_COMPILED_TURNS)
        best = min(best, time.perf_counter() - began)
    return _COMPILED_TURNS / best / 1e6


def speed_table() -> str:
    """Return a table in markdown of this machine's speeds beside the reference's, with what to expect of figures."""
    lines = [
        "## This machine beside that of the README's figures",
        "",
        "One thread, million turns of a loop a second. The README's figures are to be scaled by about the last column;",
        "other programs that run meanwhile take their share, too (`benchmarks/under_load.py`).",
        "",
        "| loop | here | there | here / there |",
        "|---|---|---|---|",
    ]
    for name, here, there in (
        ("Python, empty", python_speed(), REFERENCE_PYTHON),
        ("compiled, products", compiled_speed(), REFERENCE_COMPILED),
    ):
        lines.append(f"| {name} | {here:.0f} | {there:.0f} | {here / there:.2f} |")
    return "\n".join(lines) + "\n"


@compiled
def _turn(turns: int) -> float:
    value = 0.5
    for _ in range(turns):
        value = 3.7 * value * (1.0 - value)
    return value
