"""Values written into a deck's text, at their former places or as new entries of their definitions.

An edit counts only once it is proved: the deck with the written values must mean the same, to the bit, as the deck with
the values set from outside (`--set`). An edit without a proof is refused.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from ic.driver.compile import Compiled, Select, check
from ic.driver.explain import explanations_of
from ic.driver.written_value import WrittenValue
from ic.formatting.formatter import formatted
from ic.grammar.syntax import Deck, Entry, Group, Let
from ic.read import read
from ic.text.lexer import Text, solid_tokens
from met.diagnostic import Place, Problem, error
from met.frozen import frozen
from met.plan.keys import structure_key
from met.unit_parser import parse_unit, written

REMARK = "// chosen "
"""Beginning of the comment on a line with a written value; the next value replaces it."""

LONGEST = 120
"""Largest length of a line with such a comment at its end."""

_COMMENTS = ("//", "/*", "*/")
_UNIT_OF_LIST = re.compile(r"[^][{};]*\]\s*(?P<unit>[^\s;,})]+)")
"""The rest of a list behind one of its numbers, with the unit that stands after the brackets."""
_LITERAL = re.compile(r"[-+]?\s*(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\s*(?P<unit>\S.*)?")


@frozen
class DeckWithValues:
    """A deck's text with values written into it.

    run      that has them;  others: runs that change with it
    sources  texts of the files that its runs are made of before, by name
    """

    text: str
    run: str
    others: tuple[str, ...]
    sources: Mapping[str, str]


def with_values(
    text: str,
    values: Sequence[WrittenValue],
    *,
    name: str,
    folder: Path,
    experiment: str,
    defines: Sequence[str] = (),
    remark: str = "",
) -> DeckWithValues:
    """A deck whose run has these values, as if they had been set from outside.

    name    of the deck's file;  folder: in which what it includes lies
    experiment  the run, or a sweep of it
    remark  for a comment on the lines that are changed, behind `// chosen `

    Raises Problem E397 where a value has no place of its own in this text, or the deck would not mean the same.
    """
    laid_out = _is_laid_out(name, text)
    with tempfile.TemporaryDirectory() as place:
        copy = _Copy(Path(place) / Path(name).name, folder, tuple(defines))
        copy.write(text)
        deck = copy.read()
        run = _run_of(deck, experiment)
        runs = [entry.words[-1].text for entry in deck.entries if isinstance(entry, Group) and _word(entry) == "run"]
        before = copy.compiled(text, runs)
        wanted = copy.compiled(text, (run,), [value.setting for value in values])
        after = text
        for value in values:
            after = _written_in(copy, after, value, run, remark)
        if laid_out:
            after = formatted(name, after)
        rewritten = copy.compiled(after, runs)
        changed = [other for other in runs if other != run and _meaning(before, other) != _meaning(rewritten, other)]
    if _meaning(wanted, run) != _meaning(rewritten, run):
        raise _by_hand(values[0], "the deck with it would not mean the same as with `--set`")
    return DeckWithValues(after, run, tuple(changed), before.sources)


class _Copy:
    """A copy of the deck in a folder of its own, where its text can be changed and compiled."""

    def __init__(self, path: Path, folder: Path, defines: tuple[str, ...]) -> None:
        self.path, self.folder, self.defines = path, folder, defines

    def write(self, text: str) -> None:
        self.path.write_text(text, encoding="utf-8", newline="")

    def compiled(self, text: str, select: Select, settings: Sequence[str] = ()) -> Compiled:
        """The deck of this text. Raises Problem E397 where it has errors."""
        self.write(text)
        compiled = check(self.path, include_dirs=(self.folder,), defines=self.defines, select=select, settings=settings)
        if compiled.plan is None:
            first = next(diagnostic for diagnostic in compiled.diagnostics if diagnostic.severity == "error")
            raise Problem(error("E397", f"the deck cannot be compiled: {first.code}, {first.message}"))
        return compiled

    def read(self) -> Deck:
        return read(self.path, (self.folder,), self.defines)

    def is_own(self, place: Place | None) -> bool:
        """True for a place in the deck's own text that did not come there through a macro."""
        return place is not None and Path(place.file) == self.path and not place.expansions


