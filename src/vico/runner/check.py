"""Whether an agent keeps the contract: it acts, repeats itself, goes on from its state, and leaves what it is given."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from statistics import median
from typing import Any

from vico.agents.base import Action, Agent, AgentState
from vico.errors import InputError, SchemaError
from vico.io.plain_data import decode, encode
from vico.runner.audit import UnfairError
from vico.runner.foreign import IsolatedAgent, Terms, foreign_agents
from vico.runner.gather import failure_of, is_malformed
from vico.runner.loading import AgentSeat
from vico.runner.messages import MalformedError, copy_info, copy_observation, digest_of, plain_action
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.world import World

NAME = "assistant_0"


@dataclass(frozen=True)
class AgentFinding:
    """Something an agent does not keep to.

    Attributes
    ----------
    promise
        ``made``, ``fair``, ``acts``, ``action``, ``deadline``, ``repeatable``, ``leaves``, ``state`` or ``usage``.
    where
        The step it was found at; "" for the whole.
    what
        What is wrong, and how to mend it.
    """

    promise: str
    where: str
    what: str


@dataclass
class AgentCheck:
    """Result of a check.

    Attributes
    ----------
    findings
        Of one kind, the first.
    types
        How often each type of action was asked for.
    milliseconds
        It took for each action.
    """

    findings: list[AgentFinding] = field(default_factory=list)
    types: dict[str, int] = field(default_factory=dict)
    milliseconds: list[float] = field(default_factory=list)

    @property
    def median_ms(self) -> float:
        """The median action's milliseconds; 0 without any."""
        return median(self.milliseconds) if self.milliseconds else 0.0

    def add(self, promise: str, step: int, what: str) -> None:
        """Note what is wrong, if nothing of the kind was yet; step 0 is the whole."""
        if all(finding.promise != promise for finding in self.findings):
            self.findings.append(AgentFinding(promise, f"step {step}" if step else "", what))


def check_agent(
    spec: str,
    world: World,
    *,
    steps: int = 40,
    seed: int = 0,
    deadline: float = 1.0,
    isolate: bool = False,
    traffic: int = 4,
    instructions: list[dict[str, Any]] | None = None,
) -> AgentCheck:
    """Let an agent play an assistant, and twins of it look at what it looks at.

    Parameters
    ----------
    spec
        ``my_module:MyAgent``.
    world
        Where it plays, among a few cars and pedestrians.
    steps
        How long.
    seed
        Of the simulation and the agent.
    deadline
        Seconds an action may take.
    isolate
        Whether it and its twins are in processes of their own.
    traffic
        How many cars drive about, and how many pedestrians walk.
    instructions
        What its constructor is told of a task, if it asks.

    Returns
    -------
    AgentCheck
        No findings if it keeps the contract.
    """
    check = AgentCheck()
    terms = Terms(isolate=isolate, checked=isolate)
    seat = AgentSeat(NAME, seed, instructions or [])
    with ExitStack() as made:

        def another() -> Agent:
            agent = foreign_agents(spec, [seat], world, terms)[NAME]
            if isinstance(agent, IsolatedAgent):
                made.callback(agent.close)
            return agent

        try:
            agent, twin = another(), another()
        except UnfairError as error:
            check.add("fair", 0, str(error))
            return check
        except InputError as error:
            check.add("made", 0, str(error))
            return check
        config = SimConfig(seed=seed, assistants=1, cars=traffic, pedestrians=traffic, image=128)
        _play(check, Simulation(world, None, config), agent, twin, another, steps=steps, deadline=deadline)
        tokens, cost = getattr(agent, "tokens", 0), getattr(agent, "cost", 0.0)
        if not isinstance(tokens, int) or tokens < 0 or not isinstance(cost, (int, float)) or not cost >= 0:
            check.add("usage", 0, f"tokens {tokens!r:.40} and cost {cost!r:.40} have to be numbers of 0 or more")
    return check


def _play(
    check: AgentCheck,
    sim: Simulation,
    agent: Agent,
    twin: Agent,
    another: Callable[[], Agent],
    *,
    steps: int,
    deadline: float,
) -> None:
    observations, infos = sim.observe()
    restored: Agent | None = None
    for step in range(1, steps + 1):
        seen, info = observations[NAME], infos[NAME]
        if step == steps // 2:
            restored = _restored_agent(check, agent, another, step)
        given = copy_observation(seen), copy_info(info)
        before, began = digest_of(*given), time.perf_counter()
        action = _ask_agent(check, agent, given, step)
        seconds = time.perf_counter() - began
        check.milliseconds.append(1000 * seconds)
        if seconds > deadline:
            check.add("deadline", step, f"took {seconds:.2f} s for an action; it has {deadline:g} s")
        if digest_of(*given) != before or (isinstance(agent, IsolatedAgent) and not agent.left):
            check.add("leaves", step, "changes the observation or info it is given; take a copy of what is to change")
        if action is None:
            return
        check.types[str(action.get("type"))] = check.types.get(str(action.get("type")), 0) + 1
        for other, promise, what in (
            (
                twin,
                "repeatable",
                "a second one, made in the same way, does {} where it does {}; draw from rng(seed, name)",
            ),
            (restored, "state", "one restored from its state does {} where it does {}; state() leaves something out"),
        ):
            again = (
                None
                if other is None
                else _ask_agent(AgentCheck(), other, (copy_observation(seen), copy_info(info)), step)
            )
            if other is not None and again != action:
                check.add(promise, step, what.format(again, action))
        result = sim.step({NAME: action})
        observations, infos = result.observations, result.infos
        state = observations[NAME]["state"]
        if is_malformed(state["action_code"]):
            check.add("action", step, f"{state['action_reason']} ({state['action_code']})")


def _ask_agent(
    check: AgentCheck, agent: Agent, given: tuple[dict[str, Any], dict[str, Any]], step: int
) -> Action | None:
    """Return an agent's action; None if it has none, which is noted."""
    try:
        return plain_action(agent.act(*given))
    except MalformedError as error:
        check.add("action", step, str(error))
        return {"type": "wait"}
    except BaseException as error:
        failure = failure_of(error)
        check.add("fair" if failure.kind == "unfair" else "acts", step, failure.reason)
        return None


def _restored_agent(check: AgentCheck, agent: Agent, another: Callable[[], Agent], step: int) -> Agent | None:
    """Return a fresh agent that remembers what this one does; None if there is no such state, which is noted."""
    try:
        state: AgentState = decode(encode(agent.state()))
        fresh = another()
        fresh.restore(state)
    except UnfairError as error:
        check.add("fair", step, str(error))
    except (InputError, SchemaError) as error:
        check.add("state", step, str(error))
    except BaseException as error:
        failure = failure_of(error)
        check.add("fair" if failure.kind == "unfair" else "state", step, failure.reason)
    else:
        return fresh
    return None
