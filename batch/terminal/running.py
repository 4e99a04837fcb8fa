"""`met run` from end to end: read the input, announce the run, run it, and print results and places."""

from __future__ import annotations

import dataclasses
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from batch.archive.read import ArchiveFile
from batch.campaigns.campaign import Campaign, prepare
from batch.campaigns.choosing import read_plan
from batch.campaigns.drive import Executor, Progress
from batch.campaigns.performing import Performed, TooMany, perform
from batch.campaigns.rehearsal import rehearse
from batch.campaigns.replaying import Replay, differences, in_both, replay
from batch.campaigns.verification.verifying import Verify
from batch.executors.choose import choose
from batch.executors.threads import Threads
from batch.export import Exported
from batch.export.from_run import archive_and_export, check, export_command, export_run
from batch.queries.ordering import structures
from batch.queries.search_answers import search_result
from batch.queries.summary import RequirementSummary, Summary, summarise
from batch.queries.tallies import MANY
from batch.queries.warnings import campaign_warnings
from batch.terminal.progress import Bar
from batch.terminal.verdict import (
    RunResult,
    WorstCaseLines,
    announcement,
    result_lines,
    verdict_json,
    worst_cases,
    writing,
)
from met.diagnostic import Problem, error
from met.host.sources import names_archive, names_plan
from met.host.streams import OutputLost, kept
from met.messages import visible
from met.outputs import quoted


def run_and_tell(
    source: str,
    names: tuple[str, ...] = (),
    *,
    everything: bool = False,
    output: str | None = None,
    cases: tuple[str, ...] = (),
    failed: bool = False,
    histories: str | Sequence[str] = (),
    float32: bool = False,
    threads: int | None = None,
    processes: int | None = None,
    dask: str | None = None,
    timeout: float | None = None,
    max_failures: int | None = None,
    fresh: bool = False,
    verify: Verify = "auto",
    rows: str = "all",
    no_picture: bool = False,
    defines: tuple[str, ...] = (),
    include_dirs: tuple[str, ...] = (),
    settings: tuple[str, ...] = (),
    quiet: bool = False,
    verbose: bool = False,
    json: bool = False,
) -> bool:
    """Run a deck, a plan, or cases of an archive; True where every case reached its end and met its requirements."""
    say = (lambda *_: None) if quiet or json else visible.say
    if failed and not names_archive(source):
        helps = "`met run ARCHIVE.h5 --failed` runs those again that failed"
        raise Problem(error("E357", f"`--failed` is of an archive, and {source} is none", help=helps))
    how_read = {"everything": everything, "defines": defines, "include_dirs": include_dirs, "settings": settings}
    executor = choose(threads=threads, processes=processes, dask=dask, timeout=timeout)
    if not isinstance(executor, Threads):
        rehearse(timeout, source=source, names=names, **how_read)
    archive, target = archive_and_export(output)
    again = replay(source, names, cases, failed, everything) if names_archive(source) else None
    if again is not None:
        campaign = _of_archive(source, again, archive, histories, float32, verify, rows)
    else:
        campaign = _of_deck(source, names, how_read, archive, cases, histories, float32, quiet or json, verify, rows)
    if target is not None:
        check(campaign, target, histories=bool(histories))
    say("\n".join(announcement(campaign, verbose, notes=verbose or names_plan(source))))
    bar = None if quiet or json else Bar()
    performed = _performed(campaign, executor, fresh, max_failures, bar, json, say)
    if performed is None:
        return False
    with kept(f"{campaign.output} is whole: `met show {quoted(campaign.output)}` prints what came of it"):
        if performed.whole:
            say(f"nothing is missing: {campaign.output} has all of it (`--fresh` runs it again)")
        result = _result(campaign, performed, no_picture, say)
        exported, refused = _exported(campaign, target, bool(histories), json, say)
        unlike = differences(again.archive, campaign.output) if again is not None else []
        compared = _compared(again, unlike, campaign.output)
        missing = target is not None and exported is None
        ok = result.ok and not unlike and not missing
        if json:
            print(verdict_json(campaign, result, exported, performed, [*compared, *refused], ok), flush=True)
            return ok
        say("\n".join(result_lines(campaign, result, exported, performed)))
        if result.warned and not quiet:
            _complain(Problem(result.warned, {source.name: source.text for source in campaign.plan.sources}), json)
        for line in compared:
            say(line)
        if missing and target is not None:
            say(f"exit 1: {target} is missing: `{export_command(campaign, target, histories=bool(histories))}`")
        return ok


