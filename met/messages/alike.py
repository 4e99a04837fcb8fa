"""Words that are like one another: what may have been meant by a word that nothing has as its name."""

from __future__ import annotations

from collections.abc import Iterable

from met.messages.message import Help, TextChange


def nearest(word: str, known: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The known word that is most like this one; None where none is `cutoff` like it (1 is the same word)."""
    import difflib  # only who made a mistake pays for it

    close = difflib.get_close_matches(word, list(known), n=1, cutoff=cutoff)
    return close[0] if close else None


def meant(word: str, known: Iterable[str]) -> str | None:
    """The known word that this one may have been meant for, capitals or not; or none."""
    folded = {candidate.lower(): candidate for candidate in dict.fromkeys(known)}
    close = nearest(word.lower(), folded)
    return folded[close] if close is not None else None


def did_you_mean(word: str, known: Iterable[str]) -> tuple[str, ...]:
    """The help line that offers the word that may have been meant, with the change that writes it; or none."""
    close = meant(word, known)
    return (Help(f"did you mean `{close}`?", TextChange(close, word)),) if close is not None else ()
