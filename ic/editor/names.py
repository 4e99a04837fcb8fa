"""The names of a deck, with their definitions and uses in the texts of all its files."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from types import MappingProxyType
from typing import Any

from ic.editor.structure import (
    DEFINED,
    LETS,
    UNIT,
    DecksUsed,
    DeckText,
    TextEntry,
    TextMacro,
    entries_of,
    flattened,
    innermost_around,
    with_whole_names,
)
from ic.grammar.uses import USE
from ic.language import BLOCKS, DEFINITIONS, OF_A_RUN, TOP_LEVEL, Entry
from ic.printing.models import default
from ic.text.lexer import NAME, NUMBERS, Token
from ic.text.limits import Findings, GiveUp
from ic.text.macros import Macros
from ic.text.substitute import Argument, Macro
from met import models
from met.frozen import frozen
from met.parameter import Parameter

BASE_WORDS = {"like": None, "of": "run"}
"""Words before the name of a definition: of the same kind where the value is None."""

_BRACES = re.compile(r"\{[^{}]*\}")

_OF_RUNS: Mapping[str, str] = MappingProxyType({
    "metrics": "metric", "guides": "guide", "sensors": "sensor", "payloads": "payload", "signals": "signal",
})  # fmt: skip

UNDER: Mapping[str, str] = MappingProxyType({"links": "link", "initial": "joint", **_OF_RUNS})
"""The kinds of names after these first words of paths."""

KINDS_OF_KEYS: Mapping[str, tuple[str, ...]] = MappingProxyType({
    "arm": ("arm",), "parent": ("link",), "child": ("link",), "link": ("link",), "to": ("link",), "leader": ("joint",),
    "of": ("joint", "linear"),
})  # fmt: skip
"""The kinds of names in the values of these keys."""

_VALUES = ("let", "macro", "guide", "joint", "metric", "signal", "require", "sweep", "run", "servo", "link", "linear",
           "unit")  # fmt: skip
"""The kinds of names in any other value, the likeliest first."""

REMOVED = ("metric", "require", "guide", "sensor", "payload", "signal", "linear")
"""The kinds of names that `remove` removes."""


OUTERMOST = (*DEFINED, "roof", "run", "sweep", "search", "tune", "macro", UNIT)
"""The kinds of names that belong to a deck itself, not to an arm or a run."""

MOST_TOKENS = 20_000
"""Number of tokens that uses of macros make in a text after which no further use is read."""

_DEFINITIONS: Mapping[str, Entry] = MappingProxyType({
    name: Entry(name=name, written=BLOCKS[name].written, doc=BLOCKS[name].doc, default="") for name in DEFINITIONS
})  # fmt: skip

NO_NAMES: Mapping[tuple[str, str], Sequence[str]] = MappingProxyType({})


@frozen
class NameInText:
    """A name that is defined: its kind (`servo`, `let`, `link`, `macro`), its token, and its entry if it has one.

    by_macro  whether a macro makes it, of an argument
    """

    kind: str
    token: Token
    entry: TextEntry | None
    by_macro: bool = False

    @property
    def file(self) -> str:
        return self.token.source.name

    @property
    def owner(self) -> str:
        """The arm or run of the name; "" for a deck's own name."""
        around = self.entry.within if self.entry is not None else None
        return around.named.text if around is not None and around.named is not None else ""


class TolerantMacros(Macros):
    """Macros whose uses may have too few arguments, or too many; what they find wrong is of no interest."""

    def __init__(self) -> None:
        super().__init__(Findings())

    def _wrong_number(
        self, token: Token, macro: Macro, arguments: list[Argument], close: Token
    ) -> list[Argument] | None:
        parameters = macro.parameters or ()
        return [*arguments, *(Argument() for _ in parameters)][: len(parameters)]


