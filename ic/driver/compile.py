"""Compilation of a deck to a plan: the requested runs and sweeps, each as an experiment."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Literal

from ic.grammar.settings import command_line, read_settings
from ic.grammar.syntax import Deck, Setting
from ic.grammar.uses import with_full_names
from ic.language import EXPERIMENTS
from ic.meaning.checks.slips import macros_taken_apart, remark_degrees, skipped_elements
from ic.meaning.control.servos import check_servo_definition
from ic.meaning.control.unused_servos import check_on_a_joint, servos_in_use
from ic.meaning.definitions.resolve import Definition, Definitions
from ic.meaning.definitions.row_tables import is_row_table
from ic.meaning.definitions.unused_params import misspelt_params
from ic.meaning.mechanics.arm import check_arm, resolve_arm
from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.allowances import allowed_warnings, silence_of_all, warn_of_unneeded
from ic.read import in_order, read, read_again
from ic.sweeps.effects import Effects
from ic.sweeps.files import command_line_sweep
from ic.sweeps.groups import DeckSource, ScopedExperiment, experiments_of
from ic.sweeps.settings import Settings, check_params
from ic.text.complaints import Complaints, known_words
from ic.text.edition import FIRST
from ic.text.files import NOTHING_UNSAVED, Unsaved
from ic.text.lexer import COMMAND_LINE
from met.analysis.memo import AnalysisMemo
from met.diagnostic import Diagnostic, Label, Problem, did_you_mean, error
from met.frozen import frozen
from met.plan import Allowance, Experiment, Plan
from met.plan import Source as File
from met.units import Measure

Select = Sequence[str] | Literal["all"] | None

TOO_DEEP = error("D078", "this deck's values are nested too deeply", help="build them up in steps, with `let`")


@frozen
class Compiled:
    """A plan, None where an error stands in its way; all diagnostics, warnings too; every file's text by name.

    allowed  the warnings that are not among the diagnostics, since a run allows them, each with the allowing entry
    units    those that the deck declares
    """

    plan: Plan | None
    diagnostics: tuple[Diagnostic, ...]
    sources: Mapping[str, str] = field(default_factory=dict)
    scopes: tuple[Scope, ...] = field(default=(), repr=False)  # one for each experiment, for `explain`
    allowed: tuple[tuple[Diagnostic, Allowance], ...] = ()
    units: Mapping[str, Measure] = field(default_factory=dict)


def check(
    path: str | PathLike[str],
    *,
    include_dirs: Sequence[str | PathLike[str]],
    defines: Sequence[str],
    select: Select,
    settings: Sequence[str] = (),
    text: str | None = None,
    unsaved: Unsaved = NOTHING_UNSAVED,
    memo: AnalysisMemo | None = None,
) -> Compiled:
    """The deck at `path`, or of this text, compiled.

    unsaved  texts in place of what files hold, by real paths
    memo     answers of the analysis that are known, to which those are added that are found
    """
    try:
        folders = [Path(include_dir) for include_dir in include_dirs]
        deck = read(Path(path), folders, defines, despite_errors=True, text=text, unsaved=unsaved)
    except Problem as problem:
        return Compiled(None, problem.diagnostics, problem.sources)
    return compile_deck(deck, select=select, defines=defines, settings=settings, memo=memo)


_NO_NAME = ("`met check` takes no name: `met cases DECK NAME --vary ...` does, and says what is wrong",)


def compile_deck(
    deck: Deck,
    *,
    select: Select = None,
    defines: Iterable[str] = (),
    settings: Sequence[str] = (),
    complaints: Complaints | None = None,
    memo: AnalysisMemo | None = None,
) -> Compiled:
    """The plan of the deck's runs and sweeps that `select` names, with everything that is wrong on the way.

    settings  `PATH=VALUE`, each as if the deck said so; `vary PATH=VALUES`, as if it had a sweep of the run that
              `select` names
    memo      answers of the analysis that are known; those that are found are added
    """
    defines = tuple(defines)
    complaints = complaints if complaints is not None else Complaints(deck.warnings)
    complaints.note_unreadable(deck.unreadable)
    deck, entries = _with_settings(deck, settings, complaints)
    definitions = Definitions(deck, complaints)
    varied = tuple(entry for entry in entries if entry.words)
    overrides = Settings(tuple(entry for entry in entries if not entry.words))
    written = definitions
    selected = (select,) if isinstance(select, str) else tuple(dict.fromkeys(select or ()))
    sweep: Definition | None = None
    if varied:
        try:
            names = None if select == "all" else select
            among = EXPERIMENTS if names is not None else ("run",)
            chosen = asked_definitions(written, complaints, names, among, help=_NO_NAME if select == "all" else ())
            sweep = command_line_sweep(written, chosen, varied)
        except Problem as problem:
            complaints.add(*problem.diagnostics)
        else:
            definitions = definitions.replacing(sweep)
            select = "all" if select == "all" else (sweep.name,)
            selected = (select,) if isinstance(select, str) else select
    definitions = overrides.in_definitions(definitions)
    memo = memo if memo is not None else AnalysisMemo()
    source = DeckSource(
        definitions, complaints, partial(read_again, deck), overrides, Effects(overrides), sweep, memo=memo
    )
    requested: list[Definition] = []
    experiments: list[Experiment] = []
    scopes: list[Scope] = []
    try:
        check_params(written, complaints)
        overrides.check_lets(written, complaints)
        check_names(deck, definitions, complaints)
        requested = asked_definitions(definitions, complaints, select)
        for definition in requested:
            groups: list[ScopedExperiment] = []
            with complaints.gather():
                groups = experiments_of(source, definition)
            source.effects.complete &= bool(groups)
            experiments += (experiment for experiment, _ in groups)
            scopes += (scope for _, scope in groups)
        if not varied and len(requested) == 1 and requested[0] is _own_choice(definitions):
            selected = ()  # as where no name is given
        source.effects.report(complaints, [definition.name for definition in requested])
        loaded = definitions.have_payloads()
        for arm in definitions.of_kind("arm").values():  # with a payload its joints may move a mass
            (resolve_arm if loaded else check_arm)(Scope(definitions, complaints), arm)
        used = servos_in_use(definitions)
        for name in definitions.of_kind("servo"):
            with complaints.gather():
                before = complaints.error_count
                check_servo_definition(Scope(definitions, complaints), name)
                if name not in used and not settings and complaints.error_count == before:
                    check_on_a_joint(Scope(definitions, complaints), name)
    except RecursionError:
        complaints.add(TOO_DEEP)
    except Problem as problem:
        complaints.add(*problem.diagnostics)
    complaints.settle()
    sources = (*deck.sources, *definitions.csv_files.sources, *definitions.robot_files.sources)
    texts = {source.name: source.text for source in sources}
    if not complaints.errors:
        complaints.admit_remarks()
        silence_of_all([experiment.allowances for experiment in experiments], complaints)
        for look in (misspelt_params, skipped_elements, macros_taken_apart):
            complaints.add(*look(deck.entries))
        if select == "all":
            _remark_unused_rows(definitions, scopes, complaints)
        if not settings and not defines:  # which make another deck of it
            warn_of_unneeded(definitions, requested, experiments, complaints)
    else:
        return Compiled(None, in_order(complaints.all, sources), texts)
    decks = {source.name: source.edition for source in deck.sources if source.name != COMMAND_LINE}
    files = tuple(
        File(source_file.name, source_file.text, source_file.sha256, decks.get(source_file.name, FIRST))
        for source_file in sources
    )
    return Compiled(
        Plan(deck.file, tuple(experiments), files, tuple(defines), selected, tuple(settings)),
        in_order(complaints.all, sources),
        texts,
        tuple(scopes),
        allowed_warnings(experiments, complaints),
        deck.units,
    )


def check_names(deck: Deck, definitions: Definitions, complaints: Complaints) -> None:
    """Check what belongs to no single definition: the deck's `let`s, its angles, and the merging of definitions."""
    for problem in Scope(definitions, complaints).names.check_lets():
        complaints.add(*problem.diagnostics)
    remark_degrees(deck, definitions, complaints)
    for kind in ("arm", "servo", "run"):
        for definition in definitions.of_kind(kind).values():
            definitions.block(definition)


