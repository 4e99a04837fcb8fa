"""A worker that some cases kill or stop: `python -m tests.batch.poisoned POISON FOLDER --threads N`.

POISON is JSON: by the row of a case the name of the signal that it dies of before it computes a task with that case,
or "sleep", which never ends. `section` confines it to one section of the campaign; `fsync` is how many seconds it takes
until what is written is on the disk; `full` is how many files a worker writes until its disk is full.
"""

from __future__ import annotations

import errno
import json
import os
import resource
import signal
import sys
import time
from pathlib import Path
from typing import Any

from batch.campaigns import tasks
from batch.campaigns.tasks import CampaignSection, Done, Task
from batch.executors import worker


def command(**poison: Any) -> tuple[str, ...]:
    """What to start in place of a worker. poison: as above, with rows as `row_17`."""
    given = {name.removeprefix("row_"): what for name, what in poison.items()}
    return (sys.executable, "-m", "tests.batch.poisoned", json.dumps(given))


def poison(given: dict[str, Any]) -> None:
    """From here on tasks are carried out so."""
    carry_out, fsync = tasks.carry_out, os.fsync
    only = given.pop("section", None)
    seconds, room = given.pop("fsync", 0.0), given.pop("full", None)
    written = 0
    words = {int(row): word for row, word in given.items()}

    def poisoned(section: CampaignSection, task: Task, folder: Path, **options: Any) -> Done:
        if only is None or section.number == only:
            for row in section.rows[task.first : task.last].tolist():
                if words.get(row) == "sleep":
                    time.sleep(3600.0)
                elif row in words:
                    os.kill(os.getpid(), signal.Signals[words[row]])
                    time.sleep(60.0)  # until it comes
        return carry_out(section, task, folder, **options)

    def settle(file: int) -> None:
        nonlocal written
        written += 1
        if room is not None and written > room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        time.sleep(seconds)
        fsync(file)

    tasks.carry_out = poisoned
    os.fsync = settle


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    poison(json.loads(sys.argv[1]))
    worker.main(sys.argv[2:])
