"""Quantities as people type them into tags: heights, storeys, widths, speeds, angles.

All stages read tags' numbers here, so that `12 metres`, `40'6"` or `G+4` mean the same everywhere. A reading says by
which rule it came about where the value does not say it plainly; a build lists these (`vico.worldgen.evidence`).
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

FOOT, INCH = 0.3048, 0.0254  # metres
# Metres a second.
_KMH = 1 / 3.6
_MPH = 0.44704
_KNOT = 0.514444


class Kind(Enum):
    """Quantity that a tag's value measures."""

    LENGTH = "length"
    """Metres, where no unit is said."""
    STOREYS = "storeys"
    SPEED = "speed"
    """Kilometres an hour, where no unit is said; read as metres a second."""
    ANGLE = "angle"
    """Degrees."""
    NUMBER = "number"
    LANES = "lanes"


@dataclass(frozen=True)
class Reading:
    """A value as it is read.

    Attributes
    ----------
    value
        In metres, metres a second, degrees or as a number; None where it can't be read.
    rule
        How it was found, where the value does not say it plainly; empty where it does.
    """

    value: float | None
    rule: str = ""


_FEET, _INCHES = ("ft", "feet", "foot", "fuß", "fuss", "pie", "pies", "'"), ("in", "inch", "inches", '"', "''")
_UNITS: dict[Kind, dict[str, float]] = {
    Kind.LENGTH: {
        **dict.fromkeys(("", "m", "mt", "mts", "mtr", "mtrs", "metre", "metres", "meter", "meters", "metro"), 1.0),
        **dict.fromkeys(("metern", "metros", "metri", "metrów", "mètre", "mètres", "м", "метр", "метров", "米"), 1.0),
        **dict.fromkeys(("cm", "centimetre", "centimetres", "centimeter", "centimeters"), 0.01),
        **dict.fromkeys(("mm", "millimetre", "millimetres", "millimeter", "millimeters"), 0.001),
        **dict.fromkeys(("km", "kilometre", "kilometres", "kilometer", "kilometers", "км", "公里"), 1000.0),
        **dict.fromkeys(("yd", "yard", "yards"), 0.9144),
        **dict.fromkeys(("mi", "mile", "miles"), 1609.344),
        **dict.fromkeys(_FEET, FOOT),
        **dict.fromkeys(_INCHES, INCH),
    },
    Kind.STOREYS: {
        **dict.fromkeys(("", "level", "levels", "floor", "floors", "storey", "storeys", "story", "stories"), 1.0),
        **dict.fromkeys(("f", "fl", "st", "stock", "etage", "etagen", "geschoss", "geschosse", "étage", "étages"), 1.0),
        **dict.fromkeys(("pisos", "plantas", "piani", "层"), 1.0),
    },
    Kind.SPEED: {
        **dict.fromkeys(("", "km/h", "kmh", "kph", "kmph", "km"), _KMH),
        **dict.fromkeys(("mph", "mi/h", "miles/h"), _MPH),
        **dict.fromkeys(("knots", "knot", "kn"), _KNOT),
        "m/s": 1.0,
    },
    Kind.ANGLE: dict.fromkeys(("", "°", "deg", "degree", "degrees", "grad"), 1.0),
    Kind.NUMBER: {"": 1.0},
    Kind.LANES: dict.fromkeys(("", "lane", "lanes", "spur", "spuren", "voie", "voies", "carril", "carriles"), 1.0),
}

# Speeds that are said by what they are of, km/h.
_SPEED_WORDS = {"walk": 6.0, "living_street": 10.0, "urban": 50.0}
_ZONE = re.compile(r"(?:[a-z]{2}:)?zone:?(\d+)")
_COUNTRY = re.compile(r"[a-z]{2}(?:-[a-z]{2,3})?:")

