"""What a run's instants do not see of a command, a path or a base, and what begins after its end, is warned of."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import met.run as engine
from ic.meaning.checks.sampling import uncarried
from met.content import humps_from_zero, humps_of_turns
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, experiment, shown
from tests.oracles.random_deck import random_deck

TICKS = ("servos = 1 kHz", "servos = 100 Hz")


def under(command: str) -> str:
    return changed(SERVO, ("rate(0.1 rad/s)", command))


def test_a_sine_of_the_ticks_own_frequency_is_seen_as_nothing(tmp_path: Path) -> None:
    servo = under("rate(sine(amplitude = 1 rad/s, frequency = 100 Hz))")
    assert (
        shown(tmp_path, ARM, servo, changed(RUN, TICKS))
        == """\
warning[D335]: the command of servo `drive` swings at 100 Hz, and its servo ticks at 100 Hz: \
what is seen of it swings at 0 Hz
 --> deck.ic:9:58
  |
9 |     command = rate(sine(amplitude = 1 rad/s, frequency = 100 Hz));
  |                                                          ^^^^^^
  = help: let it swing slower than 50 Hz; or give what sees it 1000 Hz, 10 instants a swing or more
"""
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "until"),
    [
        ("ramp(to = 0.1 rad/s, over = 3 s)", "3 s"),
        ("table(times = [0, 0.5, 1.25, 9] s, values = [0, 0.1, 0.2, 0.2] rad/s)", "1.25 s"),
        ("ramp(to = 0.1 rad/s, over = 1.01 s)", None),  # there, or within two hundredths of the run
        ("table(times = [0, 0.5, 9] s, values = [0, 0.1, 0.1] rad/s)", None),
        ("sine(amplitude = 0.1 rad/s, frequency = 1 Hz)", None),
        ("chirp(amplitude = 0.1 rad/s, f0 = 1 Hz, f1 = 2 Hz, over = 3 s)", None),
    ],
)
def test_a_command_that_goes_on_after_the_run_is_told_and_its_remedy_works(
    tmp_path: Path, command: str, until: str | None
) -> None:
    servo, metric = under(f"rate({command})"), "metric last = final { of = hinge.qd; }"
    assert "D349" not in shown(tmp_path, ARM, servo, changed(RUN, ("record = [q];", f"record = [q];  {metric}")))
    run = changed(RUN, ("record = [q];", f"record = [q];  {metric}  require last < 1 rad/s;"))
    said = shown(tmp_path, ARM, servo, run)
    assert said.count("D349") == (until is not None)
    if until is not None:
        assert f"goes on after the run: its last change ends at {until}, and the run at 1 s\n" in said
        (remedy,) = re.findall("`(duration = .*;)`", said)
        assert shown(tmp_path, ARM, servo, changed(run, ("duration = 1 s;", remedy))) == "\n"


@pytest.mark.parametrize("ticks", ["100 Hz", "0.5 Hz"])
def test_of_a_swing_that_no_rate_would_see_no_rate_is_told(tmp_path: Path, ticks: str) -> None:
    """What was found: a traceback for a frequency of which ten times is beyond all numbers."""
    servo = under("rate(sine(amplitude = 1 rad/s, frequency = 1e308 Hz))")
    said = shown(tmp_path, ARM, servo, changed(RUN, (TICKS[0], TICKS[1].replace("100 Hz", ticks))))
    assert said.startswith("warning[D335]: the command of servo `drive` swings at 1e+308 Hz, and its servo ticks at ")
    assert " = help: let it swing slower than " in said and "give what sees it" not in said


def test_a_swing_that_the_histories_would_not_show_is_told_with_a_rate_that_fits(tmp_path: Path) -> None:
    """What was found: 10 Hz that were taken for a standstill in the picture, and a rate that fits no base rate."""
    servo = under("rate(sine(amplitude = 0.1 rad/s, frequency = 9.5 Hz))")
    slow = ("record = 100 Hz", "record = 10 Hz")
    said = shown(tmp_path, ARM, servo, changed(RUN, slow))
    assert (
        "warning[D335]: the command of servo `drive` swings at 9.5 Hz, and the histories have rows at 10 Hz: " in said
    )
    assert "what they show of it, and of what follows it, swings at 0.5 Hz" in said
    assert "let it swing slower than 5 Hz; or record at 100 Hz, 10 instants a swing or more" in said
    odd = changed(RUN, slow, ("dynamics = 1 kHz; servos = 1 kHz", "dynamics = 1050 Hz; servos = 1050 Hz"))
    assert "or record at 105 Hz, 10 instants " in shown(tmp_path, ARM, servo, odd)  # rows end with the run
    assert codes(tmp_path, ARM, servo, changed(odd, ("record = 10 Hz", "record = 105 Hz"))) == []
    assert codes(tmp_path, ARM, servo, changed(RUN, slow, ("record = [q]", "record = []"))) == []


def test_a_rate_that_six_digits_do_not_give_is_told_as_a_share_of_the_base_rate(tmp_path: Path) -> None:
    servo = under("rate(sine(amplitude = 0.1 rad/s, frequency = 9.5 Hz))")
    run = changed(
        RUN, ("dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz", "dynamics = 1050 Hz; servos = 10 Hz; record = 50 Hz")
    )
    assert "or give what sees it (1050/11) Hz, 10 instants " in shown(tmp_path, ARM, servo, run)
    assert codes(tmp_path, ARM, servo, changed(run, ("servos = 10 Hz", "servos = (1050/11) Hz"))) == []


def test_a_pulse_between_ticks_is_told_with_the_ticks_that_would_see_it(tmp_path: Path) -> None:
    servo = under("rate(table(times = [0.502, 0.503, 0.506, 0.507] s, values = [0, 1, 1, 0] rad/s))")
    assert (
        shown(tmp_path, ARM, servo, changed(RUN, TICKS))
        == """\
