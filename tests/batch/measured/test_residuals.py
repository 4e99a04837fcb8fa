"""Residuals of a log: their sizes, what they follow, and mistakes of the log that are suspected."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from batch.measured.mcap_log import MeasuredSignals
from batch.measured.paired import ComputedChannel
from batch.measured.residuals import Comparison, Residual, compare
from batch.terminal.residuals import residual_lines
from met import cli

TIME = np.arange(2001) / 100.0
COLUMNS = [
    {"channel": f"{joint}.{signal}", "signal": signal, "unit": unit}
    for signal, unit in (("q", "rad"), ("qd", "rad/s"), ("tau", "N*m"))
    for joint in ("luff", "fold")
]

Numbers = dict[str, np.ndarray]


def run() -> Numbers:
    """Two joints that move by sums of sines, under gravity."""
    out: Numbers = {}
    for joint, w, v in (("luff", 1.3, 0.4), ("fold", 2.1, 0.7)):
        q = 0.5 * np.sin(w * TIME) + 0.3 * np.sin(v * TIME)
        qd = 0.5 * w * np.cos(w * TIME) + 0.3 * v * np.cos(v * TIME)
        qdd = -0.5 * w * w * np.sin(w * TIME) - 0.3 * v * v * np.sin(v * TIME)
        out |= {f"{joint}.q": q, f"{joint}.qd": qd, f"{joint}.tau": 3.0 * qdd + 20.0 * np.cos(q)}
    return out


def compared(change: Callable[[Numbers], None], noise: float = 0.01, time: np.ndarray = TIME) -> Comparison:
    """A log of the run, with noise, after a change."""
    draw = np.random.default_rng(4)
    measured = {name: each + noise * each.std() * draw.standard_normal(len(each)) for name, each in run().items()}
    change(measured)
    courses = {name: ComputedChannel(TIME, each) for name, each in run().items()}
    log = MeasuredSignals({name: (time, each) for name, each in measured.items()}, [], [])
    return compare(courses, COLUMNS, ["luff", "fold"], log)


def untouched(measured: Numbers) -> None:
    """Changes nothing."""


def of(found: Comparison, channel: str) -> Residual:
    return next(each for each in found.residuals if each.channel == channel)


def test_equal_columns_that_fit_to_the_last_bit_are_not_doubted() -> None:
    """As the torques of two idle joints in a run's own export."""
    exact = run() | {"luff.tau": np.zeros(len(TIME)), "fold.tau": np.zeros(len(TIME))}
    courses = {name: ComputedChannel(TIME, values) for name, values in exact.items()}
    log = MeasuredSignals({name: (TIME, values) for name, values in exact.items()}, [], [])
    comparison = compare(courses, COLUMNS, ["luff", "fold"], log)
    assert not comparison.doubts
    assert all(residual.rms == 0.0 for residual in comparison.residuals)


def test_noise_is_white_and_follows_nothing() -> None:
    found = compared(untouched)
    assert all(each.white and not each.explained for each in found.residuals)
    assert all(0.009 < each.rms / each.spread < 0.011 for each in found.residuals)
    assert (found.doubts, found.gaps, found.missing) == ((), (), ())


def test_a_channel_without_a_number_that_can_be_squared_is_left_out_and_counted() -> None:
    def change(measured: Numbers) -> None:
        measured["luff.q"][:] = 1e200

    found = compared(change)
    assert found.left_out == len(TIME) and "luff.q" not in [each.channel for each in found.residuals]


def test_sizes_are_those_of_measured_less_computed() -> None:
    def change(measured: Numbers) -> None:
        measured["luff.q"] += 0.1
        measured["luff.q"][700] += 1.0

    found = of(compared(change, noise=0.0), "luff.q")
    assert [found.mean, found.largest, found.at] == pytest.approx([0.1 + 1.0 / 2001, 1.1, 7.0])
    assert found.rms == pytest.approx(np.sqrt((2000 * 0.01 + 1.21) / 2001))


