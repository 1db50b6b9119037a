"""Play several environments side by side, and let a planner try what would happen in one of them.

python examples/06_many_environments.py --world out/demo/world --community out/demo/community --envs 2
"""

import argparse
from pathlib import Path

import vico

TURN = {"type": "turn_left", "degrees": 30.0}
WALK = {"type": "move_forward", "distance": 1.0}


def side_by_side(world: Path, community: Path, envs: int) -> None:
    """Walk in every environment, each in a process and with a seed of its own."""
    vector = vico.make_vec(world, community, num_envs=envs, observe="none", cars=5, pedestrians=5)
    _, _ = vector.reset(seed=0)
    for _ in range(5):
        observations, _, _, _, infos = vector.step([WALK] * envs)
    print(f"{envs} environments: poses of shape {observations['pose'].shape}, states {', '.join(infos['hash'])}")
    vector.close()


def try_it_out(world: Path, community: Path) -> None:
    """Look which way leads farthest before going there."""
    env = vico.make(world, community, assistants=1, observe="none")
    observations, _ = env.reset(seed=0)
    start = observations["assistant_0"]["pose"][:2]
    reached = {}
    for turns in range(4):
        with env.sim.branch() as sim:
            for action in [TURN] * turns + [WALK] * 5:
                result = sim.step({"assistant_0": action})
            reached[turns] = float(((result.observations["assistant_0"]["pose"][:2] - start) ** 2).sum() ** 0.5)
    best = max(reached, key=lambda turns: reached[turns])
    print(f"{best} turns to the left lead farthest: {reached[best]:.1f} m; time is still {env.sim.state.second:g} s")


def fifty_times_a_second(world: Path) -> None:
    """Control a robot's motors fifty times a second beside people who act once a second."""
    env = vico.make(world, robots=("husky",), assistants=1, observe="none", periods={"robot_0": 0.02})
    env.reset(seed=0)
    rounds = {"robot_0": 0, "assistant_0": 0}
    for _ in range(50):
        observations, *_ = env.step({"robot_0": {"type": "control", "vector": [2.0] * 4}})
        for name in observations:
            rounds[name] += 1
    print(f"in one second {rounds['robot_0']} observations of the robot and {rounds['assistant_0']} of the assistant")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", type=Path, required=True)
    parser.add_argument("--community", type=Path, required=True)
    parser.add_argument("--envs", type=int, default=2)
    arguments = parser.parse_args()
    side_by_side(arguments.world, arguments.community, arguments.envs)
    try_it_out(arguments.world, arguments.community)
    fifty_times_a_second(arguments.world)


if __name__ == "__main__":  # the processes of the first part read this file, too
    main()
