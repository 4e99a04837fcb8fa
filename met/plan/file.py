"""Plans as files: canonical JSON with a schema version, exact to the bit, and the same bytes for the same plan.

    {"schema": "met.plan", "version": 1, "deck": ..., "experiments": [...], "sources": [...], "defines": [...]}

Every dataclass of `met.plan` is an object of its fields, those that equal their default left out. A number is the
shortest text that reads back to the same bits; "nan", "inf" and "-inf" are words. A parameter's value is a number, a
list, {"word": ...} or {"formula": output}.

A case table of more than `LISTED_ROWS` rows lies beside the plan, one binary file an experiment
(`plan.gains.cases.npy`: coordinate by case, little-endian doubles), named in the plan with its SHA-256. One of more
than `TABLE_ROWS` is kept as a recipe (met/plan/recipes.py): sizes of axes, seeds; long lists lie beside
(`plan.gains.0.npy`). A plan that is written for workers keeps every long table so.

Version 1 is the first; a plan with a table that is computed is of version 2. A plan of a newer version is refused. In
an older one, parameters that were added to its models since take their defaults, and the experiment's notes list them.
"""

from __future__ import annotations

import codecs
import hashlib
import io
import json
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from met.diagnostic import Problem, error
from met.host.files import open_regular, read_regular, whole_file
from met.outputs import check_regular, not_overwritten
from met.plan import Experiment, Formula, Plan, recipes
from met.plan.codec import Damaged, decode, encode
from met.plan.columns import LISTED_ROWS, CaseValues, blocks

SCHEMA = "met.plan"
VERSION = 2
TABLE_ROWS = 10_000_000
"""Largest number of rows of a case table that a plan or an archive holds as numbers."""

PIECE = 1 << 18
"""Number of rows of a table that are written together."""

Refer = Callable[[Experiment, int], Any]
Fetch = Callable[[dict[str, Any]], CaseValues]


def write(plan: Plan, path: str | os.PathLike[str], *, computed: bool = False) -> tuple[Path, ...]:
    """Write a plan, and its large case tables beside it; returns the written files.

    computed  whether all tables that are not listed are kept as what they are computed from, not the longest alone

    Raises Problem E300, and writes nothing, where it cannot, or where something else than a plan is there already.
    """
    path = Path(path)
    if not path.name:
        raise Problem(error("E300", f"cannot write {path}: it is a folder", help="name a file: `-o plan.json`"))
    files: dict[Path, bytes] = {}

    def beside(experiment: Experiment, what: str, data: bytes) -> dict[str, Any]:
        target = path.with_name(f"{path.stem}.{experiment.name}.{what}.npy")
        files[target] = data
        return {"file": target.name, "sha256": hashlib.sha256(data).hexdigest()}

    tables: dict[str, dict[str, Any]] = {}
    keepers: dict[str, recipes.ArrayKeeper] = {}

    def refer(experiment: Experiment, index: int) -> Any:
        """The reference to a column of a case table, which is kept beside the plan: a row of a table, or the recipe by
        which it is computed."""
        name = experiment.name
        if experiment.cases.count <= (LISTED_ROWS if computed else TABLE_ROWS):
            if name not in tables:
                tables[name] = beside(experiment, "cases", table_bytes(experiment))
            return {**tables[name], "row": index}
        if name not in keepers:
            keepers[name] = recipes.ArrayKeeper(lambda n, array: beside(experiment, str(n), array_bytes(array)))
        return recipes.encoded(columns(experiment)[index], keepers[name].keep)

    files[path] = dumps(plan, refer).encode()  # last, so that a plan never names a table that does not exist yet
    _check_targets(path, files)
    for target, data in files.items():
        _replace_file(target, data)
    return tuple(files)


def read(path: str | os.PathLike[str], *, every_case: bool = True) -> Plan:
    """The plan in a file. every_case: check all cases of a long table; False checks the first only, where the rest was
    checked before. Raises Problem E301 (no file), E302 (damaged), E303 (newer), E304 (a model's parameter)."""
    path = Path(path)
    try:
        text = read_regular(path).decode("utf-8-sig")
    except OSError as reason:
        raise Problem(error("E301", f"cannot read the plan {path}: {_why(reason)}")) from reason
    except UnicodeDecodeError as reason:
        raise Problem(_damaged(str(path), "it is not text")) from reason
    arrays: dict[str, tuple[np.ndarray, str]] = {}

    def find(reference: dict[str, Any]) -> np.ndarray:
        """The array of a case table beside the plan. Raises Damaged unless its SHA-256 is the plan's."""
        name = _word(reference, "file")
        if name not in arrays:
            arrays[name] = _read_array(path, name)
        array, digest = arrays[name]
        if digest != reference.get("sha256"):
            raise Damaged("", f"the case table {name} beside it is not the one it was written with (SHA-256 differs)")
        return array

    return loads(text, str(path), fetcher(find), every_case=every_case)


