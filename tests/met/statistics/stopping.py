"""How often a test that is looked at after every case is wrong, and how many cases it takes:
`python -m tests.met.statistics.stopping [CAMPAIGNS]`.

Synthetic campaigns, each of cases that miss a requirement with one chance. At the limit the requirement is just not
met, so whoever says "demonstrated" is wrong. A case is drawn by the gaps between misses: with so many misses nothing
changes but the number of cases, and a test's limits say at which number it decides.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator

import numpy as np
from scipy.special import bdtr

from met.frozen import frozen
from met.statistics import sequential
from met.statistics.sequential import DecisionLimits

CONFIDENCE = 0.9
SHARES = (0.95, 0.99, 0.9973)
TRUE_MISSES = (1.0, 0.5, 0.25, 0.1)
"""True shares of misses, of those that are allowed: 1 at the limit."""

LONGEST = 500.0
"""Cases of a campaign at most, over the fewest misses that it could have at the limit: misses expected there."""


@frozen
class Decisions:
    """For each campaign the number of cases after which it was decided, and how: 1 demonstrated, -1 refuted, 0 not
    within its cases, [campaign]."""

    cases: np.ndarray
    verdict: np.ndarray


def misses(rng: np.random.Generator, campaigns: int, chance: float, at_most: int) -> np.ndarray:
    """The number of the case that is the first, second ... miss of each campaign, [campaign, miss], rising; beyond
    `at_most` for the last of all."""
    count = int(at_most * chance + 8.0 * np.sqrt(at_most * chance) + 8.0)
    return np.cumsum(rng.geometric(chance, (campaigns, count)), axis=1)


def decide(limits: DecisionLimits, missed: np.ndarray, at_most: int) -> Decisions:
    """The decisions of a test that is looked at after every case, of campaigns of up to `at_most` cases, by their
    misses."""
    before = np.concatenate([np.zeros((len(missed), 1), missed.dtype), missed], axis=1)
    after = np.concatenate([missed, np.full((len(missed), 1), at_most + 1)], axis=1)
    so_far = np.minimum(np.arange(before.shape[1]), len(limits.demonstrates) - 1)
    last = np.minimum(after - 1, at_most)  # cases with so many misses
    shown = np.maximum(before, limits.demonstrates[so_far])
    shown = np.where(shown <= last, shown, at_most + 1)
    refuted = np.where((before <= limits.refutes[so_far]) & (before <= at_most) & (before > 0), before, at_most + 1)
    first = np.minimum(shown, refuted)
    place = first.argmin(axis=1)
    rows = np.arange(len(missed))
    cases = first[rows, place]
    verdict = np.where(shown[rows, place] <= refuted[rows, place], 1, -1) * (cases <= at_most)
    return Decisions(np.minimum(cases, at_most), verdict)


def fixed_limits(share: float, confidence: float, at_most: int) -> DecisionLimits:
    """The limits of the bound of Clopper and Pearson, which holds for a number of cases that was fixed beforehand."""
    counts = np.arange(at_most + 1)
    risk = 1.0 - confidence
    few = _fewest(counts, at_most, lambda cases, missed: bdtr(missed, cases, 1.0 - share) <= risk)
    many = _fewest(counts, at_most, lambda cases, missed: bdtr(missed - 1, cases, 1.0 - share) < confidence)
    return DecisionLimits(few, np.where(counts > 0, many - 1, -1))


def _fewest(counts: np.ndarray, at_most: int, holds: Callable[..., np.ndarray]) -> np.ndarray:
    low, high = counts.copy(), np.full(len(counts), at_most + 1)
    while (low < high).any():
        middle = (low + high) // 2
        with np.errstate(invalid="ignore"):
            found = holds(middle, counts) | (middle > at_most)
        low, high = np.where(found, low, np.minimum(middle + 1, high)), np.where(found, middle, high)
    return high


def fixed_number(limits: DecisionLimits, chance: float, power: float) -> int:
    """The fewest cases, chosen beforehand, that demonstrate it with this probability where so large a share misses it;
    0 where none of `limits` does."""
    numbers = limits.demonstrates[limits.demonstrates < limits.demonstrates[-1]]
    enough = bdtr(np.arange(len(numbers)), numbers, chance) >= power
    return int(numbers[enough.argmax()]) if enough.any() else 0


def at_most_of(share: float) -> int:
    """Cases of a campaign of a share."""
    return round(LONGEST / (1.0 - share))


def false_shares(share: float, campaigns: int, seed: int) -> tuple[float, float, float]:
    """The shares of campaigns at the limit that say "demonstrated": by the bound for a fixed number, which was fixed;
    by the same looked at after every case; by the sequential test looked at after every case."""
    at_most = at_most_of(share)
    missed = misses(np.random.default_rng(seed), campaigns, 1.0 - share, at_most)
    fixed = fixed_limits(share, CONFIDENCE, at_most)
    number = int(fixed.demonstrates[2])
    once = (missed <= number).sum(axis=1) <= 2
    found = (decide(each, missed, at_most) for each in (fixed, sequential.limits(share, CONFIDENCE, at_most)))
    peeked, watched = ((each.verdict == 1).mean() for each in found)
    return float(once.mean()), float(peeked), float(watched)


def lines(campaigns: int) -> Iterator[str]:
    """The tables of both questions."""
    risk = 1.0 - CONFIDENCE
    most = risk + 2.0 * np.sqrt(risk * CONFIDENCE / campaigns)
    yield f'{campaigns:,} campaigns at the limit, confidence {CONFIDENCE:.0%}; false "demonstrated" at most {most:.2%}'
    yield "share     fixed number   the same, looked at   sequential, looked at   cases at most"
    for number, share in enumerate(SHARES):
        once, peeked, watched = false_shares(share, campaigns, number)
        yield f"{share:<8.2%}  {once:>12.2%}   {peeked:>19.2%}   {watched:>21.2%}   {at_most_of(share):>13,}"
    yield ""
    yield "cases until demonstrated: sequential, half and 90 % of campaigns; fixed number that succeeds as often"
    yield "share     true share of misses   demonstrated   sequential 50 %   fixed 50 %   sequential 90 %   fixed 90 %"
    for number, share in enumerate(SHARES):
        at_most = at_most_of(share)
        fixed, watched = (make(share, CONFIDENCE, at_most) for make in (fixed_limits, sequential.limits))
        for part in TRUE_MISSES[1:]:
            chance = part * (1.0 - share)
            found = decide(watched, misses(np.random.default_rng(number), campaigns, chance, at_most), at_most)
            cases = np.where(found.verdict == 1, found.cases, np.inf)
            half, most_of_them = np.quantile(cases, [0.5, 0.9], method="inverted_cdf")
            planned = [fixed_number(fixed, chance, power) for power in (0.5, 0.9)]
            yield (
                f"{share:<8.2%}  {chance:>20.3%}   {(found.verdict == 1).mean():>12.2%}   {half:>15,.0f}   "
                f"{planned[0]:>10,}   {most_of_them:>15,.0f}   {planned[1]:>10,}"
            )


if __name__ == "__main__":
    print("\n".join(lines(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000)))
