"""Completion, the words that may stand where a cursor is: keys, models, names, paths, units, files, directives."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress

from lsprotocol.types import CompletionItemKind as ItemKind

from ic.editor.index import DeckIndex
from ic.editor.names import KINDS_OF_KEYS, REMOVED, NamesInTexts, entry_of, models_called
from ic.editor.structure import DEFINED, NAMING, UNIT, DeckText, TextEntry, indices_around, through_loops
from ic.find import library_files
from ic.language import BLOCKS, DEFINITIONS, EXPERIMENTS, OF_A_RUN, Entry
from ic.language.bodies import JOINT_KINDS
from ic.language.unit_words import units_of
from ic.meaning.definitions.row_tables import ALL as ALL_ROWS
from ic.meaning.expressions.evaluate import CONSTANTS, FUNCTIONS, USAGE
from ic.meaning.mechanics.arm import AXES
from ic.meaning.mechanics.matter import SHAPES
from ic.meaning.runs.linear import EQUILIBRIUM
from ic.meaning.runs.requirements import PERCENTILE
from ic.meaning.runs.step_errors import STEP_ERROR
from ic.printing.models import UNIT_WORDS, summary
from ic.text.edition import EDITION_WORD, EDITIONS
from ic.text.lexer import NAME, NUMBERS, STRING, Token
from ic.text.preprocess import DIRECTIVES
from met import models
from met.frozen import frozen
from met.parameter import Parameter
from met.plan.channel import COMMAND_UNIT, MOTION, OF_JOINT
from met.plan.judged import FIGURES
from met.unit_parser import parse_unit
from met.units import ALL_UNITS

GOALS = ("minimise", "maximise")

_PATHS = ("record", "of", "against", "confirm", "choose", "signal")

_VARIED = ("vary", "with", "exclude")
"""Words that are followed by paths of parameters, not signals, which have no value before a case has run."""

_NOT_VARIED = ("seed", "record")
"""Keys of a run with a path, that no sweep varies."""

COMPARISONS = ("<", "<=", ">", ">=")

_SIGNALS_ALONE = ("record", "open")
"""Keys whose values are signals and not parameters."""

_OF_SIGNALS = (*_PATHS, *_SIGNALS_ALONE, *GOALS, "metric", "require")
"""Keys of entries whose values may contain the path of a signal."""

_OPEN, _CLOSED = ("(", "[", "{"), (")", "]", "}")

WATCHES = Parameter(name="of", doc="what the metric watches: a channel, such as `JOINT.q`")
"""The argument of a metric that its model does not declare."""

_MODELS_OF_KEYS: Mapping[str, models.Kind] = {
    "model": "servo", "command": "command", "integrator": "integrator", "metric": "metric", "bed": "bed", "law": "law",
    "guide": "guide", "sensor": "sensor",
}  # fmt: skip
"""The kinds of models that are the values of these keys."""

KEYWORD, WORD, FIELD = ItemKind.Keyword, ItemKind.EnumMember, ItemKind.Field
CLASS, FUNCTION, CONSTANT = ItemKind.Class, ItemKind.Function, ItemKind.Constant
FILE, PROPERTY, UNIT_ITEM, REFERENCE = ItemKind.File, ItemKind.Property, ItemKind.Unit, ItemKind.Reference


@frozen
class Offer:
    """A word that may stand here, its kind, and its meaning in a line."""

    word: str
    kind: ItemKind
    about: str = ""


def _offered(kind: ItemKind, meanings: Mapping[str, str]) -> list[Offer]:
    """Words of a kind, each with its meaning in a line."""
    return [Offer(word, kind, about) for word, about in meanings.items()]


def _alike(kind: ItemKind, words: Iterable[str], about: str = "") -> list[Offer]:
    """Words of a kind that have one meaning."""
    return _offered(kind, dict.fromkeys(words, about))


def offers(text: DeckText, offset: int, names: NamesInTexts, index: DeckIndex, files: Iterable[str]) -> list[Offer]:
    """The words that may stand at an offset of a text.

    files  the names of decks that an include in quotes finds
    """
    line = text.source.text[text.source.text.rfind("\n", 0, offset) + 1 : offset]
    macro = names.macros.at(text, offset)
    if line.lstrip().startswith("#") and macro is None:
        return _of_directive(line, files)
    if _is_in_comment_or_string(text, offset):
        return []
    words, around = _before(text, offset, names)
    indices = indices_around(text.entries if macro is None else names.macros.body(macro), offset)
    seen = names.seen_from(text) if "." not in (word.text for word in words[-1:]) else names
    may_stand = _of_entry(words, around, seen, index)
    by_word = {offer.word: offer for offer in reversed(may_stand) if _has_indices(offer.word, indices)}
    return list(reversed(by_word.values()))


def _has_indices(word: str, indices: Collection[str]) -> bool:
    """True except for a name with braces, `seg_{i-1}`, outside of the loop of its index."""
    return not any(set(re.findall(r"[A-Za-z_]\w*", braces)) - set(indices) for braces in re.findall(r"\{(.*?)\}", word))


def _of_directive(line: str, files: Iterable[str]) -> list[Offer]:
    """The words that may stand behind a `#` that begins a line: directives, or files behind `#include`."""
    word, _, rest = line.lstrip().removeprefix("#").lstrip().partition(" ")
    if word == "include" or word.startswith(("include<", 'include"')):
        rest = rest or word.removeprefix("include")
        if "<" in rest:
            return _alike(FILE, library_files(), "standard library")
        return _alike(FILE, files if '"' in rest else ())
    return _alike(KEYWORD, DIRECTIVES if not rest and " " not in line.lstrip() else ())


def _is_in_comment_or_string(text: DeckText, offset: int) -> bool:
    for token in text.comments:
        written = text.source.text[token.offset : token.end]
        if token.offset < offset < token.end or (offset == token.end and not written.endswith("*/")):
            return True
    return any(token.kind == STRING and token.offset < offset < token.end for token in text.tokens)


def _before(text: DeckText, offset: int, names: NamesInTexts) -> tuple[list[Token], TextEntry | None]:
    """The words of the entry before the one that is written, and the entry whose block that is in."""
    around, entries = names.around(text, offset)
    for entry in through_loops(entries):
        last = entry.words[-1].end if entry.words else 0
        opened = entry.opened.offset if entry.opened is not None else None
        if (
            entry.words
            and entry.words[0].offset < offset
            and (offset <= (opened if opened is not None else max(last, entry.closed - entry.complete)))
        ):
            words = [word for word in entry.words if word.end <= offset]
            return words[:-1] if words and words[-1].end == offset and words[-1].kind == NAME else words, around
    return [], around


def _of_entry(words: list[Token], around: TextEntry | None, names: NamesInTexts, index: DeckIndex) -> list[Offer]:
    """The words that may follow those of an entry, all before the cursor; without words, those that begin one."""
    if around is None and [word.text for word in words] == ["default"]:
        return [offer for offer in _beginnings(None, names) if offer.word in EXPERIMENTS]
    if around is None and words and words[0].text == "default":
        words = words[1:]
    if not words:
        return _beginnings(around, names)
    last = words[-1]
    texts = [word.text for word in words]
    if texts == [EDITION_WORD] and around is None:
        return _alike(CONSTANT, map(str, EDITIONS), "an edition")
    if last.text == ".":
        return _rest_of_path(words, names, index)
    if ends_a_model(texts):
        return []
    if last.kind in NUMBERS or (last.text in ("]", ")") and "=" in texts):
        return _units(_parameter(texts, around, names), names)
    if last.text in ("*", "/") and len(words) > 1 and words[-2].text in ALL_UNITS:
        return _units(None, names)
    if last.text in ("*", "/") and len(words) > 1 and words[-2].kind in NUMBERS:
        return [*_units(None, names), *_values(texts, around, names, index)]
    if last.text == "like":
        roof = ("roof",) if texts[0] in DEFINED else ()
        return [offer for offer in _named(names, texts[0], *roof) if offer.word not in texts]
    if last.text == "of" and texts[0] in OF_A_RUN:
        return _named(names, "run")
    if texts[0] in ("remove", "substitute"):
        return _named(names, *(REMOVED if texts[0] == "remove" else ("joint",)), around=around)
    if len(texts) == 1 and texts[0] in NAMING and texts[0] != "require":
        return []
    if len(texts) == 2 and texts[0] == "joint":
        return _alike(KEYWORD, JOINT_KINDS)
    if len(texts) == 2 and texts[0] == "link" and last.kind == NAME:
        return []
    if len(texts) == 2 and texts[0] in DEFINITIONS and around is None:
        return _behind_a_name(texts[0])
    return _values(texts, around, names, index)


def _behind_a_name(definition: str) -> list[Offer]:
    """The word between the name of a definition and its block."""
    if definition in OF_A_RUN:
        return [Offer("of", KEYWORD, f"names the run that the cases are of: `{definition} NAME of RUN`")]
    about = f"takes the entries of another {definition}, and changes or adds some: `{definition} NAME like OTHER`"
    return [Offer("like", KEYWORD, about)]


def _beginnings(around: TextEntry | None, names: NamesInTexts) -> list[Offer]:
    """The words with which an entry of a block may begin."""
    macros, declared = _named(names, "macro"), names.declared_in(around)
    if around is None:
        known = {
            entry.name: f"{entry.doc}: `{entry.written}`" if entry.name not in DEFINITIONS else entry.doc
            for entry in declared.values()
        }
        known["default"] = "marks the run that `met run` takes if none is named"
        return [*_offered(KEYWORD, known), *macros]
    beginnings = [_of_entry_declared(entry) for entry in declared.values()]
    if around.kind in ("servos", "initial") and around.within is not None and around.within.block == "run":
        beginnings = [*_named(names, "joint", around=around), *beginnings]
    if around.block in DEFINITIONS and around.word_behind("like"):
        beginnings.append(Offer("remove", KEYWORD, "removes an entry of the definition that this one is `like`"))
    return [*beginnings, *(_models("environment") if around.kind == "environment" else ()), *macros]


def _models(kind: models.Kind) -> list[Offer]:
    """The models of a kind."""
    return _offered(CLASS, {name: summary(model) for name, model in models.available(kind).items()})


def _parameter(texts: list[str], around: TextEntry | None, names: NamesInTexts) -> Parameter | None:
    """The parameter that an entry sets, if it is declared."""
    if around is None or not texts:
        return None
    call = open_call(texts)
    if call is not None:
        return next((parameter for parameter in call.parameters if parameter.name == call.argument), None)
    compared = [n for n, word in enumerate(texts) if word in COMPARISONS]
    if texts[0] == "require" and compared:
        return _limit(texts[compared[-1] - 1], names)
    if around.block == "servo" and texts[0] == "rate":
        return BLOCKS["rates"]["servos"].parameter
    declared = names.declared_in(around).get(texts[0])
    return declared.parameter if declared is not None else None


def _limit(metric: str, names: NamesInTexts) -> Parameter | None:
    """The limit on a metric of the texts, in the metric's unit."""
    for definition in names.by_name.get(metric, ()):
        if definition.kind == "metric" and definition.entry is not None:
            model = models.available("metric").get(names.model_of(definition.entry))
            return Parameter(name=metric, unit=model.unit, doc="the limit") if model is not None else None
    return None


