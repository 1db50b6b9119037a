"""Drive a Husky with a parcel on its deck by goals, and a Go2 by velocities from what it feels of itself.

python examples/04_robots.py --world out/demo/world --steps 60
"""

import argparse
import math
from pathlib import Path

import numpy as np

import vico
from vico.assets.shapes import box
from vico.world.folder import read_world

SIZE = (0.3, 0.25, 0.2)


class Patroller:
    """Walks a square by the pose its odometry gives, in metres a second and radians a second."""

    def __init__(self, side: float) -> None:
        self.side = side
        self.corners = []

    def act(self, observation: dict) -> dict:
        """Walk towards the next corner, turning as one goes."""
        x, y, _, w, qx, qy, z = observation["sensors"]["base_pose"]
        if observation["sensors"]["fallen"][0]:
            return {"type": "stop"}
        if not self.corners:
            s = self.side
            self.corners = [(x + s, y), (x + s, y + s), (x, y + s), (x, y)]
        if math.dist(self.corners[0], (x, y)) < 0.6:
            self.corners.append(self.corners.pop(0))
        yaw = math.atan2(2 * (w * z + qx * qy), 1 - 2 * (qy * qy + z * z))
        goal = self.corners[0]
        error = math.remainder(math.atan2(goal[1] - y, goal[0] - x) - yaw, math.tau)
        forward = 0.6 if abs(error) < 0.6 else 0.0
        return {"vector": np.array([forward, 0.0, np.clip(error, -1.0, 1.0)], np.float32)}


def put_parcel(sim) -> None:
    """Stand the assistant beside the Husky, with a parcel at its feet."""
    robot = sim.state.robots.bodies()
    sim.scenario.place_agent("assistant_0", robot.position[0] + (0.0, 1.0, 0.0))
    feet = sim.state.people.position[0]
    sim.scenario.add_object("parcel", "parcel", [box(SIZE, (0, 0, SIZE[2] / 2))], feet, size=SIZE)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--world", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=60)
    arguments = parser.parse_args()

    world = read_world(arguments.world)
    env = vico.make(world, assistants=1, robots=("husky", "go2:velocity"), setup=put_parcel, observe="none", seed=4)
    for name in ("robot_0", "robot_1"):
        space = env.action_space(name)["vector"]
        print(f"{name}: {space.low} to {space.high}")
    observations, _ = env.reset(seed=4)
    truth = env.sim  # for this demonstration's last line; agents are given observations alone
    parcel, husky = (int(entity[0]) for entity in (truth.state.objects.entity, truth.state.robots.bodies().entity))
    start = truth.ground_truth.object_position("parcel")

    patrol = Patroller(side=4.0)
    here = observations["robot_0"]["pose"][:2]
    places = sorted(world.places, key=lambda place: math.dist(place.position[:2], here))
    goal = next(place for place in places if math.dist(place.position[:2], here) > 30.0)
    for step in range(arguments.steps):
        actions = {"robot_1": patrol.act(observations["robot_1"])}
        if step == 0:
            actions["assistant_0"] = {"type": "pick", "hand": 0, "object": parcel}
        elif step == 1:
            actions["assistant_0"] = {"type": "put", "hand": 0, "target": husky}
        elif step == 2:
            actions["robot_0"] = {"type": "go_to", "target": [*goal.position]}
        observations, *_ = env.step(actions)
        for name in actions:
            told = observations[name]["state"]
            if told["action_status"] == "refused":
                print(f"{name}: {told['action_reason']}")
    moved = math.dist(truth.ground_truth.object_position("parcel")[:2], start[:2])
    print(f"the parcel went {moved:.1f} m towards {goal.name}")
    print(f"state {env.state_hash()}")


if __name__ == "__main__":
    main()
