"""Playing the influence challenge: a day or two, in the simulation or by schedule, judged, as one record.

By schedule there are no bodies: members are where their schedule says, and walks take what the router says.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from vico.agents.influence.main_agent import Courtship, MainAgent
from vico.agents.influence.member import courted_members
from vico.agents.influence.situation import DayPlan, day_plan_of
from vico.agents.influence.strategies import PART_NAMES, Asker
from vico.agents.influence.strategies import split_strategy_name as strategy_parts
from vico.agents.schedule import followers_of
from vico.challenges.influence import evaluate
from vico.challenges.influence.day import Day, Models, make_day
from vico.challenges.influence.opinion import opinion_constants
from vico.challenges.influence.tasks import (
    InfluenceSettings,
    community_of,
    generate_influence,
    rides_in,
    settings_of,
    strategies_of,
)
from vico.challenges.records import EpisodeRecord, Job, Metric, Progress
from vico.clock import clock_of
from vico.community.model import Community
from vico.envs import make
from vico.io.files import write_json
from vico.rules import WALK_SPEED
from vico.runner.gather import Fault, FaultLog, Gatherer
from vico.runner.loop import Hook, Runner, Step
from vico.runner.recording import recorded_in
from vico.world.folder import kept_world
from vico.world.world import World

__all__ = [
    "CATEGORY",
    "NAME",
    "Influence",
    "Mover",
    "Walks",
    "movers_of",
    "next_visit",
    "plans_of",
    "play_by_schedule",
    "time_line",
]
_THINK = 30.0  # seconds until one thinks again where there is nobody to see
_FIND = 30.0  # seconds to find somebody at a place
_ROUND = 3.0  # seconds to say something and be answered
_LATE = 30.0  # seconds that whoever is to come is late


@dataclass
class Mover:
    """A main agent without a body: where it is, and when it is next to decide."""

    courtship: Courtship
    place: str
    free_at: float


class Walks:
    """Tells how long the walks between places take; each is found once a world."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._known: dict[tuple[str, str], float] = {}

    def seconds(self, start: str, goal: str) -> float:
        """Return how long a walk takes, seconds; infinite where there is none."""
        if start == goal:
            return 0.0
        key = min((start, goal), (goal, start))
        if key not in self._known:
            places = self._world.place_by_id
            # In one direction always: the other one may come to a little more or less.
            one, other = (places[place].position for place in key)
            self._known[key] = self._world.router.seconds(one, other, WALK_SPEED)
        return self._known[key]

    def position(self, place: str) -> tuple[float, float]:
        """Return where a place is, ENU metres."""
        x, y, _ = self._world.place_by_id[place].position
        return x, y


def play_by_schedule(day: Day, walks: Walks) -> None:
    """Play a day through; what was said stands in its ledger."""
    plans = plans_of(day)
    movers = movers_of(day, plans)
    while (mover := min(movers, key=lambda one: (one.free_at, one.courtship.me.id))).free_at < day.task.ends:
        next_visit(day, mover, plans, walks)


def plans_of(day: Day) -> dict[str, DayPlan]:
    """Return everybody's day by id."""
    return {resident.id: day_plan_of(resident.schedule) for resident in day.community.residents}


def movers_of(day: Day, plans: Mapping[str, DayPlan]) -> list[Mover]:
    """Return the main agents where the day finds them."""
    homes = {resident.id: resident.home for resident in day.community.residents}
    return [
        Mover(courtship, plans[main].at(day.task.begins).place or homes[main], day.task.begins)
        for main, courtship in sorted(day.courtships.items())
    ]


def next_visit(day: Day, mover: Mover, plans: dict[str, DayPlan], walks: Walks) -> None:
    """Let a main agent see somebody, or wait."""
    time, courtship = mover.free_at, mover.courtship

    def seconds_to(place: str) -> float:
        return walks.seconds(mover.place, place)

    target = courtship.choose(time, walks.position(mover.place), seconds_to)
    stay = None if target is None else courtship.meeting(target, time, seconds_to)
    if target is None or stay is None or stay.place is None or not math.isfinite(seconds_to(stay.place)):
        mover.free_at = time + _THINK
        return
    courtship.set_out(target, stay.place, time)
    there = max(time + seconds_to(stay.place) + _FIND, stay.start + _LATE)
    mover.place = stay.place
    if there >= min(stay.end, day.task.ends):
        courtship.give_up(target, there, "not reached")
        mover.free_at = there
        return
    courtship.begin(target, there)
    mover.free_at = _talk(day, mover, target, there, plans, walks)


