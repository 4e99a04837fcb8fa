"""Warnings that a run allows: `allow D105 because "the report's own rates";`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ic.grammar.places import place_of
from ic.grammar.syntax import Entry, Name, Statement, String
from ic.text.codes import is_on_the_page
from ic.text.complaints import Complaints
from met.diagnostic import Label, Place, did_you_mean
from met.messages.warning_codes import WARNINGS, WHILE_RUNNING
from met.plan import Allowance, Experiment

ALLOW = "allow"


def read_allowances(*entries: Iterable[Entry], complaints: Complaints) -> tuple[Allowance, ...]:
    """What the statements of a run, and then of a sweep of it, allow; reports each that is wrong, or there twice."""
    found: dict[str, Allowance] = {}
    for entry in (entry for each in entries for entry in each):
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
        elif (first := found.get(words[0].text)) is not None and first.place is not None:
            complaints.error(
                "D332",
                f"`{first.code}` is allowed twice",
                Label(words[0].place, "again"),
                also=[Label(first.place, "first")],
                help="leave one of the two out",
            )
        else:
            found[words[0].text] = Allowance(words[0].text, value.value, words[0].place)
    return tuple(found.values())


def places_of(allowances: Iterable[Allowance]) -> Mapping[str, Place]:
    """The place of each by its code, as `Complaints.allowing` takes them."""
    return {each.code: each.place for each in allowances if each.place is not None}


def silence_of_all(experiments: Sequence[Experiment], complaints: Complaints) -> None:
    """Leave out the warnings that are of no single run, such as of a macro, and that all experiments allow; then warn
    of each `allow` that no experiment needed."""
    everywhere = [
        each for each in WARNINGS if experiments and all(experiment.allows(each) for experiment in experiments)
    ]
    places: dict[str, dict[Place, None]] = {}
    for allowance in (each for experiment in experiments for each in experiment.allowances):
        if allowance.place is not None:
            places.setdefault(allowance.code, {})[allowance.place] = None
    complaints.silence({code: places.get(code, {}) for code in everywhere})
    for code, each in places.items():
        for place in each:
            if place not in complaints.needed_allowances and code not in WHILE_RUNNING:
                complaints.warn(
                    "D333",
                    f"`allow {code}` silences nothing here",
                    place,
                    help="leave it out: no such warning is given",
                )


def _refuse(code: str, place: Place, complaints: Complaints) -> None:
    if is_on_the_page(code):
        complaints.error(
            "D331",
            f"`{code}` is an error, and no error is allowed",
            place,
            help=f"mend what it says, and leave this out: `met doc {code}`",
        )
        return
    complaints.error(
        "D331",
        f"no warning has the code `{code}`",
        place,
        help=[*did_you_mean(code, sorted(WARNINGS)), "a code is printed with its warning, as in `warning[D105]`"],
    )
