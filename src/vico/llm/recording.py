"""Answers kept: a recording of all calls in their order, which can be replayed, and a cache of what was accepted."""

from __future__ import annotations

import hashlib
import json
import re
import threading
from collections import defaultdict, deque
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vico.errors import InputError, MissingFileError, SchemaError
from vico.io.files import write_bytes, write_errors
from vico.llm.budget import Usage
from vico.llm.transport import Endpoint

_MOST_LINE = 64 << 20
_DATA = re.compile(r"^(data:[a-z/+.-]{1,40};base64,).*", re.DOTALL)


@dataclass(frozen=True)
class Answer:
    """What a model said: its text, why it stopped, its refusal (if it refused), what it took."""

    text: str
    finish: str
    refusal: str
    usage: Usage


class _Line(BaseModel):
    """A line of a recording: an answer, what was asked in words, and the digest by which it is found."""

    model_config = ConfigDict(extra="forbid", strict=True)

    record: str = Field(default="vico.llm", pattern=r"^vico\.llm$")
    version: int = Field(default=1, ge=1, le=1)
    base: str
    model: str
    digest: str
    request: dict[str, Any]
    text: str
    finish: str = ""
    refusal: str = ""
    usage: dict[str, float | int] = {}
    cached: bool = False


def digest_of(request: Mapping[str, Any]) -> str:
    """SHA-256 of a request's body, the model's name in it."""
    text = json.dumps(request, sort_keys=True, ensure_ascii=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


class CallRecorder:
    """Appends a line a call to a file; of pictures the digest alone. No key gets in: requests hold none."""

    def __init__(self, path: Path, endpoint: Endpoint) -> None:
        self.path, self.endpoint = Path(path), endpoint
        self._lock = threading.Lock()

    def keep(self, request: Mapping[str, Any], answer: Answer, *, cached: bool) -> None:
        """Append an answer."""
        usage: dict[str, float | int] = asdict(answer.usage)
        self._append(
            _Line(
                base=self.endpoint.base,
                model=self.endpoint.model,
                digest=digest_of(request),
                request=_without_pictures(request),
                text=answer.text,
                finish=answer.finish,
                refusal=answer.refusal,
                usage=usage,
                cached=cached,
            )
        )

    def _append(self, line: _Line) -> None:
        text = json.dumps(line.model_dump(), ensure_ascii=True)
        with self._lock, write_errors(self.path):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("a", encoding="ascii") as file:
                file.write(text + "\n")
                file.flush()


def _without_pictures(value: Any) -> Any:
    """Return a request with its pictures' bytes replaced by their digest: the recording is for eyes, too."""
    if isinstance(value, str):
        return _DATA.sub(lambda m: m[1] + hashlib.sha256(m[0].encode()).hexdigest(), value)
    if isinstance(value, Mapping):
        return {key: _without_pictures(item) for key, item in value.items()}
    return [_without_pictures(item) for item in value] if isinstance(value, Sequence) else value


class Replay:
    """Answers from a recording: to the same request in the order of the recording.

    Attributes
    ----------
    base, model
        Whose answers they are.

    Raises
    ------
    MissingFileError, SchemaError
        If the file is absent, or no recording; the sentence names the line.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self._answers: dict[str, deque[tuple[Answer, bool]]] = defaultdict(deque)
        self._lock = threading.Lock()
        self.base = self.model = ""
        try:
            with self.path.open("rb") as file:
                number = 0
                while raw := file.readline(_MOST_LINE):
                    number += 1
                    if raw.strip():
                        self._read(raw, number)
        except FileNotFoundError:
            raise MissingFileError(f"{self.path}: no such recording; make one with VICO_LLM_RECORD") from None
        except OSError as error:
            raise SchemaError(f"{self.path}: can't be read ({error.strerror})") from None
        if not self.model:
            raise SchemaError(f"{self.path}: holds no recorded calls; make them with VICO_LLM_RECORD")

    def _read(self, raw: bytes, number: int) -> None:
        try:
            line = _Line.model_validate_json(raw)
            usage = Usage(**line.usage)  # type: ignore[arg-type]
        except (ValidationError, TypeError) as error:
            what = error.errors()[0]["msg"] if isinstance(error, ValidationError) else "its usage has other fields"
            raise SchemaError(f"{self.path}: line {number} is no recorded call ({what}); record it anew") from None
        self.base, self.model = self.base or line.base, self.model or line.model
        self._answers[line.digest].append((Answer(line.text, line.finish, line.refusal, usage), line.cached))

    def cached_answer(self, request: Mapping[str, Any]) -> Answer | None:
        """Return the next answer to a request if it came from the cache then, and so cost nothing; else None."""
        with self._lock:
            waiting = self._answers.get(digest_of(request))
            return waiting.popleft()[0] if waiting and waiting[0][1] else None

    def answer(self, request: Mapping[str, Any]) -> Answer:
        """Return the next answer to a request.

        Raises
        ------
        InputError
            If there is none, or no further one.
        """
        digest = digest_of(request)
        with self._lock:
            known = digest in self._answers
            if known and self._answers[digest]:
                return self._answers[digest].popleft()[0]
        more = "no further answer" if known else "no answer"
        raise InputError(
            f"{self.path}: holds {more} to request {digest[:12]} of {request.get('model')}; what is asked has changed "
            "since, so record it anew with VICO_LLM_RECORD"
        )


class Cache:
    """Accepted answers in a folder, one file each, named by endpoint, model and request."""

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder)

    def place(self, endpoint: Endpoint, request: Mapping[str, Any]) -> Path:
        """Where the answer to a request lies, or would."""
        name = hashlib.sha256(f"{endpoint.base}\0{endpoint.model}\0{digest_of(request)}".encode()).hexdigest()
        return self.folder / name[:2] / f"{name}.json"

    def text(self, path: Path) -> str | None:
        """Return the text kept at a place; None if there is none, or it is damaged, so that it is asked for anew."""
        try:
            kept = json.loads(path.read_bytes())
        except (OSError, ValueError, RecursionError):
            return None
        text = kept.get("text") if isinstance(kept, dict) else None
        return text if isinstance(text, str) else None

    def keep(self, path: Path, text: str) -> None:
        """Keep a text, whole or not at all.

        Raises
        ------
        OutputError
            If the folder can't be written.
        """
        write_bytes(path, json.dumps({"text": text}, ensure_ascii=True).encode())
