"""The host's side of one drive on a CAN bus, the part that all dialects share, each a file of this folder; and the bus:
its frames, the line that carries them, and how long they take on it.

A drive of a bench is told a torque (N m) or, where its dialect `takes_rates` and the bench wants it so, a rate (rad/s),
for which it then closes the loop. It says its angle (rad) and rate (rad/s), all of them in the sense of the bench's
shaft. It disarms itself where it hears nothing for the time of its watchdog.

    drive.greet(talk)        who is there: dialect, firmware, limits; it is idle afterwards
    drive.renew(talk)        set again what its greeting set, before each arming
    drive.armed()            frames that arm it with nothing commanded, to be sent until its state says so
    drive.command(value)     frames of a command
    drive.query()            frames that ask for its angle, rate and state
    drive.take(frame)        what it answers, or says by itself
    drive.is_command(frame)  whether a frame that came commands it: then there is another master
    drive.checks()           frames that ask what another master would have changed
"""

from __future__ import annotations

import enum
import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import Protocol

from hw.drives.bench_file import DriveEntry
from met.diagnostic import Problem, error
from met.frozen import frozen

NOMINAL, FAST = 1_000_000, 5_000_000
"""Bits a second of a bus unless a bench says otherwise: of a classic frame, and of the data of a CAN-FD one."""

SIZES = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Lengths that a frame of CAN-FD may have."""

GREETED = 2.0
"""Longest time to wait for each answer of a greeting, all asks together, s."""

OWED = 0.02
"""Time after a question for which its answer may still come, s: question and answer 10 ms late each."""

TURNS = 0.5
"""Rate of a shaft, rad/s, above which its angle has changed by the next question."""

REMEMBERED, SINCE = 64, 0.05
"""Answers of a drive that are remembered, so that an old one is known again, and for how long, s."""

ASKS = 5
"""Number of tries of a question of a greeting: a bus loses frames only when it is faulty."""


LATE = 256
"""Largest number of frames that are taken after the end of a wait: those that have come meanwhile, and no more, since a
busy bus always has another."""


SENT, ECHOED = 256, 0.05
"""Frames of the host that are remembered, so that they are not taken for another's where they come back; for how long,
s."""


@frozen
class CanFrame:
    """A frame of a CAN bus.

    id      identifier, 11 bits, or 29 where it is `extended`
    remote  True for a request without data, which the node of that identifier answers
    fd      True for a frame of CAN-FD, up to 64 bytes
    time    when the interface received it, s of the line's clock; 0 for one that is to be sent
    time_unsure  s by which what it says may have been so before or after `time`, of a line that bounds that itself
    """

    id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False
    fd: bool = False
    time: float = 0.0
    time_unsure: float = 0.0


class CanLine(Protocol):
    """A line of CAN frames. Its methods raise met.diagnostic.Problem E401 where it is lost."""

    def now(self) -> float:
        """The time of the line's clock, s."""

    def send(self, frame: CanFrame) -> None:
        """Send a frame."""

    def receive(self, until: float) -> CanFrame | None:
        """The next frame that has come, or comes until this time of the line's clock, s; else None."""

    def sleep(self, seconds: float) -> None:
        """Let `seconds` pass on the line's clock."""

    def close(self) -> None:
        """Close the line."""


