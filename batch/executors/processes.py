"""Tasks in processes of their own on this machine: one that dies or hangs affects only its task."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

from batch.campaigns.drive import Outcome
from batch.campaigns.folder import Folder
from batch.campaigns.tasks import CampaignSection, Task
from batch.executors.child import COMMAND, Crew
from met.host import system

TELL_SECONDS = 0.1


class Processes:
    """An executor with as many processes as asked for, each with its share of the cores."""

    def __init__(
        self,
        processes: int | None = None,
        *,
        threads: int | None = None,
        timeout: float | None = None,
        command: Sequence[str] = COMMAND,
    ) -> None:
        cores = system.cores()
        self.workers = processes or cores
        self.about = f"{self.workers} process{'es' if self.workers > 1 else ''}"
        self._threads = threads or max(1, cores // self.workers)
        self._timeout, self._command = timeout, command
        self._running: set[Future[Outcome]] = set()
        self._crew: Crew | None = None

    @property
    def under_way(self) -> int:
        return self._crew.under_way if self._crew else 0

    def open(self, folder: Folder, sections: Mapping[int, CampaignSection], tell: Callable[[], None]) -> None:
        self._tell = tell
        self._crew = Crew(folder.path, threads=self._threads, timeout=self._timeout, command=self._command)
        self._pool = ThreadPoolExecutor(self.workers)

    def submit(self, task: Task) -> None:
        assert self._crew is not None
        self._running.add(self._pool.submit(self._crew.carry_out, task))

    def wait(self) -> list[Outcome]:
        """The outcomes of the next tasks that end; none where none runs."""
        while self._running:
            ended, self._running = wait(self._running, timeout=TELL_SECONDS, return_when=FIRST_COMPLETED)
            self._tell()
            if ended:
                return [future.result() for future in ended]
        return []

    def close(self) -> None:
        if self._crew is not None:
            self._crew.stop()
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._crew.close()
