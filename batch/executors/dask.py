"""Tasks on the workers of a Dask cluster: one on this machine, or many machines that see the campaign's folder.

    a task here --JSON--> scheduler --> worker --> child (batch/executors/dask_worker.py) --> shard, in the folder
                                          '--> what came of it, in a line

Neither MET's classes nor its functions travel: the scheduler needs no MET, and a worker that has none can say so.
"""

from __future__ import annotations

import asyncio
import sys
import time
import uuid
from collections.abc import Callable, Coroutine, Mapping
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import ExitStack, suppress
from typing import Any

from batch.campaigns.drive import Outcome
from batch.campaigns.folder import Folder
from batch.campaigns.tasks import CampaignSection, Done, Task
from batch.executors.dask_connection import check, dask_client
from met.diagnostic import Problem, error
from met.version import VERSION

LOST = "the connection to Dask's scheduler was lost"

WORKER_SECONDS = 60.0
"""Longest wait for a first worker, s."""

TELL_SECONDS = 0.1
COUNT_SECONDS = 0.5
CLOSE_SECONDS = 3.0
FETCHES = 50

# The function that a worker runs, as text: code would have to suit its Python, and a name would have to be known to it,
# and to the scheduler.
ERRAND = f"""
try:
    from met_arm import find_own_packages
    find_own_packages()
    from batch.executors.dask_worker import carry_out
except ImportError as reason:
    from socket import gethostname
    why = f"{{gethostname()}} has no MET {VERSION} where its Dask worker runs ({{reason}}): install it there"
    outcome = {{"kind": "broken", "why": why}}
else:
    outcome = carry_out(order)
"""
CALL = "exec(errand, told) or told['outcome']"


def _say(text: str) -> None:
    print(text, file=sys.stderr)


async def _held(future: Any) -> Any:
    """The value of a Dask future. If it cannot be fetched, the worker may have ended: then it will be computed again;
    or the scheduler has: then the future is cancelled a little later."""
    from distributed.comm import CommClosedError

    for _ in range(FETCHES):
        with suppress(CommClosedError):
            return await future
        await asyncio.sleep(TELL_SECONDS)
    return await future


