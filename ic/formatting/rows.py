"""A deck's text as rows, for the formatter: the pieces of a line, its bracket, and parts that must not change.

Nothing is expanded and nothing included. What `#if` surrounds is laid out too where each of its parts closes what it
opens; else it stays as it is, since text that is left out may be anything.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from ic.formatting.pieces import cut
from ic.formatting.row import CODE, TAB, Row
from ic.grammar.cursor import OPENING
from ic.text.lexer import BAD, SPACE, Text, Token, complain_of_stray, complain_of_unseen, logical_lines
from ic.text.limits import CONDITION_DEPTH, DEPTH, LONGEST_LINE, MOST_TOKENS, Findings
from ic.text.preprocess import CONDITIONALS
from met.diagnostic import Diagnostic, Label, Problem, error

_CLOSING = {closing: opening for opening, closing in OPENING.items()}
OpenBracket = tuple[Token, Row]
"""A bracket that is open, and its row."""

_BY_ITSELF = "a file is laid out by itself: a bracket of a macro's body or of another file is not seen"


def rows(source: Text, making_strings: Collection[str] = (), tab: int = TAB) -> list[Row]:
    """The rows of a file, each knowing the bracket that it stands in. Raises Problem where the text is broken.

    making_strings  macros that make a string of what they are given: their uses stay as they are
    tab             how far apart the tab stops are
    """
    findings = Findings()
    all_rows: list[Row] = []
    count = start = 0
    for line in logical_lines(source):
        count += len(line)
        if count > MOST_TOKENS:
            findings.error("D018", f"more than {MOST_TOKENS} tokens", line[0].place)
            break
        if line[-1].offset - start > LONGEST_LINE:
            place = source.place(start + LONGEST_LINE, 1)
            findings.error("D018", f"a line has at most {LONGEST_LINE} characters", place)
            break
        all_rows.append(Row(source, start, line, tab))
        start = line[-1].offset + 1
        if len(line) > 1 and line[-2].kind == BAD and line[-2].text == "/*":  # where the lexer has stopped
            complain_of_stray(line[-2], findings)
    if start < len(source.text):  # a backslash at the end
        all_rows.append(Row(source, start, [Token(SPACE, "\n", source, len(source.text), 1)], tab))
    if not findings.errors:
        _match_all(all_rows, findings)
    if findings.errors:
        raise Problem(findings.all, {source.name: source.text})
    if making_strings:
        _keep_uses(all_rows, making_strings)
    cut(row for row in all_rows if row.kind == CODE and not row.opaque)
    for row in all_rows:
        if row.outer is not None:
            bracket, opened = row.outer
            row.parent = opened, next(i for i, piece in enumerate(opened.pieces) if bracket in piece.tokens[:1])
    return all_rows


@dataclass(slots=True)
class _OpenConditional:
    """A conditional that is open: where it begins, the brackets open before it and behind each of its parts."""

    index: int
    start: list[OpenBracket]
    ends: list[list[OpenBracket]] = field(default_factory=list)
    otherwise: bool = False
    broken: bool = False


def _match_all(all_rows: list[Row], findings: Findings) -> None:
    """Match the brackets, and tell every row the one that it begins in; text surrounded by `#if` is made opaque where
    they do not match, elsewhere that is reported."""
    stack: list[OpenBracket] = []
    ifs: list[_OpenConditional] = []
    behind: Token | None = None
    for index, row in enumerate(all_rows):
        word = row.directive
        behind = None if word in CONDITIONALS else behind
        row.outer, row.behind = _innermost(stack), behind
        if word in ("if", "ifdef", "ifndef"):
            if len(ifs) >= CONDITION_DEPTH:
                findings.error("D018", f"`#if` goes deeper than {CONDITION_DEPTH}", row.tokens[1].place)
                return
            ifs.append(_OpenConditional(index, list(stack)))
        elif word not in CONDITIONALS:
            complaint = _match(row, stack) if row.kind == CODE and not (ifs and ifs[-1].broken) else None
            if row.kind == CODE:
                behind = row.tokens[-1] if row.tokens[-1].text not in OPENING else None
            if complaint is None:
                continue
            if not ifs:
                findings.add(complaint)
                return
            ifs[-1].broken = True
        elif not ifs:
            help = "leave it out, or write the `#if` that it belongs to"
            findings.error("D007", f"`#{word}` without an `#if`", row.tokens[1].place, help=help)
            return
        elif word == "endif":
            closed = ifs.pop()
            ends = [*closed.ends, stack, *([] if closed.otherwise else [closed.start])]
            if closed.broken or len({"".join(token.text for token, _ in end) for end in ends}) > 1:
                stack = closed.start
                for inside in all_rows[closed.index : index + 1]:
                    inside.opaque = inside.exact = True
                    inside.outer, inside.closes, inside.behind = _innermost(stack), None, None
            else:
                stack = ends[0]
        else:
            ifs[-1].ends.append(stack)
            ifs[-1].otherwise = ifs[-1].otherwise or word == "else"
            stack = list(ifs[-1].start)
        row.outer = _innermost(stack)
    for left in ifs[-1:]:
        token = all_rows[left.index].tokens[1]
        help = f"`{token.source.name}` ends without its `#endif`"
        findings.error("D008", f"`#{token.text}` is not closed", token.place, help=help)
        return
    for token, _ in stack[-1:]:
        helps = (f"write the `{OPENING[token.text]}` where it ends", _BY_ITSELF)
        findings.error("D022", f"this `{token.text}` is not closed", token.place, help=helps)


def _innermost(stack: Sequence[OpenBracket]) -> OpenBracket | None:
    return stack[-1] if stack else None


def _match(row: Row, stack: list[OpenBracket]) -> Diagnostic | None:
    """Open and close the row's brackets. Returns the finding about the row, if any."""
    leading = True
    for token in row.tokens:
        leading = leading and token.text in _CLOSING
        if token.kind == BAD:
            findings = Findings()
            complain_of_stray(token, findings)
            if not findings.all:  # an invisible character
                complain_of_unseen(token.source, findings)
            return findings.all[0]
        if token.text in OPENING:
            if len(stack) >= DEPTH:
                return error("D029", f"braces, brackets and parentheses go deeper than {DEPTH}", token.place)
            stack.append((token, row))
        elif token.text in _CLOSING:
            if not stack:
                helps = ("leave it out, or open it where it begins", _BY_ITSELF)
                return error("D022", f"this `{token.text}` closes nothing", token.place, help=helps)
            opening, opened = stack.pop()
            row.closes = opened if leading else row.closes
            if opening.text != _CLOSING[token.text]:
                label = Label(opening.place, f"to close this `{opening.text}`")
                message = f"expected `{OPENING[opening.text]}`, found `{token.text}`"
                return error("D022", message, token.place, also=(label,), help=_BY_ITSELF)
    return None


def _keep_uses(all_rows: Sequence[Row], names: Collection[str]) -> None:
    """Make the rows exact in which these names are used with arguments."""
    named, depth = False, 0
    for row in all_rows:
        if row.kind != CODE or row.opaque:
            continue
        row.exact = row.exact or depth > 0
        for token in row.tokens:
            if depth or (named and token.text == "("):
                row.exact = True
                depth += {"(": 1, ")": -1}.get(token.text, 0)
            named = not depth and token.text in names
