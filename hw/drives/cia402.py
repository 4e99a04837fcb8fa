"""Drives of CiA 402 over CANopen: maxon, Elmo, Copley, Nanotec and others. In mode 10, cyclic synchronous torque, or in
mode 9, cyclic synchronous velocity, in which they close the rate loop.

    told      PDO: controlword and target torque, or velocity; then a heartbeat of the host, and a SYNC
    answered  at a SYNC, two PDOs: statusword and mode; position and velocity, in one frame as they are of one instant
    watchdog  the drive consumes the host's heartbeat, and fails where that stays away
    asked     by SDO, when it is greeted: device, modes, units, limits; PDOs are mapped then, and nothing is saved

Facts are from CiA 301 and 402 as their public descriptions have them; no such drive was there.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from hw.drives.bench_file import DriveEntry
from hw.drives.checks import SELDOM, SetpointChecks
from hw.drives.drive import CanDrive, CanFrame, DriveFacts, DriveReading, DriveState, Talk

NMT, SYNC, EMERGENCY, TPDO1, RPDO1, TPDO2, SDO_ANSWER, SDO_ASK, HEARTBEAT = (
    0x000,
    0x080,
    0x080,
    0x180,
    0x200,
    0x280,
    0x580,
    0x600,
    0x700,
)
"""Identifiers, to which a node's number is added except for the first two."""

RPDOS = range(RPDO1, RPDO1 + 4 * 0x100, 0x100)
"""Identifiers of what a node is told by PDOs, to which its number is added."""

DOWNLOADS = (0, 1)
"""Highest three bits of an SDO that writes: its segments, and its beginning."""

HOST = 127
"""The host's number, under which its heartbeat goes."""

START, PREOPERATIONAL = 1, 0x80
PROFILE, TORQUE_MODE, RATE_MODE = 402, 10, 9
HEARTBEAT_LOST = 0x8130
RATE_UNITS = {0x00B44700: 2.0 * math.pi / 60.0, 0x00B40300: 2.0 * math.pi}
"""Units of velocity as object 60A9h tells them, rad/s: turns a minute, turns a second. Its highest byte is a power of
ten, signed."""

DEVICE, PRODUCT, CONSUMED, ABORT = (0x1000, 0), (0x1018, 2), (0x1016, 1), (0x6007, 0)
REVISION, MODES, MODE, RATED, MOST, SPEED = (0x1018, 3), (0x6502, 0), (0x6060, 0), (0x6076, 0), (0x6072, 0), (0x6080, 0)
STEPS, TURNS, VELOCITY_UNIT = (0x608F, 1), (0x608F, 2), (0x60A9, 0)
TARGET_TORQUE, TARGET_RATE, LARGEST = ((0x6071, 0), "<h"), ((0x60FF, 0), "<i"), (MOST, "<H")
"""Objects that say what a drive was told, and its largest torque, with what they hold."""

CHECK_EVERY, DOUBTED_EVERY = 16, 4
"""Exchanges of which one asks a drive what it was told, and where that was another's once."""

CONTROL, STATUS = (0x6040, 0), (0x6041, 0)
OFFSETS = ((0x60B1, 0), "<i"), ((0x60B2, 0), "<h")
"""Objects, by index and subindex; the offsets, of velocity and torque, with what they hold."""

NO_OBJECT = (0x06020000, 0x06010001)
"""Codes of an SDO for an object that a drive does not have, or that cannot be read."""

CONTROL_HZ = 1000.0
"""Rate at which two such drives answer on a bus of 1 Mbit/s."""

MOST_TOLD, MOST_RATE = (1 << 15) - 1, (1 << 31) - 1
"""Largest torque and velocity that target torque and velocity can tell, in their units."""

OFF, SHUT_DOWN, SWITCH_ON, ENABLE, RESET = 0x00, 0x06, 0x07, 0x0F, 0x80


