"""A run or sweep of an archive as one HTML page that computes its cases, and any between them, where it is opened.

Everything is in the page: the module, its description, and the archive's data about the cases. The page allows itself
one script, by its digest, and WebAssembly; module and numbers are in that script, so that the digest covers them too.

A page can show data beside its own run, as a second arm and wide pale lines: another archive's run, computed in the
page by that archive's own code, or a log of measured signals (`batch.measured.log`).
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive.in_memory import GroupInMemory
from batch.archive.read import ArchiveFile, ArchiveGroup, reading
from batch.archive.stored import Unlike
from batch.arms.drawn import drawn_arm, drawn_json, visible_texts
from batch.arms.look import arm_scripts, arm_style
from batch.measured.log import read_log
from batch.modules.description import MOST_CASES, described, described_columns
from batch.plotting.against import beside
from batch.portable.numbers import OtherNumbers, deck_of, limits
from batch.queries.pool import groups_named, pools
from batch.queries.signals import DeckUnits, Panel, deck_unit, number_texts, pretty_unit
from batch.report.contents.designs import design_answer
from batch.report.html import inlined
from batch.report.html.inlined import page_head
from batch.report.html.markup import Html, el, lines
from batch.report.html.payload import script_json
from met.backends.wasm.module import KERNEL_JS, begun
from met.diagnostic import Problem, error
from met.host.sources import names_archive
from met.messages.visible import visible
from met.outputs import quoted
from met.plan import Experiment, Plan
from met.plan.limits import extremes
from met.run import Prepared, inputs, prepare
from met.version import VERSION

GENERATOR = "MET view"
"""The name in a page's `generator` that marks it as MET's, so that it may be overwritten."""

KICKER = "A page that simulates"
"""The line above the title of a page about an archive."""

SHOWN_KEY = 8
"""Number of letters of a program's key that a page shows."""

OTHER_CODE = "by other code than the archive was made with, so that numbers may differ"

OWN = ("beside.js", "traces.js", "knobs.js", "view.js")
"""Scripts of a page that simulates, in their order; `numbers.js` follows them where there is a second module."""

_ASSETS = Path(__file__).with_name("assets")
_CODE = "'wasm-unsafe-eval'"


def view(
    archive: str | Path,
    names: tuple[str, ...] = (),
    against: str | Path | None = None,
    numbers: str | Path | None = None,
    include_dirs: Sequence[str | Path] = (),
    tell: Callable[[str], object] = lambda line: None,
    *,
    meshes: bool = True,
) -> str:
    """The page of the archive's only run or sweep, or of the one that is named. against: another archive, or a log of
    measured signals, that is shown beside it. numbers: the archive's deck, whose numbers can be others there, with
    further folders of what it includes. tell: takes lines on the meshes that are drawn, and on a log of another span
    than the run's. meshes: whether links are drawn by their meshes. Raises Problem E473 where several runs are meant,
    and those of `batch.portable.beside` and `batch.portable.numbers`."""
    with ArchiveFile(archive) as file:
        file.need_every_row("a page that simulates")
        groups = groups_named(file, names)
        if len(groups) > 1:
            helps = f"name one: {', '.join(group.name for group in groups)}"
            raise Problem(
                error("E473", f"a page is of one run or sweep, and {file.path} has {len(groups)}", help=helps)
            )
        (group,) = groups
        experiment = next(experiment for experiment in file.plan().experiments if experiment.name == group.name)
        data = data_of(experiment, file, group, folder=file.path.parent if meshes else None)
        if "meshes" in data["arm"]:
            tell(data["arm"]["meshes"])
        data["report"] = visible(f"met report {quoted(Path(archive).name)}")
        answer = design_answer(file, pools(groups)[0])
        if answer is not None and answer.case in data["positions"]:
            data["opens"] = data["positions"].index(answer.case)
        if against is not None:
            data["beside"] = _beside(against, file, group, experiment, tell)
        if numbers is not None:
            data["numbers"] = _numbers(deck_of(file, experiment, numbers, include_dirs), experiment)
            data["head"] = head_of(experiment, data, KICKER, f"{_by(data)} ({_program(data)})")
        return page_of(experiment, data)


