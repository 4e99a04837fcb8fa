"""Tasks in this process: one at a time, its cases over several threads, while the previous shard is written."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor

from batch.campaigns import tasks
from batch.campaigns.drive import Outcome
from batch.campaigns.folder import Folder
from batch.campaigns.tasks import CampaignSection, Done, Task, cannot_keep
from met.host import system


class Threads:
    """The executor in this process, which needs no further processes."""

    workers = 1

    def __init__(self, threads: int | None = None) -> None:
        self.threads = threads or system.cores()
        self.about = f"{self.threads} thread{'s' if self.threads > 1 else ''}"
        self._computed = 0
        self._waiting: deque[Task] = deque()
        self._written: deque[tuple[Task, Done, Future[None]]] = deque()
        self._writer: ThreadPoolExecutor | None = None

    @property
    def under_way(self) -> int:
        return self._computed + sum(task.cases for task, _, _ in self._written)

    def open(self, folder: Folder, sections: Mapping[int, CampaignSection], tell: Callable[[], None]) -> None:
        self._folder, self._sections, self._tell = folder, sections, tell
        self._writer = ThreadPoolExecutor(1)

    def submit(self, task: Task) -> None:
        self._waiting.append(task)

    def wait(self) -> list[Outcome]:
        """Compute the next task, and return the outcomes of those whose shards (files of results) are written
        meanwhile."""
        if self._waiting:
            task = self._waiting.popleft()
            computed = tasks.compute(self._sections[task.section], task, threads=self.threads, progress=self._progress)
            assert self._writer is not None
            writing = self._writer.submit(tasks.keep, self._folder.shards, task, computed)
            self._written.append((task, Done(computed.seconds, computed.failed), writing))
            self._computed = 0
        # one shard may be on its way to the disk, with its histories in memory
        ended = [self._written.popleft() for _ in range(len(self._written) - bool(self._waiting))]
        return [self._outcome(*task_and_end) for task_and_end in ended]

    def close(self) -> None:
        self._waiting.clear()
        if self._writer is not None:
            self._writer.shutdown(wait=True)

    def _progress(self, done: int) -> None:
        self._computed = done
        self._tell()

    def _outcome(self, task: Task, done: Done, writing: Future[None]) -> Outcome:
        """The outcome of a task whose shard (the file of its results) is written."""
        try:
            writing.result()
        except OSError as reason:
            return Outcome(task, "broken", why=cannot_keep(self._folder.path, reason))
        return Outcome(task, "done", done)
