"""The loop of one joint on a bed, alone: its servo, bed and law with an arm of one link of any inertia.

The loop is an experiment of its own, linearised as any other (`period`), one tick of the servo a period. It is opened
at the bed, where the arm is felt: the arm's inertia there is an input of the program, so that many arms are linearised
side by side. Its operating point is a shaft that turns at a steady rate, at which no limit is reached and no friction
changes its sign: at rest friction holds the shaft, and there is no loop. Faults are left out, since their noise and
converters would be taken for slopes; so are limits of torque, voltage and the load's current, since nothing comes back
from a loop at its limit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from met.analysis.linear.abreast import FlowAbreast
from met.analysis.linear.jacobian import seeds
from met.analysis.linear.period import PeriodProgram
from met.frozen import frozen
from met.plan import Command, Coordinate, Experiment, Formula, Joint, Link, Origin, Quantity, Schedule
from met.program.cells import REFERENCE_RATE
from met.servos.motor import Motor
from met.trace.graph import Formulas

LINK = "load"
"""The only link of the arm."""

ARM, RATE, COMMAND = "bench:arm", "bench:rate", "bench:command"
"""Inputs of the program besides those of the experiment: inertia of the arm, kg m^2 (prismatic: mass, kg), the rate of
the joint, and the one that it is commanded, rad/s (m/s). No path of a deck's has a colon."""

PUSHES = (1.0, 2.0, 5.0, 11.0, 40.0, 200.0, 1000.0)
"""Factors on the rate that a joint is commanded, tried in turn until its shaft keeps its direction for a tick: where
the real motor differs from the law's model, the load may turn the shaft back, and an emulated bed then stops it for the
rest of a substep. Without limits the factor changes no derivative."""

BEYOND = 1e9
"""Limit of torque, N m (N), and of voltage, V, that no loop reaches, even where the real motor differs from the law's
model and the shaft slows down."""

LONG = 1000.0
"""Number of periods for which a position command goes on at that rate; one of them is linearised."""


class BedLoop:
    """The loop of one joint of an experiment, for any of its cases."""

    def __init__(self, experiment: Experiment, joint: str) -> None:
        self.joint, self.program = joint, PeriodProgram(by_itself(experiment, joint))

    def of_case(self, case_inputs: Mapping[str, float], motor: Motor) -> CaseLoop:
        """The loop of a case. case_inputs: its inputs of the experiment's program;  motor: the joint's"""
        # back-EMF alone then takes half of the available torque
        rate = 0.5 * motor.tau_max * motor.resistance / (motor.kt * motor.kt * motor.ratio)
        inputs = {**case_inputs, ARM: 1.0, RATE: float(rate), COMMAND: float(rate)}
        begun = FlowAbreast(self.program, inputs, {}, 0, 1)
        begun.begin_settled()
        rotor, joint = float(motor.ratio * motor.ratio * motor.inertia), self.joint
        turning = frozenset({f"{joint}.bed.shaft_rate", REFERENCE_RATE(joint)})
        return CaseLoop(self.program, inputs, begun.cells, rotor, turning)


@frozen
class CaseLoop:
    """The loop of a case, before its first tick.

    inputs, cells  of its program;  rotor: N^2 J_m, kg m^2 (kg);  turning: cells of turning parts, by name
    """

    program: PeriodProgram
    inputs: Mapping[str, float]
    cells: Mapping[str, float]
    rotor: float
    turning: frozenset[str]

    def maps(self, ratios: Sequence[float]) -> tuple[np.ndarray, tuple[str, ...]]:
        """The map from tick to tick with an arm of each of these r, [arm, state, state], not-a-number where an event is
        in the tick or the shaft turns back; and its states: those that act on others, which leaves out an angle that
        only adds up."""
        names = self.program.states
        maps = np.full((len(ratios), len(names), len(names)), np.nan)
        left = np.arange(len(ratios))
        for push in PUSHES:
            some = self._maps(np.array(ratios)[left], push)
            maps[left] = some
            left = left[np.isnan(some).any((1, 2))]
            if not left.size:
                break
        known = maps[~np.isnan(maps).any((1, 2))]
        act = np.flatnonzero(np.any(known != np.eye(len(names)), axis=(0, 1)))
        return maps[:, act][:, :, act], tuple(names[place] for place in act)

    def _maps(self, ratios: np.ndarray, push: float) -> np.ndarray:
        """The maps over all states, [arm, state, state], while the joint is commanded `push` times its rate."""
        program, arms = self.program, self.rotor * ratios[:, None]
        inputs = {**self.inputs, ARM: arms, COMMAND: np.full_like(arms, push * self.inputs[RATE])}
        flow = FlowAbreast(program, inputs, {}, 0, len(arms))
        flow.begin_as(self.cells)
        flow.ticks()
        flow.finish()  # no bed is under way before
        names, n = program.states, len(program.states)
        flow.tangents = seeds(program, flow, names, n)
        flow.ticks()
        flow.finish()
        maps = np.stack([np.broadcast_to(flow.tangent(name), (len(arms), n)) for name in names], axis=1)
        turns = [name for name in names if name in self.turning]
        back = [np.broadcast_to(flow.cells[name] <= 0.0, (len(arms), 1))[:, 0] for name in turns]
        maps[np.logical_or.reduce([flow.unusual, flow.on_kink, *back])] = np.nan
        return maps

    def radii(self, ratios: Sequence[float]) -> np.ndarray:
        """The spectral radius of a tick with an arm of each of these r, [arm]; infinite where it is not finite."""
        maps, _ = self.maps(ratios)
        radii, numbers = np.full(len(maps), np.inf), np.isfinite(maps).all((1, 2))
        radii[numbers] = np.abs(np.linalg.eigvals(maps[numbers])).max(1, initial=0.0)
        return radii