def _numbers(numbers: OtherNumbers, archived: Experiment) -> dict[str, Any]:
    """Data of the second module, whose inputs are the deck's numbers, as for a page of one case. archived: the
    archive's data"""
    experiment, status = numbers.run.experiment, np.full(1, -1, np.int8)
    empty = {use.name: np.full(1, np.nan) for use in experiment.metrics}
    group = GroupInMemory.of_metrics(experiment, np.arange(1), status, empty)
    data = data_of(experiment, numbers.plan, group, source="deck")
    exact = {
        coordinate.unit: [str(measure.exact.numerator), str(measure.exact.denominator)]
        for coordinate, measure in zip(experiment.cases.coordinates, numbers.measures, strict=True)
    }
    data["exact"] = [exact[coordinate.unit] for coordinate in experiment.cases.coordinates]
    data["limits"] = limits(numbers.run)
    data["leftOut"] = [visible(path) for path in numbers.left_out]
    words = [
        f"Any number that the deck writes can be moved here, one at a time; "
        f"the others are those of `{numbers.run_name}`"
    ]
    if archived.varies:
        words.append(f", which `{archived.name_in_deck}` varies")
    if numbers.fixed:
        words.append(f", with {', '.join(numbers.fixed)}")
    words.append(". The run is computed here by another program than the archive's, for numbers are its inputs ")
    words.append(f"({_program(data)}): last digits may differ. What the archive has is behind the switch.")
    head = {"kicker": "Other numbers than the archive's", "name": numbers.run_name, "lede": "".join(words)}
    data["head"] = visible_texts(head)
    return data


def _beside(
    against: str | Path, file: ArchiveFile, group: ArchiveGroup, experiment: Experiment, tell: Callable[[str], object]
) -> dict[str, Any]:
    """The data of the other archive or log on the page: for an archive everything known about it, for a log its numbers
    at the rows of a run."""
    name = visible(Path(against).name)
    if names_archive(str(against)):
        with ArchiveFile(against) as other:
            other.need_every_row("a page that simulates")
            (matched,) = beside(file, [group], other)
            assert matched is not None
            theirs = matched.group
            other_experiment = next(planned for planned in other.plan().experiments if planned.name == theirs.name)
            units = [described_column["unit"] for described_column in described_columns(experiment)]
            data = data_of(other_experiment, other, theirs)
            data["arm"].pop("acting", None)  # of a second arm only the shape is drawn
            return {"name": name, "page": data | {"own": units}}
    schedule = experiment.structure.schedule
    rows = np.arange(schedule.rows) * schedule.record / schedule.base_hz
    data = log_data(against, described_columns(experiment), rows)
    if data["part"]:
        tell(data["part"])
    values = [None if column is None else doubles(column) for column in data["values"]]
    return {"name": name, "values": values, "told": data["told"], "unused": data["unused"]}


