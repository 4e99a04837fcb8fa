"""Errors by the step as MET estimates them, against the truth: random arms with rk4 at a hundredth of the step.

python -m tests.batch.verification.truth [COUNT]                 200 runs take some ten minutes on one core
python -m tests.batch.verification.truth stops [[FIRST] COUNT]  other arms, with stops, friction and delays: extremes,
                                                                shares and instants at a sixteenth of the step; 300
                                                                take six minutes
"""

from __future__ import annotations

import math
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import beta

import ic
from batch.campaigns.verification.verifying import verify
from batch.queries.step_errors.figures import case_error
from met import run as engine
from met.analysis.step_error import refine
from met.plan import Experiment
from tests.batch.verification import stops
from tests.oracles.random_deck import random_deck

FINER = 100
"""Steps of the truth in one."""

SMALLEST = 1e-9
"""Of the value: a true error below it is none to be compared with."""

METRICS = """
    metric m_end = final { of = j0.q; }    metric m_rate = final { of = j0.qd; }
    metric m_rms = rms { of = j0.qd; }     metric m_most = max { of = j0.q; }
"""


@dataclass(frozen=True)
class Compared:
    """One metric of one run: the estimate, whether its order is the expected one, the true error, the value, and
    whether the truth has converged: finer runs differ by at most a tenth of the error."""

    seed: int
    metric: str
    estimate: float
    order: float
    clear: bool
    true: float
    value: float
    converged: bool = True

    @property
    def counts(self) -> bool:
        """True if the error is large enough, and the order is as it should be, or that of an instant is clear."""
        return self.clear and self.true > SMALLEST * abs(self.value)

    @property
    def factor(self) -> float:
        """How far the estimate is from the truth; 1 is the truth."""
        return max(self.estimate / self.true, self.true / self.estimate) if self.estimate else math.inf


def experiment(seed: int, folder: Path) -> Experiment:
    deck = folder / f"{seed}.ic"
    text = random_deck(seed)
    head, _, tail = text.rpartition("}")
    deck.write_text(f"{head}{METRICS}}}{tail}", encoding="utf-8")
    return ic.compile(deck).experiments[0]


def compared(seed: int, folder: Path) -> list[Compared]:
    """The metrics of one random arm."""
    of = experiment(seed, folder)
    fine = refine(of, FINER)
    return estimated(seed, of, [replace(fine, structure=replace(fine.structure, integrator="rk4"))])


def with_stops(seed: int, folder: Path) -> list[Compared]:
    """The metrics of one random arm with stops, against a thirty-second and a sixteenth of the step."""
    (folder / f"{seed}.ic").write_text(stops.deck(seed), encoding="utf-8")
    of = ic.compile(folder / f"{seed}.ic").experiments[0]
    return estimated(seed, of, [refine(of, 32), refine(of, 16)])


def estimated(seed: int, of: Experiment, truths: list[Experiment]) -> list[Compared]:
    """The estimates of the metrics named `m_...`, against the first of these experiments."""
    names = {use.name: use.name for use in of.structure.metrics if use.name.startswith("m_")}
    found = verify(of, np.zeros(1, np.int64), names)
    runs = [engine.run(each, record=False).metrics for each in (of, *truths)]
    out = []
    for column, name in enumerate(found.metrics):
        own, truth, *others = (float(run[name][0]) for run in runs)
        values = (own, float(found.half[0, column]), float(found.quarter[0, column]))
        instant, missed = float(found.instant[column]), float(found.missed[0, column])
        error, true = case_error(0, values, found.order, instant, missed).error, abs(own - truth)
        if error is not None and math.isfinite(truth):
            converged = all(abs(each - truth) <= 0.1 * true for each in others)
            out.append(Compared(seed, name, error.error, error.order, error.clear, true, own, converged))
    return out


def said(found: list[Compared]) -> str:
    """What came of it, in lines."""
    runs, loose = len({each.seed for each in found}), [each for each in found if not each.converged]
    found = [each for each in found if each.converged]
    counted = [each for each in found if each.counts]
    good = sum(each.factor <= 2.0 for each in counted)
    small = sum(each.true <= SMALLEST * abs(each.value) for each in found)
    unclear = [each for each in found if each.true > SMALLEST * abs(each.value) and not each.counts]
    below, far = (sum(each.estimate * factor < each.true for each in counted) for factor in (2.0, 5.0))
    bound = sum(each.estimate >= each.true for each in unclear)
    lines = [
        f"{runs} runs, {len(found)} metrics; true error below {SMALLEST:g} of the value: {small}",
        f"truth not converged, left out: {len(loose)}, of which the order is as it should be: "
        f"{sum(each.clear for each in loose)}",
        f"order as it should be: {len(counted)}, of which within a factor of 2: {good} ({share(good, len(counted))})",
        f"too small by more than a factor of 2: {below} ({share(below, len(counted))}; at most "
        f"{100 * most(below, len(counted)):.2f} % with a confidence of 95 %), of 5: {far}",
        f"order unclear, left out: {len(unclear)} ({share(len(unclear), len(unclear) + len(counted))}), of which the "
        f"rough bound holds: {bound} ({share(bound, len(unclear))})",
    ]
    for each in sorted(counted, key=lambda each: -each.factor)[:5]:
        lines.append(
            f"  seed {each.seed} {each.metric}: {each.estimate:.2g}, truly {each.true:.2g}, order {each.order:.2f}"
        )
    return "\n".join(lines)


def share(part: int, of: int) -> str:
    return f"{100 * part / of:.1f} %" if of else "-"


def most(part: int, of: int) -> float:
    """The upper one-sided 95 % bound of Clopper and Pearson on a share."""
    return float(beta.ppf(0.95, part + 1, of - part)) if part < of else 1.0


def main(words: list[str]) -> None:
    of_one, default = (with_stops, 300) if "stops" in words else (compared, 200)
    *first, count = [int(word) for word in words if word.isdigit()] or [default]
    seeds = range(*first, sum(first) + count)
    compared_ones: list[Compared] = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in seeds:
            compared_ones += of_one(seed, Path(folder))
    print(said(compared_ones))


if __name__ == "__main__":
    main(sys.argv[1:])