def _remark_unused_rows(definitions: Definitions, scopes: Iterable[Scope], complaints: Complaints) -> None:
    """Warn about rows of tables that no run uses, in tables whose deck says that all should be used."""
    used = {path for scope in scopes for path in scope.names.cells}
    for name, let in definitions.lets.items():
        unused = definitions.row_table(let.value).unused(name, used) if is_row_table(let.value) else None
        if unused is not None:
            complaints.add(unused)


def _with_settings(deck: Deck, settings: Sequence[str], complaints: Complaints) -> tuple[Deck, tuple[Setting, ...]]:
    """The deck with the text of its settings among its sources, and their entries; wrong ones are reported."""
    if not settings:
        return deck, ()
    before = "".join(source.text for source in deck.sources if source.name == COMMAND_LINE)
    files = (source for source in deck.sources if source.name != COMMAND_LINE)
    deck = replace(deck, sources=(*files, command_line(settings, before)))
    with complaints.gather():
        read_entries = read_settings(settings, before, edition=deck.edition, units=deck.units)
        return deck, tuple(entry for entry in with_full_names(read_entries, deck.roofs) if isinstance(entry, Setting))
    return deck, ()


def _own_choice(definitions: Definitions, kinds: Collection[str] = EXPERIMENTS) -> Definition | None:
    """The run or sweep that a deck itself chooses: its only one, or the one marked `default`; None where it has
    several."""
    known = [definition for kind in kinds for definition in definitions.of_kind(kind).values()]
    own = [definition for definition in known if definitions.writes(definition)]
    default = definitions.default() if not own or any(definition.default for definition in own) else None
    if default is not None and default.kind in kinds:
        return default
    known = own or known
    return known[0] if len(known) == 1 else None


