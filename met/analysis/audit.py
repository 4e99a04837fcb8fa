"""Inputs of a sweep that change nothing: the program is recorded, and followed back from all that it gives.

Nothing is compiled. A number of a case has an effect where something that the program records, gives or decides by is
computed from it, through however many steps; that is a question about the program, not about values.
"""

from __future__ import annotations

from met.analysis.chains import chains
from met.plan import Experiment
from met.program.build import COORDINATE, build
from met.trace.nodes import live
from met.trace.program import WhileAny, walk
from met.trace.recorder import record
from met.trace.recording import CodeSection


def idle_inputs(experiment: Experiment) -> tuple[str, ...]:
    """Inputs of the experiment's program that change nothing: paths of coordinates, `met.plan.REPEAT` and `SEED`.

    Of an arm whose chains do not act on each other, no more is recorded than it takes to see that all have an effect.
    Raises Problem where a model cannot be recorded.
    """
    every = {*(each.path for each in experiment.cases.coordinates), *experiment.cases.noise}
    for chain in chains(experiment):
        every &= set(_idle_inputs(chain))
        if not every:
            return ()
    return _idle_inputs(experiment)


def _idle_inputs(experiment: Experiment) -> tuple[str, ...]:
    program = build(experiment)
    recording = record(program, fuse=False)
    control = walk((*program.start, *program.tick, *program.end))
    needed = {node.cell for node in control if isinstance(node, WhileAny)}
    given = {n for n, name in enumerate(program.outputs) if not name.startswith(COORDINATE)}
    read: set[str] = set()
    while True:
        found: set[str] = set()
        for section in recording.sections:
            inputs, cells = _reads(section, needed, given)
            read |= inputs
            found |= cells
        if found <= needed:
            return tuple(name for name in program.inputs if name not in read)
        needed |= found


def _reads(section: CodeSection, needed: set[str], given: set[int]) -> tuple[set[str], set[str]]:
    """Inputs and cells from which the section computes these cells, these outputs and what it records."""
    roots = [ref for cell, ref in section.stores if cell in needed]
    roots += [ref for _, ref in section.records]
    roots += [ref for number, ref in section.outputs if number in given]
    used = [section.nodes[position] for position in live(section.nodes, roots)]
    return {node[1] for node in used if node[0] == "input"}, {node[1] for node in used if node[0] == "cell"}
