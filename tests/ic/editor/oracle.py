"""What an editor should answer at the words of a deck, from its syntax tree, its plan and the language's declaration.

Nothing here is from the editor's own code. The tree says in what role a word stands (the key of a block, the servo of
a joint, a part of a path); the plan says which arm a run has, of which model a servo is, which value was written where.
Words whose role is none of those here are left out.

    python -m tests.ic.editor.oracle PLACES [SEED]      ask at so many places of shipped decks, and print what is wrong
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any

from ic.driver.compile import Compiled, check
from ic.grammar.syntax import (
    Call,
    Entry,
    Expression,
    Group,
    Let,
    Name,
    Number,
    Setting,
    Statement,
    Unit,
    WithUnit,
    Word,
    children,
)
from ic.language import BLOCKS
from ic.read import read
from ic.text.files import LIBRARY
from met import models
from met.diagnostic import Place
from met.plan import Experiment
from met.plan.channel import recordable
from met.units import UNITS
from tests.ic.editor.client import Editor, uri

At = tuple[str, int, int]
"""A file, and a line and a column from 1."""

REACHED = ("vary", "require", "exclude", "record", "of", "remove")


@dataclass
class Judged:
    """What is right at a word.

    role     in which it stands
    defined  where its definition is; empty: nowhere; None: not judged
    said     texts of which a hover shows all;  values: paths with values of which it shows one at least
    offered  words that are offered where it begins;  only: all that may be offered there, None where that is not judged
    """

    word: str
    role: str
    defined: set[At] | None = None
    said: set[str] = field(default_factory=set)
    values: set[tuple[str, float]] = field(default_factory=set)
    offered: set[str] = field(default_factory=set)
    only: set[str] | None = None


def at(place: Place) -> At:
    return place.file, place.line, place.column


class Oracle:
    """What is right at the words of a deck's file, by line and column."""

    def __init__(self, deck: str, compiled: Compiled) -> None:
        assert compiled.plan is not None, compiled.diagnostics
        self.file = deck
        self.has_base = False  # whether the definition that is walked through is `like` another
        self.experiments = compiled.plan.experiments
        self.definitions = compiled.scopes[0].definitions
        self.words: dict[At, list[Judged]] = defaultdict(list)
        self.values = [
            (path, settled.value, settled.origin.place)
            for scope in compiled.scopes
            for path, settled in scope.parameters.items()
            if settled.origin.kind == "deck" and settled.origin.place is not None and isinstance(settled.value, float)
        ]
        self.macros = {
            match[1]: (
                name,
                text.count("\n", 0, match.start(1)) + 1,
                match.start(1) - text.rfind("\n", 0, match.start(1)),
            )
            for name, text in compiled.sources.items()
            for match in re.finditer(r"^#define (\w+)", text, re.M)
        }
        self.declared_units = {
            match[1]: (name, text.count("\n", 0, match.start(1)) + 1, len("unit ") + 1)
            for name, text in compiled.sources.items()
            for match in re.finditer(r"^unit (\w+) =", text, re.M)
        }
        for entry in read(deck).entries:
            self._definition(entry)

    # what the plan knows

    def of_run(self, name: str) -> Experiment | None:
        return next((each for each in self.experiments if each.name == name), None)

    def _named(self, kind: str) -> set[str]:
        """The names of a kind, and what those of a deck that is used begin with: `rigid` of `rigid.shuttle_arm`."""
        names = self.definitions.of_kind(kind)
        return {*names, *(name.partition(".")[0] for name in names)}

    def _place_of(self, kind: str, name: str) -> set[At] | None:
        found = self.definitions.of_kind(kind).get(name)
        if found is None:
            return None
        words = [word for word in found.group.words if word.text == name]
        return {at(words[-1].place)} if words else None

    def _inside(self, kind: str, name: str, inner: str, wanted: str) -> set[At] | None:
        """Where `link upper` of an arm, or `metric settle` of a run, is defined: in it, or in what it is `like`."""
        definition = self.definitions.of_kind(kind).get(name)
        while definition is not None:
            for entry in definition.group.body:
                if isinstance(entry, Group) and [word.text for word in entry.words[:2]] == [inner, wanted]:
                    return {at(entry.words[1].place)}
                if isinstance(entry, Setting) and entry.words and entry.words[0].text == inner:
                    if entry.path[-1].text != wanted:
                        continue
                    return {at(entry.path[-1].place)}
                if isinstance(entry, Statement) and inner == "require" and entry.name and entry.name.text == wanted:
                    return {at(entry.name.place)}
            base = definition.group.like
            definition = self.definitions.of_kind(kind).get(base.text) if base is not None else None
        return None

    def _arm_of(self, run: str) -> str:
        experiment = self.of_run(run)
        return experiment.structure.arm if experiment is not None else ""

    # notes

    def _note(self, word: Word, role: str, **what: Any) -> None:
        if word.place.file == self.file and len(word.text) == word.place.length:
            self.words[at(word.place)].append(Judged(word.text, role, **what))
            self._note_macro(word.place)

    def _note_macro(self, place: Place) -> None:
        for step in place.macros:
            use = step.use
            where = self.macros.get(step.macro)
            if use.file == self.file and where is not None and at(use) not in self.words:
                self.words[at(use)].append(Judged(step.macro, "macro", {where}, said={f"#define {step.macro}"}))

    # the tree

    def _definition(self, entry: Entry) -> None:
        if isinstance(entry, Let):
            said = {f"let {entry.name.text}"}
            self._note(entry.name, "let", defined={at(entry.name.place)}, said=said)
            self._value(entry.value, ("", ""), None)
        if isinstance(entry, Group):
            words = list(entry.words)
            if words[0].text == "default":
                self._note(words.pop(0), "default", defined=set(), offered={"default"})
            kind, name = words[0].text, words[1].text
            self.has_base = entry.like is not None
            self._note(words[0], "definition", defined=set(), said={BLOCKS[kind].doc}, offered={kind})
            self._note(words[1], f"name of {kind}", defined={at(words[1].place)})
            for base, of in ((entry.like, kind), (entry.of, "run")):
                if base is not None:
                    role = f"{of} referred to"
                    self._note(base.path[0], role, defined=self._place_of(of, base.text), offered={base.text},
                               only=self._named(of))  # fmt: skip
            self._block(kind, entry.body, (kind, name if kind == "run" or not entry.of else entry.of.text))

    def _block(self, block: str, entries: Iterable[Entry], within: tuple[str, str], model: str = "") -> None:
        for entry in entries:
            if isinstance(entry, Group):
                self._inner(block, entry, within)
            elif isinstance(entry, Setting):
                self._setting(block, entry, within, model)
            elif isinstance(entry, Statement):
                key = entry.words[0]
                if key.text in ("require", "exclude", "remove", "allow", "sample"):
                    self._note(key, "statement", defined=set(), offered={key.text})
                if key.text == "against" and isinstance(entry.value, Name):
                    word = entry.value.path[0]
                    sweeps = self._named("sweep")  # a deck that is asked here has those of one run
                    self._note(word, "sweep referred to", offered=sweeps, only=sweeps)
                self._value(entry.value, within, None, key.text)
                if entry.name is not None:
                    self._note(entry.name, "name of require", defined={at(entry.name.place)})

    def _inner(self, block: str, entry: Group, within: tuple[str, str]) -> None:
        key = entry.words[0]
        declared = {each.name: each for each in BLOCKS[block].entries} if block in BLOCKS else {}
        if key.text not in declared and key.text not in BLOCKS:
            return
        only = self._with_macros(declared) if block == "arm" or block == "run" else None
        self._note(key, "key", defined=set(), offered=set(declared), only=only)
        if len(entry.words) > 1 and key.text in ("link", "joint", "payload"):
            name = entry.words[1]
            self._note(name, f"name of {key.text}", defined={at(name.place)})
            if key.text == "joint" and len(entry.words) > 2:
                kinds = {"revolute", "prismatic", "fixed"}
                self._note(entry.words[2], "kind of joint", defined=set(), offered=kinds, only=kinds)
        special = next((word.text for word in entry.words[2:3] if word.text in BLOCKS), key.text)  # `link NAME boom`
        self._block(special, entry.body, within)

    def _setting(self, block: str, entry: Setting, within: tuple[str, str], model: str) -> None:
        words = entry.words
        kind, name = within
        first = entry.path[0]
        if words:
            self._note(words[0], "key", defined=set(), offered={words[0].text})
            if words[0].text in ("metric", "guide", "payload", "sensor", "signal", "require"):
                if block != "servo":
                    self._note(first, f"name of {words[0].text}", defined={at(first.place)})
                self._value(entry.value, within, words[0].text, words[0].text)
                return
            if words[0].text == "vary":
                self._path(entry.path, name, "vary")
                self._value(entry.value, within, None)
            return
        if block in ("servos", "initial") and kind == "run":
            experiment = self.of_run(name)
            joints = {joint.name for joint in experiment.structure.joints} if experiment is not None else set()
            if first.text in joints:
                arm = self._arm_of(name)
                also = {each.name for each in BLOCKS["initial"].entries} if block == "initial" else set()
                self._note(first, f"joint in {block}", defined=self._inside("arm", arm, "joint", first.text),
                           offered=joints, only=self._with_macros(joints | also))  # fmt: skip
            for rest in entry.path[1:]:
                self._note(rest, "part of a path", defined=set())
            if block == "initial" and isinstance(entry.value, Name) and entry.value.text == "command":
                self._note(entry.value.path[0], "start as commanded", offered={"command"})
            if block == "servos":
                value = entry.value
                servo = value.name if isinstance(value, Call) else value
                if isinstance(servo, Name):
                    word = servo.path[0]
                    self._note(word, "servo referred to", defined=self._place_of("servo", word.text),
                               offered={word.text}, only=self._named("servo"))  # fmt: skip
                    if isinstance(value, Call) and value.body is not None:
                        self._block("servo", value.body, ("servo", word.text), self._model_of(word.text))
                return
            self._value(entry.value, within, None)
            self._note_values(entry, first)
            return
        declared = {each.name: each for each in BLOCKS[block].entries} if block in BLOCKS else {}
        if block in ("environment", "guide", "sensor") and model:
            declared = {}
        model = model or (self._model_of(name) if block == "servo" else "")
        parameters = {}
        if model:
            kinds = [each for each in models.GROUPS if model in models.available(each)]
            wanted = "servo" if block == "servo" else block if block in models.GROUPS else kinds[0] if kinds else ""
            if wanted and model in models.available(wanted):
                parameters = {each.name: each for each in models.written(models.available(wanted)[model])}
        if first.text in declared:
            self._note(first, "key", defined=set(), said={declared[first.text].doc}, offered={*declared, *parameters},
                       only=self._with_macros({*declared, *parameters, *self._named_in(block, within)}))  # fmt: skip
        elif first.text in parameters:
            self._note(first, "parameter", defined=set(), said={parameters[first.text].doc},
                       offered={*declared, *parameters}, only=self._with_macros({*declared, *parameters}))  # fmt: skip
        elif block == "environment" and isinstance(entry.value, Name | Call):
            self._value(entry.value, within, "environment")
            return
        self._note_values(entry, first)
        if block == "joint" and first.text in ("parent", "child") and isinstance(entry.value, Name):
            links = {
                inner.words[1].text
                for inner in self._entries("arm", name)
                if isinstance(inner, Group) and inner.words[0].text == "link"
            }
            word = entry.value.path[0]
            where = self._inside("arm", name, "link", word.text)
            if word.text != "base" or where is not None:
                self._note(word, "link referred to", defined=where, offered=links, only=links | {"base"})
            return
        if block == "run" and first.text == "arm" and isinstance(entry.value, Name):
            word = entry.value.path[0]
            self._note(word, "arm referred to", defined=self._place_of("arm", word.text), offered={word.text},
                       only=self._named("arm"))  # fmt: skip
            return
        of = {"model": "servo", "command": "command", "integrator": "integrator", "bed": "bed", "law": "law"}
        self._value(entry.value, within, of.get(first.text) if block in ("servo", "run", "substitute") else None,
                    first.text if first.text in REACHED else "")  # fmt: skip

    def _with_macros(self, words: Iterable[str]) -> set[str]:
        return {*words, *self.macros, "remove"} if self.has_base else {*words, *self.macros}

    def _named_in(self, block: str, within: tuple[str, str]) -> set[str]:
        """The joints that entries of `initial` may begin with, the models of those of `environment`."""
        if block == "environment":
            return set(models.available("environment"))
        experiment = self.of_run(within[1]) if block == "initial" else None
        return {joint.name for joint in experiment.structure.joints} if experiment is not None else set()

    def _entries(self, kind: str, name: str) -> Iterator[Entry]:
        definition = self.definitions.of_kind(kind).get(name)
        while definition is not None:
            yield from definition.group.body
            base = definition.group.like
            definition = self.definitions.of_kind(kind).get(base.text) if base is not None else None

    def _model_of(self, servo: str) -> str:
        for experiment in self.experiments:
            for use in experiment.structure.servos:
                if use.definition == servo:
                    return use.model
        for entry in self._entries("servo", servo):
            if isinstance(entry, Setting) and entry.path[0].text == "model" and isinstance(entry.value, Name):
                return entry.value.text
        return ""

    def _note_values(self, entry: Setting, key: Word) -> None:
        """The values that were written in an entry are shown at its key."""
        if key.place.file != self.file or key.place.expansions:
            return
        numbers = {at(each.place) for each in _numbers(entry.value)}
        found = {(path, float(value)) for path, value, place in self.values if at(place) in numbers}
        for each in self.words.get(at(key.place), []):
            each.values |= found

    def _value(self, value: Expression, within: tuple[str, str], models_of: str | None, path_of: str = "") -> None:
        kind, name = within
        match value:
            case Number(unit=unit) if unit is not None:
                self._units(unit)
            case WithUnit(inner=inner, unit=unit):
                self._units(unit)
                self._value(inner, within, models_of, path_of)
            case Name(path=path):
                if path_of in REACHED or (kind == "sweep" and len(path) > 1):
                    self._path(path, name, path_of)
                elif len(path) == 1 and path[0].text in self.definitions.lets:
                    where = {at(self.definitions.lets[path[0].text].name.place)}
                    self._note(path[0], "let referred to", defined=where, offered={path[0].text},
                               said={f"let {path[0].text}"})  # fmt: skip
                elif models_of and path[0].text in models.available(models_of):  # type: ignore[arg-type]
                    self._model(path[0], models_of)
            case Call(name=called, positional=positional, named=named, body=body):
                word = called.path[0]
                if models_of in models.GROUPS and word.text in models.available(models_of):  # type: ignore[arg-type]
                    self._model(word, models_of)
                for each in (*positional, *(inner for _, inner in named)):
                    self._value(each, within, "command" if models_of == "command" else None)
                if body is not None and models_of is not None:
                    self._block("metric" if models_of == "metric" else models_of, body, within, word.text)
            case _:
                for each in children(value):
                    self._value(each, within, models_of, path_of)

    def _model(self, word: Word, kind: str) -> None:
        known = models.available(kind)  # type: ignore[arg-type]
        doc = " ".join(known[word.text].doc.split())
        begins = re.split(r"[.:] |[.:]$", doc)[0]  # its own words, not those of the class that declares it
        self._note(word, f"model of {kind}", defined=set(), said={word.text, begins}, offered=set(known))

    def _units(self, unit: Unit) -> None:
        for n, (word, _) in enumerate(unit.factors):
            if word.text in UNITS:
                said = {f"unit `{word.text}`: {UNITS[word.text].word}"}
                self._note(word, "unit", defined=set(), said=said, offered={word.text} if n == 0 else set())
        for word, measure in unit.declared:
            written = next(each for each, _ in unit.factors if each.text == word)
            where, said = self.declared_units.get(word), {f"unit `{word}`: {measure.scale:.10g} "}
            offered = {word} if written is unit.factors[0][0] else set()
            self._note(written, "unit of the deck", defined={where} if where else None, said=said, offered=offered)

    def _path(self, path: tuple[Word, ...], run: str, where: str) -> None:
        """The parts of a path: of signals in a run, of parameters in a sweep."""
        experiment = self.of_run(run)
        first = path[0]
        if experiment is None:
            return
        arm = experiment.structure.arm
        joints = {joint.name for joint in experiment.structure.joints}
        signals = recordable(experiment.structure)
        if where in ("require", "remove") and len(path) == 1:
            kinds = [k for k in ("metric", "require", "guide", "sensor") if self._inside("run", run, k, first.text)]
            if kinds:
                place = self._inside("run", run, kinds[0], first.text)
                self._note(first, f"{kinds[0]} in {where}", defined=place, offered={first.text})
            return
        if first.text in joints:
            self._note(
                first, f"joint in {where}", defined=self._inside("arm", arm, "joint", first.text), offered=joints
            )
        elif first.text in self._named("servo") and where in ("vary", "exclude", ""):
            self._note(first, f"servo in {where}", defined=self._place_of("servo", first.text), offered={first.text})
        elif first.text in ("links", "guides", "sensors", "payloads", "energy", "momentum", "servo") or len(path) == 1:
            self._note(first, f"head in {where}", defined=set(), offered={first.text})
        if first.text in ("links", "guides", "payloads") and len(path) > 1:
            inner = {
                "links": ("arm", arm, "link"),
                "guides": ("run", run, "guide"),
                "payloads": ("run", run, "payload"),
            }
            place = self._inside(*inner[first.text], path[1].text)
            if place is not None:
                self._note(path[1], f"{inner[first.text][2]} in a path", defined=place, offered={path[1].text})
        if where in ("record", "of", "require"):
            for n in range(1, len(path)):
                head = ".".join(word.text for word in path[:n]) + "."
                beside = {each[len(head) :].partition(".")[0] for each in signals if each.startswith(head)}
                if path[n].text in beside:
                    said = set() if first.text in ("links", "guides", "payloads") and n == 1 else None
                    self._note(path[n], f"part of a signal in {where}", defined=set() if said is None else None,
                               offered=beside)  # fmt: skip


