"""The step of the dynamics linearised: what it makes of a small change of the state, and what the truth does.

The program's own phases are run over arrays, once for all changes: the derivative's slopes give A of dx/dt = A x, with
all that has a part in the motion, and the inertia that the joints have at that pose: springs, gears, damping, filters,
laws that are continuous, models of other packages. What computers hold is held, and friction keeps its modes. M of
x+ = M x is what the integrator makes of A; or of the program, stage by stage. About a state that stands still these are
one. Where it does not, the second has the change of A within the step too, and is no measure of the integrator.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from typing import Any

import numpy as np

from met.frozen import frozen
from met.integrators.integrator import Integrator, Motion, Slope
from met.plan import Experiment
from met.program import cell_names
from met.program.build import Builder
from met.program.control import sensing
from met.program.evaluation import law
from met.program.motion import bodies
from met.program.step import STAGE
from met.program.system import Actuator, System
from met.program.values import NamedValues
from met.servos.servo import Setpoint
from met.trace import Real, Truth
from met.trace.program import CallPhase, Control, Every, RunPhase, Unless0, WhileAny

SMALL = 1e-6
"""Change of a position or a rate by which differences are taken, as a share of it, or of 1 rad, 1 m, 1 rad/s, 1 m/s."""

SMALL_STATE = 1e-9
"""The same of a state of a servo or sensor, in its unit: some live in micrometres, and none of them turns the arm."""


@frozen
class StepMap:
    """The linearised step of some cases of one experiment, each as it is at an instant, and at rest in that pose: two
    lanes, one after the other.

    case     rows of the case table: [lane]
    loose    whether it is at rest there, without drive, and no dry friction holds anything; else as the run has it
    names    of what is changed: `shoulder.q`, `shoulder.qd`, states of servos and sensors
    counts   of these, positions (and as many rates); the rest are states
    slope    A: [lane, name, name], 1/s
    step     M: [lane, name, name], of one step
    rate     largest rate of turning at that state, of a joint or a free body, rad/s: [lane]
    h        length of the step, s
    """

    case: np.ndarray
    loose: np.ndarray
    names: tuple[str, ...]
    positions: int
    slope: np.ndarray
    step: np.ndarray
    rate: np.ndarray
    h: float


@frozen
class SampledLaw:
    """The linearised law of a servo that ticks: what a tick makes of state and memory.

    memory   its cells: outputs, then integrals;  outputs: how many of them are outputs
    divisor  ticks of the base rate from one to the next
    slope    [lane, memory, state and all servos' memory]
    """

    joint: str
    divisor: int
    memory: tuple[str, ...]
    outputs: int
    slope: np.ndarray


@frozen
class SampledLoops:
    """Arms, loose or as the run has them, with the laws that tick on them.

    case    rows of the case table
    states  how many cells are of the state, positions first;  held: cells of the laws' memory
    slope   A: [lane, state, state and memory], 1/s
    h       length of the step, s;  divisor: in ticks of the base rate, base_hz
    """

    case: np.ndarray
    states: int
    positions: int
    held: tuple[str, ...]
    slope: np.ndarray
    laws: tuple[SampledLaw, ...]
    integrator: Integrator
    h: float
    divisor: int
    base_hz: float


class LaneTape:
    """A `Tape` over arrays: one number a lane, where the lanes differ."""

    def __init__(self, base_hz: float, inputs: Mapping[str, np.ndarray], lanes: int) -> None:
        self.base_hz = base_hz
        self.inputs = dict(inputs)
        self.cells: dict[str, Any] = {}
        self.lanes = lanes
        self.k = 0

    @property
    def tick(self) -> Real:
        return np.float64(self.k)

    @property
    def time(self) -> Real:
        return np.float64(self.k) / np.float64(self.base_hz)

    def read(self, name: str) -> Real:
        found: Real = self.cells.get(name, ZERO)
        return found

    def write(self, name: str, value: Any) -> None:
        self.cells[name] = value if value.__class__ is np.ndarray else np.float64(value)

    def read_mask(self, name: str) -> Truth:
        found: Any = self.cells.get(name, ZERO) != 0.0
        truth: Truth = found if isinstance(found, np.ndarray) else bool(found)  # type: ignore[assignment]
        return truth

    def write_mask(self, name: str, value: Any) -> None:
        self.cells[name] = np.where(value, 1.0, 0.0) if isinstance(value, np.ndarray) else np.float64(bool(value))

    def input(self, name: str) -> Real:
        found: Any = self.inputs[name]
        return found

    def record(self, column: int, value: Real) -> None:
        """Nothing is kept of a row."""

    def output(self, name: str, value: Real) -> None:
        """Nothing is kept of an end."""

    def part(self, name: str) -> AbstractContextManager[None]:
        return nullcontext()

    def lane(self, name: str) -> np.ndarray:
        """A cell, one number a lane."""
        return np.broadcast_to(np.asarray(self.read(name), dtype=float), (self.lanes,))

    def spread(self, times: int) -> LaneTape:
        """The same with every lane that often, one beside the other."""
        made = LaneTape(self.base_hz, {}, self.lanes * times)
        made.k = self.k
        made.inputs = {name: np.repeat(value, times) for name, value in self.inputs.items()}
        made.cells = {
            name: np.repeat(value, times) if isinstance(value, np.ndarray) else value
            for name, value in self.cells.items()
        }
        return made

    def follow(self, body: Iterable[Control]) -> None:
        """Runs the body once, at the tape's tick; of loops those in which payloads change hands: what repeats until
        something is decided is not run."""
        for node in body:
            match node:
                case RunPhase(phase) | CallPhase(phase):
                    phase.body(self)
                case Every(divisor, inner):
                    if self.k % divisor == 0:
                        self.follow(inner)
                case Unless0(inner):
                    if self.k > 0:
                        self.follow(inner)
                case WhileAny(cell, _, inner):
                    if cell in ("grappling", "releasing") and np.any(self.lane(cell) != 0.0):
                        self.follow(inner)


ZERO = np.float64(0.0)


class Linearizer:
    """The program of an experiment at an instant, the first one or another, for several cases at once: each as it is
    there, where what is at rest and rubs is held, and loose. A motor on a bed lets its joint turn on as it does."""

    def __init__(
        self, experiment: Experiment, cases: Sequence[int], memory: Mapping[str, np.ndarray] | None = None
    ) -> None:
        """memory: cells of these cases at instants that they pass, [lane]; a case may be there several times. None:
        where they begin."""
        self.system = System(replace(experiment, structure=replace(experiment.structure, metrics=())))
        self.builder = Builder(self.system)
        self.cases = np.asarray(cases, dtype=np.int64)
        table = {each.path: each.values[self.cases] for each in experiment.cases.coordinates}
        lanes = len(self.cases)
        # of what noise is a case's own, any will do: none of it is changed
        given = table | dict.fromkeys(experiment.cases.noise, np.zeros(lanes))
        begun, step = LaneTape(self.builder.schedule.base_hz, given, lanes), self.builder.step
        with np.errstate(all="ignore"):
            self.builder.start(begun)
            begun.follow((*step.grapple.events(), *self.builder.computers()))
            step.modes(begun)
        if memory is not None:
            begun.cells.update({name: memory[name] for name in begun.cells if name in memory})
        self.tape, self.loose = begun.spread(2), np.tile([False, True], lanes)
        self._loosen()
        self.cells = tuple(f"{name}.{part}" for part in ("q", "qd") for name in step.coordinates) + step.states
        sampled = [each for each in self.system.working if each.ticks and each.command_kind not in ("torque", "none")]
        self.laws = () if self.system.structure.substitutions else tuple(sampled)
        self.held = tuple(f"{each.path}.{part.name}" for each in self.laws for part in each.parts.memory)
        self.wide, self.moved, self.sizes = self._moved((*self.cells, *self.held))
        with np.errstate(all="ignore"):
            self.wide.cells.update({name: self.moved[name] for name in self.held})
            self.wide.cells.update({cell_names.FIRST(name): self.moved[name] for name in self.held})
            self.slope = self._slopes(self.wide, self.moved, self.sizes)

    def map(self, *, stages: bool = False) -> StepMap:
        """The map of each case, as it begins and loose. stages: M is of the program's stages."""
        step, system, n = self.builder.step, self.system, len(self.cells)
        straight = {joint.name for joint in system.joints if joint.kind == "prismatic"}
        straight |= {name for body in bodies.bodies(system) for name in body.coordinates[:3]}
        turning = [self.tape.lane(f"{name}.qd") for name in step.coordinates if name not in straight]
        rate = np.max(np.abs(turning), axis=0) if turning else np.zeros(self.tape.lanes)
        A, h, positions = self.slope[:, :, :n], step.schedule.step, len(step.coordinates)
        with np.errstate(all="ignore"):
            M = self._of_stages() if stages else linear_step(system.integrator, A, positions, h)
        return StepMap(np.repeat(self.cases, 2), self.loose, self.cells, positions, A, M, rate, h)

    def sampled(self, *, loose: bool = True) -> SampledLoops | None:
        """The cases with their laws that tick, loose or as the run has them; None where none does, or one is on a
        bed."""
        if not self.laws:
            return None
        step, schedule = self.builder.step, self.builder.step.schedule
        with np.errstate(all="ignore"):
            laws = tuple(self._law(each, self.loose == loose) for each in self.laws)
        return SampledLoops(
            self.cases, len(self.cells), len(step.coordinates), self.held, self.slope[self.loose == loose], laws,
            self.system.integrator, schedule.step, schedule.dynamics, schedule.base_hz,
        )  # fmt: skip

    def loads(self) -> np.ndarray:
        """Effective inertias of the joints whose motors are on beds, as the run has them, kg m^2 (prismatic: kg):
        [lane, joint, joint]; all other joints keep their modes."""
        with np.errstate(all="ignore"):
            Lambda, _ = self.builder.step.loads(self.tape)
        of_lanes: list[list[Any]] = [[np.broadcast_to(np.asarray(x), self.tape.lanes) for x in row] for row in Lambda]
        return np.moveaxis(np.array(of_lanes, dtype=float), -1, 0)[~self.loose]

    def _law(self, actuator: Actuator, lanes: np.ndarray) -> SampledLaw:
        """A law's slopes in these lanes, under a command that its joint be as it is."""
        joint, parts, moved = actuator.use.joint, actuator.parts, self.moved
        p = self.system.servo_values(actuator, self.wide.read)
        states: dict[str, Any] = {each.name: moved[f"{actuator.path}.{each.name}"] for each in parts.natural}
        q, qd = sensing.measured(
            actuator, p, moved[f"{joint}.q"], moved[f"{joint}.qd"], NamedValues(actuator.owner, states)
        )
        times = self.wide.lanes // self.tape.lanes
        still: Any = np.repeat(self.tape.lane(f"{joint}.q"), times) if actuator.command_kind == "position" else ZERO
        seen = self.builder.seen(actuator, q, qd, Setpoint(actuator.command_kind, still, ZERO), ZERO, states)
        held = {part.name: moved[f"{actuator.path}.{part.name}"] for part in parts.memory}
        found = law(actuator, p, NamedValues(actuator.owner, held), seen)
        after: dict[str, Any] = {f"{actuator.path}.{name}": value for name, value in found.outputs.items()}
        after |= {f"{actuator.path}.{name}": held[name] + seen.period * x for name, x in found.slopes.items()}
        memory = tuple(f"{actuator.path}.{part.name}" for part in parts.memory)
        slope = _differences(after, memory, self.sizes)[lanes]
        return SampledLaw(joint, actuator.use.divisor, memory, len(parts.outputs), slope)

    @property
    def _turned(self) -> tuple[str, ...]:
        """Coordinates of free bodies that are turns: at the start they are 0."""
        return tuple(name for body in bodies.bodies(self.system) for name in body.coordinates[3:])

    def _moved(self, cells: Sequence[str]) -> tuple[LaneTape, dict[str, Any], np.ndarray]:
        """A tape with a lane to each side of each of these cells, their values, and the differences: [lane, cell]."""
        tape, turned = self.tape, {f"{name}.q" for name in self._turned}
        n, lanes, plain = len(cells), tape.lanes, 2 * len(self.builder.step.coordinates)
        start = np.array([np.zeros(lanes) if name in turned else tape.lane(name) for name in cells])
        size = np.abs(start) * SMALL + SMALL
        size[plain:] = np.abs(start[plain:]) * 1e-7 + SMALL_STATE
        made = np.empty((n, lanes, n, 2))
        made[:] = start[:, :, None, None]
        each = np.arange(n)
        made[each, :, each, 0] += size
        made[each, :, each, 1] -= size
        sizes = made[each, :, each, 0] - made[each, :, each, 1]
        return tape.spread(2 * n), dict(zip(cells, made.reshape(n, -1), strict=True)), sizes.T

    def _slopes(self, wide: LaneTape, moved: Mapping[str, Any], sizes: np.ndarray) -> np.ndarray:
        """Slopes of the state: [lane, cell, what was moved]."""
        step = self.builder.step
        wide.cells.update({STAGE + name: moved[name] for name in self.cells})
        wide.write(f"{STAGE}fraction", 0.0)
        step.slope(wide)
        slopes: dict[str, Any] = {f"{name}.qd": wide.read(f"{STAGE}{name}.qdd") for name in step.coordinates}
        slopes |= {f"{name}.q": moved[f"{name}.qd"] for name in step.coordinates}
        slopes |= {f"{name}.q": wide.read(f"{STAGE}{name}.qd") for name in self._turned}
        slopes |= {name: wide.read(STAGE + cell_names.SLOPE(name)) for name in step.states}
        return _differences(slopes, self.cells, sizes)

    def _loosen(self) -> None:
        """Lets go in the loose lanes: rates and what computers hold are 0, and all dry friction is of sliding."""
        tape, step, loose = self.tape, self.builder.step, self.loose
        memory = [f"{each.path}.{part.name}" for each in self.system.working for part in each.parts.memory]
        first = [cell_names.FIRST(name) for name in memory]
        for name in (*(f"{each}.qd" for each in step.coordinates), *memory, *first):
            if name in tape.cells:
                tape.cells[name] = np.where(loose, 0.0, tape.lane(name))
        for each in step.sticking:
            name = cell_names.FRICTION_MODE(each.name)
            tape.cells[name] = np.where(loose & (tape.lane(name) == 0.0), 1.0, tape.lane(name))

    def _of_stages(self) -> np.ndarray:
        """M as the program's own phases make it of changed states."""
        step, free, turned = self.builder.step, bodies.bodies(self.system), self._turned
        wide, moved, sizes = self._moved(self.cells)
        wide.cells.update({name: value for name, value in moved.items() if name.removesuffix(".q") not in turned})
        for body in free:
            bodies.turn_by(body, wide, tuple(moved[f"{name}.q"] for name in body.coordinates[3:]))
        step.derive(wide)
        wide.follow(step.finish())
        ends = {name: wide.lane(name) for name in self.cells}
        for body in free:
            ends |= _turns(body, wide, len(self.cells))
        return _differences(ends, self.cells, sizes)


def _differences(values: Mapping[str, Any], cells: Sequence[str], sizes: np.ndarray) -> np.ndarray:
    """[lane, of, by] of values in lanes that were moved to both sides; sizes: [lane, by]."""
    lanes, n = sizes.shape
    found = np.array([np.broadcast_to(values[name], (lanes * 2 * n,)) for name in cells])
    pairs = found.reshape(len(cells), lanes, n, 2)
    return np.moveaxis((pairs[..., 0] - pairs[..., 1]) / sizes, 0, 1)


def linear_step(integrator: Integrator, A: np.ndarray, positions: int, h: float) -> np.ndarray:
    """M of a step of h s of dx/dt = A x, where x is that many positions, as many rates, then states; A may be several,
    [..., name, name]."""
    n, size = positions, A.shape[-1]

    def motion(x: np.ndarray) -> Motion:
        return Motion(tuple(x[:n]), tuple(x[n : 2 * n]), tuple(x[2 * n :]))

    def stacked(y: Any) -> np.ndarray:
        return np.stack((*y.q, *y.qd, *y.x), axis=-2)

    def slope(_: float, y: Motion) -> Slope:
        x = np.moveaxis(A @ stacked(y), -2, 0)
        return Slope(tuple(x[:n]), tuple(x[n : 2 * n]), tuple(x[2 * n :]))

    start = motion(np.moveaxis(np.broadcast_to(np.eye(size), A.shape), -2, 0))
    return stacked(integrator.advance(slope, h, start, slope(0.0, start)))


def _turns(body: bodies.FreeBody, tape: LaneTape, n: int) -> dict[str, np.ndarray]:
    """The turns between the orientations of lanes, and that of the first lane of their case: rotation vectors, rad."""
    now = np.stack([tape.lane(cell) for cell in body.orientation]).reshape(4, -1, 2 * n)
    w0, x0, y0, z0 = (part[:, :1] for part in now)
    w, x, y, z = now
    # the vector part of conj(q_0) o q
    turned = (
        w0 * x - x0 * w - y0 * z + z0 * y,
        w0 * y + x0 * z - y0 * w - z0 * x,
        w0 * z - x0 * y + y0 * x - z0 * w,
    )
    return {f"{name}.q": 2.0 * part.reshape(-1) for name, part in zip(body.coordinates[3:], turned, strict=True)}
