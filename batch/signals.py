"""Choosing what to draw: a panel is one signal in one unit, a line in it one joint."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence

import numpy as np

from batch.archive.read import Group, Stored
from met.diagnostic import Problem, error
from met.frozen import frozen

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@frozen
class Panel:
    """Lines of one signal that share an axis. columns: where each line lies along the signal's joint dimension."""

    name: str
    about: str
    unit: str
    variable: str
    lines: tuple[str, ...]
    columns: tuple[int, ...]

    @property
    def axis(self) -> str:
        """What to write on the axis: `qd  (rad/s)`."""
        return f"{self.name}  ({pretty_unit(self.unit)})" if self.unit not in ("", "1") else self.name


def panels(group: Group, names: Sequence[str] = ()) -> list[Panel]:
    """The panels for some signals, all by default; `shoulder.qd` is one joint of `qd`."""
    signals = {variable.name: variable for variable in group.role("signal")}
    if not signals:
        message = f"no histories of `{group.name}` are in the archive"
        raise Problem(
            error("E323", message, help="run it again with `--histories all`, or one case alone: `--case '#0'`")
        )
    out: list[Panel] = []
    for name in names or signals:
        if name in signals:
            out += _whole(group, signals[name])
        else:
            out.append(_one_joint(group, signals, name))
    return out


def _whole(group: Group, variable: Stored) -> list[Panel]:
    joints = group.joints(variable)
    if not joints:
        return [Panel(variable.name, variable.long_name, variable.unit, variable.name, ("",), (0,))]
    units = variable.units_by_joint or (variable.unit,) * len(joints)
    out = []
    for unit in dict.fromkeys(units):
        columns = tuple(i for i, u in enumerate(units) if u == unit)
        lines = tuple(joints[i] for i in columns)
        out.append(Panel(variable.name, variable.long_name, unit, variable.name, lines, columns))
    return out


def _one_joint(group: Group, signals: dict[str, Stored], name: str) -> Panel:
    joint, _, rest = name.partition(".")
    variable = signals.get(rest)
    joints = group.joints(variable) if variable is not None else ()
    if variable is None or joint not in joints:
        known = list(signals)
        known += [f"{joint}.{v.name}" for v in signals.values() for joint in group.joints(v)]
        near = difflib.get_close_matches(name, known, n=1)
        helps = [f"did you mean `{near[0]}`?"] if near else []
        helps.append(f"signals here: {', '.join(signals)}; `<joint>.{next(iter(signals))}` is one joint's")
        raise Problem(error("E324", f"no signal `{name}` in `{group.name}`", help=helps))
    column = joints.index(joint)
    unit = variable.units_by_joint[column] if variable.units_by_joint else variable.unit
    return Panel(name, variable.long_name, unit, variable.name, ("",), (column,))


def history(group: Group, panel: Panel, position: int) -> np.ndarray:
    """The panel's lines in the recorded case at this position: (time, line)."""
    values = group.signal(panel.variable, position)
    return values[:, None] if values.ndim == 1 else values[:, list(panel.columns)]


def pretty_unit(unit: str) -> str:
    """`N*m*s^2` -> `N·m·s²`."""
    out, rest = "", unit.replace("*", "·")
    while "^" in rest:
        before, _, rest = rest.partition("^")
        digits = 1 if rest[:1] == "-" else 0
        while rest[digits : digits + 1].isdecimal():
            digits += 1
        out += before + rest[:digits].translate(SUPERSCRIPTS)
        rest = rest[digits:]
    return out + rest


def number_text(value: float) -> str:
    """Four digits that mean something, without an exponent where it reads well without: `20100`, `0.0025`."""
    if not math.isfinite(value) or value == 0.0:
        return f"{value + 0.0:g}"
    size = math.floor(math.log10(abs(value)) + 1e-12)
    if not -4 < size < 7:
        return f"{value:.4g}"
    text = f"{value:.{max(0, 3 - size)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def deck_unit(variable: Stored) -> tuple[float, str]:
    """What to divide a variable's SI values by, and the unit they are then in, typeset; "" for a pure number."""
    unit = str(variable.attributes.get("deck_unit", variable.unit))
    return float(variable.attributes.get("deck_scale", 1.0)), "" if unit == "1" else pretty_unit(unit)


def value_text(value: float | str | tuple[float, ...], variable: Stored) -> str:
    """An SI value of a variable as the deck would write it: `20.1 g`, `4.2 %`."""
    scale, unit = deck_unit(variable)
    if isinstance(value, str):
        return value
    text = f"[{', '.join(number_text(v / scale) for v in value)}]" if isinstance(value, tuple) else ""
    return f"{text or number_text(value / scale)} {unit}".rstrip()  # type: ignore[operator]


def case_text(group: Group, position: int, *, varied: bool = True) -> str:
    """A case in a few words: `case #4 8f3ab2c1 · gearbox.kp = 0.02 V·s/rad`."""
    row, case_id = group.values("case")[position], group.values("case_id")[position]
    words = [
        f"{path} = {number_text(value)} {pretty_unit(unit)}".removesuffix(" 1")
        for path, (value, unit) in (group.coordinates_of(position).items() if varied else ())
    ]
    return " · ".join([f"case #{row} {case_id[:8]}", *words])
