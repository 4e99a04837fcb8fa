"""What differs between two plans, in the words of their decks: for who comes back to a campaign with another deck."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from met.distinct import distinct
from met.keys import LATER_FIELDS, SILENT_FIELDS
from met.plan import Cases, Experiment, Formula, Plan, Quantity, Schedule


def changes(before: Plan, now: Plan, *, ordered: bool = True) -> list[str]:
    """Each change that may change numbers, a line; none where there is none. ordered: another order of cases is one."""
    out = []
    old, new = ({experiment.name: experiment for experiment in plan.experiments} for plan in (before, now))
    if list(old) != list(new):
        out.append(f"runs and sweeps: {', '.join(old)}, now {', '.join(new)}")
    for name in old:
        if name in new:
            head = f"{name}: " if len(new) > 1 else ""
            out += [head + line for line in _experiment(old[name], new[name], ordered)]
    return out


def _experiment(before: Experiment, now: Experiment, ordered: bool) -> Iterator[str]:
    yield from _schedule(before.structure.schedule, now.structure.schedule)
    yield from _fields("", replace(before.structure, schedule=now.structure.schedule), now.structure)
    for path in dict.fromkeys([*before.parameters, *now.parameters]):
        old, new = before.parameters.get(path), now.parameters.get(path)
        if old is None or new is None:
            yield f"{path} is {'new' if old is None else 'gone'}"
        elif _value(old) != _value(new) and not (isinstance(old.value, Formula) and isinstance(new.value, Formula)):
            place = new.origin.place
            yield f"{path}: {', now '.join(_apart(old, new))}" + (f" ({place.file}:{place.line})" if place else "")
    yield from _cases(before.cases, now.cases, ordered)
    if before.formulas != now.formulas:
        yield "what follows from the varied parameters"


def _schedule(before: Schedule, now: Schedule) -> Iterator[str]:
    for name, old, new in (
        ("duration", f"{before.duration:g} s", f"{now.duration:g} s"),
        ("base rate", f"{before.base_hz:g} Hz", f"{now.base_hz:g} Hz"),
        ("rates.dynamics", f"{before.base_hz / before.dynamics:g} Hz", f"{now.base_hz / now.dynamics:g} Hz"),
        ("rates.record", f"{before.base_hz / before.record:g} Hz", f"{now.base_hz / now.record:g} Hz"),
    ):
        if old != new:
            yield f"{name}: {old}, now {new}"


def _cases(before: Cases, now: Cases, ordered: bool) -> Iterator[str]:
    old, new = ({c.path: c.values if ordered else np.sort(c.values) for c in cases.coordinates}
                for cases in (before, now))  # fmt: skip
    if before.count != now.count:
        yield f"{before.count:,} cases, now {now.count:,}"
    for path in dict.fromkeys([*old, *new]):
        if path not in old or path not in new:
            yield f"{path} is {'varied' if path in new else 'not varied any more'}"
        elif not np.array_equal(old[path], new[path], equal_nan=True):
            some = [f"{len(distinct(values)):,} values from {values.min():g} to {values.max():g}" for values in
                    (old[path], new[path])]  # fmt: skip
            yield f"{path}: {some[0]}, now {some[1]}" if some[0] != some[1] else f"values of {path}"
    for name in ("seed", "seeds"):
        if getattr(before, name) != getattr(now, name):
            yield f"{name}: {getattr(before, name)}, now {getattr(now, name)}"
    if not np.array_equal(_array(before.repeats), _array(now.repeats)):
        yield "repeats"


def _fields(path: str, before: Any, now: Any) -> Iterator[str]:
    """What differs between two structures, field by field."""
    if type(before) is type(now) and dataclasses.is_dataclass(before):
        for each in dataclasses.fields(before):
            if each.name not in SILENT_FIELDS or each.name in LATER_FIELDS:
                name = f"{path}.{each.name}" if path else each.name
                yield from _fields(name, getattr(before, each.name), getattr(now, each.name))
    elif isinstance(before, tuple) and isinstance(now, tuple):
        old, new = ({_name(each, index): each for index, each in enumerate(one)} for one in (before, now))
        if list(old) != list(new) and sorted(old) == sorted(new):
            yield f"{path}: in another order"
        for name in dict.fromkeys([*old, *new]):
            if name not in old or name not in new:
                yield f"{path}: {name} is {'new' if name in new else 'gone'}"
            else:
                yield from _fields(f"{path}.{name}", old[name], new[name])
    elif before != now:
        yield f"{path}: {before}, now {now}"


def _name(each: Any, index: int) -> str:
    """What one of several is called: a servo by its joint, a link by its name, another by its place."""
    return str(getattr(each, "joint", getattr(each, "name", index)))


def _value(quantity: Quantity) -> Any:
    return "varied" if isinstance(quantity.value, Formula) else quantity.value


def _apart(before: Quantity, now: Quantity) -> tuple[str, str]:
    """Two parameters' values in as few digits as tell them apart, but six at least."""
    for digits in range(6, 18):
        texts = _shown(before, digits), _shown(now, digits)
        if texts[0] != texts[1]:
            break
    return texts


def _shown(quantity: Quantity, digits: int) -> str:
    value = _value(quantity)
    shown = f"{value:.{digits}g}" if isinstance(value, float) else str(value)
    return f"{shown} {quantity.unit}" if isinstance(value, float) and quantity.unit != "1" else shown


def _array(values: np.ndarray | None) -> np.ndarray:
    return np.empty(0) if values is None else values
