"""Answers at random places of shipped decks are what tree, plan and declaration say."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.editor.oracle import asked, shipped


@pytest.mark.release
def test_answers_at_random_places_of_two_decks_are_right() -> None:
    decks = [deck for deck in shipped() if deck.endswith(("two_link.ic", "free_flyer.ic"))]
    roles, wrong = asked(80, 24, decks)
    assert not wrong, wrong
    assert sum(roles.values()) == 80 and len(roles) > 15


LOOPED = """\
deck 2;
unit turn = 360 deg;
unit ozin = 7.061552e-3 N*m;
#include <servos/rigid_gearbox.ic>
arm trio {
    for i in 1 .. 3 {
        link seg_{i} { mass = 1 kg;  shape = rod(length = 0.3 m, along = z); }
    }
    joint j_1 revolute { parent = base;   child = seg_1;  axis = z; }
    for i in 2 .. 3 {
        joint j_{i} revolute { parent = seg_{i-1};  child = seg_{i};  axis = -y;  at = [0, 0, 0.3] m; }
    }
}
servo drive like rigid_gearbox {
    tau_max    = 400 ozin;
    k_position = 6 1/s;
    command = position(trapezoid(to = 0.1 turn, max_rate = 0.1 turn/s, max_acceleration = 1 rad/s^2));
}
default run move {
    arm      = trio;
    servos   { j_1 = drive;  j_2 = drive;  j_3 = drive; }
    initial  { j_2.q = command;  j_3.q = command; }
    rates    { dynamics = 1 kHz;  servos = 500 Hz;  record = 100 Hz; }
    duration = 2 s;
    record   = [j_2.q, j_3.servo.voltage, links.seg_3.position];
    metric late = final { of = abs(j_2.q - j_2.servo.command); }
    metric lag  = rms { of = j_3.q - j_3.servo.command; }
    require late < 0.01 turn;
}
sweep heavy of move { vary links.seg_3.mass = [3, 6] kg; }
tune gains of move { choose drive.kp = between(0.01, 0.1) V*s/rad;  against heavy;  minimise lag;  at_most = 60; }
"""


@pytest.mark.release
def test_answers_at_every_place_of_a_deck_with_loops_and_units_of_its_own_are_right(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("looped.ic").write_text(LOOPED)
    roles, wrong = asked(1000, 24, ["looped.ic"])
    assert not wrong, wrong
    assert roles["unit of the deck"] == 4 and roles["joint in servos"] == 3
    assert roles["sweep referred to"] == 1 and roles["start as commanded"] == 2


@pytest.mark.release
def test_answers_at_500_random_places_of_all_shipped_decks_are_right() -> None:
    roles, wrong = asked(500, 24, shipped())
    assert not wrong, wrong
    assert sum(roles.values()) == 500 and len(roles) > 30