def _units(wanted: Parameter | None, names: NamesInTexts) -> list[Offer]:
    """The units of the table, matching ones first, and the deck's; a wanted compound one precedes all."""
    offers, own = [], _named(names, UNIT)
    unit = wanted.unit if wanted is not None else ""
    if unit not in ("", "1") and wanted is not None:
        if not any(word in unit for word in UNIT_WORDS):
            offers.append(Offer(unit, UNIT_ITEM, f"the unit of `{wanted.name}`"))
        with suppress(ValueError, KeyError):
            offers += _units_of_table(units_of(parse_unit(unit).dimension))
            if unit in ALL_UNITS:
                return [*offers, *own]  # other units may be a factor: `deg/s`
    return [*offers, *own, *_units_of_table(ALL_UNITS)]


def _units_of_table(words: Iterable[str]) -> list[Offer]:
    return _offered(UNIT_ITEM, {word: ALL_UNITS[word].word for word in words})


def _rest_of_path(words: list[Token], names: NamesInTexts, index: DeckIndex) -> list[Offer]:
    """The words that continue a path: parts of parameters, of signals, and of definitions."""
    parts: list[str] = []
    for word in reversed(words):
        if word.text != "." and (word.kind != NAME or (parts and parts[-1] != ".")):
            break
        parts.append(word.text)
    head = "".join(reversed(parts))
    signals_alone = words[0].text in _SIGNALS_ALONE
    signals = index.signals
    if words[0].text in _OF_SIGNALS and not any(path.startswith(head) for path in signals):
        is_joint = head[:-1] in names.of_kind("joint")  # whose signals are known before the deck is without errors
        signals = tuple(f"{head}{name}" for name, *_ in (*MOTION, *OF_JOINT) if is_joint)
    paths = [(value.path, f"{value.value}; {value.doc}") for value in index.values if not signals_alone]
    paths += [(path, "signal") for path in signals] + [(path, "in the table") for path in index.cells]
    begins = re.compile(re.sub(r"\\{.*?\\}", r"[^.]+", re.escape(head)))  # `bodies.{side}_arm.`, in a loop
    about: dict[str, str] = {}
    for path, meaning in paths:
        if match := begins.match(path):
            part, _, more = path[match.end() :].partition(".")
            about.setdefault(part, "" if more else meaning)
    files = names.used.under(words[0].source.name, head[:-1].split("."))
    roofed: dict[str, str] = {}
    for name, definitions in names.by_name.items() if files else ():
        for definition in definitions:
            if definition.kind in (*DEFINED, "roof") and definition.file in files:
                roofed.setdefault(name, definition.kind)
    offers = [*_offered(FIELD, about), *_offered(REFERENCE, roofed)]
    for definition in names.by_name.get(head[:-1], ()):
        if not signals_alone and definition.kind == "servo" and definition.entry is not None:
            offers += map(_of_parameter, names.parameters_of(definition.entry))
    return offers


