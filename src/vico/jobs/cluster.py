"""Tasks of a Ray cluster (the extra ``ray``): machines may come and go, and a task whose machine dies is done again."""

from __future__ import annotations

import json
import logging
import os
import secrets
import socket
import sys
from collections.abc import Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any

from vico.errors import InputError, MissingExtraError, SourceError
from vico.jobs.contract import Answer, Done, Service, Task, Told, answer_of
from vico.jobs.worker import answer_in_cluster

INSTALL = "Ray is not installed: pip install 'virtual-community[ray]'"
#: How often a task is done again whose process or machine died.
RETRIES = 2
#: Handed to the cluster at a time; it waits for free processors (and more machines) by itself.
_IN_FLIGHT = 1000
_KNOCK = 10.0  # seconds that a cluster has to answer at all
_PATIENCE = 60.0  # seconds without a processor until that is said
#: Of the environment, what decides what a task comes to or where it looks; keys and passwords stay where they are.
FORWARDED = (
    "VICO_DATA", "VICO_LLM_BASE_URL", "OPENAI_BASE_URL", "VICO_LLM_MODEL", "VICO_LLM_EPISODE_TOKENS", "VICO_LLM_PRICE",
    "VICO_OVERPASS", "AWS_ENDPOINT_URL", "AWS_ENDPOINT_URL_S3", "AWS_DEFAULT_REGION",
)  # fmt: skip
_log = logging.getLogger(__name__)


class RayCluster:
    """A Ray cluster that does tasks, a processor each.

    Nothing of its own is kept there: tasks write what they make where their service says. A task is done again, on
    another machine if need be, up to `RETRIES` times if its process or machine dies.

    Parameters
    ----------
    address
        ``auto``, ``local``, ``host:port`` or ``ray://host:port``; see `vico.jobs.executors.open_executor`.
    processors
        Of a cluster that is started for the occasion.

    Raises
    ------
    MissingExtraError
        If Ray is not installed.
    InputError
        If there is no such cluster, or it runs another version of Ray or Python.
    """

    def __init__(self, address: str, *, processors: int) -> None:
        self._ray = ray_module()
        self._mine = not self._ray.is_initialized()
        if self._mine:
            connect(address, processors)

    @property
    def one_machine(self) -> bool:
        """Whether all is done here; never taken for granted of a cluster."""
        return False

    def __enter__(self) -> RayCluster:
        return self

    def __exit__(self, *_: object) -> None:
        if self._mine:
            self._ray.shutdown()

    def run(self, service: Service, tasks: Sequence[Task], *, done: Done, told: Told | None = None) -> None:
        """Do all tasks; say what came of each as it is over.

        Raises
        ------
        InputError
            If a machine of the cluster cannot make the service; the message names it.
        OutputError
            If a task can't write what it did.
        SourceError
            If the cluster goes away.
        """
        place = json.dumps(
            {
                "environment": {name: os.environ[name] for name in FORWARDED if name in os.environ},
                "folder": os.getcwd(),
                "path": sys.path,
            }
        )
        ray = self._ray
        do = ray.remote(num_cpus=1, max_retries=RETRIES)(answer_in_cluster)
        flying: dict[Any, int] = {}
        try:
            options = ray.put(json.dumps(dict(service.options)))
            waiting = iter(range(len(tasks)))
            while True:
                for index in islice(waiting, _IN_FLIGHT - len(flying)):
                    content = json.dumps(dict(tasks[index].content))
                    flying[do.remote(service.maker, options, place, content)] = index
                if not flying:
                    return
                for ref in self._over(list(flying)):
                    done(flying.pop(ref), self._answer(ref))
        finally:
            for ref in flying:
                with suppress(Exception):  # the cluster may be gone
                    ray.cancel(ref, force=True)

    def _over(self, flying: Sequence[Any]) -> Sequence[Any]:
        """Wait until a task is over, or several."""
        try:
            while True:
                over, _ = self._ray.wait(flying, num_returns=1, timeout=_PATIENCE)
                if over:
                    # Those that are over by now, too: looking at a thousand for each of them would take long.
                    return self._ray.wait(flying, num_returns=len(flying), timeout=0)[0]
                if self._ray.cluster_resources().get("CPU", 0) < 1:
                    _log.warning("Ray: %d tasks wait, and no machine of the cluster has a processor", len(flying))
        except (ConnectionError, self._ray.exceptions.RaySystemError) as error:
            raise SourceError(f"the Ray cluster went away ({first_line(error)}); give the same command again") from None

    def _answer(self, ref: Any) -> Answer:
        """Return what came of a task; that its process died too often is one, too."""
        try:
            return answer_of(json.loads(self._ray.get(ref)))
        except self._ray.exceptions.RayTaskError as error:
            raise InputError(f"Ray: {first_line(error)}; is the same vico installed on every machine?") from None
        except self._ray.exceptions.RayError as error:
            how = f"{type(error).__name__}, {RETRIES + 1} times"
            return Answer(None, f"its process or its machine died ({how}); it may lack memory")


def connect(address: str, processors: int) -> None:
    """Let this process be one that a cluster works for; start one where that is what `address` means.

    Raises
    ------
    InputError
        If there is no such cluster, or it cannot be used from here.
    """
    ray = ray_module()
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    how = {"log_to_driver": False, "logging_level": logging.ERROR}
    try:
        found = _known_address() if address == "auto" else address
        if found in ("", "local"):
            _start(ray, processors, how)
        else:
            _check_answer(found)  # Ray itself tries for minutes
            ray.init(found, **how)
    except (ConnectionError, RuntimeError, ValueError, TimeoutError, ray.exceptions.RayError) as error:
        raise InputError(
            f"--ray {address}: {first_line(error)}; start a cluster with ray start --head, or give the address of one"
        ) from None


def _known_address() -> str:
    """Return the address of the cluster that the environment names, or that ``ray start`` has noted on this machine."""
    note = Path(os.environ.get("RAY_TMPDIR", "/tmp")) / "ray" / "ray_current_cluster"
    with suppress(OSError):
        return os.environ.get("RAY_ADDRESS") or note.read_text(encoding="utf-8").strip()
    return ""


def _check_answer(address: str) -> None:
    """Make sure that something answers at ``host:port``, with or without ``ray://``.

    Raises
    ------
    ConnectionError
        If nothing does.
    """
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if host and port.isdigit():
        try:
            socket.create_connection((host.strip("[]"), int(port)), timeout=_KNOCK).close()
        except OSError as error:
            raise ConnectionError(f"nothing answers at {address} ({error.strerror or error})") from None


def _start(ray: Any, processors: int, how: dict[str, Any]) -> None:
    """Start a cluster on this machine; whatever Ray is told it listens on all interfaces, so nobody gets in unasked."""
    # It asks for a word (Ray 2.60 on) that would be written into the home folder; Ray keeps it as long as the process.
    if not {"RAY_AUTH_MODE", "RAY_AUTH_TOKEN", "RAY_AUTH_TOKEN_PATH"} & set(os.environ):
        os.environ["RAY_AUTH_TOKEN"] = secrets.token_hex(32)
    ray.init("local", num_cpus=processors, include_dashboard=False, **how)


def ray_module() -> Any:
    """Return Ray.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    try:
        import ray
    except ImportError:
        raise MissingExtraError(INSTALL) from None
    return ray


def first_line(error: BaseException) -> str:
    """Return the line of what Ray says that says most."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return (lines[-1] if "Traceback" in str(error) else lines[0])[:300] if lines else type(error).__name__
