"""Draw a contact sheet of models: every one alone on a pavement, with its name.

python scripts/model_sheet.py docs/images/things.png
python scripts/model_sheet.py --room indoor out/furniture.png
python scripts/model_sheet.py --room carried docs/images/carried.png

Models of the folder that VICO_DATA names are among them, so it shows what one has added.
"""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from vico.assets.models.library import furniture_models, street_models
from vico.assets.models.model import Model
from vico.assets.models.model import model as model_of
from vico.assets.models.movable import movable_colours, movable_kinds, movable_surfaces
from vico.assets.shapes import box
from vico.render import Cameras, Scene, render

SIDE, LABEL, COLUMNS = 104, 16, 13  # pixels, and models in a row
GROUND = (196, 192, 184)
FIELD_OF_VIEW = np.radians(24.0)
TOWARDS = np.array([0.78, -0.5, 0.38])  # where the camera is, seen from the model: people use things from +x


def carried_models() -> dict[str, Model]:
    """Return the things that people carry, each in a colour of its own."""
    colours = list(movable_colours())
    painted = {kind: colours[k % len(colours)] for k, kind in enumerate(movable_kinds())}
    return {kind: model_of(kind, movable_surfaces(kind, colour)) for kind, colour in painted.items()}


ROOMS = {"outdoor": street_models, "indoor": furniture_models, "carried": carried_models}


def main() -> None:
    """Draw the models of a room."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="picture to write")
    parser.add_argument("--room", choices=tuple(ROOMS), default="outdoor")
    arguments = parser.parse_args()
    models = ROOMS[arguments.room]()
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    sheet(models).save(arguments.out, optimize=True)


def sheet(models: dict[str, Model]) -> Image.Image:
    """Return the pictures of models in rows, each with its name below."""
    rows = -(-len(models) // COLUMNS)
    picture = Image.new("RGB", (COLUMNS * SIDE, rows * (SIDE + LABEL)), "white")
    draw = ImageDraw.Draw(picture)
    font = ImageFont.load_default(size=9.5)
    for k, (name, model) in enumerate(models.items()):
        x, y = k % COLUMNS * SIDE, k // COLUMNS * (SIDE + LABEL)
        picture.paste(Image.fromarray(portrait(model)), (x, y))
        draw.text((x + 3, y + SIDE + 1), name.replace("_", " "), fill="black", font=font)
    return picture


def portrait(model: Model) -> NDArray[np.uint8]:
    """Return a picture of a model alone, uint8, shape ``(SIDE, SIDE, 3)``."""
    low, high = model.bounds
    middle, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    pavement = box((400.0, 400.0, 0.1), (0.0, 0.0, min(float(low[2]), 0.0) - 0.05), colour=GROUND)
    scene = Scene([pavement], {model.name: model.surfaces})
    scene.place([model.name], np.eye(4)[None], [1])
    away = TOWARDS / np.linalg.norm(TOWARDS) * radius / np.sin(FIELD_OF_VIEW / 2)
    camera = Cameras((middle + away)[None], -away[None], fov_y=float(FIELD_OF_VIEW), width=SIDE, height=SIDE)
    return render(scene, camera, depth=False, segmentation=False, samples=3).rgb[0]


if __name__ == "__main__":
    main()