warning[D336]: the command of servo `drive` has a pulse that is not seen: it is beyond half of its height from 0.5025 s \
to 0.5065 s, and its servo ticks at 0.5 s and 0.51 s
 --> deck.ic:9:34
  |
9 |     command = rate(table(times = [0.502, 0.503, 0.506, 0.507] s, values = [0, 1, 1, 0] rad/s));
  |                                  ^^^^^^^^^^^^^^^^^^^^^^^^^^^^
  = help: let it last longer than 0.01 s
  = help: or give what sees it 250 Hz
"""
    )
    assert codes(tmp_path, ARM, servo, changed(RUN, ("servos = 1 kHz", "servos = 250 Hz"))) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        "rate(step(to = 1 rad/s, at = 1 s))",
        "rate(ramp(to = 1 rad/s, begin = 2 s, over = 1 s))",
        "rate(table(times = [0, 2, 3] s, values = [1, 1, 2] rad/s))",
        "rate(chirp(amplitude = 1 rad/s, f0 = 1 Hz, f1 = 2 Hz, over = 1 s, begin = 1.5 s))",
        "rate(trapezoid(to = 1 rad/s, max_rate = 4 rad/s^2, max_acceleration = 16 rad/s^3, begin = 9 s))",
    ],
)
def test_a_command_that_changes_after_the_end_is_told(tmp_path: Path, command: str) -> None:
    assert codes(tmp_path, ARM, under(command), RUN) == ["D334"]
    assert codes(tmp_path, ARM, under(command), changed(RUN, ("1 s;", "10 s;"))) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        "rate(0.1 rad/s)",
        "rate(step(to = 0 rad/s, at = 5 s))",
        "rate(sine(amplitude = 1 rad/s, frequency = 49 Hz))",
        "rate(sine(amplitude = 0 rad/s, frequency = 490 Hz))",
        "rate(chirp(amplitude = 1 rad/s, f0 = 1 Hz, f1 = 90 Hz, over = 2 s))",
        "rate(table(times = [0, 0.5013, 0.5014, 1] s, values = [0, 0, 1, 1] rad/s))",
        "rate(table(times = [0, 0.5, 0.51, 0.52, 1] s, values = [0, 0, 1, 0, 0] rad/s))",
        "rate(table(times = [0, 1.502, 1.503, 1.504] s, values = [0, 0, 1, 0] rad/s))",
        "rate(table(times = [0.0, 0.501, 0.503, 0.505] s, values = [0, 1, 0.95, 2] rad/s))",
    ],
)
def test_what_the_ticks_carry_is_not_told(tmp_path: Path, command: str) -> None:
    assert codes(tmp_path, ARM, under(command), changed(RUN, TICKS)) in ([["D334"]] if "1.502" in command else [[]])


def test_a_sweep_is_told_of_a_command_that_no_case_sees_change_and_of_the_fastest_swing(tmp_path: Path) -> None:
    late = under("rate(step(to = 1 rad/s, at = 3 s))")
    assert codes(tmp_path, ARM, late, RUN, "sweep s of hold { vary drive.command.at = [2, 3] s; }\n", select="s") == [
        "D334"
    ]
    assert not codes(
        tmp_path, ARM, late, RUN, "sweep s of hold { vary drive.command.at = [0.5, 0.7] s; }\n", select="s"
    )
    fast = under("rate(sine(amplitude = 1 rad/s, frequency = 10 Hz))")
    sweep = "sweep s of hold { vary drive.command.frequency = [10, 60] Hz; }\n"
    assert codes(tmp_path, ARM, fast, changed(RUN, TICKS), sweep, select="s") == ["D335"]


@pytest.mark.parametrize(
    ("times", "where"),
    [
        ("[0.5, 3, 0.7]", "in case #1: it first changes at 3 s"),
        ("[0.5, 4, 0.7, 3]", "in case #1 and others: it first changes at 4 s"),
    ],
)
def test_of_a_sweep_the_first_case_whose_command_begins_after_the_end_is_named(
    tmp_path: Path, times: str, where: str
) -> None:
    late = under("rate(step(to = 1 rad/s, at = 0.5 s))")
    sweep = f"sweep s of hold {{ vary drive.command.at = {times} s; }}\n"
    said = shown(tmp_path, ARM, late, RUN, sweep)
    assert f"warning[D334]: the command of servo `drive` does nothing {where}, and the run ends at 1 s" in said


def test_a_continuous_law_sees_its_command_at_the_dynamics_steps(tmp_path: Path) -> None:
    servo = changed(
        under("rate(sine(amplitude = 1 rad/s, frequency = 600 Hz))"), ("tau_max", "rate = continuous; tau_max")
    )
    said = shown(tmp_path, ARM, servo, changed(RUN, TICKS))
    assert "swings at 600 Hz, and the dynamics steps at 1000 Hz: what is seen of it swings at 400 Hz" in said


def test_a_base_is_seen_at_the_dynamics_steps(tmp_path: Path) -> None:
    base = "base = prescribed { x = sine(amplitude = 1 cm, frequency = 700 Hz); }\n    duration"
    said = shown(tmp_path, ARM, SERVO, changed(RUN, ("duration", base)))
    assert "`x` of the base swings at 700 Hz, and the dynamics steps at 1000 Hz" in said


def test_two_joints_with_one_servo_are_told_once(tmp_path: Path) -> None:
    arm = changed(
        ARM,
        ("    joint hinge", "    link tip { mass = 1 kg; shape = rod(length = 1 m, along = x); }\n    joint hinge"),
        ("axis = z; }\n", "axis = z; }\n    joint wrist revolute { parent = bar; child = tip; axis = y; }\n"),
    )
    servo = under("rate(step(to = 1 rad/s, at = 3 s))")
    assert codes(tmp_path, arm, servo, changed(RUN, ("hinge = drive", "hinge = drive; wrist = drive"))) == ["D334"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100))
def test_humps_of_random_tables_rise_from_their_feet_and_come_back(seed: int) -> None:
    random = np.random.default_rng(seed)
    values = np.round(random.normal(size=12) * 10.0 ** random.uniform(-3.0, 3.0), 4)
    points = list(zip(np.cumsum(random.uniform(0.01, 1.0, 12)).tolist(), values.tolist(), strict=True))
    for hump in humps_of_turns(points):
        assert hump.heights[0] == hump.heights[-1] == 0.0 and hump.impulse > 0.0
        assert (hump.heights >= 0.0).all() and (np.diff(hump.times) >= 0.0).all()


PULSE = "table(times = [0, 0.502, 0.503, 0.516, 0.517] s, values = [0, 0, 2, 2, 0] rad/s)"
"""0.028 rad, and 0.02 rad of ticks at 100 Hz: one is in it."""


def test_a_pulse_of_which_the_ticks_make_less_is_told_with_both_integrals(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, ARM, under(f"rate({PULSE})"), changed(RUN, TICKS))
        == """\
