"""Cases of an archive run again from the archive alone: with full histories, and the same bits."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.campaigns import choosing
from batch.queries.pool import cases_named, groups_named
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.plan import Experiment, Plan
from met.plan.columns import are_among
from met.run import comparable

MOST_IN_NAME = 4
"""Largest number of cases in the name of their archive."""

MOST_TOLD = 8
"""Largest number of differences that are named."""


@frozen
class Replay:
    """The cases of an archive that are run again: its plan, and of each experiment the rows of the case table;
    `history_rows`, by name: those whose histories the archive has, where all of it is run again; `decided`: names of
    the experiments of which these rows are those after which it was decided what is required."""

    archive: Path
    plan: Plan
    selected: tuple[tuple[Experiment, np.ndarray], ...]
    word: str
    history_rows: Mapping[str, np.ndarray] | None = None
    decided: tuple[str, ...] = ()

    @property
    def output(self) -> Path:
        """The default archive: `two_link.gains.case7.h5`, in the current folder."""
        return Path(f"{self.archive.stem}.{self.word}.h5")


def replay(
    archive: str | Path, names: Sequence[str], cases: Sequence[str], failed: bool = False, everything: bool = False
) -> Replay:
    """Choose the cases to run again. cases: as `met show` takes them; failed: all that did not reach their end;
    everything: all of the archive, with the histories that it has. Raises Problem."""
    with ArchiveFile(archive) as file:
        rows: dict[str, set[int]] = {}
        if failed or everything:
            file.need_every_row("running all again, or all that failed,")
        if any(group.summary is not None for group in file.groups):
            return _of_summary(file, names, cases)
        for case in cases:
            for group, position in cases_named(file, names, case):
                if position is not None:
                    rows.setdefault(group.name, set()).add(_row(group, position))
        if failed:
            for group in groups_named(file, names):
                for position in np.flatnonzero(group.values("status") != 0).tolist():
                    rows.setdefault(group.name, set()).add(_row(group, position))
        positions: dict[str, np.ndarray] = {}
        decided = [
            group.name for group in groups_named(file, names) if everything and group.attributes.get("until_shown")
        ]
        for group in groups_named(file, names) if everything else ():
            rows[group.name] = set(group.values("case").tolist())
            positions[group.name] = group.values("case")[group.recorded_positions]
        if not cases and not failed and not everything:
            helps = (
                "`--case '#7'` runs a case again, `--failed` all that failed, `--all` all",
                "`met show` lists the cases",
            )
            raise Problem(error("E357", f"which cases of {file.path} are to be run again?", help=helps))
        if not rows:
            raise Problem(error("E357", f"no case of {file.path} failed: there is nothing to run again"))
        plan = file.plan()
        picked_rows = []
        history_rows: dict[str, np.ndarray] = {}
        for experiment in plan.experiments:
            if experiment.name in rows:
                table = experiment.cases.table
                wanted = np.searchsorted(table, sorted(rows[experiment.name]))
                picked_rows.append((experiment, np.asarray(wanted, dtype=np.int64)))
                if everything:
                    history_rows[experiment.name] = np.searchsorted(table, positions[experiment.name])
    if everything:
        word = "again"
    else:
        word = "failed" if failed else _cases_word(position for positions in rows.values() for position in positions)
    return Replay(Path(archive), plan, tuple(picked_rows), word, history_rows if everything else None, tuple(decided))


def _of_summary(file: ArchiveFile, names: Sequence[str], cases: Sequence[str]) -> Replay:
    """The cases to run again of an archive that keeps a summary: any that its plan has. Raises Problem."""
    plan, wanted = file.plan(), {group.name for group in groups_named(file, names)}
    if not cases:
        raise Problem(error("E357", f"which cases of {file.path} are to be run again?", help="`--case '#7'` says it"))
    experiments = [experiment for experiment in plan.experiments if experiment.name in wanted]
    picked = tuple((experiment, np.asarray(rows)) for experiment, rows in choosing.select_rows(experiments, cases))
    return Replay(
        file.path, plan, picked, _cases_word(int(e.cases.table[row]) for e, rows in picked for row in rows.tolist())
    )


def _cases_word(positions: Iterable[int]) -> str:
    """The word for these cases, by their positions in the case table, in a default archive's name: `case3-7`, or
    `cases` where they are more than `MOST_IN_NAME`."""
    few = sorted(set(positions))
    return "case" + "-".join(map(str, few)) if len(few) <= MOST_IN_NAME else "cases"


def _row(group: ArchiveGroup, position: int) -> int:
    """The position in the case table of a case of an archive."""
    return int(group.at("case", [position])[0])


def differences(before: str | Path, after: str | Path) -> list[str]:
    """The cases of the second archive with other results than in the first, a line each; none where all of their bits
    are the same. Cases that were lost or timed out do not count."""
    out: list[str] = []
    with ArchiveFile(before) as old_file, ArchiveFile(after) as new_file:
        groups = {group.name: group for group in old_file.groups}
        for new in new_file.groups:
            old = groups[new.name]
            places = np.searchsorted(old.values("case"), new.values("case"))
            in_old = are_among(old.values("case"), new.values("case"))  # a summary has few rows
            places = np.where(in_old, places, 0)
            ran = (old.at("status", places) < 2) & in_old
            out += _signals(old, new, places, ran)
            names = ["case_id", "status", "n_valid", *(variable.name for variable in new.role("metric"))]
            for name in names:
                a, b = old.at(name, places), new.values(name)
                for place in np.flatnonzero(~_alike(a, b) & ran).tolist():
                    case = new.values("case")[place]
                    out.append(f"#{case} of {new.name}: {name} was {_plain(a[place])}, is {_plain(b[place])}")
            old_code, new_code = (group.attributes.get("code_key") for group in (old, new))
            if out and comparable(old_code, new_code) and old_code != new_code:  # older archives have none
                out.insert(
                    0, f"the program of `{new.name}` is another: MET's code, or that of models, has changed since"
                )
    return out[:MOST_TOLD] + ([f"and {len(out) - MOST_TOLD} more"] if len(out) > MOST_TOLD else [])


def in_both(before: str | Path, after: str | Path) -> tuple[int, int]:
    """The number of the second archive's cases that have a row in the first, and of all of its cases."""
    with ArchiveFile(before) as old_file, ArchiveFile(after) as new_file:
        known = {group.name: group.values("case") for group in old_file.groups}
        in_old = [are_among(known[group.name], group.values("case")) for group in new_file.groups]
    return sum(int(mask.sum()) for mask in in_old), sum(map(len, in_old))