class Dask:
    """Executor on a Dask cluster: as many tasks at a time as its workers have threads; workers may come and go.

    dask      "local", the address of a scheduler, its file (`*.json`), or a `distributed.Client`
    threads   of each task
    timeout   s without any progress after which a case is given up
    say       told what the user waits for
    """

    def __init__(
        self,
        dask: object,
        *,
        threads: int | None = None,
        timeout: float | None = None,
        say: Callable[[str], None] = _say,
    ) -> None:
        """Check the argument that names a cluster. Raises Problem, TypeError; nothing is connected before `open`."""
        check(dask)
        self.under_way = 0
        self._dask, self._threads, self._timeout, self._say = dask, threads or 1, timeout, say
        self._name = f"met-{uuid.uuid4().hex}"
        self._token = f".{self._name}"  # a worker that sees this file sees the same folder, and no other of its name
        self._workers: dict[str, int] = {}
        self._counted, self._seen = False, 0.0
        self._running: dict[Future[Outcome], Task] = {}
        self._opened = ExitStack()

    @property
    def workers(self) -> int:
        return sum(self._workers.values())

    @property
    def about(self) -> str:
        workers, threads = len(self._workers), self.workers
        text = f"Dask, {workers} worker{'s' if workers != 1 else ''}"
        return text if threads == workers else f"{text} with {threads} threads"

    def open(self, folder: Folder, sections: Mapping[int, CampaignSection], tell: Callable[[], None]) -> None:
        """Connect to the cluster, and wait for a worker that sees the campaign's folder."""
        from batch.executors.dask_worker import dismiss

        self._folder, self._sections, self._tell = folder.path.resolve(), sections, tell
        with ExitStack() as opened:
            self._client = opened.enter_context(dask_client(self._dask, self._threads))
            opened.callback(self._tell_all, dismiss)
            token = self._folder / self._token
            token.touch()
            opened.callback(token.unlink, missing_ok=True)
            opened.callback(self._on_loop(self._count()).cancel)
            self._await_worker()
            self._opened = opened.pop_all()

    def submit(self, task: Task) -> None:
        self._running[self._on_loop(self._carry_out(task))] = task

    def wait(self) -> list[Outcome]:
        """The outcomes of the next tasks that end. All tasks are broken where no worker has been seen for too long."""
        while self._running:
            ended, _ = wait(self._running, timeout=TELL_SECONDS, return_when=FIRST_COMPLETED)
            self._tell()
            if not ended and (why := self._stuck()):
                return [Outcome(self._running.pop(future), "broken", why=why) for future in list(self._running)]
            if ended:
                for future in ended:
                    del self._running[future]
                return [future.result() for future in ended]
        return []

    def close(self) -> None:
        for future in self._running:
            future.cancel()
        self._running.clear()
        self._opened.close()

    # In this thread

    def _on_loop(self, work: Coroutine[Any, Any, Any]) -> Future[Any]:
        """Run a function in the client's event loop."""
        return asyncio.run_coroutine_threadsafe(work, self._client.loop.asyncio_loop)

    def _await_worker(self) -> None:
        """Wait for a worker, but not for ever. Raises Problem."""
        where = self._client.scheduler.address
        self._seen = time.monotonic()
        has_warned = False
        while not self._workers:
            if self._counted and not has_warned:
                has_warned = True
                until = f"waiting for one, {WORKER_SECONDS:g} s at most"
                self._say(f"Dask's scheduler at {where} has no worker yet: {until}")
            if why := self._stuck():
                helps = f"`dask worker {where}` starts one, where MET is installed and this folder is seen"
                raise Problem(error("E356", why, help=helps))
            time.sleep(TELL_SECONDS)
            self._tell()

    def _stuck(self) -> str:
        """The reason why no further progress is possible; empty where it is."""
        if self._client.status == "closed":
            return LOST
        if time.monotonic() - self._seen > WORKER_SECONDS:
            return f"Dask's scheduler has had no worker for {WORKER_SECONDS:g} s"
        return ""

    def _tell_all(self, dismiss: Callable[..., Any]) -> None:
        """Tell all workers to release their children for us; one that does not hear it does so itself later."""

        async def tell() -> None:
            await self._client.run(dismiss, self._name, on_error="ignore")

        if self._client.status == "running":
            with suppress(Exception):
                self._on_loop(tell()).result(CLOSE_SECONDS)

    # In the client's event loop

    async def _count(self) -> None:
        """Keep the number of threads of each worker of the cluster up to date, for ever."""
        while True:
            try:
                self._workers = await self._client.nthreads()
            except Exception:  # any error of a lost connection
                self._workers = {}
            if self._workers:
                self._seen = time.monotonic()
            self._counted = True
            await asyncio.sleep(COUNT_SECONDS)

    async def _carry_out(self, task: Task) -> Outcome:
        """Run a task on some worker. If that worker is lost, Dask runs it again on another."""
        from distributed.comm import CommClosedError
        from distributed.scheduler import KilledWorker

        key = f"{self._name}-{task.name}-{uuid.uuid4().hex}"
        order = {
            "folder": str(self._folder),
            "token": self._token,
            "version": VERSION,
            "campaign": self._name,
            "key": key,
            "task": [task.section, task.first, task.last],
            "threads": self._threads,
            "timeout": self._timeout,
        }
        dask_future = None
        try:
            errand = {"errand": ERRAND, "told": {"order": order}}
            dask_future = self._client.submit(eval, CALL, errand, key=key, pure=False)
            return self._outcome(task, await _held(dask_future))
        except KilledWorker:
            return Outcome(task, "lost", why="died with its Dask worker")
        except CancelledError:  # unless by us: that would be asyncio's
            if self._client.status == "running":
                return Outcome(task, "lost", why="was told by Dask to stop")
            return Outcome(task, "broken", why=LOST)
        except CommClosedError:
            return Outcome(task, "broken", why=LOST)
        except Exception as reason:
            return Outcome(task, "broken", why=f"Dask cannot run a task: {str(reason) or type(reason).__name__}")
        finally:
            if dask_future is not None:
                dask_future.release()

    def _outcome(self, task: Task, answer: Mapping[str, Any]) -> Outcome:
        """The outcome of a task from a worker's answer."""
        if answer["kind"] != "done":
            return Outcome(task, answer["kind"], why=answer["why"])
        if "proof" in answer and answer["proof"] != self._sections[task.section].key(task.first, task.last):
            why = f"{answer['host']} has other code of MET {VERSION}, or other models: install the same everywhere"
            return Outcome(task, "broken", why=why)
        return Outcome(task, "done", Done(*answer["done"]))
