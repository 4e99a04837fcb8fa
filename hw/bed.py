"""The interface of a motor bed's driver: connect, arm, exchange, stop. Drivers are in hw/beds, one a file.

A bed has a drive motor, which is the motor under test, and a load motor on the same shaft. It is told the voltage of
the one and the current of the other, which its amplifiers hold, and answers with what its sensors say. Everything is in
SI, on the motor's side of the gearbox. What is sent and read are whole counts of the bed's scales.

    bed.connect()                       who is there: name, limits, scales; the outputs are in the safe state
    bed.arm()                           from here on a deadman runs
    while ...: bed.exchange(V, A)       at the wire's rate, at least 500 Hz
    bed.stop()                          the safe state, from any state, whatever went wrong
"""

from __future__ import annotations

import enum
from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import TracebackType
from typing import Self

from met.diagnostic import Diagnostic, Problem, error
from met.frozen import frozen


class BedState(enum.IntEnum):
    """Of a bed: outputs in the safe state, commands taken, or stopped by a fault that is latched."""

    DISARMED = 0
    ARMED = 1
    STOPPED = 2


class Fault(enum.IntFlag):
    """Why a bed stopped; the bits of the protocol's status."""

    DEADMAN = 1 << 3
    RANGE = 1 << 4
    SLEW = 1 << 5
    RATE = 1 << 6
    CURRENT = 1 << 7
    HEAT = 1 << 8
    TACHOMETER_DEAD = 1 << 9
    TACHOMETER_REVERSED = 1 << 10
    NOISE = 1 << 11
    WATCHDOG = 1 << 12


class Capability(enum.IntFlag):
    """What a bed can, besides drive voltage, load current and tachometer."""

    ENCODER = 1 << 0
    DRIVE_CURRENT = 1 << 1
    ACCELEROMETER = 1 << 2
    WATCHDOG = 1 << 3
    LOCK_STEP = 1 << 4
    SIMULATED = 1 << 5


@frozen
class Scales:
    """The value of a count: voltage V, current A, rate rad/s, angle rad, drive current A, acceleration rad/s^2."""

    voltage: float
    current: float
    rate: float
    angle: float
    drive_current: float
    acceleration: float


@frozen
class Limits:
    """Beyond which a bed stops itself: voltage V, current A, rate rad/s, slews V/s and A/s, heat (I2t of the load)
    A^2 s; arming_rate rad/s: above it a bed does not arm."""

    voltage: float
    current: float
    rate: float
    arming_rate: float
    voltage_slew: float
    current_slew: float
    heat: float


@frozen
class About:
    """Who is there, as a bed says when it is greeted.

    firmware  first eight bytes of the SHA-256 of what was built, in hexadecimal
    session   another number after each boot
    tick_hz   rate of the bed's own ticks, Hz;  deadman: s without a new command after which it stops
    """

    name: str
    version: int
    firmware: str
    session: int
    capabilities: Capability
    tick_hz: float
    deadman: float
    scales: Scales
    limits: Limits


@frozen
class BedSample:
    """What a bed answers: its state, and its sensors at its tick `tick`; None for a sensor that it has not.

    rate          of the shaft, behind the tachometer's filter, rad/s;  angle: of the shaft, rad
    faults        that are latched;  refused: what was asked was not possible in this state, and not done
    """

    state: BedState
    greeted: bool
    faults: Fault
    refused: bool
    tick: int
    rate: float
    angle: float | None = None
    drive_current: float | None = None
    acceleration: float | None = None


LIMIT_NAMES = ("voltage", "current", "rate", "voltage_slew", "current_slew")
"""Those that a session may make tighter: V, A, rad/s, V/s, A/s."""


class BedDriver(ABC):
    """The computer's side of one motor bed. Every method raises met.diagnostic.Problem (E400-E419) where the bed cannot
    be reached or says no, but `stop` and `close`, which never raise.

    patience  s to wait for the answer to an exchange; whoever drives the bed sets it
    has_line  False where answers come at once, from this process, so that there is no line to measure
    warnings  what may make exchanges late, known once it is connected
    """

    patience: float = 0.01
    has_line: bool = True
    warnings: tuple[Diagnostic, ...] = ()

    @abstractmethod
    def connect(self) -> About:
        """Greet the bed. It is disarmed afterwards, and its limits are its own."""

    @abstractmethod
    def limit(self, asked: Mapping[str, float]) -> None:
        """Make limits tighter for this session. asked: those of `LIMIT_NAMES` that are to change, by name."""

    @abstractmethod
    def arm(self) -> BedSample:
        """Have commands taken, with both at zero. The shaft must be slow, and nothing latched."""

    @abstractmethod
    def exchange(self, voltage: float, current: float) -> BedSample | None:
        """Set the drive's voltage (V) and the load's current (A), and read the sensors. A bed in lock-step advances by
        one tick of the wire, and answers with its end. None: no answer came in time, and it was not asked again. An
        answer may say that the bed is armed no more: look at its state. A command that is no finite number or beyond a
        limit in force is not sent; the bed is stopped, and Problem E408 raised."""

    @abstractmethod
    def read(self) -> BedSample:
        """The sensors, with no effect on anything: no deadman is fed."""

    def look(self) -> BedSample | None:
        """The same, asked once: None where no answer comes within `patience`."""
        return self.read()

    @abstractmethod
    def clear(self) -> BedSample:
        """Unlatch faults, once the shaft is slow: disarmed again."""

    @abstractmethod
    def rest(self, time: float) -> BedSample:
        """Stop, and let so much time pass, s. A bed in lock-step advances as far as that."""

    def line_time(self, about: About) -> float:
        """Time that the bytes of an exchange take on the line, s; 0 where the line's speed is not what counts."""
        return 0.0

    def preset(self, *, rate: float = 0.0, seed: int = 0, repeat: int = 0) -> BedSample:
        """Start a simulated plant anew, disarmed: its shaft turning at rate (rad/s), its noise from the beginning."""
        raise real_plant()

    @abstractmethod
    def stop(self) -> bool:
        """The safe state, as surely as it can be had: asked for again until it is confirmed, or the line is dead. Gives
        back whether it was confirmed."""

    @abstractmethod
    def close(self) -> None:
        """Stop, and let go of the line."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def real_plant() -> Problem:
    return Problem(error("E406", "only a simulated bed can be started anew", help="this one has a motor"))
