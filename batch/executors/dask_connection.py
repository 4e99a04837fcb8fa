"""A client of a Dask cluster, from the user's argument: `local`, an address, a scheduler file, or a client."""

from __future__ import annotations

import asyncio
import logging
import os
import tempfile
import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from met.diagnostic import Problem, error
from met.host import system
from met.host.files import read_json

CONNECT_SECONDS = 5.0
"""Longest wait for a scheduler, s."""

LOCAL = "local"


def check(dask: object) -> None:
    """Refuse an argument that names no cluster, before any work begins. Raises Problem, TypeError."""
    if isinstance(dask, str | os.PathLike):
        return
    from distributed import Client

    if not isinstance(dask, Client):
        raise TypeError(f'dask is the address of a scheduler, "local" or a Client, and not {type(dask).__name__}')
    if dask.asynchronous:
        raise Problem(
            error(
                "E356",
                "the Dask client is asynchronous, and batch.run is not",
                help="a Client made without `asynchronous=True` serves it",
            )
        )


@contextmanager
def dask_client(dask: object, threads: int) -> Iterator[Any]:
    """The client. What is made for it here is closed afterwards: a client that the user made is not.

    threads   cores of this machine that each worker of a local cluster is for

    Raises Problem E356 where there is no such cluster.
    """
    from distributed import Client

    if isinstance(dask, Client):
        if dask.status != "running":
            helps = "it has to be connected to a scheduler"
            raise Problem(error("E356", f"the Dask client is {dask.status}", help=helps))
        yield dask
        return
    assert isinstance(dask, str | os.PathLike)
    with silenced_dask(), _started(threads) if dask == LOCAL else _reached(_address(os.fspath(dask))) as client:
        yield client


@contextmanager
def silenced_dask() -> Iterator[None]:
    """A block in which Dask prints nothing about connections and workers: what matters is reported as an outcome."""
    import distributed  # noqa: F401 - it sets the levels of its loggers when it is imported

    names = [name for name in logging.root.manager.loggerDict if name.split(".")[0] in ("distributed", "tornado")]
    before = [(logger, logger.level) for logger in map(logging.getLogger, names)]
    try:
        for logger, _ in before:
            logger.setLevel(logging.CRITICAL)
        yield
    finally:
        for logger, level in before:
            logger.setLevel(level)


def _address(called: str) -> str:
    """The address of a scheduler, which may be in a file. Raises Problem."""
    path = Path(called)
    if path.suffix != ".json":
        return called
    helps = f"`dask scheduler --scheduler-file {called}` writes it"
    try:
        return str(read_json(path)["address"])
    except OSError as reason:
        message = f"cannot read the Dask scheduler file {called}: {(reason.strerror or str(reason)).lower()}"
        raise Problem(error("E356", message, help=helps)) from None
    except (ValueError, LookupError, TypeError):
        helps = "`dask scheduler --scheduler-file FILE.json` writes one"
        raise Problem(error("E356", f"{called} is no scheduler file of Dask", help=helps)) from None


@contextmanager
def _reached(address: str) -> Iterator[Any]:
    """A client of the scheduler at an address. Raises Problem."""
    from distributed import Client
    from distributed.versions import VersionMismatchWarning

    try:
        # First without a client: one that reaches nothing goes on trying, and complains when the program ends. In a
        # thread, for there may be an event loop in this one, in a notebook for instance.
        with ThreadPoolExecutor(1) as thread:
            thread.submit(asyncio.run, _greet(address)).result()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", VersionMismatchWarning)  # what it is about does not travel
            client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except Exception as reason:  # any error, where the address is invalid or something else answers
        helps = "`dask scheduler` starts one, and says its address"
        raise Problem(error("E356", f"no Dask scheduler answers at `{address}`", help=helps)) from reason
    with client:
        yield client


async def _greet(address: str) -> None:
    """Connect to a scheduler and leave again, to see that it is there; raises what connecting raises."""
    from distributed.comm import connect
    from distributed.security import Security

    arguments = Security().get_connection_args("client")
    comm = await asyncio.wait_for(connect(address, timeout=CONNECT_SECONDS, **arguments), CONNECT_SECONDS)
    await comm.close()


@contextmanager
def _started(threads: int) -> Iterator[Any]:
    """A client of a scheduler and a worker inside this process, which others cannot reach, since a scheduler runs its
    clients' code. Its tasks are in children of the worker all the same."""
    from distributed import Client, LocalCluster

    at_once = max(1, system.cores() // threads)
    nowhere = "127.0.0.1:0"
    with (
        tempfile.TemporaryDirectory(prefix="met-dask-", ignore_cleanup_errors=True) as scratch,
        # the memory that tasks take is that of the worker's children, which Dask's limit does not count
        LocalCluster(
            n_workers=1,
            threads_per_worker=at_once,
            processes=False,
            protocol="inproc://",
            memory_limit=0,
            local_directory=scratch,
            dashboard_address=nowhere,
            worker_dashboard_address=nowhere,
            scheduler_kwargs={"dashboard": False},
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        for server in (cluster.scheduler, *cluster.workers.values()):
            server.http_server.stop()  # each has a web server, which cannot be switched off
        yield client
