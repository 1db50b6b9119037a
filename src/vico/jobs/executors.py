"""Which executor does the work: this process, processes of this machine, or a Ray cluster."""

from __future__ import annotations

from collections.abc import Sequence

from vico.errors import InputError
from vico.jobs.contract import Done, Executor, Service, Task, Told, answer_of, made, message_of
from vico.jobs.processes import Processes

_MOST = 256


def open_executor(*, workers: int = 1, ray: str | None = None) -> Executor:
    """Return what does tasks side by side.

    Parameters
    ----------
    workers
        Processes on this machine; with one, all is done in this process. With `ray` it only says how many processors
        a cluster has that is started for the occasion.
    ray
        A Ray cluster instead: its address, ``auto`` for the one that ``RAY_ADDRESS`` names or that runs on this machine
        (one is started where there is none), ``local`` for one that is started and ended here.

    Raises
    ------
    InputError
        If there is no such cluster, or `workers` is no number of processes.
    MissingExtraError
        If Ray is not installed.
    """
    if not 1 <= workers <= _MOST:
        raise InputError(f"workers: {workers}; at least one is needed, and no more than {_MOST}")
    if ray is not None:
        from vico.jobs.cluster import RayCluster

        return RayCluster(ray, processors=workers)
    return Processes(workers) if workers > 1 else ThisProcess()


class ThisProcess:
    """Does one task after the other where it was asked."""

    one_machine = True

    def run(self, service: Service, tasks: Sequence[Task], *, done: Done, told: Told | None = None) -> None:
        """Do all tasks, in order."""
        work = made(service, told or (lambda _: None))
        for index, task in enumerate(tasks):
            done(index, answer_of(message_of(work, task.content)))

    def __enter__(self) -> ThisProcess:
        return self

    def __exit__(self, *_: object) -> None:
        pass
