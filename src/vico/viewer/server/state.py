"""What a server shows, and by what hands the run can be reached; the same for all of its clients."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

from vico.errors import MissingFileError
from vico.sim.recording.run import looks_and_manners
from vico.viewer.sources.source import Source

View = Callable[[str, int, str], tuple[bytes | dict[str, Any], str]]


class Hands(Protocol):
    """Takes commands to a run that goes on, in this process; asked from the server's threads."""

    def told(self) -> dict[str, Any]:
        """Return what the message ``control`` holds."""

    def command(self, name: str, arguments: Mapping[str, Any]) -> Future[dict[str, Any]]:
        """Have a command done between two steps; its result is the reply, its error a sentence."""


class Player(Protocol):
    """Takes what a person at the page does to the agent that is played."""

    @property
    def agent(self) -> str:
        """Who is played."""

    def keys(self, client: int, message: Mapping[str, Any]) -> bool:
        """Take in what is held down; return whether it was this client's turn."""

    def do(self, client: int, action: Any) -> Future[dict[str, Any]]:
        """Have an action done; its result is the reply."""

    def leave(self, client: int) -> None:
        """Let go of all keys of a client that is gone."""

    def owner(self) -> int | None:
        """Return who plays; None for nobody."""

    def newest(self) -> dict[str, Any] | None:
        """Return the message ``you`` of the agent's newest step."""


class ViewerState:
    """What a server shows.

    Parameters
    ----------
    source
        The run.
    view
        Gives what an agent sees at a step.
    city
        Folder of the world's static files; None where there are none.
    hands, player
        Of a run that goes on; None for recordings, and where nobody is played.
    """

    def __init__(
        self,
        source: Source,
        view: View,
        *,
        city: Path | None = None,
        hands: Hands | None = None,
        player: Player | None = None,
    ) -> None:
        self.source, self.view, self.city, self.hands, self.player = source, view, city, hands, player
        #: Told how many clients are connected whenever one comes or leaves.
        self.visited: Callable[[int], None] = lambda clients: None

    def more(self) -> dict[str, Any]:
        """Return what ``/api/run`` tells beside the source's head."""
        control = None if self.hands is None else self.hands.told()
        return {"control": control, "you_play": None if self.player is None else self.player.agent}

    def factor(self) -> float | None:
        """Return simulated seconds a second; None for recordings."""
        return None if self.hands is None else self.hands.told()["factor"]

    def three(self) -> Path:
        """Return the file of the page's 3D library.

        Raises
        ------
        MissingFileError
            If it is not installed; the message holds the command to type.
        """
        from vico.viewer.three import three_module

        return three_module()

    def person(self, entity: int) -> bytes:
        """Return the file of a person.

        Raises
        ------
        MissingFileError
            If nobody has this number.
        """
        try:
            return self._people.file(entity)
        except KeyError:
            raise MissingFileError(f"there is no person with the number {entity}") from None

    @cached_property
    def _people(self) -> Any:
        from vico.viewer.city import PeopleFiles

        cast = self.source.tables.cast()
        looks, manners = looks_and_manners(self.source.manifest["seed"], self.source.agents, cast)
        return PeopleFiles(looks, manners, self.source.manifest["seed"])
