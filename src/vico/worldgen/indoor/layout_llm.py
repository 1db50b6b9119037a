"""Floor plans drawn by a language model, from a place's name, kind and the room there is; checked before they are used.

The paper (appendix, "Indoor Scene Generation Pipeline") makes rooms from building names in steps: empty rooms, large
furniture in them, small things on top. Here the model draws rooms, doors and large furniture as a layout of
`indoor.layout_library`; its validator's findings go back to the model until the plan can be built and walked
through; small things are then put on by rule. A place whose plan stays bad is planned by rule, and is reported.
"""

from __future__ import annotations

import hashlib
import json
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

from vico.errors import LlmBudgetError, LlmReplyError, SourceError
from vico.llm import LanguageModel, system, user
from vico.world.heights import HeightField
from vico.world.model import Building, Dropped, Entrance, Place
from vico.worldgen.indoor.layout_library import Layout, LayoutRequest, layout_guide, layout_problems, layout_schema
from vico.worldgen.indoor.stage import Indoors, furnish

#: A plan that shows what is meant; it passes all checks.
EXAMPLE: dict[str, Any] = {
    "schema": "vico.layout",
    "version": 1,
    "name": "Bakery with a few seats",
    "use": "bakery",
    "size": [9.0, 8.0],
    "rooms": [
        {"id": "shop", "kind": "bakery", "rect": [0, 0, 9, 4.5], "floor": "chequer", "colour": "#d8c8a8"},
        {"id": "kitchen", "kind": "restaurant_kitchen", "rect": [0, 4.5, 6, 8], "walls": "tiled"},
        {
            "id": "store",
            "kind": "storage",
            "rect": [6, 4.5, 9, 8],
            "furniture": [{"model": "store_rack", "at": [7.5, 7.68], "yaw": -90}],
        },
    ],
    "doors": [
        {"between": ["shop", "outside"], "at": [4.5, 0], "width": 1.2},
        {"between": ["shop", "kitchen"], "at": [3, 4.5]},
        {"between": ["kitchen", "store"], "at": [6, 6]},
    ],
}

_MOST_REASON = 400
_SETUP = (401, 403, 404)  # statuses that no waiting mends: the caller has to
_PATIENCE = 3  # places in a row that a server may fail at before it is left alone


class LlmLayoutAuthor:
    """A `LayoutAuthor` that asks a language model.

    Parameters
    ----------
    model
        Whom to ask.
    rounds
        How often a plan may be mended.
    workers
        Calls under way at a time; one if they are recorded or replayed. Where a budget does not reach for all
        places and there are several, it depends on the server's pace who gets a plan.

    Attributes
    ----------
    dropped
        Places left to the rules, with the reason, in the order they were asked for.
    drawn
        Number of plans that were drawn.
    """

    def __init__(self, model: LanguageModel, *, rounds: int = 3, workers: int = 4) -> None:
        self.model, self.rounds, self.workers = model, rounds, workers
        self.dropped: list[Dropped] = []
        self.drawn = 0
        self._heard = False  # whether it ever answered
        self._failed = 0  # places in a row
        self._over: str | None = None
        self._lock = threading.Lock()

    @property
    def digest(self) -> str:
        """Digest of what plans depend on besides the places: model, options, prompt."""
        told = json.dumps([self.model.name, self.rounds, _briefing()])
        return hashlib.sha256(told.encode()).hexdigest()

    def draw(self, request: LayoutRequest, feedback: Sequence[str] = ()) -> str | None:
        """Draw a plan, mended as often as it takes.

        Parameters
        ----------
        feedback
            Not needed: the model was told all findings already.

        Returns
        -------
        str or None
            A layout as JSON without a fault; None if there is none, and then `dropped` says why.

        Raises
        ------
        SourceError
            If the server refuses key or model, or has never answered: that is for the caller to mend.
        InputError
            If a recording is replayed that holds no answer.
        """
        layout, reason = self._ask_for_plan(request)
        return self._book_plan(request, layout, reason)

    def draw_all(self, requests: Sequence[LayoutRequest]) -> dict[LayoutRequest, str]:
        """Draw many plans, some at a time; requests that got none are missing, and are in `dropped`.

        Requests that differ in the place's id alone (branches of a chain in rooms of one size) share a plan.
        """
        groups: dict[LayoutRequest, list[LayoutRequest]] = {}
        for request in requests:
            groups.setdefault(replace(request, place=""), []).append(request)
        with ThreadPoolExecutor(1 if self.model.recorded else max(1, self.workers)) as pool:
            waiting = [pool.submit(self._ask_for_plan, members[0]) for members in groups.values()]
            try:
                drawn = [one.result() for one in waiting]
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
        plans: dict[LayoutRequest, str] = {}
        for members, (layout, reason) in zip(groups.values(), drawn, strict=True):
            for request in members:
                text = self._book_plan(request, layout, reason)
                if text is not None:
                    plans[request] = text
        return plans

    def _ask_for_plan(self, request: LayoutRequest) -> tuple[Layout | None, str]:
        """Return a plan, or why there is none."""
        if self._over is not None:
            return None, self._over
        try:
            place = {
                "name": request.name[:120],
                "kind": request.kind[:60],
                "category": request.category,
                "use": request.use,
                "largest size": list(request.size),
            }
            question = (
                f"The place, as map data describe it:\n{json.dumps(place, ensure_ascii=False)}\n"
                "Draw its floor plan: what would one find behind a door with this name? Fill about the largest size if "
                "a place of this kind needs it, less if not."
            )
            reply = self.model.ask(
                [system(_briefing()), user(question)],
                Layout,
                check=lambda layout: _faults(layout, request),
                rounds=self.rounds,
            )
        except LlmReplyError as error:
            self._note_answer()
            return None, str(error)
        except LlmBudgetError as error:
            self._over = str(error)
            return None, self._over
        except SourceError as error:
            with self._lock:
                self._failed += 1
                if error.status in _SETUP or not self._heard:
                    raise
                if self._failed >= _PATIENCE:
                    self._over = f"{error}; not asked again after {_PATIENCE} places"
            return None, str(error)
        self._note_answer()
        return reply.value, ""

    def _note_answer(self) -> None:
        with self._lock:
            self._heard, self._failed = True, 0

    def _book_plan(self, request: LayoutRequest, layout: Layout | None, reason: str) -> str | None:
        """Book a plan, or that there is none."""
        if layout is not None:
            self.drawn += 1
            return json.dumps(layout.model_dump(mode="json", by_alias=True, exclude_none=True))
        said = f"{request.kind} {request.name!r}: no drawn plan ({reason[:_MOST_REASON]}); planned by rule"
        self.dropped.append(Dropped(id=request.place or request.name, reason=said))
        return None


