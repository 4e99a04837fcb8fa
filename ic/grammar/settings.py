"""Settings of the command line, `PATH=VALUE` and `vary PATH=VALUES`, and its expressions, as a syntax tree."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from ic.grammar.parse import NO_UNITS, parse, parse_expression
from ic.grammar.syntax import Expression, Setting
from ic.text.edition import FIRST, LATEST
from ic.text.lexer import BAD, CHARACTER, COMMAND_LINE, END, SPACE, Text, Token, complain_of_stray, logical_lines
from ic.text.limits import Findings, GiveUp
from ic.text.source import SourceFile
from met.diagnostic import Problem, error
from met.outputs import VARY
from met.outputs import varies as is_varied
from met.units import Measure

EXAMPLE = "write `PATH=VALUE`, such as `gearbox.kp=0.02 V*s/rad`"
VARY_EXAMPLE = "write `PATH=VALUES`, such as `gearbox.kp=[0.01, 0.02] V*s/rad` or `gearbox.kp=0.1..0.5 by 0.1 V*s/rad`"

_VARIES = ([VARY], [VARY, "macro"])


def command_line(texts: Sequence[str], before: str = "") -> SourceFile:
    """The text that messages show: a line for each setting, after the macros of -D."""
    return SourceFile(COMMAND_LINE, before + "".join(f"{_one_line(text)}\n" for text in texts), "")


def read_settings(
    texts: Sequence[str], before: str = "", *, edition: int = FIRST, units: Mapping[str, Measure] = NO_UNITS
) -> tuple[Setting, ...]:
    """An entry for each `PATH=VALUE` and `vary PATH=VALUES`, in their order.

    before          as in `command_line`
    edition, units  of the deck that they are for

    Raises Problem with all their errors: of the syntax, and D231, D232.
    """
    source = Text(COMMAND_LINE, command_line(texts, before).text)
    source.edition = edition
    findings = Findings()
    settings: dict[str, Setting] = {}
    offset = len(before)
    for text in map(_one_line, texts):
        try:
            with findings.gather():
                entry = _read(source, offset, text, findings, units)
                path = path_of(entry)
                if path in settings:
                    twice = "is set twice" if not settings[path].words and not entry.words else "is set, and varied"
                    if settings[path].words and entry.words:
                        twice = "is varied twice"
                    raise Problem(error("D232", f"`{path}` {twice}", entry.place, help="leave one of the two out"))
                settings[path] = entry
        except GiveUp:
            break
        offset += len(text) + 1
    if findings.errors:
        raise Problem(findings.all)
    return tuple(settings.values())


def read_expression(text: str) -> Expression:
    """An expression of the command line, as after `--where`. Raises Problem with all its errors."""
    text = _one_line(text)
    source, findings = Text(COMMAND_LINE, f"{text}\n"), Findings()
    source.edition = LATEST
    tokens = [*_tokens(source, 0, text, findings), Token(END, "", source, len(text.rstrip()), 1)]
    expression = None if findings.errors else parse_expression(tokens, findings)
    if expression is None or findings.errors:
        raise Problem(findings.all, {COMMAND_LINE: command_line([text]).text})
    return expression


def path_of(entry: Setting) -> str:
    """The path of an entry: `gearbox.kp`."""
    return ".".join(word.text for word in entry.path)


def _one_line(text: str) -> str:
    return " ".join(text.splitlines())


def _read(source: Text, offset: int, text: str, findings: Findings, units: Mapping[str, Measure]) -> Setting:
    """The one entry of a line that begins at `offset`. Raises Problem."""
    place = source.place(offset, max(len(text), 1))
    varies = is_varied(text)
    path, equals, value = text.removeprefix(f"{VARY} ").partition("=")
    example = VARY_EXAMPLE if varies else EXAMPLE
    if not equals or not value.strip():
        message = f"`{path.strip()[:40]}` {'varies over' if varies else 'is set to'} nothing"
        raise Problem(error("D231", message, place, help=example))
    if not path.strip():
        message = f"this {'varies' if varies else 'sets'} nothing: no path stands before the `=`"
        raise Problem(error("D231", message, place, help=example))
    before = len(findings.errors)
    tokens = [*_tokens(source, offset, text, findings), Token(END, "", source, offset + len(text.rstrip()), 1)]
    inner = Findings()
    entries, _ = parse(tokens, inner, units)
    end = tokens[-2].end if len(tokens) > 1 else offset
    lacking = source.place(end, 1)  # no `;` ends it
    findings.add(
        *(
            diagnostic
            for diagnostic in inner.all
            if diagnostic.code != "D021" or diagnostic.at is None or diagnostic.at.place != lacking
        )
    )
    if len(findings.errors) > before:
        raise Problem(())
    entry = entries[0] if len(entries) == 1 else None
    words = [word.text for word in getattr(entry, "words", ())]
    if not isinstance(entry, Setting) or entry.operator != "=" or words not in (_VARIES if varies else ([],)):
        what = "values" if varies else "value"
        raise Problem(error("D231", f"this is not one path and its {what}", place, help=_remedy(words, example)))
    return entry


def _remedy(words: list[str], example: str) -> list[str]:
    """The remedy for an entry that `--set` or `--vary` does not take."""
    if words == ["macro"]:
        return ["a macro is defined by `-D NAME=VALUE`"]
    if words == [VARY] and example == EXAMPLE:
        return ["`--vary PATH=VALUES` varies a path"]
    if words[:2] == [VARY, VARY]:
        return ["leave out the word `vary`: `--vary` says it"]
    return [example]


def _tokens(source: Text, offset: int, text: str, findings: Findings) -> Iterator[Token]:
    """The tokens of a line, without white space, as tokens of the whole text."""
    for line in logical_lines(Text("", text)):
        for token in line:
            if token.kind == SPACE:
                continue
            token.source, token.offset = source, offset + token.offset
            if token.kind in (BAD, CHARACTER) or token.text[:1] == "#":
                complain_of_stray(token, findings)
                token.kind, token.text = BAD, ""
            yield token
