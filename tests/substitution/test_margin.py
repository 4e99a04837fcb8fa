"""`met margin` of other commands than a rate, against Routh's criterion, and of arms outside the range it searches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from batch.queries.stability_words import in_words, verdict
from batch.terminal.margin import as_data, margin_lines
from met.analysis.margin import HEAVIEST, LIGHTEST, Margin, margins, remedy
from met.cli import main
from met.plan import Experiment
from tests.substitution.hybrid import compiled, deck, ran

# table 1 of the paper: kt/R, damping Kt^2/R + F_v, J_m; gains of the deck's servo
_PUSH, _DAMPING, _ROTOR = 0.061 / 2.05, 0.061**2 / 2.05 + 2.58e-5, 6.38e-5
_KP, _KI = 0.020, 0.125


# A motor with little inertia and a servo with much gain; 0.3072 kg m^2 are N^2 J_m.
STIFF = """
servo stiff {{
    model = rigid_gearbox;  ratio = 160;  kp = {kp} V*s/rad;  ki = 1.2 V/rad;  k_position = 8 1/s;  v_max = 24 V;
    resistance = 0.6 ohm;  kt = 0.036 N*m/A;  tau_max = 0.4 N*m;  j_m = 1.2e-5 kg*m^2;  f_c = 0 N*m;
    f_v = 3e-6 N*m*s/rad;  command = position(ramp(to = 30 deg, over = 1 s));
}}
let r = 1;
arm one {{
    link beam {{ mass = r * 0.3072 kg;  com = [1, 0, 0] m;  inertia = [1e-9, 1e-9, 1e-9] kg*m^2; }}
    joint hip revolute {{ parent = base;  child = beam;  axis = z; }}
}}
run bench {{
    arm      = one;
    servos   {{ hip = stiff; }}
    rates    {{ dynamics = 500 Hz;  servos = 500 Hz;  record = 500 Hz; }}
    duration = 10 s;
    record   = [hip.servo.voltage];
    substitute hip {{ bed = emulated(delay = 1);  law = torque_balance_observer; }}
}}
sweep arms of bench {{ vary r = {arms}; }}
"""


def _stiff(kp: float, arms: Sequence[float]) -> tuple[Experiment, str]:
    text = STIFF.format(kp=kp, arms=list(arms))
    return compiled(text, "arms"), text


def _one(**more: float | None) -> Margin:
    """Of an arm of r = 1 with a stable stretch from 0.1 to 50, but for `more`."""
    values = {"r": 1.0, "together": 1.0, "least": 1.0, "lower": 0.1, "limit": 50.0, "searched": HEAVIEST} | more
    return Margin(0, "hip", "velocity_tracking", "emulated", 500.0, 1.0, **values)  # type: ignore[arg-type]


def _margin(servo: str, law: str = "velocity_tracking", bed: str = "emulated") -> tuple[Margin, str]:
    experiment = compiled(deck(law=law, bed=bed, duration=0.1, servo={"shoulder": f"told {{ {servo} }}"}), "on_bench")
    found = margins(experiment)
    return found[0][0], "\n".join(margin_lines(experiment, found))


@pytest.mark.release
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


@pytest.mark.slow
def test_under_a_torque_command_the_gains_that_it_does_not_use_do_not_matter() -> None:
    limits = {
        _margin(f"kp = {kp} V*s/rad;  command = torque(1 N*m);", "measured_acceleration")[0].limit for kp in (0.02, 1.0)
    }
    assert len(limits) == 1 and None not in limits
    assert _margin("kp = 1 V*s/rad;", "measured_acceleration")[0].lower > 0.0


@pytest.mark.slow
def test_an_arm_lighter_than_all_that_is_searched_is_not_called_stable_for_that() -> None:
    """A pull of three times J_bed/T turns the shaft's error over at each tick, whatever the arm."""
    one, text = _margin("ratio = 20000;", "velocity_tracking(gain = 3)")
    assert one.r < LIGHTEST
    assert not one.stable
    assert "NONE: unstable" in text


@pytest.mark.slow
def test_an_arm_heavier_than_all_that_is_searched_is_searched_too() -> None:
    one, text = _margin("ratio = 10;")
    assert one.r > HEAVIEST and one.searched == 2.0 * one.r
    assert one.stable and f"more than {one.searched:.4g}" in text


def test_an_arm_whose_r_is_no_number_is_not_called_stable() -> None:
    one = _one(r=np.nan, together=np.nan, least=np.nan, lower=0.0, limit=None)
    assert not one.stable and one.room == 0.0 and verdict(one) == "NONE: r is no number"


@pytest.mark.slow
def test_a_servo_too_stiff_for_a_light_arm_is_stable_with_a_heavier_one_as_in_simulation() -> None:
    arms = (0.02, 0.08, 0.4, 1.6, 6.4)
    experiment, text = _stiff(0.08, arms)
    found = [one for (one,) in margins(experiment)]
    voltage = ran(text, "arms").signals["hip.servo.voltage"].reshape(len(arms), -1)[:, -1000:]
    rings = np.sqrt(np.mean(voltage**2, axis=1))  # V; the arm has been where it was told to go for 7 s
    assert (rings > 4.0).tolist() == [not one.stable for one in found] == [True, True, False, False, False]
    assert (rings[2:] < 1e-9).all()
    for one in found:
        assert one.lower == pytest.approx(0.105, rel=0.01) and one.limit == pytest.approx(99.2, rel=0.01)
        assert one.factor == one.lighter if one.r < 1.0 else one.factor == min(one.r / one.lower, one.limit / one.r)


