"""A job of a cluster's queue: its share of a campaign's cases, or the end of it.

    python -m batch.terminal.job FOLDER share K TASKS.json     the K-th share, by processes of its own
    python -m batch.terminal.job FOLDER together               the archive, when all shares are done

Jobs need nothing of one another but the folder. Each writes down how far it is (`status.K.json`), and what it says goes
to its log. One that is cancelled, or out of time, leaves its shards; what it had not done is missing, and is submitted
again.
"""

from __future__ import annotations

import itertools
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from batch.campaigns.drive import Count, Driver, Stopped
from batch.campaigns.folder import Folder, FolderBusy, uncovered
from batch.campaigns.performing import perform
from batch.campaigns.resuming import described
from batch.campaigns.status import Reporter
from batch.campaigns.tasks import Task
from batch.executors.child import COMMAND
from batch.executors.processes import Processes
from batch.executors.termination import TERMINATED, Terminated, terminable
from batch.executors.threads import Threads
from batch.terminal.progress import Bar
from met.diagnostic import Problem
from met.host.files import is_count, read_json
from met.messages.visible import say


def share(path: Path, number: int, tasks_file: Path, command: Sequence[str] = COMMAND) -> int:
    """Run the stretches of this share that have no shard. Exit status 0 where all of it is done."""
    folder = Folder(path)
    if not folder.exists():
        say(f"met: {path} is gone: the campaign is whole, or was begun again elsewhere")
        return 0
    try:
        folder.lock(together=True)
    except FolderBusy:
        say(f"met: {path} is in the hands of another run: nothing was done here", err=True)
        return 1
    try:
        order = read_json(tasks_file)
        dealt = [[Task(*task) for task in tasks] for tasks in order["shares"]]
        timeout = order["timeout"]
        sections = folder.sections()
        for task in itertools.chain(*dealt):
            if not (
                is_count(task.section, len(sections) - 1)
                and is_count(task.first, task.last - 1)
                and is_count(task.last, len(sections[task.section].rows))
            ):
                raise ValueError(task)
        if timeout is not None and not (isinstance(timeout, int | float) and timeout > 0):
            raise ValueError(timeout)
    except (OSError, ValueError, LookupError, TypeError):
        say(f"met: {tasks_file} is gone or damaged: submit again", err=True)
        return 1
    if not 0 <= number < len(dealt):
        say(f"met: {tasks_file} has no share {number}: it was submitted again since", err=True)
        return 0
    mine = dealt[number]
    executor = Processes(1, threads=cores(), timeout=timeout, command=command)
    reporter = Reporter(folder, sum(task.cases for task in mine), Bar(), name=str(number))
    driver = Driver(folder, executor, reporter)
    executor.open(folder, sections, driver.tell)
    try:
        for section in sections.values():
            wanted = [task for task in mine if task.section == section.number]
            left = list(_left(wanted, folder.named_tasks(section.number)))
            own = sum(task.cases for task in wanted)
            driver.counts[section.number] = Count(own - sum(last - first for first, last in left))
            driver.run(section, left, own)
        reporter.state("done")
    except (Stopped, Problem) as reason:
        reporter.state("stopped")
        say(f"met: {reason}", err=True)
        return 1
    except BaseException:
        reporter.state("interrupted")
        raise
    finally:
        executor.close()
        folder.close()
    return 0


def cores() -> int:
    """The number of cores that the queue gives a job; one where it gives no number."""
    setting = os.environ.get("SLURM_CPUS_PER_TASK", "")
    return max(1, int(setting)) if setting.isdecimal() else 1


def _left(wanted: Sequence[Task], done: Sequence[Task]) -> Iterator[tuple[int, int]]:
    """Stretches of the wanted tasks without a shard, judged by names: contents are checked when all is merged."""
    for task in wanted:
        inside = [
            Task(t.section, max(t.first, task.first) - task.first, min(t.last, task.last) - task.first)
            for t in done
            if t.first < task.last and t.last > task.first
        ]
        yield from [(task.first + first, task.first + last) for first, last in uncovered(inside, task.cases)]


def merge_campaign(path: Path) -> int:
    """Merge a campaign whose cases are all done. Exit status 1 where cases failed or are missing."""
    if not Folder(path).exists():
        return _say_result(path.with_name(path.name.removesuffix(".campaign")))  # another job was first
    campaign = described(Folder(path))
    performed = perform(campaign, executor=Threads(cores()), together=True, say=say)
    if performed.warned:
        from met.messages.render import render

        say(render(performed.warned, {source.name: source.text for source in campaign.plan.sources}), err=True)
    return _say_result(campaign.output)


def _say_result(path: Path) -> int:
    """Print the results in an archive. Exit status 1 where cases failed, or do not meet requirements."""
    from batch.archive.read import ArchiveFile
    from batch.queries.summary import summarise
    from batch.terminal.verdict import short_result_lines

    with ArchiveFile(path) as file:
        summaries = summarise(file)
    say("\n".join(short_result_lines(path, summaries)))
    return 0 if all(summary.ok for summary in summaries) else 1


def main(arguments: Sequence[str]) -> int:
    """The entry point that a job's script calls."""
    path, verb, *rest = arguments
    try:
        with terminable():
            return share(Path(path), int(rest[0]), Path(rest[1])) if verb == "share" else merge_campaign(Path(path))
    except Terminated:
        say("met: terminated; what is done is kept", err=True)
        return TERMINATED
    except Problem as problem:
        from met.messages.render import render

        say(render(problem.diagnostics, problem.sources), err=True)
        return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
