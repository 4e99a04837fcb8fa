"""An executor as a campaign sees it: opened on its folder, given tasks, and asked what has come of them."""

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
        """Tasks that it runs at a time; more that are submitted wait. May change."""

    @property
    def under_way(self) -> int:
        """Cases that are done of tasks that are not."""

    def open(self, folder: Folder, sections: Mapping[int, CampaignSection], tell: Callable[[], None]) -> None:
        """Begin. tell: to be called now and then while `wait` waits. `sections` may grow."""

    def submit(self, task: Task) -> None:
        """Have a task run, after those submitted before."""

    def wait(self) -> list[Outcome]:
        """The outcomes since the last call; waits for one at least, unless none is submitted."""

    def close(self) -> None:
        """Stop at once. Tasks that are not done are forgotten."""
