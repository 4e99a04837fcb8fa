"""`met diff`: a face of batch.differences."""

from __future__ import annotations

import click

from met.cli import NO, YES, format_option
from met.messages.visible import line, say


@click.command(short_help="Show what changed between two archives, case by case.")
@click.argument("a", metavar="A.h5")
@click.argument("b", metavar="B.h5")
@click.option(
    "--tol",
    "tolerances",
    multiple=True,
    metavar="LIST",
    help="Differences to accept: qd=1e-6rad/s,rel=1e-9,time=1ms; may be repeated. Without a tolerance, none is "
    "accepted.",
)
@click.option(
    "--require",
    type=click.Choice(["identical", "equivalent"]),
    default="equivalent",
    show_default=True,
    help="Result that exit status 0 requires.",
)
@click.option(
    "--distributions", is_flag=True, help="Also compare metrics as distributions, as for archives with different seeds."
)
@click.option("--all", "every", is_flag=True, help="Show everything that is found, not only the first of each kind.")
@format_option
def diff(a: str, b: str, tolerances: tuple[str, ...], require: str, distributions: bool, every: bool, form: str) -> int:
    """Compare two archives: one case or a million, of two versions of a deck, of its models, or of MET.

    Cases are matched by their varied values. The output begins with the changed lines of the decks, the parameters that
    they change, and what follows from these. Then come the status of cases, signals and metrics: identical to the bit,
    equivalent within a tolerance, different, or incomparable. Exit status: 0 the archives are as required; 1 they
    differ, have other requirements, or cannot be compared; 2 the input is wrong.
    """
    import json

    from batch.differences.campaigns import diff
    from batch.differences.compare import EQUIVALENT, VERDICTS
    from batch.differences.data import as_data
    from batch.differences.text import Shortening, diff_lines
    from batch.differences.tolerance import tolerances as read
    from met.outputs import quoted

    difference = diff(a, b, read(tolerances), distributions=distributions)
    options = [
        *(f"--tol {quoted(tolerance)}" for tolerance in tolerances),
        *(["--distributions"] if distributions else []),
    ]
    cut = Shortening(every, f"`{' '.join(['met diff', quoted(a), quoted(b), *options, '--all'])}`")
    say(
        json.dumps(as_data(difference), indent=1)
        if form == "json"
        else "\n".join(map(line, diff_lines(difference, cut)))
    )
    enough = VERDICTS.index(difference.verdict) <= VERDICTS.index(require)
    if form != "json" and difference.verdict == EQUIVALENT and not enough:
        click.echo("exit 1: `--require identical` asks for the same bits")
    return YES if enough else NO
