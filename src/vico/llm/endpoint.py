"""Which server and which model: named by the environment, never by a file that could be shared by mistake."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from urllib.parse import urlsplit

from vico.errors import InputError

_OPENAI = "https://api.openai.com/v1"


@dataclass(frozen=True)
class Endpoint:
    """A server that speaks the chat completions protocol, and a model it serves.

    Attributes
    ----------
    base
        Address up to and with the version, such as ``http://127.0.0.1:8080/v1``, without a slash at its end.
    model
        Name of the model.
    key
        Sent as a bearer token; nothing is sent if empty. Never shown, recorded or cached.
    price
        Dollars a million tokens read, and written; None if unknown.

    Raises
    ------
    InputError
        If a part is unusable; the sentence names the variable that holds it.
    """

    base: str
    model: str
    key: str = field(default="", repr=False)
    price: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        try:
            parts = urlsplit(self.base)
            usable = parts.scheme in ("http", "https") and bool(parts.hostname) and (parts.port or 1) > 0
        except ValueError:
            usable = False
        if not usable or re.search(r"[\s\x00-\x1f\x7f]", self.base):
            raise InputError(
                "VICO_LLM_BASE_URL: not an http or https address; give one such as http://127.0.0.1:8080/v1"
            )
        if "@" in parts.netloc or parts.query or parts.fragment:
            raise InputError(
                "VICO_LLM_BASE_URL: must hold no user name, query or fragment; the key goes in VICO_LLM_KEY"
            )
        if not self.model or len(self.model) > 300 or not self.model.isprintable():
            raise InputError("VICO_LLM_MODEL: name the model that the server is to answer with")
        if not (self.key.isascii() and self.key.isprintable()) or " " in self.key:
            raise InputError("VICO_LLM_KEY: holds characters that no key has; copy it anew")
        if self.price is not None and not all(math.isfinite(p) and p >= 0 for p in self.price):
            raise InputError(f"VICO_LLM_PRICE: {self.price} are no prices")
        object.__setattr__(self, "base", self.base.rstrip("/"))

    @property
    def url(self) -> str:
        """Where completions are asked for."""
        return f"{self.base}/chat/completions"

    @classmethod
    def from_environment(cls, environ: Mapping[str, str] | None = None) -> Endpoint:
        """Read address, model, key and prices from the environment; `vico.llm` lists the variables.

        ``OPENAI_API_KEY`` goes to OpenAI and to ``OPENAI_BASE_URL`` only: another server must not learn it.

        Raises
        ------
        InputError
            If no server or no model is named, or one of them is unusable.
        """
        env = os.environ if environ is None else environ
        own, openai_base = env.get("VICO_LLM_BASE_URL", "").strip(), env.get("OPENAI_BASE_URL", "").strip()
        openai_key = env.get("OPENAI_API_KEY", "").strip()
        base = own or openai_base or (_OPENAI if openai_key else "")
        if not base:
            raise InputError(
                "no language model is named: set VICO_LLM_BASE_URL (such as http://127.0.0.1:8080/v1), VICO_LLM_MODEL, "
                "and VICO_LLM_KEY if the server wants a key"
            )
        key = env.get("VICO_LLM_KEY", "").strip()
        if not key and base.rstrip("/") in (_OPENAI, openai_base.rstrip("/")):
            key = openai_key
        return cls(base, env.get("VICO_LLM_MODEL", "").strip(), key, _price(env.get("VICO_LLM_PRICE", "").strip()))


def _price(text: str) -> tuple[float, float] | None:
    if not text:
        return None
    try:
        read, written = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(
            f"VICO_LLM_PRICE: {text[:40]!r}; give dollars a million tokens read and written, such as 0.15,0.60"
        ) from None
    return read, written
