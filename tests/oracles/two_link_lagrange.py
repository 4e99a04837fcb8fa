"""An independent answer for the planar two-link arm: closed-form Lagrange equations, exact stick-slip.

Nothing here comes from met or ic: numpy and scipy only, and a different method throughout. The arm's equations are
written down in closed form instead of by recursion; between two ticks of the servo the voltage is constant and
scipy's DOP853 integrates to `rtol`; a joint that comes to rest, and a stuck one that breaks away, are located as
events; which of the joints at rest stick is found by trying every combination, of which exactly one is consistent.

    M(q2) qdd + h(q, qd) = tau_load        tau_load = tau - N^2 J_m qdd        tau = N (tau_m - friction)

Both joints turn about z. Link 1 starts at joint 1, joint 2 is at link 1's tip, both links are slender uniform rods,
and there is no gravity. Joint angles: q1 from x, q2 between the links; both zero is straight out.
Arrays are [time, joint]; SI units throughout (rad, rad/s, N m at the joint).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from scipy.integrate import solve_ivp

Array = np.ndarray
CommandKind = Literal["rate", "position", "torque"]
Course = Callable[[float], Sequence[tuple[float, float]]]


@dataclass(frozen=True)
class Rods:
    """The arm: two slender uniform rods. Defaults: the project's assumptions for the lost figure 1 of the paper."""

    length_1: float = 2.0  # m
    length_2: float = 2.0  # m
    mass_1: float = 40.0  # kg
    mass_2: float = 20.0  # kg


@dataclass(frozen=True)
class Gearbox:
    """Servo and motor, the same at both joints: Hill, Hopping, Price 1989, table 1."""

    ratio: float = 1570.0  # N, motor turns per joint turn
    kp: float = 0.020  # V s/rad
    ki: float = 0.125  # V/rad
    v_max: float = 20.0  # V
    resistance: float = 2.05  # ohm
    kt: float = 0.061  # N m/A and V s/rad
    tau_max: float = 0.144  # N m
    j_m: float = 6.38e-5  # kg m^2
    f_c: float = 0.0205  # N m
    f_v: float = 2.58e-5  # N m s/rad
    k_position: float = 0.0  # 1/s


@dataclass(frozen=True)
class Command:
    """What both joints are told. course(t) -> ((value, slope) of joint 1, (value, slope) of joint 2)."""

    kind: CommandKind
    course: Course


@dataclass(frozen=True)
class Event:
    """A joint that changed between sticking and sliding: mode before and after, of 0, +1, -1."""

    time: float
    joint: int
    before: int
    after: int


@dataclass(frozen=True)
class Motion:
    """The answer at the times asked. An instant that is also a servo tick shows what holds after the tick.

    q, qd, tau, qdd, voltage  [time, joint];  tau: what the gearbox gives the joint, N (tau_m - friction)
    mode                      [time, joint]: 0 stuck, +1 or -1 the direction of sliding
    events                    every change of a joint between sticking and sliding, in order of time
    """

    time: Array
    q: Array
    qd: Array
    tau: Array
    qdd: Array
    voltage: Array
    mode: Array
    events: tuple[Event, ...] = field(default=())


def mass_matrix(arm: Rods, q2: float) -> Array:
    """Joint-space inertia of the rods alone, without rotors (kg m^2, 2x2)."""
    a, b = arm.length_1, arm.length_2 / 2.0
    about_tip_2 = arm.mass_2 * arm.length_2**2 / 3.0
    about_tip_1 = arm.mass_1 * arm.length_1**2 / 3.0
    cross = arm.mass_2 * a * b * np.cos(q2)
    m_12 = about_tip_2 + cross
    return np.array([[about_tip_1 + about_tip_2 + arm.mass_2 * a * a + 2.0 * cross, m_12], [m_12, about_tip_2]])


def velocity_torque(arm: Rods, q2: float, qd: Array) -> Array:
    """Coriolis and centrifugal torque h (N m), on the left of the equation of motion."""
    s = arm.mass_2 * arm.length_1 * arm.length_2 / 2.0 * np.sin(q2)
    return np.array([-s * qd[1] * (2.0 * qd[0] + qd[1]), s * qd[0] ** 2])


def motor_torque(motor: Gearbox, voltage: Array, w_m: Array) -> Array:
    """Motor torque before friction (N m)."""
    return np.clip(motor.kt * (voltage - motor.kt * w_m) / motor.resistance, -motor.tau_max, motor.tau_max)


