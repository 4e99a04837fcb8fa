"""Similar words: suggestions for a word that names nothing."""

from __future__ import annotations

from collections.abc import Iterable

from met.messages.message import Help, TextChange


def nearest(word: str, known: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The known word that is most similar to this one; None where none is at least `cutoff` similar (1: the same
    word)."""
    import difflib  # imported only after a mistake

    close = difflib.get_close_matches(word, list(known), n=1, cutoff=cutoff)
    return close[0] if close else None


def meant(word: str, known: Iterable[str]) -> str | None:
    """The known word that was probably meant, regardless of capitals; None where there is none."""
    folded = {candidate.lower(): candidate for candidate in dict.fromkeys(known)}
    close = nearest(word.lower(), folded)
    return folded[close] if close is not None else None


def did_you_mean(word: str, known: Iterable[str]) -> tuple[str, ...]:
    """The help line that offers the word that was probably meant, with the change that writes it; none where there is
    no such word."""
    close = meant(word, known)
    return (Help(f"did you mean `{close}`?", TextChange(close, word)),) if close is not None else ()
