"""The data of a page's plots: JSON with numbers as base64 of their bytes."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from batch.arms.drawn import drawn_json
from batch.queries.colours import Reach, reach
from batch.queries.pool import ENDED, CaseColumn
from batch.queries.signals import pretty_unit
from batch.report.contents.changes import ArchiveChanges
from batch.report.contents.parts import History, Map, Overview, ReportSection, Ruler, Signals, Stability
from batch.report.contents.simulated import SimulatedStructure
from batch.report.html.markup import Html
from met.messages.visible import visible

PRECISE = 1e-6
"""Numbers are kept in four bytes where the resulting error is smaller than this share of their range."""

LEGIBLE = str.maketrans({c: f"\\u{ord(c):04x}" for c in "<>&\u2028\u2029"})
"""JSON escapes of characters that might end a script or act as markup in it."""


def script_json(data: Any) -> Html:
    """Data as JSON that is safe in a script element, whatever its texts are."""
    return Html(json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False).translate(LEGIBLE))


def section_data(section: ReportSection, replay: str, changes: ArchiveChanges | None = None) -> dict[str, Any]:
    """The data for the plots of a section. replay: the command that runs a case again, with `#CASE` in place of its
    number"""
    return {
        "name": visible(section.name),
        "against": None if changes is None else [visible(changes.before), visible(changes.now)],
        "replay": visible(replay),
        "ended": list(ENDED),
        "overview": None if section.overview is None else overview_data(section.overview),
        "signals": None if section.signals is None else _signals(section.signals),
        "simulation": None
        if section.simulation is None
        else {"structures": [_structure(structure) for structure in section.simulation.structures]},
        "stability": None if section.stability is None else _stability(section.stability),
    }


def packed(values: np.ndarray) -> dict[str, Any]:
    """Numbers as base64: whole ones as `i4`, others as `f4`, with an offset or `f8` where that is not exact enough.

    Little-endian. Infinite ones and not-a-numbers are kept.
    """
    values = np.asarray(values).ravel()
    if values.dtype.kind in "iu" and np.array_equal(values, values.astype("<i4")):
        return {"t": "i4", "b": _base64(values.astype("<i4"))}
    values = values.astype("<f8")
    finite = values[np.isfinite(values)]
    low, high = finite.min(initial=np.inf), finite.max(initial=-np.inf)
    if len(values) > 2 and len(finite) == len(values) and low == high:
        return {"t": "c", "v": float(low), "n": len(values)}
    with np.errstate(all="ignore"):
        middle = float(low + 0.5 * (high - low)) if len(finite) and np.isfinite(high - low) else 0.0
        for offset in (0.0, middle):  # without one 0 stays 0, and small values are as exact as large ones
            small = (values - offset).astype("<f4")
            error = np.abs(small[np.isfinite(values)].astype("<f8") + offset - finite).max(initial=0.0)
            if np.isfinite(error) and error <= PRECISE * (high - low):
                return {"t": "f4", **({"o": offset} if offset else {}), "b": _base64(small)}
    return {"t": "f8", "b": _base64(values)}


def _base64(values: np.ndarray) -> str:
    return base64.b64encode(values.tobytes()).decode("ascii")


def exact(values: np.ndarray) -> dict[str, Any]:
    """Doubles to the bit, as base64: all of them, or the distinct ones with the index of each."""
    bits = np.ascontiguousarray(values, "<f8").ravel().view("<i8")
    distinct, which = np.unique(bits, return_inverse=True)
    if len(distinct) > min(0x10000, len(bits) // 2):
        return {"b": _base64(bits)}
    return {"b": _base64(distinct), "n": _base64(which.ravel().astype("<u2"))}


def modules_script(sections: Sequence[ReportSection]) -> str:
    """The WebAssembly modules and meshes of all sections by their digests, for the page's script, whose own digest
    covers them."""
    structures = [
        structure for section in sections if section.simulation for structure in section.simulation.structures
    ]
    all_ = [version for structure in structures for version in (structure, structure.before) if version is not None]
    modules = {
        version.description["kernel"]["module"]: base64.b64encode(version.code).decode("ascii") for version in all_
    }
    arms = [drawn_json(structure.arm) for structure in structures if structure.arm.meshes.links]
    meshes = {_digest(arm["scene"]["meshes"]): arm["scene"]["meshes"] for arm in arms}
    return f"MET.modules = {json.dumps(modules)};" + (f"\nMET.meshes = {json.dumps(meshes)};" if meshes else "")


def _column(column: CaseColumn) -> dict[str, Any]:
    """The data of a column of numbers over cases, for the page's scripts."""
    return {
        "key": visible(column.key),
        "label": visible(column.label),
        "unit": visible(column.unit),
        "role": column.role,
        "about": visible(column.about),
        "words": [visible(word) for word in column.words],
        "log": column.log,
        "reach": _reach(
            reach(
                column.values,
                [e.value for e in column.limits],
                parting=column.role == "change",
                by_factors=column.role == "parameter" and column.log,
            )
        ),
        "values": packed(column.values),
        "before": None if column.before is None else packed(column.before),
        "limits": [
            {"text": visible(e.text), "value": e.value, "sense": e.sense} for e in column.limits if np.isfinite(e.value)
        ],
    }


