"""Operating points that are solved for: an arm that stands still in a pose, held by its servos.

It starts from a run that begins `balanced` (docs/physics.md): each servo is asked to stay where it is, and its states
and its law's memory keep its joint from accelerating. From there the point is solved for at which nothing changes from
one period to the next. Where a motor is too weak, or something moves that no servo holds, there is no operating point.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from met.analysis.linear.abreast import together
from met.analysis.linear.flow import Flow
from met.analysis.linear.jacobian import PeriodMap, period_map, period_maps
from met.analysis.linear.period import ADDED, PeriodProgram
from met.analysis.linear.shafts import bring_to_rest, loose_beds
from met.diagnostic import Problem, error
from met.plan import Command, Experiment, Origin, Quantity, Structure
from met.program import cells
from met.program.control.substituted import LIMITED, QUEUE
from met.program.unheld import Unheld, holding_torques, unheld

CLOSE = 1e-11
"""Change of a number over a period, relative to it where it is large, that counts as none."""

HOLD = (".bed.drive_", ".bed.load_current", ":queue.")
"""Endings, after the joint's name, of a bed's cells in which a law's request waits and acts."""

MOST_STEPS = 8
"""Largest number of Newton steps: the start is nearly at the point, or there is none."""

Reason = str
"""Why an arm does not stand in a pose, in words."""


def standing(experiment: Experiment, q: Sequence[float] = ()) -> Experiment:
    """The experiment begun at rest at these positions of its joints that follow none, rad (m), in their order; by
    default those that it begins with. Servos are asked to stay; guides, and signals made of them, are removed."""
    structure = experiment.structure
    lost = tuple(f"guides.{guide.name}." for guide in structure.guides)
    servos = tuple(
        use if use.command is None else replace(use, command=Command(use.command.kind, "constant"))
        for use in structure.servos
    )
    commanded = tuple(f"{use.joint}.servo.command." for use in servos if use.command is not None)
    parameters = {
        path: quantity for path, quantity in experiment.parameters.items() if not path.startswith((*commanded, *lost))
    }
    places = dict(zip((joint.name for joint in structure.independent), q, strict=True)) if q else {}
    for joint in structure.independent:
        position = parameters[f"initial.{joint.name}.q"]
        position = replace(position, value=places[joint.name]) if q else position
        still = replace(parameters[f"initial.{joint.name}.qd"], value=0.0)
        parameters |= {f"initial.{joint.name}.q": position, f"initial.{joint.name}.qd": still}
    for use in servos:
        if use.command is not None:
            stays = parameters[f"initial.{use.joint}.q"] if use.command.kind == "position" else _ZERO
            parameters[f"{use.joint}.servo.command.value"] = stays
    for path in [path for path in parameters if path.startswith(("initial.base.velocity.", "initial.base.rate."))]:
        parameters[path] = replace(parameters[path], value=0.0)
    expressions = [
        expression
        for expression in structure.expressions
        if not any(path.startswith(lost) for path in expression.channels)
    ]
    stood: Structure = replace(
        structure, servos=servos, guides=(), metrics=(), record=(), expressions=tuple(expressions), balanced=True
    )  # fmt: skip
    return replace(
        experiment, structure=stood, parameters=parameters, requirements=(), linear=(), linear_metrics=(),
        step_errors=(), tolerances=(), search=None,
    )  # fmt: skip


_ZERO = Quantity(0.0, "", Origin("default"))


def weak(experiment: Experiment, inputs: np.ndarray) -> list[Reason]:
    """For each of these inputs, [case, input], why servos cannot hold an arm that is to stand; "" where they can."""
    return ["; ".join(map(_of_unheld, joints)) for joints in unheld(experiment, inputs, commanded=True)]


def _of_unheld(joint: Unheld) -> str:
    takes = f"`{joint.joint.name}` takes {joint.wanted:.3g} {joint.unit}, and its servo can hold {joint.holdable:.3g}"
    return f"{takes} {joint.unit}: {joint.reason}"


