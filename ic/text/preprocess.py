"""The preprocessor: pcpp reads the directives; tokens go in and come out, never text.

pcpp keeps the conditionals. Ours are the tokens, the macros (each token keeping the places it came through), the values
of conditions, the search for included files, every check, and every message.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pcpp import Action, OutputDirective

from ic.text.complaints import Complaints
from ic.text.conditions import check_written, evaluate, with_defined
from ic.text.edition import EDITIONS, LATEST
from ic.text.files import LIBRARY, Files, FoundFile, folders_by_slash
from ic.text.lexer import (
    BAD,
    CHARACTER,
    COMMAND_LINE,
    END,
    NAME,
    NOTHING,
    SPACE,
    STRING,
    Text,
    Token,
    complain_of_stray,
    complain_of_unseen,
    logical_lines,
)
from ic.text.limits import (
    CONDITION_DEPTH,
    INCLUDE_DEPTH,
    LONGEST_LINE,
    LONGEST_NAME,
    MOST_CONDITIONS,
    MOST_INCLUDES,
    MOST_TOKENS,
    Findings,
    GiveUp,
    without_collection,
)
from ic.text.macros import Macros
from ic.text.naming import VALUES, Named, names_in
from ic.text.source import SourceFile
from met.diagnostic import Diagnostic, Label, Place, Problem, did_you_mean, error, meant, nearest, write
from met.frozen import frozen

CONDITIONALS = ("if", "ifdef", "ifndef", "elif", "elifdef", "elifndef", "else", "endif")
DIRECTIVES = (*CONDITIONALS, "define", "undef", "include", "pragma", "error", "warning")
_LONG_LINE = re.compile(rf"^[^\n]{{{LONGEST_LINE + 1}}}", re.MULTILINE)
_INCLUDES = 'write `#include "beside.ic"` or `#include <servos/rigid_gearbox.ic>`'
TRUTH = "TRUTH"  # the kind of a condition's value


@frozen
class Tokens:
    """A deck after the preprocessor.

    tokens       those of the deck, without white space; the last is of kind END
    sources      every file that was read, in order, and behind them the text of what `-D` defines
    diagnostics  errors and warnings so far
    complete     whether all was read; where not, the tokens are not worth parsing
    count        how many tokens were read, white space included
    """

    tokens: tuple[Token, ...]
    sources: tuple[SourceFile, ...]
    diagnostics: tuple[Diagnostic, ...]
    complete: bool
    count: int


def preprocess(
    path: str | Path,
    include_dirs: Sequence[str | Path] = (),
    defines: Sequence[str] = (),
    *,
    library: Path = LIBRARY,
) -> Tokens:
    """Preprocess a deck and all files that it includes. `defines` are as after `-D`: `NAME` or `NAME=VALUE`."""
    files = Files(include_dirs, library)
    return preprocess_on(files, Findings(), lambda: files.deck(path), defines)


def preprocess_on(
    files: Files,
    findings: Findings,
    deck: Callable[[], FoundFile],
    defines: Sequence[str] = (),
    *,
    included: tuple[tuple[str, int], ...] = (),
    used: tuple[int, ...] = (),
    count: int = 0,
) -> Tokens:
    """Preprocess a deck and all files that it includes; errors go into the findings.

    deck            finds it; raises Problem
    defines         as after `-D`
    included, used  the lines that led to it, as a `Place` has them
    count           tokens that were read before
    """
    run = _Preprocessor(files, findings, count)
    whole = True
    try:
        with without_collection():
            run.define_from_command_line(defines)
            run.read_deck(deck(), included, used)
            run.warn_of_names()
    except GiveUp:
        whole = False
    except Problem as problem:
        whole = False
        Complaints.add(findings, *problem.diagnostics)
    sources = (*files.read_so_far.values(), *run.command_line)
    return Tokens(tuple(run.output), sources, findings.all, whole, run.count)


def find_file(
    files: Files, findings: Findings, includer: FoundFile, name: str, angled: bool, place: Place
) -> FoundFile | None:
    """The file of an `#include` or a `use`; None where there is none, which is reported."""
    directories = files.where(includer, angled)
    file = files.find(name, directories)
    if file is None:
        quoted = f"<{name}>" if angled else f'"{name}"'
        link = files.dangling(name, directories)
        near = (
            folders_by_slash(name, quoted) or did_you_mean(name, files.listed(directories))
            if link is None
            else (f"`{link}` is a link to a file that is not there",)
        )
        looked = f"looked in {', '.join(dict.fromkeys(d.in_words for d in directories))}"
        findings.error("D005", f"cannot find {quoted}", place, help=(*near, looked))
    return file


class _Conditional:
    """An open conditional: the directive, whether the text around it counts, whether its present part does; how many
    names had been asked for that were no macros, where an `#ifdef` asks for one; else 0."""

    __slots__ = ("active", "done", "otherwise", "outer", "token", "undefined_before")

    def __init__(self, token: Token, outer: bool, active: bool) -> None:
        self.token = token
        self.outer = outer
        self.active = active
        self.done = active
        self.otherwise: Token | None = None
        self.undefined_before = 0


class _Preprocessor(Macros):
    """One reading of a deck: pcpp's preprocessor with the lexer, macros, conditions, files and messages of MET.

    output        the deck's tokens so far, without white space
    command_line  the text of the macros of `-D`, where there are some
    count         tokens that were read, white space included
    """

    def __init__(self, files: Files, findings: Findings, count: int) -> None:
        self.files = files
        self.output: list[Token] = []
        self.command_line: tuple[SourceFile, ...] = ()
        self.command_line_macros: dict[str, Token] = {}
        self._given_text: Text | None = None
        self._including: list[tuple[FoundFile, Text]] = []
        self._entered: list[Place] = []
        self._ifs: list[list[_Conditional]] = []
        self._misspelt_ifs = 0  # such as `#ifdfe`, that no `#endif` has closed
        self._once: set[str] = set()
        self._included = 0
        self.count = count
        self._directive: Token | None = None
        self._conditions = 0
        self._zeros: dict[str, Place] = {}  # names in conditions that are no macros
        # names that a condition asked for as macros and that were none, with the number of tokens handed over before
        # it, and the `#endif` of an `#ifdef`
        self._not_defined: list[tuple[Token, int, Token | None]] = []
        super().__init__(findings)

    # reading

    def define_from_command_line(self, defines: Sequence[str]) -> None:
        """Define the macros of `-D NAME=VALUE`, whose tokens have places on the command line."""
        if not defines:
            return
        written = "".join(
            f"{name} {value if equals else 1}\n" for name, equals, value in (d.partition("=") for d in defines)
        )
        self.command_line = (SourceFile(COMMAND_LINE, written, ""),)
        self._given_text = Text(COMMAND_LINE, written)
        for line in logical_lines(self._given_text):
            self.define(self.tokenstrip(line))
        self.command_line_macros = {name: macro.name_token for name, macro in self.macros.items()}

    def read_deck(self, file: FoundFile, included: tuple[tuple[str, int], ...], used: tuple[int, ...]) -> None:
        source = Text(file.name, self.files.text(file), included, used)
        if self._given_text is not None:  # which is read like the deck
            self._given_text.edition = source.edition
        self._read(file, source, source.place(0, 1))
        self.output.append(Token(END, "", source, len(source.text.rstrip()), 1))

    def warn_of_names(self) -> None:
        """Warn about names in conditions that are not macros, and macros on the command line that nothing uses."""
        names = (*self._zeros, *(token.text for token, *_ in self._not_defined))
        named = names_in(self.output, (*names, *(token.text for token in self.not_undefined)))
        lets = [name for name, defined_name in named.items() if defined_name.word in VALUES]
        for name, place in self._zeros.items():
            message = f"`{name}` is no macro, so it counts as 0 in this condition"
            if name in named:
                self._warn_of_definition(message, place, named[name])
            else:
                help = f"ask `defined({name})`, or define it before: `#define {name} 1`, `-D {name}=1`"
                self.findings.warn("D036", message, place, help=[*did_you_mean(name, self.macros), help])
        for token, before, end in self._not_defined:
            if token.text not in named:
                continue
            definition = named[token.text]
            behind = end is not None and _stands_before(end, definition.token) and definition.word in VALUES
            if definition.number <= before or _stands_before(definition.token, token) or behind:
                message = f"`{token.text}` is no macro, so it counts as not defined in this condition"
                self._warn_of_definition(message, token.place, named.pop(token.text))
        for token in self.not_undefined:
            if token.text in lets and token.text in named:
                message = f"`{token.text}` is no macro, so this `#undef` changes nothing"
                self._warn_of_definition(message, token.place, named.pop(token.text))
        for name, token in self.command_line_macros.items():
            if name not in self.used_names:
                near = did_you_mean(name, [*self.used_names, *self._zeros])
                let = nearest(name, lets)
                values = [] if let is None else [f"a `let` is set by `--set '{let}=VALUE'`"]
                self.findings.warn(
                    "D037",
                    f"`-D {name}` has no effect: nothing in the deck asks for a macro `{name}`",
                    token.place,
                    help=[*near, *values],
                )

    def _warn_of_definition(self, message: str, place: Place, named: Named) -> None:
        """Warn about a condition that asks for the macro of a name which the deck defines otherwise."""
        label = Label(named.token.place, f"{named.what}; a condition sees macros alone")
        help = "define a macro for it, `#define NAME ...`, and ask that"
        self.findings.warn("D036", message, place, also=(label,), help=help)

    def _read(self, file: FoundFile, source: Text, place: Place) -> None:
        """Append a file's tokens to `output`, its directives carried out. place: of the `#include`. Stray characters
        and an `#if` that is not closed are reported (D008)."""
        self._including.append((file, source))
        self._entered.append(place)
        self._ifs.append([])
        complain_of_unseen(source, self.findings)
        self._check_heading(source)
        for token in self.parsegen("", source):
            kind = token.kind
            if kind == SPACE:
                continue
            if kind in (BAD, CHARACTER) or token.text[:1] == "#":
                if token.text:
                    complain_of_stray(token, self.findings)
                token.kind, token.text = BAD, ""
            self.output.append(token)
        for left in self._ifs.pop():
            self.findings.error(
                "D008",
                f"`#{left.token.text}` is not closed",
                left.token.place,
                help=f"`{source.name}` ends without its `#endif`",
            )
        self._including.pop()
        self._entered.pop()

    def _check_heading(self, source: Text) -> None:
        """Check the line with a file's edition, which gives the deck no tokens."""
        edition_line = source.heading
        if edition_line is None:
            return
        if edition_line.edition not in EDITIONS:
            start, end = edition_line.number
            help = f"this MET knows the editions {' and '.join(map(str, EDITIONS))}"
            if edition_line.edition > LATEST:
                help += "; a newer one may know it"
            message = f"there is no edition {edition_line.edition} of the deck language"
            self._give_up("D390", message, source.place(start, end - start), help=help)
        if not edition_line.closed:
            place = source.place(edition_line.last, 1)
            self.findings.error(
                "D021", "expected `;`", place, help=write(";", "an entry ends with `;`", where="before")
            )

    def group_lines(self, _text: str, source: Text) -> Iterable[list[Token]]:
        """The lines for pcpp. Those that `#if` leaves out are lexed, since a comment may begin there."""
        ifs = self._ifs[-1]
        long = _LONG_LINE.search(source.joined)
        if long is not None:
            place = source.place(source.written_at(long.start()), 1)
            self._give_up("D018", f"a line has at most {LONGEST_LINE} characters", place)
        joined = len(source.joined) < len(source.text)
        headed = source.heading.last if source.heading is not None else 0
        for line in logical_lines(source):
            if headed and line[0].offset < headed:
                line = [token for token in line if token.kind == SPACE or token.offset >= headed]
            self.count += len(line)
            if self.count > MOST_TOKENS:
                self._give_up("D018", f"more than {MOST_TOKENS} tokens", line[0].place)
            if len(line) > 1 and line[-2].kind == BAD and line[-2].text == "/*":
                complain_of_stray(line.pop(-2), self.findings)
            if joined and not (ifs and not ifs[-1].active):
                self._warn_of_joined_comments(line)
            first = next((token for token in line if token.kind != SPACE), line[-1])
            if first.kind == SPACE:  # pcpp takes longer over an empty line than its lexer
                continue
            if first.text != "#":
                if ifs and not ifs[-1].active:
                    continue
                for token in line:
                    if token.kind == BAD:
                        complain_of_stray(token, self.findings)
                        token.text = ""
            elif not ifs or ifs[-1].active:
                # a macro's name and the parenthesis of its call stand on one side of a directive
                yield [Token(NOTHING, "", source, first.offset, 0)]
            if first.text == "#":
                _as_elif(line, line.index(first) + 1)
            yield line

    def _warn_of_joined_comments(self, line: list[Token]) -> None:
        for token in line:
            written = token.source.text[token.offset : token.end]
            if token.kind == SPACE and written.startswith("//") and "\n" in written:
                self.findings.warn(
                    "D003",
                    "this comment goes on in the next line",
                    token.place,
                    help="its line ends with `\\`, which joins the next to it; write `/* ... */` for several lines",
                )

    def include(self, tokens: list[Token], _line: object) -> Iterable[Token]:
        """Read an included file. Its tokens go straight to the output, since pcpp has handed over all before them."""
        directive = self._directive
        assert directive is not None
        with self.findings.gather():
            self._include(directive, *self._header(tokens, directive))
        return ()

    def _include(self, directive: Token, name: str, angled: bool, place: Place) -> None:
        """Read the file of this name, in < > if it is angled, unless it is not to be read again. place: of the name.
        What keeps it from being read is reported, or raised as Problem."""
        includer, source = self._including[-1]
        file = find_file(self.files, self.findings, includer, name, angled, place)
        if file is None or file.identity in self._once:
            return
        self._included += 1
        if len(self._including) > INCLUDE_DEPTH:
            self._too_deep(place)
        if self._included > MOST_INCLUDES:
            self._give_up("D018", f"more than {MOST_INCLUDES} files are included", place)
        included = ((source.name, directive.line), *source.included)
        used = tuple(n + 1 for n in source.used)
        try:
            text = self.files.text(file)
        except Problem as problem:
            raise Problem(reached_by(d, place, included, used) for d in problem.diagnostics) from None
        self._read(file, Text(file.name, text, included, used), place)

    def _header(self, tokens: list[Token], directive: Token) -> tuple[str, bool, Place]:
        """The name in an `#include`, whether in < >, and its place. Raises Problem D005 where there is none."""
        if tokens and tokens[0].kind == STRING:
            name, angled, place, rest = tokens[0].text[1:-1], False, tokens[0].place, tokens[1:]
        elif tokens and tokens[0].text == "<":
            first = tokens[0]
            close = next((i for i, token in enumerate(tokens) if token.text[:1] == ">"), None)
            written = (
                first.source.rest_of_line(first.offset) if not first.expansions else "".join(t.text for t in tokens)
            )
            end = written.find(">")
            if end < 0:
                raise Problem(error("D005", "`#include <` without its `>`", first.place, help=_INCLUDES))
            name, angled, place = written[1:end], True, first.source.place(first.offset, end + 1, first.expansions)
            rest = tokens[close + 1 :] if close is not None else []
        else:
            place = tokens[0].place if tokens else directive.place
            raise Problem(error("D005", "`#include` needs a file", place, help=_INCLUDES))
        if not name.strip():
            raise Problem(error("D005", "`#include` needs a file, and this name is empty", place, help=_INCLUDES))
        self._nothing_after(rest, "#include")
        return name, angled, place

    def _too_deep(self, place: Place) -> None:
        """Report the circle of includes, at the include that closes it, or just that they go too deep."""
        chain = [file.identity for file, _ in self._including]
        for last, identity in enumerate(chain):
            first = chain.index(identity)
            if first < last:
                loop = " -> ".join(file.name for file, _ in self._including[first : last + 1])
                help = "`#pragma once` at the head of a file lets it be read only once"
                self._give_up("D006", f"circular include: {loop}", self._entered[last], help=help)
        self._give_up("D006", f"includes go deeper than {INCLUDE_DEPTH} files", place)

    # directives

    def on_directive_handle(self, directive: Token, args: list[Token], _passing: bool, _before: object) -> bool:
        """Handle each directive before pcpp acts on it; parts that pcpp must not see are removed."""
        self._directive = directive
        ifs = self._ifs[-1]
        name = directive.text
        if name in CONDITIONALS:
            self._conditional(name, directive, args, ifs)
            return True
        if ifs and not ifs[-1].active and not name.startswith(("el", "end")):  # `#elseif` was meant for us
            raise OutputDirective(Action.IgnoreAndRemove)
        if name in ("define", "undef", "include"):
            if not args and name != "include":
                usage = "#define NAME VALUE" if name == "define" else "#undef NAME"
                self.findings.error("D007", f"`#{name}` needs a name", directive.place, help=f"write `{usage}`")
                raise OutputDirective(Action.IgnoreAndRemove)
            return True
        if name in ("error", "warning"):
            self._announce(name, directive, args)
        elif name == "pragma" and args and args[0].text == "once":
            self._once.add(self._including[-1][0].identity)
        elif name == "pragma":
            self.findings.error("D007", "the only `#pragma` is `once`", directive.place, help="leave it out")
        elif name == "line":
            self.findings.error(
                "D007",
                "a deck cannot have `#line`: messages say where a thing really stands",
                directive.place,
                help="leave it out",
            )
        else:
            close = meant(
                "elif" if name in ("elseif", "elsif") else name,
                CONDITIONALS if name.startswith(("if", "el", "end")) else DIRECTIVES,
            )
            near = [write(close, f"did you mean `{close}`?", old=name)] if close is not None else []
            self._misspelt_ifs += close in ("if", "ifdef", "ifndef")
            apart = directive.source.text[directive.offset - 1] != "#"
            self.findings.error(
                "D007",
                f"`#{name}` is not a directive",
                directive.place,
                help=[*near, *(["a comment begins with `//`"] if apart or not near else [])],
            )
        raise OutputDirective(Action.IgnoreAndRemove)

    def _announce(self, name: str, directive: Token, args: list[Token]) -> None:
        words = " ".join(directive.source.rest_of_line(args[0].offset).split()) if args else f"`#{name}`"
        tell = self.findings.error if name == "error" else self.findings.warn
        tell("D014" if name == "error" else "D015", words[:LONGEST_NAME], directive.place)

    def _conditional(self, name: str, directive: Token, args: list[Token], ifs: list[_Conditional]) -> None:
        """Follow the conditionals beside pcpp, which gets only a name, 0 or 1."""
        if name in ("if", "ifdef", "ifndef"):
            outer = not ifs or ifs[-1].active
            truth, undefined_before = False, len(self._not_defined)
            if name == "if":
                truth = outer and self._condition(directive, args)
                args[:] = [_constant(truth, directive)]
            elif outer:
                truth = self._known(name, directive, args) == (name == "ifdef")
            ifs.append(_Conditional(directive, outer, truth))
            if name == "ifdef" and len(self._not_defined) > undefined_before:
                ifs[-1].undefined_before = len(self._not_defined)
            if len(ifs) > CONDITION_DEPTH:
                self._give_up("D018", f"`#if` goes deeper than {CONDITION_DEPTH}", directive.place)
            return
        if not ifs and self._misspelt_ifs:  # already reported: this belongs to it
            self._misspelt_ifs -= name == "endif"
            raise OutputDirective(Action.IgnoreAndRemove)
        if not ifs:
            self.findings.error(
                "D007",
                f"`#{_directive_text(directive)}` without an `#if`",
                directive.place,
                help="leave it out, or write the `#if` that it belongs to",
            )
            raise OutputDirective(Action.IgnoreAndRemove)
        opened = ifs[-1]
        if name == "endif":
            # what a deck defines behind it was not asked for, either: no order matters
            if question := ifs.pop().undefined_before:
                token, before, _ = self._not_defined[question - 1]
                self._not_defined[question - 1] = token, before, directive
            self._nothing_after(args, "#endif")
        elif opened.otherwise is not None:
            label = Label(opened.otherwise.place, "the `#else` is here")
            self.findings.error(
                "D007",
                f"`#{_directive_text(directive)}` after `#else`",
                directive.place,
                also=(label,),
                help="`#elif` comes before the one `#else`",
            )
            raise OutputDirective(Action.IgnoreAndRemove)
        elif name == "else":
            opened.otherwise = directive
            opened.active = opened.outer and not opened.done
            self._nothing_after(args, "#else")
        elif opened.outer and opened.active:
            opened.active = False
        elif opened.outer and not opened.done:
            word = _directive_text(directive)
            if word == "elif":
                opened.active = opened.done = self._condition(directive, args)
            else:
                opened.active = opened.done = self._known(word, directive, args) == (word == "elifdef")
            args[:] = [_constant(opened.active, directive)]

    def _known(self, name: str, directive: Token, args: list[Token]) -> bool:
        if not args or args[0].kind != NAME:
            self.findings.error(
                "D007",
                f"`#{name}` needs a name",
                args[0].place if args else directive.place,
                help=f"write `#{name} NAME`",
            )
            args[:] = [Token(NAME, "__nothing__", directive.source, directive.offset, directive.length)]
            return False
        self._nothing_after(args[1:], f"#{name} {args[0].text}")
        return self._is_defined(args[0])

    def _is_defined(self, name: Token) -> bool:
        """Return True if there is a macro of this name; a name without is noted, for `warn_of_names`."""
        defined = self.is_macro(name.text)
        if not defined:
            self._not_defined.append((name, len(self.output), None))
        return defined

    def _condition(self, directive: Token, args: list[Token]) -> bool:
        """Return True if the condition of an `#if` or `#elif` holds; False, with an error, where it has no meaning."""
        with self.findings.gather():
            check_written(directive, args)
            self._conditions += 1
            if self._conditions > MOST_CONDITIONS:
                self._give_up("D018", f"more than {MOST_CONDITIONS} conditions", directive.place)
            before = with_defined(args, self._is_defined)
            self.in_condition = True
            expanded = self.expand_macros(before)
            self.in_condition = False
            condition = with_defined(expanded, self._is_defined)
            if not condition:
                help = "`#ifdef NAME` asks whether a macro is defined; a value is one of `#define NAME 1`"
                message = f"the condition of this `#{directive.text}` expands to nothing"
                raise Problem(error("D009", message, args[0].place, help=help))
            zeros: list[Token] = []
            truth = evaluate(condition, self.findings, zeros.append)
            for token in zeros:
                self._zeros.setdefault(token.text[:LONGEST_NAME], token.place)
            return truth
        return False

    def evalexpr(self, tokens: list[Token]) -> tuple[Any, Any]:
        """The value for pcpp, found by `_condition`."""
        return (tokens[0].text == "1", None)

    def on_error(self, _file: object, _line: object, message: str) -> None:
        """Report pcpp's own errors that ours have not forestalled."""
        if not message.startswith("Unterminated") and self._directive is not None:
            self.findings.error("D007", f"the preprocessor cannot read this: {message}", self._directive.place)


