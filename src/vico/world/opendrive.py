"""Roads of OpenDRIVE files: reference lines, cross-sections and profiles, read from their elements.

The format: ASAM OpenDRIVE, https://www.asam.net/standards/detail/opendrive/. Metres, local ENU, radians. Of its kinds
of geometry these are read that roads of a world have: ``line`` and ``paramPoly3``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from vico.errors import SchemaError

Floats = NDArray[np.float64]

# Gauss's nodes and weights on each of some parts of a curve: lengths to a micrometre.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_PARTS = 16
_AT = ((np.arange(_PARTS)[:, None] + (_NODES + 1) / 2) / _PARTS).ravel()
_SHARE = np.tile(_WEIGHTS / (2 * _PARTS), _PARTS)


def wrapped(angle: float) -> float:
    """Return an angle from -pi to pi."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


@dataclass(frozen=True)
class Curve:
    """A piece of a reference line: a cubic polynomial of a parameter that goes from 0 to 1.

    Attributes
    ----------
    coefficients
        Of 1, p, p² and p³, east and north, metres, shape ``(4, 2)``; the last two are nought of a straight line.
    """

    coefficients: Floats

    @classmethod
    def straight(cls, start: Floats, heading: float, length: float) -> Curve:
        """Return a straight line."""
        step = length * np.array([math.cos(heading), math.sin(heading)])
        return cls(np.array([start, step, (0.0, 0.0), (0.0, 0.0)], np.float64))

    @classmethod
    def between(cls, start: Floats, heading: float, end: Floats, heading_there: float) -> Curve:
        """Return the curve that leaves and arrives in the directions given; nearly an arc where there is one."""
        chord = end - start
        distance = math.hypot(*chord)
        across = math.atan2(chord[1], chord[0])
        tangents = []
        for direction in (heading, heading_there):
            bend = min(abs(wrapped(across - direction)), math.radians(110.0))
            reach = distance / math.cos(bend / 2) ** 2
            tangents.append(reach * np.array([math.cos(direction), math.sin(direction)]))
        leaving, arriving = tangents
        return cls(np.array([start, leaving, 3 * chord - 2 * leaving - arriving, leaving + arriving - 2 * chord]))

    @classmethod
    def of(cls, geometry: Element) -> Curve:
        """Read a ``geometry`` element.

        Raises
        ------
        SchemaError
            If it is neither a line nor a parametric cubic.
        """
        x, y, heading, length = (float(geometry.get(name, "nan")) for name in ("x", "y", "hdg", "length"))
        cubic = geometry.find("paramPoly3")
        if geometry.find("line") is not None:
            return cls.straight(np.array([x, y]), heading, length)
        if cubic is None:
            kind = geometry[0].tag if len(geometry) else "nothing"
            raise SchemaError(f"OpenDRIVE: geometry of the kind {kind}; there are line and paramPoly3")
        local = np.array([[float(cubic.get(f"{name}{axis}", "nan")) for axis in "UV"] for name in "abcd"])
        if cubic.get("pRange") != "normalized":
            local = local * (length ** np.arange(4))[:, None]
        c, s = math.cos(heading), math.sin(heading)
        turned = np.stack([c * local[:, 0] - s * local[:, 1], s * local[:, 0] + c * local[:, 1]], axis=1)
        return cls(turned + np.array([[x, y], [0, 0], [0, 0], [0, 0]]))

    @property
    def is_straight(self) -> bool:
        """Whether it is a line."""
        return not self.coefficients[2:].any()

    def points(self, p: Floats) -> Floats:
        """Points at parameters, shape ``(n, 2)``."""
        powers = p[:, None] ** np.arange(4)
        return np.asarray((powers[:, :, None] * self.coefficients).sum(axis=1))

    def end(self, p: float) -> tuple[Floats, float]:
        """Point and heading at a parameter."""
        a, b, c, d = self.coefficients
        along = b + 2 * c * p + 3 * d * p**2
        return a + b * p + c * p**2 + d * p**3, math.atan2(along[1], along[0])

    @cached_property
    def length(self) -> float:
        """Metres along it."""
        _, b, c, d = self.coefficients
        if self.is_straight:
            return math.hypot(*b)
        along = b + 2 * c * _AT[:, None] + 3 * d * _AT[:, None] ** 2
        return float((np.hypot(*along.T) * _SHARE).sum())

    def part(self, low: float, high: float) -> Curve:
        """Return what lies between two parameters."""
        a, b, c, d = self.coefficients
        size = high - low
        return Curve(
            np.array(
                [
                    a + b * low + c * low**2 + d * low**3,
                    (b + 2 * c * low + 3 * d * low**2) * size,
                    (c + 3 * d * low) * size**2,
                    d * size**3,
                ]
            )
        )

    def parameter(self, along: float) -> float:
        """Return the parameter so many metres from the start, at most 1."""
        if along >= self.length:
            return 1.0
        if self.is_straight:
            return along / self.length
        low, high = 0.0, 1.0
        for _ in range(30):
            middle = (low + high) / 2
            low, high = (middle, high) if self.part(0.0, middle).length < along else (low, middle)
        return (low + high) / 2


