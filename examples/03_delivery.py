"""Draw a delivery task, let the heuristic planner do it, and see the verdict.

python examples/03_delivery.py --world out/demo/world --seed 0 --steps 600
"""

import argparse
from pathlib import Path

from vico.challenges.assistant.challenge import ASSISTANT
from vico.challenges.assistant.tasks import Task
from vico.challenges.records import Job


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=600)
    arguments = parser.parse_args()

    setting = {"steps": arguments.steps}
    job = Job("assistant", "delivery", "heuristic", setting, world=arguments.world, seed=arguments.seed)
    task = Task.model_validate(ASSISTANT.task(job))
    for errand in task.instructions():
        print(f"{errand['index']}. {errand['text']}")
    record = ASSISTANT.play(job)
    for part in record.parts:
        print(f"{part.name}. {f'done at step {part.done_at}' if part.success else f'not done: {part.cause}'}")
    print(f"SR {record.metrics['SR']:.0f} %, Ts {record.metrics['Ts']:.0f} steps")


if __name__ == "__main__":
    main()