def _as_elif(line: list[Token], first: int) -> None:
    """Turn `#elifdef` and `#elifndef` into an `#elif`, which pcpp knows; the token's kind keeps the difference."""
    directive = next((token for token in line[first:] if token.kind != SPACE), None)
    if directive is not None and directive.text in ("elifdef", "elifndef"):
        directive.kind, directive.text = directive.text, "elif"


def _stands_before(name: Token, condition: Token) -> bool:
    """Return True if a name of the output stands in the same file as a condition, and before it."""
    name_place = name.place.macros[-1].use if name.place.macros else name.place
    return name_place.file == condition.place.file and (name_place.line, name_place.column) < (
        condition.place.line,
        condition.place.column,
    )


def _directive_text(directive: Token) -> str:
    """The directive's name as written: see `_as_elif`."""
    return directive.text if directive.kind == NAME else directive.kind


def reached_by(
    complaint: Diagnostic, including: Place, included: tuple[tuple[str, int], ...], used: tuple[int, ...]
) -> Diagnostic:
    """The mistake in an included file, moved to the line that names the file where it has no place of its own."""
    place = including if complaint.at is None else replace(complaint.at.place, included=included, used=used)
    return replace(complaint, at=Label(place))


def _constant(truth: bool, token: Token) -> Token:
    return Token(TRUTH, "1" if truth else "0", token.source, token.offset, token.length)