class MacrosInTexts:
    """The macros of some texts, the blocks in which their bodies stand, and the entries that their uses make.

    Conditions are ignored, and a use that has no end is closed: for an editor, a missing name is better than no answer.
    """

    def __init__(self, texts: Sequence[DeckText]) -> None:
        self._texts = texts
        self.by_name: dict[str, list[TextMacro]] = {}
        self._defined: dict[str, Macro] = {}
        for text in texts:
            self._defined |= text.defined
            for macro in text.macros:
                self.by_name.setdefault(macro.name.text, []).append(macro)
        self._uses = dict(self._first_uses()) if self.by_name else {}
        self._bodies: dict[int, list[TextEntry]] = {}

    def meant(self, use: Token) -> TextMacro | None:
        """The macro that a token uses: the last that its text defines before it, or else any."""
        macros = self.by_name.get(use.text, ())
        before = [macro for macro in macros if macro.name.source is use.source and macro.name.offset <= use.offset]
        return before[-1] if before else macros[-1] if macros else None

    @staticmethod
    def at(text: DeckText, offset: int) -> TextMacro | None:
        """The macro in whose body, or on whose line after it, an offset of a text is."""
        for macro in text.macros:
            begin = macro.body[0].offset if macro.body else macro.end + 1
            behind = text.source.text[macro.end : offset]
            if begin <= offset and (offset <= macro.end or not behind.strip(" \t")):
                return macro
        return None

    def body(self, macro: TextMacro) -> list[TextEntry]:
        """The entries of a macro's body, inside of what stands around its first use."""
        key = id(macro)
        if key not in self._bodies:
            self._bodies[key] = []  # for a macro that uses itself
            self._bodies[key] = entries_of(macro.body, macro.end, self._around_use(macro))
        return self._bodies[key]

    def _around_use(self, macro: TextMacro) -> TextEntry | None:
        """The entry of the deck in which the macro is first used; None where it is not used."""
        text, use = self._uses.get(macro.name.text, (None, None))
        if text is None or use is None:
            return None
        inside = self.at(text, use.offset)
        if inside is None:
            return text.around(use.offset)
        body = self.body(inside)
        return innermost_around(body, use.offset) or (body[0].within if body else self._around_use(inside))

    def _first_uses(self) -> Iterator[tuple[str, tuple[DeckText, Token]]]:
        """The first use of each macro; one in a body only where there is no other."""
        for in_bodies in (True, False):
            for text in reversed(self._texts):
                lines = (token for macro in text.macros for token in macro.body)
                for token in reversed(list(lines) if in_bodies else text.tokens):
                    if token.text in self.by_name:
                        yield token.text, (text, token)

    def entries_in(self, text: DeckText) -> Iterator[TextEntry]:
        """The entries that uses of macros make in a text, where the use is an entry, or begins one; each token stands
        where it was written, in a body or in an argument."""
        macros = {**self._defined, **text.defined}
        count, reader = 0, None
        for entry in text.all_entries() if macros else ():
            if count < MOST_TOKENS and entry.words and entry.words[0].text in macros:
                reader, closing = reader or TolerantMacros(), Token("CPP_RPAREN", ")", text.source, entry.closed, 0)
                reader.macros = macros
                try:
                    tokens = reader.expand_macros([*map(copy, entry.words), closing])
                except GiveUp:
                    reader = None
                    continue
                count += len(tokens)
                yield from flattened(entries_of(with_whole_names(tokens), entry.closed, entry.within))


