"""Write an agent, check it, score it, see why it failed, and put it on a leaderboard: docs/write_an_agent.md.

python examples/11_write_an_agent.py --worlds out/demo/world --out out/looker --steps 600
"""

import argparse
import math
from pathlib import Path


class Looker:
    """Walks to where each thing may be, turns once round, and reports what it is looking for when it sees it."""

    def __init__(self, public_map, instructions):
        self.map = public_map
        self.todo = sorted(instructions, key=lambda errand: errand["sources"][0]["kind"] == "place")  # outdoors first
        self.route, self.turns = None, 0

    def act(self, observation, info):
        """Report what is in view, else walk on, else look round."""
        x, y, _, east, north, _ = observation["pose"]
        for errand in self.todo:
            for entity, about in info["entities"].items():
                seen = observation["depth"][observation["segmentation"] == entity]
                if about["name"] in errand["objects"] and len(seen) >= 20 and seen.max() < 7.0:  # metres ahead
                    self.todo.remove(errand)
                    return {"type": "task_complete", "index": errand["index"]}
        if not self.todo:
            return {"type": "wait"}
        if self.route is None:
            path = self.map.router.path((x, y), self.todo[0]["sources"][0]["centre"][:2])
            self.route, self.turns = [] if path is None else [list(map(float, point)) for point in path], 0
        while self.route and math.dist(self.route[0], (x, y)) < 1.0:
            self.route.pop(0)
        if self.route and observation["state"]["action_status"] != "collision":
            ahead = math.atan2(self.route[0][1] - y, self.route[0][0] - x) - math.atan2(north, east)
            turn = math.degrees(math.remainder(ahead, math.tau))
            if abs(turn) > 5:
                return {"type": "turn_left" if turn > 0 else "turn_right", "degrees": abs(turn)}
            return {"type": "move_forward", "distance": min(1.0, math.dist(self.route[0], (x, y)))}
        self.turns += 1
        if self.turns > 8:  # not here, or no way on: the next one
            self.route, self.todo = None, self.todo[1:] + self.todo[:1]
        return {"type": "turn_left", "degrees": 45.0}

    def state(self):
        """Return all it remembers."""
        return {"todo": self.todo, "route": self.route, "turns": self.turns}

    def restore(self, state):
        """Remember what `state` returned."""
        self.todo, self.route, self.turns = state["todo"], state["route"], state["turns"]


def main() -> None:
    # An agent's module may not import these: they hold the truth. Only who judges it does.
    from vico.challenges.evaluation import evaluate, jobs_for
    from vico.challenges.records import load_challenge
    from vico.challenges.tables.leaderboard import Leaderboard, add_entries, entries_of, write_leaderboard
    from vico.challenges.tables.results import write_results
    from vico.runner.check import check_agent
    from vico.runner.foreign import Terms
    from vico.world.folder import read_world

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=Path, nargs="+", required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--steps", type=int, default=600)
    arguments = parser.parse_args()

    mine = f"{__file__}:Looker"
    found = check_agent(mine, read_world(arguments.worlds[0]), steps=10, deadline=60.0, isolate=True)
    print(f"findings: {[f'{finding.promise}: {finding.what}' for finding in found.findings]}")

    setting = {"assistants": 1, "advanced": False, "distance": True, "steps": arguments.steps}
    jobs = jobs_for(
        "assistant",
        categories=("search",),
        methods=(mine, "random"),
        setting=setting,
        worlds=arguments.worlds,
        seeds=arguments.seeds,
        terms=Terms(isolate=True),
    )
    outcomes = evaluate("assistant", jobs, arguments.out)
    challenge = load_challenge("assistant")
    summary = write_results(arguments.out, challenge, outcomes, reference="random")
    for row in summary.rows:
        print(f"{row.method.rpartition('/')[2]}: {row.done} of {row.parts} found; why not: {dict(row.causes)}")
    board = add_entries(Leaderboard(), entries_of(arguments.out / "results.json", challenge))
    write_leaderboard(arguments.out / "leaderboard.json", board)


if __name__ == "__main__":
    main()
