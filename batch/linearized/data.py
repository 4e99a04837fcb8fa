"""A, B, C, D with named states, inputs and outputs: in xarray, and as a system of python-control."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from batch.archive.layout import coordinate_unit
from met.analysis.linear.answers import Linearized
from met.analysis.linear.gradient import MetricGradients
from met.diagnostic import Problem, error
from met.host.files import whole_file
from met.outputs import check_place, writing
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
    return xarray.Dataset(data, coordinates, _about(linearized))


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
    """An xarray.Dataset of `value` (case, metric) and `slope` (case, metric, number) in SI, with their units, and
    `why_not`, which is empty where there is a slope."""
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


ENDINGS = (".npz", ".h5", ".csv")


def check(output: Path) -> None:
    """Refuses a place at which no such file can be written. Raises Problem E305, E326."""
    if output.suffix.lower() not in ENDINGS and not output.is_dir():
        raise Problem(
            error("E326", f"cannot write {output}: linear answers are .npz, .h5 or .csv files", help="`-o linear.npz`")
        )
    check_place(output, code="E305", inside=output / "linear.npz")
    if output.exists() and output.stat().st_size > 0:
        helps = "give another name with `-o`, or remove the file"
        raise Problem(error("E305", f"{output} exists: it is not written over", help=helps))


def write(linearized: Linearized, output: Path) -> None:
    """Writes the answers. Raises Problem E305."""
    kind = output.suffix.lower()
    content = {".npz": _npz, ".h5": _hdf5, ".csv": _csv}[kind](linearized)
    with writing(output, code="E305"), whole_file(output) as file:
        file.write(content)


def _about(linearized: Linearized) -> dict[str, Any]:
    """The experiment, case, instant (s) and period (s) of linear answers, by name."""
    return {
        "experiment": linearized.experiment,
        "case": linearized.case,
        "time": linearized.time,
        "period": linearized.seconds,
    }


def _npz(linearized: Linearized) -> bytes:
    """The linear answers as the bytes of an .npz file."""
    buffer = io.BytesIO()
    several: dict[str, Any] = {name: matrix for name, (_, matrix) in arrays(linearized).items()}
    several |= {
        axis: np.array(values, dtype=str) for axis, values in axes(linearized).items() if not axis.startswith("from_")
    }
    several |= {name: np.array(value) for name, value in _about(linearized).items()}
    np.savez(buffer, **several)
    return buffer.getvalue()


def _hdf5(linearized: Linearized) -> bytes:
    """The linear answers as the bytes of an HDF5 file, with dimension scales for xarray."""
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", libver=("earliest", "v110"), track_order=True) as file:
        for axis, values in axes(linearized).items():
            file.create_dataset(axis, data=np.array(values, dtype=object), dtype=h5py.string_dtype())
            file[axis].make_scale(axis)
        for name, (along, matrix) in arrays(linearized).items():
            dataset = file.create_dataset(name, data=matrix)
            for number, axis in enumerate(along):
                dataset.dims[number].attach_scale(file[axis])
        file.attrs.update(_about(linearized))
    return buffer.getvalue()


def _csv(linearized: Linearized) -> bytes:
    """The linear answers as the bytes of a CSV file, one matrix below the other."""
    text, names = io.StringIO(), axes(linearized)
    out = csv.writer(text, lineterminator="\n")
    for key, value in _about(linearized).items():
        out.writerow([f"# {key}", json.dumps(value)])
    for name, ((rows, across), matrix) in arrays(linearized).items():
        out.writerow([name, *names[across]])
        for row, values in zip(names[rows], matrix.tolist(), strict=True):
            out.writerow([row, *(repr(value) for value in values)])
    return text.getvalue().encode()
