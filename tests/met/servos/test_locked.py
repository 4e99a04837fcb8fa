"""A locked joint does not move until it is released, and then it is free."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ic.printing.settings import settings
from met import run as engine
from met.plan import check as plan_check
from met.plan.codec import Damaged
from tests.ic.small_decks import changed, check, experiment, messages
from tests.met.tree_deck import GRAVITY, TREE
from tests.oracles.plan_tree import pinocchio

RUN = f"""\
servo lock {{ model = locked; }}
run it {{
    arm = tree;  servos {{ raise = lock; push = lock; }}
    initial {{ raise.q = 0.4 rad; turn.qd = 1 rad/s; }}
    environment {{ gravity = [{", ".join(map(str, GRAVITY))}] m/s^2; }}
    rates {{ dynamics = 500 Hz; record = 500 Hz; }}
    duration = 0.5 s;  record = [q, qd, qdd, tau];
}}
"""
TURN, RAISE, PUSH, WAG = range(4)


@pytest.mark.oracle
def test_a_locked_joint_stays_and_takes_what_the_arm_puts_on_it(tmp_path: Path) -> None:
    deck = experiment(tmp_path, TREE, RUN)
    found = engine.run(deck).signals
    assert (found["q"][0, :, RAISE] == 0.4).all() and (found["q"][0, :, PUSH] == 0.0).all()
    assert np.ptp(found["q"][0, :, TURN]) > 0.1, "the others move"
    arm = pinocchio(deck, gravity=GRAVITY)
    for q, qd, qdd, tau in zip(*(found[name][0] for name in ("q", "qd", "qdd", "tau")), strict=True):
        # some hundreds of roundings of torques up to 100 N m
        assert np.abs(tau - arm.torques(q, qd, qdd, {})).max() < 1e-11
    assert np.abs(found["tau"][0, :, RAISE]).min() > 1.0


@pytest.mark.slow
def test_once_released_the_joint_is_free(tmp_path: Path) -> None:
    """Released on a step: from there on it is the same run as one that begins in that pose."""
    released = changed(RUN, ("model = locked;", "model = locked; release = 0.2 s;"))
    found = engine.run(experiment(tmp_path, TREE, released)).signals
    q, qd, tau = (found[name][0] for name in ("q", "qd", "tau"))
    assert (q[:101, RAISE] == 0.4).all() and (qd[:101, PUSH] == 0.0).all()
    assert (tau[100:, [RAISE, PUSH]] == 0.0).all() and (tau[:100, [RAISE, PUSH]] != 0.0).all()
    again = (
        "initial {"
        + "".join(
            f"{joint}.q = {q[100, n]!r} {unit}; {joint}.qd = {qd[100, n]!r} {unit}/s; "
            for n, (joint, unit) in enumerate((("turn", "rad"), ("raise", "rad"), ("push", "m"), ("wag", "rad")))
        )
        .replace("np.float64(", "")
        .replace(")", "")
        + "}"
    )
    free = changed(
        RUN,
        ("servos { raise = lock; push = lock; }", ""),
        ("duration = 0.5 s", "duration = 0.3 s"),
        ("initial { raise.q = 0.4 rad; turn.qd = 1 rad/s; }", again),
    )
    expected = engine.run(experiment(tmp_path, TREE, free)).signals["q"][0]
    assert np.abs(q[100:] - expected).max() < 1e-12 * np.abs(expected).max()  # rounding over 150 steps


@pytest.mark.slow
def test_a_release_between_two_steps_waits_for_the_next(tmp_path: Path) -> None:
    runs = [
        engine.run(experiment(tmp_path, TREE, changed(RUN, ("locked;", f"locked; release = {at} ms;")))).signals["q"]
        for at in (199, 200, 201)
    ]
    assert (runs[0] == runs[1]).all() and (runs[1] != runs[2]).any()


def test_the_release_varies_from_case_to_case(tmp_path: Path) -> None:
    sweep = "sweep some of it { vary raise.servo.release = [0, 0.1, 0.3, 9] s; }\n"
    found = engine.run(experiment(tmp_path, TREE, RUN, sweep, select=["some"])).signals["q"][:, :, RAISE]
    begins = [int(np.argmax(one != 0.4)) if (one != 0.4).any() else None for one in found]
    assert begins == [1, 51, 151, None]  # a step after the release


MOVING = changed(RUN, ("turn.qd = 1 rad/s", "raise.qd = 0.1 rad/s"))


def test_a_locked_joint_that_begins_with_a_rate_is_an_error(tmp_path: Path) -> None:
    assert (
        messages(check(tmp_path, TREE, MOVING))
        == """\
