"""Beds whose loop is late, servos slower and faster than the dynamics, drives and amplifiers at their limits."""

from __future__ import annotations

import numpy as np
import pytest

from tests.oracles.worst import Worst
from tests.substitution.hybrid import R, apart, deck, loads, measured, ran, shaft

slow = pytest.mark.slow


@pytest.mark.slow
@pytest.mark.parametrize("law", ["velocity_tracking", pytest.param("torque_balance_observer", marks=slow)])
def test_a_loop_that_is_up_to_three_ticks_late_stays_within_the_limits_at_1_khz(law: str) -> None:
    """From rest: 0.3 % to r = 5, 0.5 % at 20. What is on its way to the bed is known, and reckoned with."""
    text = deck(law=law, sweep=loads(R), swept="vary shoulder.bed.delay = [0, 1, 2, 3];")
    own = ran(text, "own").signals["qd"][:, :, 0]
    late = shaft(ran(text, "bench"), "shoulder").reshape(4, *own.shape)
    for to, limit in ((5.0, 0.3), (20.0, 0.5)):
        worst = Worst(f"{law}, delays 0 to 3, r to {to:g}, %")
        for delay, bench in enumerate(late):
            found = apart(own, bench)
            print(f"delay {delay}: " + " / ".join(f"{each:.3g}" for each in found) + " %")
            for r, each in zip(R, found, strict=True):
                if r <= to:
                    worst.see(each, f"delay {delay}, r = {r:g}")
        worst.below(limit)


@pytest.mark.release
@pytest.mark.parametrize(("servos", "dynamics", "base"), [
    (1000.0, 100.0, None),
    (100.0, 1000.0, None),
    (400.0, 600.0, 1200.0),
    pytest.param(1000.0, 250.0, None, marks=slow),
    pytest.param(250.0, 1000.0, None, marks=slow),
    pytest.param(100.0, 40.0, 200.0, marks=slow),
    pytest.param(100.0, 30.0, 300.0, marks=slow),
])  # fmt: skip
def test_servos_slower_and_faster_than_the_dynamics_and_out_of_step_with_them(
    servos: float, dynamics: float, base: float | None
) -> None:
    """From rest 0.5 % to r = 20, of the run with the same servos and dynamics at 1.2 kHz or 1 kHz."""
    whole = 1000.0 if 1000.0 % servos == 0.0 else 1200.0
    text = deck(servos=servos, dynamics=dynamics, base=base, fast=whole, sweep=loads(R))
    worst = Worst(f"servos {servos:g} Hz, dynamics {dynamics:g} Hz, %")
    for r, each in zip(R, measured("shoulder", 0, text), strict=True):
        worst.see(each, f"r = {r:g}")
    worst.below(0.5)


TURNING = "table(times = [0, 0.9995, 1, 2] s, values = [0.3 rad/s, 0.3 rad/s, -0.3 rad/s, -0.3 rad/s])"
AMPLIFIERS = "record += [shoulder.bed.drive_voltage, shoulder.bed.load_current];"


@pytest.mark.slow
def test_a_drive_at_its_limits_is_followed() -> None:
    """Ten times the rate, then back: the voltage stays at 20 V and the motor's torque at 0.144 N m most of the time.

    0.5 % of the commanded 0.3 rad/s; the arms of r = 5 and 20 stay far below it, as on their own motor.
    """
    text = deck(command=TURNING, duration=2.0, sweep=loads(R), hybrid=AMPLIFIERS)
    own, bench = ran(text, "own"), ran(text, "bench")
    at_limit = (np.abs(bench.signals["shoulder.bed.drive_voltage"]) >= 20.0).mean(axis=1)
    assert (at_limit > 0.3).all()
    worst = Worst("at the drive's limits, %")
    found = apart(own.signals["qd"][:, :, 0], shaft(bench, "shoulder"), rate=0.3)
    for r, each in zip(R, found, strict=True):
        worst.see(each, f"r = {r:g}")
    worst.below(0.5)


@pytest.mark.slow
def test_a_load_amplifier_at_its_limit_holds_it_and_the_run_goes_on() -> None:
    """1.2 A are enough for r = 0.5 and not for more: there the load is too light, which no law can help."""
    text = deck(command=TURNING, duration=2.0, sweep=loads(R), hybrid=AMPLIFIERS, bed="emulated(i_max = 1.2 A)")
    own, bench = ran(text, "own"), ran(text, "bench")
    largest = np.abs(bench.signals["shoulder.bed.load_current"]).max(axis=1)
    found = apart(own.signals["qd"][:, :, 0], shaft(bench, "shoulder"), rate=0.3)
    print("currents", largest, "A; apart", found, "%")
    assert largest[0] < 1.2 and found[0] < 0.5
    assert (largest[1:] == 1.2).all() and (found[1:] > 5.0).all()
