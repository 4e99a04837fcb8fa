"""Checks of a recording that back ends rely on: made between the passes, in tests and on request.

`MET_CHECK_RECORDINGS=1` in the environment turns it on. A pass that leaves an invalid recording is a defect of MET.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

from met.trace.nodes import OPERANDS, TRUTHS, Node
from met.trace.program import Branch, CodeSection, RecordedControl, Recording, WhileAny

# operands that are truths, by operation and position; all others are numbers
_TRUTH_OPERANDS = {("and", 1), ("and", 2), ("where", 1)}
# types of the further arguments after the operands of a node
_REST = {"const": float, "input": str, "cell": str, "bit": int, "flip": int, "gather": tuple, "philox": int}


def wanted() -> bool:
    """True where recordings should be checked."""
    return os.environ.get("MET_CHECK_RECORDINGS") == "1"


def check(recording: Recording) -> None:
    """Raise ValueError with the fault of an invalid recording."""
    program = recording.program
    cells = set(recording.cells)
    if len(cells) != len(recording.cells):
        raise ValueError("two cells of one name")
    for section in recording.sections:
        check_nodes(section.name, section.nodes)
        names = {"cell": cells, "input": set(program.inputs)}
        for node in (section.nodes[i] for i in section.order):
            if node[0] in names and node[1] not in names[node[0]]:
                raise ValueError(f"{section.name}: it reads the {node[0]} {node[1]!r}, which there is not")
        _check_results(section, cells, program.columns, len(program.outputs))
    _check_control((*recording.start, *recording.tick, *recording.end), len(recording.sections), cells)


def check_nodes(where: str, nodes: Sequence[Node]) -> None:
    """Raise ValueError where one of these nodes is invalid, takes a later node, or a truth for a number."""
    for i, node in enumerate(nodes):
        op = node[0]
        if op not in OPERANDS:
            raise ValueError(f"{where}: node {i} is {op!r}, which is no operation")
        count = OPERANDS[op]
        rest = node[1 + count :]
        if len(node) < 1 + count or [type(part) for part in rest] != ([_REST[op]] if op in _REST else []):
            raise ValueError(f"{where}: node {i} is {node!r}, and `{op}` has {count} operands")
        for position, ref in enumerate(node[1 : 1 + count], start=1):
            if not isinstance(ref, int) or not 0 <= ref >> 1 < i:
                raise ValueError(f"{where}: node {i} takes {ref!r}, which is no node before it")
            if (nodes[ref >> 1][0] in TRUTHS) != ((op, position) in _TRUTH_OPERANDS):
                kind = nodes[ref >> 1][0]
                raise ValueError(f"{where}: node {i}, `{op}`, takes node {ref >> 1}, `{kind}`, for what it is not")


def _check_results(section: CodeSection, cells: set[str], columns: int, outputs: int) -> None:
    """Check that a section's stores, records and outputs are known, one each, and numbers. Raises ValueError."""
    for kind, known, results in (
        ("cell", cells, section.stores),
        ("column", range(columns), section.records),
        ("output", range(outputs), section.outputs),
    ):
        for name, ref in results:
            if name not in known:
                raise ValueError(f"{section.name}: it sets the {kind} {name!r}, which there is not")
            if section.nodes[ref >> 1][0] in TRUTHS:
                raise ValueError(f"{section.name}: the {kind} {name!r} is set to a truth")
        if len({name for name, _ in results}) != len(results):
            raise ValueError(f"{section.name}: it sets a {kind} twice")


def _check_control(body: Sequence[RecordedControl], sections: int, cells: set[str]) -> None:
    """Raise ValueError where control runs a section, or goes by a cell, that there is not."""
    for step in body:
        if isinstance(step, Branch):
            if isinstance(step.condition, WhileAny) and step.condition.cell not in cells:
                raise ValueError(f"a loop goes by the cell {step.condition.cell!r}, which there is not")
            _check_control(step.body, sections, cells)
        elif not 0 <= step.section < sections:
            raise ValueError(f"control runs section {step.section} of {sections}")
