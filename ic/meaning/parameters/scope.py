"""One run under resolution: its parameters as they are settled, and what a sweep varies in them.

A parameter is settled once, at one spot, from four sources in this order: a sweep's coordinate that names it, what is
given from outside of the deck, what the deck wrote, the declaration's default. It is named by its canonical path
(`elbow.servo.kp`) and by the path of every definition that hands it down without its being overridden (`gearbox.kp`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

from ic.grammar.syntax import Call, Expression, Name, Setting, String, place_of
from ic.meaning.definitions.merge import Item, no_block, refuse_block
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.expressions.conditions import Checks, VariedPath
from ic.meaning.expressions.cycles import components
from ic.meaning.expressions.names import (
    ON_COMMAND_LINE,
    CommandLineValue,
    Names,
    evaluate_setting,
    is_on_command_line,
    written_origin,
)
from ic.meaning.expressions.quantity import Value, ValueList, no_single_number
from ic.meaning.parameters.owner import COMPILED, COMPILED_ALONE, LIST, WORD, XYZ, NotSweepable, Owner, Settled, several
from ic.meaning.parameters.value_checks import ValueChecks, how_to_write
from ic.text.complaints import Complaints
from met.diagnostic import Label, Place, Problem, did_you_mean, error
from met.parameter import Parameter
from met.plan import Formula, Origin, Quantity
from met.trace import Graph, Real, Scalar
from met.units import PURE

VARIES = "leave it out here, or name runs and sweeps that do not vary this"
"""The remedy where a sweep varies a path that `--set` sets."""


@dataclass
class Scope:
    """The definitions of a deck, and the parameters of one run as they are settled.

    auxiliary       settled values that are no parameters of the plan: what parameters are made of, settings of the run
    known           every path that would set something -> the parameters it sets
    targets         coordinate -> parameters that took their value from it directly
    not_sweepable   known paths that do not vary over numbers -> why
    joint_kinds     servo definition -> kinds of the joints it moves
    failed_servos   joints whose servo failed: nothing can be said of its channels
    failed_parts    joints and links that failed: nothing can be said of paths that begin with them
    guides, sensors the run's guides, by name: what commands may follow; names of its sensors on links
    removed         path of a parameter -> where `remove` took it away
    settings        path -> a number set by the run, or on the command line
    rate_place      where the rate of the dynamics is written; None where it is not, or wrong
    declared_rates  code -> the largest figure that servos and sensors give for themselves, and the cases that have it
    """

    definitions: Definitions
    complaints: Complaints
    varied: dict[str, VariedPath] = field(default_factory=dict)
    graph: Graph = field(default_factory=Graph)
    parameters: dict[str, Settled] = field(default_factory=dict)
    auxiliary: dict[str, Settled] = field(default_factory=dict)
    known: dict[str, list[str]] = field(default_factory=dict)
    targets: dict[str, list[str]] = field(default_factory=dict)
    not_sweepable: dict[str, NotSweepable] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    scales: list[Any] = field(default_factory=list)  # of the first case (ic.meaning.checks.scales.Scale)
    joint_kinds: dict[str, set[str]] = field(default_factory=dict)
    failed_servos: frozenset[str] = frozenset()
    failed_parts: frozenset[str] = frozenset()
    guides: Mapping[str, Item] = field(default_factory=dict)
    sensors: frozenset[str] = frozenset()
    removed: dict[str, Place] = field(default_factory=dict)
    settings: Mapping[str, Setting] = field(default_factory=dict)
    rate_place: Place | None = None
    declared_rates: dict[str, tuple[float, tuple[int, ...]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.checks = Checks(self.complaints, self.graph, self.varied)
        self.names = Names(self.definitions, {path: varied.value for path, varied in self.varied.items()})
        self.value_checks = ValueChecks(self.complaints, self.definitions, self.names, self.checks, self.joint_kinds)
        # the settings that are evaluated so far, by path; None for one that is no number
        self.evaluated_settings: dict[str, CommandLineValue | None] = {}

    def note_rate(self, code: str, figure: float, case: int) -> None:
        """Note a figure of a servo or a sensor for itself, and its case."""
        before, cases = self.declared_rates.get(code, (0.0, ()))
        known = self.checks.case_of(case)
        if known is not None:
            self.declared_rates[code] = (max(before, figure), (*cases, known))

    def settled(self, path: str) -> Settled | None:
        """The settled value of a path, whether or not it is a parameter of the plan."""
        return self.parameters.get(path) or self.auxiliary.get(path)

    def depends_on_failed(self, path: str) -> bool:
        """Return True if this path cannot be judged, since what it depends on has failed (already reported)."""
        first, *rest = self.definitions.split(path)
        thing = (rest or [""])[0] if first in ("links", "payloads") else first
        if self.checks.touches_failed(path) or thing in self.failed_parts:
            return True
        return bool(self.failed_servos) and (first in self.failed_servos or first in self.definitions.of_kind("servo"))

    # Numbers

    def number(
        self,
        owner: Owner,
        wanted: Parameter,
        item: Item | None,
        *,
        expression: Expression | None = None,
        value: Value | None = None,
        record: bool = True,
    ) -> Real | None:
        """The parameter's number; None where there is a mistake (already reported).

        expression, value  what to take in place of the item's expression
        """
        written = value
        if item is not None and value is None:
            with self.complaints.gather():
                written = self._one_number(owner, wanted, item, expression)
        default = wanted.default if isinstance(wanted.default, (int, float)) else None
        return self._settle(owner, wanted, wanted.name, item, written, default, record, expression)

    def vector(
        self,
        owner: Owner,
        wanted: Parameter,
        item: Item | None,
        *,
        names: Sequence[str] = XYZ,
        short: int = 0,
        replacements: Sequence[Real] | None = None,
        record: bool = True,
    ) -> tuple[Real, ...] | None:
        """The parameter's numbers, `names` of them, or the first `short`, the rest zero.

        replacements  numbers made of what the item says, in its stead
        """
        heads = [owner.path] * (wanted.name == owner.short) + [owner.join(wanted.name)]
        for head in heads:
            self.not_sweepable.setdefault(head, several([f"{heads[0]}.{name}" for name in names]))
        values: list[Value | None] = [None] * len(names)
        if item is not None and replacements is None:
            with self.complaints.gather():
                value = self.evaluate(item)
                values = list(self.value_checks.components(owner, wanted, item.name, value, names, short))
            if all(value is None for value in values):
                self.checks.fail(owner.join(wanted.name))
                return None
        elif replacements is not None and item is not None:
            values = [Value(x, PURE, item.value_place) for x in replacements]
        elif wanted.default is None:
            self._missing(owner, wanted)
            return None
        defaults = wanted.default if isinstance(wanted.default, tuple) else (None,) * len(names)
        parts = components(item, len(names)) if replacements is None else (None,) * len(names)
        numbers = [
            self._settle(owner, wanted, f"{wanted.name}.{name}", item, value, default, record, part)
            for name, value, default, part in zip(names, values, defaults, parts, strict=True)
        ]
        return None if any(number is None for number in numbers) else tuple(numbers)  # type: ignore[arg-type]

    def constant(self, owner: Owner, wanted: Parameter, item: Item, *, instead: str = "") -> float | None:
        """A compile-time constant: another value is another program. instead: the remedy where it varies, if it is
        another than varying it itself."""
        path = owner.join(wanted.name)
        for known in owner.paths(wanted.name, item.homes):
            self.not_sweepable[known] = COMPILED
        number = None
        with self.complaints.gather():
            value = self._one_number(owner, wanted, item)
            self.value_checks.dimension(owner, wanted, value)
            if isinstance(value.number, Scalar):
                raise Problem(
                    error(
                        "D122",
                        f"`{wanted.name}` of {owner.label} varies with the sweep",
                        value.place,
                        help=instead or f"it decides the program: vary `{path}` itself",
                    )
                )
            before = self.complaints.error_count
            self.value_checks.range(owner, wanted, value.number, value.place)
            number = float(value.number) if self.complaints.error_count == before else None
            if number is not None:
                self.auxiliary[path] = Settled(
                    number, owner.unit(wanted)[0], self._origin(item, value.place), wanted.doc, item.value
                )
        if number is None:
            self.checks.fail(path)
        return number

    def model_constant(self, owner: Owner, wanted: Parameter, item: Item | None) -> float | None:
        """A model's number that decides the program, the same in all cases."""
        path = owner.join(wanted.name)
        if item is None and isinstance(wanted.default, (int, float)):
            unit = owner.unit(wanted)[0]
            self.auxiliary[path] = Settled(float(wanted.default), unit, Origin("default"), wanted.doc)
        elif item is None:
            self._missing(owner, wanted)
        elif self.constant(owner, wanted, item) is None:
            self.auxiliary.pop(path, None)
        self.not_sweepable[path] = COMPILED_ALONE
        if path not in self.auxiliary:
            return None
        self.parameters[path] = self.auxiliary.pop(path)
        return self.parameters[path].value  # type: ignore[return-value]  # a number, by the two lines above

    def number_list(self, owner: Owner, wanted: Parameter, item: Item | None) -> tuple[float, ...] | None:
        """A list of any length, the same in all cases."""
        path = owner.join(wanted.name)
        self.not_sweepable[path] = LIST
        if item is None and isinstance(wanted.default, tuple):
            self.parameters[path] = Settled(wanted.default, owner.unit(wanted)[0], Origin("default"), wanted.doc)
            return wanted.default
        if item is None:
            self._missing(owner, wanted)
            return None
        numbers: tuple[float, ...] | None = None
        with self.complaints.gather():
            listed = self.evaluate(item)
            if isinstance(listed, Value):
                raise Problem(
                    error(
                        "D071",
                        f"`{wanted.name}` of {owner.label} is a list",
                        listed.place,
                        help=f"write `{wanted.name} = [...] {owner.unit(wanted)[0]};`",
                    )
                )
            floats = []
            for value in listed.items:
                if isinstance(value, ValueList):
                    raise Problem(error("D071", "a list inside a list", value.place))
                self.value_checks.dimension(owner, wanted, value)
                if isinstance(value.number, Scalar):
                    remedy = "a list does not vary: write a run for each, and `sweep NAME = ONE + OTHER;`"
                    raise Problem(
                        error(
                            "D122", f"`{wanted.name}` of {owner.label} varies with the sweep", value.place, help=remedy
                        )
                    )
                self.value_checks.range(owner, wanted, value.number, value.place)
                floats.append(float(value.number))
            numbers = tuple(floats)
            self.parameters[path] = Settled(
                numbers, owner.unit(wanted)[0], self._origin(item, listed.place), wanted.doc, item.value
            )
        if numbers is None:
            self.checks.fail(path)
        return numbers

    def word(self, owner: Owner, wanted: Parameter, item: Item | None, *, record: bool = False) -> str | None:
        """A word, one of `wanted.words` where it has any."""
        path = owner.join(wanted.name)
        self.not_sweepable[path] = WORD
        if item is None:
            if not isinstance(wanted.default, str):
                self._missing(owner, wanted)
                return None
            word, origin = wanted.default, Origin("default")
        else:
            if item.upon is not None and isinstance(item.value, Name):
                self.complaints.add(no_block(item.name, item.upon, item.place))
                self.checks.fail(path)
                return None
            named = item.value.text if isinstance(item.value, Name) else None
            if named is None or (wanted.words and not wanted.names and named not in wanted.words):
                helps = [
                    *(did_you_mean(named, wanted.words) if named else ()),
                    "one of: " + ", ".join(wanted.words) if wanted.words else "write a name, without quotes",
                ]
                message = f"`{wanted.name}` of {owner.label} is a word"
                if isinstance(item.value, String):
                    message += ", without quotes"
                if named:
                    message = f"`{wanted.name}` of {owner.label} cannot be `{named}`"
                self.complaints.error("D076", message, item.value_place, help=helps)
                self.checks.fail(path)
                return None
            word = named
            origin = written_origin(item.value_place, item.overrides)  # a word is not a name for a value
        table = self.parameters if record else self.auxiliary
        table[path] = Settled(word, "", origin, wanted.doc, item.value if item else None)
        return word

    def keep_in_deck(self, path: str, value: str, item: Item) -> None:
        """Keep a setting that only the deck writes, neither a sweep nor `--set`."""
        self.keep_setting(path, value, item=item)
        self.not_sweepable[path] = COMPILED_ALONE

    def keep_setting(
        self, path: str, value: Real | str, unit: str = "", item: Item | None = None, note: str = ""
    ) -> None:
        """Keep a setting that decides the program, for questions about its origin. item: its entry; None: a default."""
        origin = Origin("default", note=note)
        if item is not None:
            origin = written_origin(item.value_place, item.overrides)
        self.auxiliary[path] = Settled(value, unit, origin, "", item.value if item is not None else None)

    def replace_values(self, values: Mapping[str, Real], item: Item) -> None:
        """Replace settled values, each made from the whole item: what varies one, varies all."""
        for path, value in values.items():
            settled = self.parameters[path]
            settled.value = self._plain(value)
            if settled.origin.note == ON_COMMAND_LINE:
                continue
            settled.expression = item.value
            if settled.origin.kind == "deck" and item.value is not None:
                settled.origin = replace(settled.origin, place=place_of(item.value))
        for taken in self.targets.values():
            if any(path in values for path in taken):
                taken += [path for path in values if path not in taken]

    def derived(self, owner: Owner, name: str, value: Real, unit: str, note: str) -> Real:
        """A parameter that follows from others, unless a sweep varies it itself."""
        wanted = _derived_parameter(name, unit, note)
        origin = Origin("derived", owner.place, (), note)
        return self._finish(owner, wanted, name, owner.homes, self._plain(value), origin, owner.place, True)

    def copied(self, owner: Owner, wanted: Parameter, base: str, over: Real | None = None) -> Real | None:
        """A parameter that copies another one, of this path, unless a sweep varies it itself; None where the other
        failed.

        over  a scale: the parameter is then the other's value over it
        """
        other = self.parameters.get(base)
        if other is None or isinstance(other.value, str | tuple) or self.checks.failed(base):
            self.checks.fail(owner.join(wanted.name))
            return None
        paths = owner.paths(wanted.name, owner.homes)
        own = self._coordinate(owner, wanted.name, owner.homes, paths) is not None or bool(self._settings_of(paths))
        origin = replace(other.origin, note="" if own else f"that of `{base}`")
        if over is not None and not own:
            note = f"that of `{base}` over its scale"
            return self._finish(
                owner, wanted, wanted.name, owner.homes, self._plain(other.value / over),
                Origin("derived", other.origin.place, (), note), other.origin.place or owner.place, True, needs=(base,),
            )  # fmt: skip
        value = self._finish(
            owner,
            wanted,
            wanted.name,
            owner.homes,
            other.value,
            origin,
            origin.place or owner.place,
            True,
            other.expression,
            needs=(base,),
            paths=paths,
        )
        for taken in self.targets.values():
            if not own and base in taken:
                taken.append(owner.join(wanted.name))
        return value

    def keep_derived(self, path: str, value: Real, unit: str, item: Item, note: str) -> None:
        """Keep a parameter that an item computes from its own numbers, which vary in its place."""
        origin = Origin("derived", item.value_place, item.overrides, note)
        self.parameters[path] = Settled(self._plain(value), unit, origin, note)

    def evaluate(self, item: Item, expression: Expression | None = None) -> Value | ValueList:
        """The value of the item's expression, lists with what `+=` appended. Raises Problem."""
        expression = item.value if expression is None else expression
        refuse_block(item)
        if expression is None or (item.body is not None and not isinstance(expression, Call)):
            raise Problem(no_block(item.name, item.place))
        if isinstance(expression, Call) and item.body is not None:
            expression = replace(expression, body=())  # with names, which no function takes
        evaluated = self.names.evaluate(expression)
        if not item.appended:
            return evaluated
        if isinstance(evaluated, Value):
            raise Problem(
                error(
                    "D056",
                    f"`{item.name}` is one number, and `+=` appends to a list",
                    place_of(item.appended[0]),
                    help=f"write `{item.name} = ...;`",
                )
            )
        items = list(evaluated.items)
        for more in item.appended:
            value = self.names.evaluate(more)
            items.extend(value.items if isinstance(value, ValueList) else (value,))
        return ValueList(tuple(items), evaluated.place, evaluated.unit)

    def _one_number(self, owner: Owner, wanted: Parameter, item: Item, expression: Expression | None = None) -> Value:
        """The value of the item's expression. Raises Problem, D071 where it is a list."""
        value = self.evaluate(item, expression)
        if isinstance(value, ValueList):
            raise no_single_number(f"`{wanted.name}` of {owner.label}", value)
        return value

    def _missing(self, owner: Owner, wanted: Parameter) -> None:
        """Report a parameter that has neither value nor default (D075), unless that is known already."""
        self.checks.fail(owner.join(wanted.name))
        servos = self.definitions.of_kind("servo")
        bases = [servos[home].place for home in owner.homes if home in servos]
        removed = self.removed.get(owner.join(wanted.name))
        lacks = removed or owner.place
        if any(self.complaints.is_known_to_lack(place, wanted.name) for place in (lacks, *bases)):
            return  # already reported: in another use, or in a base, or another word was taken for it
        also = [Label(owner.place, f"{owner.label} stands here")] if removed is not None else []
        place = Label(removed, "removed here") if removed is not None else owner.place
        self.complaints.lack(
            lacks,
            wanted.name,
            "D075",
            f"{owner.label} has no `{wanted.name}`",
            place,
            also=also,
            help=how_to_write(owner, wanted),
        )

    def _settle(
        self,
        owner: Owner,
        wanted: Parameter,
        name: str,
        item: Item | None,
        written: Value | None,
        default: float | None,
        record: bool,
        part: Expression | None = None,
    ) -> Real | None:
        """Settle one number: written, varied, set or default. part: the expression's part that says it; None: all."""
        homes = owner.homes if item is None else item.homes
        place = owner.place if item is None else item.place
        value: Real | None = None
        origin = Origin("default")
        if item is None:
            value = default
        elif written is not None:
            place = written.place
            with self.complaints.gather():
                self.value_checks.dimension(owner.as_written_in(homes), wanted, written)
                value = self._plain(written.number)
            origin = self._origin(item, place)
        paths = owner.paths(name, homes)
        coordinate = self._coordinate(owner, name, homes, paths)
        if value is None and (item is not None or coordinate is None) and not self._settings_of(paths):
            if item is None:
                self._missing(owner, wanted)
            for path in (owner.join(name), *(owner.join_local(home, name) for home in homes)):
                self.checks.fail(path)
            return None
        expression = part if part is not None else item.value if item is not None else None
        return self._finish(owner, wanted, name, homes, value, origin, place, record, expression, paths=paths)

    def _finish(
        self,
        owner: Owner,
        wanted: Parameter,
        name: str,
        homes: tuple[str, ...],
        value: Real | None,
        origin: Origin,
        place: Place,
        record: bool,
        expression: Expression | None = None,
        needs: tuple[str, ...] = (),
        paths: tuple[str, ...] | None = None,
    ) -> Real:
        """Enter a settled number under its paths (`Owner.paths`, unless they are given), with the settings that replace
        it."""
        path = owner.join(name)
        paths = owner.paths(name, homes) if paths is None else paths
        for known in paths:
            self.known.setdefault(known, []).append(path)
        for number, setting in enumerate(self._settings_of(paths)):  # those of the run first
            if origin.note == ON_COMMAND_LINE if is_on_command_line(setting.value.place) else number > 0:
                self.complaints.error(
                    "D232",
                    f"this sets `{path}`, which is set already",
                    setting.value.place,
                    also=[Label(origin.place, "here")] if origin.place is not None else [],
                    help="leave one of the two out",
                )
            self.targets.setdefault(setting.path, []).append(path)
            value, expression, place = self._plain(setting.value.number), setting.expression, setting.value.place
            self._check_instead(owner, wanted, setting.value, path)
            origin = setting.overriding(origin)
        coordinate = self._coordinate(owner, name, homes, paths)
        if coordinate is not None:
            if origin.note == ON_COMMAND_LINE and not is_on_command_line(coordinate.place):
                self.complaints.error(
                    "D233",
                    f"this sets `{path}`, which the sweep varies",
                    origin.place,
                    also=[Label(coordinate.place, f"`{coordinate.path}` varies here")],
                    help=VARIES,
                )
            places = (origin.place,) if origin.place is not None else ()
            origin = Origin("case", coordinate.place, (*places, *origin.overrides), origin.note)
            place = coordinate.place
            self.targets.setdefault(coordinate.path, []).append(path)
            value = coordinate.value.number
            self._check_instead(owner, wanted, coordinate.value, coordinate.path)
        assert value is not None
        endless = not isinstance(value, Scalar) and math.isinf(value)
        if origin.kind != "default" or not endless:  # a model's own default may be: never
            self.value_checks.range(owner, wanted, value, place, path, needs)
        table = self.parameters if record and not (wanted.timing and origin.kind == "default") else self.auxiliary
        if record or owner.called is None:
            table[path] = Settled(value, owner.unit(wanted)[0], origin, wanted.doc, expression)
        return value

    def _check_instead(self, owner: Owner, wanted: Parameter, value: Value, path: str) -> None:
        """Report a value of the wrong dimension that replaces the deck's; path: the path that has then failed"""
        try:
            self.value_checks.dimension(owner, wanted, value)
        except Problem as problem:
            self.complaints.add(*problem.diagnostics)
            self.checks.fail(path)

    def _settings_of(self, paths: Iterable[str]) -> list[CommandLineValue]:
        """The numbers that the run and `--set` give for a parameter with these paths; several where several are set."""
        own_paths = [path for path in paths if path in self.settings] if self.settings else []
        own_paths.sort(key=lambda path: is_on_command_line(self.settings[path].place))
        for path in own_paths:
            if path not in self.evaluated_settings:
                self.evaluated_settings[path] = None
                with self.complaints.gather():
                    self.evaluated_settings[path] = evaluate_setting(self.settings[path], path, self.names)
        return [setting for path in own_paths if (setting := self.evaluated_settings[path]) is not None]

    def _coordinate(self, owner: Owner, name: str, homes: tuple[str, ...], paths: tuple[str, ...]) -> VariedPath | None:
        """The coordinate that varies a parameter; paths: all of it."""
        if not self.varied:
            return None
        coordinates = [varied for path, varied in self.varied.items() if path in paths]
        for other in coordinates[1:]:
            self.targets.setdefault(other.path, [])
            self.complaints.error(
                "D123",
                f"`{coordinates[0].path}` and `{other.path}` both set `{owner.join(name)}`",
                other.place,
                also=[Label(coordinates[0].place, "the first")],
                help=["vary one of them, or different joints", *self._own(owner, name, homes, (coordinates[0], other))],
            )
        return coordinates[0] if coordinates else None

    def _own(self, owner: Owner, name: str, homes: tuple[str, ...], both: tuple[VariedPath, ...]) -> list[str]:
        """The remedy for two coordinates that belong to a servo's definition and to its base; none otherwise."""
        by_path = {owner.join_local(home, name): home for home in homes}
        named = [home for path, home in by_path.items() if path in (both[0].path, both[1].path)]
        return [f"or give `{named[1]}` its own `{name}`, which `{named[0]}` does not reach"] if len(named) > 1 else []

    def _plain(self, number: Real) -> Real:
        """A recorded number as a plain one, if it is constant."""
        if isinstance(number, Scalar):
            known = self.graph.value(number.ref)
            return number if known is None else known
        return float(number)

    def quantities(self, *, auxiliary: bool = False) -> tuple[dict[str, Any], list[Scalar]]:
        """The parameters in a plan's form, and the scalars of its formulas, in order. auxiliary: including auxiliary
        ones"""

        outputs: list[Scalar] = []
        quantities = {}
        for path, settled in {**self.parameters, **(self.auxiliary if auxiliary else {})}.items():
            value: Any = settled.value
            if isinstance(value, Scalar):
                outputs.append(value)
                value = Formula(len(outputs) - 1)
            quantities[path] = Quantity(value, settled.unit, settled.origin)
        return quantities, outputs

    def _origin(self, item: Item, place: Place) -> Origin:
        """The origin of an item's value; for a cell of a table with its line and column in the file."""
        name = self.definitions.in_full(item.value) if isinstance(item.value, Name) else None
        note = f"from `{name.text}`" if name is not None else self.definitions.robot_files.note_at(place)
        cells = self.names.cells.get(name.text, ()) if name is not None else ()
        cell_place = f" ({cells[0].place})" if len(cells) == 1 else ""
        return written_origin(place, item.overrides, note + cell_place)


@lru_cache(maxsize=1024)
def _derived_parameter(name: str, unit: str, doc: str) -> Parameter:
    """The declaration of a derived parameter: for a hundred links they are the same."""
    return Parameter(name=name, unit=unit, doc=doc)
