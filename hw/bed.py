"""The interface of a motor bed's driver: connect, arm, exchange, stop. Drivers are in hw/beds, one a file.

A bed has a drive motor, which is the motor under test, and a load motor on the same shaft. It is told the voltage of
the one and the current of the other, which its amplifiers hold, and answers with what its sensors say. Everything is in
SI, on the motor's side of the gearbox. What is sent and read are whole counts of the bed's scales.

A drive that has a loop of its own is told a torque or a rate in place of the voltage: `About.drive` says which. All
that is called voltage here, command, count, limit and slew, is then of that quantity and in its unit, N m or rad/s.

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
from met.substitution.bed import DriveCommand


class BedState(enum.IntEnum):
    """The state of a bed: disarmed, its outputs safe; armed, so that it takes commands; or stopped by a latched
    fault."""

    DISARMED = 0
    ARMED = 1
    STOPPED = 2


class Fault(enum.IntFlag):
    """The reasons for which a bed stops itself; the values are the bits of the protocol's status, and from 1 << 16 on
    those that only a bed of another kind has."""

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
    INTERLOCK = 1 << 14
    DRIVE = 1 << 16
    SUPPLY = 1 << 17
    DISAGREEMENT = 1 << 18
    OTHER_MASTER = 1 << 19


class Capability(enum.IntFlag):
    """The properties of a bed beyond drive voltage, load current and tachometer; the values are bits of the
    protocol, and from 1 << 16 on those that only a bed of another kind has."""

    ENCODER = 1 << 0
    DRIVE_CURRENT = 1 << 1
    ACCELEROMETER = 1 << 2
    WATCHDOG = 1 << 3
    LOCK_STEP = 1 << 4
    SIMULATED = 1 << 5
    INTERLOCK = 1 << 6
    COASTS = 1 << 16
    """Its safe state is outputs that are off: the shaft is not braked."""
    ARMATURE = 1 << 17
    """Capability: its drive takes torques, so it is sent the torque of an armature at the requested voltage."""


class InterlockReason(enum.IntFlag):
    """The reasons for which a bed's interlock stops it or does not let it arm; the values are bits of the
    protocol."""

    STOP = 1 << 0
    READY = 1 << 1
    READ_BACK = 1 << 2
    KEY = 1 << 3
    CONVERTER = 1 << 4
    DRIVE_HEAT = 1 << 5
    TEMPERATURE = 1 << 6
    BUS = 1 << 7
    ANGLE = 1 << 8
    ENCODER = 1 << 9
    LOAD = 1 << 10
    TICK = 1 << 11
    MAIN = 1 << 12


@frozen
class Scales:
    """The quantity of one count: voltage V, current A, rate rad/s, angle rad, drive current A, acceleration rad/s^2."""

    voltage: float
    current: float
    rate: float
    angle: float
    drive_current: float
    acceleration: float


@frozen
class Limits:
    """The limits beyond which a bed stops itself: voltage V, current A, rate rad/s, slews V/s and A/s, heat (I2t of
    the load motor) A^2 s. Above arming_rate, rad/s, it does not arm."""

    voltage: float
    current: float
    rate: float
    arming_rate: float
    voltage_slew: float
    current_slew: float
    heat: float


@frozen
class About:
    """A bed's description of itself, its answer when it is greeted.

    version   of MET's protocol; 0 where the bed speaks another one, and its firmware is then of all that it consists of
    firmware  first eight bytes of the SHA-256 of what was built, in hexadecimal
    session   another number after each boot
    tick_hz   rate of the bed's own ticks, Hz;  deadman: s without a new command after which it stops
    drive     what the drive is told (met.substitution.bed.DRIVES); a deck's bed model must be of the same
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
    drive: DriveCommand = "voltage"


@frozen
class BedSample:
    """One answer of a bed: its state, and its sensors as they were at its tick `tick`. A sensor that it lacks is
    None.

    rate     rate of the shaft behind the tachometer's filter, rad/s;  angle: of the shaft, rad
    faults   the faults that are latched
    refused  True where the bed did not do what was asked, as it may not in this state
    interlock  reasons that are latched, else those that forbid arming now
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
    interlock: InterlockReason | None = None


LIMIT_NAMES = ("voltage", "current", "rate", "voltage_slew", "current_slew")
"""The limits that a host may make tighter for a session: V, A, rad/s, V/s, A/s."""


class BedDriver(ABC):
    """The computer's side of one motor bed. Every method raises met.diagnostic.Problem (E400-E419) where the bed cannot
    be reached or says no, but `stop` and `close`, which never raise.

    patience  s to wait for the answer to an exchange; whoever drives the bed sets it
    has_line  False where answers come at once, from this process, so that there is no line to measure
    warnings  what may make exchanges late, known once it is connected
    remarks   rows for whoever asks what the bed is, a word and a line each, known once it is connected
    unseen    what another master may do to it without being noticed, in words; "" where there can be none
    """

    patience: float = 0.01
    has_line: bool = True
    warnings: tuple[Diagnostic, ...] = ()
    remarks: tuple[tuple[str, str], ...] = ()
    unseen: str = ""

    @abstractmethod
    def connect(self) -> About:
        """Greet the bed, and return its description. It is disarmed afterwards, and its limits are its own."""

    @abstractmethod
    def limit(self, limits: Mapping[str, float]) -> None:
        """Make limits tighter for this session. limits: those of `LIMIT_NAMES` that are to change, by name."""

    @abstractmethod
    def arm(self) -> BedSample:
        """Let the bed take commands, both of them 0 to begin with. The shaft must be slow, and no fault latched."""

    @abstractmethod
    def exchange(self, voltage: float, current: float) -> BedSample | None:
        """Set the drive's voltage (V) and the load's current (A), and read the sensors. A bed in lock-step advances by
        one tick of the wire, and answers with its end. None: no answer came in time, and it was not asked again. An
        answer may say that the bed is armed no more: look at its state. A command that is no finite number or beyond a
        limit in force is not sent; the bed is stopped, and Problem E408 raised."""

    @abstractmethod
    def read(self) -> BedSample:
        """Read the sensors. Nothing else changes: the deadman is not fed."""

    def look(self) -> BedSample | None:
        """Read the sensors, asking once: None where no answer comes within `patience`."""
        return self.read()

    @abstractmethod
    def clear(self) -> BedSample:
        """Forget the latched faults once the shaft is slow; the bed is disarmed then."""

    @abstractmethod
    def rest(self, time: float) -> BedSample:
        """Stop, and let `time` s pass. A bed in lock-step advances as far as that."""

    def line_time(self, about: About) -> float:
        """Time of an exchange's bytes on the line, s; 0 where the line's speed does not matter."""
        return 0.0

    def account(self) -> tuple[str, ...]:
        """Lines for people about the exchanges since the bed was armed, once it is stopped."""
        return ()

    def preset(self, *, rate: float = 0.0, seed: int = 0, repeat: int = 0) -> BedSample:
        """Start a simulated plant anew, disarmed: its shaft turning at rate (rad/s), its noise from the beginning."""
        raise real_plant()

    @abstractmethod
    def stop(self) -> bool:
        """Bring the bed into the safe state, with repeated requests until the bed confirms it or the line is dead.
        Returns True where it was confirmed."""

    @abstractmethod
    def close(self) -> None:
        """Stop the bed, and release the line."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def real_plant() -> Problem:
    """The error that a bed with a motor cannot be started anew."""
    return Problem(error("E406", "only a simulated bed can be started anew", help="this one has a motor"))
