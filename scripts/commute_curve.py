"""Draw how commuters learnt: python scripts/commute_curve.py benchmarks/results docs/images/commute_training.png."""

import argparse
import csv
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot

#: Rows that a point of the curve is the mean of, and colours that the colour-blind tell apart.
SMOOTH, COLOURS = 5, {"ppo": "#0072b2", "a2c": "#d55e00"}
PANELS = (("return", "mean return of episodes that ended"), ("arrived_percent", "episodes that arrived, %"))


def main() -> None:
    """Draw two panels over the steps."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("curves", type=Path)
    parser.add_argument("out", type=Path)
    given = parser.parse_args()
    figure, panels = pyplot.subplots(1, 2, figsize=(9.0, 3.2), layout="constrained")
    for method, colour in COLOURS.items():
        with (given.curves / f"commute_{method}.csv").open(newline="") as file:
            rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
        for panel, (name, title) in zip(panels, PANELS, strict=True):
            parts = [rows[k : k + SMOOTH] for k in range(0, len(rows), SMOOTH)]
            weights = [sum(row["episodes"] for row in part) for part in parts]
            means = [
                sum(row[name] * row["episodes"] for row in part) / weight
                for part, weight in zip(parts, weights, strict=True)
            ]
            panel.plot([part[-1]["steps"] / 1e6 for part in parts], means, color=colour, label=method.upper())
            panel.set(xlabel="million steps", ylabel=title)
            panel.grid(alpha=0.3)
    panels[0].legend()
    figure.savefig(given.out, dpi=110)


if __name__ == "__main__":
    main()
