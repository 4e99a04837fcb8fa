"""Settings of the command line, `PATH=VALUE`, and its expressions, as a syntax tree."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ic.grammar.parse import parse, parse_expression
from ic.grammar.syntax import Expression, Setting
from ic.text.lexer import BAD, CHARACTER, COMMAND_LINE, END, SPACE, Text, Token, logical_lines
from ic.text.limits import Findings, GiveUp
from ic.text.source import SourceFile
from ic.text.strays import complain_of_stray
from met.diagnostic import Place, Problem, error

EXAMPLE = "write `PATH=VALUE`, such as `gearbox.kp=0.02 V*s/rad`"


def command_line(texts: Sequence[str], before: str = "") -> SourceFile:
    """The text that messages show: a line for each `PATH=VALUE`, behind the macros of -D."""
    return SourceFile(COMMAND_LINE, before + "".join(f"{_one_line(text)}\n" for text in texts), "")


def read_settings(texts: Sequence[str], before: str = "") -> tuple[Setting, ...]:
    """An entry for each `PATH=VALUE`, in their order. before: as in `command_line`.

    Raises Problem with all that is wrong with them: what the syntax does not have, and D231, D232.
    """
    source = Text(COMMAND_LINE, command_line(texts, before).text)
    findings = Findings()
    made: dict[str, Setting] = {}
    at = len(before)
    for text in map(_one_line, texts):
        try:
            with findings.gather():
                entry = _read(source, at, text, findings)
                path = path_of(entry)
                if path in made:
                    raise Problem(error("D232", f"`{path}` is set twice", entry.place, help="leave one of the two out"))
                made[path] = entry
        except GiveUp:
            break
        at += len(text) + 1
    if findings.errors:
        raise Problem(findings.all)
    return tuple(made.values())


def read_expression(text: str) -> Expression:
    """An expression of the command line, as behind `--where`. Raises Problem with all that is wrong with it."""
    text = _one_line(text)
    source, findings = Text(COMMAND_LINE, f"{text}\n"), Findings()
    tokens = [*_tokens(source, 0, text, findings), Token(END, "", source, len(text.rstrip()), 1)]
    found = None if findings.errors else parse_expression(tokens, findings)
    if found is None or findings.errors:
        raise Problem(findings.all, {COMMAND_LINE: command_line([text]).text})
    return found


def path_of(entry: Setting) -> str:
    """`gearbox.kp`"""
    return ".".join(word.text for word in entry.path)


def _one_line(text: str) -> str:
    return " ".join(text.splitlines())


def _read(source: Text, at: int, text: str, findings: Findings) -> Setting:
    """The one entry of a line that begins at `at`. Raises Problem."""
    place = source.place(at, max(len(text), 1))
    path, equals, value = text.partition("=")
    if not equals or not value.strip():
        message = f"`{path.strip()[:40]}` is set to nothing"
        raise Problem(error("D231", message, place, help=EXAMPLE))
    if not path.strip():
        raise Problem(error("D231", "this sets nothing: no path stands before the `=`", place, help=EXAMPLE))
    before = len(findings.errors)
    tokens = [*_tokens(source, at, text, findings), Token(END, "", source, at + len(text.rstrip()), 1)]
    inner = Findings()
    entries, _ = parse(tokens, inner)
    end = tokens[-2].end if len(tokens) > 1 else at
    lacking = source.place(end, 1)  # no `;` ends it
    findings.add(*(each for each in inner.all if each.code != "D021" or each.at is None or each.at.place != lacking))
    if len(findings.errors) > before:
        raise Problem(())
    entry = entries[0] if len(entries) == 1 else None
    if not isinstance(entry, Setting) or entry.operator != "=" or entry.words:
        raise Problem(error("D231", "this is not one path and its value", place, help=_remedy(entry, place)))
    return entry


def _remedy(entry: object, place: Place) -> list[str]:
    """The remedy for an entry that `--set` does not take."""
    words = [word.text for word in getattr(entry, "words", ())]
    if isinstance(entry, Setting) and words[-1:] == ["macro"]:
        return ["a macro is defined by `-D NAME=VALUE`"]
    return [EXAMPLE]


def _tokens(source: Text, at: int, text: str, findings: Findings) -> Iterator[Token]:
    """The tokens of a line, white space apart, as tokens of the whole text."""
    for line in logical_lines(Text("", text)):
        for token in line:
            if token.kind == SPACE:
                continue
            token.source, token.offset = source, at + token.offset
            if token.kind in (BAD, CHARACTER) or token.text[:1] == "#":
                complain_of_stray(token, findings)
                token.kind, token.text = BAD, ""
            yield token
