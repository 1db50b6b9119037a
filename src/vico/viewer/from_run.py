"""From a run folder to what the viewers show."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.sim.recording import Run
from vico.viewer.recording import RecordedBody, RecordedEvent, Recording

# Told by the map and the schedule already, or only of use to developers.
_SILENT = {"refused", "collision"}


def recording_of(run: Run) -> Recording:
    """Read what the page and the film show out of a run: its state at every whole second."""
    chosen = _whole_seconds(run)
    tracks = run.tracks()
    cast = {int(entity): run.cast[int(entity)] for entity in tracks.entity}
    bodies = [RecordedBody(e, b.kind, b.name, b.size[0], b.size[1], b.agent) for e, b in cast.items()]
    events = [
        RecordedEvent(
            min(int(np.searchsorted(chosen, e["step"])), len(chosen) - 1),
            e["kind"],
            e["agent"],
            e["text"],
            (e["x"], e["y"]),
        )
        for e in run.events
        if e["kind"] not in _SILENT
    ]
    return Recording(
        path=run.path,
        start=int(run.manifest["start"]),
        tracks=np.concatenate([tracks.position[chosen, :, :2], tracks.yaw[chosen, :, None]], axis=-1, dtype=np.float32),
        bodies=bodies,
        events=events,
        people={agent["name"]: _about(agent, cast[agent["entity"]].name) for agent in run.agents},
        views=run.views,
        view_steps=chosen,
        metrics=run.metrics,
        state_hash=run.hashes[-1],
    )


def _whole_seconds(run: Run) -> NDArray[np.int64]:
    """Return the last recorded step of each second since the start: every step, where all agents act once a second."""
    times = run.times - run.times[0]
    seconds = np.arange(int(times[-1] + 1e-6) + 1)
    return np.searchsorted(times, seconds + 1e-6) - 1


def _about(agent: dict[str, Any], shown: str) -> dict[str, Any]:
    person = agent["person"]
    if person is None:
        return {"name": shown, "role": agent["kind"], "about": "", "schedule": []}
    return {
        "name": person["name"],
        "role": person["occupation"],
        "about": f"{person['age']}. {person['biography']}",
        "schedule": [
            {"start": s["start"], "end": s["end"], "activity": s["activity"], "where": s["place"], "type": s["type"]}
            for s in person["schedule"]
        ],
    }
