"""Checks of a value against its parameter: its dimension, its range, and units that may mean something else."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ic.language.unit_words import after_number, either, in_degrees, measure_here, unit_here
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.expressions.conditions import Checks
from ic.meaning.expressions.cycles import ambiguous_unit, unit_remedy
from ic.meaning.expressions.names import Names
from ic.meaning.expressions.quantity import Value, ValueList
from ic.meaning.parameters.owner import Owner
from ic.text.complaints import Complaints
from met import models, units
from met.diagnostic import Help, Place, Problem, TextChange, error, write, write_either
from met.parameter import Parameter
from met.plan import JointKind
from met.trace import Real, Scalar
from met.unit_parser import parse_unit, written
from met.units import PURE


def how_to_write(owner: Owner, wanted: Parameter) -> list[str]:
    """The help where a parameter is missing."""
    unit = owner.unit(wanted)[0]
    example = {"number": "...", "vector": "[...]", "list": "[...]", "word": "WORD"}[wanted.shape]
    example = example if unit == "1" or wanted.shape == "word" else f"{example} {unit}"
    doc = f" ({wanted.doc})" if wanted.doc != wanted.name else ""
    return [f"write `{wanted.name} = {example}{'' if owner.call else ';'}`{doc}", *of_a_rate(owner)]


def of_a_rate(owner: Owner) -> list[str]:
    """The remedies for a trajectory under a `rate` command that may be meant as positions."""
    course = models.find_own("command").get(owner.label.strip("`")) if owner.call and owner.command == "rate" else None
    return [course.of_a_rate] if course is not None and course.of_a_rate else []


@dataclass
class ValueChecks:
    """The checks of each single value of a run.

    joint_kinds  servo definition -> kinds of joints that it moves; filled in while servos are resolved
    """

    complaints: Complaints
    definitions: Definitions
    names: Names
    checks: Checks
    joint_kinds: Mapping[str, set[str]]

    def dimension(self, owner: Owner, wanted: Parameter, value: Value) -> None:
        """Raise D060 for a bare number where a dimension is needed, D061 for a wrong one."""
        text, dimension = owner.unit(wanted)
        if units.same(value.dimension, dimension):
            self._remark_cycles(owner, wanted, value, text)
            self._remark_share(owner, wanted, value)
            return
        what = owner.what(wanted)
        also = self.names.label(value)
        apart: str | list[str] = self._of_its_own(owner, wanted, value, text)
        if value.dimension == PURE:
            wrote: Help | str = f"write a number in {text}"
            if not isinstance(value.number, Scalar):
                written = units.ONE.decimal(value.number)
                stands = (iteration.macro for iteration in value.place.iterations if iteration.iteration == written)
                index = next((macro for macro in stands if macro == self.definitions.text_at(value.place)), written)
                wrote = write_either((f"{index} {degrees}" for degrees in in_degrees(text)), where="value")
            read = [value.place, *(label.place for label in self.names.label_of_cell(value.number, value.place))]
            files = {source.name for source in self.definitions.csv_files.sources} if value.bare else set()
            if any(place.file in files for place in read):
                wrote = f"write the unit in square brackets behind the column's name: `[{text}]`"
            raise Problem(
                error(
                    "D060",
                    f"{what} is in {text}, and this is a {'bare' if value.bare else 'pure'} number",
                    value.place,
                    also=also,
                    help=apart or (wrote if value.bare else f"a unit is missing on the way here: {text}"),
                )
            )
        unit_text = units.text(value.dimension)
        apart = apart or self._of_another_command(owner, wanted, value, text)
        message = (
            f"{what} is " + ("a pure number" if dimension == PURE else f"in {text}") + f", and this is in {unit_text}"
        )
        other = self._other(owner, wanted, value) if dimension == PURE else []
        raise Problem(
            error("D061", message, value.place, also=also, help=apart or [*other, unit_remedy(value, text, dimension)])
        )

    def components(
        self,
        owner: Owner,
        wanted: Parameter,
        key: str,
        listed: Value | ValueList,
        names: Sequence[str],
        short: int,
    ) -> Iterable[Value]:
        """The numbers of a list, one for each name; zeros behind the first `short` where there are only these.

        key  what the deck calls the list.  Raises Problem where it is no list of so many numbers.
        """
        count = len(names)
        text, dimension = owner.unit(wanted)
        expected = f"{short} or {count}" if short else f"{count}"
        if isinstance(listed, Value):
            raise Problem(
                error(
                    "D071",
                    f"{owner.what(wanted)} is a list of {expected} numbers",
                    listed.place,
                    help=f"write `{key} = [...]{after_number(text)};`",
                )
            )
        if len(listed.items) not in (short, count):
            components = ", ".join(names)
            raise Problem(
                error(
                    "D071",
                    f"{owner.what(wanted)} has {expected} numbers, not {len(listed.items)}",
                    listed.place,
                    help=f"they are [{components}]",
                )
            )
        numbers = []
        for value in listed.items:
            if isinstance(value, ValueList):
                raise Problem(error("D071", "a list inside a list", value.place))
            numbers.append(value)
        if dimension != PURE and len(numbers) > 1 and all(value.bare for value in numbers):
            raise Problem(
                error(
                    "D060",
                    f"{owner.what(wanted)} is in {text}, and these are bare numbers",
                    listed.place,
                    help=_one_unit_for_all(in_degrees(text)),
                )
            )
        dimensions = {value.dimension for value in numbers}
        if listed.unit is not None and len(dimensions) == 1:  # one unit for all: where it is wrong, it is so once
            self.dimension(owner, wanted, replace(numbers[0], place=listed.place))
        numbers += [Value(0.0, dimension, listed.place)] * (count - len(numbers))
        return numbers

    def range(
        self, owner: Owner, wanted: Parameter, value: Real, place: Place, path: str = "", needs: tuple[str, ...] = ()
    ) -> None:
        """Report a number out of the parameter's range, now or once the cases of a sweep are known.

        path  of the parameter;  needs  paths whose own checks must hold for this one to say anything
        """
        bounds = [
            (bound, word, sign)
            for bound, word, sign in (
                (wanted.above, "above", np.greater),
                (wanted.at_least, "at least", np.greater_equal),
                (wanted.below, "below", np.less),
                (wanted.at_most, "at most", np.less_equal),
            )
            if bound is not None
        ]
        if (
            isinstance(value, float)
            and math.isfinite(value)
            and (not wanted.whole or value.is_integer())
            and all(holds(value, bound) for bound, _, holds in bounds)
        ):
            return
        text = owner.unit(wanted)[0]
        unit = after_number(text)

        def test(values: np.ndarray) -> tuple[np.ndarray, list[str]]:
            """True of each case in which the number is out of its bounds, with words about the first. values: [case,
            1]"""
            bad = ~np.isfinite(values[:, 0])
            for bound, _, holds in bounds:
                bad |= ~holds(values[:, 0], bound)
            if wanted.whole:
                bad |= values[:, 0] != np.rint(values[:, 0])
            return bad, [f"this is {x:g}{unit}" for x in values[bad, 0][:1]]

        limits = " and ".join(f"{word} {bound:g}" for bound, word, _ in bounds) or "finite"
        preposition = "of " if limits.startswith("at ") else ""
        remedy = f"write a number {preposition}{limits}{unit}" if bounds else "write a finite number"
        if wanted.whole:
            limits, remedy = f"whole and {limits}", remedy.replace("a number", "a whole number")
        limits += unit if bounds else ""
        helps: tuple[str, ...] = (remedy + (f" ({wanted.doc})" if wanted.doc else ""),)
        if wanted.if_negative and isinstance(value, float) and value < 0.0:
            new = written(-value, text)
            helps = (write(new, f"write its magnitude, `{new}`: {wanted.if_negative}", where="value"),)
        self.checks.require(
            (value,),
            test,
            code="D077",
            message=f"{owner.what(wanted)} must be {limits}",
            place=place,
            path=path,
            needs=needs,
            help=helps,
            also=self.names.label_of_cell(value, place),
        )

    def _of_another_command(self, owner: Owner, wanted: Parameter, value: Value, text: str) -> list[str]:
        """The remedies where a command, or a parameter of its trajectory, has the unit of another kind of command."""
        if owner.command is None:
            return []
        fits = [
            kind
            for kind in ("position", "rate", "acceleration")
            if kind != owner.command
            and units.same(value.dimension, unit_here(wanted.unit, owner.joint, kind, owner.of)[1])
        ]
        unit_text = units.text(value.dimension)
        if not owner.label.startswith("`"):  # no course: the command is this number
            return [f"`{owner.command}(...)` takes {text}; `{kind}(...)` takes {unit_text}" for kind in fits]
        course = owner.label.strip("`")
        return [
            f"of a `{owner.command}` command it is in {text}; with `{kind}({course}(...))` it would be in "
            f"{unit_text}, like all of that course"
            for kind in fits
        ] + of_a_rate(owner) * bool(fits)

    def _remark_cycles(self, owner: Owner, wanted: Parameter, value: Value, text: str) -> None:
        """Report a unit that may mean cycles in place of radians, or the reverse."""
        if wanted.ticks:
            return
        ambiguity = ambiguous_unit(value, text, measure_here(wanted.unit, owner.joint, owner.command, owner.of))
        if ambiguity is not None:
            self.complaints.warn(
                "D305",
                f"{owner.what(wanted)} is {ambiguity.taken}",
                value.place,
                also=self.names.label(value),
                help=ambiguity.helps,
            )

    def _remark_share(self, owner: Owner, wanted: Parameter, value: Value) -> None:
        """Report a bare number above 1 in place of a share, which may have been meant in per cent."""
        if not wanted.share or not value.bare:
            return
        number = value.number
        if isinstance(number, Scalar):
            values = (varied.values for varied in self.checks.varied.values() if varied.value.number is value.number)
            number = max(next(values, np.zeros(1)).tolist(), key=abs, default=0.0)
        if abs(number) <= 1.0:
            return
        bare, per_cent = units.ONE.decimal(number), f"{parse_unit('%').decimal(number)} %"
        helps: list[str] = [
            write(f"{bare} %", f"if per cent are meant, write `{bare} %`", where="value"),
        ]
        if all(bound is None or abs(number) < bound for bound in (wanted.below, wanted.at_most)):
            helps.append(write(per_cent, f"if that is meant, write `{per_cent}`", where="value"))
        if isinstance(value.number, Scalar):
            helps = [
                "if per cent are meant, write `%` behind the values",
                f"if that is meant, write the values in per cent, such as `{per_cent}`",
            ]
        self.complaints.warn(
            "D307", f"{owner.what(wanted)} is a share, and {bare} is {per_cent}", value.place, help=helps
        )

    def _other(self, owner: Owner, wanted: Parameter, value: Value) -> list[str]:
        """The one optional parameter of the model for which a number with this unit may be meant."""
        fitting = [
            other
            for other in owner.others
            if other.shape == "number"
            and other.default is not None
            and other.name != wanted.name
            and units.same(value.dimension, owner.unit(other)[1])
        ]
        if len(fitting) != 1:
            return []
        return [f"`{fitting[0].name}` is what is in {owner.unit(fitting[0])[0]}: {fitting[0].doc}"]

    def _of_its_own(self, owner: Owner, wanted: Parameter, value: Value, text: str) -> str:
        """The remedy where a value fits the other joints of its servo definition, which move differently."""
        other: JointKind = "revolute" if owner.joint == "prismatic" else "prismatic"
        both = [home for home in owner.homes if other in self.joint_kinds.get(home, ())]
        if not both or not units.same(value.dimension, unit_here(wanted.unit, other, owner.command, owner.of)[1]):
            return ""
        joint = owner.path.partition(".servo")[0]
        key = wanted.name if owner.command is None else "command"
        example = f"{value.number:g}" if value.bare and not isinstance(value.number, Scalar) else "..."
        example += after_number(text)
        written = f"{key} = {example};" if owner.command is None else f"{key} = {owner.command}(...);"
        moves, others = ("slides", "turn") if owner.joint == "prismatic" else ("turns", "slide")
        why = f"joint `{joint}` {moves}, and others of servo `{both[-1]}` {others}"
        if owner.homes[-1] != both[-1]:
            return f"{why}: write `{written}` in servo `{owner.homes[-1]}`"
        return f"{why}: give its servo a {key} of its own, `{joint} = {both[-1]} {{ {written} }}`"


def _one_unit_for_all(written: Iterable[str]) -> Help:
    """The help for a list of bare numbers that needs a unit after its bracket."""
    examples = either(f"[...] {unit}" for unit in written)
    changes = (TextChange(f" {unit}", where="behind") for unit in written)
    return Help(f"write {examples}: a unit after the bracket is for all of them", *changes)
