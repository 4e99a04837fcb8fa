"""The code on a Dask worker: it runs tasks in child processes, which it keeps while a campaign sends it tasks.

So a case that kills its process, or never ends, takes down a child and never the worker. The children of a campaign
are a plugin of the worker: it goes when the campaign says so, when nobody waits for a running task any more, when
nothing has come for a while, and with the worker; a worker that is killed takes its children along
(batch/executors/child.py).
"""

from __future__ import annotations

import asyncio
import os
import socket
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from distributed import Reschedule, Worker, WorkerPlugin, get_worker
from distributed.utils import sync
from distributed.worker import WORKER_ANY_RUNNING

from batch.campaigns import tasks
from batch.campaigns.drive import Outcome
from batch.campaigns.tasks import Task
from batch.executors.child import Crew
from met.version import VERSION

IDLE_SECONDS = 60.0
"""Seconds without a task after which children are released: their campaign may have been killed."""

LOOK_SECONDS = 1.0

GIVEN_UP = ("released", "cancelled", "forgotten")
"""States, in the worker's words, of a running task that nobody waits for any more."""


def carry_out(order: Mapping[str, Any]) -> dict[str, Any]:
    """Have a task run by a child of this worker; called by Dask, in a thread of the worker's.

    order   folder, the campaign's; token, a file in it; version, of MET; task; key, of the Dask task; campaign, its
            name here; threads and timeout, of a child

    What came of it, as `batch.executors.Outcome` has it, in words and numbers that any Dask can carry: kind, why, done.
    With the first that is done goes its shard's key as proof: it says what code this worker has.
    """
    host, folder, task = socket.gethostname(), Path(order["folder"]), Task(*order["task"])
    if order["version"] != VERSION:
        return _broken(f"{host} has MET {VERSION}, and not {order['version']}: install that where its Dask worker runs")
    if not os.path.exists(folder / order["token"]):  # nor may its user look into it
        return _broken(
            f"{host} does not see {folder}: put the archive where all hosts see it under the same name (`-o`)"
        )
    worker = get_worker()
    children: WorkerChildren = sync(worker.loop, WorkerChildren.on, worker, order)
    outcome = children.carry_out(task, order["key"])
    if outcome.kind == "broken":
        return _broken(f"on {host}, {outcome.why}")
    if outcome.done is None:
        return {"kind": outcome.kind, "why": outcome.why}
    answer = {"kind": "done", "done": [outcome.done.seconds, outcome.done.failed], "host": host}
    if not children.proved:
        children.proved = True
        answer["proof"] = tasks.shard_of_file(folder / "shards" / task.path).key
    return answer


async def dismiss(campaign: str, dask_worker: Worker) -> None:
    """Release the children that a worker keeps for a campaign."""
    if campaign in dask_worker.plugins:
        await dask_worker.plugin_remove(name=campaign)


class WorkerChildren(WorkerPlugin):
    """The children that a worker keeps for one campaign. All but `carry_out` is called in the worker's event loop.

    over     whether they have been sent home
    proved   whether a shard of theirs has been shown
    """

    def __init__(self, name: str, crew: Crew) -> None:
        self._name, self._crew = name, crew
        self.over = self.proved = False
        self._at_work: set[str] = set()
        self._last = time.monotonic()

    @staticmethod
    async def on(worker: Worker, order: Mapping[str, Any]) -> WorkerChildren:
        """The children of a worker, for one more task. Raises Reschedule where the worker is closing: it would not let
        go of them."""
        if worker.status not in WORKER_ANY_RUNNING:
            raise Reschedule
        name = order["campaign"]
        children = worker.plugins.get(name)
        if not isinstance(children, WorkerChildren):
            crew = Crew(Path(order["folder"]), threads=order["threads"], timeout=order["timeout"])
            children = WorkerChildren(name, crew)
            await worker.plugin_add(plugin=children, name=name)
        children._at_work.add(order["key"])
        return children

    def carry_out(self, task: Task, key: str) -> Outcome:
        """Run a task, for which the children were requested with `on`. Raises Reschedule where they were released
        before: then it has no result, and may be run elsewhere."""
        try:
            outcome = self._crew.carry_out(task)
        except RuntimeError:
            if not self.over:
                raise
        finally:
            self._last = time.monotonic()
            self._at_work.discard(key)
        if self.over:
            raise Reschedule
        return outcome

    def setup(self, worker: Worker) -> None:
        self._worker = worker
        self._look = asyncio.create_task(self._go_when_idle())

    def transition(self, key: Any, start: str, finish: str, **_: Any) -> None:
        """Stop all where Dask has given up a task that is under way here."""
        if key in self._at_work and finish in GIVEN_UP:
            self.over = True
            self._crew.stop()
            self._going = asyncio.create_task(self._go())

    async def teardown(self, worker: Worker) -> None:
        """Stop the tasks of this worker, and end its child processes, as the worker closes."""
        self.over = True
        self._crew.stop()
        if self._look is not asyncio.current_task():
            self._look.cancel()
        while self._at_work:
            await asyncio.sleep(0.01)
        self._crew.close()

    async def _go_when_idle(self) -> None:
        while self._at_work or time.monotonic() - self._last < IDLE_SECONDS:
            await asyncio.sleep(LOOK_SECONDS)
        await self._go()

    async def _go(self) -> None:
        if self._worker.plugins.get(self._name) is self:
            await self._worker.plugin_remove(name=self._name)


def _broken(why: str) -> dict[str, Any]:
    return {"kind": "broken", "why": why}
