"""A collector of diagnostics: a deck's mistakes are reported together, so that none hides the next."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import replace

from ic.text.source import UnreadableStretch
from met.diagnostic import Diagnostic, Expansion, Label, Place, Problem, error, meant
from met.frozen import frozen

MOST_DIAGNOSTICS = 200  # diagnostics of one deck; any after these seldom say more

REPORTED_ONCE = ("D060", "D061", "D076", "D077", "D087", "D104", "D109", "D125", "D141", "D305", "D307")
"""Codes that are reported once for each place: a bare number, a wrong unit, no such word, out of range, no body's
inertia, a rate too slow, no entry of a run, no channel, no such key, a unit that may mean cycles, a share above 1."""


REMARKED_ONCE = ("D317", "D318", "D319", "D320", "D322", "D335")
"""Codes of warnings that are given once at a place: of a rate or a servo that several runs and sweeps share."""


PROVISIONAL = ("D104", "D105", "D249")
"""Codes of a servo's or sensor's own step warnings, which wait for those of the whole arm's step."""


MOST_ITERATIONS_SHOWN = 4
"""Number of further iterations of a loop that are named beside a mistake in the first."""


MOST_ROOFS_SHOWN = 4
"""Number of further uses of a file that are named beside a mistake in it."""


UNKNOWN_WORDS = ("D044", "D045", "D082", "D108", "D136", "D157")
"""Codes of messages about unknown words of the language, which no deck defines."""


MAY_FOLLOW = ("D114", "D125", "D132", "D144", "D362", "D375", "D376")
"""Codes of messages that a run has no joint, initial value, channel, metric or linear answer of a name, which an error
in what would define it may bring about."""


_BEFORE = error("", "an error outside of the definition")


@frozen
class DefinitionFindings:
    """All that a check of one definition by itself has found: what `Complaints.apart` collects, and `take` takes over.

    diagnostics  in the order found; remarks: warnings that say something only where there are no errors
    lacking      by those that say what a definition lacks: the definition, and the entry
    missing      definitions, and entries that they are known to lack
    of_no_run    those that no run is to blame for
    silenced     warnings that are allowed, each with the place of the `allow`; needed: the places of each that was
    iterations   iterations of loops that made the same mistake as the first of them
    """

    diagnostics: tuple[Diagnostic, ...]
    remarks: tuple[Diagnostic, ...]
    lacking: Mapping[Diagnostic, tuple[Place, str]]
    missing: frozenset[tuple[Place, str]]
    of_no_run: frozenset[Diagnostic]
    silenced: Mapping[Diagnostic, Place]
    needed: frozenset[Place]
    iterations: Mapping[object, tuple[tuple[Expansion, ...], ...]]


