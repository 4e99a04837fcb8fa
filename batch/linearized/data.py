"""A, B, C, D with named states, inputs and outputs: in xarray, and as a system of python-control."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from batch.archive.layout import coordinate_unit
from met.analysis.linear.answers import Linearized
from met.analysis.linear.gradient import MetricGradients
from met.diagnostic import Problem, error
from met.plan import Experiment
from met.plan.outputs import metric_units

if TYPE_CHECKING:
    import xarray


def arrays(linearized: Linearized) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """The matrices by name, each with the names of its axes."""
    plant = linearized.plant
    return {
        "A": (("state", "from_state"), linearized.A),
        "B": (("state", "input"), linearized.B),
        "C": (("output", "from_state"), linearized.C),
        "D": (("output", "input"), linearized.D),
        "plant_A": (("plant_state", "from_plant_state"), plant.A),
        "plant_B": (("plant_state", "held"), plant.B),
    }


def axes(linearized: Linearized) -> dict[str, tuple[str, ...]]:
    """The names along each axis."""
    plant = linearized.plant
    return {
        "state": linearized.states,
        "from_state": linearized.states,
        "input": linearized.inputs,
        "output": linearized.outputs,
        "plant_state": plant.states,
        "from_plant_state": plant.states,
        "held": plant.inputs,
    }


def to_xarray(linearized: Linearized) -> Any:
    """An xarray.Dataset of A, B, C, D of a period, of the plant's A and B in continuous time, and of the poles."""
    import xarray

    poles = linearized.poles
    data: dict[str, Any] = dict(arrays(linearized))
    data["pole"] = (("mode",), np.array([pole.z for pole in poles], dtype=complex))
    shares = [[dict(pole.shares)[state] for state in linearized.states] for pole in poles]
    data["share"] = (("mode", "state"), np.array(shares).reshape(len(poles), len(linearized.states)))
    coordinates = {name: list(values) for name, values in axes(linearized).items()}
    about = {
        "experiment": linearized.experiment,
        "case": linearized.case,
        "time": linearized.time,
        "period": linearized.seconds,
    }
    return xarray.Dataset(data, coordinates, about)


def state_space(linearized: Linearized) -> Any:
    """A `control.StateSpace` in discrete time, with names. Raises Problem E451 where python-control is missing."""
    try:
        import control
    except ImportError as reason:
        helps = "`pip install control`, or what MET's extra `control` names"
        raise Problem(error("E451", "a `control.StateSpace` needs the package python-control", help=helps)) from reason
    return control.ss(
        linearized.A, linearized.B, linearized.C, linearized.D, linearized.seconds,
        states=[_word(name) for name in linearized.states],
        inputs=[_word(name) for name in linearized.inputs] or None,
        outputs=[_word(name) for name in linearized.outputs] or None,
        name=linearized.experiment,
    )  # fmt: skip


def _word(name: str) -> str:
    """A name without dots, which python-control reserves for signals of systems."""
    return name.replace(".", "_")


def to_dataset(experiment: Experiment, gradients: MetricGradients) -> xarray.Dataset:
    """`value` (case, metric) and `slope` (case, metric, number) in SI, with their units, and `why_not`, which is empty
    where there is a slope."""
    import xarray

    why_not = np.full(gradients.slope.shape, "", dtype=object)
    for place, reason in gradients.why_not.items():
        why_not[place] = reason
    units = metric_units(experiment.structure)
    return xarray.Dataset(
        {
            "value": (("case", "metric"), gradients.value),
            "slope": (("case", "metric", "number"), gradients.slope),
            "why_not": (("case", "metric", "number"), why_not.astype(str)),
        },
        {
            "case": list(gradients.cases),
            "metric": list(gradients.metrics),
            "number": list(gradients.paths),
            "unit": ("metric", [units[name] for name in gradients.metrics]),
            "number_unit": (
                "number",
                [coordinate_unit(experiment, coordinate) for coordinate in experiment.cases.coordinates],
            ),
        },
        {"experiment": experiment.name},
    )
