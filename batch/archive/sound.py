"""A check that an experiment's group matches the archive format, made once, when an archive is opened.

Readers of an archive may rely on it: cases rise and are unique, statuses are valid, times rise, sizes are those of the
dimensions. Values of signals, metrics and coordinates may be any number.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from batch.archive import searched
from batch.archive.stored import Stored, StoredGroup, Unlike
from met.messages.visible import line
from met.plan.columns import blocks
from met.run import DONE, LOST
from met.statistics.confidence import can_be_shown

NUMBERS, WHOLE, WORDS = "iuf", "iu", "O"
"""Kinds of numpy's types: of numbers, of whole numbers, and of strings in h5py."""

ATTRIBUTES: dict[str, tuple[type, ...]] = {
    "experiment": (str,),
    "arm": (str,),
    "integrator": (str,),
    "velocity_products": (str,),
    "duration_s": (float,),
    "dynamics_hz": (float,),
    "record_hz": (float,),
    "cases_in_table": (int,),
}
"""Attributes that every experiment's group has, with their types; numbers are above 0."""

WORDED = ("sweep", "structure_key", "code_key", "frame", "coordinates", "allowed", *searched.WORDS)
"""Optional text attributes of an experiment's group."""

VARIABLES = {"case": WHOLE, "case_id": WORDS, "cause": WORDS, "status": WHOLE, "n_valid": WHOLE}
"""Variables along `case` that every experiment's group has, with their types."""

OTHERS: dict[str, tuple[tuple[str, ...], str]] = {
    "case_key": (("case",), WORDS),
    "repeat": (("case",), WHOLE),
    "seed": (("case",), WHOLE),
    "bed_limited": (("case",), WHOLE),
    "warning": (("case",), WORDS),
    "recorded_case": (("recorded_case",), WHOLE),
    "time": (("time",), "f"),
    "requirement": (("requirement",), WORDS),
    "met": (("case", "requirement"), WHOLE),
}
"""Optional variables of a group: dimensions and type of each."""

OF_ROLES: dict[str, str | tuple[str, ...]] = {
    "coordinate": ("<f8",),
    "metric": ("<f8",),
    "limit": ("<f8",),
    "excess": ("<f8",),
    "extreme": ("<i8",),
    "grapple": ("<f8",),
    "signal": ("<f8", "<f4"),
    "choice": WORDS,
}
"""Types of variables by role: kinds, or types in numpy's notation."""

MOST = 1e15
"""Bound of seconds, hertz and cases; the inverse bounds seconds and hertz from below."""

LONGEST = 10_000
"""Largest length of a name or a unit: a picture with longer ones takes minutes."""

MOST_CASE = 1 << 53
"""Largest number of a case, since such numbers are exact as doubles too."""


def check(group: StoredGroup) -> None:
    """Check a group. Raises Unlike; HDF5's own errors over damaged bytes pass through."""
    _attributes(group.attributes)
    variables = group.variables
    shapes = {name: group.shape(name) for name in variables}
    types = {name: group.type(name) for name in variables}
    wanted = {**OTHERS, **{name: (("case",), kind) for name, kind in VARIABLES.items()}}
    for name in VARIABLES:
        if name not in variables:
            raise Unlike(f"variable `{name}` is missing or of another type")
    for name, variable in variables.items():
        dims, kinds = wanted.get(name, (variable.dims, NUMBERS + WORDS))
        if variable.dims != dims or types[name][1] not in kinds:
            raise Unlike(f"variable `{name}` is missing or of another type")
        if any(dim not in shapes for dim in variable.dims):
            raise Unlike(f"variable `{name}` lacks a dimension")
        if shapes[name] != tuple(shapes[dim][0] for dim in variable.dims):
            raise Unlike(f"variable `{name}` is not of the size of its dimensions")
        _of_its_role(variable, types)
    _names(group)
    _requirements(group)
    _values(group)
    if why := searched.why_unsound(group):
        raise Unlike(why)


def _names(group: StoredGroup) -> None:
    """Check that the deck's names are names: letters, numbers and visible marks, in one line."""
    attributes = group.attributes
    names = [attributes["experiment"], attributes.get("sweep", ""), *group.variables]
    for variable in group.role("signal"):
        for dim in variable.dims[2:]:
            names += group.values(dim).tolist()
    for variable in group.variables.values():
        if max(map(len, (variable.name, variable.unit, variable.long_name, *variable.units_by_joint))) > LONGEST:
            raise Unlike(f"variable `{variable.name[:99]}` has more words than there can be")
    for name in names:
        if len(name) > LONGEST:
            raise Unlike(f"a name in it has {len(name):,} letters")
        if line(name) != name:
            raise Unlike(f"a name in it has characters that no name has: {name}")


def _attributes(attributes: dict[str, Any]) -> None:
    """Check the attributes of an experiment's group: their types, and numbers within bounds. Raises Unlike."""
    for name, types in ATTRIBUTES.items():
        value = attributes.get(name)
        if not isinstance(value, types) or isinstance(value, bool):
            raise Unlike(f"attribute `{name}` is missing or of another type")
        if isinstance(value, int | float) and not 1 / MOST < value < MOST:
            raise Unlike(f"attribute `{name}` is {value}")
    early = attributes.get("until_shown", 1)
    if not isinstance(early, int) or isinstance(early, bool) or not 0 < early < MOST:
        raise Unlike("attribute `until_shown` is no number of cases")
    for name in WORDED:
        if not isinstance(attributes.get(name, ""), str):
            raise Unlike(f"attribute `{name}` is missing or of another type")