class NamesInTexts:
    """The definitions of some texts, by name.

    names_by_owner  by kind and arm or run, the names that it had when the deck was last compiled: what loops make is
           among them
    """

    def __init__(
        self, texts: Iterable[DeckText], names_by_owner: Mapping[tuple[str, str], Sequence[str]] = NO_NAMES
    ) -> None:
        """Find all definitions of the texts of one deck. names_by_owner: as of the class"""
        self._names_by_owner = names_by_owner
        self.texts = tuple(texts)
        self.used = DecksUsed(self.texts)
        self.macros = MacrosInTexts(self.texts)
        self._entries: dict[DeckText, list[TextEntry]] = {}
        self.by_name: dict[str, list[NameInText]] = {}
        for text in self.texts:
            for definition in self._defined(text):
                self.by_name.setdefault(definition.token.text, []).append(definition)
        self._all: Mapping[str, list[NameInText]] = self.by_name
        self._with_braces = {name: definitions for name, definitions in self.by_name.items() if "{" in name}

    def of_kind(self, *kinds: str) -> list[str]:
        """The names of these kinds, each once."""
        return [
            name
            for name, definitions in self.by_name.items()
            if any(definition.kind in kinds for definition in definitions)
        ]

    def written_out(self, name: str, kind: str, owners: Sequence[str]) -> list[str]:
        """The names that a loop makes from one with braces: those of these arms and runs, or of all where there are
        none."""
        pattern = re.compile(_BRACES.sub(r"\\w+", name))
        lists = (
            names
            for (loop_kind, owner), names in self._names_by_owner.items()
            if loop_kind == kind and (not owners or owner in owners)
        )
        return [word for names in lists for word in names if pattern.fullmatch(word)]

    def entry_at(self, text: DeckText, token: Token) -> TextEntry | None:
        """The entry of a word of a text, before its block; also one in a macro's body."""
        entries = self.entries(text)
        n = bisect_right(entries, token.offset, key=lambda entry: entry.words[0].offset) - 1
        return entries[n] if n >= 0 and token.offset <= entries[n].words[-1].offset else None

    def entries(self, text: DeckText) -> list[TextEntry]:
        """All entries of a text that have words, those in macros' bodies too, in the order of their first words."""
        if text not in self._entries:
            entries = [*text.all_entries(), *(e for macro in text.macros for e in flattened(self.macros.body(macro)))]
            self._entries[text] = sorted((e for e in entries if e.words), key=lambda e: e.words[0].offset)
        return self._entries[text]

    def around(self, text: DeckText, offset: int) -> tuple[TextEntry | None, list[TextEntry]]:
        """The innermost entry in whose block an offset is, also in a macro's body, and the entries beside it."""
        macro = self.macros.at(text, offset)
        if macro is None:
            innermost = text.around(offset)
            return innermost, text.entries if innermost is None else innermost.entries
        body = self.macros.body(macro)
        innermost = innermost_around(body, offset)
        return (body[0].within if body else None, body) if innermost is None else (innermost, innermost.entries)

    def meant_in(self, text: DeckText, token: Token) -> list[NameInText]:
        """The definitions that a word of a text means: of a macro's parameter, where the macro has it."""
        macro = next(
            (candidate for candidate in text.macros if candidate.name.offset <= token.offset <= candidate.end), None
        )
        for parameter in macro.parameters or () if macro is not None else ():
            if parameter.text == token.text:
                return [NameInText("parameter", parameter, None)]
        return self.meant(token, self.entry_at(text, token))

    def meant(self, token: Token, entry: TextEntry | None) -> list[NameInText]:
        """The definitions that a word in an entry means: those of the kind that is expected there."""
        definitions = self.by_name.get(token.text) or self._made_by_loops(token.text)
        if any(_same(definition.token, token) for definition in definitions):
            return [definition for definition in definitions if _same(definition.token, token)]
        under = self._under_roof(token, entry)
        if under is not None:
            return under
        definitions = self._seen(definitions, token.source.name)
        for kind in _wanted(token, entry):
            of_kind = [definition for definition in definitions if definition.kind == kind]
            if of_kind:
                macro = self.macros.meant(token) if kind == "macro" else None
                return [
                    definition for definition in of_kind if macro is not None and definition.token is macro.name
                ] or (self._of_owner(of_kind, entry))
        return definitions if entry is None else []

    def _seen(self, definitions: list[NameInText], file: str) -> list[NameInText]:
        """The definitions among these that a file's text sees without a roof."""
        seen = self.used.seen_from(file)
        return [definition for definition in definitions if definition.file in seen or definition.kind not in OUTERMOST]

    def seen_from(self, text: DeckText) -> NamesInTexts:
        """The names that a text sees without a roof, and those of arms and runs."""
        names = copy(self)
        seen = {name: self._seen(definitions, text.source.name) for name, definitions in self.by_name.items()}
        names.by_name = {name: definitions for name, definitions in seen.items() if definitions}
        return names

    def _under_roof(self, token: Token, entry: TextEntry | None) -> list[NameInText] | None:
        """The definitions that a word after roofs means, `d1` of `cell.panda.d1`, and the roof that the word before
        means; None where there is no roof."""
        words = entry.words if entry is not None and entry.kind != USE and self.used else []
        index = next((i for i, word in enumerate(words) if word.offset == token.offset), None)
        if index is None:
            return None
        roofs: list[str] = []
        begin = index
        while begin >= 2 and words[begin - 1].text == "." and words[begin - 2].kind == NAME:
            begin -= 2
            roofs.insert(0, words[begin].text)
        files = self.used.under(token.source.name, roofs)
        is_before_dot = index + 1 < len(words) and words[index + 1].text == "."
        roof = self.used.roofs(files).get(token.text) if is_before_dot else None
        if roof is not None:
            return [NameInText("roof", roof.roof, None)]
        if not roofs or not files:
            return None
        return [
            definition
            for definition in self._all.get(token.text, ())
            if definition.kind in DEFINED and definition.file in files
        ]

    def _of_owner(self, definitions: list[NameInText], entry: TextEntry | None) -> list[NameInText]:
        """The definitions of the arm or the run that an entry is about, if there are some."""
        if len(definitions) < 2 or entry is None:
            return definitions
        for owner in self.owners(entry):
            own = [definition for definition in definitions if definition.owner == owner]
            if own:
                return own
        return definitions

    def owners(self, entry: TextEntry) -> list[str]:
        """The arms and runs whose names an entry may mean, its own first, then those that it is `like`."""
        while entry.within is not None:
            entry = entry.within
        owners: list[str] = []
        waiting = [entry]
        while waiting and len(owners) < 16:
            entry = waiting.pop(0)
            if entry.named is not None:
                owners.append(entry.named.text)
            bases = [*self._named_behind("like", entry, entry.kind)]
            bases += self._named_behind("of", entry, "run") if entry.kind in OF_A_RUN else ()
            for inner in entry.entries:
                bases += self._named_behind("=", inner, "arm") if inner.texts[:2] == ["arm", "="] else ()
            waiting += [base.entry for base in bases if base.entry is not None]
        return owners

    def _named_behind(self, word: str, entry: TextEntry, kind: str) -> list[NameInText]:
        """The definitions of a kind that an entry names after a word, with or without roofs before the name."""
        token = entry.name_behind(word)
        if token is None:
            return []
        under = self._under_roof(token, entry)
        definitions = under if under is not None else self._seen(self._all.get(token.text, []), token.source.name)
        return [definition for definition in definitions if definition.kind == kind]

    def _made_by_loops(self, name: str) -> list[NameInText]:
        """The definitions whose names with braces may be this one: `seg_{i}` of `seg_7` and of `seg_{i-1}`."""
        if not self._with_braces:
            return []
        plain = _BRACES.sub("0", name)
        return [
            definition
            for written, definitions in self._with_braces.items()
            if re.fullmatch(_BRACES.sub(r"\\w+", written), plain)
            for definition in definitions
        ]

    def uses(self, name: str) -> Iterator[tuple[Token, list[NameInText]]]:
        """All tokens of a name in the texts, including its definitions, each with the definitions that it means."""
        for text in self.texts:
            for token in (*text.tokens, *(token for line in text.directives for token in line.words)):
                if token.kind == NAME and token.text == name:
                    yield token, self.meant_in(text, token)

    def model_of(self, entry: TextEntry) -> str:
        """The model of a servo or a metric, through those that it is `like`; "" where it is not written."""
        for _ in range(16):
            for inner in entry.entries:
                if inner.kind == "model" and len(inner.words) > 2:
                    return inner.words[2].text
            behind = "=" if "=" in entry.texts else "like"
            if behind == "=" and entry.block != "servo":
                return entry.word_behind("=")
            definitions = [
                definition
                for definition in self._named_behind(behind, entry, entry.block)
                if definition.entry is not None
            ]
            if not definitions or definitions[0].entry is entry:
                return ""
            assert definitions[0].entry is not None
            entry = definitions[0].entry
        return ""

    def parameters_of(self, entry: TextEntry) -> tuple[Parameter, ...]:
        """The parameters of an entry's model."""
        entry_kind = entry.block or entry.kind
        for kind, model in models_called(self.model_of(entry)).items():
            if kind == entry_kind or (entry_kind not in models.GROUPS and kind not in ("servo", "metric")):
                return models.written(model)
        return ()

    def declared_in(self, around: TextEntry | None) -> dict[str, Entry]:
        """The entries that may stand in the block of an entry, or in a deck itself, by their first words: those of the
        language, then the parameters of the block's model, which are written as their names alone."""
        if around is None:
            return {**_DEFINITIONS, **{entry.name: entry for entry in TOP_LEVEL.entries}}
        block = BLOCKS.get(around.block, TOP_LEVEL)
        declared = {entry.name.split()[0]: entry for entry in block.entries if block is not TOP_LEVEL}
        for parameter in self.parameters_of(around):
            declared.setdefault(parameter.name, entry_of(parameter))
        return declared

    def _defined(self, text: DeckText) -> Iterator[NameInText]:
        """The names that a text defines: blocks, decks that it uses, macros, and what its macros expand to."""
        yield from _named(text.all_entries(), by_macro=False)
        yield from (NameInText("roof", use.roof, None) for use in text.uses)
        parameters = {parameter.text for macro in text.macros for parameter in macro.parameters or ()}
        for macro in text.macros:
            yield NameInText("macro", macro.name, None)
        known: set[tuple[str, int]] = set()
        for definition in _named(self.macros.entries_in(text), by_macro=True):
            if (
                definition.token.text not in parameters
                and (definition.token.text, definition.token.offset) not in known
            ):
                known.add((definition.token.text, definition.token.offset))
                yield definition


