"""Checks of a deck, definition by definition, for an editor, without the audit of programs.

Each arm, each servo, and each run or sweep is checked by itself, so its findings depend only on what it can see: its
own entries, those that it is like or of, arms, servos and `let`s, each with its places. Their digest is the findings'
key. Findings that are kept under their keys are reused in the next check; they never expire, since another text has
another key.

Checks that need a program (`DeckSource.audited`) are left to `ic.driver.compile.check`, whose verdict is final.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial

from ic.driver.compile import TOO_DEEP, check_names
from ic.grammar.syntax import Deck, Entry, Group
from ic.language import EXPERIMENTS
from ic.meaning.control.servos import check_servo_definition
from ic.meaning.definitions.resolve import Definition, Definitions
from ic.meaning.mechanics.arm import bring_arm, check_arm, packed_arm, resolve_arm
from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.allowances import silence_of_all
from ic.read import in_order, read_again
from ic.sweeps.groups import DeckSource, experiments_of
from ic.sweeps.settings import check_params
from ic.text.complaints import Complaints, DefinitionFindings
from met.diagnostic import Diagnostic
from met.frozen import frozen
from met.plan import Allowance


@frozen
class KnownFindings:
    """Findings about one definition, and the allowances of its experiments.

    arm  of an arm's definition: the arm itself as runs share it, pickled; nothing where they cannot
    """

    findings: DefinitionFindings
    allowances: tuple[tuple[Allowance, ...], ...] = ()
    arm: bytes = b""


Known = Mapping[bytes, KnownFindings]
"""Findings by the digest of everything that they depend on."""

Check = Callable[[Definitions, Complaints], tuple[tuple[Allowance, ...], ...]]


class DefinitionChecks:
    """The checks of a deck's definitions: known findings at once, the others one by one."""

    def __init__(self, deck: Deck, known: Known) -> None:
        """Find the deck's definitions, and those whose findings are known. known: findings by the digest of all that
        they depend on"""
        self._deck = deck
        self._complaints = Complaints(deck.warnings)
        self._complaints.note_unreadable(deck.unreadable)
        self._definitions = Definitions(deck, self._complaints)
        self._check_names()
        self._units = list(self._all())
        keys = _Keys(deck, self._definitions, self._complaints)
        self._keys = [keys.of(definition) for definition, _ in self._units]
        self._findings = {n: known[key] for n, key in enumerate(self._keys) if key is not None and key in known}
        for n, findings in self._findings.items():
            bring_arm(self._definitions, self._units[n][0].name, findings.arm)
        order = sorted(range(len(self._units)), key=lambda n: self._units[n][0].kind in EXPERIMENTS)
        self._waiting = [
            n for n in order if n not in self._findings
        ]  # arms and servos first: runs have their mistakes too

    @property
    def to_come(self) -> int:
        """The number of definitions without findings yet."""
        return len(self._waiting)

    def check_next(self) -> None:
        """Check the next definition (an arm, a servo, a run or a sweep) whose findings are not known, and keep its
        findings."""
        n = self._waiting.pop(0)
        complaints = self._complaints.apart()
        allowances: tuple[tuple[Allowance, ...], ...] = ()
        try:
            with complaints.gather():
                allowances = self._units[n][1](self._definitions.reporting_to(complaints), complaints)
        except RecursionError:
            complaints.add(TOO_DEEP)
        definition = self._units[n][0]
        arm = packed_arm(self._definitions, definition.name) if definition.kind == "arm" else b""
        self._findings[n] = KnownFindings(complaints.findings(), allowances, arm)

    @property
    def findings(self) -> Known:
        """The findings to keep for the next check. Empty where files are searched whose texts are in no key."""
        files = self._definitions
        if any(kind.was_asked for kind in (files.csv_files, files.robot_files, files.mesh_files)):
            return {}
        return {key: self._findings[n] for n, key in enumerate(self._keys) if key is not None and n in self._findings}

    def diagnostics(self) -> tuple[tuple[Diagnostic, ...], Mapping[str, str]]:
        """All findings so far, in the order of the text, and every file's text by name."""
        complaints = self._complaints.copied()
        all_findings = [self._findings[n] for n in range(len(self._units)) if n in self._findings]
        for known_findings in all_findings:
            complaints.take(known_findings.findings)
        if not complaints.errors and not self._waiting:
            complaints.admit_remarks()
            silence_of_all(
                [allowances for known_findings in all_findings for allowances in known_findings.allowances], complaints
            )
        files = self._definitions
        sources = (*self._deck.sources, *files.csv_files.sources, *files.robot_files.sources)
        return in_order(complaints.all, sources), {source.name: source.text for source in sources}

    def _check_names(self) -> None:
        """Check `let`s, `param`s, and the merging of definitions, which belong to no single definition."""
        complaints, definitions = self._complaints, self._definitions
        try:
            with complaints.gather():
                check_params(definitions, complaints)
                check_names(self._deck, definitions, complaints)
        except RecursionError:
            complaints.add(TOO_DEEP)

    def _all(self) -> Iterator[tuple[Definition, Check]]:
        """Every definition with its check, in the order of `met check`."""
        definitions = self._definitions
        for definition in definitions.experiments.values():
            yield definition, partial(self._experiment, definition)
        loaded = definitions.have_payloads()
        for definition in definitions.of_kind("arm").values():
            yield definition, partial(_arm, definition, resolve_arm if loaded else check_arm)
        for definition in definitions.of_kind("servo").values():
            yield definition, partial(_servo, definition)

    def _experiment(
        self, definition: Definition, definitions: Definitions, complaints: Complaints
    ) -> tuple[tuple[Allowance, ...], ...]:
        """Check a run or sweep; returns the allowances of its experiments."""
        source = DeckSource(definitions, complaints, partial(read_again, self._deck), audited=False)
        return tuple(experiment.allowances for experiment, _ in experiments_of(source, definition))


