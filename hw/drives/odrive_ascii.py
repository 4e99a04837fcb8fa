"""ODrive's ASCII protocol, of firmware 0.6, each drive on a serial line of its own: USB, or a UART.

    c 0 TORQUE, v 0 RATE 0    told: N m of the motor's shaft, or turns/s with no torque besides; feeds the watchdog
    f 0                       asked: angle and rate, turns and turns/s, in decimals
    r PATH, w PATH VALUE      properties, by their names
    sc                        forget errors

Lines, checksums and whose turn it is are those of hw/drives/odrive_lines.py; what CAN and serial lines have in common
is in hw/drives/odrive_axis.py. The protocol has no emergency stop: `es` sets an encoder.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace

from hw.drives.bench_file import ASCII, DriveEntry
from hw.drives.checks import SELDOM
from hw.drives.drive import ASKS, GREETED, CanFrame, DriveFacts, DriveReading, DriveState, Talk
from hw.drives.odrive_axis import (
    CLOSED_LOOP,
    CONTROL_MODE,
    IDLE,
    INPUT_MODE,
    PASSTHROUGH,
    TURN,
    OdriveAxis,
)
from hw.drives.odrive_lines import OdriveLines
from met.diagnostic import Problem, error

STATE, ACTIVE, REASON = "axis0.current_state", "axis0.active_errors", "axis0.disarm_reason"
VOLTAGE, CURRENT = "vbus_voltage", "ibus"
REQUESTED = "axis0.requested_state"
FIRMWARE_NUMBERS = ("fw_version_major", "fw_version_minor", "fw_version_revision")
HARDWARE_NUMBERS = ("hw_version_major", "hw_version_minor", "hw_version_variant")

QUIET = 0.02
"""Time to wait for late answers before a question of a greeting is repeated, s."""

SUPPLY_EVERY = 8
"""Exchanges of which one asks for the supply; of the others every other asks for what another master would have
changed, and the rest for the state."""

DIGITS = 1e-6
"""Turns, and turns/s, of the last decimal of an angle and a rate, as firmware 0.5 writes them."""

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d{1,3})?|[-+]?inf")


class OdriveAsciiDrive(OdriveAxis):
    """The host's side of an ODrive's axis on a serial line."""

    dialect = ASCII
    unseen = SELDOM

    def __init__(self, entry: DriveEntry) -> None:
        super().__init__(entry)
        self._answered: dict[str, str] = {}
        """Values of properties, from their last answers."""
        self._state: int | None = None
        """The state that is not that of driving, until it is known why."""
        self._errors: dict[str, int] = {}
        """Its errors, as they were answered since that state."""
        self._turn = 0

    @property
    def where(self) -> str:
        return self.entry.port

    def greet(self, talk: Talk) -> DriveFacts:
        """Check the firmware of this ODrive, and that its answers come soon enough; it is idle afterwards. Raises
        Problem E402 to E404."""
        self._state, self._turn, self.steps = None, 0, (TURN * DIGITS, TURN * DIGITS)
        self._written.clear()
        if not isinstance(talk.line, OdriveLines):
            raise self.wrong("it is not on a serial line", '`interface = "serial"` of `[bus]`')
        numbers = [self._read(talk, path) for path in (*FIRMWARE_NUMBERS, *HARDWARE_NUMBERS)]
        if not all(math.isfinite(number) for number in numbers):
            raise self.other("its version is no number", "MET speaks to firmware 0.6")
        firmware, hardware = (tuple(int(number) for number in numbers[first : first + 3]) for first in (0, 3))
        self._check_firmware(firmware)
        took, most = talk.line.fastest(self.node), talk.line.late
        if took > most:
            helps = ("no hub between, another USB port of the computer", "a UART, at 921600 bits a second")
            raise self.wrong(f"an answer of its takes {1e3 * took:.3g} ms, and {1e3 * most:.3g} ms is the most", helps)
        talk.send(self.idle())
        words = (".".join(str(number) for number in version) for version in (firmware, hardware))
        facts = self._described(talk, *words)
        self._property(talk, VOLTAGE)
        seen = talk.line.now()
        if not talk.ask(self.query(), lambda: self.stated > seen and self.state != DriveState.DRIVING):
            raise self._silent(talk, f"`r {STATE}`")
        angle_step, rate_step = self.steps
        return replace(facts, angle_count=angle_step, rate_count=rate_step)

    def _read(self, talk: Talk, path: str) -> float:
        """A property, read until two answers in a row are the same: the checksum lets some through that are altered."""
        before = ""
        for _ in range(ASKS):
            text = self._property(talk, path)
            if text == before:
                return _number(text)
            before = text
        raise self.wrong(f"it answers each time differently what `{path}` is", "look at the cable of its line")

    def _property(self, talk: Talk, path: str) -> str:
        """The text of a property that is a number, asked for until it is answered. Raises Problem E402, E403."""
        self._answered.pop(path, None)
        for _ in range(ASKS):
            talk.send([self._text(f"r {path}")])
            if talk.pump(talk.line.now() + GREETED / ASKS - QUIET, lambda: path in self._answered):
                text = self._answered[path]
                if math.isnan(_number(text)):
                    raise self.other(f"it answers `{text[:40]}` to `r {path}`", "MET speaks to firmware 0.6")
                return text
            talk.pump(talk.line.now() + QUIET)
        raise self._silent(talk, f"`r {path}`")

    def _put(self, talk: Talk, path: str, value: float) -> None:
        talk.send([self._text(f"w {path} {float(value):.9g}")])

    def _silent(self, talk: Talk, what: str) -> Problem:
        """The error for a drive that does not answer a question of its greeting."""
        assert isinstance(talk.line, OdriveLines)
        came = talk.line.heard(self.node)
        text = "".join(
            character if character.isprintable() else "?" for character in came[:60].decode("ascii", "replace")
        )
        if came:
            helps = (f"what came is `{text}`: no answer with a checksum", "is this the line of an ODrive?")
        else:
            helps = (
                "is it switched on? its line may have another name since it was plugged in: `ls /dev/serial/by-id`",
                "its USB line speaks ASCII where `config.usb_cdc_protocol` says so, a UART `config.uart0_protocol`",
            )
        message = f"no {self.dialect} answers {what} as {self.words}"
        return Problem(error("E402", message, help=[*helps, f"`port` of `[{self.entry.role}]`, and its `dialect`"]))

    # Texts

    def _text(self, text: str) -> CanFrame:
        return CanFrame(self.node, text.encode())

    def _command(self, value: float) -> CanFrame:
        own = self.own(value) / TURN if self.rates else self.own(value)
        self._checks.tell(own)
        return self._text(f"v 0 {own:.7f} 0" if self.rates else f"c 0 {own:.7f}")

    def armed(self) -> Sequence[CanFrame]:
        """Frames that set the mode, command 0, and close the loop."""
        return (
            *(
                self._text(f"w {path} {value}")
                for path, value in ((CONTROL_MODE, self._mode), (INPUT_MODE, PASSTHROUGH))
            ),
            self._command(0.0),
            self._text(f"w {REQUESTED} {CLOSED_LOOP}"),
            *self.query(),
        )

    def command(self, value: float) -> Sequence[CanFrame]:
        """Frames of an exchange: the command, N m or rad/s, the question for angle and rate, and one for state, supply
        or a check in turn."""
        self._turn += 1
        asks: tuple[str, ...] = (STATE,)
        if self._turn % 2 == 0 and self._checks.doubtful:  # while the command before is still in force
            return (self._text(f"r {self._checks.next()}"), self._command(value), self._text("f 0"))
        if self.state == DriveState.DRIVING and self._state is not None:  # it has stopped, and does not say why itself
            asks = (ACTIVE, REASON)
        elif self._turn % SUPPLY_EVERY == 0:
            asks = (CURRENT if self._turn % (2 * SUPPLY_EVERY) else VOLTAGE,)
        elif self._turn % 2 == 0:
            asks = (self._checks.next(),)
        return (self._command(value), self._text("f 0"), *(self._text(f"r {path}") for path in asks))

    def query(self) -> Sequence[CanFrame]:
        return (self._text("f 0"), *(self._text(f"r {path}") for path in (STATE, ACTIVE, REASON)))

    def is_asked_by(self, frame: CanFrame) -> bool:
        return False  # its line asks one question at a time, and knows which answers are due

    def idle(self) -> Sequence[CanFrame]:
        return (self._command(0.0), self._text(f"w {REQUESTED} {IDLE}"))

    def cleared(self) -> Sequence[CanFrame]:
        return (self._text("sc"), *self.idle())

    def answers(self) -> Sequence[CanFrame]:
        return (self._text("-1000.000000 -1000.000000"), self._text("16777216"))

    def take(self, frame: CanFrame) -> bool:
        """Take an answer of this axis, with its question: angle and rate, or a property's value. Returns whether it is
        its and new."""
        if frame.id != self.node:
            return False
        question, _, answer = frame.data.decode("ascii", "replace").partition("\n")
        if question.startswith("f "):
            angle, rate = (_number(number) for number in answer.split())
            if not (math.isfinite(angle) and math.isfinite(rate)) or self.has_said(answer, TURN * rate, frame.time):
                return False
            own = self.own(TURN * angle), self.own(TURN * rate)
            self.reading = DriveReading(frame.time, *own, frame.time_unsure)
            return True
        path = question[2:]
        self._answered[path] = answer
        value = _number(answer)
        if path in (STATE, ACTIVE, REASON):
            self._judge(path, value, frame.time)
        elif path == VOLTAGE and math.isfinite(value):
            self.supply = value
        elif path == CURRENT and math.isfinite(value) and self.supply is not None:
            self.power = self.supply * value
        elif path == self._checks.open_question:
            self._check(value, frame.time)
        return True

    def _judge(self, path: str, value: float, time: float) -> None:
        """Take the drive's state; where it does not drive, also its errors, which are asked for after it. time: of the
        frame, s"""
        if not math.isfinite(value) or value != int(value):
            return
        if path != STATE:
            if self._state is not None and path == REASON and ACTIVE in self._errors:
                self._says(self._errors[ACTIVE] | int(value), self._state, time)
                self._state = None
            self._errors[path] = int(value)
            return
        self._errors = {}
        self._state = None if value == CLOSED_LOOP else int(value)
        if self._state is None:  # an axis with errors does not drive
            self._says(0, CLOSED_LOOP, time)


def _number(text: str) -> float:
    """The number in an answer, 1 or 0 for a truth; not-a-number for other text."""
    if text.lower() in ("true", "false"):
        return float(text.lower() == "true")
    return float(text) if _NUMBER.fullmatch(text) else math.nan
