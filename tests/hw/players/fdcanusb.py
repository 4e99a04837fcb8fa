"""An fdcanusb, as its maker's description has it, and its bus's end on a pseudo-terminal.

PlayedFdcanusb       the adapter: takes bytes of its line, and says others
PlayedFdcanusbPort   the bus's end of it, for `play`, its line being a pseudo-terminal
"""

from __future__ import annotations

import select
import time
from collections import deque
from collections.abc import Mapping
from typing import Any

from hw.drives.bench_file import FDCANUSB, SERIAL
from hw.drives.bus import open_bus
from hw.drives.drive import CanFrame, CanLine
from tests.hw.players.odrive_ascii import PlayedOdrivePorts
from tests.hw.players.terminal import Terminal


class PlayedFdcanusb:
    """An adapter. on: whether it is on its bus;  settings: by name, as they were set"""

    def __init__(self) -> None:
        self.on = False
        self.settings = {"can.bitrate": "1000000", "can.fd_bitrate": "5000000"}
        self._begun = ""

    def hears(self, data: bytes) -> tuple[list[CanFrame], bytes]:
        """Take bytes from the host. Returns the frames that it sends on its bus, and its answers."""
        frames, said = [], ""
        *lines, self._begun = (self._begun + data.decode("latin-1")).split("\n")
        for each in lines:
            words = each.split()
            if words:
                found, answer = self._obey(words)
                frames += found
                said += f"{answer}\r\n"
        return frames, said.encode()

    def _obey(self, words: list[str]) -> tuple[list[CanFrame], str]:
        match words:
            case ["can", "on"] if self.on:
                return [], "ERR already in BusOn"
            case ["can", "off"] if not self.on:
                return [], "ERR already in BusOff"
            case ["can", "on" | "off" as which]:
                self.on = which == "on"
                return [], "OK"
            case ["conf", "set", name, value]:
                if name not in self.settings or self.on:
                    return [], "ERR error setting"
                self.settings[name] = value
                return [], "OK"
            case ["can", "std" | "ext", *_] if not self.on:
                return [], "ERR not in BusOn state"
            case ["can", "std" | "ext" as kind, number, data, *flags]:
                letters = "".join(flags)
                try:
                    frame = CanFrame(
                        int(number, 16), bytes.fromhex(data), kind == "ext", "R" in letters, "F" in letters
                    )
                except ValueError:
                    return [], "ERR invalid data"
                return [frame], "OK"
        return [], "ERR unknown command"

    def says(self, frame: CanFrame) -> bytes:
        """Its output for a frame on its bus."""
        if not self.on:
            return b""
        number = f"{frame.id:X}"
        number = number.rjust(len(number) + len(number) % 2, "0")
        flags = (("e", "E")[frame.extended], ("b", "B")[frame.fd], ("f", "F")[frame.fd], ("r", "R")[frame.remote])
        return f"rcv {number} {frame.data.hex().upper()} {' '.join(flags)} x-1\r\n".encode()


class PlayedFdcanusbPort:
    """The bus's end of an adapter whose line is a pseudo-terminal, to which a link leads. Making it raises Problem
    E400 where something else is at that path."""

    def __init__(self, path: str) -> None:
        self._terminal = Terminal(path, "fdcanusb", "`channel` of `[bus]`")
        self._adapter, self._frames = PlayedFdcanusb(), deque[CanFrame]()

    def now(self) -> float:
        return time.perf_counter()

    def send(self, frame: CanFrame) -> None:
        self._terminal.write(self._adapter.says(frame))

    def receive(self, until: float) -> CanFrame | None:
        while not self._frames:
            if not select.select((self._terminal.file,), (), (), max(0.0, until - time.perf_counter()))[0]:
                return None
            frames, said = self._adapter.hears(self._terminal.read())
            self._frames += frames
            self._terminal.write(said)
        return self._frames.popleft()

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)

    def close(self) -> None:
        self._terminal.close()


def played_bus(settings: Mapping[str, Any]) -> CanLine:
    """The drives' end of the bus that `[bus]` of a bench file describes. Raises Problem E400 or E449, OSError."""
    if settings["interface"] == SERIAL:
        return PlayedOdrivePorts(settings["ports"])
    if settings["interface"] == FDCANUSB:
        return PlayedFdcanusbPort(str(settings["channel"]))
    return open_bus(settings)