def _arm(
    definition: Definition,
    check: Callable[[Scope, Definition], object],
    definitions: Definitions,
    complaints: Complaints,
) -> tuple[()]:
    check(Scope(definitions, complaints), definition)
    return ()


def _servo(definition: Definition, definitions: Definitions, complaints: Complaints) -> tuple[()]:
    check_servo_definition(Scope(definitions, complaints), definition.name)
    return ()


# Keys


class _Keys:
    """Digests of everything on which a definition's findings depend."""

    def __init__(self, deck: Deck, definitions: Definitions, complaints: Complaints) -> None:
        """Digest what many definitions share: the deck's `let`s, its arms and its servos."""
        self._known = definitions.experiments
        self._of_kind = {kind: definitions.of_kind(kind) for kind in ("run", "arm", "servo")}
        everything = [
            definition for kind in (*EXPERIMENTS, "arm", "servo") for definition in definitions.of_kind(kind).values()
        ]
        self._chooses = {
            id(definition): _chooses_macros(definition.group.body)
            for definition in everything
            if definition.kind in EXPERIMENTS
        }
        self._own = {
            id(definition): pickle.dumps((definition.group, definition.default, definition.parts))
            for definition in everything
        }
        names = [(definition.kind, definition.name, definition.default, definition.place) for definition in everything]
        lets = list(definitions.lets.values())
        loaded = definitions.have_payloads()
        before, *sets = complaints.known_before
        reported = [before, *(sorted(map(repr, group)) for group in sets)]  # type: ignore[call-overload]
        shared = (deck.file, deck.defines, names, lets, reported, loaded, sorted(deck.roofs.items()))
        arms, servos = (
            {name: self._own[id(definition)] for name, definition in definitions.of_kind(kind).items()}
            for kind in ("arm", "servo")
        )
        told_of, values = pickle.dumps(shared), [pickle.dumps(lets), *arms.values()]
        plain = {name: name.rpartition(".")[2].encode() for name in servos}  # as its own deck calls it
        named = [body for name, body in servos.items() if any(plain[name] in value for value in values)]
        self._shared = {
            "arm": _digest([told_of, *arms.values(), *named]),
            "servo": _digest([told_of, *servos.values()]),
            "run": _digest([told_of, *arms.values(), *servos.values()]),
        }

    def of(self, definition: Definition) -> bytes | None:
        """The digest; None where its dependences are not all known."""
        seen: dict[int, bytes] = {}
        waiting = [definition]
        while waiting:
            dependence = waiting.pop()
            body = self._own[id(dependence)]
            if id(dependence) in seen:
                continue
            if self._chooses.get(id(dependence)):
                return None
            seen[id(dependence)] = body
            like, of = dependence.group.like, dependence.group.of
            kind = "run" if dependence.kind in EXPERIMENTS else dependence.kind
            for name, among in (
                *((name, self._of_kind[kind]) for name in (like, of)),
                *((p, self._known) for p in dependence.parts),
            ):
                if name is not None and name.text not in among:
                    return None
                waiting += [among[name.text]] if name is not None else []
        shared = self._shared.get(definition.kind, self._shared["run"])
        return _digest([definition.kind.encode(), definition.name.encode(), shared, *seen.values()])


def _chooses_macros(entries: Iterable[Entry]) -> bool:
    """True for a sweep over macros, which reads the deck again: then nothing is known about text that is left out."""
    return any(
        any(word.text == "macro" for word in getattr(entry, "words", ()))
        or (isinstance(entry, Group) and _chooses_macros(entry.body))
        for entry in entries
    )


def _digest(parts: Iterable[bytes]) -> bytes:
    """The SHA-256 of these parts, each behind its length, so that two lists never give the same bytes."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "big") + part)
    return digest.digest()
