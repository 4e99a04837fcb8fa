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
        positions = []
        solid = [token for token in self.body if token.kind != SPACE]
        for i, token in enumerate(solid):
            if token.kind != NAME:
                continue
            before = solid[i - 1].text if i else ""
            after = solid[i + 1].text if i + 1 < len(solid) else ""
            if token.text == OPTIONAL and self.variadic:
                positions.append(len(self.numbers) - 1)
            elif token.text in self.numbers and before not in ("#", "##") and after != "##":
                positions.append(self.numbers[token.text])
        return positions


def substituted(macro: Macro, arguments: Sequence[Argument]) -> list[Token]:
    """The body with the arguments in it. Tokens of the body and of arguments are handed on as they are, not copied.

    Raises NotOneToken.
    """
    if macro.parameters is None and not macro.pastes:
        return macro.body
    tokens = _Substitution(macro, arguments).of(macro.body)
    return [token for token in tokens if token.kind != NOTHING]


class _Substitution:
    """The substitution of one use of a macro, with the arguments of this use."""

    def __init__(self, macro: Macro, arguments: Sequence[Argument]) -> None:
        self.macro = macro
        self.arguments = arguments
        self.optional_depth = 0

    def of(self, body: list[Token]) -> list[Token]:
        """The tokens of an expanded body, or a part of one; an empty one beside a `##` is a token of kind NOTHING."""
        tokens: list[Token] = []
        position, pasting = 0, False
        while position < len(body):
            if body[position].kind == PASTE:
                pasting = True
                position += 1
                continue
            if not pasting and self.is_comma_of_rest(body, position):
                self.comma_and_rest(body[position], tokens)
                position += 3
                continue
            pieces, position = self.pieces(body, position, pasting)
            if pasting:
                pieces = [_joined(tokens.pop(), pieces[0]), *pieces[1:]]
                pasting = False
            tokens += pieces
        return [_as_one(token) for token in tokens] if self.macro.pastes else tokens

    def pieces(self, body: list[Token], position: int, pasting: bool) -> tuple[list[Token], int]:
        """The tokens of the expanded element at a position, and the position after it; at least one beside a `##`."""
        token = body[position]
        if self.macro.parameters is None or token.text not in ("#", OPTIONAL, *self.macro.numbers):
            return [token], position + 1
        if token.text == "#" and token.kind != STRING:
            position = _solid(body, position + 1)
            return [self.string(body, position)], self.end(body, position)
        if token.kind != NAME:
            return [token], position + 1
        end = self.end(body, position)
        beside = pasting or (end < len(body) and body[end].kind == PASTE)
        if token.text == OPTIONAL:
            pieces = self.optional(body, position, end)
        else:
            argument = self.arguments[self.macro.numbers[token.text]]
            pieces = list(argument) if beside else argument.expanded
        if (beside or self.optional_depth) and all(piece.kind == SPACE for piece in pieces):
            pieces = [Token(NOTHING, "", token.source, token.offset, token.length)]
        return pieces, end

    def end(self, body: list[Token], position: int) -> int:
        """The position after the parameter, or after the `__VA_OPT__(...)`, at a position."""
        return position + 1 if body[position].text != OPTIONAL else closing(body, _solid(body, position + 1)) + 1

    def optional(self, body: list[Token], position: int, end: int) -> list[Token]:
        """The tokens of the expanded `__VA_OPT__(...)` at a position: none where the rest of the arguments is empty."""
        if not any(token.kind != SPACE for token in self.arguments[-1].expanded):
            return []
        inside = body[_solid(body, position + 1) + 1 : end - 1]
        self.optional_depth += 1
        tokens = stripped(self.of(stripped(inside)))
        self.optional_depth -= 1
        return tokens

    def string(self, body: list[Token], position: int) -> Token:
        """The string of `#` with the parameter, or the `__VA_OPT__(...)`, at a position; white space is one blank."""
        token = body[position]
        if token.text == OPTIONAL:
            pieces = self.optional(body, position, self.end(body, position))
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

    def is_comma_of_rest(self, body: list[Token], position: int) -> bool:
        """Return True if gcc's `, ## __VA_ARGS__` begins here: a comma and the rest of the arguments, or neither."""
        if not self.macro.variadic or body[position].text != "," or position + 2 >= len(body):
            return False
        after = body[position + 3].kind if position + 3 < len(body) else ""
        return body[position + 1].kind == PASTE and body[position + 2].text == REST and after != PASTE

    def comma_and_rest(self, comma: Token, tokens: list[Token]) -> None:
        """Add the comma and the rest of the arguments as written, or nothing where there is no rest."""
        rest = self.arguments[-1]
        if rest.omitted:
            if tokens and tokens[-1].kind == SPACE:
                tokens.pop()
            return
        tokens.append(comma)
        if rest.spaced:
            tokens.append(Token(SPACE, " ", comma.source, comma.offset, comma.length))
        tokens += rest


def _joined(left: Token, right: Token) -> Token:
    """The token, of kind JOINED, that `##` makes of two; if one of them is empty, the other one unchanged."""
    if right.kind == NOTHING:
        return left
    if left.kind == NOTHING:
        return right
    joined = Token(JOINED, left.text + right.text, left.source, left.offset, left.length)
    joined.expansions = left.expansions
    return joined


def _as_one(token: Token) -> Token:
    """The token that a row of `##` has made, with its kind. Raises NotOneToken."""
    if token.kind == JOINED:
        tokens = [piece for line in logical_lines(Text("", token.text)) for piece in line if piece.text != "\n"]
        if len(tokens) != 1 or tokens[0].kind == SPACE:
            raise NotOneToken(token.text)
        token.kind = HASHES if tokens[0].kind == PASTE else tokens[0].kind
    return token


def closing(body: Sequence[Token], opening: int) -> int:
    """The position of the `)` that closes the parenthesis at `opening`; the end of the body where none does."""
    depth = 0
    for position in range(opening, len(body)):
        depth += {"(": 1, ")": -1}.get(body[position].text, 0)
        if depth <= 0:
            return position
    return len(body)


def _solid(body: Sequence[Token], position: int) -> int:
    """The first place from a position on without white space."""
    while body[position].kind == SPACE:
        position += 1
    return position


def stripped(tokens: list[Token]) -> list[Token]:
    """The tokens without white space at their ends."""
    first, last = 0, len(tokens)
    while first < last and tokens[first].kind == SPACE:
        first += 1
    while last > first and tokens[last - 1].kind == SPACE:
        last -= 1
    return tokens[first:last]