class Complaints:
    """Diagnostics in the order found, each once."""

    def __init__(self, findings: Iterable[Diagnostic] = ()) -> None:
        """findings: diagnostics of an earlier stage, which belong to no run"""
        self._diagnostics: dict[Diagnostic, None] = dict.fromkeys(findings)
        self._remarks: dict[Diagnostic, None] = {}
        self._provisional: list[Diagnostic] = []
        self.error_count = (
            0  # errors so far, those that are not reported again included: to see whether a step found one
        )
        self._unreadable: list[UnreadableStretch] = []
        self._torn: set[Place] = set()  # definitions and blocks of which an entry could not be read
        self._lost: set[str] = set()  # names that what could not be read may have defined
        self._spots: set[tuple[str, int, int]] = set()  # where errors of syntax are reported
        self.known_missing: set[tuple[Place, str]] = set()  # definitions, and entries that they lack, already reported
        self._allowed: Mapping[str, Place] | None = None  # codes that the run at hand allows; None outside of runs
        self._silenced: dict[Diagnostic, Place] = {}
        self._of_no_run: set[Diagnostic] = set(self._diagnostics)
        # of each mistake in a loop's body the iterations that make it
        self._iterations: dict[object, dict[tuple[Expansion, ...], None]] = {}
        self.needed_allowances: set[Place] = set()  # the places of each `allow` that silenced a warning
        self._lacking: dict[Diagnostic, tuple[Place, str]] = {}

    @property
    def is_clear(self) -> bool:
        """True where nothing was found or noted."""
        return not (self._diagnostics or self._remarks or self._provisional or self.known_missing or self.error_count)

    def copied(self) -> Complaints:
        """A copy with the same findings, to which others can be added."""
        complaints = copy(self)
        for name, value in vars(self).items():
            if isinstance(value, dict | set | list):
                setattr(complaints, name, copy(value))
        complaints._iterations = {mistake: dict(iterations) for mistake, iterations in self._iterations.items()}
        return complaints

    def apart(self) -> Complaints:
        """A collector for one definition alone, which knows only `known_before` of the present findings."""
        complaints = Complaints([_BEFORE] if self.errors else [])
        complaints._torn, complaints._lost = set(self._torn), set(self._lost)
        complaints.known_missing = set(self.known_missing)
        return complaints

    @property
    def known_before(self) -> tuple[object, ...]:
        """Everything on which the findings of an `apart` collector depend: if it is equal, they are equal."""
        sets = (frozenset(group) for group in (self._torn, self._lost, self.known_missing))
        return (bool(self.errors), *sets)

    def findings(self) -> DefinitionFindings:
        """All that this collector, which must be an `apart` one, has found of one definition: to be kept, and brought
        into another check by `take`."""
        return DefinitionFindings(
            tuple(diagnostic for diagnostic in self._diagnostics if diagnostic != _BEFORE),
            tuple(self._remarks),
            dict(self._lacking),
            frozenset(self.known_missing),
            frozenset(self._of_no_run),
            dict(self._silenced),
            frozenset(self.needed_allowances),
            {mistake: tuple(iterations) for mistake, iterations in self._iterations.items()},
        )

    def take(self, findings: DefinitionFindings) -> None:
        """Take over findings of an `apart` collector, except those known here already."""
        before = self._allowed
        for diagnostic in (*findings.diagnostics, *findings.remarks):  # without those that the definition allows
            self._allowed = None if diagnostic in findings.of_no_run else {}
            if diagnostic in findings.remarks:
                self._note_remark(diagnostic)
            elif findings.lacking.get(diagnostic) not in self.known_missing:
                self.add(diagnostic)
        self._allowed = before
        for mistake, iterations in findings.iterations.items():
            self._iterations.setdefault(mistake, {}).update(dict.fromkeys(iterations))
        for diagnostic, place in findings.silenced.items():
            self._silenced.setdefault(diagnostic, place)
        self.known_missing |= findings.missing
        self.needed_allowances |= findings.needed

    @property
    def all(self) -> tuple[Diagnostic, ...]:
        """All findings; of a mistake in several iterations of a loop, or under several roofs of a file, only the first,
        which names the others."""
        return tuple(once_for_all_roofs(map(self._with_iterations, self._without_guesses())))

    def _without_guesses(self) -> Iterator[Diagnostic]:
        """All findings; those that may follow from an error of another kind without a guess of what was meant, which
        would change what a sound entry means."""
        others = any(
            diagnostic.severity == "error" and diagnostic.code not in MAY_FOLLOW for diagnostic in self._diagnostics
        )
        for diagnostic in self._diagnostics:
            plain = tuple(line for line in diagnostic.help if not getattr(line, "changes", ()))
            if others and diagnostic.code in MAY_FOLLOW and len(plain) < len(diagnostic.help):
                diagnostic = replace(
                    diagnostic, help=(*plain, "it may follow from another error here: mend that first")
                )
            yield diagnostic

    @property
    def errors(self) -> tuple[Diagnostic, ...]:
        return tuple(d for d in self._diagnostics if d.severity == "error")

    @property
    def warnings(self) -> tuple[Diagnostic, ...]:
        return tuple(d for d in self._diagnostics if d.severity == "warning")

    @property
    def allowed(self) -> Mapping[Diagnostic, Place]:
        """The allowed warnings wherever they were found, each with the place of an `allow`."""
        return {
            diagnostic: place for diagnostic, place in self._silenced.items() if diagnostic not in self._diagnostics
        }

    def add(self, *diagnostics: Diagnostic) -> None:
        for diagnostic in diagnostics:
            if diagnostic.severity != "warning" or not self._is_silenced(diagnostic):
                self._record(diagnostic)

    def _record(self, diagnostic: Diagnostic) -> None:
        """Add a diagnostic, unless the same mistake is known, or it only follows from an unreadable part."""
        self.error_count += diagnostic.severity == "error"
        if (
            not self.is_of_another_iteration(diagnostic)
            and len(self._diagnostics) < MOST_DIAGNOSTICS
            and not self._is_known_at_this_place(diagnostic)
            and not self._follows_from_unreadable(diagnostic)
        ):
            self._diagnostics.setdefault(diagnostic)

    def is_of_another_iteration(self, diagnostic: Diagnostic) -> bool:
        """Return True if an iteration of a loop made the same mistake in the same place before; this one is noted."""
        if diagnostic.at is None or not diagnostic.at.place.iterations:
            return False
        iterations = diagnostic.at.place.iterations
        known = self._iterations.setdefault(_mistake(diagnostic), {iterations: None})
        known[iterations] = None
        return next(iter(known)) != iterations

    def _with_iterations(self, diagnostic: Diagnostic) -> Diagnostic:
        """A diagnostic from inside a loop with a remark on the other iterations that have it too."""
        if not self._iterations or diagnostic.at is None or not diagnostic.at.place.iterations:
            return diagnostic
        others = tuple(self._iterations.get(_mistake(diagnostic), ()))[1:]
        if not others:
            return diagnostic
        loop = diagnostic.at.place.iterations[0]
        text = f"likewise in {len(others):,} other iteration{'s' * (len(others) > 1)}"
        if all(len(iterations) == 1 for iterations in others):
            listed = [iterations[0].iteration for iterations in others[:MOST_ITERATIONS_SHOWN]]
            more = f" and {len(others) - len(listed):,} more" * (len(others) > len(listed))
            text = f"likewise where {loop.macro} = {', '.join(listed)}{more}"
        return replace(diagnostic, also=(*diagnostic.also, Label(loop.use, text)))

    def note_unreadable(self, stretches: Sequence[UnreadableStretch]) -> None:
        """Note stretches that could not be read, so that errors that follow from them, or from the errors so far, are
        not reported."""
        self._spots.update(_spot(diagnostic.at.place) for diagnostic in self.errors if diagnostic.at is not None)
        self._unreadable += stretches
        self._torn.update(stretch.within for stretch in stretches if stretch.within is not None)
        self.note_lost_names(*(name for stretch in stretches for name in stretch.names))

    def note_lost_names(self, *names: str) -> None:
        """Note names that may be defined by something that could not be taken in, already reported."""
        self._lost.update(names)

    def is_lost(self, name: str) -> bool:
        """Return True if this name may be defined by something that could not be taken in."""
        return name in self._lost

    def note_base(self, definition: Place, base: Place) -> None:
        """Note that the definition at this place inherits its base's entries, and lacks those that the base lacks."""
        if base in self._torn:
            self._torn.add(definition)

    def _follows_from_unreadable(self, diagnostic: Diagnostic) -> bool:
        """Return True if this is about an unreadable stretch, or a name that it may have defined."""
        if diagnostic.code not in UNKNOWN_WORDS and diagnostic.message.startswith("no "):
            path = diagnostic.message.split("`")[1:2]
            if any(word in self._lost for text in path for word in text.split(".")):
                return True
        if diagnostic.at is None or not (self._unreadable or self._spots):
            return False
        file, line, column = _spot(diagnostic.at.place)
        return (file, line, column) in self._spots or any(
            stretch.place.file == file and (stretch.place.line, stretch.place.column) <= (line, column) < stretch.end
            for stretch in self._unreadable
        )

    def _is_known_at_this_place(self, diagnostic: Diagnostic) -> bool:
        """Return True if this mistake is reported here already: one in a base or a `let` is found at every use."""
        if diagnostic.at is None or diagnostic.code not in REPORTED_ONCE:
            return False
        return any(
            earlier.code == diagnostic.code and earlier.at is not None and earlier.at.place == diagnostic.at.place
            for earlier in self._diagnostics
        )

    def error(
        self,
        code: str,
        message: str,
        place: Label | Place | None = None,
        *,
        also: Iterable[Label] = (),
        help: Iterable[str] | str = (),
    ) -> None:
        """Add an error. One about the steps of a servo or sensor waits until the whole arm's step has been checked
        (`settle`)."""
        diagnostic = error(code, message, place, also=also, help=help)
        if code in PROVISIONAL:
            self._provisional.append(diagnostic)
        else:
            self.add(diagnostic)

    def settle(self, refuted: Collection[str] = ()) -> frozenset[str]:
        """Report provisional warnings, except those of these codes; returns the codes that were reported."""
        reported = [diagnostic for diagnostic in self._provisional if diagnostic.code not in refuted]
        self._provisional = []
        for diagnostic in reported:
            if diagnostic.severity == "error":
                self.add(diagnostic)
            else:
                self._note_remark(diagnostic)
        return frozenset(diagnostic.code for diagnostic in reported)

    def note_misspelling(self, definition: Place, word: str, known: Iterable[str]) -> None:
        """Note the entry for which an unknown one in the definition at this place may have been meant, so that it is
        not reported as missing."""
        near = meant(word, known)
        if near is not None:
            self.known_missing.add((definition, near.rpartition(".")[2]))

    def is_known_to_lack(self, definition: Place, *names: str) -> bool:
        """Return True if one of these entries of the definition at this place was reported as missing, another word was
        taken for it, or an entry there could not be read."""
        if definition in self._torn:
            return True
        return any((definition, name) in self.known_missing for name in names)

    def missing(
        self,
        definition: Place,
        names: tuple[str, ...],
        code: str,
        message: str,
        place: Place | None = None,
        *,
        also: Iterable[Label] = (),
        help: Iterable[str] | str = (),
    ) -> None:
        """Report an error about the definition at this place, which has none of these entries, unless that is known
        already."""
        if not self.is_known_to_lack(definition, *names):
            self.error(code, message, place or definition, also=also, help=help)

    def withdraw(self, code: str, place: Place) -> None:
        """Take back what was reported with this code at a place, where another message turns out to say why."""
        self._diagnostics = {
            diagnostic: None
            for diagnostic in self._diagnostics
            if (diagnostic.code, diagnostic.at and diagnostic.at.place) != (code, place)
        }

    def lack(
        self,
        definition: Place,
        name: str,
        code: str,
        message: str,
        place: Label | Place,
        *,
        also: Iterable[Label],
        help: Iterable[str] | str,
    ) -> None:
        """Report an error about the definition at this place, which has no entry of this name, and note that."""
        self.known_missing.add((definition, name))
        diagnostic = error(code, message, place, also=also, help=help)
        self._lacking[diagnostic] = (definition, name)
        self.add(diagnostic)

    def warn(
        self,
        code: str,
        message: str,
        place: Label | Place | None = None,
        *,
        also: Iterable[Label] = (),
        help: Iterable[str] | str = (),
    ) -> None:
        """Add a warning."""
        self.add(replace(error(code, message, place, also=also, help=help), severity="warning"))

    def remark(
        self,
        code: str,
        message: str,
        place: Label | Place | None = None,
        *,
        also: Iterable[Label] = (),
        help: Iterable[str] | str = (),
    ) -> None:
        """Add a warning about the deck's meaning, which is given only if the deck has no errors."""
        self.pass_on(replace(error(code, message, place, also=also, help=help), severity="warning"))

    def pass_on(self, diagnostic: Diagnostic) -> None:
        """Add such a warning that is already put in words."""
        if diagnostic.code in PROVISIONAL:
            self._provisional.append(diagnostic)
        else:
            self._note_remark(diagnostic)

    def _note_remark(self, diagnostic: Diagnostic) -> None:
        """Add a warning about the deck's meaning, unless the run allows it or it is there already."""
        if self._is_silenced(diagnostic):
            return
        spot = (diagnostic.code, diagnostic.at and diagnostic.at.place)
        if diagnostic.code not in REMARKED_ONCE or all((d.code, d.at and d.at.place) != spot for d in self._remarks):
            self._remarks.setdefault(diagnostic)

    def admit_remarks(self) -> None:
        """Turn the remarks into warnings."""
        for diagnostic in self._remarks:
            self._record(diagnostic)
        self._remarks = {}

    @contextmanager
    def allowing(self, allowed: Mapping[str, Place]) -> Iterator[None]:
        """A block in which a run or sweep is checked, and warnings with the codes that it allows are left out.

        allowed the place of the `allow` by its code
        """
        before, self._allowed = self._allowed, allowed
        try:
            yield
        finally:
            self._allowed = before

    def silence(self, allowed: Mapping[str, Iterable[Place]]) -> None:
        """Leave out warnings that belong to no single run, such as about a macro, with codes that all runs allow.

        allowed the places of each `allow` by the code
        """
        for diagnostic in [
            warning for warning in self.warnings if warning in self._of_no_run and warning.code in allowed
        ]:
            places = tuple(allowed[diagnostic.code])
            self.needed_allowances.update(places)
            self._silenced[diagnostic] = places[0]
            del self._diagnostics[diagnostic]

    def _is_silenced(self, diagnostic: Diagnostic) -> bool:
        """Return True if the run that is checked allows this warning, or one that allows it has found it too."""
        if self._allowed is None:
            if diagnostic in self._silenced:
                return True
            self._of_no_run.add(diagnostic)
        elif diagnostic.code in self._allowed:
            self.needed_allowances.add(self._allowed[diagnostic.code])
            self._silenced.setdefault(diagnostic, self._allowed[diagnostic.code])
            return True
        else:
            self._of_no_run.discard(diagnostic)
        return False

    def mark(self, since: int, *labels: Label) -> None:
        """Add places, with texts, to the errors found after the first `since` diagnostics."""
        diagnostics = list(self._diagnostics)
        for n, diagnostic in enumerate(diagnostics):
            if n >= since and diagnostic.severity == "error":
                more = (label for label in labels if diagnostic.at is None or label.place != diagnostic.at.place)
                diagnostics[n] = Diagnostic(
                    diagnostic.code,
                    diagnostic.message,
                    diagnostic.at,
                    (*diagnostic.also, *more),
                    diagnostic.help,
                    diagnostic.severity,
                )
        self._diagnostics = dict.fromkeys(diagnostics)

    @contextmanager
    def gather(self) -> Iterator[None]:
        """Collect every `Problem` raised inside; the rest of the block is skipped."""
        try:
            yield
        except Problem as problem:
            self.add(*problem.diagnostics)


