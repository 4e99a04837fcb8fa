"""What comes over the line: frames, numbers, and what is dropped. A device answers what the page has, and no more."""

from __future__ import annotations

import ctypes
import struct
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hw.bed import Capability
from tests.hw.firmware import wire
from tests.hw.firmware.device import LOCK_STEP, PLAIN, SENSORS, Device, library
from tests.hw.firmware.wire import frame, framed, payloads, told

pytestmark = pytest.mark.compiler

BODIES = {
    wire.HELLO: b"\1",
    wire.LIMIT: b"\0\1\0\0\0",
    wire.ARM: b"\xee\xff\xc0\0",
    wire.DRIVE: bytes(9),
    wire.STOP: b"",
    wire.CLEAR: b"",
    wire.READ: b"",
}
SENSING = replace(PLAIN, capabilities=SENSORS)
SIMULATED = replace(PLAIN, capabilities=LOCK_STEP)
FREE_SIMULATED = replace(PLAIN, capabilities=Capability.SIMULATED)


def test_the_crc_is_that_of_the_page() -> None:
    lib = library(PLAIN)
    lib.frame_crc.restype = ctypes.c_uint16
    assert lib.frame_crc(b"123456789", ctypes.c_size_t(9)) == 0x29B1


@given(st.binary(min_size=1, max_size=200))
def test_any_payload_is_stuffed_as_the_page_has_it(payload: bytes) -> None:
    lib, out = library(PLAIN), ctypes.create_string_buffer(208)
    lib.frame_encode.restype = ctypes.c_size_t
    count = lib.frame_encode(out, payload, ctypes.c_size_t(len(payload)))
    assert out.raw[:count] == framed(payload)


@given(st.binary(min_size=3, max_size=12))
def test_any_payload_is_read_back(payload: bytes) -> None:
    lib, out = library(PLAIN), ctypes.create_string_buffer(16)
    lib.frame_decode.restype = ctypes.c_size_t
    line = framed(payload)[:-1]
    count = lib.frame_decode(out, line, ctypes.c_size_t(len(line)))
    assert out.raw[:count] == payload


@pytest.mark.parametrize("bad", [b"\0\1\1", b"\1\1\0", b"", b"\xff\1\1", b"\1\1\1\1"])
def test_what_no_frame_can_be_is_none(bad: bytes) -> None:
    lib, out = library(PLAIN), ctypes.create_string_buffer(16)
    lib.frame_decode.restype = ctypes.c_size_t
    assert lib.frame_decode(out, bad, ctypes.c_size_t(len(bad))) == 0


def test_hello_tells_who_is_there() -> None:
    found = Device().greet()
    assert (found.version, found.capabilities, found.session) == (1, 0, 0xC0FFEE)
    assert found.name == b"a bed for tests\0"
    assert found.numbers == (
        1000.0,
        0.015,
        0.01,
        0.002,
        0.1,
        0.001,
        0.005,
        0.25,
        20.0,
        3.0,
        350.0,
        2.0,
        4000.0,
        1500.0,
        1.0,
    )
    assert any(found.firmware)


@pytest.mark.parametrize("version", [0, 1, 2, 255])
def test_a_host_of_any_version_is_told_the_device_s_own(version: int) -> None:
    assert Device().ask(wire.HELLO, bytes([version])).version == 1


def test_a_sample_has_what_the_capabilities_say_and_no_more() -> None:
    for config, more in ((PLAIN, ()), (SENSING, (123456, -8, -(2**31)))):
        device = Device(config)
        device.sensors.rate, device.sensors.angle = -7, 123456
        device.sensors.drive_current, device.sensors.acceleration = -8, -(2**31)
        device.tick(3)
        assert device.read() == wire.Sample(1, 0, 3, -7, more)
        assert device.greet().capabilities == config.capabilities


def test_a_session_is_the_port_s_number_of_the_first_hello_after_a_boot() -> None:
    device = Device(session=7)
    assert device.greet().session == 7
    ctypes.c_uint32.in_dll(device.lib, "fake_session").value = 8
    assert device.greet().session == 7
    device.boot(session=9)
    assert device.greet().session == 9


# What is dropped


@pytest.mark.parametrize("kind", sorted(BODIES))
@pytest.mark.parametrize("off", [-3, -1, 1, 3, 200])
def test_a_body_of_the_wrong_length_is_dropped(kind: int, off: int) -> None:
    body = BODIES[kind]
    wrong = body[:off] if off < 0 else body + b"\1" * off
    if len(wrong) == len(body):
        wrong += b"\1"
    device = Device()
    assert device.raw(frame(kind, 1, wrong)) == b""
    assert device.outputs() == [("i", 0), ("v", 0)]
    assert device.raw(frame(wire.READ, 1)) != b""  # its number was not taken either


@pytest.mark.parametrize("kind", [0, 10, 0x7F, 0x81, 0x84, 255])
def test_an_unknown_kind_is_dropped(kind: int) -> None:
    assert Device().raw(b"".join(frame(kind, 1, bytes(n)) for n in range(10))) == b""