@pytest.mark.slow
def test_more_gain_of_the_servo_takes_away_from_below_and_not_all_at_once() -> None:
    found = [margins(_stiff(kp, [2.75])[0])[0][0] for kp in (0.076, 0.079, 0.2)]
    assert found[0].lower == 0.0 and 0.05 < found[1].lower < 0.1 and found[2].lower == pytest.approx(3.17, rel=0.01)
    assert [one.stable for one in found] == [True, True, False] and found[2].too_light
    assert found[2].factor == found[2].lighter and found[2].lighter < 1.0 < found[2].heavier  # type: ignore[operator]


@pytest.mark.slow
def test_where_the_arm_is_too_light_the_table_says_from_where_it_would_not_be() -> None:
    experiment, _ = _stiff(0.08, [0.08, 0.4])
    found = margins(experiment)
    assert list(margin_lines(experiment, found)) == [
        "arms: 1 joint on a bed, 2 cases",
        "",
        "  joint  law                       servo  delay     r    stable at r  margin",
        "  hip    torque_balance_observer  500 Hz      1  0.08  0.105 to 99.2  NONE: unstable, too light",
        "",
        "  hip: a lower gain of the servo's rate loop, a faster servo or a heavier arm may help",
        "  hip: not stable in 1 of 2 cases: #0",
        "  each row is the tightest of all cases",
        "  r = J_eff/(N^2 J_m) at the start of the run, each joint by itself; delay in ticks of the servo",
    ]
    rows = as_data(experiment, found)["margins"]
    assert [row["stable"] for row in rows] == [False, True]
    assert rows[1]["lower"] == found[1][0].lower and rows[1]["margin"] == found[1][0].lighter


def test_a_delay_that_no_line_has_is_said() -> None:
    """`met bed run` refuses it there; a servo below 500 Hz is spoken to more often, and has none."""
    experiment = _stiff(0.08, [1.0])[0]
    one = _one()
    said = [
        [line for line in margin_lines(experiment, [[replace(one, **changed)]]) if "refuses" in line]
        for changed in ({}, {"delay": 0.0}, {"delay": 0.0, "rate_hz": 100.0})
    ]
    assert said[0] == said[2] == []
    assert said[1] == [
        "  hip: `met bed run` refuses this delay on a line, where commands act a tick later: "
        "`bed = emulated(delay = 1, ...)`, which has another margin"
    ]


@pytest.mark.parametrize(
    ("one", "said", "sentence", "what_helps"),
    [
        (_one(), "50 times heavier, 10 times lighter", "r = 1, stable from 0.1 to 50", None),
        (_one(limit=None), "10 times lighter", "r = 1, stable from 0.1 to more than 2e+03", None),
        (_one(lower=0.0), "50 times", "r = 1, stable to 50", None),
        (_one(lower=0.0, limit=None), "no limit found", "r = 1, stable to more than 2e+03", None),
        (
            _one(lower=2.0),
            "NONE: unstable, too light",
            "r = 1, stable from 2 to 50",
            "a lower gain of the servo's rate loop, a faster servo or a heavier arm",
        ),
        (
            _one(least=0.05),
            "NONE: unstable, too light",
            "r = 0.05, stable from 0.1 to 50",
            "a lower gain of the servo's rate loop, a faster servo or a heavier arm",
        ),
        (
            _one(together=60.0),
            "NONE: unstable",
            "r = 60, stable from 0.1 to 50",
            "a lighter arm, a faster servo or another law",
        ),
        (
            _one(lower=0.0, limit=0.5),
            "NONE: unstable",
            "r = 1, stable to 0.5",
            "a lighter arm, a faster servo or another law",
        ),
        (
            _one(lower=0.0, limit=0.0),
            "NONE: unstable",
            "r = 1, stable at no r",
            "lower gains, a faster servo or another law",
        ),
    ],
)
def test_a_margin_in_words(one: Margin, said: str, sentence: str, what_helps: str | None) -> None:
    assert verdict(one) == said
    assert in_words(one) == f"hip: {sentence} with velocity_tracking at 500 Hz"
    assert one.stable == (what_helps is None)
    if what_helps is not None:
        assert remedy(one) == what_helps


@pytest.mark.slow
def test_a_limit_of_the_beds_current_is_not_taken_for_stability() -> None:
    """At r = 100 a measured acceleration asks for more than any bed's current: the loop then looks at rest."""
    one, _ = _margin("ratio = 180;", "measured_acceleration")
    limited, _ = _margin("ratio = 180;", "measured_acceleration", "emulated(i_max = 0.01 A)")
    assert one.r == limited.r > 50.0 and one.limit == limited.limit
    assert not one.stable and not limited.stable


def test_a_run_without_a_bed_has_no_margin(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["margin", "panda.ic"]) == 2
    assert capsys.readouterr().err.endswith(
        "error[E333]: no joint is on a bed here\n"
        " = help: a run says so: `substitute JOINT { }`\n"
        " = help: name the run or sweep that does, if it is another one\n"
        "\n1 error\n"
    )
