"""Campaigns: many cases, run into archives that xarray opens directly.

import batch
archive = batch.run("two_link.ic")                      # -> two_link.h5
data = archive.open()                                   # an xarray.Dataset, or a DataTree of several
data = batch.open("two_link.h5")                        # the same, later
sim = batch.Simulation("two_link.ic")                   # no files: values of parameters to an xarray.Dataset
data = sim.run({"gearbox.kp": [0.01, 0.02, 0.03]})
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from met.frozen import frozen

if TYPE_CHECKING:
    import xarray

    from batch.campaigns.drive import Executor, Progress
    from batch.campaigns.verification.verifying import Verify
    from batch.differences.result import Diff
    from batch.linearized import LinearAnswer
    from batch.queries.summary import Summary
    from batch.simulation.simulation import Simulation as Simulation
    from met.plan import Plan


@frozen
class Archive:
    """An archive on disk, and the results of its cases, one summary for each experiment."""

    path: Path
    summaries: tuple[Summary, ...]
    notes: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """True if every case reached its end and met every requirement."""
        return all(summary.ok for summary in self.summaries)

    def open(self) -> Any:
        """The archive's contents as xarray objects (`batch.open`)."""
        return open(self.path)


def __getattr__(name: str) -> Any:
    """Import `Simulation` when it is first used."""
    if name != "Simulation":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from batch.simulation.simulation import Simulation

    return Simulation