def _values(texts: list[str], around: TextEntry | None, names: NamesInTexts, index: DeckIndex) -> list[Offer]:
    """The words with which a value may begin."""
    key = texts[0]
    where = around.kind if around is not None else ""
    wanted, call = _parameter(texts, around, names), open_call(texts)
    if wanted is not None and wanted.words:
        return _alike(WORD, wanted.words, wanted.doc)
    if key in ("against", "confirm") and around is not None:
        return _sweeps_of(around.word_behind("of"), names)
    if texts[-2:] == ["rows", "="]:
        return _alike(WORD, [ALL_ROWS], "requires that every row is used")
    if where == "servos":
        return _named(names, "servo", "roof")
    if key in KINDS_OF_KEYS and key != "of" and where in ("joint", "loop", "run"):
        return _bodies(KINDS_OF_KEYS[key][0], around, names)
    if texts[-2:] == ["shape", "="] and where == "link":
        return _alike(CLASS, SHAPES)
    offers = _words_of_value(texts, where)
    kind = _MODELS_OF_KEYS.get(key, "environment" if where == "environment" else None)
    if kind is not None and "=" in texts and "(" not in texts:
        offers += _models(kind)
        if key != "command":
            return offers
        offers += _alike(FUNCTION, COMMAND_UNIT, "a command of this kind")
    if texts[-1] == "(" and texts[-2:-1] and texts[-2] in COMMAND_UNIT:
        offers += [*_models("command"), *_named(names, "guide")]
    if key in GOALS or key == "require":
        return offers + _of_goal(texts, around, names, index)
    if key in _VARIED:
        return offers + _of_varied(texts, names, index)
    watches = key == "metric" and call is not None and call.argument == WATCHES.name
    if key in _SIGNALS_ALONE:
        return [*offers, *_heads(index.signals), *_named(names, "joint", "macro", around=around)]
    if key in _PATHS or watches:
        offers += _heads([*(value.path for value in index.values), *index.signals])
        offers += _named(names, "joint", "metric", "servo", around=around)
    if call is not None and texts[-1] in ("(", ",", ";") and not call.argument:
        offers += [_of_parameter(parameter) for parameter in call.parameters if parameter.name not in call.earlier]
        if key == "shape":
            return offers
    return offers + _of_expression(names)