def _run_of(deck: Deck, name: str) -> str:
    """The run of a sweep, or of the sweep that it is of. Raises Problem E397 for a sum of sweeps."""
    groups = {
        entry.words[-1].text: entry for entry in deck.entries if isinstance(entry, Group) and _word(entry) != "arm"
    }
    for _ in groups:
        if name in groups and _word(groups[name]) == "run":
            return name
        base = groups[name].of if name in groups else None
        if base is None:
            break
        name = base.text
    message = f"`{name}` is no sweep of one run, so no run can be given its values"
    raise Problem(error("E397", message, help="`met best` of one of the sweeps that it is made of has a run"))


def _meaning(compiled: Compiled, run: str) -> object:
    """Everything on which the results of a run depend."""
    assert compiled.plan is not None
    return [
        (
            structure_key(experiment.structure),
            {path: (quantity.value, quantity.unit) for path, quantity in experiment.parameters.items()},
            [
                (requirement.text, requirement.comparison, requirement.limit, requirement.share, requirement.confidence)
                for requirement in experiment.requirements
            ],
        )
        for experiment in compiled.plan.experiments
        if experiment.name == run
    ]


def _written_in(copy: _Copy, text: str, value: WrittenValue, run: str, remark: str) -> str:
    """The text with one more value; unchanged where the run has that value already."""
    compiled = copy.compiled(text, (run,))
    explanations = list(explanations_of(compiled, value.path))
    places = {explanation.place for explanation in explanations}
    if explanations and all(explanation.value == value.si for explanation in explanations):
        return text  # the run has the value already, in its author's words
    if not places:
        raise _by_hand(value, f"`{run}` has no such parameter")
    place = places.pop() if len(places) == 1 else None
    source, deck = Text(str(copy.path), text), copy.read()
    home, _, rest = value.path.partition(".")
    owners = [entry for entry in deck.entries if copy.is_own(entry.place) and _may_own(entry, home, run)]
    for owner in owners:
        first, last = _extent(source, owner)
        if place is not None and copy.is_own(place) and first <= _offset(source, place) < last:
            return _replaced(source, place, value, remark)
    blocks = [block for block in owners if isinstance(block, Group) and _word(block) == "servo"]
    if blocks and rest.isidentifier():
        first, last = _extent(source, blocks[0])
        uses = [expansion.use for expansion in place.expansions] if place is not None else []
        if not any(copy.is_own(use) and first <= _offset(source, use) < last for use in uses):
            return _added(source, last, rest, value, remark)
    raise _by_hand(value, _why(copy, place, home))


def _may_own(entry: Entry, home: str, run: str) -> bool:
    """True for an entry of the deck in which a value may be replaced: the definition or `let` at the beginning of the
    path, else an arm, or the run itself, but not a run that it is like."""
    if isinstance(entry, Let):
        return entry.name.text == home
    if not isinstance(entry, Group):
        return False
    name = entry.words[-1].text
    return name == home if _word(entry) == "servo" else _word(entry) == "arm" or name == run


def _word(group: Group) -> str:
    words = [word.text for word in group.words]
    return words[1] if words[0] == "default" and len(words) > 1 else words[0]


def _why(copy: _Copy, place: Place | None, home: str) -> str:
    """The reason why a value cannot be written into the deck's text at this place, in words."""
    if place is None:
        return f"it stands in no place of its own, and no `servo {home} {{ ... }}` of this deck can have it"
    if place.macros:
        return f"it comes through the macro {place.macros[0].macro}"
    if place.iterations:
        return f"it stands in `for {place.iterations[0].macro}`, which says it for every iteration"
    if Path(place.file) != copy.path:
        return f"it stands in {place.file}, line {place.line}, which other decks may use"
    return f"it stands at line {place.line}, which is of more than this"


