"""Errors a person can act on: each says what went wrong, where, and how to mend it.

Every error of ours derives from `VicoError` and from the builtin it refines, so callers may catch either.
The command line prints the sentence and exits 2. Anything else is a fault of the program: the command line says so in a
sentence too, and where it happened; `vico --verbose` shows the traceback.
"""

import os
import traceback
from collections.abc import Sequence


class VicoError(Exception):
    """Base of every error that bad input or a missing part can cause."""


class InputError(VicoError, ValueError):
    """An argument or a value in a file is not usable."""


class MissingFileError(VicoError, FileNotFoundError):
    """A file or folder that was asked for is not there."""


class OutputExistsError(VicoError, FileExistsError):
    """The output folder holds something already; `--force` replaces it."""


class OutputError(VicoError, OSError):
    """Something cannot be written: the disk is full, the folder is gone or another process's, or rights are missing."""


class SchemaError(VicoError, ValueError):
    """A file is of another schema, version or owner than the one expected."""


class EmptyInputError(VicoError, ValueError):
    """The input was read, but holds nothing to work on."""


class StageError(VicoError, RuntimeError):
    """A stage of a build failed as a whole, for none of its objects in particular; its cause is what failed."""


class MissingExtraError(VicoError, ImportError):
    """An optional part is not installed; the message holds the command to type."""


class SourceError(VicoError, OSError):
    """A service in the network did not give what was asked for; `status` is its HTTP status, if it answered."""

    status: int | None = None


class LlmReplyError(VicoError, ValueError):
    """A language model's replies stayed unusable; `findings` holds what was wrong with the last, `answer` its text."""

    findings: tuple[str, ...] = ()
    answer: str = ""


class LlmBudgetError(VicoError, RuntimeError):
    """The calls, tokens or money a caller granted are spent."""


def sentence_of(error: BaseException) -> str:
    """Return the kind of an error and the first line of what it says."""
    said = str(error).strip().splitlines()
    return f"{type(error).__name__}: {said[0][:200]}" if said else type(error).__name__


def line_of(error: BaseException) -> str:
    """Return the file and line that an error came from."""
    frames = traceback.extract_tb(error.__traceback__)
    return f"{os.path.basename(frames[-1].filename)}:{frames[-1].lineno}" if frames else "an unknown line"


def some_of(names: Sequence[str], most: int = 12) -> str:
    """Return names for a message, separated by commas; of many only the first, and how many there are."""
    told = ", ".join(names[:most])
    return told if len(names) <= most else f"{told}, ... ({len(names):,} in all)"