def _of_archive(
    source: str,
    again: Replay,
    output: Path | None,
    histories: str | Sequence[str],
    float32: bool,
    verify: Verify,
    rows: str,
) -> Campaign:
    """The campaign that runs cases of an archive again. Raises Problem E305 where it would be written over that one."""
    archive = output or again.output
    if os.path.realpath(archive) == os.path.realpath(source):  # Path.resolve fails for a link to itself
        helps = "`-o FILE` names another place"
        raise Problem(error("E305", f"cannot write {archive}: it is what is run again", help=helps))
    return prepare(
        again.plan,
        output=archive,
        selected=again.selected,
        histories=histories or ("all" if again.history_rows is None and rows == "all" else "none"),
        history_rows=again.history_rows if not histories else None,
        decided=again.decided,
        float32=float32,
        verify=verify,
        rows=rows,
    )


def _performed(
    campaign: Campaign,
    executor: Executor,
    fresh: bool,
    max_failures: int | None,
    progress: Progress | None,
    json: bool,
    say: Callable[[str], None],
) -> Performed | None:
    """Run a campaign's cases; None where it stopped, with a message, because more cases failed than may."""
    try:
        return perform(
            campaign,
            executor=executor,
            fresh=fresh,
            max_failures=max_failures,
            progress=progress,
            ready=lambda: say(writing(campaign)),
            say=say,
        )
    except TooMany as problem:
        _complain(problem, json)
        return None
    except OutputLost:
        raise
    except KeyboardInterrupt as interrupt:
        if str(interrupt) and not json:
            visible.say(f"\n{interrupt}", err=True)
        raise


def _result(campaign: Campaign, performed: Performed, no_picture: bool, say: Callable[[str], None]) -> RunResult:
    """Read the results of a campaign, and draw the picture beside its archive."""
    if campaign.kept_rows.all and campaign.cases > MOST_READ and _is_counted(campaign, performed):
        return _counted_result(campaign, performed)
    with ArchiveFile(campaign.output) as file:
        summaries = summarise(file)
        worst = tuple(worst_cases(file))
        answers = tuple(search_result(file, group) for group in file.groups)
        experiments = {part.experiment.name: part.experiment for part in campaign.parts}
        warned = [*performed.warned, *campaign_warnings(file.groups, experiments)]
        tables = list(structures(file))
        try:
            if no_picture:
                picture, excuse = None, ""
            elif campaign.kept_rows.all and campaign.cases > MOST_READ:
                picture, excuse = None, NOT_DRAWN.format(MOST_READ)
            else:
                picture, excuse = first_picture(file)
        except KeyboardInterrupt as interrupt:
            say(f"{campaign.output} is whole; its picture is missing: `met plot {quoted(campaign.output)}`")
            raise type(interrupt) from None
    return RunResult(summaries, worst, picture, excuse, tables, tuple(warned), answers)


MOST_READ = MANY
"""Largest number of cases of a campaign for which its picture is drawn: a million take 150 MB of memory."""

NOT_DRAWN = "of more than {:,} cases `met show` says more and `met plot` draws: 150 MB of memory a million"


def _is_counted(campaign: Campaign, performed: Performed) -> bool:
    """True where counts of cases alone decide the verdict."""
    names = {part.experiment.name for part in campaign.parts}
    shares = [r.share for part in campaign.parts for r in part.experiment.requirements if r.share is not None]
    return (
        names == performed.counted.keys() and not shares and not any(p.experiment.step_errors for p in campaign.parts)
    )


def _counted_result(campaign: Campaign, performed: Performed) -> RunResult:
    """The result of very many cases without reading their archive: the numbers that failed, and that met
    requirements."""
    summaries = []
    for part in campaign.parts:
        experiment, counted = part.experiment, performed.counted[part.experiment.name]
        required = tuple(
            RequirementSummary(text, met, missed, unknown, none)
            for text, (met, missed, unknown, none) in counted.met.items()
        )
        summaries.append(
            Summary(
                experiment.name,
                counted.cases,
                counted.failed,
                counted.recorded,
                failures=(),
                metrics=(),
                requirements=required,
                sweep=experiment.sweep,
            )
        )
    none = (WorstCaseLines(),) * len(summaries)
    return RunResult(tuple(summaries), none, None, NOT_DRAWN.format(MOST_READ), warned=performed.warned)


