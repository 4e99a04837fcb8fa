"""The choice of signals to draw: a panel is one signal in one unit, a line in it one joint, or one component of a
vector.
"""

from __future__ import annotations

import difflib
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.archive.stored import Stored
from met.diagnostic import Place, Problem, error
from met.frozen import frozen
from met.plan import Experiment, Plan
from met.plan.channel import FAMILIES, channel_paths, joint_of
from met.unit_parser import parse_unit

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@frozen
class Panel:
    """Lines of one signal that share an axis.

    lines    what each is called: its joint, its component, or nothing where there is no other
    columns  where each lies along the signal's joints and components, counted as one
    joints   the joint that each is of; none for what a link or the arm has. Lines of one joint are components
    scale    how many SI units one `unit` is, where that is not `si`
    """

    name: str
    about: str
    unit: str
    variable: str
    lines: tuple[str, ...]
    columns: tuple[int, ...]
    joints: tuple[str, ...] = ("",)
    scale: float = 1.0
    in_si: str = ""

    @property
    def si(self) -> str:
        """The unit in which the archive holds it."""
        return self.in_si or self.unit

    @property
    def axis(self) -> str:
        """The label of the axis: `qd  (rad/s)`."""
        return f"{self.name}  ({pretty_unit(self.unit)})" if self.unit not in ("", "1") else self.name


def panels(group: ArchiveGroup, names: Sequence[str] = ()) -> list[Panel]:
    """The panels for some signals, all by default; `shoulder.qd` is one joint of `qd`."""
    signals = {variable.name: variable for variable in group.role("signal")}
    if not signals:
        message = f"no histories of `{group.name}` are in the archive"
        raise Problem(
            error("E323", message, help="run it again with `--histories all`, or one case alone: `--case '#0'`")
        )
    known = _choices(group, signals)
    out: list[Panel] = []
    for name in names or signals:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            helps = [f"did you mean `{near[0]}`?"] if near else []
            of_joints = next((v.name for v in signals.values() if group.joints(v)), "")
            hint = f"; `<joint>.{of_joints}` is one joint's" if of_joints else ""
            helps.append(f"signals here: {', '.join(signals)}{hint}")
            raise Problem(error("E324", f"no signal `{name}` in `{group.name}`", help=helps))
        for choice in known[name]:
            out += _panels(group, choice)
    return out


@frozen
class SignalSelection:
    """Some of a signal's columns, under the name by which they were asked for."""

    name: str
    variable: Stored
    columns: tuple[int, ...]


def _choices(group: ArchiveGroup, signals: dict[str, Stored]) -> dict[str, tuple[SignalSelection, ...]]:
    """The selections of each name: whole signals, one joint's, one component's, a family's."""
    selections: dict[str, tuple[SignalSelection, ...]] = {}
    for variable in signals.values():
        joints, components = group.joints(variable), group.components(variable)
        parts: dict[str, list[int]] = {}
        scalars = channel_paths(variable.name, joints, components)
        for column, path in enumerate(scalars):
            names = [path]
            if components and joints:
                owner, _, component = path.rpartition(".")
                inner = variable.name.startswith("links.")  # whose `.x` would be that of a joint `x`
                names += [owner] if inner else [owner, f"{variable.name}.{component}"]
            for name in names:
                parts.setdefault(name, []).append(column)
        parts[variable.name] = list(range(len(scalars)))
        for name, columns in parts.items():
            if name == variable.name or (name not in selections and name not in signals):
                selections[name] = (SignalSelection(name, variable, tuple(columns)),)
    for name, choice in list(selections.items()):
        family, _, member = name.rpartition(".")
        if member in FAMILIES.get(family.rpartition(".")[2], ()):
            selections[family] = (*selections.get(family, ()), *choice)
    return selections