def run(
    plan: Plan | str | os.PathLike[str],
    *,
    set: Mapping[str, object] | Sequence[str] = (),
    vary: Mapping[str, object] | Sequence[str] = (),
    output: str | os.PathLike[str] | None = None,
    experiments: Sequence[str] | None = None,
    cases: Sequence[int | str] | None = None,
    histories: str | int | Sequence[str | int] = "default",
    float32: bool = False,
    threads: int | None = None,
    processes: int | None = None,
    dask: Any = None,
    timeout: float | None = None,
    max_failures: int | None = None,
    fresh: bool = False,
    verify: Verify = "auto",
    rows: str = "all",
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Archive:
    """Run a plan's cases into an archive; after an interrupted run, only the missing ones.

    plan          a deck's path; what `ic.compile` gives; or a plan file (`met plan DECK -o p.json`)
    set, vary     of a deck: values in place of its own, and what a sweep of the run varies, as `ic.compile` has them
    output        the archive; None: in the current folder, called as `met run` calls it: the deck's name, and those of
                  the runs and sweeps that were asked for, if the deck does not choose them itself
                  (`two_link.gains.h5`). FILE.mcap, FILE.csv or FILE.parquet:
                  FILE.h5, and an export of it: a table of a sweep has its metrics, or the histories that are asked for
    experiments   names of runs and sweeps; None: all of the plan's, of a deck as `met run` takes it
    cases         rows of the case table, `"#7"`, or the beginnings of case_ids; None: all
    histories     whose signals are kept, one word or several: "default" (all while the archive stays below 1 GiB, else
                  none), "all", "none", "every:N", "failed", "worst:N", "worst:N:METRIC", or cases as above
    float32       keep signals as numbers of four bytes
    threads       None: as many as there are cores
    processes     run in so many processes, so that a case that kills its process is found out
    dask          run on a Dask cluster: the address of its scheduler, "local", or a `distributed.Client`
    timeout       s without any progress after which a case is given up; in processes
    max_failures  stop when more cases have failed
    fresh         start over, rather than run what is missing
    verify        which cases are run again with shorter steps, so that metrics have errors: "none", "some", "all", or
                  "auto": some where that is cheap
    rows          cases that have a row in the archive: "all"; or a "summary", with the few that it names; or
                  "worst:N:METRIC", the worst besides
    executor      who runs it, in place of threads, processes and dask (batch/executors)

    Raises met.diagnostic.Problem for mistakes that a user can correct.
    """
    from batch.campaigns.campaign import prepare
    from batch.campaigns.performing import perform
    from batch.executors.choose import choose
    from batch.export import from_run

    archive, target = from_run.archive_and_export(output)
    made_plan = _plan(plan, experiments, set, vary)
    chosen = executor or choose(threads=threads, processes=processes, dask=dask, timeout=timeout)
    campaign = prepare(
        made_plan,
        output=archive,
        experiments=experiments,
        cases=cases,
        histories=histories,
        float32=float32,
        verify=verify,
        rows=rows,
    )
    if target is not None:
        from_run.check(campaign, target, histories=histories != "default")
    performed = perform(campaign, executor=chosen, fresh=fresh, max_failures=max_failures, progress=progress)
    if target is not None:
        from_run.export_run(campaign, target, histories=histories != "default")
    return look(campaign.output, (*campaign.notes, *performed.notes))


def diff(
    a: str | os.PathLike[str],
    b: str | os.PathLike[str],
    *,
    tolerances: str | Sequence[str] = (),
    distributions: bool = False,
) -> Diff:
    """Compare two archives: `verdict` of the result is identical, equivalent, different or incomparable.

    tolerances     as `met diff --tol` has them: "qd=1e-6rad/s,rel=1e-9,time=1ms"; nothing may differ unless it is given
    distributions  compare metrics as distributions too, as is done where seeds differ

    Raises met.diagnostic.Problem.
    """
    from batch.differences.campaigns import diff as compared
    from batch.differences.tolerance import tolerances as read

    texts = [tolerances] if isinstance(tolerances, str) else tolerances
    return compared(Path(a), Path(b), read(texts), distributions=distributions)


def linear(
    plan: Plan | str | os.PathLike[str],
    experiment: str | None = None,
    *,
    case: int | str = 0,
    of: str | None = None,
    at: float | None = None,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    opened: Sequence[str] = (),
) -> LinearAnswer:
    """Linearise the program of a plan's run exactly, at an instant of a case: docs/linear.md.

    experiment  name of a run or sweep; None: the plan's first
    case        row of the case table, `"#7"`, or the beginning of a case_id
    of          what the run's `linear` block of this name asks, in place of what follows; where nothing is asked at
                all, what its only block does
    at          s, 0 unless given; the answers are of the last begin of a period up to it
    inputs      columns of B: commands of servos that tick, outputs of their laws
    outputs     rows of C: whatever can be recorded
    opened      outputs of laws, at which loops are opened: each alone, and all at once

    Raises Problem D370 where an event is on the way, D371 where the run has failed before, D372, D373 and D376 for
    an instant or a name that is not there; ValueError where `of` and more are given.
    """
    from batch.campaigns.choosing import experiments_named, select_rows
    from batch.linearized import LinearAnswer
    from met.analysis.linear.answers import question_of

    chosen = experiments_named(_plan(plan, None), None if experiment is None else (experiment,))[:1]
    ((chosen_experiment, rows),) = select_rows(chosen, [case])
    question = question_of(chosen_experiment, of, at=at, inputs=inputs, outputs=outputs, opened=opened)
    return LinearAnswer(question.of(int(rows[0])))


def gradient(
    plan: Plan | str | os.PathLike[str],
    experiment: str | None = None,
    *,
    cases: Sequence[int | str] | None = None,
    metrics: Sequence[str] = (),
) -> xarray.Dataset:
    """Slopes of metrics of a sweep's cases by the numbers that it varies: exact, of the program that runs.

    experiment  name of a sweep; None: the plan's first
    cases       rows of the case table, `"#7"`, beginnings of case_ids; None: all
    metrics     names; none: all

    The Dataset has `value` (case, metric) and `slope` (case, metric, number) in SI, and `why_not`: where there is no
    slope, the reason. `Simulation.gradient` takes any number of a deck; docs/linear.md has more of both.

    Raises Problem D379 where no number varies, or a name is no metric's.
    """
    from batch.campaigns.choosing import experiments_named, select_rows
    from batch.linearized.data import to_dataset
    from met.analysis.linear.gradient import GradientProgram

    names = None if experiment is None else (experiment,)
    chosen_experiment = experiments_named(_plan(plan, names), names)[0]
    ((chosen_experiment, rows),) = select_rows([chosen_experiment], cases)
    return to_dataset(chosen_experiment, GradientProgram(chosen_experiment).of(rows[:], metrics))


def _plan(
    source: object,
    experiments: Sequence[str] | None,
    set: Mapping[str, object] | Sequence[str] = (),
    vary: Mapping[str, object] | Sequence[str] = (),
) -> Plan:
    """The plan: the given one, one from a plan file, or one from a deck, with its runs and sweeps of these names.
    Raises TypeError for other arguments, and for values that are set or varied in a plan."""
    from met.plan import Plan

    if not isinstance(source, Plan | str | os.PathLike):
        raise TypeError(f"batch.run takes a deck's path or a plan, and not {type(source).__name__}")
    if not isinstance(source, Plan) and Path(source).suffix != ".json":
        import ic

        return ic.compile(source, set=set, vary=vary, select=experiments)
    if set or vary:
        raise TypeError("`set` and `vary` are of decks: the values of a plan are settled")
    if isinstance(source, Plan):
        return source
    from met.plan import file as plan_file

    return plan_file.read(source)


def look(path: str | os.PathLike[str], notes: Sequence[str] = ()) -> Archive:
    """An existing archive, with its summaries."""
    from batch.archive.read import ArchiveFile
    from batch.queries.summary import summarise

    with ArchiveFile(Path(path)) as file:
        return Archive(Path(path), summarise(file), tuple(notes))


def open(path: str | os.PathLike[str], *, chunks: Any = None) -> Any:
    """An archive as an xarray.Dataset, or an xarray.DataTree where it holds several experiments; read lazily.

    chunks  as xarray.open_dataset has it: `{}` for arrays of Dask, in the archive's own chunks

    Further methods are in `data.met` (batch.notebook): cases by varied parameters, positions of links, and more. From
    an archive of `--rows summary` it has the rows that were kept, which are not a sample: it warns (UserWarning), and
    the attribute `summary_of_cases` is the number of cases of the summary.
    """
    from batch.archive.read import ArchiveFile, reading

    with ArchiveFile(Path(path)) as file:
        several = len(file.groups) > 1
        summed = {group.name: group.summary.cases for group in file.groups if group.summary is not None}
        row_counts = {group.name: group.count for group in file.groups}
    import xarray

    import batch.notebook  # noqa: F401 - registers `data.met`

    opened = xarray.open_datatree if several else xarray.open_dataset
    with reading(Path(path)):
        data = opened(path, engine="h5netcdf", **({} if chunks is None else {"chunks": chunks}))
    for name, cases in summed.items():
        (data[name] if several else data).attrs["summary_of_cases"] = cases
        message = (
            f"{path} keeps a summary of {cases:,} cases of `{name}`, and the rows of {row_counts[name]:,} that it names"
        )
        warnings.warn(f"{message}: these are no sample of them; `data.met.evidence()` judges all", stacklevel=2)
    return data