def _talk(day: Day, mover: Mover, target: str, time: float, plans: dict[str, DayPlan], walks: Walks) -> float:
    """Talk until one has nothing more to say, or is not answered; return when that was."""
    here = walks.position(mover.place)
    while True:
        text = mover.courtship.message(time, here, lambda place: walks.seconds(mover.place, place))
        if text is None:
            return time + _ROUND
        gone = not plans[target].at(time).can_talk
        member = next((m for m in day.task.members if day.ledger.is_meant(m, text)), None)
        answer = None
        if member is not None and (member == target or plans[member].at(time).place == mover.place):
            distance = 1.5
            answer = day.ledger.say(time, mover.courtship.me.id, member, text, distance=distance, on_the_way=gone)
        time += _ROUND
        if answer is None or gone:
            mover.courtship.break_off(time, "on the way" if gone else "no answer")
            return time
        mover.courtship.note_answer(answer)


def time_line(day: Day) -> list[str]:
    """Return what was said to whom, a line a message."""
    return [f"{clock_of(int(u.time))} {u.speaker} to {u.listener}: {u.text}" for u in day.ledger.utterances]


NAME = "influence"
CATEGORY = "day"
_TALKS_FILE = "talks.json"


class Influence:
    """The influence challenge, as `vico.challenges.records.Challenge` has it.

    Task: two main agents court the thirteen other members of a community until the day of talk is over. They see
    everybody's profile and schedule, walk to members, and talk with them: up to three messages a conversation, from
    within 2 m; who is on the way somewhere does not listen.

    Randomisation: the community; which two of its adults court the others; what members think of them at first.

    Success: a member is won who ranks the main agent first at day's end. Win is the share of members won; Conv the
    share of those who at first ranked the rival first and now do not.
    """

    name = NAME
    categories: Sequence[str] = (CATEGORY,)
    methods: Sequence[str] = PART_NAMES

    def metrics(self, category: str) -> Sequence[Metric]:
        """Columns of the table."""
        return evaluate.columns([variant.name for variant in opinion_constants().variant])

    def causes(self, category: str) -> Sequence[str]:
        """Why members are not won."""
        return evaluate.CAUSES

    def task(self, job: Job) -> Mapping[str, object]:
        """Return what is asked in an episode; the same for all strategies."""
        settings = settings_of(job.setting)
        world = kept_world(job.world)
        community = _community(job.world, job.seed)
        return generate_influence(world, community, job.seed, settings).record()

    def play(
        self,
        job: Job,
        *,
        recording: Path | None = None,
        progress: Progress | None = None,
        models: Models | None = None,
    ) -> EpisodeRecord:
        """Play an episode and judge it: as many days as the assignment asks for.

        Parameters
        ----------
        recording
            Folder for the runs and what was said in them; a folder a day in it where two are played.
        models
            Makes what asks a language model; those of the environment unless given.

        Raises
        ------
        InputError
            If a strategy or setting is unknown, or a language model is needed and none is set.
        """
        began = time.perf_counter()
        settings = settings_of(job.setting)
        for name in strategies_of(job.method):
            strategy_parts(name)
        world, community = kept_world(job.world), _community(job.world, job.seed)
        task = generate_influence(world, community, job.seed, settings)
        names = {resident.id: f"{resident.id} {resident.name}" for resident in community.residents}
        verdicts, parts, hashes = [], [], []
        askers: list[Asker] = []
        faults: list[FaultLog] = []
        talks = 0
        for assignment in settings.assignments:
            day = make_day(task, community, job.method, settings, assignment, models)
            before = evaluate.first_choices(day.ledger, now=task.begins, with_talk=False)
            folder = (
                None if recording is None else recording / assignment if len(settings.assignments) > 1 else recording
            )
            state_hash, log = _play_day(day, world, settings, folder, progress)
            verdict = evaluate.judge(day, before)
            parts += evaluate.parts_of(verdict, names, assignment, settings.steps)
            verdicts.append(verdict)
            hashes.append(state_hash)
            askers += day.askers
            faults.append(log)
            counted = (u for u in day.ledger.utterances if u.speaker == day.ours and not u.ignored)
            talks += len({(u.listener, u.conversation) for u in counted})
            if folder is not None:
                folder.mkdir(parents=True, exist_ok=True)
                write_json(
                    folder / _TALKS_FILE,
                    {
                        "schema_name": "vico.influence.talks",
                        "version": 1,
                        "task": day.task.record(),
                        "strategies": {main: one.strategy.name for main, one in day.courtships.items()},
                        "visits": {
                            main: [visit.record() for visit in one.visits] for main, one in day.courtships.items()
                        },
                        "utterances": day.ledger.record(),
                        "before": verdict.before,
                        "after": verdict.after,
                    },
                )
        metrics = evaluate.metrics_of(verdicts) | {"talks": talks / len(verdicts)}
        return EpisodeRecord(
            challenge=NAME,
            category=job.category,
            method=job.method,
            setting=settings.record(),
            world=world.manifest.name,
            seed=job.seed,
            metrics=metrics,
            parts=parts,
            steps=settings.steps * len(verdicts),
            limit=settings.steps * len(verdicts),
            wall_seconds=time.perf_counter() - began,
            state_hash=hashes[0] if len(hashes) == 1 else sha256("".join(hashes).encode()).hexdigest(),
            tokens=sum(asker.usage.tokens for asker in askers),
            cost=sum(asker.usage.cost for asker in askers),
            **_faults(faults, askers),
        )


