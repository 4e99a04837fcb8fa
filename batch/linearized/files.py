"""Linear answers in files: .npz, .h5 that xarray opens, or .csv, each whole or not at all."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

import numpy as np

from batch.linearized.data import arrays, axes
from met.analysis.linear.answers import Linearized
from met.diagnostic import Problem, error
from met.host.files import whole_file
from met.outputs import check_place, writing

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
    return {
        "experiment": linearized.experiment,
        "case": linearized.case,
        "time": linearized.time,
        "period": linearized.seconds,
    }


def _npz(linearized: Linearized) -> bytes:
    buffer = io.BytesIO()
    several: dict[str, Any] = {name: matrix for name, (_, matrix) in arrays(linearized).items()}
    several |= {
        axis: np.array(values, dtype=str) for axis, values in axes(linearized).items() if not axis.startswith("from_")
    }
    several |= {name: np.array(value) for name, value in _about(linearized).items()}
    np.savez(buffer, **several)
    return buffer.getvalue()


def _hdf5(linearized: Linearized) -> bytes:
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
    text, names = io.StringIO(), axes(linearized)
    out = csv.writer(text, lineterminator="\n")
    for key, value in _about(linearized).items():
        out.writerow([f"# {key}", json.dumps(value)])
    for name, ((rows, across), matrix) in arrays(linearized).items():
        out.writerow([name, *names[across]])
        for row, values in zip(names[rows], matrix.tolist(), strict=True):
            out.writerow([row, *(repr(value) for value in values)])
    return text.getvalue().encode()
