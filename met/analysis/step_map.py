"""The linearised step of the dynamics, and the true linear motion over the same time.

The program's own phases are run over arrays, once for all changes: the derivative's slopes give A of dx/dt = A x, with
all that has a part in the motion, and the inertia that the joints have at that pose: springs, gears, damping, filters,
laws that are continuous, models of other packages. The outputs of computers are held, and friction keeps its modes. M
of x+ = M x is the integrator's map for A, or that of the program, stage by stage. About a state at rest the two are
equal. About a moving state the second includes the change of A within the step, and is no measure of the integrator.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from met.analysis import laws
from met.analysis.lanes import SMALL, SMALL_STATE, LaneTape, differences, to_both_sides
from met.analysis.laws import SampledLaw
from met.frozen import frozen
from met.integrators.integrator import Integrator, Motion, Slope
from met.parameter import Parameter
from met.plan import Experiment
from met.plan.columns import blocks
from met.program.build import Builder
from met.program.cells import FIRST, FRICTION_MODE, HOLDING, SLOPE
from met.program.evaluation import brake_levels
from met.program.motion import bodies
from met.program.step import STAGE
from met.program.system import System

AT_ONCE = 2000
"""Lanes over which the program is run at once: more take more memory, fewer more time (600 joints: 0.5 GB, 4 s)."""


@frozen
class StepMap:
    """The linearised step of some cases of one experiment, each as it is at an instant, and at rest in that pose: two
    lanes, one after the other.

    case     rows of the case table: [lane]
    loose    whether it is at rest there, without drive, and no dry friction holds anything; else as the run has it
    names    of what is changed: `shoulder.q`, `shoulder.qd`, states of servos and sensors
    positions  how many of these, at the front, are positions; as many rates follow, then states
    slope    A: [lane, name, name], 1/s
    step     M: [lane, name, name], of one step as the program's stages make it, where these were asked for; None: what
             the integrator makes of A (`linear_step`)
    rate     largest rate of turning at that state, of a joint or a free body, rad/s: [lane]
    h        length of the step, s
    """

    case: np.ndarray
    loose: np.ndarray
    names: tuple[str, ...]
    positions: int
    slope: np.ndarray
    step: np.ndarray | None
    rate: np.ndarray
    h: float


@frozen
class SampledLoops:
    """Arms, loose or as the run has them, with the laws on them.

    case    rows of the case table
    states  how many cells are of the state, positions first;  held: cells of the memory of laws and their sensors
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


class TooLarge(Exception):
    """A program has more states than are to be linearised. The text says how many, in words."""