def data_of(
    experiment: Experiment,
    archive: ArchiveFile | Plan,
    group: ArchiveGroup,
    *,
    source: str = "archive",
    prepared: Prepared | None = None,
    quick: bool = False,
    folder: Path | None = None,
) -> dict[str, Any]:
    """Data for the script: the module, its description, and the archive's data about the first cases.

    archive   the group's; of a group that is in none, the plan
    source    what the page calls whatever its numbers are compared with
    prepared  the experiment, where it is at hand
    quick     whether a module that is sooner made and slower will do
    folder    where files of links' meshes are looked for too; None to draw no meshes
    """
    prepared = prepared or prepare(experiment)
    making = begun(prepared.recording, quick=quick)
    arm = drawn_json(
        drawn_arm(
            experiment, [described_column["channel"] for described_column in described_columns(experiment)], folder
        )
    )
    code_key, module = prepared.code_key, making()
    description = described(prepared, module)
    positions = group.values("case")[:MOST_CASES]
    rows = np.searchsorted(experiment.cases.table, positions)
    description["cases"]["inputs"] = inputs(experiment, np.asarray(rows, np.int64)).tolist()
    stored = {variable.name: variable for variable in group.role("metric")}
    known = {name.removeprefix("metrics."): name for name in stored}
    visible_description: dict[str, Any] = visible_texts(description)
    metrics = [*description["metrics"], *description["not_computed"]]
    units = DeckUnits(archive, group)
    columns = [
        units.panel(Panel(column["signal"], "", column["unit"], column["signal"], (), ()))
        for column in description["columns"]
    ]
    lacking = [metric["name"] for metric in metrics if metric["name"] not in known]
    with reading(group.path):
        if lacking:
            raise Unlike(f"the plan of `{experiment.name}` has a metric `{lacking[0]}`, and it has none")
        metric_units = [deck_unit(stored[known[metric["name"]]]) for metric in metrics]
    return {
        "module": base64.b64encode(module.code).decode("ascii"),
        "description": visible_description,
        "source": source,
        "same_code": code_key == group.attributes.get("code_key"),
        "positions": positions.tolist(),
        "count": group.count,
        "status": group.stretch("status", 0, len(positions)).tolist(),
        "metrics": [
            doubles(group.stretch(known[metric["name"]], 0, len(positions))) for metric in metrics
        ],
        "labels": [visible(parameter["name"]) for parameter in description["inputs"]],
        "units": [_unit(parameter["unit"]) for parameter in description["inputs"]],
        "metricUnits": [visible(unit) for _, unit in metric_units],
        "metricScales": [scale for scale, _ in metric_units],
        "metricAbout": [visible(stored[known[metric["name"]]].long_name) for metric in metrics],
        "watched": [[use.model, visible(use.of)] for use in experiment.structure.metrics],
        "atLimits": {
            visible(name): [visible(use.path) for use in uses] for name, uses in extremes(experiment).items()
        },
        "signalAbout": {visible(recording.name): visible(recording.doc) for recording in experiment.structure.record},
        "springs": [f"{joint}.q" for joint in sorted(experiment.structure.springs)],
        "columnUnits": [_unit(column.unit) for column in columns],
        "columnScales": [column.scale for column in columns],
        "arm": arm,
    }  # fmt: skip


def _unit(unit: str) -> str:
    """A unit as the page writes it; empty where there is none."""
    return "" if unit == "1" else visible(pretty_unit(unit))


def doubles(values: np.ndarray) -> str:
    """Numbers as base64 of their bytes."""
    return base64.b64encode(np.ascontiguousarray(values, "<f8").tobytes()).decode("ascii")


def page_of(experiment: Experiment, data: dict[str, Any]) -> str:
    """The whole file of a page about an archive; equal data give equal text."""
    start = f"const MET_PAGE = {script_json(data)};\nMET.simulate(MET_PAGE, null);"
    head = data.get("head") or head_of(experiment, data, KICKER, _by(data))
    return page_text(head, [start], own=(*OWN, "numbers.js") if "numbers" in data else OWN)


def _by(data: Mapping[str, Any]) -> str:
    """The code that computes the numbers of a page about an archive, in words."""
    return "by the code that the archive was made with" if data["same_code"] else f"{OTHER_CODE} (MET {VERSION})"


def _program(data: Mapping[str, Any]) -> str:
    """The program of a page's module, by the first letters of its key without the version of the lowering."""
    return f"program {data['description']['code_key'].rpartition(':')[2][:SHOWN_KEY]}"


def head_of(experiment: Experiment, data: Mapping[str, Any], kicker: str, by: str) -> dict[str, str]:
    """The texts at the top of a page. kicker, by: what stands above the name, and by what code numbers are computed."""
    when = "Move a slider, and the run is computed again, here," if data["count"] > 1 else "The run is computed here,"
    return {"kicker": kicker, "name": visible(experiment.name), "lede": f"{when} {by}."}


