"""The commands check, plan, cases, explain, doc and dump, on top of `ic.check`, the plan and its printing."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, Any, Literal

import click

from met.cli import (
    BAD_INPUT,
    PROGRAM_FORMS,
    YES,
    check_options,
    complain,
    deck_options,
    format_option,
    loudness_options,
)
from met.diagnostic import Diagnostic, Problem, did_you_mean, error
from met.frozen import frozen
from met.host.streams import kept
from met.messages.visible import say
from met.outputs import settings_of

if TYPE_CHECKING:
    from ic.driver.compile import Compiled
    from ic.meaning.runs.allowances import Allowance
    from met.plan import Plan

DECK = click.argument("deck")


@click.command()
@click.argument("decks", nargs=-1, required=True, metavar="DECK...")
@deck_options
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", *PROGRAM_FORMS]),
    default="text",
    help="Form of the output: text for people, json and sarif for programs, github for GitHub workflows.",
)
@loudness_options
def check(
    decks: tuple[str, ...],
    defines: tuple[str, ...],
    include_dirs: tuple[str, ...],
    settings: tuple[str, ...],
    form: str,
    quiet: bool,
    verbose: bool,
) -> int:
    """Find all mistakes in decks.

    Every run and sweep of a deck is compiled to its plan; nothing is run. A plan file is read, and its contents are
    listed.
    """
    for deck in decks:
        check_options(deck, defines=defines, include_dirs=include_dirs, settings=settings)
    checked_decks: list[_Checked] = []
    for deck in decks:
        try:
            checked_deck = _checked(deck, include_dirs, defines, settings)
        except Problem as problem:
            checked_deck = _Checked(deck, None, problem.diagnostics, problem.sources)
        checked_decks.append(checked_deck)
        if form != "text":
            continue
        if checked_deck.diagnostics and (checked_deck.plan is None or not quiet):
            complain(checked_deck.diagnostics, checked_deck.sources)
        if checked_deck.plan is not None and not quiet:
            _print_verdict(checked_deck, verbose)
    if form != "text":
        _complain_together(checked_decks, form)
    return BAD_INPUT if any(checked_deck.plan is None for checked_deck in checked_decks) else YES


@frozen
class _Checked:
    """The findings of `met check` in one file: its plan, None where it has none, and messages.

    allowed  warnings that runs allow, each with how and why they do
    """

    file: str
    plan: Plan | None
    diagnostics: tuple[Diagnostic, ...]
    sources: Mapping[str, str]
    allowed: tuple[tuple[Diagnostic, Allowance], ...] = ()


def _checked(file: str, include_dirs: tuple[str, ...], defines: tuple[str, ...], settings: tuple[str, ...]) -> _Checked:
    """A deck, or a plan file, checked. Raises Problem where it cannot be read."""
    if file.endswith(".json"):
        from met.plan import file as plan_file

        return _Checked(file, plan_file.read(file), (), {})
    import ic
    from ic.find import find

    find(file, include_dirs)
    compiled = ic.check(file, include_dirs=include_dirs, defines=defines, **settings_of(settings), select="all")
    return _Checked(file, compiled.plan, tuple(compiled.diagnostics), compiled.sources, tuple(compiled.allowed))


def _print_verdict(checked: _Checked, verbose: bool) -> None:
    """Print the verdict on a checked deck or plan: errors, warnings and sizes, and with `verbose` also notes and
    allowed warnings."""
    from ic.printing.check import left_out, notes, verdict

    assert checked.plan is not None
    if checked.file.endswith(".json"):
        say(f"{checked.file}: plan of {verdict(checked.plan, ())}")
        return
    if verbose:
        _print(notes(checked.plan))
        _print(f"allowed: {warning.message} ({allowance})" for warning, allowance in checked.allowed)
    _print(left_out(checked.plan))
    say(verdict(checked.plan, checked.diagnostics, len(checked.allowed)))


def _complain_together(checked_decks: Iterable[_Checked], form: str) -> None:
    """Print the messages of several files as one, for programs: those that decks share are printed once."""
    from ic.printing.looked_up import titles

    diagnostics: dict[object, Diagnostic] = {}
    allowed: dict[object, tuple[Diagnostic, str]] = {}
    sources: dict[str, str] = {}
    for checked_deck in checked_decks:
        for diagnostic in checked_deck.diagnostics:
            diagnostics.setdefault(_whoever_includes(diagnostic), diagnostic)
        for warning, allowance in checked_deck.allowed:
            allowed.setdefault(_whoever_includes(warning), (warning, allowance.because))
        sources |= checked_deck.sources
    complain(
        tuple(diagnostics.values()),
        sources,
        form=form,
        allowed=[diagnostic for key, diagnostic in allowed.items() if key not in diagnostics],
        titles=titles() if form == "sarif" else None,
    )


def _whoever_includes(part: object) -> object:
    """The words of a message and its place, without the files that include its file: equal ones are the same mistake,
    found by way of two decks."""
    if isinstance(part, tuple):
        return tuple(map(_whoever_includes, part))
    if is_dataclass(part):
        names = (field.name for field in fields(part) if field.name not in ("included", "used"))
        return tuple(_whoever_includes(getattr(part, name)) for name in names)
    return part


@click.command()
@DECK
@click.argument("names", nargs=-1, metavar="[NAME]...")
@click.option("--all", "everything", is_flag=True, help="All runs and sweeps of the deck.")
@click.option("-o", "output", metavar="FILE", help="Write the plan to this file (JSON), which `met run FILE` runs.")
@deck_options
@format_option
@loudness_options
def plan(
    deck: str,
    names: tuple[str, ...],
    everything: bool,
    output: str | None,
    defines: tuple[str, ...],
    include_dirs: tuple[str, ...],
    settings: tuple[str, ...],
    form: str,
    quiet: bool,
    verbose: bool,
) -> None:
    """Show what a deck means, and write its plan.

    The output has the arm as a tree, rates and steps, channels, cases and sizes, of the runs and sweeps NAME, or else
    of the only one or the default.
    """
    from met.plan import file as plan_file

    check_options(deck, names, everything, defines, include_dirs, settings)
    if output is not None and not output.endswith(".json"):
        helps = "`met run` knows a plan by its ending, and takes any other file for a deck"
        raise Problem(error("E300", f"cannot write {output}: a plan's name ends in .json", help=helps))
    whole_plan = _plan(deck, include_dirs, defines, settings, names, everything, quiet)
    if not whole_plan.experiments:
        raise Problem(error("D161", "this deck has no run", help="write `run NAME { ... }`"))
    if output is not None:
        plan_file.write(whole_plan, output)
        if not quiet and form == "text":
            with kept(f"{output} is whole"):
                say(f"wrote {output}")
    elif form == "json":
        say(plan_file.dumps(whole_plan), end="", exact=True)
    elif not quiet:
        from ic.printing.plan import print_plan

        _print(print_plan(whole_plan, verbose=verbose))


@click.command()
@DECK
@click.argument("names", nargs=-1, metavar="[SWEEP]...")
@click.option("--all", "everything", is_flag=True, help="Print every row, however many there are.")
@deck_options
@format_option
@loudness_options
def cases(
    deck: str,
    names: tuple[str, ...],
    everything: bool,
    defines: tuple[str, ...],
    include_dirs: tuple[str, ...],
    settings: tuple[str, ...],
    form: str,
    quiet: bool,
    verbose: bool,
) -> None:
    """List the cases of a sweep: position, id and varied values.

    Without SWEEP, the cases of all sweeps of the deck are listed. `met run --case` takes a position (`#3`) or the
    beginning of an id.
    """
    from ic.printing.cases import cases_json, print_cases

    check_options(deck, defines=defines, include_dirs=include_dirs, settings=settings)
    whole_plan = _plan(deck, include_dirs, defines, settings, names, not names, True)
    sweeps = [e for e in whole_plan.experiments if names or e.varies] or list(whole_plan.experiments)
    by_sweep = [list(groups) for _, groups in groupby(sweeps, lambda experiment: experiment.name_in_deck)]
    if form == "json":
        _print_json([cases_json(groups) for groups in by_sweep])
        return
    for position, groups in enumerate(by_sweep):
        if position:
            click.echo()
        _print(print_cases(groups, everything=everything))


@click.command()
@DECK
@click.argument("path", required=False)
@click.option("--run", "name", metavar="NAME", help="The run or sweep to look in, if it is not the default one.")
@click.option("--scales", is_flag=True, help="Show numbers of the run as multiples of others, with what is usual.")
@click.option("--assumptions", is_flag=True, help="Show what the run leaves out or holds, and how much that is.")
@deck_options
@format_option
@loudness_options
def explain(
    deck: str,
    path: str | None,
    name: str | None,
    scales: bool,
    assumptions: bool,
    defines: tuple[str, ...],
    include_dirs: tuple[str, ...],
    settings: tuple[str, ...],
    form: str,
    quiet: bool,
    verbose: bool,
) -> None:
    """Show where a value comes from: the line that wrote it, and the values that it replaced.

    PATH is a parameter (elbow.servo.kt), the beginning of several (elbow.servo), one of a definition (gearbox.kp), or a
    setting of the run (rates.dynamics). Without PATH, `--scales` shows what the run's numbers are beside one another,
    and `--assumptions` what it leaves out.
    """
    from ic.printing.explain import Sources, explained_json, print_explained
    from ic.printing.reviewing import assumptions_json, print_assumptions, print_scales, scales_json

    check_options(deck, defines=defines, include_dirs=include_dirs, settings=settings)
    if [path is not None, scales, assumptions].count(True) != 1:
        raise click.UsageError("write a PATH, or one of `--scales` and `--assumptions` without one")
    names = (name,) if name else ()
    if path is None:
        if deck.endswith(".json"):
            raise click.UsageError("`--scales` and `--assumptions` are of a deck; this is a plan")
        compiled = _compiled(deck, include_dirs, defines, settings, names or None)
        if form == "json":
            _print_json(scales_json(compiled) if scales else assumptions_json(compiled))
        else:
            _print(print_scales(compiled) if scales else print_assumptions(compiled))
        return
    if deck.endswith(".json"):
        sources: Sources = [lambda: (_plan_in_file(deck, names), None)]
    else:  # a path that only another run of the deck has is explained for that one
        selections: list[Any] = [names] if names else [None, "all"]
        sources = [partial(_source, deck, include_dirs, defines, settings, selection) for selection in selections]
    if form == "json":
        _print_json(explained_json(sources, path))
    else:
        _print(print_explained(sources, path))


@click.command()
@click.argument("words", nargs=-1, metavar="[KIND] [MODEL]")
@format_option
def doc(words: tuple[str, ...], form: str) -> None:
    """Show the models, and everything that each of them declares.

    KIND is a kind of model, such as `servo`; MODEL is the name of one model. Other words are the blocks of a deck, as
    in `met doc run`; the signals that can be recorded, `met doc channels`; further subjects, which `met doc` lists;
    the code of a message, as in `met doc D060`; any word of a deck, such as `like`, `allow` or `kp`; and a word of the
    glossary, such as `shard`. `met doc language --format json` prints all of it for programs.
    """
    from ic.printing.page import in_json, in_terminal, separated, terminal_width
    from ic.printing.requests import requested_pages

    if len(words) > 2:
        raise click.UsageError("at most a kind and a model")
    pages = requested_pages(words)
    if form == "text":
        _print_text(separated(in_terminal(page, terminal_width()) for page in pages))
    elif any(page.records for page in pages):
        _print_json(in_json(pages))
    else:
        raise click.UsageError(f"what `{words[0]}` means is text: it has no --format")


@click.command()
@click.argument("stage")
@DECK
@click.argument("names", nargs=-1, metavar="[NAME]...")
@deck_options
def dump(
    stage: str,
    deck: str,
    names: tuple[str, ...],
    defines: tuple[str, ...],
    include_dirs: tuple[str, ...],
    settings: tuple[str, ...],
) -> None:
    """Show the output of one stage on the way from a deck to machine code.

    STAGE is tokens, syntax, model, plan, program or kernel.
    """
    from ic.printing.dump import WRITTEN, DumpRequest, find_stage

    check_options(deck, settings=settings)
    print_stage = find_stage(stage)
    if settings and stage in WRITTEN:
        message = f"`met dump {stage}` shows what the deck says; `met dump plan`, what --set and --vary make of it"
        raise click.UsageError(message)
    _print(print_stage(DumpRequest(deck, include_dirs, defines, names or None, settings)))


def _plan(
    deck: str,
    include_dirs: tuple[str, ...],
    defines: tuple[str, ...],
    settings: tuple[str, ...],
    names: tuple[str, ...],
    everything: bool,
    quiet: bool,
) -> Plan:
    """The plan of a deck, or of a plan file; its warnings are printed on the way."""
    if deck.endswith(".json"):
        return _plan_in_file(deck, names)
    compiled = _compiled(deck, include_dirs, defines, settings, "all" if everything else names or None)
    if compiled.diagnostics and not quiet:
        complain(compiled.diagnostics, compiled.sources)
    assert compiled.plan is not None
    return compiled.plan


def _compiled(
    deck: str,
    include_dirs: tuple[str, ...],
    defines: tuple[str, ...],
    settings: tuple[str, ...],
    select: tuple[str, ...] | Literal["all"] | None,
) -> Compiled:
    """A deck with its plan. Raises Problem where there is none."""
    import ic
    from ic.find import find

    find(deck, include_dirs)
    compiled = ic.check(deck, include_dirs=include_dirs, defines=defines, **settings_of(settings), select=select)
    if compiled.plan is None:
        raise Problem(compiled.diagnostics, compiled.sources)
    return compiled


def _source(
    deck: str, include_dirs: tuple[str, ...], defines: tuple[str, ...], settings: tuple[str, ...], select: Any
) -> tuple[Plan, Compiled]:
    """A deck's plan, and the compiled deck that it is from. Raises Problem."""
    compiled = _compiled(deck, include_dirs, defines, settings, select)
    assert compiled.plan is not None
    return compiled.plan, compiled