@pytest.mark.parametrize(
    ("config", "kind", "last"),
    [(PLAIN, wire.STEP, 1), (PLAIN, wire.DRIVE, 1), (SIMULATED, wire.DRIVE, 0), (SIMULATED, wire.STEP, 0),
     (FREE_SIMULATED, wire.STEP, 1), (PLAIN, wire.PRESET, 0)],
)  # fmt: skip
def test_what_a_device_does_not_have_is_dropped(config: object, kind: int, last: int) -> None:
    device = Device(config)  # type: ignore[arg-type]
    device.greet()
    device.arm()
    assert device.raw(frame(kind, 5, bytes(8) + bytes([last]))) == b""


def test_every_flipped_bit_and_every_missing_or_doubled_byte_of_a_command_is_dropped() -> None:
    device = Device()
    device.ready()
    good = frame(wire.DRIVE, 3, struct.pack("<iiB", 100, -50, 0))
    bad = [bytes([*good[:k], good[k] ^ 1 << bit, *good[k + 1 :]]) for k in range(len(good) - 1) for bit in range(8)]
    bad += [good[:k] + good[k + 1 :] for k in range(len(good) - 1)]
    bad += [good[:k] + good[k : k + 1] + good[k:] for k in range(len(good) - 1)]
    for each in bad:
        device.boot()
        device.number = 0
        device.ready()
        assert device.raw(each + b"\0") == b"", each.hex()
        assert device.outputs() == []
    assert len(bad) == 150


def test_a_frame_is_taken_however_it_is_cut() -> None:
    device = Device()
    line = frame(wire.READ, 1)
    for k in range(len(line)):
        answer = device.raw(line[k : k + 1])
        assert bool(answer) == (k == len(line) - 1)


def test_garbage_of_any_length_spoils_the_frame_that_it_runs_into_and_no_other() -> None:
    device = Device()
    for count in (1, 14, 15, 16, 17, 1000):
        assert device.raw(b"\x55" * count + frame(wire.READ, 1)) == b""
        assert [told(each).number for each in payloads(device.raw(frame(wire.READ, 1)))] == [1]


def test_empty_frames_mean_nothing() -> None:
    device = Device()
    device.ready()
    assert device.raw(bytes(1000)) == b""
    assert device.read().state == wire.ARMED


def test_a_frame_of_sixteen_bytes_is_taken_and_one_of_seventeen_is_not() -> None:
    device = Device()
    longest = frame(wire.DRIVE, 1, b"\1\1\1\1\1\1\1\1\0")
    assert len(longest) == 16
    assert device.raw(longest) != b""
    assert device.raw(frame(wire.DRIVE, 2, b"\1\1\1\1\1\1\1\1\1\0")) == b""


def test_answers_that_nobody_takes_are_lost_whole() -> None:
    device = Device()
    for number in range(1, 200):
        device.lib.fake_receive(frame(wire.READ, number), 8)
    numbers = [told(each).number for each in payloads(device.sent())]
    assert numbers == list(range(1, len(numbers) + 1))
    assert 2 * 208 // 18 <= len(numbers) < 30
    assert device.read().state == wire.DISARMED


def test_answers_go_out_in_any_pieces() -> None:
    device = Device()
    for _ in range(50):  # round the end of the buffer many times
        device.lib.fake_receive(frame(wire.HELLO, 1, b"\1"), 9)
        whole = b""
        while piece := device.sent(7):
            whole += piece
        [found] = payloads(whole)
        assert told(found).number == 1


# Numbers


@pytest.mark.parametrize(
    ("last", "ahead", "new"),
    [(5, 1, True), (5, 32767, True), (5, 32768, False), (5, 32769, False), (5, 65535, False), (5, 0, False),
     (65535, 1, True), (65000, 32767, True), (65000, 32768, False), (0, 65536 - 1, False)],
)  # fmt: skip
def test_a_frame_is_new_by_its_number(last: int, ahead: int, new: bool) -> None:
    device = Device()
    device.number = (last - 2) & 0xFFFF
    device.ready()
    assert device.number == last
    sample = device.drive(100, 50, number=(last + ahead) & 0xFFFF)
    assert device.outputs() == ([("i", 50), ("v", 100)] if new else [])
    assert (sample.state, sample.refused) == (wire.ARMED, False)


def test_the_first_frame_after_a_boot_is_new_whatever_its_number() -> None:
    for number in (0, 1, 32768, 65535):
        assert Device().ask(wire.ARM, bytes(4), number).refused


@pytest.mark.parametrize("kind", sorted(BODIES.keys() - {wire.HELLO}))
def test_one_that_is_not_new_has_no_effect_and_is_answered_with_a_sample(kind: int) -> None:
    device = Device()
    device.ready()
    device.drive(100, 50)
    device.events()
    sample = device.ask(kind, BODIES[kind], device.number)
    assert isinstance(sample, wire.Sample)
    assert (sample.state, sample.refused, device.outputs()) == (wire.ARMED, False, [])


def test_hello_is_always_new_and_numbers_go_on_from_it() -> None:
    device = Device()
    device.ready()
    assert device.ask(wire.HELLO, b"\1", device.number - 1).session == 0xC0FFEE
    device.number -= 1
    device.events()
    assert device.arm().state == wire.ARMED
    assert device.drive(1, 1).state == wire.ARMED
    assert device.outputs()[-2:] == [("i", 1), ("v", 1)]


def test_a_frame_that_was_refused_has_taken_its_number() -> None:
    device = Device()
    assert device.drive(1, 1, number=9).refused
    assert not device.drive(1, 1, number=9).refused  # not new any more
