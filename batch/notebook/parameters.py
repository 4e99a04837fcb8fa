"""All parameters of one case, with their origins."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray

from batch.notebook.table import experiment, places
from batch.queries import cases


def table(path: Path, data: xarray.Dataset, case: int) -> Any:
    """A pandas.DataFrame by path: value (SI), unit, varies, origin (deck, default, case, derived), place. Raises
    Problem E389."""
    with experiment(path, data) as (file, group):
        [position] = places(group, path, data, np.array([case]))
        rows = cases.parameters(file, group, int(position))
        own = next(planned for planned in file.plan().experiments if planned.name == group.name)
    origins = {name: quantity.origin for name, quantity in own.parameters.items()}
    columns: dict[str, list[Any]] = {key: [row[key] for row in rows.values()] for key in ("value", "unit", "varies")}
    columns["origin"] = [origins[name].kind for name in rows]
    columns["place"] = [str(origins[name].place or "") for name in rows]
    held = {name: ("path", _column(values)) for name, values in columns.items()}
    return xarray.Dataset(held, coords={"path": list(rows)}).to_dataframe()


def _column(values: list[Any]) -> np.ndarray:
    """The values as an array of one dimension, even if they are lists."""
    out = np.empty(len(values), object)
    out[:] = values
    return out
