"""Margins of a swept loop, as metrics, are those of its closed form, of python-control, and of the runs themselves."""

from __future__ import annotations

import cmath
import math
from pathlib import Path

import numpy as np
import pytest

from batch.terminal.linear import case_lines, linear_lines
from met import run as engine
from met.analysis.linear import metrics
from met.analysis.linear.answers import of_deck
from met.plan import keys
from met.plan.judged import FIGURES
from tests.ic.small_decks import ARM, RUN, SERVO, experiment

KP = (0.1, 0.2, 0.8, 3.2)
STIFF = SERVO.replace("ki = 1 V/rad", "ki = 0 V/rad").replace("kp = 0.1", "kp = 0.05")
STIFF = STIFF.replace("v_max = 24 V", "v_max = 1e9 V").replace("tau_max = 1 N*m", "tau_max = 1e9 N*m")
ASKED = "    linear loop { at = 0.5 s;  open = hinge.servo.voltage; }\n" + "".join(
    f"    metric {name} = {name} {{ of = loop; }}\n" for name in FIGURES if not FIGURES[name].of_way
)
SWEPT = "sweep gains of hold { vary drive.kp = [" + ", ".join(map(str, KP)) + "] V*s/rad; }\n"


def with_entries(run: str, *entries: str) -> str:
    return run.removesuffix("}\n") + "".join(entries) + "}\n"


def answers(folder: Path, *parts: str, select: str) -> engine.Run:
    made = engine.prepare(experiment(folder, *parts, select=[select]))
    rows = np.arange(made.experiment.cases.count)
    return engine.results(made, rows, *metrics.compute(made, rows, threads=1, record=False))


def pole_and_gain(h: float = 1e-3) -> tuple[float, float]:
    """a and b of w+ = a w + b V: a bar on its motor, over one step of Heun's method with the voltage held."""
    N, kt, R = 100.0, 0.05, 1.0
    J = 2.0 * 1.0**2 / 3.0 + N * N * 1e-4
    x = -h * (N * kt) ** 2 / (R * J)
    return 1.0 + x + 0.5 * x * x, h * N * kt / (R * J) * (1.0 + 0.5 * x)


def test_a_swept_rate_loop_has_the_margins_of_its_closed_form(tmp_path: Path) -> None:
    """L = N kp b/(z - a): its size is 1 at one frequency, and it is -1 at the half of the rate alone."""
    found = answers(tmp_path, ARM, STIFF, with_entries(RUN, ASKED), SWEPT, select="gains")
    a, b = pole_and_gain()
    for case, kp in enumerate(KP):
        k = 100.0 * kp * b
        assert found.metrics["gain_margin"][case] == pytest.approx((1.0 + a) / k, rel=1e-9)
        w = math.acos((1.0 + a * a - k * k) / (2.0 * a)) / 1e-3
        turned = math.pi + cmath.phase(k / (cmath.exp(1j * w * 1e-3) - a))
        assert found.metrics["phase_margin"][case] == pytest.approx(turned, rel=1e-8)
        assert found.metrics["delay_margin"][case] == pytest.approx(turned / w, rel=1e-8)
        disk = min(abs(0.5 * (z - a + k) / (z - a - k) / 0.5) for z in np.exp(1j * np.linspace(1e-6, math.pi, 20001)))
        assert found.metrics["disk_margin"][case] == pytest.approx(2.0 * disk, rel=1e-6)
        pole = cmath.log(a - k) * 1e3
        assert found.metrics["damping"][case] == pytest.approx(-pole.real / abs(pole), rel=1e-8)
        assert found.metrics["decay_time"][case] == pytest.approx(-1.0 / pole.real, rel=1e-7)
    assert found.warning == [""] * len(KP)