warning[D342]: the command of servo `drive` has a pulse that is seen as another: from 0.502 s to 0.517 s its integral \
is 0.028, and its servo ticks every 0.01 s make it 0.02, 28.6 % less
 --> deck.ic:9:34
  |
9 |     command = rate(table(times = [0, 0.502, 0.503, 0.516, 0.517] s, values = [0, 0, 2, 2, 0] rad/s));
  |                                  ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
  = help: let it begin, turn and end at instants that see it, or last longer
  = help: or give what sees it 500 Hz
"""
    )
    assert codes(tmp_path, ARM, under(f"rate({PULSE})"), changed(RUN, ("servos = 1 kHz", "servos = 500 Hz"))) == []


@pytest.mark.slow
def test_what_is_told_of_a_pulse_is_how_far_the_joint_goes(tmp_path: Path) -> None:
    """An `ideal` servo's way is the integral of the rate that it is asked, whatever its bandwidth."""
    ideal = f"servo drive {{ model = ideal; bandwidth = 100 1/s; command = rate({PULSE}); }}\n"
    for hz, way in ((100, 0.02), (500, 0.028)):
        run = changed(RUN, ("servos = 1 kHz", f"servos = {hz} Hz"), ("1 s;", "2 s;"))
        found = engine.run(experiment(tmp_path, ARM, ideal, run))
        assert found.signals["q"][0, -1, 0] == pytest.approx(way, rel=1e-3)


