"""Completion, the words that may stand where a cursor is: keys, models, names, paths, units, files, directives."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator

from lsprotocol import types

from ic.editor.calls import WATCHES, ends_a_model, open_call
from ic.editor.index import DeckIndex
from ic.editor.names import REMOVED, NamesInTexts
from ic.editor.structure import DEFINED, NAMING, UNIT, DeckText, TextEntry, indices_around, through_loops
from ic.find import library_files
from ic.language import BLOCKS, DEFINITIONS, EXPERIMENTS, OF_A_RUN, TOP_LEVEL
from ic.language.bodies import JOINT_KINDS
from ic.language.unit_words import units_of
from ic.meaning.definitions.row_tables import ALL as ALL_ROWS
from ic.meaning.expressions.evaluate import CONSTANTS, FUNCTIONS, USAGE
from ic.meaning.mechanics.arm import AXES
from ic.meaning.mechanics.matter import SHAPES
from ic.meaning.runs.linear import EQUILIBRIUM
from ic.meaning.runs.requirements import PERCENTILE
from ic.meaning.runs.step_errors import STEP_ERROR
from ic.printing.models import summary
from ic.text.edition import EDITION_WORD, EDITIONS
from ic.text.lexer import NAME, NUMBERS, STRING, Token
from ic.text.preprocess import DIRECTIVES
from met import models
from met.frozen import frozen
from met.parameter import Parameter
from met.plan.channel import COMMAND_UNIT, MOTION, OF_JOINT
from met.plan.linear_uses import FIGURES
from met.unit_parser import parse_unit
from met.units import ALL_UNITS

GOALS = ("minimise", "maximise")

_PATHS = ("record", "of", "against", "confirm", "choose", "signal")

_VARIED = ("vary", "with", "exclude")
"""Words that are followed by paths of parameters, not signals, which have no value before a case has run."""

_NOT_VARIED = ("seed", "record")
"""Keys of a run with a path, that no sweep varies."""

COMPARISONS = ("<", "<=", ">", ">=")

_UNIT_WORDS = {"of": "the unit of the signal", "command": "the unit of the command"}
"""Units that depend on another word of the deck, in words."""

_SIGNALS_ALONE = ("record", "open")
"""Keys whose values are signals and not parameters."""

_OF_SIGNALS = (*_PATHS, *_SIGNALS_ALONE, *GOALS, "metric", "require")
"""Keys of entries whose values may contain the path of a signal."""


@frozen
class Offer:
    """A word that may stand here, its kind, and its meaning in a line."""

    word: str
    kind: types.CompletionItemKind
    about: str = ""


def offers(text: DeckText, offset: int, names: NamesInTexts, index: DeckIndex, files: Iterable[str]) -> list[Offer]:
    """The words that may stand at an offset of a text.

    files  the names of decks that an include in quotes finds
    """
    line = text.source.text[text.source.text.rfind("\n", 0, offset) + 1 : offset]
    if line.lstrip().startswith("#") and names.macros.at(text, offset) is None:
        return list(_of_directive(line, files))
    if _is_in_comment_or_string(text, offset):
        return []
    words, around = _before(text, offset, names)
    macro = names.macros.at(text, offset)
    indices = indices_around(text.entries if macro is None else names.macros.body(macro), offset)
    seen = names.seen_from(text) if "." not in (word.text for word in words[-1:]) else names
    may_stand = [offer for offer in _of_entry(words, around, seen, index, offset) if _has_indices(offer.word, indices)]
    by_word = {offer.word: offer for offer in reversed(may_stand)}
    return list(reversed(by_word.values()))


def _has_indices(word: str, indices: Collection[str]) -> bool:
    """True except for a name with braces, `seg_{i-1}`, outside of the loop of its index."""
    return not any(set(re.findall(r"[A-Za-z_]\w*", braces)) - set(indices) for braces in re.findall(r"\{(.*?)\}", word))


def _of_directive(line: str, files: Iterable[str]) -> Iterator[Offer]:
    word, _, rest = line.lstrip().removeprefix("#").lstrip().partition(" ")
    if word == "include" or word.startswith(("include<", 'include"')):
        rest = rest or word.removeprefix("include")
        if "<" in rest:
            yield from (
                Offer(library_file, types.CompletionItemKind.File, "standard library")
                for library_file in library_files()
            )
        elif '"' in rest:
            yield from (Offer(file, types.CompletionItemKind.File) for file in files)
    elif not rest and " " not in line.lstrip():
        yield from (Offer(directive, types.CompletionItemKind.Keyword) for directive in DIRECTIVES)


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


def _of_entry(
    words: list[Token], around: TextEntry | None, names: NamesInTexts, index: DeckIndex, offset: int
) -> Iterator[Offer]:
    """The words that may follow those of an entry, all before the cursor; without words, those that begin one."""
    if not words:
        yield from _beginnings(around, names)
        return
    last = words[-1]
    texts = [word.text for word in words]
    if texts[0] == "default" and around is None:
        texts, words = texts[1:], words[1:]
        if not words:
            yield from (
                Offer(experiment, types.CompletionItemKind.Keyword, BLOCKS[experiment].doc)
                for experiment in EXPERIMENTS
            )
            return
    if texts == [EDITION_WORD] and around is None:
        yield from (Offer(str(edition), types.CompletionItemKind.Constant, "an edition") for edition in EDITIONS)
        return
    if last.text == ".":
        yield from _rest_of_path(words, names, index)
        return
    if ends_a_model(texts):
        return
    if last.kind in NUMBERS or (last.text in ("]", ")") and "=" in texts):
        yield from _units(_parameter(texts, around, names), names)
        return
    if last.text in ("*", "/") and len(words) > 1 and (words[-2].text in ALL_UNITS or words[-2].kind in NUMBERS):
        yield from _units(None, names)
        if words[-2].kind not in NUMBERS:
            return
    if last.text == "like":
        roof = ("roof",) if texts[0] in DEFINED else ()
        yield from (offer for offer in _named(names, texts[0], *roof) if offer.word not in texts)
        return
    if last.text == "of" and texts[0] in OF_A_RUN:
        yield from _named(names, "run")
        return
    if len(texts) == 1 and texts[0] in NAMING and texts[0] != "require":
        return
    if len(texts) == 2 and texts[0] == "joint":
        yield from (Offer(joint_kind, types.CompletionItemKind.Keyword) for joint_kind in JOINT_KINDS)
        return
    if len(texts) == 2 and texts[0] == "link" and last.kind == NAME:
        return
    if len(texts) == 2 and texts[0] in DEFINITIONS and around is None:
        yield from _behind_a_name(texts[0])
        return
    if texts[0] == "remove":
        yield from _named(names, *REMOVED, around=around)
        return
    if texts[0] == "substitute":
        yield from _named(names, "joint", around=around)
        return
    yield from _values(texts, around, names, index)


def _behind_a_name(definition: str) -> Iterator[Offer]:
    """The words between the name of a definition and its block."""
    if definition in OF_A_RUN:
        yield Offer(
            "of", types.CompletionItemKind.Keyword, f"names the run that the cases are of: `{definition} NAME of RUN`"
        )
    else:
        about = f"takes the entries of another {definition}, and changes or adds some: `{definition} NAME like OTHER`"
        yield Offer("like", types.CompletionItemKind.Keyword, about)


def _beginnings(around: TextEntry | None, names: NamesInTexts) -> Iterator[Offer]:
    """The words with which an entry of a block may begin."""
    if around is None:
        yield from (
            Offer(definition, types.CompletionItemKind.Keyword, BLOCKS[definition].doc) for definition in DEFINITIONS
        )
        for entry in TOP_LEVEL.entries:
            yield Offer(entry.name, types.CompletionItemKind.Keyword, f"{entry.doc}: `{entry.written}`")
        yield Offer("default", types.CompletionItemKind.Keyword, "marks the run that `met run` takes if none is named")
        yield from _named(names, "macro")
        return
    block = BLOCKS.get(around.block)
    if around.kind in ("servos", "initial") and around.within is not None and around.within.block == "run":
        yield from _named(names, "joint", around=around)
    if block is not None:
        for entry in block.entries:
            default = entry.default if entry.default.startswith("needed") else f"default: {entry.default}"
            about = f"{entry.doc}; {default}" if entry.default else entry.doc
            yield Offer(entry.name, types.CompletionItemKind.Property, about)
        if around.block in DEFINITIONS and around.word_behind("like"):
            yield Offer(
                "remove", types.CompletionItemKind.Keyword, "removes an entry of the definition that this one is `like`"
            )
    yield from (_of_parameter(parameter) for parameter in parameters_of(around, names))
    if around.kind == "environment":
        for name in models.available("environment"):
            yield Offer(name, types.CompletionItemKind.Class, summary(models.available("environment")[name]))
    yield from _named(names, "macro")


def parameters_of(entry: TextEntry, names: NamesInTexts) -> tuple[Parameter, ...]:
    """The parameters of an entry's model."""
    name = names.model_of(entry)
    for kind in models.GROUPS:
        model = models.available(kind).get(name)
        entry_kind = entry.block or entry.kind
        wanted = kind == entry_kind or (entry_kind not in models.GROUPS and kind not in ("servo", "metric"))
        if model is not None and wanted:
            return models.written(model)
    return ()


