"""A challenge that takes no time: what an episode comes to is drawn from its seed; some seeds go wrong in their way."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel

import toy_city
from vico.challenges.evaluation import jobs_for
from vico.challenges.records import EpisodeRecord, Job, Metric, Part, Progress
from vico.errors import InputError
from vico.llm import Budget, Connection, LanguageModel, user
from vico.runner.gather import Fault
from vico.seeds import rng
from vico.world.folder import read_world
from vico.world.world import manifest_bytes

NAME = "toy_challenge:TOY"
SKILL = {"good": 0.9, "fair": 0.5, "bad": 0.1}
PARTS = 6
LIMIT = 100


class Way(BaseModel):
    """What the model is asked for."""

    left: bool


class Toy:
    """Six things to do, done with a method's skill."""

    name = "toy"
    categories: Sequence[str] = ("fetch", "find")
    methods: Sequence[str] = (*SKILL, "llm")

    def metrics(self, category: str) -> Sequence[Metric]:
        rate = Metric("SR", "SR", "%", "higher", 0.0, 100.0, about="episodes that were done")
        time = Metric("Ts", "Ts", "s", "lower", 0.0, LIMIT, digits=0, about="steps until they were")
        return (rate, time) if category == "fetch" else (rate,)

    def causes(self, category: str) -> Sequence[str]:
        return ("out of time", "not seen")

    def task(self, job: Job) -> Mapping[str, object]:
        world = read_world(job.world)
        if "crowded" in job.setting and job.seed == 1:
            raise InputError(f"{world.manifest.name}: 2 of 9 places can be reached; choose another world")
        return {"world": world.digest, "seed": job.seed, "category": job.category}

    def play(self, job: Job, *, recording: Path | None = None, progress: Progress | None = None) -> EpisodeRecord:
        self._suffer(job)
        generator = rng(job.seed, "toy", job.category, read_world(job.world).digest)
        hard = 0.3 * generator.random()
        skill = sum(SKILL[part] for part in job.method.split("+") if part in SKILL)
        done = [bool(draw < skill - hard) for draw in generator.random(PARTS)]
        steps = LIMIT if not all(done) else 60
        if progress is not None:
            progress(f"{job.method}, seed {job.seed}", steps, LIMIT)
        if recording is not None:
            recording.mkdir(parents=True)
            (recording / "run.json").write_text("{}")
        told = json.dumps([job.category, job.method, job.seed, done]).encode()
        faults = [Fault(3, "assistant_0", "crashed", "no plan")] if job.method == "bad" else []
        metrics = {"SR": 100.0 * sum(done) / PARTS} | ({"Ts": float(steps)} if job.category == "fetch" else {})
        return EpisodeRecord(
            job.challenge, job.category, job.method, job.setting, read_world(job.world).manifest.name, job.seed,
            metrics=metrics,
            parts=[
                Part(f"part {i}", ok, "" if ok else ("out of time", "not seen")[i % 2], 10 * i + 1 if ok else None)
                for i, ok in enumerate(done)
            ],
            steps=steps, limit=LIMIT, wall_seconds=0.5, state_hash=hashlib.sha256(told).hexdigest(),
            tokens=7 if job.method == "llm" else 0, cost=0.5 if job.method == "llm" else 0.0,
            fault_counts={"crashed": len(faults)} if faults else {}, faults=faults,
        )  # fmt: skip

    def _suffer(self, job: Job) -> None:
        """Do what the setting says this episode suffers: only in a process of its own is that survived."""
        played = job.setting.get("count_in")
        if played:
            with Path(str(played)).open("a") as file:
                file.write(f"{job.category} {job.method} {job.world.name} {job.seed} {os.getpid()}\n")
        if job.setting.get("slow"):
            time.sleep(float(job.setting["slow"]))
        if job.setting.get("killed") and job.seed == 1:
            flag = Path(str(job.setting["killed"]))
            if job.setting.get("always") or not flag.exists():
                flag.touch()
                os.kill(os.getpid(), signal.SIGKILL)
        if job.setting.get("bug") and job.seed == 1:
            raise KeyError("no such shelf")
        if job.method == "llm":
            self._ask(job)

    def _ask(self, job: Job) -> None:
        budget = Budget(calls=0) if job.setting.get("no_budget") else Budget()
        model = LanguageModel.from_environment(budget=budget, connection=Connection(timeout=5.0, retries=0))
        model.ask([user("Which way?")], Way)


TOY = Toy()


def toy_world(folder: Path) -> Path:
    """Write as much of a world as the challenge looks at: its manifest."""
    folder.mkdir(parents=True)
    manifest = toy_city.world().manifest.model_copy(update={"name": folder.name})
    (folder / "world.json").write_bytes(manifest_bytes(manifest))
    return folder


def toy_jobs(
    worlds: list[Path], *, methods: tuple[str, ...] = ("good", "bad"), seeds: int = 2, **setting: Any
) -> list[Job]:
    """Return the jobs of both categories."""
    return jobs_for(
        NAME, categories=("fetch", "find"), methods=methods, setting=setting, worlds=worlds, seeds=seeds
    )  # fmt: skip


def played(count: Path) -> list[str]:
    """Return which episodes were played, of the file that the setting ``count_in`` names."""
    return [line.rsplit(" ", 1)[0] for line in count.read_text().splitlines()] if count.exists() else []
