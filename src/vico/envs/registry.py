"""Environments by id: ``gymnasium.make("vico/Community-v0", ...)`` and PettingZoo's registry where it has one."""

from __future__ import annotations

import gymnasium
import pettingzoo

#: One agent among residents (Gymnasium), and everybody at once (PettingZoo, parallel).
ID = "vico/Community-v0"


#: Tasks for one learner, by id, and what makes them in `vico.challenges.learning.make`: that stands on a higher floor,
#: and is imported when one is made.
TASKS = {
    "vico/PointGoal-v0": "make_point_goal",
    "vico/RobotPointGoal-v0": "make_robot_point_goal",
    "vico/Commute-v0": "make_commute",
    "vico/Carry-v0": "make_carry",
    "vico/Delivery-v0": "make_delivery",
    "vico/Search-v0": "make_search",
    "vico/RobotCarry-v0": "make_robot_carry",
    "vico/RobotDeliver-v0": "make_robot_deliver",
    "vico/Influence-v0": "make_influence",
}
#: Tasks for two robots at once, in PettingZoo's registry.
TEAM_TASKS = {
    "vico/RobotCarry-v0": "make_robot_carry_team",
    "vico/RobotDeliver-v0": "make_robot_deliver_team",
}
_LEARNING = "vico.challenges.learning.make"
#: Tasks of an arm and a box, which need no world, and what makes them.
ARM_TASKS = {
    "vico/Reach-v0": "make_reach",
    "vico/Lift-v0": "make_lift",
    "vico/Place-v0": "make_place",
    "vico/PickPlace-v0": "make_pick_place",
}
_MANIPULATION = "vico.challenges.learning.manipulation.make"


def register_ids() -> None:
    """Register the environments; once is enough, and more does no harm.

    They take a world's folder as `world`, a community's as `community` where people are needed, and the options of
    `vico.envs.spec.EnvSpec`; those of `ARM_TASKS` take neither, but `ManipulationOptions`.
    """
    if ID not in gymnasium.registry:
        # The checks of Gymnasium's own wrapper would refuse the short form of actions.
        gymnasium.register(
            ID,
            entry_point="vico.agents.single:make_single",
            vector_entry_point="vico.agents.single:make_vec",
            disable_env_checker=True,
        )
    for module, tasks in ((_LEARNING, TASKS), (_MANIPULATION, ARM_TASKS)):
        for name, maker in tasks.items():
            if name not in gymnasium.registry:
                gymnasium.register(
                    name,
                    entry_point=f"{module}:{maker}",
                    vector_entry_point=f"{module}:{maker}_vec",
                    disable_env_checker=True,
                )
    registry = getattr(pettingzoo, "parallel_registry", None)
    if registry is None:
        return
    teams = {name: f"{_LEARNING}:{maker}" for name, maker in TEAM_TASKS.items()}
    for name, entry_point in ({ID: "vico.envs.parallel:make"} | teams).items():
        if name not in registry:
            pettingzoo.register("parallel", name, entry_point=entry_point)