def _parameter(texts: list[str], around: TextEntry | None, names: NamesInTexts) -> Parameter | None:
    """The parameter that an entry sets, if it is declared."""
    if around is None or not texts:
        return None
    call = open_call(texts)
    if call is not None:
        return call.wanted
    compared = [n for n, word in enumerate(texts) if word in COMPARISONS]
    if texts[0] == "require" and compared:
        return _limit(texts[compared[-1] - 1], names)
    for parameter in parameters_of(around, names):
        if parameter.name == texts[0]:
            return parameter
    if around.block == "servo" and texts[0] == "rate":
        return BLOCKS["rates"]["servos"].parameter
    block = BLOCKS.get(around.block)
    entries = [entry for entry in block.entries if entry.name == texts[0]] if block is not None else []
    return entries[0].parameter if entries else None


def _limit(metric: str, names: NamesInTexts) -> Parameter | None:
    """The limit on a metric of the texts, in the metric's unit."""
    for definition in names.by_name.get(metric, ()):
        if definition.kind == "metric" and definition.entry is not None:
            model = models.available("metric").get(names.model_of(definition.entry))
            return Parameter(name=metric, unit=model.unit, doc="the limit") if model is not None else None
    return None


def _units(wanted: Parameter | None, names: NamesInTexts) -> Iterator[Offer]:
    """The units of the table, matching ones first, and the deck's; a wanted compound one precedes all."""
    fit: list[str] = []
    if wanted is not None and wanted.unit not in ("", "1"):
        try:
            fit = units_of(parse_unit(wanted.unit).dimension)
        except (ValueError, KeyError):
            fit = []
        unit = wanted.unit
        if unit not in ("joint", "effort", "of", "command") and not any(
            word in unit for word in ("joint", "effort", "of", "command")
        ):
            yield Offer(unit, types.CompletionItemKind.Unit, f"the unit of `{wanted.name}`")
        if fit:
            yield from (Offer(unit_name, types.CompletionItemKind.Unit, ALL_UNITS[unit_name].word) for unit_name in fit)
            if unit in ALL_UNITS:
                yield from _named(names, UNIT)
                return  # other units may be a factor: `deg/s`
    yield from _named(names, UNIT)
    yield from (Offer(unit_name, types.CompletionItemKind.Unit, ALL_UNITS[unit_name].word) for unit_name in ALL_UNITS)


