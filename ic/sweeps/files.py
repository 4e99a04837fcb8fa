"""Case tables from CSV files, and the sweep of `--vary` from the command line."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ic.grammar.syntax import Group, Name, Setting, String, Unit, Word
from ic.meaning.definitions.resolve import Definition, Definitions
from ic.meaning.expressions.conditions import VariedPath
from ic.meaning.expressions.quantity import Value
from ic.sweeps.choices import ChoiceColumn, Option
from ic.text.complaints import known_words, with_article
from met.diagnostic import Label, Place, Problem, error, write
from met.outputs import varied_name
from met.trace import Graph

_PATH = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*")


def columns_of(
    definitions: Definitions, named: String, graph: Graph
) -> tuple[list[VariedPath | ChoiceColumn], list[Place]]:
    """The columns of the file, in its order, and the places of its rows. Raises Problem, placed in the file."""
    table = definitions.csv_files.get(named)
    columns: list[VariedPath | ChoiceColumn] = []
    for column in table.columns:
        if not _PATH.fullmatch(column.name):
            raise Problem(
                error(
                    "D223",
                    f"`{column.name[:40]}` is no path of a run",
                    column.place,
                    help="a column is named as `vary` would name it: `gearbox.kp [V*s/rad]`",
                )
            )
        words = table.words(column)
        if words is not None:
            options = [Option(text, Name((Word(text, place),), place), place) for text, place in words]
            columns.append(ChoiceColumn(column.name, column.place, tuple(options)))
            continue
        numbers, measure = table.quantities(column)
        unit = Unit((), column.place, column.unit) if column.unit is not None else None
        value = Value(
            graph.input(column.name), measure.dimension, column.place, column.unit is None, hertz=measure.hertz
        )
        columns.append(VariedPath(column.name, column.place, np.array(numbers), value, unit, measure.scale))
    if not table.rows:
        raise Problem(
            error(
                "D223",
                f"`{table.file}` has no rows: no case is in it",
                named.place,
                help="write a row of values for each case",
            )
        )
    return columns, [Place(table.file, line, 1, max(len(row), 1)) for line, row in table.rows]


def command_line_sweep(
    definitions: Definitions, requested: Sequence[Definition], entries: tuple[Setting, ...]
) -> Definition:
    """The sweep of the requested run over these entries, `vary PATH = VALUES`. Raises Problem D288."""
    place = entries[0].place
    runs = list(definitions.of_kind("run"))
    if len(requested) != 1:
        message = f"`--vary` varies one run, and {len(requested)} are asked for"
        also = [Label(definition.place, f"`{definition.name}`") for definition in requested]
        raise Problem(error("D288", message, place, also=also, help=known_words("name one", runs)))
    (run,) = requested
    if run.kind != "run":
        message = f"`--vary` varies a run, and `{run.name}` is {with_article(run.kind)}"
        base = run.run_name
        helps = [write(base, f"name the run that it is of: `{base}`", old=run.name)] if base in runs else []
        also = [Label(run.place, "defined here")]
        raise Problem(error("D288", message, place, also=also, help=helps or known_words("name a run", runs)))
    words = (Word("sweep", place), Word(varied_name(run.name, definitions.experiments), place))
    group = Group(words, None, Name((Word(run.name, place),), place), entries, place)
    return Definition("sweep", words[1].text, group)
