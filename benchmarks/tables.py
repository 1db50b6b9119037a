"""Play the episodes of one of the paper's tables again, on our worlds, with every method that needs no language model.

    python benchmarks/worlds.py --list standard --places EXTRACTS --out WORLDS
    python benchmarks/tables.py --table assistant --worlds WORLDS --out OUT [--workers 2]
    python benchmarks/tables.py --table assistant --reduced --out OUT        # builds four windows of the packaged map

Tables: assistant (24 worlds; one and two assistants), advanced (three worlds), influence (five), commute (ten), robot
(21). A table that was cut short goes on with the same command. With `--reduced` there are four worlds, one seed and
shorter episodes of the first part (or of those that `--block` names), so that all is over in ten minutes on two cores;
these worlds are built into OUT/worlds if `--worlds` is not given. Methods that need a language model are played where
`--method` names them, with the model of the environment; without, the page says that they were not run. So are methods
of the robot table whose arm was trained, with their `--policy METHOD=FILE`:

    python benchmarks/tables.py --table robot --worlds WORLDS --block "oracle grasp" --method heuristic \
        --method rl-decomposed --policy rl-decomposed=benchmarks/policies/decomposed --out OUT

Reported seeds are drawn from the commit at which a method was frozen, so nobody can have tuned on them:
`--first-seed N` with N the first six hexadecimal digits of that commit's hash, as an integer (`echo $((16#e6541f))`).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from worlds import locate, row_of

from vico.challenges.episodes import Outcome, label_of
from vico.challenges.evaluation import evaluate, jobs_for
from vico.challenges.records import Challenge, Setting, load_challenge
from vico.challenges.robot.arm_policies import LEARNED, policy_settings
from vico.challenges.tables.results import published_rows, write_results
from vico.challenges.windows import window_list
from vico.errors import InputError, VicoError
from vico.io.files import write_bytes
from vico.worldgen.batch import build_many


@dataclass(frozen=True)
class Block:
    """A part of a table: one challenge in one setting; `methods` instead of all that need no language model."""

    name: str
    challenge: str
    setting: Setting = field(default_factory=dict)
    methods: tuple[str, ...] = ()


@dataclass(frozen=True)
class Table:
    """What is played for a table: its parts, its list of worlds, and how many seeds a world.

    `shorter` is what `--reduced` changes in the setting of every part.
    """

    blocks: tuple[Block, ...]
    windows: str
    seeds: int
    reference: str
    shorter: Setting


def _assistants(count: int, *, advanced: bool = False) -> Setting:
    return {"assistants": count, "advanced": advanced, "distance": True, "steps": 1500}


_ABLATION = ("ours+nearest/ours", "ours+ours/nearest", "ours+persuadable/ours", "ours+ours/persuadable")

TABLES = {
    "assistant": Table(
        (
            Block("1 assistant", "assistant", _assistants(1)),
            Block("2 assistants", "assistant", _assistants(2)),
            Block("1 assistant, without distance modelling", "assistant", {**_assistants(1), "distance": False}),
            Block("2 assistants, without distance modelling", "assistant", {**_assistants(2), "distance": False}),
        ),
        "standard", 1, "heuristic", {"steps": 500},
    ),
    "advanced": Table(
        (
            Block("1 assistant, advanced", "assistant", _assistants(1, advanced=True)),
            Block("2 assistants, advanced", "assistant", _assistants(2, advanced=True)),
        ),
        "advanced", 3, "heuristic", {"steps": 500},
    ),
    "influence": Table(
        (
            Block("pairings", "influence"),
            # The same dialogue on both sides, then the same target choice: what each of the two is worth.
            Block("ablation", "influence", methods=_ABLATION),
        ),
        "influence", 1, "", {"hours": 0.5},
    ),
    "commute": Table(
        (Block("a day of commutes", "commute"),), "commute", 10, "rule", {}
    ),
    "robot": Table(
        (
            Block("held by friction", "robot", {"steps": 1500, "oracle_grasp": False}),
            Block("oracle grasp", "robot", {"steps": 1500, "oracle_grasp": True}),
        ),
        "robot", 1, "heuristic", {"steps": 400},
    ),
}  # fmt: skip


def offline_methods(challenge: Challenge) -> list[str]:
    """Return the methods that need neither a language model nor a policy; where they compete, all pairs of two."""
    methods = [method for method in challenge.methods if "llm" not in method and method not in LEARNED]
    if challenge.name == "influence":  # ours, which comes last, is the first of its pairs
        return [f"{other}+{one}" for i, one in enumerate(methods) for other in methods[i + 1 :]]
    return methods


def world_folders(arguments: argparse.Namespace, table: Table) -> list[Path]:
    """Return the worlds of a table; those of the reduced list are built if none are given."""
    name = "reduced" if arguments.reduced else table.windows
    windows = window_list(name).windows
    names = [window.name for window in windows]
    if unknown := set(arguments.world or ()) - set(names):
        raise InputError(f"--world: {', '.join(sorted(unknown))}; the list {name} has {', '.join(names)}")
    windows = tuple(window for window in windows if window.name in (arguments.world or names))
    folder: Path = arguments.worlds or arguments.out / "worlds"
    if arguments.reduced and arguments.worlds is None:
        for outcome in build_many([row_of(window, None) for window in windows], folder, locate=locate):
            print(f"{outcome.name}: {outcome.state} {outcome.reason}", file=sys.stderr, flush=True)
    return [folder / window.name for window in windows]


def tell(outcome: Outcome, done: int, total: int) -> None:
    """Say that an episode is over."""
    what = (
        outcome.reason
        if outcome.record is None
        else ", ".join(f"{k} {v:.4g}" for k, v in outcome.record.metrics.items())
    )
    print(f"{done} of {total}: {label_of(outcome.job)}: {what}", file=sys.stderr, flush=True)


def play(arguments: argparse.Namespace, table: Table, block: Block, worlds: Sequence[Path]) -> bool:
    """Play a part of a table and write it; return whether all episodes were played."""
    challenge = load_challenge(block.challenge)
    methods = arguments.method or block.methods or offline_methods(challenge)
    setting = {**block.setting, **(table.shorter if arguments.reduced else {})}
    if arguments.steps:
        setting["steps"] = arguments.steps
    jobs = jobs_for(
        block.challenge,
        categories=arguments.category or challenge.categories,
        methods=methods,
        setting=setting,
        worlds=worlds,
        seeds=arguments.seeds or (1 if arguments.reduced else table.seeds),
        first_seed=arguments.first_seed,
    )
    policies = policy_settings(methods, arguments.policy)
    jobs = [replace(job, setting={**job.setting, **policies.get(job.method, {})}) for job in jobs]
    folder = arguments.out / block.name.replace(", ", "_").replace(" ", "_")
    outcomes = evaluate(
        block.challenge, jobs, folder, workers=arguments.workers, record=arguments.record, finished=tell
    )  # fmt: skip
    published = published_rows(challenge.name, setting)
    reference = table.reference if table.reference in methods else ""
    write_results(folder, challenge, outcomes, reference=reference, published=published)
    page = (folder / "results.md").read_text(encoding="utf-8")
    not_run = [method for method in challenge.methods if "llm" in method and method not in methods]
    if not_run:
        page += f"\nNot run, for want of a language model: {', '.join(not_run)}.\n"
        write_bytes(folder / "results.md", page.encode())
    print(page)
    return all(outcome.record is not None for outcome in outcomes)


def main() -> int:
    """Play a table; 1 if an episode could not be played."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--table", choices=sorted(TABLES), required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--worlds", type=Path, help="folder of the worlds of the table's list")
    parser.add_argument("--world", action="append", help="worlds of the list instead of all: their names")
    parser.add_argument("--reduced", action="store_true")
    parser.add_argument("--method", action="append", help="instead of all methods without a language model")
    parser.add_argument("--policy", action="append", default=[], help="METHOD=FILE, of a method whose arm was trained")
    parser.add_argument("--category", action="append", help="instead of all")
    parser.add_argument("--block", action="append", help="parts of the table instead of all: their names")
    parser.add_argument("--seeds", type=int, default=0)
    parser.add_argument("--first-seed", type=int, default=0, help="N: episodes are seeded N, N + 1, ...")
    parser.add_argument("--steps", type=int, default=0, help="episodes of another length, in steps")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--record", action="store_true")
    arguments = parser.parse_args()
    table = TABLES[arguments.table]
    if arguments.worlds is None and not arguments.reduced:
        parser.error(
            f"--worlds: the folder with the worlds of the list {table.windows}; benchmarks/worlds.py builds them"
        )
    known = [block.name for block in table.blocks]
    wanted = arguments.block or (known[:1] if arguments.reduced else known)
    if unknown := set(arguments.block or ()) - set(known):
        parser.error(f"--block: {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    try:
        worlds = world_folders(arguments, table)
        blocks = [block for block in table.blocks if block.name in wanted]
        played = [play(arguments, table, block, worlds) for block in blocks]
    except VicoError as error:
        print(error, file=sys.stderr)
        return 2
    return 0 if all(played) else 1


if __name__ == "__main__":
    sys.exit(main())
