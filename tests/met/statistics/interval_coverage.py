"""How often the intervals of sensitivity indices hold what is true, and how wide they are.

    python -m tests.met.statistics.interval_coverage [CASES...] [--draws N]

Ten functions of up to eight inputs, uniform from 0 to 1, are drawn again and again. For each number of cases and each
function it prints the share of the draws whose interval holds the true index: alone and with others, of the input for
which it is smallest, and the mean half width. `saltelli` has as many cases, made by its scheme. What is true comes from
4 million cases of that scheme, exact to about 0.002. docs/sensitivity.md has the figures.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np

from met.statistics.saltelli import saltelli_shares
from met.statistics.sensitivity import Shares, shares

Function = Callable[[np.ndarray], np.ndarray]

G = np.array([0.0, 1.0, 4.5, 9.0, 99.0, 99.0, 99.0, 99.0])
"""Parameters of the g function: I. M. Sobol, 1998."""


def ishigami(x: np.ndarray) -> np.ndarray:
    """T. Ishigami and T. Homma, 1990, with a = 7 and b = 0.1."""
    x = np.pi * (2.0 * x - 1.0)
    return np.asarray(np.sin(x[0]) + 7.0 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0]))


def corner(x: np.ndarray) -> np.ndarray:
    """A sharp step where two inputs are large, and a third input."""
    return np.asarray(((x[0] > 0.37) & (x[1] > 0.61)) + 0.1 * x[2])


def product(x: np.ndarray) -> np.ndarray:
    """Two inputs that do nothing alone, and a third."""
    return np.asarray((x[0] - 0.5) * (x[1] - 0.5) + 0.1 * x[2])


def step(x: np.ndarray) -> np.ndarray:
    """A sharp step, an input beside it, and one without effect."""
    return np.asarray((x[0] > 0.3) + 0.2 * x[1])


FUNCTIONS: dict[str, tuple[int, Function]] = {
    "ishigami": (3, ishigami),
    "g": (8, lambda x: np.prod((np.abs(4.0 * x.T - 2.0) + G) / (1.0 + G), axis=1)),
    "corner": (3, corner),
    "product": (3, product),
    "step": (3, step),
    "off_centre": (2, lambda x: x[0] * x[1]),
    "three": (3, lambda x: np.prod(2.0 * x - 1.0, axis=0)),
    "smooth": (4, lambda x: np.exp(x[0]) + 0.3 * x[1] + 0.1 * x[2] ** 2),
    "peak": (3, lambda x: 1.0 / (1.0 + 100.0 * (x[0] - 0.5) ** 2) + 0.2 * x[1] * x[2]),
    "diagonal": (3, lambda x: (x[0] + x[1] > 1.0) * 1.0),
}


def scheme(rng: np.random.Generator, inputs: int, pairs: int) -> np.ndarray:
    """Cases of Saltelli's scheme from random points, [input, case]."""
    a, b = rng.uniform(size=(2, inputs, pairs))
    mixed = [np.where(np.arange(inputs)[:, None] == place, b, a) for place in range(inputs)]
    return np.stack([a, *mixed, b], axis=2).reshape(inputs, -1)


def true_indices(inputs: int, function: Function) -> np.ndarray:
    """First-order and total indices, [input, 2]."""
    x = scheme(np.random.default_rng(9), inputs, 4_000_000 // (inputs + 2))
    found = saltelli_shares(list(x), function(x))
    assert found is not None
    return np.array([(share.first, share.total) for share in found.inputs])


def held(truth: np.ndarray, found: Shares) -> np.ndarray:
    """Whether the intervals hold what is true, within 0.002, and their half widths.

    Returns [input, alone and with others, held and half width]
    """
    rows = []
    for (first, total), share in zip(truth, found.inputs, strict=True):
        middle, half = 0.5 * (share.total_high + share.total_low), 0.5 * (share.total_high - share.total_low)
        rows.append(
            [
                (abs(share.first - first) <= share.first_by + 0.002, share.first_by),
                (abs(middle - total) <= half + 0.002, half),
            ]
        )
    return np.array(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", type=int, default=[300, 1_000, 3_000])
    parser.add_argument("--draws", type=int, default=200)
    wanted = parser.parse_args()
    known = {name: true_indices(*each) for name, each in FUNCTIONS.items()}
    print(
        f"{'cases':>6} {'function':<12}{'alone':>7}{'±':>7}{'others':>8}{'±':>7}   saltelli: {'alone':>7}{'±':>7}",
        end="",
    )
    print(f"{'others':>8}{'±':>7}")
    for cases in wanted.cases:
        for name, (inputs, function) in FUNCTIONS.items():
            line = f"{cases:6} {name:<12}"
            pairs = cases // (inputs + 2)
            for estimate, draw in ((shares, None), (saltelli_shares, pairs)):
                if draw is not None and draw < 64:
                    continue
                rows = []
                for seed in range(wanted.draws):
                    rng = np.random.default_rng([seed, cases])
                    x = rng.uniform(size=(inputs, cases)) if draw is None else scheme(rng, inputs, draw)
                    found = estimate(list(x), function(x))
                    assert found is not None
                    rows.append(held(known[name], found))
                mean = np.mean(rows, axis=0)
                least, wide = mean[:, :, 0].min(axis=0), mean[:, :, 1].mean(axis=0)
                line += f"{least[0]:7.1%}{wide[0]:7.3f}{least[1]:8.1%}{wide[1]:7.3f}" + (" " * 13) * (draw is None)
            print(line, flush=True)


if __name__ == "__main__":
    main()
