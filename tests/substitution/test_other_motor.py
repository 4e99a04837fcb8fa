"""The motor on the bed is not what the servo believes it is: the run is to follow the motor there is."""

from __future__ import annotations

import numpy as np
import pytest

from tests.oracles.worst import Worst
from tests.substitution.hybrid import REVERSING, R, apart, deck, loads, r_of, ran, shaft

KT = 0.061  # N m/A, table 1
RANGE = [*R, *np.geomspace(0.1, 18.0, 12).tolist()]


@pytest.mark.release
@pytest.mark.parametrize(("share", "command"), [
    (0.93, "slow"), (1.07, REVERSING),
    pytest.param(0.93, REVERSING, marks=pytest.mark.slow), pytest.param(1.07, "slow", marks=pytest.mark.slow),
])  # fmt: skip
def test_a_run_follows_the_motor_on_the_bed_and_not_its_data_sheet(share: float, command: str) -> None:
    """kt 7 % off, velocity_tracking at 1 kHz, r to 20: 0.5 % of the run whose arm has this motor itself.

    That run is pure: its servo's kt is the bed's. The nominal run is of the servo as both believe it.
    """
    real = f"{KT * share:.6g} N*m/A"
    common = {"command": command, "sweep": loads(RANGE)}
    bench = shaft(ran(deck(bed=f"emulated(kt = {real})", **common), "bench"), "shoulder")
    pure = ran(deck(servo={"shoulder": f"told {{ kt = {real}; }}"}, **common), "own")
    nominal = ran(deck(**common), "own")
    near, far = (apart(run.signals["qd"][:, :, 0], bench) for run in (pure, nominal))
    how = "from rest" if command == "slow" else "reversing"
    worst = Worst(f"kt {share:g} of what is believed, {how}, against the real motor, %")
    for r, each, other in zip(r_of(pure, 0), near, far, strict=True):
        worst.see(each, f"r = {r:.3g}")
        assert other > 2.0 * each, (r, each, other)
    print(f"against the nominal motor {far.min():.3g} to {far.max():.3g} %; twice as far at least at every r")
    worst.below(0.5)


@pytest.mark.slow
def test_what_the_motor_does_besides_its_data_sheet_is_found_by_the_observer() -> None:
    """kt 7 % low: at a steady rate the unknown torque is what the servo believes of the torque, less what there is."""
    text = deck(
        bed=f"emulated(kt = {KT * 0.93:.6g} N*m/A)",
        sweep=loads([1.5]),
        hybrid="record += [shoulder.bed.drive_voltage, shoulder.law.unknown_torque];",
    )
    run = ran(text, "bench")
    w = run.signals["shoulder.bed.shaft_rate"][0, -500:]
    V, d = (run.signals[f"shoulder.{name}"][0, -500:] for name in ("bed.drive_voltage", "law.unknown_torque"))
    believed, real = (kt * (V - kt * w) / 2.05 for kt in (KT, 0.93 * KT))
    # the voltage of a tick and the rate at its beginning; the observer forgets in about a hundredth of a second
    assert np.mean(d) == pytest.approx(np.mean(real - believed), rel=0.05)
    print(f"unknown torque {np.mean(d):.4g} N m, to be {np.mean(real - believed):.4g} N m")