def settled(program: PeriodProgram, flows: Sequence[Flow]) -> list[Flow | None]:
    """Each of these flows moved to where nothing changes over a period, by Newton's method with the exact derivative;
    None for one that has no such point.

    The joints stay where they are; the unknowns are all other memory of the arm and its laws, and a number added to
    each servo's command: behind a gear that is wound up, a law sees another position than the joint's.
    """
    answers: list[Flow | None] = [None] * len(flows)
    if program.bodies:
        return answers
    never = dict.fromkeys(program.states, 0.0)  # cells that the run has not written yet
    commanded = (_commanded(program, flow) for flow in flows)
    begun = [Flow(program, flow.inputs, never | flow.cells, flow.tick) for flow in commanded]
    moving = dict(enumerate(_under_way(program, begun)))
    for _ in range(MOST_STEPS):
        now = list(moving.values())
        for flow in now:
            bring_to_rest(flow)
        maps, later = period_maps(program, now), together(now, Flow.period)
        for place, period, after in zip(list(moving), maps, later, strict=True):
            # a limit that is reached, or something breaks away: it does not stand
            stands = False if isinstance(period, Problem) else _step(moving[place], after, period)
            if stands is not None:
                flow = moving.pop(place)
                answers[place] = flow if stands and not loose_beds(flow) else None
    return answers


def _step(flow: Flow, after: Flow, period: PeriodMap) -> bool | None:
    """Do a step of Newton's method on the flow. True where it stands already, False where it never will. after: a
    period later; period: of that period"""
    program = flow.program
    now = np.array([flow.cells[name] for name in period.states])
    change = np.array([after.cells[name] for name in period.states]) - now
    if not np.isfinite(change).all():
        return False
    if np.all(np.abs(change) <= CLOSE * np.maximum(np.abs(now), 1.0)):
        return True
    fixed = _places(program)
    # while friction holds a joint, several torques do; the one that it begins with is as good as any
    of_torque, held = _of_torque(program), {*period.held}
    stays = {path for path, joint in of_torque.items() if {joint, f"{joint}.bed"} & held}
    commands = [k for k, signal in enumerate(program.inputs) if not signal.is_output and signal.path not in stays]
    sought = [place for place, name in enumerate(period.states) if name not in fixed]
    added = [[k for k, tick in enumerate(period.ticks) if tick.entry == number] for number in commands]
    columns = [(period.A - np.eye(len(now)))[:, sought], *(period.B[:, ticks].sum(1)[:, None] for ticks in added)]
    moves_by = np.hstack(columns)
    sizes = np.linalg.norm(moves_by, axis=0)
    sizes[sizes == 0.0] = 1.0  # a state that moves nothing stays as it is, as the integral of a joint that sticks
    step = np.linalg.lstsq(moves_by / sizes, -change, rcond=1e-13)[0] / sizes
    for place, size in zip(sought, step, strict=False):
        flow.cells[period.states[place]] += float(size)
    for number, size in zip(commands, step[len(sought) :], strict=True):
        cell = ADDED + program.inputs[number].path
        flow.cells[cell] = flow.cells.get(cell, 0.0) + float(size)
    return None


def _of_torque(program: PeriodProgram) -> dict[str, str]:
    """Joints whose servos take a torque command that can be solved for, by the paths of these commands."""
    kinds = {actuator.use.joint: actuator.command_kind for actuator in program.system.working}
    return {
        signal.path: signal.joint
        for signal in program.inputs
        if not signal.is_output and kinds[signal.joint] == "torque"
    }


def _commanded(program: PeriodProgram, flow: Flow) -> Flow:
    """The flow with torque-commanded servos given, from the run's start on, the torque that keeps their joints from
    accelerating: from 0 the search would cross all torques that friction holds."""
    of_torque = _of_torque(program)
    if not of_torque:
        return flow
    torques = holding_torques(program.experiment, flow.inputs)
    moved = Flow(program, flow.inputs, {}, 0)
    moved.begin()
    moved.cells |= {ADDED + path: torques[joint] for path, joint in of_torque.items() if joint in torques}
    while moved.tick < flow.tick:
        moved.ticks()
        moved.finish()
    return moved


