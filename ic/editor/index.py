"""The values of a deck as last compiled, for completion and hover."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import field
from itertools import islice

from ic.driver.compile import Compiled
from ic.driver.explain import explanations_of
from ic.meaning.parameters.owner import Settled
from ic.printing.columns import vector
from met.diagnostic import Place
from met.frozen import frozen
from met.messages.message import shown_place
from met.plan import Plan
from met.plan.channel import recordable
from met.trace import Scalar
from met.unit_parser import written
from met.units import size_in_si

MOST_VALUES = 20_000  # of a deck
_PATH = re.compile(r"\w+(\.\w+)*")
MOST_NUMBERS = 6  # of a list, that are shown


@frozen
class ValueInDeck:
    """A value of a run, with its place in the deck.

    path   the parameter's, or the name of a `let`
    value  in SI, as a person reads it
    origins  where it comes from: what it overrode, in which run
    doc    what the parameter means
    place  where it is written; None for a default
    """

    path: str
    value: str
    origins: tuple[str, ...]
    doc: str
    place: Place | None


@frozen
class DeckIndex:
    """The values of a deck, and the signals that its runs can record, with their units.

    cases  how many each run, sweep and search has, by name
    units  the sizes in SI of those that the deck declares
    names_by_owner  the names that the compiler knows, written out where loops make them: by kind, and arm or run that
           has them
    cells  the paths of the values of tables by row name, `bodies.boom.mass`
    """

    values: tuple[ValueInDeck, ...]
    signals: tuple[str, ...]
    cases: Mapping[str, int] = field(default_factory=dict)
    cells: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    names_by_owner: Mapping[tuple[str, str], tuple[str, ...]] = field(default_factory=dict)


def index_of(compiled: Compiled) -> DeckIndex:
    """The index of a deck that has a plan."""
    assert compiled.plan is not None
    signals = {path: None for experiment in compiled.plan.experiments for path in recordable(experiment.structure)}
    signals = {path: None for path in signals if _PATH.fullmatch(path)}  # no expression, as a metric may watch
    cases: dict[str, int] = {}
    for experiment in compiled.plan.experiments:
        name = experiment.name.partition(" ")[0]  # one of several structures is called `NAME CHOICES`
        cases[name] = cases.get(name, 0) + experiment.cases.count
    values = tuple(islice(_values(compiled), MOST_VALUES))
    cells = tuple(islice(_cells(compiled), MOST_VALUES))
    units = {name: size_in_si(measure) for name, measure in compiled.units.items()}
    return DeckIndex(values, tuple(signals), cases, cells, units, dict(_names_by_owner(compiled.plan)))


def _names_by_owner(plan: Plan) -> Iterator[tuple[tuple[str, str], tuple[str, ...]]]:
    """Joints, links and metrics of the plan by kind and by the arm or run that has them."""
    for experiment in plan.experiments:
        structure = experiment.structure
        yield ("joint", structure.arm), tuple(joint.name for joint in structure.joints)
        yield ("link", structure.arm), tuple(link.name for link in structure.links)
        yield ("metric", experiment.name.partition(" ")[0]), tuple(metric.name for metric in structure.metrics)


def _cells(compiled: Compiled) -> Iterator[str]:
    """The paths of all values of the deck's tables."""
    for scope in compiled.scopes[:1]:
        for name in scope.definitions.lets:
            table = scope.names.row_table(name)
            yield from (f"{name}.{path}" for path in table.paths()) if table is not None else ()


def _values(compiled: Compiled) -> Iterator[ValueInDeck]:
    """The values; where several runs differ, those that are written elsewhere too."""
    assert compiled.plan is not None
    seen: set[tuple[str, Place | None]] = set()
    for number, (experiment, scope) in enumerate(zip(compiled.plan.experiments, compiled.scopes, strict=True)):
        for path, settled in {**scope.parameters, **scope.auxiliary}.items():
            place = settled.origin.place
            key = path, place and shown_place(place)
            if key in seen:
                continue
            seen.add(key)
            text = _text(None if isinstance(settled.value, Scalar) else settled.value, settled.unit)
            yield ValueInDeck(path, text, tuple(_origins(settled, experiment.name)), settled.doc, place)
        for name in scope.definitions.lets if number == 0 else ():
            for explained in explanations_of(compiled, name):
                if explained.path == name and explained.place is not None:
                    value = explained.value
                    text = _text(value if not explained.varies else None, explained.unit)
                    yield ValueInDeck(name, text, (f"written `{explained.written}`",), explained.doc, explained.place)
                    break


def _text(value: float | tuple[float, ...] | str | None, unit: str) -> str:
    """A value in words for hover and completion, with its unit; None is a value that varies with the case."""
    if value is None:
        return f"in {unit}, and varies with the case" if unit not in ("", "1") else "varies with the case"
    if isinstance(value, str):
        return f"`{value}`"
    if isinstance(value, tuple):
        more = f", ... ({len(value)} in all)" if len(value) > MOST_NUMBERS else ""
        return vector(value[:MOST_NUMBERS], unit) + more
    return written(float(value), unit)


def _origins(settled: Settled, run: str) -> Iterator[str]:
    """Lines about where a settled value is from, and what it overrides. run: its name"""
    origin = settled.origin
    words = {"case": "a sweep varies it", "default": "the default", "derived": "computed"}.get(origin.kind, "")
    note = ", ".join(part for part in (words, origin.note) if part)
    yield f"in `{run}`" + (f": {note}" if note else "")
    yield from (f"overrides {shown_place(place)}" for place in origin.overrides)
