"""Values and courses in time, where a deck allows either; commands whose course is a column of a CSV file.

Angles that a log has wrapped, 3.1 rad and then -3.1 rad, are warned of. A command follows its rows as they are, so it
asks a joint to turn back by almost a turn in one row. A wrap is told from a real motion by what surrounds it: with a
turn added the rows go on as fast as they went before, and without it the row is far faster than all others.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np

from ic.grammar.syntax import Call, Expression, Name, String, Word, place_of
from ic.meaning.definitions.csv_files import missing_column
from ic.meaning.definitions.merge import Item, MergedBlock, open_call, refuse_block
from ic.meaning.expressions.cycles import components
from ic.meaning.parameters.models import (
    TIME,
    check_keys,
    find_model,
    keep_column,
    named_file,
    refuse_values,
    use_columns,
    use_model,
    word_of,
)
from ic.meaning.parameters.owner import Owner, a_model
from ic.meaning.parameters.scope import Scope
from met import models
from met.commands.profile import COLUMN, FILE, Profile
from met.diagnostic import Label, Place, Problem, error
from met.instants import ROUNDING
from met.models import parameter
from met.plan.defaults import component

LISTS = ("times", "values")
FEWEST = 2  # rows: a curve goes from one to the next


def with_file_named(call: Call) -> Call:
    """The call with its file named: `trajectory("moves.csv")` is short for `trajectory(file = "moves.csv")`, and a name
    is a file without its quotes."""
    if len(call.positional) != 1 or not isinstance(call.positional[0], String | Name):
        return call
    named = call.positional[0]
    return replace(call, positional=(), named=((Word(FILE.name, named.place), named), *call.named))


def use_file(
    scope: Scope, owner: Owner, profile: Profile, body: MergedBlock, name: str, kind: str = "joint"
) -> dict[str, Any] | None:
    """The values of a command's profile that follows a column of a CSV file, by parameter, also entered in the scope;
    None where one is missing or wrong, which is reported.

    name  of the column where the deck names none: the name of the joint, or of another thing, of this `kind` in words
    """
    check_keys(scope, body, [declared.name for declared in profile.written], owner)
    of_file = (FILE.name, COLUMN.name)
    return use_columns(
        scope,
        owner,
        profile.parameters,
        LISTS,
        of_file,
        body,
        lambda: _columns(scope, owner, profile, body, name, kind),
    )


def _columns(
    scope: Scope, owner: Owner, profile: Profile, body: MergedBlock, own: str, kind: str
) -> dict[str, tuple[float, ...]] | None:
    """The lists of times and values of a trajectory, from the columns of its CSV file, in SI; None where it names none
    (reported). kind, own: the word and the name by which a column is looked for where none is named. Raises Problem."""
    file = body.get(FILE.name)
    if file is None:
        scope.complaints.missing(
            owner.place, (FILE.name,), "D075", f"{owner.label} has no `{FILE.name}`", help='write `file = "NAME.csv"`'
        )
        return None
    named = named_file(owner, file)
    wanted, place = _column_name(owner, body.get(COLUMN.name), own), named.place
    if body.get(COLUMN.name) is not None:
        place = place_of(body.items[COLUMN.name].value or named)
    table = scope.definitions.csv_files.get(named)
    label_of_file = Label(
        named.place, "read here"
    )  # the same for all joints, so that the file's own faults are reported once
    columns = {}
    angle = None
    for name, column_name, where in zip(LISTS, (TIME, wanted), (named.place, place), strict=True):
        declared = parameter(profile, name)
        column = table.column(column_name)
        assert declared is not None  # by the declaration of `from_file`
        if column is None:
            why = "the times of the rows stand in a column `time [s]`" if column_name == TIME else ""
            if where is named.place and not why:
                why = f'that of the {kind}\'s name is taken, unless `column = "NAME"` names another'
            raise missing_column(table, column_name, where, why)
        label = label_of_file if column_name == TIME else Label(named.place, f"read here for {kind} `{own}`")
        columns[name] = keep_column(scope, owner, declared, table, column, label)
        if owner.unit(declared)[0] == "rad":
            angle = column
    if len(table.rows) < FEWEST:
        raise Problem(
            error(
                "D196",
                f"`{table.file}` has {len(table.rows) or 'no'} row{'s' if not table.rows else ''}",
                table.columns[0].place,
                also=[label_of_file],
                help=f"a trajectory has {FEWEST} at least; `table` takes a single point",
            )
        )
    if angle is not None:
        cell, (times, angles) = partial(table.cell, angle), columns.values()
        warn_of_wraps(scope, f"column `{angle.name}`", times, angles, lambda n: cell(n).place)
    scope.keep_setting(owner.join(FILE.name), table.file, item=file)
    scope.keep_setting(owner.join(COLUMN.name), wanted, item=body.get(COLUMN.name), note=f"the {kind}'s name")
    return columns


def _column_name(owner: Owner, item: Item | None, joint: str) -> str:
    """The name of a joint's column in a file: the written one, else the joint's. Raises Problem D076."""
    if item is None:
        return joint
    refuse_block(item)
    if isinstance(item.value, String):
        return item.value.value
    if isinstance(item.value, Name) and len(item.value.path) == 1:
        return item.value.text
    raise Problem(
        error(
            "D076",
            f"`column` of {owner.label} is the name of a column, in quotes",
            item.value_place,
            help='write `column = "NAME"`',
        )
    )


TURN = 2.0 * math.pi
_LEAST = 0.75 * TURN  # a smaller jump is not that of a log whose rows are dense enough for its motion
_SLACK = 0.01  # rad by which rounding may take a wrapped log beyond one turn
_FEWEST = 2  # other rows that say how fast the joint is
_FASTER = 4.0  # times the fastest other row: a jump of less may be a motion
_GOES_ON = 2.0  # times the fastest other row: with a turn added, a wrapped row is no faster
_LONGER = 2.0  # times the usual time between rows: a longer one is a move between points, not a row of a log


def wrapped_rows(times: Sequence[float], values: Sequence[float]) -> list[int]:
    """The rows of a column, in rad, before which a log has wrapped the angle; empty where that is not plain."""
    steps = [
        (after - before, late - early) for (early, before), (late, after) in pairwise(zip(times, values, strict=True))
    ]
    others = [abs(step / time) for step, time in steps if abs(step) <= _LEAST]
    if (
        not max(_FEWEST, len(steps) - len(others)) <= len(others) < len(steps)
        or max(values) - min(values) > TURN + _SLACK
    ):
        return []
    from statistics import median  # imported here, since it takes 3 ms, and few commands come as rows

    fastest, usual = max(others), median(time for _, time in steps)

    def is_wrap(step: float, time: float) -> bool:
        rest = TURN - abs(step)
        fast = abs(step) >= _FASTER * fastest * time and abs(rest) <= _GOES_ON * fastest * time
        return abs(step) > _LEAST and fast and time <= _LONGER * usual

    return [n for n, (step, time) in enumerate(steps, 1) if is_wrap(step, time)]


def warn_of_wraps(
    scope: Scope, what: str, times: Sequence[float], values: Sequence[float], place: Callable[[int], Place]
) -> None:
    """Warn where an angle over time is wrapped. what: the angle, in words; place: of the value in a row, from 0"""
    rows = wrapped_rows(times, values)
    if not rows:
        return
    n = rows[0]
    step, time = values[n] - values[n - 1], times[n] - times[n - 1]
    more = f", and so in {len(rows) - 1:,} more row{'s' * (len(rows) > 2)}" * (len(rows) > 1)
    scope.complaints.remark(
        "D387",
        f"{what} jumps by {step:.4g} rad from one row to the next, almost a turn{more}: such is a log whose angle is "
        "wrapped",
        Label(place(n), f"it is followed as a motion of {abs(step / time):.3g} rad/s"),
        also=[Label(place(n - 1), "the row before")],
        help=[
            f"{'add' if step < 0.0 else 'subtract'} a turn, 360 deg, {'to' if step < 0.0 else 'from'} this row and all "
            "after it",
            "`numpy.unwrap` does that for a column in rad; for one in deg with `period=360`",
            'if it is meant so, `allow D387 because "...";`',
        ],
    )


def use_course(
    scope: Scope,
    spot: Owner,
    inner: Expression,
    item: Item,
    *,
    doc: str,
    column: str,
    kind: str = "joint",
    body: MergedBlock | None = None,
) -> str | None:
    """Enter a value, or a course (a value as a function of time, of a command's model), in the scope under the path of
    `spot`. Returns its model's name, "constant" for a value; None where it has a mistake.

    item    the entry that says it, whose expression is, or holds, `inner`;  body: what of the course is written apart
    doc     what a value means;  column: of a CSV file, unless one is named: the name of the joint, or what `kind` says
    """
    name = word_of(inner) if isinstance(inner, Call) else None
    if name is None or name in ("sqrt", "sin", "cos", "min", "max"):
        constant = models.find_own("command")["constant"]
        (value,) = constant.parameters
        scope.number(spot, replace(value, doc=doc), item, expression=inner)
        return "constant"
    assert isinstance(inner, Call)
    profile = find_model(scope, "command", name, inner.name.place)
    if profile is None:
        return None
    inner = with_file_named(inner) if profile.from_file else inner
    if refuse_values(scope, inner, [p.name for p in profile.written]):
        return None
    _, named = open_call(inner, None, scope.complaints)
    inside = {
        key: replace(part, homes=item.homes, overrides=item.overrides)
        for key, part in (named or MergedBlock()).items.items()
    }
    apart = body or MergedBlock()
    opened = replace(
        apart,
        items=inside | dict(apart.items),
        statements=(*(named or MergedBlock()).statements, *apart.statements),
        pending=(*(named or MergedBlock()).pending, *apart.pending),
    )
    course = replace(spot, label=f"`{name}`", called=None, place=inner.name.place, call=True)
    if profile.from_file:
        use_file(scope, course, profile, opened, column, kind)
        return profile.name
    values = use_model(scope, course, profile.parameters, opened)
    if values is not None and profile.shortest is not None:
        _check_room(scope, course, profile, values, opened)
    if values is not None and {"times", "values"} <= values.keys():
        _check_wraps(scope, course, profile, values, opened)
    return profile.name


def _check_wraps(scope: Scope, owner: Owner, profile: Profile, values: Mapping[str, Any], body: MergedBlock) -> None:
    """Warn where angles that a deck lists over time are those of a wrapped log."""
    declared = next(parameter for parameter in profile.parameters if parameter.name == "values")
    times, angles = values["times"], values["values"]
    if owner.unit(declared)[0] == "rad" and len(times) == len(angles):
        written = components(body.get("values"), len(angles))

        def place(n: int) -> Place:
            expression = written[n]
            return owner.place if expression is None else place_of(expression)

        warn_of_wraps(scope, f"`values` of {owner.label}", times, angles, place)


def _check_room(scope: Scope, owner: Owner, profile: Profile, values: Mapping[str, Any], body: MergedBlock) -> None:
    """Check that the duration `over` of a course in time is long enough for all its parts, in every case."""
    assert profile.shortest is not None
    path, item = owner.join("over"), body.get("over")
    try:
        least = profile.shortest(SimpleNamespace(**values))
    except ZeroDivisionError:  # a number that is out of its range, which is reported
        return

    def test(times: np.ndarray) -> tuple[np.ndarray, list[str]]:
        bad = ~(times[:, 0] >= times[:, 1] * (1.0 - ROUNDING))
        return bad, [f"this is {over:.9g} s, and {needed:.9g} s are needed" for over, needed in times[bad][:1]]

    scope.checks.require(
        (values["over"], least),
        test,
        code="D384",
        message=f"`over` of {owner.label} is too short for the way up and down",
        place=place_of(item.value) if item is not None and item.value is not None else owner.place,
        help="write a longer one, or a larger `slope`",
        path=path,
        needs=tuple(owner.join(name) for name in values),
    )


def course_named(scope: Scope, inner: Expression) -> Expression:
    """The call of a command's model that is named without parameters, `file`; other expressions as they are."""
    if isinstance(inner, Name) and inner.text in models.available("command") and not scope.names.is_value(inner):
        return Call(inner, (), (), None, inner.place)
    return inner


def use_component(scope: Scope, item: Item, label: str, path: str, doc: str, kind: str) -> str | None:
    """The command's model that moves one component of a motion in time (of a guide's path, or of a prescribed base),
    its parameters entered in the scope; None where it has a mistake, which is reported.

    label  of the component, in words;  path: of its parameters;  doc: what its value means;  kind: as `use_course`
    """
    assert item.value is not None
    owner = Owner(
        label, item.place, path, homes=item.homes, joint=component(item.name).kind, command="position", called=label
    )
    inner = course_named(scope, item.value)
    model = use_course(scope, owner, inner, item, doc=doc, column=item.name, kind=kind, body=item.body)
    if model is not None:
        scope.keep_in_deck(f"{path}.model", model, item)
        scope.not_sweepable[path] = a_model("a course in time", path)
    return model