def _words_of_value(texts: list[str], where: str) -> list[Offer]:
    """The words of the language with which a value of some keys may begin, beside those of any value."""
    if where == "joint" and texts in (["axis", "="], ["axis", "=", "-"]):
        return _alike(WORD, AXES, "an axis of the joint's frame")
    if where == "initial" and texts[-2:] in (["q", "="], ["qd", "="]):
        return _alike(WORD, ["command"], "the initial value of the joint's command")
    if where == "linear" and texts == ["at", "="]:
        return _alike(FUNCTION, [EQUILIBRIUM], "the equilibrium near positions of the joints")
    return []


def _bodies(kind: str, around: TextEntry | None, names: NamesInTexts) -> list[Offer]:
    """The names of links, joints or arms that a key may have as its value."""
    base = _alike(CONSTANT, ["base"] if kind == "link" else (), "the body that the arm stands on")
    return [*base, *_named(names, kind, around=around), *(_named(names, "roof") if kind in DEFINED else ())]


def _heads(paths: Iterable[str]) -> list[Offer]:
    """The first words of some paths."""
    return _alike(FIELD, (path.partition(".")[0] for path in paths), "the first word of a path")


def _of_expression(names: NamesInTexts) -> list[Offer]:
    """The words that may occur in any value."""
    functions = _offered(FUNCTION, {function: ", ".join(USAGE[function]) for function in FUNCTIONS})
    return [*_named(names, "let", "macro", "roof"), *functions, *_alike(CONSTANT, CONSTANTS)]


