"""Commands whose course is a column of a CSV file: its rows become lists of the plan, as if the deck had written
them."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from ic.grammar.syntax import Call, Name, String, Word, place_of
from ic.meaning.control.wraps import warn_of_wraps
from ic.meaning.definitions.csv_files import missing_column
from ic.meaning.definitions.merge import Item, MergedBlock, refuse_block
from ic.meaning.parameters import not_sweepable
from ic.meaning.parameters.models import check_keys, use_model
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from ic.meaning.parameters.tables import TIME, keep_column, named_file
from met.commands.profile import COLUMN, FILE, Profile
from met.diagnostic import Label, Problem, error
from met.models import parameter

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
    """Every parameter of a profile that reads a file, entered in the scope; None where one is missing or wrong.

    name  of the column, unless another is named: that of the joint, or of what `kind` says
    """
    others = [declared for declared in profile.parameters if declared.name not in LISTS]
    check_keys(scope, body, [declared.name for declared in profile.written], owner)
    values = use_model(
        scope,
        owner,
        others,
        MergedBlock({key: item for key, item in body.items.items() if key in [other.name for other in others]}),
    )
    for entry in (FILE.name, COLUMN.name, *LISTS):
        scope.not_sweepable[owner.join(entry)] = not_sweepable.FILE
    columns: dict[str, tuple[float, ...]] | None = None
    file = body.get(FILE.name)
    if file is None:
        scope.complaints.missing(
            owner.place, (FILE.name,), "D075", f"{owner.label} has no `{FILE.name}`", help='write `file = "NAME.csv"`'
        )
    else:
        with scope.complaints.gather():
            columns = _columns(scope, owner, profile, body, file, name, kind)
    if columns is None:
        for entry in LISTS:
            scope.checks.fail(owner.join(entry))
    return None if values is None or columns is None else {**values, **columns}


def _columns(
    scope: Scope, owner: Owner, profile: Profile, body: MergedBlock, file: Item, own: str, kind: str
) -> dict[str, tuple[float, ...]]:
    """The two lists. Raises Problem."""
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
            place_of(item.value) if item.value is not None else item.place,
            help='write `column = "NAME"`',
        )
    )
