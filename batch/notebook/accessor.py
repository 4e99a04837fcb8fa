"""`data.met`: MET's own methods of an archive's Dataset in xarray."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any, Generic, ParamSpec, TypeVar

import xarray

from batch.notebook import grid, quantities, selection
from batch.notebook.table import CASE, archive, cases_of, file_of, name_of, unknown_name
from met.diagnostic import Problem, error

if TYPE_CHECKING:
    from met.plan import Plan

Data = TypeVar("Data", xarray.Dataset, xarray.DataTree)
P = ParamSpec("P")
T = TypeVar("T")


def without_internals(function: Callable[P, T]) -> Callable[P, T]:
    """Wrap a method so that its Problems have no traceback into MET."""

    @wraps(function)
    def outer(*args: P.args, **named: P.kwargs) -> T:
        try:
            return function(*args, **named)
        except Problem as problem:
            raise problem.with_traceback(None) from None

    return outer


class Accessor(Generic[Data]):
    """An archive's cases, selected by their varied parameters and unfolded over these; poses of links; and the plan
    that was run.

    Selections and blocks are made of the Dataset alone. `frames`, `parameters`, `evidence`, `plan` and `sources` read
    the archive that it was opened from, which must still be the same one. All methods raise met.diagnostic.Problem for
    mistakes that a user can correct.
    """

    def __init__(self, data: Data) -> None:
        self._data: Data = data

    @without_internals
    def sel(self, wanted: Mapping[str, Any] | None = None, /, **more: Any) -> Data:
        """The cases that match all conditions, with their kept histories.

        By path in the deck, or by name of a metric or of any other variable that each case has one of:

            sel({"gearbox.kp": "20 mV*s/rad"})     a text has its unit
            sel(reach=0.8)                         a number is in the variable's unit, which is SI
            sel(reach=[0.5, 0.8])                  several values; each is in the archive to nine digits
            sel(settle=slice(None, "2 s"))         a range, with both ends
            sel(integrator="rk4")                  what decides the structure is a word

        and by

            case     7, "#7" or the beginning of a case_id; several in a list. One alone is no dimension any more
            failed   True: cases that did not reach their end
            met      True: cases that meet every requirement
            missed   True: cases that miss one
            run      name of a run or sweep, or several, of a DataTree

        A structure of a DataTree that has no such case is left out.
        """
        return self._whole(selection.selected(self._parts(), {**(wanted or {}), **more}))

    @without_internals
    def grid(self, *names: str | Sequence[str]) -> Any:
        """Metrics, or other variables over cases, as a block with a dimension for each parameter that is varied.

        One name gives a DataArray; several, or a list, a Dataset; none all metrics. Parameters that are varied in step
        share a dimension. Repeats are a dimension, and so is what decides the structure. Where there is no case it is
        not-a-number.
        """
        wanted = [wanted for name in names for wanted in ([name] if isinstance(name, str) else name)]
        block = grid.to_grid(list(self._parts().values()), wanted)
        return block[names[0]] if len(names) == 1 and isinstance(names[0], str) else block

    @without_internals
    def frames(self, *links: str, case: Any = None) -> Data:
        """The poses of links in the world at each instant, of all links or of these; of all recorded cases, or as `sel`
        takes them.

        position     (recorded_case, time, link, axis), m: origin of the link's frame
        orientation  (recorded_case, time, link, quaternion): w, x, y, z, from link axes to world axes

        Computed from the Dataset's q, at its instants, and the case's own parameters; not-a-number after a failure.
        """
        from batch.notebook.frames import frames

        path = file_of(self._data)
        parts = self._parts() if case is None else selection.selected(self._parts(), {CASE: case})
        return self._whole(frames(path, parts, links, whole=case is not None))

    @without_internals
    def in_units(self, wanted: Mapping[str, str] | None = None, /, **more: str) -> Data:
        """Variables in other units, `in_units(qd="deg/s")`; none given: parameters and metrics as the deck writes
        them. `units` of each says so. `sel`, `grid` and `frames` go on working."""
        units = {**(wanted or {}), **more}
        parts = self._parts()
        known = {
            name: [known_name for known_name in units if quantities.named(data, known_name)]
            for name, data in parts.items()
        }
        for unit in units:
            if not any(unit in names for names in known.values()):
                raise unknown_name(
                    list(parts.values()), unit, "no variable", [str(v) for d in parts.values() for v in d]
                )
        return self._whole(
            {
                name: quantities.in_units(
                    data, {known_name: units[known_name] for known_name in known[name]} if units else None
                )
                for name, data in parts.items()
            }
        )

    @without_internals
    def parameters(self, case: Any = None) -> Any:
        """All parameters of a case as a pandas.DataFrame by path: value (SI), unit, whether it varies, who wrote it
        and where. case: as `sel` takes it; None where there is only one."""
        from batch.notebook.answers import parameter_table

        path = file_of(self._data)
        parts = self._parts() if case is None else selection.selected(self._parts(), {CASE: case})
        cases = [(data, int(row)) for data in parts.values() for row in cases_of(data)]
        if len(cases) != 1:
            helps = 'name one: `data.met.parameters("#0")`; of several runs, `data.met.sel(run=NAME)` before'
            raise Problem(error("E388", f"parameters are those of one case, and here are {len(cases):,}", help=helps))
        return parameter_table(path, *cases[0])

    @without_internals
    def evidence(self) -> Any:
        """The evidence of the cases for each requirement at each design point, as a pandas.DataFrame with a row each:
        the table of `met show --evidence`, numbers in SI. It is about all cases, so ask before selecting any."""
        from batch.notebook.answers import evidence_table

        return evidence_table(file_of(self._data), self._parts())

    @property
    @without_internals
    def plan(self) -> Plan:
        """The whole plan that was run."""
        with archive(file_of(self._data), self._parts()) as file:
            return file.plan()

    @property
    @without_internals
    def sources(self) -> dict[str, str]:
        """The deck's files as they were read, by name; the deck itself first."""
        with archive(file_of(self._data), self._parts()) as file:
            return file.sources()

    def __repr__(self) -> str:
        from batch.notebook.answers import summary

        return "\n".join(summary(data) for data in self._parts().values())

    def __getattr__(self, name: str) -> Any:
        where = "" if name.startswith("_") else '; the variable of that name, of verdicts, is data["met"]'
        raise AttributeError(f"`data.met` has no `{name}`{where}")

    def __eq__(self, other: object) -> bool:
        raise TypeError('`data.met` is no variable; the one of that name, of verdicts, is data["met"]')

    __hash__ = object.__hash__

    def _parts(self) -> dict[str, xarray.Dataset]:
        raise NotImplementedError

    def _whole(self, parts: Mapping[str, xarray.Dataset]) -> Data:
        raise NotImplementedError


class DatasetAccessor(Accessor[xarray.Dataset]):
    def _parts(self) -> dict[str, xarray.Dataset]:
        return {"": self._data}

    def _whole(self, parts: Mapping[str, xarray.Dataset]) -> xarray.Dataset:
        return parts[""]


class TreeAccessor(Accessor[xarray.DataTree]):
    """`data.met` of a DataTree: each question is put to each run, sweep or structure in it."""

    def _parts(self) -> dict[str, xarray.Dataset]:
        """The datasets of the runs and sweeps in a DataTree, by name. Raises Problem E389 where it has none."""
        datasets = {
            node.path.removeprefix(self._data.path.rstrip("/")) or "/": node.to_dataset()
            for node in self._data.subtree
            if name_of(node)
        }
        if not datasets:
            raise Problem(error("E389", "this DataTree is of no archive: nothing in it has an attribute `experiment`"))
        return datasets

    def _whole(self, parts: Mapping[str, xarray.Dataset]) -> xarray.DataTree:
        tree = xarray.DataTree.from_dict(dict(parts), name=self._data.name)
        tree.attrs = {**self._data.attrs, **tree.attrs}
        tree.encoding = {**self._data.root.encoding, **tree.encoding}
        return tree
