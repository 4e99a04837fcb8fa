"""The executor of a campaign: it is opened on its folder, given tasks, and asked for their outcomes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal, Protocol

from batch.campaigns.folder import Folder
from batch.campaigns.tasks import CampaignSection, Done, Task
from met.frozen import frozen


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
    """Carries out tasks, `workers` of them at a time."""

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