# Fractions that are a letter, after a whole number or alone.
_FRACTION_LETTER = re.compile(r"(\d+)?\s*([¼½¾⅐-⅞])")
# Spellings of one thing; unicode's own compatible forms (full-width digits, no-break spaces) are resolved after the
# first and before the others.
_FIRST = str.maketrans({"″": '"', "º": "°"})
_ALIKE = str.maketrans(
    {**dict.fromkeys("’‘′´`ʹ", "'"), **dict.fromkeys("“”″„ʺ", '"'), **dict.fromkeys("−‐‑–—", "-"), "⁄": "/"}
)
_NUMBER = r"\d+(?:[ .,']\d{3})+(?:[.,]\d+)?(?!\d)|\d*[.,]?\d+"
_ONE = re.compile(rf"(?P<number>[-+]?(?:{_NUMBER}))(?:\.(?=[^\W\d]))?\s*(?P<unit>[^\d\s.,;:()+-][^\s\d,;:()]*)?")
_FEET_AND_INCHES = re.compile(
    r"(?P<feet>\d+(?:[.,]\d+)?)\s*(?:'(?!')|ft(?![a-z])\.?|feet(?![a-z])|foot(?![a-z]))\s*(?:and\s*)?-?\s*"
    r"(?P<inches>\d+(?:[.,]\d+)?)\s*(?:\"|''|in\b\.?|inch(?:es)?\b)?\.?"
)
# "1m80", "8 m 50 cm".
_METRES_AND_CENTIMETRES = re.compile(r"(\d+)\s*m\s*(\d\d)(?:\s*cm)?")
# A comma between thousands, where nobody would measure in thousandths: of feet.
_THOUSANDS = re.compile(r"[1-9]\d{0,2},\d{3}")
_UNIT_IN_BRACKETS = re.compile(r"(.*\d)\s*\(([^\s\d()]+)\)")
_ABOUT = re.compile(
    r"^(?:~|≈|≃|±|\+/-|ca\b\.?|circa\b|c\.|approx\b\.?|approximately\b|about\b|around\b|est\b\.?|estimated\b|etwa\b|env\b\.?|"
    r"environ\b|roughly\b|um\b|ungefähr\b|aprox\b\.?|cca\b\.?|około\b|около\b|ок\.|c(?=\d))\s*"
)
_BOUND = re.compile(
    r"^(?:>=?|<=?|≥|≤|over\b|above\b|under\b|below\b|up to\b|at least\b|at most\b|min\b\.?|max\b\.?|more than\b|"
    r"less than\b)\s*"
)
_REMARK = re.compile(r"\([^()]*\)|\[[^\[\]]*\]")
_SEVERAL = re.compile(
    r"\s*[;|&]\s*|,\s+(?=[-+]?\d)|,(?=-\d)|\s+(?:and|or|und|to|bis)\s+(?=[-+]?\d)|(?<=[\w'\"])\s*/\s*(?=\d)"
    r"|(?<=[\w'\"°])\s*(?:-|\.\.+)\s*(?=-?\d)"
)
_FRACTION = re.compile(r"(?<![\d.,/])(\d+) (\d)/([2-9])(?![\d/])")
# Of a length; of storeys and lanes "1/2" lists two.
_LESS_THAN_ONE = re.compile(r"^(1/2|1/3|2/3|1/4|3/4)(?![\d/])")
_DASHED_INCHES = re.compile(r"(?<=')\s*-\s*(?=\d+(?:[.,]\d+)?\s*(?:\"|''|in\b))")
_COLON = re.compile(r"(?<!\d)(\d+):(\d+)(?![\d:])")
# Terms of storeys that are letters: the ground floor counts as one, cellars and what lies in the roof as none.
_GROUND_FLOOR = frozenset(["g", "gf", "eg", "r", "rc", "rdc", "p", "pb", "l", "lg", "pt", "bv"])
_NO_STOREY = frozenset(["b", "ug", "kg", "s", "ss", "m", "a", "at", "dg", "pk", "mp", "mansard", "attic", "t", "ph"])
_TERM = re.compile(r"(\d+(?:[.,]\d+)?)|([a-z]+)")


def read(text: str | None, kind: Kind = Kind.NUMBER) -> Reading:
    """Read a tag's value.

    Parameters
    ----------
    text
        As typed: ``12``, ``12,5 m``, ``40'6"``, ``65 feet``, ``~15``, ``15 m (to the eaves)``, ``10-12``, ``G+4``.
    kind
        What it measures.

    Returns
    -------
    Reading
        Of several values the highest. Numbers have a comma or a point; both together, the last one is the decimal.
    """
    return _read(text, kind) if text and not text.isspace() else Reading(None)


