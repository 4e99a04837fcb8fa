"""The knowledge that logs can give of a deck's numbers, by the slopes of what is computed: rank, condition, and which
go together.

A parameter is known as far as its standard error is small beside its size. Where several are unknown although each by
itself leaves a mark, a change of all of them together leaves none: the right singular vectors of the slopes say which.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from met.frozen import frozen

UNKNOWN = 0.25
"""Standard error of a parameter, as a share of its size, from which on it is unknown."""

PARTS = (0.1, 0.01)
"""Share of the largest part of a change, each in sizes of its parameter, from which on a part counts; and where that
leaves one part alone."""


@frozen
class Known:
    """The knowledge that logs give of parameters.

    deviation   standard errors to expect, SI, [path]; infinite where nothing is known
    alone       those of each parameter by itself, the others known, SI, [path]
    verdict     of each: "known", "tied" to others, "unseen", or "held" where the deck allows no value beside it
    condition   of the slopes in sizes of the parameters: largest singular value by smallest, infinite for no rank
    rank        number of directions whose standard error is below `UNKNOWN` sizes
    size        of the parameters, SI, [path]
    together    changes that leave no mark: of each, by position of the parameter, its part in SI; the largest is one
                size of its parameter, or its sign's
    """

    deviation: np.ndarray
    alone: np.ndarray
    verdict: tuple[str, ...]
    condition: float
    rank: int
    size: np.ndarray
    together: tuple[dict[int, float], ...]

    @property
    def worst(self) -> float:
        """The largest standard error of a parameter that is not held, in its size."""
        free = np.array([verdict != "held" for verdict in self.verdict])
        return float(np.max(self.deviation / self.size, where=free, initial=0.0))


def known(slopes: np.ndarray, size: np.ndarray, held: np.ndarray, wider: float | np.ndarray = 1.0) -> Known:
    """The knowledge that weighted slopes give.

    slopes  of residuals in units of their noise, [number, path];  size: of the parameters, [path]
    held    whether the deck allows no value beside a parameter's, [path]
    wider   factor of standard errors where residuals are correlated
    """
    scaled = slopes * size
    _, singular, right = np.linalg.svd(scaled, full_matrices=False)
    singular = np.concatenate([singular, np.zeros(len(size) - len(singular))])
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.where(singular > 0.0, 1.0 / singular, np.inf)
        parts = np.where(right**2 > 1e-24, right**2 * along[: len(right), None] ** 2, 0.0)
        deviation = np.sqrt(parts.sum(axis=0)) * wider
        alone = 1.0 / np.linalg.norm(scaled, axis=0) * wider
        condition = float(singular[0] / singular[-1]) if singular[-1] > 0.0 else np.inf
    verdict = [
        "held" if fixed else "known" if whole < UNKNOWN else "unseen" if by_itself >= UNKNOWN else "tied"
        for whole, by_itself, fixed in zip(deviation, alone, held, strict=True)
    ]
    together = []
    for direction, error in zip(right[::-1], along[::-1], strict=True):
        largest = float(np.abs(direction).max())
        for part in PARTS:
            members = np.flatnonzero(np.abs(direction) >= part * largest)
            if len(members) > 1:
                break
        if error >= UNKNOWN and len(members) > 1 and any(verdict[member] == "tied" for member in members):
            sign = np.sign(direction[members[0]])
            together.append(
                {int(member): float(sign * direction[member] / largest * size[member]) for member in members}
            )
    rank = int(np.sum(along < UNKNOWN))
    return Known(deviation * size, alone * size, tuple(verdict), condition, rank, size, tuple(together))


def correlated(
    covariance: np.ndarray, paths: Sequence[str], known: Known, least: float = 0.9
) -> Iterator[tuple[str, str, float]]:
    """Pairs of known parameters whose estimates are correlated by `least` or more, with the correlation."""
    deviation = np.sqrt(np.diag(covariance))
    for first_place in range(len(paths)):
        for other in range(first_place):
            with np.errstate(invalid="ignore", divide="ignore"):
                share = float(covariance[first_place, other] / (deviation[first_place] * deviation[other]))
            if abs(share) >= least and known.verdict[first_place] == known.verdict[other] == "known":
                yield (paths[other], paths[first_place], share)