def furnish_drawn(
    places: Sequence[Place],
    *,
    author: LlmLayoutAuthor,
    buildings: Sequence[Building],
    height: HeightField,
    seed: int = 0,
    entrances: Sequence[Entrance] = (),
    library: Path | None = None,
) -> tuple[Indoors, list[Dropped]]:
    """`furnish` with plans from a language model, asked for several at a time.

    Parameters
    ----------
    author
        Who draws; asked for all places that the library does not cover.

    Returns
    -------
    Indoors, list of Dropped
        The rooms, and the places whose rooms follow the rules although a plan was asked for, with the reason.

    Raises
    ------
    SourceError, InputError
        As `LlmLayoutAuthor.draw`; and as `furnish`.
    """
    before = len(author.dropped)
    wanted = _Collector()
    furnish(
        places, buildings=buildings, height=height, seed=seed, entrances=entrances, library=library, author=wanted
    )  # fmt: skip
    # Mapped places first, in their order: halls without a name can do with the rules if the budget runs out.
    order = {place.id: k for k, place in enumerate(places)}
    requests = sorted(wanted.requests, key=lambda request: order.get(request.place, len(order)))
    plans = author.draw_all(requests)
    made = furnish(
        places, buildings=buildings, height=height, seed=seed, entrances=entrances, library=library,
        author=_Drawn(plans),
    )  # fmt: skip
    return made, author.dropped[before:]


class _Collector:
    """An author that only collects requests."""

    def __init__(self) -> None:
        self.requests: list[LayoutRequest] = []

    def draw(self, request: LayoutRequest, feedback: Sequence[str]) -> None:
        self.requests.append(request)


class _Drawn:
    """An author whose plans lie ready."""

    def __init__(self, plans: dict[LayoutRequest, str]) -> None:
        self.plans = plans

    def draw(self, request: LayoutRequest, feedback: Sequence[str]) -> str | None:
        return self.plans.get(request)


def _faults(layout: Layout, request: LayoutRequest) -> list[str]:
    wrong = layout_problems(layout, request)
    if layout.use != request.use or layout.category is not None:
        wrong.insert(0, f"use: it has to be {request.use!r}, and category null")
    return wrong


def _briefing() -> str:
    """Return what does not depend on the place."""
    schema = layout_schema()
    pieces = "; ".join(
        f"{name} {one['size'][0]:g} x {one['size'][1]:g}{'' if one['solid'] else ' flat'}"
        for name, one in schema["x-furniture"].items()
    )
    return (
        "You are an architect who draws floor plans for places in a simulated city, as JSON. First divide the floor "
        "into rooms, then set doors, then place large furniture; small things are put on it later by others.\n"
        f"Rules. {layout_guide()}\n"
        f"Kinds of rooms: {', '.join(schema['x-room-kinds'])}. A room whose furniture is null is furnished as its "
        "kind demands, well and without faults: give furniture of your own only where this place differs.\n"
        f"Floors: {', '.join(schema['x-floors'])}. Walls: {', '.join(schema['x-walls'])}.\n"
        f"Furniture, by model, with extent along and across its used side at yaw 0 in metres: {pieces}.\n"
        f"An example:\n{json.dumps(EXAMPLE)}"
    )
