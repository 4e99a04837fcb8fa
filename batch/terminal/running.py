"""`met run` from end to end: read, say what will run, run it, say what came of it and where it is."""

from __future__ import annotations

import dataclasses
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from batch.archive.read import ArchiveFile
from batch.campaigns.campaign import Campaign, prepare
from batch.campaigns.performing import TooMany, perform
from batch.campaigns.plans import read_plan
from batch.campaigns.rehearsal import rehearse
from batch.campaigns.replaying import Replay, differences, replay
from batch.executors.choose import choose
from batch.executors.threads import Threads
from batch.export.from_run import archive_and_export, check, export_command, export_run
from batch.queries.structures import structures
from batch.queries.summary import summarise
from batch.terminal.progress import Bar
from batch.terminal.verdict import announcement, result_lines, verdict_json, worst_cases, writing
from batch.verification.warning import campaign_warnings
from batch.verification.when import Verify
from met.diagnostic import Problem, error
from met.host.sources import names_archive, names_plan
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
    executor = choose(threads=threads, processes=processes, dask=dask, timeout=timeout)
    if not isinstance(executor, Threads):
        rehearse(
            timeout,
            source=source,
            names=names,
            everything=everything,
            defines=defines,
            include_dirs=include_dirs,
            settings=settings,
        )
    archive, target = archive_and_export(output)
    again = None
    if names_archive(source):
        again = replay(source, names, cases, failed, everything)
        archive = archive or again.output
        if os.path.realpath(archive) == os.path.realpath(source):  # Path.resolve has an error for a link to itself
            helps = "`-o FILE` names another place"
            raise Problem(error("E305", f"cannot write {archive}: it is what is run again", help=helps))
        campaign = prepare(
            again.plan,
            output=archive,
            selected=again.selected,
            histories=histories or ("all" if again.kept is None else "none"),
            kept=again.kept if not histories else None,
            float32=float32,
            verify=verify,
        )
    else:
        campaign = _of_deck(
            source,
            names,
            everything,
            archive,
            cases,
            histories,
            float32,
            defines,
            include_dirs,
            settings,
            quiet or json,
            verify,
        )
    of_histories = bool(histories)
    if target is not None:
        check(campaign, target, histories=of_histories)
    say("\n".join(announcement(campaign, verbose, notes=verbose or names_plan(source))))
    try:
        performed = perform(
            campaign,
            executor=executor,
            fresh=fresh,
            max_failures=max_failures,
            progress=None if quiet or json else Bar(),
            ready=lambda: say(writing(campaign)),
            say=say,
        )
    except TooMany as problem:
        _complain(problem, json)
        return False
    except KeyboardInterrupt as interrupt:
        if str(interrupt) and not json:
            visible.say(f"\n{interrupt}", err=True)
        raise
    if performed.whole:
        say(f"nothing is missing: {campaign.output} has all of it (`--fresh` runs it again)")
    with ArchiveFile(campaign.output) as file:
        summaries = summarise(file)
        worst = worst_cases(file)
        experiments = {part.experiment.name: part.experiment for part in campaign.parts}
        warned = campaign_warnings(file.groups, experiments)
        tables = list(structures(file))
        try:
            picture, excuse = (None, "") if no_picture else first_picture(file)
        except KeyboardInterrupt as interrupt:
            say(f"{campaign.output} is whole; its picture is missing: `met plot {quoted(campaign.output)}`")
            raise type(interrupt) from None
    exported = None
    refused: list[str] = []
    try:
        exported = None if target is None else export_run(campaign, target, histories=of_histories)
    except Problem as problem:
        refused = [each.message for each in problem.diagnostics]
        if not json:
            _complain(problem, json)
    except KeyboardInterrupt as interrupt:
        if target is not None:
            command = export_command(campaign, target, histories=of_histories)
            say(f"{campaign.output} is whole; {target} is missing: `{command}`")
        raise type(interrupt) from None
    ok = all(summary.ok for summary in summaries)
    missing = target is not None and exported is None
    unlike = differences(again.archive, campaign.output) if again is not None else []
    notes = [*performed.notes, *_compared(again, unlike), *refused]
    if json:
        print(
            verdict_json(
                campaign,
                summaries,
                worst,
                picture,
                exported,
                performed.seconds,
                notes,
                ok and not unlike and not missing,
            )
        )
    else:
        say(
            "\n".join(
                result_lines(
                    source, campaign, summaries, worst, picture, excuse, exported, performed.seconds, ok, tables
                )
            )
        )
        if warned and not quiet:
            _complain(Problem(warned, {source.name: source.text for source in campaign.plan.sources}), json)
        for line in _compared(again, unlike):
            say(line)
        if missing and target is not None:
            say(f"exit 1: {target} is missing: `{export_command(campaign, target, histories=of_histories)}`")
    return ok and not unlike and not missing


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
    defines: tuple[str, ...] = (),
    include_dirs: tuple[str, ...] = (),
    settings: tuple[str, ...] = (),
    quiet: bool = False,
    verbose: bool = False,
    json: bool = False,
) -> None:
    """Hand a deck's or a plan's cases to SLURM, and say which jobs have them."""
    import json as json_module

    from batch.executors.submitting import submit

    say = (lambda *_: None) if quiet or json else visible.say
    campaign = _of_deck(
        source,
        names,
        everything,
        output,
        cases,
        histories,
        float32,
        defines,
        include_dirs,
        settings,
        quiet or json,
        verify,
    )
    say("\n".join(announcement(campaign, verbose, notes=verbose or names_plan(source))))
    done = submit(campaign, jobs=jobs, options=options, timeout=timeout, fresh=fresh, say=say)
    archive = str(campaign.output)
    if json:
        about = {} if done is None else dataclasses.asdict(done)
        print(json_module.dumps({"archive": archive, "whole": done is None, **about}, indent=1))
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
    everything: bool,
    output: str | Path | None,
    cases: tuple[str, ...],
    histories: str | Sequence[str],
    float32: bool,
    defines: tuple[str, ...],
    include_dirs: tuple[str, ...],
    settings: tuple[str, ...],
    quiet: bool,
    verify: Verify,
) -> Campaign:
    """The campaign that is asked of a deck or a plan."""
    plan = read_plan(
        source, names, everything=everything, defines=defines, include_dirs=include_dirs, settings=settings, quiet=quiet
    )
    return prepare(
        plan,
        output=output,
        experiments=names or None,
        cases=cases or None,
        histories=histories or "default",
        float32=float32,
        verify=verify,
    )


def _complain(problem: Problem, json: bool) -> None:
    """Print a problem: for people on stderr, for programs as JSON."""
    from met.messages import render

    if json:
        print(render.to_json(problem.diagnostics))
    else:
        colour = render.wants_colour(sys.stderr)
        print(render.render(problem.diagnostics, problem.sources, colour=colour), end="", file=sys.stderr)


def _compared(again: Replay | None, unlike: Sequence[str]) -> list[str]:
    """Lines that compare a replay with its archive."""
    if again is None:
        return []
    if not unlike:
        return [f"the same bits as in {again.archive}"]
    return [f"not the same as in {again.archive}:", *(f"  {line}" for line in unlike)]


def first_picture(archive: ArchiveFile) -> tuple[Path | None, str]:
    """The picture beside an archive; where there can be none, why not, in words."""
    from batch.plotting import draw

    try:
        return draw(archive, archive.path.with_suffix(".png")), ""
    except Problem as problem:
        return None, problem.diagnostics[0].message
