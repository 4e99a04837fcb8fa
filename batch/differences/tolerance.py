"""Tolerances of comparisons, `qd=1e-6rad/s, settle=0.04s, rel=1e-9, time=1ms`; without one, nothing may differ.

The deck says so in `tolerances { }`, and its archives with it; the command line has its way over the deck.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace

from batch.archive.read import ArchiveGroup
from met import units
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.plan import Experiment
from met.plan.outputs import OF_ALL
from met.unit_parser import parse_unit

NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
NONE = "none"
USAGE = "as in `--tol qd=1e-6rad/s,rel=1e-9,time=1ms`"


@frozen
class SignalTolerance:
    """The allowed difference of one signal or metric: |b - a| <= absolute + relative * max(|a|, |b|), at an instant
    that may be `time` s earlier or later. absolute in SI."""

    absolute: float = 0.0
    relative: float = 0.0
    time: float = 0.0


@frozen
class Tolerances:
    """Allowed differences: relative and time (s) of all, None where nothing is given; and absolute, by the name of a
    signal, of a joint's part of one (`elbow.q`), or of a metric: SI value, and as it was written.

    alone   whether decks have no say in it
    """

    relative: float | None = None
    time: float | None = None
    absolute: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    alone: bool = False

    @property
    def allow_any(self) -> bool:
        return bool(self.relative or self.time or any(size for size, _ in self.absolute.values()))

    def of(self, name: str) -> SignalTolerance:
        """The tolerance of a signal or a metric."""
        return SignalTolerance(self.absolute.get(name, (0.0, ""))[0], self.relative or 0.0, self.time or 0.0)

    def over(self, deck: Tolerances) -> Tolerances:
        """These tolerances, completed by those of a deck."""
        if self.alone:
            return self
        relative = deck.relative if self.relative is None else self.relative
        time = deck.time if self.time is None else self.time
        return Tolerances(relative, time, {**deck.absolute, **self.absolute})

    def within(self, known: Mapping[str, Sequence[str]]) -> Tolerances:
        """The tolerances without those of a quantity with another unit here. known: as for `check`"""
        fit = {
            name: size_text
            for name, size_text in self.absolute.items()
            if name not in known or fits(size_text[1], known[name])
        }
        return replace(self, absolute=fit)

    def as_written(self, names: Mapping[str, str]) -> dict[str, str]:
        """Tolerances as they were written, under the names that `names` gives them."""
        return {called: self.absolute[name][1] for called, name in names.items() if name in self.absolute}

    def words(self) -> list[str]:
        """The tolerances in words, one text each: `qd 1e-6 rad/s`, `rel 1e-9`, `time 0.001 s`."""
        of_all = (("rel", self.relative, ""), ("time", self.time, " s"))
        return [
            *(f"{name} {text}" for name, (_, text) in self.absolute.items()),
            *(f"{name} {size:g}{unit}" for name, size, unit in of_all if size is not None),
        ]


def of_deck(experiment: Experiment, group: ArchiveGroup) -> Tolerances:
    """The tolerances of an archive's deck. group: of the archive, in which a metric may have another name"""
    metrics = {variable.path: variable.name for variable in group.role("metric")}
    signals = {recorded.name for recorded in experiment.structure.record}
    by_name = {tolerance.of: tolerance for tolerance in experiment.tolerances}
    absolute = {}
    for name, tolerance in by_name.items():
        if name not in OF_ALL:
            metric = name.removeprefix("metrics.")
            known = name if name in signals or metric not in metrics else metrics[metric]
            absolute[known] = (tolerance.value, tolerance.text)
    of_all = {name: by_name[name].value if name in by_name else None for name in OF_ALL}
    return Tolerances(of_all["rel"], of_all["time"], absolute)


def tolerances(texts: Iterable[str]) -> Tolerances:
    """Read the words of `--tol`, each several with commas between; `none`: those of decks do not count. Raises Problem
    E360."""
    of_all: dict[str, float] = {}
    absolute: dict[str, tuple[float, str]] = {}
    words = [word.strip() for text in texts for word in text.split(",")]
    for word in words:
        if word == NONE:
            continue
        name, equals, value = (part.strip() for part in word.partition("="))
        number = NUMBER.match(value)
        if not equals or not name or number is None:
            raise _wrong(f"tolerance `{word}` cannot be read")
        size, unit = float(number.group()), value[number.end() :].strip()
        if not 0.0 <= size < float("inf"):
            raise _wrong(f"tolerance `{word}` is no size: it must be at least 0")
        if name in absolute or name in of_all:
            raise _wrong(f"tolerance `{name}` is given twice")
        if name == "rel":
            if unit and unit != "%":
                raise _wrong(f"tolerance `{word}` has a unit: `rel` is a share of the value")
            of_all[name] = size / 100.0 if unit else size
        elif name == "time":
            of_all[name] = _in_si(word, size, unit, "s")
        else:
            absolute[name] = (_in_si(word, size, unit), f"{number.group()} {unit}".rstrip())
    return Tolerances(of_all.get("rel"), of_all.get("time"), absolute, alone=NONE in words)


def fits(written: str, known: Sequence[str]) -> bool:
    """True if a tolerance as it was written, "1e-6 rad/s", has the unit of its quantity. known: the SI units in which
    the quantity occurs; with several there is none that fits."""
    wanted, *others = known
    unit = written.partition(" ")[2]
    return not others and units.same(parse_unit(unit or "1").dimension, parse_unit(wanted or "1").dimension)


def check(checked: Tolerances, known: Mapping[str, Sequence[str]], known_names: Sequence[str]) -> None:
    """Check that every tolerance of the command line names a quantity, and has its unit. known: SI units by the names
    of signals, joints' parts of them and metrics, several where a signal's joints have several. Raises E360."""
    for name, (_, written) in checked.absolute.items():
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            helps = [
                *(f"did you mean `{near_name}`?" for near_name in near),
                f"signals and metrics here: {', '.join(known_names)}",
            ]
            raise _wrong(f"tolerance of `{name}`: neither archive has such a signal or metric", *helps)
        if len(known[name]) > 1:
            parts = [part for part in known if part.endswith(f".{name}")]
            raise _wrong(
                f"tolerance of `{name}`: it is in {' and in '.join(known[name])}",
                f"give each joint its own: {', '.join(parts)}",
            )
        [wanted] = known[name]
        if not fits(written, known[name]):
            unit = written.partition(" ")[2]
            raise _wrong(f"tolerance of `{name}` is in `{unit or '1'}`, and `{name}` in `{wanted or '1'}`")


def _in_si(word: str, size: float, unit: str, wanted: str = "") -> float:
    """A tolerance in SI. wanted: the unit whose dimension it must have, if any. Raises Problem E360."""
    try:
        measure = parse_unit(unit or "1")
    except ValueError:
        raise _wrong(f"tolerance `{word}`: `{unit}` is no unit") from None
    if wanted and not units.same(measure.dimension, parse_unit(wanted).dimension):
        raise _wrong(f"tolerance `{word}`: `{unit or '1'}` is no unit of time")
    return size * measure.scale


def _wrong(message: str, *helps: str) -> Problem:
    return Problem(error("E360", message, help=helps or (USAGE,)))