@dataclass
class _Arm:
    """The equations of motion under a voltage held and friction modes held."""

    arm: Rods
    motor: Gearbox
    dry: float  # Coulomb friction at the motor, N m
    viscous: float  # N m s/rad
    velocity_products: bool

    def accelerations(self, q: Array, qd: Array, voltage: Array, mode: Array) -> tuple[Array, Array]:
        """(qdd, tau): a joint of mode 0 has qdd = 0 and the torque that this takes; all others slide."""
        n = self.motor.ratio
        stuck = mode == 0 if self.dry > 0.0 else np.zeros(2, dtype=bool)
        inertia = mass_matrix(self.arm, q[1])
        h = velocity_torque(self.arm, q[1], qd) if self.velocity_products else np.zeros(2)
        w_m = n * qd
        tau = n * (motor_torque(self.motor, voltage, w_m) - mode * self.dry - self.viscous * w_m)
        qdd = np.zeros(2)
        free = np.flatnonzero(~stuck)
        if free.size:
            whole = inertia + n * n * self.motor.j_m * np.eye(2)
            qdd[free] = np.linalg.solve(whole[np.ix_(free, free)], (tau - h)[free])
        load = inertia @ qdd + h
        return qdd, np.where(stuck, load, tau)

    def need(self, q: Array, qd: Array, voltage: Array, mode: Array) -> Array:
        """Friction (N m, motor) that each joint takes to stay at rest; of meaning for stuck joints alone."""
        _, tau = self.accelerations(q, qd, voltage, mode)
        return motor_torque(self.motor, voltage, np.zeros(2)) - tau / self.motor.ratio

    def decide(self, q: Array, qd: Array, voltage: Array) -> Array:
        """The one consistent set of modes: sliding joints slide on; those at rest by complementarity."""
        mode = np.sign(qd).astype(int)
        resting = np.flatnonzero(qd == 0.0)
        if self.dry == 0.0 or not resting.size:
            return mode
        # Stuck takes at most F_c; released moves the way friction does not. M is positive definite, so just one fits;
        # rounding may leave none or two on an edge, hence the largest margin.
        best, best_margin = mode, -np.inf
        for choice in itertools.product((0, 1, -1), repeat=resting.size):
            trial = mode.copy()
            trial[resting] = choice
            qdd, _ = self.accelerations(q, qd, voltage, trial)
            need = self.need(q, qd, voltage, trial)
            margins = [
                self.dry - abs(need[i]) if trial[i] == 0 else trial[i] * qdd[i] * self.motor.j_m * self.motor.ratio
                for i in resting
            ]
            if min(margins) > best_margin:
                best, best_margin = trial, min(margins)
        return best


def _tick(motor: Gearbox, command: Command, t: float, period: float, y: Array, integral: Array) -> tuple[Array, Array]:
    """(voltage, integral) for the time to the next tick."""
    asked = np.array(command.course(t))
    q, qd = y[:2], y[2:]
    if command.kind == "torque":
        voltage = motor.resistance * asked[:, 0] / motor.ratio / motor.kt + motor.kt * motor.ratio * qd
        return np.clip(voltage, -motor.v_max, motor.v_max), integral
    rate = asked[:, 0] if command.kind == "rate" else asked[:, 1] + motor.k_position * (asked[:, 0] - q)
    error = motor.ratio * (rate - qd)
    wanted = motor.kp * error + motor.ki * integral
    voltage = np.clip(wanted, -motor.v_max, motor.v_max)
    winding_up = (wanted != voltage) & (np.sign(wanted) == np.sign(error))
    return voltage, np.where(winding_up, integral, integral + period * error)


