"""Substitution of a macro's use: its body with the arguments in it; `#`, `##` and `__VA_OPT__` are done as in gcc."""

from __future__ import annotations

from collections.abc import Sequence

from ic.text.lexer import HASHES, NAME, NOTHING, PASTE, SPACE, STRING, Text, Token, logical_lines

REST = "__VA_ARGS__"
OPTIONAL = "__VA_OPT__"
JOINED = "JOINED"


class NotOneToken(Exception):
    """Raised where `##` makes a text of two tokens that is not one token."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.text = text


class Argument(list[Token]):
    """A macro's argument as written, and what it expands to.

    omitted  it is the rest of the arguments, and nothing is written for it, not even its comma
    spaced   white space stands before it
    """

    expanded: list[Token]
    omitted = spaced = False


class Macro:
    """A macro as defined: its name, its parameters (None where it takes none, `__VA_ARGS__` for the rest), its body.

    The body has no white space at its ends nor beside `##`.
    """

    __slots__ = ("body", "expanded", "name_token", "numbers", "parameters", "pastes")

    def __init__(self, name_token: Token, parameters: tuple[str, ...] | None, body: list[Token]) -> None:
        self.name_token = name_token
        self.parameters = parameters
        self.body = body
        self.numbers = {name: i for i, name in enumerate(parameters or ())}
        self.pastes = any(token.kind == PASTE for token in body)
        self.expanded = frozenset(self._put_in_expanded()) if parameters else frozenset()

    @property
    def name(self) -> str:
        return self.name_token.text

    @property
    def variadic(self) -> bool:
        return self.parameters is not None and self.parameters[-1:] == (REST,)

    def _put_in_expanded(self) -> list[int]:
        """The parameters whose arguments are needed expanded: those that neither `#` nor `##` takes as written."""
        found = []
        solid = [token for token in self.body if token.kind != SPACE]
        for i, token in enumerate(solid):
            if token.kind != NAME:
                continue
            before = solid[i - 1].text if i else ""
            after = solid[i + 1].text if i + 1 < len(solid) else ""
            if token.text == OPTIONAL and self.variadic:
                found.append(len(self.numbers) - 1)
            elif token.text in self.numbers and before not in ("#", "##") and after != "##":
                found.append(self.numbers[token.text])
        return found


def substituted(macro: Macro, arguments: Sequence[Argument]) -> list[Token]:
    """The body with the arguments in it. Tokens of the body and of arguments are handed on as they are, not copied.

    Raises NotOneToken.
    """
    if macro.parameters is None and not macro.pastes:
        return macro.body
    made = _Substitution(macro, arguments).of(macro.body)
    return [token for token in made if token.kind != NOTHING]


class _Substitution:
    def __init__(self, macro: Macro, arguments: Sequence[Argument]) -> None:
        self.macro = macro
        self.arguments = arguments
        self.optional_depth = 0

    def of(self, body: list[Token]) -> list[Token]:
        """The tokens of an expanded body, or a part of one; an empty one beside a `##` is a token of kind NOTHING."""
        made: list[Token] = []
        at, pasting = 0, False
        while at < len(body):
            if body[at].kind == PASTE:
                pasting = True
                at += 1
                continue
            if not pasting and self.is_comma_of_rest(body, at):
                self.comma_and_rest(body[at], made)
                at += 3
                continue
            pieces, at = self.pieces(body, at, pasting)
            if pasting:
                pieces = [_joined(made.pop(), pieces[0]), *pieces[1:]]
                pasting = False
            made += pieces
        return [_as_one(token) for token in made] if self.macro.pastes else made

    def pieces(self, body: list[Token], at: int, pasting: bool) -> tuple[list[Token], int]:
        """The tokens of the expanded element at `at`, and the position after it; at least one token beside a `##`."""
        token = body[at]
        if self.macro.parameters is None or token.text not in ("#", OPTIONAL, *self.macro.numbers):
            return [token], at + 1
        if token.text == "#" and token.kind != STRING:
            at = _solid(body, at + 1)
            return [self.string(body, at)], self.end(body, at)
        if token.kind != NAME:
            return [token], at + 1
        end = self.end(body, at)
        beside = pasting or (end < len(body) and body[end].kind == PASTE)
        if token.text == OPTIONAL:
            pieces = self.optional(body, at, end)
        else:
            argument = self.arguments[self.macro.numbers[token.text]]
            pieces = list(argument) if beside else argument.expanded
        if (beside or self.optional_depth) and all(piece.kind == SPACE for piece in pieces):
            pieces = [Token(NOTHING, "", token.source, token.offset, token.length)]
        return pieces, end

    def end(self, body: list[Token], at: int) -> int:
        """The position after the parameter, or after the `__VA_OPT__(...)`, at `at`."""
        return at + 1 if body[at].text != OPTIONAL else closing(body, _solid(body, at + 1)) + 1

    def optional(self, body: list[Token], at: int, end: int) -> list[Token]:
        """The tokens of the expanded `__VA_OPT__(...)` at `at`: none where the rest of the arguments is empty."""
        if not any(token.kind != SPACE for token in self.arguments[-1].expanded):
            return []
        inside = body[_solid(body, at + 1) + 1 : end - 1]
        self.optional_depth += 1
        made = _stripped(self.of(_stripped(inside)))
        self.optional_depth -= 1
        return made

    def string(self, body: list[Token], at: int) -> Token:
        """The string of `#` with the parameter, or the `__VA_OPT__(...)`, at `at`, with white space as one blank."""
        token = body[at]
        if token.text == OPTIONAL:
            pieces = self.optional(body, at, self.end(body, at))
        else:
            pieces = list(self.arguments[self.macro.numbers[token.text]])
        texts: list[str] = []
        for piece in pieces:
            if piece.kind not in (SPACE, NOTHING):
                texts.append(piece.text)
            elif piece.kind == SPACE and texts and texts[-1] != " ":
                texts.append(" ")
        text = "".join(texts).strip(" ").replace("\\", "\\\\").replace('"', '\\"')
        return Token(STRING, f'"{text}"', token.source, token.offset, token.length)

    def is_comma_of_rest(self, body: list[Token], at: int) -> bool:
        """Return True if gcc's `, ## __VA_ARGS__` begins here: a comma and the rest of the arguments, or neither."""
        if not self.macro.variadic or body[at].text != "," or at + 2 >= len(body):
            return False
        after = body[at + 3].kind if at + 3 < len(body) else ""
        return body[at + 1].kind == PASTE and body[at + 2].text == REST and after != PASTE

    def comma_and_rest(self, comma: Token, made: list[Token]) -> None:
        """Add the comma and the rest of the arguments as written, or nothing where there is no rest."""
        rest = self.arguments[-1]
        if rest.omitted:
            if made and made[-1].kind == SPACE:
                made.pop()
            return
        made.append(comma)
        if rest.spaced:
            made.append(Token(SPACE, " ", comma.source, comma.offset, comma.length))
        made += rest