@pytest.mark.parametrize(
    ("what", "added", "size"),
    [
        ("the sign of luff.qd", lambda run: 2.0 * np.sign(run["luff.qd"]), 2.0),
        ("luff.qd", lambda run: 3.0 * run["luff.qd"], 3.0),
        ("the rate of luff.qd", lambda run: 1.5 * np.gradient(run["luff.qd"], TIME), 1.5),
        ("sine and cosine of luff.q", lambda run: 5.0 * np.sin(run["luff.q"]), None),
        ("luff.tau itself", lambda run: 0.2 * run["luff.tau"], 0.2),
        ("the rate of luff.tau", lambda run: -0.05 * np.gradient(run["luff.tau"], TIME), 0.05),
    ],
)
def test_what_a_torque_lacks_is_found(what: str, added: Callable[[Numbers], np.ndarray], size: float | None) -> None:
    def change(measured: Numbers) -> None:
        measured["luff.tau"] += added(run())

    found = compared(change)
    first = of(found, "luff.tau").explained[0]
    assert first.what == what or (what in first.alike and first.share > 0.9)
    assert not of(found, "fold.tau").explained
    if first.what == what and size is not None:
        assert first.size == pytest.approx(size, rel=0.06)


def test_friction_and_a_payload_are_told_apart() -> None:
    def change(measured: Numbers) -> None:
        measured["luff.tau"] += 2.0 * np.sign(run()["luff.qd"]) + 6.0 * np.sin(run()["luff.q"])

    explained = of(compared(change), "luff.tau").explained
    assert {each.what for each in explained} == {"the sign of luff.qd", "sine and cosine of luff.q"}
    assert sum(each.share for each in explained) > 0.98


def test_a_few_outliers_hide_nothing() -> None:
    def change(measured: Numbers) -> None:
        measured["luff.tau"] += 2.0 * np.sign(run()["luff.qd"])
        measured["luff.tau"][[100, 1500]] += 5000.0

    found = of(compared(change), "luff.tau")
    assert (found.outliers, found.largest > 4000.0, found.explained[0].what) == (2, True, "the sign of luff.qd")


def test_a_channel_that_fits_by_chance_in_one_half_explains_nothing() -> None:
    def change(measured: Numbers) -> None:
        measured["luff.tau"][:126] += 3.0 * run()["luff.qd"][:126]

    assert not of(compared(change), "luff.tau").explained


MISTAKES: list[tuple[Callable[[Numbers], None], str]] = [
    (lambda log: log.update({"luff.q": np.degrees(log["luff.q"])}), "`luff.q` of the log fits read as degrees"),
    (lambda log: log.update({"fold.tau": 1e3 * log["fold.tau"]}), "`fold.tau` of the log fits divided by 1,000"),
    (lambda log: log.update({"fold.qd": -log["fold.qd"]}), "`fold.qd` of the log fits with its sign turned"),
    (lambda log: log.update({"luff.q": log["fold.q"], "fold.q": log["luff.q"]}), "`luff.q` and `fold.q` of the log"),
    (lambda log: log.update({"luff.tau": 50.0 * log["luff.tau"]}), "`luff.tau` of the log is 50 times what was"),
    (lambda log: log.update({"luff.q": log["luff.q"] + 0.2}), "`luff.q` of the log fits with 0.2 rad less: "),
    (lambda log: log.update({"fold.q": np.full(len(TIME), 0.3)}), "`fold.q` of the log does not change"),
]


@pytest.mark.parametrize(("change", "words"), MISTAKES)
def test_a_mistake_of_a_column_is_suspected(change: Callable[[Numbers], None], words: str) -> None:
    (doubt,) = compared(change).doubts
    assert doubt.startswith(words)


@pytest.mark.parametrize(
    ("time", "words"),
    [
        (TIME + 0.12, "the log fits best with its times 0.12 s less"),
        (TIME - 0.12, "the log fits best with its times 0.12 s more"),
        (TIME * 1.02, "the log fits best with its times divided by 1.02"),
        (TIME / 1.02, "the log fits best with its times multiplied by 1.02"),
    ],
)
def test_a_late_clock_and_a_fast_one_are_suspected(time: np.ndarray, words: str) -> None:
    (doubt,) = compared(untouched, time=time).doubts
    assert doubt.startswith(f"{words}: ")


def test_a_clock_that_is_later_than_what_is_tried_is_not_told_as_less() -> None:
    assert not [each for each in compared(untouched, time=TIME + 0.6).doubts if "its times" in each]


