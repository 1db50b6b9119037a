"""Shows a mobile manipulator how to pick and place, writes that down for trainers, and plays a policy of yours.

    python examples/19_imitation.py --out demos --episodes 4
    python examples/19_imitation.py --out demos --policy policy/policy.npz --seeds 20
    python examples/19_imitation.py --out demos --lerobot outputs/train/act/checkpoints/last/pretrained_model

Without a policy, what stands in the dataset is done again, action by action. See docs/imitation.md.
"""

import argparse
from collections import Counter
from pathlib import Path

from vico.agents.robot.chunk_policy import ChunkActor, ChunkPolicy
from vico.agents.robot.increments import arm_state, control_of
from vico.agents.robot.lerobot_policy import LeRobotActor
from vico.challenges.pick_place.episode import play
from vico.challenges.pick_place.tasks import draw_task
from vico.datasets.build import BuildRequest, Contents, SplitRule, build_dataset
from vico.datasets.folder import Dataset


class Again:
    """Does what an episode of a dataset holds; a policy is anything with such an `act`."""

    def __init__(self, dataset: Dataset, episode: int) -> None:
        self.actions = [frame["action"] for frame in dataset.frames(episode)]

    def act(self, observation, instruction):
        """Return the next action; None once there is none left."""
        return control_of(self.actions.pop(0), arm_state(observation)) if self.actions else None


def actor_of(options: argparse.Namespace):
    if options.policy:
        return ChunkActor(ChunkPolicy.read(options.policy), ensemble=options.ensemble)
    return LeRobotActor.read(options.lerobot)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--episodes", type=int, default=2)
    parser.add_argument("--first-seed", type=int, default=7)
    parser.add_argument("--policy", type=Path)
    parser.add_argument("--lerobot", type=Path)
    parser.add_argument("--ensemble", type=float, help="temporal ensembling, such as 0.01; slower")
    parser.add_argument("--seconds", type=int, default=120, help="that an episode may last")
    parser.add_argument("--seeds", type=int, default=10, help="episodes that a policy is played in")
    options = parser.parse_args()

    if not options.out.exists():
        contents = Contents("lerobot", outputs=("rgb",), size=224)
        wanted = BuildRequest(
            contents,
            category="pick_place",
            episodes=options.episodes,
            first_seed=options.first_seed,
            rule=SplitRule("episode", 0.0, 0.0),
            successes=True,
        )
        build_dataset(wanted, options.out)
    dataset = Dataset(options.out)
    for episode in dataset.episodes():
        print(f"{episode['frames']} frames: {episode['instructions'][0]}")

    if not (options.policy or options.lerobot):
        seed = dataset.episodes()[0]["seed"]
        played = play(draw_task(seed), None, Again(dataset, 0), side=64, outputs=("rgb",), to_the_end=True)
        print(f"seed {seed} done again: {played.cause}, {played.off:.2f} m off")
        return
    causes: Counter[str] = Counter()
    for seed in range(100_000, 100_000 + options.seeds):  # of none of the demonstrations
        actor = actor_of(options)
        played = play(draw_task(seed, seconds=options.seconds), None, actor, outputs=("rgb",))
        causes[played.cause] += 1
        print(f"seed {seed}: {played.cause} after {played.seconds:.1f} s")
    print(f"{causes['done']} of {options.seeds} done; {dict(causes)}")


if __name__ == "__main__":
    main()