def on_bus(frame: CanFrame, bitrate: float = NOMINAL, fast: float = FAST) -> float:
    """Longest time that a frame takes on the bus, s, all bits stuffed that can be (ISO 11898-1). `fast`: bits a second
    of the data of a CAN-FD frame."""
    length, head = len(frame.data), 20 if frame.extended else 0
    if not frame.fd:
        stuffed = 34 + head + 8 * length
        return (stuffed + (stuffed - 1) // 4 + 13) / bitrate
    arbitration = 17 + head + (16 + head) // 4 + 12
    data = 8 * length + 9
    check = 21 if length > 16 else 17
    return arbitration / bitrate + (data + (data - 1) // 4 + check + 4 + (check + 3) // 4 + 1) / fast


class DriveState(enum.Enum):
    """The state of a drive: idle, its outputs off; driving, its outputs on; or stopped by an error."""

    IDLE = "idle"
    DRIVING = "driving"
    FAILED = "failed"


@frozen
class DriveReading:
    """An answer of a drive. time: when its frame came, s of the line's clock;  angle rad, rate rad/s, of the shaft;
    time_unsure: s by which it may have sampled before or after `time`, besides what frames of a bus may be off"""

    time: float
    angle: float
    rate: float
    time_unsure: float = 0.0


@frozen
class DriveFacts:
    """A drive's description of itself, the end of its greeting.

    firmware, hardware  in words
    watchdog        s without a command after which it stops by itself
    torque_max      N m, the most that it gives;  rate_max: rad/s
    control_hz      rate of its own control, Hz
    torque_count, angle_count, rate_count  N m, rad, rad/s of the smallest step that the dialect can tell; 0 where it
                    has none (floats)
    angle_range     rad after which its angle begins anew; 0 where it does not
    braking         True where it shorts its windings when it stops; False where the shaft coasts
    supply_max      V beyond which it stops by itself; 0 where it does not say
    rate_told_count  rad/s of the smallest step in which a rate is told; 0 where there is none
    rate_loop       of a drive that is told rates, its loop's gains: N m s/rad on the error, N m/rad on its integral;
                    None where it does not say them
    """

    firmware: str
    hardware: str
    watchdog: float
    torque_max: float
    rate_max: float
    control_hz: float
    torque_count: float = 0.0
    angle_count: float = 0.0
    rate_count: float = 0.0
    angle_range: float = 0.0
    braking: bool = False
    supply_max: float = 0.0
    rate_told_count: float = 0.0
    rate_loop: tuple[float, float] | None = None


class CanDrive(ABC):
    """The host's side of one drive.

    reading   the last answer; None before the first
    state     as it said last;  errors: that it told, in words;  stated: when, s of the line's clock
    starved   True where the error that it failed by is that of its watchdog, and no other
    supply    V of its supply, as it said last; None where it never did
    power     W that it takes from its supply, below 0 where it gives back; None where it never said so
    rates     True where it is told rates: set before it is greeted, where its dialect `takes_rates`
    owed      times at which it was asked what is not answered yet, s of the line's clock
    steps     rad and rad/s of the steps in which its answers tell angle and rate, once it is greeted; 0: floats
    disturbed  how its answers show that another master has commanded it, in words; "" where they do not
    """

    dialect: str
    answers_commands = True
    """True where its answer to a command has its angle, rate and state, so that it need not be asked."""
    unseen = "commands on another port of a drive, such as USB"
    """What another master may do to it without being noticed, in words."""
    takes_rates = False
    """True where it can be commanded rates, and closes the rate loop itself."""

    def __init__(self, entry: DriveEntry) -> None:
        self.entry, self.node, self.sense = entry, entry.node, entry.sense
        self.rates = False
        self.reading: DriveReading | None = None
        self.state, self.stated = DriveState.IDLE, 0.0
        self.errors = ""
        self.starved = False
        self.supply: float | None = None
        self.power: float | None = None
        self.owed = deque[float](maxlen=256)
        self.steps = 0.0, 0.0
        self.disturbed = ""
        self._said_since: dict[Hashable, float] = {}
        """Time of each pair of angle and rate, as in answers, when it was last sent, s."""
        self._turned = -math.inf
        """Time of the last answer in which the shaft turns, s."""

    @abstractmethod
    def greet(self, talk: Talk) -> DriveFacts:
        """Find the drive, leave it idle, and read its description. Raises Problem E402 to E404."""

    def renew(self, talk: Talk) -> None:
        """Set the greeting's settings again, where they are not part of commands, and check them: a drive that has
        restarted since has its own mode, limits and watchdog. Raises Problem E402, E404."""
        return

    @abstractmethod
    def armed(self) -> Sequence[CanFrame]:
        """Frames that let it drive, with nothing commanded."""

    @abstractmethod
    def command(self, value: float) -> Sequence[CanFrame]:
        """Frames of a command, N m; or rad/s for a drive that takes rates."""

    @abstractmethod
    def query(self) -> Sequence[CanFrame]:
        """Frames that ask for angle, rate and state."""

    @abstractmethod
    def is_asked_by(self, frame: CanFrame) -> bool:
        """True for a frame of the host's that it answers by angle and rate, once."""

    @abstractmethod
    def idle(self) -> Sequence[CanFrame]:
        """Frames that switch its output off."""

    def halted(self) -> Sequence[CanFrame]:
        """Frames that switch its output off so that it does not drive again until its errors are cleared, where the
        dialect has such; else those of `idle`."""
        return self.idle()

    @abstractmethod
    def cleared(self) -> Sequence[CanFrame]:
        """Frames that let it forget its errors."""

    @abstractmethod
    def take(self, frame: CanFrame) -> bool:
        """Take a frame that came, where it is this drive's and sound. Returns True where it was."""

    @abstractmethod
    def answers(self) -> Sequence[CanFrame]:
        """Frames as long as those with which it answers an exchange, to reckon how long they take on the bus."""

    def is_command(self, frame: CanFrame) -> bool:
        """True for a frame that only a master sends to this drive, and that changes what it does. One that only asks is
        none: who listens may ask."""
        return False

    def checks(self) -> Sequence[CanFrame]:
        """Frames that ask whether another master has commanded it, to be sent before a command, where it can tell."""
        return ()

    def owes(self, now: float) -> bool:
        """True where an answer to an earlier question may still come at a time of the line's clock, s."""
        while self.owed and now - self.owed[0] > OWED:
            self.owed.popleft()
        return bool(self.owed)

    def forget_answers(self) -> None:
        """Forget its answers so far, so that a new one is not taken for a repeated one, outside of a run."""
        self._said_since.clear()
        self._turned = -math.inf

    def has_said(self, fields: Hashable, rate: float, time: float) -> bool:
        """True for an answer that is older than the last ones: it repeats angle and rate of one within the last 50 ms,
        and the shaft has turned since by more than a step of the angle. rate: rad/s;  time: of the frame, s"""
        angle_step, rate_step = self.steps
        turns = max(0.0, abs(rate) - rate_step)
        before = self._said_since.pop(fields, None)
        if before is not None and time - before > SINCE:
            before = None
        old = before is not None and (turns * abs(time - before) > angle_step or before < self._turned)
        self._said_since[fields] = before if before is not None and old else time
        if turns > TURNS and not old:
            self._turned = time
        if len(self._said_since) > REMEMBERED:
            del self._said_since[next(iter(self._said_since))]
        return old

    @property
    def sound(self) -> bool:
        """True where it drives, and tells no error."""
        return self.state == DriveState.DRIVING and not self.errors

    @property
    def bears(self) -> float:
        """The largest torque that the bench bears from this drive, N m."""
        figures = self.entry.figures
        return figures["torque_max"] if self.entry.role == "drive" else figures["kt"] * figures["current_max"]

    def own(self, value: float) -> float:
        """A quantity of the shaft in the drive's own sense, or the other way round."""
        return self.sense * value

    @property
    def where(self) -> str:
        """The place of the drive, in words."""
        return f"node {self.node}"

    @property
    def words(self) -> str:
        """The drive in words, for messages."""
        return f"{self.entry.role} ({self.where})"

    def wrong(self, what: str, helps: str | Sequence[str]) -> Problem:
        """The error for a drive that cannot be driven in its present state."""
        return Problem(error("E404", f"{self.words} cannot be driven: {what}", help=helps))

    def other(self, what: str, helps: str | Sequence[str]) -> Problem:
        """The error for a drive of another dialect or firmware."""
        return Problem(error("E403", f"{self.words} is no {self.dialect} of a kind that MET knows: {what}", help=helps))


class Talk:
    """A line with the drives on it: input is given to all of them, and questions and answers of each are counted."""

    def __init__(self, line: CanLine, drives: Sequence[CanDrive]) -> None:
        self.line, self.drives = line, drives
        self.strange: dict[int, int] = {}
        """Frames that no drive has taken, by identifier, for the message about a drive that does not answer."""
        self._sent: dict[tuple[Hashable, ...], float] = {}
        """Times at which frames were sent last, s."""
        self._heard = ""

    @property
    def other_master(self) -> str:
        """The sign of another master on the line, in words; "" where none was noticed."""
        return self._heard or next((drive.disturbed for drive in self.drives if drive.disturbed), "")

    def forget_other_master(self) -> None:
        self._heard = ""
        for drive in self.drives:
            drive.disturbed = ""

    def send(self, frames: Iterable[CanFrame]) -> None:
        """Send frames, and count the questions among them for the drives that are to answer."""
        for frame in frames:
            self.line.send(frame)
            now, content = self.line.now(), _content(frame)
            self._sent.pop(content, None)
            self._sent[content] = now
            if len(self._sent) > SENT:
                del self._sent[next(iter(self._sent))]
            for drive in self.drives:
                if drive.is_asked_by(frame):
                    drive.owed.append(now)

    def pump(self, until: float, done: Callable[[], bool] = lambda: False) -> bool:
        """Read until a time of the line's clock, s, or until `done`. Returns True where it is done."""
        late = 0
        while not done():
            frame = self.line.receive(until)
            late += self.line.now() > until
            if frame is None or late > LATE:
                return done()
            if not any(self._taken(drive, frame) for drive in self.drives):
                self._overhear(frame)
        return True

    def _overhear(self, frame: CanFrame) -> None:
        """Take a frame that is no drive's. One that commands a drive is another master's, unless this host has sent the
        same: some interfaces hand what they send to their sender too."""
        commanded = next((drive for drive in self.drives if drive.is_command(frame)), None)
        own = self.line.now() - self._sent.get(_content(frame), -math.inf) <= ECHOED
        if commanded is not None and not self._heard and not own:
            self._heard = (
                f"{commanded.words} was sent a command by another, 0x{frame.id:X} {frame.data.hex(' ')}".rstrip()
            )
        if len(self.strange) < 64:
            self.strange[frame.id] = self.strange.get(frame.id, 0) + 1

    def _taken(self, drive: CanDrive, frame: CanFrame) -> bool:
        """Give a frame to a drive; returns whether it was this drive's. An answer settles the oldest question that the
        drive has not answered (`owed`)."""
        before = drive.reading
        if not drive.take(frame):
            return False
        if drive.reading is not before and drive.owed:
            drive.owed.popleft()
        return True

    def drain(self) -> None:
        """Read pending input, without waiting."""
        self.pump(-1.0)

    def ask(self, frames: Sequence[CanFrame], done: Callable[[], bool]) -> bool:
        """Send frames until `done`, `ASKS` times in `GREETED` s. Returns whether it is."""
        for _ in range(ASKS):
            self.send(frames)
            if self.pump(self.line.now() + GREETED / ASKS, done):
                return True
        return False

    def silent(self, drive: CanDrive, what: str) -> Problem:
        """The error for a drive that does not answer a question of its greeting."""
        message = f"no {drive.dialect} answers {what} as {drive.words} on the bus"
        if not self.strange:
            helps = ["is it switched on, on this bus, at its bitrate? is the bus terminated at both ends?"]
        else:
            heard = ", ".join(f"0x{id_:X} ({n})" for id_, n in sorted(self.strange.items())[:8])
            helps = [f"what came has the identifiers {heard}", *self._guessed()]
        return Problem(error("E402", message, help=[*helps, f"`node` of `[{drive.entry.role}]`, and its `dialect`"]))

    def _guessed(self) -> list[str]:
        """The dialect that frames nobody took look like, in words."""
        if any(0x700 < identifier <= 0x77F for identifier in self.strange):
            return ["identifiers from 0x701 on are heartbeats of CANopen: `cia402`?"]
        if any(identifier & 0x1F == 1 and identifier < 0x800 for identifier in self.strange):
            nodes = sorted({identifier >> 5 for identifier in self.strange if identifier & 0x1F == 1})
            return [f"0x{(nodes[0] << 5) + 1:X} looks like the heartbeat of an ODrive, node {nodes[0]}"]
        return []


def _content(frame: CanFrame) -> tuple[Hashable, ...]:
    """All of a frame that goes over the bus."""
    return frame.id, frame.data, frame.extended, frame.remote
