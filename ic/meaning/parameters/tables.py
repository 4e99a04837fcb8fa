"""Environment models whose lists are columns of a CSV file: its rows become lists of the plan, as if the deck had
them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ic.grammar.syntax import Name, String, place_of
from ic.meaning.definitions.csv_files import CsvColumn, CsvTable, missing_column
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.parameters import not_sweepable
from ic.meaning.parameters.models import check_keys, use_model
from ic.meaning.parameters.owner import Owner, Settled
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words
from met import units
from met.diagnostic import Label, Problem, did_you_mean, error, leave_out
from met.environments.environment import FILE, Environment
from met.parameter import Parameter
from met.plan import Origin
from met.unit_parser import parse_unit

TIME = "time"


def use_table(scope: Scope, owner: Owner, environment: Environment, body: MergedBlock) -> dict[str, Any] | None:
    """Every parameter of a model whose body names a file, entered in the scope; None where one is missing or wrong."""
    lists = [parameter for parameter in environment.parameters if parameter.shape == "list"]
    check_keys(scope, body, [parameter.name for parameter in environment.written], owner)
    for parameter in lists:
        item = body.get(parameter.name)
        if item is not None:
            scope.complaints.error(
                "D242",
                f"`{parameter.name}` of {owner.label} stands in the file",
                item.place,
                also=[Label(body.items[FILE.name].place, "which is named here")],
                help=leave_out("leave one of the two out"),
            )
    own = [parameter.name for parameter in environment.parameters if parameter.shape != "list"]
    values = use_model(
        scope,
        owner,
        [parameter for parameter in environment.parameters if parameter.shape != "list"],
        MergedBlock({key: item for key, item in body.items.items() if key in own}),
    )
    for name in (FILE.name, *(parameter.name for parameter in lists)):
        scope.not_sweepable[owner.join(name)] = not_sweepable.FILE
    columns: dict[str, tuple[float, ...]] | None = None
    with scope.complaints.gather():
        columns = _columns(scope, owner, lists, body.items[FILE.name])
    if columns is None:
        for parameter in lists:
            scope.checks.fail(owner.join(parameter.name))
    return None if values is None or columns is None else {**values, **columns}


def report_named_lists(scope: Scope, owner: Owner, lists: list[Parameter], body: MergedBlock) -> bool:
    """Report a file's name in place of a list; return True if there is one."""
    is_named = False
    for parameter in lists:
        item = body.get(parameter.name)
        if item is not None and isinstance(item.value, String):
            is_named = True
            scope.complaints.error(
                "D064",
                f"`{parameter.name}` of {owner.label} is a list of numbers, not text",
                item.value.place,
                help=f'write `file = "{item.value.value}";` for a CSV file that '
                f"has it in a column `{TIME if parameter.rises else parameter.name}`",
            )
    return is_named


def named_file(owner: Owner, item: Item) -> String:
    """The name of the file that `file` is. Raises Problem D076."""
    if not isinstance(item.value, String):
        raise Problem(
            error(
                "D076",
                f"`file` of {owner.label} is the name of a file, in quotes",
                place_of(item.value) if item.value is not None else item.place,
                help=f'write `file = "{item.value.text if isinstance(item.value, Name) else "NAME.csv"}"`',
            )
        )
    return item.value


def keep_column(
    scope: Scope, owner: Owner, wanted: Parameter, table: CsvTable, column: CsvColumn, label: Label
) -> tuple[float, ...]:
    """A column as the model's list, entered in the scope. Raises Problem D193, D194, D195. label: the part that needs
    it"""
    text, dimension = owner.unit(wanted)
    numbers = table.numbers(column, text, dimension, label)
    if column.name == TIME:
        table.rising(column, numbers)
    note = f"column `{column.name}` of {table.file}"
    scope.parameters[owner.join(wanted.name)] = Settled(
        numbers, text, Origin("deck", column.place, (), note), wanted.doc
    )
    return numbers


def _alike(scope: Scope, owner: Owner, column: CsvColumn, by_column: Mapping[str, Parameter]) -> list[str]:
    """The columns that this one may be, judged by its unit; all of them where it has none, or an unreadable one."""
    try:
        meant = parse_unit(column.unit or "").dimension
    except (ValueError, OverflowError, ZeroDivisionError):
        return list(by_column)
    return [name for name, wanted in by_column.items() if units.same(owner.unit(wanted)[1], meant)]


def _columns(scope: Scope, owner: Owner, lists: list[Parameter], item: Item) -> dict[str, tuple[float, ...]]:
    """The lists. Raises Problem."""
    named = named_file(owner, item)
    table = scope.definitions.csv_files.get(named)
    by_column = {TIME if parameter.rises else parameter.name: parameter for parameter in lists}
    label = Label(named.place, "read here")
    for column in table.columns:
        if column.name not in by_column:
            raise Problem(
                error(
                    "D243",
                    f"{owner.label} has no use for column `{column.name}`",
                    column.place,
                    also=[label],
                    help=[
                        *did_you_mean(column.name, _alike(scope, owner, column, by_column)),
                        known_words("its columns", by_column),
                        "or take it out",
                    ],
                )
            )
    columns = {}
    for name, wanted in by_column.items():
        cells = table.column(name)
        if cells is not None:
            columns[wanted.name] = keep_column(scope, owner, wanted, table, cells, label)
        elif isinstance(wanted.default, tuple) and name != TIME:
            text, _ = owner.unit(wanted)
            columns[wanted.name] = wanted.default
            scope.parameters[owner.join(wanted.name)] = Settled(wanted.default, text, Origin("default"), wanted.doc)
        else:
            why = f"the times of the rows stand in a column `{TIME} [s]`" if name == TIME else ""
            raise missing_column(table, name, named.place, why)
    if not table.rows:
        raise Problem(
            error(
                "D196", f"`{table.file}` has no rows", table.columns[0].place, also=[label], help="it has one at least"
            )
        )
    scope.keep_setting(owner.join(FILE.name), table.file, item=item)
    return columns
