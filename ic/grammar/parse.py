"""Tokens to the tree of `ic.grammar.syntax`, by recursive descent.

The parser knows no word of the language but `for`, `let`, `param`, `like`, `of`, `from`, `and`, `or`, `not` and `when`,
and those only where they stand: what a run of names means is decided by what comes behind it, so a joint may be called
`at`, `let` or `sample`.

    names =  or  +=      a setting; all names but the last are words
    names {              a group
    names value ;        a statement;  require name: value ;  one with a name
    for name in ... {    a loop, and [names] = value ; an entry for each name (`ic.grammar.loops`)
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import field
from itertools import pairwise, takewhile
from types import MappingProxyType

from ic.grammar.cursor import NOT_OPEN, SHOWN, EndedInsideBlock, Unreadable, span, token_in_words
from ic.grammar.declared_units import UNIT, is_declaration
from ic.grammar.syntax import (
    Broken,
    Call,
    Entry,
    Expression,
    Group,
    Let,
    Name,
    OverCases,
    Setting,
    Statement,
    UseEntry,
    Word,
)
from ic.grammar.uses import Uses
from ic.text.edition import EDITION_WORD
from ic.text.lexer import BAD, COMMAND_LINE, END, NAME, NUMBERS, STRING, Token
from ic.text.limits import Findings, GiveUp, without_collection
from ic.text.source import UnreadableStretch
from met import units
from met.diagnostic import Diagnostic, Label, write
from met.frozen import frozen
from met.units import Measure

NO_UNITS: Mapping[str, Measure] = MappingProxyType({})
COMPARE = ("require", "exclude")
DEFINED_IN_PARTS = ("arm", "link", "joint", "loop", "servo", "run", "substitute")  # by a block in a block
PARAM = "param"
LETS = ("let", PARAM)
_OVER_CASES = "write `require METRIC < LIMIT in 99 % of cases with 90 % confidence;`"


@frozen
class Parsed:
    """The entries of a deck, and further results of parsing.

    unreadable  the stretches that could not be read
    sound       whether the rest is where it belongs: not where a brace is missing or too many
    units       those that the deck declares
    uses        the decks that it uses
    """

    entries: tuple[Entry, ...] = ()
    unreadable: tuple[UnreadableStretch, ...] = ()
    sound: bool = False
    units: Mapping[str, Measure] = field(default_factory=dict)
    uses: tuple[UseEntry, ...] = ()


def parse(
    tokens: Sequence[Token], findings: Findings | None = None, declared: Mapping[str, Measure] = NO_UNITS
) -> tuple[tuple[Entry, ...], tuple[Diagnostic, ...]]:
    """The entries of a deck, and its errors; with errors, the entries are incomplete. declared: further known units."""
    findings = findings if findings is not None else Findings()
    return parse_on(tokens, findings, declared).entries, findings.all


def parse_on(
    tokens: Sequence[Token],
    findings: Findings,
    declared: Mapping[str, Measure] = NO_UNITS,
    looped: list[int] | None = None,
) -> Parsed:
    """The deck of these tokens; errors go into the findings. looped: tokens of all loops so far, of decks counted
    together."""
    parser = _Parser(tokens, findings)
    parser.declared = declared
    parser.looped = looped if looped is not None else parser.looped
    entries: list[Entry] = []
    sound = False
    with without_collection(), suppress(GiveUp, EndedInsideBlock):
        parser.declare_units()
        parser.entries(entries)
        sound = not parser.unbalanced
    return Parsed(tuple(entries), tuple(parser.unreadable), sound, parser.declared, tuple(parser.uses))


def parse_expression(tokens: Sequence[Token], findings: Findings) -> Expression | None:
    """The expression that these tokens make; None, with errors in the findings, where they do not make one."""
    parser = _Parser(tokens, findings)
    with suppress(GiveUp, EndedInsideBlock, Unreadable):
        expression = parser.value()
        if parser.token.kind != END:
            helps = {"=": "`==` compares", "&": "`and` joins conditions", "|": "`or` joins conditions"}
            parser.unexpected("the end of the line", helps.get(parser.token.text, ()))
        return expression
    return None


class _Parser(Uses):
    """The parser of a deck's entries, on top of its parts for values, loops, units and used decks."""

    closed_within_line: Token | None = None  # a `}` that ends a block and a line that has not begun with it

    def entries(self, into: list[Entry]) -> None:
        """Entries up to the closing brace of the block they stand in, or to the end."""
        depth = len(self.open)
        while True:
            token = self.token
            if token.kind == END:
                if self.open:
                    self.never_closed()
                return
            if token.text == "}":
                if depth:
                    return
                self.closes_nothing()
                continue
            if token.text == ";":
                self.advance()
                continue
            if token.text == UNIT and is_declaration(self.tokens, self.position):
                self.step_over_unit()
                continue
            start, operators = self.position, self.operators
            try:
                if self.at_loop():
                    self.loop(into)
                elif self.at_use():
                    self.use()
                elif self.at_several():
                    into += self.several()
                else:
                    into.append(self.entry())
            except Unreadable:
                self.recover(start, depth)
                into += self.note_unreadable(start)
            self.operators = operators

    def note_unreadable(self, start: int) -> list[Entry]:
        """Note that an entry could not be read, with the known part: the name that it sets, to an unknown value."""
        tokens = self.tokens[start : max(self.position, start + 1)]
        names = list(takewhile(lambda token: token.kind == NAME, tokens))
        behind = len(names)
        while behind + 1 < len(tokens) and tokens[behind].text == "." and tokens[behind + 1].kind == NAME and names:
            behind += 2
        path = [names[-1], *tokens[len(names) + 1 : behind : 2]] if names else []
        first, last = tokens[0], tokens[-1]
        sets = bool(names) and behind < len(tokens) and tokens[behind].text in ("=", "+=")
        end = last.place.macros[-1].use if last.place.macros else last.place
        place = first.place.macros[-1].use if first.place.macros else first.place
        known = [name.text for name in names[1:] or names]
        if len(names) == 1 and behind == 1 and tokens[behind:] and tokens[behind].text == "(":  # likewise, misspelt
            known += [token.text for token in tokens if token.kind == NAME]
        if any(token.kind == BAD for token in tokens):  # a macro's use, perhaps: its arguments may be names
            known += re.findall(
                r"[A-Za-z_]\w*", last.source.rest_of_line(first.offset if first.source is last.source else last.offset)
            )
        self.unreadable.append(
            UnreadableStretch(place, (end.line, end.column + end.length), tuple(known), None if sets else self.within)
        )
        if not sets:
            return []
        value = Broken(first.place)
        if names[0].text in LETS:
            return [Let(_word(names[1]), value, span(names[0], names[1]))] if len(names) == 2 and len(path) == 1 else []
        operator = tokens[behind].text
        return [Setting(_words(names[:-1]), _words(path), operator, value, span(names[0], path[-1]))]

    def block(self) -> tuple[Entry, ...]:
        """The entries of a block, from its `{` to its `}`. Notes what may explain a brace that is missing elsewhere: a
        `}` that is indented less than the line of its `{`, and one that stands behind other tokens on its line."""
        opening = self.enter()
        body: list[Entry] = []
        outer = self.begin_items()
        self.entries(body)
        self.end_items(outer)
        closing = self.leave()
        on_lines = [self.line_of(bracket) for bracket in (opening, self.tokens[self.position - 2], closing)]
        if not self.open and on_lines[0] != on_lines[1] == on_lines[2] and not closing.expansions:
            self.closed_within_line = closing
        if self.misindented is None and not (opening.expansions or closing.expansions):
            before, after = opening.source.indent(opening.offset), closing.source.indent(closing.offset)
            if after < before and opening.line != closing.line:
                self.misindented = (opening, closing)
        return tuple(body)

    def closes_nothing(self) -> None:
        """Report a `}` too many, with the place where a `{` may be missing; what was reported there follows from it."""
        token = self.advance()
        self.unbalanced = True
        also = [Label(place, "perhaps a `{` is missing here") for place in self.unopened[-1:]]
        if self.unopened:
            self.findings.withdraw("D021", self.unopened.pop())
        elif self.closed_within_line is not None:
            also = [Label(self.closed_within_line.place, "perhaps the `{` to this one is missing")]
        self.tell("D022", f"this `{token.text}` closes nothing", token, also=also, help=NOT_OPEN)

    # entries

    def entry(self) -> Entry:
        """Read one entry of a deck or block: a `let`, a setting, a group or a statement. Raises Unreadable."""
        start = self.position
        first = self.token
        if first.kind != NAME:
            self.not_an_entry()
        names = [self.advance()]
        if first.text in (*LETS, UNIT) and self.token.kind not in (NAME, BAD) and self.token.place.macros:
            self.replaced_name()
        while self.token.kind == NAME and not (len(names) > 0 and self.line_break_in(names)):
            names.append(self.advance())
        arm_from = len(names) >= 3 and (first.text, names[2].text) == ("arm", "from")
        if arm_from and self.token.text in (".", "..", "/", "-"):
            self.file_without_quotes(names)
        tail: list[Token] = []
        if self.token.text == ".":
            self.position -= 1
            tail = self.path()[1:]
        text = self.token.text
        if len(names) == 1 and first.text == EDITION_WORD and self.token.kind in NUMBERS:
            self.not_the_edition(first)
        if text in ("=", "+="):
            if len(names) == 2 and (names[0].text == "let" or (names[0].text == PARAM and not self.open)):
                return self.let(names, tail)
            return self.setting(names, tail)
        if text == "{":
            self.refuse_braces()
        if text == "{" or (text == ";" and _base_at(names) is not None):
            return self.group(names, tail)
        if text == "(" and _made_from(names, tail):
            return self.group_from(names)
        if self.token.kind == STRING and names[0].text == "arm" and names[-1].text == "from":
            self.fail(
                "D020",
                "a file is named by what it is",
                self.token,
                help=write(f"urdf({self.token.text})", f"write `from urdf({self.token.text[:SHOWN]})`"),
            )
        if text == "," and _base_at(names) is not None:
            self.fail("D032", "there is one base only", self.token, help="a definition takes after one other")
        if text in ("-=", "*=", "/="):
            self.fail("D023", f"there is no `{text}`", self.token, help="`=` sets a value, `+=` appends to a list")
        if text == ":" and len(names) == 2 and names[0].text == "require" and not tail:
            return self.named_requirement(names)
        if text == ":":
            self.unexpected("`=`", help="a deck writes `name = value;`")
        if text == "==" and len(names) == 1 and not tail:
            self.fail("D023", "`==` compares", self.token, help=write("=", "to set a value, write `=`"))
        if _base_at(names) is not None and (not self.begins_value() or self.on_new_line(self.position)):
            self.no_brace([*names, *tail])
        return self.statement(start, names, tail)

    def file_without_quotes(self, names: list[Token]) -> None:
        """Refuse `arm panda from robots/panda.urdf { }`, a file without quotes. Raises Unreadable."""
        first = self.position if len(names) == 3 else self.position - 1
        last = self.position
        while (
            self.tokens[last + 1].text not in ("{", ";", ")")
            and self.tokens[last + 1].kind != END
            and not self.on_new_line(last + 1)
        ):
            last += 1
        file = "".join(token.text for token in self.tokens[first : last + 1])
        self.fail(
            "D020",
            "the name of a file stands in quotes",
            span(self.tokens[first], self.tokens[last]),
            help=f'write `from urdf("{file[:SHOWN]}")`',
        )

    def line_break_in(self, names: list[Token]) -> bool:
        """Return True if a new line breaks a run of names that cannot be one entry: `q` and, below it, `mass = 3;`."""
        return self.begins_entry(self.position) and self.following.text in ("=", "+=")

    def not_an_entry(self) -> None:
        token = self.token
        if token.text in (")", "]"):
            self.unbalanced = True
            self.fail("D022", f"this `{token.text}` closes nothing", token, help=NOT_OPEN)
        if token.text == "{":
            self.unexpected("a name before the block", help="a block is written `kind name { ... }`")
        if token.text == "*=":
            self.fail(
                "D020", "`*=` is one sign", token, help=write("* =", "the servo of all other joints is `* = SERVO;`")
            )
        self.unexpected("an entry, such as `name = value;`")

    def no_brace(self, names: list[Token]) -> None:
        """Report `servo light like strong` without its `{`, and skip what follows of its block. Raises Unreadable."""
        self.tell(
            "D020",
            f"expected `{{` after `{names[-1].text[:40]}`",
            self.behind(names[-1]),
            help="a definition has a block, `... like BASE { ... }`; `;` stands for an empty one",
        )
        inside = self.token.kind == NAME and self.following.text in ("=", "+=")
        inside = inside or (self.token.text == "}" and not self.open)
        depth = 0
        while inside and self.token.kind != END:
            depth += {"{": 1, "}": -1}.get(self.token.text, 0)
            inside = depth >= 0
            self.advance()
        raise Unreadable

    def replaced_name(self) -> None:
        """A macro has put its body where the name of a `let` or `unit` stands: `-D height=2` and `let height = ...`."""
        step = self.token.place.macros[-1]
        message = f"the macro `{step.macro}` has put {token_in_words(self.token)} in the place of this name"
        helps: tuple[str, ...] = ("give one of the two another name",)
        if self.token.source.name == COMMAND_LINE:
            message = f"`-D {step.macro}` has put {token_in_words(self.token)} in the place of this name"
            helps = (
                "-D defines a macro, as #define does; it does not set a `let`",
                f"`--set '{step.macro}=VALUE'` does, with its unit",
            )
        self.fail("D035", message, step.use, help=helps)

    def let(self, names: list[Token], tail: list[Token]) -> Let:
        """The `let` or `param` whose names are read. tail: of a path, which is an error. Raises Unreadable."""
        name = names[1]
        if tail:
            message = f"`{names[0].text}` gives a value to one name, without points"
            path = ".".join(part.text for part in (name, *tail))
            help = f"a value of a deck that is used is set in a run: `with {path} = ...;`"
            self.fail("D020", message, span(name, tail[-1]), help=help)
        if self.is_reserved(name):
            message = f"`{name.text}` is the unit {units.UNITS[name.text].word}, so it cannot name a value"
            self.tell(
                "D026",
                message,
                name,
                help="choose another name: after a number it would be the unit; in edition 2 (`deck 2;`) it may",
            )
        if self.token.text == "+=":
            self.fail("D023", f"`{names[0].text}` gives a value once", self.token, help=write("="))
        self.advance()
        value = self.value()
        self.semicolon(value)
        return Let(_word(name), value, span(names[0], name), names[0].text == PARAM)

    def setting(self, names: list[Token], tail: list[Token]) -> Setting:
        """Read `NAMES.TAIL = VALUE;`, of which the names are read; all but the last are words. tail: the rest of the
        path behind the last name. Raises Unreadable."""
        operator = self.advance()
        words, path = names[:-1], [names[-1], *tail]
        if words and words[0].text in COMPARE and operator.text == "=":
            helps = [write("==", "to compare, write `==`")]
            if words[0].text == "require":
                helps = [write(sign, f"a requirement is a limit: write `{sign}`") for sign in ("<=", ">=")]
            self.fail("D023", "`=` sets a value", operator, help=helps)
        if len(words) > 1:
            self.unopened.append(self.behind(words[-1]))
        value = self.value()
        self.semicolon(value, may_open=bool(words))
        return Setting(_words(words), _words(path), operator.text, value, span(names[0], path[-1]))

    def group(self, names: list[Token], tail: list[Token]) -> Group:
        """The block whose names are read, and which begins here. tail: the rest of its base's path. Raises
        Unreadable."""
        base = _base_at(names)
        self.unopened += [self.behind(a) for a, b in pairwise(names) if self.line_of(a) != self.line_of(b)]
        if tail and (base is None or base + 2 != len(names)):
            self.fail(
                "D020",
                "a block's name has no points",
                span(names[-1], tail[-1]),
                help=_without_points(names, tail),
            )
        like = of = None
        words = names
        while base is not None:
            path = [words[base + 1], *(tail if base + 2 == len(names) else [])]
            name = Name(_words(path), span(path[0], path[-1]))
            if words[base].text == "like":
                like = name
            else:
                of = name
            words = words[:base]
            further = _base_at(words)
            if further is not None and words[further].text == names[base].text:
                self.fail("D032", f"`{names[base].text}` is there twice", names[base], help="there is one base only")
            base = further
        body: tuple[Entry, ...] = ()
        if self.token.text == ";":
            self.advance()
        else:
            outer, self.within = self.within, span(words[0], words[-1])
            body = self.block()
            self.within = outer
        return Group(_words(words), like, of, body, span(words[0], words[-1]))

    def group_from(self, names: list[Token]) -> Group:
        """Read `arm NAME from urdf("FILE") { ... }`, where the block is the group's, not the call's."""
        words, called = names[:-2], names[-1]
        if _base_at(words) is not None:
            self.fail(
                "D032", f"`{words[-2].text}` and `from` both name a base", names[-2], help="there is one base only"
            )
        behind = self.tokens[self.closing(self.position) + 1]
        if behind.text in ("like", "of"):
            self.fail("D032", f"`from` and `{behind.text}` both name a base", behind, help="there is one base only")
        call = self.call(Name((_word(called),), called.place), called)
        if not isinstance(call, Call):
            self.fail("D020", "a file has no unit", self.previous, help="leave the unit out")
        body = call.body
        if body is None:
            if self.token.text != ";":
                self.unexpected("`{` or `;`", help="a block holds what differs from the file; `;` stands for none")
            self.advance()
        made_from = Call(call.name, call.positional, call.named, None, call.place)
        return Group(_words(words), None, None, body or (), span(words[0], words[-1]), made_from)

    def statement(self, start: int, names: list[Token], tail: list[Token]) -> Statement:
        """Read a statement such as `require settle < 10 s;`: what follows the names says which of them are in its
        value."""
        token = self.token
        count = _words_before_value(names, bool(tail), token)
        if count == 0 or (count == len(names) and not (self.begins_value() or token.text in ("-", "+", "!"))):
            self.no_statement([*names, *tail], token)
        self.position = start + count
        words = names[:count]
        value = self.value()
        if words[0].text == "sample" and self.token.text == "{":
            self.unexpected("`;`", help="a sample names its design: `sample lhs(200) { ... }`")
        if words[0].text == "require":
            value = self.over_cases(value)
        self.semicolon(value, may_open=True)
        return Statement(_words(words), value, span(words[0], words[-1]))

    def named_requirement(self, names: list[Token]) -> Statement:
        """Read `require NAME: COMPARISON;`."""
        self.advance()
        value = self.over_cases(self.value())
        self.semicolon(value)
        return Statement(_words(names[:1]), value, span(names[0], names[-1]), _word(names[1]))

    def over_cases(self, comparison: Expression) -> Expression:
        """Read `in SHARE of cases` and `with CONFIDENCE confidence`, one or both, which a comparison may precede."""
        if self.token.text not in ("in", "with") or self.on_new_line(self.position):
            return comparison
        first = self.token
        share = confidence = None
        if self.token.text == "in":
            self.advance()
            share = self.expression()
            self.take_word_of_requirement("of")
            self.take_word_of_requirement("cases")
        if self.token.text == "with":
            self.advance()
            confidence = self.expression()
            self.take_word_of_requirement("confidence")
        return OverCases(comparison, share, confidence, span(first, self.previous))

    def take_word_of_requirement(self, word: str) -> None:
        """Step over a word that a requirement over cases needs here. Raises Unreadable where another stands here."""
        if self.token.text != word:
            self.unexpected(f"`{word}`", help=_OVER_CASES)
        self.advance()

    def no_statement(self, names: list[Token], token: Token) -> None:
        last = names[-1]
        wanted = "`=`, `{` or a value"
        if self.on_new_line(self.position) or token.kind == END or token.text in (";", "}"):
            if token.kind == BAD:
                raise Unreadable
            self.fail("D020", f"expected {wanted} after `{last.text[:40]}`", self.behind(last))
        self.unexpected(f"{wanted} after `{last.text[:40]}`")