def test_a_log_that_goes_on_after_the_run_is_doubted_in_nothing() -> None:
    time = np.concatenate([TIME, TIME + 21.0])
    draw = np.random.default_rng(1).standard_normal(len(TIME))
    log = {name: (time, np.concatenate([each + 0.01 * each.std() * draw, 0.0 * each])) for name, each in run().items()}
    courses = {name: ComputedChannel(TIME, each) for name, each in run().items()}
    found = compare(courses, COLUMNS, ["luff", "fold"], MeasuredSignals(log, [], ["other"]))
    assert (found.doubts, found.left_out) == ((), 6 * len(TIME)) and found.log_span[1] > found.run_span[1]
    words = "\n".join(residual_lines(found))
    assert "nan" not in words and "12,006 of the log's numbers have none" in words and "not used: other" in words


def test_slow_noise_in_a_short_log_is_not_explained() -> None:
    time = TIME[:401]
    draw, slow = np.random.default_rng(2), np.zeros(401)
    for i, each in enumerate(draw.standard_normal(400)):
        slow[i + 1] = 0.99 * slow[i] + each
    courses = {name: ComputedChannel(time, each[:401]) for name, each in run().items()}
    log = MeasuredSignals({"luff.tau": (time, run()["luff.tau"][:401] + slow)}, [], [])
    (found,) = compare(courses, COLUMNS, ["luff", "fold"], log).residuals
    assert found.too_short and not found.explained


def test_few_and_huge_numbers_say_nothing_untrue() -> None:
    courses = {name: ComputedChannel(TIME, each) for name, each in run().items()}
    time = np.array([0.0, 1.0, 2.0])
    log = {"luff.q": (time, np.array([0.1, 0.1, -0.5])), "fold.q": (time, np.array([0.0, 1e200, np.nan]))}
    found = compare(courses, COLUMNS, ["luff", "fold"], MeasuredSignals(log, [], []))
    words = "\n".join(residual_lines(found))
    assert found.doubts == () and "too few" in words and "nan" not in words and "inf" not in words


def test_a_shift_below_an_instant_is_no_doubt() -> None:
    assert not compared(untouched, noise=0.0, time=TIME + 0.004).doubts


def test_gaps_of_a_clock_are_told_and_what_the_log_lacks() -> None:
    def change(measured: Numbers) -> None:
        del measured["fold.tau"]

    found = compared(change, time=np.where(TIME > 9.0, TIME + 0.05, TIME))
    (gap,) = found.gaps
    assert gap == pytest.approx((9.0, 0.06)) and found.missing == ("fold.tau",)
    words = "\n".join(residual_lines(found))
    assert "goes on by 0.01 s, but 0.06 s at 9 s" in words and "not in the log: fold.tau" in words


DECK = """
arm crane { link boom { mass = 4 kg; shape = rod(length = 1 m, along = x); }
            joint luff revolute { parent = base; child = boom; axis = -y; } }
run swing { arm = crane; rates { dynamics = 1 kHz; record = 100 Hz; } duration = 2 s; record = [q, qd];
            environment { gravity = [0, 0, -9.81] m/s^2; } initial { luff.q = -1 rad; } }
"""


@pytest.mark.slow
def test_the_command_reads_a_log_in_its_units(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("crane.ic").write_text(DECK, encoding="utf-8")
    assert cli.main(["run", "crane.ic", "-q", "--no-picture"]) == 0
    assert cli.main(["export", "crane.h5", "-q", "-o", "own.csv"]) == 0
    Path("late.csv").write_text("time [s],luff.q [deg]\n3,1\n4,1\n", encoding="utf-8")
    capsys.readouterr()
    assert cli.main(["residuals", "crane.h5", "own.csv", "--format", "json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [each["rms"] for each in found["residuals"]] == [0.0, 0.0] and found["doubts"] == []
    Path("own.csv").write_text("time [s],luff.q [deg]\n0,-57.29577951308232\n0.01,-57.3\n", encoding="utf-8")
    assert cli.main(["residuals", "crane.h5", "own.csv"]) == 0
    assert "not in the log: luff.qd" in capsys.readouterr().out
    assert cli.main(["residuals", "crane.h5", "late.csv"]) == 2
    assert "has one of the run beside it" in capsys.readouterr().err


def test_a_clock_that_jumped_is_told_from_instants_that_are_missing() -> None:
    (doubt,) = compared(untouched, time=np.where(TIME > 10.0, TIME + 0.05, TIME)).doubts
    assert doubt.startswith("the log fits best with its times after 10 s 0.05 s less: ")

    def forget(measured: Numbers) -> None:
        for name in measured:
            measured[name][1000:1005] = np.nan

    assert not compared(forget).doubts