def overview_data(overview: Overview) -> dict[str, Any]:
    """The data of a plot of cases as points, and of maps."""
    return {
        "cases": packed(overview.cases),
        "ids": [visible(text) for text in overview.ids],
        "ended": packed(overview.ended),
        "columns": [_column(column) for column in overview.columns],
        "causes": {str(place): visible(cause) for place, cause in overview.causes.items()},
        "total": overview.total,
        "start": [visible(key) for key in overview.start],
        "maps": [_map(case_map) for case_map in overview.maps],
    }


def _map(case_map: Map) -> dict[str, Any]:
    """The data of a map, for the page's scripts."""
    return {
        "x": visible(case_map.x),
        "y": visible(case_map.y),
        "xLevels": [visible(level) for level in case_map.x_levels],
        "yLevels": [visible(level) for level in case_map.y_levels],
        "xRuler": _ruler(case_map.x_ruler),
        "yRuler": _ruler(case_map.y_ruler),
        "counts": packed(case_map.counts),
        "failed": packed(case_map.failed),
        "of": {
            visible(key): {
                "values": packed(case_map.values[key]),
                "cases": packed(case_map.cases[key]),
                "missed": packed(case_map.missed[key]),
                "reach": _reach(case_map.reaches[key]),
            }
            for key in case_map.values
        },
    }


def _ruler(ruler: Ruler) -> dict[str, Any]:
    """The data of a map's side: edges of its cells, 0 to 1, and texts by their positions."""
    return {
        "edges": list(ruler.edges),
        "ticks": [[[position, visible(text)] for position, text in tick] for tick in ruler.ticks],
    }


def _reach(colours: Reach | None) -> dict[str, Any] | None:
    """The range of the colours, and the number of values beyond it, for the page's scripts."""
    if colours is None:
        return None
    return {
        "low": colours.low,
        "high": colours.high,
        "log": colours.log,
        "below": colours.below,
        "above": colours.above,
        "least": colours.least,
        "most": colours.most,
    }


def _signals(signals: Signals) -> dict[str, Any]:
    """The data of recorded signals, for the page's scripts."""
    return {
        "joints": [visible(joint) for joint in signals.joints],
        "clocks": [packed(clock) for clock in signals.clocks],
        "panels": [
            {
                "name": visible(panel.name),
                "about": visible(panel.about),
                "unit": visible("" if panel.unit == "1" else pretty_unit(panel.unit)),
                "scale": panel.scale,
                "lines": [
                    {"label": visible(e.label), "joint": visible(e.joint), "command": e.command} for e in panel.lines
                ],
            }
            for panel in signals.panels
        ],
        "histories": [
            {
                "case": history.case,
                **_history(history),
                "before": _history(history.before),
                "change": _history(history.change),
            }
            for history in signals.histories
        ],
        "shown": list(signals.first_cases),
        "most": list(signals.most),
        "worst": signals.worst if signals.most else None,
        "middle": signals.middle,
        "opens": signals.opens,
    }


def _history(history: History | None) -> dict[str, Any]:
    """The data of a history; empty where there is none."""
    if history is None:
        return {}
    lines = {str(place): [packed(line) for line in values.T] for place, values in history.values.items()}
    return {"clock": history.clock, "panels": lines}


def _structure(structure: SimulatedStructure) -> dict[str, Any]:
    """The data with which the page runs the cases of a structure again."""
    description, kernel = structure.description, structure.description["kernel"]
    metrics = {metric["name"]: metric["output"] for metric in description["metrics"]}
    return {
        "module": kernel["module"],
        "kernel": {
            **{name: kernel[name] for name in ("entry", "heap", "lanes", "base_hz", "record_divisor", "columns")},
            **{name: {"length": len(kernel[name])} for name in ("inputs", "cells", "outputs")},
        },
        "ticks": description["ticks"],
        "rows": description["rows"],
        "failure": description["failure"],
        "names": [visible(parameter["name"]) for parameter in description["inputs"]],
        "sameCode": structure.same_code,
        "cases": packed(structure.cases),
        "inputs": [exact(column) for column in structure.inputs.T],
        "status": packed(structure.status),
        "metrics": [
            {"name": visible(name), "output": metrics[name.removeprefix("metrics.")], "values": exact(values)}
            for name, values in structure.metrics
        ],
        "panels": [list(columns) for columns in structure.panels],
        "arm": _arm(structure),
        "before": None if structure.before is None else _structure(structure.before),
    }


def _arm(structure: SimulatedStructure) -> dict[str, Any]:
    """The arm of a structure, with the name of its meshes in place of them."""
    arm = drawn_json(structure.arm)
    if meshes := arm.get("scene", {}).get("meshes"):
        arm["scene"]["meshes"] = _digest(meshes)
    return arm


def _digest(meshes: list[dict[str, Any]]) -> str:
    """The name of an arm's meshes on a page: the SHA-256 of their data."""
    return hashlib.sha256(json.dumps(meshes).encode()).hexdigest()


def _stability(bed_stability: Stability) -> dict[str, Any]:
    """The stability of motor beds as data of a plot."""
    return {
        "cases": packed(bed_stability.cases),
        "columns": [_column(column) for column in bed_stability.columns],
        "beds": [
            {
                "joint": visible(bed.joint),
                "r": packed(bed.r),
                "lower": packed(bed.lower),
                "limit": packed(bed.limit),
                "unstable": packed(bed.unstable.astype(int)),
            }
            for bed in bed_stability.beds
        ],
    }