@pytest.mark.oracle
def test_they_are_those_of_python_control(tmp_path: Path) -> None:
    """The rate a tick late, so that the gain ends within the rate; it is so slow that python-control does not doubt its
    own polynomials."""
    import control

    slow, gains = with_entries(RUN.replace("1 kHz", "100 Hz"), ASKED), (0.1, 0.2, 0.25, 0.3)
    late = STIFF.replace("command =", "sensor qd = tachometer { delay = 1; }  command =")
    found = answers(tmp_path, ARM, late, slow, SWEPT.replace("0.2, 0.8, 3.2", "0.2, 0.25, 0.3"), select="gains")
    a, b = pole_and_gain(1e-2)
    for case, kp in enumerate(gains):
        loop = control.tf([100.0 * kp * b], [1.0, -a, 0.0], 1e-2)
        gain, phase, *_ = control.stability_margins(loop)[:2]
        assert found.metrics["gain_margin"][case] == pytest.approx(gain, rel=1e-9)
        assert math.degrees(found.metrics["phase_margin"][case]) == pytest.approx(phase, rel=1e-7)


def test_the_gain_at_which_runs_grow_is_where_the_margin_ends(tmp_path: Path) -> None:
    """Just within the margin a swing dies away, just beyond it grows; and then there is no margin."""
    late = "    metric end = peak { of = hinge.qd; }\n    metric last = final { of = hinge.qd; }\n"
    run = with_entries(RUN, ASKED, late)
    a, b = pole_and_gain()
    limit = (1.0 + a) / (100.0 * b)
    near = f"sweep near of hold {{ vary drive.kp = [{0.995 * limit!r}, {1.005 * limit!r}] V*s/rad; }}\n"
    found = answers(tmp_path, ARM, STIFF, run, near, select="near")
    assert abs(found.metrics["last"][0] - 0.1) < 0.01 < 1.0 < abs(found.metrics["last"][1])
    assert found.metrics["gain_margin"][0] == pytest.approx(1.0 / 0.995, rel=1e-9)
    assert found.metrics["damping"][0] > 0.0 > found.metrics["damping"][1]
    none = {name: float(found.metrics[name][1]) for name in FIGURES if not FIGURES[name].of_way}
    assert none.pop("damping") == pytest.approx(-math.cos(math.atan2(math.pi, math.log(abs(a - 1.005 * (1 + a))))))
    assert none == {
        "gain_margin": 1.0, "phase_margin": 0.0, "delay_margin": 0.0, "disk_margin": 0.0, "decay_time": math.inf
    }  # fmt: skip


@pytest.mark.slow
def test_a_case_without_an_answer_says_why_and_its_requirement_is_open(tmp_path: Path) -> None:
    """Where the joint breaks away there is no derivative; where it sticks nothing comes back; where a law is at its
    limit neither."""
    rubs = STIFF.replace("command", "f_c = 0.02 N*m; command")
    asked = "    linear loop { open = hinge.servo.voltage; }\n    require phase_margin(loop) > 30 deg;\n"
    swept = "sweep asked of hold { vary drive.command.value = [0, 0.1] rad/s; }\n"
    found = answers(tmp_path, ARM, rubs, with_entries(RUN, asked), swept, select="asked")
    assert np.isnan(found.metrics["loop_phase_margin"]).all()
    assert found.warning == [
        "no answer of `loop` at 0 s: nothing comes back where the loop is opened, as its joint is held, or its law at "
        "its limit",
        "no answer of `loop` at 0 s: an event is in the period there",
    ]
    assert (found.status == engine.DONE).all()


def test_poles_of_an_arm_at_a_limit_or_at_rest_meet_no_requirement(tmp_path: Path) -> None:
    """A motor at its limit pushes whatever comes, and what sticks does not move: nothing there decays in no time."""
    rubs = SERVO.replace("command", "f_c = 0.02 N*m; command")
    asked = "    linear loop { at = 10 ms; }\n    require decay_time(loop) < 1 s;\n    require damping(loop) > 0.5;\n"
    swept = "sweep asked of hold { vary drive.command.value = [0, 1000] rad/s; }\n"
    found = answers(tmp_path, ARM, rubs, with_entries(RUN, asked), swept, select="asked")
    assert np.isnan(found.metrics["loop_decay_time"]).all() and np.isnan(found.metrics["loop_damping"]).all()
    assert found.warning == [
        "no answer of `loop` at 0.01 s: nothing decays or grows there: all of it stays, or is held",
        "no answer of `loop` at 0.01 s: something is at its limit there, so that its poles are not those of its loops",
    ]


