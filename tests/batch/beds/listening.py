"""A deck whose shoulder is on a bed, and a device at the other end of a line that keeps what it is asked."""

from __future__ import annotations

from tests.hw.device import Device, payload

DECK = """\
#include <two_link.ic>
run wired like nominal {
    rates    { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration = 1 s;
    record   = [q];
    remove settle;
    remove volts;
    substitute shoulder { bed = emulated(delay = 1, faults = typical);  law = velocity_tracking; }
}
run both like wired { substitute elbow { bed = emulated(delay = 1);  law = velocity_tracking; } }
run soft like wired { remove shoulder; }
"""

HELLO, STOP, READ = 1, 6, 8


class Listening(Device):
    """A device that keeps the kinds of the messages that it was sent."""

    def boot(self) -> None:
        super().boot()
        self.kinds: list[int] = []

    def take(self, data: bytes) -> bytes:
        self.kinds += [found[0] for each in data.split(b"\0")[:-1] if (found := payload(each)) is not None]
        return super().take(data)