def _upload(which: tuple[int, int]) -> bytes:
    """The SDO that asks for an object."""
    return struct.pack("<BHB", 0x40, *which).ljust(8, b"\0")


def _words(which: tuple[int, int]) -> str:
    """An object in words."""
    return f"object {which[0]:04X}h:{which[1]}"


class Cia402Drive(CanDrive):
    """The host's side of a CiA 402 drive."""

    dialect = "cia402"
    takes_rates = True
    unseen = f"on another port of a drive, such as USB, {SELDOM}"

    def __init__(self, entry: DriveEntry) -> None:
        super().__init__(entry)
        self._answer: bytes | None = None
        self._control, self._wanted, self._error = OFF, False, 0
        self._rated = self._step = self._rate_unit = 1.0
        self._mode = TORQUE_MODE
        self._checks, self._turn = SetpointChecks(apart=1.0), 0
        self._objects: dict[str, tuple[tuple[int, int], str]] = {}
        """Objects that are asked for in a run, with what they hold, by their names."""

    def greet(self, talk: Talk) -> DriveFacts:
        """Check that this is a CiA 402 drive with the mode that is wanted, and set its PDOs; it is idle afterwards.
        Raises Problem E402 to E404."""
        self._wanted, self._control = False, OFF
        if not 0 < self.node < HOST:
            raise self.wrong("its number is none of CANopen's, or the host's", "a number from 1 to 126")
        device = self._read(talk, DEVICE, "<I")
        if int(device) & 0xFFFF != PROFILE:
            raise self.other(f"its device profile is {int(device) & 0xFFFF}, and a drive's is 402", "another node?")
        self._write(talk, CONTROL, "<H", OFF)  # a former command ends before anything is changed
        if int(self._read(talk, STATUS, "<H")) & 0x6F == 0x27:
            raise self.wrong("it drives, and does not stop when it is told to", "switch it off and on")
        self._mode = RATE_MODE if self.rates else TORQUE_MODE
        if not int(self._read(talk, MODES, "<I")) & 1 << self._mode - 1:
            raise self.other(
                f"it has no cyclic synchronous {'velocity, mode 9' if self.rates else 'torque, mode 10'}",
                f"it is told a {'rate' if self.rates else 'torque'}, and nothing else",
            )
        unit = int(self._read(talk, VELOCITY_UNIT, "<I"))
        if unit & 0xFFFFFF not in RATE_UNITS:
            helps = "set object 60A9h to thousandths of a turn a minute, 0xFDB44700"
            raise self.wrong(f"its unit of velocity is 0x{unit:08X}", helps)
        ten = struct.unpack("<b", bytes([unit >> 24]))[0]
        self._rate_unit = RATE_UNITS[unit & 0xFFFFFF] * 10.0**ten
        self._rated = 1e-3 * self._read(talk, RATED, "<I")
        most = 1e-3 * self._rated * self._most(talk)
        rate = math.tau / 60.0 * self._read(talk, SPEED, "<I")
        steps, turns = self._read(talk, STEPS, "<I"), self._read(talk, TURNS, "<I")
        if not all(figure > 0.0 for figure in (self._rated, most, rate, steps, turns)):
            raise self.wrong("a limit or a unit of its is 0", "objects 6072h, 6076h, 6080h and 608Fh")
        if rate > MOST_RATE * self._rate_unit:
            helps = "set object 60A9h to thousandths of a turn a minute, 0xFDB44700"
            raise self.wrong(f"its largest speed, {rate:.4g} rad/s, is more than 32 bits hold in its unit", helps)
        self._step = math.tau * turns / steps
        self.steps = self._step, self._rate_unit
        self._set_up(talk)
        talk.send(self.idle())
        self.reading = None
        if not talk.ask(self.query(), lambda: self.reading is not None and self.state != DriveState.DRIVING):
            raise talk.silent(self, "SYNC")
        self._prepare_checks(talk)
        product, revision = int(self._read(talk, PRODUCT, "<I")), int(self._read(talk, REVISION, "<I"))
        return DriveFacts(
            f"revision 0x{revision:X}",
            f"product 0x{product:X}",
            self.entry.figures["watchdog"],
            most,
            rate,
            CONTROL_HZ,
            torque_count=1e-3 * self._rated,
            angle_count=self._step,
            rate_count=self._rate_unit,
            rate_told_count=self._rate_unit if self.rates else 0.0,
            angle_range=self._step * 2.0**32,
        )

    def _prepare_checks(self, talk: Talk) -> None:
        """Find the objects that the drive can be asked for during a run: its targets, and limits that nobody then
        changes. Another master's commands show in their answers."""
        commanded, other = (TARGET_RATE, TARGET_TORQUE) if self.rates else (TARGET_TORQUE, TARGET_RATE)
        self._objects = {
            _words(which): (which, layout)
            for which, layout in (commanded, other, LARGEST)
            if self._sdo(talk, _upload(which), _words(which), may_lack=True)
        }
        unchanged = {
            name: self._read(talk, *object_) for name, object_ in self._objects.items() if object_ is not commanded
        }
        self._checks.begin([_words(commanded[0])] if _words(commanded[0]) in self._objects else (), unchanged)

    def renew(self, talk: Talk) -> None:
        self._most(talk)
        self._set_up(talk)

    def _most(self, talk: Talk) -> float:
        """The largest torque that the drive may be commanded, in thousandths of its rated torque. In rate mode the
        drive's own limit is first lowered to what the bench bears."""
        if self.rates and self._rated > 0.0:
            bears = math.floor(1e3 * self.entry.figures["torque_max"] / self._rated + 1e-6)
            if bears < self._read(talk, MOST, "<H"):
                self._set(talk, MOST, "<H", bears)
        return min(self._read(talk, MOST, "<H"), MOST_TOLD)

    def _set_up(self, talk: Talk) -> None:
        """Map the PDOs, set mode and watchdog, and let PDOs begin."""
        talk.send([CanFrame(NMT, bytes((PREOPERATIONAL, self.node)))])
        for parameters, mapping, cob, kind, objects in (
            (0x1400, 0x1600, RPDO1, 255, (0x60400010, 0x60FF0020 if self.rates else 0x60710010)),
            (0x1800, 0x1A00, TPDO1, 1, (0x60410010, 0x60610008)),
            (0x1801, 0x1A01, TPDO2, 1, (0x60640020, 0x606C0020)),
        ):
            self._write(talk, (parameters, 1), "<I", 0x80000000 | cob + self.node)
            self._write(talk, (parameters, 2), "<B", kind)
            self._write(talk, (mapping, 0), "<B", 0)
            for n, entry in enumerate(objects, 1):
                self._write(talk, (mapping, n), "<I", entry)
            self._write(talk, (mapping, 0), "<B", len(objects))
            self._write(talk, (parameters, 1), "<I", cob + self.node)
        self._set(talk, ABORT, "<h", 1)
        self._set(talk, CONSUMED, "<I", HOST << 16 | round(1e3 * self.entry.figures["watchdog"]))
        self._set(talk, MODE, "<b", self._mode)
        self._clear_offsets(talk)
        talk.send([CanFrame(NMT, bytes((START, self.node)))])

    def _clear_offsets(self, talk: Talk) -> None:
        """Set to 0 the offsets that a drive adds to commanded rate and torque, if it has any: they may be saved. Raises
        Problem E404 where it keeps one."""
        for which, layout in OFFSETS:
            if self._sdo(talk, _upload(which), _words(which), may_lack=True) and self._read(talk, which, layout) != 0.0:
                self._set(talk, which, layout, 0)

    def _sdo(self, talk: Talk, data: bytes, what: str, *, may_lack: bool = False) -> bytes:
        """The answer to an SDO of up to four bytes; empty for a missing object that is optional. Raises Problem E402
        without an answer, E404 where it is refused."""
        self._answer = None
        multiplexer = data[1:4]

        def answered() -> bool:
            return self._answer is not None and self._answer[1:4] == multiplexer

        if not talk.ask([CanFrame(SDO_ASK + self.node, data.ljust(8, b"\0"))], answered):
            raise talk.silent(self, what)
        assert self._answer is not None
        if self._answer[0] == 0x80:
            code = struct.unpack_from("<I", self._answer, 4)[0]
            if may_lack and code in NO_OBJECT:
                return b""
            raise self.wrong(f"it refuses {what}, 0x{code:08X}", "its documentation says whether it has that object")
        return self._answer

    def _read(self, talk: Talk, which: tuple[int, int], layout: str) -> float:
        """An object, read twice: a limit is not taken from one frame."""
        what = _words(which)
        size = struct.calcsize(layout)
        first, second = (self._sdo(talk, _upload(which), what) for _ in range(2))
        if first != second or first[0] & 0xE3 != 0x43 or 4 - (first[0] >> 2 & 3) < size:
            raise self.wrong(f"{what} is not what it is in a drive", "two nodes of one number on the bus?")
        return float(struct.unpack_from(layout, first, 4)[0])

    def _write(self, talk: Talk, which: tuple[int, int], layout: str, value: int) -> None:
        """Set an object by SDO. layout: of its value, as of struct. Raises Problem E402, E404."""
        size = struct.calcsize(layout)
        head = 0x23 | (4 - size) << 2
        what = f"to set {_words(which)}"
        self._sdo(talk, struct.pack("<BHB", head, *which) + struct.pack(layout, value), what)

    def _set(self, talk: Talk, which: tuple[int, int], layout: str, value: int) -> None:
        """Set an object, and see that it is set. Raises Problem E404 where it is not."""
        self._write(talk, which, layout, value)
        if (value_read := self._read(talk, which, layout)) != value:
            raise self.wrong(
                f"it does not take {value} for {_words(which)}, which is {value_read:g}", "set it by its maker's tool"
            )

    # Frames

    def _pdo(self, control: int, command_counts: int = 0) -> CanFrame:
        return CanFrame(RPDO1 + self.node, struct.pack("<Hi" if self.rates else "<Hh", control, command_counts))

    def armed(self) -> Sequence[CanFrame]:
        self._wanted = True
        return self.command(0.0)

    def command(self, value: float) -> Sequence[CanFrame]:
        """The next step towards operation, or torque or rate once it is there. The drive's come last: they end with the
        heartbeat that feeds both watchdogs, and the SYNC at which both answer."""
        command_counts = 0
        if self.state == DriveState.DRIVING:
            counts = self.own(value) / (self._rate_unit if self.rates else 1e-3 * self._rated)
            command_counts = math.trunc(counts + math.copysign(1e-6, counts))  # rounding must not lose a step
        self._checks.tell(command_counts)
        frames = (self._pdo(self._control if self._wanted else OFF, command_counts),)
        return frames if self.entry.role == "load" else (*frames, CanFrame(HEARTBEAT + HOST, b"\x05"), *self.query())

    def query(self) -> Sequence[CanFrame]:
        return (CanFrame(SYNC),)

    def is_asked_by(self, frame: CanFrame) -> bool:
        return frame.id == SYNC

    def checks(self) -> Sequence[CanFrame]:
        """The question by SDO for a target or limit that is due, before the next command replaces it; the two drives
        take turns."""
        self._turn += 1
        every = DOUBTED_EVERY if self._checks.doubtful else CHECK_EVERY
        turn = self._turn + every // 2 * (self.entry.role == "load")
        if self.state != DriveState.DRIVING or turn % every or not (what := self._checks.next()):
            return ()
        return (CanFrame(SDO_ASK + self.node, _upload(self._objects[what][0])),)

    def is_command(self, frame: CanFrame) -> bool:
        """True for a frame that changes what this drive does: NMT, an SDO that writes, a target, a SYNC or the host's
        heartbeat."""
        if frame.extended or frame.fd or frame.remote:
            return False
        if frame.id == NMT:
            return frame.data[1:2] in (b"\0", bytes([self.node]))
        if frame.id == SDO_ASK + self.node:
            return frame.data[:1] != b"" and frame.data[0] >> 5 in DOWNLOADS
        return frame.id in (SYNC, HEARTBEAT + HOST, *(base + self.node for base in RPDOS))

    def idle(self) -> Sequence[CanFrame]:
        self._wanted = False
        return (self._pdo(OFF),)

    def cleared(self) -> Sequence[CanFrame]:
        self._wanted, self._error = False, 0
        return (self._pdo(OFF), self._pdo(RESET), self._pdo(OFF))

    def answers(self) -> Sequence[CanFrame]:
        return (CanFrame(TPDO1 + self.node, bytes(3)), CanFrame(TPDO2 + self.node, bytes(8)))

    def take(self, frame: CanFrame) -> bool:
        """Take an answer to SDO, a PDO or an emergency message of this drive. Returns whether the frame is one and
        new."""
        if frame.extended or frame.fd or frame.remote or frame.id & 0x7F != self.node:
            return False
        which, data = frame.id & 0x780, frame.data
        if which == SDO_ANSWER and len(data) == 8:
            self._answer = data
            self._check(data, frame.time)
        elif which == TPDO1 and len(data) == 3:
            status, mode = struct.unpack("<Hb", data)
            self._status(status, mode, frame.time)
        elif which == TPDO2 and len(data) == 8:
            position, velocity = struct.unpack("<ii", data)
            angle, rate = position * self._step, velocity * self._rate_unit
            if self.has_said(data, rate, frame.time):
                return False
            self.reading = DriveReading(frame.time, self.own(angle), self.own(rate))
        elif which == EMERGENCY and len(data) == 8:
            self._error = self._error or struct.unpack_from("<H", data)[0]
        else:
            return False
        return True

    def _check(self, data: bytes, time: float) -> None:
        """Take the answer to the question for a target or limit; another value than this host's shows another master.
        time: of the frame, s"""
        if not self._checks.open_question:
            return
        which, layout = self._objects[self._checks.open_question]
        upload = data[0] & 0xE3 == 0x43 and 4 - (data[0] >> 2 & 3) >= struct.calcsize(layout)
        if not upload or data[1:4] != struct.pack("<HB", *which):
            return
        if what := self._checks.answered(struct.unpack_from(layout, data, 4)[0], time):
            self.disturbed = f"{self.words} was commanded by another: {what}"

    def _status(self, status: int, mode: int, time: float) -> None:
        """Take a statusword: the drive's state, why it failed, and the next controlword on the way to where it is
        wanted. time: of the frame, s."""
        self.stated, drove = time, self.state == DriveState.DRIVING
        if status & 0x4F in (0x08, 0x0F):
            self.state, self.errors = DriveState.FAILED, f"error 0x{self._error:04X}"
        elif status & 0x6F == 0x27:
            if not drove:
                self._error = 0  # an emergency from before is not why it stops after
            self.state = DriveState.DRIVING
            self.errors = "" if mode == self._mode else f"it is in mode {mode}, and not in {self._mode}"
        elif status & 0x6F == 0x07:
            self.state, self.errors = DriveState.DRIVING, "it makes a quick stop"
        else:
            self.state, self.errors = DriveState.IDLE, ""
        if drove and self.state != DriveState.DRIVING:
            self._wanted = False  # it goes on only where it is armed again
        self.starved = self.state == DriveState.FAILED and self._error == HEARTBEAT_LOST
        self._control = {0x40: SHUT_DOWN, 0x21: SWITCH_ON, 0x23: ENABLE, 0x27: ENABLE}.get(
            status & 0x4F if status & 0x4F == 0x40 else status & 0x6F, SHUT_DOWN
        )