def test_of_a_position_the_peak_counts_and_of_others_the_integral(tmp_path: Path) -> None:
    peak = "table(times = [0, 0.5, 0.524, 0.55, 1] s, values = [0, 0, 1, 0, 0] {})"
    said = shown(tmp_path, ARM, changed(under(f"position({peak.format('rad')})"), ("kp =", "k_position = 5 1/s; kp =")),
                 changed(RUN, TICKS))  # fmt: skip
    assert "from 0.5 s to 0.55 s its peak is 1, and its servo ticks every 0.01 s make it 0.8333, 16.7 % less" in said
    assert codes(tmp_path, ARM, under(f"rate({peak.format('rad/s')})"), changed(RUN, TICKS)) == []  # 1.3 % of a way


@pytest.mark.parametrize(
    "command",
    [
        "rate(table(times = [0, 0.5, 0.51, 0.53, 0.54] s, values = [0, 0, 1, 1, 0] rad/s))",  # at ticks
        "rate(table(times = [0, 0.503, 0.504, 0.803, 0.804] s, values = [0, 0, 1, 1, 0] rad/s))",  # long
        "rate(table(times = [0, 0.503, 0.504, 1] s, values = [0, 0, 1, 1] rad/s))",  # a step
        "rate(table(times = [0, 0.1, 0.503, 0.506, 0.512, 0.9] s, values = [0, 1, 1, 0.95, 1, 0] rad/s))",  # slight
        "rate(table(times = [0, 0.313, 0.707, 0.913] s, values = [0, 1, -1, 0] rad/s))",  # through zero
    ],
)
def test_pulses_that_the_ticks_carry_are_not_told(tmp_path: Path, command: str) -> None:
    assert codes(tmp_path, ARM, under(command), changed(RUN, TICKS)) == []


def test_a_short_run_is_not_told_of_a_ramp_that_goes_on(tmp_path: Path) -> None:
    servo = under("rate(table(times = [0, 0.1] s, values = [0, 1] rad/s))")
    assert codes(tmp_path, ARM, servo, changed(RUN, TICKS, ("1 s;", "0.1 s;"))) == []