def _plan_in_file(path: str, names: tuple[str, ...]) -> Plan:
    """The plan of a plan file, with only the runs and sweeps of these names. Raises Problem D174 for a name that is not
    in it."""
    from dataclasses import replace

    from ic.text.complaints import known_words
    from met.diagnostic import error
    from met.plan import file as plan_file

    whole_plan = plan_file.read(path)
    known = {experiment.name: experiment for experiment in whole_plan.experiments}
    for name in names:
        if name not in known:
            helps = [*did_you_mean(name, known), known_words("it has", known)]
            raise Problem(error("D174", f"no run or sweep `{name}` in this plan", help=helps))
    return replace(whole_plan, experiments=tuple(known[name] for name in names)) if names else whole_plan


def _print(lines: Iterable[str]) -> None:
    for line in lines:
        say(line)


def _print_text(lines: Iterable[str]) -> None:
    """Print lines of text, filled to the width of a terminal."""
    from ic.printing.page import fitted, terminal_width

    _print(fitted(lines, width=terminal_width()))


def _print_json(value: object) -> None:
    import json

    click.echo(json.dumps(_spelled(value), indent=1, allow_nan=False))


def _spelled(value: object) -> object:
    """The value with words for numbers that JSON does not have, as in plan files: "inf", "nan"."""
    if isinstance(value, Mapping):
        return {key: _spelled(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_spelled(part) for part in value]
    return repr(value) if isinstance(value, float) and not math.isfinite(value) else value
