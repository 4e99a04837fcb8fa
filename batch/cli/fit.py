"""`met fit`: a face of batch.fitting."""

from __future__ import annotations

from typing import Any

import click

from batch.cli.best import tell
from batch.cli.quantities import INSTANT
from batch.cli.residuals import column_option
from met.cli import NO, YES, deck_options, format_option
from met.outputs import varies


class LogInstant(click.ParamType):
    """An instant of a log: its file, "" for any log, and s."""

    name = "instant"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read `LOG=TIME` or `TIME`."""
        log, _, instant = value.rpartition("=")
        return log, INSTANT.convert(instant, param, ctx)


@click.command(short_help="Estimate numbers of a deck from logs of the real arm.")
@click.argument("deck", metavar="DECK")
@click.argument("logs", metavar="[RUN=]LOG...", nargs=-1, required=True)
@click.option(
    "--estimate",
    "estimates",
    multiple=True,
    required=True,
    metavar="PATH",
    help="Estimate this number, by a path that `vary` can name: 'links.jib.mass', 'links.*.mass', or the time "
    "by which a log is late: 'delay of log.csv'; may be repeated.",
)
@click.option(
    "--prior",
    "priors",
    multiple=True,
    metavar="PATH=normal(MEAN, SD) UNIT",
    help="What is known of a parameter before: 'gearbox.kt=normal(0.061, 0.002) N*m/A'; may be repeated.",
)
@click.option(
    "--predict",
    multiple=True,
    metavar="[RUN=]LOG",
    help="Also compare a log that is not fitted, with the deck's and with the fitted numbers; may be repeated.",
)
@click.option("--identifiable", is_flag=True, help="Only say what the logs can tell of these numbers, and fit nothing.")
@click.option(
    "--motion",
    "motions",
    multiple=True,
    metavar="NAME",
    help="With --identifiable: also say what a log of this run, as noisy as LOG, would add, or one of the best case of "
    "this sweep; may be repeated.",
)
@click.option(
    "--picture",
    metavar="FILE",
    help="Draw the first log, or the first predicted one, as measured, and as computed before and after.",
)
@click.option("--diff", is_flag=True, help="Show what --write would change in the deck's text.")
@click.option("--write", is_flag=True, help="Write the values into the deck's text, and show what changed.")
@click.option(
    "-o", "output", metavar="FILE", help="With --diff or --write: a new file, for a changed copy of the deck."
)
@column_option
@click.option(
    "--zero",
    "zeros",
    type=LogInstant(),
    multiple=True,
    metavar="[LOG=]TIME",
    help="The time of the logs, or of this one, at which its run begins: '12.5 s'; 'log.csv=4 ms' of one that is 4 ms "
    "late; may be repeated.  [0 s]",
)
@deck_options
@format_option
def fit(
    deck: str,
    logs: tuple[str, ...],
    estimates: tuple[str, ...],
    identifiable: bool,
    picture: str | None,
    diff: bool,
    write: bool,
    output: str | None,
    form: str,
    **options: Any,
) -> int:
    """Estimate numbers of a run so that it computes what LOG measured, a CSV or MCAP file of the real arm's signals.

    LOG is compared with the deck's only run, the one marked `default`, or RUN; several logs are fitted together.

    Exit status: 0 all numbers are known; 1 the logs cannot tell some of them, or are doubtful; 2 the input is wrong.
    """
    from batch.fitting.question import fit_question
    from batch.plotting import logs as pictures
    from batch.plotting import output as places
    from batch.terminal import fit as shown
    from batch.terminal.chosen_deck import fitted_deck
    from batch.terminal.progress import Bar
    from met.diagnostic import Problem, error
    from met.host.sources import names_archive, names_plan
    from met.outputs import path_of

    if names_plan(deck) or names_archive(deck):
        raise click.UsageError(f"`{deck}` is no deck, of which numbers could be estimated")
    if any(varies(setting) for setting in options["settings"]):
        raise click.UsageError("--vary is for sweeps: `--estimate PATH` is what a fit moves")
    if output is not None and not (diff or write):
        raise click.UsageError("-o is the file for --write")
    if identifiable and (picture or options["predict"]):
        raise click.UsageError("--identifiable fits nothing: leave --picture and --predict out")
    drawn = None if picture is None else path_of(picture)
    if drawn is not None:
        places.check(drawn)
    if options["motions"] and not identifiable:
        raise click.UsageError("--motion is for --identifiable: a run without a log cannot be fitted")
    question = fit_question(deck, logs, estimates, **options)
    how_read = {key: options[key] for key in ("defines", "settings")}
    bar, changed = Bar(), None
    if identifiable:
        bar.begin("slopes", 0)
        known, promised = question.identifiable(), question.promised(bar.advance)
        bar.end()
        chosen = [promise for promise in promised if promise.values]
        if diff or write:
            if len(chosen) != 1:
                raise click.UsageError("--identifiable writes the best motion of one sweep: `--motion SWEEP`")
            name = chosen[0].motion.deck_run.name
            changed = fitted_deck(deck, shown.written_motion(chosen[0]), output, experiment=name, **how_read)
            if logged := {run.deck_run.name for run in question.runs} & {name, *changed.others}:
                message = f"with this motion, `{min(logged)}` is no longer the run of its log"
                raise Problem(error("E480", message, help=f"give `{name}` servos of its own"))
        data = shown.identifiable_data(question, known, promised)
        tell(form, data, shown.identifiable_lines(question, known, promised), changed, requested=False, write=write)
        return YES if set(known.verdict) == {"known"} else NO
    bar.begin(f"fit of {question.runs[0].deck_run.name}", 0)
    answer = question.answer(bar.advance)
    bar.end()
    certain = shown.is_certain(question, answer)
    lines, data = list(shown.fit_lines(question, answer)), {}
    if form == "json":
        data = shown.as_data(question, answer)
    if certain:
        lines += ["", *shown.sweep_lines(question, answer)]
        if diff or write:
            values = shown.written_values(question, answer)
            try:
                changed = fitted_deck(deck, values, output, experiment=question.runs[0].deck_run.name, **how_read)
            except Problem:
                tell(form, data, lines, None, requested=False, write=False)  # the numbers are not lost with the deck
                raise
    if drawn is not None:
        run = (*question.predicted, *question.runs)[0]
        courses = {"deck": run.courses(question.start), "fitted": run.courses(answer.fit.values)}
        units = {column["channel"]: column["unit"] for column in run.columns}
        pictures.draw(run.name, pictures.panels(run.log, units, courses), drawn)
    tell(
        form,
        data,
        lines,
        changed,
        requested=diff or write,
        write=write,
        why_not="not all numbers are known, or a log is doubtful",
    )
    return YES if certain else NO