def _by_hand(value: WrittenValue, why: str) -> Problem:
    """The error that a value cannot be written into the deck (E397), with what to write by hand."""
    home, _, rest = value.path.rpartition(".")
    write = f"`{rest} = {value.text};` in what `{home}` is" if home else f"`{rest} = {value.text}`"
    helps = [f"write it by hand: {write}", f"or leave the deck as it is, and run it with `--set '{value.setting}'`"]
    return Problem(error("E397", f"`{value.path}` cannot be written into the deck: {why}", help=helps))


# The text


def _offset(source: Text, place: Place) -> int:
    return source.offset(place.line, place.column)


def _extent(source: Text, entry: Entry) -> tuple[int, int]:
    """The range from the first character of an entry to its last one, a brace or a semicolon, exclusive."""
    first, depth = _offset(source, entry.place), 0
    for token in solid_tokens(source):
        if token.offset < first:
            continue
        depth += {"{": 1, "}": -1}.get(token.text, 0)
        if depth == 0 and token.text in ("}", ";"):
            return first, token.offset
    return first, first


def _replaced(source: Text, place: Place, value: WrittenValue, remark: str) -> str:
    """The deck's text with a value in place of the one at a place, in the unit that stands there. remark: the comment
    that is put behind it."""
    text, first = source.text, _offset(source, place)
    last = first + place.length
    literal = _LITERAL.fullmatch(text[first:last])
    own = (literal["unit"] or "") if literal else ""
    outside = None if own else _UNIT_OF_LIST.match(text, last)
    new_text = _in_unit(value, outside["unit"] if outside else own)
    if outside:
        new_text = new_text.removesuffix(f" {outside['unit']}")
    return _with_remark(text[:first] + new_text + text[last:], first, remark)


def _in_unit(value: WrittenValue, unit: str) -> str:
    """The value in its former unit, where that gives the same bits; else in its own."""
    try:
        measure, own = parse_unit(unit or "1"), parse_unit(value.unit or "1")
    except ValueError:
        return value.text
    text = written(value.si, unit)
    number = text.split(" ")[0]
    same = measure.dimension == own.dimension and measure.to_si(float(number), number.lstrip("-")) == value.si
    return text if same else value.text


def _added(source: Text, brace: int, parameter: str, value: WrittenValue, remark: str) -> str:
    """The text with an entry before the brace that closes a block."""
    text, entry = source.text, f"{parameter} = {value.text};"
    line = text.rfind("\n", 0, brace) + 1
    if text[line:brace].strip():
        inside = text[:brace].rstrip()
        gap = " " if inside.endswith("{") else "  "
        return _with_remark(f"{inside}{gap}{entry} {text[brace:]}", len(inside) + len(gap), remark)
    above = text[:line].rstrip("\n").rpartition("\n")[2]
    indent = above[: len(above) - len(above.lstrip())] if above.strip() and not above.rstrip().endswith("{") else "    "
    return _with_remark(f"{text[:line]}{indent}{entry}\n{text[line:]}", line, remark)


def _with_remark(text: str, offset: int, remark: str) -> str:
    """The text with the remark at the end of the line at an offset, or on a line above it where that is too long,
    replacing an earlier remark. A line that has another comment, or that a backslash joins, is not changed."""
    first, end = text.rfind("\n", 0, offset) + 1, text.find("\n", offset)
    end = len(text) if end < 0 else end
    line, mark, _ = text[first:end].partition(REMARK)
    if not remark or line.rstrip().endswith("\\") or (not mark and any(comment in line for comment in _COMMENTS)):
        return text
    line = line.rstrip()
    above = text.rfind("\n", 0, max(first - 1, 0)) + 1
    start = above if text[above:first].lstrip().startswith(REMARK) else first
    whole = f"{line}    {REMARK}{remark}"
    if len(whole) <= LONGEST:
        return text[:start] + whole + text[end:]
    indent = line[: len(line) - len(line.lstrip())]
    return f"{text[:start]}{indent}{REMARK}{remark}\n{line}{text[end:]}"


def _is_laid_out(name: str, text: str) -> bool:
    try:
        return formatted(name, text) == text
    except Problem:
        return False
