"""A layout for Foxglove and Lichtblick: the arm in 3D beside plots of q, qd and tau, and the log.

A layout is a JSON file that both import ("Import from file" of the layouts' menu).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from batch.export import scene
from batch.export.poses import PosedArm, root_frame
from batch.plotting.layout import COLOURS
from batch.queries.signals import pretty_unit

ENDING = ".layout.json"
"""The ending of the layout beside an export, in place of the export's own."""

PLOTTED = ("q", "qd", "tau")
"""Signals with a panel of their own, if they exist; else the first existing ones."""

LINKS = COLOURS[:-1]
GHOST = "55"
"""Opacity of the lines of every case but the first, as a colour's last two digits."""

DISTANCE, GRID, AXES = 2.6, 4.0, 0.08
"""Distance of the camera from the base, edge of the grid, length of a frame's axes, each in sizes of the arm."""


def text(arms: Sequence[PosedArm]) -> str:
    """The layout of an export of these arms."""
    known = arms[0].case.signals
    signals = [name for name in PLOTTED if name in known] or list(known)[: len(PLOTTED)]
    panels: dict[str, Any] = {"3D!arm": _view(arms)}
    panels |= {f"Plot!{name}": _plot(arms, name) for name in signals}
    panels["RosOut!log"] = {"topicToRender": "/log", "minLogLevel": 1, "searchTerms": [], **_titled("log")}
    right = _column([f"Plot!{name}" for name in signals] + ["RosOut!log"])
    layout = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {"direction": "row", "first": "3D!arm", "second": right, "splitPercentage": 55},
    }
    return json.dumps(layout, indent=1) + "\n"


def _view(arms: Sequence[PosedArm]) -> dict[str, Any]:
    """The 3D panel: the whole arm from obliquely above, on a grid."""
    base, size = root_frame(arms), scene.size(arms)
    return {
        "cameraState": {
            "distance": DISTANCE * size,
            "perspective": True,
            "phi": 60,
            "thetaOffset": 45,
            "fovy": 45,
            "target": [0, 0, 0],
            "targetOffset": [0, 0, 0],
            "targetOrientation": [0, 0, 0, 1],
            "near": size / 100,
            "far": 100 * size,
        },
        "followMode": "follow-pose",
        "followTf": base,
        "scene": {"transforms": {"showLabel": False, "axisScale": AXES * size, "lineWidth": 0}},
        "transforms": {},
        "topics": {arm.topic("scene"): {"visible": True} for arm in arms},
        "layers": {
            "grid": {
                "layerId": "foxglove.Grid",
                "instanceId": "grid",
                "label": "Grid",
                "visible": True,
                "frameId": base,
                "frameLocked": True,
                "size": GRID * size,
                "divisions": 20,
                "lineWidth": 1,
                "color": "#8a939c55",
                "position": [0, 0, 0],
                "rotation": [0, 0, 0],
                "order": 1,
            }
        },
        **_titled("arm"),
    }


def _plot(arms: Sequence[PosedArm], signal: str) -> dict[str, Any]:
    """The panel of a signal over time: a line for each joint or component, in each case."""
    paths, units = [], []
    for number, arm in enumerate(arms):
        for place, column in enumerate(arm.case.signals.get(signal, [])):
            colour = LINKS[place % len(LINKS)] + (GHOST if number else "")
            field = ".".join(column.parts or ("value",))
            label = f"{arm.prefix.replace('/', ' ')}{'.'.join(column.parts)}".strip() or signal
            value = f"{arm.topic(signal)}.{field}"
            paths.append(
                {"value": value, "label": label, "color": colour, "enabled": True, "timestampMethod": "receiveTime"}
            )
            units.append("" if column.unit == "1" else pretty_unit(column.unit))
    title = f"{signal} ({', '.join(dict.fromkeys(units))})" if any(units) else signal
    return {
        "paths": paths,
        "xAxisVal": "timestamp",
        "isSynced": True,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "showLegend": True,
        "legendDisplay": "floating",
        "showPlotValuesInLegend": False,
        **_titled(title),
    }


def _titled(title: str) -> dict[str, str]:
    """Panels stacked in a column, all of equal height."""
    return {"foxglovePanelTitle": title, "lichtblickPanelTitle": title}


def _column(panels: Sequence[str]) -> Any:
    """Panels under one another, all of one height."""
    first, *rest = panels
    if not rest:
        return first
    return {"direction": "column", "first": first, "second": _column(rest), "splitPercentage": 100 / len(panels)}
