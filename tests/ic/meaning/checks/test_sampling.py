"""What a run's instants do not see of a command, a path or a base, and what begins after its end, is warned of."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, messages
from tests.oracles.random_deck import random_deck

TICKS = ("servos = 1 kHz", "servos = 100 Hz")


def under(command: str) -> str:
    return changed(SERVO, ("rate(0.1 rad/s)", command))


def shown(folder: Path, *parts: str) -> str:
    """What is said of a deck, without the counting line."""
    return messages(check(folder, *parts, select="all")).rpartition("\n\n")[0] + "\n"


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


@pytest.mark.parametrize(
    "command",
    [
        "rate(step(to = 1 rad/s, at = 1 s))",
        "rate(ramp(to = 1 rad/s, begin = 2 s, over = 1 s))",
        "rate(table(times = [0, 2, 3] s, values = [1, 1, 2] rad/s))",
        "rate(chirp(amplitude = 1 rad/s, f0 = 1 Hz, f1 = 2 Hz, over = 1 s, begin = 1.5 s))",
        "rate(trapezoid(to = 1 rad/s, max_rate = 1 rad/s^2, max_acceleration = 1 rad/s^3, begin = 9 s))",
    ],
)
def test_a_command_that_changes_after_the_end_is_told(tmp_path: Path, command: str) -> None:
    assert codes(tmp_path, ARM, under(command), RUN) == ["D334"]
    assert codes(tmp_path, ARM, under(command), changed(RUN, ("1 s;", "10 s;"))) == []


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
    assert codes(tmp_path, ARM, under(command), changed(RUN, TICKS)) in ([], ["D334"] * ("1.502" in command))


def test_a_sweep_is_told_of_a_command_that_no_case_sees_change_and_of_the_fastest_swing(tmp_path: Path) -> None:
    late = under("rate(step(to = 1 rad/s, at = 3 s))")
    assert codes(tmp_path, ARM, late, RUN, "sweep s of hold { vary drive.command.at = [2, 3] s; }\n", select="s") == [
        "D334"
    ]
    assert not codes(tmp_path, ARM, late, RUN, "sweep s of hold { vary drive.command.at = [0.5, 3] s; }\n", select="s")
    fast = under("rate(sine(amplitude = 1 rad/s, frequency = 10 Hz))")
    sweep = "sweep s of hold { vary drive.command.frequency = [10, 60] Hz; }\n"
    assert codes(tmp_path, ARM, fast, changed(RUN, TICKS), sweep, select="s") == ["D335"]


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
        ("axis = z; }\n", "axis = z; }\n    joint wrist revolute { parent = bar; child = tip; axis = z; }\n"),
    )
    servo = under("rate(step(to = 1 rad/s, at = 3 s))")
    assert codes(tmp_path, arm, servo, changed(RUN, ("hinge = drive", "hinge = drive; wrist = drive"))) == ["D334"]


@pytest.mark.parametrize("seed", range(40))
def test_random_sane_decks_are_told_nothing_of_it(tmp_path: Path, seed: int) -> None:
    said = codes(tmp_path, random_deck(seed))
    assert not [code for code in said if code > "D333"], (seed, said)
