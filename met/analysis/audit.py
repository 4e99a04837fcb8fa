"""Inputs of a sweep that change nothing: the program is recorded and followed back from all of its results.

Nothing is compiled. A number of a case has an effect where something that the program records, gives or decides by is
computed from it, through however many steps; that is a question about the program, not about values.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from met import models
from met.analysis.chains import chains, numbered
from met.analysis.memo import AnalysisMemo
from met.plan import Experiment
from met.program.build import COORDINATE, build
from met.trace.nodes import live
from met.trace.program import CodeSection, Program, Unless0, slice_roots
from met.trace.recorder import SectionRecorder, record


def idle_inputs(experiment: Experiment, memo: AnalysisMemo | None = None) -> tuple[str, ...]:
    """Inputs of the experiment's program that change nothing: paths of coordinates, `met.plan.REPEAT` and `SEED`.

    Where the chains of an arm do not act on each other, only as much is recorded as shows that all inputs have an
    effect. memo: answers about other experiments, which may have equal chains. Raises Problem where a model cannot be
    recorded.
    """
    memo = memo if memo is not None else AnalysisMemo()
    every = {*(coordinate.path for coordinate in experiment.cases.coordinates), *experiment.cases.noise}
    for chain in chains(experiment):
        alike, _ = numbered(chain)
        every &= set(memo.answer("idle inputs of a chain", alike, partial(_idle_inputs_of_chain, alike)))
        if not every:
            return ()
    return _idle_inputs(experiment)


def _idle_inputs(experiment: Experiment) -> tuple[str, ...]:
    program = build(experiment)
    return _unread(program, record(program, fuse=False).sections)


def _idle_inputs_of_chain(chain: Experiment) -> tuple[str, ...]:
    """The idle inputs of one chain; the rest of a step is recorded only where an effect does not show without it."""
    program = build(chain)
    recorder = SectionRecorder(program)
    recorder.steps(program.start, "start")
    recorder.steps(program.end, "end")
    if chain.structure.integrator in models.find_own("integrator"):  # another package's is recorded in any case
        recorder.steps(tuple(Unless0(()) if isinstance(step, Unless0) else step for step in program.tick), "tick")
        if not _unread(program, recorder.sections):
            return ()
    recorder.steps(program.tick, "tick")
    return _unread(program, recorder.sections)


def _unread(program: Program, sections: Iterable[CodeSection]) -> tuple[str, ...]:
    """Inputs from which these sections compute nothing that the program records, gives or decides by."""
    needed = program.loop_cells
    outputs = {n for n, name in enumerate(program.outputs) if not name.startswith(COORDINATE)}
    columns = range(program.columns)
    read: set[str] = set()
    while True:
        cells_read: set[str] = set()
        for section in sections:
            roots = slice_roots(section, needed, outputs, columns)
            used = [section.nodes[position] for position in live(section.nodes, roots)]
            read |= {node[1] for node in used if node[0] == "input"}
            cells_read |= {node[1] for node in used if node[0] == "cell"}
        if cells_read <= needed or len(read) == len(program.inputs):
            return tuple(name for name in program.inputs if name not in read)
        needed |= cells_read
