"""The values of an archive's variables from the engine's results, by the variable's name: for a file, or in memory."""

from __future__ import annotations

from typing import Any

import numpy as np

from batch.archive import layout as archive_layout
from batch.archive.layout import AT_LIMIT, EXCESS, EXTREME_AT, GRAPPLE, Layout
from batch.archive.searched import GENERATION
from met.plan import Experiment, keys
from met.run import Run

KINDS = {"float64": np.float64, "float32": np.float32, "int64": np.int64, "int8": np.int8, "str": object}
"""The type of an array for each kind of variable."""


def values_of_cases(experiment: Experiment, layout: Layout, run: Run, id_head: bytes | None = None) -> dict[str, Any]:
    """All variables with one value a case, for the cases of a run; keys as arrays of bytes, other strings in lists.

    id_head  of the experiment, as `keys.id_head` gives it, where known
    """
    rows = run.case
    own, names = keys.case_names(experiment, rows, id_head)
    values: dict[str, Any] = {
        "case": experiment.cases.table[rows],
        "case_key": own,
        "case_id": names,
        "seed": keys.case_seeds(experiment, rows),
        "repeat": 0 if experiment.cases.repeats is None else experiment.cases.repeats[rows],
        **({} if experiment.search is None else {GENERATION: experiment.search.generation_of(rows)}),
        "status": run.status,
        "cause": run.cause,
        "warning": run.warning,
        "n_valid": run.n_valid,
        "bed_limited": run.limited,
        **{f"friction_{name}": count for name, count in run.events.items()},
        **{variable.name: run.coordinates[variable.key] for variable in layout.role("coordinate")},
        **{variable.name: run.metrics[variable.key] for variable in layout.role("metric")},
        **{AT_LIMIT + path: share for path, share in run.at_limit.items()},
        **{EXCESS + path: most for path, most in run.excess.items()},
        **{EXTREME_AT + metric: number for metric, number in run.extreme_at.items()},
        **{GRAPPLE + payload: figure for payload, figure in run.grapples.items()},
    }
    for role in ("limit", "excess", "extreme", "grapple"):  # by the free name
        values |= {variable.name: values[variable.key] for variable in layout.role(role)}
    for choice, variable in zip(experiment.cases.choices, layout.role("choice"), strict=True):
        values[variable.name] = [choice.value] * len(rows)
    values["met"] = verdicts_of_cases(experiment, run)
    return values


def verdicts_of_cases(experiment: Experiment, run: Run) -> np.ndarray:
    """1 where a case meets a requirement, 0 where it misses it, -1 where that is unknown since it failed or has no
    value of the metric, [case, requirement]."""
    verdicts = np.empty((len(run.case), len(experiment.requirements)), np.int8)
    for index, requirement in enumerate(experiment.requirements):
        unknown = (run.status != 0) | np.isnan(run.metrics[requirement.metric])
        verdicts[:, index] = np.where(unknown, -1, run.met[requirement.text])
    return verdicts


def values_of_dimensions(experiment: Experiment) -> dict[str, Any]:
    """The values of dimensions that do not depend on the cases that are run, but for `time`."""
    values: dict[str, Any] = {"requirement": np.array([r.text for r in experiment.requirements], dtype=object)}
    for dimensions in (archive_layout.joint_dimensions, archive_layout.component_dimensions):
        values |= {dim: np.array(names, dtype=object) for names, dim in dimensions(experiment).items()}
    return values


def times_of(experiment: Experiment) -> np.ndarray:
    """The values of the dimension `time`: the instants of a history's rows, s."""
    schedule = experiment.structure.schedule
    return np.arange(schedule.rows) * schedule.record / schedule.base_hz
