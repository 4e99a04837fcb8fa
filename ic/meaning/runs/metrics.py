"""The metrics of a run: their models, watched channels, and parameters."""

from __future__ import annotations

from dataclasses import replace

from ic.grammar.syntax import Expression, Name, place_of
from ic.meaning.definitions.merge import Item, MergedBlock
from ic.meaning.parameters.models import check_keys, find_model, refuse_values, use_model, word_of
from ic.meaning.parameters.owner import Owner
from ic.meaning.parameters.scope import Scope
from ic.meaning.runs.expressions import ChannelTable
from ic.meaning.runs.linear import is_figure_metric
from ic.meaning.runs.record import not_one, of_lost
from ic.text.complaints import known_words
from met import models
from met.diagnostic import did_you_mean
from met.metrics.metric import Metric
from met.plan.channel import Channel
from met.plan.judged import FIGURES, MetricUse, SignalExpression


def resolve_metrics(
    scope: Scope, block: MergedBlock, signals: ChannelTable
) -> tuple[tuple[MetricUse, ...], tuple[SignalExpression, ...]]:
    """The metrics that are computed during the run, and the watched expressions that are not yet channels of the
    run."""
    expressions: dict[str, SignalExpression] = {}
    own = [item for item in block.of_kind("metric") if not is_figure_metric(item)]
    uses = [_metric(scope, item, signals, expressions) for item in own]
    scope.complaints.note_lost_names(*(item.name for item, use in zip(own, uses, strict=True) if use is None))
    return tuple(use for use in uses if use is not None), tuple(expressions.values())


def _metric(
    scope: Scope, item: Item, signals: ChannelTable, expressions: dict[str, SignalExpression]
) -> MetricUse | None:
    """The metric of an entry with the channel that it watches; None where it has a mistake, which is reported."""
    if item.detail:
        scope.complaints.error(
            "D129",
            f"`{item.detail[0].text}` after the name of a metric",
            item.detail[0].place,
            help=f"write `metric {item.name} = MODEL {{ of = CHANNEL; }}`",
        )
    if item.value is None:
        scope.complaints.error(
            "D129",
            f"metric `{item.name}` has no model",
            item.place,
            help=[
                f"write `metric {item.name} = MODEL {{ of = CHANNEL; }}`",
                known_words("metric models", sorted({**models.available("metric"), **FIGURES})),
            ],
        )
        return None
    word = word_of(item.value)
    figure = did_you_mean(word, FIGURES) if word is not None and word not in models.available("metric") else []
    if figure and not did_you_mean(word or "", models.available("metric")):
        scope.complaints.error("D140", f"no metric model `{word}`", place_of(item.value), help=figure)
        return None
    metric = find_model(scope, "metric", word, place_of(item.value))
    if metric is None or refuse_values(scope, item.value, ["of", *(p.name for p in metric.parameters)]):
        return None
    body = item.body or MergedBlock()
    owner = Owner(f"metric `{item.name}`", item.place, f"metrics.{item.name}")
    of_item = body.get("of")
    channel = None
    if of_item is None:
        check_keys(scope, body, ["of", *(p.name for p in metric.parameters)], owner)
        scope.complaints.missing(
            item.place,
            ("of",),
            "D125",
            f"metric `{item.name}` watches no {'condition' if metric.condition else 'channel'}",
            help=_write(metric),
        )
    elif of_item.value is None or of_item.body is not None:
        scope.complaints.error("D125", "a channel is needed here", of_item.upon or of_item.place, help=_write(metric))
    else:
        channel = _watched(scope, of_item.value, metric, signals, expressions)
    if channel is None or of_item is None:
        return None
    scope.keep_in_deck(f"metrics.{item.name}.model", metric.name, item)
    scope.keep_in_deck(f"metrics.{item.name}.of", channel.path, of_item)
    use_model(scope, replace(owner, of=channel.unit), metric.parameters, body, ("of",))
    return MetricUse(item.name, metric.name, channel.path, item.place)


def _write(metric: Metric) -> str:
    if metric.condition:
        return "write `of = CONDITION;`, such as `of = abs(shoulder.qd) < 2 deg/s;`"
    return "write `of = CHANNEL;`, such as `of = shoulder.qd;`"


def _watched(
    scope: Scope, watched: Expression, metric: Metric, signals: ChannelTable, expressions: dict[str, SignalExpression]
) -> Channel | None:
    """The channel that a metric watches, or that of an expression; None where there is none (reported)."""
    if isinstance(watched, Name) and not metric.condition and watched.path[0].text != "*":
        if watched.text in signals.known:
            return signals.known[watched.text]
        if watched.text in signals.lost or watched.path[0].text in scope.failed_servos | scope.failed_parts:
            return None
        if not of_lost(scope, watched, signals.structure):
            message, helps = not_one(watched, signals.structure)
            scope.complaints.error("D125", message, watched.place, help=helps)
        return None
    expression = None
    with scope.complaints.gather():
        expression = signals.condition(watched, metric) if metric.condition else signals.number(watched, metric)
    if expression is None:
        return None
    expressions[expression.name] = expression
    return Channel(expression.name, expression.unit, expression.text, 1)