def _play_day(
    day: Day, world: World, settings: InfluenceSettings, recording: Path | None, progress: Progress | None
) -> tuple[str, FaultLog]:
    """Play a day; return the hash of how it ended, and what agents did wrong."""
    if settings.simulation == "schedule":
        play_by_schedule(day, Walks(world) if world.path is None else _walks_of(world.path))
        return sha256(repr(day.ledger.utterances).encode()).hexdigest(), FaultLog()
    return _simulate_day(day, world, settings, recording, progress)


def _simulate_day(
    day: Day, world: World, settings: InfluenceSettings, recording: Path | None, progress: Progress | None
) -> tuple[str, FaultLog]:
    """Play a day in the simulation: nobody is given pictures, and nothing drives but what somebody there rides."""
    task, seed = day.task, day.task.seed
    env = make(
        world,
        day.community,
        seed=seed,
        start=settings.start,
        cars=0,
        pedestrians=0,
        transit=rides_in(day.community, world, begins=task.begins, ends=task.ends),
        observe=(),
        max_steps=settings.steps,
    )
    followers = followers_of(day.community, env.public_map, seed=seed)
    members = courted_members(followers, task.mains, day.ledger.answers(), env.public_map.walkable)
    mains = {name: MainAgent(one, env.public_map, seed=seed) for name, one in day.courtships.items()}
    agents = Gatherer({**members, **mains}, trusted=[*members, *mains])
    hooks: list[Hook] = []
    runner = Runner(env.sim, agents, hooks=hooks)
    if progress is not None:
        label = f"{task.world}, seed {seed}"
        runner.hooks.append(_DayProgress(progress, label, settings.steps))
    with ExitStack() as stack:
        stack.callback(agents.close)
        if recording is not None:
            notes = {"challenge": NAME, "task": task.record()}
            recorded = recorded_in(recording, env.sim, runner.faults, wanted=settings.steps, notes=notes)
            runner.hooks.append(stack.enter_context(recorded))
        runner.run(settings.steps)
    return env.sim.state_hash(), runner.faults


class _DayProgress(Hook):
    """Tells how far a day is."""

    def __init__(self, progress: Progress, label: str, steps: int) -> None:
        self._progress, self._label, self._steps = progress, label, steps

    def on_step(self, step: Step) -> None:
        """Tell it."""
        self._progress(self._label, step.number, self._steps)


def _faults(logs: Sequence[FaultLog], askers: Sequence[Asker]) -> dict[str, Any]:
    """Return what agents did wrong, and how often an offline part had to decide for a language model."""
    counts: dict[str, int] = {}
    for log in logs:
        for kind, number in log.by_kind().items():
            counts[kind] = counts.get(kind, 0) + number
    fallbacks = sum(asker.fallbacks for asker in askers)
    if fallbacks:
        counts["fallback"] = fallbacks
    told = [fault for log in logs for fault in log.first]
    told += [Fault(0, "language model", "fallback", reason) for asker in askers for reason in asker.reasons]
    return {"fault_counts": counts, "faults": told}


@lru_cache(maxsize=8)
def _community(path: Path, seed: int) -> Community:
    return community_of(kept_world(path), seed)


@lru_cache(maxsize=2)
def _walks_of(path: Path) -> Walks:
    return Walks(kept_world(path))
