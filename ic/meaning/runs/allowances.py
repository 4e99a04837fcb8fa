"""Warnings that a run allows: `allow D105 because "the report's own rates";`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ic.grammar.syntax import Entry, Name, Statement, String, place_of
from ic.language import OF_A_RUN
from ic.meaning.definitions.resolve import Definition, Definitions
from ic.text.complaints import Complaints
from met.diagnostic import Diagnostic, Label, Place, did_you_mean, leave_out
from met.messages.warning_codes import WARNINGS, WHILE_RUNNING
from met.plan import Allowance, Experiment

ALLOW = "allow"


def allowances_of(
    definitions: Definitions, run: Definition, complaints: Complaints, sweep: Definition | None = None
) -> tuple[Allowance, ...]:
    """The allowances of a run, or of a sweep of it: its own reason replaces that of its base."""
    runs = definitions.of_kind("run")
    bodies = [runs[name].group.body for name in definitions.homes(run)[:-1]]
    bodies += [run.group.body, *([sweep.group.body] if sweep is not None else [])]
    allowances: dict[str, Allowance] = {}
    for body in bodies:
        allowances |= _read(body, complaints)
    return tuple(allowances.values())


def _read(body: Iterable[Entry], complaints: Complaints) -> dict[str, Allowance]:
    """The allowances in the statements of one block, by code; wrong ones and duplicates are reported."""
    allowances: dict[str, Allowance] = {}
    for entry in body:
        if not isinstance(entry, Statement) or entry.words[0].text != ALLOW:
            continue
        words, value = entry.words[1:], entry.value
        if len(words) != 2 or words[1].text != "because" or not isinstance(value, String) or not value.value.strip():
            code = words[0].text if words else value.text if isinstance(value, Name) else "CODE"
            complaints.error(
                "D330",
                "an `allow` names a warning and says why",
                words[0].place if words else place_of(value),
                help=f'write `allow {code} because "REASON";`',
            )
        elif words[0].text not in WARNINGS:
            _refuse(words[0].text, words[0].place, complaints)
        elif (first := allowances.get(words[0].text)) is not None and first.place is not None:
            complaints.error(
                "D332",
                f"`{first.code}` is allowed twice",
                Label(words[0].place, "again"),
                also=[Label(first.place, "first")],
                help=leave_out("leave one of the two out"),
            )
        else:
            allowances[words[0].text] = Allowance(words[0].text, " ".join(value.value.split()), words[0].place)
    return allowances


def places_of(allowances: Iterable[Allowance]) -> Mapping[str, Place]:
    """The place of each by its code, as `Complaints.allowing` takes them."""
    return {allowance.code: allowance.place for allowance in allowances if allowance.place is not None}


def silence_of_all(allowances: Sequence[tuple[Allowance, ...]], complaints: Complaints) -> None:
    """Leave out warnings that belong to no single run, such as about a macro, if all experiments allow them.

    allowances  of each experiment
    """
    if not all(allowances):
        return
    codes = [{allowance.code for allowance in of_one} for of_one in allowances]
    places: dict[str, list[Place]] = {}
    for allowance in (allowance for of_one in allowances for allowance in of_one):
        if allowance.place is not None and all(allowance.code in of_one for of_one in codes):
            places.setdefault(allowance.code, []).append(allowance.place)
    complaints.silence(places)


def allowed_warnings(
    experiments: Iterable[Experiment], complaints: Complaints
) -> tuple[tuple[Diagnostic, Allowance], ...]:
    """The suppressed warnings, each with its allowance."""
    by_place = {allowance.place: allowance for experiment in experiments for allowance in experiment.allowances}
    return tuple((warning, by_place[place]) for warning, place in complaints.allowed.items() if place in by_place)


def warn_of_unneeded(
    definitions: Definitions, checked: Iterable[Definition], experiments: Iterable[Experiment], complaints: Complaints
) -> None:
    """Warn about each `allow` that silenced nothing, where that is certain: the deck itself writes it, no included
    file, and every run and sweep for which it holds was checked, including those that inherit it."""
    unneeded = {
        allowance.place: allowance.code
        for experiment in experiments
        for allowance in experiment.allowances
        if allowance.place is not None
        and allowance.place not in complaints.needed_allowances
        and allowance.code not in WHILE_RUNNING
        and definitions.writes_at(allowance.place)
    }
    if not unneeded:
        return
    runs = definitions.of_kind("run")
    names = _with_parts(definitions, checked)
    for definition in definitions.experiments.values():
        sweep = definition if definition.kind in OF_A_RUN else None
        run = definition if sweep is None else runs.get(definition.run_name)
        if definition.name not in names and run is not None:
            elsewhere = {allowance.place for allowance in allowances_of(definitions, run, Complaints(), sweep)}
            unneeded = {place: code for place, code in unneeded.items() if place not in elsewhere}
    for place, code in unneeded.items():
        complaints.warn(
            "D333",
            f"`allow {code}` silences nothing here",
            place,
            help=leave_out("leave it out: no such warning is given"),
        )


def _with_parts(definitions: Definitions, checked: Iterable[Definition]) -> set[str]:
    """The names of these runs and sweeps, including their parts."""
    names, known, waiting = set[str](), definitions.experiments, list(checked)
    while waiting:
        definition = waiting.pop()
        if definition.name not in names:
            names.add(definition.name)
            waiting += (known[part.text] for part in definition.parts if part.text in known)
    return names


def _refuse(code: str, place: Place, complaints: Complaints) -> None:
    """Report an `allow` of a code that is no warning of a run (D331)."""
    from ic.text.codes import is_on_the_page

    if is_on_the_page(code):
        complaints.error(
            "D331",
            f"`{code}` is no warning of a run, and nothing else is allowed",
            place,
            help=leave_out(f"mend what it says, and leave this out: `met doc {code}`"),
        )
        return
    complaints.error(
        "D331",
        f"no warning has the code `{code}`",
        place,
        help=[*did_you_mean(code, sorted(WARNINGS)), "a code is printed with its warning, as in `warning[D105]`"],
    )
