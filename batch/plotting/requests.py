"""Resolution of a plot's request: signals over time, or metrics over varied parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.plotting import layout, maps, points
from batch.plotting.against import OtherGroup, file_names
from batch.plotting.layout import PictureSheet
from batch.plotting.measured import MapMetric, map_metrics
from batch.queries.grids import is_grid, levels
from batch.queries.pool import CaseColumn, Pool
from batch.queries.signals import number_text, panels
from met.diagnostic import Problem, did_you_mean, error
from met.frozen import frozen
from met.outputs import quoted

MOST_OVER = 3
MOST_BESIDE = 6
"""Largest number of maps side by side, one for each value of a third parameter."""

MAPPED = 5
"""Number of values from which two parameters are drawn as a map by default: with fewer, curves are clearer."""


@frozen
class PlotRequest:
    """A request for signals or metrics; both are empty where none is named."""

    signals: tuple[str, ...] = ()
    metrics: tuple[str, ...] = ()
    histories: bool = True


def plot_request(
    group: ArchiveGroup, pool: Pool, names: Sequence[str], cases: Sequence[str], over: Sequence[str]
) -> PlotRequest:
    """The requested signals or metrics, from the names and the other options. Raises Problem E323, E324, E391."""
    metrics = {name: v for v in pool.variables("metric") for name in (v.path, v.name)}
    signals, others = [], []
    for name in names:
        try:
            panels(group, [name])  # refuses what is no signal
            signals.append(name)
        except Problem as no_signal:
            if name not in metrics:
                raise _unknown(group, name, list(metrics), no_signal) from None
            others.append(metrics[name].name)
    if signals and others:
        message = f"`{signals[0]}` is a signal and `{others[0]}` a metric: they have no axis in common"
        raise Problem(error("E391", message, help="draw two pictures, each with a name of its own: `-o FILE.png`"))
    if signals and over:
        message = f"`{signals[0]}` is a signal, which is drawn over time, and not over `{over[0]}`"
        known = f": {', '.join(dict.fromkeys(v.path for v in metrics.values()))}" if metrics else ""
        raise Problem(error("E391", message, help=f"`--over` is of metrics{known}"))
    if cases and (others or over):
        message = f"`--case` is of signals, and {f'`{others[0]}` is a metric' if others else '`--over` of metrics'}"
        raise Problem(error("E391", message, help="a case's metrics are numbers: `met show --case` tells them"))
    if others or over:
        return PlotRequest(metrics=tuple(dict.fromkeys(others)), histories=False)
    whole = group.recorded == group.count or (group.recorded > 0 and not group.role("metric"))
    return PlotRequest(signals=tuple(signals), histories=bool(signals or cases or whole))


def _unknown(group: ArchiveGroup, name: str, metrics: Sequence[str], no_signal: Problem) -> Problem:
    """The problem that a name is neither a metric nor a signal. no_signal: why it is no signal, which is said where the
    run has signals alone, or neither."""
    signals = [v.name for v in group.role("signal")]
    metrics_text = f"metrics here: {', '.join(dict.fromkeys(metrics))}"
    if signals and metrics:
        helps = [*did_you_mean(name, [*signals, *metrics]), f"signals here: {', '.join(signals)}", metrics_text]
        return Problem(error("E324", f"no signal or metric `{name}` in `{group.name}`", help=helps))
    [diagnostic] = no_signal.diagnostics
    meant = did_you_mean(name, metrics) if not signals else ()
    helps = [*meant, *diagnostic.help, *([metrics_text] if metrics else [])]
    return Problem(error(diagnostic.code, diagnostic.message, help=helps))


# Parameters of the axes


def map_axes(archive: ArchiveFile, pool: Pool, names: Sequence[str]) -> tuple[CaseColumn, ...]:
    """The parameters over which metrics are drawn: the named ones; else two that make a grid of some size, or the one
    with most values; none where nothing is varied. Raises Problem E390."""
    varied = pool.varied()
    if not names:
        x, y = (*varied, None, None)[:2]
        if x is None or y is None:
            return varied[:1]
        mapped = min(len(levels(x.values)), len(levels(y.values))) >= MAPPED and is_grid(x.values, y.values)
        return (x, y) if mapped else (x,)
    known = {column.label: column for column in varied}
    if len(names) > MOST_OVER:
        helps = "one gives points, two a map, a third maps beside one another"
        raise Problem(error("E390", f"{len(names)} parameters in `--over`: {MOST_OVER} at most", help=helps))
    for place, name in enumerate(names):
        if name not in known:
            raise _not_varied(archive, pool, name, list(known))
        if name in names[:place]:
            raise Problem(error("E390", f"`{name}` twice in `--over`", help=_varied_text(list(known))))
    columns = tuple(known[name] for name in names)
    count = len(levels(columns[2].values)) if len(columns) > 2 else 0
    if count > MOST_BESIDE:
        message = f"`{names[2]}` has {count:,} values: a map for each of them is more than {MOST_BESIDE}"
        shorter = f"`--over {names[0]},{names[1]}` shows in each cell the worst case or the middle one"
        raise Problem(error("E390", message, help=("as the third take what has few values", shorter)))
    return columns


def _not_varied(archive: ArchiveFile, pool: Pool, name: str, known: Sequence[str]) -> Problem:
    """The problem that a name after `--over` is not varied: it has one value, is a metric, or does not exist."""
    helps = [*did_you_mean(name, known), _varied_text(known)]
    for column in pool.columns:
        if column.label == name and column.role != "metric":
            value = column.values[np.isfinite(column.values)][:1]
            words = column.words[int(value[0])] if column.words else number_text(float(value[0])) if len(value) else "-"
            message = f"`{name}` has one value in all cases of `{pool.name}`: {words} {column.unit}".rstrip()
            return Problem(error("E390", message, help=helps))
        if column.label == name:
            message = f"`{name}` is a metric: it is drawn over what is varied"
            return Problem(
                error("E390", message, help=[f"`met plot {quoted(archive.path)} {name}`", _varied_text(known)])
            )
    if pool.count == 1:
        return Problem(error("E390", f"`{pool.name}` is one case: nothing is varied in it", help=()))
    which = f"`{name}` is not" if _is_parameter(archive, pool, name) else f"no parameter `{name}` is"
    return Problem(error("E390", f"{which} varied in `{pool.name}`", help=helps))


def _is_parameter(archive: ArchiveFile, pool: Pool, name: str) -> bool:
    """True if a name is a parameter of one of the experiments."""
    try:
        experiments = archive.plan(as_written=True).experiments
    except Problem:
        return False
    names = {group.name for group in pool.groups}
    return any(name in experiment.parameters for experiment in experiments if experiment.name in names)


def _varied_text(known: Sequence[str]) -> str:
    return f"varied here: {', '.join(known)}" if known else "nothing is varied here"


def colour_column(pool: Pool, drawn: Sequence[CaseColumn]) -> CaseColumn | None:
    """The column that colours points over one parameter: the varied one with most values that is not in step with it;
    None where nothing else is varied."""
    for column in pool.varied():
        if all(column is not drawn_column for drawn_column in drawn) and is_independent(column, drawn[0]):
            return column
    return None


def is_independent(column: CaseColumn, other: CaseColumn) -> bool:
    """True if a column does not always rise, or fall, where another one rises."""
    ranks, others = (np.searchsorted(levels(ranked.values), ranked.values) for ranked in (column, other))
    return not (np.array_equal(ranks, others) or np.array_equal(ranks, others.max(initial=0) - others))


def draw(
    archive: ArchiveFile,
    pool: Pool,
    names: Sequence[str],
    parameters: Sequence[str],
    sheet: PictureSheet,
    others: Mapping[int, OtherGroup],
    other: ArchiveFile | None,
) -> Any:
    """The figure of a run's or sweep's metrics over its parameters. Raises Problem E327, E390, E393.

    pool        the cases of the run or sweep, over all its structures
    names       of metrics, none: all;  parameters: what they are drawn over, none: as is best
    others      another archive's cases, by number of a group of the pool
    """
    axes_columns = map_axes(archive, pool, parameters)
    if not pool.metrics():
        helps = "`--histories all` keeps histories; a `metric` in the deck gives a number a case"
        message = f"nothing to draw in `{pool.name}`: it has neither histories nor metrics"
        raise Problem(error("E327", message, help=helps))
    if pool.count < 2:
        message = f"nothing to draw in `{pool.name}`: the metrics of one case are single numbers"
        raise Problem(error("E327", message, help=f"`met show {quoted(archive.path)}` tells them"))
    metrics, left = layout.as_many_as_fit(map_metrics(pool, names, others), bool(names), "metrics")
    files = file_names(archive.path, other.path) if other is not None else None
    count = f"{pool.count:,} cases"
    matched = sum(int((other_group.places >= 0).sum()) for other_group in others.values())
    if files is not None and matched < pool.count:
        count += f", {matched:,} of them also in {files[1]}"
    if len(axes_columns) < 2:
        by = colour_column(pool, axes_columns)
        figure = _points(pool, metrics, axes_columns[0] if axes_columns else None, by, sheet, files)
        drawn = {column.key for column in (*axes_columns, by) if column is not None}
        besides = [
            column.label
            for column in pool.varied()
            if column.key not in drawn and is_independent(column, axes_columns[0])
        ]
        below = f"{count}; {' and '.join(besides)} varied too" if besides else count
    else:
        if files is not None:
            metrics = [metric for metric in metrics if metric.theirs is not None]
        third = axes_columns[2] if len(axes_columns) > 2 else None
        planned = maps.plan(axes_columns[0], axes_columns[1], third, files)
        figure = maps.draw(sheet, planned, metrics, third)
        below = f"{count}: {maps.description(planned, metrics, third)}"
    below = f"{below}; {left}" if left else below
    layout.title(figure, archive, pool.groups[0].name if len(pool.groups) == 1 else pool.name, below, sheet)
    return figure


def _points(
    pool: Pool,
    metrics: Sequence[MapMetric],
    x: CaseColumn | None,
    by: CaseColumn | None,
    sheet: PictureSheet,
    files: tuple[str, str] | None,
) -> Any:
    """The figure of metrics as points: a panel for each metric, over the parameter `x`, in the colours of `by`."""
    x = x or CaseColumn("case", "case", "", "case", pool.cases.astype(np.float64))
    figure, axes = layout.figure(sheet, 1, [1.0] * len(metrics))
    mapped = None
    for metric, [ax] in zip(metrics, axes, strict=True):
        mapped = points.scatter(ax, metric, x, by, sheet)
        text = " · ".join(part for part in (metric.about, points.edge_words(metric.values)) if part)
        layout.head(ax, text, sheet, 1)
        ax.set_ylabel(layout.two_lines(metric.label))
        points.varied_axis(ax, x, sheet)
    axes[-1][0].set_xlabel(layout.with_unit(x.label, x.unit))
    if mapped is not None and by is not None:
        points.bar(figure, mapped, [ax for [ax] in axes], by, sheet)
    layout.legend(figure, points.legend_of(layout.legend_entries(axes), files), sheet)
    return figure
