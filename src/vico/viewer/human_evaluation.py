"""A page from which a person plays an assistant task, held to the clock: the `Theatre` of `vico eval assistant`."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from vico.agents.base import Agent
from vico.agents.human import PERIOD, HumanAgent, Mailbox
from vico.challenges.assistant.challenge import HUMAN, AssistantChallenge, PlayedByHand
from vico.challenges.records import EpisodeRecord, Job, Progress, parts_of
from vico.errors import InputError
from vico.runner.control import Control
from vico.runner.gather import Gatherer
from vico.runner.loop import Hook
from vico.sim.recording.recorder import Recorder
from vico.viewer.live import LiveViewer
from vico.viewer.play import PlayedAgent
from vico.world.world import World

#: What a person may do to a run in which they are judged.
ALLOWED = ("pause", "resume", "bookmark", "bookmarks", "stop")
#: Seconds that an episode waits for a person who has not come, or has left.
WAITS = 600.0


class BrowserTheatre:
    """Lets a person play at a page of this machine.

    One episode after the other; `open` says how.
    """

    period = PERIOD

    def __init__(self) -> None:
        self._human: tuple[str, HumanAgent] | None = None
        self.open(city=lambda world: None, announce=lambda url: None)

    def open(
        self,
        *,
        city: Callable[[World], Path | None],
        announce: Callable[[str], None],
        port: int = 0,
        waits: float = WAITS,
        hosts: Sequence[str] = (),
    ) -> None:
        """Say where the pages of the coming episodes are.

        Parameters
        ----------
        city
            Gives the folder of a world's files for the page; None where there are none.
        announce
            Told the page's address.
        port
            To listen on; 0 takes a free one.
        waits
            Seconds that an episode waits for the person.
        hosts
            Names of hosts, beside this machine's own, under which the page is shown.
        """
        self._hosts = hosts
        self._city, self._announce, self._port, self._waits = city, announce, port, waits

    def agent(self, name: str) -> Agent:
        """Return who acts for the person."""
        human = HumanAgent(Mailbox())
        self._human = name, human
        return human

    @contextmanager
    def perform(
        self, recorder: Recorder, agents: Gatherer, task: Callable[[float], Mapping[str, Any]]
    ) -> Iterator[BrowserPerformance]:
        """Open the page for an episode; see `vico.challenges.assistant.challenge.Theatre`."""
        assert self._human is not None
        name, human = self._human
        world = recorder.sim.world
        control = Control(recorder.out, speed=1.0, paused=True, manageable=False, allowed=ALLOWED)
        performance = BrowserPerformance(control, waits=self._waits)
        player = PlayedAgent(name, human, present=performance.present)
        player.task = lambda second: dict(task(second))
        with LiveViewer(
            control, world, city=self._city(world), player=player, port=self._port, hosts=self._hosts
        ) as viewer:
            viewer.announce = self._announce
            viewer.show(recorder, agents)
            performance.hooks = [viewer, performance]
            try:
                yield performance
            finally:
                performance.close()
                human.close("the episode is over")


class BrowserPerformance(Hook):
    """An episode that a person plays at a page: it begins when they come, waits when they leave, and ends some time.

    Parameters
    ----------
    control
        Of the run.
    waits
        Seconds that it waits.
    """

    def __init__(self, control: Control, *, waits: float) -> None:
        self.director = control.before_step
        self._control = control
        self.hooks: Sequence[Hook] = ()
        self._waits = waits
        self._gone = False
        self._lock = threading.Lock()
        self._timer: threading.Timer | None = None
        self._there = False

    @property
    def over(self) -> bool:
        """Whether it is to end before its time."""
        return self._control.over

    def begin(self, observations: Mapping[str, dict[str, Any]]) -> None:
        """Wait for the person from now on: the scene is set, which takes a while."""
        if not self._there:
            self._wait()

    def present(self, there: bool) -> None:
        """Go on when the person comes, and wait for them when they leave."""
        self._there = there
        self._cancel()
        self._control.command("resume" if there else "pause", {})
        if not there:
            self._wait()

    def confirm(self) -> None:
        """Make sure that it was played to its end.

        Raises
        ------
        InputError
            If the person left and did not come back.
        """
        if self._gone:
            step = self._control.step
            raise InputError(f"nobody played: after {step * PERIOD:g} s the page was gone for {self._waits:g} s")

    def close(self) -> None:
        """Wait for nobody any more."""
        self._cancel()

    def _wait(self) -> None:
        with self._lock:
            self._timer = threading.Timer(self._waits, self._give_up)
            self._timer.daemon = True
            self._timer.start()

    def _cancel(self) -> None:
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None

    def _give_up(self) -> None:
        self._gone = True
        with suppress(InputError):
            self._control.command("stop", {})


class HumanChallenge(AssistantChallenge):
    """The assistant challenge with one more method: a person at a page.

    Parameters
    ----------
    theatre
        Where they play.
    """

    def __init__(self, theatre: BrowserTheatre) -> None:
        self._theatre = theatre

    @property
    def methods(self) -> Sequence[str]:
        """Names of the planners, and ``human``."""
        return (*super().methods, HUMAN)

    def play(self, job: Job, *, recording: Path | None = None, progress: Progress | None = None) -> EpisodeRecord:
        """Play one episode and judge it."""
        if HUMAN not in parts_of(job.method):
            return super().play(job, recording=recording, progress=progress)
        if recording is None:
            raise InputError("eval: what a person plays is recorded: add --record")
        return self._play(job, PlayedByHand(job.method, self._theatre), recording, progress)


AT_THE_PAGE = BrowserTheatre()
ASSISTANT = HumanChallenge(AT_THE_PAGE)
#: As `vico.challenges.records.load_challenge` takes it.
CHALLENGE = "vico.viewer.human_evaluation:ASSISTANT"
