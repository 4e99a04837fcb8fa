"""Answers about an archive's cases in a notebook: evidence for requirements, parameters, and a summary."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from batch.notebook.quantities import in_deck_unit
from batch.notebook.table import CASE, RECORDED, archive, cases_of, experiment, file_of, name_of, places, varied
from batch.queries import cases
from batch.queries.answer_outcome import answer_outcome
from batch.queries.evidence_table import FIELDS, as_data, requirement_evidence
from batch.queries.pool import STATUS, by_run
from batch.queries.search_answers import SearchAnswer
from met.diagnostic import Problem, error
from met.distinct import distinct
from met.run import DONE


def evidence_table(path: Path, parts: Mapping[str, xarray.Dataset]) -> Any:
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


def parameter_table(path: Path, data: xarray.Dataset, case: int) -> Any:
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
    held = {name: ("path", _parameter_column(values)) for name, values in columns.items()}
    return xarray.Dataset(held, coords={"path": list(rows)}).to_dataframe()


def _parameter_column(values: list[Any]) -> np.ndarray:
    """The values as an array of one dimension, even if they are lists."""
    out = np.empty(len(values), object)
    out[:] = values
    return out


FEW = 5
"""Largest number of distinct values that are listed."""


def summary(data: xarray.Dataset) -> str:
    """Text about a Dataset: its run, the number of its cases, how they ended, and its varied parameters."""
    if not name_of(data):
        return "a Dataset that is of no archive of MET"
    deck = str(data.attrs.get("deck", "")).strip("<>")
    out = [f"{name_of(data)}{f' of {deck}' if deck else ''}: {_cases(data)}"]
    summed = int(data.attrs.get("summary_of_cases", 0))
    if summed:
        out.append(f"  rows that a summary of {summed:,} cases names, no sample of them; `evidence()` judges all")
    if CASE in data.dims and "status" in data and not summed:
        status = data["status"].values
        ended = (
            f"{(status == code).sum():,} {word}"
            for code, word in STATUS.items()
            if code == DONE or (status == code).any()
        )
        out.append(f"  {', '.join(ended)}")
    if "search" in data.attrs:
        out += _answered(data)
    elif not summed and "met" in data and data["met"].dims == (CASE, "requirement"):
        for text, met in zip(data["requirement"].values.astype(str), data["met"].values.T, strict=True):
            out.append(f"  require {text}: met by {(met == 1).sum():,} of {len(met):,}")
    dim = next((name for name in (CASE, RECORDED) if name in data.dims), "")
    out += [f"  {path}: {_values(array)}" for path, array in (varied(data, dim) if dim else {}).items()]
    return "\n".join(out)


def _answered(data: xarray.Dataset) -> list[str]:
    """The requirements of a search in the cases of its answer, from its archive; none where that is gone, or was opened
    in part."""
    try:
        with experiment(file_of(data), data) as (_, group):
            answer = SearchAnswer.of(group)
            outcome = None if answer is None else answer_outcome(answer)
    except (Problem, OSError):
        return []
    if outcome is None:
        return []
    return [
        f"  {outcome.headline}",
        *(f"  require {requirement.text}: {requirement.outcome_with_value}" for requirement in outcome.requirements),
    ]


def _cases(data: xarray.Dataset) -> str:
    """The number of cases of a Dataset in words."""
    if CASE in data.dims:
        count, recorded = data.sizes[CASE], data.sizes.get(RECORDED, 0)
        return f"{count:,} case{'s' if count != 1 else ''}, {recorded:,} with a history"
    if RECORDED in data.dims:
        return f"histories of {data.sizes[RECORDED]:,} cases"
    alone = next((name for name in (CASE, RECORDED) if name in data.coords), "")
    return f"case #{int(data[alone])}" if alone else "no cases"


def _values(array: xarray.DataArray) -> str:
    """The distinct values if they are few, or their range; in the deck's unit."""
    values = distinct(array.values)
    numbers = values.dtype.kind in "iuf"
    if len(values) <= FEW:
        return ", ".join(in_deck_unit(values, array.attrs) if numbers else values.astype(str))
    if not numbers:
        return f"{len(values):,} words"
    first, last = in_deck_unit(values[[0, -1]], array.attrs)
    return f"{first} to {last}, {len(values):,} values"
