"""Case tables from CSV files: each column is a path of the run, its numbers in the unit of its head."""

from __future__ import annotations

import re

import numpy as np

from ic.grammar.syntax import Name, String, Unit, Word
from ic.meaning.definitions.resolve import Definitions
from ic.meaning.expressions.conditions import VariedPath
from ic.meaning.expressions.quantity import Value
from ic.sweeps.choices import ChoiceColumn, Option
from met.diagnostic import Place, Problem, error
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