def test_a_command_that_begins_in_a_pulse_is_told(tmp_path: Path) -> None:
    servo = under("rate(table(times = [0.015, 0.016] s, values = [1, 0] rad/s))")
    said = shown(tmp_path, ARM, servo, changed(RUN, TICKS))
    assert (
        "from 0 s to 0.016 s its integral is 0.0155, and its servo ticks every 0.01 s make it 0.02, 29 % more" in said
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100))
def test_integrals_of_random_pulses_are_those_of_a_fine_sum(seed: int) -> None:
    random = np.random.default_rng(seed)
    times = np.concatenate([[0.0], np.sort(random.uniform(0.1, 0.2, 6)), [1.0]])
    values = np.concatenate([[0.0, 0.0], random.uniform(0.5, 2.0, 4) * random.choice([-1.0, 1.0]), [0.0, 0.0]])
    [hump] = humps_from_zero(list(zip(times.tolist(), values.tolist(), strict=True)), 1.0)
    fine = np.linspace(0.0, 1.0, 200_001)
    assert hump.impulse == pytest.approx(np.abs(np.interp(fine, times, values)).sum() * 5e-6, rel=1e-5)
    for found in uncarried(list(zip(times, values, strict=True)), 0.01, 1.0, integral=True):
        if (found.begins, found.ends) == (times[1], times[-2]):
            ticks = np.abs(np.interp(np.arange(100) * 0.01, times, values)).sum() * 0.01
            assert found.seen == pytest.approx(ticks)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(40))
def test_random_sane_decks_are_told_nothing_of_it(tmp_path: Path, seed: int) -> None:
    said = codes(tmp_path, random_deck(seed))
    assert not [code for code in said if code > "D333"], (seed, said)


def test_a_filter_that_passes_more_than_the_ticks_of_its_reader_resolve_is_told_and_its_remedies_work(
    tmp_path: Path,
) -> None:
    def filtered(cutoff: str) -> str:
        return changed(SERVO, ("command", f"sensor qd = low_pass {{ cutoff = {cutoff}; }}\n    command"))

    run = changed(RUN, ("dynamics = 1 kHz; servos = 1 kHz", "dynamics = 2 kHz; servos = 100 Hz"))
    assert shown(tmp_path, ARM, filtered("60 Hz"), run) == """\
warning[D335]: the filter of sensor `qd` of servo `drive` passes 60 Hz, and its servo ticks at 100 Hz: \
what swings faster than 50 Hz is read as slower
 --> deck.ic:9:37
  |
9 |     sensor qd = low_pass { cutoff = 60 Hz; }
  |                                     ^^^^^
  = help: a cut-off frequency of 50 Hz or less; or give what reads it 125 Hz
"""  # fmt: skip
    assert codes(tmp_path, ARM, filtered("50 Hz"), run) == []
    assert codes(tmp_path, ARM, filtered("60 Hz"), changed(run, ("servos = 100 Hz", "servos = 125 Hz"))) == []
    assert codes(tmp_path, ARM, filtered("60 Hz"), changed(run, ("servos = 100 Hz", "servos = continuous"))) == []


def test_the_filter_of_a_links_sensor_is_told_with_the_case_that_widens_it(tmp_path: Path) -> None:
    sensor = "sensor up = accelerometer { link = bar; along = [0, 0, 1]; cutoff = 20 Hz; rate = 100 Hz; }"
    run = changed(RUN, ("record = [q];", f"record = [q];  {sensor}"))
    assert codes(tmp_path, ARM, SERVO, run) == []
    sweep = "sweep wide of hold { vary sensors.up.cutoff = [20, 60, 40] Hz; }\n"
    (found,) = check(tmp_path, ARM, SERVO, run, sweep, select="wide").diagnostics
    assert found.code == "D335" and found.message == (
        "the filter of sensor `up` passes 60 Hz in case #1, and it reads at 100 Hz: "
        "what swings faster than 50 Hz is read as slower"
    )
