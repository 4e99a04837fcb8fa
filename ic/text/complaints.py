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

    def __init__(self, found: Iterable[Diagnostic] = ()) -> None:
        self._found: dict[Diagnostic, None] = dict.fromkeys(found)
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
        self._of_no_run: set[Diagnostic] = set(self._found)
        # of each mistake in a loop's body the iterations that make it
        self._iterations: dict[object, dict[tuple[Expansion, ...], None]] = {}
        self.needed_allowances: set[Place] = set()  # the places of each `allow` that silenced a warning
        self._lacking: dict[Diagnostic, tuple[Place, str]] = {}

    @property
    def is_clear(self) -> bool:
        """True where nothing was found or noted."""
        return not (self._found or self._remarks or self._provisional or self.known_missing or self.error_count)

    def copied(self) -> Complaints:
        """A copy with the same findings, to which others can be added."""
        made = copy(self)
        for name, value in vars(self).items():
            if isinstance(value, dict | set | list):
                setattr(made, name, copy(value))
        made._iterations = {mistake: dict(iterations) for mistake, iterations in self._iterations.items()}
        return made

    def apart(self) -> Complaints:
        """A collector for one definition alone, which knows only `known_before` of the present findings."""
        made = Complaints([_BEFORE] if self.errors else [])
        made._torn, made._lost = set(self._torn), set(self._lost)
        made.known_missing = set(self.known_missing)
        return made

    @property
    def known_before(self) -> tuple[object, ...]:
        """Everything on which the findings of an `apart` collector depend: if it is equal, they are equal."""
        sets = (frozenset(each) for each in (self._torn, self._lost, self.known_missing))
        return (bool(self.errors), *sets)

    def findings(self) -> DefinitionFindings:
        """The findings of an `apart` collector."""
        return DefinitionFindings(
            tuple(each for each in self._found if each != _BEFORE),
            tuple(self._remarks),
            dict(self._lacking),
            frozenset(self.known_missing),
            frozenset(self._of_no_run),
            dict(self._silenced),
            frozenset(self.needed_allowances),
            {mistake: tuple(iterations) for mistake, iterations in self._iterations.items()},
        )

    def take(self, found: DefinitionFindings) -> None:
        """Take over findings of an `apart` collector, except those known here already."""
        before = self._allowed
        for each in (*found.diagnostics, *found.remarks):  # without those that the definition allows
            self._allowed = None if each in found.of_no_run else {}
            if each in found.remarks:
                self._note_remark(each)
            elif found.lacking.get(each) not in self.known_missing:
                self.add(each)
        self._allowed = before
        for mistake, iterations in found.iterations.items():
            self._iterations.setdefault(mistake, {}).update(dict.fromkeys(iterations))
        for each, place in found.silenced.items():
            self._silenced.setdefault(each, place)
        self.known_missing |= found.missing
        self.needed_allowances |= found.needed

    @property
    def all(self) -> tuple[Diagnostic, ...]:
        """All findings; of a mistake in several iterations of a loop, or under several roofs of a file, only the first,
        which names the others."""
        return tuple(once_for_all_roofs(map(self._with_iterations, self._without_guesses())))

    def _without_guesses(self) -> Iterator[Diagnostic]:
        """All findings; those that may follow from an error of another kind without a guess of what was meant, which
        would change what a sound entry means."""
        others = any(each.severity == "error" and each.code not in MAY_FOLLOW for each in self._found)
        for each in self._found:
            plain = tuple(line for line in each.help if not getattr(line, "changes", ()))
            if others and each.code in MAY_FOLLOW and len(plain) < len(each.help):
                each = replace(each, help=(*plain, "it may follow from another error here: mend that first"))
            yield each

    @property
    def errors(self) -> tuple[Diagnostic, ...]:
        return tuple(d for d in self._found if d.severity == "error")

    @property
    def warnings(self) -> tuple[Diagnostic, ...]:
        return tuple(d for d in self._found if d.severity == "warning")

    @property
    def allowed(self) -> Mapping[Diagnostic, Place]:
        """The allowed warnings wherever they were found, each with the place of an `allow`."""
        return {each: place for each, place in self._silenced.items() if each not in self._found}

    def add(self, *diagnostics: Diagnostic) -> None:
        for diagnostic in diagnostics:
            if diagnostic.severity != "warning" or not self._is_silenced(diagnostic):
                self._record(diagnostic)

    def _record(self, diagnostic: Diagnostic) -> None:
        self.error_count += diagnostic.severity == "error"
        if (
            not self.is_of_another_iteration(diagnostic)
            and len(self._found) < MOST_DIAGNOSTICS
            and not self._is_known_at_this_place(diagnostic)
            and not self._follows_from_unreadable(diagnostic)
        ):
            self._found.setdefault(diagnostic)

    def is_of_another_iteration(self, diagnostic: Diagnostic) -> bool:
        """Return True if an iteration of a loop made the same mistake in the same place before; this one is noted."""
        if diagnostic.at is None or not diagnostic.at.place.iterations:
            return False
        iterations = diagnostic.at.place.iterations
        known = self._iterations.setdefault(_mistake(diagnostic), {iterations: None})
        known[iterations] = None
        return next(iter(known)) != iterations

    def _with_iterations(self, diagnostic: Diagnostic) -> Diagnostic:
        if not self._iterations or diagnostic.at is None or not diagnostic.at.place.iterations:
            return diagnostic
        others = tuple(self._iterations.get(_mistake(diagnostic), ()))[1:]
        if not others:
            return diagnostic
        loop = diagnostic.at.place.iterations[0]
        text = f"likewise in {len(others):,} other iteration{'s' * (len(others) > 1)}"
        if all(len(iterations) == 1 for iterations in others):
            shown = [iterations[0].iteration for iterations in others[:MOST_ITERATIONS_SHOWN]]
            more = f" and {len(others) - len(shown):,} more" * (len(others) > len(shown))
            text = f"likewise where {loop.macro} = {', '.join(shown)}{more}"
        return replace(diagnostic, also=(*diagnostic.also, Label(loop.use, text)))

    def note_unreadable(self, stretches: Sequence[UnreadableStretch]) -> None:
        """Note stretches that could not be read, so that errors that follow from them, or from the errors so far, are
        not reported."""
        self._spots.update(_spot(each.at.place) for each in self.errors if each.at is not None)
        self._unreadable += stretches
        self._torn.update(stretch.within for stretch in stretches if stretch.within is not None)
        self.note_lost_names(*(name for stretch in stretches for name in stretch.names))

    def note_lost_names(self, *names: str) -> None:
        """Note names that may be defined by something that could not be taken in, already reported."""
        self._lost.update(names)

    def is_lost(self, name: str) -> bool:
        """Return True if this name may be defined by something that could not be taken in."""
        return name in self._lost

    def note_base(self, of: Place, base: Place) -> None:
        """Note that the definition at `of` inherits its base's entries, and lacks those that the base lacks."""
        if base in self._torn:
            self._torn.add(of)

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
            each.place.file == file and (each.place.line, each.place.column) <= (line, column) < each.end
            for each in self._unreadable
        )

    def _is_known_at_this_place(self, diagnostic: Diagnostic) -> bool:
        """Return True if this mistake is reported here already: one in a base or a `let` is found at every use."""
        if diagnostic.at is None or diagnostic.code not in REPORTED_ONCE:
            return False
        return any(
            each.code == diagnostic.code and each.at is not None and each.at.place == diagnostic.at.place
            for each in self._found
        )

    def error(
        self,
        code: str,
        message: str,
        at: Label | Place | None = None,
        *,
        also: Iterable[Label] = (),
        help: Iterable[str] | str = (),
    ) -> None:
        found = error(code, message, at, also=also, help=help)
        if code in PROVISIONAL:
            self._provisional.append(found)
        else:
            self.add(found)

    def settle(self, refuted: Collection[str] = ()) -> frozenset[str]:
        """Report provisional warnings, except those of these codes; returns the codes that were reported."""
        kept = [each for each in self._provisional if each.code not in refuted]
        self._provisional = []
        for each in kept:
            if each.severity == "error":
                self.add(each)
            else:
                self._note_remark(each)
        return frozenset(each.code for each in kept)

    def note_misspelling(self, of: Place, word: str, known: Iterable[str]) -> None:
        """Note the entry for which an unknown one in the definition at `of` may have been meant, so that it is not
        reported as missing."""
        near = meant(word, known)
        if near is not None:
            self.known_missing.add((of, near.rpartition(".")[2]))

    def is_known_to_lack(self, of: Place, *names: str) -> bool:
        """Return True if one of these entries of the definition at `of` was reported as missing, another word was taken
        for it, or an entry there could not be read."""
        if of in self._torn:
            return True
        return any((of, name) in self.known_missing for name in names)

    def missing(
        self,
        of: Place,
        names: tuple[str, ...],
        code: str,
        message: str,
        at: Place | None = None,
        *,
        also: Iterable[Label] = (),
        help: Iterable[str] | str = (),
    ) -> None:
        """Report an error about the definition at `of`, which has none of these entries, unless that is known
        already."""
        if not self.is_known_to_lack(of, *names):
            self.error(code, message, at or of, also=also, help=help)

    def withdraw(self, code: str, at: Place) -> None:
        """Take back what was reported with this code at a place, where another message turns out to say why."""
        self._found = {each: None for each in self._found if (each.code, each.at and each.at.place) != (code, at)}

    def lack(
        self,
        of: Place,
        name: str,
        code: str,
        message: str,
        at: Label | Place,
        *,
        also: Iterable[Label],
        help: Iterable[str] | str,
    ) -> None:
        """Report an error about the definition at `of`, which has no entry of this name, and note that."""
        self.known_missing.add((of, name))
        found = error(code, message, at, also=also, help=help)
        self._lacking[found] = (of, name)
        self.add(found)

    def warn(
        self,
        code: str,
        message: str,
        at: Label | Place | None = None,
        *,
        also: Iterable[Label] = (),
        help: Iterable[str] | str = (),
    ) -> None:
        self.add(replace(error(code, message, at, also=also, help=help), severity="warning"))

    def remark(
        self,
        code: str,
        message: str,
        at: Label | Place | None = None,
        *,
        also: Iterable[Label] = (),
        help: Iterable[str] | str = (),
    ) -> None:
        """Add a warning about the deck's meaning, which is given only if the deck has no errors."""
        self.pass_on(replace(error(code, message, at, also=also, help=help), severity="warning"))

    def pass_on(self, diagnostic: Diagnostic) -> None:
        """Add such a warning that is already put in words."""
        if diagnostic.code in PROVISIONAL:
            self._provisional.append(diagnostic)
        else:
            self._note_remark(diagnostic)

    def _note_remark(self, diagnostic: Diagnostic) -> None:
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
            del self._found[diagnostic]

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
        found = list(self._found)
        for n, each in enumerate(found):
            if n >= since and each.severity == "error":
                more = (label for label in labels if each.at is None or label.place != each.at.place)
                found[n] = Diagnostic(each.code, each.message, each.at, (*each.also, *more), each.help, each.severity)
        self._found = dict.fromkeys(found)

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


