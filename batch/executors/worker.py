"""A worker process: `python -m batch.executors.worker FOLDER --threads N` runs its parent's tasks.

The parent's side is batch/executors/child.py.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

from batch.campaigns import tasks
from batch.campaigns.folder import Folder
from batch.campaigns.tasks import CampaignSection, Task, cannot_keep
from batch.executors.child import NO_MEMORY
from met.diagnostic import Problem

TELL_SECONDS = 0.2


class Parent:
    """The other end of the two pipes."""

    def __init__(self) -> None:
        self._out = os.dup(sys.stdout.fileno())
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # a model's output is not a message
        self.tasks: queue.SimpleQueue[Task] = queue.SimpleQueue()
        threading.Thread(target=self._listen, daemon=True).start()

    def tell(self, **message: Any) -> None:
        """Send the parent a message, a line of JSON; ends the process where nobody listens."""
        data = json.dumps(message).encode() + b"\n"
        try:
            while data:
                data = data[os.write(self._out, data) :]
        except OSError:  # nobody listens any more
            os._exit(0)

    def _listen(self) -> None:
        """Watch the parent: one that is gone, killed or not, has closed its end of the pipe, and the worker ends."""
        for line in sys.stdin:
            self.tasks.put(Task(*json.loads(line)["task"]))
        os._exit(0)


def main(arguments: list[str]) -> None:
    """Run tasks until the parent is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to all processes; the parent decides
    folder, threads = Folder(Path(arguments[0])), int(arguments[2])
    parent = Parent()
    sections: dict[int, CampaignSection] = {}
    while True:
        task = parent.tasks.get()
        try:
            if task.section not in sections:
                sections = folder.sections()
            section = sections[task.section]
            if task.last > len(section.rows):
                section = sections[task.section] = folder.with_new_cases(section)
            section.prepared.kernel  # noqa: B018 - compiled here, so that a case's time does not begin before
            parent.tell(begun=[])
            done = tasks.carry_out(
                section,
                task,
                folder.shards,
                threads=threads,
                progress=_slowly(parent),
                computed=lambda: parent.tell(computed=[]),  # a slow disk does not count as a case without an end
            )
            parent.tell(done=[done.seconds, done.failed])
        except MemoryError:
            os._exit(NO_MEMORY)
        except Problem as problem:
            parent.tell(broken="; ".join(diagnostic.message for diagnostic in problem.diagnostics))
        except OSError as reason:
            parent.tell(broken=cannot_keep(folder.path, reason))


def _slowly(parent: Parent) -> Any:
    """A function that tells the parent the number of cases done, at most every `TELL_SECONDS`."""
    last = 0.0

    def tell(done: int) -> None:
        """Tell the parent how many cases are done, unless it was told just now."""
        nonlocal last
        now = time.monotonic()
        if now - last > TELL_SECONDS:
            last = now
            parent.tell(progress=done)

    return tell


if __name__ == "__main__":
    main(sys.argv[1:])
