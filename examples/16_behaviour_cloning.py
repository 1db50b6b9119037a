"""Train a small network on recorded demonstrations, and have it judged in the challenge: docs/datasets.md.

python examples/16_behaviour_cloning.py --dataset demos --worlds helsinki --out cloned --seeds 10

The network is a perceptron in NumPy. It is given what a frame of the dataset holds (state, goal, depth, whether the
thing that is asked for is in view) and where the way leads that the public map knows, and learns which action comes
next, and how far or by which angle. Ids are not learnt: a door is entered that can be, a part is reported that is asked
for.
"""

import argparse
import json
import math
import os
from itertools import pairwise
from pathlib import Path

import numpy as np

from vico.agents.base import generator_state, restore_generator
from vico.datasets.vectors import PERSON_STATE, ActionForm, goal_vector, in_own_frame, person_state
from vico.seeds import rng

WEIGHTS = "VICO_CLONED_WEIGHTS"  # environment variable: the file that `train` wrote
FORM = ActionForm()
TURNS = ("turn_left", "turn_right")
STATE = [
    PERSON_STATE.index(name) for name in ("indoors", "holds.left", "holds.right", "last.collision", "last.refused")
]
PICTURE = 64  # pixels
AHEAD = 6.0  # metres along the way that the network is shown
TEMPERATURE = 0.5
ARRIVED = 4.0  # metres from the middle of a region, whose steps there are counted


class Way:
    """Where the shortest way to a point leads, by the public map."""

    def __init__(self, public_map) -> None:
        self.map, self.goal, self.line = public_map, None, None

    def ahead(self, position, goal):
        """Return a point some metres ahead on the way; the goal itself where there is none."""
        here = np.asarray(position[:2])
        if self.line is not None and self.goal == tuple(goal[:2]):
            nearest = int(np.argmin(np.hypot(*(self.line - here).T)))
            if math.dist(self.line[nearest], here) < 2 * AHEAD:
                reach = round(AHEAD)  # the line has a point each metre
                return self.line[min(nearest + reach, len(self.line) - 1)]
        self.goal = tuple(goal[:2])
        path = self.map.router.path(tuple(here), self.goal)
        self.line = None if path is None else densified(np.asarray(path, np.float64)[:, :2])
        return np.asarray(goal[:2]) if self.line is None else self.line[min(round(AHEAD), len(self.line) - 1)]


def densified(line):
    """Return a line with a point each metre."""
    lengths = np.r_[0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T))]
    at = np.r_[np.arange(0.0, lengths[-1], 1.0), lengths[-1]]
    return np.column_stack([np.interp(at, lengths, line[:, axis]) for axis in range(2)])


def polar(forward, left):
    """Return what a network makes easy use of: direction and distance of a point on the ground."""
    away = math.hypot(forward, left)
    angle = math.atan2(left, forward)
    return [math.cos(angle), math.sin(angle), angle / math.pi, math.log1p(away) / 5.0]


