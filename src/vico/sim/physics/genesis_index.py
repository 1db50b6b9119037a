"""Where a robot's numbers are in Genesis' arrays, and how its motors and sites act there."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.errors import InputError
from vico.io.compiled import compiled
from vico.io.mujoco import mujoco
from vico.quaternions import matrix_of

#: How a joint is driven, as Genesis counts it: towards a position, towards a speed, by a force.
POSITION, VELOCITY, FORCE = range(3)


@compiled
def _write_targets(joints, transmission, targets, controls):  # type: ignore[no-untyped-def]
    """Write what joints follow for the motors that drive them to follow `targets`.

    Parameters
    ----------
    joints
        Degrees of freedom, and how each is driven.
    transmission
        What the motors' positions or speeds make of the joints', and the other way round.
    controls
        Positions, speeds and forces that all joints follow: written.
    """
    driven, mode = joints
    joint_of, motor_of = transmission
    for k in range(len(driven)):
        wanted = 0.0
        for motor in range(len(targets)):
            wanted += (motor_of[motor, k] if mode[k] == FORCE else joint_of[k, motor]) * targets[motor]
        for kind in range(len(controls)):
            controls[kind][driven[k]] = wanted if kind == mode[k] else 0.0


class GenesisIndex:
    """Where a robot's numbers are.

    Motors of Genesis sit on joints. A motor on a tendon of joints, such as those that drive and turn a base on two
    wheels, is there a servo of each of these joints towards the speed at which the tendons have theirs.

    Parameters
    ----------
    model
        The robot.
    spec
        The same, compiled by MuJoCo alone.
    entity
        The same in Genesis.

    Attributes
    ----------
    root, root_speed
        First of its base's position and speed.
    positions, speeds
        All its positions and speeds.
    angle, rate
        Positions and speeds of its joints, in the order of the model's `joints`, int64.
    driven
        Degrees of freedom that its motors drive, int64.
    mode
        How each of those is driven, int32.
    gain, bias, limit
        Genesis' numbers of each: force = gain * target + bias . (1, position, speed), within the limits; shapes
        ``(n,)``, ``(n, 3)``, ``(n, 2)``.
    servo
        Which of those follow angles, bool.
    links, link
        Names of all its bodies, base first; and their numbers.
    shown
        Links in the order of the model's `shapes`.
    sites
        Sites by name: row in `site_link` and the others.
    site_link, site_place, site_turn
        Link of each site, and its place and rotation in the frame of that.
    gripping
        Shapes whose friction goes before that of what they touch (tyres, feet), int64.
    weightless, lift
        Links whose weight is carried for them, and the force that does, N, shape ``(n, 3)``.
    """

    def __init__(self, model: RobotModel, spec: Any, entity: Any) -> None:
        self._offset = int(entity.dof_start), int(entity.q_start)
        self.root, self.root_speed = int(entity.q_start), int(entity.dof_start)
        self.positions = slice(self.root, self.root + int(entity.n_qs))
        self.speeds = slice(self.root_speed, self.root_speed + int(entity.n_dofs))
        names = [link.name for link in entity.links]
        self.links = tuple(names)
        self.link = np.array([link.idx for link in entity.links], np.int64)
        of = dict(zip(names, self.link.tolist(), strict=True))
        self.shown = np.array([of[name] for name in model.shapes], np.int64)
        self._dof = {joint.name: int(joint.dofs_idx[0]) for joint in entity.joints if joint.n_dofs == 1}
        self._q = {joint.name: int(joint.qs_idx[0]) for joint in entity.joints if joint.n_dofs == 1}
        measured = [_joint_name(spec, name, driven=name in model.driven) for name in model.joints]
        self.angle = np.array([self._q[name] for name in measured], np.int64)
        self.rate = np.array([self._dof[name] for name in measured], np.int64)
        self._index_motors(model, spec)
        self._index_sites(spec, of)
        self.gripping = _gripping(spec, entity)
        carried = np.flatnonzero(spec.body_gravcomp > 0.0)
        self.weightless = np.array([of[spec.body(k).name] for k in carried.tolist()], np.int64)
        self.lift = np.zeros((len(carried), 3))
        self.lift[:, 2] = spec.body_mass[carried] * spec.body_gravcomp[carried] * -spec.opt.gravity[2]

    def _index_motors(self, model: RobotModel, spec: Any) -> None:
        """Note what each motor drives, and make of motors on tendons servos of joints."""
        actuators = [spec.actuator(name).id for name in model.driven]
        through: dict[int, NDArray[np.float64]] = {}  # joint -> how much of it is in each motor
        for row, actuator in enumerate(actuators):
            for joint, share in _transmission(spec, actuator):
                through.setdefault(joint, np.zeros(len(actuators)))[row] += share
        joints = list(through)
        #: What the speeds of the driven joints make of the speeds of the motors, shape ``(motors, n)``.
        of_joint = np.array([through[joint] for joint in joints]).reshape(len(joints), len(actuators))
        self._motor_of = np.ascontiguousarray(of_joint.T)
        self._joint_of = np.ascontiguousarray(np.linalg.pinv(self._motor_of))
        self.driven = np.array([self._dof[spec.joint(joint).name] for joint in joints], np.int64)
        count = len(joints)
        self.mode = np.zeros(count, np.int32)
        self.gain, self.bias = np.zeros(count), np.zeros((count, 3))
        self.limit = np.tile([-np.inf, np.inf], (count, 1))
        follows = dict(zip(model.driven, _servos(model), strict=True))
        modes = {"position": POSITION, "velocity": VELOCITY, "force": FORCE}
        for k in range(count):
            mine = np.flatnonzero(self._motor_of[:, k])
            share = np.abs(self._motor_of[mine, k])
            motors = [actuators[row] for row in mine]
            servos = {follows[model.driven[row]] for row in mine}
            if len(servos) > 1 or (len(mine) > 1 and servos != {"velocity"}):
                raise InputError(
                    f"physics: joint {spec.joint(joints[k]).name!r} of robot {model.name!r} has motors of several "
                    "kinds, which Genesis has not; take --physics mujoco"
                )
            self.mode[k] = modes[servos.pop()]
            # As stiff as the stiffest of its motors is to the joints that turn together in it.
            stiff = [
                float(spec.actuator_gainprm[motor, 0] * s * np.abs(self._motor_of[row]).sum())
                for motor, row, s in zip(motors, mine, share, strict=True)
            ]
            self.gain[k] = max(stiff)
            if len(mine) == 1 and share[0] == 1.0:
                self.gain[k] = spec.actuator_gainprm[motors[0], 0]
                self.bias[k] = spec.actuator_biasprm[motors[0], :3]
            else:
                self.bias[k, 2] = -self.gain[k]
            if all(spec.actuator_forcelimited[motor] for motor in motors):
                most = float(np.sum(share * spec.actuator_forcerange[motors, 1]))
                self.limit[k] = -most, most
        self.servo = self.mode == POSITION

    def _index_sites(self, spec: Any, of: dict[str, int]) -> None:
        self.sites = {spec.site(k).name: k for k in range(spec.nsite)}
        bodies = [spec.body(int(body)).name for body in spec.site_bodyid]
        self.site_link = np.array([of[name] for name in bodies], np.int64)
        self.site_place = np.array(spec.site_pos, np.float64).reshape(-1, 3)
        self.site_turn = matrix_of(np.array(spec.site_quat, np.float64).reshape(-1, 4)).reshape(-1, 3, 3)

    def follow(self, targets: NDArray[np.float64], controls: tuple[NDArray[np.float64], ...]) -> None:
        """Have the motors follow `targets`: write what their joints do into `controls`, by `mode`."""
        _write_targets((self.driven, self.mode), (self._joint_of, self._motor_of), targets, controls)

    def motor_forces(self, forces: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the motors' forces, given the driven joints'."""
        return self._joint_of.T @ forces


