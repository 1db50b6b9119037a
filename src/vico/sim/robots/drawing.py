"""Robots in pictures and collisions: their outlines, links, cameras and decks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.exact import apply_matrix
from vico.sim.bodies.arrays import Drawn
from vico.sim.bodies.collisions import DeckPose
from vico.sim.robots.flying import flight_of
from vico.sim.robots.state import RobotRun
from vico.world.mesh import Surface


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
        if model.rotors is not None:
            _turn_rotors(run, i, model, transforms[-1])
    return Drawn(
        names, np.array(index, np.int32), np.concatenate(transforms).astype(np.float32), np.array(entity, np.int32)
    )


def _turn_rotors(run: RobotRun, robot: int, model: RobotModel, transforms: NDArray[np.float64]) -> None:
    """Turn the links that turn with rotors as far as these have turned."""
    found = flight_of(run, robot)
    assert found is not None
    assert model.rotors is not None
    flight, row = found
    links, turned = list(model.shapes), flight.arrays.turned[row] * model.rotors.turns
    for link, angle in zip(model.rotors.links, turned.tolist(), strict=True):
        pose = transforms[links.index(link)]
        c, s = np.cos(angle), np.sin(angle)
        pose[:3, :2] = np.stack([c * pose[:3, 0] + s * pose[:3, 1], c * pose[:3, 1] - s * pose[:3, 0]], axis=1)


def cameras(run: RobotRun) -> NDArray[np.float64]:
    """Where each robot's camera is, ENU metres, and the unit vector it looks along, shape ``(n, 6)``.

    They are held level but for their pitch. Without a camera: at the base's origin.
    """
    found = np.empty((len(run.scene), 6))
    for robot, model in enumerate(run.scene.models):
        base, camera = run.engine.base(robot), model.sensors.camera
        yaw, pitch = base.yaw, model.sensors.camera_pitch
        found[robot, :3] = base.position if camera is None else base.position + apply_matrix(camera, base.rotation)
        found[robot, 3:] = np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)
    return found


def deck_of(run: RobotRun, entity: int) -> DeckPose | None:
    """Return the deck of the robot with an entity; None if it has none."""
    for i in np.flatnonzero(run.entities == entity):
        deck, base = run.scene.models[i].deck, run.engine.base(int(i))
        if deck is not None:
            return DeckPose(base.position, base.rotation, np.array(deck.centre), deck.length, deck.width)
    return None
