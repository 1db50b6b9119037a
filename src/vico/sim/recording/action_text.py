"""Actions as text: whatever an agent handed in, good or not, in a bounded line of JSON."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

#: An action whose JSON is longer is cut to its type, and says how long it was.
LONGEST_ACTION = 8192
_DEEPEST = 6
_STRICT = json.JSONEncoder(ensure_ascii=False, allow_nan=False)
_LONGEST_TEXT, _LONGEST_LIST = 2048, 512


def action_text(action: object) -> str:
    """Return an action as JSON: what JSON does not know is told in words, what is too large is cut."""
    try:
        # Most actions are small mappings of plain values: one call writes them.
        text = _STRICT.encode(action)
    except (TypeError, ValueError, RecursionError):
        text = json.dumps(_plain(action, 0), ensure_ascii=False)
    if len(text) <= LONGEST_ACTION:
        # Halves of surrogate pairs, which no file can hold, become question marks.
        return text.encode("utf-8", "replace").decode()
    kind = action.get("type") if isinstance(action, dict) else None
    return json.dumps({"type": kind if isinstance(kind, str) and len(kind) < 80 else None, "characters": len(text)})


def _plain(value: object, depth: int) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, np.ndarray) and value.size <= _LONGEST_LIST:
        value = value.tolist()
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, int):
        return value if abs(value) < 2**63 else "a whole number beyond 64 bits"
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    if isinstance(value, str):
        return value[:_LONGEST_TEXT]
    if isinstance(value, dict) and depth < _DEEPEST and len(value) <= _LONGEST_LIST:
        return {_plain_key(key): _plain(item, depth + 1) for key, item in value.items()}
    if isinstance(value, list | tuple) and depth < _DEEPEST and len(value) <= _LONGEST_LIST:
        return [_plain(item, depth + 1) for item in value]
    # Not its repr: that is the agent's own code.
    return f"<{type(value).__name__}>"


def _plain_key(key: object) -> str:
    return key[:80] if isinstance(key, str) else f"<{type(key).__name__}>"
