"""The reasons of a bed's interlock: one name on the wire, in the firmware and for people, each with a remedy."""

from __future__ import annotations

import re
from dataclasses import replace

from hw import refusals
from hw.bed import About, BedSample, BedState, Capability, Fault, InterlockReason, Limits, Scales
from hw.boards.build import FIRMWARE
from hw.driving.loop import _ending
from tests.hw.conftest import said

ABOUT = About(
    "bench", 1, "00" * 8, 1, Capability.INTERLOCK, 1e3, 0.015, Scales(*[1.0] * 6), Limits(20.0, 3.0, 350.0, *[2.0] * 4)
)
SAMPLE = BedSample(BedState.DISARMED, True, Fault(0), True, 5, 0.0)


def test_the_firmware_s_reasons_are_those_of_the_host() -> None:
    text = (FIRMWARE / "core" / "interlock.h").read_text(encoding="utf-8")
    found = {name: 1 << int(bit) for name, bit in re.findall(r"#define INTERLOCK_BY_(\w+) \(1u << (\d+)\)", text)}
    assert found == {str(each.name): int(each) for each in InterlockReason}


def test_each_reason_has_words_and_a_remedy() -> None:
    found = refusals.interlocked(~InterlockReason(0))
    assert len(found) == len(InterlockReason) == len(set(found))
    assert all(what and remedy for what, remedy in found)
    assert refusals.interlocked(None) == []


def test_a_bed_that_does_not_arm_says_by_which_of_its_inputs() -> None:
    why = replace(SAMPLE, interlock=InterlockReason.KEY | InterlockReason.STOP)
    assert said(refusals.refused(ABOUT, "arm", why)) == (
        "error[E406]: bed `bench` does not arm: the emergency stop is pressed, or its wire is off; nobody has turned "
        "its key since it last stopped\n"
        " = help: find out why, then release it\n"
        " = help: turn the key off, then on, at the bed"
    )
    stopped = replace(SAMPLE, state=BedState.STOPPED, faults=Fault.INTERLOCK, interlock=InterlockReason.READY)
    assert said(refusals.refused(ABOUT, "arm", stopped)) == (
        "error[E406]: bed `bench` does not arm: it stopped itself: its interlock stopped it; an amplifier is not "
        "ready\n"
        " = help: read what the amplifier shows; is it switched on?"
    )
    assert said(refusals.refused(ABOUT, "clear", stopped)) == (
        "error[E406]: bed `bench` does not clear: an amplifier is not ready\n"
        " = help: read what the amplifier shows; is it switched on?"
    )


def test_a_run_that_the_interlock_ends_says_why() -> None:
    stopped = replace(SAMPLE, state=BedState.STOPPED, faults=Fault.INTERLOCK, interlock=InterlockReason.ENCODER)
    ended = _ending(7, 0, stopped, True)
    assert ended is not None
    assert ended.why == "the bed stopped itself: interlock; encoder and tachometer do not agree"
