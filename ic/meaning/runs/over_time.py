"""Requirements with a call in them, each a metric of its own and a limit on it: over time, `require always(CONDITION,
after = 1 s);`, and of linear answers, `require phase_margin(hand_loop) > 30 deg;`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from ic.grammar.spell import spell
from ic.grammar.syntax import Call, Expression, Name, Statement, Word, mapped, place_of
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.expressions import is_over_time
from ic.meaning.runs.linear import is_figure
from met import models
from met.diagnostic import Label, Problem, error
from met.metrics.metric import Metric

MetricOf = Callable[[Statement, Call], Name]


def metrics_over_time(scope: Scope, block: MergedBlock) -> tuple[MergedBlock, Mapping[int, Expression]]:
    """The run with a metric for each requirement over time; and by position of the statement, what it requires with
    the metric's name in the place of its call.

    A metric is called after its requirement, or where that has no name as its model, `always`, `always_2`; of linear
    answers after both, `hand_loop_phase_margin`.
    """
    items = dict(block.items)
    required: dict[int, Expression] = {}
    unnamed: dict[str, str] = {}
    taken = {item.name for item in block.of_kind("metric")}
    taken |= {statement.name.text for statement in block.statements if statement.name is not None}

    def metric_of(statement: Statement, call: Call) -> Name:
        text = spell(call)
        name = statement.name.text if statement.name is not None else unnamed.get(text, "")
        if not name:
            model, number = call.name.text, 2
            model = f"{_of_figure(call)}_{model}" if is_figure(call) else model
            name = model
            while name in taken:
                name, number = f"{model}_{number}", number + 1
            unnamed[text] = name
            taken.add(name)
        make = _figure_metric if is_figure(call) else _metric
        items[f"metric {name}"] = make(name, call, statement)
        return Name((Word(name, call.place),), call.place)

    for position, statement in enumerate(block.statements):
        if [word.text for word in statement.words] != ["require"]:
            continue
        with scope.complaints.gather():
            _check_name(block, statement)
            value = _with_metrics(statement.value, statement, metric_of)
            if value is not statement.value:
                required[position] = value
    return replace(block, items=items), required


def _check_name(block: MergedBlock, statement: Statement) -> None:
    """Raise D040 where a metric has the requirement's name."""
    metric = block.get(f"metric {statement.name.text}") if statement.name is not None else None
    if metric is not None and statement.name is not None:
        message = f"`{metric.name}` is a metric, and a requirement"
        helps = "give one of them another name"
        raise Problem(error("D040", message, statement.name.place, also=[Label(metric.place, "metric")], help=helps))


def _with_metrics(expression: Expression, statement: Statement, metric_of: MetricOf) -> Expression:
    """The expression with names in place of calls of metrics; unchanged where there are none."""
    if isinstance(expression, Call) and (is_over_time(expression) or is_figure(expression)):
        return metric_of(statement, expression)
    replaced = mapped(expression, lambda part: _with_metrics(part, statement, metric_of))
    return expression if replaced == expression else replaced


def _of_figure(call: Call) -> str:
    """The name of a figure's linear answers. Raises D376 for other forms."""
    name = call.positional[0] if len(call.positional) == 1 else None
    if not isinstance(name, Name) or len(name.path) > 1 or call.named or call.body is not None:
        message = f"`{call.name.text}` takes the name of a `linear` block"
        raise Problem(error("D376", message, call.place, help=f"write `{call.name.text}(NAME)`"))
    return name.text


def _figure_metric(name: str, call: Call, statement: Statement) -> Item:
    """The metric of a figure of linear answers. Raises D376."""
    _of_figure(call)
    of_item = Item("", "of", (), call.positional[0], None, place_of(call.positional[0]))
    return Item(
        "metric", name, (), Name((call.name.path[0],), call.name.place), MergedBlock({"of": of_item}), statement.place
    )


def _metric(name: str, call: Call, statement: Statement) -> Item:
    """The metric of a call. Raises D355 for other forms."""
    metric: Metric = models.find("metric", call.name.text)
    order = ["of", *(parameter.name for parameter in metric.parameters if parameter.default is None)]
    if not call.positional or len(call.positional) > len(order):
        usage = ", ".join(["CONDITION", *(parameter.upper() for parameter in order[1:])])
        rest = [parameter.name for parameter in metric.parameters if parameter.default is not None]
        by_name = ", ".join(f"`{parameter} = ...`" for parameter in rest)
        helps = f"write `{metric.name}({usage})`; by name it takes {by_name}"
        message = f"`{metric.name}` takes {'a condition' if len(order) == 1 else f'a condition and `{order[1]}`'}"
        raise Problem(error("D355", message, call.place, help=helps))
    written = [*zip(order, call.positional, strict=False), *((word.text, value) for word, value in call.named)]
    items: dict[str, Item] = {}
    for key, value in written:
        if key in items:
            message = f"`{key}` of `{metric.name}` is written twice"
            raise Problem(error("D040", message, place_of(value), help="leave one of the two out"))
        items[key] = Item("", key, (), value, None, place_of(value))
    model = Name((call.name.path[0],), call.name.place)
    return Item("metric", name, (), model, MergedBlock(items), statement.place)