def reference_line(road: Element) -> list[Curve]:
    """Return the curves of a road's reference line, in order.

    Raises
    ------
    SchemaError
        If it has none, or one of a kind that is not read.
    """
    curves = [Curve.of(geometry) for geometry in road.iterfind("planView/geometry")]
    if not curves:
        raise SchemaError(f"OpenDRIVE: road {road.get('id')} has no geometry")
    return curves


def polynomial(entries: Iterable[Element], at: float, *, offset: str = "sOffset") -> float:
    """Return the value at `at` of cubic polynomials that hold from their `offset` on; 0 before the first."""
    value = 0.0
    for entry in entries:
        ds = at - float(entry.get(offset, "nan"))
        if ds < -1e-9:
            break
        a, b, c, d = (float(entry.get(name, "nan")) for name in "abcd")
        value = a + b * ds + c * ds**2 + d * ds**3
    return value


def lanes_of(section: Element) -> dict[int, Element]:
    """Return the lanes beside the middle of a lane section, by id."""
    return {int(lane.get("id", "0")): lane for side in ("left", "right") for lane in section.iterfind(f"{side}/lane")}


def end_section(road: Element, *, at_end: bool) -> Element:
    """Return a road's first or last lane section.

    Raises
    ------
    SchemaError
        If it has none.
    """
    sections = road.findall("lanes/laneSection")
    if not sections:
        raise SchemaError(f"OpenDRIVE: road {road.get('id')} has no lane section")
    return sections[-1 if at_end else 0]


def lane_borders(road: Element, *, at_end: bool) -> dict[int, tuple[float, float]]:
    """Return how far left of the reference line each lane's inner and outer border is at an end of a road, metres."""
    length = float(road.get("length", "nan"))
    section = end_section(road, at_end=at_end)
    along = length if at_end else 0.0
    middle = polynomial(road.iterfind("lanes/laneOffset"), along, offset="s")
    within = along - float(section.get("s", "nan")) if at_end else 0.0
    found: dict[int, tuple[float, float]] = {}
    for sign in (1, -1):
        border = middle
        chosen = [lane for lane in lanes_of(section).items() if lane[0] * sign > 0]
        for number, lane in sorted(chosen, key=lambda lane: abs(lane[0])):
            outer = border + sign * polynomial(lane.iterfind("width"), within)
            found[number] = (border, outer)
            border = outer
    return found


def elevation(road: Element, at: float) -> float:
    """Return the height of a road's reference line, metres."""
    return polynomial(road.iterfind("elevationProfile/elevation"), at, offset="s")


def beside(point: Floats, heading: float, left: float) -> Floats:
    """Return the point so many metres left of another."""
    return point + left * np.array([-math.sin(heading), math.cos(heading)])