def _spelt_alike(text: str, kind: Kind) -> str:
    """Return a value in small letters, with one spelling of marks and fractions, and its unit beside its number."""
    said = _FRACTION_LETTER.sub(lambda found: f"{int(found[1] or 0) + unicodedata.numeric(found[2]):g}", text)
    said = unicodedata.normalize("NFKC", said.translate(_FIRST)).translate(_ALIKE)
    said = "".join(letter for letter in said if unicodedata.category(letter) != "Cf")
    said = " ".join(said.lower().split())
    said = _FRACTION.sub(lambda found: f"{int(found[1]) + int(found[2]) / int(found[3]):g}", said)
    said = _DASHED_INCHES.sub(" ", said)
    if (found := _UNIT_IN_BRACKETS.fullmatch(said)) and found[2].rstrip(".") in _UNITS[kind]:
        said = f"{found[1]} {found[2]}"
    if kind is Kind.LENGTH and (found := _LESS_THAN_ONE.match(said)):
        said = f"{int(found[1][0]) / int(found[1][2]):g}{said[found.end() :]}"
    if kind is Kind.STOREYS:
        said = re.sub(r"(?<=\d)-(?=[a-z])", " ", said)  # "3-storey"
    return said


@lru_cache(maxsize=65536)
def _read(text: str, kind: Kind) -> Reading:
    said = _spelt_alike(text, kind)
    if kind is Kind.SPEED and (named := _named_speed(said)) is not None:
        return named
    rules: list[str] = []
    bare = _REMARK.sub(" ", said).strip()
    if bare != said:
        rules.append("without the remark" if bare else "of what stands in brackets")
        said = bare or said.strip("()[] ")
    for pattern, rule in ((_ABOUT, "an approximate value"), (_BOUND, "the bound that it names")):
        if (shorter := pattern.sub("", said)) != said:
            rules.append(rule)
            said = shorter
    for mark, rule in (("+", "the bound that it names"), ("?", "an approximate value")):
        if said.endswith(mark):
            rules.append(rule)
            said = said.rstrip(f"{mark} ")
    if kind is Kind.LENGTH and _COLON.fullmatch(said):
        rules.append("a colon as the decimal point")
        said = said.replace(":", ".")
    if kind is Kind.LANES and re.fullmatch(r"\d+(?: ?\+ ?\d+)+", said):
        return Reading(float(sum(map(int, said.split("+")))), "; ".join([*rules, "added up"]))
    if kind is Kind.STOREYS and (summed := _sum_of_storeys(said)) is not None:
        return Reading(summed.value, "; ".join([*rules, summed.rule]))
    if kind is Kind.STOREYS and not re.fullmatch(r"\d+,(?:50?|25|75)", said):
        # Halves and quarters are all the fractions there are: "1,2" lists two values, "1,5" is one and a half.
        said = said.replace(",", ";")
    pieces = [piece for piece in _SEVERAL.split(said.strip(" ,")) if piece]
    readings = [_one(piece, kind) for piece in pieces]
    if not readings or any(one is None for one in readings):
        return Reading(None)
    units = [one.unit for one in readings if one is not None and one.unit]
    last = units[-1] if units else ""
    values = [one.number * _UNITS[kind][one.unit or last] for one in readings if one is not None]
    rules += [one.rule for one in readings if one is not None and one.rule]
    if len(values) > 1:
        rules.append("the highest of several values")
    value = max(values)
    return Reading(value, "; ".join(dict.fromkeys(rules))) if math.isfinite(value) else Reading(None)


@dataclass(frozen=True)
class _Piece:
    number: float
    unit: str
    rule: str = ""


def _one(piece: str, kind: Kind) -> _Piece | None:
    """Read a number with its unit; words may follow a unit, and nothing else."""
    if kind is Kind.LENGTH and (found := _FEET_AND_INCHES.fullmatch(piece)):
        if float(found["inches"].replace(",", ".")) > 12.0:
            return None
        metres = float(found["feet"].replace(",", ".")) * FOOT + float(found["inches"].replace(",", ".")) * INCH
        return _Piece(metres, "m")
    if kind is Kind.LENGTH and (found := _METRES_AND_CENTIMETRES.fullmatch(piece)):
        return _Piece(int(found[1]) + int(found[2]) / 100.0, "m")
    found = _ONE.match(piece)
    if found is None:
        return None
    unit = (found["unit"] or "").rstrip(".")
    rest = piece[found.end() :].strip(" .")
    if unit not in _UNITS[kind] or (rest and not unit) or re.search(r"\d", rest):
        return None
    rule = "the words after it left out" if rest else ""
    if unit in _FEET and _THOUSANDS.fullmatch(found["number"]):
        return _Piece(float(found["number"].replace(",", "")), unit, rule or "a comma between its thousands")
    return _Piece(_decimal(found["number"]), unit, rule)