def _panels(group: ArchiveGroup, choice: SignalSelection) -> Iterator[Panel]:
    """The panels of a choice: for several joints' vectors one a component, for several units one a unit."""
    variable = choice.variable
    joints, components = group.joints(variable), group.components(variable)
    units = variable.units_by_joint or (variable.unit,) * max(1, len(joints))
    width = max(1, len(components))
    several = len({column // width for column in choice.columns}) > 1
    alone = choice.name != variable.name and len(choice.columns) == 1
    gathered: dict[tuple[str, str], list[tuple[str, str, int]]] = {}
    springs = variable.springs if choice.name == variable.name else ()
    for column in sorted(choice.columns, key=lambda column: column % width if several else column):
        joint = joints[column // width] if joints else joint_of(variable.name)
        if joint in springs:
            continue
        component = components[column % width] if components else ""
        name = f"{variable.name}.{component}" if several and component else choice.name
        label = component if component and not several else joint if joints else ""
        line = ("" if alone else label, joint, column)
        gathered.setdefault((name, units[column // width]), []).append(line)
    frame = str(variable.attributes.get("frame", "")) if components else ""  # a joint's own number is about its axis
    about = ", ".join(part for part in (variable.long_name, frame) if part)
    for (name, unit), lines in gathered.items():
        labels, owners, columns = zip(*lines, strict=True)
        yield Panel(name, about, unit, variable.name, labels, columns, owners)


def history(group: ArchiveGroup, panel: Panel, position: int) -> np.ndarray:
    """The panel's lines in the recorded case at this position: (time, line)."""
    values = group.signal(panel.variable, position)
    return values.reshape(len(values), -1)[:, list(panel.columns)] / panel.scale


def pretty_unit(unit: str) -> str:
    """A unit as it is typeset: `N*m*s^2` -> `N·m·s²`."""
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
    """A number in four significant digits, without an exponent where it reads well without: `20100`, `0.0025`."""
    if not math.isfinite(value) or value == 0.0:
        return f"{value + 0.0:g}"
    size = math.floor(math.log10(abs(value)) + 1e-12)
    if not -4 < size < 7:
        return f"{value:.4g}"
    text = f"{value:.{max(0, 3 - size)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def number_texts(values: Iterable[float]) -> list[str]:
    """Numbers as `number_text` writes them, and those that it would write alike in as many digits as tell them
    apart."""
    values = [float(value) for value in values]
    texts = {value: number_text(value) for value in values}
    alike: dict[str, list[float]] = {}
    for number, text in texts.items():
        alike.setdefault(text, []).append(number)
    for those in alike.values():
        digits = 4
        while len({texts[value] for value in those}) < len(those) and digits < 17:
            digits += 1
            texts.update((value, f"{value:.{digits}g}") for value in those)
    return [texts[value] if value in texts else number_text(value) for value in values]


def deck_unit(variable: Stored) -> tuple[float, str]:
    """The divisor of a variable's SI values, and the resulting unit, typeset; "" for a pure number."""
    unit = str(variable.attributes.get("deck_unit", variable.unit))
    return float(variable.attributes.get("deck_scale", 1.0)), "" if unit == "1" else pretty_unit(unit)


def value_text(value: float | str | tuple[float, ...], variable: Stored) -> str:
    """An SI value of a variable as the deck would write it: `20.1 g`, `4.2 %`."""
    scale, unit = deck_unit(variable)
    if isinstance(value, str):
        return value
    text = f"[{', '.join(number_text(v / scale) for v in value)}]" if isinstance(value, tuple) else ""
    return f"{text or number_text(value / scale)} {unit}".rstrip()  # type: ignore[operator]


def case_text(group: ArchiveGroup, position: int, *, varied: bool = True) -> str:
    """A case in a few words: `case #4 8f3ab2c1 · gearbox.kp = 0.02 V·s/rad`."""
    row, case_id = group.values("case")[position], group.values("case_id")[position]
    words = [
        f"{path} = {number_text(value)} {pretty_unit(unit)}".removesuffix(" 1")
        for path, (value, unit) in (group.coordinates_of(position).items() if varied else ())
    ]
    chosen = [f"{v.path} = {group.at(v.name, [position])[0]}" for v in (group.role("choice") if varied else ())]
    repeats = group.values("repeat") if "repeat" in group.variables else np.zeros(0)
    repeat = [f"repeat {int(repeats[position])}"] if repeats.any() else []
    return " · ".join([f"case #{row} {case_id[:8]}", *chosen, *words, *repeat])


MOTION = re.compile(r"initial\.|metrics\.|guides?\.|environment\.|(.*\.)?servo\.command\.")
"""Parameters whose units are those of a motion; lengths of links and torques of friction do not count."""

WRITTEN = re.compile(r"[\d.\])]\s*([A-Za-z%][\w*/^()]*)\s*$")
"""The unit at the end of a value: `30 deg`, `[0, 0, 90] deg`."""


class DeckUnits:
    """The deck's unit for each SI unit: for a signal, that of a requirement on it, else that of most of its values.

    archive     the group's, or the plan that was run (`written_plan`, where a caller has several groups); None where
                that cannot be read
    experiment  what was run, as the plan has it; None where the plan cannot be read here: units are SI then
    """

    def __init__(self, archive: ArchiveFile | Plan | None, group: ArchiveGroup) -> None:
        self.group = group
        plan = written_plan(archive) if isinstance(archive, ArchiveFile) else archive
        experiments = {} if plan is None else {experiment.name: experiment for experiment in plan.experiments}
        self.experiment: Experiment | None = experiments.get(group.name)
        self._votes = _votes(self.experiment, plan) if plan is not None and self.experiment is not None else {}
        self._required = self._of_metrics()

    def panel(self, panel: Panel) -> Panel:
        """The panel in the deck's unit."""
        if panel.unit in ("", "1"):
            return panel
        required = [*self._required.get(panel.name, ()), *self._required.get(panel.variable, ())]
        usual = self._votes.get(panel.unit, ())
        unit = next((deck_unit for deck_unit in (*required, *usual) if _scale(deck_unit, panel.unit)), "")
        scale = _scale(unit, panel.unit)
        return replace(panel, unit=unit, scale=scale, in_si=panel.unit) if scale not in (0.0, 1.0) else panel

    def _of_metrics(self) -> dict[str, list[str]]:
        """For each signal, the units of requirements of it; a joint's speaks for all of its signal."""
        out: dict[str, list[str]] = {}
        if self.experiment is None:
            return out
        named = {metric.name: metric.of for metric in self.experiment.structure.metrics}
        judged = {requirement.metric for requirement in self.experiment.requirements}
        for variable in self.group.role("metric"):
            signal_path = named.get(variable.path, "")
            if signal_path and variable.path in judged:
                for signal in (signal_path, signal_path.rpartition(".")[2]):
                    out.setdefault(signal, []).append(str(variable.attributes.get("deck_unit", variable.unit)))
        return out


def written_plan(archive: ArchiveFile) -> Plan | None:
    """The archive's plan, for display; None where it cannot be read here."""
    try:
        return archive.plan(as_written=True)
    except Problem:
        return None


def _votes(experiment: Experiment, plan: Plan) -> dict[str, tuple[str, ...]]:
    """By SI unit, the units of the deck's values, the most frequent first; zeros do not count."""
    texts = {source.name: source.text.split("\n") for source in plan.sources}
    counts: dict[str, Counter[str]] = {}
    seen: set[tuple[str, Place | None]] = set()
    for path, quantity in experiment.parameters.items():
        place = quantity.origin.place
        if place is None or not MOTION.match(path) or quantity.value == 0.0 or (quantity.unit, place) in seen:
            continue
        seen.add((quantity.unit, place))
        match_ = WRITTEN.search(_text(place, texts))
        if match_:
            counts.setdefault(quantity.unit, Counter())[match_[1]] += 1
    return {unit: tuple(text for text, _ in counter.most_common()) for unit, counter in counts.items()}


def _text(place: Place, texts: Mapping[str, list[str]]) -> str:
    lines = texts.get(place.file, [])
    line = lines[place.line - 1] if 0 < place.line <= len(lines) else ""
    return line[place.column - 1 : place.column - 1 + place.length]


def _scale(unit: str, si: str) -> float:
    """The size of a unit in an SI unit; 0 where they are of different kinds, or one cannot be read."""
    try:
        mine, theirs = parse_unit(unit), parse_unit(si)
    except ValueError:
        return 0.0
    return mine.scale / theirs.scale if mine.dimension == theirs.dimension else 0.0
