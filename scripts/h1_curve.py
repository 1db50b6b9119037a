"""Draw how H1 learnt to walk.

python scripts/h1_curve.py benchmarks/results/h1_training.csv docs/images/h1_training.png
"""

import argparse
import csv
from functools import partial
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

WIDTH, HEIGHT, LEFT, TOP, BOTTOM = 760, 300, 64, 18, 46
PANELS = (("falls per robot-minute", "falls_per_robot_minute", 60.0), ("reward for the velocity", "velocity", 1.2))
INK, SOFT, LINES = (30, 30, 34), (150, 150, 156), ((0, 90, 160), (200, 90, 0))


def _place(
    samples: float, value: float, *, box: tuple[int, int, int, int], last: float, top: float
) -> tuple[float, float]:
    """Return the pixel of a value."""
    x0, x1, y0, y1 = box
    return x0 + (x1 - x0) * samples / last, y0 + (y1 - y0) * min(value, top) / top


def main() -> None:
    """Draw two panels over millions of samples; vertical lines are where a run went on from the one before."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("curve", type=Path)
    parser.add_argument("out", type=Path)
    given = parser.parse_args()
    with given.curve.open(newline="") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    last = max(row["samples"] for row in rows) / 1e6
    picture = Image.new("RGB", (2 * WIDTH, HEIGHT * 2), "white")
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(size=22)
    wide, high = 2 * WIDTH, HEIGHT * 2
    for panel, (title, name, top) in enumerate(PANELS):
        x0, x1 = panel * wide // 2 + 2 * LEFT - 30, (panel + 1) * wide // 2 - 20
        y0, y1 = high - 2 * BOTTOM, 2 * TOP + 34

        place = partial(_place, box=(x0, x1, y0, y1), last=last, top=top)
        draw.line((*place(0, top), *place(0, 0), *place(last, 0)), INK, 2)
        for row, before in zip(rows[1:], rows[:-1], strict=True):
            if row["run"] != before["run"]:
                at = row["samples"] / 1e6
                draw.line((*place(at, 0), *place(at, top)), SOFT, 1)
        draw.line([place(row["samples"] / 1e6, row[name]) for row in rows], LINES[panel], 4)
        draw.text((x0, 8), title, INK, font)
        for k in range(5):
            value = top * k / 4
            draw.text((place(0, value)[0] - 8, place(0, value)[1]), f"{value:g}", INK, font, anchor="rm")
            draw.text((place(last * k / 4, 0)[0], y0 + 8), f"{last * k / 4:.1f}", INK, font, anchor="ma")
        draw.text(((x0 + x1) / 2, y0 + 40), "million samples of 0.02 s", INK, font, anchor="ma")
    picture.save(given.out, optimize=True)


if __name__ == "__main__":
    main()
