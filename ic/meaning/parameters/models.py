"""Checks of uses of models against their declarations: keys, missing parameters, units, ranges, words, lists."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType, SimpleNamespace
from typing import Any

from ic.grammar.syntax import Call, Expression, Name, String, place_of
from ic.meaning.definitions.csv_files import CsvColumn, CsvTable, missing_column
from ic.meaning.definitions.merge import Item, MergedBlock, refuse_pending
from ic.meaning.parameters.owner import OF_A_FILE, Owner, Settled
from ic.meaning.parameters.relations import check_relations
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import known_words, where_it_belongs, with_article
from met import models, units
from met.diagnostic import Label, Place, Problem, did_you_mean, error, leave_out
from met.environments.environment import FILE, Environment
from met.parameter import Only, Parameter, is_present
from met.plan import Origin
from met.trace import Scalar
from met.unit_parser import parse_unit


def word_of(expression: Expression | None) -> str | None:
    """The one word that an expression is, or calls; None for other expressions."""
    if isinstance(expression, Call):
        expression = expression.name
    if isinstance(expression, Name) and len(expression.path) == 1:
        return expression.path[0].text
    return None


def overriding_place(item: Item) -> Place | None:
    """The place of the first entry of a block over an entry's value, of the block where it is empty; None where there
    is none."""
    return next((entry.place for entry in item.body.items.values()), item.upon) if item.body is not None else None


def words_chosen(parameters: Sequence[Parameter], body: MergedBlock) -> tuple[tuple[str, str], ...]:
    """The words that a body writes for these parameters, without defaults."""
    words = ((parameter, word_written(parameter, body)) for parameter in parameters)
    return tuple((parameter.name, word) for parameter, word in words if word != parameter.default)


def word_written(wanted: Parameter, body: MergedBlock) -> str:
    """The word that a body writes for a parameter, else its default."""
    item = body.get(wanted.name)
    written = word_of(item.value) if item is not None else wanted.default
    return written if isinstance(written, str) else ""


def _check_unused(
    scope: Scope, owner: Owner, wanted: Parameter, only: Only, body: MergedBlock, words: Mapping[str, str]
) -> None:
    """Report a parameter that is absent under its word, unless that word was written over another, which may have had
    it."""
    item, word = body.get(wanted.name), body.get(only[0])
    if item is None or (word is not None and word.overrides):
        return
    also = [Label(place_of(word.value), "chosen here")] if word is not None and word.value is not None else []
    needed = " or ".join(f"`{only[0]} = {needed_word};`" for needed_word in only[1])
    scope.complaints.error(
        "D141",
        f"{owner.label} has no `{wanted.name}` with `{only[0]} = {words[only[0]]}`",
        item.place,
        also=also,
        help=f"it is there with {needed}",
    )


def refuse_values(scope: Scope, expression: Expression | None, names: Iterable[str]) -> bool:
    """Report values without a name, whose parameter is unknown; return True if there are any."""
    if not isinstance(expression, Call) or not expression.positional:
        return False
    name = word_of(expression)
    usage = f"{name}({', '.join(f'{parameter} = ...' for parameter in names)})"
    scope.complaints.error(
        "D153", f"`{name}` takes its values by name", place_of(expression.positional[0]), help=f"write `{usage}`"
    )
    return True


def check_keys(
    scope: Scope,
    body: MergedBlock,
    known: Iterable[str],
    owner: Owner,
    others: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Report every entry of the body that is not a known plain key, and note the key that was probably meant.

    others messages about keys one expects
    """
    known = list(known)
    for item in body.items.values():
        if item.kind:
            scope.complaints.error(
                "D141",
                f"no `{item.kind}` in {owner.label}",
                item.place,
                help=[*where_it_belongs(item.kind), known_words("it has", known)],
            )
        elif item.name not in known:
            if item.name not in others:
                scope.complaints.note_misspelling(owner.place, item.name, known)
            scope.complaints.error(
                "D141",
                f"{owner.label} has no `{item.name}`",
                item.place,
                help=[
                    *([others[item.name]] if item.name in others else did_you_mean(item.name, known)),
                    known_words("it has", known),
                ],
            )
    refuse_statements(scope, body, owner.label)
    refuse_pending(body, scope.complaints)
    scope.removed.update(
        (owner.join(removed.key), removed.place) for removed in body.removed if body.get(removed.key) is None
    )


def refuse_statements(scope: Scope, body: MergedBlock, label: str) -> None:
    """Report each statement, such as `require`, in a block that has none. label: what to call the block."""
    for statement in body.statements:
        scope.complaints.error(
            "D142",
            f"`{statement.words[0].text}` inside {label}",
            statement.place,
            help="it belongs to a run or a sweep",
        )


def find_bare_model(scope: Scope, kind: models.Kind, item: Item, remedy: str) -> Any:
    """The declaration that an entry names with nothing in parentheses or braces; None where that failed (reported).

    remedy  what to write in place of parameters behind the name, with `{}` for the name
    """
    name, place = word_of(item.value), item.value_place
    if name is not None and (isinstance(item.value, Call) or item.body is not None):
        place = place if isinstance(item.value, Call) else overriding_place(item) or place
        scope.complaints.error(
            "D143", f"`{item.name} = {name}` takes neither parentheses nor braces", place, help=remedy.format(name)
        )
        return None
    return find_model(scope, kind, name, place)


