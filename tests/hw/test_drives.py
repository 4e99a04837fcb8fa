"""What a bed's drive is told: a voltage, a torque or a rate, which the deck's bed model has to send."""

from __future__ import annotations

from dataclasses import replace

import pytest

import ic
from hw.bed import About
from hw.beds import emulated
from hw.beds.emulated import EmulatedBed
from hw.driving import case
from met.diagnostic import Problem
from met.substitution import BEDS
from met.substitution.bed import check
from tests.hw.device import Shaft

DECK = """\
#include <two_link.ic>
run bench like nominal {
    rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
    substitute shoulder { bed = emulated(delay = 1); }
}
"""


def about() -> About:
    values = {"i_max": 3.0}
    return EmulatedBed(Shaft(), emulated.scales(values), emulated.limits(values, 1e-3)).connect()


def test_a_drive_that_takes_a_torque_is_not_sent_voltages() -> None:
    (experiment,) = ic.compile(text=DECK, select=["bench"]).experiments
    case._check_drive(about(), experiment, "shoulder")
    with pytest.raises(Problem) as refused:
        case._check_drive(replace(about(), drive="torque"), experiment, "shoulder")
    (told,) = refused.value.diagnostics
    assert (told.code, told.message) == (
        "E438",
        "bed `emulated` takes a torque, and `emulated` of joint `shoulder` sends it a voltage",
    )
    assert told.help == ("bed models that send a torque: torque_drive",)


def test_a_drive_that_takes_a_torque_is_sent_torques() -> None:
    (experiment,) = ic.compile(text=DECK.replace("emulated(", "torque_drive("), select=["bench"]).experiments
    case._check_drive(replace(about(), drive="torque"), experiment, "shoulder")
    with pytest.raises(Problem, match="takes a voltage, and `torque_drive` of joint `shoulder` sends it a torque"):
        case._check_drive(about(), experiment, "shoulder")


def test_a_bed_model_that_tells_its_drive_a_rate_says_its_torque() -> None:
    wrong = check(replace(BEDS[0], drive="rate"))
    assert wrong is not None
    assert wrong[0] == "declares no memory `motor_torque`, which every bed model has whose drive is told a rate"
