"""Probabilities that a difference arises by chance: of one test, and corrected for the number of tests."""

from __future__ import annotations

from collections.abc import Sequence


def sign_test(higher: int, lower: int) -> float:
    """The probability that pairs differ at least as one-sidedly by chance, if both directions were equally likely.

    higher, lower  pairs whose second value is larger, and smaller; pairs of equal values are left out. Two-sided and
                   exact. For a requirement that is met in one of two versions, this is McNemar's exact test. 1 where no
                   pair differs.
    Q. McNemar, Psychometrika 12 (1947) 153-157; W. J. Conover, Practical Nonparametric Statistics, 3rd ed., 3.4, 3.5.
    """
    if higher < 0 or lower < 0:
        raise ValueError(f"{higher} and {lower} are not numbers of pairs")
    if higher == lower:
        return 1.0
    from scipy.special import bdtr

    return min(1.0, 2.0 * float(bdtr(min(higher, lower), higher + lower, 0.5)))


def holm(chances: Sequence[float]) -> list[float]:
    """Probabilities of several tests, each computed as if it were the only one, corrected for their number.

    S. Holm, Scandinavian Journal of Statistics 6 (1979) 65-70.
    """
    order = sorted(range(len(chances)), key=lambda i: chances[i])
    out, largest = [1.0] * len(chances), 0.0
    for rank, i in enumerate(order):
        largest = max(largest, min(1.0, (len(chances) - rank) * chances[i]))
        out[i] = largest
    return out
