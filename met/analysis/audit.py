"""Inputs of a sweep that change nothing: the program is recorded, and followed back from all that it gives.

Nothing is compiled. A number of a case has an effect where something that the program records, gives or decides by is
computed from it, through however many steps; that is a question about the program, not about values.
"""

from __future__ import annotations

import numpy as np

from met import models
from met.analysis.lanes import LaneTape
from met.plan import Experiment
from met.program.build import COORDINATE, Builder, build
from met.program.system import System
from met.trace.nodes import live
from met.trace.program import WhileAny, walk
from met.trace.recorder import record
from met.trace.recording import CodeSection

MANY_JOINTS = 50
"""Moving joints from which on inputs are tried in numbers before the program is recorded, which takes seconds."""

MOST_TRIED = 10_000
"""Cases, of the first ones, among which another value of a coordinate is looked for."""


def idle_inputs(experiment: Experiment) -> tuple[str, ...]:
    """Inputs of the experiment's program that change nothing: paths of coordinates, `met.plan.REPEAT` and `SEED`.

    Raises Problem where a model cannot be recorded. Of an arm of many joints, all of whose models are MET's own,
    nothing is recorded where each input is seen to change an acceleration.
    """
    if len(experiment.structure.moving) >= MANY_JOINTS and _models_are_own(experiment):
        cases = experiment.cases
        if not cases.noise and accelerating(experiment) >= {each.path for each in cases.coordinates}:
            return ()
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


def accelerating(experiment: Experiment) -> set[str]:
    """Paths of the coordinates that alone, each changed to another of its values, change an acceleration at the start.

    These have an effect, since whether a case fails goes by every acceleration; of others nothing is said.
    """
    step = (builder := Builder(System(experiment))).step
    given = {each.path: np.full(1 + len(experiment.cases.coordinates), each.values[np.zeros(1, dtype=np.int64)][0])
             for each in experiment.cases.coordinates}  # fmt: skip
    for lane, each in enumerate(experiment.cases.coordinates, 1):
        values = each.values[np.arange(min(experiment.cases.count, MOST_TRIED))]
        given[each.path][lane] = values[np.argmax(values != values[0])]
    tape = LaneTape(builder.schedule.base_hz, given, 1 + len(given))
    with np.errstate(all="ignore"):
        builder.start(tape)
        tape.follow((*step.grapple.events(), *builder.computers()))
        step.modes(tape)
        step.derive(tape)
    found = np.array([tape.lane(f"{name}.qdd") for name in step.coordinates])
    found = found[np.isfinite(found).all(axis=1)]
    changed = np.any(found[:, 1:] != found[:, :1], axis=0)
    return {each.path for each, moves in zip(experiment.cases.coordinates, changed.tolist(), strict=True) if moves}


def _models_are_own(experiment: Experiment) -> bool:
    """True where no model is of another package, which is only recorded."""
    structure = experiment.structure
    used = [("servo", each.model) for each in structure.servos]
    used += [("command", each.command.model) for each in structure.servos if each.command and not each.command.guide]
    used += [("sensor", each.model) for servo in structure.servos for each in servo.sensors]
    used += [("sensor", each.model) for each in structure.sensors]
    used += [("guide", each.model) for each in structure.guides]
    used += [("environment", each.model) for each in structure.environment]
    used += [("metric", each.model) for each in structure.metrics]
    used += [(kind, name) for each in structure.substitutions for kind, name in (("bed", each.bed), ("law", each.law))]
    used.append(("integrator", structure.integrator))
    return all(name in models.find_own(kind) for kind, name in set(used))  # type: ignore[arg-type]
