"""Running a campaign's cases: missing ones are cut into tasks, and lost tasks are tried again in parts.

A case that kills its worker, or never ends, is found by division: a lost task is cut into pieces, each is tried again,
and in the end only one case is lost, `TRIES` times. Its status says so, and all others are done.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Literal, Protocol

from batch.campaigns import tasks
from batch.campaigns.folder import Folder, uncovered
from batch.campaigns.tasks import GRANULE, CampaignSection, Done, Task
from met.frozen import frozen
from met.run import LOST, TIMED_OUT


@frozen
class Outcome:
    """The result of a task.

    done      its shard is there
    lost      what ran it died;  stalled: it made no progress for too long; the task may be tried again, or in parts
    broken    nothing of the kind can be run: a full disk, a folder that a worker does not see
    why       of the last three, in words
    """

    task: Task
    kind: Literal["done", "lost", "stalled", "broken"]
    done: Done | None = None
    why: str = ""


class Executor(Protocol):
    """Carries out a campaign's tasks, `workers` of them at a time: it is opened on the campaign's folder, given tasks,
    and asked for their outcomes."""

    @property
    def about(self) -> str:
        """A description for people: `2 threads`."""

    @property
    def workers(self) -> int:
        """Number of tasks that it runs at a time; more that are submitted wait. It may change."""

    @property
    def under_way(self) -> int:
        """Number of finished cases of unfinished tasks."""

    def open(self, folder: Folder, sections: Mapping[int, CampaignSection], tell: Callable[[], None]) -> None:
        """Begin. tell: called now and then while `wait` waits. `sections` may grow"""

    def submit(self, task: Task) -> None:
        """Submit a task, to run after those submitted before."""

    def wait(self) -> list[Outcome]:
        """The outcomes since the last call; waits for at least one, unless none is submitted."""

    def close(self) -> None:
        """Stop at once. Tasks that are not done are forgotten."""


WORK_SECONDS = 1.5
"""Intended duration of a task on its worker, s, where workers are few."""

TASKS_A_SECOND = 100.0
"""Largest number of tasks that end in a second on all workers together: a scheduler handles several hundred, and has
other work."""

FIRST_SECONDS = 0.2
"""Intended duration of the first tasks, s, by a guess that may be off by a factor of ten."""

GUESS_NS = 40.0
"""Time of one joint's step, ns, assumed before any measurement."""