def test_a_law_that_ticks_several_times_in_a_period_has_a_gain_alone(tmp_path: Path) -> None:
    slow = (
        with_entries(RUN, ASKED).replace("dynamics = 1 kHz", "dynamics = 500 Hz").replace("record = 100", "record = 50")
    )
    found = answers(tmp_path, ARM, STIFF, slow, select="hold")
    assert found.metrics["gain_margin"][0] > 1.0 and np.isnan(found.metrics["phase_margin"][0])
    (why,) = found.warning
    assert why.endswith("its law ticks several times in a period, and has no phase, delay or disk of one rate")


def test_a_gain_is_told_as_far_as_its_limit_was_looked_for(tmp_path: Path) -> None:
    """A law that ticks several times in a period, with a millionth of the gain of the test before: its limit is a
    million times farther."""
    slow = (
        with_entries(RUN, ASKED).replace("dynamics = 1 kHz", "dynamics = 500 Hz").replace("record = 100", "record = 50")
    )
    soft = STIFF.replace("kp = 0.05", "kp = 5e-8")
    assert answers(tmp_path, ARM, soft, slow, select="hold").metrics["gain_margin"].tolist() == [1e4]
    question = of_deck(experiment(tmp_path, ARM, soft, slow, select=["hold"]))
    found = question.of(0)
    (loop,) = found.loops
    assert loop.gains == (None, None) and loop.searched == 1e4
    assert "  gain   more than 10,000 times" in linear_lines(found)
    assert "  #0    more than 10,000 times" in case_lines(question, [found])


@pytest.mark.slow
def test_they_move_no_bit_and_no_key_of_a_run(tmp_path: Path) -> None:
    """The program is what it is without them; and without them a plan has no word of them."""
    peak = "    metric top = peak { of = hinge.q; }\n"
    bare = experiment(tmp_path, ARM, STIFF, with_entries(RUN, peak), SWEPT, select=["gains"])
    full = experiment(tmp_path, ARM, STIFF, with_entries(RUN, peak, ASKED), SWEPT, select=["gains"])
    assert keys.structure_key(bare.structure) == keys.structure_key(full.structure)
    assert keys.case_ids(bare) == keys.case_ids(full)
    one, other = engine.prepare(bare), engine.prepare(full)
    assert one.code_key == other.code_key
    assert one.result_keys["metrics.top"] == other.result_keys["metrics.top"]
    assert one.work_key != other.work_key
    rows = np.arange(len(KP))
    _, plain = metrics.compute(one, rows)
    _, more = metrics.compute(other, rows)
    assert np.array_equal(plain, more[:, : plain.shape[1]])


@pytest.mark.parametrize("change", [("at = 0.5 s", "at = 0.25 s"), ("gain_margin { of", "disk_margin { of")])
def test_another_question_has_another_key(change: tuple[str, str], tmp_path: Path) -> None:
    text = with_entries(RUN, ASKED)
    one = engine.prepare(experiment(tmp_path, ARM, STIFF, text))
    other = engine.prepare(experiment(tmp_path, ARM, STIFF, text.replace(*change, 1)))
    assert one.code_key == other.code_key and one.work_key != other.work_key
    assert one.result_keys["metrics.gain_margin"] != other.result_keys["metrics.gain_margin"]


def test_a_case_has_the_same_bits_alone_and_among_others(tmp_path: Path) -> None:
    made = engine.prepare(experiment(tmp_path, ARM, STIFF, with_entries(RUN, ASKED), SWEPT, select=["gains"]))
    _, together = metrics.compute(made, np.arange(len(KP)), threads=2)
    for case in reversed(range(len(KP))):
        _, alone = metrics.compute(made, np.array([case]), threads=1)
        assert np.array_equal(alone[0], together[case])


def test_progress_comes_to_the_end_and_never_goes_back(tmp_path: Path) -> None:
    made = engine.prepare(experiment(tmp_path, ARM, STIFF, with_entries(RUN, ASKED), SWEPT, select=["gains"]))
    told: list[int] = []
    metrics.compute(made, np.arange(len(KP)), progress=told.append)
    assert told == sorted(told) and told[-1] == len(KP) and len(told) > len(KP)
