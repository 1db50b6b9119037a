"""Robots as links with the joints between them, so that whoever has joint angles can put every link in its place."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.assets.robots import RobotModel, robot_model, robot_names
from vico.io.mujoco import mujoco
from vico.viewer.city.models import coarse
from vico.viewer.city.pack import Blob, packed
from vico.viewer.city.textures import TextureLayers

_HINGE, _SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)


def write_robots(textures: TextureLayers, blob: Blob) -> dict[str, Any]:
    """Write all robots' links; return their entries by model's name."""
    return {name: _robot(robot_model(name), textures, blob) for name in robot_names()}


def _robot(model: RobotModel, textures: TextureLayers, blob: Blob) -> dict[str, Any]:
    """Return links in an order in which each follows its parent.

    A link's ``joints`` turn or slide it, one after the other, about ``axis`` through ``at``, both in the link's own
    frame; ``index`` is the place of the angle among the robot's measured joints, None where nobody measures it.
    """
    physics = mujoco.MjModel.from_xml_string(model.mjcf)
    measured = _measured(physics, model)
    links = []
    for body in range(1, physics.nbody):
        name = mujoco.mj_id2name(physics, mujoco.mjtObj.mjOBJ_BODY, body)
        surfaces = list(model.shapes.get(name, ()))
        links.append(
            {
                "name": name,
                "parent": int(physics.body_parentid[body]) - 1,
                "position": physics.body_pos[body].tolist(),
                "quaternion": physics.body_quat[body].tolist(),
                "joints": _joints_of(physics, body, measured),
                "rotor": _rotor(model, name),
                "near": [blob.mesh(mesh) for mesh in packed(surfaces, textures)],
                "far": [blob.mesh(mesh) for mesh in packed(coarse(surfaces, textures), textures)],
            }
        )
    # The base is placed by its recorded pose.
    links[0]["position"], links[0]["quaternion"] = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]
    return {"title": model.title, "joints": list(model.joints), "rest": model.rest.tolist(), "links": links}


def _measured(physics: mujoco.MjModel, model: RobotModel) -> dict[int, int]:
    """Return which measured joint each joint of the physics is."""
    found = {}
    for index, name in enumerate(model.joints):
        actuator = mujoco.mj_name2id(physics, mujoco.mjtObj.mjOBJ_ACTUATOR, name)
        joint = (
            int(physics.actuator_trnid[actuator, 0])
            if actuator >= 0
            else mujoco.mj_name2id(physics, mujoco.mjtObj.mjOBJ_JOINT, name)
        )
        if joint >= 0:
            found[joint] = index
    return found


def _joints_of(physics: mujoco.MjModel, body: int, measured: dict[int, int]) -> list[dict[str, Any]]:
    first = int(physics.body_jntadr[body])
    entries = []
    for joint in range(first, first + int(physics.body_jntnum[body])) if first >= 0 else ():
        kind = int(physics.jnt_type[joint])
        if kind in (_HINGE, _SLIDE):
            entries.append(
                {
                    "index": measured.get(joint),
                    "slides": kind == _SLIDE,
                    "axis": physics.jnt_axis[joint].tolist(),
                    "at": physics.jnt_pos[joint].tolist(),
                    "zero": float(physics.qpos0[physics.jnt_qposadr[joint]]),
                }
            )
    return entries


def _rotor(model: RobotModel, link: str) -> float:
    """Return 1 or -1 for links that turn with a rotor to the left or right, 0 for others."""
    if model.rotors is None or link not in model.rotors.links:
        return 0.0
    return float(np.asarray(model.rotors.turns)[model.rotors.links.index(link)])