def _joined(left: Token, right: Token) -> Token:
    """The token, of kind JOINED, that `##` makes of two; if one of them is empty, the other one unchanged."""
    if right.kind == NOTHING:
        return left
    if left.kind == NOTHING:
        return right
    made = Token(JOINED, left.text + right.text, left.source, left.offset, left.length)
    made.expansions = left.expansions
    return made


def _as_one(token: Token) -> Token:
    """The token that a row of `##` has made, with its kind. Raises NotOneToken."""
    if token.kind == JOINED:
        found = [each for line in logical_lines(Text("", token.text)) for each in line if each.text != "\n"]
        if len(found) != 1 or found[0].kind == SPACE:
            raise NotOneToken(token.text)
        token.kind = HASHES if found[0].kind == PASTE else found[0].kind
    return token


def closing(body: Sequence[Token], opening: int) -> int:
    """The position of the `)` that closes the parenthesis at `opening`; the end of the body where none does."""
    depth = 0
    for at in range(opening, len(body)):
        depth += {"(": 1, ")": -1}.get(body[at].text, 0)
        if depth <= 0:
            return at
    return len(body)


def _solid(body: Sequence[Token], at: int) -> int:
    """The first place from `at` on without white space."""
    while body[at].kind == SPACE:
        at += 1
    return at


def _stripped(tokens: list[Token]) -> list[Token]:
    """The tokens without white space at their ends."""
    first, last = 0, len(tokens)
    while first < last and tokens[first].kind == SPACE:
        first += 1
    while last > first and tokens[last - 1].kind == SPACE:
        last -= 1
    return tokens[first:last]