def _of_goal(texts: list[str], around: TextEntry | None, names: NamesInTexts, index: DeckIndex) -> list[Offer]:
    """The words after `require`, `minimise` and `maximise`: metrics, then a limit; in a call, its signals."""
    if texts.count("(") > texts.count(")"):
        signals = [*_named(names, "metric", "linear", "joint", around=around), *_heads(index.signals)]
        return [*signals, *_of_expression(names)]
    if any(text in COMPARISONS for text in texts):
        return [*_named(names, "servo"), *_of_expression(names)]
    over_time = [name for name, model in models.available("metric").items() if model.condition]
    figures = (*over_time, *FIGURES, STEP_ERROR, PERCENTILE) if texts[0] == "require" else ()
    return [
        *_named(names, "metric", "macro", around=around),
        *_alike(FUNCTION, figures, "a figure to require a limit of"),
    ]


def _of_varied(texts: list[str], names: NamesInTexts, index: DeckIndex) -> list[Offer]:
    """The words after `vary`, `with` and `exclude when`: a path of a parameter, then its values."""
    if "=" in texts:
        return [*_named(names, "arm" if texts[-4:-1] == ["arm", "=", "["] else "servo"), *_of_expression(names)]
    heads = _heads(value.path for value in index.values)
    macro = _alike(KEYWORD, ["macro"] if texts == ["vary"] else (), "a macro of the deck: `vary macro NAME = [...];`")
    return [
        *(head for head in heads if texts[0] != "vary" or head.word not in _NOT_VARIED),
        *macro,
        *_named(names, "joint", "servo", "let", "macro", "roof"),
        *(_of_expression(names) if texts[0] == "exclude" else ()),
    ]