def _signals(old: ArchiveGroup, new: ArchiveGroup, places: np.ndarray, ran: np.ndarray) -> Iterator[str]:
    """Lines about differing signals, in cases whose histories both archives have. places: of new's cases in old"""
    for variable in new.role("signal"):
        if variable.name not in old.variables or old.variables[variable.name].role != "signal":
            continue
        for place in np.flatnonzero(ran).tolist():
            if places[place] in old.recorded_positions and place in new.recorded_positions:
                a, b = old.signal(variable.name, int(places[place])), new.signal(variable.name, place)
                if a.dtype != b.dtype:  # one side has numbers of four bytes
                    a, b = a.astype(np.float32), b.astype(np.float32)
                if a.shape == b.shape and not _alike(a, b).all():
                    row = int(np.argmin(_alike(a, b).reshape(len(a), -1).all(axis=1)))
                    case, time = new.values("case")[place], new.values("time")[row]
                    yield f"#{case} of {new.name}: {variable.name} differs from {time:g} s on"


def _alike(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """True where two arrays have the same bits; all not-a-numbers are alike."""
    if before.dtype.kind != "f":
        return np.asarray(before == after)
    whole = np.dtype(f"i{before.dtype.itemsize}")
    bits = [np.ascontiguousarray(values, before.dtype).view(whole) for values in (before, after)]
    return np.asarray((bits[0] == bits[1]) | (np.isnan(before) & np.isnan(after)))


def _plain(value: object) -> str:
    return repr(value.item()) if isinstance(value, np.generic) else repr(value)
