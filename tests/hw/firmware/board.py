"""The firmware with its simulated board as a library, on a clock that is set: the other end of a `VirtualLine`.

It has the face of tests/hw/device.py, for the same tests. What it says of itself is what its amplifiers were told.
"""

from __future__ import annotations

import ctypes
from dataclasses import astuple

from hw.boards.build import build
from tests.hw import device as model
from tests.hw.firmware import wire
from tests.hw.firmware.line import FREE, PLANT, STEPPED

COMMANDS = (wire.DRIVE, wire.STEP)
_LISTENER = ctypes.CFUNCTYPE(None, ctypes.c_char, ctypes.c_int32)


class Board:
    """One bed; of each kind one at a time. version: that it says, as another firmware in its place would.

    outputs    (name, value) as the amplifiers were told;  answers: payloads by number
    commanded  numbers of the commands that reached an output, none of which may be of zero volts
    """

    def __init__(self, *, lock_step: bool) -> None:
        config = STEPPED if lock_step else FREE
        self.lib = ctypes.CDLL(str(build("library", config, PLANT)))
        self.lib.board_send.restype = ctypes.c_size_t
        self.lock_step, self.tick_hz, self.version = lock_step, config.tick_hz, 1
        self.scales = astuple(config.scales)
        self.outputs: list[tuple[str, float]] = []
        self.answers: dict[int, list[bytes]] = {}
        self.commanded: list[int] = []
        self.faults = 0
        self._heard = _LISTENER(self._output)
        listener = ctypes.c_void_p.in_dll(self.lib, "board_listener")
        listener.value = ctypes.cast(self._heard, ctypes.c_void_p).value
        self._held = {"current": 0, "voltage": 0}
        self.boot()

    def boot(self) -> None:
        self.began: float | None = None
        self.ticks = 0
        self._coming = b""
        self.lib.board_boot(0)

    @property
    def state(self) -> int:
        """By its outputs."""
        return model.ARMED if any(self._held.values()) else model.DISARMED

    def at(self, time: float) -> None:
        """The clock, s."""
        if self.began is None:
            self.began = time
        while not self.lock_step and (self.ticks + 1) / self.tick_hz <= time - self.began + 1e-12:
            before = self.state
            self.lib.board_tick()
            self.ticks += 1
            if before == model.ARMED and self.state != model.ARMED:
                self.faults = model.DEADMAN  # no other tick ends what these tests command

    def take(self, data: bytes) -> bytes:
        """Bytes from the line, one after another; those that go back."""
        out, back = ctypes.create_string_buffer(1024), b""
        del self.outputs[:-1000]
        for at in range(len(data)):
            byte = data[at : at + 1]
            before = len(self.outputs)
            self.lib.board_receive(byte, ctypes.c_size_t(1))
            count = self.lib.board_send(out, ctypes.c_size_t(1024))
            self._coming += byte
            if byte == b"\0":
                self._note(before)
                self._coming = b""
            for payload in wire.payloads(out.raw[:count]):
                if payload[0] == wire.TOLD_HELLO:
                    payload = payload[:3] + bytes((self.version,)) + payload[4:]
                self.answers.setdefault(int.from_bytes(payload[1:3], "little"), []).append(payload)
                back += wire.framed(payload)
        return back

    def _note(self, before: int) -> None:
        """What the frame that has ended did to the outputs since there were so many."""
        if any(value for _, value in self.outputs[before:]):
            [payload] = wire.payloads(self._coming)
            assert payload[0] in COMMANDS, "an output by something that is no command"
            self.commanded.append(int.from_bytes(payload[1:3], "little"))
            self.faults = 0

    def _output(self, output: bytes, counts: int) -> None:
        name = "current" if output == b"i" else "voltage"
        self._held[name] = counts
        self.outputs.append((name, counts * self.scales[name == "current"]))