class Cutter:
    """Estimates the duration of a case from finished tasks."""

    def __init__(self, section: CampaignSection) -> None:
        structure = section.prepared.experiment.structure
        steps = structure.schedule.ticks // min([structure.schedule.dynamics, *(s.divisor for s in structure.servos)])
        self._most = section.most
        self._guess = 1e-9 * GUESS_NS * steps * max(1, len(structure.joints))
        self._seconds, self._cases = 0.0, 0.0

    def learn(self, cases: int, seconds: float) -> None:
        """Note the time that a worker took for these cases."""
        if cases >= GRANULE:  # fewer take as long as a whole block
            self._seconds, self._cases = 0.5 * self._seconds + seconds, 0.5 * self._cases + cases

    def size(self, left: int, workers: int) -> int:
        """The number of cases of the next task, for so many cases left and so many workers."""
        if self._cases:
            wanted = max(WORK_SECONDS, workers / TASKS_A_SECOND) * self._cases / max(self._seconds, 1e-9)
        else:
            wanted = FIRST_SECONDS / self._guess
        wanted = min(wanted, -(-left // (2 * workers)) if workers > 1 else left)
        cases = max(GRANULE, int(wanted) // GRANULE * GRANULE)
        return min(cases, self._most, left)


TRIES = 3
"""Total number of tries of a case whose worker dies: a machine may fail for other reasons."""

PIECES = 16
"""The number of pieces that a lost task is cut into."""

AHEAD = 1
"""Number of tasks that wait for a worker."""


class Progress(Protocol):
    """The display of a campaign's progress (batch/terminal/progress.py)."""

    def begin(self, name: str, cases: int, done: int, failed: int, workers: str) -> None:
        """Begin with a run or sweep. cases: 0 where their number is not known."""

    def advance(self, done: int, failed: int, more: str = "") -> None:
        """Show how many cases are done, and how many failed. more: further text."""

    def end(self) -> None:
        """End the display of this run or sweep."""


class Stopped(Exception):
    """Raised where a campaign cannot go on; the message says why. Finished cases are kept."""


class TooManyFailures(Stopped):
    """Raised where more cases failed than were allowed."""


@dataclass
class Count:
    """The number of finished cases of a section, and of failed ones; seconds: their computing time."""

    done: int = 0
    failed: int = 0
    seconds: float = 0.0


@dataclass
class Driver:
    """Drives the sections of a campaign, one after the other. Whoever made the executor closes it.

    counts    what is done, by section
    messages  what is to be told of shards that did not count
    more      what else is told of how far it is
    sections  of the first pass, whose failures count: those after them run the same cases again
    """

    folder: Folder
    executor: Executor
    progress: Progress
    max_failures: int | None = None
    sections: int | None = None
    counts: dict[int, Count] = field(default_factory=dict)
    messages: list[str] = field(default_factory=list)
    more: str = ""
    _section_number: int | None = None

    def find(self, section: CampaignSection) -> list[tuple[int, int]]:
        """Count the finished cases of a section; returns the missing stretches."""
        sound, messages = self.folder.sound_tasks(section)
        self.messages += messages
        missing = uncovered(sound, len(section.rows))
        count = self.counts[section.number] = Count(len(section.rows) - sum(last - first for first, last in missing))
        for done in sound.values():
            count.failed += done.failed
            count.seconds += done.seconds
        return missing

    def run(self, section: CampaignSection, missing: Sequence[tuple[int, int]], cases: int | None = None) -> None:
        """Run the missing cases. cases: the total for the progress display; None: the section's. Raises Stopped."""
        self.check()
        if missing:
            with self.telling(section, cases or len(section.rows)):
                self.work(section, missing)

    @contextmanager
    def telling(self, section: CampaignSection, cases: int) -> Iterator[None]:
        """Show the progress of a section with this number of cases during its work; 0 where their number is not
        known."""
        count = self.counts[section.number]
        self.progress.begin(section.name, cases, count.done, count.failed, self.executor.about)
        self._section_number = section.number
        yield
        self._section_number, self.more = None, ""
        self.progress.end()

    def work(self, section: CampaignSection, missing: Sequence[tuple[int, int]], *, checked: bool = True) -> None:
        """Run cases of a section whose progress is shown. Raises Stopped.

        checked  whether it stops in the midst of them where too many fail
        """
        _SectionWork(self, section, missing, checked).run()

    def tell(self) -> None:
        """Report the progress of the running section."""
        if self._section_number is not None:
            count = self.counts[self._section_number]
            self.progress.advance(count.done + self.executor.under_way, count.failed, self.more)

    def check(self) -> None:
        """Stop where too many cases have failed. Raises TooManyFailures."""
        failed = sum(
            count.failed for number, count in self.counts.items() if self.sections is None or number < self.sections
        )
        if self.max_failures is not None and failed > self.max_failures:
            cases = f"{failed:,} case{'s' if failed != 1 else ''} failed"
            raise TooManyFailures(f"{cases}, more than the {self.max_failures:,} allowed")


class _SectionWork:
    """One section under way."""

    def __init__(
        self, driver: Driver, section: CampaignSection, missing: Sequence[tuple[int, int]], checked: bool
    ) -> None:
        self._driver, self._section, self._checked = driver, section, checked
        self._gaps = deque(missing)
        self._again: deque[Task] = deque()
        self._tries: dict[Task, int] = {}
        self._cutter = Cutter(section)
        self._open = 0

    def run(self) -> None:
        """Run all missing cases of the section, with as many tasks open as there are workers and one more."""
        executor, driver = self._driver.executor, self._driver
        while True:
            while self._open < executor.workers + AHEAD and (task := self._next()) is not None:
                executor.submit(task)
                self._open += 1
            if not self._open:
                return
            for outcome in executor.wait():
                self._open -= 1
                self._take(outcome)
            driver.tell()
            if self._checked:
                driver.check()

    def _next(self) -> Task | None:
        """The next task: one to be tried again, or a stretch of missing cases of a suitable size. None where none is
        left."""
        if self._again:
            return self._again.popleft()
        if not self._gaps:
            return None
        first, last = self._gaps.popleft()
        left = last - first + sum(b - a for a, b in self._gaps)
        cut = first + min(last - first, self._cutter.size(left, self._driver.executor.workers))
        if cut < last:
            self._gaps.appendleft((cut, last))
        return Task(self._section.number, first, cut)

    def _take(self, outcome: Outcome) -> None:
        """Count the outcome of a task. A task that was lost or timed out is cut into pieces, and a single case is tried
        again or given up as failed. Raises Stopped where the campaign cannot go on."""
        task, count = outcome.task, self._driver.counts[self._section.number]
        if outcome.kind == "broken":
            raise Stopped(outcome.why)
        if outcome.done is not None:
            self._cutter.learn(task.cases, outcome.done.seconds)
            count.done += task.cases
            count.failed += outcome.done.failed
            count.seconds += outcome.done.seconds
            return
        if task.cases > 1:
            step = -(-task.cases // PIECES)
            for first in range(task.first, task.last, step):
                self._again.append(Task(task.section, first, min(first + step, task.last)))
            return
        tries = self._tries[task] = self._tries.get(task, 0) + 1
        if outcome.kind == "lost" and tries < TRIES:
            self._again.append(task)
            return
        status, why = (
            (LOST, f"its worker {outcome.why}, {tries} times")
            if outcome.kind == "lost"
            else (TIMED_OUT, f"timed out: {outcome.why}")
        )
        tasks.keep(self._driver.folder.shards, task, tasks.not_run(self._section, task, status, why))
        count.done += 1
        count.failed += 1
