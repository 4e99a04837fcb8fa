"""Any frames, ticks and rates in any order: the core tells its port and its host what the model of the page does."""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hw.bed import Capability
from tests.hw.firmware import wire
from tests.hw.firmware.device import LOCK_STEP, PLAIN, Device
from tests.hw.firmware.model import Model
from tests.hw.firmware.wire import Hello, Limits, Sample, framed, payloads, told

pytestmark = pytest.mark.compiler

# near the limits and far from them
COUNTS = st.one_of(
    st.integers(-2100, 2100), st.integers(-450, 450), st.sampled_from([0, 2000, -2000, 1500, 2**31 - 1, -(2**31)])
)
# one ahead, mostly
NUMBERS = st.one_of(st.just(1), st.just(1), st.just(1), st.integers(0, 65535), st.sampled_from([0, 32767, 32768]))

LIMIT_BODY = st.builds(lambda which, value: struct.pack("<Bi", which, value), st.integers(0, 6), COUNTS)
COMMAND = st.builds(
    lambda voltage, current, last: struct.pack("<iiB", voltage, current, last),
    COUNTS,
    COUNTS,
    st.sampled_from([0, 1, 2, 14, 15, 30]),
)
PRESET_BODY = st.builds(
    lambda which, value: bytes([which]) + value, st.integers(0, 4), st.binary(min_size=8, max_size=8)
)

FRAMES = st.one_of(
    st.tuples(st.just(wire.HELLO), NUMBERS, st.binary(min_size=1, max_size=1)),
    st.tuples(st.just(wire.LIMIT), NUMBERS, LIMIT_BODY),
    st.tuples(st.just(wire.ARM), NUMBERS, st.sampled_from([struct.pack("<I", 0xC0FFEE)] * 4 + [bytes(4)])),
    st.tuples(st.sampled_from([wire.DRIVE, wire.STEP]), NUMBERS, COMMAND),
    st.tuples(st.sampled_from([wire.STOP, wire.CLEAR, wire.READ]), NUMBERS, st.just(b"")),
    st.tuples(st.just(wire.PRESET), NUMBERS, PRESET_BODY),
    st.tuples(st.integers(0, 255), NUMBERS, st.binary(max_size=9)),
)

ACTS = st.lists(
    st.one_of(
        FRAMES,
        FRAMES,
        st.tuples(st.just("tick"), st.integers(1, 16)),
        st.tuples(st.just("rate"), st.one_of(st.integers(-25, 25), st.sampled_from([3500, 3501, -3501, -(2**31)]))),
        st.tuples(st.just("noise"), st.integers(1, 20)),
    ),
    max_size=60,
)
# what gets to armed at once, so that most of what follows is about that
OPENING = [(wire.HELLO, 1, b"\1"), (wire.ARM, 1, struct.pack("<I", 0xC0FFEE))]
HOT = [
    *OPENING,
    *[(wire.DRIVE, 1, struct.pack("<iiB", 0, i, 0)) for i in (700, 1400)],
    *[("tick", 14), (wire.DRIVE, 1, struct.pack("<iiB", 0, 1400, 0))] * 20,
]


def said(payload: bytes) -> tuple[object, ...]:
    found = told(payload)
    if isinstance(found, Hello):
        return ("hello", found.number)
    if isinstance(found, Limits):
        return ("limits", found.number, *found.counts)
    assert isinstance(found, Sample)
    return ("sample", found.number, found.status, found.tick, found.rate)


@pytest.mark.release
@pytest.mark.parametrize(
    "capabilities", [Capability(0), Capability.SIMULATED, LOCK_STEP], ids=["motor", "free", "lock-step"]
)
@given(opened=st.booleans(), acts=ACTS)
@example(opened=False, acts=HOT)
@settings(max_examples=300, deadline=None)
def test_the_core_does_what_the_model_does(capabilities: Capability, opened: bool, acts: list[Any]) -> None:
    device = Device(replace(PLAIN, capabilities=capabilities))
    model = Model(Capability.LOCK_STEP in capabilities, Capability.SIMULATED in capabilities)
    number = 0
    for act in [*(OPENING if opened else []), *acts]:
        if act[0] == "tick":
            device.tick(act[1])
            for _ in range(act[1]):
                model.tick()
        elif act[0] == "rate":
            device.sensors.rate = model.rate = act[1]
        elif act[0] == "noise":
            assert device.raw(b"\x09\x01\0" * act[1]) == b""
            for _ in range(act[1]):
                model.take(None)
        else:
            kind, ahead, body = act
            number = (number + ahead) & 0xFFFF
            payload = struct.pack("<BH", kind, number) + body
            answers = [said(each) for each in payloads(device.raw(framed(payload)))]
            expected = model.take(payload)
            assert answers == ([] if expected is None else [expected]), act
        assert device.events() == model.events, act
        model.events = []
