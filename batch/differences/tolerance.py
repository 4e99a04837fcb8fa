"""How much may differ: `qd=1e-6rad/s, settle=0.04s, rel=1e-9, time=1ms`. Nothing may unless it is given."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace

from met import units
from met.diagnostic import Problem, error
from met.frozen import frozen

NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
USAGE = "as in `--tol qd=1e-6rad/s,rel=1e-9,time=1ms`"


@frozen
class Tolerance:
    """What one signal or metric may differ by: |b - a| <= absolute + relative * max(|a|, |b|), at an instant that may
    be `time` s earlier or later. absolute in SI."""

    absolute: float = 0.0
    relative: float = 0.0
    time: float = 0.0

    @property
    def given(self) -> bool:
        return bool(self.absolute or self.relative or self.time)


@frozen
class Tolerances:
    """relative, time: of all; absolute: by the name of a signal, of a joint's part of one (`elbow.qd`), or of a metric:
    SI value and unit as written."""

    relative: float = 0.0
    time: float = 0.0
    absolute: Mapping[str, tuple[float, str]] = field(default_factory=dict)

    @property
    def given(self) -> bool:
        return bool(self.absolute or self.relative or self.time)

    def of(self, name: str) -> Tolerance:
        """Of a signal or a metric."""
        return Tolerance(self.absolute.get(name, (0.0, ""))[0], self.relative, self.time)


def tolerances(texts: Iterable[str]) -> Tolerances:
    """What words say, each several with commas between. Raises Problem E360."""
    found = Tolerances()
    absolute: dict[str, tuple[float, str]] = {}
    for word in (word.strip() for text in texts for word in text.split(",")):
        name, equals, value = (part.strip() for part in word.partition("="))
        number = NUMBER.match(value)
        if not equals or not name or number is None:
            raise _wrong(f"tolerance `{word}` cannot be read")
        size, unit = float(number.group()), value[number.end() :].strip()
        if not 0.0 <= size < float("inf"):
            raise _wrong(f"tolerance `{word}` is no size: it must be at least 0")
        if name in absolute or (name == "rel" and found.relative) or (name == "time" and found.time):
            raise _wrong(f"tolerance `{name}` is given twice")
        if name == "rel":
            if unit and unit != "%":
                raise _wrong(f"tolerance `{word}` has a unit: `rel` is a share of the value")
            found = replace(found, relative=size / 100.0 if unit else size)
        elif name == "time":
            found = replace(found, time=_in_si(word, size, unit, "s"))
        else:
            absolute[name] = (_in_si(word, size, unit), unit)
    return replace(found, absolute=absolute)


def check(found: Tolerances, known: Mapping[str, str], shown: Sequence[str]) -> None:
    """That every tolerance is of something, in its unit: SI units by the names of signals and metrics. Raises E360."""
    for name, (_, unit) in found.absolute.items():
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            helps = [*(f"did you mean `{each}`?" for each in near), f"signals and metrics here: {', '.join(shown)}"]
            raise _wrong(f"tolerance of `{name}`: neither archive has such a signal or metric", *helps)
        wanted = units.parse_unit(known[name] or "1").dimension
        if not units.same(units.parse_unit(unit or "1").dimension, wanted):
            raise _wrong(f"tolerance of `{name}` is in `{unit or '1'}`, and `{name}` in `{known[name] or '1'}`")


def _in_si(word: str, size: float, unit: str, wanted: str = "") -> float:
    try:
        measure = units.parse_unit(unit or "1")
    except ValueError:
        raise _wrong(f"tolerance `{word}`: `{unit}` is no unit") from None
    if wanted and not units.same(measure.dimension, units.parse_unit(wanted).dimension):
        raise _wrong(f"tolerance `{word}`: `{unit or '1'}` is no unit of time")
    return size * measure.scale


def _wrong(message: str, *helps: str) -> Problem:
    return Problem(error("E360", message, help=helps or (USAGE,)))
