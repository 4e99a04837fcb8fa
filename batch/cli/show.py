"""`met show`, `profile`, `margin`: faces of batch.terminal.show, met.analysis.profile and met.analysis.margin."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import click

from met.cli import NO, YES, check_options, deck_options, format_option
from met.messages.visible import say

if TYPE_CHECKING:
    from met.plan import Experiment


@click.command(short_help="Show an archive in the terminal: outcome, metrics, signals.")
@click.argument("archive", metavar="ARCHIVE")
@click.argument("signals", nargs=-1, metavar="[SIGNAL]...")
@click.option("--run", "experiments", multiple=True, metavar="NAME", help="Only this run or sweep of the archive.")
@click.option(
    "--case", metavar="ID", help="Only this case, in full: the beginning of its id, or its position, as '#0'."
)
@click.option("--all-cases", is_flag=True, help="All rows of the table of cases, not only the first 20.")
@click.option(
    "--sort",
    multiple=True,
    metavar="NAME",
    help="Sort cases by this metric or varied parameter, smallest first; NAME:largest sorts largest first. Repeated: "
    "equal cases by the next NAME.",
)
@click.option("--reverse", is_flag=True, help="With --sort: largest first, for each NAME that does not say it itself.")
@click.option(
    "--where", metavar="CONDITION", help="Only cases in which this holds: 'settle < 4 s and gearbox.kp > 0.02 V*s/rad'."
)
@click.option("--over", multiple=True, metavar="PATH", help="Of the cases that differ only in PATH, show the worst.")
@click.option("--met", is_flag=True, help="Only those of the cases that meet all requirements.")
@click.option("--evidence", is_flag=True, help="Only the table of requirements: share, bounds, worst case, margin.")
@format_option
def show(
    archive: str,
    signals: tuple[str, ...],
    experiments: tuple[str, ...],
    case: str | None,
    all_cases: bool,
    sort: tuple[str, ...],
    reverse: bool,
    where: str | None,
    met: bool,
    over: tuple[str, ...],
    evidence: bool,
    form: str,
) -> int:
    """Show the contents of an archive: what was run, its outcome, metrics, requirements, and SIGNALs (`qd`, `elbow.q`).

    Of a sweep, also the cases that failed or missed a requirement, the worst first, or in the order of --sort.
    """
    import shutil

    from batch.archive.read import ArchiveFile
    from batch.queries.ordering import CaseSelection, by_names
    from batch.terminal.show import as_json, show, show_evidence

    if reverse and not sort:
        raise click.UsageError("--reverse is of --sort, and nothing is sorted: `--sort NAME`")
    if case is not None and sort:
        raise click.UsageError("--sort is of many cases, and --case of one")
    some = CaseSelection(where or "", over, met)
    if case is not None and not some.everything:
        raise click.UsageError("--where, --met and --over are of many cases, and --case of one")
    if evidence and (signals or case is not None or sort or all_cases or not some.everything):
        raise click.UsageError("--evidence is about all cases: of one, or of signals, ask without it")
    by = by_names(sort, reverse=reverse)
    with ArchiveFile(archive) as file:
        if form == "json":
            click.echo(as_json(file, experiments, case=case, all_cases=all_cases, by=by, some=some))
            return YES
        width = min(100, shutil.get_terminal_size((100, 24)).columns)
        if evidence:
            click.echo(show_evidence(file, experiments, width=width), nl=False)
            return YES
        text = show(
            file,
            signals,
            experiments=experiments,
            case=case,
            all_cases=all_cases,
            by=by,
            some=some,
            width=width,
        )
        click.echo(text, nl=False)
    return YES


@click.command(short_help="Show where the time of a run goes, and what its kernel is like.")
@click.argument("source", metavar="DECK|PLAN.json")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@deck_options
@format_option
def profile(
    source: str,
    names: tuple[str, ...],
    defines: tuple[str, ...],
    include_dirs: tuple[str, ...],
    settings: tuple[str, ...],
    form: str,
) -> int:
    """Measure the kernel of a deck's only run or sweep, of the one marked `default`, or of these NAMEs, on one core.

    The output has operations, flops and time of each part of a step, the share of what the core can do, the parameters
    that are folded into the code and those that are inputs, and how the kernel was made. Nothing is written but the
    cache.
    """
    from batch.terminal.profile import profile_lines
    from met.analysis.profile import as_data
    from met.analysis.profile import profile as measured

    profiles = [
        (measured(experiment), experiment)
        for experiment in _asked_for(source, names, defines, include_dirs, settings, form)
    ]
    _say(
        form,
        [as_data(run_profile) for run_profile, _ in profiles],
        [profile_lines(*run_profile) for run_profile in profiles],
    )
    return YES


@click.command(short_help="Predict whether a law keeps a motor on a bed stable, and with what margin.")
@click.argument("source", metavar="DECK|PLAN.json")
@click.argument("names", nargs=-1, metavar="[NAME]...")
@deck_options
@format_option
def margin(
    source: str,
    names: tuple[str, ...],
    defines: tuple[str, ...],
    include_dirs: tuple[str, ...],
    settings: tuple[str, ...],
    form: str,
) -> int:
    """Predict, for each joint whose motor is on a bed, how heavy the arm may be for its law, rate and delay.

    Bed, servo and law are linearised over a tick of the servo, with arms of any inertia, and judged by their poles.
    Exit status: 0 all joints are stable in all cases; 1 one is not; 2 the input is wrong, or no joint is on a bed.
    """
    from batch.terminal.margin import as_data, margin_lines
    from met.analysis.margin import margins
    from met.diagnostic import Problem, error

    named = _asked_for(source, names, defines, include_dirs, settings, form)
    on_beds = [experiment for experiment in named if experiment.structure.substitutions]
    if not on_beds:
        helps = ("a run says so: `substitute JOINT { }`", "name the run or sweep that does, if it is another one")
        raise Problem(error("E333", "no joint is on a bed here", help=helps))
    margins_of = [(experiment, margins(experiment)) for experiment in on_beds]
    _say(
        form,
        [as_data(*experiment_and_margins) for experiment_and_margins in margins_of],
        [margin_lines(*experiment_and_margins) for experiment_and_margins in margins_of],
    )
    return YES if all(joint_margin.stable for _, cases in margins_of for case in cases for joint_margin in case) else NO


def _asked_for(
    source: str,
    names: tuple[str, ...],
    defines: tuple[str, ...],
    include_dirs: tuple[str, ...],
    settings: tuple[str, ...],
    form: str,
) -> Sequence[Experiment]:
    """The runs and sweeps of a deck or plan for a command; the compiler's messages go to people."""
    from batch.campaigns.choosing import experiments_named, read_plan

    check_options(source, names, defines=defines, include_dirs=include_dirs, settings=settings)
    plan = read_plan(source, names, defines=defines, include_dirs=include_dirs, settings=settings, quiet=form == "json")
    return experiments_named(plan, names or None)


def _say(form: str, data: Sequence[Any], texts: Sequence[Iterable[str]]) -> None:
    """Print data for programs, or texts for people with a blank line between them."""
    import json

    say(json.dumps(data, indent=1) if form == "json" else "\n\n".join("\n".join(lines) for lines in texts))
