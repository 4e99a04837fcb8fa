"""The data of `met diff --format json`; `schema` is the version of their layout."""

from __future__ import annotations

import dataclasses
from typing import Any

from batch.differences.result import Diff, ExperimentDiff, SignalDiff
from batch.queries.evidence_table import as_data as as_row
from batch.queries.summary import finite

SCHEMA, VERSION = "met.diff", 2


def as_data(found: Diff) -> dict[str, Any]:
    """The comparison as plain data; non-finite numbers are null."""
    data = {
        "schema": SCHEMA,
        "version": VERSION,
        "a": str(found.a),
        "b": str(found.b),
        "verdict": found.verdict,
        "changed": dataclasses.asdict(found.changed),
        "only_a": list(found.only_a),
        "only_b": list(found.only_b),
        "experiments": [_experiment(experiment) for experiment in found.experiments],
    }
    plain: dict[str, Any] = finite(data)
    return plain


def _experiment(found: ExperimentDiff) -> dict[str, Any]:
    return {
        "name_a": found.name_a,
        "name_b": found.name_b,
        "verdict": found.verdict,
        "cases": found.cases.count,
        "tolerances": {
            "relative": found.tolerances.relative,
            "time": found.tolerances.time,
            "absolute": {name: size for name, (size, _) in found.tolerances.absolute.items()},
        },
        "cases_different": found.cases_different,
        "only_a": found.only_a,
        "only_b": found.only_b,
        "ended": [dataclasses.asdict(each) for each in found.ended],
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
            for requirement in found.requirements
        ],
        "evidence": [{"a": as_row(each.before), "b": as_row(each.now)} for each in found.evidence],
        "required_in_one": found.required_in_one,
        "signals": [_signal(signal) for signal in found.signals],
        "worst": [dataclasses.asdict(each) for each in found.worst],
        "distributions": [{**dataclasses.asdict(sample), "unlike": sample.unlike} for sample in found.samples],
        "notes": found.notes,
    }


def _signal(found: SignalDiff) -> dict[str, Any]:
    kept = (
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
        **{name: getattr(found, name) for name in kept},
        "verdict": found.verdict,
        "rms": found.rms,
        "share": found.share,
        "place": None if found.place is None else dataclasses.asdict(found.place),
        "tolerance": {**dataclasses.asdict(found.tolerance), "by_joint": found.by_joint},
    }
