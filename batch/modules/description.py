"""The description of an experiment's module, as JSON, by which a program runs it and shows its numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from met.backends.wasm.module import WasmModule
from met.plan import REPEAT, Experiment
from met.plan.outputs import metric_units
from met.program import plausible
from met.program.build import METRIC, UNHELD
from met.program.step import FAILURE
from met.run import Prepared, inputs
from met.version import VERSION

FORMAT = "met module 1"
"""Name and version of the description."""

MOST_CASES = 1_000
"""Number of cases whose inputs are listed; if there are more, the first ones are."""


def described(prepared: Prepared, module: WasmModule) -> dict[str, Any]:
    """The description of a module.

    name, deck, made_by, code_key   the experiment, where it is from, and what decides its numbers, as archives have it
    kernel       the module's memory (`WasmModule.description`)
    ticks        the number of the run's last tick; rows: recorded ones
    inputs       of each the name, what it is (coordinate, repeat, seed); a value is shown as `value / scale` in `unit`
    columns      of each recorded number the channel, the signal that it is of, the SI unit
    metrics      of each the name, the SI unit, and its place among the outputs
    not_computed metrics of linear answers, which a module does not compute: of each the name and the SI unit
    failure      places among the outputs by which a case has failed (`METKernel.failed` in kernel.js reads them)
    requirements of each its text, its metric, and the comparison with a limit in SI
    cases        how many there are, and the inputs of the first ones, a list each
    """
    experiment = prepared.experiment
    structure, schedule, linear = experiment.structure, experiment.structure.schedule, experiment.linear_metrics
    units, outputs = metric_units(structure, linear), prepared.program.outputs
    rows = np.arange(min(experiment.cases.count, MOST_CASES))
    return {
        "format": FORMAT,
        "made_by": f"MET {VERSION}",
        "name": experiment.name,
        "code_key": prepared.code_key,
        "kernel": module.description,
        "ticks": schedule.ticks,
        "rows": schedule.rows,
        "inputs": _inputs(experiment),
        "columns": described_columns(experiment),
        "metrics": [
            {"name": use.name, "unit": units[use.name], "output": outputs.index(METRIC + use.name)}
            for use in structure.metrics
        ],
        "not_computed": [{"name": use.name, "unit": units[use.name]} for use in linear],
        "failure": {
            "failure": outputs.index(FAILURE[0]),
            "tick": outputs.index(FAILURE[2]),
            "too_fast": _place(outputs, plausible.FAILED_TICK),
            "unheld": _place(outputs, UNHELD),
        },
        "requirements": [
            {
                "text": requirement.text,
                "metric": requirement.metric,
                "comparison": requirement.comparison,
                "limit": requirement.limit,
            }
            for requirement in experiment.requirements
        ],
        "cases": {"count": experiment.cases.count, "inputs": inputs(experiment, rows).tolist()},
    }


def _place(outputs: tuple[str, ...], name: str) -> int | None:
    return outputs.index(name) if name in outputs else None


def _inputs(experiment: Experiment) -> list[dict[str, Any]]:
    """The inputs of a module for JSON: varied parameters with their unit, then repeat and seed of the noise."""
    cases = experiment.cases
    return [
        *(
            {"name": coordinate.path, "is": "coordinate", "unit": coordinate.unit, "scale": coordinate.scale}
            for coordinate in cases.coordinates
        ),
        *({"name": n, "is": "repeat" if n == REPEAT else "seed", "unit": "1", "scale": 1.0} for n in cases.noise),
    ]


def described_columns(experiment: Experiment) -> list[dict[str, Any]]:
    """The channel of each number of a row, the signal that it is of, and its SI unit."""
    columns = []
    for recorded in experiment.structure.record:
        count = len(recorded.channels)
        own = recorded.unit if len(recorded.unit) == count else [recorded.unit[0]] * count
        if len(recorded.unit) == len(recorded.joints) != count:  # one a joint, of vectors
            own = [unit for unit in recorded.unit for _ in range(count // len(recorded.joints))]
        for channel, unit in zip(recorded.channels, own, strict=True):
            columns.append({"channel": channel, "signal": recorded.name, "unit": unit})
    return columns