def by_itself(experiment: Experiment, joint: str) -> Experiment:
    """The experiment reduced to one substituted joint without the rest of its arm, at the ticks of its servo."""
    structure, formulas = experiment.structure, experiment.formulas
    servo = next(use for use in structure.servos if use.joint == joint)
    moved = next(other for other in structure.joints if other.name == joint)
    schedule = Schedule(structure.schedule.base_hz / servo.divisor, 1, 1, 2)
    kind = "rate" if servo.command is None else servo.command.kind
    alone = replace(
        structure,
        links=(Link(LINK),),
        joints=(Joint(joint, moved.kind, "base", LINK),),
        servos=(replace(servo, divisor=1, command=Command(kind, "ramp" if kind == "position" else "constant")),),
        substitutions=tuple(use for use in structure.substitutions if use.joint == joint),
        schedule=schedule,
        environment=(),
        metrics=(),
        record=(),
        payloads=(),
        guides=(),
        sensors=(),
        expressions=(),
        base=None,
        balanced=False,
    )
    n, outputs, over = 2 * len(formulas.nodes), len(formulas.outputs), LONG / schedule.base_hz
    own_formulas = Formulas(
        (*formulas.inputs, ARM, RATE, COMMAND),
        (
            *formulas.nodes,
            *(("input", name) for name in (ARM, RATE, COMMAND)), ("const", over), ("mul", n + 4, n + 6),
        ),
        (*formulas.outputs, n, n + 2, n + 4, n + 8),
    )  # fmt: skip
    arm, rate, commanded, far = (_number(Formula(outputs + k)) for k in range(4))
    command = f"{joint}.servo.command."
    parameters = {
        path: value
        for path, value in experiment.parameters.items()
        if path.startswith((f"{joint}.servo.", f"{joint}.bed.", f"{joint}.law.")) and not path.startswith(command)
    }
    limits = (f"{joint}.servo.tau_max", f"{joint}.servo.v_max", f"{joint}.bed.tau_max")
    parameters |= {path: _number(BEYOND) for path in limits if path in parameters}
    places = [f"{joint}.{part}.{axis}" for part in ("at", "rpy", "axis") for axis in "xyz"]
    inertias = [f"inertia.{axes}" for axes in ("xx", "yy", "zz", "xy", "xz", "yz")]
    body = [f"links.{LINK}.{entry}" for entry in ("mass", "com.x", "com.y", "com.z", *inertias)]
    parameters |= dict.fromkeys(
        (*places, *body, f"initial.{joint}.q", f"{command}value", f"{command}begin"), _number(0.0)
    )
    parameters |= {f"{joint}.axis.z": _number(1.0), f"initial.{joint}.qd": rate}
    parameters[f"links.{LINK}.{'mass' if moved.kind == 'prismatic' else 'inertia.zz'}"] = arm
    if kind == "position":
        parameters |= {f"{command}start": _number(0.0), f"{command}to": far, f"{command}over": _number(over)}
    elif kind == "rate":
        parameters[f"{command}value"] = commanded
    inputs = (Coordinate(path, "", 1.0, np.zeros(experiment.cases.count), ()) for path in (ARM, RATE, COMMAND))
    return replace(
        experiment, structure=alone, parameters=parameters, formulas=own_formulas, requirements=(), linear=(),
        linear_metrics=(), step_errors=(), tolerances=(), search=None,
        cases=replace(experiment.cases, coordinates=(*experiment.cases.coordinates, *inputs)),
    )  # fmt: skip


def _number(value: float | Formula) -> Quantity:
    return Quantity(value, "", Origin("derived"))
