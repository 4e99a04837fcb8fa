"""The log of a case, with lines at their times, and its result as one message."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from batch.archive.read import ArchiveGroup
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
    group, position = case.group, case.position
    status, cause = int(_value_in_case(group, "status", position)), str(_value_in_case(group, "cause", position))
    end = ends(case)
    out = [LogLine(0.0, "INFO", case_text(group, position))]
    if status == DONE:
        out.append(LogLine(end, "INFO", "reached its end"))
    else:
        word = STATUS.get(status, "failed")
        out.append(LogLine(end, "ERROR", f"{word}: {cause.removeprefix(f'{word}: ')}"))
    if "bed_limited" in group.variables and (ticks := int(_value_in_case(group, "bed_limited", position))):
        text = f"the load motor of a bed was at its limit for {ticks:,} ticks: the run is not what the joint would do"
        out.append(LogLine(end, "WARNING", text))
    if "warning" in group.variables and (warning := str(_value_in_case(group, "warning", position))):
        out.append(LogLine(end, "WARNING", warning))
    metrics = {variable.name: variable for variable in group.role("metric")}
    for text, outcome, name in _requirements(group, position):
        has = f" ({name} = {_value(group, metrics[name], position)})" if name in metrics else ""
        out.append(LogLine(end, "INFO" if outcome == "met" else "WARNING", f"require {text}: {outcome}{has}"))
    return out


def ends(case: ExportedCase) -> float:
    """The end of a case, s: after its last row; for a failed one, the instant of the failure, if its cause names it."""
    last = float(case.time[-1]) if len(case.time) else 0.0
    group, position = case.group, case.position
    if int(_value_in_case(group, "status", position)) == FAILED:
        match_ = FAILED_AT.match(str(_value_in_case(group, "cause", position)))
        try:
            return max(last, float(match_[1])) if match_ else last
        except ValueError:
            return last
    return last


def result(case: ExportedCase) -> tuple[tuple[MessageField, ...], dict[str, Any]]:
    """The result of a case as a message: its fields and their contents, in SI."""
    group, position = case.group, case.position
    metrics = group.role("metric")
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
        "case_id": str(_value_in_case(group, "case_id", position)),
        "status": STATUS.get(int(_value_in_case(group, "status", position)), "failed"),
        "cause": str(_value_in_case(group, "cause", position)),
        "valid_rows": len(case.time),
        "varied": [
            {"name": v.path, "value": float(_value_in_case(group, v.name, position)), "unit": v.unit}
            for v in group.role("coordinate")
        ],
        "requirements": [{"text": text, "outcome": outcome} for text, outcome, _ in _requirements(group, position)],
    }
    if metrics:
        names = {variable.name: variable.name.rpartition(".")[2] for variable in metrics}  # `metrics.q` is `q` here
        fields.append(MessageField("metrics", within=tuple(MessageField(name) for name in names.values())))
        data["metrics"] = {field: float(_value_in_case(group, name, position)) for name, field in names.items()}
    return tuple(fields), data


def varied(case: ExportedCase) -> dict[str, str]:
    """Varied parameters of a case, in the deck's units, by path; choices of structure in words."""
    group, position = case.group, case.position
    numbers = {v.path: _value(group, v, position) for v in group.role("coordinate")}
    return {**{v.path: str(_value_in_case(group, v.name, position)) for v in group.role("choice")}, **numbers}


def _requirements(group: ArchiveGroup, position: int) -> list[tuple[str, str, str]]:
    """Text, outcome and metric of each requirement."""
    if "met" not in group.variables:
        return []
    texts = requirement_texts(group)
    judged = group.variables["requirement"].attributes.get("metric", [])
    metrics: Sequence[str] = judged if isinstance(judged, list) else [str(judged)]
    metrics = metrics if len(metrics) == len(texts) else [""] * len(texts)
    outcomes = np.atleast_1d(group.at("met", [position])[0]).tolist()
    return [
        (text, OUTCOMES.get(outcome, "unknown"), metric)
        for text, outcome, metric in zip(texts, outcomes, metrics, strict=True)
    ]


def _value(group: ArchiveGroup, variable: Stored, position: int) -> str:
    return value_text(float(_value_in_case(group, variable.name, position)), variable)


def _value_in_case(group: ArchiveGroup, name: str, position: int) -> Any:
    return group.at(name, [position])[0]