def fetcher(find: recipes.Find) -> Fetch:
    """Return a function that reads a column to which a plan refers: a row of a table that `find` gives, or its
    recipe."""
    reader = recipes.RecipeReader(find)

    def fetch(reference: dict[str, Any]) -> CaseValues:
        """The column of a case table that a reference of the plan stands for. Raises Damaged."""
        if "row" not in reference:
            try:
                return reader.column(reference)
            except (ValueError, LookupError, TypeError, OverflowError) as reason:
                raise Damaged("", f"its case table is not told as it should be: {reason}") from reason
        table, row, name = find(reference), reference["row"], reference.get("file")
        if table.ndim != 2 or table.dtype != np.dtype("<f8"):
            raise Damaged("", f"the case table {name} is not a table of doubles")
        if type(row) is not int or not 0 <= row < len(table):
            raise Damaged("", f"the case table {name} has no row {row}")
        return np.asarray(table[row])

    return fetch


def dumps(plan: Plan, refer: Refer | None = None) -> str:
    """A plan as canonical JSON. refer: gives the text in place of a large table's coordinate; None: all values."""
    kept_elsewhere = [refer is not None and experiment.cases.count > LISTED_ROWS for experiment in plan.experiments]
    bare = [
        _without_values(e) if elsewhere else e for e, elsewhere in zip(plan.experiments, kept_elsewhere, strict=True)
    ]
    body, computed = encode(Plan, replace(plan, experiments=tuple(bare))), False
    for experiment, written, elsewhere in zip(plan.experiments, body["experiments"], kept_elsewhere, strict=True):
        if refer is not None and elsewhere:
            cases = written["cases"]
            places = [(coordinate, "values") for coordinate in cases.get("coordinates", ())]
            places += [(cases, name) for name in ("repeats", "positions") if name in cases]
            for index, (holder, name) in enumerate(places):
                holder[name] = refer(experiment, index)
                computed = computed or not holder[name].keys() & {"row", "index"}
    document = {"schema": SCHEMA, "version": VERSION if computed else 1, **body}
    return json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False) + "\n"


def loads(
    text: str,
    name: str = "plan",
    fetch: Fetch | None = None,
    *,
    as_written: bool = False,
    every_case: bool = True,
) -> Plan:
    """A plan from its JSON. name: for messages. fetch: gives the values of a coordinate that are kept elsewhere.
    as_written: for display only, without checking its models or adding newer parameters. every_case: as in `read`."""
    from met.plan.check import check, check_text

    try:
        document = json.loads(text, parse_constant=_no_constant)
    except (ValueError, RecursionError) as reason:
        where = f" (line {reason.lineno})" if isinstance(reason, json.JSONDecodeError) else ""
        raise Problem(_damaged(name, f"it is not JSON{where}; was it cut short?")) from reason
    if not isinstance(document, dict) or document.pop("schema", None) != SCHEMA:
        helps = "plans are written by `met plan DECK -o FILE`"
        raise Problem(error("E302", f"{name} is not a plan of MET", help=helps))
    version = document.pop("version", None)
    if type(version) is not int or version < 1:
        raise Problem(_damaged(name, f"its schema version is {version!r}"))
    if version > VERSION:
        message = f"{name} was written by a newer MET: plan schema {version}, and this one reads up to {VERSION}"
        raise Problem(error("E303", message, help="update MET, or make the plan again from its deck"))
    try:
        if "\\u" in text:  # characters that cannot stand in a file unescaped; see `dumps`
            check_text(document)
        plan: Plan = decode(Plan, document, "", fetch)
        if as_written:
            return plan
        check(plan.experiments if every_case else map(_beginning, plan.experiments))
    except RecursionError as reason:
        raise Problem(_damaged(name, "it is nested too deeply")) from reason
    except Damaged as reason:
        raise Problem(_damaged(name, str(reason))) from reason
    return completed(plan, name, version)


def completed(plan: Plan, name: str = "plan", version: int = VERSION) -> Plan:
    """The plan with the defaults of its missing parameters, each listed in its experiment's notes."""
    from met.plan.defaults import missing_parameters, unknown_parameters

    problems, experiments = [], []
    for experiment in plan.experiments:
        for path, near in unknown_parameters(experiment):
            message = f"{name}: run `{experiment.name}`: parameter `{path}` is none of its model's"
            helps = [f"did you mean `{near}`?"] if near else []
            problems.append(error("E304", message, help=[*helps, "make the plan again from its deck"]))
        added = dict(experiment.parameters)
        notes = list(experiment.notes)
        for path, quantity in missing_parameters(experiment):
            if quantity is None:
                message = f"{name}: run `{experiment.name}`: parameter `{path}` is missing and has no default"
                problems.append(error("E304", message, help="make the plan again from its deck"))
                continue
            added[path] = quantity
            value_text = quantity.value if isinstance(quantity.value, str) else f"{quantity.value!r} {quantity.unit}"
            if isinstance(quantity.value, Formula):
                value_text = "that of the joint's servo"
            notes.append(f"`{path}` is not in the plan (schema {version}): its default, {value_text}, is taken")
        if len(added) > len(experiment.parameters):
            experiment = replace(experiment, parameters=added, notes=tuple(notes))
        experiments.append(experiment)
    if problems:
        raise Problem(problems)
    return replace(plan, experiments=tuple(experiments))


