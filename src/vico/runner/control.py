"""Control of a run: it is paused, paced, inspected and changed between two steps, by commands from other threads.

Arguments of commands are checked before they are used. The pace holds a run back to a speed by the clock on the wall,
and measures it; it decides nothing in the run.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from vico.agents.base import Action
from vico.errors import InputError, VicoError
from vico.runner.loop import Runner
from vico.runner.recording import add_bookmark, bookmarks_of, branch_path, free_name
from vico.sim.recording.interventions import (
    COMMANDS,
    InterventionLine,
    append_intervention,
    intervene,
    intervention_of,
    read_interventions,
    things_to_drop,
    write_interventions,
)
from vico.sim.recording.schema import checkpoint_steps

_LONGEST_NAME, _LONGEST_TEXT = 60, 1000

#: Arguments of each command that has any.
_ARGUMENTS = {
    "step": ("steps",),
    "speed": ("factor",),
    "snapshot": ("name",),
    "back": ("step", "name"),
    "branch": ("name", "step"),
    "bookmark": ("text", "step", "time"),
}


class CommandArguments:
    """Arguments of a command, each of which is looked at before it is used."""

    def __init__(self, command: str, given: Mapping[str, Any]) -> None:
        self._command, self._given = command, given
        known = _ARGUMENTS.get(command, ())
        unknown = [name for name in given if name not in known]
        if unknown:
            raise InputError(f"{command}: no argument is called {unknown[0]!r}; there are {', '.join(known) or 'none'}")

    def has(self, name: str) -> bool:
        """Whether one is given."""
        return self._given.get(name) is not None

    def number(self, name: str, usual: float | None, low: float, high: float) -> float:
        """Return a number, or the usual one where it is left out."""
        value = self._given.get(name, usual)
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise InputError(f"{self._command}: {name} is {value!r}; it has to be {low:g} to {high:g}")
        return value

    def text(self, name: str) -> str:
        """Return a text; "" where it is left out."""
        value = self._given.get(name, "")
        if not isinstance(value, str) or len(value) > _LONGEST_TEXT:
            raise InputError(f"{self._command}: {name} has to be a short text")
        if name == "name" and (len(value) > _LONGEST_NAME or not all(c.isalnum() or c in "-_ " for c in value)):
            raise InputError(f"{self._command}: name may have {_LONGEST_NAME} letters, digits, spaces, - and _")
        return value.strip()


# Who is later than this does not try to make up for it, seconds.
_LATE = 0.5
# The measured speed is that of so many seconds.
_MEASURED = 3.0


class Pace:
    """Holds a run back to a speed.

    Parameters
    ----------
    speed
        Simulated seconds a second; 0 does not hold it back.
    clock
        Seconds of a clock that never goes back.

    Attributes
    ----------
    factor
        Simulated seconds a second of late.
    """

    def __init__(self, speed: float, *, clock: Callable[[], float] = time.monotonic) -> None:
        self.speed = speed
        self.factor = 0.0
        self._clock = clock
        self._anchor: tuple[float, float] | None = None
        self._marks: deque[tuple[float, float]] = deque()

    def ahead(self, second: float) -> float:
        """Return how many seconds a run is ahead that is about to go on from a simulated second; 0 if it is not."""
        now = self._clock()
        if not self.speed:
            self._measure(now, second)
            return 0.0
        if self._anchor is None:
            self._anchor = now, second
        due = self._anchor[0] + (second - self._anchor[1]) / self.speed
        if due > now:
            return due - now
        if now - due > _LATE:
            self._anchor = now, second
        self._measure(now, second)
        return 0.0

    def forget(self) -> None:
        """Begin anew: it was held up, or is to go at another speed."""
        self._anchor = None
        self._marks.clear()
        self.factor = 0.0

    def _measure(self, now: float, second: float) -> None:
        self._marks.append((now, second))
        while now - self._marks[0][0] > _MEASURED:
            self._marks.popleft()
        began, first = self._marks[0]
        if now > began:
            self.factor = (second - first) / (now - began)


T = TypeVar("T")

#: How fast a run may be asked to go, simulated seconds a second; 0 is as fast as it goes.
FASTEST = 1000.0

_MOST_WAITING = 256
# Commands that need everybody's state.
_KEEPING = ("snapshot", "back", "branch")


class Switch(NamedTuple):
    """A run is to go on elsewhere: from a checkpoint, in another folder.

    Attributes
    ----------
    step
        Of the checkpoint.
    name
        Of the branch.
    told
        Is answered when it goes on there.
    """

    step: int
    name: str
    told: Future[dict[str, Any]]


@dataclass
class _Waiting:
    """Something to do between two steps."""

    do: Callable[[Runner], Any]
    told: Future[Any]


class Control:
    """Directs a run by `before_step`, a `vico.runner.loop.Director`; its methods may be called from any thread.

    Parameters
    ----------
    out
        The run's folder: what is done to the run is written there.
    speed
        Simulated seconds a second at most; 0 for as fast as it goes.
    paused
        Whether it waits before its first step.
    script
        Interventions that are done again, as a run's folder holds them.
    manageable
        Whether a snapshot of everybody can be taken: whether the run can go back.
    allowed
        Commands that are done; None for all.

    Attributes
    ----------
    switch
        Where the run is to go on instead; None for here.
    stopping
        Whether it is to end.
    """

    def __init__(
        self,
        out: Path,
        *,
        speed: float = 0.0,
        paused: bool = False,
        script: Sequence[InterventionLine] = (),
        manageable: bool = True,
        allowed: Collection[str] | None = None,
    ) -> None:
        self.out, self.paused = out, paused
        self.switch: Switch | None = None
        self.stopping = self._ended = False
        self._attended = True
        self.step = 0
        self._pace = Pace(speed)
        self._script = deque(script)
        self._manageable, self._allowed = manageable, allowed
        self._lines = 0
        self._pending: dict[str, Action] = {}
        self._steps_left = 0
        self._waiting: deque[_Waiting] = deque()
        self._arriving: tuple[Future[dict[str, Any]], dict[str, Any]] | None = None
        self._something = threading.Condition()

    # Asked by others.

    def told(self) -> dict[str, Any]:
        """Return how the run stands, as the viewer's protocol has it."""
        status = "ended" if self._ended else "paused" if self._holds() else "running"
        return {
            "paused": self.paused,
            "speed": self._pace.speed,
            "step": self.step,
            "status": status,
            "factor": round(self._pace.factor, 2),
            "can": [] if self._ended else self._can(),
        }

    def command(self, name: str, arguments: Mapping[str, Any]) -> Future[dict[str, Any]]:
        """Have a command done between two steps; its result is the reply.

        The errors that the reply may be are `InputError`.
        """
        return self.ask(lambda runner: self._run_command(runner, name, arguments))

    def ask(self, do: Callable[[Runner], T]) -> Future[T]:
        """Have something done between two steps, in the thread that simulates."""
        waiting = _Waiting(do, Future())
        with self._something:
            if self._ended:
                waiting.told.set_exception(InputError("the run has ended"))
            elif len(self._waiting) >= _MOST_WAITING:
                waiting.told.set_exception(InputError(f"{_MOST_WAITING} commands are waited for already"))
            else:
                self._waiting.append(waiting)
                self._something.notify_all()
        return waiting.told

    def attend(self, there: bool) -> None:
        """Let the run go on while somebody is there, and hold it up while nobody is; it stays paused if it was."""
        with self._something:
            self._attended = there
            self._something.notify_all()

    def stop_soon(self) -> None:
        """End the run before its next step; for handlers of signals, too."""
        with self._something:  # may be taken twice by one thread: a handler interrupts whoever holds it
            self.stopping = True
            self._something.notify_all()

    # Asked by the runner.

    def before_step(self, runner: Runner) -> Mapping[str, Action]:
        """Do what is waiting, hold the run up while it is paused or too fast; return what agents do in its place."""
        self.step = runner.sim.metrics.steps
        self._arrive()
        self._follow_script(runner)
        while True:
            self._do_waiting(runner)
            if self.over:
                return {}
            with self._something:
                if self._waiting:
                    continue
                if self._holds():
                    self._pace.forget()
                    self._something.wait()
                    continue
                ahead = self._pace.ahead(runner.sim.state.second)
                if ahead <= 0.0:
                    break
                self._something.wait(ahead)
        self._steps_left = max(self._steps_left - 1, 0)
        due = runner.sim.due
        return {name: self._pending.pop(name) for name in list(self._pending) if name in due}

    @property
    def over(self) -> bool:
        """Whether the run is not to go on here; for `Runner.run`'s `until`."""
        return self.stopping or self.switch is not None

    def end(self) -> None:
        """Say that the run has ended: whoever waits is told so."""
        self._arrive()
        with self._something:
            self._ended = True
            waiting, self._waiting = list(self._waiting), deque()
        for one in waiting:
            one.told.set_exception(InputError("the run has ended"))

    def notes(self) -> dict[str, Any]:
        """Return what a checkpoint has to keep of it."""
        return {"interventions": self._lines, "pending": dict(self._pending)}

    def restore(self, notes: Mapping[str, Any], *, out: Path, step: int) -> None:
        """Go on from a checkpoint of a run in a folder, with what had been done to it by then.

        Who asked for it is told so once the run is there, before its next step.
        """
        if self.switch is not None:
            self._arriving = self.switch.told, {"step": step, "path": str(out)}
        self.out, self.switch, self.step = out, None, step
        self._lines, self._pending = int(notes.get("interventions", 0)), dict(notes.get("pending", {}))
        done = read_interventions(out)[: self._lines]
        write_interventions(out, done)
        self._script = deque(line for line in self._script if line not in done)
        self._pace.forget()

    def _arrive(self) -> None:
        if self._arriving is not None:
            told, reply = self._arriving
            self._arriving = None
            told.set_result(reply)

    # Commands.

    def _can(self) -> list[str]:
        known = [name for name in (*_COMMANDS, *COMMANDS) if self._manageable or name not in _KEEPING]
        return known if self._allowed is None else [name for name in known if name in self._allowed]

    def _holds(self) -> bool:
        return not self._attended or (self.paused and not self._steps_left)

    def _do_waiting(self, runner: Runner) -> None:
        while True:
            with self._something:
                if not self._waiting:
                    return
                one = self._waiting.popleft()
            if not one.told.set_running_or_notify_cancel():
                continue
            try:
                result = one.do(runner)
            except VicoError as error:
                one.told.set_exception(error)
            except Exception as error:  # a fault of the program: told, and the run goes on
                one.told.set_exception(InputError(f"this could not be done: {type(error).__name__}: {error}"))
            else:
                if not isinstance(result, Switch):
                    one.told.set_result(result)
                else:
                    self.switch = result._replace(told=one.told)

    def _run_command(self, runner: Runner, name: str, arguments: Mapping[str, Any]) -> Any:
        if name not in self._can():
            raise InputError(f"{name!r} is no command here; there are {', '.join(self._can())}")
        if name in COMMANDS:
            return self._apply_intervention(
                runner, InterventionLine(after=self.step, command=name, arguments=dict(arguments))
            )
        return _COMMANDS[name](self, runner, CommandArguments(name, arguments))

    def _apply_intervention(self, runner: Runner, line: InterventionLine) -> dict[str, Any]:
        told, actions = intervene(runner.sim, intervention_of(line.command, line.arguments))
        self._pending |= actions
        append_intervention(self.out, line)
        self._lines += 1
        return told

    def _follow_script(self, runner: Runner) -> None:
        while self._script and self._script[0].after <= self.step:
            line = self._script.popleft()
            if line.after == self.step:
                self._apply_intervention(runner, line)

    def pause(self, runner: Runner, given: CommandArguments) -> dict[str, Any]:
        """Hold the run up."""
        self.paused, self._steps_left = True, 0
        return {}

    def resume(self, runner: Runner, given: CommandArguments) -> dict[str, Any]:
        """Let it go on."""
        self.paused = False
        return {}

    def do_steps(self, runner: Runner, given: CommandArguments) -> dict[str, Any]:
        """Make some steps, and hold it up again."""
        # Who asks again before they are made gets all of them.
        waiting = self._steps_left if self.paused else 0
        self.paused, self._steps_left = True, waiting + int(given.number("steps", 1, 1, 100_000))
        return {}

    def set_speed(self, runner: Runner, given: CommandArguments) -> dict[str, Any]:
        """Set how fast it goes at most."""
        self._pace.speed = given.number("factor", None, 0, FASTEST)
        self._pace.forget()
        return {}

    def stop(self, runner: Runner, given: CommandArguments) -> dict[str, Any]:
        """End it."""
        self.stopping = True
        return {}

    def snapshot(self, runner: Runner, given: CommandArguments) -> dict[str, Any]:
        """Write a checkpoint."""
        name = given.text("name")
        self._save(runner)
        if name:
            add_bookmark(self.out, step=self.step, time=runner.sim.state.second, text=name)
        return {"step": self.step}

    def back(self, runner: Runner, given: CommandArguments) -> Switch:
        """Have the run go on from a checkpoint at or before a step, in a folder of its own."""
        step = int(given.number("step", None, 0, self.step))
        before = [k for k in checkpoint_steps(self.out) if k <= step]
        if not before:
            first = next(iter(checkpoint_steps(self.out)), None)
            known = "there is none" if first is None else f"the first is of step {first}"
            raise InputError(f"back: no checkpoint at or before step {step}; {known}")
        return self._elsewhere(before[-1], given, f"from-{before[-1]}")

    def branch(self, runner: Runner, given: CommandArguments) -> Switch:
        """Have the run go on in a folder of its own, from here or from an earlier checkpoint."""
        if given.has("step"):
            return self.back(runner, given)
        switch = self._elsewhere(self.step, given, f"branch-{self.step}")
        self._save(runner)
        return switch

    def bookmark(self, runner: Runner, given: CommandArguments) -> dict[str, Any]:
        """Remember a step with a text."""
        step = int(given.number("step", self.step, 0, self.step))
        add_bookmark(
            self.out, step=step, time=given.number("time", runner.sim.state.second, 0, 1e9), text=given.text("text")
        )
        return self.bookmarks(runner, given)

    def bookmarks(self, runner: Runner, given: CommandArguments) -> dict[str, Any]:
        """Tell all bookmarks."""
        return {"bookmarks": bookmarks_of(self.out)}

    def things(self, runner: Runner, given: CommandArguments) -> dict[str, Any]:
        """Tell what can be dropped."""
        return {"things": things_to_drop()}

    def _elsewhere(self, step: int, given: CommandArguments, usual: str) -> Switch:
        name = given.text("name")
        if name and branch_path(self.out, name).exists():
            raise InputError(f"there is a branch {name!r} already; give it another name")
        return Switch(step, name or free_name(self.out, usual), Future())

    def _save(self, runner: Runner) -> None:
        if not runner.save():
            raise InputError(
                "an agent does not say what it remembers now: nothing was kept; try again after the next step"
            )


_COMMANDS: dict[str, Callable[[Control, Runner, CommandArguments], Any]] = {
    "pause": Control.pause,
    "resume": Control.resume,
    "step": Control.do_steps,
    "speed": Control.set_speed,
    "stop": Control.stop,
    "snapshot": Control.snapshot,
    "back": Control.back,
    "branch": Control.branch,
    "bookmark": Control.bookmark,
    "bookmarks": Control.bookmarks,
    "things": Control.things,
}


def wait_for(told: Future[T], seconds: float) -> T:
    """Return what something came to that was asked of a run, or say that the run is busy.

    Raises
    ------
    InputError
        If it takes longer than some seconds.
    """
    try:
        return told.result(seconds)
    except TimeoutError:
        raise InputError(f"the run did not come to it within {seconds:g} s") from None
