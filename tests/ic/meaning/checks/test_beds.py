"""What the check says of a motor on a bed unasked: what `met margin` says when it is asked, and of whom."""

from __future__ import annotations

from pathlib import Path

import pytest

import ic
from met.analysis.margin import margins
from tests.ic.small_decks import changed

BENCH = """\
#include <servos/rigid_gearbox.ic>
arm one {
    link bar { mass = 1 kg;  com = [0, 0, 0] m;  inertia = [1, 1, 1] kg*m^2; }
    joint swing revolute { parent = base;  child = bar;  axis = z; }
}
servo gearbox like rigid_gearbox { command = rate(0.03 rad/s); }
run bench {
    arm = one;
    servos { swing = gearbox; }
    substitute swing { bed = emulated;  law = measured_acceleration; }
    rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    duration = 2 s;
    record = [q];
}
"""
ROTOR = 1570.0**2 * 6.38e-5
"""N^2 J_m, kg m^2."""


def said(folder: Path, deck: str) -> tuple[list[str], list[str]]:
    """Messages and last helps of the warnings of beds; the deck's margin has to say the same."""
    (folder / "deck.ic").write_text(deck)
    found = ic.check(folder / "deck.ic")
    assert found.plan is not None
    return (
        [each.message for each in found.diagnostics if each.code == "D321"],
        [each.help[-1] for each in found.diagnostics if each.code == "D321"],
    )


@pytest.mark.slow
@pytest.mark.parametrize(("r", "kp", "law", "weight"), [
    (5.30, 0.02, "measured_acceleration", ""),
    (5.40, 0.02, "measured_acceleration", "heavy"),
    (0.53, 1.0, "velocity_tracking", "light"),
    (0.57, 1.0, "velocity_tracking", ""),
])  # fmt: skip
def test_an_arm_beyond_the_limit_is_told_and_one_within_is_not(
    r: float, kp: float, law: str, weight: str, tmp_path: Path
) -> None:
    """A hundredth to each side of the limits of docs/linear.md: 5.35, and 0.548 with a delay of a tick."""
    deck = BENCH.replace("[1, 1, 1]", str([r * ROTOR] * 3)).replace("measured_acceleration", law)
    deck = changed(deck, ("{ command", f"{{ kp = {kp} V*s/rad;  command"))
    if law == "velocity_tracking":
        deck = changed(deck, ("bed = emulated;", "bed = emulated(delay = 1);"))
    messages, _ = said(tmp_path, deck)
    ends = {"": "", "heavy": "r = 5.4, and it is stable up to 5.35", "light": "r = 0.53, and it is stable above 0.548"}
    assert [each.endswith(ends[weight]) for each in messages] == [True] * bool(weight)
    (experiment,) = ic.compile(tmp_path / "deck.ic").experiments
    assert margins(experiment)[0][0].stable == (not weight)


@pytest.mark.slow
def test_of_a_sweep_the_ends_are_looked_at(tmp_path: Path) -> None:
    deck = BENCH.replace("[1, 1, 1] kg*m^2", "[J_bar, J_bar, J_bar]").replace(
        "arm one", f"let J_bar = {0.1 * ROTOR} kg*m^2;\narm one"
    )
    deck += f"sweep heavier of bench {{ vary J_bar = linspace({0.1 * ROTOR}, {9 * ROTOR}, 50) kg*m^2; }}\n"
    messages, helps = said(tmp_path, deck)
    assert len(messages) == 1 and "r = 9" in messages[0]
    assert helps == ["reckoned with the arm as it stands at the start of case #49; 47 of 50 cases were not looked at"]
