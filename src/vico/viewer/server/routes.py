"""What the server answers over HTTP: the page, the city, and the run as JSON, frames and pictures."""

from __future__ import annotations

import json
import struct
from collections.abc import Awaitable, Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles

from vico.errors import InputError, MissingFileError, VicoError
from vico.viewer.server.state import ViewerState
from vico.viewer.sources.views import NoPictureError

PAGE = Path(__file__).parents[1] / "page"
#: Steps whose frames one answer holds at most.
MOST_FRAMES = 600

_MOST_EVENTS, _MOST_POINTS, _MOST_HITS, _LONGEST_QUERY = 5000, 5000, 100, 200

Handler = Callable[[Request], Awaitable[Response]]
_Answer = Callable[[ViewerState, Request], Awaitable[Response]]


def routes(state: ViewerState) -> list[BaseRoute]:
    """Return the routes of a server.

    Parameters
    ----------
    state
        What it shows.
    """
    found: list[BaseRoute] = [
        Route("/", _handler(state, _page)),
        Route("/three/index.js", _handler(state, _three)),
        Mount("/page", StaticFiles(directory=PAGE, check_dir=False)),
        Route("/api/person/{entity:int}.bin", _handler(state, _person)),
    ]
    found += [Route(f"/api/{name}", _handler(state, answer)) for name, answer in _API.items()]
    if state.city is not None:
        found.append(Mount("/city", StaticFiles(directory=state.city)))
    return found


def _handler(state: ViewerState, answer: _Answer) -> Handler:
    """Return a handler that makes sentences of our errors."""

    @wraps(answer)
    async def handle(request: Request) -> Response:
        try:
            return await answer(state, request)
        except MissingFileError as error:
            return JSONResponse({"error": str(error)}, 404)
        except VicoError as error:
            return JSONResponse({"error": str(error)}, 400)

    return handle


async def _page(state: ViewerState, request: Request) -> Response:
    return FileResponse(PAGE / "index.html", media_type="text/html; charset=utf-8")


async def _three(state: ViewerState, request: Request) -> Response:
    return FileResponse(state.three(), media_type="text/javascript")


async def _run(state: ViewerState, request: Request) -> Response:
    head = await run_in_threadpool(state.source.head)
    return _json(head | state.more())


async def _cast(state: ViewerState, request: Request) -> Response:
    since = _number(request, "since", None, 0, None)
    return _json(await run_in_threadpool(state.source.cast, since))


async def _moment(state: ViewerState, request: Request) -> Response:
    step = _step(state, request, "step", state.source.last)
    agent = request.query_params.get("agent", "")[:_LONGEST_QUERY]
    return _json(await run_in_threadpool(state.source.moment, step, agent))


async def _events(state: ViewerState, request: Request) -> Response:
    first, last = _range(state, request)
    limit = _number(request, "limit", 1000, 1, _MOST_EVENTS)
    return _json(await run_in_threadpool(state.source.events, first, last, limit))


async def _metrics(state: ViewerState, request: Request) -> Response:
    first, last = _range(state, request)
    points = _number(request, "points", 500, 2, _MOST_POINTS)
    told = await run_in_threadpool(state.source.metrics, first, last, points)
    return _json(told | {"speed": state.factor()})


async def _signals(state: ViewerState, request: Request) -> Response:
    return _json(await run_in_threadpool(lambda: state.source.signals))


async def _search(state: ViewerState, request: Request) -> Response:
    text = request.query_params.get("q", "")[:_LONGEST_QUERY]
    limit = _number(request, "limit", 20, 1, _MOST_HITS)
    return _json(await run_in_threadpool(state.source.search, text, limit))


async def _view(state: ViewerState, request: Request) -> Response:
    agent, output = (request.query_params.get(key, "")[:_LONGEST_QUERY] for key in ("agent", "output"))
    step = _step(state, request, "step", state.source.last)
    try:
        content, kind = await run_in_threadpool(state.view, agent, step, output or "rgb")
    except NoPictureError as error:
        # An answer like any other: a page asks for each step, and a 404 would be a fault in its browser's console.
        return _json({"picture": None, "reason": str(error)})
    except VicoError as error:
        return JSONResponse({"error": str(error)}, 404)
    if isinstance(content, Mapping):
        return _json(content)
    headers = {"X-Depth": "255*exp(-metres/20)"} if output == "depth" else {}
    return Response(content, media_type=kind, headers=headers)


async def _frames(state: ViewerState, request: Request) -> Response:
    first, last = _range(state, request)
    every = _number(request, "every", 1, 1, 100_000)
    if (last - first) // every >= MOST_FRAMES:
        raise InputError(f"frames of {(last - first) // every + 1} steps; ask for {MOST_FRAMES} at most")

    def content() -> bytes:
        frames = [frame.encoded() for frame in state.source.frames(first, last, every)]
        return b"".join(struct.pack("<I", len(frame)) + frame for frame in frames)

    return Response(await run_in_threadpool(content), media_type="application/octet-stream")


async def _person(state: ViewerState, request: Request) -> Response:
    content = await run_in_threadpool(state.person, request.path_params["entity"])
    return Response(content, media_type="application/octet-stream")


_API: dict[str, _Answer] = {
    "run": _run,
    "cast": _cast,
    "moment": _moment,
    "events": _events,
    "metrics": _metrics,
    "search": _search,
    "signals": _signals,
    "view": _view,
    "frames": _frames,
}


def _json(content: Mapping[str, Any]) -> Response:
    # Not a number is no JSON; nothing that is told here is one.
    return Response(json.dumps(content, ensure_ascii=False, allow_nan=False), media_type="application/json")


def _range(state: ViewerState, request: Request) -> tuple[int, int]:
    first, last = _step(state, request, "first", 0), _step(state, request, "last", state.source.last)
    if first > last:
        raise InputError(f"first is {first}, after last, which is {last}")
    return first, last


def _step(state: ViewerState, request: Request, name: str, usual: int) -> int:
    return _number(request, name, usual, 0, max(state.source.last, 0))


def _number(request: Request, name: str, usual: Any, low: int, high: int | None) -> Any:
    """Return a number of the query, or the usual one where it is left out.

    Raises
    ------
    InputError
        If it is no whole number, or out of range.
    """
    text = request.query_params.get(name)
    if text is None:
        return usual
    try:
        value = int(text[:20])
    except ValueError:
        raise InputError(f"{name} is {text[:20]!r}; it has to be a whole number") from None
    if value < low or (high is not None and value > high):
        raise InputError(f"{name} is {value}; it has to be {low} to {'any' if high is None else high}")
    return value
