"""The choice of an executor."""

from __future__ import annotations

from batch.campaigns.drive import Executor
from batch.executors.threads import Threads
from met.diagnostic import Problem, error


def choose(
    *, threads: int | None = None, processes: int | None = None, dask: object = None, timeout: float | None = None
) -> Executor:
    """The executor of a campaign's tasks that these options ask for. Raises Problem E356 for two ways at once.

    dask     the address of a scheduler, "local", or a `distributed.Client`
    timeout  s that a case may go on without any progress; it takes processes, for a thread cannot be stopped
    """
    for name, count in (("threads", threads), ("processes", processes)):
        if count is not None and count < 1:
            raise ValueError(f"{name}={count}: at least 1")
    if dask is not None:
        if processes is not None:
            helps = "Dask's processes are its own; `--dask local` has as many at work as there are cores"
            raise Problem(error("E356", "`--processes` and `--dask` are two ways to run a campaign", help=helps))
        from batch.executors.dask import Dask

        return Dask(dask, threads=threads, timeout=timeout)
    if processes is not None or timeout is not None:
        from batch.executors.processes import Processes

        return Processes(processes, threads=threads, timeout=timeout)
    return Threads(threads)