def model_of_entry(scope: Scope, item: Item, kind: models.Kind, code: str, helps: Iterable[str]) -> Any:
    """The declaration that an entry `KIND NAME = MODEL { ... }` names; None where there is none, or where a word stands
    behind the name (already reported). code, helps: of the report"""
    if item.detail or item.value is None:
        place = item.detail[0].place if item.detail else item.place
        message = f"{kind} `{item.name}` has no model"
        if item.detail:
            message = f"`{item.detail[0].text}` after the name of {with_article(kind)}"
        scope.complaints.error(code, message, place, help=helps)
        return None
    return find_model(scope, kind, word_of(item.value), item.value_place)


def find_model(scope: Scope, kind: models.Kind, name: str | None, place: Place) -> Any:
    """The declaration; None where there is none (already reported)."""
    if name is None:
        scope.complaints.error(
            "D143",
            f"the name of {with_article(kind)} model is needed here",
            place,
            help=known_words(f"{kind} models", sorted(models.available(kind))),
        )
        return None
    try:
        return models.find(kind, name, place)
    except Problem as problem:
        scope.complaints.add(*problem.diagnostics)
        return None


def use_model(
    scope: Scope, owner: Owner, parameters: Iterable[Parameter], body: MergedBlock, extra: Iterable[str] = ()
) -> dict[str, Any] | None:
    """Every parameter of a model used with this body, entered in the scope; None where one is missing or wrong.

    Of those that are there only under a word (`Parameter.only`), those under the words of this body. Two of one name
    are there under different words, as one that needs to be written under some.
    """
    parameters = tuple(parameters)
    words = {p.name: word_written(p, body) for p in parameters if p.shape == "word"}
    wrong = [p.name for p in parameters if p.words and not p.names and words[p.name] not in p.words]
    known = [p.name for p in parameters if is_present(p, words) or body.get(p.name) is not None]
    extra = list(extra)
    check_keys(scope, body, [*known, *extra], owner)
    if FILE.name in extra and scope.complaints.is_known_to_lack(owner.place, FILE.name):  # which would have the lists
        scope.complaints.known_missing |= {
            (owner.place, parameter.name) for parameter in parameters if parameter.shape == "list"
        }
    present = [p.name for p in parameters if is_present(p, words)]
    owner = replace(owner, others=parameters)
    values: dict[str, Any] = {}
    for wanted in parameters:
        item = body.get(wanted.name)
        if wanted.only is not None and wanted.only[0] in wrong:
            scope.checks.fail(owner.join(wanted.name))  # a missing word is reported where words are read
            continue
        if wanted.only is not None and not is_present(wanted, words):
            if wanted.name not in present:
                _check_unused(scope, owner, wanted, wanted.only, body, words)
            continue
        if wanted.shape == "vector":
            values[wanted.name] = scope.vector(owner, wanted, item)
        elif wanted.shape == "list":
            values[wanted.name] = scope.number_list(owner, wanted, item)
        elif wanted.shape == "word":
            values[wanted.name] = scope.word(owner, wanted, item, record=True)
        elif wanted.decides:
            values[wanted.name] = scope.model_constant(owner, wanted, item)
        else:
            values[wanted.name] = scope.number(owner, wanted, item)
    if any(value is None for value in values.values()):
        return None
    check_relations(scope, owner, [parameter for parameter in parameters if parameter.name in values], body, values)
    return values


def body_of(scope: Scope, item: Item | None) -> MergedBlock:
    """The block of an entry; an empty one where there is none, or where a value stands in its place, which is
    reported."""
    if item is None:
        return MergedBlock()
    if item.body is None or item.value is not None:
        scope.complaints.error(
            "D111", f"`{item.name}` is a block, not a value", item.place, help=f"write `{item.name} {{ ... }}`"
        )
        return MergedBlock()
    return item.body


def idleness(model: Any, values: Mapping[str, Any], duration: float) -> tuple[Sequence[str], str] | None:
    """The parameters by which a model has no effect in a run of this duration, s, and the reason in words; None where
    it has one, or may have one in some case of a sweep. values: of all its parameters"""
    numbers = [x for value in values.values() for x in (value if isinstance(value, tuple) else (value,))]
    if model.idle is None or any(isinstance(x, Scalar) for x in numbers):
        return None
    found: tuple[Sequence[str], str] | None = model.idle(SimpleNamespace(**values), duration)
    return found


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
    names = [parameter.name for parameter in lists]
    file = body.items[FILE.name]
    return use_columns(
        scope, owner, environment.parameters, names, (FILE.name,), body, lambda: _columns(scope, owner, lists, file)
    )


def use_columns(
    scope: Scope,
    owner: Owner,
    parameters: Iterable[Parameter],
    lists: Collection[str],
    of_file: Iterable[str],
    body: MergedBlock,
    read: Callable[[], dict[str, tuple[float, ...]] | None],
) -> dict[str, Any] | None:
    """Every parameter of a model of which some are columns of a file, entered in the scope; None where one is missing
    or wrong.

    lists    the names of those parameters;  of_file: those of the keys that name the file and its columns
    read     gives the columns, SI, by their parameters; None where they are wrong (already reported). Raises Problem
    """
    others = [parameter for parameter in parameters if parameter.name not in lists]
    own = {parameter.name for parameter in others}
    values = use_model(scope, owner, others, MergedBlock({key: body.items[key] for key in body.items if key in own}))
    for name in (*of_file, *lists):
        scope.not_sweepable[owner.join(name)] = OF_A_FILE
    columns: dict[str, tuple[float, ...]] | None = None
    with scope.complaints.gather():
        columns = read()
    if columns is None:
        for name in lists:
            scope.checks.fail(owner.join(name))
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
                item.value_place,
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
    """The lists of a model's table by their parameters' names, from the columns of a CSV file, in SI. Raises
    Problem."""
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
