"""From a run folder to what the viewers show."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.sim.recording import Run
from vico.viewer.recording import RecordedBody, RecordedEvent, Recording

# Told by the map and the schedule already, or only of use to developers.
_SILENT = {"refused", "collision"}


def recording_of(run: Run) -> Recording:
    """Read what the page and the film show out of a run."""
    by_entity = {agent["entity"]: agent["name"] for agent in run.manifest["agents"]}
    bodies = [
        RecordedBody(b["entity"], b["kind"], b["name"], b["size"][0], b["size"][1], by_entity.get(b["entity"]))
        for b in run.manifest["bodies"]
    ]
    shown = {body.entity: body.name for body in bodies}
    events = [
        RecordedEvent(e["step"], e["kind"], e["agent"], e["text"], (e["x"], e["y"]))
        for e in run.events
        if e["kind"] not in _SILENT
    ]
    return Recording(
        path=run.path,
        start=int(run.manifest["start"]),
        tracks=np.concatenate([run.position[..., :2], run.yaw[..., None]], axis=-1),
        bodies=bodies,
        events=events,
        people={agent["name"]: _about(agent, shown[agent["entity"]]) for agent in run.manifest["agents"]},
        views=run.views,
        metrics=run.metrics,
        state_hash=run.hashes[-1],
    )


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
