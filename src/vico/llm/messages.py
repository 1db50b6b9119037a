"""What is said to a model: plain records of the chat protocol, text and pictures."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

from vico.errors import InputError

#: ``{"role": ..., "content": text or parts}``; made by `system` and `user`.
Message = dict[str, Any]

_HEADS = (("png", b"\x89PNG\r\n\x1a\n"), ("jpeg", b"\xff\xd8\xff"), ("gif", b"GIF8"))
_MOST_PICTURE = 20 << 20  # bytes; the least of what the large services take


def system(text: str) -> Message:
    """Say who the model is and what it has to keep to."""
    return {"role": "system", "content": text}


def user(text: str, *pictures: bytes) -> Message:
    """Say what is wanted, with pictures to look at.

    Parameters
    ----------
    text
        The request.
    pictures
        Encoded PNG, JPEG, WebP or GIF files; they travel inside the request.

    Raises
    ------
    InputError
        If a picture is none of these, or larger than 20 MiB.
    """
    if not pictures:
        return {"role": "user", "content": text}
    parts: list[dict[str, Any]] = [{"type": "text", "text": text}]
    parts += [{"type": "image_url", "image_url": {"url": _data_url(picture, k)}} for k, picture in enumerate(pictures)]
    return {"role": "user", "content": parts}


def _data_url(picture: bytes, number: int) -> str:
    if len(picture) > _MOST_PICTURE:
        raise InputError(f"picture {number}: {len(picture):,} bytes; at most {_MOST_PICTURE:,} can be sent")
    kinds = [media for media, head in _HEADS if picture.startswith(head)]
    if picture[:4] == b"RIFF" and picture[8:12] == b"WEBP":
        kinds.append("webp")
    if not kinds:
        raise InputError(f"picture {number}: neither PNG, JPEG, WebP nor GIF")
    return f"data:image/{kinds[0]};base64,{base64.b64encode(picture).decode()}"


def checked(messages: Sequence[Message]) -> list[Message]:
    """Return the messages if they are what `system` and `user` make, or an assistant's words.

    Raises
    ------
    InputError
        If one is not; pictures by address are refused, as the server would fetch what the address names.
    """
    for k, message in enumerate(messages):
        content = message.get("content")
        if message.get("role") not in ("system", "user", "assistant") or not isinstance(content, (str, list)):
            raise InputError(f"message {k}: give a role (system, user, assistant) and text, or parts")
        for part in content if isinstance(content, list) else ():
            url = part.get("image_url", {}).get("url", "") if part.get("type") == "image_url" else None
            if not (isinstance(part.get("text"), str) if url is None else url.startswith("data:image/")):
                raise InputError(f"message {k}: a part is text, or a picture as a data address")
    if not messages:
        raise InputError("messages: there are none")
    return list(messages)


def tokens_of(messages: Sequence[Message]) -> int:
    """About how many tokens messages have: four characters each, 1,000 a picture."""
    total = 0
    for message in messages:
        content = message["content"]
        for part in [{"text": content}] if isinstance(content, str) else content:
            total += 1000 if "image_url" in part else len(part["text"]) // 4 + 4
    return total
