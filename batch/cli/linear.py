"""`met linear`: a face of met.analysis.linear."""

from __future__ import annotations

from typing import Any

import click

from batch.cli.quantities import QuantityOption
from met.cli import NO, YES, check_options, deck_options, format_option
from met.messages.visible import say

EQUILIBRIUM = "write `2 s`; a `linear` block of the run has `at = equilibrium;`, and `--of` asks for it"


@click.command(short_help="Linearise the program that runs: poles, modes, margins of loops, A B C D.")
@click.argument("source", metavar="DECK|PLAN.json")
@click.argument("name", metavar="[NAME]", required=False)
@click.option("--of", metavar="LINEAR", help="Answer this `linear` block of the run. [its only one]")
@click.option(
    "--at",
    type=QuantityOption("instant", "s", "`2 s` or `250 ms`", equilibrium=EQUILIBRIUM),
    metavar="TIME",
    help="The instant of the run, such as `2 s`. [0 s]",
)
@click.option(
    "--case", metavar="ID", help="The case of a sweep: the beginning of its id, or its position, as '#7'. [#0]"
)
@click.option(
    "--all-cases", is_flag=True, help="All cases of a sweep, a row for each: margins of opened loops, or else damping."
)
@click.option(
    "--input",
    "inputs",
    multiple=True,
    metavar="SIGNAL",
    help="A column of B, such as `pan.servo.command`; may be repeated.",
)
@click.option(
    "--output", "outputs", multiple=True, metavar="SIGNAL", help="Rows of C, such as `pan.q` or `tau`; may be repeated."
)
@click.option(
    "--open",
    "opened",
    multiple=True,
    metavar="SIGNAL",
    help="Open the loop at this output of a control law, such as `pan.servo.voltage`; may be repeated.",
)
@click.option(
    "-o", "--to", "output", metavar="FILE", help="Write A, B, C, D with their names to this file: .npz, .h5 or .csv."
)
@click.option(
    "--picture",
    metavar="FILE",
    help="Draw loops (Bode, Nichols) and step responses, of all cases a root locus: .png, .svg or .pdf.",
)
@deck_options
@format_option
def linear(source: str, name: str | None, form: str, **options: Any) -> int:
    """Linearise a deck's only run or sweep, the one marked `default`, or NAME, at an instant.

    The derivative is exact, and that of the program that runs, with its sampling, held values and delays. Joints that
    stick are held. Without a question in the options, the run's only `linear` block is answered. Exit status: 0 done; 1
    a loop that was opened is unstable as it is; 2 the input is wrong, or there is an event in the period.
    """
    import json

    from batch.campaigns.choosing import experiments_named, read_plan, select_rows
    from batch.linearized import picture
    from batch.linearized.data import check, write
    from batch.plotting import output as places
    from batch.terminal.linear import answered, as_data, case_lines, linear_lines
    from met.analysis.linear.answers import Linearized, question_of
    from met.outputs import path_of

    if options["of"] is not None:
        for option, key in (("--at", "at"), ("--input", "inputs"), ("--output", "outputs"), ("--open", "opened")):
            if options[key] not in (None, ()):
                raise click.UsageError(f"{option} asks, and so does --of {options['of']}: leave one of them out")
    if options["all_cases"]:
        for option, key in (("--case", "case"), ("-o", "output")):
            if options[key] is not None:
                raise click.UsageError(f"{option} is of one case, and --all-cases of all")
    names = (name,) if name is not None else ()
    how_read = {key: options[key] for key in ("defines", "include_dirs", "settings")}
    check_options(source, names, **how_read)
    output, drawn = (None if options[key] is None else path_of(options[key]) for key in ("output", "picture"))
    if output is not None:
        check(output)
    if drawn is not None:
        places.check(drawn)
    plan = read_plan(source, names, **how_read, quiet=form == "json")
    experiments = experiments_named(plan, names or None)
    if options["case"] is not None:
        ((experiment, rows), *_) = select_rows(experiments, [options["case"]])
        case = int(rows[0])
    else:
        experiment, case = experiments[0], 0
    question = question_of(
        experiment, **{key: options[key] for key in ("of", "at", "inputs", "outputs", "opened")}
    )  # fmt: skip
    if options["all_cases"]:
        every = answered(question)
        if drawn is not None:
            picture.draw_locus(question, every, drawn)
        data = [
            as_data(answer) if isinstance(answer, Linearized) else {"case": n, "why_not": answer}
            for n, answer in enumerate(every)
        ]
        say(json.dumps(data, indent=1) if form == "json" else "\n".join(case_lines(question, every)))
        loops = [loop for answer in every if isinstance(answer, Linearized) for loop in answer.loops]
        return NO if any(loop.unstable for loop in loops) else YES
    linearized = question.of(case)
    if output is not None:
        write(linearized, output)
    if drawn is not None:
        picture.draw(linearized, drawn)
    lines = linear_lines(linearized, experiment.cases.count)
    say(json.dumps(as_data(linearized), indent=1) if form == "json" else "\n".join(lines))
    return NO if any(loop.unstable for loop in linearized.loops) else YES
