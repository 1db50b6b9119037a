"""Who of a run's residents know each other, as its community tells."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vico.community.folder import read_community
from vico.errors import VicoError


def relations_of(path: Path, manifest: Mapping[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """Return whom each resident knows, the nearest first, by the resident's id; empty where the community is gone.

    Each entry has ``name``, ``kind``, ``note`` and ``strength`` as `vico.community.model.Relation` describes them.
    """
    told = (manifest.get("community") or {}).get("path")
    if not told:
        return {}
    try:
        community = read_community(Path(os.path.normpath(path / told)))
    except (VicoError, OSError):
        # A recording is shown without its community as well.
        return {}
    names = {resident.id: resident.name for resident in community.residents}
    found: dict[str, list[dict[str, Any]]] = {}
    for relation in sorted(community.relations, key=lambda r: -r.strength):
        for one, other in (relation.between, relation.between[::-1]):
            entry = {"name": names.get(other, other), "kind": str(relation.kind.value), "note": relation.note}
            found.setdefault(one, []).append(entry | {"strength": relation.strength})
    return found