class Linearizer:
    """The program of an experiment at an instant, the first one or another, for several cases at once: each as it is
    there, with resting parts held by their friction, and loose. A motor on a bed lets its joint keep turning."""

    def __init__(
        self,
        experiment: Experiment,
        cases: Sequence[int],
        memory: Mapping[str, np.ndarray] | None = None,
        *,
        opened: bool = False,
        most: float = math.inf,
    ) -> None:
        """memory: cells of these cases at instants that they pass, [lane]; a case may be there several times. None:
        where they begin. opened: continuous laws are kept apart from the slopes, as laws that tick are. most: number of
        states beyond which TooLarge is raised"""
        structure, self._arguments = experiment.structure, (experiment, cases, memory)
        self.continuous = frozenset(use.joint for use in structure.servos if use.continuous)
        if opened:
            structure = replace(structure, servos=tuple(replace(use, continuous=False) for use in structure.servos))
        self.system = System(replace(experiment, structure=replace(structure, metrics=())))
        self.builder = Builder(self.system)
        self.cases = np.asarray(cases, dtype=np.int64)
        table = {coordinate.path: coordinate.values[self.cases] for coordinate in experiment.cases.coordinates}
        lanes = len(self.cases)
        # any value serves as the noise seed: none of it is changed
        inputs = table | dict.fromkeys(experiment.cases.noise, np.zeros(lanes))
        begun, step = LaneTape(self.builder.schedule.base_hz, inputs, lanes), self.builder.step
        with np.errstate(all="ignore"):
            self.builder.start(begun)
            begun.follow((*step.grapple.events(), *self.builder.computers()))
            step.modes(begun)
        if memory is not None:
            begun.cells.update(
                {
                    name: values
                    for name, values in memory.items()
                    if name in begun.cells or name.startswith(bodies.PAYLOAD)
                }
            )
        held = self._braked(begun) if memory is None else {}
        self.tape, self.loose = begun.spread(2), np.tile([False, True], lanes)
        self._loosen(held)
        self.cells = tuple(f"{name}.{part}" for part in ("q", "qd") for name in step.coordinates) + step.states
        driven = [
            actuator
            for actuator in self.system.working
            if actuator.servo.control is not None and actuator.command_kind not in ("torque", "none")
        ]
        if self.system.structure.substitutions:
            driven = []
        self.has_laws = bool(driven)
        self.laws = tuple(actuator for actuator in driven if actuator.ticks)
        self.held = tuple(name for law in self.laws for name in laws.memory(law))
        if len(self.cells) > most:
            raise TooLarge(f"{len(self.cells):,} states, and {most:,} is the most")
        own = tuple(f"{law.path}.{part.name}" for law in self.laws for part in law.parts.memory)
        self.slope = np.zeros((2 * lanes, len(self.cells), len(self.cells) + len(self.held)))
        numbers = {name: place for place, name in enumerate((*self.cells, *self.held))}
        places = np.array([numbers[name] for name in (*self.cells, *own)], dtype=int)
        for block in blocks(len(places), max(1, AT_ONCE // (4 * lanes))):
            wide, moved, sizes = self._moved((*self.cells, *own), block)
            with np.errstate(all="ignore"):
                wide.cells.update({name: moved[name] for name in own})
                wide.cells.update({FIRST(name): moved[name] for name in own})
                self.slope[:, :, places[block]] = self._slopes(wide, moved, sizes)

    def map(self, *, stages: bool = False) -> StepMap:
        """The map of each case, as it begins and loose. stages: with M of the program's stages."""
        step, system, n = self.builder.step, self.system, len(self.cells)
        straight = {joint.name for joint in system.joints if joint.kind == "prismatic"}
        straight |= {name for body in bodies.bodies(system) for name in body.coordinates[:3]}
        turning = [self.tape.lane(f"{name}.qd") for name in step.coordinates if name not in straight]
        rate = np.max(np.abs(turning), axis=0) if turning else np.zeros(self.tape.lanes)
        A, h, positions = self.slope[:, :, :n], step.schedule.step, len(step.coordinates)
        with np.errstate(all="ignore"):
            M = self._of_stages() if stages else None
        return StepMap(np.repeat(self.cases, 2), self.loose, self.cells, positions, A, M, rate, h)

    def opened(self) -> Linearizer:
        """The slopes with continuous laws kept apart."""
        return Linearizer(*self._arguments, opened=True)

    def sampled(
        self, *, loose: bool = True, scaled: Mapping[str, Mapping[str, float]] | None = None
    ) -> SampledLoops | None:
        """The cases with their laws, loose or as the run has them; None where no law is closed over the arm, or a motor
        is on a bed.

        scaled  by joint: what parameters of its servo are multiplied by in its law, by name
        """
        if not self.has_laws:
            return None
        step, schedule, wanted = self.builder.step, self.builder.step.schedule, self.loose == loose
        tape = self.tape.only(wanted)
        with np.errstate(all="ignore"):
            wanted_laws = tuple(
                laws.linearised(
                    self.builder,
                    law,
                    tape,
                    (*self.cells, *self.held),
                    continuous=law.use.joint in self.continuous,
                    scaled=(scaled or {}).get(law.use.joint),
                )
                for law in self.laws
            )
        return SampledLoops(
            self.cases, len(self.cells), len(step.coordinates), self.held, self.slope[wanted], wanted_laws,
            self.system.integrator, schedule.step, schedule.dynamics, schedule.base_hz,
        )  # fmt: skip

    def gains(self, joint: str) -> tuple[Parameter, ...]:
        """The parameters of a joint's servo that only its law uses."""
        (actuator,) = (law for law in self.laws if law.use.joint == joint)
        with np.errstate(all="ignore"):
            return tuple(laws.gains(self.builder, actuator, self.tape.only(self.loose)))

    def loads(self) -> np.ndarray:
        """Inertias of the arm at the joints whose motors are on beds, as the run has them, kg m^2 (prismatic: kg):
        [lane, joint, joint]; all other joints keep their modes."""
        with np.errstate(all="ignore"):
            Lambda, _ = self.builder.step.loads(self.tape)
        of_lanes: list[list[Any]] = [[np.broadcast_to(np.asarray(x), self.tape.lanes) for x in row] for row in Lambda]
        return np.moveaxis(np.array(of_lanes, dtype=float), -1, 0)[~self.loose]

    @property
    def _turned(self) -> tuple[str, ...]:
        """Rotation coordinates of free bodies: at the start they are 0."""
        return tuple(name for body in bodies.bodies(self.system) for name in body.coordinates[3:])

    def _moved(self, cells: Sequence[str], block: slice = slice(None)) -> tuple[LaneTape, dict[str, Any], np.ndarray]:
        """A tape with a lane to each side of each of these cells that are in a block, the values of all, and the
        differences: [lane, moved]."""
        tape, turned = self.tape, {f"{name}.q" for name in self._turned}
        plain = 2 * len(self.builder.step.coordinates)
        start = np.array([np.zeros(tape.lanes) if name in turned else tape.lane(name) for name in cells])
        size = np.abs(start) * SMALL + SMALL
        size[plain:] = np.abs(start[plain:]) * 1e-7 + SMALL_STATE
        moved, sizes = to_both_sides(start, size, block)
        return tape.spread(2 * sizes.shape[1]), dict(zip(cells, moved, strict=True)), sizes

    def _slopes(self, wide: LaneTape, moved: Mapping[str, Any], sizes: np.ndarray) -> np.ndarray:
        """Slopes of the state: [lane, cell, moved cell]."""
        step = self.builder.step
        wide.cells.update({STAGE + name: moved[name] for name in self.cells})
        wide.write(f"{STAGE}fraction", 0.0)
        step.slope(wide)
        slopes: dict[str, Any] = {f"{name}.qd": wide.read(f"{STAGE}{name}.qdd") for name in step.coordinates}
        slopes |= {f"{name}.q": moved[f"{name}.qd"] for name in step.coordinates}
        slopes |= {f"{name}.q": wide.read(f"{STAGE}{name}.qd") for name in self._turned}
        slopes |= {name: wide.read(STAGE + SLOPE(name)) for name in step.states}
        return differences(slopes, self.cells, sizes)

    def _braked(self, tape: LaneTape) -> dict[str, np.ndarray]:
        """The joints that brakes hold where a case begins, and as strong as at the run's end: a truth for each lane. A
        brake that slips later shows at the instants that the case passes."""
        system, step = self.system, self.builder.step
        if not system.braked:
            return {}
        begun, end = tape.spread(1), step.schedule.duration - step.schedule.step
        with np.errstate(all="ignore"):
            step.derive(begun)
            y = step.state(begun)
            first, last = (brake_levels(system, begun.read, y, time, time) for time in (0.0, end))
        return {
            joint: np.broadcast_to(
                (np.abs(begun.lane(HOLDING(joint))) <= first[joint]) & (first[joint] <= last[joint]),
                tape.lanes,
            )
            for joint in first
        }

    def _loosen(self, held: Mapping[str, np.ndarray]) -> None:
        """Release the loose lanes: rates and computers' outputs are 0, and all dry friction is sliding, except at
        joints held by brakes."""
        tape, step, loose = self.tape, self.builder.step, self.loose
        memory = [f"{actuator.path}.{part.name}" for actuator in self.system.working for part in actuator.parts.memory]
        first = [FIRST(name) for name in memory]
        for name in (*(f"{coordinate}.qd" for coordinate in step.coordinates), *memory, *first):
            if name in tape.cells:
                tape.cells[name] = np.where(loose, 0.0, tape.lane(name))
        for sticking in step.sticking:
            name = FRICTION_MODE(sticking.name)
            lets_go = loose & (tape.lane(name) == 0.0)
            if sticking.name in held:
                lets_go &= ~np.repeat(held[sticking.name], 2)
            tape.cells[name] = np.where(lets_go, 1.0, tape.lane(name))

    def _of_stages(self) -> np.ndarray:
        """M from the program's own phases, run from changed states."""
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
        return differences(ends, self.cells, sizes)


def linear_step(integrator: Integrator, A: np.ndarray, positions: int, h: float) -> np.ndarray:
    """M of a step of h s of dx/dt = A x, where x is `positions` positions, as many rates, then states; A may be
    several, [..., name, name]."""
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
    """The rotations from the orientation of the first lane of each case to those of its lanes: rotation vectors,
    rad."""
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