def _under_way(program: PeriodProgram, flows: Sequence[Flow]) -> list[Flow]:
    """The flows (memories of cases) with their motor beds under way: amplifiers and queues hold what laws ask for at
    that point. All else stays as at the start."""
    copies = [flow.copy(tangents=False) for flow in flows]
    heads = tuple(f"{actuator.use.joint}{part}" for actuator, _, _ in program.system.mounted for part in HOLD)
    rates = {
        cells.REFERENCE_RATE(actuator.use.joint): 0.0 for actuator, _, law in program.system.mounted if law.observer
    }
    for _ in range(QUEUE + 1 if heads else 0):
        for flow, later in zip(copies, together(copies, Flow.period), strict=True):
            flow.cells |= {name: value for name, value in later.cells.items() if name.startswith(heads)} | rates
    return copies


def _places(program: PeriodProgram) -> tuple[str, ...]:
    """Cells of the positions of joints, and of the shafts of motor beds."""
    return (
        *program.positions,
        *(cells.SHAFT_ANGLE(actuator.use.joint) for actuator, _, _ in program.system.mounted),
    )


def _faults(program: PeriodProgram) -> Iterator[str]:
    """Paths of the faults of motor beds that are not 0 in this experiment."""
    for actuator, bed, _ in program.system.mounted:
        for name in dict.fromkeys(name for preset in bed.presets.values() for name in preset):
            path = f"{actuator.use.joint}.bed.{name}"
            if program.experiment.parameters[path].value != 0.0:
                yield path


def moves(program: PeriodProgram, flow: Flow) -> Reason:
    """The part of an arm whose rate changes most within a period that begins where a flow stands, in words."""
    if program.bodies:
        return f"`{program.bodies[0].name}` moves freely"
    (flow,) = _under_way(program, [_commanded(program, flow)])
    bring_to_rest(flow)
    (after,) = together([flow], Flow.period)
    changes = {name: abs(after.cells[name] - flow.cells[name]) / program.seconds for name in program.rates}
    faults = ", ".join(f"`{path}`" for path in _faults(program))
    if program.of_beds and faults:
        return f"its beds have faults, with which nothing comes to rest or goes evenly: {faults}"
    if loose := loose_beds(flow):
        return (
            f"no dry friction, `f_c`, holds the shaft of the bed of `{loose[0]}`, and an emulated bed stops a shaft "
            "that would turn back for the rest of a substep, so that there is no derivative at rest"
        )
    if not any(changes.values()):
        try:
            period_map(program, flow)
        except Problem as edge:
            return f"it stands still there, on an edge: {edge.diagnostics[0].message.partition(': ')[2]}"
    name = max(changes, key=lambda rate: changes[rate])
    first = name.removesuffix(".qd")
    sliding = {joint.name for joint in program.experiment.structure.moving if joint.kind == "prismatic"}
    size = f"{changes[name]:.3g} {'m/s^2' if first in sliding else 'rad/s^2'}"
    if first in {a.use.joint for a in program.system.working if a.command_kind == "torque" and not a.ticks}:
        return (
            f"`{first}` begins to move, by {size}, and the torque that would hold it is not sought: the law of its "
            "servo is `continuous`, so give it a `rate`"
        )
    mounted = {actuator.use.joint for actuator, _, _ in program.system.mounted}
    if first in mounted and after.cells.get(LIMITED, 0.0) > flow.cells.get(LIMITED, 0.0):
        return (
            f"`{first}` begins to move, by {size}: the load motor of its bed is at its limit, "
            f"`{first}.bed.i_max` times `{first}.bed.kt_load`, and does not give the torque of the arm"
        )
    return f"`{first}` begins to move, by {size}, and no constant command and no state of its servo stop it"


def refusal(experiment: Experiment, why: Reason) -> Problem:
    """The refusal of an operating point that does not exist."""
    message = f"`{experiment.name}` has no operating point in this pose: {why}"
    helps = "another pose, a stronger servo or bed; `at = TIME` asks of a motion instead"
    return Problem(error("D377", message, experiment.place, help=helps))