def _rest_of_path(words: list[Token], names: NamesInTexts, index: DeckIndex) -> Iterator[Offer]:
    """The words that continue a path: parts of parameters, of signals, and of definitions."""
    parts: list[str] = []
    for word in reversed(words):
        if word.text != "." and (word.kind != NAME or (parts and parts[-1] != ".")):
            break
        parts.append(word.text)
    head = "".join(reversed(parts))
    about: dict[str, str] = {}
    signals_alone = words[0].text in _SIGNALS_ALONE
    for value in index.values:
        if not signals_alone and value.path.startswith(head):
            part, _, more = value.path[len(head) :].partition(".")
            about.setdefault(part, "" if more else f"{value.value}; {value.doc}")
    signals = index.signals
    if words[0].text in _OF_SIGNALS and not any(path.startswith(head) for path in signals):
        signals = tuple(f"{head}{name}" for name, *_ in (*MOTION, *OF_JOINT) if _names_a_joint(head, names))
    for path in signals:
        if path.startswith(head):
            part, _, more = path[len(head) :].partition(".")
            about.setdefault(part, "" if more else "signal")
    begins = re.compile(re.sub(r"\\{.*?\\}", r"\\w+", re.escape(head)))  # `bodies.{side}_arm.`, in a loop
    for path in index.cells:
        if found_head := begins.match(path):
            part, _, more = path[found_head.end() :].partition(".")
            about.setdefault(part, "" if more else "in the table")
    yield from (Offer(part, types.CompletionItemKind.Field, meaning) for part, meaning in about.items())
    files = names.used.under(words[0].source.name, head[:-1].split("."))
    for name, defined in names.by_name.items() if files else ():
        kinds = [
            definition.kind
            for definition in defined
            if definition.kind in (*DEFINED, "roof") and definition.file in files
        ]
        yield from (Offer(name, types.CompletionItemKind.Reference, kind) for kind in kinds[:1])
    for definition in names.by_name.get(head[:-1], ()):
        if not signals_alone and definition.kind == "servo" and definition.entry is not None:
            yield from (_of_parameter(parameter) for parameter in parameters_of(definition.entry, names))