def _numbers(value: Expression) -> Iterator[Number]:
    if isinstance(value, Number):
        yield value
    for each in children(value):
        yield from _numbers(each)


def shipped() -> list[str]:
    """The paths of all shipped decks that have runs."""
    found = [str(path) for path in sorted(LIBRARY.glob("*.ic"))]
    return [each for each in found if "run " in Path(each).read_text()]


def wrong(editor: Editor, deck: Path, judged: Judged, where: At) -> Iterator[tuple[str, str]]:
    """What the editor answers wrongly at a word: of which kind of question, and in words."""
    line, column = where[1] - 1, where[2] - 1
    shown = f"{deck.name}:{where[1]}:{where[2]} `{judged.word}` ({judged.role})"
    if judged.defined is not None:
        found = editor.about("textDocument/definition", deck, line, column)
        places = {
            (each["uri"], each["range"]["start"]["line"] + 1, each["range"]["start"]["character"] + 1) for each in found
        }
        expected = {(_uri(file, deck), *rest) for file, *rest in judged.defined}
        if places != expected:
            yield "definition", f"{shown}: {sorted(places)}, not {sorted(expected)}"
    if judged.said or judged.values:
        answer = editor.about("textDocument/hover", deck, line, column)
        text = answer["contents"]["value"] if answer is not None else ""
        lacking = [each for each in judged.said if each not in text]
        values = dict(_values_in(text))
        right = [path for path, value in judged.values if _close(values.get(path), value)]
        if lacking or (judged.values and not right):
            yield "hover", f"{shown}: lacks {lacking} {sorted(judged.values)[:2]} in {text!r}"
    if judged.offered or judged.only is not None:
        found = editor.about("textDocument/completion", deck, line, column)
        words = {each["label"].split()[0] for each in found}  # `exclude when`
        if not _is_in_loop(deck.read_text(), line):
            unwritable = sorted(each["label"] for each in found if re.search(r"[({]", each["label"]))
            if unwritable:
                yield "completion", f"{shown}: {unwritable} cannot be written here"
        lacking = sorted({each.split()[0] for each in judged.offered} - words)
        more = sorted(words - judged.only) if judged.only is not None else []
        if lacking or more:
            yield "completion", f"{shown}: lacks {lacking}, and has {more[:6]} too many"


