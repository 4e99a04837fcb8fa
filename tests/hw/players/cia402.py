"""A drive of CiA 402 in modes 9 and 10, over canopen's LocalNode, whose object dictionary and SDO server it has.

canopen is imported when one is made.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any

from hw.drives.drive import CanFrame
from tests.hw.players.player import PlayedDrive
from tests.hw.players.shaft import OFF, Output

_OBJECTS = (
    ("device", 0x1000, 0, 7, 0x00020192),
    ("consumed", 0x1016, 1, 7, 0),
    ("vendor", 0x1018, 1, 7, 0xFB),
    ("product", 0x1018, 2, 7, 0x6050),
    ("revision", 0x1018, 3, 7, 0x0170),
    *((f"rpdo1 {n}", 0x1400, n, kind, 0) for n, kind in ((1, 7), (2, 5))),
    *((f"rpdo1 map {n}", 0x1600, n, 5 if n == 0 else 7, 0) for n in range(5)),
    *((f"tpdo1 {n}", 0x1800, n, kind, 0) for n, kind in ((1, 7), (2, 5))),
    *((f"tpdo2 {n}", 0x1801, n, kind, 0) for n, kind in ((1, 7), (2, 5))),
    *((f"tpdo1 map {n}", 0x1A00, n, 5 if n == 0 else 7, 0) for n in range(5)),
    *((f"tpdo2 map {n}", 0x1A01, n, 5 if n == 0 else 7, 0) for n in range(5)),
    ("abort", 0x6007, 0, 3, 0),
    ("control", 0x6040, 0, 6, 0),
    ("status", 0x6041, 0, 6, 0x40),
    ("mode", 0x6060, 0, 2, 0),
    ("mode shown", 0x6061, 0, 2, 0),
    ("target torque", 0x6071, 0, 3, 0),
    ("target velocity", 0x60FF, 0, 4, 0),
    ("most torque", 0x6072, 0, 6, 3000),
    ("rated torque", 0x6076, 0, 7, 200),
    ("most speed", 0x6080, 0, 7, 6000),
    ("steps", 0x608F, 1, 7, 65536),
    ("turns", 0x608F, 2, 7, 1),
    ("velocity unit", 0x60A9, 0, 7, 0x00B44700),
    ("velocity offset", 0x60B1, 0, 4, 0),
    ("torque offset", 0x60B2, 0, 3, 0),
    ("modes", 0x6502, 0, 7, 0x3ED),
)
"""Name, index, subindex, type (CiA 301) and value of each object."""

_LAYOUTS = {2: "<b", 3: "<h", 4: "<i", 5: "<B", 6: "<H", 7: "<I"}
_LAYOUT = {(index, sub): struct.Struct(_LAYOUTS[kind]) for _, index, sub, kind, _ in _OBJECTS}


class PlayedCia402(PlayedDrive):
    """A CiA 402 drive.

    watches  False for one that does not miss the host's heartbeat
    refuses  objects that keep what they are, by index; 0x6061: it stays in the mode that it is in
    saved    what objects are after it was switched on, by index, where it is not what is usual
    rate_gain N m s/rad and rate_integral N m/rad, of its rate loop
    """

    def __init__(self, node: int, sense: int = 1, *, rate_gain: float = 0.01, rate_integral: float = 0.05) -> None:
        super().__init__(node, sense)
        self.rate_gain, self.rate_integral = rate_gain, rate_integral
        import canopen

        class Network(canopen.Network):
            """A network whose frames go into a list."""

            def __init__(self) -> None:
                super().__init__()
                self.sent: list[CanFrame] = []

            def send_message(self, can_id: int, data: Any, remote: bool = False) -> None:
                self.sent.append(CanFrame(can_id, bytes(data), remote=remote))

        dictionary = canopen.ObjectDictionary()
        for name, index, sub, kind, value in _OBJECTS:
            variable = canopen.objectdictionary.ODVariable(name, index, sub)
            variable.data_type, variable.access_type, variable.default = kind, "rw", value
            if any(each[1] == index and each[2] for each in _OBJECTS):
                if index not in dictionary:
                    dictionary.add_object(canopen.objectdictionary.ODRecord(f"record {index:X}", index))
                record = dictionary[index]
                assert isinstance(record, canopen.objectdictionary.ODRecord)
                record.add_member(variable)
            else:
                dictionary.add_object(variable)
        self.refuses: set[int] = set()
        self._network = Network()
        self._node = canopen.LocalNode(node, dictionary)
        self._node.associate_network(self._network)
        self._values: dict[tuple[int, int], int] = {}
        """The objects' values as numbers: each tick reads some."""
        self._node.add_write_callback(self._written)
        self.watches = True
        self.saved: dict[int, int] = {}
        self.reboot()

    def reboot(self) -> None:
        """Restart as after a loss of supply: unsaved values are gone."""
        for _, index, sub, _, value in _OBJECTS:
            self.set_value(index, sub, self.saved.get(index, value))
        self.status, self.torque, self.heard, self.error = 0x40, 0.0, math.inf, 0
        self.rate_told, self.integral, self.looped = 0.0, 0.0, 0.0
        self._operational = False

    def value(self, index: int, sub: int = 0) -> int:
        """An object's value."""
        return self._values[index, sub]

    def _written(self, index: int, subindex: int, od: object, data: bytes) -> None:
        """Note what is written into an object, by whomever."""
        self._values[index, subindex] = _LAYOUT[index, subindex].unpack(data)[0]

    def set_value(self, index: int, sub: int, value: int) -> None:
        """Set an object."""
        self._node.set_data(index, sub, _LAYOUT[index, sub].pack(value))

    def _offset(self, index: int) -> int:
        """An offset; 0 where it has no such object."""
        return self.value(index) if index in self._node.object_dictionary else 0

    @property
    def mode(self) -> int:
        """The mode that it is in."""
        return self.value(0x6061)

    @property
    def bridge(self) -> Output:
        return Output("torque", self.torque) if self.status == 0x27 else OFF

    def receive(self, frame: CanFrame, now: float) -> Sequence[CanFrame]:
        if frame.extended or frame.fd:
            return ()
        data = frame.data
        if frame.id == 0x000 and len(data) == 2 and data[1] in (0, self.node):
            self._operational = {1: True, 0x80: False, 2: False}.get(data[0], self._operational)
        elif frame.id == 0x600 + self.node and len(data) == 8:
            return self._served(data, now)
        elif frame.id == 0x700 + (self.value(0x1016, 1) >> 16) and self.value(0x1016, 1):
            self.heard = now
        elif self._operational and frame.id == self.value(0x1400, 1):
            rates = self.value(0x1600, 2) == 0x60FF0020
            layout = "<Hi" if rates else "<Hh"
            if len(data) >= struct.calcsize(layout):
                control, told = struct.unpack_from(layout, data)
                self.set_value(0x60FF if rates else 0x6071, 0, told)
                self._obey(control, told)
        elif self._operational and frame.id == 0x080 and not data:
            return self._answers()
        return ()

    def _served(self, data: bytes, now: float) -> Sequence[CanFrame]:
        """The answers of its SDO server."""
        self.set_value(0x6041, 0, self.status)
        which, kept = (data[2] << 8 | data[1], data[3]), b""
        if which[0] in self.refuses:
            kept = self._node.get_data(*which)
        self._network.notify(0x600 + self.node, bytearray(data), now)
        if kept:
            self._node.set_data(*which, kept)
        if data[0] & 0xE0 == 0x20 and which[0] == 0x6040:
            self._obey(self.value(0x6040), 0)
        if 0x6061 not in self.refuses:
            self.set_value(0x6061, 0, self.value(0x6060))
        sent, self._network.sent = self._network.sent, []
        return sent

    def _answers(self) -> Sequence[CanFrame]:
        """Its two PDOs, as mapped."""
        turns = 2.0 * math.pi
        per_turn = self.value(0x608F, 1) / self.value(0x608F, 2)
        values = {
            0x60410010: struct.pack("<H", self.status),
            0x60610008: struct.pack("<b", self.mode),
            0x60640020: struct.pack("<i", _wrapped(math.floor(self.angle / turns * per_turn))),
            0x606C0020: struct.pack("<i", round(self.rate / self._rate_unit)),
        }
        out = []
        for parameters, mapping in ((0x1800, 0x1A00), (0x1801, 0x1A01)):
            cob, count = self.value(parameters, 1), self.value(mapping, 0)
            if not cob & 0x80000000 and count and self.value(parameters, 2) == 1:
                out.append(CanFrame(cob, b"".join(values[self.value(mapping, n)] for n in range(1, count + 1))))
        return out

    @property
    def _rate_unit(self) -> float:
        """Its unit of velocity, rad/s: a turn a minute, or a thousandth of it."""
        return 2.0 * math.pi / 60.0 * (1e-3 if self.value(0x60A9) == 0xFDB44700 else 1.0)

    def _obey(self, control: int, told: int) -> None:
        """Follow the state machine of CiA 402 by a step."""
        if self.status == 0x08:
            if control & 0x80:
                self.status, self.error = 0x40, 0
            return
        if not control & 0x02:
            self.status = 0x40
        elif control & 0x0F == 0x06:
            self.status = 0x21
        elif control & 0x0F == 0x07 and self.status in (0x21, 0x27):
            self.status = 0x23
        elif control & 0x0F == 0x0F and self.status == 0x23:
            self.status = 0x27
        mode = self.mode
        if self.status != 0x27:
            self.torque, self.rate_told, self.integral = 0.0, 0.0, 0.0
        elif mode == 9:
            fastest = self.value(0x6080) * 2.0 * math.pi / 60.0
            told += self._offset(0x60B1)
            self.rate_told = min(max(told * self._rate_unit, -fastest), fastest)
        else:
            told += self._offset(0x60B2)
            self.torque = self._limited(1e-6 * self.value(0x6076) * told) if mode == 10 else 0.0

    def _limited(self, torque: float) -> float:
        """A torque within its largest, N m."""
        most = 1e-6 * self.value(0x6076) * self.value(0x6072)
        return min(max(torque, -most), most)

    def tick(self, now: float) -> Sequence[CanFrame]:
        passed, self.looped = now - self.looped, now
        if self.status == 0x27 and self.mode == 9:
            error = self.rate_told - self.rate
            wanted = self.rate_gain * error + self.integral + 1e-6 * self.value(0x6076) * self._offset(0x60B2)
            self.torque = self._limited(wanted)
            if self.torque == wanted:  # how a maker holds the integral at the limit is no part of CiA 402
                self.integral += self.rate_integral * passed * error
        time = 1e-3 * (self.value(0x1016, 1) & 0xFFFF)
        lost = self.watches and time and self._operational and now - self.heard > time
        return self.fail(0x8130) if lost and self.value(0x6007) == 1 and self.status == 0x27 else ()

    def fail(self, error: int) -> Sequence[CanFrame]:
        """Fail, and say so."""
        self.status, self.torque, self.error = 0x08, 0.0, error
        return (CanFrame(0x080 + self.node, struct.pack("<HB5x", error, 0x11)),)


def _wrapped(value: int) -> int:
    """A whole number as 32 bits hold it."""
    return (value + (1 << 31)) % (1 << 32) - (1 << 31)