def models_called(name: str) -> dict[models.Kind, Any]:
    """The models of a name, by their kinds."""
    return {kind: models.available(kind)[name] for kind in models.GROUPS if name in models.available(kind)}


def entry_of(parameter: Parameter) -> Entry:
    """The declaration of a model's parameter as an entry of a block, written as its name alone."""
    name, written = parameter.name, default(parameter)
    return Entry(name=name, written=name, doc=parameter.doc, default=written, parameter=parameter)


def _named(entries: Iterable[TextEntry], by_macro: bool) -> Iterator[NameInText]:
    """The names that these entries define. by_macro: whether the entries are from a macro's expansion"""
    for entry in entries:
        name = entry.named
        if name is not None:
            yield NameInText("let" if entry.kind in LETS else entry.kind, name, entry, by_macro)


def _same(token: Token, other: Token) -> bool:
    """True for the same token, and for one that stands for the same text."""
    return token.source is other.source and token.offset == other.offset and token.text == other.text


def _wanted(token: Token, entry: TextEntry | None) -> Sequence[str]:
    """The kinds of definitions that a word may mean at its place, the likeliest first."""
    words = entry.words if entry is not None else []
    index = next((i for i, word in enumerate(words) if word is token or word.offset == token.offset), None)
    if entry is None or index is None:
        return ()
    before = words[index - 1].text if index else ""
    behind = words[index + 1].text if index + 1 < len(words) else ""
    around = entry.within.kind if entry.within is not None else ""
    if words[index] is entry.head or (before in ("[", ",") and words[0].text == "[" and "=" not in entry.texts[:index]):
        return ("joint", "macro") if around in ("servos", "initial") else ("macro",)
    if before in BASE_WORDS and index > 1:
        return (BASE_WORDS[before] or entry.kind,)
    if before == "substitute":
        return ("joint",)
    if entry.kind == "remove":
        return REMOVED
    if index and (words[index - 1].kind in NUMBERS or (before in ("*", "/", ")", "]") and entry.kind == UNIT)):
        return (UNIT, *_VALUES)
    if before == ".":
        return (UNDER[words[index - 2].text],) if index >= 2 and words[index - 2].text in UNDER else ()
    if behind == ".":
        return ("joint", "servo", "arm", "run", "let")
    if around == "servos" and before == "=":
        return ("servo", "macro")
    if before == "=" and index >= 2:
        key = words[index - 2].text
        return (*KINDS_OF_KEYS[key], "let", "macro", "metric", "signal") if key in KINDS_OF_KEYS else _VALUES
    if entry.kind in ("require", "exclude", "maximise", "minimise"):
        return ("metric", *_VALUES)
    return (
        _VALUES if "=" in entry.texts or "(" in entry.texts or before in ("against", "confirm", "macro") else ("macro",)
    )