def _is_in_loop(text: str, line: int) -> bool:
    """True for a line, from 0, in a loop of a deck whose loops end on lines of their own."""
    opened: list[bool] = []
    for each in text.split("\n")[:line]:
        opened += [each.strip().startswith("for ")] * max(each.count("{") - each.count("}"), 0)
        del opened[len(opened) - max(each.count("}") - each.count("{"), 0) :]
    return any(opened)


def _values_in(text: str) -> Iterator[tuple[str, float]]:
    for match in re.finditer(r"`([\w.]+)` = (-?[\d.]+(?:e[-+]?\d+)?)", text):
        yield match[1], float(match[2])


def _close(shown: float | None, value: float) -> bool:
    return shown is not None and abs(shown - value) <= 1e-5 * abs(value)


def _uri(file: str, deck: Path) -> str:
    if file.startswith("<"):
        return uri(LIBRARY / file[1:-1])
    return uri(deck) if Path(file).name == deck.name else uri(Path(file))


def asked(places: int, seed: int, decks: Iterable[str]) -> tuple[Counter[str], list[tuple[str, str]]]:
    """How many places of decks were asked about, by role, and what was wrong: the kind of question, and in words."""
    chance = Random(seed)
    oracles = {}
    for deck in decks:
        oracles[deck] = Oracle(deck, check(deck, include_dirs=(), defines=(), select="all"))
    pool = [(deck, where) for deck in oracles for where in sorted(oracles[deck].words)]
    chosen = sorted(chance.sample(pool, min(places, len(pool))))
    roles: Counter[str] = Counter()
    found: list[tuple[str, str]] = []
    with tempfile.TemporaryDirectory() as folder, Editor(Path(folder)) as editor:
        for deck in oracles:
            here = [where for chosen_deck, where in chosen if chosen_deck == deck]
            if not here:
                continue
            copy = Path(folder) / Path(deck).name
            copy.write_text(Path(deck).read_text())
            editor.open(copy)
            editor.settle()
            for where in here:
                for judged in oracles[deck].words[where][:1]:
                    roles[judged.role] += 1
                    found += wrong(editor, copy, judged, where)
            editor.close_all()
        assert editor.end() == 0
    return roles, found


if __name__ == "__main__":
    roles, found = asked(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0, shipped())
    for question, words in found:
        print(f"{question}: {words[:400]}")
    print(roles.most_common())
    print(f"{sum(roles.values())} places, wrong: {dict(Counter(question for question, _ in found))}")
