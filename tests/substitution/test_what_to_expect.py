"""How near a run with the shoulder's motor on a bed comes to the same run on its own motor: two_link.ic from rest.

Rms over 5 s of (shaft rate/N - rate of the joint on its own motor), as a share of the commanded 0.03 rad/s; friction
on, no faults. The run on its own motor has the same servos, and dynamics at 1 kHz. The limits are those that this
project set itself after a study by an independent model, which has no code in common with it.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.oracles.worst import Worst
from tests.substitution.hybrid import REVERSING, R, deck, loads, measured, r_of, ran

RATES = {"1 kHz": (1000.0, 1000.0), "100/25 Hz": (100.0, 25.0)}  # servos, dynamics
RANGE = sorted({*R, *np.geomspace(0.1, 20.0, 24).tolist()})


def errors(law: str, rates: str, command: str, heaviness: list[float]) -> np.ndarray:
    servos, dynamics = RATES[rates]
    return measured(
        "shoulder", 0, deck(law=law, servos=servos, dynamics=dynamics, command=command, sweep=loads(heaviness))
    )


def told(found: np.ndarray) -> str:
    return " / ".join(f"{each:.3g}" for each in found) + " %"


def test_the_arms_are_as_heavy_as_the_table_says() -> None:
    """1e-3: the arm is no longer quite straight when all its joints have begun to slide."""
    worst = Worst("r of the shoulder, as a share of what was wanted")
    for want, found in zip(R, r_of(ran(deck(sweep=loads(R)), "own"), 0), strict=True):
        worst.see(abs(found / want - 1.0), f"r = {want:g}, found {found:.4g}")
    worst.below(1e-3)


@pytest.mark.release
@pytest.mark.parametrize(("law", "rates", "command", "to", "limit"), [
    ("velocity_tracking", "1 kHz", "slow", 5.0, 0.3),
    ("velocity_tracking", "1 kHz", "slow", 20.0, 0.5),
    ("velocity_tracking", "1 kHz", REVERSING, 20.0, 0.6),
    ("velocity_tracking", "100/25 Hz", "slow", 5.0, 1.2),
    ("velocity_tracking", "100/25 Hz", REVERSING, 5.0, 1.2),
    ("torque_balance", "1 kHz", "slow", 5.0, 1.0),
    ("torque_balance", "1 kHz", "slow", 20.0, 2.0),
    ("torque_balance", "1 kHz", REVERSING, 5.0, 2.5),
    ("torque_balance", "100/25 Hz", "slow", 5.0, 2.0),
    ("torque_balance_observer", "1 kHz", "slow", 20.0, 0.5),
])  # fmt: skip
def test_the_shaft_turns_as_the_joint_would_on_its_own_motor(
    law: str, rates: str, command: str, to: float, limit: float
) -> None:
    found = errors(law, rates, command, RANGE)
    worst = Worst(f"{law}, {rates}, {'from rest' if command == 'slow' else 'reversing'}, r from 0.1 to {to:g}, %")
    for r, each in zip(RANGE, found, strict=True):
        if r <= to:
            worst.see(each, f"r = {r:.3g}")
    print(f"r = {', '.join(f'{r:g}' for r in R)}: {told(found[[RANGE.index(r) for r in R]])}")
    worst.below(limit)


@pytest.mark.slow
def test_torque_balance_reverses_within_its_limit_at_the_loads_of_the_table() -> None:
    """Between them it comes to 2.9 % (r = 12), and so does the independent model."""
    worst = Worst("torque_balance, 1 kHz, reversing, %")
    for r, each in zip(R, errors("torque_balance", "1 kHz", REVERSING, list(R)), strict=True):
        worst.see(each, f"r = {r:g}")
    worst.below(2.5)


@pytest.mark.slow
def test_friction_left_out_of_the_balance_is_too_strong_by_one_plus_r() -> None:
    """`bare` is eq. 10 of the paper as it stands; the figures are the independent model's."""
    found = errors("bare", "1 kHz", "slow", list(R))
    worst = Worst(f"bare ({told(found)}) against 2.3/6.9/26/103 %, as a share")
    for ours, theirs in zip(found, (2.3, 6.9, 26.0, 103.0), strict=True):
        worst.see(abs(ours / theirs - 1.0), f"{theirs} %")
    worst.below(0.1)


@pytest.mark.slow
def test_measured_acceleration_is_as_good_while_it_is_stable_and_fails_beyond() -> None:
    found = errors("measured_acceleration", "1 kHz", "slow", list(R))
    print(f"measured_acceleration: {told(found)}; independent 0.13 / 0.13 / 0.13 / unstable")
    assert (found[:3] < 0.3).all() and found[3] > 10.0
