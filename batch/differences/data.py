"""The data of `met diff --format json`; `schema` is the version of their layout."""

from __future__ import annotations

import dataclasses
from typing import Any

from batch.differences.result import Diff, ExperimentDiff, SignalDiff
from batch.queries.evidence_table import as_data as as_row
from batch.queries.summary import finite

SCHEMA, VERSION = "met.diff", 2


def as_data(differences: Diff) -> dict[str, Any]:
    """The comparison as plain data; non-finite numbers are null."""
    data = {
        "schema": SCHEMA,
        "version": VERSION,
        "a": str(differences.a),
        "b": str(differences.b),
        "verdict": differences.verdict,
        "changed": dataclasses.asdict(differences.changed),
        "only_a": list(differences.only_a),
        "only_b": list(differences.only_b),
        "experiments": [_experiment(experiment) for experiment in differences.experiments],
    }
    return dict(finite(data))


def _experiment(experiment: ExperimentDiff) -> dict[str, Any]:
    """The differences of one experiment as plain data, with values in SI."""
    return {
        "name_a": experiment.name_a,
        "name_b": experiment.name_b,
        "verdict": experiment.verdict,
        "cases": experiment.cases.count,
        "tolerances": {
            "relative": experiment.tolerances.relative,
            "time": experiment.tolerances.time,
            "absolute": {name: size for name, (size, _) in experiment.tolerances.absolute.items()},
        },
        "cases_different": experiment.cases_different,
        "only_a": experiment.only_a,
        "only_b": experiment.only_b,
        "ended": [dataclasses.asdict(ending) for ending in experiment.ended],
        "requirements": [
            {
                "text": requirement.now,
                "text_a": requirement.before,
                "met_a": requirement.met_before,
                "met_b": requirement.met_now,
                "gained": requirement.gained,
                "lost": requirement.lost,
                "other": requirement.other,
                "chance": requirement.chance,
            }
            for requirement in experiment.requirements
        ],
        "evidence": [{"a": as_row(row.before), "b": as_row(row.now)} for row in experiment.evidence],
        "required_in_one": experiment.required_in_one,
        "signals": [_signal(signal) for signal in experiment.signals],
        "worst": [dataclasses.asdict(ranked) for ranked in experiment.worst],
        "distributions": [{**dataclasses.asdict(sample), "unlike": sample.unlike} for sample in experiment.samples],
        "notes": experiment.notes,
    }


def _signal(signal: SignalDiff) -> dict[str, Any]:
    """The differences of a signal or metric as plain data, with values in SI."""
    copied = (
        "name",
        "unit",
        "metric",
        "compared",
        "identical",
        "equivalent",
        "different",
        "largest",
        "first",
        "first_beyond",
        "used",
        "nan",
        "higher",
        "lower",
        "chance",
        "why",
        "by_step",
    )
    return {
        **{name: getattr(signal, name) for name in copied},
        "verdict": signal.verdict,
        "rms": signal.rms,
        "share": signal.share,
        "place": None if signal.place is None else dataclasses.asdict(signal.place),
        "tolerance": {**dataclasses.asdict(signal.tolerance), "by_joint": signal.by_joint},
    }
