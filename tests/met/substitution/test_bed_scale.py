"""Scales of a bed: those that follow from torque, rate and voltage keep every law that both motors obey."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from met.substitution import BEDS
from met.substitution.bed_scale import PARAMETERS, POWERS, BedScale

SCALES = st.floats(min_value=1e-3, max_value=1e3)

LAWS = [
    ("J w' = tau", ["kg*m^2", "rad/s"], ["N*m"]),
    ("F_v w = tau", ["N*m*s/rad", "rad/s"], ["N*m"]),
    ("kt i = tau", ["N*m/A", "A"], ["N*m"]),
    ("kt w = back-EMF", ["N*m/A", "rad/s"], ["V"]),
    ("R i = V", ["ohm", "A"], ["V"]),
    ("V i = tau w", ["V", "A"], ["N*m", "rad/s"]),
    ("w s = angle", ["rad/s", "s"], ["rad"]),
]


@pytest.mark.slow
@pytest.mark.parametrize(("left", "right"), [law[1:] for law in LAWS], ids=[law[0] for law in LAWS])
@given(torque=SCALES, rate=SCALES, voltage=SCALES)
def test_both_sides_of_a_law_have_one_scale(
    left: list[str], right: list[str], torque: float, rate: float, voltage: float
) -> None:
    scale = BedScale(torque, rate, voltage)
    sides = [1.0, 1.0]
    for side, units in enumerate((left, right)):
        for unit in units:
            sides[side] *= float(scale.of(unit))
    assert sides[0] == pytest.approx(sides[1], rel=1e-12)
    assert scale.inertia == pytest.approx(scale.of("kg*m^2"), rel=1e-12)


def test_a_bed_that_is_not_scaled_has_exactly_one_for_all() -> None:
    assert [BedScale().of(unit) for unit in POWERS] == [1.0] * len(POWERS)
    assert all(each.default == 1.0 and each.above == 0.0 for each in PARAMETERS)


def test_all_that_a_bed_takes_from_its_servo_has_a_scale() -> None:
    assert {each.unit for bed in BEDS for each in bed.parameters if each.of_servo} <= set(POWERS)
