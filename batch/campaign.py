"""A campaign: which cases of a plan are run, what is kept of them, and the running itself.

`prepare` settles everything that can be refused (names, cases, room on the disk, the output) and writes nothing;
`perform` runs the cases batch by batch, in bounded memory, into an archive that has its name only when it is whole.
"""

from __future__ import annotations

import difflib
import json
import os
import shlex
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np

from batch.archive import layout as archive_layout
from batch.archive.sink import Busy, Sink, temporary_of
from batch.rows import row_of
from ic.printing.columns import size as size_text
from met import keys
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.plan import Experiment, Plan

Histories = Literal["default", "all", "none"]

KEPT_BYTES = 1 << 30
"""Histories are kept by default while the archive stays below this."""

BATCH_BYTES = 128 << 20
"""Histories held in memory at a time."""

BATCH_CASES = 1 << 16
"""Cases a batch where no histories are kept."""


class Progress(Protocol):
    """Who is told how far a campaign is (batch/progress.py)."""

    def begin(self, name: str, cases: int) -> None: ...
    def advance(self, done: int) -> None: ...
    def end(self) -> None: ...


@frozen
class Part:
    """The cases of one experiment that are run: rows of its case table, and whether their histories are kept."""

    experiment: Experiment
    rows: np.ndarray
    recorded: bool

    @property
    def bytes(self) -> int:
        described = archive_layout.PARAMETER_TEXT * len(self.experiment.parameters)
        return archive_layout.layout(self.experiment, len(self.rows), self.recorded).bytes + described

    @property
    def batch(self) -> int:
        """Cases a batch: whole blocks of the kernel where there are many."""
        if not self.recorded:
            return BATCH_CASES
        cases = max(1, min(BATCH_CASES, BATCH_BYTES // self.experiment.structure.history_bytes))
        return cases if cases < 64 else cases // 32 * 32


@frozen
class Campaign:
    """What will be run, all of it checked."""

    plan: Plan
    parts: tuple[Part, ...]
    output: Path
    notes: tuple[str, ...] = ()

    @property
    def cases(self) -> int:
        return sum(len(part.rows) for part in self.parts)

    @property
    def bytes(self) -> int:
        return sum(part.bytes for part in self.parts)


def prepare(
    plan: Plan,
    *,
    output: str | os.PathLike[str] | None = None,
    experiments: Sequence[str] | None = None,
    cases: Sequence[int | str] | None = None,
    histories: Histories = "default",
) -> Campaign:
    """Settle what will be run; raises Problem for anything that would stop it later, and writes nothing.

    output       None: `default_output`, in the current folder
    experiments  names; None: all of the plan's
    cases        positions in the case table, `7` or `"#7"`, or the beginning of a case_id; None: all
    histories    "default": all while the archive stays below 1 GiB, else none, and a note says so
    """
    chosen = experiments_named(plan, experiments)
    selected = _selected(chosen, cases)
    target = Path(output) if output is not None else default_output(plan, experiments, selected)
    kept = {"default": True, "all": True, "none": False}[histories]
    parts = tuple(Part(e, rows, kept and e.structure.history_bytes > 0) for e, rows in selected)
    notes: list[str] = []
    whole = sum(part.bytes for part in parts)
    if histories == "default" and whole > KEPT_BYTES:
        parts = tuple(Part(part.experiment, part.rows, False) for part in parts)
        notes.append(
            f"histories would take {size_text(whole)}, over {size_text(KEPT_BYTES)}: metrics only are kept "
            f"(`--histories all` keeps them; any case can be run again alone: `--case '#0'`)"
        )
    kept_plan = Plan(plan.deck, tuple(part.experiment for part in parts), plan.sources, plan.defines)
    campaign = Campaign(kept_plan, parts, target, tuple(notes))
    check_output(campaign)
    return campaign


def default_output(
    plan: Plan, experiments: Sequence[str] | None = None, selected: Sequence[tuple[Experiment, np.ndarray]] = ()
) -> Path:
    """`two_link.h5`; `two_link.gains.h5` where runs are named; `two_link.gains.case7.h5` for some of the cases.

    They are named here, or were when the plan was made (`two_link.all.h5` where all were asked for).
    So a case that is run again does not take its sweep's place. A deck of the standard library is called `<name>`.
    """
    names = [Path(plan.deck.strip("<>")).stem, *(experiments or plan.selected)]
    chosen = [int(position) for experiment, rows in selected for position in experiment.cases.table[rows]]
    if len(chosen) < sum(experiment.cases.count for experiment, _ in selected):
        names.append("case" + "-".join(map(str, chosen)) if len(chosen) <= 4 else "cases")
    return Path(".".join([*names, "h5"]))


def perform(
    campaign: Campaign, *, threads: int | None = None, progress: Progress | None = None,
    ready: Callable[[], None] | None = None,
) -> list[dict[str, Any]]:  # fmt: skip
    """Run a campaign into its archive. What is unlike from one making to the next (times) is returned, and
    written beside the archive as `<archive>.run.json`. However this ends, no half file is left.

    ready  called once the first kernel is there, so that something will be written
    """
    from batch.archive.provenance import machine
    from batch.archive.write import Writer

    began = time.time()
    temporary = temporary_of(campaign.output)
    try:
        writer = Writer(temporary, campaign.plan, [(p.experiment, p.rows, p.recorded) for p in campaign.parts])
        try:
            timings = [_run_part(writer, index, part, threads, progress, ready if index == 0 else None)
                       for index, part in enumerate(campaign.parts)]
            writer.finish()
            sidecar = {
                "archive": campaign.output.name,
                "began": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(began)),
                "seconds": round(time.time() - began, 6),
                "threads": threads,
                "experiments": timings,
                **machine(),
            }
            publish(campaign.output, temporary, sidecar)
            writer.close()
        except BaseException:
            writer.abandon()
            raise
    except Busy:
        raise Problem(_busy(campaign.output)) from None
    except OSError as reason:
        raise Problem(_cannot_write(campaign.output, reason)) from reason
    return timings


def _run_part(
    writer: Any, index: int, part: Part, threads: int | None, progress: Progress | None,
    ready: Callable[[], None] | None,
) -> dict[str, Any]:  # fmt: skip
    """Run one experiment; its wall time."""
    from met import run as engine

    began = time.perf_counter()
    if progress is not None:
        progress.begin(part.experiment.name, len(part.rows))
    prepared = engine.prepare(part.experiment)
    if ready is not None:
        ready()
    for first, rows in _batches(part):
        report = None if progress is None else _from(progress, first)
        writer.put(index, first, engine.run(prepared, rows, threads=threads, record=part.recorded, progress=report))
        if progress is not None:
            progress.advance(first + len(rows))
    if progress is not None:
        progress.end()
    return {
        "experiment": part.experiment.name,
        "cases": len(part.rows),
        "seconds": round(time.perf_counter() - began, 6),
    }


def _from(progress: Progress, first: int) -> Any:
    return lambda done: progress.advance(first + done)


def _batches(part: Part) -> Iterator[tuple[int, np.ndarray]]:
    for first in range(0, len(part.rows), part.batch):
        yield first, part.rows[first : first + part.batch]


def publish(output: Path, temporary: Path, sidecar: dict[str, Any]) -> None:
    """Give a finished archive its name, and its sidecar."""
    beside = sidecar_path(output)
    beside_temporary = temporary_of(beside)
    try:
        beside_temporary.write_text(json.dumps(sidecar, indent=1) + "\n", encoding="utf-8")
        temporary.replace(output)
        beside_temporary.replace(beside)
    finally:
        beside_temporary.unlink(missing_ok=True)
    folder = os.open(output.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def sidecar_path(output: Path) -> Path:
    return output.with_name(output.name + ".run.json")


# What can be refused


def experiments_named(plan: Plan, names: Sequence[str] | None) -> tuple[Experiment, ...]:
    """The plan's experiments of these names; all of them for None. Raises Problem E310."""
    if names is None:
        return plan.experiments
    by_name: dict[str, list[Experiment]] = {}
    for experiment in plan.experiments:
        for name in {experiment.name, experiment.asked}:
            by_name.setdefault(name, []).append(experiment)
    problems = []
    for name in names:
        if name not in by_name:
            near = difflib.get_close_matches(name, by_name, n=1)
            helps = [f"did you mean `{near[0]}`?"] if near else []
            helps.append(f"runs and sweeps of {plan.deck}: {', '.join(by_name)}")
            problems.append(error("E310", f"no run or sweep `{name}` in {plan.deck}", help=helps))
    if problems:
        raise Problem(problems)
    found = {experiment.name: experiment for name in names for experiment in by_name[name]}
    return tuple(found.values())


def _selected(
    experiments: tuple[Experiment, ...], cases: Sequence[int | str] | None
) -> list[tuple[Experiment, np.ndarray]]:
    """The rows of each experiment; one that a case_id leaves without any is not run."""
    if cases is None:
        return [(experiment, np.arange(experiment.cases.count)) for experiment in experiments]
    found: dict[str, set[int]] = {experiment.name: set() for experiment in experiments}
    for case in cases:
        matches = [(e, row) for e in experiments for row in _rows(e, case)]
        if not matches:
            last: dict[str, int] = {}
            for e in experiments:
                last[e.asked] = max(last.get(e.asked, 0), int(e.cases.table[-1]))
            counts = ", ".join(f"`{name}` has #0 {f'to #{row}' if row else 'alone'}" for name, row in last.items())
            raise Problem(error("E311", f"no case `{_case_text(case)}`", help=[counts, "`met cases DECK` lists them"]))
        if len(matches) > 1 and not _is_row(case):
            some = ", ".join(f"#{e.cases.table[row]} of `{e.asked}`" for e, row in matches[:4])
            message = f"case `{case}` may be any of {len(matches)}: {some}"
            position, alike = matches[0][0].cases.table[matches[0][1]], len({_id_of(*match) for match in matches}) == 1
            remedy = "" if alike else "give more of its id, or "  # cases that differ in structure alone share their ids
            raise Problem(error("E312", message, help=f"{remedy or 'give '}its position: `--case '#{position}'`"))
        for experiment, row in matches:
            found[experiment.name].add(row)
    return [(e, np.array(sorted(found[e.name]), dtype=np.int64)) for e in experiments if found[e.name]]


def _id_of(experiment: Experiment, row: int) -> str:
    return keys.case_ids(experiment, [row])[0]


def _is_row(case: int | str) -> bool:
    return not isinstance(case, str) or row_of(case) is not None


def _case_text(case: int | str) -> str:
    return case if isinstance(case, str) else f"#{case}"


def _rows(experiment: Experiment, case: int | str) -> list[int]:
    if _is_row(case):
        position = row_of(case) if isinstance(case, str) else int(case)
        return np.flatnonzero(experiment.cases.table == position).tolist()
    return [row for row, case_id in enumerate(keys.case_ids(experiment)) if case and case_id.startswith(str(case))]


def check_output(campaign: Campaign) -> None:
    """Refuse an output that could not be written in the end, before anything runs."""
    try:
        _check_output(campaign)
    except Busy:
        raise Problem(_busy(campaign.output)) from None
    except OSError as reason:
        raise Problem(_cannot_write(campaign.output, reason)) from reason


def _check_output(campaign: Campaign) -> None:
    from batch.archive.read import is_archive

    output = campaign.output
    for target in (output, sidecar_path(output)) if output.name else (output,):  # the name of . and / is empty
        if target.is_dir():
            inside = quoted(target / default_output(campaign.plan))
            helps = f"name a file in it: `-o {inside}`" if target == output else ()
            raise Problem(error("E305", f"cannot write {target}: it is a folder", help=helps))
    if not output.parent.is_dir():
        what = "is a file, not a folder" if output.parent.exists() else "does not exist"
        helps = () if output.parent.exists() else f"make it first: `mkdir -p {quoted(output.parent)}`"
        raise Problem(error("E305", f"cannot write {output}: {output.parent} {what}", help=helps))
    if output.exists() and not output.is_file():
        raise Problem(error("E305", f"cannot write {output}: it is not a regular file"))
    if output.exists() and output.stat().st_size > 0 and not is_archive(output):
        helps = "give another name with `-o`, or remove the file"
        raise Problem(error("E305", f"{output} exists and is no archive of MET: it is not written over", help=helps))
    probe = Sink(temporary_of(output))
    probe.remove()
    probe.close()
    free = shutil.disk_usage(output.parent).free
    if campaign.bytes > free:
        needs, has = size_text(campaign.bytes), size_text(free)
        message = f"cannot write {output}: it needs about {needs}, and the disk has {has} left"
        helps = (
            "`--histories none` keeps metrics only; fewer signals in `record`, or a slower `rates.record`, take less"
        )
        raise Problem(error("E306", message, help=helps))


def _cannot_write(output: Path, reason: OSError) -> Any:
    why = (os.strerror(reason.errno) if reason.errno else str(reason)).lower()
    return error("E305", f"cannot write {output}: {why}", help="nothing was kept; `-o FILE` names another place")


def _busy(output: Path) -> Any:
    helps = "wait until it is done, or give another name with `-o`"
    return error("E307", f"cannot write {output}: another run is writing it now", help=helps)


def quoted(path: Any) -> str:
    """A path as a word of a command line: for a shell, and not to be taken for an option."""
    text = str(path)
    return shlex.quote(f"./{text}" if text.startswith("-") else text)
