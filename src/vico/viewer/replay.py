"""The replay page: one HTML file with the map, the moving agents, schedules, log and first-person pictures inside."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.io.files import write_bytes
from vico.threads import in_order
from vico.viewer.recording import Recording
from vico.world.world import World

UNIT = 0.02  # metres a track unit, at best: 16 bits reach 655 m; wider runs have larger units
_HIDDEN = -32768


def write_replay(path: Path, recording: Recording, world: World, *, picture: NDArray[np.uint8] | None = None) -> None:
    """Write the page; it opens from disk in any browser, without a network.

    Parameters
    ----------
    picture
        The world seen from above, north up, uint8, shape ``(n, n, 3)``: shown under the map on request.
    """
    page = files("vico.viewer").joinpath("replay_page.html").read_text(encoding="utf-8")
    data = json.dumps(page_data(recording, world, picture=picture), separators=(",", ":"), ensure_ascii=False)
    # Names come from the map: nothing in them may end the script element, or open a comment in it.
    write_bytes(path, page.replace("/*DATA*/", data.replace("<", "\\u003c")).encode())


def page_data(recording: Recording, world: World, *, picture: NDArray[np.uint8] | None = None) -> dict[str, Any]:
    """Everything the page shows, as JSON types."""
    names = list(recording.people)
    numbers = {name: i for i, name in enumerate(names)}
    manifest = world.manifest
    reach = np.abs(recording.tracks[..., :2])
    unit = max(UNIT, float(np.max(reach, initial=0.0, where=np.isfinite(reach))) / 32_000)
    credit = "; ".join(dict.fromkeys(source.attribution for source in manifest.sources if source.attribution))

    def pictures(name: str) -> list[tuple[int, str]]:
        """Return what an agent saw every 20 s or so: views are filmed with a whole frame that often."""
        if name not in recording.views:
            return []
        return [(second, _uri(frame, 60)) for second, frame in recording.key_pictures(name)]

    bodies = []
    for body in recording.bodies:
        entry = {"kind": body.kind, "name": body.agent or body.name, "length": body.length, "width": body.width}
        if body.agent is not None:
            entry["agent"] = numbers[body.agent]
        bodies.append(entry)
    return {
        "title": f"Virtual Community: {manifest.name}",
        "subtitle": f"{recording.steps // 60} minutes, {len(recording.bodies)} bodies, "
        f"state {recording.state_hash[:16]}",
        "credit": credit,
        "half": world.half,
        "start": recording.start,
        "steps": recording.steps,
        "unit": unit,
        "tracks": _tracks(recording.tracks, unit),
        "bodies": bodies,
        "events": [
            {
                "t": e.step,
                "kind": e.kind,
                "who": e.agent,
                "name": recording.people.get(e.agent, {}).get("name", e.agent),
                "text": e.text,
            }
            for e in recording.events
        ],
        "agents": [
            recording.people[name] | {"id": name, "pictures": seen}
            for name, seen in zip(names, in_order(pictures, names), strict=True)
        ],
        "metrics": {k: v for k, v in recording.metrics.items() if isinstance(v, (int, float, str))},
        "picture": _uri(picture, 80) if picture is not None else None,
        **_map(world),
    }


def _tracks(tracks: NDArray[np.float32], unit: float) -> str:
    turns = tracks[..., 2:] - 2 * np.pi * np.rint(tracks[..., 2:] / (2 * np.pi))
    scaled = np.concatenate([tracks[..., :2] / unit, turns * 10_000], axis=-1)
    gone = ~np.isfinite(scaled).all(axis=-1)
    # Yaw of +-pi is +-31,416: it fits beside the mark for a body that is not there.
    whole = np.clip(np.nan_to_num(np.rint(scaled)), -32767, 32767).astype("<i2")
    whole[gone] = _HIDDEN
    return base64.b64encode(whole.tobytes()).decode()


def _uri(image: NDArray[np.uint8], quality: int) -> str:
    packed = io.BytesIO()
    Image.fromarray(image).save(packed, "WEBP", quality=quality, method=2)
    return "data:image/webp;base64," + base64.b64encode(packed.getvalue()).decode()


def _flat(points: Iterable[Iterable[float]]) -> list[int]:
    """Decimetres, x and y in turn."""
    return [round(10 * value) for point in points for value in list(point)[:2]]


def _map(world: World) -> dict[str, Any]:
    walked = {"footway", "path", "pedestrian", "steps", "cycleway", "track", "bridleway", "corridor"}
    objects = world.objects
    trees = (objects.kind == "tree") & (objects.room == "")
    return {
        "buildings": [
            {"rings": [_flat(ring) for ring in b.footprint], "open": int(b.accessible)} for b in world.buildings
        ],
        "roads": [
            {"w": road.width, "kind": "walk" if road.kind in walked else "drive", "line": _flat(road.line)}
            for road in world.roads.roads
            if road.layer >= 0
        ],
        "trees": _flat(zip(objects.x[trees].tolist(), objects.y[trees].tolist(), strict=True)),
        "places": [
            {"x": round(10 * p.position[0]), "y": round(10 * p.position[1]), "name": p.name, "kind": str(p.category)}
            for p in world.places
        ],
    }
