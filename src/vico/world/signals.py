"""Traffic signals as the road network has them: programs, and what each of their links lets into a junction.

Read from SUMO's `roads.net.xml` (https://sumo.dlr.de/docs/Simulation/Traffic_Lights.html), whose programs netconvert
makes where the map has signals.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int32]


@dataclass(frozen=True)
class SignalProgram:
    """A fixed-time program of the signals of a junction, or of several that are controlled together.

    Attributes
    ----------
    id
        SUMO's name.
    seconds
        Length of each phase.
    states
        What each phase shows, a letter a link as SUMO has them: ``G`` and ``g`` green (``g``: others go first), ``y``
        amber, ``r`` red.
    """

    id: str
    seconds: tuple[int, ...]
    states: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Signals:
    """The signals of a road network.

    Attributes
    ----------
    programs
        Of all signals.
    lane, lane_program, lane_link
        Lanes inside junctions that a signal lets vehicles onto, whose program that is, and which of its links, int32,
        shape ``(k,)`` each.
    crossing, crossing_program, crossing_link
        The same of crossings, by their SUMO lane ids.
    """

    programs: tuple[SignalProgram, ...]
    lane: Ints
    lane_program: Ints
    lane_link: Ints
    crossing: tuple[str, ...]
    crossing_program: Ints
    crossing_link: Ints

    @classmethod
    def none(cls) -> Signals:
        """Return those of a network without signals."""
        empty = np.zeros(0, np.int32)
        return cls((), empty, empty, empty, (), empty, empty)

    @classmethod
    def of(
        cls, programs: Sequence[SignalProgram], links: Sequence[Mapping[str, str]], lanes: Mapping[str, int]
    ) -> Signals:
        """Join programs to what they control.

        Parameters
        ----------
        programs
            Of the network; of several with one name the first counts.
        links
            Attributes of the network's ``connection`` elements.
        lanes
            Numbers of the lanes that vehicles drive, by id.

        Raises
        ------
        ValueError
            If a link is no number, or its program has no such link.
        """
        number: dict[str, int] = {}
        kept: list[SignalProgram] = []
        for program in programs:
            if program.id not in number:
                number[program.id] = len(kept)
                kept.append(program)
        driven: list[tuple[int, int, int]] = []
        walked: list[tuple[str, int, int]] = []
        for attributes in links:
            if attributes.get("tl", "") not in number:
                continue
            k, link = number[attributes["tl"]], int(attributes["linkIndex"])
            if not 0 <= link < len(kept[k].states[0]):
                raise ValueError(f"signal program {kept[k].id!r} has no link {link}")
            onto = attributes.get("via") or f"{attributes['to']}_{attributes['toLane']}"
            if onto in lanes:
                driven.append((lanes[onto], k, link))
            else:
                walked.append((onto, k, link))
        by_lane = np.array(sorted(driven), np.int32).reshape(-1, 3)
        walked.sort()
        return cls(
            programs=tuple(kept),
            lane=by_lane[:, 0].copy(),
            lane_program=by_lane[:, 1].copy(),
            lane_link=by_lane[:, 2].copy(),
            crossing=tuple(name for name, _, _ in walked),
            crossing_program=np.array([k for _, k, _ in walked], np.int32),
            crossing_link=np.array([link for _, _, link in walked], np.int32),
        )


def signal_program(attributes: Mapping[str, str], phases: Sequence[Mapping[str, str]]) -> SignalProgram:
    """Return a ``tlLogic`` element and its phases as a program.

    Raises
    ------
    KeyError, ValueError
        If something is missing, or a phase is not of whole seconds, of at least one, with a letter for each link.
    """
    seconds = tuple(int(float(phase["duration"])) for phase in phases)
    states = tuple(phase["state"] for phase in phases)
    if not phases or min(seconds) < 1 or len({len(state) for state in states}) != 1:
        raise ValueError(f"signal program {attributes['id']!r} has no phases of equal links and at least a second")
    return SignalProgram(attributes["id"], seconds, states)