def table_bytes(experiment: Experiment) -> bytes:
    """A case table as the bytes of a .npy file: coordinate by case, little-endian doubles."""
    return array_bytes(np.array(columns(experiment), dtype="<f8").reshape(-1, experiment.cases.count))


def array_bytes(array: np.ndarray) -> bytes:
    """An array as the bytes of a .npy file."""
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, array, version=(1, 0), allow_pickle=False)
    return buffer.getvalue()


def columns(experiment: Experiment) -> list[CaseValues]:
    """The values of all coordinates, SI, then repeats and positions if there are any."""
    cases = experiment.cases
    values = [coordinate.values for coordinate in cases.coordinates]
    return values + [column for column in (cases.repeats, cases.positions) if column is not None]


def table_pieces(experiment: Experiment) -> Iterator[tuple[int, slice, np.ndarray]]:
    """A case table piece by piece: number of the column, rows, their values as little-endian doubles."""
    for number, column in enumerate(columns(experiment)):
        for rows in blocks(len(column), PIECE):
            yield number, rows, np.asarray(column[rows], dtype="<f8")


def _beginning(experiment: Experiment) -> Experiment:
    """The experiment with only the first rows of a long case table."""
    cases = experiment.cases
    if cases.count <= LISTED_ROWS or any(column.size != cases.count for column in columns(experiment)):
        return experiment
    coordinates = tuple(
        replace(coordinate, values=np.asarray(coordinate.values[:LISTED_ROWS])) for coordinate in cases.coordinates
    )
    repeats, positions = (
        None if column is None else np.asarray(column[:LISTED_ROWS]) for column in (cases.repeats, cases.positions)
    )
    shorter = replace(cases, count=LISTED_ROWS, coordinates=coordinates, repeats=repeats, positions=positions)
    return replace(experiment, cases=shorter)


def _without_values(experiment: Experiment) -> Experiment:
    """The experiment without the values of its case table."""
    cases = experiment.cases
    coordinates = tuple(replace(c, values=np.empty(0)) for c in cases.coordinates)
    repeats, positions = (None if column is None else np.empty(0) for column in (cases.repeats, cases.positions))
    return replace(experiment, cases=replace(cases, coordinates=coordinates, repeats=repeats, positions=positions))


def _read_array(plan: Path, name: str) -> tuple[np.ndarray, str]:
    """An array from a .npy file beside the plan, and the file's SHA-256. Raises Damaged."""
    if Path(name).name != name or not name:
        raise Damaged("", f"it names a case table outside its folder: {name}")
    try:
        data = read_regular(plan.with_name(name))
    except OSError as reason:
        raise Damaged(
            "", f"its case table {name}, which should lie beside it, cannot be read: {_why(reason)}"
        ) from reason
    try:
        array = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    except (ValueError, EOFError, OSError, TypeError, OverflowError, MemoryError) as reason:
        raise Damaged("", f"the case table {name} beside it is damaged") from reason
    return array, hashlib.sha256(data).hexdigest()


def _check_targets(path: Path, files: dict[Path, bytes]) -> None:
    """Check that nothing is overwritten except a plan of MET's, and the tables that it names."""
    before = _plan_there(path)
    for target, data in files.items():
        check_regular(target, code="E300")
        if target == path or not target.exists() or f'"{target.name}"' in before or read_regular(target) == data:
            continue
        message = f"cannot write {target}: it exists, and is no case table of {path}; it is not written over"
        raise Problem(error("E300", message, help="give another name with `-o`, or remove the file"))


def _plan_there(path: Path) -> str:
    """The text of the existing plan; empty where there is no file. Raises Problem E300 for anything else."""
    text = ""
    try:
        if not path.is_dir():
            check_regular(path, code="E300")
        with open_regular(path) as file:
            begins = file.read(1)
            text = (begins + file.read()).decode("utf-8-sig") if begins in (b"{", codecs.BOM_UTF8[:1]) else ""
        document = json.loads(text) if begins else {"schema": SCHEMA}
    except FileNotFoundError:
        return ""
    except OSError as reason:
        raise Problem(error("E300", f"cannot write {path}: {_why(reason)}")) from reason
    except (ValueError, RecursionError):
        document = None
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise Problem(not_overwritten(path, code="E300", because=" and is no plan of MET"))
    return text


def _replace_file(target: Path, data: bytes) -> None:
    """Write a file whole or not at all."""
    try:
        with whole_file(target) as file:
            file.write(data)
    except OSError as reason:
        raise Problem(error("E300", f"cannot write {target}: {_why(reason)}")) from reason


def _word(reference: dict[str, Any], key: str) -> str:
    value = reference.get(key)
    if not isinstance(value, str):
        raise Damaged("", f"a reference to a case table lacks its `{key}`")
    return value


def _no_constant(name: str) -> Any:
    raise ValueError(f"{name} is not JSON")


def _damaged(name: str, why: str) -> Any:
    helps: Iterable[str] = "make the plan again from its deck: `met plan DECK -o FILE`"
    return error("E302", f"the plan {name} is damaged: {why}", help=helps)


def _why(reason: OSError) -> str:
    return (reason.strerror or str(reason)).lower()