def _mistake(diagnostic: Diagnostic) -> object:
    """A key that is equal for a mistake in all iterations of a loop: the code and the place, without the iteration."""
    assert diagnostic.at is not None
    place = diagnostic.at.place
    return diagnostic.code, diagnostic.severity, place.file, place.line, place.column, place.macros


def once_for_all_roofs(diagnostics: Iterable[Diagnostic]) -> Iterator[Diagnostic]:
    """The diagnostics with each mistake of a file under several roofs once, at the first of them."""
    first: dict[object, Diagnostic] = {}
    others: dict[object, dict[Place, None]] = {}
    with_keys: list[tuple[Diagnostic, object]] = []
    key: object
    for diagnostic in diagnostics:
        place = diagnostic.at.place if diagnostic.at is not None else None
        key = (_mistake(diagnostic), place.iterations) if place is not None and place.used else None
        known = first.setdefault(key, diagnostic)
        came_by = known.at.place.included if known.at is not None else ()
        roofs = [place.included[n] for n in place.used if place.included[n] not in came_by] if place and key else []
        if roofs:
            others.setdefault(key, {})[Place(*roofs[-1], 1)] = None
        else:
            with_keys.append((diagnostic, key if known is diagnostic else None))
    for diagnostic, key in with_keys:
        uses = list(others.get(key, ())) if key is not None else []
        labels = [Label(use, "likewise where it is used here") for use in uses[:MOST_ROOFS_SHOWN]]
        if len(uses) > MOST_ROOFS_SHOWN:
            more = f", and in {len(uses) - MOST_ROOFS_SHOWN:,} more"
            labels[-1] = replace(labels[-1], text=labels[-1].text + more)
        yield replace(diagnostic, also=(*diagnostic.also, *labels)) if labels else diagnostic


