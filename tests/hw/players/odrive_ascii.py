"""An ODrive's axis as firmware 0.6 has it on a serial line, and two such lines as pseudo-terminals.

PlayedOdriveAscii   the drive: takes the bytes of its line, as they are cut, and answers lines
PlayedOdrivePorts   the drives' end of them, for `play`, the lines being pseudo-terminals

Commands alone feed its watchdog. It writes six decimals, as the sources of 0.5 do.
"""

from __future__ import annotations

import math
import select
import time
from collections.abc import Mapping, Sequence
from typing import Any

from hw.drives.drive import CanFrame
from tests.hw.players.odrive import PlayedOdrive
from tests.hw.players.terminal import Terminal

BUFFER = 256
"""Bytes of a line, of which no drive takes more."""


UNKNOWN = "invalid property"


class PlayedOdriveAscii(PlayedOdrive):
    """An ODrive's axis on a line of its own: frames of its number carry bytes of it."""

    def __init__(self, node: int, sense: int = 1, **figures: Any) -> None:
        super().__init__(node, sense, **figures)
        self._begun = b""
        self.hardware, self.firmware = (4, 4, 58), (0, 6, 10)
        self.reason = 0

    def reboot(self) -> None:
        super().reboot()
        self._begun, self.reason = b"", 0

    def tick(self, now: float) -> Sequence[CanFrame]:
        self._watch(now)
        return ()

    def _failed(self, error: int) -> None:
        super()._failed(error)
        self.reason |= error

    def receive(self, frame: CanFrame, now: float) -> Sequence[CanFrame]:
        if frame.id != self.node:
            return ()
        said = b""
        *lines, self._begun = (self._begun + frame.data).replace(b"\r", b"\n").split(b"\n")
        self._begun = self._begun[:BUFFER]
        for line in lines:
            said += self._line(line[:BUFFER], now)
        return (CanFrame(self.node, said),) if said else ()

    def _line(self, line: bytes, now: float) -> bytes:
        """Obey a line. Returns the answer, with a checksum where the line had one."""
        command, star, sum_ = line.partition(b";")[0].partition(b"*")
        if star:
            found = 0
            for each in command:
                found ^= each
            if not sum_.strip().isdigit() or int(sum_) != found:
                return b""
        words = command.decode("latin-1").split()
        answer = self._obey(words, now) if words else None
        if answer is None:
            return b""
        if not star:
            return f"{answer}\r\n".encode()
        found = 0
        for each in answer.encode():
            found ^= each
        return f"{answer}*{found}\r\n".encode()

    def _obey(self, words: list[str], now: float) -> str | None:
        match words:
            case ["c", "0", torque]:
                self.fed = now
                self._told_torque(_float(torque))
                return None
            case ["v", "0", rate, *more]:
                self.fed = now
                self._told_rate(_float(rate))
                if more:
                    self._told_torque(_float(more[0]))
                return None
            case ["u", "0"]:
                self.fed = now
                return None
            case ["f", "0"]:
                return f"{self.angle / (2.0 * math.pi):f} {self.rate / (2.0 * math.pi):f}"
            case ["sc"]:
                self.errors = self.reason = 0
                return None
            case ["r", path]:
                return self._read(path)
            case ["w", path, value]:
                return self._write(path, value, now)
        return "unknown command"

    def _read(self, path: str) -> str:
        numbers = {
            **dict(zip(("fw_version_major", "fw_version_minor", "fw_version_revision"), self.firmware, strict=True)),
            **dict(zip(("hw_version_major", "hw_version_minor", "hw_version_variant"), self.hardware, strict=True)),
            "axis0.current_state": self.state,
            "axis0.active_errors": self.errors,
            "axis0.disarm_reason": self.reason,
        }
        if path in numbers:
            return str(numbers[path])
        if path == "ibus":
            return f"{self.bridge.value * self.rate / self.values['vbus_voltage']:f}"
        if path not in self.values:
            return UNKNOWN
        value = self.values[path]
        return f"{value:d}" if isinstance(value, bool | int) else f"{value:f}"

    def _write(self, path: str, value: str, now: float) -> str | None:
        number = _float(value)
        if path == "axis0.requested_state":
            if number == 8 and not self.errors:
                self.state, self.fed = 8, now
            elif number == 1:
                self.state, self.torque, self.integral = 1, 0.0, 0.0
        elif path not in self.values:
            return UNKNOWN
        elif path not in self.refuses and not math.isnan(number):
            kind = type(self.values[path])
            self.values[path] = kind(number)
        return None


def _float(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


class PlayedOdrivePorts:
    """The drives' end of lines that are pseudo-terminals. ports: their paths, by the drives' numbers. Making it raises
    Problem E400 where something else is at one."""

    def __init__(self, ports: Mapping[int, str]) -> None:
        self._terminals: dict[int, Terminal] = {}
        try:
            for number, path in ports.items():
                self._terminals[number] = Terminal(path, "ODrive", "`port`")
        except BaseException:
            self.close()
            raise

    def now(self) -> float:
        return time.perf_counter()

    def send(self, frame: CanFrame) -> None:
        self._terminals[frame.id].write(frame.data)

    def receive(self, until: float) -> CanFrame | None:
        files = [each.file for each in self._terminals.values()]
        select.select(files, (), (), max(0.0, until - time.perf_counter()))
        for number, terminal in self._terminals.items():
            if data := terminal.read():
                return CanFrame(number, data)
        return None

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)

    def close(self) -> None:
        for each in self._terminals.values():
            each.close()