def _names_a_joint(head: str, names: NamesInTexts) -> bool:
    """True for `JOINT.`, with a joint of the texts: its signals are known before the deck is without errors."""
    return any(definition.kind == "joint" for definition in names.by_name.get(head[:-1], ()))


def _values(texts: list[str], around: TextEntry | None, names: NamesInTexts, index: DeckIndex) -> Iterator[Offer]:
    """The words with which a value may begin."""
    key = texts[0]
    wanted = _parameter(texts, around, names)
    if wanted is not None and wanted.words:
        yield from (Offer(word, types.CompletionItemKind.EnumMember, wanted.doc) for word in wanted.words)
        return
    where = around.kind if around is not None else ""
    call = open_call(texts)
    if key in ("against", "confirm") and around is not None:
        yield from _sweeps_of(around.word_behind("of"), names)
        return
    if where == "joint" and texts in (["axis", "="], ["axis", "=", "-"]):
        yield from (Offer(axis, types.CompletionItemKind.EnumMember, "an axis of the joint's frame") for axis in AXES)
    if texts[-2:] == ["rows", "="]:
        yield Offer(ALL_ROWS, types.CompletionItemKind.EnumMember, "requires that every row is used")
        return
    if where == "initial" and texts[-2:] in (["q", "="], ["qd", "="]):
        yield Offer("command", types.CompletionItemKind.EnumMember, "the initial value of the joint's command")
    if where == "linear" and texts == ["at", "="]:
        yield Offer(EQUILIBRIUM, types.CompletionItemKind.Function, "the equilibrium near positions of the joints")
    if where == "servos":
        yield from _named(names, "servo", "roof")
        return
    kinds = {"parent": "link", "child": "link", "arm": "arm", "leader": "joint", "link": "link", "to": "link"}
    if key in kinds and where in ("joint", "loop", "run"):
        if kinds[key] == "link":
            yield Offer("base", types.CompletionItemKind.Constant, "the body that the arm stands on")
        yield from _named(names, kinds[key], around=around)
        yield from _named(names, "roof") if kinds[key] in DEFINED else ()
        return
    model_kinds: dict[str, models.Kind] = {
        "model": "servo", "command": "command", "integrator": "integrator", "metric": "metric", "bed": "bed",
        "law": "law", "guide": "guide", "sensor": "sensor",
    }  # fmt: skip
    kind = model_kinds.get(key, "environment" if where == "environment" else None)
    if texts[-2:] == ["shape", "="] and where == "link":
        yield from (Offer(shape, types.CompletionItemKind.Class) for shape in SHAPES)
        return
    if kind is not None and "=" in texts and "(" not in texts:
        for name, model in models.available(kind).items():
            yield Offer(name, types.CompletionItemKind.Class, summary(model))
        if key != "command":
            return
        yield from (
            Offer(command, types.CompletionItemKind.Function, "a command of this kind") for command in COMMAND_UNIT
        )
    if len(texts) > 1 and texts[-1] == "(" and texts[-2] in COMMAND_UNIT:
        for name, model in models.available("command").items():
            yield Offer(name, types.CompletionItemKind.Class, summary(model))
        yield from _named(names, "guide")
    if key in GOALS or key == "require":
        yield from _of_goal(texts, around, names, index)
        return
    if key in _VARIED:
        yield from _of_varied(texts, names, index)
        return
    watches = key == "metric" and call is not None and call.argument == WATCHES.name
    if key in _PATHS or key in _SIGNALS_ALONE or watches:
        values = () if key in _SIGNALS_ALONE else index.values
        heads = dict.fromkeys(value.path.partition(".")[0] for value in values)
        heads |= dict.fromkeys(path.partition(".")[0] for path in index.signals)
        yield from (Offer(head, types.CompletionItemKind.Field, "the first word of a path") for head in heads)
        if key in _SIGNALS_ALONE:
            yield from _named(names, "joint", "macro", around=around)
            return
        yield from _named(names, "joint", "metric", "servo", around=around)
    if call is not None and texts[-1] in ("(", ",", ";") and not call.argument:
        yield from (_of_parameter(parameter) for parameter in call.parameters if parameter.name not in call.earlier)
        if key == "shape":
            return
    yield from _of_expression(names)


