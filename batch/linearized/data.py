"""A, B, C, D with named states, inputs and outputs: in xarray, and as a system of python-control."""

from __future__ import annotations

from typing import Any

import numpy as np

from met.analysis.linear.answers import Linearized
from met.diagnostic import Problem, error


def arrays(found: Linearized) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """The matrices by name, each with the names of its axes."""
    plant = found.plant
    return {
        "A": (("state", "from_state"), found.A),
        "B": (("state", "input"), found.B),
        "C": (("output", "from_state"), found.C),
        "D": (("output", "input"), found.D),
        "plant_A": (("plant_state", "from_plant_state"), plant.A),
        "plant_B": (("plant_state", "held"), plant.B),
    }


def axes(found: Linearized) -> dict[str, tuple[str, ...]]:
    """The names along each axis."""
    plant = found.plant
    return {
        "state": found.states,
        "from_state": found.states,
        "input": found.inputs,
        "output": found.outputs,
        "plant_state": plant.states,
        "from_plant_state": plant.states,
        "held": plant.inputs,
    }


def to_xarray(found: Linearized) -> Any:
    """An xarray.Dataset of A, B, C, D of a period, of the plant's A and B in continuous time, and of the poles."""
    import xarray

    poles = found.poles
    data: dict[str, Any] = dict(arrays(found))
    data["pole"] = (("mode",), np.array([pole.z for pole in poles], dtype=complex))
    shares = [[dict(pole.shares)[state] for state in found.states] for pole in poles]
    data["share"] = (("mode", "state"), np.array(shares).reshape(len(poles), len(found.states)))
    coordinates = {name: list(values) for name, values in axes(found).items()}
    about = {"experiment": found.experiment, "case": found.case, "time": found.time, "period": found.seconds}
    return xarray.Dataset(data, coordinates, about)


def state_space(found: Linearized) -> Any:
    """A `control.StateSpace` in discrete time, with names. Raises Problem E451 where python-control is missing."""
    try:
        import control
    except ImportError as reason:
        helps = "`pip install control`, or what MET's extra `control` names"
        raise Problem(error("E451", "a `control.StateSpace` needs the package python-control", help=helps)) from reason
    return control.ss(
        found.A, found.B, found.C, found.D, found.seconds,
        states=[_word(name) for name in found.states],
        inputs=[_word(name) for name in found.inputs] or None,
        outputs=[_word(name) for name in found.outputs] or None,
        name=found.experiment,
    )  # fmt: skip


def _word(name: str) -> str:
    """A name without dots, which python-control reserves for signals of systems."""
    return name.replace(".", "_")
