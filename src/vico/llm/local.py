"""A language model on this machine: a server on the loop-back interface that holds replies to a schema.

llama.cpp does the work, through the package of the extra ``llm``. Speed hangs on idle cores: beside other work a second
thread makes it slower, as both wait for each other at every token.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vico.errors import InputError, MissingExtraError, MissingFileError, SourceError

_MAGIC = b"GGUF"


@contextmanager
def serve_model(
    path: Path, *, context: int = 8192, threads: int = 1, port: int = 0, quiet: bool = True
) -> Iterator[str]:
    """Serve a model on 127.0.0.1 while the context lasts.

    Parameters
    ----------
    path
        Weights, a GGUF file.
    context
        Longest question and answer together, tokens.
    threads
        Processor threads that answer.
    port
        Where it listens; 0 takes a free one.
    quiet
        Without llama.cpp's own log on stderr.

    Yields
    ------
    str
        Its address with ``/v1``, for ``VICO_LLM_BASE_URL``.

    Raises
    ------
    MissingExtraError
        If the extra is not installed.
    MissingFileError, InputError
        If the file is missing or no GGUF, or a number is unusable.
    SourceError
        If it can't be loaded or the port is taken.
    """
    try:
        import xllamacpp
    except ImportError:
        raise MissingExtraError("no local language model server: pip install 'virtual-community[llm]'") from None
    for name, value, least, most in (
        ("context", context, 512, 1 << 20), ("threads", threads, 1, 256), ("port", port, 0, 65535)
    ):  # fmt: skip
        if not least <= value <= most:
            raise InputError(f"llm serve: {name} {value}; give {least} to {most:,}")
    try:
        with path.open("rb") as file:
            magic = file.read(4)
    except OSError as error:
        raise MissingFileError(f"{path}: no weights can be read there ({error.strerror})") from None
    if magic != _MAGIC:
        raise InputError(f"{path}: no GGUF file; give a model's weights in that format")
    params = xllamacpp.CommonParams()
    params.model.path = str(path)
    params.model_alias = {path.stem}
    params.hostnames = ["127.0.0.1"]
    params.port, params.n_ctx, params.n_parallel, params.n_gpu_layers = port, context, 1, 0
    params.cpuparams.n_threads = params.cpuparams_batch.n_threads = threads
    params.ui = params.warmup = params.endpoint_slots = False
    if quiet:
        params.verbosity = -1
    try:
        server = xllamacpp.Server(params)
    except RuntimeError as error:
        raise SourceError(f"{path}: can't be served on 127.0.0.1:{port or 'any port'} ({error})") from None
    try:
        yield f"{server.listening_address}/v1"
    finally:
        del server  # it stops with its last reference