def _spot(place: Place) -> tuple[str, int, int]:
    """The file, line and column that the deck's reader sees; for the product of a macro, those of the macro's use."""
    reader_place = place.macros[-1].use if place.macros else place
    return reader_place.file, reader_place.line, reader_place.column


def where_it_belongs(word: str) -> list[str]:
    """The remedy for a word of the language that belongs in another block."""
    places = {
        "substitute": "`substitute JOINT { ... }`, in a run, puts a joint's motor on a bed",
        "payload": "`payload NAME { ... }`, in a run, is a body that a link carries or grapples",
        "guide": "`guide NAME = MODEL { ... }`, in a run, commands several joints together",
        "sensor": "`sensor NAME = MODEL { link = LINK; ... }`, in a run, is on a link; `sensor QUANTITY = MODEL "
        "{ ... }`, in a servo, is of its joint",
    }
    return [places[word]] if word in places else []


def counted(number: int, thing: str) -> str:
    """A number of things in words: `1 joint`, `2 joints`."""
    return f"{number} {thing}{'s' * (number != 1)}"


def and_more(others: int) -> str:
    """A remark that the same is so of this many others, `, and 2 more`; "" of none."""
    return f", and {others} more" if others > 0 else ""


def with_article(word: str, *, quoted: bool = False) -> str:
    """A word with its article, `an arm`, `a servo`; quoted: in the quotes of deck text"""
    return f"{'an' if word[:1] in tuple('aeiou') else 'a'} {f'`{word}`' if quoted else word}"


def known_words(what: str, known: Iterable[str], most: int = 24) -> str:
    """The known words in a sentence, `keys of a link: com, inertia, mass, shape`, cut where there are many."""
    names = list(dict.fromkeys(known))
    listed = ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
    return f"{what}: {listed}" if names else f"{what}: none"
