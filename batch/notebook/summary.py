"""A summary of an archive's Dataset in a few lines."""

from __future__ import annotations

import xarray

from batch.notebook.quantities import in_deck_unit
from batch.notebook.table import CASE, RECORDED, experiment, file_of, name_of, varied
from batch.queries.answer_outcome import answer_outcome
from batch.queries.failures import STATUS
from batch.queries.search_answers import SearchAnswer
from met.diagnostic import Problem
from met.distinct import distinct
from met.run import DONE

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
