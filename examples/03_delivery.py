"""Generate a delivery task, let the heuristic planner do it, and see the verdict.

python examples/03_delivery.py --world out/demo/world --seed 0 --steps 600
"""

import argparse
from pathlib import Path

from vico.challenges.assistant.delivery import generate_delivery
from vico.challenges.assistant.runner import community_for, run_episode
from vico.world.folder import read_world


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=600)
    arguments = parser.parse_args()

    world = read_world(arguments.world)
    task = generate_delivery(world, seed=arguments.seed, steps=arguments.steps)
    for errand in task.instructions():
        print(f"{errand['index']}. {errand['text']}")
    result = run_episode(world, community_for(world, residents=3), task, method="heuristic")
    for errand, done in zip(task.subtasks, result.done_at, strict=True):
        print(f"{errand.index}. {'not done' if done is None else f'done at step {done}'}")


if __name__ == "__main__":
    main()
