"""Draw how walking to a point was learnt.

python scripts/point_goal_curve.py benchmarks/results/point_goal_ppo.csv docs/images/point_goal_training.png
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot


def main() -> None:
    """Read the curve that examples/14_train_with_sb3.py wrote, and draw it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("curve", type=Path)
    parser.add_argument("out", type=Path)
    given = parser.parse_args()
    with given.curve.open(encoding="utf-8") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    steps = [row["steps"] / 1000 for row in rows]
    figure, axis = pyplot.subplots(figsize=(6.4, 3.2), dpi=120, layout="constrained")
    axis.plot(steps, [100 * row["success"] for row in rows], color="#0072B2", label="points reached (left)")
    axis.set(xlabel="thousands of steps", ylabel="of the last 100 episodes, %", ylim=(0, 100), xlim=(0, None))
    other = axis.twinx()
    other.plot(steps, [row["reward"] for row in rows], "--", color="#D55E00", label="shaped reward (right)")
    other.set_ylabel("mean of an episode")
    figure.legend(loc="outside upper center", ncols=2, frameon=False)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(given.out)


if __name__ == "__main__":
    main()
