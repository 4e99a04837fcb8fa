"""The requirements of a run: conditions on its metrics, of every case or of a share of all cases."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Literal

from ic.grammar.syntax import (
    Binary,
    Call,
    Expression,
    Name,
    OverCases,
    Statement,
    Word,
    children,
    mapped,
    place_of,
    spell,
)
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.parameters.models import word_of
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.expressions import is_over_time
from ic.meaning.runs.linear import is_figure
from ic.meaning.runs.step_errors import FLIPPED, is_step_error, number_required
from ic.text.complaints import known_words
from met import models
from met.diagnostic import Help, Label, Problem, did_you_mean, error, write
from met.frozen import frozen
from met.metrics.metric import Metric
from met.parameter import Parameter
from met.plan import Structure
from met.plan.judged import MetricUse, Requirement
from met.plan.outputs import metric_units
from met.statistics.confidence import can_be_shown

SHARE = Parameter(name="share", unit="1", doc="the share of all cases", share=True, above=0.0, at_most=1.0)
CONFIDENCE = Parameter(name="confidence", unit="1", doc="the confidence", share=True, above=0.0, below=1.0)
PERCENTILE = "percentile"
"""The function that may replace a metric: `percentile(volts, 99 %) < 40 V` means the same as `volts < 40 V in 99 % of
cases`, and `percentile(volts, 1 %) > 3 V` as `volts > 3 V in 99 % of cases`."""


@frozen
class WrittenRequirement:
    """A `require` with its metric on the left.

    limit       as written; None where a margin is to be at least 0
    share       of all cases, as written; None where every case is to meet it
    percentile  True where the share is that of a percentile: below which so many of the values lie
    confidence  as written; None where none is
    """

    statement: Statement
    metric: str
    operator: Literal["<", "<=", ">", ">="]
    limit: Expression | None
    share: Expression | None = None
    percentile: bool = False
    confidence: Expression | None = None


def read_requirements(
    scope: Scope, block: MergedBlock, required: Mapping[int, Expression] = MappingProxyType({})
) -> list[WrittenRequirement]:
    """Every `require` that compares a metric of the run with a limit; reports the others.

    required  what statements require, by position, where a metric stands for a call (`metrics_over_time`)
    """
    written = {item.name for item in block.of_kind("metric")}
    requirements = []
    for position, statement in enumerate(block.statements):
        if [word.text for word in statement.words] != ["require"]:
            continue
        comparison, share, confidence = _over_cases(required.get(position, statement.value))
        if position in required and isinstance(comparison, Name) and not is_figure(_over_cases(statement.value)[0]):
            model = models.find("metric", word_of(block.items[f"metric {comparison.text}"].value) or "")
            if model.share:
                scope.complaints.error(
                    "D355",
                    f"`{model.name}` is a share, and there is no limit for it",
                    place_of(statement.value),
                    help=_write(statement, f"{spell(_over_cases(statement.value)[0])} > 95 %"),
                )
            else:
                requirements.append(
                    WrittenRequirement(statement, comparison.text, ">=", None, share, False, confidence)
                )
            continue
        if any(map(is_over_time, (comparison, *children(comparison)))):
            continue  # it is reported
        if not isinstance(comparison, Binary) or comparison.operator not in FLIPPED:
            scope.complaints.error(
                "D131",
                "a requirement compares a metric with a limit",
                place_of(comparison),
                help="write `require METRIC < LIMIT;`, or <=, >, >=",
            )
            continue
        if is_step_error(comparison):
            if share is not None or confidence is not None:
                message = "an error by the step is of a metric, not of a share of cases"
                helps = _write(statement, spell(comparison))
                scope.complaints.error("D350", message, place_of(statement.value), help=helps)
            continue  # `resolve_step_errors` reads it
        removed = {
            removed_item.key.removeprefix("metric ")
            for removed_item in block.removed
            if removed_item.key.startswith("metric ") and position < removed_item.before
        }
        operator, metric, limit = comparison.operator, comparison.left, comparison.right
        if _is_percentile(limit) and not _is_percentile(metric):
            operator, metric, limit = FLIPPED[operator], limit, metric
        percentile = _is_percentile(metric)
        if percentile:
            found_share = _of_percentile(scope, metric, share)
            if found_share is None:
                continue
            metric, share = found_share
        elif confidence is not None and share is None:
            scope.complaints.error(
                "D350",
                "a confidence without the share of cases that it is of",
                place_of(statement.value),
                help=_write(statement, f"{spell(comparison)} in 99 % of cases with {spell(confidence)} confidence"),
            )
            continue
        if not _is_metric(metric, written | removed) and _is_metric(limit, written | removed):
            operator, metric, limit = FLIPPED[operator], limit, metric
        if not _is_metric(metric, written | removed):
            name = spell(metric)
            watch = []
            if isinstance(metric, Name) and len(metric.path) > 1:
                watch = [f"a metric of a channel is `metric NAME = max {{ of = {name}; }}`, and `require NAME < ...;`"]
            scope.complaints.error(
                "D132",
                f"no metric `{name}`",
                place_of(metric),
                help=[*did_you_mean(name, written), known_words("metrics of this run", sorted(written)), *watch],
            )
        elif spell(metric) in removed:
            scope.notes.append(
                f"`require {spell(comparison)}` went with the metric `{spell(metric)}`, which is removed"
            )
        else:
            requirements.append(
                WrittenRequirement(statement, spell(metric), operator, limit, share, percentile, confidence)  # type: ignore[arg-type]
            )
    return requirements


def _is_metric(expression: Expression, metrics: set[str]) -> bool:
    return isinstance(expression, Name) and expression.text in metrics


def _write(statement: Statement, requirement: str) -> Help:
    """The help that says to write this requirement in place of a statement."""
    name = f" {statement.name.text}:" if statement.name is not None else ""
    return write(f"require{name} {requirement};", f"write `require {requirement};`", where="entry")


def _over_cases(value: Expression) -> tuple[Expression, Expression | None, Expression | None]:
    """The comparison of a requirement, and its share and confidence where they are written."""
    if isinstance(value, OverCases):
        return value.comparison, value.share, value.confidence
    return value, None, None


def _is_percentile(expression: Expression) -> bool:
    return isinstance(expression, Call) and expression.name.text == PERCENTILE


def _of_percentile(scope: Scope, call: Expression, share: Expression | None) -> tuple[Expression, Expression] | None:
    """The metric of `percentile(METRIC, SHARE)` and its share; None where it is written otherwise (reported here)."""
    assert isinstance(call, Call)
    usage = "write `require percentile(METRIC, 99 %) < LIMIT with 90 % confidence;`"
    if len(call.positional) != 2 or call.named or call.body is not None:
        scope.complaints.error("D350", "a percentile is of a metric and a share", place_of(call), help=usage)
        return None
    if share is not None:
        scope.complaints.error("D350", "a percentile has its share in its brackets", place_of(share), help=usage)
        return None
    return call.positional[0], call.positional[1]


def share_metrics(structure: Structure) -> set[str]:
    """The metrics that are a share of a quantity, such as an overshoot."""
    return {use.name for use in structure.metrics if models.find("metric", use.model, use.place).share}


def resolve_requirements(
    scope: Scope, read: list[WrittenRequirement], structure: Structure, linear: Sequence[MetricUse] = ()
) -> tuple[Requirement, ...]:
    """The requirements with their limits in SI. linear: the metrics of linear answers."""
    metrics = metric_units(structure, linear)
    shares = share_metrics(structure)
    requirements = []
    for written in read:
        if written.metric not in metrics:
            continue  # the metric failed (already reported)
        owner = Owner("", written.statement.place, "require", called=f"the limit on `{written.metric}`")
        wanted = Parameter(name="limit", unit=metrics[written.metric], doc="limit", share=written.metric in shares)
        number = 0.0 if written.limit is None else number_required(scope, owner, wanted, written.limit)
        share = confidence = None
        if written.share is not None:
            share = number_required(
                scope,
                _owner(written, "share"),
                replace(SHARE, below=1.0, at_most=None) if written.percentile else SHARE,
                written.share,
            )
        if written.confidence is not None:
            confidence = number_required(scope, _owner(written, "confidence"), CONFIDENCE, written.confidence)
        if (written.share is not None and share is None) or (written.confidence is not None and confidence is None):
            continue
        if share is not None and written.percentile and written.operator.startswith(">"):
            share = 1.0 - share
        if share == 1.0 and confidence is not None:
            scope.complaints.error(
                "D350",
                "no number of cases shows that all cases meet a requirement",
                place_of(written.share) if written.share is not None else written.statement.place,
                help="write a share below 100 %, or leave the confidence out: then all cases of the run are to meet it",
            )
            continue
        if share is not None and confidence is not None and not can_be_shown(share):
            scope.complaints.error(
                "D350",
                "no campaign has the cases that show a share so near to all or none",
                place_of(written.share) if written.share is not None else written.statement.place,
                help="write a share from 0.0000001 % to 99.9999999 %, or leave the confidence out",
            )
            continue
        if number is not None:
            text = spell(written.statement.value)
            text = f"{written.statement.name.text}: {text}" if written.statement.name is not None else text
            requirements.append(
                Requirement(text, written.metric, written.operator, number, written.statement.place, share, confidence)
            )
    return tuple(requirements)


def _owner(written: WrittenRequirement, what: str) -> Owner:
    return Owner("", written.statement.place, "require", called=f"the {what} of the requirement on `{written.metric}`")


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
        """The name of the metric that stands for a call in a requirement, such as `always(...)`; the metric is made at
        its first use."""
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
