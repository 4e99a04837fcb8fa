"""Small decks written by tests, read, and told about as a user would see it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ic.grammar.syntax import Deck
from ic.read import read
from ic.text.preprocess import Tokens, preprocess
from met.diagnostic import Problem
from met.messages.render import render


class Desk:
    """A directory to write decks in; it is the current one, so that names in messages are short."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.library = directory / "library"
        self.library.mkdir()

    def write(self, text: str | bytes, name: str = "a.ic") -> str:
        path = self.directory / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return name

    def read(
        self, text: str | bytes, include_dirs: Sequence[str] = (), defines: Sequence[str] = (), **others: str
    ) -> Deck:
        for name, other in others.items():
            self.write(other, f"{name}.ic")
        return read(self.write(text), include_dirs, defines, library=self.library)

    def tokens(self, text: str | bytes, include_dirs: Sequence[str] = (), defines: Sequence[str] = ()) -> Tokens:
        return preprocess(self.write(text), include_dirs, defines, library=self.library)

    def texts(self, text: str, defines: Sequence[str] = ()) -> str:
        """The tokens after the preprocessor, a space between; no error allowed."""
        made = self.tokens(text, defines=defines)
        assert not [d for d in made.diagnostics if d.severity == "error"], made.diagnostics
        return " ".join(token.text for token in made.tokens[:-1])

    def told(
        self, text: str | bytes, include_dirs: Sequence[str] = (), files: Mapping[str, str | bytes] | None = None
    ) -> str:
        """What the user is shown: the errors and warnings, rendered; "" for none."""
        for name, other in (files or {}).items():
            self.write(other, name)
        try:
            deck = self.read(text, include_dirs)
        except Problem as problem:
            return render(problem.diagnostics, problem.sources)
        return render(deck.warnings, {source.name: source.text for source in deck.sources})

    def codes(self, text: str | bytes) -> list[str]:
        """Codes and lines of what is told, such as `D021:3`."""
        try:
            found = self.read(text).warnings
        except Problem as problem:
            found = problem.diagnostics
        return [f"{d.code}:{d.at.place.line}" if d.at else d.code for d in found]