def reference(
    times: Array,
    *,
    command: Command,
    servo_hz: float,
    arm: Rods | None = None,
    motor: Gearbox | None = None,
    friction: bool = True,
    velocity_products: bool = False,
    q: Sequence[float] = (0.0, 0.0),
    qd: Sequence[float] = (0.0, 0.0),
    rtol: float = 1e-12,
) -> Motion:
    """The motion of the servo-driven arm at `times` (s, rising, the first >= 0).

    friction=False leaves out dry and viscous friction both. servo_hz: ticks at k/servo_hz, k = 0, 1, ...; a time
    within 1e-9 of a tick is that tick.
    """
    motor = motor or Gearbox()
    world = _Arm(
        arm=arm or Rods(),
        motor=motor,
        dry=motor.f_c if friction else 0.0,
        viscous=motor.f_v if friction else 0.0,
        velocity_products=velocity_products,
    )
    y = np.array([*q, *qd], dtype=float)
    integral, voltage = np.zeros(2), np.zeros(2)
    mode = world.decide(y[:2], y[2:], voltage)
    events: list[Event] = []
    rows: list[tuple[Array, ...]] = []
    now = 0.0
    for t, is_tick, wanted in _instants(np.asarray(times, dtype=float), servo_hz):
        y, mode = _advance(world, y, voltage, mode, now, t, rtol, events)
        now = t
        if is_tick:
            voltage, integral = _tick(motor, command, t, 1.0 / servo_hz, y, integral)
            decided = world.decide(y[:2], y[2:], voltage)
            if t > 0.0 and world.dry > 0.0:
                _note(events, t, mode, decided)
            mode = decided
        if wanted:
            qdd, tau = world.accelerations(y[:2], y[2:], voltage, mode)
            rows.append((y[:2].copy(), y[2:].copy(), tau, qdd, voltage, mode.copy()))
    q_, qd_, tau_, qdd_, voltage_, mode_ = (np.array(column) for column in zip(*rows, strict=True))
    return Motion(
        np.asarray(times, dtype=float), q_, qd_, tau_, qdd_, voltage_, mode_.astype(int), events=tuple(events)
    )


def _instants(times: Array, servo_hz: float) -> list[tuple[float, bool, bool]]:
    """(time, is a servo tick, is asked for), rising, ticks up to the last time asked."""
    ticks = int(np.floor(times[-1] * servo_hz + 1e-9))
    found = {k / servo_hz: [True, False] for k in range(ticks + 1)}
    for t in times:
        k = round(t * servo_hz)
        at = k / servo_hz if abs(t - k / servo_hz) < 1e-9 else float(t)
        found.setdefault(at, [False, False])[1] = True
    return [(t, is_tick, wanted) for t, (is_tick, wanted) in sorted(found.items())]


def _note(events: list[Event], t: float, before: Array, after: Array) -> None:
    events.extend(Event(t, i, int(before[i]), int(after[i])) for i in range(2) if before[i] != after[i])


def _advance(
    world: _Arm, y: Array, voltage: Array, mode: Array, start: float, end: float, rtol: float, events: list[Event]
) -> tuple[Array, Array]:
    """(state, modes) at `end`, the voltage held, through every stop and release on the way."""
    now = start
    while now < end:
        watches = [_watch(world, voltage, mode, joint) for joint in range(2)] if world.dry > 0.0 else None

        def slope(t: float, y: Array, mode: Array = mode) -> Array:
            qdd, _ = world.accelerations(y[:2], y[2:], voltage, mode)
            return np.concatenate([y[2:], qdd])

        # A tolerance far below the rates at stake (0.03 rad/s); solve_ivp allows no rtol below 100 roundings.
        solution = solve_ivp(slope, (now, end), y, method="DOP853", rtol=rtol, atol=1e-3 * rtol, events=watches)
        if solution.status < 0:
            raise RuntimeError(solution.message)
        now, y = float(solution.t[-1]), solution.y[:, -1].copy()
        if solution.status == 1:
            before = mode
            joint = next(i for i, found in enumerate(solution.t_events or []) if found.size)
            if before[joint] == 0:  # breaks away: on the edge both modes fit, so its direction is the need's
                mode = before.copy()
                mode[joint] = int(np.sign(world.need(y[:2], y[2:], voltage, before)[joint]))
            else:
                y[2 + joint] = 0.0
                mode = world.decide(y[:2], y[2:], voltage)
            _note(events, now, before, mode)
    return y, mode


def _watch(world: _Arm, voltage: Array, mode: Array, joint: int) -> Callable[[float, Array], float]:
    """The joint's event: sliding, its rate falls to zero; stuck, it needs more than Coulomb friction."""

    def stops(t: float, y: Array) -> float:
        return float(mode[joint] * y[2 + joint])

    def breaks_away(t: float, y: Array) -> float:
        return float(abs(world.need(y[:2], y[2:], voltage, mode)[joint]) - world.dry)

    watch: Any = stops if mode[joint] else breaks_away
    watch.terminal = True
    watch.direction = -1.0 if mode[joint] else 1.0
    return watch
