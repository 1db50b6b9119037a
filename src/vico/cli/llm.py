"""`vico llm serve`: a language model on this machine, for those who have no other."""

from __future__ import annotations

import threading
from pathlib import Path

from vico.assets.packages import small_language_model
from vico.llm.local import serve_model


def serve(model: Path | None, *, context: int, threads: int, port: int) -> int:
    """Serve a model until interrupted, and print what to tell other commands.

    Raises
    ------
    MissingExtraError
        If the extra, or the small model, is not installed.
    """
    path = model or small_language_model()
    with serve_model(path, context=context, threads=threads, port=port) as base:
        print(f"export VICO_LLM_BASE_URL={base} VICO_LLM_MODEL={path.stem}", flush=True)
        print("Serving on this machine only, until Ctrl-C.", flush=True)
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            print("Stopped.")
    return 0