def _gripping(spec: Any, entity: Any) -> NDArray[np.int64]:
    """Return shapes with a priority. Genesis has those of a link that touch anything in MuJoCo's order."""
    found: list[int] = []
    for link in entity.links:
        body = spec.body(link.name)
        first, count = int(body.geomadr[0]), int(body.geomnum[0])
        touching = [k for k in range(first, first + count) if spec.geom_contype[k] or spec.geom_conaffinity[k]]
        found += [geom.idx for geom, k in zip(link.geoms, touching, strict=True) if spec.geom_priority[k] > 0]
    return np.array(found, np.int64)


def _servos(model: RobotModel) -> list[str]:
    """Return what each driven motor follows."""
    of = dict(zip(model.motors, model.servos, strict=True))
    return [of[name] for name in model.driven]


def _transmission(spec: Any, actuator: int) -> list[tuple[int, float]]:
    """Joints an actuator drives, and how much of it goes into each."""
    kind, target = int(spec.actuator_trntype[actuator]), int(spec.actuator_trnid[actuator, 0])
    gear = float(spec.actuator_gear[actuator, 0])
    if kind == int(mujoco.mjtTrn.mjTRN_JOINT):
        return [(target, gear)]
    if kind == int(mujoco.mjtTrn.mjTRN_TENDON):
        first, count = int(spec.tendon_adr[target]), int(spec.tendon_num[target])
        rows = range(first, first + count)
        if all(spec.wrap_type[k] == int(mujoco.mjtWrap.mjWRAP_JOINT) for k in rows):
            return [(int(spec.wrap_objid[k]), gear * float(spec.wrap_prm[k])) for k in rows]
    name = spec.actuator(actuator).name
    raise InputError(f"physics: motor {name!r} drives no joints, which Genesis' motors do; take --physics mujoco")


def _joint_name(spec: Any, name: str, *, driven: bool) -> str:
    """Return the name of a joint: of the one an actuator drives, or the one that has the name itself."""
    return str(spec.joint(int(spec.actuator_trnid[spec.actuator(name).id, 0])).name if driven else name)