def once_for_all_roofs(found: Iterable[Diagnostic]) -> Iterator[Diagnostic]:
    """The diagnostics with each mistake of a file under several roofs once, at the first of them."""
    first: dict[object, Diagnostic] = {}
    others: dict[object, dict[Place, None]] = {}
    kept: list[tuple[Diagnostic, object]] = []
    key: object
    for each in found:
        place = each.at.place if each.at is not None else None
        key = (_mistake(each), place.iterations) if place is not None and place.used else None
        known = first.setdefault(key, each)
        came_by = known.at.place.included if known.at is not None else ()
        roofs = [place.included[n] for n in place.used if place.included[n] not in came_by] if place and key else []
        if roofs:
            others.setdefault(key, {})[Place(*roofs[-1], 1)] = None
        else:
            kept.append((each, key if known is each else None))
    for each, key in kept:
        uses = list(others.get(key, ())) if key is not None else []
        labels = [Label(use, "likewise where it is used here") for use in uses[:MOST_ROOFS_SHOWN]]
        if len(uses) > MOST_ROOFS_SHOWN:
            more = f", and in {len(uses) - MOST_ROOFS_SHOWN:,} more"
            labels[-1] = replace(labels[-1], text=labels[-1].text + more)
        yield replace(each, also=(*each.also, *labels)) if labels else each


def _spot(place: Place) -> tuple[str, int, int]:
    """The file, line and column that the deck's reader sees; for the product of a macro, those of the macro's use."""
    at = place.macros[-1].use if place.macros else place
    return at.file, at.line, at.column


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


def with_article(word: str, *, quoted: bool = False) -> str:
    """A word with its article, `an arm`, `a servo`; quoted: in the quotes of deck text"""
    return f"{'an' if word[:1] in tuple('aeiou') else 'a'} {f'`{word}`' if quoted else word}"


def known_words(what: str, known: Iterable[str], most: int = 24) -> str:
    """The known words in a sentence, `keys of a link: com, inertia, mass, shape`, cut where there are many."""
    names = list(dict.fromkeys(known))
    shown = ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
    return f"{what}: {shown}" if names else f"{what}: none"