def _of_expression(names: NamesInTexts) -> Iterator[Offer]:
    """The words that may occur in any value."""
    yield from _named(names, "let", "macro", "roof")
    yield from (
        Offer(function, types.CompletionItemKind.Function, ", ".join(USAGE[function])) for function in FUNCTIONS
    )
    yield from (Offer(constant, types.CompletionItemKind.Constant) for constant in CONSTANTS)


def _of_goal(texts: list[str], around: TextEntry | None, names: NamesInTexts, index: DeckIndex) -> Iterator[Offer]:
    """The words after `require`, `minimise` and `maximise`: metrics, then a limit; in a call, its signals."""
    if texts.count("(") > texts.count(")"):
        heads = dict.fromkeys(path.partition(".")[0] for path in index.signals)
        yield from _named(names, "metric", "linear", "joint", around=around)
        yield from (Offer(head, types.CompletionItemKind.Field, "the first word of a path") for head in heads)
        yield from _of_expression(names)
    elif any(text in COMPARISONS for text in texts):
        yield from _named(names, "servo")
        yield from _of_expression(names)
    else:
        yield from _named(names, "metric", "macro", around=around)
        if texts[0] == "require":
            over_time = [name for name, model in models.available("metric").items() if model.condition]
            for figure in (*over_time, *FIGURES, STEP_ERROR, PERCENTILE):
                yield Offer(figure, types.CompletionItemKind.Function, "a figure to require a limit of")


def _of_varied(texts: list[str], names: NamesInTexts, index: DeckIndex) -> Iterator[Offer]:
    """The words after `vary`, `with` and `exclude when`: a path of a parameter, then its values."""
    if "=" not in texts:
        heads = dict.fromkeys(value.path.partition(".")[0] for value in index.values)
        for head in heads:
            if texts[0] != "vary" or head not in _NOT_VARIED:
                yield Offer(head, types.CompletionItemKind.Field, "the first word of a path")
        if texts == ["vary"]:
            yield Offer("macro", types.CompletionItemKind.Keyword, "a macro of the deck: `vary macro NAME = [...];`")
        yield from _named(names, "joint", "servo", "let", "macro", "roof")
        if texts[0] != "exclude":
            return
    else:
        yield from _named(names, "arm" if texts[-4:-1] == ["arm", "=", "["] else "servo")
    yield from _of_expression(names)


def _sweeps_of(run: str, names: NamesInTexts) -> Iterator[Offer]:
    """The sweeps of a run, and those that are made of others."""
    for offer in _named(names, "sweep"):
        entries = [
            definition.entry
            for definition in names.by_name[offer.word]
            if definition.kind == "sweep" and definition.entry is not None
        ]
        if any(entry.word_behind("of") in ("", run) for entry in entries):
            yield offer


def _named(names: NamesInTexts, *kinds: str, around: TextEntry | None = None) -> Iterator[Offer]:
    """The names of some kinds. around: restricts names to those of arms and runs that the surrounding entries may mean,
    if there are any"""
    icons = {
        "let": types.CompletionItemKind.Variable,
        "macro": types.CompletionItemKind.Constant,
        "run": types.CompletionItemKind.Function,
        "unit": types.CompletionItemKind.Unit,
    }
    owners = names.owners(around) if around is not None else []
    for kind in kinds:
        known = names.of_kind(kind)
        own = [name for name in known if any(names.is_of(name, kind, owner) for owner in owners)]
        for name in own or known:
            written = names.written_out(name, kind, owners) if "{" in name else ()
            for spelling in (name, *written):
                yield Offer(spelling, icons.get(kind, types.CompletionItemKind.Reference), kind)


def _of_parameter(parameter: Parameter) -> Offer:
    unit = f"; in {_UNIT_WORDS.get(parameter.unit, parameter.unit)}" if parameter.unit not in ("", "1") else ""
    return Offer(parameter.name, types.CompletionItemKind.Property, f"{parameter.doc}{unit}")