def _sweeps_of(run: str, names: NamesInTexts) -> list[Offer]:
    """The sweeps of a run, and those that are made of others."""
    sweeps = (
        definition.token.text
        for definitions in names.by_name.values()
        for definition in definitions
        if definition.kind == "sweep" and definition.entry is not None
        if definition.entry.word_behind("of") in ("", run)
    )
    return _alike(REFERENCE, sweeps, "sweep")


def _named(names: NamesInTexts, *kinds: str, around: TextEntry | None = None) -> list[Offer]:
    """The names of some kinds. around: restricts names to those of arms and runs that the surrounding entries may mean,
    if there are any"""
    icons = {"let": ItemKind.Variable, "macro": CONSTANT, "run": FUNCTION, "unit": UNIT_ITEM}
    owners = names.owners(around) if around is not None else []
    offers: list[Offer] = []
    for kind in kinds:
        known = names.of_kind(kind)
        own = [name for name in known if any(d.kind == kind and d.owner in owners for d in names.by_name[name])]
        for name in own or known:
            written = names.written_out(name, kind, owners) if "{" in name else ()
            offers += _alike(icons.get(kind, REFERENCE), (name, *written), kind)
    return offers


def _of_parameter(parameter: Parameter) -> Offer:
    """The name of a model's parameter."""
    return _of_entry_declared(entry_of(parameter))


def _of_entry_declared(entry: Entry) -> Offer:
    """The first word of a declared entry, with its meaning, unit and default."""
    unit = f"in {UNIT_WORDS.get(entry.unit, entry.unit)}" if entry.unit not in ("", "1") else ""
    return Offer(entry.name, PROPERTY, "; ".join(filter(None, (entry.doc, unit, entry.default_in_words))))


@frozen
class OpenCall:
    """A call whose parenthesis no word before the cursor closes.

    name        the function, model or shape
    argument    the argument whose value is written, `radius` in `cylinder(radius = `; "" where a name may stand
    earlier     the arguments that are written before it
    parameters  those that it takes by name; none of a function
    """

    name: str
    argument: str
    earlier: tuple[str, ...]
    parameters: tuple[Parameter, ...]


def open_call(texts: Sequence[str]) -> OpenCall | None:
    """The innermost call that the words of an entry, those before a cursor, leave open; None outside of calls."""
    depth, opened = 0, len(texts) - 1
    while opened >= 0 and not (texts[opened] == "(" and depth == 0):
        depth += (texts[opened] in _CLOSED) - (texts[opened] in _OPEN)
        opened -= 1
        depth = max(depth, 0)  # a bracket that is open, as in `size = [1, `
    if opened < 1:
        return None
    depth, argument, arguments = 0, "", []
    for n in range(opened + 1, len(texts)):
        word = texts[n]
        depth += (word in _OPEN) - (word in _CLOSED)
        if depth == 0 and word == "=":
            argument = texts[n - 1]
        elif depth == 0 and word in (",", ";"):
            arguments.append(argument)
            argument = ""
    name = texts[opened - 1]
    return OpenCall(name, argument, tuple(arguments), _parameters(name, texts[0]))


def ends_a_model(texts: Sequence[str]) -> bool:
    """True where the last word closes a call that is not a number: of a model, of a shape, of a kind of command."""
    call = open_call(texts[:-1]) if texts[-1:] == [")"] else None
    return call is not None and (call.name in COMMAND_UNIT or bool(call.parameters))


def _parameters(name: str, entry: str) -> tuple[Parameter, ...]:
    """The arguments of a call in an entry that begins with this word: `max` is a metric, and a function elsewhere."""
    if entry == "shape":
        return SHAPES[name].parameters if name in SHAPES else ()
    metric = models.available("metric").get(name)
    if metric is not None and entry == "metric":
        return (WATCHES, *models.written(metric))
    if metric is not None and entry != "require" and entry not in GOALS:
        return ()
    called = [models.written(model) for model in models_called(name).values()]
    return called[0] if called else ()