def depth_features(depth):
    """Return how far the nearest thing is in twelve columns of the upper and the lower half, 0 far, 1 near."""
    far = np.where(depth > 0.0, depth, 600.0)
    edges = np.linspace(0, depth.shape[1], 13).astype(int)
    bands = (far[depth.shape[0] // 4 : depth.shape[0] // 2], far[depth.shape[0] // 2 : 3 * depth.shape[0] // 4])
    return [1.0 / (1.0 + float(band[:, a:b].min())) for band in bands for a, b in pairwise(edges)]


def target_features(depth, segmentation, wanted):
    """Return whether something that is asked for is in view, how large it is, and where."""
    seen = np.isin(segmentation, wanted) if len(wanted) else np.zeros(segmentation.shape, bool)
    if not seen.any():
        return [0.0] * 6
    _, columns = np.nonzero(seen)
    away = float(np.median(depth[seen]))
    left = (depth.shape[1] / 2 - columns.mean()) / (depth.shape[1] / 2) * away  # the usual lens sees 90 degrees
    return [1.0, math.log1p(seen.sum()) / 5.0, *polar(away, left)]


class Memory:
    """What the network is told of the steps before: how often it turned, and how long it has been there.

    Not the last action: who repeats that is right most of the time in demonstrations, and stuck for good in the street.
    """

    def __init__(self) -> None:
        self.turned, self.there = 0, 0

    def features(self):
        """Return it as numbers."""
        return [min(self.turned, 12) / 12.0, min(self.there, 30) / 30.0]

    def note(self, kind, goal_away):
        """Take note of an action."""
        self.turned = self.turned + 1 if kind in TURNS else 0
        self.there = self.there + 1 if goal_away < ARRIVED else 0


def features(state, goal, ahead, pictures, wanted, memory):
    """Return all that the network is given of a frame."""
    pose = pose_of(state)
    forward, left, _ = in_own_frame(pose, (*ahead, pose[2]))
    own = [*(float(state[k]) for k in STATE), float(goal[5]), float(goal[4]) / 15.0, float(goal[3]) / 10.0]
    way = [*polar(forward, left), *polar(goal[1], goal[2])]
    sight = [*depth_features(pictures["depth"]), *target_features(pictures["depth"], pictures["segmentation"], wanted)]
    return np.array([*own, *way, *sight, *memory.features()], np.float32)


def pose_of(state):
    """Return x, y, z and yaw of a state vector."""
    x, y, z, east, north = (float(value) for value in state[:5])
    return x, y, z, math.atan2(north, east)


class Network:
    """Two hidden layers; answers with scores of the actions, a distance and an angle."""

    def __init__(self, arrays) -> None:
        self.arrays = arrays

    @classmethod
    def fresh(cls, width, hidden=128, seed=0):
        """Return one that knows nothing yet."""
        draw = rng(seed, "behaviour cloning")
        sizes = (width, hidden, hidden, len(FORM.types) + 2)
        arrays = {}
        for k, (a, b) in enumerate(pairwise(sizes)):
            arrays[f"w{k}"] = (draw.normal(size=(a, b)) * math.sqrt(2.0 / a)).astype(np.float32)
            arrays[f"b{k}"] = np.zeros(b, np.float32)
        return cls(arrays)

    def layers(self, x):
        """Return what every layer makes of inputs, the inputs first."""
        found = [x]
        for k in range(3):
            y = found[-1] @ self.arrays[f"w{k}"] + self.arrays[f"b{k}"]
            found.append(np.maximum(y, 0.0) if k < 2 else y)
        return found

    def gradients(self, x, kind, amount, weight):
        """Return loss and gradients of a batch: which action, by its weight, and how far where that counts."""
        layers = self.layers(x)
        out = layers[-1]
        n = len(x)
        scores = out[:, :-2] - out[:, :-2].max(axis=1, keepdims=True)
        shares = np.exp(scores)
        shares /= shares.sum(axis=1, keepdims=True)
        loss = (-np.log(shares[np.arange(n), kind] + 1e-9) * weight[kind]).mean()
        slope = np.zeros_like(out)
        slope[:, :-2] = shares
        slope[np.arange(n), kind] -= 1.0
        slope *= weight[kind][:, None]
        off = np.where(np.isnan(amount), 0.0, out[:, -2:] - np.nan_to_num(amount))
        slope[:, -2:] = 4.0 * off
        slope /= n
        found = {}
        for k in (2, 1, 0):
            found[f"w{k}"], found[f"b{k}"] = layers[k].T @ slope, slope.sum(axis=0)
            if k:
                slope = (slope @ self.arrays[f"w{k}"].T) * (layers[k] > 0.0)
        return loss + 2.0 * (off**2).sum() / n, found


def train(dataset, public_map_of, *, epochs=60, failures=False, seed=0):
    """Return a network, its inputs' mean and spread, and the loss of each epoch."""
    inputs, kinds, amounts = frames_of(dataset, public_map_of, failures=failures)
    middle, spread = inputs.mean(axis=0), inputs.std(axis=0) + 0.05
    inputs = (inputs - middle) / spread
    network, draw = Network.fresh(inputs.shape[1], seed=seed), rng(seed, "batches")
    count = np.bincount(kinds, minlength=len(FORM.types))
    weight = np.where(count > 0, (count.max() / np.maximum(count, 1)) ** 0.25, 1.0)  # rare actions count a little more
    moments = {name: (np.zeros_like(array), np.zeros_like(array)) for name, array in network.arrays.items()}
    losses, step = [], 0
    for epoch in range(epochs):
        rate = 1e-3 * (1.0 - epoch / epochs) + 1e-5
        order, total = draw.permutation(len(inputs)), 0.0
        for batch in np.array_split(order, max(1, len(order) // 256)):
            noisy = inputs[batch] + 0.05 * draw.normal(size=(len(batch), inputs.shape[1])).astype(np.float32)
            loss, found = network.gradients(noisy, kinds[batch], amounts[batch], weight)
            total += loss * len(batch)
            step += 1
            for name, slope in found.items():  # Adam
                first, second = moments[name]
                first += 0.1 * (slope - first)
                second += 0.001 * (slope**2 - second)
                scaled = first / (1 - 0.9**step) / (np.sqrt(second / (1 - 0.999**step)) + 1e-8)
                network.arrays[name] -= (rate * scaled).astype(np.float32)
        losses.append(total / len(inputs))
    return network, middle, spread, losses


def frames_of(dataset, public_map_of, split="train", *, failures=False):
    """Return inputs, actions' numbers, and distances and angles (NaN where an action has none), of a split."""
    first, end = dataset.about.splits[split]
    rows = dataset.episodes()
    inputs, kinds, amounts = [], [], []
    for index in range(first, end):
        if not (failures or rows[index]["success"]):
            continue  # what did not lead to success is not to be learnt
        names = dataset.entities(index)
        text = rows[index]["instructions"][0]
        wanted = [entity for entity, (kind, name) in names.items() if kind == "object" and name in text]
        way, memory = Way(public_map_of(rows[index]["world_digest"])), Memory()
        for frame in dataset.frames(index):
            state, goal = np.array(frame["observation.state"]), np.array(frame["observation.environment_state"])
            pose = pose_of(state)
            action = FORM.decode(frame["action"], pose, frame.get("action.text") or "")
            ahead = way.ahead(pose, centre_of(pose, goal))
            if action["type"] == "wait":  # which the demonstrator does where it can do nothing else, as in doors
                continue
            inputs.append(features(state, goal, ahead, frame["pictures"], wanted, memory))
            kinds.append(FORM.types.index(action["type"]))
            distance = action["distance"] / 2.5 if action["type"] == "move_forward" else math.nan
            amounts.append([distance, action.get("degrees", math.nan) / 180.0])
            memory.note(action["type"], math.hypot(goal[1], goal[2]))
    if not inputs:
        raise SystemExit(f"{dataset.path}: no episode of the split {split!r} was a success; --failures takes all")
    return np.array(inputs), np.array(kinds), np.array(amounts, np.float32)


def agreement(network, middle, spread, inputs, kinds):
    """Return in which share of frames the network's first choice is what the demonstrator did."""
    return float(np.mean(network.layers((inputs - middle) / spread)[-1][:, :-2].argmax(axis=1) == kinds))


def centre_of(pose, goal):
    """Return the middle of the region to go to, ENU metres: the goal vector has it in the agent's own frame."""
    c, s = math.cos(pose[3]), math.sin(pose[3])
    return pose[0] + c * goal[1] - s * goal[2], pose[1] + s * goal[1] + c * goal[2]


class Cloned:
    """Does what the network says, as `vico eval` asks any agent."""

    def __init__(self, public_map, instructions, seed):
        with np.load(os.environ[WEIGHTS], allow_pickle=False) as kept:
            self.network = Network({name: kept[name] for name in kept.files if name[0] in "wb"})
            self.middle, self.spread = kept["middle"], kept["spread"]
        self.todo = list(instructions)
        self.way, self.memory, self.visited = Way(public_map), Memory(), []
        self.draw = rng(seed, "cloned")

    def act(self, observation, info):
        """Return the action that the network finds most fitting."""
        if not self.todo or info.get("coming_out"):
            return {"type": "wait"}
        errand = self.todo[0]
        state = person_state(observation)
        pose = pose_of(state)
        goal = goal_vector(pose, errand)
        step = observation["depth"].shape[0] // PICTURE
        pictures = {name: observation[name][step // 2 :: step, step // 2 :: step] for name in ("depth", "segmentation")}
        wanted = [entity for entity, about in info["entities"].items() if about["name"] in errand["text"]]
        ahead = self.way.ahead(pose, centre_of(pose, goal))
        inputs = (features(state, goal, ahead, pictures, wanted, self.memory) - self.middle) / self.spread
        action = self.action(self.network.layers(inputs[None])[-1][0], observation, errand)
        self.memory.note(action["type"], math.hypot(goal[1], goal[2]))
        return action

    def action(self, out, observation, errand):
        """Return an action that can be done here, drawn by the scores: whoever always does the same stays stuck."""
        state = observation["state"]
        doors = [door["to"] for door in state["doors"] if door["to"] != "outside"]
        scores = out[:-2] + TEMPERATURE * self.draw.gumbel(size=len(FORM.types))
        for kind in (FORM.types[k] for k in np.argsort(-scores)):
            if kind == "move_forward":
                return {"type": kind, "distance": float(np.clip(2.5 * out[-2], 0.1, 2.0))}
            if kind in TURNS:
                return {"type": kind, "degrees": float(np.clip(180.0 * out[-1], 5.0, 180.0))}
            if kind == "enter" and not state["room"] and errand["sources"][0]["place"] in state["accessible_places"]:
                return {"type": kind, "place": errand["sources"][0]["place"]}
            if kind == "enter" and state["room"] and doors:
                self.visited.append(state["room"])
                doors.sort(key=self.visited.count)  # where one has been least
                return {"type": kind, "place": doors[0]}
            if kind == "task_complete":
                self.todo.pop(0)
                return {"type": kind, "index": errand["index"]}
        return {"type": "wait"}

    def state(self):
        """Return all it remembers."""
        memory = {"turned": self.memory.turned, "there": self.memory.there}
        return {
            "todo": len(self.todo),
            "visited": list(self.visited),
            "memory": memory,
            "generator": generator_state(self.draw),
        }

    def restore(self, state):
        """Remember what `state` returned."""
        self.todo = self.todo[len(self.todo) - state["todo"] :] if state["todo"] else []
        self.visited = list(state["visited"])
        restore_generator(self.draw, state["generator"])
        for name, value in state["memory"].items():
            setattr(self.memory, name, value)


def main() -> None:
    # An agent's module may not import these: they hold the truth. Only who trains and judges it does.
    from vico.challenges.evaluation import evaluate, jobs_for
    from vico.challenges.records import load_challenge
    from vico.challenges.tables.results import write_results
    from vico.datasets.folder import Dataset
    from vico.runner.foreign import Terms
    from vico.world.folder import read_world
    from vico.world.public import PublicMap

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dataset", type=Path, required=True)
    parser.add_argument("--worlds", type=Path, nargs="+", required=True, help="those of the dataset")
    parser.add_argument("--judge-in", type=Path, nargs="+", help="worlds to be judged in; all of them without")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first-seed", type=int, default=1000, help="none of the dataset's")
    parser.add_argument("--steps", type=int, default=150)
    parser.add_argument("--epochs", type=int, default=60)
    parser.add_argument("--failures", action="store_true", help="train on episodes that failed, too")
    arguments = parser.parse_args()

    dataset = Dataset(arguments.dataset)
    worlds = {world.digest: PublicMap.from_world(world) for world in map(read_world, arguments.worlds)}
    network, middle, spread, losses = train(
        dataset, worlds.__getitem__, epochs=arguments.epochs, failures=arguments.failures
    )
    print(f"trained on {dataset.about.episodes} episodes: loss {losses[0]:.2f} -> {losses[-1]:.2f}")
    if "test" in dataset.about.splits:
        inputs, kinds, _ = frames_of(dataset, worlds.__getitem__, "test")
        share = agreement(network, middle, spread, inputs, kinds)
        usual = np.bincount(kinds).max() / len(kinds)
        print(f"type of the next action, test split: {share:.0%} right; always the most frequent one: {usual:.0%}")
    arguments.out.mkdir(parents=True, exist_ok=True)
    weights = arguments.out / "weights.npz"
    np.savez(weights, **network.arrays, middle=middle, spread=spread)
    os.environ[WEIGHTS] = str(weights.resolve())

    mine = f"{Path(__file__).resolve()}:Cloned"
    setting = {"assistants": 1, "advanced": False, "distance": True, "steps": arguments.steps, "subtasks": 1}
    jobs = jobs_for(
        "assistant",
        categories=(dataset.about.made["category"],),
        methods=(mine, "heuristic", "random"),
        setting=setting,
        worlds=arguments.judge_in or arguments.worlds,
        seeds=arguments.seeds,
        first_seed=arguments.first_seed,
        terms=Terms(isolate=True),
    )
    outcomes = evaluate("assistant", jobs, arguments.out)
    summary = write_results(arguments.out, load_challenge("assistant"), outcomes, reference="heuristic")
    for row in summary.rows:
        print(
            f"{row.method.rpartition(':')[2]}: {row.done} of {row.parts} done; why not: {json.dumps(dict(row.causes))}"
        )


if __name__ == "__main__":
    main()
