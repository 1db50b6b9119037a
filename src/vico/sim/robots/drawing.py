"""What can be seen and met of robots: their outlines, links, cameras and decks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.exact import apply_matrix
from vico.sim.bodies import Bodies, Drawn
from vico.sim.carrying import DeckPose
from vico.sim.robots.state import RobotRun
from vico.world.mesh import Surface

#: Metres a robot has to be above where it stands on the ground to count as being in the air.
_AIRBORNE = 0.5


def bodies_of(run: RobotRun) -> Bodies:
    """Return upright boxes around the robots: on the ground, or where they fly."""
    outlines = run.scene.outlines
    bases = [run.engine.base(i) for i in range(len(run.entities))]
    position = np.array([base.position for base in bases]).reshape(-1, 3)
    ground = run.scene.world.height(position)
    bottom = position[:, 2] - outlines.stand
    position[:, 2] = np.where(bottom > ground + _AIRBORNE, bottom, ground)
    return Bodies(
        run.entities,
        outlines.kind,
        position,
        np.array([base.yaw for base in bases]),
        outlines.half_length,
        outlines.half_width,
        outlines.height,
        np.array([base.velocity for base in bases]).reshape(-1, 3)[:, :2].copy(),
    )


def prototypes_of(models: Sequence[RobotModel]) -> dict[str, list[Surface]]:
    """Return the shapes of all links, by ``robot/<model>/<link>``."""
    return {
        f"robot/{model.name}/{link}": list(surfaces)
        for model in {model.name: model for model in models}.values()
        for link, surfaces in model.shapes.items()
    }


def drawn_links(run: RobotRun) -> Drawn:
    """Return the poses of all links."""
    names = list(prototypes_of(run.scene.models))
    index: list[int] = []
    entity: list[int] = []
    transforms = [np.zeros((0, 4, 4))]
    for i, model in enumerate(run.scene.models):
        index += [names.index(f"robot/{model.name}/{link}") for link in model.shapes]
        entity += [int(run.entities[i])] * len(model.shapes)
        transforms.append(run.engine.links(i))
    return Drawn(
        names, np.array(index, np.int32), np.concatenate(transforms).astype(np.float32), np.array(entity, np.int32)
    )


def camera_heights(run: RobotRun) -> NDArray[np.float64]:
    """Height of each robot's camera above its body's bottom, metres; of the base's where there is no camera."""
    eyes = np.array([_eye(run, i) for i in range(len(run.scene))]).reshape(-1, 3)
    return np.asarray(eyes[:, 2] - bodies_of(run).position[:, 2])


def _eye(run: RobotRun, robot: int) -> NDArray[np.float64]:
    base, camera = run.engine.base(robot), run.scene.models[robot].sensors.camera
    return base.position if camera is None else base.position + apply_matrix(camera, base.rotation)


def deck_of(run: RobotRun, entity: int) -> DeckPose | None:
    """Return the deck of the robot with an entity; None if it has none."""
    for i in np.flatnonzero(run.entities == entity):
        deck, base = run.scene.models[i].deck, run.engine.base(int(i))
        if deck is not None:
            return DeckPose(base.position, base.rotation, np.array(deck.centre), deck.length, deck.width)
    return None
