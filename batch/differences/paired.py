"""Paired comparison of two versions that ran the same cases: McNemar's test of each requirement, and the sign test of
each metric.

Each case is a pair, which is far sharper than two shares with an interval each. Only cases that were drawn are a
sample: of a grid the counts say all there is, and chance has no part in them. The probabilities of all requirements
and metrics of an experiment are corrected for their number by Holm's method.
"""

from __future__ import annotations

from dataclasses import replace

from batch.differences.result import ExperimentDiff
from met.statistics.significance import holm, sign_test

LEVEL = 0.05
"""Probability, over all differences of an experiment, of calling one shown that is due to chance."""


def judge_pairs(experiment: ExperimentDiff) -> None:
    """Give requirements and metrics of an experiment the probability that pairs differ so one-sidedly by chance.

    One case is no sample, and requirements of which each version has another limit are not compared.
    """
    if experiment.cases.count < 2:
        return
    alike = [i for i, requirement in enumerate(experiment.requirements) if not requirement.other]
    metrics = [signal for signal in experiment.signals if signal.metric and not signal.why]
    pairs = [(experiment.requirements[i].gained, experiment.requirements[i].lost) for i in alike]
    pairs += [(metric.higher, metric.lower) for metric in metrics]
    chances = holm([sign_test(*pair) for pair in pairs])
    for i, chance in zip(alike, chances, strict=False):
        experiment.requirements[i] = replace(experiment.requirements[i], chance=chance)
    for metric, chance in zip(metrics, chances[len(alike) :], strict=True):
        metric.chance = chance