def _of_its_role(variable: Stored, types: dict[str, str]) -> None:
    """Check that a variable's type and dimensions match its role. types: of all variables, in numpy's notation"""
    name, dims = variable.name, variable.dims
    wanted = OF_ROLES.get(variable.role, NUMBERS + WORDS)
    if types[name][1] not in wanted and types[name] not in wanted:
        raise Unlike(f"variable `{name}` is of another type")
    of_cases = ("coordinate", "metric", "choice", "limit", "excess", "extreme", "grapple", "case")
    if variable.role in of_cases and dims != ("case",):
        raise Unlike(f"variable `{name}` is not over cases")
    if variable.role == "signal":
        if dims[:2] != ("recorded_case", "time"):
            raise Unlike(f"variable `{name}` is not over cases and time")
        if len(dims) > (4 if variable.of_joints else 3):
            raise Unlike(f"variable `{name}` has more dimensions than joints and components")
        if any(types[dim][1] not in WORDS for dim in dims[2:]):
            raise Unlike(f"variable `{name}` has a dimension without names")
    scale = variable.attributes.get("deck_scale", 1.0)
    if not isinstance(scale, int | float) or not math.isfinite(scale) or not scale:
        raise Unlike(f"variable `{name}` has no scale")
    if not isinstance(variable.attributes.get("code_key", ""), str):
        raise Unlike(f"variable `{name}` has a key that is no word")


def _requirements(group: StoredGroup) -> None:
    """Check that each attribute of the requirements has a value for each of them, and that `met` is 1, 0 or -1."""
    if "requirement" not in group.variables:
        return
    count = group.shape("requirement")[0]
    if count and "met" not in group.variables:
        raise Unlike("variable `met` is missing or of another type")
    attributes = group.variables["requirement"].attributes
    for name, types in (
        ("metric", str),
        ("comparison", str),
        ("limit", float),
        ("share", float),
        ("confidence", float),
    ):
        values = attributes.get(name, [])
        values = values if isinstance(values, list) else [values]
        if name in attributes and (len(values) != count or not all(isinstance(value, types) for value in values)):
            raise Unlike(f"attribute `{name}` of `requirement` is not of each")
        if name in ("share", "confidence") and not all(0.0 < value <= 1.0 for value in values if value == value):
            raise Unlike(f"attribute `{name}` of `requirement` is no share")
    shares, confidences = (np.atleast_1d(attributes.get(name, [])) for name in ("share", "confidence"))
    for share, confidence in zip(shares, confidences, strict=False):
        if confidence == 1.0 or (confidence > 0.0 and not can_be_shown(share)):
            raise Unlike("a requirement asks for what no number of cases shows")


def _values(group: StoredGroup) -> None:
    """Check that cases rise, and that statuses, times and names have valid values."""
    count = group.shape("case")[0]
    if not count:
        raise Unlike("it has no case")
    rows = None
    if "time" in group.variables:
        times = group.values("time")
        rows = len(times)
        if not rows or not (np.diff(times) > 1 / MOST).all() or not 0.0 <= times[0] <= times[-1] < MOST:
            raise Unlike("its times do not rise")
    before = -1
    for piece in blocks(count):
        cases, valid = (group.stretch(name, piece.start, piece.stop) for name in ("case", "n_valid"))
        if not _rises(cases) or not before < cases[0] or not cases[-1] <= MOST_CASE:
            raise Unlike("its cases do not rise")
        if valid.min() < 0 or (rows is not None and valid.max() > rows):
            raise Unlike("variable `n_valid` is not of its times")
        before = int(cases[-1])
    _within(group, "status", DONE, LOST)
    if "met" in group.variables:
        _within(group, "met", -1, 1)
    if "recorded_case" in group.variables:
        recorded = group.values("recorded_case")
        if not _rises(recorded) or not are_cases(group, recorded).all():
            raise Unlike("its recorded cases are none of its cases")
    for variable in group.role("extreme"):
        _within(group, variable.name, 0, len(str(variable.attributes.get("flag_meanings", "")).split()) - 1)
    for variable in group.role("signal"):
        for dim in variable.dims[2:]:
            names = group.values(dim).tolist()
            if not names or len(set(names)) != len(names) or not all(names):
                raise Unlike(f"variable `{dim}` does not name each")
        joints = group.shape(variable.dims[2])[0] if variable.of_joints else 1
        if variable.units_by_joint and len(variable.units_by_joint) != joints:
            raise Unlike(f"variable `{variable.name}` has not a unit of each joint")
        if "time" not in group.variables or "recorded_case" not in group.variables:
            raise Unlike(f"variable `{variable.name}` is not over cases and time")


def _rises(values: np.ndarray) -> bool:
    return bool((values[1:] > values[:-1]).all())


def are_cases(group: StoredGroup, wanted: np.ndarray) -> np.ndarray:
    """True for each of these positions in the case table whose case is in the group."""
    are_there = np.zeros(np.shape(wanted), bool)
    for piece in blocks(group.shape("case")[0]):
        are_there |= np.isin(wanted, group.stretch("case", piece.start, piece.stop))
    return are_there


def _within(group: StoredGroup, name: str, low: int, high: int) -> None:
    """Check the values of a variable along cases, a stretch at a time."""
    for piece in blocks(group.shape(name)[0]):
        values = group.stretch(name, piece.start, piece.stop)
        if values.size and not (values.min() >= low and values.max() <= high):
            raise Unlike(f"variable `{name}` has a value that it cannot have")