def asked_definitions(
    definitions: Definitions,
    complaints: Complaints,
    select: Select,
    kinds: Collection[str] = EXPERIMENTS,
    *,
    help: Sequence[str] = (),
) -> list[Definition]:
    """The runs and sweeps that are asked for: by name, all, or the deck's only one, or the one marked `default`.

    kinds  those among which it is chosen where no name is given
    help   what to write besides where that cannot be said

    A deck's own come before those of files that it includes, whatever these mark.
    """
    known = {d.name: d for kind in kinds for d in definitions.of_kind(kind).values()}
    if select == "all":
        return list(known.values())
    if select is not None:
        names = [select] if isinstance(select, str) else list(dict.fromkeys(select))
        for name in names:
            if name not in known:
                complaints.error(
                    "D164",
                    f"no run or sweep `{name}` in this deck",
                    help=definitions.stays_away(name) or [*did_you_mean(name, known), known_words("it has", known)],
                )
        return [known[name] for name in names if name in known]
    if (chosen := _own_choice(definitions, kinds)) is not None:
        return [chosen]
    known = {name: definition for name, definition in known.items() if definitions.writes(definition)} or known
    if complaints.errors and not known:
        return []
    if not known:
        raise Problem(error("D161", "this deck has no run", help="write `run NAME { ... }`"))
    none = (
        "several included files mark a `default`"
        if any(d.default for d in known.values())
        else "none is marked `default`"
    )
    raise Problem(
        error(
            "D162",
            f"this deck has {len(known)} {'runs and sweeps' if 'sweep' in kinds else 'runs'}, and {none}",
            also=[Label(d.place, d.name) for d in known.values()],
            help=[known_words("name one", known), "or write `default run ...` for one of them", *help],
        )
    )
