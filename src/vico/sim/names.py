"""Agents, things and vehicles by what people call them: ``resident_3``, ``Ann Lee``, ``ann``, ``husky``, ``car 3``."""

from __future__ import annotations

import unicodedata
from collections.abc import Mapping
from difflib import get_close_matches

from vico.errors import InputError, some_of


def name_called(text: str, names: Mapping[str, str], *, option: str) -> str:
    """Return the key of what somebody calls by its key, by its name, or by words of its name.

    Capitals, accents, and underscores or spaces between words make no difference.

    Parameters
    ----------
    names
        Names as people know them, such as that of a person, by the key that the simulation knows, such as
        ``resident_3``.
    option
        Of which the text is, for the sentence of an error, such as ``film: --follow``.

    Raises
    ------
    InputError
        If nothing is called so, or several things are.
    """
    if text in names:
        return text
    wanted = _words(text)
    by_words: dict[str, list[tuple[str, ...]]] = {key: [_words(key), _words(name)] for key, name in names.items()}
    found = [key for key, called in by_words.items() if wanted in called]
    if not found and wanted:
        found = [key for key, called in by_words.items() if set(wanted) <= set(called[1])]
    if len(found) == 1:
        return found[0]
    if found:
        several = [_both(key, names[key]) for key in found]
        raise InputError(f"{option}: {len(found)} are called {text!r}: {some_of(several)}; say which")
    spelt = {" ".join(words): key for key, called in by_words.items() for words in called}
    near = get_close_matches(" ".join(wanted), spelt, n=1) or get_close_matches(" ".join(wanted[:1]), spelt, n=1)
    if near:
        key = spelt[near[0]]
        raise InputError(f"{option}: nobody is called {text!r}; did you mean {_both(key, names[key])}?")
    raise InputError(
        f"{option}: nobody is called {text!r}; there are {some_of([_both(*one) for one in names.items()])}"
    )


def _words(text: str) -> tuple[str, ...]:
    """Return the words of a name, without capitals and accents."""
    letters = unicodedata.normalize("NFKD", text.casefold())
    plain = "".join(letter for letter in letters if not unicodedata.combining(letter))
    return tuple(plain.replace("_", " ").split())


def _both(key: str, name: str) -> str:
    """Return a name with its key, where they are not the same words."""
    return key if _words(key) == _words(name) else f"{name} ({key})"


__all__ = ["name_called"]
