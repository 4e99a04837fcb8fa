"""The evidence of an archive's cases for each requirement, as a table."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from batch.notebook.table import archive, cases_of, name_of
from batch.queries.evidence_table import FIELDS, as_data, requirement_evidence
from batch.queries.pool import by_run
from met.diagnostic import Problem, error


def table(path: Path, parts: Mapping[str, xarray.Dataset]) -> Any:
    """A pandas.DataFrame with the fields of `RequirementEvidence`, a row for each. Raises Problem E388 where cases are
    missing, E389 where the archive is another one."""
    with archive(path, parts) as file:
        names = {name_of(data): len(cases_of(data)) for data in parts.values()}
        groups = [group for group in file.groups if group.name in names]
        for group in groups:
            if names[group.name] != group.count:
                message = f"evidence is of all cases, and here are {names[group.name]:,} of {group.count:,}"
                raise Problem(error("E388", message, help="ask the data as they were opened: `batch.open(FILE).met`"))
        evidence = requirement_evidence(groups, path.name, several=len(by_run(file.groups)) > 1)
        rows = [as_data(row) for row in evidence]
    held = {name: ("row", _column([row[name] for row in rows])) for name in FIELDS}
    return xarray.Dataset(held, coords={"row": range(len(rows))}).to_dataframe()


def _column(values: list[Any]) -> np.ndarray:
    """Words unchanged; numbers as floats, with not-a-number where there is none."""
    if any(isinstance(value, str) for value in values):
        return np.array(values, object)
    return np.array([np.nan if value is None else value for value in values])
