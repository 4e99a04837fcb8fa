"""The log of a case, with lines at their times, and its result as one message."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from batch.archive.stored import Stored
from batch.export.picking import ExportedCase
from batch.export.wire import MessageField
from batch.queries.pool import STATUS
from batch.queries.requirements import requirement_texts
from batch.queries.signals import case_text, value_text
from met.frozen import frozen
from met.run import DONE, FAILED

Level = Literal["INFO", "WARNING", "ERROR"]

FAILED_AT = re.compile(r"t = (\S+) s: ")
"""The beginning of a failed case's cause, with its time, s."""

OUTCOMES = {1: "met", 0: "missed", -1: "unknown"}


@frozen
class LogLine:
    """A line of a log. time: s, simulated."""

    time: float
    level: Level
    text: str


def log_lines(case: ExportedCase) -> list[LogLine]:
    """The log of a case in the order of time: its name, its end, and the requirements that it met."""
    group, end = case.group, ends(case)
    status, cause = int(case.value("status")), str(case.value("cause"))
    out = [LogLine(0.0, "INFO", case_text(group, case.position))]
    if status == DONE:
        out.append(LogLine(end, "INFO", "reached its end"))
    else:
        word = STATUS.get(status, "failed")
        out.append(LogLine(end, "ERROR", f"{word}: {cause.removeprefix(f'{word}: ')}"))
    if "bed_limited" in group.variables and (ticks := int(case.value("bed_limited"))):
        text = f"the load motor of a bed was at its limit for {ticks:,} ticks: the run is not what the joint would do"
        out.append(LogLine(end, "WARNING", text))
    if "warning" in group.variables and (warning := str(case.value("warning"))):
        out.append(LogLine(end, "WARNING", warning))
    metrics = {variable.name: variable for variable in group.role("metric")}
    for text, outcome, name in _requirements(case):
        has = f" ({name} = {_value(case, metrics[name])})" if name in metrics else ""
        out.append(LogLine(end, "INFO" if outcome == "met" else "WARNING", f"require {text}: {outcome}{has}"))
    return out


def ends(case: ExportedCase) -> float:
    """The end of a case, s: after its last row; for a failed one, the instant of the failure, if its cause names it."""
    last = float(case.time[-1]) if len(case.time) else 0.0
    if int(case.value("status")) == FAILED:
        match_ = FAILED_AT.match(str(case.value("cause")))
        try:
            return max(last, float(match_[1])) if match_ else last
        except ValueError:
            return last
    return last


def result(case: ExportedCase) -> tuple[tuple[MessageField, ...], dict[str, Any]]:
    """The result of a case as a message: its fields and their contents, in SI."""
    metrics = case.group.role("metric")
    numbers = (MessageField("name", "string"), MessageField("value"), MessageField("unit", "string"))
    fields = [
        MessageField("case", "int64"),
        MessageField("case_id", "string"),
        MessageField("status", "string"),
        MessageField("cause", "string"),
        MessageField("valid_rows", "int64"),
        MessageField("varied", within=numbers, many=True),
        MessageField(
            "requirements", within=(MessageField("text", "string"), MessageField("outcome", "string")), many=True
        ),
    ]
    data: dict[str, Any] = {
        "case": case.number,
        "case_id": str(case.value("case_id")),
        "status": STATUS.get(int(case.value("status")), "failed"),
        "cause": str(case.value("cause")),
        "valid_rows": len(case.time),
        "varied": [
            {"name": v.path, "value": float(case.value(v.name)), "unit": v.unit} for v in case.group.role("coordinate")
        ],
        "requirements": [{"text": text, "outcome": outcome} for text, outcome, _ in _requirements(case)],
    }
    if metrics:
        names = {variable.name: variable.name.rpartition(".")[2] for variable in metrics}  # `metrics.q` is `q` here
        fields.append(MessageField("metrics", within=tuple(MessageField(name) for name in names.values())))
        data["metrics"] = {field: float(case.value(name)) for name, field in names.items()}
    return tuple(fields), data


def varied(case: ExportedCase) -> dict[str, str]:
    """Varied parameters of a case, in the deck's units, by path; choices of structure in words."""
    group = case.group
    numbers = {v.path: _value(case, v) for v in group.role("coordinate")}
    return {**{v.path: str(case.value(v.name)) for v in group.role("choice")}, **numbers}


def _requirements(case: ExportedCase) -> list[tuple[str, str, str]]:
    """Text, outcome and metric of each requirement."""
    group = case.group
    if "met" not in group.variables:
        return []
    texts = requirement_texts(group)
    judged = group.variables["requirement"].attributes.get("metric", [])
    metrics: Sequence[str] = judged if isinstance(judged, list) else [str(judged)]
    metrics = metrics if len(metrics) == len(texts) else [""] * len(texts)
    outcomes = np.atleast_1d(case.value("met")).tolist()
    return [
        (text, OUTCOMES.get(outcome, "unknown"), metric)
        for text, outcome, metric in zip(texts, outcomes, metrics, strict=True)
    ]


def _value(case: ExportedCase, variable: Stored) -> str:
    """The value of a variable in a case, with the deck's unit."""
    return value_text(float(case.value(variable.name)), variable)