error[D119]: joint `raise` begins with a rate, and servo `lock` (locked) needs it at rest
  --> deck.ic:16:45
   |
16 |     initial { raise.q = 0.4 rad; raise.qd = 0.1 rad/s; }
   |                                             ^^^^^^^^^ this is 0.1 rad/s
   = help: leave `raise.qd` out of `initial`
   = help: or give the joint another servo

1 error
"""
    )


def test_so_it_is_in_a_case_of_a_sweep(tmp_path: Path) -> None:
    sweep = "sweep some of it { vary initial.push.qd = [0, 20, 30] cm/s; }\n"
    assert (
        messages(check(tmp_path, TREE, RUN, sweep, select=["some"]))
        == """\
error[D119]: joint `push` begins with a rate, and servo `lock` (locked) needs it at rest; case #1 breaks it, and 1 more
  --> deck.ic:21:25
   |
21 | sweep some of it { vary initial.push.qd = [0, 20, 30] cm/s; }
   |                         ^^^^^^^^^^^^^^^ this is 0.2 m/s
   = help: case #1: initial.push.qd = 20 cm/s
   = help: leave `push.qd` out of `initial`
   = help: or give the joint another servo

1 error
"""
    )


@pytest.mark.slow
def test_a_joint_that_is_free_from_the_start_may_move(tmp_path: Path) -> None:
    free = changed(MOVING, ("raise = lock;", "raise = lock { release = 0 s; };"))
    assert engine.run(experiment(tmp_path, TREE, free)).signals["qd"][0, 0, RAISE] == 0.1


@pytest.mark.parametrize(
    ("sweep", "said"),
    [
        ("", "experiments[0].parameters.initial.raise.qd: a locked joint begins at rest"),
        (
            "sweep some of it { vary initial.turn.qd = [1, 2] rad/s; }\n",
            "experiments[0].parameters.initial.raise.qd: a locked joint begins at rest",
        ),
        (
            "sweep some of it { vary raise.servo.release = [0, 1, 2] s; }\n",
            "experiments[0].parameters.initial.raise.qd: a locked joint begins at rest; in case #1",
        ),
    ],
)
def test_a_plan_by_hand_is_held_to_it_too(tmp_path: Path, sweep: str, said: str) -> None:
    deck = experiment(tmp_path, TREE, RUN, sweep, select=["some"] if sweep else None)
    plan_check.check([deck])
    path = "initial.raise.qd"
    moving = {**deck.parameters, path: replace(deck.parameters[path], value=0.5)}
    with pytest.raises(Damaged) as told_:
        plan_check.check([replace(deck, parameters=moving)])
    assert str(told_.value) == said


def test_a_rate_has_no_meaning_for_a_servo_without_a_computer(tmp_path: Path) -> None:
    text = changed(RUN, ("model = locked;", "model = locked; rate = 1 kHz;"))
    assert (
        messages(check(tmp_path, TREE, text))
        == """\
error[D150]: the model `locked` has no computer that ticks, so no rate
  --> deck.ic:13:30
   |
13 | servo lock { model = locked; rate = 1 kHz; }
   |                              ^^^^
   = help: leave `rate` out

1 error
"""
    )


def test_a_servo_without_a_computer_has_no_rate_to_explain_and_needs_none(tmp_path: Path) -> None:
    deck = experiment(tmp_path, TREE, RUN)
    assert "raise.servo.model" in settings(deck) and "raise.servo.rate" not in settings(deck)
    assert {use.divisor for use in deck.structure.servos} == {deck.structure.schedule.dynamics}