def page_text(
    head: Mapping[str, str],
    start: Sequence[str],
    *,
    own: Sequence[str] = OWN,
    before: Sequence[str] = (),
    style: str = "",
) -> str:
    """The whole HTML file of a page that runs a run's cases.

    head    the texts at its top, as `head_of` has them
    start   texts of scripts, after all others: what gives the page its data
    own     names of the scripts of such pages;  before: of those of the report that come before them
    style   a further one
    """
    script = "\n".join(
        [
            inlined.licensed("uPlot.iife.min.js", "core.js", "timeline.js", *before),
            arm_scripts(),
            KERNEL_JS.read_text(encoding="utf-8"),
            *((_ASSETS / name).read_text(encoding="utf-8") for name in own),
            *start,
        ]
    )
    style = "\n".join([inlined.style(), arm_style(), (_ASSETS / "view.css").read_text(encoding="utf-8"), style])
    top = page_head(head["name"], generator=GENERATOR, style=style, script=script, allowed=_CODE)
    kicker, lede = (el("p", head[name], cls=name) for name in ("kicker", "lede"))
    header = el("header", kicker, el("h1", head["name"]), lede)
    none = el("p", "This page needs scripts and WebAssembly, which this reader does not run.")
    body = lines([header, el("main", none), Html(f"<script>{script}</script>")])
    return f'<!DOCTYPE html>\n<html lang="en">\n<head>\n{top}\n</head>\n<body>\n{body}\n</body>\n</html>\n'


NANOSECOND = 1e-9


COVERED = 0.9
"""Share of a log's span, and of a run's, that the other has, below which it is said."""


def log_data(path: str | Path, columns: Sequence[Mapping[str, str]], rows: np.ndarray) -> dict[str, Any]:
    """A log at the rows of a run.

    columns  what the run records: of each number its channel, signal and SI unit
    rows     times of the run's rows, s; between rows of the log its numbers are on a straight line, before its first
             and after its last they are none

    Gives `values`, of each column an array over `rows` in SI, or none where the log has not the channel; `told`, what
    the log's columns are, with their units; and `unused`, those that are not shown; `part`, a line on the
    spans of both where one is much longer, else "". Raises Problem E478, and those of
    CSV files.
    """
    log = read_log(path, columns)
    channels = [column["channel"] for column in columns]
    begin, end = (
        pick(time[end_place] for time, _ in log.signals.values()) for pick, end_place in ((min, 0), (max, -1))
    )
    if not (begin < rows[-1] and end > rows[0]):
        message = _spans(begin, end, rows)
        raise Problem(error("E478", message, log.head, help="let its times begin where the run begins, at 0 s"))
    both, run = min(end, rows[-1]) - max(begin, rows[0]), rows[-1] - rows[0]
    whole = both >= COVERED * (end - begin) and both >= COVERED * run
    values = [_interpolated(rows, *log.signals[name]) if name in log.signals else None for name in channels]
    part = "" if whole else f"{_spans(begin, end, rows)}: what both have is shown"
    return {"values": values, "told": log.column_texts, "unused": log.unused, "part": part}


def _spans(begin: float, end: float, rows: np.ndarray) -> str:
    """The spans of a log and of a run, in words."""
    log, run = number_texts([begin, end]), number_texts([rows[0], rows[-1]])
    return f"the log is from {log[0]} s to {log[1]} s, and the run from {run[0]} s to {run[1]} s"


def _interpolated(rows: np.ndarray, time: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Numbers at other times, by straight lines; not-a-number before the first and after the last, with an allowance
    for the rounding of a clock in nanoseconds."""
    inside = (rows >= time[0] - NANOSECOND) & (rows <= time[-1] + NANOSECOND)
    return np.where(inside, np.interp(rows, time, numbers), np.nan)