def _word(token: Token) -> Word:
    return Word(token.text, token.place)


def _words(tokens: Sequence[Token]) -> tuple[Word, ...]:
    return tuple(Word(token.text, token.place) for token in tokens)


def _base_at(names: Sequence[Token]) -> int | None:
    """The position of `like X` or `of X` at the end of a definition's names, behind kind and name; None without one."""
    position = len(names) - 2
    return position if position >= 2 and names[position].text in ("like", "of") else None


def _made_from(names: Sequence[Token], tail: Sequence[Token]) -> bool:
    """Return True if the names of a definition end in `from MODEL`, before the arguments of the model."""
    return len(names) >= 4 and names[-2].text == "from" and not tail


def _words_before_value(names: Sequence[Token], dotted: bool, following: Token) -> int:
    """The number of a statement's names that come before its value."""
    texts = [name.text for name in names]
    for i in range(1, len(texts)):
        if texts[i] == "not":
            return i
        if texts[i] in ("and", "or") and i > 1:
            return i - 1
    if dotted or len(names) == 1:
        return len(names) - dotted
    if texts[-1] == "when" or following.kind in (*NUMBERS, STRING) or following.text == "[":
        return len(names)
    return len(names) - 1


def _without_points(names: list[Token], tail: list[Token]) -> str:
    """The remedy for `linear shoulder.servo { }`, whose name may be any, and for `shoulder.servo { }`."""
    if len(names) > 1 and names[0].text not in DEFINED_IN_PARTS:
        name = "_".join(part.text for part in (names[-1], *tail))
        return write(name, f"give it a name without points, such as `{name}`")
    return f"write `{names[-1].text} {{ {tail[0].text} {{ ... }} }}`"
