"""`met margin` of other commands than a rate, against Routh's criterion, and of arms outside the range it searches."""

from __future__ import annotations

import pytest

from batch.margin import told
from met.cli import main
from met.margin import HEAVIEST, LIGHTEST, Margin, margins
from tests.substitution.hybrid import compiled, deck

# table 1 of the paper: kt/R, damping Kt^2/R + F_v, J_m; gains of the deck's servo
_PUSH, _DAMPING, _ROTOR = 0.061 / 2.05, 0.061**2 / 2.05 + 2.58e-5, 6.38e-5
_KP, _KI = 0.020, 0.125


def _margin(servo: str, law: str = "velocity_tracking") -> tuple[Margin, str]:
    experiment = compiled(deck(law=law, duration=0.1, servo={"shoulder": f"told {{ {servo} }}"}), "on_bench")
    found = margins(experiment)
    return found[0][0], "\n".join(told(experiment, found))


@pytest.mark.parametrize("gain", [1.0, 10.0, 30.0])
def test_under_a_position_command_the_limit_is_that_of_the_position_loop(gain: float) -> None:
    """J s^3 + (D + K kp) s^2 + K (ki + kp k) s + K ki k is stable where (D + K kp)(ki + kp k) > J ki k.

    The bed's filter and ticks lag behind it: by 1 % at k = 30 1/s, whose loop turns at 70 rad/s. As rate command the
    same servo has no limit.
    """
    one, _ = _margin(f"k_position = {gain} 1/s;  command = position(0.1 rad);")
    inertia = (_DAMPING + _PUSH * _KP) * (_KI + _KP * gain) / (_KI * gain)
    assert one.limit == pytest.approx(inertia / _ROTOR - 1.0, rel=0.03)
    assert _margin(f"k_position = {gain} 1/s;  command = rate(slow);")[0].limit is None


def test_under_a_torque_command_the_gains_that_it_does_not_use_do_not_matter() -> None:
    limits = {_margin(f"kp = {kp} V*s/rad;  command = torque(1 N*m);", "measured_acceleration")[0].limit
              for kp in (0.02, 1.0)}  # fmt: skip
    assert len(limits) == 1 and None not in limits
    assert not _margin("kp = 1 V*s/rad;", "measured_acceleration")[0].stable


def test_an_arm_lighter_than_all_that_is_searched_is_not_called_stable_for_that() -> None:
    """A pull of three times J_bed/T turns the shaft's error over at each tick, whatever the arm."""
    one, text = _margin("ratio = 20000;", "velocity_tracking(gain = 3)")
    assert one.r < LIGHTEST
    assert not one.stable
    assert "NONE: unstable" in text


def test_an_arm_heavier_than_all_that_is_searched_is_searched_too() -> None:
    one, text = _margin("ratio = 10;")
    assert one.r > HEAVIEST and one.searched == 2.0 * one.r
    assert one.stable and f"more than {one.searched:.4g}" in text


def test_an_arm_whose_r_is_no_number_is_not_called_stable() -> None:
    one = Margin(0, "a", "velocity_tracking", "emulated", 1000.0, 0.0, float("nan"), float("nan"), float("nan"), 0.0, None, HEAVIEST)
    assert not one.stable


def test_a_run_without_a_bed_has_no_margin(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["margin", "panda.ic"]) == 2
    assert capsys.readouterr().err.endswith(
        "error[E333]: no joint is on a bed here\n"
        " = help: a run says so: `substitute JOINT { }`\n"
        " = help: name the run or sweep that does, if it is another one\n"
        "\n1 error\n"
    )