def _decimal(number: str) -> float:
    """Return a number that may have a decimal comma, a decimal point, or either between its thousands."""
    digits = number.replace(" ", "").replace("'", "")
    last = max(digits.rfind(","), digits.rfind("."))
    if last >= 0 and digits.count(digits[last]) == 1:
        return float(digits[:last].replace(",", "").replace(".", "") + "." + digits[last + 1 :])
    return float(digits.replace(",", "").replace(".", ""))  # "1.200.000", or no mark at all


def _sum_of_storeys(said: str) -> Reading | None:
    """Read storeys that are added up: ``G+4``, ``3+1``, ``EG+2+DG``; None where nothing is added."""
    terms = [term.strip() for term in said.split("+")]
    if len(terms) < 2:
        return None
    total = 0.0
    for term in terms:
        found = _TERM.fullmatch(term)
        if found is None or (found[2] and found[2] not in _GROUND_FLOOR | _NO_STOREY):
            return None
        total += _decimal(found[1]) if found[1] else float(found[2] in _GROUND_FLOOR)
    return Reading(total, "storeys added up" + (", the ground floor one of them" if not terms[0][0].isdigit() else ""))


def _named_speed(said: str) -> Reading | None:
    """Read a speed that is a word: ``walk``, ``DE:urban``, ``FI:zone30``."""
    if zone := _ZONE.fullmatch(said):
        return Reading(float(zone[1]) * _KMH, "the speed of its zone")
    word = _COUNTRY.sub("", said)
    return Reading(_SPEED_WORDS[word] * _KMH, f"the usual speed of {word!r}") if word in _SPEED_WORDS else None


@dataclass(frozen=True)
class Range:
    """A tag's quantity, and what it can be: a value beyond is as good as none."""

    kind: Kind
    least: float = -math.inf
    most: float = math.inf


#: What stages read by the tag's key.
QUANTITIES: Mapping[str, Range] = {
    **dict.fromkeys(("height", "building:height", "est_height"), Range(Kind.LENGTH, 0.1, 900.0)),
    **dict.fromkeys(("min_height", "building:min_height"), Range(Kind.LENGTH, 0.0, 900.0)),
    "roof:height": Range(Kind.LENGTH, 0.0, 200.0),
    "building:levels": Range(Kind.STOREYS, 1.0, 150.0),
    "roof:levels": Range(Kind.STOREYS, 0.0, 20.0),
    "building:levels:underground": Range(Kind.STOREYS, 0.0, 30.0),
    **dict.fromkeys(("building:min_level", "min_level"), Range(Kind.STOREYS, 0.0, 150.0)),
    "roof:angle": Range(Kind.ANGLE, 0.0, 90.0),
    "width": Range(Kind.LENGTH, 0.0, 1000.0),
    "circumference": Range(Kind.LENGTH, 0.0, 50.0),
    "diameter_crown": Range(Kind.LENGTH, 0.0, 60.0),
    "maxspeed": Range(Kind.SPEED, 0.0, 100.0),
    **dict.fromkeys(("lanes", "lanes:forward", "lanes:backward"), Range(Kind.LANES, 0.0, 20.0)),
    "layer": Range(Kind.NUMBER, -10.0, 10.0),
}


def quantity(tags: Mapping[str, str], key: str) -> float | None:
    """Return what a tag measures, in metres, metres a second, degrees or as a number.

    Parameters
    ----------
    key
        One of `QUANTITIES`.

    Returns
    -------
    float or None
        None where there is no such tag, it can't be read, or it says what can't be.
    """
    of = QUANTITIES[key]
    value = read(tags.get(key), of.kind).value
    return value if value is not None and of.least <= value <= of.most else None


def number(text: str | None) -> float | None:
    """Return a bare number, of several the highest; None if there is none."""
    return read(text).value


def numbers(text: str | None) -> list[float]:
    """Return all the bare numbers of a list such as ``-1;0;1``; empty if one of them can't be read."""
    pieces = [read(piece).value for piece in re.split(r"[;|]", text or "") if piece.strip()]
    return [] if None in pieces else [value for value in pieces if value is not None]


def metres(text: str | None) -> float | None:
    """Return a length, metres; None if there is none."""
    return read(text, Kind.LENGTH).value
