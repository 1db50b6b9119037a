"""Drawing teaming tasks: deterministic, each choice out of nine; what each category draws stands in its own module."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from vico.challenges.assistant.choose import Chooser, seeded_chooser
from vico.challenges.drawing import Draw
from vico.challenges.task_files import frame_of
from vico.challenges.teaming import accompany, guide, spot
from vico.challenges.teaming.model import Category, TeamingTask
from vico.challenges.teaming.thresholds import LEAST_WALK, MOST_WALK, STEPS
from vico.community.model import Community
from vico.errors import EmptyInputError
from vico.seeds import rng
from vico.world.world import World

#: How a task of each category is drawn.
DRAWN: dict[Category, Callable[[Draw, dict[str, Any]], TeamingTask | None]] = {
    "accompany": accompany.draw_task,
    "guide": guide.draw_task,
    "spot": spot.draw_task,
}
# Starts that are tried.
_TRIES = 60


def generate_teaming_task(
    world: World,
    community: Community,
    category: Category,
    *,
    seed: int,
    steps: int = STEPS,
    chooser: Chooser | None = None,
) -> TeamingTask:
    """Make one episode's task; the same world, community, seed and chooser give the same task.

    Parameters
    ----------
    steps
        Seconds at most.
    chooser
        Who picks out of nine candidates; a seeded draw if None.

    Raises
    ------
    EmptyInputError
        If the world and its people have too little around any starting point.
    """
    chance = rng(seed, "teaming task", category, world.digest)
    draw = Draw(world, community, category, chance, chooser or seeded_chooser(chance))
    frame = frame_of(world, community, category, seed=seed, steps=steps)
    for _ in range(_TRIES):
        task = DRAWN[category](draw, frame)
        if task is not None:
            return task
        draw.candidates.clear()
    raise EmptyInputError(
        f"teaming: {category}: nobody knows anything that is a walk of {LEAST_WALK:.0f} to {MOST_WALK:.0f} m away and "
        "has free ground; use a larger world or more residents"
    )
