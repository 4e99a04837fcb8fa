"""Errors by the step as MET estimates them, against the truth: random arms with rk4 at a hundredth of the step.

python -m tests.batch.verification.truth [COUNT]      200 runs take some ten minutes on one core
"""

from __future__ import annotations

import math
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import ic
from batch.campaigns.verification.verifying import FACTORS
from batch.queries.step_errors.figures import case_error
from met import models
from met import run as engine
from met.analysis.refinement import refine
from met.plan import Experiment
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
    """One metric of one run: the estimate, whether its order is the expected one, the true error, and the value."""

    seed: int
    metric: str
    estimate: float
    order: float
    clear: bool
    true: float
    value: float

    @property
    def counts(self) -> bool:
        """True if the error is large enough, and the order is as it should be."""
        return self.clear and math.isfinite(self.order) and self.true > SMALLEST * abs(self.value)

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
    of = replace(of, structure=replace(of.structure, record=()))
    fine = refine(of, FINER)
    fine = replace(fine, structure=replace(fine.structure, integrator="rk4"))
    runs = [engine.run(each, record=False).metrics for each in (of, *(refine(of, n) for n in FACTORS), fine)]
    order = models.find("integrator", of.structure.integrator).order
    out = []
    for name in (use.name for use in of.structure.metrics if use.name.startswith("m_")):
        own, half, quarter, truth = (float(run[name][0]) for run in runs)
        found = case_error(0, (own, half, quarter), order, 0.0).error
        if found is not None and math.isfinite(truth):
            out.append(Compared(seed, name, found.error, found.order, found.clear, abs(own - truth), own))
    return out


def said(found: list[Compared]) -> str:
    """What came of it, in lines."""
    counted = [each for each in found if each.counts]
    good = sum(each.factor <= 2.0 for each in counted)
    small = sum(each.true <= SMALLEST * abs(each.value) for each in found)
    unclear = [each for each in found if each.true > SMALLEST * abs(each.value) and not each.counts]
    bound = sum(each.estimate >= each.true for each in unclear)
    runs = len({each.seed for each in found})
    lines = [
        f"{runs} runs, {len(found)} metrics; true error below {SMALLEST:g} of the value: {small}",
        f"order as it should be: {len(counted)}, of which within a factor of 2: {good} ({share(good, len(counted))})",
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


def main(count: int) -> None:
    found: list[Compared] = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(count):
            found += compared(seed, Path(folder))
    print(said(found))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