def _exported(
    campaign: Campaign, target: Path | None, histories: bool, json: bool, say: Callable[[str], None]
) -> tuple[Exported | None, list[str]]:
    """Export the run, if requested; where that is refused, returns the reasons, which people see at once."""
    if target is None:
        return None, []
    try:
        return export_run(campaign, target, histories=histories), []
    except Problem as problem:
        if not json:
            _complain(problem, json)
        return None, [diagnostic.message for diagnostic in problem.diagnostics]
    except KeyboardInterrupt as interrupt:
        command = export_command(campaign, target, histories=histories)
        say(f"{campaign.output} is whole; {target} is missing: `{command}`")
        raise type(interrupt) from None


def submit_and_tell(
    source: str,
    names: tuple[str, ...] = (),
    *,
    everything: bool = False,
    output: str | None = None,
    cases: tuple[str, ...] = (),
    histories: Sequence[str] = (),
    float32: bool = False,
    jobs: int | None = None,
    options: tuple[str, ...] = (),
    timeout: float | None = None,
    fresh: bool = False,
    verify: Verify = "auto",
    rows: str = "all",
    defines: tuple[str, ...] = (),
    include_dirs: tuple[str, ...] = (),
    settings: tuple[str, ...] = (),
    quiet: bool = False,
    verbose: bool = False,
    json: bool = False,
) -> None:
    """Submit a deck's or a plan's cases to SLURM, and print the jobs."""
    import json as json_module

    from batch.executors.submitting import submit

    say = (lambda *_: None) if quiet or json else visible.say
    how_read = {"everything": everything, "defines": defines, "include_dirs": include_dirs, "settings": settings}
    campaign = _of_deck(source, names, how_read, output, cases, histories, float32, quiet or json, verify, rows)
    say("\n".join(announcement(campaign, verbose, notes=verbose or names_plan(source))))
    done = submit(campaign, jobs=jobs, options=options, timeout=timeout, fresh=fresh, say=say)
    archive = str(campaign.output)
    state = "is whole" if done is None else f"is submitted: `met status {quoted(archive)}` says how far it is"
    with kept(f"{archive} {state}"):
        if json:
            about = {} if done is None else dataclasses.asdict(done)
            print(json_module.dumps({"archive": archive, "whole": done is None, **about}, indent=1), flush=True)
        elif done is None:
            say(f"nothing is missing: {archive} has all of it (`--fresh` runs it again)")
        else:
            if done.array:
                many = f"{done.jobs} job{'s' if done.jobs > 1 else ''}"
                say(f"submitted  array {done.array}: {many} for {done.cases:,} cases")
            say(f"           job {done.end}: merges them into {archive}")
            say(f"next       met status {quoted(archive)}")


def _of_deck(
    source: str,
    names: tuple[str, ...],
    how_read: dict[str, Any],
    output: str | Path | None,
    cases: tuple[str, ...],
    histories: str | Sequence[str],
    float32: bool,
    quiet: bool,
    verify: Verify,
    rows: str,
) -> Campaign:
    """The campaign of a deck's or a plan's runs and sweeps of these names. how_read: further arguments of `read_plan`,
    such as macros and settings"""
    return prepare(
        read_plan(source, names, **how_read, quiet=quiet),
        output=output,
        experiments=names or None,
        cases=cases or None,
        histories=histories or "default",
        float32=float32,
        verify=verify,
        rows=rows,
    )


def _complain(problem: Problem, json: bool) -> None:
    """Print a problem: for people on stderr, for programs as JSON."""
    from met.messages import programs, render

    if json:
        print(programs.to_json(problem.diagnostics, problem.sources))
    else:
        colour = render.wants_colour(sys.stderr)
        print(render.render(problem.diagnostics, problem.sources, colour=colour), end="", file=sys.stderr)


def _compared(again: Replay | None, unlike: Sequence[str], output: Path) -> list[str]:
    """Lines that compare a replay with its archive."""
    if again is None:
        return []
    with_row, cases = in_both(again.archive, output)
    if not with_row:
        return [f"{again.archive} keeps a summary, without a row of {'it' if cases == 1 else 'them'} to compare with"]
    if not unlike:
        return [f"the same bits as in {again.archive}" + f", which has rows of {with_row:,}" * (with_row < cases)]
    return [f"not the same as in {again.archive}:", *(f"  {line}" for line in unlike)]


def first_picture(archive: ArchiveFile) -> tuple[Path | None, str]:
    """The picture beside an archive; or the reason, in words, why there is none."""
    from batch.plotting import draw

    try:
        return draw(archive, archive.path.with_suffix(".png")), ""
    except Problem as problem:
        return None, problem.diagnostics[0].message
